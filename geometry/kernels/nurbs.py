"""Tensor-product B-splines at many parameters: de Boor's basis functions, summed over the control points they reach.

Nearest points of a surface are searched for by Newton's method, each from a start.

Notation
    k, l   : orders in u and v, degree plus one
    N_a    : the k basis functions that are not zero between knots i and i + 1, a from 0 to k - 1
    S, S_u, S_uu, ... : the surface and its derivatives by the parameters
    o                 : S less a given point
    g, H              : gradient and Hessian of half of the squared distance
"""

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL

MAX_STEPS = 30  # Gauss-Newton steps to a foot
NEAR = 1e-6  # mm, last step to a foot: the error of the height is its square over the radius of curvature
ROUNDS = 50
# Largest step as a share of the domain. A step that gains nothing is cut to a quarter, at most this often.
REACH, CUTS = 0.25, 12
# A step shorter than this share of the domain ends the search. The error of the distance is then of its square.
ENOUGH = 1e-10
LEAST_DETERMINANT = 1e-3  # of the determinant of the metric: a Hessian with less does not descend surely


@njit(**KERNEL)
def _span(knots, order, count, x):
    """i with knots[i] <= x < knots[i + 1], from order - 1 to count - 1; at the end of the domain the last that is
    not empty."""
    low, high = order - 1, count
    while high - low > 1:
        middle = (low + high) // 2
        if x >= knots[middle]:
            low = middle
        else:
            high = middle
    while low > order - 1 and knots[low] == knots[low + 1]:
        low -= 1
    return low


@njit(**KERNEL)
def _basis(knots, order, i, x, out):
    """N_a at x, into the first ``order`` of ``out``."""
    out[0] = 1.0
    for degree in range(1, order):
        carried = 0.0
        for a in range(degree):
            right, left = knots[i + a + 1], knots[i + a + 1 - degree]
            share = out[a] / (right - left) if right > left else 0.0
            out[a] = carried + (right - x) * share
            carried = (x - left) * share
        out[degree] = carried


@njit(**KERNEL)
def _sum(net, knots_u, knots_v, order_u, order_v, u, v, by_u, by_v, out):
    """The sum at one place of a net (n, m, c), into out (c,)."""
    i, j = _span(knots_u, order_u, net.shape[0], u), _span(knots_v, order_v, net.shape[1], v)
    _basis(knots_u, order_u, i, u, by_u)
    _basis(knots_v, order_v, j, v, by_v)
    for c in range(net.shape[2]):
        total = 0.0
        for a in range(order_u):
            row = 0.0
            for b in range(order_v):
                row += by_v[b] * net[i - order_u + 1 + a, j - order_v + 1 + b, c]
            total += by_u[a] * row
        out[c] = total


@njit(**KERNEL)
def surface_values(net, knots_u, knots_v, order_u, order_v, uv, out):
    """Sums at uv (p, 2) of a net (n, m, c), into out (p, c)."""
    by_u, by_v = np.empty(order_u), np.empty(order_v)
    for p in range(len(uv)):
        _sum(net, knots_u, knots_v, order_u, order_v, uv[p, 0], uv[p, 1], by_u, by_v, out[p])


