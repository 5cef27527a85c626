"""How deep necks, shanks and holders, carried along a move, take in a point or a solid column below it.

Notation
    (wx, wy, wz) : the point, or the top of the column, seen from the tip at the start of the move
    D            : displacement of the tip, tip(s) = s D, 0 <= s <= 1
    z0, z1       : heights of the frustum over the tip; r0, r1 its radii there, k its slope (r1 - r0) / (z1 - z0)
    aside(s)     : how deep the point is in the frustum radially, r0 + k (wz - s dz - z0) - rho(s)
    down(s)      : its height over the lower end, wz - s dz - z0
Both are concave in s (a line, and a line less a norm), so the greatest of either, and of the lesser of both, has a
closed form: at an end, where a slope is zero, or where they are equal.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

INF = np.inf


@njit(cache=True, nogil=True)
def _aside(s, wx, wy, wz, dx, dy, dz, z0, r, k):
    ux, uy = wx - s * dx, wy - s * dy
    return r + k * (wz - s * dz - z0) - math.sqrt(ux * ux + uy * uy)


@njit(cache=True, nogil=True)
def _lesser(s, wx, wy, wz, dx, dy, dz, z0, r, k):
    return min(_aside(s, wx, wy, wz, dx, dy, dz, z0, r, k), wz - s * dz - z0)


@njit(cache=True, nogil=True)
def _nearest(s1, s2, wx, wy, dx, dy, dz, k):
    """Where on [s1, s2] aside is greatest."""
    plan2, fall = dx * dx + dy * dy, -k * dz
    free2 = plan2 - fall * fall
    if free2 <= 1e-18:  # the cone widens faster than the point moves away
        return s2 if fall > 0.0 else s1
    along = wx * dx + wy * dy
    miss2 = max((wx * wx + wy * wy) * plan2 - along * along, 0.0)
    s = (along + math.sqrt(miss2 / free2) * fall) / plan2
    return min(max(s, s1), s2)


@njit(cache=True, nogil=True)
def _lesser_most(s1, s2, wx, wy, wz, dx, dy, dz, z0, r, k):
    """The greatest on [s1, s2] of the lesser of aside and down."""
    beside, high = _nearest(s1, s2, wx, wy, dx, dy, dz, k), s1 if dz > 0.0 else s2
    out, down = _aside(beside, wx, wy, wz, dx, dy, dz, z0, r, k), wz - beside * dz - z0
    if out <= down:
        return out
    out = max(down, _lesser(high, wx, wy, wz, dx, dy, dz, z0, r, k))
    # equal where rho = e + f s
    e, f = r + (k - 1.0) * (wz - z0), (1.0 - k) * dz
    a, b = dx * dx + dy * dy - f * f, wx * dx + wy * dy + e * f
    c = wx * wx + wy * wy - e * e
    root2 = b * b - a * c
    if root2 >= 0.0:
        # of the two forms of a root the one that subtracts nothing of its size
        q = b + math.sqrt(root2) if b >= 0.0 else b - math.sqrt(root2)
        if abs(a) > 1e-300:
            out = max(out, _lesser(min(max(q / a, s1), s2), wx, wy, wz, dx, dy, dz, z0, r, k))
        if abs(q) > 1e-300:
            out = max(out, _lesser(min(max(c / q, s1), s2), wx, wy, wz, dx, dy, dz, z0, r, k))
    return out


@njit(cache=True, nogil=True)
def _meeting(wz, dz, low, high):
    """First and last s at which a place wz over the tip is between two heights of the tool; first > last for never."""
    if abs(dz) < 1e-15:
        return (0.0, 1.0) if low < wz < high else (1.0, 0.0)
    u, v = (wz - low) / dz, (wz - high) / dz
    return max(0.0, min(u, v)), min(1.0, max(u, v))


@njit(cache=True, nogil=True)
def _most(wx, wy, wz, dx, dy, dz, z0, z1, r0, r1, column, lesser):
    """The greatest of aside, or of the lesser of aside and down; -inf where the heights never meet.

    A column meets a frustum that narrows upwards with its lower end, one that widens as high as it stands.
    """
    s1, s2 = _meeting(wz, dz, z0, INF if column else z1)
    if s1 > s2:
        return -INF
    k = 0.0 if r0 == r1 or (column and r1 < r0) else (r1 - r0) / max(z1 - z0, 1e-12)
    out = -INF
    if column and k > 0.0:  # over the frustum the column fills it, as wide as it is on top
        t1, t2 = _meeting(wz, dz, z1, INF)
        if t1 <= t2:
            out = _lesser_most(t1, t2, wx, wy, wz, dx, dy, dz, z0, r1, 0.0) if lesser else \
                _aside(_nearest(t1, t2, wx, wy, dx, dy, dz, 0.0), wx, wy, wz, dx, dy, dz, z0, r1, 0.0)
        s1, s2 = _meeting(wz, dz, z0, z1)
        if s1 > s2:
            return out
    if lesser:
        return max(out, _lesser_most(s1, s2, wx, wy, wz, dx, dy, dz, z0, r0, k))
    return max(out, _aside(_nearest(s1, s2, wx, wy, dx, dy, dz, k), wx, wy, wz, dx, dy, dz, z0, r0, k))


@njit(cache=True, nogil=True)
def overlap(wx, wy, wz, dx, dy, dz, z0, z1, r0, r1, column):
    """How deep (radially, mm) the frustum takes in the point, or the column below it.

    Positive inside; -inf where the heights never meet.
    """
    return _most(wx, wy, wz, dx, dy, dz, z0, z1, r0, r1, column, False)


@njit(cache=True, nogil=True)
def penetration(wx, wy, wz, dx, dy, dz, z0, z1, r0, r1, column):
    """How deep the frustum takes in the point (or the column below it), mm: the shorter way out, aside or down.

    0 where they do not meet.
    """
    return max(_most(wx, wy, wz, dx, dy, dz, z0, z1, r0, r1, column, True), 0.0)


@njit(cache=True, nogil=True)
def no_deeper(wx, wy, wz, dx, dy, dz, z0, z1, wide, clearance, known):
    """Whether ``contact`` with anything of radius ``wide``, the clearance in it, from z0 to z1 is ``known`` at most.

    A bound by the way aside, and by the way down from where the point is highest in the tool.
    """
    if known >= clearance and clearance + wz - min(dz, 0.0) - z0 <= known:
        return True
    return overlap(wx, wy, wz, dx, dy, dz, z0, z1, wide, wide, False) <= known


@njit(cache=True, nogil=True)
def contact(wx, wy, wz, dx, dy, dz, z0, z1, r0, r1, clearance, slack, known, column):
    """How deep a body grown by ``clearance`` takes in a point (or the column below it), as an event counts it.

    r0, r1 hold the clearance. Up to the clearance that is how much nearer than it, aside; above it the clearance and
    how deep the point is in the bare body (``penetration``). 0 where it is no deeper than ``slack`` or ``known``.
    """
    if known >= clearance and clearance + wz - min(dz, 0.0) - z0 <= known:
        return 0.0
    depth = overlap(wx, wy, wz, dx, dy, dz, z0, z1, r0, r1, column)
    if depth <= max(slack, known):
        return 0.0
    bare = penetration(wx, wy, wz, dx, dy, dz, z0, z1, r0 - clearance, r1 - clearance, column)
    return clearance + bare if bare > slack else min(depth, clearance)
