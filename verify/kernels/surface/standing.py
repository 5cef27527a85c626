"""Whether a tool of frusta takes in points where it stands."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL

MORE, OVER = 1.2, 5e-4  # a push goes farther than it must, times and mm, so that few of them suffice


@njit(**KERNEL)
def _takes_in(px, py, pz, tip, axis, frusta):
    x, y, z = px - tip[0], py - tip[1], pz - tip[2]
    h = x * axis[0] + y * axis[1] + z * axis[2]
    rho = math.sqrt(max(x * x + y * y + z * z - h * h, 0.0))
    for k in range(len(frusta)):
        z0, z1, r0, r1 = frusta[k, 0], frusta[k, 1], frusta[k, 2], frusta[k, 3]
        if z0 < h < z1 and rho < r0 + (r1 - r0) * (h - z0) / (z1 - z0):
            return True
    return False


@njit(**KERNEL)
def first_inside(points, first, balls, frusta, tip, axis, hint):
    """Index of a point that the tool takes in, -1 for none.

    points : (n, 3) float64, mm, grouped
    first  : (g + 1,) int64, index of the first point of each group, and n
    balls  : (g, 4) float64, mm: a ball round the points of each group, centre and radius
    frusta : (k, 4) float64, mm: lower and upper end over the tip, and the radii there
    tip, axis : (3,) float64, mm and unit, frame of the points
    hint   : index of the point that is looked at first
    """
    if 0 <= hint < len(points) and _takes_in(points[hint, 0], points[hint, 1], points[hint, 2], tip, axis, frusta):
        return hint
    for g in range(len(balls)):
        x, y, z, r = balls[g, 0] - tip[0], balls[g, 1] - tip[1], balls[g, 2] - tip[2], balls[g, 3]
        h = x * axis[0] + y * axis[1] + z * axis[2]
        rho = math.sqrt(max(x * x + y * y + z * z - h * h, 0.0))
        low, high = len(frusta), 0  # the frusta that the ball may meet
        for k in range(len(frusta)):
            if frusta[k, 0] < h + r and frusta[k, 1] > h - r and rho < max(frusta[k, 2], frusta[k, 3]) + r:
                low, high = min(low, k), k + 1
        if low < high:
            met = frusta[low:high]
            for i in range(first[g], first[g + 1]):
                if _takes_in(points[i, 0], points[i, 1], points[i, 2], tip, axis, met):
                    return i
    return -1


@njit(**KERNEL)
def _deepest(points, tip, axis, frusta, most):
    """Index of the point that is deepest inside the side of a tool, and its depth in mm; -1 and 0 for none.

    A point deeper than ``most`` mm ends the search.
    """
    found, deepest = -1, 0.0
    low, high, widest = frusta[:, 0].min(), frusta[:, 1].max(), max(frusta[:, 2].max(), frusta[:, 3].max())
    for i in range(len(points)):
        x, y, z = points[i, 0] - tip[0], points[i, 1] - tip[1], points[i, 2] - tip[2]
        h = x * axis[0] + y * axis[1] + z * axis[2]
        rho2 = x * x + y * y + z * z - h * h
        if h <= low or h >= high or rho2 >= (widest - deepest) * (widest - deepest):
            continue
        for k in range(len(frusta)):
            z0, z1 = frusta[k, 0], frusta[k, 1]
            if z0 < h < z1:
                wide = frusta[k, 2] + (frusta[k, 3] - frusta[k, 2]) * (h - z0) / (z1 - z0)
                if wide > deepest and rho2 < (wide - deepest) * (wide - deepest):
                    found, deepest = i, wide - math.sqrt(max(rho2, 0.0))
                break
        if deepest > most:
            break
    return found, deepest


@njit(**KERNEL)
def _push(tip, axis, point, by):
    """Move a tip square to its axis, away from a point by ``by`` mm, or towards it where that is negative."""
    x, y, z = tip[0] - point[0], tip[1] - point[1], tip[2] - point[2]
    h = x * axis[0] + y * axis[1] + z * axis[2]
    x, y, z = x - h * axis[0], y - h * axis[1], z - h * axis[2]
    size = math.sqrt(x * x + y * y + z * z)
    if size > 0.0:
        tip[0] += by * x / size
        tip[1] += by * y / size
        tip[2] += by * z / size


@njit(**KERNEL)
def _beside(points, first, balls, frusta, tip, axis, room):
    """The points of the groups that come within ``room`` mm of a tool."""
    count, chosen = 0, np.zeros(len(balls), np.bool_)
    for g in range(len(balls)):
        x, y, z, r = balls[g, 0] - tip[0], balls[g, 1] - tip[1], balls[g, 2] - tip[2], balls[g, 3] + room
        h = x * axis[0] + y * axis[1] + z * axis[2]
        rho = math.sqrt(max(x * x + y * y + z * z - h * h, 0.0))
        for k in range(len(frusta)):
            if frusta[k, 0] < h + r and frusta[k, 1] > h - r and rho < max(frusta[k, 2], frusta[k, 3]) + r:
                chosen[g] = True
                count += first[g + 1] - first[g]
                break
    out, n = np.empty((count, 3)), 0
    for g in range(len(balls)):
        if chosen[g]:
            for i in range(first[g], first[g + 1]):
                for c in range(3):
                    out[n, c] = points[i, c]
                n += 1
    return out


@njit(**KERNEL)
def settle(points, first, balls, frusta, tip, axis, place, radius, most, rounds):
    """Move a tool square to its axis until it takes in no point and still touches a place; whether it does.

    points, first, balls, frusta, axis : as those of ``first_inside``
    tip    : (3,) float64, mm, changed in place
    place  : (3,) float64, mm
    radius : mm: the tool touches the place where its axis is as near to it
    most   : mm, depth of points from which on nothing is tried
    rounds : number of pushes

    It is pushed away from the deepest point and drawn back to the place in turn. Where both sets of tips are convex
    near by, this ends in their common part if they have one. It goes no farther than twice ``most``.
    """
    start, near = tip.copy(), _beside(points, first, balls, frusta, tip, axis, 2.0 * most)
    for _ in range(rounds):
        found, depth = _deepest(near, tip, axis, frusta, most)
        x, y, z = tip[0] - place[0], tip[1] - place[1], tip[2] - place[2]
        h = x * axis[0] + y * axis[1] + z * axis[2]
        rho = math.sqrt(max(x * x + y * y + z * z - h * h, 0.0))
        if found < 0 and rho <= radius:
            return True
        if depth > most:
            return False
        if rho > radius:
            _push(tip, axis, place, MORE * (radius - rho) - OVER)
        if found >= 0:
            _push(tip, axis, near[found], MORE * depth + OVER)
        x, y, z = tip[0] - start[0], tip[1] - start[1], tip[2] - start[2]
        if x * x + y * y + z * z > 4.0 * most * most:
            return False
    return False
