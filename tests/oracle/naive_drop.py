"""Slow, obvious twins of the shape kernels: every triangle by itself, no hierarchy, no shortcuts."""

from __future__ import annotations

import numpy as np

from geometry.mesh import TriangleMesh


def profile(rho, radius, corner_radius):
    """Height of the cutter above its tip at the distance rho <= radius from its axis."""
    t = np.clip(rho - (radius - corner_radius), 0.0, corner_radius)
    return corner_radius - np.sqrt(corner_radius**2 - t**2)


def lift_of_points(points, x, y, radius, corner_radius):
    """Highest tip that any of the points (n, 3) forces on a cutter over (x, y); also a bound by sampling."""
    rho = np.hypot(points[:, 0] - x, points[:, 1] - y)
    inside = rho < radius
    if not inside.any():
        return -np.inf
    return float((points[inside, 2] - profile(rho[inside], radius, corner_radius)).max())


def _lift_of_edges(a, b, x, y, radius, corner_radius):
    """Ternary search along the part of each edge that is under the cutter: the lift is concave there."""
    a, b = a - [x, y, 0.0], b - [x, y, 0.0]
    e = b - a
    ee, ae, aa = (e[:, :2] ** 2).sum(1), (a[:, :2] * e[:, :2]).sum(1), (a[:, :2] ** 2).sum(1)
    ok = ee > 1e-20
    a, e, ee, ae, aa = a[ok], e[ok], ee[ok], ae[ok], aa[ok]
    disc = ae**2 - ee * (aa - radius**2)
    ok = disc > 0.0
    a, e, ee, ae, disc = a[ok], e[ok], ee[ok], ae[ok], disc[ok]
    lo, hi = np.maximum((-ae - np.sqrt(disc)) / ee, 0.0), np.minimum((-ae + np.sqrt(disc)) / ee, 1.0)
    ok = lo < hi
    a, e, lo, hi = a[ok], e[ok], lo[ok], hi[ok]
    if len(a) == 0:
        return -np.inf

    def lift(t):
        p = a + t[:, None] * e
        return p[:, 2] - profile(np.minimum(np.hypot(p[:, 0], p[:, 1]), radius), radius, corner_radius)

    best = np.maximum(lift(lo), lift(hi))
    for _ in range(110):
        t0, t1 = lo + (hi - lo) / 3.0, hi - (hi - lo) / 3.0
        f0, f1 = lift(t0), lift(t1)
        best = np.maximum(best, np.maximum(f0, f1))
        lo, hi = np.where(f0 < f1, t0, lo), np.where(f0 < f1, hi, t1)
    return float(best.max())


def _lift_of_facets(mesh: TriangleMesh, x, y, radius, corner_radius):
    """Contact of each plane with the corner torus, where it falls inside the triangle."""
    n = mesh.normals * np.where(mesh.normals[:, 2:] < 0.0, -1.0, 1.0)
    ok = n[:, 2] > 1e-9
    n, v = n[ok], mesh.triangles[ok]
    lean = np.hypot(n[:, 0], n[:, 1])
    away = np.where(lean > 1e-14, radius - corner_radius, 0.0) / np.where(lean > 1e-14, lean, 1.0) + corner_radius
    p = np.array([x, y]) - away[:, None] * n[:, :2]

    def weight(i, j):
        s, t = v[:, i, :2] - p, v[:, j, :2] - p
        return s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]

    w = np.stack([weight(1, 2), weight(2, 0), weight(0, 1)], 1)
    inside = ((w >= 0.0).all(1) | (w <= 0.0).all(1)) & (w.sum(1) != 0.0)
    if not inside.any():
        return -np.inf
    w = w[inside] / w[inside].sum(1, keepdims=True)
    z = (w * v[inside, :, 2]).sum(1)
    return float((z - corner_radius * (1.0 - n[inside, 2])).max())


def drop(mesh: TriangleMesh, x, y, radius, corner_radius):
    """Lowest tip over (x, y): the highest lift of all vertices, edges and facets."""
    v = mesh.triangles
    return max(
        lift_of_points(mesh.vertices[np.unique(mesh.faces)], x, y, radius, corner_radius),
        max(_lift_of_edges(v[:, i], v[:, (i + 1) % 3], x, y, radius, corner_radius) for i in range(3)),
        _lift_of_facets(mesh, x, y, radius, corner_radius),
    )


def first_hit(mesh: TriangleMesh, origin, direction, t_min, t_max):
    """First crossing of one ray with all triangles, each by a 3 x 3 linear system."""
    best, number = np.inf, -1
    for i, (a, b, c) in enumerate(mesh.triangles):
        matrix = np.column_stack([b - a, c - a, -np.asarray(direction)])
        if abs(np.linalg.det(matrix)) < 1e-14:
            continue
        u, v, t = np.linalg.solve(matrix, np.asarray(origin) - a)
        if u >= 0.0 and v >= 0.0 and u + v <= 1.0 and t_min <= t <= t_max and t < best:
            best, number = t, i
    return best, number
