"""A solid as a few boxes that hold it: fixtures are boxes, and the one box round a clamp holds much air.

The box round the solid is cut along the planes of its faces that are square to an axis, and evenly between them. Cells
that the solid enters are joined to boxes. So a clamp of upright and level planes is covered exactly, and any other
solid with at most a cell of room. Lengths are mm.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64

CELLS = (12, 8, 5, 3)  # even parts of each side, the first number that gives few enough boxes
SQUARE = 1e-9  # of a unit normal: less aside is square to an axis
NEAR = 1e-6  # mm, or of the longest side: planes nearer to one another are one
MAX_PLANES = 16  # square to one axis; of more planes none is exact
FULL = 0.97  # of its box: a fuller solid is its box
MAX_PIECES = 400_000  # of triangles
# Where in a cell its inside is looked up: off the middle, so that no ray runs along an edge of the mesh.
LOOK = (0.4871, 0.5213, 0.4937)
BOOL = NDArray[np.bool_]


def box_cover(triangles: F64, plane: BOOL, off: float, bounds: F64, most: int) -> F64:
    """Boxes that hold a closed mesh and the solid that it was made of.

    triangles : (n, 3, 3) float64, mm, outward, any frame
    plane     : (n,) bool, whether a triangle lies in a plane face; the others are up to ``off`` mm off the solid
    bounds    : (2, 3) float64, mm, same frame, the box round the solid
    most      : largest count of boxes

    Returns (k, 2, 3) float64, mm, same frame, lower and upper corners, k at most ``most``; they do not overlap. It is
    the box round the solid where that is nearly full, or where ``most`` is not enough.
    """
    whole = bounds[None].copy()
    size = bounds[1] - bounds[0]
    volume = float(np.einsum("ij,ij->i", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])).sum()) / 6.0
    if most < 2 or not (size > 0.0).all() or volume >= FULL * size.prod():
        return whole
    for parts in CELLS:
        lines = [_lines(triangles, plane, bounds, k, parts) for k in range(3)]
        held = _held(triangles, plane, off, lines)
        if held is None:
            return whole
        boxes = list(_boxes(held, lines))
        if len(boxes) <= most:
            return np.array(boxes)
    return whole


def _lines(triangles: F64, plane: BOOL, bounds: F64, axis: int, parts: int) -> F64:
    """Planes square to an axis that cut the box, ascending."""
    low, high = bounds[:, axis]
    near = NEAR * max(1.0, float((bounds[1] - bounds[0]).max()))
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    aside = np.delete(np.abs(normal), axis, axis=1).max(axis=1)
    at = np.sort(triangles[plane & (aside <= SQUARE * np.abs(normal[:, axis])), 0, axis])
    at = at[(np.diff(at, prepend=-np.inf) > near) & (at > low + near) & (at < high - near)]
    at = np.concatenate([[low], at if len(at) <= MAX_PLANES else [], [high]])
    step = (high - low) / parts
    counts = np.maximum(np.ceil(np.diff(at) / step - 1e-9).astype(int), 1)
    return np.concatenate([*(np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(at[:-1], at[1:], counts, strict=True)),
                           [high]])


def _held(triangles: F64, plane: BOOL, off: float, lines: list[F64]) -> BOOL | None:
    """(a, b, c) bool, cells that the solid enters; None where the mesh is too fine to tell."""
    held = np.zeros([len(x) - 1 for x in lines], np.bool_)
    least = np.array([np.diff(x).min() for x in lines])
    wide = np.array([max(np.diff(x).max(), 1e-12) for x in lines])
    pieces, grown = triangles, np.where(plane, 0.0, off)
    while len(pieces):
        if len(pieces) > MAX_PIECES:
            return None
        low, high = pieces.min(axis=1), pieces.max(axis=1)
        small = ((high - low) <= 0.5 * wide).all(axis=1)
        _mark(held, lines, low[small] - grown[small, None], high[small] + grown[small, None], 1e-6 * least)
        pieces, grown = _halves(pieces[~small], wide), np.repeat(grown[~small], 2)
    inside = _inside(triangles, lines)
    return held | inside


def _mark(held: BOOL, lines: list[F64], low: F64, high: F64, room: F64) -> None:
    """Mark the cells whose inside boxes, (n, 3) mm each corner, enter by more than ``room``, (3,) mm."""
    first, last = [], []
    for k, x in enumerate(lines):
        first.append(np.clip(np.searchsorted(x, low[:, k] + room[k], side="right") - 1, 0, len(x) - 2))
        last.append(np.clip(np.searchsorted(x, high[:, k] - room[k], side="left") - 1, 0, len(x) - 2))
        # a box without thickness in the plane between two cells enters none
        flat = high[:, k] - low[:, k] <= 2.0 * room[k]
        on = np.abs(x[np.clip(np.searchsorted(x, low[:, k] + room[k], side="right") - 1, 0, len(x) - 1)]
                    - low[:, k]) <= 2.0 * room[k]
        last[k] = np.where(flat & on, first[k] - 1, np.maximum(last[k], first[k]))
    for a, b, c, d, e, f in zip(*first, *last, strict=True):
        held[a:d + 1, b:e + 1, c:f + 1] = True


def _halves(pieces: F64, wide: F64) -> F64:
    """Each triangle halved at its longest side, measured in cells; the two halves follow one another."""
    sides = np.linalg.norm((np.roll(pieces, -1, axis=1) - pieces) / wide, axis=2)
    k, row = sides.argmax(axis=1), np.arange(len(pieces))
    a, b, c = pieces[row, k], pieces[row, (k + 1) % 3], pieces[row, (k + 2) % 3]
    middle = 0.5 * (a + b)
    return np.stack([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)], axis=1).reshape(-1, 3, 3)


def _inside(triangles: F64, lines: list[F64]) -> BOOL:
    """(a, b, c) bool, cells with a place inside of the mesh, by the number of triangles over that place."""
    x, y, z = (v[:-1] + s * np.diff(v) for v, s in zip(lines, LOOK, strict=True))
    out = np.zeros((len(x), len(y), len(z)), np.bool_)
    p, q, r = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    area = (q[:, 0] - p[:, 0]) * (r[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (r[:, 0] - p[:, 0])
    p, q, r, area = p[area != 0.0], q[area != 0.0], r[area != 0.0], area[area != 0.0]
    for i, a in enumerate(x.tolist()):
        for j, b in enumerate(y.tolist()):
            u = ((q[:, 0] - a) * (r[:, 1] - b) - (q[:, 1] - b) * (r[:, 0] - a)) / area
            v = ((r[:, 0] - a) * (p[:, 1] - b) - (r[:, 1] - b) * (p[:, 0] - a)) / area
            hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
            heights = u[hit] * p[hit, 2] + v[hit] * q[hit, 2] + (1.0 - u[hit] - v[hit]) * r[hit, 2]
            out[i, j] = (heights[:, None] > z).sum(axis=0) % 2 == 1
    return out


def _boxes(held: BOOL, lines: list[F64]) -> Iterator[F64]:
    """Boxes of held cells: each as long as it goes along Z, then X, then Y. Each is (2, 3) float64, mm."""
    rest = held.copy()
    while rest.any():
        a, b, c = (int(v) for v in np.argwhere(rest)[0])
        f = c
        while f + 1 < rest.shape[2] and rest[a, b, f + 1]:
            f += 1
        d = a
        while d + 1 < rest.shape[0] and rest[d + 1, b, c:f + 1].all():
            d += 1
        e = b
        while e + 1 < rest.shape[1] and rest[a:d + 1, e + 1, c:f + 1].all():
            e += 1
        rest[a:d + 1, b:e + 1, c:f + 1] = False
        yield np.array([[x[i] for x, i in zip(lines, (a, b, c), strict=True)],
                        [x[i + 1] for x, i in zip(lines, (d, e, f), strict=True)]])
