"""Samples lie evenly inside a triangle, not only among triangles."""

import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.sampling import sample_surface


@pytest.mark.parametrize("corner", [0, 1, 2])
def test_every_part_of_a_triangle_has_its_share(corner):
    vertices = np.array([[0.0, 0, 0], [12.0, 1.0, 0], [2.0, 9.0, 3.0]])
    mesh = TriangleMesh(vertices, np.array([[0, 1, 2]], np.int32), np.array([1], np.int32))
    samples = sample_surface(mesh, 200.0, seed=5)
    assert samples.area.sum() == pytest.approx(mesh.areas.sum(), rel=1e-9)
    # barycentric weight of the corner: above t lies the share (1 - t)^2 of the area
    frame = np.vstack([vertices.T, [1.0, 1.0, 1.0]])
    weight = np.linalg.lstsq(frame, np.vstack([samples.points.T, np.ones(len(samples))]), rcond=None)[0][corner]
    assert weight.min() > -1e-9
    for t in (0.2, 0.5, 0.8):
        share = (1.0 - t) ** 2
        assert (weight > t).mean() == pytest.approx(share, abs=4.0 * np.sqrt(share * (1 - share) / len(samples)))
