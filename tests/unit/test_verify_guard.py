"""True depths of gouges, also under samples of the exact surface that stand over their facets."""

import numpy as np
import pytest

from geometry.bvh import TriangleTree
from tests.hand_parts import dome
from verify.guard import gouge_depths

RADIUS = 15.0


def _on_sphere(off: float):
    """Places ``off`` mm over the middle of the cells of the dome's facets, with the sphere's normals."""
    g = np.linspace(-4.9, 4.9, 50)
    x, y = (a.ravel() for a in np.meshgrid(g, g))
    n = np.column_stack([x, y, np.sqrt(RADIUS**2 - x**2 - y**2)]) / RADIUS
    return n * (RADIUS + off) - [0.0, 0.0, RADIUS], n


@pytest.mark.parametrize("off", [0.0, -0.0006])
def test_a_gouge_under_the_exact_surface_is_as_deep_as_it_is(off):
    points, normals = _on_sphere(off)
    depth = gouge_depths(TriangleTree(dome(RADIUS)), points, normals, np.full(len(points), 0.01))
    np.testing.assert_allclose(depth, 0.01, atol=1e-3)
