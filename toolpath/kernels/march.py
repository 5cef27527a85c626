"""How far every place is from the nearest of some others, on ways that stay inside; and when discs that grow cover it.

Notation
    U   (ny, nx) float64   mm, length of the way; inf where there is none. |grad U| = 1
    h   mm                 lattice step

Fast sweeping: Godunov's upwind scheme, (U - a)+^2 + (U - b)+^2 = h^2 with a and b the lesser neighbours along x and y,
in the four diagonal orders by turns until nothing gets less. First order: U is too great by O(h log 1/h) at most, and
exact along the lattice.
"""

from __future__ import annotations

import numpy as np
from numba import njit

SETTLED = 1e-6
"""Of a step: what a value may still get less by."""


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def march(far, inside, step):
    """Lower ``far`` (ny, nx), mm, 0 at sources and inf elsewhere, in place to the length of the way; returns rounds.

    inside : (ny, nx) bool, nodes that ways may go over
    step   : mm
    """
    ny, nx = far.shape
    rounds = 0
    while True:
        most = 0.0
        for order in range(4):
            for m in range(ny):
                i = m if order & 1 == 0 else ny - 1 - m
                for n in range(nx):
                    j = n if order & 2 == 0 else nx - 1 - n
                    if not inside[i, j] or far[i, j] == 0.0:
                        continue
                    a = min(far[i, j - 1] if j > 0 else np.inf, far[i, j + 1] if j < nx - 1 else np.inf)
                    b = min(far[i - 1, j] if i > 0 else np.inf, far[i + 1, j] if i < ny - 1 else np.inf)
                    low, high = min(a, b), max(a, b)
                    if low == np.inf:
                        continue
                    if high - low >= step:
                        u = low + step
                    else:
                        u = 0.5 * (low + high + np.sqrt(2.0 * step * step - (high - low) ** 2))
                    if u < far[i, j]:
                        most = max(most, far[i, j] - u)
                        far[i, j] = u
        rounds += 1
        if most <= SETTLED * step:
            return rounds


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def spread(when, radius, step, out):
    """Lower ``out`` (ny, nx) in place to the least ``when`` of the discs that hold a node.

    when   : (ny, nx) of the disc round a node; inf for none
    radius : (ny, nx) mm; step : mm
    """
    ny, nx = when.shape
    for i in range(ny):
        for j in range(nx):
            t = when[i, j]
            if t == np.inf:
                continue
            size = radius[i, j] / step
            reach = int(size)
            for k in range(max(i - reach, 0), min(i + reach, ny - 1) + 1):
                half = int(np.sqrt(max(size * size - (k - i) ** 2, 0.0)))
                for m in range(max(j - half, 0), min(j + half, nx - 1) + 1):
                    out[k, m] = min(out[k, m], t)
