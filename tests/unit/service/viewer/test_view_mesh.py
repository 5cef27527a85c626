"""The part for a page: facets with one label, the worst that was measured at their corners, and a rough level."""

import json
from dataclasses import replace

import numpy as np
import pytest

from geometry.sampling import sample_surface
from geometry.step_import.reader import read_part
from geometry.tool_body import ToolBody
from service.viewer.view_data import tool_shape
from service.viewer.view_file import read_view, write_view
from service.viewer.view_mesh import (
    CELLS,
    JUDGED,
    LEFT_UNIT,
    NOBODY,
    UNCUT,
    UNJUDGED,
    Judged,
    clustered,
    edge_chunk,
    facets_of,
    mesh_chunks,
    top_of,
)
from tests.hand_parts import ball, tool
from tests.step_files import write_step

cq = pytest.importorskip("cadquery")
TOP = 8.0  # mm, height of the block; its upper face has zones on both sides of x = 7


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    """A block of 20 x 10 x 8 mm."""
    path = write_step(cq.Workplane().box(20, 10, TOP, centered=False), tmp_path_factory.mktemp("view") / "block.step")
    return read_part(path)


@pytest.fixture(scope="module")
def judged(part):
    """Samples of the upper face: two labels, one gouge of 0.2 mm at (15, 5), and a corner no cut reached."""
    upper = np.flatnonzero(part.mesh.normals[:, 2] > 0.9)
    s = sample_surface(part.mesh, 100.0, seed=1, triangles=upper)
    excess = np.full(len(s), 0.004)
    excess[np.argmin(np.linalg.norm(s.points - [15, 5, TOP], axis=1))] = -0.2
    corner = (s.points[:, 0] > 18) & (s.points[:, 1] > 8)
    excess[corner] = 1.0
    return Judged(s, np.where(s.points[:, 0] < 7.0, 0, 1), excess, ~corner, 0.01, 0.01)


@pytest.fixture(scope="module")
def facets(part, judged):
    return facets_of(part, judged)


def areas(f):
    p = f.place[f.corners]
    return 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)


def test_the_facets_are_the_part_cut_where_the_label_changes(part, facets):
    area = areas(facets)
    assert area.sum() == pytest.approx(part.mesh.areas.sum(), rel=1e-9)
    assert area[facets.label == 0].sum() == pytest.approx(7 * 10, rel=0.02)
    assert area[facets.label == 1].sum() == pytest.approx(13 * 10, rel=0.02)
    assert set(facets.label.tolist()) == {NOBODY, 0, 1}
    centre = facets.place[facets.corners].mean(axis=1)
    assert centre[facets.label == 0, 0].max() < 7.3 and centre[facets.label == 1, 0].min() > 6.7


def test_a_single_gouge_is_not_lost(facets):
    worst = np.argmin(facets.left)
    assert facets.left[worst] == pytest.approx(-0.2) and np.linalg.norm(facets.place[worst] - [15, 5, TOP]) < 1.0
    assert facets.judged[worst] == JUDGED


def test_what_no_cut_reached_and_what_nobody_judged(facets):
    uncut = facets.place[facets.judged == UNCUT]
    assert len(uncut) and (uncut[:, 0] > 17).all() and (uncut[:, 1] > 7).all()
    assert (facets.judged[facets.place[:, 2] < TOP - 1e-9] == UNJUDGED).all()


def test_chunks_read_back(part, facets):
    low = np.array([-1.0, -1.0, -1.0])
    first, then = mesh_chunks(facets, low)
    assert not then and {c.about["label"] for c in first} == {NOBODY, 0, 1}
    head, chunks = read_view(write_view({}, [*first, edge_chunk(part, low, 0.5)]))
    area = 0.0
    for words, c in zip(head["chunks"][:-1], chunks[:-1], strict=True):
        p = (low + 0.001 * c["place"])[c["corners"]]
        cross = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        area += 0.5 * np.linalg.norm(cross, axis=1).sum()
        normal = c["normal"][c["corners"][:, 0]]
        assert ((cross * normal).sum(axis=1) > 0).all(), words["label"]
    assert area == pytest.approx(part.mesh.areas.sum(), rel=1e-4)
    assert min(c["left"].min() for c in chunks[:-1]) * LEFT_UNIT == pytest.approx(-0.2, abs=LEFT_UNIT)
    edges = chunks[-1]
    ways = np.diff(low + 0.001 * edges["place"], axis=0)
    ends = np.isin(np.arange(1, len(ways) + 1), edges["begins"][1:-1])
    assert np.linalg.norm(ways, axis=1)[~ends].sum() == pytest.approx(4 * (20 + 10 + TOP), abs=0.1)


