"""Material that a cutter leaves along a path: its swept envelope along normals, and the crest between two of them.

Notation
    tree   the path turned upside down, a mesh of segments; E(x, y) = -tip of the cutter dropped over it
    shape  the cutter, a shape of ``geometry.kernels.revolved``
    p, n   a sample and its unit normal, n_z > 0
    above  E over p + t n, less its height: it falls as t grows, until the place is beside the cutter
    apart  E of one path less E of the other at a place; where both are infinite the side of the sample decides
Samples are independent, so the order changes no byte.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL
from geometry.kernels.revolved import tip_over

OUTWARDS = 12  # steps along a normal in search of the envelope
ROUNDS = 60
NEAR = 1e-10  # mm: end of the search along a normal
CREST = 1e-6  # mm: two envelopes this near each other have met


@njit(**KERNEL)
def _above(tree, shape, p, n, t):
    return -tip_over(shape, tree, p[0] + t * n[0], p[1] + t * n[1]) - (p[2] + t * n[2])


@njit(**KERNEL)
def _apart(tree_a, tree_b, shape, p, across, w):
    x, y = p[0] + w * across[0], p[1] + w * across[1]
    out = -tip_over(shape, tree_a, x, y) - -tip_over(shape, tree_b, x, y)
    return math.copysign(np.inf, w) if math.isnan(out) else out


@njit(**KERNEL)
def _next(a, b, at_a, at_b):
    """Place to look at next in a bracket: by false position, half way where a value is infinite."""
    if math.isfinite(at_a) and math.isfinite(at_b):
        return a - at_a * ((b - a) / (at_b - at_a))
    return 0.5 * (a + b)


@njit(**KERNEL)
def _other(a, b, at_a, at_b, value):
    """The end of a bracket that stays when its place moves: the Illinois rule halves the value of one that stays on."""
    if np.sign(value) == np.sign(at_a):
        return b, 0.5 * at_b
    return a, at_a


@njit(**KERNEL)
def _bracket(tree, shape, p, n, here):
    """Place far enough out along the normal that the envelope has been passed, and ``above`` there; nan: none."""
    # an envelope parallel to the surface lies n_z times as far along the normal as it does upright
    far, near, beside = 1.02 * here * n[2], 0.0, np.inf
    for _ in range(OUTWARDS):
        value = _above(tree, shape, p, n, far)
        if (here > 0.0 and value <= 0.0) or (here <= 0.0 and value >= 0.0):
            return far, value
        if value == np.inf:
            beside = far
        else:
            near = far
        far = 0.5 * (near + beside) if math.isfinite(beside) else 1.5 * far
    return np.nan, np.nan


@njit(**KERNEL)
def along(tree, shape, points, normals, out):
    """Way from points (n, 3) along normals (n, 3) to the envelope, into out (n,); inf where no cutter comes."""
    for k in range(points.shape[0]):
        p, n = points[k], normals[k]
        here = _above(tree, shape, p, n, 0.0)
        out[k] = np.inf
        if not math.isfinite(here):
            continue
        if here == 0.0:
            out[k] = 0.0
            continue
        b, at_b = _bracket(tree, shape, p, n, here)
        if math.isnan(b):
            continue
        a, at_a, place = 0.0, here, b
        if at_b != 0.0:
            for _ in range(ROUNDS):
                place = _next(a, b, at_a, at_b)
                value = _above(tree, shape, p, n, place)
                b, at_b = _other(a, b, at_a, at_b, value)
                a, at_a = place, value
                if not (abs(value) > NEAR and abs(b - a) > NEAR):
                    break
        out[k] = place


@njit(**KERNEL)
def _meeting(tree_a, tree_b, shape, p, across, most):
    """Place across at which two envelopes meet, within ``most`` of the sample; nan where they do not."""
    a, b = -most, most
    at_a, at_b = _apart(tree_a, tree_b, shape, p, across, a), _apart(tree_a, tree_b, shape, p, across, b)
    if not (at_a < 0.0 and at_b > 0.0):
        return np.nan
    place = b
    for _ in range(ROUNDS):
        place = _next(a, b, at_a, at_b)
        value = _apart(tree_a, tree_b, shape, p, across, place)
        b, at_b = _other(a, b, at_a, at_b, value)
        a, at_a = place, value
        if not (abs(value) > CREST and abs(b - a) > CREST):
            break
    return place


@njit(**KERNEL)
def crests(tree_a, tree_b, shape, ground, dot, points, normals, across, most, out):
    """Height of the crest between two envelopes over the surface beside points (n, 3), along their normals (n, 3).

    ground : the finished surface; dot : a shape without width, dropped on it
    across : (n, 2), the way to the other pass
    most   : no crest farther than this from its point counts, mm
    out    : (n,), -inf where there is none
    """
    for k in range(points.shape[0]):
        p, n, side = points[k], normals[k], across[k]
        out[k] = -np.inf
        w = _meeting(tree_a, tree_b, shape, p, side, most)
        if math.isnan(w):
            continue
        bottom = tip_over(dot, ground, p[0] + w * side[0], p[1] + w * side[1])
        # at the rim of a flat end an envelope jumps, and the crest is on one side of the jump
        low = -np.inf
        for aside in (-2.0 * CREST, 2.0 * CREST):
            x, y = p[0] + (w + aside) * side[0], p[1] + (w + aside) * side[1]
            height = min(-tip_over(shape, tree_a, x, y), -tip_over(shape, tree_b, x, y))
            if math.isfinite(height):
                low = max(low, height)
        # ground that is not the sample's own surface any more is a matter of the samples there
        slope = math.sqrt(max(1.0 - n[2] ** 2, 0.0)) / max(n[2], 1e-9)
        over = (low - bottom) * n[2]
        if abs(bottom - p[2]) <= (slope + 0.3) * abs(w) + 1e-3 and math.isfinite(over):
            out[k] = over
