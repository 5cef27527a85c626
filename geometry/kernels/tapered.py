"""A ball, flat end or bull nose under a side that leans outwards: a tapered mill, as a shape for drops.

Notation
    d, r       radius of the flat bottom, and corner radius
    t          tangent of the angle between the side and the axis, above 0
    R          largest radius, where the side ends; an upright wall without end above it
    h(rho)     profile: 0 up to d; the corner, r - sqrt(r^2 - (rho - d)^2), up to the join; a line of slope 1 / t to R
    join       where corner and line touch: rho = d + r cos, h = r (1 - sin), of the angle whose tangent is t
    w          rho^2
h is convex and does not fall, so the loops of ``geometry.kernels.revolved`` apply.

Bounds: as a function of w the corner is convex and the line concave. So c + k/2 w lies below h everywhere on [0, R]
where it does so on the corner and at R. The tangent of the corner at any place, lowered until it passes R no higher
than h(R), is such a bound: where it has to be lowered, its k is above that of the line through R that touches the
corner (``bend``), and a line through R with more than ``bend`` lies below the corner.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from geometry.kernels import revolved
from geometry.kernels.drop import RIM, bull_edge, profile
from geometry.kernels.options import KERNEL
from geometry.kernels.revolved import NOTHING, for_shape, triangle_tip

BISECTIONS = 60


class Tapered(NamedTuple):
    """A shape: tapered mill; lengths in mm.

    radius       : largest radius R
    corner, flat : r and d
    join, high   : rho and h of the join
    grade        : slope of the side, 1 / t
    bend         : the least k of a line c + k/2 w that meets h at R and lies below the corner
    """

    radius: float
    corner: float
    flat: float
    join: float
    high: float
    grade: float
    bend: float


@njit(**KERNEL)
def tapered_of(radius, corner_radius, taper, widest):
    """Tapered mill of the radius of its end (d + r), corner radius, tangent t and largest radius, mm.

    The side is as long as it takes to get from the join to ``widest``.
    """
    r = min(corner_radius, radius)
    d = radius - r
    if d <= 1e-12 * radius:
        r, d = radius, 0.0
    elif r <= 1e-12 * radius:
        r, d = 0.0, radius
    long = math.sqrt(1.0 + taper * taper)
    join, high = d + r / long, r * (1.0 - taper / long)
    wide = max(widest, join)
    top, grade = high + (wide - join) / taper, 1.0 / taper
    return Tapered(wide, r, d, join, high, grade, _bend(r, d, join, high, wide, top, grade))


@njit(**KERNEL)
def _bend(r, d, join, high, wide, top, grade):
    """2 (h(R) - h) / (R^2 - rho^2) where it is largest on [0, join]: where the line through R touches the corner.

    That is no more than the slope of the corner at the join, which counts where there is next to no side.
    """
    if wide <= join * (1.0 + 1e-9):
        return grade / join
    w = wide * wide
    if r <= 0.0:
        return 2.0 * top / (w - d * d)
    lo, hi = 0.0, math.asin(min((join - d) / r, 1.0))
    for _ in range(BISECTIONS):
        theta = 0.5 * (lo + hi)
        rho, h = d + r * math.sin(theta), r - r * math.cos(theta)
        # the tangent there, d h / d w, passes R below h(R): the touch is farther out
        if math.tan(theta) / (2.0 * rho) * (w - rho * rho) < top - h:
            lo = theta
        else:
            hi = theta
    rho, h = d + r * math.sin(lo), r - r * math.cos(lo)
    return 2.0 * max((top - h) / (w - rho * rho), (top - high) / (w - join * join))


@njit(**KERNEL)
def _height_at(shape, rho):
    if rho <= shape.join:
        return profile(rho, shape.corner, shape.flat)
    return shape.high + (rho - shape.join) * shape.grade


@for_shape(revolved.radius_of, Tapered)
def _radius(shape):
    return shape.radius


@for_shape(revolved.height_at, Tapered)
def _height(shape, rho):
    return _height_at(shape, rho)


@for_shape(revolved.touches_widely, Tapered)
def _widely(shape):
    # the side touches a facet that leans as it does along a line: the edges have the rest of it
    return True


@for_shape(revolved.widened, Tapered)
def _widened(shape, off):
    flat, join, wide = shape.flat + off, shape.join + off, shape.radius + off
    top = shape.high + (wide - join) * shape.grade
    return Tapered(wide, shape.corner, flat, join, shape.high, shape.grade,
                   _bend(shape.corner, flat, join, shape.high, wide, top, shape.grade))


@for_shape(revolved.facet_contact, Tapered)
def _facet_contact(shape, nx, ny, nz):
    lean = math.sqrt(nx * nx + ny * ny)
    if lean <= 1e-14:
        return 0.0, 0.0, 0.0
    if lean <= shape.grade * nz:
        rho, h = shape.flat + shape.corner * lean, shape.corner * (1.0 - nz)
    else:
        rho, h = shape.radius, _height_at(shape, shape.radius)
    return -rho * (nx / lean), -rho * (ny / lean), h


for_shape(revolved.lift_of, Tapered)(triangle_tip)


@for_shape(revolved.edge_bound, Tapered)
def _edge_bound(shape, z0, ez, length, u0, lo, hi, q):
    return math.inf


@njit(**KERNEL)
def _place(shape, lo, hi, q, m):
    """Place u in [lo, hi] where m u - h(sqrt(q^2 + u^2)) is largest, m >= 0, with the profile's height there."""
    start = max(lo, 0.0)
    if hi <= start:
        return hi, _height_at(shape, math.sqrt(q * q + hi * hi))
    edge = math.sqrt(max((shape.join - q) * (shape.join + q), 0.0))
    if edge > start and (edge >= hi or m * shape.join <= shape.grade * edge):
        # the slope of the side is m there or more, so the place is on the corner or the flat
        end = min(hi, edge)
        if shape.corner > 0.0:
            u, h = bull_edge(start, end, q, m, shape.corner, shape.flat)
        else:
            u, h = (end if m > 0.0 else start), 0.0
        return u, h
    u = hi
    if m < shape.grade:
        u = m * q / math.sqrt((shape.grade - m) * (shape.grade + m))
    u = min(max(u, start, edge), hi)
    return u, _height_at(shape, math.sqrt(q * q + u * u))


