"""Tensor-product B-splines at many parameters: de Boor's basis functions, summed over the control points they reach.

Notation
    k, l   : orders in u and v, degree plus one
    N_a    : the k basis functions that are not zero between knots i and i + 1, a from 0 to k - 1
"""

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL

MAX_STEPS = 30  # Gauss-Newton steps to a foot
NEAR = 1e-6  # mm, last step to a foot: the error of the height is its square over the radius of curvature


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
