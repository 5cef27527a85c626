"""STEP-NC as AP238 (ISO 10303-238 edition 3), conformance class 1: a toolpath for every operation.

Every parameter of the application model is a property with a representation;
the strings are those of clause 5.1 of the standard. Units are written in the
file: mm, mm/min, rev/min (negative: a right-hand cutter seen from the holder).
Rapids are toolpaths of their operation with the speed profile 'rapid'. The
stock is a product of its own, tied to the part as 'rawpiece', with a block as
its shape.
"""

from __future__ import annotations

import numpy as np

from geometry.errors import OutputError
from geometry.mesh import F64
from geometry.toolbody import ToolBody
from output.grid import check_plan
from output.model import Workplan
from output.part21 import Part21, quoted, real, reals, refs
from output.stepnc_words import Curve, header_words, operation_words, region_name, setup_words, stock_box, ways
from output.text import decimal, height_word, step_title, tool_name
from toolpath.motion import Motion, Trajectory, Workingstep

_KIND = {"ball": "ballnose endmill", "bull": "bullnose endmill", "flat": "endmill"}
_TYPE = {
    Motion.RAPID: "connect", Motion.APPROACH: "approach", Motion.CUT: "trajectory path",
    Motion.CONNECT: "connect", Motion.LIFT: "lift",
}
_CLT = "'cutter location trajectory'"


def write_stepnc_aim(plan: Workplan) -> str:
    """The job as an AP238 Part 21 file, schema MODEL_BASED_INTEGRATED_MANUFACTURING_SCHEMA.

    plan : lengths in mm, setup frame
    Returns the text, ASCII; points read back within 0.00005 mm of the plan on each axis.
    Raises OutputError as ``output.grid.check_plan`` and ``grid_path`` do, and where the stock box is empty.
    """
    check_plan(plan)
    return _Aim(plan).text()


