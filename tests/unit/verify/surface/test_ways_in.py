"""How far a cut stands inside the part, where it goes right through a part of a face."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import sample_surface
from tests.pocket_case import SETUP, TOOL
from verify.findings import Source
from verify.moves import Moves
from verify.surface.asked_faces import Cutting
from verify.surface.ways_in import deep_findings

TOP = 2


def wedge() -> TriangleMesh:
    """10 x 10 mm, top at z = 0 (face 2), the bottom rises from -7 at x = 0 to -3 at x = 10."""
    ring = [(0, 0, -7), (10, 0, -3), (10, 0, 0), (0, 0, 0)]
    v = np.array(ring + [(x, 10, z) for x, _, z in ring], float)
    quads = [(1, (0, 1, 2, 3)), (1, (7, 6, 5, 4)), (1, (0, 4, 5, 1)), (1, (1, 5, 6, 2)), (TOP, (2, 6, 7, 3)),
             (1, (3, 7, 4, 0))]
    faces = [t for _, (a, b, c, d) in quads for t in ((a, b, c), (a, c, d))]
    return TriangleMesh(v, np.array(faces, np.int32), np.array([n for n, _ in quads for _ in range(2)], np.int32))


def test_a_level_cut_that_goes_through_the_thin_half_is_as_deep_as_in_the_thick_half():
    mesh = wedge()
    y = np.arange(-1.0, 11.5, 2.0)
    moves = Moves(np.column_stack([np.full(len(y), -5.0), y, np.full(len(y), -5.0)]),
                  np.column_stack([np.full(len(y), 15.0), y, np.full(len(y), -5.0)]), np.ones(len(y), bool),
                  np.zeros(len(y), np.int32))
    cutting = Cutting(TriangleTree(mesh), replace(SETUP, stock_kind="box", margin=0.5), moves, (TOOL,))
    samples = sample_surface(mesh, 4.0, seed=1, triangles=np.flatnonzero(mesh.face_ids == TOP))
    source = Source(("P",), np.zeros(len(y), np.int32), np.arange(1, len(y) + 1, dtype=np.int32),
                    np.ones(len(y), np.int32))
    (found,) = deep_findings(samples, np.full(len(samples), -2.0), np.zeros(len(samples), np.int32), cutting, source)
    assert found.face == f"F{TOP}" and found.depth == pytest.approx(5.0, abs=0.01)
