"""Nearest triangle of a mesh and its distance, over the triangle hierarchy (exact, closed form per triangle)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _segment2(px, py, pz, p, q):
    """Squared distance from a point to a segment."""
    ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    wx, wy, wz = px - p[0], py - p[1], pz - p[2]
    length2 = ux * ux + uy * uy + uz * uz
    s = min(max((wx * ux + wy * uy + wz * uz) / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
    return (wx - s * ux) ** 2 + (wy - s * uy) ** 2 + (wz - s * uz) ** 2


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def triangle2(px, py, pz, t):
    """Squared distance from a point to a triangle (3, 3): to its plane over it, else to its edges."""
    ux, uy, uz = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    vx, vy, vz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    n2 = nx * nx + ny * ny + nz * nz
    wx, wy, wz = px - t[0, 0], py - t[0, 1], pz - t[0, 2]
    if n2 > 0.0:
        f = ((wy * vz - wz * vy) * nx + (wz * vx - wx * vz) * ny + (wx * vy - wy * vx) * nz) / n2
        g = ((uy * wz - uz * wy) * nx + (uz * wx - ux * wz) * ny + (ux * wy - uy * wx) * nz) / n2
        if f >= 0.0 and g >= 0.0 and f + g <= 1.0:
            h = wx * nx + wy * ny + wz * nz
            return h * h / n2
    return min(_segment2(px, py, pz, t[0], t[1]), _segment2(px, py, pz, t[1], t[2]), _segment2(px, py, pz, t[2], t[0]))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def foot(px, py, pz, t):
    """The point of a triangle (3, 3) that ``triangle2`` measures to."""
    p, u, v, w = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    p[0], p[1], p[2] = px, py, pz
    for c in range(3):
        u[c], v[c], w[c] = t[1, c] - t[0, c], t[2, c] - t[0, c], p[c] - t[0, c]
    uu, uv, vv = np.dot(u, u), np.dot(u, v), np.dot(v, v)
    wu, wv, det = np.dot(w, u), np.dot(w, v), uu * vv - uv * uv
    out = np.empty(3)
    if det > 0.0:
        f, g = (wu * vv - wv * uv) / det, (wv * uu - wu * uv) / det
        if f >= 0.0 and g >= 0.0 and f + g <= 1.0:
            for c in range(3):
                out[c] = t[0, c] + f * u[c] + g * v[c]
            return out
    best = np.inf
    for c in range(3):
        out[c] = t[0, c]
    for k in range(3):
        following = (k + 1) % 3
        for c in range(3):
            u[c], w[c] = t[following, c] - t[k, c], p[c] - t[k, c]
        length2 = np.dot(u, u)
        s = min(max(np.dot(w, u) / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
        for c in range(3):
            v[c] = t[k, c] + s * u[c]
            w[c] = p[c] - v[c]
        d2 = np.dot(w, w)
        if d2 < best:
            best = d2
            for c in range(3):
                out[c] = v[c]
    return out


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _box2(lower, upper, px, py, pz):
    x = max(lower[0] - px, 0.0, px - upper[0])
    y = max(lower[1] - py, 0.0, py - upper[1])
    z = max(lower[2] - pz, 0.0, pz - upper[2])
    return x * x + y * y + z * z


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def nearest_row(lower, upper, child, first, size, corners, px, py, pz, most2, stack):
    """Squared distance in mm² from a point to the mesh, and the row of the nearest triangle.

    most2 : mm², end of the search: most2 and -1 are returned then; stack : (128,) int64, overwritten
    """
    best, found = most2, -1
    stack[0], depth = 0, 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if _box2(lower[node], upper[node], px, py, pz) >= best:
            continue
        c = child[node]
        if c < 0:
            for k in range(first[node], first[node] + size[node]):
                d2 = triangle2(px, py, pz, corners[k])
                if d2 < best:
                    best, found = d2, k
            continue
        left_near = _box2(lower[c], upper[c], px, py, pz) <= _box2(lower[c + 1], upper[c + 1], px, py, pz)
        stack[depth], stack[depth + 1] = (c + 1, c) if left_near else (c, c + 1)
        depth += 2
    return best, found


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def nearest_triangles(lower, upper, child, first, size, corners, points, limit, out, row, feet):
    """out[i] = distance in mm from points[i] to the mesh, row[i] the row of the nearest triangle, feet[i] the place.

    limit : mm, end of the search: inf and -1 there, as for an empty mesh
    """
    stack = np.empty(128, np.int64)
    for i in range(len(points)):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        best, found = nearest_row(lower, upper, child, first, size, corners, px, py, pz, limit * limit, stack)
        out[i] = math.sqrt(best) if found >= 0 else np.inf
        row[i] = found
        if found >= 0:
            place = foot(px, py, pz, corners[found])
            for k in range(3):
                feet[i, k] = place[k]
