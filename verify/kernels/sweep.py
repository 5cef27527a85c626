"""Where a straight ray meets the volume that a cutting part sweeps along a straight move.

Notation
    p, n     : start and unit direction of the ray, p + t n
    A, D     : tip at the start of the move and its displacement; the tip is A + s D, 0 <= s <= 1
    q        : p - A
    R, r, L  : radius, width of the corner and flute length of the cutting part; a = R - r
    h        : height over the tip, h(s, t) = q_z + t n_z - s D_z

The cutting part is convex and a translation keeps it so: the swept volume is convex and the ray meets
it in one interval of t. In the plane (s, t) a swept sphere or cylinder is an ellipse, the limits of the
move and of the height are lines, and the interval is the extent in t of their intersection: it is
reached at an extreme of the ellipse or on one of the four lines, all of them quadratics.
A cone is the same with a radius that grows along the axis: its quadric is of any kind, but between the heights of its
ends the region stays convex, and each place tried lies in it.
A tapered mill is its corner and a cone from where the corner ends. The whole ball of a corner tangent to the cone lies
in the endless cone over it, so it is cut off at the flute length only; flutes of a bull nose are as long as a torus is
high.
A torus corner is a disc of radius a grown by r: the distance to the swept disc is convex in t, so
Newton's step from outside never passes the root. A circle segment mill is met in the same way: its signed distance is
convex in s and t together, so the least of it over s is convex in t.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from geometry.kernels.cutter_sizes import CutterSizes, corner_end
from verify.kernels.segment import arc_gradient

INF = np.inf
FLAT_RAY = 1e-9
ROOT_ERROR = 1e-9
LEAST_CONE = 1e-9  # mm, height of a cone that counts


class Ray(NamedTuple):
    """A ray as the tool sees it at the start of the move, frame of the tool: tip at the origin, axis Z.

    qx, qy, qz : float, mm, where it begins
    nx, ny, nz : float, unit, its direction
    """

    qx: float
    qy: float
    qz: float
    nx: float
    ny: float
    nz: float


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _below_zero(a, b, c):
    """The interval of x with a x² + 2 b x + c <= 0 for a >= 0; (inf, -inf) where there is none."""
    if a <= 1e-18:
        if abs(b) <= 1e-15:
            return (-INF, INF) if c <= 0.0 else (INF, -INF)
        x = -c / (2.0 * b)
        return (-INF, x) if b > 0.0 else (x, INF)
    disc = b * b - a * c
    if disc < 0.0:
        return INF, -INF
    w = math.sqrt(disc)
    return (-b - w) / a, (-b + w) / a


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _on_line_s(s, att, ats, ass, bt, bs, c, qz, nz, dz, h0, h1):
    """Extent in t of the region on the line s = const."""
    lo, hi = _below_zero(att, bt + ats * s, c + 2.0 * bs * s + ass * s * s)
    if lo > hi:
        return lo, hi
    base = qz - s * dz
    if abs(nz) <= FLAT_RAY:
        if base < h0 - 1e-12 or base > h1 + 1e-12:
            return INF, -INF
        return lo, hi
    ta, tb = (h0 - base) / nz, (h1 - base) / nz
    lo, hi = max(lo, min(ta, tb)), min(hi, max(ta, tb))
    return (lo, hi) if lo <= hi else (INF, -INF)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _on_line_h(h, att, ats, ass, bt, bs, c, qz, nz, dz):
    """Extent in t of the region on the line of constant height h.

    The line is walked in s where the ray is steeper than the move and in t where it is flatter: the slope of the
    one over the other then never exceeds 1 (a nearly level ray and a plunge would cost all digits in s).
    """
    if abs(dz) > abs(nz):
        s0, s1 = (qz - h) / dz, nz / dz
        lo, hi = _below_zero(max(att + 2.0 * ats * s1 + ass * s1 * s1, 0.0), bt + ats * s0 + (bs + ass * s0) * s1,
                             c + 2.0 * bs * s0 + ass * s0 * s0)
        if s1 == 0.0:
            return (lo, hi) if 0.0 < s0 < 1.0 else (INF, -INF)
        ta, tb = -s0 / s1, (1.0 - s0) / s1
        lo, hi = max(lo, min(ta, tb)), min(hi, max(ta, tb))
        return (lo, hi) if lo <= hi else (INF, -INF)
    t0, t1 = (h - qz) / nz, dz / nz
    a = att * t1 * t1 + 2.0 * ats * t1 + ass
    b = att * t0 * t1 + ats * t0 + bt * t1 + bs
    lo, hi = _below_zero(max(a, 0.0), b, att * t0 * t0 + 2.0 * bt * t0 + c)
    lo, hi = max(lo, 0.0), min(hi, 1.0)
    if lo > hi:
        return INF, -INF
    ta, tb = t0 + lo * t1, t0 + hi * t1
    return min(ta, tb), max(ta, tb)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def quadric_interval(att, ats, ass, bt, bs, c, qz, nz, dz, h0, h1):
    """Extent in t of {att t² + 2 ats t s + ass s² + 2 bt t + 2 bs s + c <= 0, 0 <= s <= 1, h0 <= h <= h1}.

    Returns (t_min, t_max), (inf, -inf) where the ray misses.
    """
    lo, hi = _on_line_s(0.0, att, ats, ass, bt, bs, c, qz, nz, dz, h0, h1)
    if ass <= 1e-24 and abs(dz) <= 1e-12:
        return lo, hi
    u, v = _on_line_s(1.0, att, ats, ass, bt, bs, c, qz, nz, dz, h0, h1)
    lo, hi = min(lo, u), max(hi, v)
    for k in range(2):
        h = h0 if k == 0 else h1
        if abs(nz) > FLAT_RAY or abs(dz) > 1e-12:
            u, v = _on_line_h(h, att, ats, ass, bt, bs, c, qz, nz, dz)
            lo, hi = min(lo, u), max(hi, v)
    if ats * ats < att * ass * (1.0 - 1e-12):
        u, v = _below_zero(att - ats * ats / ass, bt - ats * bs / ass, c - bs * bs / ass)
        if u <= v:
            for k in range(2):
                t = u if k == 0 else v
                s = -(bs + ats * t) / ass
                h = qz + t * nz - s * dz
                if 0.0 <= s <= 1.0 and h0 <= h <= h1:
                    lo, hi = min(lo, t), max(hi, t)
    return lo, hi


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def cylinder_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, radius, h0, h1):
    """Interval of t inside the sweep of a vertical cylinder h0 <= h <= h1."""
    return quadric_interval(nx * nx + ny * ny, -(nx * dx + ny * dy), dx * dx + dy * dy, qx * nx + qy * ny,
                            -(qx * dx + qy * dy), qx * qx + qy * qy - radius * radius, qz, nz, dz, h0, h1)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def sphere_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, radius, centre, h1):
    """Interval of t inside the sweep of a sphere centred at height ``centre``, cut off above height h1."""
    z = qz - centre
    return quadric_interval(nx * nx + ny * ny + nz * nz, -(nx * dx + ny * dy + nz * dz), dx * dx + dy * dy + dz * dz,
                            qx * nx + qy * ny + z * nz, -(qx * dx + qy * dy + z * dz),
                            qx * qx + qy * qy + z * z - radius * radius, qz, nz, dz, -1e300, h1)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _in_nappe(a, b, c, grows):
    """The interval of x with a x² + 2 b x + c <= 0 on one nappe of a cone, for any a; (inf, -inf) where there is none.

    grows : where a < 0, whether the radius of that nappe grows with x
    """
    disc = b * b - a * c
    if disc < 0.0:
        if a >= 0.0:
            return INF, -INF
        disc = 0.0  # a line along the nappe, through its apex
    q = -b - math.sqrt(disc) if b >= 0.0 else -b + math.sqrt(disc)
    if q == 0.0:  # b = 0 and a c = 0
        if a == 0.0:
            return (-INF, INF) if c <= 0.0 else (INF, -INF)
        return (0.0, 0.0) if a > 0.0 else (0.0, INF) if grows else (-INF, 0.0)
    if a == 0.0:
        return (-INF, c / q) if b > 0.0 else (c / q, INF)
    lo, hi = min(q / a, c / q), max(q / a, c / q)
    if a > 0.0:
        return lo, hi
    return (hi, INF) if grows else (-INF, lo)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _cone_on_line_s(s, ray, dx, dy, dz, a, m, h1):
    """Extent in t of the standing cone of the move at s: radius a + m h, 0 <= h <= h1."""
    qx, qy, qz, nx, ny, nz = ray
    wx, wy, base = qx - s * dx, qy - s * dy, qz - s * dz
    wide = a + m * base
    lo, hi = _in_nappe(nx * nx + ny * ny - m * m * nz * nz, wx * nx + wy * ny - m * nz * wide,
                       wx * wx + wy * wy - wide * wide, nz > 0.0)
    if lo > hi:
        return INF, -INF
    if abs(nz) <= FLAT_RAY:
        return (lo, hi) if -1e-12 <= base <= h1 + 1e-12 else (INF, -INF)
    ta, tb = -base / nz, (h1 - base) / nz
    lo, hi = max(lo, min(ta, tb)), min(hi, max(ta, tb))
    return (lo, hi) if lo <= hi else (INF, -INF)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def cone_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, a, radius, h1):
    """Interval of t inside the sweep of a cone of radius a at the tip and ``radius`` at height h1 > 0."""
    ray, m = Ray(qx, qy, qz, nx, ny, nz), (radius - a) / h1
    lo, hi = _cone_on_line_s(0.0, ray, dx, dy, dz, a, m, h1)
    u, v = _cone_on_line_s(1.0, ray, dx, dy, dz, a, m, h1)
    lo, hi = min(lo, u), max(hi, v)
    att, ats, ass = nx * nx + ny * ny, -(nx * dx + ny * dy), dx * dx + dy * dy
    bt, bs, c = qx * nx + qy * ny, -(qx * dx + qy * dy), qx * qx + qy * qy
    if abs(nz) > FLAT_RAY or abs(dz) > 1e-12:
        for k in range(2):
            r, h = (a, 0.0) if k == 0 else (radius, h1)
            u, v = _on_line_h(h, att, ats, ass, bt, bs, c - r * r, qz, nz, dz)
            lo, hi = min(lo, u), max(hi, v)
    # where the side is met along the move: the derivative of the quadric in s is 0
    wide = a + m * qz
    att, ats, ass = att - m * m * nz * nz, ats + m * m * nz * dz, ass - m * m * dz * dz
    bt, bs, c = bt - wide * m * nz, bs + wide * m * dz, c - wide * wide
    if abs(ass) > 1e-15 * (dx * dx + dy * dy + m * m * dz * dz):
        p, r, k0 = att - ats * ats / ass, bt - ats * bs / ass, c - bs * bs / ass
        disc = r * r - p * k0
        if disc >= 0.0:
            q = -r - math.sqrt(disc) if r >= 0.0 else -r + math.sqrt(disc)
            for k in range(2):
                if (k == 0 and p == 0.0) or (k == 1 and q == 0.0):
                    continue
                t = q / p if k == 0 else k0 / q
                s = -(bs + ats * t) / ass
                h = qz + t * nz - s * dz
                if 0.0 <= s <= 1.0 and 0.0 <= h <= h1:
                    lo, hi = min(lo, t), max(hi, t)
    return lo, hi


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def capsule_start(qx, qy, qz, nx, ny, nz, dx, dy, dz, radius, centre):
    """Least t inside the sweep of a whole sphere: inf where missed, NaN where the ray runs along the move.

    t_min(s) of the standing spheres is convex in s, so an extreme outside 0..1 moves to the nearer end.
    """
    z = qz - centre
    ats, ass = -(nx * dx + ny * dy + nz * dz), dx * dx + dy * dy + dz * dz
    bt, bs = qx * nx + qy * ny + z * nz, -(qx * dx + qy * dy + z * dz)
    c = qx * qx + qy * qy + z * z - radius * radius
    s = 0.0
    if ass > 1e-24:
        a = 1.0 - ats * ats / ass
        if a < 1e-9:
            return np.nan
        b = bt - ats * bs / ass
        disc = b * b - a * (c - bs * bs / ass)
        if disc < 0.0:
            return INF
        t = (-b - math.sqrt(disc)) / a
        s = -(bs + ats * t) / ass
        if 0.0 <= s <= 1.0:
            return t
        s = 0.0 if s < 0.0 else 1.0
    b = bt + ats * s
    disc = b * b - (c + 2.0 * bs * s + ass * s * s)
    return -b - math.sqrt(disc) if disc >= 0.0 else INF


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _disc_slope(s, qx, qy, qz, dx, dy, dz, a):
    """d/ds of half the squared distance from q to the disc of radius a carried to s D."""
    wx, wy, wz = qx - s * dx, qy - s * dy, qz - s * dz
    rho = math.sqrt(wx * wx + wy * wy)
    slope = -wz * dz
    if rho > a:
        slope -= (rho - a) / rho * (wx * dx + wy * dy)
    return slope


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _disc_nearest(qx, qy, qz, dx, dy, dz, a):
    """The s in [0, 1] at which a horizontal disc of radius a carried along D is nearest to q."""
    lo, hi = 0.0, 1.0
    flo = _disc_slope(lo, qx, qy, qz, dx, dy, dz, a)
    if flo >= 0.0:
        return lo
    fhi = _disc_slope(hi, qx, qy, qz, dx, dy, dz, a)
    if fhi <= 0.0:
        return hi
    side = 0
    for k in range(120):
        # where the disc covers q the slope all but vanishes, and the false position creeps: halve in between
        s = 0.5 * (lo + hi) if k % 3 == 2 else (lo * fhi - hi * flo) / (fhi - flo)
        f = _disc_slope(s, qx, qy, qz, dx, dy, dz, a)
        if abs(f) < 1e-14 or hi - lo < 1e-13:
            return s
        if f < 0.0:
            lo, flo = s, f
            if side == -1:
                fhi *= 0.5
            side = -1
        else:
            hi, fhi = s, f
            if side == 1:
                flo *= 0.5
            side = 1
    return 0.5 * (lo + hi)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def disc_distance(qx, qy, qz, nx, ny, nz, dx, dy, dz, a):
    """Distance from q to the swept disc and its derivative along n."""
    s = _disc_nearest(qx, qy, qz, dx, dy, dz, a)
    wx, wy, wz = qx - s * dx, qy - s * dy, qz - s * dz
    rho = math.sqrt(wx * wx + wy * wy)
    over = max(rho - a, 0.0)
    dist = math.sqrt(over * over + wz * wz)
    if dist == 0.0:
        return 0.0, 0.0
    radial = (wx * nx + wy * ny) / rho if over > 0.0 else 0.0
    return dist, (over * radial + wz * nz) / dist


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _disc_root(t, limit, sign, ray, dx, dy, dz, a, r):
    """Newton from t (outside) in the direction of ``sign`` to distance r; NaN where the ray passes by."""
    qx, qy, qz, nx, ny, nz = ray
    for _ in range(80):
        dist, slope = disc_distance(qx + t * nx, qy + t * ny, qz + t * nz, nx, ny, nz, dx, dy, dz, a)
        if dist - r <= ROOT_ERROR:
            return t
        if slope * sign >= -1e-12:
            return np.nan
        t -= (dist - r) / slope
        if (t - limit) * sign > 0.0:
            return np.nan
    return t


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def torus_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, radius, r):
    """Interval of t inside the sweep of a disc of radius R - r at height r grown by r (error 1e-9 mm)."""
    lo, hi = sphere_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, radius, r, 1e300)
    if lo > hi:
        return INF, -INF
    ray, a = Ray(qx, qy, qz - r, nx, ny, nz), radius - r
    first = _disc_root(lo, hi, 1.0, ray, dx, dy, dz, a, r)
    if math.isnan(first):
        return INF, -INF
    last = _disc_root(hi, first, -1.0, ray, dx, dy, dz, a, r)
    return first, (first if math.isnan(last) else last)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _tapered_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, cutter):
    """As ``cutter_interval``, of a tapered mill: its corner, and the cone from where that ends."""
    lo, hi, r, flat = INF, -INF, cutter.round, cutter.radius - cutter.corner
    if r > 0.0 and flat <= 1e-12:
        lo, hi = sphere_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, r, r, cutter.length)
    elif r > 0.0:
        lo, hi = torus_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, flat + r, r)
    wide, high = corner_end(cutter)
    if cutter.length - high > LEAST_CONE:
        u, v = cone_interval(qx, qy, qz - high, nx, ny, nz, dx, dy, dz, wide, cutter.radius, cutter.length - high)
        lo, hi = min(lo, u), max(hi, v)
    return lo, hi


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _arcs_at(s, ray, dx, dy, dz, cutter):
    """Signed distance from the beginning of a ray to a standing circle segment mill at s; derivatives by s and t."""
    qx, qy, qz, nx, ny, nz = ray
    wx, wy, h = qx - s * dx, qy - s * dy, qz - s * dz
    rho = math.sqrt(wx * wx + wy * wy)
    far, aside, up = arc_gradient(rho, h, cutter)
    if h - cutter.length > far:
        far, aside, up = h - cutter.length, 0.0, 1.0
    aside = aside / rho if rho > 0.0 else 0.0
    return far, -aside * (wx * dx + wy * dy) - up * dz, aside * (wx * nx + wy * ny) + up * nz


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _arcs_distance(ray, dx, dy, dz, cutter):
    """Signed distance from the beginning of a ray to the swept circle segment mill, and its derivative along the ray.

    At a kink the derivative is that of the two sides, weighed so that nothing is left of those by s.
    """
    qx, qy, _, _, _, _ = ray
    plan2 = dx * dx + dy * dy
    if dz == 0.0:
        s = min(max((qx * dx + qy * dy) / plan2, 0.0), 1.0) if plan2 > 0.0 else 0.0
        far, _, slope = _arcs_at(s, ray, dx, dy, dz, cutter)
        return far, slope
    lo, hi, side = 0.0, 1.0, 0
    far_lo, flo, glo = _arcs_at(lo, ray, dx, dy, dz, cutter)
    if flo >= 0.0:
        return far_lo, glo
    far_hi, fhi, ghi = _arcs_at(hi, ray, dx, dy, dz, cutter)
    if fhi <= 0.0:
        return far_hi, ghi
    wlo, whi, small = flo, fhi, 1e-13 * math.sqrt(plan2 + dz * dz)
    for k in range(150):
        # false position creeps where the mill covers the ray or at a kink: halve in between
        s = 0.5 * (lo + hi) if k % 3 == 2 else (lo * whi - hi * wlo) / (whi - wlo)
        far, f, g = _arcs_at(s, ray, dx, dy, dz, cutter)
        if abs(f) <= small:
            return far, g
        if f < 0.0:
            lo, far_lo, flo, glo, wlo = s, far, f, g, f
            whi = 0.5 * whi if side == -1 else whi
            side = -1
        else:
            hi, far_hi, fhi, ghi, whi = s, far, f, g, f
            wlo = 0.5 * wlo if side == 1 else wlo
            side = 1
        if hi - lo < 1e-13:
            break
    return min(far_lo, far_hi), (fhi * glo - flo * ghi) / (fhi - flo)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _arcs_root(t, limit, sign, ray, dx, dy, dz, cutter):
    """Newton from t (outside) in the direction of ``sign`` to the swept mill; NaN where the ray passes by."""
    qx, qy, qz, nx, ny, nz = ray
    for _ in range(80):
        far, slope = _arcs_distance(Ray(qx + t * nx, qy + t * ny, qz + t * nz, nx, ny, nz), dx, dy, dz, cutter)
        if far <= ROOT_ERROR:
            return t
        if slope * sign >= -1e-12:
            return np.nan
        t -= far / slope
        if (t - limit) * sign > 0.0:
            return np.nan
    return t


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _arcs_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, cutter):
    """As ``cutter_interval``, of a circle segment mill, from the interval of the cylinder that holds it."""
    lo, hi = cylinder_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, cutter.radius, 0.0, cutter.length)
    if lo > hi:
        return INF, -INF
    ray = Ray(qx, qy, qz, nx, ny, nz)
    first = _arcs_root(lo, hi, 1.0, ray, dx, dy, dz, cutter)
    if math.isnan(first):
        return INF, -INF
    last = _arcs_root(hi, first, -1.0, ray, dx, dy, dz, cutter)
    return first, (first if math.isnan(last) else last)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def cutter_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, cutter: CutterSizes):
    """Interval of t inside the sweep of a whole cutting part; (inf, -inf) where the ray misses it."""
    radius, corner, length, cone = cutter.radius, cutter.corner, cutter.length, cutter.cone
    if cutter.taper > 0.0:
        return _tapered_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, cutter)
    if cutter.up > 0.0:
        return _arcs_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, cutter)
    lo, hi = cylinder_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, radius, cone if cone > 0.0 else corner, length)
    if cone > 0.0:
        u, v = cone_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, radius - corner, radius, cone)
        return min(lo, u), max(hi, v)
    if corner <= 0.0:
        return lo, hi
    if corner >= radius - 1e-12:
        u, v = sphere_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, radius, radius, length)
    else:
        u, v = torus_interval(qx, qy, qz, nx, ny, nz, dx, dy, dz, radius, corner)
    return min(lo, u), max(hi, v)
