"""Which tool gets which samples."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from geometry.tool_body import HolderFrustum
from tests.hand_parts import as_part, ball, dome, field_of, samples_of, terraces, tool, view_of, walls
from zones.machinable_area import AreaForm, forms_of, machinable_faces
from zones.model import Connection, Decomposition
from zones.plan_view.regions import Labels, Region, face_bases
from zones.reach.access_reach import able, preference
from zones.reach.tip_field import touchable
from zones.zoning.zones import LEAST_PART_MM2, LEAST_ZONE_MM2, _parts, build_zones, is_open

NOTHING = Decomposition((), (), ())


def labels_by_face(base, face):
    """Labels where every face is one region, without looking at the plan."""
    regions = tuple(Region(b) for b in sorted(set(base.values())))
    place = {r.base: k for k, r in enumerate(regions)}
    return Labels(regions, np.array([place[base[int(f)]] for f in face], dtype=np.int64))


def zones_of(mesh, tools, *, faces=None, scallop=0.02, lift=0.002, density=20.0, regions=None):
    samples = samples_of(mesh, density, faces)
    samples = samples.subset(samples.normals[:, 2] > -0.02)
    fields = {t.id: field_of(mesh, t) for t in tools}
    labels = None if regions is None else labels_by_face(regions, samples.face)
    view = view_of(as_part(mesh), samples, fields, labels=labels)
    return samples, fields, list(build_zones([view], NOTHING, scallop, lift).zones)


def face_at(mesh, point, normal) -> int:
    """Number of the face of the triangle with this normal that lies nearest to a point."""
    mine = np.flatnonzero(mesh.normals @ np.array(normal, float) > 0.999)
    centre = mesh.triangles[mine].mean(axis=1)
    return int(mesh.face_ids[mine[np.argmin(np.linalg.norm(centre - np.array(point), axis=1))]])


def test_forms_by_the_normal():
    n = np.array([[0, 0, 1.0], [0.6, 0, 0.8], [0.8, 0, 0.6], [1, 0, 0], [0, 0.0, -1]])
    assert forms_of(n).tolist() == [AreaForm.LEVEL, AreaForm.SHALLOW, AreaForm.STEEP, AreaForm.STEEP, AreaForm.STEEP]


def test_the_seat_and_what_faces_down_are_not_machinable():
    mesh = walls()
    samples = samples_of(mesh, 2.0)
    faces = machinable_faces(samples, NOTHING.seat, None, set())
    assert 1 not in faces and faces == set(range(2, int(mesh.face_ids.max()) + 1))
    assert machinable_faces(samples, NOTHING.seat, None, {3}) == faces - {3}
    assert machinable_faces(samples, NOTHING.seat, {4, 5}, {5}) == {4}
    seat = {f for f in range(1, 7) if (samples.normals[samples.face == f] @ [0, 0, -1] > 0.9).all()}
    lies = Decomposition((), (), (), {}, tuple(seat))
    below = np.array([[0.0, 0.8, -0.6], [0.0, 0.0, 1.0]])
    assert seat and not seat & machinable_faces(samples, lies.seat, None, set(), below), "the part still lies on it"
    assert seat <= machinable_faces(samples, lies.seat, None, set(), [[0.0, 0.0, -1.0]]), "the part lies turned over"


def test_faces_of_a_connection_are_its_region():
    mesh = walls()
    d = Decomposition((), (Connection("C1", (3, 4), ("W1", "W2"), 0, 1),), ())
    region = face_bases(as_part(mesh), d)
    assert region[3] == region[4] == "C1" and region[2] == "free"


def test_a_sharp_end_is_for_planes_and_upright_walls():
    n = np.array([[0, 0, 1.0], [1, 0, 0], [0.9999, 0, 0.0141], [0.6, 0, 0.8]])
    assert able(tool(4, 0), n, 0.02).tolist() == [True, True, True, False]
    assert able(tool(4, 0), n, 0.002).tolist() == [True, True, False, False]
    assert able(ball(4), n, 0.002).all()


def test_flat_ends_come_first_on_planes_only():
    flat, thick = tool(4, 0), ball(6)
    assert preference(flat, AreaForm.LEVEL) < preference(thick, AreaForm.LEVEL)
    assert preference(thick, AreaForm.STEEP) < preference(flat, AreaForm.STEEP)


def test_zones_partition_what_is_in_reach():
    samples, fields, zones = zones_of(walls(), [ball(4, "T1"), tool(3, 0, "T2")])
    taken = np.concatenate([z.samples for z in zones])
    assert len(np.unique(taken)) == len(taken)
    assert [z.id for z in zones] == [f"Z{k}" for k in range(1, len(zones) + 1)]
    for z in zones:
        assert (forms_of(samples.normals[z.samples]) == z.form).all()
        field = fields[z.tool.id]
        at = z.tips + [0, 0, 2e-5]
        assert not (field.blocked_by_cutter(at) | field.blocked_by_body(at)).any()
        assert samples.points[z.samples, 2].min() == z.bottom and samples.points[z.samples, 2].max() == z.top
    level = [z for z in zones if z.form is AreaForm.LEVEL]
    assert {z.tool.id for z in level} == {"T2"}
    assert samples.area[taken].sum() == pytest.approx(samples.area.sum(), rel=0.01)


def test_the_stoutest_tool_stops_where_its_shank_meets_the_wall():
    mesh = terraces([0, 10, 24], [0, 10], [[14, 2]])
    short, long = ball(6, "T1", neck=8.0, shank=10.0), ball(3, "T2", neck=20.0)
    samples, _, zones = zones_of(mesh, [short, long], faces={face_at(mesh, (10, 5, 8), (1, 0, 0))})
    assert [z.tool.id for z in zones] == ["T1", "T2"]
    upper, lower = zones
    assert upper.bottom >= upper.plane > -np.inf
    # at contact the tip stands 3 below the sample; the shank 8 above it has to clear the top at 14
    assert upper.plane == pytest.approx(14 - 8 + 3, abs=0.1)
    assert lower.top < upper.plane and lower.bottom == pytest.approx(2 + 1.5, abs=0.15)
    assert lower.rejected[0]["tool"] == "T1"


def test_the_cutting_plane_costs_no_reach_where_no_other_tool_follows():
    # the holder meets the tall block over the upper floor; the lower floor far away is free to the same tool
    mesh = terraces([0, 6, 14, 40], [0, 20], [[30, 10, 4]])
    body = tool(4, 0, neck=60.0, stickout=12.0, holder=(HolderFrustum(16, 16, 40),))
    floors = {face_at(mesh, (10, 10, 10), (0, 0, 1)), face_at(mesh, (30, 10, 4), (0, 0, 1))}
    samples, fields, zones = zones_of(mesh, [body], faces=floors)
    low = samples.points[:, 2] < 5
    by_tool = np.zeros(len(samples), bool)
    for z in zones:
        by_tool[z.samples] = True
    assert low.any() and by_tool[low & (samples.points[:, 0] > 26)].all()
    assert not by_tool[~low & (samples.points[:, 0] < 10)].any()
    assert all(z.plane == -np.inf or z.bottom >= z.plane for z in zones)


def test_a_thinner_tool_still_comes_before_what_lies_below_the_plane():
    mesh = terraces([0, 6, 14, 40], [0, 20], [[30, 10, 4]])
    stout = tool(4, 0, "T1", stickout=12.0, holder=(HolderFrustum(16, 16, 40),))
    long = tool(3, 0, "T2", stickout=60.0)
    floors = {face_at(mesh, (10, 10, 10), (0, 0, 1)), face_at(mesh, (30, 10, 4), (0, 0, 1))}
    _, _, zones = zones_of(mesh, [stout, long], faces=floors)
    assert {z.tool.id for z in zones if z.bottom < 5} == {"T2"}


def test_a_small_region_gets_one_tool():
    # a square pocket of 5 mm: the 4 mm ball gets nearly all the 3 mm one gets of its walls
    mesh = terraces([0, 4, 10, 14], [0, 4, 10, 14], [[4, 4, 4], [4, 2.8, 4], [4, 4, 4]])
    walls_of_pocket = {face_at(mesh, p, n) for p, n in [((4, 7, 3.4), (1, 0, 0)), ((10, 7, 3.4), (-1, 0, 0)),
                                                        ((7, 4, 3.4), (0, 1, 0)), ((7, 10, 3.4), (0, -1, 0))]}
    _, _, zones = zones_of(mesh, [tool(2, 0, "T2"), tool(1.9, 0, "T1")], faces=walls_of_pocket)
    assert [z.tool.id for z in zones] == ["T2"]


def test_too_little_area_is_no_zone():
    mesh = terraces([0, 4, 4.5, 10], [0, 1, 2, 10], [[4, 4, 4], [4, 5, 4], [4, 4, 4]])
    top = {face_at(mesh, (4.2, 1.5, 5), (0, 0, 1))}
    _, _, zones = zones_of(mesh, [ball(3)], faces=top)
    assert zones == []


def test_tools_that_reach_nothing_make_no_zone():
    mesh = terraces([0, 5, 5.8, 11], [0, 10], [[8, 2, 8]])
    _, _, zones = zones_of(mesh, [ball(3)], faces={face_at(mesh, (5.4, 5, 2), (0, 0, 1))})
    assert zones == []


def test_open_and_closed_zones():
    mesh = dome()
    samples, fields, zones = zones_of(mesh, [ball(4)], faces={2})
    assert is_open(zones[0], fields["T1"], samples.area)
    pocket = terraces([0, 4, 16, 20], [0, 4, 16, 20], [[8, 8, 8], [8, 2, 8], [8, 8, 8]])
    samples, fields, zones = zones_of(pocket, [ball(4)], faces={face_at(pocket, (10, 10, 2), (0, 0, 1))})
    assert not is_open(zones[0], fields["T1"], samples.area)


def pocket(size: float):
    """A square pocket 6 deep with sharp corners in a block."""
    a, b = 10.0, 10.0 + size
    return terraces([0, a, b, b + a], [0, a, b, b + a], [[8, 8, 8], [8, 2, 8], [8, 8, 8]])


@pytest.mark.parametrize("size", [60.0, 300.0])
def test_the_corners_of_a_floor_are_no_less_worth_in_a_large_pocket(size):
    mesh = pocket(size)
    floor = {face_at(mesh, (10 + size / 2, 10 + size / 2, 2), (0, 0, 1))}
    samples, _, zones = zones_of(mesh, [tool(25.0, 0.0, "T1"), tool(8.0, 0.0, "T2")], faces=floor,
                                 density=min(20.0, 1e5 / size ** 2))
    assert [z.tool.id for z in zones] == ["T1", "T2"]
    left_by = [4 * (1 - np.pi / 4) * (d / 2) ** 2 for d in (25.0, 8.0)]  # in four square corners
    assert samples.area[zones[1].samples].sum() == pytest.approx(left_by[0] - left_by[1], rel=0.1)


def test_what_is_too_little_in_each_region_is_pooled():
    # four corners, each a region of its own: 0.6 mm² in each are too little for a zone, 2.4 mm² are worth a tool
    mesh = pocket(40.0)
    samples = samples_of(mesh, 60.0, {face_at(mesh, (30, 30, 2), (0, 0, 1))})
    tools = [tool(4.0, 0.0, "T1"), tool(2.0, 0.0, "T2")]
    fields = {t.id: field_of(mesh, t) for t in tools}
    side = (samples.points[:, :2] > 30).astype(int)
    quarter = side[:, 0] + 2 * side[:, 1]

    def held(rows):
        few, code = samples.subset(rows), quarter[rows].astype(np.int64)
        view = view_of(as_part(mesh), few, fields, labels=Labels(tuple(Region(f"W{k}") for k in range(4)), code))
        found = build_zones([view], NOTHING, 0.02, 0.002).zones
        return {z.region: float(few.area[z.samples].sum()) for z in found if z.tool.id == "T2"}

    apiece = (1 - np.pi / 4) * (2.0 ** 2 - 1.0 ** 2)
    assert apiece < LEAST_ZONE_MM2 < 4 * apiece
    assert held(np.flatnonzero(quarter == 0)) == {}
    got = held(np.arange(len(samples)))
    assert set(got) == {"W0", "W1", "W2", "W3"} and sum(got.values()) == pytest.approx(4 * apiece, rel=0.1)


@pytest.mark.parametrize(("apiece", "count", "worth"), [(0.04, 4, False), (0.04, 5, True), (0.25, 1, True)])
def test_a_part_for_a_tool_in_use_is_worth_a_zone_by_its_area(apiece, count, worth):
    rows = np.arange(count)
    sight = SimpleNamespace(samples=SimpleNamespace(area=np.full(count, apiece)),
                            groups=lambda _: [("floor", AreaForm.LEVEL, rows)])
    assert bool(_parts(sight, rows, set())) == worth


def test_no_tool_that_is_used_leaves_what_is_worth_a_zone():
    samples, fields, zones = zones_of(walls(), [ball(4, "T1"), tool(3, 0, "T2")], density=40.0)
    taken = np.zeros(len(samples), bool)
    taken[np.concatenate([z.samples for z in zones])] = True
    for t in {z.tool.id for z in zones}:
        gets = touchable(fields[t], samples.points, samples.normals, 0.002)[1] & able(fields[t].tool, samples.normals,
                                                                                    0.02)
        for form in AreaForm:
            rows = gets & ~taken & (forms_of(samples.normals) == form)
            assert samples.area[rows].sum() <= LEAST_PART_MM2
