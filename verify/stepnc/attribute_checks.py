"""Checks attributes of instances, and words the errors.

A form of STEP-NC has a table: by entity its attributes in order, each with the kind of its value. Every instance of an
entity of the table is checked before use, so a reader can rely on the values. Arrays of coordinates are float64, mm, in
the frame of the file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from verify.stepnc.part21 import DERIVED, EnumItem, Part21File, Record, Ref, Typed, Value

FARTHEST = 1e6  # mm, of the coordinates of a path and the sizes of a tool
UNIT = 1e-3  # largest deviation of the length of a tool axis from one
LONGEST_VECTOR = 1e9  # largest ratio of a direction; squares of much larger ones overflow


class AttributeKind:
    """Kind of a value; ``problem`` words the error of a wrong value, or gives None."""

    def problem(self, value: Value, file: Part21File) -> str | None:
        """Words for the error, or None."""
        raise NotImplementedError


@dataclass(frozen=True)
class Text(AttributeKind):
    """A string."""

    def problem(self, value: Value, file: Part21File) -> str | None:
        right = isinstance(value, str) and not isinstance(value, EnumItem)
        return None if right else f"a string expected, not {shown(value)}"


@dataclass(frozen=True)
class Real(AttributeKind):
    """A real number, with a decimal point, above ``above`` and up to ``limit``."""

    above: float = -math.inf
    limit: float = math.inf

    def problem(self, value: Value, file: Part21File) -> str | None:
        if not isinstance(value, float) or not math.isfinite(value):
            return f"a real number expected, not {shown(value)}"
        if value > self.limit:
            return f"a number up to {self.limit:g} expected, not {value:g}"
        return None if value > self.above else f"a number over {self.above:g} expected, not {value:g}"


@dataclass(frozen=True)
class Whole(AttributeKind):
    """A whole number."""

    def problem(self, value: Value, file: Part21File) -> str | None:
        right = isinstance(value, int) and not isinstance(value, Ref | bool)
        return None if right else f"a whole number expected, not {shown(value)}"


@dataclass(frozen=True)
class OneOf(AttributeKind):
    """One of some enumeration items."""

    items: tuple[str, ...]

    def problem(self, value: Value, file: Part21File) -> str | None:
        if isinstance(value, EnumItem) and value in self.items:
            return None
        return f"one of {', '.join(f'.{i}.' for i in self.items)} expected, not {shown(value)}"


FLAG = OneOf(("T", "F"))
LOGICAL = OneOf(("T", "F", "U"))


@dataclass(frozen=True)
class To(AttributeKind):
    """A reference to an instance of one of some entities; of any where none is named."""

    entities: tuple[str, ...] = ()

    def problem(self, value: Value, file: Part21File) -> str | None:
        if isinstance(value, Ref) and file.has(value):
            if not self.entities:
                return None
            names = file.names(value)
            for name in names:
                if name in self.entities:
                    return None
        wanted = " or ".join(self.entities) or "an instance"
        if not isinstance(value, Ref):
            return f"a reference to {wanted} expected, not {shown(value)}"
        if not file.has(value):
            return f"{value!r}, which must be {wanted}, is not in the file"
        return f"a reference to {wanted} expected, but {value!r} is {' '.join(names)}"


@dataclass(frozen=True)
class Many(AttributeKind):
    """A list of values of one kind, from ``min_count`` to ``max_count`` of them."""

    of: AttributeKind
    min_count: int = 0
    max_count: int | None = None

    def problem(self, value: Value, file: Part21File) -> str | None:
        if not isinstance(value, list):
            return f"a list expected, not {shown(value)}"
        if len(value) < self.min_count or (self.max_count is not None and len(value) > self.max_count):
            return f"a list of {self.min_count} or more expected, not of {len(value)}" if self.max_count is None else \
                f"a list of {self.min_count} to {self.max_count} expected, not of {len(value)}"
        for v in value:
            problem = self.of.problem(v, file)
            if problem is not None:
                return problem
        return None


@dataclass(frozen=True)
class Maybe(AttributeKind):
    """A value that may be left out."""

    of: AttributeKind

    def problem(self, value: Value, file: Part21File) -> str | None:
        return None if value is None else self.of.problem(value, file)


@dataclass(frozen=True)
class Named(AttributeKind):
    """A value with the name of its type before it."""

    types: tuple[tuple[str, AttributeKind], ...]

    def problem(self, value: Value, file: Part21File) -> str | None:
        wanted = " or ".join(f"{name}(...)" for name, _ in self.types)
        if not isinstance(value, Typed) or value.name not in dict(self.types):
            return f"{wanted} expected, not {shown(value)}"
        return dict(self.types)[value.name].problem(value.value, file)


@dataclass(frozen=True)
class Nothing(AttributeKind):
    """``*``: the value follows from others."""

    def problem(self, value: Value, file: Part21File) -> str | None:
        return None if value is DERIVED else f"* expected, not {shown(value)}"


@dataclass(frozen=True)
class Either(AttributeKind):
    """A value of one of several kinds."""

    kinds: tuple[AttributeKind, ...]

    def problem(self, value: Value, file: Part21File) -> str | None:
        problems = [kind.problem(value, file) for kind in self.kinds]
        return None if None in problems else problems[0]


Attributes = tuple[tuple[str, AttributeKind], ...]
Table = Mapping[str, Attributes]


def shown(value: Value) -> str:
    """A value for an error message, shortened."""
    text = "$, nothing," if value is None else repr(value)
    return text if len(text) <= 50 else text[:47] + "..."


class Checked:
    """The instances of a file, each checked against the tables of its form.

    table   : by entity
    records : by the names of the records of complex instances, which hold no inherited attributes

    Raises
    ------
    ProgramError
        An instance has values of wrong kinds; the subjects name it.
    """

    def __init__(self, file: Part21File, table: Table, records: Table | None = None) -> None:
        self.file, self._table, self._records = file, table, records or {}
        self._columns = {many: {entity: {name: k for k, (name, _) in enumerate(kinds)}
                                  for entity, kinds in these.items()}
                           for many, these in ((False, self._table), (True, self._records))}
        self._rows: dict[int, NDArray[np.int64]] = {}  # of the plain points of polylines
        self._turns: dict[tuple[int | None, int | None], F64] = {}  # by the directions of placements: files share them
        for entity, numbers in sorted(file.entities().items()):
            if entity in self._table or entity in self._records:
                for number in numbers:
                    if entity == "POLYLINE" and (plain := file.plain_polyline(number)) is not None:
                        self._check_points(number, plain)
                    else:
                        self._check(number, entity)

    def of(self, entity: str) -> list[int]:
        """Numbers of the instances of an entity."""
        return self.file.of(entity)

    def get(self, number: int, *entities: str) -> Record:
        """Name and values of an instance of one of some entities.

        An entity that its form writes alone is refused among the records of a complex instance, and vice versa: no
        table checks its values there.

        Raises ProgramError where it is of none of them.
        """
        records = self.file.records(number)
        if len(records) == 1 and records[0][0] in entities and records[0][0] in self._table:
            return records[0]
        for record in records:
            if record[0] in entities:
                if record[0] not in (self._records if len(records) > 1 else self._table):
                    raise self.file.error(number, f"has {record[0]} {'among' if len(records) > 1 else 'without'} "
                                                  "other records, which its form does not allow")
                return record
        raise self.file.error(number, f"must be {' or '.join(entities)}")

    def one(self, number: int, entity: str, attribute: str) -> Value:
        """One attribute of an instance."""
        records = self.file.records(number)
        if len(records) == 1 and records[0][0] == entity and entity in self._table:  # nearly always
            return records[0][1][self._columns[False][entity][attribute]]
        values = self.get(number, entity)[1]
        return values[self._columns[len(records) > 1][entity][attribute]]

    def ref(self, number: int, entity: str, attribute: str) -> int:
        """The number of the instance that an attribute refers to. Raises ProgramError where it refers to none."""
        value = self.one(number, entity, attribute)
        if not isinstance(value, Ref):
            raise self.file.error(number, f", {attribute}: a reference expected, not {shown(value)}")
        return int(value)

    def maybe(self, number: int, entity: str, attribute: str) -> int | None:
        """As ``ref``; None where the attribute is left out."""
        return None if self.one(number, entity, attribute) is None else self.ref(number, entity, attribute)

    def refs(self, number: int, entity: str, attribute: str) -> list[int]:
        """The numbers of the instances that a list refers to."""
        value = self.one(number, entity, attribute)
        return [int(v) for v in value if isinstance(v, Ref)] if isinstance(value, list) else []

    def real(self, number: int, entity: str, attribute: str) -> float | None:
        """A real attribute; None where it is left out."""
        value = self.one(number, entity, attribute)
        return value if isinstance(value, float) else None

    def within(self, number: int, label: str, value: float, low: float, high: float) -> float:
        """The value, which must lie from ``low`` to ``high``. Raises ProgramError where it does not."""
        if not low <= value <= high:  # nor where it is nan
            raise self.file.error(number, f", {label}: {low:g} to {high:g} expected, not {value:g}")
        return value

    def placement(self, number: int, scale: float = 1.0) -> F64:
        """Transformation of an AXIS2_PLACEMENT_3D to the frame that it is placed in.

        scale : mm in the unit of the file

        Returns (4, 4) float64: a rotation, dimensionless, and an origin, mm.
        Raises ProgramError where both directions are one.
        """
        entity = "AXIS2_PLACEMENT_3D"
        out = np.eye(4)
        out[:3, 3] = self._place(number, self.ref(number, entity, "location"), scale)
        directions = self.maybe(number, entity, "axis"), self.maybe(number, entity, "ref_direction")
        turn = self._turns.get(directions)
        if turn is None:
            turn = self._turns[directions] = self._turn(number, *directions)
        out[:3, :3] = turn
        return out

    def _turn(self, number: int, up: int | None, along: int | None) -> F64:
        """(3, 3) float64, dimensionless: the rotation of a placement, by the numbers of its directions."""
        z = np.array([0.0, 0.0, 1.0]) if up is None else self.vector(up)
        x = np.array([1.0, 0.0, 0.0]) if along is None else self.vector(along)
        x = x - (x @ z) * z
        if (length := float(np.linalg.norm(x))) < 1e-9:
            raise self.file.error(number, ", ref_direction: a direction that is not along the axis expected")
        x = x / length
        return np.column_stack([x, np.cross(z, x), z])

    def vector(self, number: int) -> F64:
        """(3,) float64, dimensionless, frame of the file: a DIRECTION of length one.

        Raises ProgramError where it is not three numbers, or all are 0.
        """
        ratios = self.one(number, "DIRECTION", "direction_ratios")
        out = np.array([v for v in ratios if isinstance(v, float)] if isinstance(ratios, list) else [])
        length = float(np.linalg.norm(out)) if len(out) and np.abs(out).max() <= LONGEST_VECTOR else 0.0
        if len(out) != 3 or length < 1e-12:
            raise self.file.error(number, f", direction_ratios: three numbers within {LONGEST_VECTOR:g} that are not "
                                          "all 0 expected")
        return out / length

    def unit_axes(self, number: int, words: str, axes: F64, count: int) -> F64:
        """Tool axes of a path made exactly unit.

        words : name of the attribute, for the error
        axes  : (n, 3) float64, dimensionless, frame of the file
        count : number of points of the path

        Returns (n, 3) float64, dimensionless, same frame.
        Raises ProgramError where their number is another, or one is not of length one.
        """
        if len(axes) != count:
            raise self.file.error(number, f", {words}: {count} points expected as in the path, not {len(axes)}")
        size = np.linalg.norm(axes, axis=1)
        if (bad := np.flatnonzero(np.abs(size - 1.0) > UNIT)).size:
            raise self.file.error(number, f", {words}: unit vectors expected, but point {bad[0] + 1} has length "
                                          f"{size[bad[0]]:.6g}")
        return axes / size[:, None]

    def curve(self, number: int, scale: float = 1.0) -> tuple[F64, F64]:
        """Points of a polyline and their lines in the file.

        scale : mm in the unit of the file

        Returns (n, 3) float64, mm, frame of the file, and (n,) float64, index, 1-based lines.
        """
        if number in self._rows:
            points, lines = self.file.of_rows(self._rows[number])
            with np.errstate(over="ignore"):
                points = points * scale
            if np.abs(points).max() <= FARTHEST:  # the others are named below
                return points, lines.astype(np.float64)
        numbers = self.file.plain_polyline(number)
        if numbers is None:
            self._check(number, "POLYLINE")
            numbers = np.array(self.one(number, "POLYLINE", "points"), np.int64)
        self._check_points(number, numbers)
        return self._places(number, numbers, scale), self.file.lines_of(numbers).astype(np.float64)

    def point(self, number: int, scale: float = 1.0) -> F64:
        """(3,) float64, mm, frame of the file: a CARTESIAN_POINT; ``scale`` is mm in the unit of the file."""
        if self.file.coordinates(number) is None:
            self.get(number, "CARTESIAN_POINT")
        return self._place(number, number, scale)

    def _place(self, owner: int, number: int, scale: float) -> F64:
        """(3,) float64: coordinates of one point that an instance refers to, times ``scale``."""
        plain = self.file.coordinates(number)
        if plain is not None:
            scaled = [v * scale for v in plain]
            if max(scaled) <= FARTHEST and min(scaled) >= -FARTHEST:
                return np.array(scaled)
        return np.asarray(self._places(owner, np.array([number], np.int64), scale)[0])  # names what is wrong

    def _places(self, owner: int, numbers: NDArray[np.int64], scale: float) -> F64:
        """(n, 3) float64: coordinates of points that an instance refers to, times ``scale``."""
        points = self.file.points(numbers)
        for k in np.flatnonzero(np.isnan(points).any(axis=1)).tolist():  # those not written plainly
            points[k] = np.array(self.one(int(numbers[k]), "CARTESIAN_POINT", "coordinates"), np.float64)
        with np.errstate(over="ignore"):  # an overflow is beyond FARTHEST too
            points = points * scale
        if (far := np.flatnonzero(~(np.abs(points) <= FARTHEST).all(axis=1))).size:
            raise self.file.error(int(numbers[far[0]]), f", coordinates: numbers within {FARTHEST / scale:g} expected",
                                  owner)
        return points

    def _check_points(self, number: int, numbers: NDArray[np.int64]) -> None:
        """Refuse a polyline that refers to an instance that is not a point; keep where its points are, if all plain."""
        rows = self.file.rows(numbers)
        if (rows >= 0).all():
            self._rows[number] = rows
            return
        for target in numbers[rows < 0].tolist():
            problem = To(("CARTESIAN_POINT",)).problem(Ref(target), self.file)
            if problem is not None:
                raise self.file.error(number, f", points: {problem}")

    def _check(self, number: int, entity: str) -> None:
        records = self.file.records(number)
        record = records[0] if records[0][0] == entity else next((r for r in records if r[0] == entity), None)
        if record is None:
            raise self.file.error(number, f"must be {entity}")
        kinds = (self._records if len(records) > 1 else self._table).get(entity)
        if kinds is None:
            return
        if len(record[1]) != len(kinds):
            raise self.file.error(number, f"has {len(record[1])} attributes of {entity}, {len(kinds)} are required")
        for (name, kind), value in zip(kinds, record[1], strict=True):
            if type(value) is str and type(kind) is Text:  # as most values are
                continue
            problem = kind.problem(value, self.file)
            if problem is not None:
                raise self.file.error(number, f", {name}: {problem}")


def attributes(**kinds: AttributeKind) -> Attributes:
    """The attributes of an entity, in order."""
    return tuple(kinds.items())
