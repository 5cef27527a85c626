"""Snap rounding: segments in plan become pieces on an integer grid that meet only at their ends [Hobby1999].

1. End points are rounded to the grid. A pixel is the square of one grid step round a grid point, its left and bottom
   side included, its right and top side not, so every place is in exactly one.
2. Hot pixels are those with an end point or a crossing in them. The crossings come from shapely's union on a grid.
3. Every segment is routed through the centres of the hot pixels it runs through, in their order. The tests are exact in
   int64. Each step is a piece. Pieces then meet only at their ends [Guibas1998], and each keeps the segments that run
   over it.

Floating point decides in step 2 only. The exact construction of the map (``zones.plan_view.trapezoidal_map``) detects a
missed crossing; the crossing then becomes hot and step 3 is repeated.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.mesh import F64
from zones.kernels.trapezoid import LIMIT

I64 = NDArray[np.int64]
MIN_PART = 4.0  # grid steps: shorter parts of a segment do not pay for a box of their own


@dataclass(frozen=True, eq=False)
class Noding:
    """A noded arrangement on the grid.

    grid     : mm, one step
    segments : (s, 2, 2) int64, the input rounded to the grid, zero length included
    hot      : (h, 2) int64, hot pixels, sorted by x, then y; every end of a piece is one
    pieces   : (n, 2) int64, indices into ``hot``, lesser first, sorted, none twice
    starts   : (n + 1,) int64; piece k came from the segments ``sources[starts[k]:starts[k + 1]]``
    sources  : (m,) int64, indices into ``segments``, ascending for each piece
    """

    grid: float
    segments: I64
    hot: I64
    pieces: I64
    starts: I64
    sources: I64

    def with_crossing(self, first: int, second: int) -> Noding:
        """The same segments with hot pixels at the crossings of two pieces' segments.

        first, second : pieces that cross. Returns a new noding, unchanged if there is no crossing.
        """
        more = []
        for a in self.sources[self.starts[first] : self.starts[first + 1]].tolist():
            for b in self.sources[self.starts[second] : self.starts[second + 1]].tolist():
                pixel = crossing_pixel(self.segments[a].tolist(), self.segments[b].tolist())
                if pixel is not None:
                    more.append(pixel)
        hot = np.unique(np.vstack([self.hot, np.array(more, np.int64).reshape(-1, 2)]), axis=0)
        return _led(self.grid, self.segments, hot)


def node_segments(segments: ArrayLike, grid: float) -> Noding:
    """Snap-round segments to a grid [Hobby1999; Guibas1998].

    segments : (s, 2, 2) float64, mm, in plan; they may cross, overlap, repeat or have zero length
    grid     : mm, > 0
    Returns a ``Noding``; every piece lies within half a grid step (in x and in y) of each of its segments. Segments
    that round to one point have no piece and no effect.
    Raises InputError (bad_segments, not_finite, bad_grid, out_of_bounds).
    References: Hobby, Practical segment intersection with finite precision output, 1999; Guibas and Marimont,
    Rounding arrangements dynamically, 1998.
    """
    rounded = on_grid(segments, grid)
    some = _distinct(rounded)
    hot = np.vstack([some.reshape(-1, 2), _vertices(shapely.linestrings(some.astype(float)))])
    return _led(grid, rounded, np.unique(hot, axis=0))


def on_grid(segments: ArrayLike, grid: float) -> I64:
    """End points in grid steps, halves rounded up: (s, 2, 2) int64, index of the grid.

    segments : (s, 2, 2) float64, mm, in plan
    grid     : mm, > 0

    Raises InputError (bad_segments, not_finite, bad_grid, or out_of_bounds: not within 2^25 grid steps).
    """
    v = finite_pairs(segments, "(n, 2, 2)")
    if not (np.isfinite(grid) and grid > 0.0):
        raise InputError(f"the grid step is {grid} mm", code="bad_grid", measured=float(grid), limit=0.0,
                         remedy="give a positive length, such as 0.001 mm")
    most, limit = float(np.abs(v).max(initial=0.0)), (LIMIT - 1) * grid
    if not most <= limit:
        raise InputError(f"a coordinate of {most:.6g} mm is beyond the limit of {limit:.6g} mm, 2^25 grid steps",
                         code="out_of_bounds", measured=most, limit=limit,
                         remedy="take a coarser grid, or move the segments to the origin")
    return np.floor(v / grid + 0.5).astype(np.int64)


def finite_pairs(values: ArrayLike, shape: str) -> F64:
    """Coordinates as float64 after a check, in the unit and frame of the input.

    values : (n, 2) or (n, 2, 2) float64, mm or grid steps, in plan
    shape  : "(n, 2)" for points or "(n, 2, 2)" for segments
    Returns (n, 2) or (n, 2, 2) float64, mm or grid steps as given, in plan.
    Raises InputError (bad_segments, not_finite; the subjects are the rows).
    """
    try:
        v = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as e:
        raise InputError("coordinates are not numbers", code="bad_segments", remedy=f"give an array {shape}") from e
    tail = (2, 2) if shape == "(n, 2, 2)" else (2,)
    if v.size == 0:
        v = v.reshape(0, *tail)
    if v.shape[1:] != tail:
        raise InputError(f"coordinates have the shape {v.shape}", code="bad_segments", measured=list(v.shape),
                         limit=shape, remedy=f"give an array {shape}, mm")
    bad = np.flatnonzero(~np.isfinite(v).all(axis=tuple(range(1, v.ndim))))
    if len(bad):
        raise InputError(f"{len(bad)} of {len(v)} rows hold a coordinate that is not finite", code="not_finite",
                         subjects=tuple(str(int(k)) for k in bad[:10]), measured=len(bad), limit=0,
                         remedy="remove or repair these rows")
    return v


def crossing_pixel(s: list[list[int]], t: list[list[int]]) -> tuple[int, int] | None:
    """Pixel with the crossing of two segments, exactly; None where they do not cross or are parallel."""
    (ax, ay), (bx, by) = s
    (cx, cy), (dx, dy) = t
    ux, uy, vx, vy = bx - ax, by - ay, dx - cx, dy - cy
    den = ux * vy - uy * vx
    if den == 0:
        return None
    a = (cx - ax) * vy - (cy - ay) * vx
    b = (cx - ax) * uy - (cy - ay) * ux
    if den < 0:
        den, a, b = -den, -a, -b
    if not (0 <= a <= den and 0 <= b <= den):
        return None
    return (2 * (ax * den + a * ux) + den) // (2 * den), (2 * (ay * den + a * uy) + den) // (2 * den)


def runs_through(segments: I64, pixels: I64) -> NDArray[np.bool_]:
    """Whether segment k runs through pixel k, exactly.

    segments : (n, 2, 2) int64, index of the grid
    pixels   : (n, 2) int64, index of the grid
    Returns (n,) bool.

    Doubled coordinates make the corners whole; products stay below 2^56.
    """
    p, q = 2 * segments[:, 0], 2 * segments[:, 1]
    low, high = 2 * pixels - 1, 2 * pixels + 1
    overlap = ((np.minimum(p, q) < high) & (np.maximum(p, q) >= low)).all(axis=1)
    d = q - p
    side = [d[:, 0] * (y[:, 1] - p[:, 1]) - d[:, 1] * (x[:, 0] - p[:, 0]) for x in (low, high) for y in (low, high)]
    above = np.any([s > 0 for s in side], axis=0)
    below = np.any([s < 0 for s in side], axis=0)
    return overlap & ((above & below) | (side[0] == 0))  # through the inside, or the one corner that belongs to it


def _distinct(segments: I64) -> I64:
    """Segments longer than zero, each once."""
    p, q = segments[:, 0], segments[:, 1]
    swap = (p[:, 0] > q[:, 0]) | ((p[:, 0] == q[:, 0]) & (p[:, 1] > q[:, 1]))
    flat = np.where(swap[:, None], np.hstack([q, p]), np.hstack([p, q]))
    return np.unique(flat[(p != q).any(axis=1)], axis=0).reshape(-1, 2, 2)


def _vertices(lines: Iterable[shapely.LineString]) -> I64:
    """Vertices of the union on the grid: ends and crossings."""
    return np.rint(shapely.get_coordinates(shapely.union_all(lines, grid_size=1.0))).astype(np.int64).reshape(-1, 2)


def _led(grid: float, segments: I64, hot: I64) -> Noding:
    """Step 3: every segment through the centres of its hot pixels."""
    s, h = _near(segments, hot)
    through = runs_through(segments[s], hot[h]) & (segments[s, 0] != segments[s, 1]).any(axis=1)
    s, h = s[through], h[through]
    along = ((hot[h] - segments[s, 0]) * (segments[s, 1] - segments[s, 0])).sum(axis=1)
    rank = np.lexsort((along, s))
    s, h = s[rank], h[rank]
    same = s[1:] == s[:-1]
    pairs = np.sort(np.column_stack([h[:-1][same], h[1:][same]]), axis=1)
    return _sorted_pieces(grid, segments, hot, pairs, s[:-1][same])


def _sorted_pieces(grid: float, segments: I64, hot: I64, pairs: I64, source: I64) -> Noding:
    """A noding from pairs of hot pixels (k, 2), lesser first, and the segments (k,) they came from."""
    pieces, piece = np.unique(pairs, axis=0, return_inverse=True)
    both = np.unique(np.column_stack([piece.ravel(), source]), axis=0)
    starts = np.searchsorted(both[:, 0], np.arange(len(pieces) + 1)).astype(np.int64)
    return Noding(grid, segments, hot, pieces, starts, np.ascontiguousarray(both[:, 1]))


def _near(segments: I64, hot: I64) -> tuple[I64, I64]:
    """Pairs (segment, hot pixel) that may touch: boxes of short parts of the segments against the pixels.

    A part is as long as the mean distance of the pixels, so that the box of a slanting segment does not cover the plan.
    """
    n = len(segments)
    if n == 0 or len(hot) == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    p, d = segments[:, 0].astype(float), (segments[:, 1] - segments[:, 0]).astype(float)
    length = np.hypot(d[:, 0], d[:, 1])
    spread = float(np.prod(np.ptp(hot, axis=0) + 1.0))
    part = max(MIN_PART, float(np.sqrt(spread / len(hot))), float(length.sum()) / (4 * (n + len(hot))))
    parts = np.maximum(1, np.ceil(length / part)).astype(np.int64)
    of = np.repeat(np.arange(n), parts)
    k = np.arange(len(of)) - np.repeat(np.cumsum(parts) - parts, parts)
    a = p[of] + d[of] * (k / parts[of])[:, None]
    b = p[of] + d[of] * ((k + 1) / parts[of])[:, None]
    low, high = np.minimum(a, b) - 1.0, np.maximum(a, b) + 1.0
    tree = shapely.STRtree(shapely.points(hot.astype(float)))
    found = tree.query(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))
    pairs = np.unique(of[found[0]] * len(hot) + found[1])
    return pairs // len(hot), pairs % len(hot)
