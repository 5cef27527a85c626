"""Reader of STEP-NC as AP238 (both schema names): records the tool motion of its workplan [ISO10303-238].

The file holds the application model as methods, relationships between them and properties with representations; the
name of a property tells its parameter. The reader refuses, by instance, an unknown name or value. It also refuses what
could move the tool and is not read: strategies without a path, contact trajectories, splines, branches. Lengths, feeds
and speeds are in the units of the file.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from geometry.errors import ProgramError
from geometry.mesh import F64
from verify.program.program import Remark
from verify.program.turn_subdivision import TURN
from verify.stepnc.ap238_attributes import EXECUTABLES, METHODS, RECORDS, REPRESENTATIONS, SHAPES, TABLE, UNITS
from verify.stepnc.attribute_checks import FARTHEST, Checked, shown
from verify.stepnc.curves import curve_points
from verify.stepnc.cutter_shape import MAX_TAPER, SAME_SHAPE, CutterShape, contradiction, shape_of
from verify.stepnc.iso14649 import sane_rates, tool_number
from verify.stepnc.part21 import Part21File, Ref, Typed
from verify.stepnc.tool_motion import MAX_DWELL, CutterRecord, MotionRecorder

SCHEMAS = frozenset({"MODEL_BASED_INTEGRATED_MANUFACTURING_SCHEMA", "INTEGRATED_CNC_SCHEMA"})
_PREFIX = {None: 1.0, "KILO": 1e3, "HECTO": 1e2, "DECA": 1e1, "DECI": 1e-1, "CENTI": 1e-2, "MILLI": 1e-3,
           "MICRO": 1e-6, "NANO": 1e-9}
_BASE = {"METRE": ("length", 1000.0), "SECOND": ("time", 1.0 / 60.0), "RADIAN": ("angle", 1.0),
         "STERADIAN": ("solid angle", 1.0)}  # mm and min
_SMALLEST, _LARGEST, _MAX_POWER = 1e-12, 1e12, 3.0  # sizes of units, and exponents; real units are far within
_FEED, _SPEED = {"length": 1.0, "time": -1.0}, {"turn": 1.0, "time": -1.0}
_SYMBOLS = {
    "priority": ("required",),
    "trajectory type": ("approach", "lift", "connect", "non-contact", "contact", "trajectory path"),
    "direction": ("beginning to end", "end to beginning"),
    "speed profile": ("rapid",),
    "coolant": ("coolant on", "coolant off"),
    "mist": ("mist on", "mist off"),
    "through spindle coolant": ("through spindle coolant on", "through spindle coolant off"),
    "chip removal": ("chip removal on", "chip removal off"),
    "feedrate reference": ("tool center point",),
    "synchronize spindle with feed": ("not synchronized",),
    "inhibit feedrate override": ("override allowed", "override not allowed"),
    "inhibit spindle override": ("override allowed", "override not allowed"),
    "pathmode": ("forward", "zigzag"),
    "cutmode": ("climb", "conventional"),
}
_NAMES = {
    "MACHINING_TOOLPATH": ("priority", "trajectory type", "direction", "speed profile", "basic curve", "tool axis",
                           "surface normal", "dwell", "path maximum deviation", "tool axis maximum deviation"),
    "MACHINING_TECHNOLOGY": ("spindle", "feedrate", "feedrate reference", "synchronize spindle with feed",
                             "inhibit feedrate override", "inhibit spindle override"),
    "MACHINING_FUNCTIONS": ("coolant", "mist", "through spindle coolant", "chip removal"),
    "MACHINING_NC_FUNCTION": ("message text",),
    "FREEFORM_MILLING_STRATEGY": ("pathmode", "cutmode", "milling tolerances", "stepover length", "plane normal",
                                  "leading line", "forward direction", "sideward direction"),
}
_TOOLS = {"ballnose endmill": "ball", "ball endmill": "ball", "bullnose endmill": "bull", "endmill": "flat",
          "tapered endmill": "cone", "user defined milling tool": "cone"}
_CORNER = {"edge radius": "corner", "corner radius": "corner", "edge center horizontal": "centre",
           "corner radius center horizontal": "centre"}
"""Sizes of the corner of a cutter with a cone, by their names in the first and the later editions."""
_HEIGHTS = ("edge center vertical", "corner radius center vertical")
DEVIATION = 0.001
"""mm, from the path, that a file may allow; the error bound includes it, as it does that of G64."""
_NC_STOPS = ("program stop", "optional stop")
_NC_QUIET = ("display message", "set mark")
_ITEMS = ("effective cutting diameter", "maximum depth of cut", "overall assembly length", "hand of cut",
          "number of effective teeth", "edge radius", "coolant through tool", "functional length")
_CONE_ITEMS = (*_CORNER, *_HEIGHTS, "taper angle", "tip outer angle", "tool description")
_QUIET_ITEMS = ("coolant through tool", "tool description")
_UNIT_OF = {"number of effective teeth": {}, "taper angle": {"angle": 1.0}, "tip outer angle": {"angle": 1.0}}


def read_ap238(file: Part21File, recorder: MotionRecorder) -> None:
    """Record the tool motion of the main workplan of a file [ISO10303-238].

    Raises
    ------
    ProgramError
        An instance, which the subjects name, does not have the required form, or moves the tool in a way that the
        reader does not know.
    """
    Ap238Reader(file, recorder).run()


class Ap238Reader:
    """One reading of an AP238 file: tables of references, and the walk through the workplan."""

    def __init__(self, file: Part21File, recorder: MotionRecorder) -> None:
        self.file, self.recorder = file, recorder
        self.data = Checked(file, TABLE, RECORDS)
        self.properties = self._properties("ACTION_PROPERTY", "definition")
        self._check_properties()
        self._check_relationships()
        self.units: dict[int, tuple[dict[str, float], float]] = {}
        self.scales: dict[int, float] = {}
        self.secure = self._security_plane()
        self.rates: dict[int, tuple[float, float]] = {}
        self.cutters: dict[int, CutterRecord] = {}
        self.tools = self._tools_by_operation()
        self.below = {entity: self._ordered(entity) for entity in (
            "MACHINING_PROCESS_SEQUENCE_RELATIONSHIP", "MACHINING_TOOLPATH_SEQUENCE_RELATIONSHIP")}
        self.related_methods = {entity: self._related(entity) for entity in (
            "MACHINING_OPERATION_RELATIONSHIP", "MACHINING_TECHNOLOGY_RELATIONSHIP", "MACHINING_FUNCTIONS_RELATIONSHIP",
            "MACHINING_FEATURE_RELATIONSHIP")}
        self.placements = self._placements()
        self.seen: set[int] = set()

    def run(self) -> None:
        """Record the motion of the main workplan.

        Raises
        ------
        ProgramError
            The file does not have exactly one project and one main workplan, or an instance is wrong.
        """
        projects = self.data.of("MACHINING_PROJECT")
        plans = [self.data.ref(n, "PRODUCT_DEFINITION_PROCESS", "chosen_method")
                 for n in self.data.of("PRODUCT_DEFINITION_PROCESS") if self._word(n, "PRODUCT_DEFINITION_PROCESS",
                                                                                  "name", ("machining", "setup"))
                 == "machining"]
        for entity, found in (("MACHINING_PROJECT", projects), ("main MACHINING_WORKPLAN", plans)):
            if len(found) != 1:
                raise ProgramError(f"{self.file.name}: one {entity} expected, not {len(found)}",
                                   subjects=tuple(f"#{n}" for n in found), measured=len(found), limit=1,
                                   remedy="send one project per file")
        self._execute(plans[0])

    def _word(self, number: int, entity: str, attribute: str, allowed: Iterable[str]) -> str:
        """A string attribute that must be one of ``allowed``."""
        value = str(self.data.one(number, entity, attribute))
        if value not in allowed:
            raise self.file.error(number, f", {attribute}: one of {', '.join(map(repr, allowed))} expected, not "
                                          f"{value!r}")
        return value

    def _properties(self, entity: str, owner: str) -> dict[int, dict[str, tuple[int, int]]]:
        """Properties and their representations, by owner and name."""
        shown_by: dict[int, int] = {}
        for n in self.data.of(f"{entity}_REPRESENTATION"):
            prop = self.data.ref(n, f"{entity}_REPRESENTATION", "property")
            if prop in shown_by:
                raise self.file.error(n, f", property: #{prop} already has a representation")
            shown_by[prop] = self.data.ref(n, f"{entity}_REPRESENTATION", "representation")
        out: dict[int, dict[str, tuple[int, int]]] = defaultdict(dict)
        for n in self.data.of(entity):
            name, mine = str(self.data.one(n, entity, "name")), self.data.ref(n, entity, owner)
            if n not in shown_by:
                raise self.file.error(n, f"'{name}' has no {entity}_REPRESENTATION")
            if name in out[mine]:
                raise self.file.error(n, f", name: #{mine} already has a property '{name}'")
            out[mine][name] = n, shown_by[n]
        return out

    def _check_properties(self) -> None:
        """Refuse properties of names, and symbols of values, that the reader does not know."""
        for owner, named in self.properties.items():
            entity = self.file.names(owner)[0]
            for name, (prop, representation) in named.items():
                if name not in _NAMES.get(entity, ()):
                    raise self.file.error(prop, f", name: unknown property '{name}' of {entity}; known are "
                                                f"{', '.join(_NAMES.get(entity, ())) or 'none'}")
                if name in _SYMBOLS:
                    self._symbol(representation, _SYMBOLS[name])

    def _check_relationships(self) -> None:
        """Refuse what relates methods in a way that is not read: branches, and what is done at the same time."""
        for entity, numbers in sorted(self.file.entities().items()):
            if entity in TABLE or entity in RECORDS or not entity.endswith(("_RELATIONSHIP", "_METHOD")):
                continue
            for n in numbers:
                for value in (v for _, values in self.file.records(n) for v in values):
                    if isinstance(value, Ref) and self.file.has(value) and set(self.file.names(value)) & set(METHODS):
                        raise self.file.error(n, "is not read; a control may do more than the sequence says",
                                              int(value))

    def _items(self, representation: int) -> list[int]:
        entity = self.data.get(representation, *REPRESENTATIONS, *SHAPES)[0]
        return self.data.refs(representation, entity, "items")

    def _symbol(self, representation: int, allowed: tuple[str, ...]) -> str:
        """The word a representation stands for."""
        item = self._items(representation)[0]
        self.data.get(item, "DESCRIPTIVE_REPRESENTATION_ITEM")
        return self._word(item, "DESCRIPTIVE_REPRESENTATION_ITEM", "description", allowed)

    def _setting(self, owner: int, name: str) -> str | None:
        found = self.properties.get(owner, {}).get(name)
        return None if found is None else self._symbol(found[1], _SYMBOLS[name])

    def _related(self, entity: str) -> dict[int, list[int]]:
        out: dict[int, list[int]] = defaultdict(list)
        for n in self.data.of(entity):
            out[self.data.ref(n, entity, "relating_method")].append(self.data.ref(n, entity, "related_method"))
        return out

    def _ordered(self, entity: str) -> dict[int, list[int]]:
        """Methods below each method, in the order of their positions."""
        rows: dict[int, dict[float, int]] = defaultdict(dict)
        for n in self.data.of(entity):
            above, place = self.data.ref(n, entity, "relating_method"), self.data.real(n, entity, "sequence_position")
            if place is None or place in rows[above]:
                raise self.file.error(n, f", sequence_position: {place} appears twice below #{above}")
            rows[above][place] = self.data.ref(n, entity, "related_method")
        return {above: [found[k] for k in sorted(found)] for above, found in rows.items()}

    def _only_related(self, entity: str, number: int) -> int:
        found = self.related_methods[entity].get(number, [])
        if len(found) != 1:
            raise self.file.error(number, f"has {len(found)} {entity}, one is required")
        return found[0]

    def _execute(self, number: int) -> None:
        if number in self.seen:
            raise self.file.error(number, "appears in two places of the workplans, or inside itself")
        self.seen.add(number)
        entity = self.data.get(number, *EXECUTABLES)[0]
        if entity == "MACHINING_WORKPLAN":
            below = self.below["MACHINING_PROCESS_SEQUENCE_RELATIONSHIP"].get(number)
            if below is None:
                raise self.file.error(number, "has no elements: a MACHINING_PROCESS_SEQUENCE_RELATIONSHIP is required")
            for element in below:
                self._execute(element)
        elif entity == "MACHINING_NC_FUNCTION":
            if self._word(number, entity, "description", (*_NC_STOPS, *_NC_QUIET)) in _NC_STOPS:
                self.recorder.stop("program stop", self.file.line(number))
        elif entity == "MACHINING_PROCESS_EXECUTABLE":
            self._word(number, entity, "description", ("setup instructions",))
        else:
            self._workingstep(number)

    def _workingstep(self, number: int) -> None:
        operation = self._only_related("MACHINING_OPERATION_RELATIONSHIP", number)
        line = self.file.line(number)
        if self.secure is not None:
            self.recorder.over(*self.secure, line)
        tool = self.tools.get(operation)
        if tool is None:
            raise self.file.error(operation, "has no tool: a MACHINING_TOOL whose usage holds it is required")
        self.recorder.take(self._cutter(tool), line)
        technology = self._only_related("MACHINING_TECHNOLOGY_RELATIONSHIP", operation)
        functions = self._only_related("MACHINING_FUNCTIONS_RELATIONSHIP", operation)
        coolant = self._setting(functions, "coolant")
        if coolant is None:
            raise self.file.error(functions, "has no 'coolant': an ACTION_PROPERTY of that name is required")
        self.recorder.coolant = coolant == "coolant on"
        paths = self.below["MACHINING_TOOLPATH_SEQUENCE_RELATIONSHIP"].get(operation)
        if paths is None:
            raise self.file.error(operation, "has no tool path: strategies without one are not read")
        place = np.eye(4)
        for process in self.related_methods["MACHINING_FEATURE_RELATIONSHIP"].get(number, []):
            place = self.placements.get(process, place)
        for path in paths:
            self._path(path, place, technology)

    def _path(self, number: int, place: F64, technology: int) -> None:
        kind = self._word(number, "MACHINING_TOOLPATH", "description", ("cutter location trajectory", "feedstop"))
        named = self.properties.get(number, {})
        own = self.related_methods["MACHINING_TECHNOLOGY_RELATIONSHIP"].get(number, [])
        if len(own) > 1:
            raise self.file.error(number, f"has {len(own)} MACHINING_TECHNOLOGY_RELATIONSHIP, one at most is allowed")
        if kind == "feedstop":
            dwell = 60.0 * self._measure(number, "dwell", {"time": 1.0})
            self.recorder.dwell += self.data.within(number, "'dwell', s", dwell, 0.0, MAX_DWELL)
            return
        tips, lines = self._curve(number, "basic curve", lengths=True)
        if "tool axis" in named:
            axes, _ = self._curve(number, "tool axis", lengths=False)
            axes = self.data.unit_axes(number, "'tool axis'", axes, len(tips))
        else:
            axes = np.tile([0.0, 0.0, 1.0], (len(tips), 1))
        if self._setting(number, "direction") == "end to beginning":
            tips, axes, lines = tips[::-1], axes[::-1], lines[::-1]
        self._check_deviation(number, named)
        rapid = self._setting(number, "speed profile") is not None
        feed, speed = self._rates(own[0] if own else technology)
        self.recorder.follow(tips @ place[:3, :3].T + place[:3, 3], axes @ place[:3, :3].T, rapid=rapid, feed=feed,
                           speed=speed, lines=lines)

    def _check_deviation(self, number: int, named: dict[str, tuple[int, int]]) -> None:
        """Take a deviation that the file allows the control into the error bound; more is a finding."""
        for name, unit, most in (("path maximum deviation", "length", DEVIATION),
                                 ("tool axis maximum deviation", "angle", TURN)):
            if name not in named:
                continue
            size = self._measure(number, name, {unit: 1.0})
            if unit == "length" and 0.0 <= size <= most:
                self.recorder.blend = max(self.recorder.blend, size)
            elif not 0.0 <= size <= most:
                self.recorder.remarks.append(Remark(self.file.line(number), f"'{name}' lets the control leave the way "
                                                    "of the file, and nothing simulates that"))

    def _curve(self, number: int, name: str, *, lengths: bool) -> tuple[F64, F64]:
        """Points (n, 3) of a property, mm of a curve where they are lengths, else of a polyline; their lines (n,)."""
        found = self.properties.get(number, {}).get(name)
        if found is None:
            raise self.file.error(number, f"has no '{name}': an ACTION_PROPERTY of that name is required")
        items = self._items(found[1])
        if len(items) != 1:
            raise self.file.error(found[1], f", items: one curve expected, not {len(items)}")
        if lengths:
            return curve_points(self.data, items[0], self._scale(found[1]))
        self.data.get(items[0], "POLYLINE")
        return self.data.curve(items[0])

    def _scale(self, representation: int) -> float:
        """Size of the length unit of a representation, mm."""
        entity = self.data.get(representation, *REPRESENTATIONS, *SHAPES)[0]
        context = self.data.ref(representation, entity, "context_of_items")
        if context not in self.scales:
            self.data.get(context, "GLOBAL_UNIT_ASSIGNED_CONTEXT")
            units = [self._unit(u) for u in self.data.refs(context, "GLOBAL_UNIT_ASSIGNED_CONTEXT", "units")]
            lengths = [factor for dimensions, factor in units if dimensions == {"length": 1.0}]
            if len(lengths) != 1:
                raise self.file.error(context, f", units: one unit of length expected, not {len(lengths)}")
            self.scales[context] = lengths[0]
        return self.scales[context]

    def _unit(self, number: int) -> tuple[dict[str, float], float]:
        """Dimensions of a unit, as exponents, and its size in mm, min or turns."""
        if number in self.units:
            return self.units[number]
        entity, values = self.data.get(number, *UNITS)
        dimensions: dict[str, float] = {}
        factor = 1.0
        if entity == "SI_UNIT":
            name, prefix = str(values[1]), None if values[0] is None else str(values[0])
            if name not in _BASE or prefix not in _PREFIX:
                raise self.file.error(number, f"is an unknown unit: {shown(values[0])} {name}")
            dimensions, factor = {_BASE[name][0]: 1.0}, _BASE[name][1] * _PREFIX[prefix]
        elif entity == "CONVERSION_BASED_UNIT":
            dimensions, factor = self._measured(self.data.ref(number, entity, "conversion_factor"))
        elif entity == "CONTEXT_DEPENDENT_UNIT":
            word = self._word(number, entity, "name", ("revolution", "count"))
            dimensions = {"turn": 1.0} if word == "revolution" else {}
        else:
            for element in self.data.refs(number, entity, "elements"):
                inner, size = self._unit(self.data.ref(element, "DERIVED_UNIT_ELEMENT", "unit"))
                exponent = self.data.real(element, "DERIVED_UNIT_ELEMENT", "exponent") or 0.0
                self.data.within(element, "exponent", exponent, -_MAX_POWER, _MAX_POWER)
                for dimension, power in inner.items():
                    dimensions[dimension] = dimensions.get(dimension, 0.0) + power * exponent
                factor *= size**exponent
        self.data.within(number, "the size of the unit in mm, min and turns", factor, _SMALLEST, _LARGEST)
        self.units[number] = dimensions, factor
        return dimensions, factor

    def _measured(self, number: int) -> tuple[dict[str, float], float]:
        """A value with a unit: its dimensions, and its size in mm, min and turns."""
        for name, values in self.file.records(number):
            if len(values) >= 2 and isinstance(values[-2], Typed) and isinstance(values[-1], Ref):
                dimensions, factor = self._unit(int(values[-1]))
                value = values[-2].value
                if isinstance(value, float):
                    return dimensions, value * factor
            if name == "MEASURE_WITH_UNIT":
                break
        raise self.file.error(number, "must be a measure with its unit")

    def _measure(self, owner: int, name: str, wanted: dict[str, float]) -> float:
        """A measured property of a method, in mm, min and turns."""
        found = self.properties.get(owner, {}).get(name)
        if found is None:
            raise self.file.error(owner, f"has no '{name}': an ACTION_PROPERTY of that name is required")
        item = self._items(found[1])[0]
        dimensions, value = self._measured(item)
        if dimensions != wanted:
            raise self.file.error(item, f"'{name}' has a unit of {dimensions or 'nothing'}, {wanted} is required")
        return value

    def _rates(self, technology: int) -> tuple[float, float]:
        """mm/min and 1/min clockwise."""
        if technology not in self.rates:
            feed, speed = (self._measure(technology, *of) for of in (("feedrate", _FEED), ("spindle", _SPEED)))
            self.rates[technology] = sane_rates(self.data, technology, feed, -speed)
        return self.rates[technology]

    def _tools_by_operation(self) -> dict[int, int]:
        out: dict[int, int] = {}
        for tool in self.data.of("MACHINING_TOOL"):
            for operation in self.data.refs(tool, "MACHINING_TOOL", "usage"):
                if operation in out:
                    raise self.file.error(tool, f", usage: #{operation} already has the tool #{out[operation]}")
                out[operation] = tool
        return out

    def _cutter(self, tool: int) -> CutterRecord:
        if tool not in self.cutters:
            self.cutters[tool] = self._body(tool)
        return self.cutters[tool]

    def _body(self, tool: int) -> CutterRecord:
        bodies = [n for n in self.data.of("RESOURCE_PROPERTY")
                  if self.data.ref(n, "RESOURCE_PROPERTY", "resource") == tool
                  and self._word(n, "RESOURCE_PROPERTY", "name", ("tool body",)) == "tool body"]
        shown_by = [self.data.ref(n, "RESOURCE_PROPERTY_REPRESENTATION", "representation")
                    for n in self.data.of("RESOURCE_PROPERTY_REPRESENTATION")
                    if self.data.ref(n, "RESOURCE_PROPERTY_REPRESENTATION", "property") in bodies]
        if len(shown_by) != 1:
            raise self.file.error(tool, f"has {len(shown_by)} representations of its 'tool body', one is required")
        self.data.get(shown_by[0], "MACHINING_TOOL_BODY_REPRESENTATION")
        sizes: dict[str, float] = {}
        words = " ".join(str(self.data.one(n, "RESOURCE_PROPERTY", "description")) for n in bodies)
        kind = _TOOLS[self._word(tool, "MACHINING_TOOL", "description", _TOOLS)]
        for item in self._items(shown_by[0]):
            name = self._item_name(item, (*_ITEMS, *(_CONE_ITEMS if kind == "cone" else ())))
            if name == "hand of cut":
                self.data.get(item, "DESCRIPTIVE_REPRESENTATION_ITEM")
                self._word(item, "DESCRIPTIVE_REPRESENTATION_ITEM", "description", ("right", "neutral"))
            elif name == "tool description":
                words = str(self.data.one(item, "DESCRIPTIVE_REPRESENTATION_ITEM", "description"))
            elif name not in _QUIET_ITEMS:
                dimensions, sizes[name] = self._measured(item)
                wanted = _UNIT_OF.get(name, {"length": 1.0})
                if dimensions != wanted:
                    raise self.file.error(item, f"'{name}' has a unit of {dimensions or 'nothing'}, "
                                                f"{wanted or 'nothing'} is required")
                self.data.within(item, f"'{name}'", sizes[name], 0.0, FARTHEST)
        diameter = sizes.get("effective cutting diameter", 0.0)
        if not diameter > 0.0:
            raise self.file.error(shown_by[0], ", items: an 'effective cutting diameter' over 0 expected")
        taper, given = 0.0, sizes.get("edge radius")
        if kind == "cone":
            shape = self._cone(tool, shown_by[0], sizes)
            diameter, given, taper = shape.diameter, shape.corner, shape.taper
        corner = 0.5 * diameter if kind == "ball" else 0.0 if kind == "flat" else given
        if corner is None or not 0.0 <= corner <= 0.5 * diameter + 1e-9 or abs((given or corner) - corner) > 1e-6:
            raise self.file.error(shown_by[0], f", items: an 'edge radius' that suits a {kind} of {diameter:g} mm "
                                               f"expected, not {given}")
        name = str(self.data.one(tool, "MACHINING_TOOL", "name"))
        return CutterRecord(tool_number(name), name, shape_of(diameter, corner, taper), diameter, corner,
                            sizes.get("maximum depth of cut"), sizes.get("overall assembly length"), tool, taper=taper,
                            words=words)

    def _cone(self, tool: int, body: int, sizes: dict[str, float]) -> CutterShape:
        """The cutter of APT: its end is level, its side leans and touches its corner; else there is a remark."""
        if sizes.get("tip outer angle", 0.0) != 0.0:
            raise self.file.error(body, ", items: a 'tip outer angle' of 0 expected; pointed ends are not read")
        found: dict[str, float] = {}
        for name, meaning in _CORNER.items():
            if name in sizes:
                found[meaning] = sizes[name]
        corner, taper = found.get("corner", 0.0), math.degrees(sizes.get("taper angle", 0.0))
        self.data.within(body, "'taper angle', deg", taper, 0.0, MAX_TAPER)
        for name in _HEIGHTS:
            if abs(sizes.get(name, corner) - corner) > SAME_SHAPE:
                raise self.file.error(body, f", items: {corner:g} mm expected as '{name}', the radius of the corner, "
                                            f"not {sizes[name]:g}")
        shape = CutterShape(sizes["effective cutting diameter"], corner, found.get("centre"), taper)
        if shape.difference > SAME_SHAPE:
            self.recorder.remarks.append(Remark(self.file.line(body), contradiction(tool, shape)))
        return shape

    def _item_name(self, item: int, known: tuple[str, ...]) -> str:
        """The name of an item of a tool body, one of ``known``."""
        records = self.file.records(item)
        entity, values = next((r for r in records if r[0] == "REPRESENTATION_ITEM"), records[0])
        if not values or not isinstance(values[0], str):
            raise self.file.error(item, f"must be an item with a name, not {entity}")
        if values[0] not in known:
            raise self.file.error(item, f", name: one of {', '.join(map(repr, known))} expected, not {values[0]!r}")
        return values[0]

    def _security_plane(self) -> tuple[F64, F64] | None:
        """Point, mm, and unit normal of the plane of the setup; None where there is no setup."""
        planes = []
        for n in self.data.of("PROPERTY_DEFINITION"):
            owner = self.data.ref(n, "PROPERTY_DEFINITION", "definition")
            if "MACHINING_SETUP_WORKPIECE_RELATIONSHIP" in self.file.names(owner):
                raise self.file.error(n, ", definition: a placement of the workpiece in its setup is not read; send "
                                         "the paths in the frame of the setup", owner)
            if "PRODUCT_DEFINITION" in self.file.names(owner):
                formation = self.data.ref(owner, "PRODUCT_DEFINITION", "formation")
                product = self.data.ref(formation, "PRODUCT_DEFINITION_FORMATION", "of_product")
                if "MACHINING_SETUP" in self.file.names(product):
                    self._word(n, "PROPERTY_DEFINITION", "name", ("security plane",))
        for n in self.data.of("PROPERTY_DEFINITION_REPRESENTATION"):
            prop = self.data.ref(n, "PROPERTY_DEFINITION_REPRESENTATION", "definition")
            if self.data.one(prop, "PROPERTY_DEFINITION", "name") == "security plane":
                planes.append(self.data.ref(n, "PROPERTY_DEFINITION_REPRESENTATION", "used_representation"))
        setups = self.data.of("MACHINING_SETUP")
        if len(planes) > 1 or len(planes) < len(setups):
            at = setups[0] if setups else planes[0]
            raise self.file.error(at, f"{len(planes)} representations of a 'security plane', one per setup is required")
        if not planes:
            return None
        item = self._items(planes[0])[0]
        self.data.get(item, "PLANE")
        place = self.data.placement(self.data.ref(item, "PLANE", "position"), self._scale(planes[0]))
        return place[:3, 3], place[:3, 2]

    def _placements(self) -> dict[int, F64]:
        """(4, 4) by feature process: transformation from the feature to the workpiece, where it is given."""
        process_of = {n: self.data.ref(n, "PROPERTY_PROCESS", "chosen_method")
                      for n in self.data.of("PROPERTY_PROCESS")}
        feature_of = {process_of[self.data.ref(n, "PROCESS_PROPERTY_ASSOCIATION", "process")]:
                      self.data.ref(n, "PROCESS_PROPERTY_ASSOCIATION", "property_or_shape")
                      for n in self.data.of("PROCESS_PROPERTY_ASSOCIATION")}
        placed: dict[int, F64] = {}
        for n in self.data.of("SHAPE_DEFINITION_REPRESENTATION"):
            shape = self.data.ref(n, "SHAPE_DEFINITION_REPRESENTATION", "definition")
            owner = self.data.ref(shape, "PRODUCT_DEFINITION_SHAPE", "definition")
            representation = self.data.ref(n, "SHAPE_DEFINITION_REPRESENTATION", "used_representation")
            if "INSTANCED_FEATURE" not in self.file.names(owner):
                continue
            for item in self._items(representation):
                if "AXIS2_PLACEMENT_3D" in self.file.names(item):
                    placed[owner] = self.data.placement(item, self._scale(representation))
        for feature in feature_of.values():
            if feature not in placed:
                raise self.file.error(feature, "has no placement: a SHAPE_DEFINITION_REPRESENTATION with an "
                                               "AXIS2_PLACEMENT_3D is required")
        return {process: placed[feature] for process, feature in feature_of.items()}


__all__ = ["SCHEMAS", "read_ap238"]
