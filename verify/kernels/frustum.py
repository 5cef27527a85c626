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
from typing import NamedTuple

import numpy as np
from numba import njit

INF = np.inf
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
SECTIONS = 32  # of a move: 2e-7 of it is left


class Frustum(NamedTuple):
    """A frustum about the axis of the tool, mm, frame of the tool: tip at the origin, axis Z.

    z0, z1 : float, heights of its lower and upper end over the tip
    r0, r1 : float, its radii there
    """

    z0: float
    z1: float
    r0: float
    r1: float


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _aside(s, wx, wy, wz, dx, dy, dz, z0, r, k):
    ux, uy = wx - s * dx, wy - s * dy
    return r + k * (wz - s * dz - z0) - math.sqrt(ux * ux + uy * uy)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _lesser(s, wx, wy, wz, dx, dy, dz, z0, r, k):
    return min(_aside(s, wx, wy, wz, dx, dy, dz, z0, r, k), wz - s * dz - z0)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
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


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
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


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _meeting(wz, dz, low, high):
    """First and last s at which a place wz over the tip is between two heights of the tool; first > last for never."""
    if abs(dz) < 1e-15:
        return (0.0, 1.0) if low < wz < high else (1.0, 0.0)
    u, v = (wz - low) / dz, (wz - high) / dz
    return max(0.0, min(u, v)), min(1.0, max(u, v))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _most(wx, wy, wz, dx, dy, dz, body, column, lesser):
    """The greatest of aside, or of the lesser of aside and down; -inf where the heights never meet.

    A column meets a frustum that narrows upwards with its lower end, one that widens as high as it stands.
    """
    z0, z1, r0, r1 = body
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


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def overlap(wx, wy, wz, dx, dy, dz, body: Frustum, column):
    """How deep (radially, mm) the frustum takes in the point, or the column below it.

    Positive inside; -inf where the heights never meet.
    """
    return _most(wx, wy, wz, dx, dy, dz, body, column, False)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def penetration(wx, wy, wz, dx, dy, dz, body: Frustum, column):
    """How deep the frustum takes in the point (or the column below it), mm: the shorter way out, aside or down.

    0 where they do not meet.
    """
    return max(_most(wx, wy, wz, dx, dy, dz, body, column, True), 0.0)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def no_deeper(wx, wy, wz, dx, dy, dz, z0, z1, wide, clearance, known):
    """Whether ``contact`` with anything of radius ``wide``, the clearance in it, from z0 to z1 is ``known`` at most.

    A bound by the way aside, and by the way down from where the point is highest in the tool.
    """
    if known >= clearance and clearance + wz - min(dz, 0.0) - z0 <= known:
        return True
    return overlap(wx, wy, wz, dx, dy, dz, Frustum(z0, z1, wide, wide), False) <= known


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def contact(wx, wy, wz, dx, dy, dz, body: Frustum, clearance, slack, known, column):
    """How deep a body grown by ``clearance`` takes in a point (or the column below it), as an event counts it.

    The radii of ``body`` hold the clearance. Up to the clearance that is how much nearer than it, aside; above it the
    clearance and how deep the point is in the bare body (``penetration``). 0 where it is no deeper than ``slack`` or
    ``known``.
    """
    z0, z1, r0, r1 = body
    if known >= clearance and clearance + wz - min(dz, 0.0) - z0 <= known:
        return 0.0
    depth = overlap(wx, wy, wz, dx, dy, dz, body, column)
    if depth <= max(slack, known):
        return 0.0
    bare = penetration(wx, wy, wz, dx, dy, dz, Frustum(z0, z1, r0 - clearance, r1 - clearance), column)
    return clearance + bare if bare > slack else min(depth, clearance)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _apart(rho, h, body, column):
    """Distance of a point, or of the column below it, to a standing frustum, mm; 0 inside.

    The place of a column that is nearest is its top, the lower end of a frustum that narrows upwards, or the upper end
    of one that widens, whichever is lowest.
    """
    z0, z1, r0, r1 = body
    if column and h > z0:
        h = min(h, z1) if r1 > r0 else z0
    rise, wider = z1 - z0, r1 - r0
    if z0 <= h <= z1 and rho <= r0 + wider * (h - z0) / max(rise, 1e-12):
        return 0.0
    s = min(max(((rho - r0) * wider + (h - z0) * rise) / max(wider * wider + rise * rise, 1e-24), 0.0), 1.0)
    out = math.hypot(rho - r0 - s * wider, h - z0 - s * rise)
    if h < z0 and rho <= r0:
        out = min(out, z0 - h)
    if h > z1 and rho <= r1:
        out = min(out, h - z1)
    return out


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def clear_of(wx, wy, wz, dx, dy, dz, body: Frustum, column):
    """Least distance of a point, or of the column below it, to a frustum carried along a move, mm; 0 where they meet.

    Both are convex, so the distance is convex in s: by golden sections.
    """
    if dx * dx + dy * dy + dz * dz < 1e-18:
        return _apart(math.hypot(wx, wy), wz, body, column)
    lo, hi = 0.0, 1.0
    a, b = hi - GOLDEN * (hi - lo), lo + GOLDEN * (hi - lo)
    at_a = _apart(math.hypot(wx - a * dx, wy - a * dy), wz - a * dz, body, column)
    at_b = _apart(math.hypot(wx - b * dx, wy - b * dy), wz - b * dz, body, column)
    least = min(at_a, at_b, _apart(math.hypot(wx, wy), wz, body, column),
                _apart(math.hypot(wx - dx, wy - dy), wz - dz, body, column))
    for _ in range(SECTIONS):
        if least <= 0.0:
            break
        if at_a < at_b:
            hi, b, at_b = b, a, at_a
            a = hi - GOLDEN * (hi - lo)
            at_a = _apart(math.hypot(wx - a * dx, wy - a * dy), wz - a * dz, body, column)
        else:
            lo, a, at_a = a, b, at_b
            b = lo + GOLDEN * (hi - lo)
            at_b = _apart(math.hypot(wx - b * dx, wy - b * dy), wz - b * dz, body, column)
        least = min(least, at_a, at_b)
    return least


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def at_least(wx, wy, wz, dx, dy, dz, body: Frustum):
    """A lower bound of ``clear_of`` for a point, mm: on the way neither distance at an end falls by more than it."""
    first, last = _apart(math.hypot(wx, wy), wz, body, False), \
        _apart(math.hypot(wx - dx, wy - dy), wz - dz, body, False)
    return 0.5 * (first + last - math.sqrt(dx * dx + dy * dy + dz * dz))


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _of_ball(s, wx, wy, wz, dx, dy, dz, body, k, v, lesser):
    """The greatest of aside, or of the lesser of aside and down, of places within v of the point, at s.

    Of all places q higher than the point the deepest is nearer the axis by what is left of v. -inf where none of them
    is between z0 and z1.
    """
    z0, z1, r = body.z0, body.z1, body.r0
    ux, uy, high = wx - s * dx, wy - s * dy, wz - s * dz - z0
    low, up = max(-v, -high), min(v, z1 - z0 - high)
    if low > up:
        return -INF
    rho = math.sqrt(ux * ux + uy * uy)
    # where aside is greatest: along the normal of the side, or from there on where the axis is within v
    q = max(v * abs(k) / math.sqrt(1.0 + k * k), math.sqrt(max(v * v - rho * rho, 0.0))) if k != 0.0 else 0.0
    q = min(max(q if k > 0.0 else -q, low), up)
    aside = r + k * (high + q) - max(rho - math.sqrt(max(v * v - q * q, 0.0)), 0.0)
    if not lesser or aside <= high + q:
        return aside
    # from there up aside falls and down grows: where they are equal
    for _ in range(40):
        mid = 0.5 * (q + up)
        if r + k * (high + mid) - max(rho - math.sqrt(max(v * v - mid * mid, 0.0)), 0.0) > high + mid:
            q = mid
        else:
            up = mid
    return high + q


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _most_of_ball(wx, wy, wz, dx, dy, dz, body, v, lesser):
    """The greatest on the move of ``_of_ball``, which is concave in s: by golden sections."""
    z0, z1, r0, r1 = body
    s1, s2 = _meeting(wz, dz, z0 - v, z1 + v)
    if s1 > s2:
        return -INF
    k = (r1 - r0) / max(z1 - z0, 1e-12)
    if (s2 - s1) ** 2 * (dx * dx + dy * dy + dz * dz) < 1e-18:
        return _of_ball(0.5 * (s1 + s2), wx, wy, wz, dx, dy, dz, body, k, v, lesser)
    a, b = s2 - GOLDEN * (s2 - s1), s1 + GOLDEN * (s2 - s1)
    at_a = _of_ball(a, wx, wy, wz, dx, dy, dz, body, k, v, lesser)
    at_b = _of_ball(b, wx, wy, wz, dx, dy, dz, body, k, v, lesser)
    most = max(at_a, at_b, _of_ball(s1, wx, wy, wz, dx, dy, dz, body, k, v, lesser),
               _of_ball(s2, wx, wy, wz, dx, dy, dz, body, k, v, lesser))
    for _ in range(SECTIONS):
        if at_a < at_b:
            s1, a, at_a = a, b, at_b
            b = s1 + GOLDEN * (s2 - s1)
            at_b = _of_ball(b, wx, wy, wz, dx, dy, dz, body, k, v, lesser)
        else:
            s2, b, at_b = b, a, at_a
            a = s2 - GOLDEN * (s2 - s1)
            at_a = _of_ball(a, wx, wy, wz, dx, dy, dz, body, k, v, lesser)
        most = max(most, at_a, at_b)
    return most


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def contact_of_ball(wx, wy, wz, dx, dy, dz, body: Frustum, v, clearance, slack, known):
    """As ``contact``, for the deepest of all places within v mm of the point."""
    z0, z1, r0, r1 = body
    k = (r1 - r0) / max(z1 - z0, 1e-12)
    side = v * math.sqrt(1.0 + k * k)  # the side moves out by so much, measured across the axis
    most = overlap(wx, wy, wz, dx, dy, dz, Frustum(z0 - v, z1 + v, r0 + side - v * k, r1 + side + v * k), False)
    if most <= max(slack, known) or (known >= clearance and clearance + wz - min(dz, 0.0) + v - z0 <= known):
        return 0.0
    if most > clearance + slack:
        bare = _most_of_ball(wx, wy, wz, dx, dy, dz, Frustum(z0, z1, r0 - clearance, r1 - clearance), v, True)
        if bare > slack:
            return clearance + bare
    if known >= clearance:
        return 0.0
    near = _most_of_ball(wx, wy, wz, dx, dy, dz, body, v, False)
    return min(near, clearance) if near > max(slack, known) else 0.0
