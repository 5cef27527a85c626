"""Slow twins of the compiled loops of passes: all samples at once, one array operation after another."""

import numpy as np

from geometry.mesh_queries.drop import drop_tips

ROUNDS = 60


def roots(f, a, b, at_a, at_b, tolerance):
    """Places where functions change sign between a and b, by the Illinois rule [Dowell1971]: ``f(places, which)``."""
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


def along(envelope, points, normals):
    """``Envelope.along``."""
    left = np.full(len(points), np.inf)
    up = envelope.heights(points[:, :2]) - points[:, 2]
    todo = np.flatnonzero(np.isfinite(up))
    points, normals, here = points[todo], normals[todo], up[todo]

    def above(t, k):
        """Envelope over the points k moved out by t; it falls as t grows, until they are beside the cutter."""
        at = points[k] + t[:, None] * normals[k]
        return np.asarray(envelope.heights(at[:, :2]) - at[:, 2])

    # an envelope parallel to the surface lies n_z times as far along the normal as it does upright
    far, at_far = 1.02 * here * normals[:, 2], np.zeros(len(todo))
    near, beside = np.zeros(len(todo)), np.full(len(todo), np.inf)
    found, k = here == 0.0, np.flatnonzero(here != 0.0)
    for _ in range(12):
        if not len(k):
            break
        value = above(far[k], k)
        past = np.where(here[k] > 0.0, value <= 0.0, value >= 0.0)
        at_far[k[past]], found[k[past]] = value[past], True
        k, value = k[~past], value[~past]
        lost = value == np.inf
        beside[k[lost]], near[k[~lost]] = far[k[lost]], far[k[~lost]]
        far[k] = np.where(np.isfinite(beside[k]), 0.5 * (near[k] + beside[k]), 1.5 * far[k])
    k = np.flatnonzero(found)
    left[todo[k]] = roots(lambda t, which: above(t, k[which]), np.zeros(len(k)), far[k], here[k], at_far[k], 1e-10)
    return left


def crests(a, b, ground_tree, points, normals, across, farthest):
    """``Envelope.crests``."""
    most = np.full(len(points), farthest)

    def places(w, k):
        return np.asarray(points[k, :2] + w[:, None] * across[k])

    def apart(w, k):
        with np.errstate(invalid="ignore"):
            apart = np.asarray(a.heights(places(w, k)) - b.heights(places(w, k)))
        return np.where(np.isnan(apart), np.copysign(np.inf, w), apart)  # beside both

    every = np.arange(len(points))
    f_lo, f_hi = apart(-most, every), apart(most, every)
    k = np.flatnonzero((f_lo < 0.0) & (f_hi > 0.0))
    out = np.full(len(points), -np.inf)
    w = roots(lambda x, which: apart(x, k[which]), -most[k], most[k], f_lo[k], f_hi[k], 1e-6)
    xy = places(w, k)
    ground = drop_tips(ground_tree, xy, 0.0, 0.0)
    # at the rim of a flat end an envelope jumps, and the crest is on one side of the jump
    low = np.full(len(k), -np.inf)
    for aside in (-2.0 * 1e-6, 2.0 * 1e-6):
        beside = places(w + aside, k)
        height = np.minimum(a.heights(beside), b.heights(beside))
        low = np.where(np.isfinite(height), np.maximum(low, height), low)
    # ground that is not the sample's own surface any more is a matter of the samples there
    nz = normals[k, 2]
    slope = np.sqrt(np.maximum(1.0 - nz**2, 0.0)) / np.maximum(nz, 1e-9)
    own = np.abs(ground - points[k, 2]) <= (slope + 0.3) * np.abs(w) + 1e-3
    with np.errstate(invalid="ignore"):
        over = (low - ground) * nz
    out[k] = np.where(own & np.isfinite(over), over, -np.inf)
    return out
