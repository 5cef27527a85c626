"""Faces of STEP parts as NURBS surfaces, against the nodes of the part's mesh."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("cadquery")
import cadquery as cq  # noqa: E402

from benchmarks.reach.exact_faces import ExactFaces  # noqa: E402
from geometry.errors import GeometryError, StepError  # noqa: E402
from geometry.setup_frame import SetupFrame  # noqa: E402
from geometry.step_import.face_surfaces import patches_from_bytes, patches_to_bytes, read_patches  # noqa: E402
from geometry.step_import.occ.loading import load_part  # noqa: E402
from geometry.step_import.occ.patches import load_patches  # noqa: E402
from geometry.step_import.reader import read_part, read_part_and_faces  # noqa: E402
from tests.step_files import real_part, write_step  # noqa: E402

PLACE = SetupFrame((1, 2, 3), (0.1, 1, 0.2), (1, 0, 0))


def read_here(path):
    """Part and patches without child processes, which take seconds to start."""
    part = load_part(path, placement=PLACE, chord=0.02, angle=0.3)
    return part, patches_from_bytes(load_patches(path, placement=PLACE))


def misses(path, read=read_here):
    """Nodes against patches at their parameters: largest distance (mm) inside faces, and of all; least cosine between
    normals; largest deviation the patches own to (mm)."""
    part, patches = read(path)
    assert list(patches) == [f.number for f in part.faces]
    mesh = part.mesh
    pairs = np.unique(np.stack([mesh.faces.ravel(), np.repeat(mesh.face_ids, 3)], axis=1), axis=0)
    owners = np.bincount(pairs[:, 0], minlength=len(mesh.vertices))
    inside = border = 0.0
    cosine = 1.0
    for number, patch in patches.items():
        rows = mesh.face_ids == number
        corner = mesh.faces[rows].ravel()
        uv = patch.parameters(part.uv[rows].reshape(-1, 2))
        off = np.linalg.norm(patch.surface.points(uv) - mesh.vertices[corner], axis=1)
        inside = max(inside, off[owners[corner] == 1].max(initial=0.0))
        border = max(border, off.max())
        with np.errstate(invalid="ignore"):
            agree = (patch.surface.normals(uv) * mesh.corner_normals[rows].reshape(-1, 3)).sum(axis=1)
        cosine = min(cosine, np.nanmin(agree, initial=1.0))
    return inside, border, cosine, max(p.deviation for p in patches.values())


def test_faces_of_the_demo_part_lie_on_their_patches(demo_files):
    inside, border, cosine, deviation = misses(
        demo_files[0], lambda p: (read_part(p, placement=PLACE, chord=0.02), read_patches(p, placement=PLACE)))
    assert inside < 1e-12 and border < 2e-6 and cosine > 1 - 1e-12 and deviation < 1e-12


@pytest.mark.parametrize(("name", "gap"), [("wall_nist_ftc_10_wavy.stp", 0.005), ("blade_seed_propeller.stp", 0.01)])
def test_faces_of_parts_by_others_lie_on_their_patches(name, gap):
    """Nodes on borders stand off by what the borders of the file stand off its own faces."""
    inside, border, cosine, deviation = misses(real_part(name))
    assert inside < 1e-11 and border < gap and cosine > 0.9999 and deviation < 1e-11


SHAPES = {
    "cylinder": lambda: cq.Solid.makeCylinder(4, 9),
    "bore": lambda: cq.Workplane().box(20, 20, 5).faces(">Z").workplane().hole(6).val(),
    "cone to its tip": lambda: cq.Solid.makeCone(4, 0, 6),
    "sphere": lambda: cq.Solid.makeSphere(4, angleDegrees1=-90, angleDegrees2=90),
    "torus": lambda: cq.Solid.makeTorus(8, 2),
    "turned spline": lambda: cq.Workplane("XZ").moveTo(2, 0).spline([(4, 3), (3, 6)], includeCurrent=True)
                               .lineTo(0, 6).lineTo(0, 0).close().revolve(360, (0, 0, 0), (0, 1, 0)).val(),
    "moved": lambda: cq.Workplane().box(8, 6, 4).edges("|Z").fillet(1).val()
                       .moved(cq.Location((3, 2, 1), (1, 1, 0), 40)),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_every_kind_of_surface(shape, tmp_path):
    path = write_step(SHAPES[shape](), tmp_path / "part.step")
    inside, border, cosine, deviation = misses(path)
    assert max(inside, border) < 1e-6 and cosine > 1 - 1e-9 and deviation < 1e-9


def test_curvature_is_that_of_the_exact_face(demo_files):
    part, patches = read_here(demo_files[0])
    exact = ExactFaces(demo_files[0], placement=PLACE)
    face = max((f for f in part.faces if f.surface in ("bspline", "extrusion")), key=lambda f: f.area).number
    patch = patches[face]
    rows = part.mesh.face_ids == face
    uv, points = part.uv[rows].reshape(-1, 2)[:40], part.mesh.triangles[rows].reshape(-1, 3)[:40]
    assert np.allclose(patch.surface.curvature(patch.parameters(uv)), exact.evaluate(face, points).curvature, atol=1e-5)


def test_faces_read_behind_the_part_are_those_read_alone(demo_files):
    parts = []
    both = read_part_and_faces(demo_files[0], parts.append, flat=False, placement=PLACE, chord=0.02)
    curved = [f.number for f in parts[0].faces if f.surface != "plane"]
    assert both == patches_to_bytes(read_patches(demo_files[0], curved, placement=PLACE).values())
    assert parts[0].to_bytes() == read_part(demo_files[0], placement=PLACE, chord=0.02).to_bytes()


def test_faces_by_number_and_errors(demo_files, tmp_path):
    assert list(read_patches(demo_files[0], [3, 1])) == [1, 3]
    with pytest.raises(GeometryError) as caught:
        read_patches(demo_files[0], [99])
    assert caught.value.code == "no_such_face" and caught.value.subjects == ("F99",)
    (tmp_path / "no.step").write_text("nothing")
    with pytest.raises(StepError):
        read_patches(tmp_path / "no.step")
