"""Four-sided regions for re-parameterisations: smooth, moderate, severe, and one with a step in its top."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.spatial import Delaunay

from geometry.quadgrid import Quad, even


def region(bump: float, notch: float, step: float = 0.0, size: float = 1.0) -> tuple[np.ndarray, ...]:
    """Bottom, right, top, left of a region of about ``size`` mm: a bump into it from below, a notch in its top, curved
    sides, and a step down by ``step`` in its top."""
    t = np.linspace(0.0, 1.0, 801)

    def hill(at: float, wide: float) -> np.ndarray:
        h = np.exp(-(((t - at) / wide) ** 2))
        return h - h[0] * (1 - t) - h[-1] * t

    bottom = np.column_stack([t, bump * hill(0.5, 0.12)])
    top = np.column_stack([t, 1.0 + notch * hill(0.35, 0.1)])
    right, left = np.column_stack([1.0 + 0.06 * np.sin(np.pi * t), t]), np.column_stack([-0.06 * np.sin(np.pi * t), t])
    if step:
        after = t > 0.7
        top[after, 1] -= step
        top = np.insert(top, int(np.flatnonzero(after)[0]), [top[after][0, 0], top[~after][-1, 1]], axis=0)
        right = right * [1.0, 1.0 - step]
    return tuple(size * side for side in (bottom, right, top[::-1], left[::-1]))


def quad(name: str, n: int, m: int) -> Quad:
    """A smooth (A), moderate (M) or severe (B) region as sides of n and m places."""
    return Quad.of(region(**{"A": {"bump": 0.0, "notch": 0.05}, "M": {"bump": 0.2, "notch": -0.17},
                             "B": {"bump": 0.35, "notch": -0.28, "step": 0.12}}[name]), n, m)  # type: ignore[arg-type]


def triangulated(sides: tuple[np.ndarray, ...],
                 spacing: float) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, ...]]:
    """Vertices (k, 2), triangles (m, 3) and the vertices along each side of a region, about ``spacing`` apart."""
    border: list[np.ndarray] = []
    rows = []
    for side in sides:
        length = np.linalg.norm(np.diff(side, axis=0), axis=1).sum()
        line = even(side, max(3, int(np.ceil(length / spacing)) + 1))
        rows.append(np.arange(len(border), len(border) + len(line)))
        border += list(line[:-1])
    count, edge = len(border), np.array(border)
    region = shapely.Polygon(edge)
    low, high = edge.min(axis=0), edge.max(axis=0)
    x, y = np.meshgrid(np.arange(low[0], high[0], spacing), np.arange(low[1], high[1], 0.866 * spacing))
    x[1::2] += 0.5 * spacing
    lattice = np.column_stack([x.ravel(), y.ravel()])
    places = np.vstack([edge, lattice[shapely.contains_xy(region.buffer(-0.5 * spacing), *lattice.T)]])
    while True:
        faces = Delaunay(places).simplices
        middle = places[faces].mean(axis=1)
        faces = faces[shapely.contains_xy(region, *middle.T)]
        edges, shared = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0,
                                  return_counts=True)
        chords = edges[(edges < count).all(axis=1) & (shared == 2)]
        if not len(chords):
            break
        places = np.vstack([places, places[chords].mean(axis=1)])
    a, b, c = (places[faces[:, k]] for k in range(3))
    over = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    faces[over] = faces[over][:, ::-1]
    return places, faces, tuple(r % count for r in rows)
