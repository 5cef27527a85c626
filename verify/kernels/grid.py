"""Nodes of a grid inside a closed mesh, and the surface of a field of signed distances.

Node (i, j, k) stands at origin + (i, j, k) h.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL

ASIDE = (1.2345e-7, 2.3456e-7)
"""mm by which columns stand beside their nodes, so that none runs along an edge of a mesh on round numbers."""


@njit(**KERNEL)
def _cross_facet(inside, i0, i1, origin, h, p, q, s):
    """Turn round the nodes above one triangle in the columns i0..i1-1 under which it lies."""
    ux, uy, vx, vy = q[0] - p[0], q[1] - p[1], s[0] - p[0], s[1] - p[1]
    twice = ux * vy - uy * vx
    if twice == 0.0:
        return
    ox, oy = origin[0] + ASIDE[0], origin[1] + ASIDE[1]
    _, ny, nz = inside.shape
    a0 = max(i0, math.ceil((p[0] + min(0.0, ux, vx) - ox) / h))
    a1 = min(i1 - 1, math.floor((p[0] + max(0.0, ux, vx) - ox) / h))
    b0 = max(0, math.ceil((p[1] + min(0.0, uy, vy) - oy) / h))
    b1 = min(ny - 1, math.floor((p[1] + max(0.0, uy, vy) - oy) / h))
    for i in range(a0, a1 + 1):
        x = ox + i * h - p[0]
        for j in range(b0, b1 + 1):
            y = oy + j * h - p[1]
            f, g = (x * vy - y * vx) / twice, (ux * y - uy * x) / twice
            if f >= 0.0 and g >= 0.0 and f + g <= 1.0:
                z = p[2] + f * (q[2] - p[2]) + g * (s[2] - p[2])
                for k in range(max(0, math.ceil((z - origin[2]) / h)), nz):
                    inside[i, j, k] = not inside[i, j, k]


@njit(**KERNEL)
def cross_columns(inside, i0, i1, origin, h, vertices, faces):
    """Mark the nodes inside a closed mesh in the columns i0..i1-1; ``inside`` (nx, ny, nz) bool, False before."""
    for t in range(len(faces)):
        _cross_facet(inside, i0, i1, origin, h, vertices[faces[t, 0]], vertices[faces[t, 1]], vertices[faces[t, 2]])


@njit(**KERNEL)
def net_vertices(field, number, out, h):
    """A vertex in every cell whose corners differ in sign: the mean of where its edges cross zero.

    field  : (nx, ny, nz) float32, below zero on its border; number (nx-1, ny-1, nz-1) int32 is filled, -1 for none
    out    : (v, 3) float64, in mm from node 0; with v = 0 vertices are only counted

    Returns the number of vertices.
    """
    nx, ny, nz = number.shape
    count = 0
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                number[i, j, k] = -1
                least, most = np.inf, -np.inf
                for c in range(8):
                    v = field[i + (c >> 2), j + (c >> 1 & 1), k + (c & 1)]
                    least, most = min(least, v), max(most, v)
                if least > 0.0 or most <= 0.0:
                    continue
                if count < len(out):
                    _mean_crossing(field, i, j, k, out[count], h)
                number[i, j, k] = count
                count += 1
    return count


@njit(**KERNEL)
def _mean_crossing(field, i, j, k, out, h):
    n = 0
    x = y = z = 0.0
    for c in range(8):
        ci, cj, ck = c >> 2, c >> 1 & 1, c & 1
        v = field[i + ci, j + cj, k + ck]
        for e in range(3):
            di, dj, dk = ci + (e == 0), cj + (e == 1), ck + (e == 2)
            if di > 1 or dj > 1 or dk > 1:
                continue
            w = field[i + di, j + dj, k + dk]
            if (v > 0.0) != (w > 0.0):
                f = v / (v - w)
                x += ci + f * (di - ci)
                y += cj + f * (dj - cj)
                z += ck + f * (dk - ck)
                n += 1
    out[0], out[1], out[2] = (i + x / n) * h, (j + y / n) * h, (k + z / n) * h


@njit(**KERNEL)
def net_faces(field, number, out):
    """Two triangles across every edge of the grid that changes sign, seen from where stock is not.

    out : (t, 3) int32, rows of ``net_vertices``; with t = 0 triangles are only counted

    Returns the number of triangles.
    """
    nx, ny, nz = field.shape
    count = 0
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            for k in range(1, nz - 1):
                solid = field[i, j, k] > 0.0
                for e in range(3):
                    other = field[i + (e == 0), j + (e == 1), k + (e == 2)] > 0.0
                    if solid == other:
                        continue
                    if count + 1 < len(out):
                        # the four cells round the edge, in the order that turns about it
                        u, v = (e + 1) % 3, (e + 2) % 3
                        pi, pj, pk = i - (u == 0), j - (u == 1), k - (u == 2)
                        ri, rj, rk = i - (v == 0), j - (v == 1), k - (v == 2)
                        a, c = number[pi + ri - i, pj + rj - j, pk + rk - k], number[i, j, k]
                        b, d = number[ri, rj, rk], number[pi, pj, pk]
                        if not solid:
                            b, d = d, b
                        out[count, 0], out[count, 1], out[count, 2] = a, b, c
                        out[count + 1, 0], out[count + 1, 1], out[count + 1, 2] = a, c, d
                    count += 2
    return count
