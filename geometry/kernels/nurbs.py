"""Tensor-product B-splines at many parameters: de Boor's basis functions, summed over the control points they reach.

Notation
    k, l   : orders in u and v, degree plus one
    N_a    : the k basis functions that are not zero between knots i and i + 1, a from 0 to k - 1
"""

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL


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
def surface_values(net, knots_u, knots_v, order_u, order_v, uv, out):
    """Sums at uv (p, 2) of a net (n, m, c), into out (p, c)."""
    by_u, by_v = np.empty(order_u), np.empty(order_v)
    for p in range(len(uv)):
        i = _span(knots_u, order_u, net.shape[0], uv[p, 0])
        j = _span(knots_v, order_v, net.shape[1], uv[p, 1])
        _basis(knots_u, order_u, i, uv[p, 0], by_u)
        _basis(knots_v, order_v, j, uv[p, 1], by_v)
        for c in range(net.shape[2]):
            total = 0.0
            for a in range(order_u):
                row = 0.0
                for b in range(order_v):
                    row += by_v[b] * net[i - order_u + 1 + a, j - order_v + 1 + b, c]
                total += by_u[a] * row
            out[p, c] = total
