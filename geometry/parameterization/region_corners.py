"""The four sides of a region: which places of its border become corners of the unit square.

A border turns by 2 pi in total. The search looks for four places that turn by a right angle each, with little turning
between them and opposite sides of similar length. It tries every choice of four from the sharpest places and some
places evenly along the border. A choice costs

    sum over corners ((pi/2 - turn) / (pi/2))²  +  sum over what is left (turn / (pi/2))²
        +  SHAPE (ln² + ln²)  +  ASPECT ln²

The sum counts turns outwards only: a side may turn inwards, a corner may not. The logarithms are of the ratios of
opposite sides, and of the ratio of one pair of sides to the other. The cheapest choice wins. So a triangle gets its
fourth corner on a side, a pentagon loses its bluntest corner, and a disc is cut into quarters.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from geometry.errors import GeometryError
from geometry.mesh import F64

SHAPE, ASPECT = 0.25, 0.05
NARROW, WINDOW = 0.004, 0.02  # of the border, to each side: a turn is measured over it, at sharp and at rounded corners
SHARP = np.radians(20.0)
MAX_SHARP = 14
EVENLY = 12  # further places to choose from


@dataclass(frozen=True, eq=False)
class Corners:
    """Four corners of a closed border.

    at    : (4,) int64, index of the places in the border, counterclockwise, the least number first
    turn  : (4,) float64, rad, by which the border turns there, positive outwards
    sharp : count of the places of the border that turn outwards by 20 degrees or more
    cost  : dimensionless, of the choice
    """

    at: np.ndarray
    turn: F64
    sharp: int
    cost: float

    def sides(self, border: F64) -> tuple[F64, F64, F64, F64]:
        """Sides of a border from corner to corner.

        border : (n, d) float64, mm, in the plane of the parameters or in space

        Returns bottom, right, top and left, each (k, d) float64, mm.
        """
        n = len(border)
        out = []
        for a, b in zip(self.at.tolist(), np.roll(self.at, -1).tolist(), strict=True):
            out.append(border[np.arange(a, b + 1 if b > a else b + n + 1) % n])
        return out[0], out[1], out[2], out[3]


def find_corners(border: F64) -> Corners:
    """The corners of a region.

    border : (n, 2) float64, mm, in the plane, closed, counterclockwise, the first place not repeated; n at least 4

    Raises
    ------
    GeometryError
        Code 'bad_border': fewer than four places, two equal neighbours, or clockwise.
    """
    around = np.vstack([border, border[:1]])
    step = np.linalg.norm(np.diff(around, axis=0), axis=1)
    area = 0.5 * float((around[:-1, 0] * around[1:, 1] - around[1:, 0] * around[:-1, 1]).sum())
    if len(border) < 4 or not (step > 0.0).all() or not area > 0.0:
        raise GeometryError(f"the border has {len(border)} places and {area:g} mm²; it needs at least four places, "
                            "no two equal neighbours, and a counterclockwise order", code="bad_border", measured=area,
                            limit=0.0)
    way = np.concatenate([[0.0], np.cumsum(step)])
    chosen, sharp = _candidates(around, way)
    best, cost = None, np.inf
    at = way[chosen] / way[-1]
    total = float((np.maximum(sharp, 0.0) ** 2).sum())
    for four in combinations(range(len(chosen)), 4):
        f = np.array(four)
        own = sharp[f]
        here = float((((0.5 * np.pi - own) / (0.5 * np.pi)) ** 2).sum())
        here += (total - float((np.maximum(own, 0.0) ** 2).sum())) / (0.5 * np.pi) ** 2
        if here >= cost:
            continue
        length = np.diff(np.append(at[f], at[f[0]] + 1.0))
        here += SHAPE * (np.log(length[0] / length[2]) ** 2 + np.log(length[1] / length[3]) ** 2)
        here += ASPECT * np.log((length[0] + length[2]) / (length[1] + length[3])) ** 2
        if here < cost:
            best, cost = f, here
    assert best is not None  # the places evenly along the border alone are enough
    return Corners(chosen[best], sharp[best], int((sharp >= SHARP).sum()), float(cost))


def _turns(around: F64, way: F64, window: float) -> F64:
    """(n,) float64, rad: turn of the border at each place, over a share of its length to both sides."""
    total = way[-1]
    long = np.concatenate([way[:-1] - total, way, way[1:] + total])
    tour = np.vstack([around[:-1], around, around[1:]])

    def place(s: F64) -> F64:
        return np.column_stack([np.interp(s, long, tour[:, c]) for c in (0, 1)])

    s = way[:-1]
    back, ahead = place(s) - place(s - window * total), place(s + window * total) - place(s)
    return np.arctan2(back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0], (back * ahead).sum(axis=1))


def _candidates(around: F64, way: F64) -> tuple[np.ndarray, F64]:
    """Candidate places in order, and the turn of the border there, rad.

    The search adds the sharpest places by the narrow window first, so that the two corners of a narrow end count as
    two. Then it adds rounded corners, which only the wide window sees, and then some places evenly along the border.
    """
    total, s = way[-1], way[:-1]
    out: list[int] = []
    value: list[float] = []

    def apart(k: int) -> float:
        return float(np.abs((s[k] - s[out] + 0.5 * total) % total - 0.5 * total).min()) if out else float(total)

    for window in (NARROW, WINDOW):
        turn = _turns(around, way, window)
        for k in np.argsort(-turn, kind="stable").tolist():
            if turn[k] < SHARP or len(out) == MAX_SHARP:
                break
            if apart(k) > 1.5 * window * total:
                out.append(k)
                value.append(float(turn[k]))
    first = s[out[0]] if out else 0.0  # the result does not depend on where the border begins
    evenly = np.searchsorted(s, np.sort((first + np.arange(EVENLY) * total / EVENLY) % total)) % len(s)
    spare = evenly.tolist() if len(s) > 3 * EVENLY else range(len(s))
    for k in spare:
        if apart(k) > (WINDOW * total if len(s) > 3 * EVENLY else 0.0):
            out.append(k)
            value.append(float(turn[k]))
    order = np.argsort(out)
    return np.array(out)[order], np.array(value)[order]
