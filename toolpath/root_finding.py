"""Roots of many functions of one variable at once, each in a bracket of its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64

ROUNDS = 60


def roots(f: Callable[[F64, NDArray[np.int64]], F64], a: F64, b: F64, at_a: F64, at_b: F64, tolerance: float) -> F64:
    """Places where functions change sign between a and b, by the Illinois rule [Dowell1971].

    f          : takes places, (k,) float64, mm, rad or dimensionless, and which functions, (k,) int64, index; gives
                 their values, (k,) float64, which may be infinite
    a, b       : (n,) float64, mm, rad or dimensionless, ends of the brackets
    at_a, at_b : (n,) float64, mm, rad or dimensionless, values there, of different signs or zero
    tolerance  : a bracket this narrow, or a value this small, ends the search

    Returns
    -------
    (n,) float64, mm, rad or dimensionless as ``a``
        By false position. The value at the end that stays is halved, so that both ends move. A bracket with an infinite
        value is halved.
    """
    out = np.where(at_a == 0.0, a, b)
    k = np.flatnonzero((at_a != 0.0) & (at_b != 0.0))
    a, b, at_a, at_b = a[k], b[k], at_a[k], at_b[k]
    for _ in range(ROUNDS):
        if not len(k):
            break
        with np.errstate(invalid="ignore"):
            x = a - at_a * ((b - a) / (at_b - at_a))
        x = np.where(np.isfinite(at_a) & np.isfinite(at_b), x, 0.5 * (a + b))
        value = f(x, k)
        out[k] = x
        same = np.sign(value) == np.sign(at_a)
        b, at_b = np.where(same, b, a), np.where(same, 0.5 * at_b, at_a)
        a, at_a = x, value
        going = (np.abs(value) > tolerance) & (np.abs(b - a) > tolerance)
        k, a, b, at_a, at_b = k[going], a[going], b[going], at_a[going], at_b[going]
    return out