class _Aim:
    """One file being written; the small dictionaries keep equal instances single."""

    def __init__(self, plan: Workplan) -> None:
        self.plan = plan
        self.file = Part21()
        self.symbols: dict[str, int] = {}
        self.technologies: dict[tuple[float, float], int] = {}
        self.tools: dict[int, tuple[int, ToolBody, list[int]]] = {}

    def text(self) -> str:
        plan = self.plan
        self._contexts()
        self._feed_and_speed_units()
        self._project()
        self._functions()
        self._steps()
        for number, tool, operations in self.tools.values():
            self._tool(number, tool, operations)
        return self.file.text(
            description=header_words(plan, "AP238 freeform milling, conformance class 1, cutter location paths"),
            name=f"{plan.name}.stpnc", schema=("MODEL_BASED_INTEGRATED_MANUFACTURING_SCHEMA",),
            system=f"zonemill {plan.version}")

    def _contexts(self) -> None:
        add = self.file.add
        application = add("APPLICATION_CONTEXT('Application protocol for the exchange of CNC data')")
        add("APPLICATION_PROTOCOL_DEFINITION('international standard',"
            f"'model_based_integrated_manufacturing_schema',2022,#{application})")
        self.product_context = add(f"PRODUCT_CONTEXT('CNC Machining',#{application},'manufacturing')")
        self.view = add(f"PRODUCT_DEFINITION_CONTEXT('CNC Machining',#{application},'manufacturing')")
        self.plain = add("REPRESENTATION_CONTEXT('','units not necessary')")
        self.mm = add("(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.))")
        radian = add("(NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.))")
        steradian = add("(NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT())")
        self.space = add(f"(GEOMETRIC_REPRESENTATION_CONTEXT(3) "
                         f"GLOBAL_UNIT_ASSIGNED_CONTEXT((#{self.mm},#{radian},#{steradian})) "
                         f"REPRESENTATION_CONTEXT('','3D'))")
        self.up = add("DIRECTION('',(0.,0.,1.))")
        self.along = add("DIRECTION('',(1.,0.,0.))")
        origin = add("CARTESIAN_POINT('',(0.,0.,0.))")
        self.zero = self._placement("orientation", origin)

    def _placement(self, name: str, point: int) -> int:
        return self.file.add(f"AXIS2_PLACEMENT_3D({quoted(name)},#{point},#{self.up},#{self.along})")

    def _feed_and_speed_units(self) -> None:
        add = self.file.add
        second = add("(NAMED_UNIT(*) SI_UNIT($,.SECOND.) TIME_UNIT())")
        sixty = add(f"TIME_MEASURE_WITH_UNIT(TIME_MEASURE(60.),#{second})")
        time = add("DIMENSIONAL_EXPONENTS(0.,0.,1.,0.,0.,0.,0.)")
        none = add("DIMENSIONAL_EXPONENTS(0.,0.,0.,0.,0.,0.,0.)")
        minute = add(f"(CONVERSION_BASED_UNIT('minute',#{sixty}) NAMED_UNIT(#{time}) TIME_UNIT())")
        turn = add(f"CONTEXT_DEPENDENT_UNIT(#{none},'revolution')")
        per_minute = add(f"DERIVED_UNIT_ELEMENT(#{minute},-1.)")
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
        part = self._definition(add(f"PRODUCT('part','part',{quoted('sha256 ' + plan.part_sha256)},"
                                    f"(#{self.product_context}))"))
        add(f"MACHINING_PROJECT_WORKPIECE_RELATIONSHIP('','workpiece','',#{project},#{part})")
        self.part_shape = add(f"PRODUCT_DEFINITION_SHAPE('','',#{part})")
        stock = self._definition(add(f"PRODUCT('stock','stock',{quoted(plan.material)},(#{self.product_context}))"))
        add(f"PRODUCT_DEFINITION_RELATIONSHIP('','rawpiece','',#{part},#{stock})")
        self._stock_shape(stock)
        if plan.material:
            add(f"MATERIAL_DESIGNATION({quoted(plan.material)},(#{part},#{stock}))")

    def _definition(self, product: int) -> int:
        formation = self.file.add(f"PRODUCT_DEFINITION_FORMATION('','',#{product})")
        return self.file.add(f"PRODUCT_DEFINITION('','',#{formation},#{self.view})")

    def _stock_shape(self, stock: int) -> None:
        add = self.file.add
        low, size = stock_box(self.plan)
        corner = add(f"CARTESIAN_POINT('',{reals(low)})")
        items = [self._placement("orientation", corner)]
        items += [self._length(n, s) for n, s in zip(("length", "width", "height"), size, strict=True)]
        shape = add(f"PRODUCT_DEFINITION_SHAPE('','',#{stock})")
        block = add(f"BLOCK_SHAPE_REPRESENTATION('stock block',{refs(items)},#{self.space})")
        add(f"SHAPE_DEFINITION_REPRESENTATION(#{shape},#{block})")

    def _length(self, name: str, value: float) -> int:
        return self.file.add(f"(LENGTH_MEASURE_WITH_UNIT() MEASURE_REPRESENTATION_ITEM() "
                             f"MEASURE_WITH_UNIT(LENGTH_MEASURE({real(value, 6)}),#{self.mm}) "
                             f"REPRESENTATION_ITEM({quoted(name)}))")

    def _property(self, name: str, about: str, owner: int, representation: int) -> None:
        prop = self.file.add(f"ACTION_PROPERTY('{name}',{about},#{owner})")
        self.file.add(f"ACTION_PROPERTY_REPRESENTATION('',{about},#{prop},#{representation})")

    def _symbol(self, value: str) -> int:
        """The representation of a symbolic value such as 'approach'; one for the whole file."""
        if value not in self.symbols:
            item = self.file.add(f"DESCRIPTIVE_REPRESENTATION_ITEM('constant','{value}')")
            self.symbols[value] = self.file.add(f"REPRESENTATION('constant',(#{item}),#{self.plain})")
        return self.symbols[value]

    def _functions(self) -> None:
        self.functions = self.file.add("MACHINING_FUNCTIONS('','milling','','')")
        for name, value in (("coolant", "coolant on"), ("through spindle coolant", "through spindle coolant off"),
                            ("chip removal", "chip removal off")):
            self._property(name, "'milling'", self.functions, self._symbol(value))
        item = self.file.add("DESCRIPTIVE_REPRESENTATION_ITEM('','rapid')")
        self.rapid = self.file.add(f"MACHINING_TOOLPATH_SPEED_PROFILE_REPRESENTATION('',(#{item}),#{self.plain})")

    def _steps(self) -> None:
        for place, way in enumerate(ways(self.plan), start=1):
            executable = self._workingstep(way.step, [*way.before, *way.path, *way.after])
            self.file.add(f"MACHINING_PROCESS_SEQUENCE_RELATIONSHIP('','',#{self.workplan},#{executable},{place}.)")

    def _workingstep(self, step: Workingstep, path: list[Curve]) -> int:
        add = self.file.add
        workingstep = add(f"MACHINING_WORKINGSTEP({quoted(step_title(step))},'machining','','')")
        operation = add(f"FREEFORM_MILLING_OPERATION({quoted(operation_words(step))},"
                        f"'{'roughing' if step.operation == 'roughing' else 'finishing'}','',"
                        f"{quoted(_purpose(step))})")
        add(f"MACHINING_OPERATION_RELATIONSHIP('','machining',#{workingstep},#{operation})")
        self._feature(step, workingstep)
        technology = self._technology(step.spindle_rpm, step.feed)
        add(f"MACHINING_TECHNOLOGY_RELATIONSHIP('','',#{operation},#{technology})")
        add(f"MACHINING_FUNCTIONS_RELATIONSHIP('','',#{operation},#{self.functions})")
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
        first = at = self.file.points(np.concatenate([path[0].points[:1], *(c.points[1:] for c in path)]))
        place = 0
        for curve in path:
            trajectory, count = curve.trajectory, len(curve.points)
            if count < 2:
                continue
            place += 1
            toolpath = self._toolpath(f"{step.id} {trajectory.motion.value} {place}", trajectory,
                                      range(at, at + count), curve.axes)
            at += count - 1
            self.file.add(f"MACHINING_TOOLPATH_SEQUENCE_RELATIONSHIP('','',#{operation},#{toolpath},{place}.)")
            if trajectory.motion is not Motion.RAPID and trajectory.feed != step.feed:
                technology = self._technology(step.spindle_rpm, trajectory.feed)
                self.file.add(f"MACHINING_TECHNOLOGY_RELATIONSHIP('','',#{toolpath},#{technology})")
        if at == first:
            raise OutputError(f"{step.id} does not move", code="empty_step", subjects=(step.id,))

    def _toolpath(self, name: str, trajectory: Trajectory, points: range, axes: F64 | None) -> int:
        add = self.file.add
        toolpath = add(f"MACHINING_TOOLPATH({quoted(name)},{_CLT},'','')")
        self._property("priority", _CLT, toolpath, self._symbol("required"))
        self._property("trajectory type", _CLT, toolpath, self._symbol(_TYPE[trajectory.motion]))
        line = add(f"POLYLINE('',{refs(points)})")
        self._property("basic curve", _CLT, toolpath, add(f"REPRESENTATION('',(#{line}),#{self.space})"))
        if axes is not None:
            leaning = add(f"POLYLINE('',{refs(self.file.vectors(axes))})")
            self._property("tool axis", _CLT, toolpath, add(f"REPRESENTATION('',(#{leaning}),#{self.space})"))
        if trajectory.motion is Motion.RAPID:
            self._property("speed profile", _CLT, toolpath, self.rapid)
        return toolpath

    def _technology(self, rpm: float, feed: float) -> int:
        key = (rpm, feed)
        if key not in self.technologies:
            add = self.file.add
            number = self.technologies[key] = add("MACHINING_TECHNOLOGY('','milling','','')")
            turns = add(f"MEASURE_REPRESENTATION_ITEM('rotational speed',NUMERIC_MEASURE({real(-rpm)}),"
                        f"#{self.rev_min})")
            self._property("spindle", "'milling'", number, add(
                f"MACHINING_SPINDLE_SPEED_REPRESENTATION('spindle speed',(#{turns}),#{self.plain})"))
            rate = add(f"MEASURE_REPRESENTATION_ITEM('feed speed',NUMERIC_MEASURE({real(feed)}),#{self.mm_min})")
            self._property("feedrate", "'milling'", number, add(
                f"MACHINING_FEED_SPEED_REPRESENTATION('feed speed',(#{rate}),#{self.plain})"))
        return self.technologies[key]

    def _tool(self, number: int, tool: ToolBody, operations: list[int]) -> None:
        add = self.file.add
        kind = add("ACTION_RESOURCE_TYPE('milling cutting tool')")
        self.file.fill(number, f"MACHINING_TOOL('{tool.number}','{_KIND[tool.kind]}',{refs(operations)},#{kind})")
        prop = add(f"RESOURCE_PROPERTY('tool body',{quoted(tool_name(tool))},#{number})")
        items = [self._length("effective cutting diameter", tool.diameter),
                 self._length("maximum depth of cut", tool.flute_length),
                 add("DESCRIPTIVE_REPRESENTATION_ITEM('hand of cut','right')")]
        if tool.kind != "flat":
            items.append(self._length("edge radius", tool.corner_radius))
        body = add(f"MACHINING_TOOL_BODY_REPRESENTATION('{_KIND[tool.kind]}',{refs(items)},#{self.plain})")
        add(f"RESOURCE_PROPERTY_REPRESENTATION('','',#{prop},#{body})")


def _purpose(step: Workingstep) -> str:
    """What the strategy was asked for: class 1 carries no strategy object."""
    return (f"{step.strategy}, {'climb' if step.climb else 'conventional'}, side step {decimal(step.side_step)} mm, "
            f"scallop {decimal(step.scallop_height)} mm, chordal tolerance {decimal(step.chordal_tolerance)} mm, "
            f"{height_word(step)} {decimal(step.top)} to {decimal(step.bottom)} mm")
