"""Meshes that a drop kernel finds easy, steep or nasty."""

from __future__ import annotations

import numpy as np

from geometry.mesh import TriangleMesh


def smooth(n: int = 12, size: float = 20.0) -> TriangleMesh:
    """A wavy height field of 2 n^2 facets."""
    g = np.linspace(0.0, size, n + 1)
    x, y = np.meshgrid(g, g)
    z = 2.0 * np.sin(0.45 * x) + 1.5 * np.cos(0.6 * y) + 0.1 * x
    cell = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = [np.stack([cell, cell + 1, cell + n + 2], 1), np.stack([cell, cell + n + 2, cell + n + 1], 1)]
    return TriangleMesh(np.stack([x, y, z], -1).reshape(-1, 3), np.concatenate(faces))


def box(lower, upper) -> TriangleMesh:
    """A closed box: vertical walls of two facets each."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    lo, hi = np.asarray(lower, float), np.asarray(upper, float)
    return TriangleMesh(lo + corners * (hi - lo), np.array(faces))


def join(*meshes: TriangleMesh) -> TriangleMesh:
    """All triangles of several meshes."""
    start = np.cumsum([0] + [len(m.vertices) for m in meshes])
    return TriangleMesh(np.concatenate([m.vertices for m in meshes]),
                        np.concatenate([m.faces + s for m, s in zip(meshes, start, strict=False)]))


def walls() -> TriangleMesh:
    """Two thin vertical walls on a floor, a bar between them, one wall leaning a little."""
    wall = box((4.0, 2.0, 0.0), (5.0, 18.0, 12.0))
    other = box((9.0, 2.0, 0.0), (10.0, 18.0, 11.0))
    lean = np.eye(4)
    lean[0, 2] = 0.05
    return join(box((0, 0, -2), (20, 20, 0)), wall, other.transformed(lean), box((5, 8, 4), (9.3, 9, 5)))


def slivers(seed: int = 3, n: int = 60) -> TriangleMesh:
    """Long needles, folded and nearly vertical triangles, some without area."""
    rng = np.random.default_rng(seed)
    a = rng.random((n, 3)) * [20, 20, 6]
    b = a + rng.normal(size=(n, 3)) * [6, 6, 2]
    c = a + (b - a) * rng.random((n, 1)) + rng.normal(size=(n, 3)) * (10.0 ** -rng.integers(1, 12, (n, 1)))
    c[::7] = 0.5 * (a[::7] + b[::7])
    c[1::9, :2] = a[1::9, :2]
    return TriangleMesh(np.stack([a, b, c], 1).reshape(-1, 3), np.arange(3 * n).reshape(n, 3))


def soup(seed: int = 5, n: int = 80) -> TriangleMesh:
    """Well-shaped triangles in any position."""
    rng = np.random.default_rng(seed)
    return TriangleMesh((rng.random((n, 1, 3)) * [20, 20, 6] + rng.normal(size=(n, 3, 3)) * 2.5).reshape(-1, 3),
                        np.arange(3 * n).reshape(n, 3))


SHAPES = {"smooth": smooth, "walls": walls, "slivers": slivers, "soup": soup}
CUTTERS = {"ball": (1.6, 1.6), "small_ball": (0.3, 0.3), "flat": (1.5, 0.0), "bull": (2.0, 0.5),
           "round_bull": (2.0, 1.7), "sharp_bull": (3.0, 0.01)}
