"""Meshes the drop is timed and compared on."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline

from geometry.mesh import TriangleMesh

# heights of the thesis' convex test surface, its table 4.4: a 5 x 5 net over 50 x 50 mm. Row 0 as rows 1 to 4 have it;
# the print misplaces two of its points.
CONVEX_Z = np.array([[15.0, 17.5, 20.0, 17.5, 15.0], [17.5, 20.0, 22.5, 20.0, 17.5], [20.0, 22.5, 25.0, 22.5, 20.0],
                     [17.5, 20.0, 22.5, 20.0, 17.5], [15.0, 17.5, 20.0, 17.5, 15.0]])


def field(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> TriangleMesh:
    """Two facets to each cell of a net (n + 1, m + 1) of points, mm."""
    n, m = x.shape[0] - 1, x.shape[1] - 1
    i = (np.arange(n)[:, None] * (m + 1) + np.arange(m)).ravel()
    faces = [np.stack([i, i + 1, i + m + 2], 1), np.stack([i, i + m + 2, i + m + 1], 1)]
    return TriangleMesh(np.stack([x, y, z], -1).reshape(-1, 3), np.concatenate(faces))


def wavy(cells: int, size: float = 100.0) -> TriangleMesh:
    """A wavy field of size x size mm with 2 cells^2 facets."""
    g = np.linspace(0.0, size, cells + 1)
    x, y = np.meshgrid(g, g)
    return field(x, y, 5.0 * np.sin(x / 12.0) + 4.0 * np.cos(y / 9.0) + 0.05 * x)


def convex(cells: int) -> TriangleMesh:
    """The thesis' convex test surface, order 4 both ways, open uniform, as 2 cells^2 facets even in u and v."""
    knots = np.array([0.0, 0, 0, 0, 1, 2, 2, 2, 2])
    basis = BSpline.design_matrix(np.linspace(0.0, 2.0, cells + 1), knots, 3).toarray()
    flat = np.repeat(basis @ np.linspace(0.0, 50.0, 5), cells + 1).reshape(cells + 1, cells + 1)
    return field(flat.T, flat, basis @ CONVEX_Z @ basis.T)


def walls(n: int = 40) -> TriangleMesh:
    """Upright walls round pockets of a floor, of two facets each, 50 x 50 mm."""
    rng = np.random.default_rng(2)
    quad = np.array([[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4], [2, 6, 7], [2, 7, 3], [0, 4, 6],
                     [0, 6, 2], [1, 3, 7], [1, 7, 5]])
    unit = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    size = np.where(rng.random((n, 1)) < 0.5, [10.0, 1.0, 8.0], [1.0, 10.0, 8.0]) * (0.5 + rng.random((n, 3)))
    boxes = np.concatenate([[unit * [50.0, 50.0, 2.0] - [0, 0, 2.0]],
                            unit * size[:, None] + np.pad(rng.random((n, 1, 2)) * 45.0, ((0, 0), (0, 0), (0, 1)))])
    return TriangleMesh(boxes.reshape(-1, 3), np.concatenate([quad + 8 * k for k in range(n + 1)]))


def slivers(n: int = 2000) -> TriangleMesh:
    """Long needles, some folded, some upright, over 50 x 50 mm."""
    rng = np.random.default_rng(3)
    a = rng.random((n, 3)) * [50.0, 50.0, 8.0]
    b = a + rng.normal(size=(n, 3)) * [6.0, 6.0, 2.0]
    c = a + (b - a) * rng.random((n, 1)) + rng.normal(size=(n, 3)) * 10.0 ** -rng.integers(1, 8, (n, 1))
    c[::9, :2] = a[::9, :2]
    return TriangleMesh(np.stack([a, b, c], 1).reshape(-1, 3), np.arange(3 * n).reshape(n, 3))


def impeller(blades: int = 7, cells: int = 60) -> TriangleMesh:
    """A hub that rises to its axis, and twisted steep blades on it, 50 mm across, centre (25, 25)."""
    g = np.linspace(0.0, 1.0, cells + 1)
    turn, out = np.meshgrid(2.0 * np.pi * g, g)
    rho = 4.0 + 21.0 * out
    parts = [field(25 + rho * np.cos(turn), 25 + rho * np.sin(turn), 12.0 * (1.0 - out) ** 2)]
    up, out = np.meshgrid(g, g)
    rho = 5.0 + 19.0 * out
    for k in range(blades):
        for side in (-0.5, 0.5):  # mm to each side of the blade's middle
            angle = 2.0 * np.pi * k / blades + 0.9 * out + (0.25 * up * (1.0 - out)) + side * (1.0 - 0.4 * up) / rho
            parts.append(field(25 + rho * np.cos(angle), 25 + rho * np.sin(angle),
                               12.0 * (1.0 - out) ** 2 + up * (10.0 - 4.0 * out)))
    start = np.cumsum([0] + [len(p.vertices) for p in parts])
    return TriangleMesh(np.concatenate([p.vertices for p in parts]),
                        np.concatenate([p.faces + s for p, s in zip(parts, start, strict=False)]))
