"""Heights over grids with level areas, against the same grid measured point by point."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import drop_grid
from geometry.mesh_queries.flat_grid import drop_over_flats


def terraces(seed: int) -> TriangleMesh:
    """Columns of random heights, 4 mm wide, some as high as their neighbours, and a thin spike."""
    rng = np.random.default_rng(seed)
    vertices, faces = [], []

    def quad(*corners):
        n = len(vertices)
        vertices.extend(corners)
        faces.extend([(n, n + 1, n + 2), (n, n + 2, n + 3)])

    heights = rng.integers(0, 3, (6, 5)) * 2.0
    for (j, i), z in np.ndenumerate(heights):
        x, y = 4.0 * i, 4.0 * j
        quad((x, y, z), (x + 4, y, z), (x + 4, y + 4, z), (x, y + 4, z))
        for a, b in (((x, y), (x + 4, y)), ((x + 4, y), (x + 4, y + 4)), ((x + 4, y + 4), (x, y + 4)),
                     ((x, y + 4), (x, y))):
            quad((*a, -1.0), (*b, -1.0), (*b, z), (*a, z))
    n = len(vertices)
    vertices.extend([(9.0, 9.0, 0.0), (9.05, 9.0, 0.0), (9.0, 9.05, 7.0)])
    faces.append((n, n + 1, n + 2))
    places, same = np.unique(np.array(vertices, float), axis=0, return_inverse=True)
    return TriangleMesh(places, same.reshape(-1)[np.array(faces)].astype(np.int32), np.ones(len(faces), np.int32))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("radius", "corner"), [(1.5, 1.5), (0.6, 0.2), (0.5, 0.0)])
def test_heights_are_those_of_every_point(seed, radius, corner):
    tree = TriangleTree(terraces(seed))
    grid = (-2.03, -1.51, 0.08, 300, 350)
    whole = drop_over_flats(tree, *grid, radius, corner, large=0)
    true = drop_grid(tree, *grid, radius, corner)
    assert np.array_equal(np.isfinite(whole), np.isfinite(true))
    there = np.isfinite(true)
    assert np.abs(whole[there] - true[there]).max() <= 1e-9
