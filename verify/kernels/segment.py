"""Outline of circle segment mills in their half section: heights, widths, and signed distances with their gradients.

Notation
    flat, r    : radius of the flat end, and of the lower arc round (flat, r)
    out, up, b : centre and radius of the upper arc; b may be 0, a rim
    H, R, L    : height at which the upper arc ends and the side of radius R begins, and flute length
    phi        : angle of an outward normal (sin, -cos) off the axis downwards; 0 on the flat, a right angle on the side
    phi_j, phi_e : where the arcs touch, and where the upper one ends; both are less than or equal to a right angle
The outline is convex. The signed distance to a convex outline is the largest of the distances to its tangents; of an
arc that is the tangent towards the point where that is in its range. Beside the rim (R, H) of a barrel that leans at
its end the rim itself is the nearest place.
"""

from __future__ import annotations

import math

from numba import njit

from geometry.kernels.cutter_sizes import CutterSizes, arcs_touch
from geometry.kernels.options import KERNEL

HALVINGS = 40


@njit(**KERNEL)
def arc_bottom(rho, cutter: CutterSizes):
    """Height of the end over the tip at distance rho from the axis, which may be beyond its radius."""
    flat, r = cutter.radius - cutter.corner, cutter.round
    if rho <= flat:
        return 0.0
    if rho <= arcs_touch(cutter)[0]:
        return r - math.sqrt(max(r * r - (rho - flat) * (rho - flat), 0.0))
    x = rho - cutter.out
    return cutter.up - math.sqrt(max(cutter.bow * cutter.bow - x * x, 0.0))


@njit(**KERNEL)
def arc_width(over, cutter: CutterSizes):
    """Radius of the profile ``over`` mm above the tip, 0 <= over."""
    if over >= cutter.cone:
        return cutter.radius
    if over <= arcs_touch(cutter)[1]:
        return cutter.radius - cutter.corner + math.sqrt(max(over * (2.0 * cutter.round - over), 0.0))
    y = cutter.up - over
    return cutter.out + math.sqrt(max(cutter.bow * cutter.bow - y * y, 0.0))


@njit(**KERNEL)
def _slope(rho, flat, join, cutter):
    """Slope of the end at distance rho from the axis, dimensionless."""
    if rho <= flat:
        return 0.0
    x, r = (rho - flat, cutter.round) if rho <= join else (rho - cutter.out, cutter.bow)
    x = min(x, r * (1.0 - 1e-12))
    return x / math.sqrt(r * r - x * x) if r > 0.0 else math.inf


@njit(**KERNEL)
def lowest_on_arcs(wx, wy, dx, dy, dz, s1, s2, cutter: CutterSizes):
    """Where on [s1, s2] the end over a line is lowest: (wx, wy) is the line seen from the tip, D the move."""
    flat, join = cutter.radius - cutter.corner, arcs_touch(cutter)[0]
    lo, hi = s1, s2
    for _ in range(HALVINGS):
        s = 0.5 * (lo + hi)
        ux, uy = wx - s * dx, wy - s * dy
        rho = math.sqrt(ux * ux + uy * uy)
        slope = dz
        if rho > flat:
            slope -= _slope(rho, flat, join, cutter) * (ux * dx + uy * dy) / rho
        if slope > 0.0:
            hi = s
        else:
            lo = s
    return 0.5 * (lo + hi)


@njit(**KERNEL)
def joint_normal(cutter: CutterSizes):
    """Sine and cosine of phi_j, at which the arcs touch."""
    far = cutter.bow - cutter.round
    return (cutter.radius - cutter.corner - cutter.out) / far, (cutter.up - cutter.round) / far


@njit(**KERNEL)
def end_normal(cutter: CutterSizes):
    """Sine and cosine of phi_e, at which the upper arc ends."""
    if cutter.bow <= 0.0:
        return 1.0, 0.0
    return (cutter.radius - cutter.out) / cutter.bow, (cutter.up - cutter.cone) / cutter.bow


@njit(**KERNEL)
def arc_gradient(rho, h, cutter: CutterSizes):
    """Signed distance, mm, to end and side under an endless cylinder, and its derivatives by rho and h."""
    sj, cj = joint_normal(cutter)
    se, ce = end_normal(cutter)
    x, y = rho - (cutter.radius - cutter.corner), cutter.round - h
    best, gr, gh = -h, 0.0, -1.0
    if x >= 0.0 and x * cj <= y * sj:
        far = math.sqrt(x * x + y * y)
        if far - cutter.round > best and far > 0.0:
            best, gr, gh = far - cutter.round, x / far, -y / far
    out = x * sj + y * cj - cutter.round
    if out > best:
        best, gr, gh = out, sj, -cj
    x, y = rho - cutter.out, cutter.up - h
    if x * cj >= y * sj and x * ce <= y * se:
        far = math.sqrt(x * x + y * y)
        if far - cutter.bow > best and far > 0.0:
            best, gr, gh = far - cutter.bow, x / far, -y / far
    out = x * se + y * ce - cutter.bow
    if out > best:
        best, gr, gh = out, se, -ce
    x, y = rho - cutter.radius, cutter.cone - h
    if y >= 0.0 and x * ce >= y * se and x > 0.0:
        far = math.sqrt(x * x + y * y)
        if far > best:
            best, gr, gh = far, x / far, -y / far
    if x > best:
        best, gr, gh = x, 1.0, 0.0
    return best, gr, gh


@njit(**KERNEL)
def on_lower_arc(x, y, cutter: CutterSizes):
    """Whether a place x beside and y under the centre of the lower arc is nearest to that arc."""
    sj, cj = joint_normal(cutter)
    return x >= 0.0 and x * cj <= y * sj


@njit(**KERNEL)
def touching_place(aside, down, cutter: CutterSizes):
    """Where the outline touches a plane: distance from the axis and height, mm.

    aside, down : of the outward unit normal of the outline there, away from the axis and downwards, down > 0
    """
    sj, cj = joint_normal(cutter)
    if aside * cj <= down * sj:
        return cutter.radius - cutter.corner + cutter.round * aside, cutter.round * (1.0 - down)
    se, ce = end_normal(cutter)
    if aside * ce <= down * se:
        return cutter.out + cutter.bow * aside, cutter.up - cutter.bow * down
    return cutter.radius, cutter.cone
