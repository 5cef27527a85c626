"""Which faces have few samples inside: those on which no tool of the setup leaves a cusp."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from geometry.sampling import SurfaceSamples
from service.pictures.clamping_picture import box_mesh, corners_of
from service.stages.sample_spacing import coarse_spacing, split_where_zones_meet
from tests.hand_parts import as_part, tool
from zones.machinable_area import AreaForm

UP = np.array([[0.0, 0.0, 1.0]])
FLAT, BALL = tool(6.0, 0.0), tool(4.0, 2.0)
CONE = replace(tool(3.0, 0.5), taper=0.1)


def spacing(*bodies):
    """By 'level' and 'upright', the spacing of a block of 60 mm, mm."""
    part = as_part(box_mesh(corners_of(np.array([[0.0, 0.0, 0.0], [60.0, 60.0, 60.0]]))))
    part = replace(part, mesh=replace(part.mesh, face_ids=(1 + np.arange(12) // 2).astype(np.int32)))
    part = replace(part, faces=tuple(replace(part.faces[0], number=n) for n in range(1, 7)))
    found = coarse_spacing(part, SimpleNamespace(turns=False, bodies=bodies), UP)
    up = {n: abs(float(part.mesh.normals[part.mesh.face_ids == n][0, 2])) for n in found}
    return {"level" if up[n] > 0.5 else "upright": s for n, s in found.items()}


def test_a_wall_needs_an_upright_side_and_a_floor_a_flat_end():
    assert spacing(FLAT) == {"level": 0.5, "upright": 0.5}
    assert spacing(BALL) == {"upright": 0.5}
    assert spacing(CONE) == {"level": 0.25}
    assert spacing(CONE, FLAT) == {"level": 0.25, "upright": 0.5}
    assert spacing(replace(CONE, diameter=1.0)) == {}


@pytest.mark.parametrize(("body", "form", "stays"), [
    (FLAT, AreaForm.LEVEL, True), (BALL, AreaForm.LEVEL, False), (CONE, AreaForm.LEVEL, True),
    (BALL, AreaForm.STEEP, True), (CONE, AreaForm.STEEP, False)])
def test_a_coarse_sample_stays_only_where_the_tool_of_its_zone_leaves_nothing(body, form, stays):
    mesh = box_mesh(corners_of(np.array([[0.0, 0.0, 0.0], [60.0, 60.0, 60.0]])))
    triangle = np.zeros(1, np.int64)
    one = SurfaceSamples(mesh.vertices[mesh.faces[:1]].mean(axis=1), mesh.normals[:1], np.ones(1), mesh.face_ids[:1],
                         triangle, covers=np.array([0.5]))
    zone = SimpleNamespace(form=form, tool=body, samples=np.zeros(1, np.int64))
    assert (len(split_where_zones_meet(one, one, (zone,), 0.1)) == 1) == stays
