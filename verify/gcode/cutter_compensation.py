"""Cutter radius compensation: a programmed contour in, the path of the tool's centre out.

The module knows no words of a control. It works in the plane of the contour, whose points are complex numbers in mm.
``Contour`` takes the elements of one contour in order and gives back pieces as soon as they are certain, one element
late, since a corner depends on the element after it. A ``Style`` names what controls do differently: the way onto the
contour and the way round outside corners.

How dialects use it: they write no geometry. They give the reader ``G41`` or ``G42`` with an optional ``D`` (number of a
register), ``G41.1`` or ``G42.1`` with ``D`` as a diameter in units of the program, and ``G40``; the same word again
changes nothing. Their class states its ``style``, which may change from line to line (G450, G451 of Siemens). The words
may stand in the block of the first or last move or alone before it. The reader finds the radius, keeps moves along the
third axis in their order, and refuses what cannot be combined (cycles, machine places, tool changes).

Geometry. With side s (1 left, -1 right) and radius r, an element with the unit tangent t is offset by r n, n = i s t.
An arc of radius R that turns by w (1 counterclockwise, -1 clockwise) gets the radius R - s w r about the same centre.
At a corner the direction turns by phi = s arg(tB / tA):

- phi above ``Style.tangent`` is an inside corner: both offsets end at their intersection. An element too short for it
  cannot be followed, nor can an inside arc with R < r. One with R = r, the fillet that the tool itself leaves, is a
  point of the path between tangent neighbours (LinuxCNC refuses it).
- phi below its negative is an outside corner: an arc about the corner (``Corner.ARC``), straight on along both tangents
  by e = r min(tan(|phi| / 2), 1) with a straight line between (``EXTENDED``), or by r tan(|phi| / 2) up to a turn of
  100 deg and an arc beyond (``INTERSECTION``).
- between them the offset of the next element begins where the last one ends. The path then leaves the exact offset by
  at most r phi^2 / 2.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import NoReturn

from verify.gcode.block_words import BlockError

SHARPEST = math.radians(100.0)
"""rad, the largest turn that ``Corner.INTERSECTION`` rounds by straight lines."""
_SAME = 1e-9  # mm
_FIT = 1e-6  # mm, by which a trimmed element may be too short
_POINT = 1e-3  # mm, by which an inside arc may be smaller than the tool that leaves it: the steps of programs


class Corner(Enum):
    """The way round an outside corner."""

    ARC = 0
    EXTENDED = 1
    INTERSECTION = 2


class Approach(Enum):
    """Where the first move ends: on the normal of its own end, or on the normal of the next element's start."""

    OWN_NORMAL = 0
    NEXT_NORMAL = 1


@dataclass(frozen=True)
class Style:
    """What a control does.

    corner, approach : see there
    tangent  : rad, a corner that turns by less counts as tangent
    longer   : whether the first move must be longer than the radius
    arc_first : whether the first move may be an arc
    holds    : whether, after the end of compensation, moves along the third axis keep the place in the plane
    fillets  : whether an inside arc may have the radius of the tool
    """

    corner: Corner
    approach: Approach
    tangent: float = 1e-3
    longer: bool = False
    arc_first: bool = False
    holds: bool = True
    fillets: bool = True


LINUXCNC_STYLE = Style(Corner.ARC, Approach.OWN_NORMAL, 0.05, longer=True, arc_first=True, holds=False,
                       fillets=False)
"""LinuxCNC."""
FANUC_STYLE = Style(Corner.EXTENDED, Approach.NEXT_NORMAL)
"""Fanuc and Haas, approach of type A."""


class CompensationError(BlockError):
    """A contour that a tool of this radius cannot follow."""


@dataclass(frozen=True)
class Element:
    """One line or arc of a contour, in the plane.

    start, end : complex, mm
    centre : complex, mm, of an arc; None for a line
    sweep  : rad, signed, counterclockwise positive, of an arc; more than a turn where it turns more often
    line   : of the program, for messages
    rapid  : whether it is one
    tag    : anything that the caller wants back with the pieces
    """

    start: complex
    end: complex
    centre: complex | None = None
    sweep: float = 0.0
    line: int = 0
    rapid: bool = False
    tag: object = None

    @property
    def turn(self) -> int:
        """1 counterclockwise, -1 clockwise, 0 for a line."""
        return 0 if self.centre is None else 1 if self.sweep > 0 else -1

    @property
    def radius(self) -> float:
        """mm, of an arc; 0 for a line."""
        return 0.0 if self.centre is None else abs(self.start - self.centre)

    @property
    def length(self) -> float:
        """mm."""
        return abs(self.end - self.start) if self.centre is None else self.radius * abs(self.sweep)

    def tangent(self, at_end: bool) -> complex:
        """Unit tangent in the direction of motion at the start or end."""
        if self.centre is None:
            return (self.end - self.start) / abs(self.end - self.start)
        arm = (self.end if at_end else self.start) - self.centre
        return 1j * self.turn * arm / abs(arm)


