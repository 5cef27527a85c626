"""Chamfers and roundings between two moves of a contour, and moves onto it and off it.

Points of the plane are complex numbers in mm.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from verify.gcode.dialects.base import BlockError

_SAME = 1e-9
_FIT = 1e-6


@dataclass(frozen=True)
class Leg:
    """A line or an arc: start and end, the centre of an arc, and whether it turns left; complex, mm."""

    start: complex
    end: complex
    centre: complex | None = None
    left: bool = False

    def tangent(self, at_end: bool) -> complex:
        """Unit direction of motion at the start or end.

        Raises
        ------
        BlockError
            The move has no length.
        """
        arm = self.end - self.start
        if self.centre is not None:
            arm = ((self.end if at_end else self.start) - self.centre) * (1j if self.left else -1j)
        if abs(arm) < _SAME:
            raise BlockError("a corner, an approach or a departure next to a move without length in the plane")
        return arm / abs(arm)

    def holds(self, place: complex) -> bool:
        """Whether a point of the carrier lies on the leg."""
        if self.centre is None:
            t = self.tangent(False)
            along = ((place - self.start) * t.conjugate()).real
            return -_FIT <= along <= abs(self.end - self.start) + _FIT
        whole = self._angle(self.end)
        return self._angle(place) <= (whole or math.tau) + 1e-7

    def _angle(self, place: complex) -> float:
        """rad from the start to a point, in the sense of the arc, 0 to 2 pi."""
        assert self.centre is not None
        ratio = (place - self.centre) / (self.start - self.centre)
        angle = math.atan2(ratio.imag, ratio.real) * (1 if self.left else -1)
        return angle % math.tau if angle < -1e-9 else max(angle, 0.0)


def chamfer(first: Leg, second: Leg, size: float) -> tuple[complex, complex]:
    """Ends of a chamfer that takes ``size`` mm off both lines.

    Raises
    ------
    BlockError
        An arc, or a line that is shorter.
    """
    if first.centre is not None or second.centre is not None:
        raise BlockError("a chamfer needs a straight line before it and after it")
    if size > min(abs(first.end - first.start), abs(second.end - second.start)) + _FIT:
        raise BlockError(f"a chamfer of {size:g} mm is longer than a line next to it")
    return first.end - size * first.tangent(True), second.start + size * second.tangent(False)


def rounding(first: Leg, second: Leg, radius: float) -> tuple[complex, complex, complex, bool] | None:
    """Ends, centre and sense (left) of the arc of ``radius`` mm that is tangent to both legs at their corner.

    Returns None where the legs are tangent already.

    Raises
    ------
    BlockError
        No such arc touches both.
    """
    a, b = first.tangent(True), second.tangent(False)
    cross = (a.conjugate() * b).imag
    if abs(cross) < 1e-7 and (a.conjugate() * b).real > 0:
        return None
    side = 1 if cross > 0 else -1
    corner = first.end
    best: tuple[float, complex, complex, complex] | None = None
    for centre in _meetings(first, second, side * radius):
        p, q = _foot(first, centre), _foot(second, centre)
        if first.holds(p) and second.holds(q):
            far = abs(p - corner) + abs(q - corner)
            if best is None or far < best[0]:
                best = far, p, q, centre
    if best is None:
        raise BlockError(f"a rounding of {radius:g} mm does not fit between the moves next to it, near "
                         f"({corner.real:.3f}, {corner.imag:.3f})")
    return best[1], best[2], best[3], side > 0


def _foot(leg: Leg, place: complex) -> complex:
    """The point of the carrier nearest to a place."""
    if leg.centre is None:
        t = leg.tangent(False)
        return leg.start + t * ((place - leg.start) * t.conjugate()).real
    arm = place - leg.centre
    return leg.centre + (arm / abs(arm) if abs(arm) > _SAME else 1.0) * abs(leg.start - leg.centre)


def _meetings(first: Leg, second: Leg, offset: float) -> list[complex]:
    """Common points of the carriers, moved to their left by ``offset`` mm."""
    lines, circles = [], []
    for leg in (first, second):
        if leg.centre is None:
            t = leg.tangent(False)
            lines.append((leg.start + 1j * t * offset, t))
        else:
            radius = abs(leg.start - leg.centre) - (offset if leg.left else -offset)
            if radius > _SAME:
                circles.append((leg.centre, radius))
    if len(lines) == 2:
        (p, t), (q, u) = lines
        cross = (t.conjugate() * u).imag
        return [] if abs(cross) < 1e-12 else [p + t * ((q - p).conjugate() * u).imag / cross]
    if len(lines) == 1 and len(circles) == 1:
        (p, t), (c, r) = lines[0], circles[0]
        foot = p + t * ((c - p) * t.conjugate()).real
        square = r * r - abs(c - foot) ** 2
        return [] if square < -_FIT else [foot + s * math.sqrt(max(square, 0.0)) * t for s in (-1, 1)]
    if len(circles) == 2:
        (c, r), (d, s) = circles
        way = d - c
        far = abs(way)
        if far < _SAME:
            return []
        along = (far * far + r * r - s * s) / (2 * far)
        square = r * r - along * along
        foot = c + way / far * along
        return [] if square < -_FIT else [foot + k * math.sqrt(max(square, 0.0)) * 1j * way / far for k in (-1, 1)]
    return []


__all__ = ["Leg", "chamfer", "rounding"]
