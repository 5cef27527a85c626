"""The end of a circle segment mill, two arcs that touch, as a shape for drops.

Notation
    d, r       radius of the flat bottom, and radius of the lower arc round (d, r)
    e, z, b    centre (distance from the axis, height) and radius of the upper arc; b may be 0: a rim
    R          largest radius, where the upper arc ends; an upright wall without end above it
    h(rho)     profile: 0 up to d, the lower arc up to the join, the upper arc up to R
    m          slope of an edge; q its distance from the axis; u a place along it
h is convex and does not fall, so the loops of ``geometry.kernels.revolved`` apply.

Bounds: the upper arc lies above its tangent at the join. So the profile lies above that of a tapered mill with the same
lower arc and that tangent as its side, whose bound applies (``geometry.kernels.tapered``).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from geometry.kernels import revolved
from geometry.kernels.drop import bull_edge
from geometry.kernels.options import KERNEL
from geometry.kernels.revolved import NOTHING, arc_angle, for_shape, node_bound, triangle_tip, widened
from geometry.kernels.tapered import Tapered, tapered_of


class TwoArcs(NamedTuple):
    """A shape: circle segment mill; lengths in mm.

    radius         : largest radius R
    flat, low      : d and r
    out, up, bow   : e, z and b
    join, high     : rho and h of the join
    top            : h(R)
    sine, cosine   : of the angle of the profile at the join
    grade, bend    : of the tapered mill below it, as in ``Tapered``
    """

    radius: float
    flat: float
    low: float
    out: float
    up: float
    bow: float
    join: float
    high: float
    top: float
    sine: float
    cosine: float
    grade: float
    bend: float


@njit(**KERNEL)
def two_arcs_of(flat, low, out, up, bow, radius, top):
    """Circle segment mill of the sizes of ``geometry.tool_body.ArcPair``, mm; the arcs touch from inside."""
    far = bow - low
    sine, cosine = (flat - out) / far, (up - low) / far
    join, high = flat + low * sine, low * (1.0 - cosine)
    # the tapered mill of that tangent: a ball or bull of the lower arc, whose side begins at the join
    under = tapered_of(flat + low, low, max(cosine, 1e-9) / max(sine, 1e-9), radius)
    return TwoArcs(radius, flat, low, out, up, bow, join, high, top, sine, cosine, under.grade, under.bend)


@njit(**KERNEL)
def _under(shape):
    return Tapered(shape.radius, shape.low, shape.flat, shape.join, shape.high, shape.grade, shape.bend)


@njit(**KERNEL)
def _height_at(shape, rho):
    t = rho - shape.flat
    if t <= 0.0:
        return 0.0
    if rho <= shape.join:
        return shape.low - math.sqrt(max((shape.low - t) * (shape.low + t), 0.0))
    t = rho - shape.out
    return shape.up - math.sqrt(max((shape.bow - t) * (shape.bow + t), 0.0))


@for_shape(revolved.radius_of, TwoArcs)
def _radius(shape):
    return shape.radius


@for_shape(revolved.height_at, TwoArcs)
def _height(shape, rho):
    return _height_at(shape, rho)


@for_shape(revolved.touches_widely, TwoArcs)
def _widely(shape):
    # a level facet is touched all over a flat bottom
    return True


@for_shape(revolved.widened, TwoArcs)
def _widened(shape, off):
    return TwoArcs(shape.radius + off, shape.flat + off, shape.low, shape.out + off, shape.up, shape.bow,
                   shape.join + off, shape.high, shape.top, shape.sine, shape.cosine, shape.grade,
                   widened(_under(shape), off).bend)


@for_shape(revolved.facet_contact, TwoArcs)
def _facet_contact(shape, nx, ny, nz):
    lean = math.sqrt(nx * nx + ny * ny)
    if lean <= 1e-14:
        return 0.0, 0.0, 0.0
    if lean <= shape.sine:
        rho, h = shape.flat + shape.low * lean, shape.low * (1.0 - nz)
    else:
        rho, h = shape.out + shape.bow * lean, shape.up - shape.bow * nz
        if rho >= shape.radius:
            rho, h = shape.radius, shape.top
    return -rho * (nx / lean), -rho * (ny / lean), h


for_shape(revolved.lift_of, TwoArcs)(triangle_tip)


@for_shape(revolved.edge_bound, TwoArcs)
def _edge_bound(shape, z0, ez, length, u0, lo, hi, q):
    return math.inf


@njit(**KERNEL)
def _on_upper(shape, start, hi, q, m):
    """Place u in [start, hi], all of it on the upper arc, where m u - h is largest, with h there."""
    c, b = shape.out, shape.bow
    if b <= 0.0:
        return hi, shape.up
    rho = math.sqrt(q * q + hi * hi)
    high = math.asin(min((rho - c) / b, 1.0))
    if math.sin(high) * hi <= m * math.cos(high) * rho:
        return hi, _height_at(shape, rho)
    rho = math.sqrt(q * q + start * start)
    low = math.asin(min((rho - c) / b, 1.0))
    if math.sin(low) * start >= m * math.cos(low) * rho:
        return start, _height_at(shape, rho)
    theta = arc_angle(low, high, q, m, c, b)
    rho = c + b * math.sin(theta)
    u = min(max(math.sqrt(max((rho - q) * (rho + q), 0.0)), start), hi)
    return u, shape.up - b * math.cos(theta)


@njit(**KERNEL)
def _place(shape, lo, hi, q, m):
    """Place u in [lo, hi] where m u - h(sqrt(q^2 + u^2)) is largest, m >= 0, with the profile's height there."""
    start = max(lo, 0.0)
    if hi <= start:
        return hi, _height_at(shape, math.sqrt(q * q + hi * hi))
    edge = math.sqrt(max((shape.join - q) * (shape.join + q), 0.0))
    if edge > start and (edge >= hi or m * shape.cosine * shape.join <= shape.sine * edge):
        # at the join the slope is m or more, or the edge ends before: the place is on the lower arc or the flat
        u, h = bull_edge(start, min(hi, edge), q, m, shape.low, shape.flat)
        return u, h
    return _on_upper(shape, max(start, edge), hi, q, m)


@for_shape(revolved.edge_place, TwoArcs)
def _edge_place(shape, lo, hi, q, half, length, l2, ez):
    if ez >= 0.0:
        return _place(shape, lo, hi, q, ez / length)
    u, h = _place(shape, -hi, -lo, q, -ez / length)
    return -u, h


@for_shape(revolved.node_bound, TwoArcs)
def _bound(shape, node, x, y, best):
    """That of the tapered mill under the profile; or the top less h at the nearest place of the box."""
    if node[4] <= best:
        return NOTHING
    x_lo, x_hi, y_lo, y_hi = node[0] - x, node[1] - x, node[2] - y, node[3] - y
    u = x_lo if x_lo > 0.0 else (x_hi if x_hi < 0.0 else 0.0)
    v = y_lo if y_lo > 0.0 else (y_hi if y_hi < 0.0 else 0.0)
    near2 = u * u + v * v
    if near2 > shape.radius * shape.radius:
        return NOTHING
    top = node[4] - _height_at(shape, math.sqrt(near2))
    if top <= best:
        return NOTHING
    return min(top, node_bound(_under(shape), node, x, y, best))
