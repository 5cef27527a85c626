"""First hit of a ray on a mesh.

Notation
    o, d     origin and direction; a point of the ray is o + t d, so t is in lengths of d
    u, v     barycentric weights [Moller1997], extended by EDGE so that a ray that meets a
             shared edge or vertex meets at least one of its triangles
Both sides of a triangle count. The traversal is that of the drop kernel: near child first, a bit a level.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from geometry.kernels.bvh import TreeArrays
from geometry.kernels.options import KERNEL

EDGE = 1e-10
HUGE = 1e300


@njit(**KERNEL)
def _enter(lo, hi, o0, o1, o2, i0, i1, i2, t_min, t_max):
    """Where the ray enters a box, inf when it misses; i0.. are the reciprocals of the direction."""
    a, b = (lo[0] - o0) * i0, (hi[0] - o0) * i0
    near, far = min(a, b), max(a, b)
    a, b = (lo[1] - o1) * i1, (hi[1] - o1) * i1
    near, far = max(near, min(a, b)), min(far, max(a, b))
    a, b = (lo[2] - o2) * i2, (hi[2] - o2) * i2
    near, far = max(near, min(a, b)), min(far, max(a, b))
    # The slabs are rounded; let the box out by a few units in the last place.
    slack = 1e-14 * (abs(near) + abs(far))
    if near - slack > far + slack or far + slack < t_min or near - slack > t_max:
        return np.inf
    return max(near - slack, t_min)


@njit(**KERNEL)
def _meet(v, o0, o1, o2, d0, d1, d2):
    """t of the crossing with one triangle, NaN when there is none."""
    ex, ey, ez = v[1, 0] - v[0, 0], v[1, 1] - v[0, 1], v[1, 2] - v[0, 2]
    fx, fy, fz = v[2, 0] - v[0, 0], v[2, 1] - v[0, 1], v[2, 2] - v[0, 2]
    px, py, pz = d1 * fz - d2 * fy, d2 * fx - d0 * fz, d0 * fy - d1 * fx
    det = ex * px + ey * py + ez * pz
    if det == 0.0:
        return np.nan
    sx, sy, sz = o0 - v[0, 0], o1 - v[0, 1], o2 - v[0, 2]
    u = (sx * px + sy * py + sz * pz) / det
    if not -EDGE <= u <= 1.0 + EDGE:
        return np.nan
    qx, qy, qz = sy * ez - sz * ey, sz * ex - sx * ez, sx * ey - sy * ex
    w = (d0 * qx + d1 * qy + d2 * qz) / det
    if not (w >= -EDGE and u + w <= 1.0 + EDGE):
        return np.nan
    return (fx * qx + fy * qy + fz * qz) / det


@njit(**KERNEL, inline="always")
def _reciprocal(d):
    return 1.0 / d if abs(d) > 1.0 / HUGE else HUGE


@njit(**KERNEL)
def first_hit(tree: TreeArrays, o0, o1, o2, d0, d1, d2, t_min, t_max):
    """Smallest t in [t_min, t_max] at which the ray meets the mesh, and the triangle; (inf, -1): none."""
    i0, i1, i2 = _reciprocal(d0), _reciprocal(d1), _reciprocal(d2)
    lower, upper, child, parent = tree.lower, tree.upper, tree.child, tree.parent
    best, slot = t_max, -1
    node = 0
    trail = np.uint64(0)
    one = np.uint64(1)
    if _enter(lower[0], upper[0], o0, o1, o2, i0, i1, i2, t_min, best) == np.inf:
        return np.inf, -1
    while True:
        inner = child[node]
        if inner >= 0:
            left = _enter(lower[inner], upper[inner], o0, o1, o2, i0, i1, i2, t_min, best)
            right = _enter(lower[inner + 1], upper[inner + 1], o0, o1, o2, i0, i1, i2, t_min, best)
            if left < np.inf or right < np.inf:
                trail <<= one
                if left < np.inf and right < np.inf:
                    trail |= one
                node = inner if left <= right else inner + 1
                continue
        else:
            for i in range(tree.first[node], tree.first[node] + tree.size[node]):
                t = _meet(tree.corners[i], o0, o1, o2, d0, d1, d2)
                if t_min <= t and (t < best or (t == best and slot < 0)):
                    best, slot = t, i
        while True:
            if trail == 0:
                return (best, tree.order[slot]) if slot >= 0 else (np.inf, -1)
            while trail & one == 0:
                trail >>= one
                node = parent[node]
            trail ^= one
            node = ((node - 1) ^ 1) + 1
            if _enter(lower[node], upper[node], o0, o1, o2, i0, i1, i2, t_min, best) < np.inf:
                break


@njit(**KERNEL)
def hit_range(tree, origins, directions, t_min, t_max, lo, hi, t, triangle):
    """``first_hit`` for the rays lo .. hi - 1."""
    for i in range(lo, hi):
        o, d = origins[i], directions[i]
        t[i], triangle[i] = first_hit(tree, o[0], o[1], o[2], d[0], d[1], d[2], t_min, t_max)


@njit(**KERNEL, parallel=True)
def hits_parallel(tree, origins, directions, t_min, t_max, t, triangle):
    """``hit_range`` over all rays, on the threads numba has."""
    for i in prange(origins.shape[0]):
        hit_range(tree, origins, directions, t_min, t_max, i, i + 1, t, triangle)
