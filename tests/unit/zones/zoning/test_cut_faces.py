"""A face of a STEP file cut by planes: its pieces over the unit square, and what passes over each leave."""

import numpy as np
import pytest

from geometry.sampling import sample_surface
from geometry.step_import.face_surfaces import read_patches
from geometry.step_import.reader import read_part
from geometry.surfaces.foot_points import foot_points
from geometry.trimming.trim import trim_faces
from tests.hand_parts import ball
from toolpath.passes.cutter_locations import lifted
from toolpath.passes.forward_step import PassProfile, steps
from toolpath.passes.trimmed_faces import TrimmedFace
from verify.moves import Moves
from verify.surface.removal import residual_on_normals

PLANES = (6.5, 10.0)  # of z + 0.15 x, mm
SCALLOP, CHORD = 0.02, 0.004


def height(points):
    return points[:, 2] + 0.15 * points[:, 0]


@pytest.fixture(scope="module")
def cut(demo_files):
    """The part and its largest free-form wall in three pieces, by number of the piece."""
    part = read_part(demo_files[0])
    face = max((f for f in part.faces if f.surface not in ("plane", "cylinder")), key=lambda f: f.area).number
    patch = read_patches(demo_files[0], [face])[face]
    made = trim_faces(part, [face], lambda p, _n, _f: np.digitize(height(p), PLANES), 0.5)
    pieces = {k: [TrimmedFace(face, patch.surface, tuple(patch.parameters(q) for q in p.loops), p.area) for p in found]
              for k, found in made.items()}
    return part, face, patch, pieces


@pytest.mark.parametrize("piece", [0, 1, 2])
def test_passes_over_a_piece_between_cutting_planes(cut, piece):
    part, face, patch, pieces = cut
    assert sorted(pieces) == [0, 1, 2]
    assert sum(f.area for found in pieces.values() for f in found) == pytest.approx(
        part.mesh.areas[part.mesh.face_ids == face].sum(), rel=1e-6)
    body, lines, borders = ball(2.0), [], []
    for one in pieces[piece]:
        for iso, etas in one.passes(1.0, SCALLOP - CHORD, None):
            for eta in etas.tolist():
                profile = PassProfile.of(iso.curve(eta), CHORD, 1.0)
                lines += lifted(profile, steps(profile, 1.0, CHORD, SCALLOP), body,
                                lambda xy: np.full(len(xy), -np.inf), CHORD)[0]
                borders.append(profile.contact)
    start, end = np.vstack([q[:-1] for q in lines]), np.vstack([q[1:] for q in lines])
    s = sample_surface(part.mesh, 100.0, seed=2, triangles=np.flatnonzero(part.mesh.face_ids == face))
    own = s.subset(np.digitize(height(s.points), PLANES) == piece)
    at = foot_points(patch.surface, own.points, patch.parameters(part.uv[own.triangle].mean(axis=1))).uv
    points, normals = patch.surface.points_and_normals(at)
    left = residual_on_normals(points, normals, np.full(len(points), 10.0), Moves(
        start, end, np.ones(len(start), bool), np.zeros(len(start), np.int32)), [body])[0]
    assert left.max() <= SCALLOP and left.min() > -1.05 * CHORD
    reached = height(np.vstack(borders))  # to what a spline through 41 places of a border is off
    low, high = (-np.inf, *PLANES)[piece], (*PLANES, np.inf)[piece]
    assert reached.min() > low - 0.03 and reached.max() < high + 0.03
    if piece == 1:
        assert reached.min() < low + 0.03 and reached.max() > high - 0.03
