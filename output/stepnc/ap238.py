"""STEP-NC as AP238 (ISO 10303-238): a toolpath for every operation, streamed.

Every parameter of the application model is a property with a representation; the strings are those of clause 5.1 of the
standard. The file states its units: mm, mm/min, rev/min (negative: a right-hand cutter seen from the holder). Rapids
are
toolpaths of their operation with the speed profile 'rapid', also those to it and away from it. Before a fresh cutter
there are a message and a program stop.

The purpose of a file (``output.workplan.Ap238``) decides its content. Conformance class 1 has tool paths, one workplan
and no shape. By clause 6.2 explicit tool paths have no strategy, so its figures are in the purpose of the operation.
Class 2 adds part and stock as shapes, the strategies and the setup instructions. Blocks and cylinders have their sizes;
other shapes are triangles, with faces named as in the report. Readers of the first edition get class 1 under its schema
name.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry.errors import OutputError
from geometry.mesh import F64, TriangleMesh
from geometry.tool_body import ToolBody
from output.header_text import decimal, height_word, short_words, step_title, tool_name
from output.program_grid import I64, GridArc, check_plan
from output.stepnc.common import (
    Curve,
    cutter_diameter,
    fresh_words,
    header_words,
    operation_words,
    pass_plane_normal,
    path_points,
    region_name,
    setup_words,
    step_paths,
    stock_box,
    to_and_fro,
    trimmed_circle,
    written_feed,
    written_speed,
)
from output.stepnc.part21 import Part21Writer, Write, quoted, real, reals, refs
from output.workplan import Ap238, Workplan
from toolpath.workingsteps import Trajectory, TrajectoryKind, Workingstep

_KIND = {"ball": "ballnose endmill", "bull": "bullnose endmill", "flat": "endmill"}
_USER_DEFINED = "user defined milling tool"  # the standard has no tapered end mill since its second edition
_OLD_KIND = {"ball": "ball endmill"}  # names in the first edition that differ
_OLD_TAPERED = "tapered endmill"
_DEGREE = 0.0174532925199433  # rad
_TYPE = {
    TrajectoryKind.RAPID: "connect", TrajectoryKind.APPROACH: "approach", TrajectoryKind.CUT: "trajectory path",
    TrajectoryKind.CONNECT: "connect", TrajectoryKind.LIFT: "lift",
}
_NONE = "''"
_CLT = "'cutter location trajectory'"
_SCHEMA = {
    Ap238.CC1: "model_based_integrated_manufacturing_schema",
    Ap238.CC2: "model_based_integrated_manufacturing_schema",
    Ap238.INTEGRATED_CNC: "integrated_cnc_schema",
}


def write_stepnc_aim(plan: Workplan) -> str:
    """The text that ``stream_stepnc_aim`` writes [ISO10303-238]; errors as there."""
    pieces: list[str] = []
    stream_stepnc_aim(plan, pieces.append)
    return "".join(pieces)


def stream_stepnc_aim(plan: Workplan, write: Write) -> None:
    """Write the job as an AP238 Part 21 file, piece by piece.

    plan  : lengths in mm, setup frame; ``plan.ap238`` is the purpose of the file
    write : receives ASCII text; points read back within 0.00005 mm of the plan on each axis

    OutputErrors come from ``output.program_grid.check_plan``, ``grid_path`` and ``stock_box``. The text written until
    then
    is not a valid file.

    Notes
    -----
    Entities, attributes and strings follow [ISO10303-238]; the numbers of the process follow [ISO14649-10].
    """
    check_plan(plan)
    _Ap238Writer(plan, write).run()


class _Ap238Writer:
    """One file being written; the dictionaries keep equal instances single."""

    def __init__(self, plan: Workplan, write: Write) -> None:
        self.plan = plan
        self.shapes = plan.ap238 is Ap238.CC2
        self.schema = _SCHEMA[plan.ap238]
        words = f"AP238 freeform milling, conformance class {2 if self.shapes else 1}, cutter location paths"
        self.file = Part21Writer(write, description=header_words(plan, words), name=f"{plan.name}.stpnc",
                           schema=(self.schema.upper(),), system=f"zonemill {plan.version}")
        self.symbols: dict[str, int] = {}
        self.technologies: dict[tuple[float, float], int] = {}
        self.tools: dict[int, tuple[int, ToolBody, list[int]]] = {}
        self.elements = 0

    def run(self) -> None:
        self._contexts()
        self._units_of_rates()
        self._project()
        self._setup()
        self._functions()
        for path in step_paths(self.plan):
            if all(len(c.points) < 2 for c in path.path):
                raise OutputError(f"{path.step.id} does not move", code="empty_step", subjects=(path.step.id,))
            if path.step.fresh:
                self._pause(path.step)
            self._element(self._workingstep(path.step, [*path.before, *path.path, *path.after]))
        for number, tool, operations in self.tools.values():
            self._tool(number, tool, operations)
        self.file.close()

    def _contexts(self) -> None:
        add = self.file.add
        application = add("APPLICATION_CONTEXT('Application protocol for the exchange of CNC data')")
        year = 2007 if self.plan.ap238 is Ap238.INTEGRATED_CNC else 2022
        add(f"APPLICATION_PROTOCOL_DEFINITION('international standard','{self.schema}',{year},#{application})")
        self.product_context = add(f"PRODUCT_CONTEXT('CNC Machining',#{application},'manufacturing')")
        self.view = add(f"PRODUCT_DEFINITION_CONTEXT('CNC Machining',#{application},'manufacturing')")
        self.plain = add("REPRESENTATION_CONTEXT('','units not necessary')")
        self.mm = add("(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.))")
        self.radian = add("(NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.))")
        self.degree: int | None = None  # written where a tool has an angle
        steradian = add("(NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT())")
        self.space = add(f"(GEOMETRIC_REPRESENTATION_CONTEXT(3) "
                         f"GLOBAL_UNIT_ASSIGNED_CONTEXT((#{self.mm},#{self.radian},#{steradian})) "
                         f"REPRESENTATION_CONTEXT('','3D'))")
        self.up = add("DIRECTION('',(0.,0.,1.))")
        self.along = add("DIRECTION('',(1.,0.,0.))")
        origin = add("CARTESIAN_POINT('',(0.,0.,0.))")
        self.zero = self._placement("orientation", origin)

    def _placement(self, name: str, point: int) -> int:
        return self.file.add(f"AXIS2_PLACEMENT_3D({quoted(name)},#{point},#{self.up},#{self.along})")

    def _units_of_rates(self) -> None:
        add = self.file.add
        second = add("(NAMED_UNIT(*) SI_UNIT($,.SECOND.) TIME_UNIT())")
        sixty = add(f"TIME_MEASURE_WITH_UNIT(TIME_MEASURE(60.),#{second})")
        time = add("DIMENSIONAL_EXPONENTS(0.,0.,1.,0.,0.,0.,0.)")
        none = add("DIMENSIONAL_EXPONENTS(0.,0.,0.,0.,0.,0.,0.)")
        self.minute = add(f"(CONVERSION_BASED_UNIT('minute',#{sixty}) NAMED_UNIT(#{time}) TIME_UNIT())")
        turn = add(f"CONTEXT_DEPENDENT_UNIT(#{none},'revolution')")
        self.count = add(f"CONTEXT_DEPENDENT_UNIT(#{none},'count')")
        per_minute = add(f"DERIVED_UNIT_ELEMENT(#{self.minute},-1.)")
        self.mm_min = add(f"DERIVED_UNIT((#{add(f'DERIVED_UNIT_ELEMENT(#{self.mm},1.)')},#{per_minute}))")
        self.rev_min = add(f"DERIVED_UNIT((#{add(f'DERIVED_UNIT_ELEMENT(#{turn},1.)')},#{per_minute}))")
        add(f"NAME_ATTRIBUTE('millimetre/minute',#{self.mm_min})")
        add(f"NAME_ATTRIBUTE('revolution/minute',#{self.rev_min})")

    def _project(self) -> None:
        """Project, workplan, part and stock."""
        plan, add = self.plan, self.file.add
        words = quoted("; ".join(setup_words(plan)))
        name = quoted(plan.name)
        product = add(f"MACHINING_PROJECT({name},{name},{words},(#{self.product_context}))")
        project = self._definition(product)
        self.workplan = add("MACHINING_WORKPLAN('main workplan','','','')")
        process = add(f"PRODUCT_DEFINITION_PROCESS('machining','',#{self.workplan},'')")
        add(f"PROCESS_PRODUCT_ASSOCIATION('','',#{project},#{process})")
        self.part = self._definition(add(f"PRODUCT('part','part',{quoted('sha256 ' + plan.part_sha256)},"
                                         f"(#{self.product_context}))"))
        add(f"MACHINING_PROJECT_WORKPIECE_RELATIONSHIP('','workpiece','',#{project},#{self.part})")
        self.part_shape = add(f"PRODUCT_DEFINITION_SHAPE('','',#{self.part})")
        low, size = stock_box(plan)
        box = " ".join(decimal(v) for v in (*low, *np.add(low, size)))
        kind = plan.stock_words or "box"
        stock = self._definition(add(f"PRODUCT('stock','stock',{quoted(f'{kind}, inside {box} mm')},"
                                     f"(#{self.product_context}))"))
        add(f"PRODUCT_DEFINITION_RELATIONSHIP('','rawpiece','',#{self.part},#{stock})")
        if self.shapes:
            shape = add(f"PRODUCT_DEFINITION_SHAPE('','',#{stock})")
            add(f"SHAPE_DEFINITION_REPRESENTATION(#{shape},#{self._stock_shape()})")
            if plan.part_mesh is not None:
                add(f"SHAPE_DEFINITION_REPRESENTATION(#{self.part_shape},#{self._triangles('part', plan.part_mesh)})")
        if plan.material:
            add(f"MATERIAL_DESIGNATION({quoted(plan.material)},(#{self.part},#{stock}))")

    def _definition(self, product: int) -> int:
        formation = self.file.add(f"PRODUCT_DEFINITION_FORMATION('','',#{product})")
        return self.file.add(f"PRODUCT_DEFINITION('','',#{formation},#{self.view})")

    def _stock_shape(self) -> int:
        """The blank: a cylinder, triangles, or a block. The block is the bounding box where the blank is neither."""
        add, cylinder = self.file.add, self.plan.cylinder
        if self.plan.stock_mesh is not None:
            return self._triangles("stock", self.plan.stock_mesh)
        if cylinder is not None:
            base, axis = (add(f"{kind}('',{reals(v.tolist(), 9)})") for kind, v in
                          (("CARTESIAN_POINT", cylinder.base), ("DIRECTION", cylinder.axis)))
            aside = add(f"DIRECTION('',{reals(_square_to(cylinder.axis), 9)})")
            items = [add(f"AXIS2_PLACEMENT_3D('orientation',#{base},#{axis},#{aside})"),
                     self._length("length", cylinder.height), self._length("diameter", 2.0 * cylinder.radius)]
            return add(f"CYLINDRICAL_SHAPE_REPRESENTATION('stock cylinder',{refs(items)},#{self.space})")
        low, size = stock_box(self.plan)
        corner = add(f"CARTESIAN_POINT('',{reals(low)})")
        items = [self._placement("orientation", corner)]
        items += [self._length(n, s) for n, s in zip(("length", "width", "height"), size, strict=True)]
        name = "box round the stock" if self.plan.stock_words else "stock block"
        return add(f"BLOCK_SHAPE_REPRESENTATION('{name}',{refs(items)},#{self.space})")

    def _triangles(self, name: str, mesh: TriangleMesh) -> int:
        """A mesh with one face for every face number, named as in the report."""
        add = self.file.add
        rows = ",\n".join(reals(v, 6) for v in mesh.vertices.tolist())
        places = add(f"COORDINATES_LIST('',{len(mesh.vertices)},({rows}))")
        faces = []
        for number in np.unique(mesh.face_ids).tolist():
            corners = mesh.faces[mesh.face_ids == number]
            used, local = np.unique(corners, return_inverse=True)
            index = ",".join(map(str, (used + 1).tolist()))
            three = ",\n".join("(%d,%d,%d)" % tuple(r) for r in (local.reshape(-1, 3) + 1).tolist())  # noqa: UP031
            faces.append(add(f"TRIANGULATED_FACE('F{number}',#{places},{len(used)},(),$,({index}),({three}))"))
        solid = add(f"TESSELLATED_SOLID('{name}',{refs(faces)},$)")
        return add(f"TESSELLATED_SHAPE_REPRESENTATION('{name}',(#{solid}),#{self.space})")

    def _setup(self) -> None:
        """The setup with its security plane and, in class 2, the setup instructions."""
        plan, add = self.plan, self.file.add
        name = quoted(f"setup {plan.work_offset} sha256 {plan.setup_sha256}")
        setup = self._definition(add(f"MACHINING_SETUP({name},{name},'',(#{self.product_context}))"))
        height = add(f"CARTESIAN_POINT('',(0.,0.,{real(plan.clearance_plane)}))")
        plane = add(f"PLANE('security plane',#{self._placement('security plane', height)})")
        secure = add(f"PROPERTY_DEFINITION('security plane','',#{setup})")
        add(f"PROPERTY_DEFINITION_REPRESENTATION(#{secure},#{add(f'REPRESENTATION({_NONE},(#{plane}),#{self.space})')})")
        add(f"MACHINING_SETUP_WORKPIECE_RELATIONSHIP('','','',#{setup},#{self.part})")
        process = add(f"PRODUCT_DEFINITION_PROCESS('setup','',#{self.workplan},'')")
        add(f"PROCESS_PRODUCT_ASSOCIATION('','',#{setup},#{process})")
        if self.shapes:
            instructions = add("MACHINING_PROCESS_EXECUTABLE('setup instructions','setup instructions','','')")
            kind = add("DOCUMENT_TYPE('setup instructions')")
            sheet = add(f"DOCUMENT('setup','setup instructions','',#{kind})")  # the schema requires a document
            for place, words in enumerate(setup_words(plan), start=1):
                note = add(f"MACHINING_OPERATOR_INSTRUCTION('',{quoted(words)},'','',(#{sheet}))")
                add(f"MACHINING_OPERATOR_INSTRUCTION_RELATIONSHIP('','',#{instructions},#{note},{place}.)")
            self._element(instructions)

    def _length(self, name: str, value: float) -> int:
        return self.file.add(f"(LENGTH_MEASURE_WITH_UNIT() MEASURE_REPRESENTATION_ITEM() "
                             f"MEASURE_WITH_UNIT(LENGTH_MEASURE({real(value, 6)}),#{self.mm}) "
                             f"REPRESENTATION_ITEM({quoted(name)}))")

    def _property(self, name: str, about: str, owner: int, representation: int) -> None:
        prop = self.file.add(f"ACTION_PROPERTY('{name}',{about},#{owner})")
        self.file.add(f"ACTION_PROPERTY_REPRESENTATION('',{about},#{prop},#{representation})")

    def _symbol(self, value: str) -> int:
        """The representation of a symbolic value such as 'approach', one for the whole file."""
        if value not in self.symbols:
            item = self.file.add(f"DESCRIPTIVE_REPRESENTATION_ITEM('constant','{value}')")
            self.symbols[value] = self.file.add(f"REPRESENTATION('constant',(#{item}),#{self.plain})")
        return self.symbols[value]

    def _functions(self) -> None:
        self.functions = self.file.add("MACHINING_FUNCTIONS('','milling','','')")
        wet = "coolant on" if self.plan.coolant else "coolant off"
        for name, value in (("coolant", wet), ("through spindle coolant", "through spindle coolant off"),
                            ("chip removal", "chip removal off")):
            self._property(name, "'milling'", self.functions, self._symbol(value))
        item = self.file.add("DESCRIPTIVE_REPRESENTATION_ITEM('','rapid')")
        self.rapid = self.file.add(f"MACHINING_TOOLPATH_SPEED_PROFILE_REPRESENTATION('',(#{item}),#{self.plain})")

    def _element(self, executable: int) -> None:
        """The next element of the workplan."""
        self.elements += 1
        self.file.add(f"MACHINING_PROCESS_SEQUENCE_RELATIONSHIP('','',#{self.workplan},#{executable},"
                      f"{self.elements}.)")

    def _pause(self, step: Workingstep) -> None:
        """Message for a fresh cutter, and a stop."""
        add = self.file.add
        message = add(f"MACHINING_NC_FUNCTION({quoted(f'fresh cutter for {step.id}')},'display message','','')")
        text = add(f"DESCRIPTIVE_REPRESENTATION_ITEM('message text',{quoted(fresh_words(step))})")
        self._property("message text", "'display message'", message,
                       add(f"REPRESENTATION('',(#{text}),#{self.plain})"))
        self._element(message)
        self._element(add(f"MACHINING_NC_FUNCTION({quoted(f'stop before {step.id}')},'program stop','','')"))

    def _workingstep(self, step: Workingstep, path: list[Curve]) -> int:
        add = self.file.add
        workingstep = add(f"MACHINING_WORKINGSTEP({quoted(step_title(step))},'machining','','')")
        operation = add(f"FREEFORM_MILLING_OPERATION({quoted(operation_words(step))},"
                        f"'{'finishing' if step.operation == 'finishing' else 'roughing'}','',"
                        f"{quoted(_purpose(step))})")
        add(f"MACHINING_OPERATION_RELATIONSHIP('','machining',#{workingstep},#{operation})")
        self._feature(step, workingstep)
        technology = self._technology(step.spindle_rpm, step.feed)
        add(f"MACHINING_TECHNOLOGY_RELATIONSHIP('','',#{operation},#{technology})")
        add(f"MACHINING_FUNCTIONS_RELATIONSHIP('','',#{operation},#{self.functions})")
        if self.shapes:
            add(f"MACHINING_STRATEGY_RELATIONSHIP('machining','machining',#{operation},#{self._strategy(step)})")
        if step.tool.number not in self.tools:
            self.tools[step.tool.number] = (self.file.reserve(), step.tool, [])
        self.tools[step.tool.number][2].append(operation)
        self._toolpaths(step, operation, path)
        return workingstep

    def _feature(self, step: Workingstep, workingstep: int) -> None:
        add = self.file.add
        process = add("MACHINING_FEATURE_PROCESS('','machining','','')")
        add(f"MACHINING_FEATURE_RELATIONSHIP('','machining',#{workingstep},#{process})")
        prop = add(f"PROPERTY_PROCESS('machining','machining',#{process},'')")
        feature = add(f"INSTANCED_FEATURE({quoted(region_name(step))},'toolpath','','toolpath',#{self.part_shape},.F.)")
        add(f"PROCESS_PROPERTY_ASSOCIATION('','machining',#{prop},#{feature})")
        shape = add(f"PRODUCT_DEFINITION_SHAPE('orientation','toolpath',#{feature})")
        placed = add(f"SHAPE_REPRESENTATION_WITH_PARAMETERS('',(#{self.zero}),#{self.space})")
        add(f"SHAPE_DEFINITION_REPRESENTATION(#{shape},#{placed})")

    def _toolpaths(self, step: Workingstep, operation: int, path: list[Curve]) -> None:
        at, place = self.file.points(path_points(path)), 0
        for curve in path:
            trajectory, parts = curve.trajectory, curve.parts()
            if not parts:
                continue
            place += 1
            line, at = self._line(parts, at)
            toolpath = self._toolpath(f"{step.id} {trajectory.motion.value} {place}", trajectory, line, curve.axes)
            self.file.add(f"MACHINING_TOOLPATH_SEQUENCE_RELATIONSHIP('','',#{operation},#{toolpath},{place}.)")
            if (trajectory.motion is not TrajectoryKind.RAPID
                    and written_feed(trajectory.feed) != written_feed(step.feed)):
                technology = self._technology(step.spindle_rpm, trajectory.feed)
                self.file.add(f"MACHINING_TECHNOLOGY_RELATIONSHIP('','',#{toolpath},#{technology})")

    def _line(self, parts: Sequence[I64 | GridArc], at: int) -> tuple[int, int]:
        """The curve of joined parts, and the number of its last point; ``at`` is the number of the first."""
        lines = []
        for part in parts:
            if isinstance(part, GridArc):
                lines.append(trimmed_circle(self.file, part, at, self.up, self.along))
                at += 1
            else:
                lines.append(self.file.add(f"POLYLINE('',{refs(range(at, at + len(part)))})"))
                at += len(part) - 1
        if len(lines) == 1:
            return lines[0], at
        transitions = [".CONTINUOUS."] * (len(lines) - 1) + [".DISCONTINUOUS."]
        segments = [self.file.add(f"COMPOSITE_CURVE_SEGMENT({transition},.T.,#{line})")
                    for transition, line in zip(transitions, lines, strict=True)]
        return self.file.add(f"COMPOSITE_CURVE('',{refs(segments)},.U.)"), at

    def _toolpath(self, name: str, trajectory: Trajectory, line: int, axes: F64 | None) -> int:
        add = self.file.add
        toolpath = add(f"MACHINING_TOOLPATH({quoted(name)},{_CLT},'','')")
        self._property("priority", _CLT, toolpath, self._symbol("required"))
        self._property("trajectory type", _CLT, toolpath, self._symbol(_TYPE[trajectory.motion]))
        self._property("basic curve", _CLT, toolpath, add(f"REPRESENTATION('',(#{line}),#{self.space})"))
        if axes is not None:
            leaning = add(f"POLYLINE('',{refs(self.file.vectors(axes))})")
            self._property("tool axis", _CLT, toolpath, add(f"REPRESENTATION('',(#{leaning}),#{self.space})"))
        if trajectory.motion is TrajectoryKind.RAPID:
            self._property("speed profile", _CLT, toolpath, self.rapid)
        return toolpath

    def _technology(self, rpm: float, feed: float) -> int:
        key = written_speed(rpm), written_feed(feed)
        if key not in self.technologies:
            add = self.file.add
            number = self.technologies[key] = add("MACHINING_TECHNOLOGY('','milling','','')")
            turns = add(f"MEASURE_REPRESENTATION_ITEM('rotational speed',NUMERIC_MEASURE({real(-key[0])}),"
                        f"#{self.rev_min})")
            self._property("spindle", "'milling'", number, add(
                f"MACHINING_SPINDLE_SPEED_REPRESENTATION('spindle speed',(#{turns}),#{self.plain})"))
            rate = add(f"MEASURE_REPRESENTATION_ITEM('feed speed',NUMERIC_MEASURE({real(key[1])}),#{self.mm_min})")
            self._property("feedrate", "'milling'", number, add(
                f"MACHINING_FEED_SPEED_REPRESENTATION('feed speed',(#{rate}),#{self.plain})"))
        return self.technologies[key]

    def _strategy(self, step: Workingstep) -> int:
        """Planes or parameters of the passes, tolerance, scallop and side step, setup frame."""
        add = self.file.add
        along_faces = step.strategy == "isoparametric"
        kind = "uv" if along_faces else "plane cutter location"
        strategy = add(f"FREEFORM_MILLING_STRATEGY({quoted(operation_words(step))},'{kind}','','')")
        words = {"pathmode": "zigzag" if to_and_fro(step) else "forward",
                 "cutmode": "climb" if step.cut_direction.climbs else "conventional"}
        for name, value in words.items():
            self._property(name, f"'{kind}'", strategy, self._symbol(value))
        limits = [self._length("chordal tolerance", step.chordal_tolerance),
                  self._length("scallop height", step.scallop_height)]
        self._property("milling tolerances", f"'{kind}'", strategy, add(
            f"FREEFORM_MILLING_TOLERANCE_REPRESENTATION('',{refs(limits)},#{self.plain})"))
        if step.side_step > 0.0:
            self._property("stepover length", f"'{kind}'", strategy, add(
                f"REPRESENTATION('',(#{self._length('stepover length', step.side_step)}),#{self.plain})"))
        directions = {"forward direction": (1.0, 0.0, 0.0), "sideward direction": (0.0, 1.0, 0.0)}
        if not along_faces:
            normal, clamping = np.array(pass_plane_normal(step)), self.plan.clamping
            directions = {"plane normal": tuple(
                (normal if clamping is None else normal @ clamping.frames[step.access].rotation).tolist())}
        for name, direction in directions.items():
            self._property(name, f"'{kind}'", strategy, add(
                f"REPRESENTATION('',(#{add(f'DIRECTION({_NONE},{reals(direction, 6)})')}),#{self.space})"))
        return strategy

    def _tool(self, number: int, tool: ToolBody, operations: list[int]) -> None:
        """A tool with its body. One with a taper has its profile as the cutter of APT, and its kind in words.

        The standard has no circle segment mill: it is written as the bull nose or flat of its diameter and corner, with
        its profile in words.
        """
        add, known = self.file.add, self.plan.assembly(tool)
        kind = add("ACTION_RESOURCE_TYPE('milling cutting tool')")
        old = self.plan.ap238 is Ap238.INTEGRATED_CNC
        if tool.form:
            words = (_KIND["bull"] if tool.corner_radius > 0.0 else _KIND["flat"]) if old else _USER_DEFINED
        elif tool.taper > 0.0:
            words = _OLD_TAPERED if old else _USER_DEFINED
        else:
            words = _OLD_KIND.get(tool.end, _KIND[tool.end]) if old else _KIND[tool.end]
        self.file.fill(number, f"MACHINING_TOOL('{tool.number}','{words}',{refs(operations)},#{kind})")
        prop = add(f"RESOURCE_PROPERTY('tool body',{quoted(tool_name(tool))},#{number})")
        items = [self._length("effective cutting diameter", cutter_diameter(tool)),
                 self._length("maximum depth of cut", tool.flute_length),
                 self._length("overall assembly length", known.gauge_length),
                 add("DESCRIPTIVE_REPRESENTATION_ITEM('hand of cut','right')")]
        if known.teeth is not None:
            items.append(add(f"MEASURE_REPRESENTATION_ITEM('number of effective teeth',COUNT_MEASURE({known.teeth}.),"
                             f"#{self.count})"))
        if tool.form and not old:
            note = f"{short_words(tool)}; its nearest shape of the standard is that of diameter and corner radius"
            items += [*self._corner(tool, "corner radius"), add(
                f"DESCRIPTIVE_REPRESENTATION_ITEM('tool description',{quoted(note)})")]
        elif tool.taper > 0.0:
            items += self._taper(tool, old)
        elif tool.corner_radius > 0.0:
            items.append(self._length("edge radius", tool.corner_radius))
        body = add(f"MACHINING_TOOL_BODY_REPRESENTATION('{words}',{refs(items)},#{self.plain})")
        add(f"RESOURCE_PROPERTY_REPRESENTATION('','',#{prop},#{body})")
        if known.life is not None:
            self._edge(number, tool, operations, known.gauge_length, known.life)

    def _taper(self, tool: ToolBody, old: bool) -> list[int]:
        """Angle and corner of a tapered mill: the cutter of APT, whose side touches the corner.

        old : whether the names are those of the first edition
        """
        if self.degree is None:
            none = self.file.add("DIMENSIONAL_EXPONENTS(0.,0.,0.,0.,0.,0.,0.)")
            size = self.file.add(f"PLANE_ANGLE_MEASURE_WITH_UNIT(PLANE_ANGLE_MEASURE({real(_DEGREE, 16)}),"
                                 f"#{self.radian})")
            self.degree = self.file.add(f"(CONVERSION_BASED_UNIT('degree',#{size}) NAMED_UNIT(#{none}) "
                                        "PLANE_ANGLE_UNIT())")
        items = self._corner(tool, "edge" if old else "corner radius")
        if not old:
            note = f"{short_words(tool)}; the effective cutting diameter is where its side meets the plane of its tip"
            items.append(self.file.add(f"DESCRIPTIVE_REPRESENTATION_ITEM('tool description',{quoted(note)})"))
        return [*items, self.file.add(
            f"(MEASURE_REPRESENTATION_ITEM() MEASURE_WITH_UNIT(PLANE_ANGLE_MEASURE({real(tool.taper_deg, 6)}),"
            f"#{self.degree}) PLANE_ANGLE_MEASURE_WITH_UNIT() REPRESENTATION_ITEM('taper angle'))")]

    def _corner(self, tool: ToolBody, words: str) -> list[int]:
        """Radius and centre of the corner of a cutter of APT; ``words`` begin the names of its centre."""
        return [self._length(f"{words.removesuffix(' radius')} radius", tool.corner_radius),
                self._length(f"{words} center horizontal", tool.radius - tool.corner_radius),
                self._length(f"{words} center vertical", tool.corner_radius)]

    def _edge(self, tool: int, body: ToolBody, operations: list[int], gauge: float, life: float) -> None:
        """The cutter of a tool and its life, min in cut."""
        add = self.file.add
        kind = add("ACTION_RESOURCE_TYPE('milling cutting edge')")
        edge = add(f"MACHINING_CUTTING_COMPONENT({quoted(f'cutter of T{body.number}')},'',{refs(operations)},#{kind},"
                   f"'','')")
        add(f"ACTION_RESOURCE_RELATIONSHIP('','',#{tool},#{edge})")
        minutes = add(f"(MEASURE_REPRESENTATION_ITEM() MEASURE_WITH_UNIT(TIME_MEASURE({real(life)}),#{self.minute}) "
                      "REPRESENTATION_ITEM('expected life') TIME_MEASURE_WITH_UNIT())")
        old = self.plan.ap238 is Ap238.INTEGRATED_CNC
        for name, item in (("offset length" if old else "functional length", self._length("", gauge)),
                           ("expected life", minutes)):
            prop = add(f"RESOURCE_PROPERTY('{name}','',#{edge})")
            add(f"RESOURCE_PROPERTY_REPRESENTATION('','',#{prop},"
                f"#{add(f'REPRESENTATION({_NONE},(#{item}),#{self.plain})')})")


def _square_to(axis: F64) -> Sequence[float]:
    """A unit vector perpendicular to ``axis`` (3,)."""
    aside = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    return [float(v) for v in aside / np.linalg.norm(aside)]


def _purpose(step: Workingstep) -> str:
    """The strategy in words, since class 1 has no strategy object."""
    direction = "climb or conventional" if step.cut_direction.both_ways else step.cut_direction.value
    return (f"{step.strategy}, {direction}, side step {decimal(step.side_step)} mm, "
            f"scallop {decimal(step.scallop_height)} mm, chordal tolerance {decimal(step.chordal_tolerance)} mm, "
            f"{height_word(step)} {decimal(step.top)} to {decimal(step.bottom)} mm")
