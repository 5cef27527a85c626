"""What stays, why, and whether the tool that is asked for would really do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import joined as together
from geometry.tool_body import HolderFrustum
from tests.hand_parts import as_part, ball, box_mesh, field_of, joined, samples_of, terraces, tool, view_of
from zones.model import Connection, Decomposition
from zones.reach.tip_field import touchable
from zones.remainder.remainder import MAX_SAMPLES, _examined, explain
from zones.remainder.tool_catalogue import DIAMETERS, catalogue

NOTHING = Decomposition((), (), ())
LIFT = 0.002


def stays(mesh, tools, samples, decomposition=NOTHING, given_up=None):
    fields = {t.id: field_of(mesh, t) for t in tools}
    view = view_of(as_part(mesh), samples, fields)
    return explain(samples, view.labels, [view], decomposition, LIFT, given_up)


def out_of_reach(mesh, tools, samples):
    """The samples none of the tools touches."""
    got = np.zeros(len(samples), bool)
    for t in tools:
        got |= touchable(field_of(mesh, t), samples.points, samples.normals, LIFT)[1]
    return samples.subset(~got)


def bought(body, need):
    """The tool with the dimensions that were asked for."""
    d = float(need.get("diameter_mm", body.diameter))
    return replace(body, diameter=d, corner_radius=d / 2 if need["kind"] == "ball" else 0.0, neck_diameter=0.95 * d,
                   neck_length=float(need.get("neck_length_mm", body.neck_length)),
                   stickout=float(need.get("stickout_mm", max(body.stickout, need.get("neck_length_mm", 0.0)))))


def block(depth=10.0):
    return terraces([0, 10, 24], [0, 12], [[2 + depth, 2]])


def wall_of_block(mesh, density=6.0):
    s = samples_of(mesh, density)
    return s.subset((s.normals[:, 0] > 0.9) & (np.abs(s.points[:, 0] - 10) < 1e-9) & (s.area > 0))


def test_nothing_left_is_an_empty_list():
    mesh = block()
    assert stays(mesh, [ball(3)], samples_of(mesh, 1.0).subset(np.zeros(0, int))) == []


@pytest.mark.parametrize("body, reason", [
    (ball(3.0, neck=4.0, shank=6.0), "shank"),
    (ball(3.0, neck=60.0, stickout=5.0, holder=(HolderFrustum(12, 30, 10), HolderFrustum(30, 30, 20))), "holder"),
    (ball(3.0, neck=5.0, shank=5.0, stickout=6.0, holder=(HolderFrustum(20, 20, 20),)), "shank"),
    (tool(4.0, 0.0, neck=3.0, shank=8.0, stickout=9.0, holder=(HolderFrustum(20, 20, 20),)), "shank"),
])
def test_a_longer_tool_that_is_asked_for_reaches(body, reason):
    mesh = block()
    left = out_of_reach(mesh, [body], wall_of_block(mesh))
    found = stays(mesh, [body], left)
    assert sum(r.area for r in found) == pytest.approx(left.area.sum())
    assert {r.reason for r in found} & {reason}
    for r in found:
        if r.reason not in ("shank", "holder"):
            continue
        longer = bought(body, r.would_need)
        assert longer.stickout >= longer.neck_length or longer.neck_length == body.neck_length
        high = left.subset(left.points[:, 2] > 2 + body.radius + 0.1)
        reached = touchable(field_of(mesh, longer), high.points, high.normals, LIFT)[1]
        assert reached.mean() >= 0.98 - 1e-9


def test_a_floor_beside_a_wall_asks_for_length_at_the_tip_that_fits():
    # the axis cannot stand over these samples: the length counts from the place beside them where it can
    mesh = block()
    body = tool(4.0, 0.0, neck=4.0, shank=8.0)
    s = samples_of(mesh, 8.0)
    floor = s.subset((s.normals[:, 2] > 0.9) & (np.abs(s.points[:, 2] - 2) < 1e-9) & (s.points[:, 0] < 11.5)
                     & (s.area > 0))
    left = out_of_reach(mesh, [body], floor)
    found = stays(mesh, [body], left)
    assert [r.reason for r in found] == ["shank"]
    reached = touchable(field_of(mesh, bought(body, found[0].would_need)), left.points, left.normals, LIFT)[1]
    assert reached.mean() >= 0.98


def test_a_narrow_gap_asks_for_a_thinner_ball():
    mesh = terraces([0, 5, 6.2, 11], [0, 12], [[10, 2, 10]])
    s = samples_of(mesh, 8.0)
    inside = s.subset((s.points[:, 0] >= 5) & (s.points[:, 0] <= 6.2) & (s.points[:, 2] < 9.9)
                      & (np.abs(s.normals[:, 1]) < 0.5) & (s.area > 0))
    found = stays(mesh, [ball(3.0)], inside)
    gap = [r for r in found if r.reason == "gap"]
    assert gap and sum(r.area for r in found) == pytest.approx(inside.area.sum())
    for r in gap:
        assert r.would_need["diameter_mm"] < 1.2
        thin = field_of(mesh, bought(ball(3.0), r.would_need))
        reached = touchable(thin, inside.points, inside.normals, LIFT)[1]
        assert inside.area[reached].sum() >= 0.97 * r.area
    assert {r.would_need["kind"] for r in gap} == {"ball", "flat"}  # the foot of the wall needs a sharp corner


def test_an_inner_corner_is_for_a_smaller_radius_and_its_line_for_none():
    mesh = terraces([0, 4, 14], [0, 4, 14], [[8, 8], [8, 2]])
    s = samples_of(mesh, 40.0)
    upright = s.subset((np.abs(s.normals[:, 2]) < 0.1) & (s.points[:, 2] > 4) & (s.points[:, 0] >= 4)
                       & (s.points[:, 1] >= 4) & (s.points[:, 0] < 13.9) & (s.points[:, 1] < 13.9) & (s.area > 0))
    left = out_of_reach(mesh, [ball(4.0)], upright)
    found = stays(mesh, [ball(4.0)], left)
    assert {r.reason for r in found} <= {"corner", "gap", "sharp corner"} and found
    assert sum(r.area for r in found) == pytest.approx(left.area.sum())
    assert all(r.would_need == {} for r in found if r.reason == "sharp corner")


def test_what_hangs_over_is_undercut_and_names_the_connection():
    plate = terraces([0, 20], [0, 12], [[2]])
    bar = box_mesh([8, -1, 6], [12, 13, 8])
    bar = type(bar)(bar.vertices, bar.faces, np.full(len(bar.faces), 9, np.int32))
    mesh = joined(plate, bar)
    s = samples_of(mesh, 5.0, {2})
    below = s.subset((s.normals[:, 2] > 0.9) & (s.points[:, 0] > 8.1) & (s.points[:, 0] < 11.9) & (s.area > 0))
    named = Decomposition((), (Connection("C1", (9,), ("W1", "W2"), 6, 8),), ())
    assert [r.reason for r in stays(mesh, [ball(3.0)], below)] == ["undercut"]
    found = stays(mesh, [ball(3.0)], below, named)
    assert [r.reason for r in found] == ["undercut behind connection C1"]
    assert found[0].would_need == {"kind": "other access"} and found[0].area == pytest.approx(below.area.sum())


def test_what_a_tool_at_hand_touches_asks_for_no_other_tool():
    mesh = block()
    s = wall_of_block(mesh)
    high = s.subset(s.points[:, 2] > 6)
    found = stays(mesh, [ball(3.0), tool(2.0, 0.0, "T2", neck=1.0, shank=9.0)], high)
    assert [(r.reason, r.would_need) for r in found] == [("pass", {})]


def test_given_up_is_not_blamed_on_a_corner():
    mesh = terraces([0, 4, 14], [0, 4, 14], [[8, 8], [8, 2]])
    s = samples_of(mesh, 40.0)
    near = s.subset((np.abs(s.normals[:, 0] - 1) < 0.1) & (s.points[:, 0] < 4.1) & (s.points[:, 1] > 4)
                    & (s.points[:, 1] < 4.3) & (s.points[:, 2] > 5) & (s.area > 0))
    assert {r.reason for r in stays(mesh, [ball(4.0)], near)} <= {"corner", "gap", "sharp corner"}
    found = stays(mesh, [ball(4.0)], near, given_up=np.ones(len(near), bool))
    assert [(r.reason, r.would_need) for r in found] == [("pass", {})]


def test_many_samples_are_asked_by_a_share_and_areas_still_sum():
    mesh = block()
    s = wall_of_block(mesh, 80.0)
    assert len(s) > 6000
    found = stays(mesh, [ball(3.0, neck=1.0, shank=9.0)], s)
    assert sum(r.area for r in found) == pytest.approx(s.area.sum())
    assert found == sorted(found, key=lambda r: -r.area)


@pytest.mark.parametrize("wide", [0, 40, 900, 5000])
def test_no_sample_that_stands_for_much_is_left_to_chance(wide):
    """Samples of 0.01 mm² with squares of 0.25 among them: at random some squares more or less changed a face of the
    demo part from 78 to 70 mm²."""
    area = np.full(40_000, 0.01)
    area[np.random.default_rng(wide).choice(20_000, wide, replace=False)] = 0.25  # in the first half
    rows, stands_for = _examined(area)
    assert len(rows) == len(np.unique(rows)) == len(stands_for) == MAX_SAMPLES
    assert stands_for.sum() == pytest.approx(area.sum())
    first = rows < 20_000
    few_are_wide = wide <= MAX_SAMPLES // 2
    assert stands_for[first].sum() == pytest.approx(area[:20_000].sum(), rel=0.03 if few_are_wide else 0.1)
    if 0 < wide and few_are_wide:
        assert (area[rows] == 0.25).sum() == wide and (stands_for[area[rows] == 0.25] == 0.25).all()


def clamped_channel():
    """A channel 6 wide and 8 deep, and a clamp over one end of it 2 above the floor."""
    mesh = terraces([0, 6, 12, 18], [0, 24], [[10, 2, 10]])
    clamp = box_mesh([7, -1, 4], [11, 8, 14])
    s = samples_of(mesh, 6.0)
    floor = s.subset((s.normals[:, 2] > 0.9) & (np.abs(s.points[:, 2] - 2) < 1e-9) & (s.points[:, 0] > 6.1)
                     & (s.points[:, 0] < 11.9) & (s.points[:, 1] < 14.0) & (s.area > 0))
    return mesh, joined(mesh, clamp), floor


def held_by(mesh, held, tools, samples):
    tree = TriangleTree(held)
    fields = {t.id: field_of(tree, t) for t in tools}
    view = view_of(as_part(mesh), samples, fields, obstacles=tree)
    return explain(samples, view.labels, [view], NOTHING, LIFT), fields


def test_what_a_fixture_alone_keeps_a_tool_from_is_said_of_the_fixture():
    mesh, held, floor = clamped_channel()
    body = tool(4.0, 0.0)
    found, fields = held_by(mesh, held, [body], floor)
    assert {r.reason for r in found} == {"fixture", "pass"}
    bare = {r.reason: r for r in stays(mesh, [body], floor)}
    assert set(bare) == {"pass"}
    got = touchable(fields["T1"], floor.points, floor.normals, LIFT)[1]
    by_fixture = [r for r in found if r.reason == "fixture"]
    assert sum(r.area for r in by_fixture) == pytest.approx(float(floor.area[~got].sum()))
    assert all(r.would_need == {"kind": "other clamping"} for r in by_fixture)
    assert {r.tool_at_hand for r in by_fixture} == {"", "T1"}  # under the clamp, and beside it


def test_a_tool_that_is_asked_for_clears_part_and_fixtures():
    mesh, held, floor = clamped_channel()
    short = tool(4.0, 0.0, neck=3.0, shank=5.5)  # too short for the channel with or without the clamp
    found, _ = held_by(mesh, held, [short], floor)
    asked = [r for r in found if "diameter_mm" in r.would_need]
    assert asked and {r.reason for r in asked} <= {"shank", "gap", "corner"}
    for r in asked:
        n = r.would_need
        body = replace(short, diameter=n["diameter_mm"], corner_radius=n["corner_radius_mm"],
                       neck_diameter=0.95 * n["diameter_mm"], neck_length=n["neck_length_mm"],
                       shank_diameter=n["shank_diameter_mm"], stickout=n["stickout_mm"])
        got = touchable(field_of(TriangleTree(held), body), r.samples.points, r.samples.normals, LIFT)[1]
        assert r.samples.area[got].sum() >= (n["share"] - 0.02) * r.area


def test_tools_asked_for_are_sold_and_do_what_they_are_named_for():
    # a square pocket and a deep slot: corners of every thickness, necks beyond what is sold
    mesh = terraces([0, 4, 16, 20, 20.5, 26], [0, 4, 16, 20], [[14] * 5, [14, 8, 14, 2, 14], [14] * 5])
    s = samples_of(mesh, 30.0)
    inside = s.subset((s.points[:, 0] > 3.9) & (s.points[:, 0] < 20.6) & (s.points[:, 1] > 3.9)
                      & (s.points[:, 1] < 16.1) & (s.points[:, 2] < 13.9)
                      & (np.abs(s.normals).max(axis=1) > 0.99) & (s.area > 0))
    body = ball(3.175, neck=20.0, shank=6.0)
    left = out_of_reach(mesh, [body], inside)
    found = stays(mesh, [body], left)
    named = [r for r in found if "diameter_mm" in r.would_need]
    assert len(named) > 2 and sum(r.area for r in found) == pytest.approx(float(left.area.sum()))
    for r in named:
        n = r.would_need
        assert n["diameter_mm"] in (*DIAMETERS, 3.175) and n["share"] >= 0.5
        assert n["neck_length_mm"] <= 20 * n["diameter_mm"] and n["stickout_mm"] >= n["neck_length_mm"] + 5.9
        assert n["neck_length_mm"] == float(catalogue(np.array([n["neck_length_mm"]]))[0])
        bought_tool = replace(body, diameter=n["diameter_mm"], corner_radius=n["corner_radius_mm"],
                              neck_diameter=0.95 * n["diameter_mm"], neck_length=n["neck_length_mm"],
                              shank_diameter=n["shank_diameter_mm"], stickout=n["stickout_mm"])
        got = touchable(field_of(mesh, bought_tool), r.samples.points, r.samples.normals, LIFT)[1]
        assert r.samples.area[got].sum() >= 0.5 * r.area
    assert any(r.would_need.get("kind") == "other process" and r.would_need["slenderness"] > 20 for r in found)


def slots(length):
    """Deep slots for cutters of 1.0, 0.5 and 0.2 that need necks of 18, 9 and 4 mm, and samples low on their walls.

    The slot of the 0.5 is ``length`` + 1 long, the others 12, open at both ends.
    """
    xs, top = [0, 5, 6.1, 11, 11.58, 16, 16.3, 21], 20.0
    floors = [top, 2.4, top, 11.4, top, 16.6, top]
    short = [top if k == 3 else h for k, h in enumerate(floors)]
    mesh = terraces(xs, [0, 11 - length, 12], [short, floors])
    s = samples_of(mesh, 40.0)
    by_slot = []
    for k in (1, 3, 5):
        inside = (s.points[:, 0] > xs[k] - 1e-6) & (s.points[:, 0] < xs[k + 1] + 1e-6)
        up = s.points[:, 2] - floors[k] - 0.55 * (xs[k + 1] - xs[k])
        low = (up > 0) & (up < 0.3) & (s.points[:, 1] > (12 - length if k == 3 else 0.0))
        by_slot.append(s.subset(inside & low & (np.abs(s.normals[:, 0]) > 0.9) & (s.area > 0)))
    return mesh, by_slot


@pytest.mark.parametrize("length", [0.5, 6.0])
def test_a_thinner_cutter_is_not_named_where_only_a_stouter_one_is_sold_on_the_neck(length):
    """0.5 fits wherever 1.0 does, and with its own slot that is more than half, but it is not sold on a neck of 18."""
    mesh, by_slot = slots(length)
    left = together(by_slot)
    parts = np.array([p.area.sum() for p in by_slot]) / left.area.sum()
    assert parts[0] < 0.5 < parts[0] + parts[1]
    body = ball(3.175, neck=10.0, shank=6.0)
    found = stays(mesh, [body], left)
    assert {r.reason for r in found} == {"gap"} and sum(r.area for r in found) == pytest.approx(float(left.area.sum()))
    named = {r.would_need["diameter_mm"]: r for r in found}  # no 'other process': each is sold
    assert len(named) == len(found) and set(named) == ({1.0, 0.2} if length < 1.0 else {1.0, 0.5, 0.2})
    for d, r in named.items():
        n = r.would_need
        assert n["kind"] == "ball" and n["neck_length_mm"] <= 20 * d and n["share"] >= 0.9
        bought_tool = replace(bought(body, n), stickout=n["stickout_mm"], shank_diameter=n["shank_diameter_mm"])
        got = touchable(field_of(mesh, bought_tool), r.samples.points, r.samples.normals, LIFT)[1]
        assert r.samples.area[got].sum() >= 0.9 * r.area


def test_few_samples_with_most_of_the_area_decide_how_long_the_neck_is():
    mesh = block(16.0)
    body = ball(3.0, neck=2.0, shank=6.0)
    s = wall_of_block(mesh, 12.0)
    deep = np.flatnonzero((s.points[:, 2] > 4.0) & (s.points[:, 2] < 5.0))[:2]
    rows = np.concatenate([deep, np.flatnonzero((s.points[:, 2] > 8.0) & (s.points[:, 2] < 13.0))])
    area = s.area[rows]
    area[:2] = area.sum()
    s = replace(s.subset(rows), area=area)
    left = out_of_reach(mesh, [body], s)
    assert len(left) > 200
    (r,) = stays(mesh, [body], left)
    assert r.reason == "shank" and r.would_need["share"] == 1.0
    got = touchable(field_of(mesh, bought(body, r.would_need)), left.points, left.normals, LIFT)[1]
    assert got.all()


def test_what_is_left_to_a_tool_at_hand_names_it_and_says_why():
    mesh = block()
    s = wall_of_block(mesh)
    high = s.subset(s.points[:, 2] > 6)
    tools = [ball(3.0, "T2"), ball(2.0, "T1")]
    assert [(r.tool_at_hand, r.why_left) for r in stays(mesh, tools, high)] == [("T2", "less than a zone is made of")]
    (given,) = stays(mesh, tools, high, given_up=np.ones(len(high), bool))
    assert (given.reason, given.tool_at_hand, given.why_left) == ("pass", "T2", "no pass gets there")
