"""What a tool that walks a pass leaves at places beside it, along their normals.

Notation
    P, n  : place and unit normal;  C : centre of the corner along the pass, close together;  r : its radius
    A, R  : axis of the tool in plan and its radius, where the flank counts;  t : how far along n the tool begins

The ball goes straight from one C to the next: P + t n meets the capsule where |P + t n - Q| = r, Q the nearest place of
the segment. The flank is an upright band of half width R over the way of A, from C upwards by its height. The nearest
segment is looked for from where P lies along the pass, in steps that halve; one farther off than the true nearest says
that more is left, never less.
"""

import math

from numba import njit

from geometry.kernels.options import KERNEL

ROUNDS = 4  # of taking the nearest place of a segment anew
FIRST_STEP = 16  # centres, of the search along the pass
FAR = 1.01  # of the radius: as much is left where the tool does not come


@njit(**KERNEL)
def _nearest(line, k, x, y, z, dims):
    """Where along line (n, 3), from k on, (x, y, z) is nearest; in plan where dims is 2."""
    best = math.inf
    step = FIRST_STEP
    last = len(line) - 1
    while step > 0:
        moved = False
        for at in (k, k - step, k + step):
            if 0 <= at <= last:
                d = (line[at, 0] - x) ** 2 + (line[at, 1] - y) ** 2
                if dims == 3:
                    d += (line[at, 2] - z) ** 2
                if d < best:
                    moved = moved or at != k
                    best, k = d, at
        if not moved:
            step //= 2
    return k


@njit(**KERNEL)
def _ball(p, n, a, b, radius, far):
    """t of a ball that goes from a to b."""
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    length2 = max(dx * dx + dy * dy + dz * dz, 1e-300)
    t = 0.0
    for _ in range(ROUNDS):
        s = ((p[0] + t * n[0] - a[0]) * dx + (p[1] + t * n[1] - a[1]) * dy + (p[2] + t * n[2] - a[2]) * dz) / length2
        s = min(max(s, 0.0), 1.0)
        wx, wy, wz = a[0] + s * dx - p[0], a[1] + s * dy - p[1], a[2] + s * dz - p[2]
        along = wx * n[0] + wy * n[1] + wz * n[2]
        deep = radius * radius - (wx * wx + wy * wy + wz * wz) + along * along
        t = along - math.sqrt(deep) if deep >= 0.0 else far
    return min(t, far)


@njit(**KERNEL)
def _band(p, n, size, k, centres, axes, radius, height, far):
    """t of the flank over the segment after axis k; ``size`` of n in plan."""
    ax, ay = axes[k, 0], axes[k, 1]
    dx, dy = axes[k + 1, 0] - ax, axes[k + 1, 1] - ay
    length2 = max(dx * dx + dy * dy, 1e-300)
    t, s = 0.0, 0.0
    for _ in range(ROUNDS):
        s = min(max(((p[0] + t * n[0] - ax) * dx + (p[1] + t * n[1] - ay) * dy) / length2, 0.0), 1.0)
        wx, wy = ax + s * dx - p[0], ay + s * dy - p[1]
        along = wx * n[0] + wy * n[1]
        deep = along * along - size * size * (wx * wx + wy * wy - radius * radius)
        t = min((along - math.sqrt(deep)) / (size * size), far) if deep >= 0.0 else far
    up = p[2] + t * n[2] - centres[k, 2] - s * (centres[k + 1, 2] - centres[k, 2])
    return t if 0.0 <= up <= height else far


@njit(**KERNEL, inline="always")
def _at(line, k):
    """Place k of a line (n, 3), as numbers: a row of an array is an object, whose uses are counted."""
    return line[k, 0], line[k, 1], line[k, 2]


@njit(**KERNEL)
def left_beside(points, normals, centres, axes, radius, flank, height, steep, out):
    """t at points (m, n, 3) with normals, the second index along the pass, into out (m, n).

    axes (k, 3) : of the tool where the flank counts, the third number unused; flank 0.0 where it does not
    steep       : of a normal lies in plan; where less does the flank does not count
    """
    last = len(centres) - 1
    share = last / (points.shape[1] - 1)
    far = FAR * radius
    for j in range(points.shape[1]):
        for i in range(points.shape[0]):
            p = points[i, j, 0], points[i, j, 1], points[i, j, 2]
            n = normals[i, j, 0], normals[i, j, 1], normals[i, j, 2]
            k = _nearest(centres, int(j * share), p[0] + radius * n[0], p[1] + radius * n[1], p[2] + radius * n[2], 3)
            best = far
            for a in (k - 1, k):
                if 0 <= a < last:
                    best = min(best, _ball(p, n, _at(centres, a), _at(centres, a + 1), radius, far))
            size = math.sqrt(n[0] * n[0] + n[1] * n[1])
            if flank > 0.0 and size > steep:
                k = _nearest(axes, k, p[0] + flank / size * n[0], p[1] + flank / size * n[1], 0.0, 2)
                for a in (k - 1, k):
                    if 0 <= a < last:
                        best = min(best, _band(p, n, size, a, centres, axes, flank, height, far))
            out[i, j] = best