@for_shape(revolved.edge_place, Tapered)
def _edge_place(shape, lo, hi, q, half, length, l2, ez):
    if ez >= 0.0:
        return _place(shape, lo, hi, q, ez / length)
    u, h = _place(shape, -hi, -lo, q, -ez / length)
    return -u, h


@for_shape(revolved.node_bound, Tapered)
def _bound(shape, node, x, y, best):
    """The covering plane less one of the lines in w below h, largest where each coordinate has its own maximum; or the
    top less h at the nearest place of the box."""
    R, r, d = shape.radius, shape.corner, shape.flat
    if node[4] <= best:
        return NOTHING
    x_lo, x_hi, y_lo, y_hi = node[0] - x, node[1] - x, node[2] - y, node[3] - y
    u = x_lo if x_lo > 0.0 else (x_hi if x_hi < 0.0 else 0.0)
    v = y_lo if y_lo > 0.0 else (y_hi if y_hi < 0.0 else 0.0)
    near2 = u * u + v * v
    if near2 > R * R:
        return NOTHING
    near = math.sqrt(near2)
    by_top = node[4] - _height_at(shape, near)
    if by_top <= best:
        return NOTHING
    a, b, sine, slant = node[5], node[6], node[8], node[9]
    rho0 = max(d + r * sine, near)
    if rho0 < shape.join and r > 0.0:
        t = min(rho0 - d, RIM * r)
        if t <= 0.0:
            return by_top
        rho0 = d + t
        root = math.sqrt((r - t) * (r + t))
        k = t / (root * rho0)
        low = r - root - 0.5 * k * rho0 * rho0
    elif r > 0.0:
        k = max(sine * slant / R, shape.bend)
        low = math.inf
    else:
        k = sine * slant / max(rho0, near)
        low = -0.5 * k * d * d
    if not k > 1e-12:
        return by_top
    low = min(low, shape.high + (R - shape.join) * shape.grade - 0.5 * k * R * R)
    u, v = min(max(a / k, x_lo), x_hi), min(max(b / k, y_lo), y_hi)
    return min(by_top, node[7] + a * (x + u) + b * (y + v) - low - 0.5 * k * (u * u + v * v))