def test_the_rough_level_is_smaller_and_near(facets):
    rough = clustered(facets)
    assert 0 < len(rough.corners) <= len(facets.corners)
    assert np.abs(rough.place.min(axis=0)).max() < 0.4 and np.abs(rough.place.max(axis=0) - [20, 10, TOP]).max() < 0.4
    assert set(rough.label.tolist()) <= set(facets.label.tolist())


def test_corners_of_one_cell_and_face_become_one(facets):
    """Against groups by whole rows of cell and face, also where a face has a high number."""
    for high in (0, 4711):
        f = replace(facets, face=facets.face + np.int32(high))
        cell = float(np.linalg.norm(np.ptp(f.place, axis=0))) / CELLS
        rows = np.column_stack([np.floor((f.place - f.place.min(axis=0)) / cell).astype(np.int64), f.face])
        _, first, group = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        rough = clustered(f)
        assert np.array_equal(rough.face, f.face[first])
        mean = [f.place[group.reshape(-1) == k].mean(axis=0) for k in range(len(first))]
        np.testing.assert_allclose(rough.place, mean, atol=1e-9)


def test_names_stand_at_the_upper_end(part):
    upper = int(part.mesh.face_ids[np.argmax(part.mesh.normals[:, 2])])
    assert top_of(part, [upper])[2] == pytest.approx(TOP)
    assert top_of(part, []) is None


@pytest.mark.parametrize("body", [ball(4.0), tool(6.0, 1.0), tool(3.0, 0.0)])
def test_the_profile_of_a_tool_is_its_shape(body):
    shape = tool_shape(body)
    cutter = np.array(shape["bodies"][0]["profile"])
    assert cutter[0].tolist() == [0.0, 0.0] and cutter[:, 0].max() == body.radius
    c = body.corner_radius
    arc = cutter[(cutter[:, 1] < c) & (cutter[:, 0] > body.radius - c)]
    assert np.allclose(np.hypot(arc[:, 0] - (body.radius - c), arc[:, 1] - c), c, atol=1e-4)
    assert [b["kind"] for b in shape["bodies"]][-1] in ("shank", "holder")
    json.dumps(shape, allow_nan=False)


@pytest.mark.parametrize("end", [(1.0, 0.5), (2.0, 0.4), (2.0, 0.0)])
def test_the_profile_of_a_tapered_mill_has_its_cone(end):
    body = ToolBody("T1", 1, *end, 12.0, 2.0, 20.0, 6.0, 40.0, taper=np.tan(np.radians(3.0)))
    shape = tool_shape(body)
    cutter = np.array(shape["bodies"][0]["profile"])
    wide, high = body.corner_end
    assert shape["kind"] == body.kind and shape["taper_deg"] == 3.0
    assert np.allclose(cutter[-2:], [[wide, high], [body.widest_radius, 12.0]], atol=1e-5)
    flat = body.radius - body.corner_radius
    assert np.allclose(np.hypot(cutter[1:-1, 0] - flat, cutter[1:-1, 1] - body.corner_radius), body.corner_radius,
                       atol=2e-5)


def test_the_profile_of_a_chamfer_mill_has_its_cone():
    body = replace(tool(6.0, 0.0), named="chamfer", tip_diameter=1.0, cone_height=2.5)
    assert tool_shape(body)["bodies"][0]["profile"][:3] == [[0.0, 0.0], [0.5, 0.0], [3.0, 2.5]]
