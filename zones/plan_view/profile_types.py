"""The ten profile types of [Arivazhagan2020, table 1], made computable: one type for every curve, with a margin.

    polyline -> B-spline -> bends, skew, roundness (zones.plan_view.curve_bends) -> decision table -> type, level
    the same table with each measure moved over its nearest limit -> margin and second type

The curve is walked with the void on its left. So the part decides its start, and the same side of a wall always gives
the same curve. Definitions, pictures and ambiguities: docs/theory/profiles.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from geometry.array_checks import finite_points
from zones.plan_view.curve_bends import BendMeasures, BendSide, CurveBend, measure_bends

# Limits of the table. Beyond the last relative distance there is no second type.
SKEW = 0.10
ROUND = 0.88
NOTHING_NEAR = 0.99


class ProfileType(StrEnum):
    """Profile types of [Arivazhagan2020, table 1]."""

    C1 = "C1"
    """Single up."""
    C2 = "C2"
    """Double up."""
    C3 = "C3"
    """Triple up, even."""
    C4 = "C4"
    """Single down."""
    C5 = "C5"
    """Five up, closed."""
    C6 = "C6"
    """Two up, closed, with ends that may differ."""
    C7 = "C7"
    """Triple up, to the left."""
    C8 = "C8"
    """Triple up, to the right."""
    C9 = "C9"
    """Triple up, each bend near an arc."""
    C10 = "C10"
    """Continuous multiple."""


class Level(StrEnum):
    """Complexity, which decides the order of machining."""

    SIMPLE = "simple"
    MEDIUM = "medium"
    HIGH = "high"


LEVEL: dict[ProfileType, Level] = {
    ProfileType.C1: Level.SIMPLE, ProfileType.C4: Level.SIMPLE,
    ProfileType.C2: Level.MEDIUM, ProfileType.C3: Level.MEDIUM, ProfileType.C6: Level.MEDIUM,
    ProfileType.C5: Level.HIGH, ProfileType.C7: Level.HIGH, ProfileType.C8: Level.HIGH, ProfileType.C9: Level.HIGH,
    ProfileType.C10: Level.HIGH,
}
"""Level of each type; a straight curve is simple."""

OPEN = {0: ProfileType.C4, 1: ProfileType.C1, 2: ProfileType.C2}
"""Type by number of up bends, where the number alone decides; more than three give C10."""
CLOSED = {0: ProfileType.C4, 1: ProfileType.C1, 2: ProfileType.C6, 5: ProfileType.C5}
"""The same on a ring; other numbers give C10."""


class VoidSide(StrEnum):
    """Side of the void in a walk along the points."""

    LEFT = "left"
    RIGHT = "right"


@dataclass(frozen=True)
class CurveProfile:
    """The type of a curve with the measures that decide it.

    type      : ProfileType, None for a curve without a bend
    level     : Level
    margin    : 0..1, the least relative change of one measure (strength of a bend, skew, roundness) that gives another
                type: |measure - limit| over the greater of the two
    second    : the type on the other side of that limit; None for straight, and where nothing is near (margin 1)
    bends     : tuple of Bend, in walking order; on a ring from its least curvature on
    skew      : centroid of the area between curve and chord off the middle, in chords, negative to the left
    roundness : mean over the up bends, 1 for arcs; 0 without any
    closed    : a ring
    """

    type: ProfileType | None
    level: Level
    margin: float
    second: ProfileType | None
    bends: tuple[CurveBend, ...]
    skew: float
    roundness: float
    closed: bool


def classify(points: ArrayLike, closed: bool = False, void: VoidSide = VoidSide.LEFT) -> CurveProfile:
    """The profile type of a curve [Arivazhagan2020, table 1].

    points : (n, 2) float64, mm, in plan of the access frame; four hundred or more where they carry noise
    closed : a ring; the last point is not repeated
    void   : VoidSide along the points; curves of ``wall_sections`` have the void on the left

    Returns
    -------
    CurveProfile
        The same for a curve that is moved, turned, scaled or sampled otherwise, and for the reversed points with the
        void on the other side. With noise of 1 % of the chord it does not change for 399 or more of 400 curves a type,
        and for 364 of type C9 (docs/theory/profiles.md).

    Raises
    ------
    GeometryError
        Points of another shape, not finite, or without length.
    """
    p = finite_points(points, 2, "points")
    measures = measure_bends(p if void == VoidSide.LEFT else p[::-1], closed)
    place = measures.counted
    bends = measures.levels[place].bends
    kind = _decide(measures, bends, measures.skew, roundness_of(bends))
    margin, second = _nearest_other(measures, place, kind)
    return CurveProfile(kind, LEVEL[kind] if kind else Level.SIMPLE, margin, second, _ordered(measures, bends),
                   measures.skew, roundness_of(bends), closed)


def roundness_of(bends: tuple[CurveBend, ...]) -> float:
    """Mean roundness of the up bends, 0 without any."""
    found = [b.roundness for b in bends if b.way == BendSide.UP]
    return float(np.mean(found)) if found else 0.0


def _decide(measures: BendMeasures, bends: tuple[CurveBend, ...], skew: float, roundness: float) -> ProfileType | None:
    """The decision table."""
    if not bends:
        return None
    ups = sum(b.way == BendSide.UP for b in bends)
    if measures.closed:
        return CLOSED.get(ups, ProfileType.C10)
    return _decide_triple(skew, roundness) if ups == 3 else OPEN.get(ups, ProfileType.C10)


def _decide_triple(skew: float, roundness: float) -> ProfileType:
    if abs(skew) > SKEW:
        return ProfileType.C7 if skew < 0 else ProfileType.C8
    return ProfileType.C9 if roundness >= ROUND else ProfileType.C3


def _nearest_other(measures: BendMeasures, place: int, kind: ProfileType | None) -> tuple[float, ProfileType | None]:
    """Relative distance to the nearest limit with another type behind it, and that type."""
    found: list[tuple[float, ProfileType | None]] = []
    for step in (-1, 1):
        i = place + step
        while 0 <= i < len(measures.levels):
            level = measures.levels[i]
            other = _decide(measures, level.bends, measures.skew, roundness_of(level.bends))
            if other != kind:
                # The bend that has to cross strength 1: the strongest removed one, or the weakest that stays.
                found.append((_relative(level.most if step < 0 else level.least, 1.0), other))
                break
            i += step
    bends = measures.levels[place].bends
    skew, roundness = measures.skew, roundness_of(bends)
    beyond = np.copysign(SKEW * (1.01 if abs(skew) <= SKEW else 0.99), skew)
    across = ROUND * (0.99 if roundness >= ROUND else 1.01)
    found.append((_relative(abs(skew), SKEW), _decide(measures, bends, float(beyond), roundness)))
    found.append((_relative(roundness, ROUND), _decide(measures, bends, skew, across)))
    others = [(m, t) for m, t in found if t != kind and m < NOTHING_NEAR]
    return min(others, key=lambda f: f[0]) if others else (1.0, None)


def _relative(measure: float, limit: float) -> float:
    return 1.0 if not np.isfinite(measure) else abs(measure - limit) / max(measure, limit)


def _ordered(measures: BendMeasures, bends: tuple[CurveBend, ...]) -> tuple[CurveBend, ...]:
    """Bends in walking order; on a ring from the bend with the least curvature, in the direction the ring turns."""
    if not measures.closed or len(bends) < 2:
        return bends
    u = np.linspace(0.0, 1.0, 720, endpoint=False)
    at = float(u[int(np.argmin(np.copysign(1.0, measures.turn) * measures.spline.curvature(u)))])
    first = int(np.argmin([abs((at - 0.5 * (b.start + b.end) + 0.5) % 1.0 - 0.5) for b in bends]))
    return bends[first:] + bends[:first]
