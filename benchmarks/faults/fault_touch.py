"""Loops of the brute-force twin: which places standing tools touch or take, pose by pose."""

from __future__ import annotations

import numpy as np
from numba import njit

REACH = 1.0  # mm, no residual is told above it


@njit(cache=True, nogil=True)
def _seen(p, tip, axis):
    """Height over the tip and distance from the axis at which a tool sees a place (3,), mm."""
    x, y, z = p[0] - tip[0], p[1] - tip[1], p[2] - tip[2]
    h = x * axis[0] + y * axis[1] + z * axis[2]
    return h, np.sqrt(max(x * x + y * y + z * z - h * h, 0.0))


@njit(cache=True, nogil=True)
def in_cutter(rho, h, radius, corner, length, upright):
    """How deep (rho, h) is in a cutting part, mm: over its end or aside where upright, else the shortest way out."""
    if h < 0.0 or h > length or rho > radius:
        return -1.0
    a = radius - corner
    bottom = corner - np.sqrt(max(corner**2 - max(rho - a, 0.0) ** 2, 0.0))
    if h <= bottom:
        return -1.0
    if upright:
        return min(h - bottom, radius - rho)
    if h < corner and rho > a:
        return corner - np.sqrt((rho - a) ** 2 + (corner - h) ** 2)
    return min(radius - rho, h, length - h)


@njit(cache=True, nogil=True)
def _in_shape(shape, h, rho):
    z0, z1 = shape[0], shape[1]
    if not z0 < h < z1:
        return -1.0
    d = shape[2] + (shape[3] - shape[2]) * (h - z0) / (z1 - z0) - rho
    return d if shape[4] > 0.0 else min(d, h - z0)


@njit(cache=True, nogil=True)
def taken_in(points, tips, axes, shapes):
    """(n,) bool: which places (n, 3) mm any of the shapes (k, 5) takes in at poses (m, 3), (m, 3)."""
    out = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        for m in range(len(tips)):
            h, rho = _seen(points[i], tips[m], axes[m])
            for k in range(len(shapes)):
                if _in_shape(shapes[k], h, rho) > 0.0:
                    out[i] = True
            if out[i]:
                break
    return out


@njit(cache=True, nogil=True)
def taken_at(points, tips, axes, moves, cutter, out):
    """Lower out (n,) to the first of the moves (m,) whose cutter (3,) mm at its poses takes each place (n, 3), mm."""
    far2 = cutter[0] ** 2 + cutter[2] ** 2
    for i in range(len(points)):
        for m in range(len(tips)):
            if moves[m] >= out[i]:
                continue
            x, y, z = points[i, 0] - tips[m, 0], points[i, 1] - tips[m, 1], points[i, 2] - tips[m, 2]
            r2 = x * x + y * y + z * z
            if r2 > far2:
                continue
            h = x * axes[m, 0] + y * axes[m, 1] + z * axes[m, 2]
            if in_cutter(np.sqrt(max(r2 - h * h, 0.0)), h, cutter[0], cutter[1], cutter[2], True) > 0.0:
                out[i] = moves[m]


@njit(cache=True, nogil=True)
def touch_standing(tips, axes, moves, points, gone, shapes, cutter, upright):
    """As ``touch``, of places that no move up to that of the pose has taken; moves (m,), gone (n,)."""
    best, which = np.zeros(len(tips)), np.zeros(len(tips), np.int64)
    for m in range(len(tips)):
        for i in range(len(points)):
            if gone[i] <= moves[m]:
                continue
            h, rho = _seen(points[i], tips[m], axes[m])
            d = -1.0
            if len(shapes) == 0:
                # over a tool along Z everything stands in its way, however long the flutes are
                d = in_cutter(rho, h, cutter[0], cutter[1], 1e9 if upright else cutter[2], upright)
            for k in range(len(shapes)):
                d = max(d, _in_shape(shapes[k], h, rho))
            if d > best[m]:
                best[m], which[m] = d, i
    return best, which


@njit(cache=True, nogil=True)
def touch(tips, axes, points, shapes, cutter, upright):
    """Deepest point of (n, 3) in the shapes (k, 5), or in the cutter (3,) where k is 0, for poses (m, 3) and (m, 3).

    shapes : z0, z1, r0, r1 mm, and whether only the way aside counts

    Returns (m,) depth, mm, and (m,) index of the point.
    """
    moves, gone = np.zeros(len(tips), np.int64), np.ones(len(points), np.int64)
    return touch_standing(tips, axes, moves, points, gone, shapes, cutter, upright)


@njit(cache=True, nogil=True)
def swept(points, wanted, tips, axes, cutter):
    """(n,) bool: which of the wanted places (n, 3) mm any cutter (3,) mm at poses (m, 3), (m, 3) takes."""
    out = np.zeros(len(points), np.bool_)
    far2 = cutter[0] ** 2 + cutter[2] ** 2
    for i in range(len(points)):
        if not wanted[i]:
            continue
        for m in range(len(tips)):
            x, y, z = points[i, 0] - tips[m, 0], points[i, 1] - tips[m, 1], points[i, 2] - tips[m, 2]
            r2 = x * x + y * y + z * z
            if r2 > far2:
                continue
            h = x * axes[m, 0] + y * axes[m, 1] + z * axes[m, 2]
            if in_cutter(np.sqrt(max(r2 - h * h, 0.0)), h, cutter[0], cutter[1], cutter[2], True) > 0.0:
                out[i] = True
                break
    return out


@njit(cache=True, nogil=True)
def _taken(p, n, t, tip, axis, cutter):
    x, y, z = p[0] + t * n[0] - tip[0], p[1] + t * n[1] - tip[1], p[2] + t * n[2] - tip[2]
    h = x * axis[0] + y * axis[1] + z * axis[2]
    rho = np.sqrt(max(x * x + y * y + z * z - h * h, 0.0))
    return in_cutter(rho, h, cutter[0], cutter[1], cutter[2], True) > 0.0


@njit(cache=True, nogil=True)
def remain(points, normals, left, tips, axes, cutter):
    """Lower ``left`` (n,) mm on normals (n, 3) of places (n, 3) mm by a cutter (3,) at poses (m, 3), (m, 3)."""
    far = np.sqrt(cutter[0] ** 2 + cutter[2] ** 2) + REACH
    for i in range(len(points)):
        p, n = points[i], normals[i]
        for m in range(len(tips)):
            d = (p[0] - tips[m, 0]) ** 2 + (p[1] - tips[m, 1]) ** 2 + (p[2] - tips[m, 2]) ** 2
            if left[i] <= 0.0 or d > far * far:
                continue
            low = -0.05
            for k in range(1, 42):
                t = 0.0005 if k == 1 else (k - 1) * REACH / 40.0
                if low >= left[i]:
                    break
                t = min(t, left[i])
                if _taken(p, n, t, tips[m], axes[m], cutter):
                    high = t
                    for _ in range(16):
                        mid = 0.5 * (low + high)
                        if _taken(p, n, mid, tips[m], axes[m], cutter):
                            high = mid
                        else:
                            low = mid
                    left[i] = min(left[i], high)
                    break
                low = t
