"""STEP-NC as ISO 14649: project, nested workplans, one machining workingstep for each workingstep of the plan.

The main workplan holds the rapid that brings the first tool and the workplan of the setup. On a machine with rotary
axes the latter has one workplan for each tool axis. Before a fresh cutter there are a message and a program stop.

Units are the defaults of ISO 14649-10 and are not written: mm, m/s for feeds, 1/s for the spindle (negative: a
right-hand cutter seen from the holder). Paths are in workpiece coordinates (no feature placement), at the tool tip.

A rapid inside an operation has the speed ``SPEED_NAME(.RAPID.)``, as the schema requires. The NIST toolkit accepts only
the bare ``.RAPID.`` and refuses this form. Without the word a reader would take the rapid at cutting feed, so the form
of the schema stands here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry.errors import OutputError
from geometry.surfaces.nurbs import NurbsSurface
from geometry.tool_body import ToolBody
from output.header_text import step_title, tool_name
from output.program_grid import GRID, GridArc, check_plan, to_grid
from output.stepnc.common import (
    Curve,
    cutter_diameter,
    fresh_words,
    header_words,
    knots_of,
    operation_words,
    pass_plane_normal,
    path_points,
    region_name,
    region_outline,
    setup_words,
    step_paths,
    stock_box,
    surfaces_of,
    to_and_fro,
    trimmed_circle,
    written_feed,
    written_speed,
)
from output.stepnc.part21 import Part21Writer, Write, quoted, real, reals, refs
from output.workplan import Workplan
from toolpath.workingsteps import TrajectoryKind, Workingstep

_TYPE = {
    TrajectoryKind.RAPID: ".CONNECT.", TrajectoryKind.APPROACH: ".APPROACH.", TrajectoryKind.CUT: ".TRAJECTORY_PATH.",
    TrajectoryKind.CONNECT: ".CONNECT.", TrajectoryKind.LIFT: ".LIFT.",
}
_END = "''"
_M_PER_S = 1.0 / 60_000.0  # m/s of one mm/min


def write_stepnc_arm(plan: Workplan) -> str:
    """The text that ``stream_stepnc_arm`` writes [ISO14649-10]; errors as there."""
    pieces: list[str] = []
    stream_stepnc_arm(plan, pieces.append)
    return "".join(pieces)


def stream_stepnc_arm(plan: Workplan, write: Write) -> None:
    """Write the job as an ISO 14649 Part 21 file, schemas MACHINING_SCHEMA and MILLING_SCHEMA, piece by piece.

    plan  : lengths in mm, setup frame
    write : receives ASCII text; points read back within 0.00005 mm of the plan on each axis

    OutputErrors come from ``output.program_grid.check_plan``, ``grid_path`` and ``stock_box``. The text written until
    then
    is not a valid file.

    Notes
    -----
    Entities follow [ISO14649-10], those of milling [ISO14649-11].
    """
    check_plan(plan)
    _Iso14649Writer(plan, write).run()


class _Iso14649Writer:
    """One file being written; the dictionaries keep equal instances single."""

    def __init__(self, plan: Workplan, write: Write) -> None:
        self.plan = plan
        words = "ISO 14649-10/-11, freeform milling, cutter location paths"
        self.file = Part21Writer(write, description=header_words(plan, words),
                                 name=f"{plan.name}.arm.stpnc", schema=("MACHINING_SCHEMA", "MILLING_SCHEMA"),
                                 system=f"zonemill {plan.version}")
        self.tools: dict[int, int] = {}
        self.technologies: dict[tuple[float, float], int] = {}
        self.groups: dict[str, int] = {}

    def run(self) -> None:
        project, workplan = self.file.reserve(), self.file.reserve()
        self._shared()
        setup = self._setup()
        elements = self._elements(setup)
        self.file.fill(workplan, f"WORKPLAN('main workplan',{refs(elements)},#{self.channel},#{setup},$)")
        self.file.fill(project, f"PROJECT({quoted(self.plan.name)},#{workplan},(#{self.workpiece}),$,$,$)")
        self.file.close()

    def _shared(self) -> None:
        add = self.file.add
        self.origin = add("CARTESIAN_POINT('',(0.,0.,0.))")
        self.up = add("DIRECTION('z',(0.,0.,1.))")
        self.along = add("DIRECTION('x',(1.,0.,0.))")
        self.down = add("DIRECTION('projection',(0.,0.,-1.))")
        top = add(f"CARTESIAN_POINT('',(0.,0.,{real(self.plan.clearance_plane)}))")
        self.secplane = add(f"PLANE('security plane',#{self._placement('security plane placement', top)})")
        self.channel = add("CHANNEL('channel 1')")
        if self.plan.clamping is None:
            self.three_axes = add("THREE_AXES()")
        wet = ".T." if self.plan.coolant else ".F."
        self.functions = add(f"MILLING_MACHINE_FUNCTIONS({wet},$,$,.F.,$,(),.F.,$,$,())")

    def _placement(self, name: str, point: int) -> int:
        return self.file.add(f"AXIS2_PLACEMENT_3D({quoted(name)},#{point},#{self.up},#{self.along})")

    def _setup(self) -> int:
        """Workpiece, stock and setup; returns the SETUP."""
        plan, add = self.plan, self.file.add
        material = add(f"MATERIAL('',{quoted(plan.material)},())")
        raw = add(f"WORKPIECE('stock',#{material},$,$,$,#{self._stock()},())")
        self.workpiece = add(f"WORKPIECE({quoted('part sha256 ' + plan.part_sha256)},#{material},$,#{raw},$,$,())")
        zero = self._placement("setup origin", self.origin)
        notes = [add(f"SETUP_INSTRUCTION({quoted(t)},$)") for t in setup_words(plan)]
        holding = add(f"WORKPIECE_SETUP(#{self.workpiece},#{zero},$,$,{refs(notes)})")
        name = quoted(f"setup {plan.work_offset} sha256 {plan.setup_sha256}")
        return add(f"SETUP({name},#{zero},#{self.secplane},(#{holding}))")

    def _stock(self) -> int:
        """The blank: a cylinder or a block. The block is the bounding box where the blank is neither."""
        add, cylinder = self.file.add, self.plan.cylinder
        if cylinder is not None:
            base = add(f"CARTESIAN_POINT('',{reals(cylinder.base.tolist(), 9)})")
            axis = add(f"DIRECTION('along the stock',{reals(cylinder.axis.tolist(), 9)})")
            return add(f"RIGHT_CIRCULAR_CYLINDER('stock cylinder',#{add(f'AXIS1_PLACEMENT({_END},#{base},#{axis})')},"
                       f"{real(cylinder.height)},{real(cylinder.radius)})")
        low, size = stock_box(self.plan)
        corner = add(f"CARTESIAN_POINT('',{reals(low)})")
        name = "box round the stock" if self.plan.stock_words else "stock block"
        sides = ",".join(real(s) for s in size)
        return add(f"BLOCK('{name}',#{self._placement('stock corner', corner)},{sides})")

    def _elements(self, setup: int) -> list[int]:
        """The main workplan: the rapid from the present tool position, and a workplan for the setup.

        On a machine with rotary axes that contains one workplan for each tool axis, in order.
        """
        first: list[int] = []
        groups: list[tuple[str, list[int]]] = []
        for path in step_paths(self.plan):
            access = path.step.access if self.plan.clamping is not None else ""
            if not groups or groups[-1][0] != access:
                groups.append((access, []))
            mine, name = groups[-1][1], f"rapid to {path.step.id}"
            if path.step.fresh:
                mine += self._pause(path.step)
            if path.fresh:
                arrive = self._rapid(f"rapid to above all for {path.step.id}" if path.before else name, ())
                (mine if first else first).append(arrive)
            if path.before:
                mine.append(self._rapid(name, path.before))
            mine.append(self._workingstep(path.step, path.path))
            if path.after:
                mine.append(self._rapid(f"away from {path.step.id}", path.after))
        inner = groups[0][1] if self.plan.clamping is None else [self._group(a, members) for a, members in groups]
        name = quoted(f"setup {self.plan.work_offset}")
        return [*first, self.file.add(f"WORKPLAN({name},{refs(inner)},#{self.channel},#{setup},$)")]

    def _group(self, access: str, members: list[int]) -> int:
        """The workplan of steps along one tool axis; a repeated axis has a number."""
        again = self.groups[access] = self.groups.get(access, 0) + 1
        name = f"access {access}" if again == 1 else f"access {access} again {again}"
        return self.file.add(f"WORKPLAN({quoted(name)},{refs(members)},#{self.channel},$,$)")

    def _pause(self, step: Workingstep) -> list[int]:
        """Message for a fresh cutter, and a stop."""
        add = self.file.add
        return [add(f"DISPLAY_MESSAGE({quoted(f'fresh cutter for {step.id}')},{quoted(fresh_words(step))})"),
                add(f"PROGRAM_STOP({quoted(f'stop before {step.id}')})")]

    def _rapid(self, name: str, path: Sequence[Curve]) -> int:
        """A rapid; one without a path comes from where the control left the tool."""
        if not path:
            return self.file.add(f"RAPID_MOVEMENT({quoted(name)},#{self.secplane},$,$)")
        numbers = []
        for curve in path:
            first = self.file.points(curve.points)
            line = self.file.add(f"POLYLINE('',{refs(range(first, first + len(curve.points)))})")
            numbers.append(self.file.add(f"CUTTER_LOCATION_TRAJECTORY(.T.,.CONNECT.,$,$,$,$,#{line},"
                                         f"{self._tool_axes(curve)},$)"))
        paths = self.file.add(f"TOOLPATH_LIST({refs(numbers)})")
        return self.file.add(f"RAPID_MOVEMENT({quoted(name)},#{self.secplane},#{paths},{self._direction()})")

    def _tool_axes(self, curve: Curve) -> str:
        """Reference to the tool axes of a curve, one for each point; '$' where they are Z."""
        if curve.axes is None:
            return "$"
        line = f"POLYLINE('',{refs(self.file.vectors(curve.axes))})"
        return f"#{self.file.add(line)}"

    def _workingstep(self, step: Workingstep, path: Sequence[Curve]) -> int:
        add, title = self.file.add, step_title(step)
        operation = self.file.reserve()
        feature = self._region(step, operation)
        paths = self._toolpaths(step, path)
        technology = self._technology(step.spindle_rpm, step.feed)
        self.file.fill(operation, (
            f"FREEFORM_OPERATION(#{paths},{self._direction()},{quoted(operation_words(step))},"
            f"{real(self.plan.clearance_plane)},$,#{self._tool(step.tool)},#{technology},#{self.functions},"
            f"$,$,$,#{self._strategy(step)})"))
        return add(f"MACHINING_WORKINGSTEP({quoted(title)},#{self.secplane},#{feature},#{operation},$)")

    def _normal(self, step: Workingstep) -> list[float]:
        """Normal of the planes of the passes, setup frame."""
        normal = np.array(pass_plane_normal(step))
        clamping = self.plan.clamping
        return (normal if clamping is None else normal @ clamping.frames[step.access].rotation).tolist()

    def _direction(self) -> str:
        """Three axes along Z; '$' where every trajectory has its own tool axis, which overrides it."""
        return f"#{self.three_axes}" if self.plan.clamping is None else "$"

    def _region(self, step: Workingstep, operation: int) -> int:
        """The exact faces, or the area in plan and its depth.

        A flat area has the depth of one grid step, since the schema requires a positive value.
        """
        if faces := surfaces_of(self.plan, step):
            surfaces = [self._surface(f"F{number}", surface) for number, surface in faces]
            return self.file.add(f"REGION_SURFACE_LIST({quoted(region_name(step))},#{self.workpiece},(#{operation}),$,"
                                 f"{refs(surfaces)})")
        clamping = self.plan.clamping
        rotation = None if clamping is None else clamping.frames[step.access].rotation
        outline = region_outline(step, rotation)
        first = self.file.points(outline[:-1])
        loop = [*range(first, first + len(outline) - 1), first]
        curve = self.file.add(f"POLYLINE({quoted('outline of ' + step.id)},{refs(loop)})")
        width = real(max(step.chordal_tolerance, GRID))
        tolerance = self.file.add(f"PLUS_MINUS_VALUE({width},{width},4)")
        depth = self.file.add(f"TOLERANCED_LENGTH_MEASURE({real(max(step.top - step.bottom, GRID))},#{tolerance})")
        down = self.down
        if rotation is not None and rotation[2, 2] < 1.0:
            down = self.file.add(f"DIRECTION('projection',{reals((-rotation[2]).tolist(), 9)})")
        return self.file.add(f"REGION_PROJECTION({quoted(region_name(step))},#{self.workpiece},(#{operation}),$,"
                             f"#{curve},#{down},#{depth})")

    def _surface(self, name: str, surface: NurbsSurface) -> int:
        """A face as a B-spline surface. One without inner knots is a Bezier surface, which more readers know."""
        add, (n, m) = self.file.add, surface.control.shape[:2]
        first = self.file.points(to_grid(surface.control.reshape(-1, 3)))
        net = "(" + ",\n".join(refs(range(first + i * m, first + (i + 1) * m)) for i in range(n)) + ")"
        k, j = surface.orders
        form = ".RULED_SURF." if (k == 2 and n == 2) or (j == 2 and m == 2) else ".UNSPECIFIED."
        net = f"{k - 1},{j - 1},{net},{form},.F.,.F.,.U."
        (times_u, at_u), (times_v, at_v) = knots_of(surface.knots_u), knots_of(surface.knots_v)
        plain = surface.weights is None
        if plain and len(at_u) == len(at_v) == 2:
            return add(f"BEZIER_SURFACE('{name}',{net})")
        times = ",".join("(" + ",".join(map(str, t)) + ")" for t in (times_u, times_v))
        knots = f"{times},{reals(at_u, 9)},{reals(at_v, 9)},.UNSPECIFIED."
        if surface.weights is None:
            return add(f"B_SPLINE_SURFACE_WITH_KNOTS('{name}',{net},{knots})")
        rows = ",\n".join(reals(row, 9) for row in surface.weights.tolist())
        # most readers sort the underscore before the letters
        return add(f"(B_SPLINE_SURFACE({net}) B_SPLINE_SURFACE_WITH_KNOTS({knots}) BOUNDED_SURFACE() "
                   f"GEOMETRIC_REPRESENTATION_ITEM() RATIONAL_B_SPLINE_SURFACE(({rows})) "
                   f"REPRESENTATION_ITEM('{name}') SURFACE())")

    def _toolpaths(self, step: Workingstep, path: Sequence[Curve]) -> int:
        """A trajectory for each planned one; a trajectory with arcs becomes one for each arc and each line."""
        at, numbers = self.file.points(path_points(path)), []
        for curve in path:
            trajectory = curve.trajectory
            rapid = trajectory.motion is TrajectoryKind.RAPID
            speed = "SPEED_NAME(.RAPID.)" if rapid else "$"
            for part in curve.parts():
                if isinstance(part, GridArc):
                    line = trimmed_circle(self.file, part, at, self.up, self.along)
                    at += 1
                else:
                    line = self.file.add(f"POLYLINE('',{refs(range(at, at + len(part)))})")
                    at += len(part) - 1
                own = "$" if rapid or written_feed(trajectory.feed) == written_feed(step.feed) else \
                    f"#{self._technology(step.spindle_rpm, trajectory.feed)}"
                numbers.append(self.file.add(f"CUTTER_LOCATION_TRAJECTORY(.T.,{_TYPE[trajectory.motion]},{speed},{own},"
                                             f"$,$,#{line},{self._tool_axes(curve)},$)"))
        if not numbers:
            raise OutputError(f"{step.id} does not move", code="empty_step", subjects=(step.id,))
        return self.file.add(f"TOOLPATH_LIST({refs(numbers)})")

    def _technology(self, rpm: float, feed: float) -> int:
        key = written_speed(rpm), written_feed(feed)
        if key not in self.technologies:
            self.technologies[key] = self.file.add(
                f"MILLING_TECHNOLOGY({real(key[1] * _M_PER_S, 12)},.TCP.,$,{real(-key[0] / 60.0, 9)},$,.F.,.F.,.F.,$)")
        return self.technologies[key]

    def _tool(self, tool: ToolBody) -> int:
        """A tool, one for the whole file; angles are degrees. A tapered mill of any end is a TAPERED_ENDMILL.

        The standard has no circle segment mill: it is written as the bull nose of its diameter and corner, with its
        profile in the name.
        """
        if tool.number not in self.tools:
            add, ball = self.file.add, tool.end == "ball"
            edge = tool.radius if ball else tool.corner_radius
            angle = real(tool.taper_deg, 6) if tool.taper else "$"
            size = add(f"MILLING_TOOL_DIMENSION({real(cutter_diameter(tool), 6 if tool.taper else 4)},$,{angle},"
                       f"{real(tool.flute_length)},{real(edge, 6)},{real(edge, 6)},"
                       f"{real(0.0 if ball else tool.radius - edge, 6)})")
            # ENDMILL is abstract to some readers; a bull nose with edge radius 0 is a flat end mill to all
            known = self.plan.assembly(tool)
            teeth = "$" if known.teeth is None else str(known.teeth)
            kind = "TAPERED_ENDMILL" if tool.taper else "BALL_ENDMILL" if ball else "BULLNOSE_ENDMILL"
            body = add(f"{kind}(#{size},{teeth},.RIGHT.,.F.,$" + (f",{angle})" if tool.taper else ")"))
            length, life = real(known.gauge_length), "$" if known.life is None else real(60.0 * known.life)
            part = add(f"CUTTING_COMPONENT({length},$,$,{life},$)")
            self.tools[tool.number] = add(f"MILLING_CUTTING_TOOL({quoted(tool_name(tool))},#{body},(#{part}),{length},"
                                          "$,$)")
        return self.tools[tool.number]

    def _strategy(self, step: Workingstep) -> int:
        """For information: planes or parameters of the passes, tolerance, scallop and side step."""
        add = self.file.add
        tolerances = add(f"TOLERANCES({real(step.chordal_tolerance, 6)},{real(step.scallop_height, 6)})")
        mode = ".ZIGZAG." if to_and_fro(step) else ".FORWARD."
        cut = ".CLIMB." if step.cut_direction.climbs else ".CONVENTIONAL."
        side = real(step.side_step) if step.side_step > 0.0 else "$"
        if step.strategy == "isoparametric":
            along = add(f"DIRECTION('along the passes in parameters',{reals((1.0, 0.0, 0.0), 6)})")
            across = add(f"DIRECTION('across the passes in parameters',{reals((0.0, 1.0, 0.0), 6)})")
            return add(f"UV_STRATEGY({mode},{cut},#{tolerances},{side},#{along},#{across})")
        plane = add(f"DIRECTION('normal of the pass planes',{reals(self._normal(step), 6)})")
        return add(f"PLANE_CL_STRATEGY({mode},{cut},#{tolerances},{side},#{plane})")