@njit(**KERNEL)
def heights_along(nets, knots_u, knots_v, order_u, order_v, side, low, high, points, start, uv, height):
    """Heights of chains of points (m, t, 3) over a surface; the search for each foot starts at the previous foot.

    nets   : of the surface and its derivatives in u and v, homogeneous where there are four columns; the knots and
             orders belong to the surface, those of a derivative are one less
    low, high : (2,) limits of the parameters of a foot; beyond its knots the surface is the polynomial of its border
    start  : (m, 2) parameters near the foot of the first point
    uv     : (m, t, 2), height (m, t) mm along the normal of the foot, both written
    """
    net, net_u, net_v = nets
    by_u, by_v = np.empty(order_u), np.empty(order_v)
    place, along_u, along_v = np.zeros(4), np.zeros(4), np.zeros(4)
    width = net.shape[2]
    for m in range(points.shape[0]):
        u, v = start[m]
        for t in range(points.shape[1]):
            x, y, z = points[m, t]
            for _ in range(MAX_STEPS):
                _sum(net, knots_u, knots_v, order_u, order_v, u, v, by_u, by_v, place)
                _sum(net_u, knots_u[1:-1], knots_v, order_u - 1, order_v, u, v, by_u, by_v, along_u)
                _sum(net_v, knots_u, knots_v[1:-1], order_u, order_v - 1, u, v, by_u, by_v, along_v)
                if width == 4:
                    place[:3] /= place[3]
                    along_u[:3] = (along_u[:3] - along_u[3] * place[:3]) / place[3]
                    along_v[:3] = (along_v[:3] - along_v[3] * place[:3]) / place[3]
                dx, dy, dz = x - place[0], y - place[1], z - place[2]
                e = along_u[0] ** 2 + along_u[1] ** 2 + along_u[2] ** 2
                f = along_u[0] * along_v[0] + along_u[1] * along_v[1] + along_u[2] * along_v[2]
                g = along_v[0] ** 2 + along_v[1] ** 2 + along_v[2] ** 2
                a = dx * along_u[0] + dy * along_u[1] + dz * along_u[2]
                b = dx * along_v[0] + dy * along_v[1] + dz * along_v[2]
                area = e * g - f * f
                before_u, before_v = u, v
                u = min(max(u + (g * a - f * b) / area, low[0]), high[0])
                v = min(max(v + (e * b - f * a) / area, low[1]), high[1])
                if (u - before_u) ** 2 * e + (v - before_v) ** 2 * g < NEAR * NEAR:
                    break
            nx = side * (along_u[1] * along_v[2] - along_u[2] * along_v[1])
            ny = side * (along_u[2] * along_v[0] - along_u[0] * along_v[2])
            nz = side * (along_u[0] * along_v[1] - along_u[1] * along_v[0])
            uv[m, t, 0], uv[m, t, 1] = u, v
            height[m, t] = (dx * nx + dy * ny + dz * nz) / np.sqrt(nx * nx + ny * ny + nz * nz)


@njit(**KERNEL)
def _place(net, knots_u, knots_v, order_u, order_v, u, v, by_u, by_v, out):
    """The surface at one place, into out (3,) of (4,)."""
    _sum(net, knots_u, knots_v, order_u, order_v, u, v, by_u, by_v, out)
    if net.shape[2] == 4:
        for c in range(3):
            out[c] /= out[3]


@njit(**KERNEL)
def _plain(d):
    """Derivatives of a rational surface from those of its homogeneous net, d (6, 4), in place: S, u, v, uu, uv, vv."""
    w = d[0, 3]
    for c in range(3):
        d[0, c] /= w
        d[1, c] = (d[1, c] - d[1, 3] * d[0, c]) / w
        d[2, c] = (d[2, c] - d[2, 3] * d[0, c]) / w
        d[3, c] = (d[3, c] - 2.0 * d[1, 3] * d[1, c] - d[3, 3] * d[0, c]) / w
        d[4, c] = (d[4, c] - d[1, 3] * d[2, c] - d[2, 3] * d[1, c] - d[4, 3] * d[0, c]) / w
        d[5, c] = (d[5, c] - 2.0 * d[2, 3] * d[2, c] - d[5, 3] * d[0, c]) / w