@dataclass(frozen=True)
class Piece:
    """One line or arc of the tool's centre.

    start, end, centre, sweep : as those of ``Element``
    element : whose piece it is
    link    : whether it goes round the corner before its element, not along it
    """

    start: complex
    end: complex
    centre: complex | None
    sweep: float
    element: Element
    link: bool = False


@dataclass
class _Offset:
    """An element and what is certain of its offset.

    start  : complex, mm, where the tool begins it
    begun  : complex, mm, where its offset would begin on its own normal; done : where it would end
    centre, sweep : of the offset arc
    cut    : mm of a line, rad of an arc, that the inside corner before it takes away
    first  : whether it leads onto the contour
    point  : whether it is an inside arc of the radius of the tool, whose centre stays at one place
    """

    element: Element
    start: complex
    begun: complex
    done: complex
    centre: complex | None
    sweep: float
    first: bool = False
    cut: float = 0.0
    open_end: bool = False
    point: bool = False
    waiting: list[object] = field(default_factory=list)

    @property
    def radius(self) -> float:
        return abs(self.done - self.centre) if self.centre is not None else 0.0

    def back(self, place: complex) -> float:
        """mm of a line, rad of an arc, from ``place`` on its carrier to its own end; negative behind the end."""
        if self.centre is None:
            return ((self.done - place) * self.element.tangent(True).conjugate()).real
        turn = self.element.turn
        return _positive(turn * cmath.phase((self.done - self.centre) / (place - self.centre)), self.radius)

    def ahead(self, place: complex) -> float:
        """mm of a line, rad of an arc, from its own start to ``place``; negative before the start."""
        if self.centre is None:
            return ((place - self.begun) * self.element.tangent(False).conjugate()).real
        turn = self.element.turn
        return _positive(turn * cmath.phase((place - self.centre) / (self.begun - self.centre)), self.radius)

    @property
    def extent(self) -> float:
        """mm of a line, rad of an arc, that is left after the corner before it."""
        if self.open_end:
            return math.inf
        return (abs(self.done - self.begun) if self.centre is None else abs(self.sweep)) - self.cut


def _positive(angle: float, radius: float) -> float:
    """The angle within 0 to 2 pi; one that is negative by less than ``_FIT`` mm is 0."""
    return 0.0 if -_FIT < angle * radius < 0 else angle % math.tau


