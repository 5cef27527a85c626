"""How far a cut stands inside the part, where it goes right through a part of a face."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import sample_surface
from tests.pocket_case import SETUP, TOOL, block
from verify.findings import Source
from verify.model import Finding, FindingKind
from verify.moves import Moves
from verify.surface.removal import residual_on_normals
from verify.surface.ways_in import deep_findings, slot_findings
from verify.work.asked_faces import Cutting

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


def slots(*passes: tuple[tuple[float, float, float], tuple[float, float, float]]) -> list[Finding]:
    """Slots found in the block (40 x 30 x 10 mm, pocket from x = -10 to 10) after straight passes of a 4 mm tool."""
    start, end = np.array(passes, float).transpose(1, 0, 2)
    n = len(passes)
    moves = Moves(np.ascontiguousarray(start), np.ascontiguousarray(end), np.ones(n, bool), np.zeros(n, np.int32))
    mesh = block().mesh
    cutting = Cutting(TriangleTree(mesh), replace(SETUP, stock_kind="box", margin=0.5), moves, (TOOL,))
    source = Source(("P",), np.zeros(n, np.int32), np.arange(1, n + 1, dtype=np.int32), np.ones(n, np.int32))
    samples = sample_surface(mesh, 1.0, seed=1)
    residual, _ = residual_on_normals(samples.points, samples.normals, np.full(len(samples), 0.5), moves, (TOOL,))
    return slot_findings(samples, residual, cutting, source)


@pytest.mark.parametrize(("by", "front"), [(4.5, 0.5), (5.0, 1.0), (6.5, 2.5)])
def test_a_pass_shifted_by_more_than_the_tool_is_wide_is_as_deep_as_it_was_shifted(by, front):
    """Along the side x = -20 with the edge of the tool in it, and then by so much into the part."""
    x = -22.0 + by
    (found,) = slots(((x, -20.0, -5.0), (x, 20.0, -5.0)))
    assert found.face == "F5" and found.depth == pytest.approx(by, abs=1e-6) and found.kind == FindingKind.GOUGE
    assert f"{front:.4f} mm of the part stand" in found.message and found.line == 1
    assert found.point[0] == pytest.approx(-20.0 + by, abs=1e-6)


def test_a_slot_is_told_of_the_face_it_is_nearer_to():
    """The wall of the pocket is at x = -10, 10 mm behind the side; the slot reaches from 2 to 6 mm behind the wall."""
    (found,) = slots(((-14.0, -20.0, -4.0), (-14.0, 20.0, -4.0)))
    assert found.face == "F10" and found.depth == pytest.approx(6.0, abs=1e-6)


def test_passes_beside_each_other_are_one_slot():
    (found,) = slots(*(((x, -20.0, -5.0), (x, 20.0, -5.0)) for x in (-17.0, -16.0)))
    assert found.face == "F5" and found.depth == pytest.approx(6.0, abs=1e-6)


@pytest.mark.parametrize("where", [
    ((-22.0, -20.0, -5.0), (-22.0, 20.0, -5.0)),  # along the side, as it should be
    ((-20.0, -20.0, -5.0), (-20.0, 20.0, -5.0)),  # into the side: its samples are gouged themselves
    ((-20.0, -20.0, -12.0), (20.0, -20.0, -12.0)),  # outside
    ((-16.0, -8.0, -1.0), (-16.0, 8.0, -1.0)),  # behind less than a fifth of the side
    ((-9.0, 0.0, -5.0), (9.0, 0.0, -5.0)),  # in the pocket
    ((-12.0, -20.0, -9.0), (-12.0, 20.0, -9.0)),  # under the pocket, 6 mm behind the side
])
def test_other_cuts_are_no_slots_behind_a_face(where):
    assert slots(where) == []


def test_a_slot_that_opens_into_the_pocket_is_behind_no_face():
    """From x = -13 to -9, and the wall of the pocket is at -10: seen from the side the cut leaves the part."""
    assert [f.face for f in slots(((-11.0, -20.0, -4.0), (-11.0, 20.0, -4.0)))] == []