@njit(**KERNEL)
def _step(d, x, y, z, at, low, high, out):
    """A step of Newton's method from at (2,), or of Gauss-Newton where Newton's does not descend, into out (2,).

    d : (6, 4), S and its derivatives there. A coordinate stays where the step would cross a border.
    """
    o0, o1, o2 = d[0, 0] - x, d[0, 1] - y, d[0, 2] - z
    gu = o0 * d[1, 0] + o1 * d[1, 1] + o2 * d[1, 2]
    gv = o0 * d[2, 0] + o1 * d[2, 1] + o2 * d[2, 2]
    held_u = at[0] <= low[0] and gu > 0.0 or at[0] >= high[0] and gu < 0.0
    held_v = at[1] <= low[1] and gv > 0.0 or at[1] >= high[1] and gv < 0.0
    gu, gv = 0.0 if held_u else gu, 0.0 if held_v else gv
    e = d[1, 0] * d[1, 0] + d[1, 1] * d[1, 1] + d[1, 2] * d[1, 2]
    f = d[1, 0] * d[2, 0] + d[1, 1] * d[2, 1] + d[1, 2] * d[2, 2]
    g = d[2, 0] * d[2, 0] + d[2, 1] * d[2, 1] + d[2, 2] * d[2, 2]
    huu = e + o0 * d[3, 0] + o1 * d[3, 1] + o2 * d[3, 2]
    huv = f + o0 * d[4, 0] + o1 * d[4, 1] + o2 * d[4, 2]
    hvv = g + o0 * d[5, 0] + o1 * d[5, 1] + o2 * d[5, 2]
    if not (huu * hvv - huv * huv > LEAST_DETERMINANT * (e * g - f * f) and huu > 0.0):
        huu, huv, hvv = e, f, g
    huu, hvv = huu * (1.0 + 1e-12) + 1e-300, hvv * (1.0 + 1e-12) + 1e-300
    if held_u or held_v:  # a coordinate fixed at a border leaves the system of equations
        huv = 0.0
    huu, hvv = 1.0 if held_u else huu, 1.0 if held_v else hvv
    det = huu * hvv - huv * huv
    out[0], out[1] = -(hvv * gu - huv * gv) / det, -(huu * gv - huv * gu) / det
    for c in range(2):
        if not np.isfinite(out[c]):
            out[c] = 0.0


@njit(**KERNEL)
def search_feet(nets, knots_u, knots_v, orders, low, high, points, uv, foot, left):
    """Nearest places of a surface to points (p, 3) in the valley of their starts.

    nets, knots_u, knots_v : 6 of each, of the surface and its derivatives u, v, uu, uv, vv; homogeneous where a net has
                             four columns
    orders    : (6, 2)
    low, high : (2,) borders of the parameters
    uv        : (p, 2) starts, then the parameters of the places
    foot      : (p, 3) mm, left (p,) mm, the places and the square of their distance, written
    """
    by_u, by_v = np.empty(orders[0, 0]), np.empty(orders[0, 1])
    d, place, step, trial = np.zeros((6, 4)), np.zeros(4), np.zeros(2), np.zeros(2)
    for p in range(len(points)):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        at = uv[p]
        _place(nets[0], knots_u[0], knots_v[0], orders[0, 0], orders[0, 1], at[0], at[1], by_u, by_v, place)
        nearest = (place[0] - x) ** 2 + (place[1] - y) ** 2 + (place[2] - z) ** 2
        for c in range(3):
            foot[p, c] = place[c]
        for _ in range(ROUNDS):
            for k in range(6):
                _sum(nets[k], knots_u[k], knots_v[k], orders[k, 0], orders[k, 1], at[0], at[1], by_u, by_v, d[k])
            if nets[0].shape[2] == 4:
                _plain(d)
            _step(d, x, y, z, at, low, high, step)
            long = max(abs(step[0] / (REACH * (high[0] - low[0]))), abs(step[1] / (REACH * (high[1] - low[1]))), 1.0)
            step /= long
            if abs(step[0]) <= ENOUGH * (high[0] - low[0]) and abs(step[1]) <= ENOUGH * (high[1] - low[1]):
                break
            gained = False
            for _cut in range(CUTS):
                for c in range(2):
                    trial[c] = min(max(at[c] + step[c], low[c]), high[c])
                _place(nets[0], knots_u[0], knots_v[0], orders[0, 0], orders[0, 1], trial[0], trial[1], by_u, by_v,
                       place)
                gap = (place[0] - x) ** 2 + (place[1] - y) ** 2 + (place[2] - z) ** 2
                if gap < nearest:
                    gained, nearest = True, gap
                    at[0], at[1] = trial[0], trial[1]
                    for c in range(3):
                        foot[p, c] = place[c]
                    break
                step *= 0.25
            if not gained:
                break
        left[p] = nearest