class Contour:
    """The elements between two words of compensation.

    side   : 1 for the tool left of the contour, -1 for right
    radius : mm, of the tool, >= 0
    at     : complex, mm, where the tool stands in the plane; after each call, where the pieces so far lead
    """

    def __init__(self, side: int, radius: float, at: complex) -> None:
        self.side, self.radius, self.at = side, radius, at
        self._last: _Offset | None = None

    @property
    def waits(self) -> bool:
        """Whether an element waits for the next one."""
        return self._last is not None

    def bends(self, element: Element, style: Style) -> bool:
        """Whether a corner lies between the latest element and this one, which follows it."""
        if self._last is None:
            return False
        turn = cmath.phase(element.tangent(False) / self._last.element.tangent(True))
        return abs(turn) > style.tangent

    def add(self, element: Element, style: Style) -> Iterator[Piece | object]:
        """Take the next element; give the pieces, and the objects that waited, that are certain now.

        Raises
        ------
        CompensationError
            The tool does not fit an inside corner or an inside arc, or the first move is not allowed.
        """
        last = self._last
        if last is None:
            self._last = self._first(element, style)
            return
        offset = self._offset(element, style)
        if last.element.turn == 0 and last.first and style.approach is Approach.NEXT_NORMAL:
            yield from self._settle(offset.begun)
        else:
            yield from self._corner(last, offset, style)
        offset.start = self.at
        self._last = offset

    def wait(self, item: object) -> Iterator[object]:
        """Keep the order of anything that is no element: given back at once, or after the element that waits."""
        if self._last is None:
            yield item
        else:
            self._last.waiting.append(item)

    def close(self) -> Iterator[Piece | object]:
        """The last element to its end on its own normal, and what waited behind it.

        Raises CompensationError where the contour cannot be followed on that side.
        """
        if self._last is not None:
            yield from self._settle(self._last.done)

    def _first(self, element: Element, style: Style) -> _Offset:
        if element.turn and not style.arc_first:
            raise CompensationError("an arc in the block that begins cutter radius compensation",
                                    "begin it with a straight move")
        span = abs(element.end - self.at)
        if style.longer and span <= self.radius:
            raise CompensationError(f"the move that begins cutter radius compensation is {span:.4f} mm long; it must "
                                    f"be longer than the radius of the tool, {self.radius:g} mm")
        if element.turn:
            return self._first_arc(element, style)
        offset = self._offset(element, style)
        offset.start, offset.first, offset.open_end = self.at, True, True
        return offset

    def _first_arc(self, element: Element, style: Style) -> _Offset:
        """The arc from where the tool stands that ends on the offset of ``element`` with its tangent."""
        whole = self._offset(element, style)
        normal, chord = 1j * element.tangent(True), self.at - whole.done
        across = (chord * normal.conjugate()).real
        if abs(across) < _SAME:
            raise CompensationError("the arc that begins cutter radius compensation has no centre: the tool stands on "
                                    "its last tangent")
        centre = whole.done + normal * abs(chord) ** 2 / (2 * across)
        turn = element.turn
        sweep = turn * (turn * cmath.phase((whole.done - centre) / (self.at - centre)) % math.tau)
        return _Offset(element, self.at, self.at, whole.done, centre, sweep, first=True)

    def _offset(self, element: Element, style: Style) -> _Offset:
        shift = 1j * self.side * self.radius
        begun = element.start + shift * element.tangent(False)
        done = element.end + shift * element.tangent(True)
        inside, room = self.side * element.turn > 0, element.radius - self.radius
        point = inside and style.fillets and -_POINT <= room <= _FIT
        if inside and room <= 0 and not point:
            raise CompensationError(f"the inside arc of radius {element.radius:g} mm is not larger than the radius of "
                                    f"the tool, {self.radius:g} mm", "use a smaller tool, or a larger arc")
        return _Offset(element, begun, begun, done, element.centre, element.sweep, point=point)

    def _corner(self, last: _Offset, offset: _Offset, style: Style) -> Iterator[Piece | object]:
        """The corner between two elements; afterwards the tool stands where ``offset`` begins."""
        leaving, entering = last.element.tangent(True), offset.element.tangent(False)
        phi = self.side * cmath.phase(entering / leaving)
        back = abs(phi) >= math.pi - style.tangent
        bow = offset.element.turn or last.element.turn
        if abs(phi) <= style.tangent:
            yield from self._settle(last.done)
        elif last.point or offset.point:
            arc = (last if last.point else offset).element
            raise CompensationError(f"the inside arc of radius {arc.radius:g} mm is not larger than the radius of the "
                                    f"tool, {self.radius:g} mm, and an element next to it is not tangent",
                                    "use a smaller tool, or a larger arc")
        elif self.side * bow < 0 if back else phi > 0:
            place = self._meeting(last, offset, phi)
            offset.cut = max(offset.ahead(place), 0.0)
            yield from self._settle(place, max(last.back(place), 0.0))
        else:
            yield from self._round(last, offset, -abs(phi), style)

    def _round(self, last: _Offset, offset: _Offset, phi: float, style: Style) -> Iterator[Piece | object]:
        """The end of an element and the way round an outside corner of turn ``phi`` < 0, rad."""
        element, half = offset.element, math.tan(min(-phi / 2, 1.57))
        if style.corner is Corner.EXTENDED or (style.corner is Corner.INTERSECTION and -phi <= SHARPEST):
            reach = self.radius * (min(half, 1.0) if style.corner is Corner.EXTENDED else half)
            ahead = last.done + reach * last.element.tangent(True)
            yield from self._settle(ahead if last.centre is None else last.done)
            ways = [ahead, offset.begun - reach * element.tangent(False)]
            yield from self._links([*ways, offset.begun] if offset.centre is not None else ways, element)
        elif element.rapid:
            yield from self._settle(last.done)
            yield from self._links([offset.begun], element)
        else:
            yield from self._settle(last.done)
            yield self._piece(offset.begun, element.start, self.side * phi, element)

    def _links(self, places: Iterable[complex], element: Element) -> Iterator[Piece]:
        """Straight lines from where the tool stands to places, mm, one after the other."""
        for place in places:
            if abs(place - self.at) > _SAME:
                yield self._piece(place, None, 0.0, element)

    def _piece(self, end: complex, centre: complex | None, sweep: float, element: Element) -> Piece:
        start, self.at = self.at, end
        return Piece(start, end, centre, sweep, element, link=True)

    def _settle(self, end: complex, cut: float = 0.0) -> Iterator[Piece | object]:
        """The waiting element to ``end``, which takes ``cut`` (mm or rad) off its end; then what waited behind it."""
        last = self._last
        if last is None:
            return
        if not last.first and cut > last.extent + _FIT / max(last.radius, 1.0):
            self._too_short(last)
        sweep = last.sweep - math.copysign(last.cut + cut, last.sweep) if last.centre is not None else 0.0
        self.at, self._last = end, None
        if last.point:
            yield Piece(last.start, end, None, 0.0, last.element)
        else:
            yield Piece(last.start, end, last.centre, sweep, last.element)
        yield from last.waiting

    def _meeting(self, last: _Offset, offset: _Offset, phi: float) -> complex:
        """Where two offsets meet at an inside corner of turn ``phi``, rad."""
        slack = _FIT / max(last.radius, 1.0)
        place = self._carriers_meet(last, offset)
        if place is not None and -slack <= last.back(place) <= last.extent + slack and (
                offset.centre is None or offset.ahead(place) <= offset.extent + slack):
            return place
        need = self.radius * math.tan(min(abs(phi) / 2, 1.57))
        self._too_short(last, f"the inside corner to line {offset.element.line} takes {need:.4f} mm of straight "
                              "elements")

    def _carriers_meet(self, a: _Offset, b: _Offset) -> complex | None:
        """The meeting of two carriers (lines without ends, full circles) where the tool leaves one for the other.

        A line inside a circle is left where it comes out of the circle, one outside where it goes in; the way back is
        the mirror image. None where they do not meet.
        """
        t, u = a.element.tangent(True), b.element.tangent(False)
        inside = self.side * (b if a.centre is None else a).element.turn > 0
        if a.centre is None and b.centre is None:
            cross = (t.conjugate() * u).imag
            return None if abs(cross) < 1e-12 else a.done + t * ((b.begun - a.done).conjugate() * u).imag / cross
        if a.centre is None:
            return _on_line(a.done, t if inside else -t, b)
        if b.centre is None:
            return _on_line(b.begun, -u if inside else u, a)
        way = b.centre - a.centre
        d = abs(way)
        if d < _SAME:
            return None
        along = (d * d + a.radius**2 - b.radius**2) / (2 * d)
        left = inside == (b.element.turn > 0)
        return _reached(a.centre + way / d * along, (1j if left else -1j) * way / d, a.radius**2 - along**2)

    def _too_short(self, last: _Offset, why: str = "its inside corners take more than its length") -> NoReturn:
        place = last.element.end
        raise CompensationError(
            f"a tool of radius {self.radius:g} mm cannot follow the contour of line {last.element.line} near "
            f"({place.real:.3f}, {place.imag:.3f}): {why}, and it is {last.element.length:.4f} mm long",
            "use a smaller tool, or a contour without elements shorter than the tool needs")


def _on_line(place: complex, tangent: complex, circle: _Offset) -> complex | None:
    """The last point of a circle on a line through ``place`` along its unit ``tangent``."""
    centre = circle.centre or 0j
    foot = place + tangent * ((centre - place) * tangent.conjugate()).real
    return _reached(foot, tangent, circle.radius**2 - abs(centre - foot) ** 2)


def _reached(foot: complex, direction: complex, square: float) -> complex | None:
    """The point at the root of ``square`` (mm²) from ``foot`` along a unit direction; None where it is negative."""
    return None if square < -_FIT else foot + math.sqrt(max(square, 0.0)) * direction


__all__ = ["FANUC_STYLE", "LINUXCNC_STYLE", "Approach", "CompensationError", "Contour", "Corner", "Element", "Piece",
           "Style"]
