"""The frame of a tool along a move that may turn it, and places seen from there.

Notation
    A, D      : tip at the start of the move and its displacement, tip(s) = A + s D, 0 <= s <= 1
    u, w      : tool axis at the start (tip to spindle) and the unit vector it turns about, square to it
    angle     : rad, by which it turns over the move, evenly; the axis runs along a great circle
    F(s)      : rows w, z(s) x w, z(s) with z(s) = u cos(s angle) + (w x u) sin(s angle)
    y(s)      : F(s) (p - tip(s)), where the tool sees a point p

A standing point sees the tool sweep by; a standing tool sees the point run along y(s). That is a straight line where
the tool does not turn, and else |y''| <= angle² |p - tip| + 2 angle |D|, so over one of n even pieces of the move y is
within (angle² l + 2 angle |D|) / (8 n²) of its chord for every point within l of the tip. On the chord the closed
forms of a translation hold (``sweep``): that is all that turning needs.
"""

from __future__ import annotations

import math

from numba import njit

from geometry.kernels.options import KERNEL

MAX_ANGLE = 0.1
PIECE = 31
# A piece is 31 numbers: 0:9 tip and rows y, z at its start, 9:18 the same at its end, 18:21 row w, which both share,
# 21:27 rows y, z half way, 27:30 the displacement seen by the tool where it does not turn, 30 the angle of the piece.


@njit(**KERNEL)
def pieces(angle, length, reach, bow):
    """Into how many even pieces a move is cut so that chords are within ``bow`` mm for points within ``reach`` mm."""
    if angle == 0.0:
        return 1
    n = math.sqrt((angle * angle * reach + 2.0 * angle * length) / (8.0 * bow))
    return max(1, math.ceil(max(n, angle / MAX_ANGLE)))


@njit(**KERNEL)
def _rows(out, k, u, w, phi):
    """Rows y = z x w and z of the frame turned by phi, written from out[k]."""
    vx, vy, vz = w[1] * u[2] - w[2] * u[1], w[2] * u[0] - w[0] * u[2], w[0] * u[1] - w[1] * u[0]
    c, s = math.cos(phi), math.sin(phi)
    out[k], out[k + 1], out[k + 2] = u[0] * s - vx * c, u[1] * s - vy * c, u[2] * s - vz * c
    out[k + 3], out[k + 4], out[k + 5] = u[0] * c + vx * s, u[1] * c + vy * s, u[2] * c + vz * s


@njit(**KERNEL)
def fill_piece(out, a, b, u, w, angle, k, n):
    """Write piece k of n of a move into ``out`` (PIECE,).

    a, b  : (3,) tips of the move; u, w : (3,) its axis and what it turns about; angle : rad
    """
    s0, s1 = k / n, (k + 1) / n
    for i in range(3):
        out[i] = a[i] + s0 * (b[i] - a[i])
        out[9 + i] = b[i] if k == n - 1 else a[i] + s1 * (b[i] - a[i])
        out[18 + i] = w[i]
    _rows(out, 3, u, w, s0 * angle)
    out[30] = angle / n
    if angle == 0.0:
        for i in range(6):
            out[12 + i] = out[21 + i] = out[3 + i]
        dx, dy, dz = out[9] - out[0], out[10] - out[1], out[11] - out[2]
        for i in range(3):
            row = 18 if i == 0 else 3 * i
            out[27 + i] = out[row] * dx + out[row + 1] * dy + out[row + 2] * dz
        return
    _rows(out, 12, u, w, s1 * angle)
    _rows(out, 21, u, w, 0.5 * (s0 + s1) * angle)


@njit(**KERNEL)
def view(p, x, y, z):
    """Where the tool sees (x, y, z) at the start of piece p, and the displacement of the tool on the chord."""
    dx, dy, dz = x - p[0], y - p[1], z - p[2]
    qx = p[18] * dx + p[19] * dy + p[20] * dz
    qy = p[3] * dx + p[4] * dy + p[5] * dz
    qz = p[6] * dx + p[7] * dy + p[8] * dz
    if p[30] == 0.0:
        return qx, qy, qz, p[27], p[28], p[29]
    dx, dy, dz = x - p[9], y - p[10], z - p[11]
    return (qx, qy, qz, qx - (p[18] * dx + p[19] * dy + p[20] * dz), qy - (p[12] * dx + p[13] * dy + p[14] * dz),
            qz - (p[15] * dx + p[16] * dy + p[17] * dz))


@njit(**KERNEL)
def turned(p, x, y, z):
    """A direction as the tool sees it half way along piece p."""
    return (p[18] * x + p[19] * y + p[20] * z, p[21] * x + p[22] * y + p[23] * z, p[24] * x + p[25] * y + p[26] * z)


@njit(**KERNEL)
def near_segment2(x, y, z, a, b):
    """Squared distance from (x, y, z) to the segment between tips a and b (3,)."""
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    wx, wy, wz = x - a[0], y - a[1], z - a[2]
    length2 = dx * dx + dy * dy + dz * dz
    if length2 > 0.0:
        s = min(max((wx * dx + wy * dy + wz * dz) / length2, 0.0), 1.0)
        wx, wy, wz = wx - s * dx, wy - s * dy, wz - s * dz
    return wx * wx + wy * wy + wz * wz
