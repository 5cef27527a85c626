"""Cubic patches through the nodes of a triangulated parametric surface.

Notation: node i has the place ``place[i]`` (3,) mm and the surface parameters ``par[i]`` (2,). Its patch is
    X_i(u, v) = place[i] + c0 du + c1 dv + c2 du^2 + c3 du dv + c4 dv^2 + c5 du^3 + c6 du^2 dv + c7 du dv^2 + c8 dv^3
with (du, dv) = (u, v) - par[i], ``coef[i]`` (9, 3). The nodes that share a triangle with node i are
``ring[start[i]:start[i + 1]]``.
"""

from __future__ import annotations

import numpy as np
from numba import njit

ENOUGH, RINGS = 16, 4
RIDGE = np.array([1e-14, 1e-14, 1e-10, 1e-10, 1e-10, 1e-6, 1e-6, 1e-6, 1e-6])
"""Cost of each term. Where few rows of nodes do not separate v from v^2, or u^2 from u^3, the lower order wins."""


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def local_nodes(faces, ids, par, vertices, same):
    """Nodes that are one per face, vertex and parameters, so both sides of a seam have their own.

    faces (k, 3), ids (k,) of triangles, par (k, 3, 2), number of vertices; parameters within ``same`` are one.
    Returns (k, 3) int64 nodes of the triangles and (n,) int64, for every node its first corner (3 t + c).
    """
    corner = np.empty((len(faces), 3), np.int64)
    head, follows = np.full(vertices, -1, np.int64), np.empty(3 * len(faces), np.int64)
    first = np.empty(3 * len(faces), np.int64)
    n = 0
    for t in range(len(faces)):
        for c in range(3):
            node = head[faces[t, c]]
            while node >= 0:
                r, q = first[node] // 3, first[node] % 3
                if (ids[r] == ids[t] and abs(par[r, q, 0] - par[t, c, 0]) <= same
                        and abs(par[r, q, 1] - par[t, c, 1]) <= same):
                    break
                node = follows[node]
            if node < 0:
                node = n
                first[node] = 3 * t + c
                follows[node] = head[faces[t, c]]
                head[faces[t, c]] = node
                n += 1
            corner[t, c] = node
    return corner, first[:n].copy()


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def rings(corner, count):
    """Neighbours of every node, most of them twice: (n + 1,) int64 starts and the nodes in one row."""
    start = np.zeros(count + 1, np.int64)
    for t in range(len(corner)):
        for c in range(3):
            start[corner[t, c] + 1] += 2
    for i in range(count):
        start[i + 1] += start[i]
    at, ring = start[:-1].copy(), np.empty(start[-1], np.int64)
    for t in range(len(corner)):
        for c in range(3):
            i = corner[t, c]
            ring[at[i]], ring[at[i] + 1] = corner[t, (c + 1) % 3], corner[t, (c + 2) % 3]
            at[i] += 2
    return start, ring


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _neighbours(i, start, ring, out):
    """Nodes around node i, without it, each once: two rings, and up to ``RINGS`` until there are ``ENOUGH``."""
    n, done = 0, 0
    for turn in range(RINGS):
        if turn >= 2 and n >= ENOUGH:
            break
        end = n
        for m in range(-1 if turn == 0 else done, end):
            j = i if m < 0 else out[m]
            for b in range(start[j], start[j + 1]):
                k = ring[b]
                known = k == i
                for q in range(n):
                    if out[q] == k:
                        known = True
                        break
                if not known and n < len(out):
                    out[n] = k
                    n += 1
        done = end
    return n


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _solve(a, b):
    """a x = b for a (m, m) symmetric and positive definite, b (m, 3) is overwritten by x (Cholesky)."""
    m = len(a)
    for j in range(m):
        for i in range(j, m):
            s = a[i, j]
            for k in range(j):
                s -= a[i, k] * a[j, k]
            a[i, j] = np.sqrt(max(s, 1e-300)) if i == j else s / a[j, j]
    for c in range(3):
        for i in range(m):
            for k in range(i):
                b[i, c] -= a[i, k] * b[k, c]
            b[i, c] /= a[i, i]
        for i in range(m - 1, -1, -1):
            for k in range(i + 1, m):
                b[i, c] -= a[k, i] * b[k, c]
            b[i, c] /= a[i, i]


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _terms(s, t, out):
    """The nine terms of a patch."""
    out[0], out[1], out[2], out[3], out[4] = s, t, s * s, s * t, t * t
    out[5], out[6], out[7], out[8] = s * s * s, s * s * t, s * t * t, t * t * t


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def fit_patches(place, par, start, ring):
    """Least-squares patch of every node, (n, 9, 3) float64, weighted by one over the squared scaled distance."""
    coef = np.zeros((len(place), 9, 3))
    near = np.empty(96, np.int64)
    phi, a, b = np.empty(9), np.empty((9, 9)), np.empty((9, 3))
    for i in range(len(place)):
        n = _neighbours(i, start, ring, near)
        su, sv = 0.0, 0.0
        for m in range(n):
            su = max(su, abs(par[near[m], 0] - par[i, 0]))
            sv = max(sv, abs(par[near[m], 1] - par[i, 1]))
        if su <= 0.0 or sv <= 0.0:
            continue
        for p in range(9):
            for q in range(9):
                a[p, q] = 0.0
            for c in range(3):
                b[p, c] = 0.0
        total = 0.0
        for m in range(n):
            s, t = (par[near[m], 0] - par[i, 0]) / su, (par[near[m], 1] - par[i, 1]) / sv
            w = 1.0 / (s * s + t * t + 1e-6)
            total += w
            _terms(s, t, phi)
            for p in range(9):
                f = w * phi[p]
                for q in range(p + 1):
                    a[p, q] += f * phi[q]
                for c in range(3):
                    b[p, c] += f * (place[near[m], c] - place[i, c])
        for p in range(9):
            a[p, p] += total * RIDGE[p]
        _solve(a, b)
        _terms(su, sv, phi)
        for p in range(9):
            for c in range(3):
                coef[i, p, c] = b[p, c] / phi[p]
    return coef


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _shares(a, b, c, p, out):
    """Barycentric coordinates of p in the triangle a b c, clipped to it."""
    e, f, w = np.empty(3), np.empty(3), np.empty(3)
    for k in range(3):
        e[k], f[k], w[k] = b[k] - a[k], c[k] - a[k], p[k] - a[k]
    ee, ef, ff, we, wf = np.dot(e, e), np.dot(e, f), np.dot(f, f), np.dot(w, e), np.dot(w, f)
    det = max(ee * ff - ef * ef, 1e-300)
    out[1] = min(max((we * ff - wf * ef) / det, 0.0), 1.0)
    out[2] = min(max((wf * ee - we * ef) / det, 0.0), 1.0 - out[1])
    out[0] = 1.0 - out[1] - out[2]


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def blend_patches(corner, points, place, par, coef):
    """Places (k, 3) and unit normals (k, 3) on the patches at points (k, 3) of triangles of nodes (k, 3).

    The three patches of a triangle, taken at the point's own parameters, are blended by its barycentric coordinates.
    NaN normals where the parameters are singular; the sign follows u x v.
    """
    where, normal = np.zeros((len(corner), 3)), np.empty((len(corner), 3))
    xu, xv, share = np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(corner)):
        _shares(place[corner[k, 0]], place[corner[k, 1]], place[corner[k, 2]], points[k], share)
        u, v = 0.0, 0.0
        for m in range(3):
            u += share[m] * par[corner[k, m], 0]
            v += share[m] * par[corner[k, m], 1]
        for c in range(3):
            xu[c], xv[c] = 0.0, 0.0
        for m in range(3):
            i, w = corner[k, m], share[m]
            s, t = u - par[i, 0], v - par[i, 1]
            for c in range(3):
                x = coef[i, :, c]
                where[k, c] += w * (place[i, c] + s * (x[0] + s * (x[2] + s * x[5] + t * x[6]))
                                    + t * (x[1] + s * x[3] + t * (x[4] + s * x[7] + t * x[8])))
                xu[c] += w * (x[0] + 2.0 * s * x[2] + t * x[3] + 3.0 * s * s * x[5] + 2.0 * s * t * x[6]
                              + t * t * x[7])
                xv[c] += w * (x[1] + s * x[3] + 2.0 * t * x[4] + s * s * x[6] + 2.0 * s * t * x[7]
                              + 3.0 * t * t * x[8])
        nx, ny, nz = xu[1] * xv[2] - xu[2] * xv[1], xu[2] * xv[0] - xu[0] * xv[2], xu[0] * xv[1] - xu[1] * xv[0]
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        limit = 1e-9 * np.sqrt((xu @ xu) * (xv @ xv))
        if length > limit and length > 0.0:
            normal[k, 0], normal[k, 1], normal[k, 2] = nx / length, ny / length, nz / length
        else:
            normal[k, 0], normal[k, 1], normal[k, 2] = np.nan, np.nan, np.nan
    return where, normal
