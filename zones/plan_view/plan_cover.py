"""Area that triangles cover in plan, by its border alone.

An edge that two triangles pass in opposite directions is inside; the other edges form directed borders. Their winding
number at a place is the number of triangles over it (``TrapezoidMap.windings``). So overlaps and the small folds of
triangles on a steep face need no special care, and no union of single triangles is needed.
"""

from __future__ import annotations

import numpy as np
import shapely

from geometry.mesh import F64, I32, TriangleMesh
from zones.plan_view.snap_rounding import I64

FACES_UP = 1e-3  # n_z above: a triangle covers part of the plan; steeper triangles 50 mm high cover 0.05 mm
THIN = 5e-4  # mm, largest shift of straightened borders, half a step of the grid they are rounded to


def upward(mesh: TriangleMesh) -> F64:
    """n_z of each triangle, (m,) float64, dimensionless: that of the exact surface at its corners, else its own.

    Triangles of a steep twisted face point up and down by turns; its surface does not.
    """
    own = mesh.normals[:, 2]
    if mesh.corner_normals is None:
        return np.asarray(own)
    slope = mesh.corner_normals[:, :, 2].mean(axis=1)
    return np.where(np.isfinite(slope), slope, own)


def cover_border(vertices: F64, faces: I32, level: float = -np.inf) -> F64:
    """Directed borders in plan, (k, 2, 2) float64, mm, of the area that triangles cover above a level.

    vertices : (n, 3) float64, mm, access frame
    faces    : (m, 3) int32, index, triangles that face up, with shared corners
    level    : mm; the covered area lies to the left of the borders, which are straightened by at most ``THIN``
    """
    p, z = vertices[:, :2], vertices[:, 2]
    f = faces.astype(np.int64)
    high = z[f] > level
    f, high = f[high.any(axis=1)], high[high.any(axis=1)]
    if not len(f):
        return np.zeros((0, 2, 2))
    start, end = f, f[:, [1, 2, 0]]
    start_high, end_high = high, high[:, [1, 2, 0]]
    crossing = start_high != end_high
    ends = np.stack([start[crossing], end[crossing]], axis=1)
    ends = np.where(start_high[crossing][:, None], ends[:, ::-1], ends)  # the low one first: one cut for both sides
    keys, at = np.unique(ends, axis=0, return_inverse=True)
    low, top = keys[:, 0], keys[:, 1]
    t = (level - z[low]) / (z[top] - z[low])
    places = np.concatenate([p, p[low] + t[:, None] * (p[top] - p[low])])
    cut = np.full(f.shape, -1, np.int64)
    cut[crossing] = len(p) + at.ravel()
    some = start_high | end_high
    edges = [np.stack([np.where(start_high, start, cut)[some], np.where(end_high, end, cut)[some]], axis=1)]
    across = crossing.any(axis=1)  # two edges of each cross the level; the border runs from falling to rising edge
    sinks, rises = (crossing & start_high)[across], (crossing & end_high)[across]
    edges.append(np.stack([cut[across][sinks], cut[across][rises]], axis=1))
    left = _left_over(np.concatenate(edges), len(places))
    return np.concatenate([np.zeros((0, 2, 2)), *(_straight(places, e) for e in left)])


def _left_over(edges: I64, count: int) -> list[I64]:
    """Directed edges (k, 2) without an opposite edge; edges left twice or more often come in lists of their own."""
    low, high = edges.min(axis=1), edges.max(axis=1)
    key, at = np.unique(low * count + high, return_inverse=True)
    net = np.zeros(len(key), np.int64)
    np.add.at(net, at.ravel(), np.where(edges[:, 0] == low, 1, -1))
    pairs = np.stack([key // count, key % count], axis=1)
    pairs = np.where((net < 0)[:, None], pairs[:, ::-1], pairs)
    net = np.where(pairs[:, 0] == pairs[:, 1], 0, np.abs(net))
    return [pairs[net >= k] for k in range(1, int(net.max(initial=0)) + 1)]


def _straight(places: F64, edges: I64) -> F64:
    """The edges as segments (k, 2, 2); chains keep their ends and fewer points."""
    merged = shapely.line_merge(shapely.multilinestrings(places[edges]), directed=True)
    lines = shapely.get_parts(shapely.simplify(merged, THIN, preserve_topology=False))
    points = [shapely.get_coordinates(line) for line in lines]
    return np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in points])
