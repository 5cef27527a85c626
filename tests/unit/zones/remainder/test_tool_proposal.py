"""The proposed tools do what is said of them, they are the fewest, and what stays stays for a reason."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.tool_body import HolderFrustum
from tests.hand_parts import as_part, ball, box_mesh, field_of, joined, samples_of, terraces, tool, view_of
from zones.reach.access_reach import able
from zones.reach.assembly import Clearances
from zones.reach.tip_field import touchable
from zones.remainder import tool_proposal
from zones.remainder.tool_catalogue import DIAMETERS, MAX_SLENDERNESS, catalogue, sold
from zones.remainder.tool_proposal import _Candidate, _named, propose
from zones.remainder.tool_requirements import CuttingPart, ToolRequirement
from zones.zoning.zones import LEAST_ZONE_MM2

LIFT = 0.002
HOLDER = (HolderFrustum(10, 16, 8), HolderFrustum(16, 16, 20))


def test_a_tapered_mill_keeps_its_taper_and_cutters_of_the_series_have_none():
    body = replace(tool(2.0, 1.0), taper=0.1)
    assert sold(body, 3.0, 1.5).kind == "ball" and sold(body, 3.0, 1.5).taper == 0.0
    at_hand = _named(_Candidate(CuttingPart(2.0, 1.0, body.id, True), body, np.zeros(1, np.int64), np.zeros((1, 2))),
                     np.array([[14.0, 30.0]]))
    assert (at_hand.kind, at_hand.taper_angle_deg) == ("tapered_ball", round(body.taper_deg, 6))
    bought = at_hand.body("P9", 9, HOLDER)
    assert bought.kind == "tapered_ball" and bought.taper == pytest.approx(0.1) and bought.neck_length == 14.0


def takes(mesh, body, samples, margin=4.0):
    field = field_of(mesh, body, margin=margin)
    return touchable(field, samples.points, samples.normals, LIFT)[1] & able(body, samples.normals, field.cusp)


def remainder(mesh, tools, density=8.0):
    s = samples_of(mesh, density)
    s = s.subset((s.normals[:, 2] > -0.02) & (s.area > 0) & (s.points[:, 2] > mesh.bounds[0, 2] + 0.1))
    left = np.ones(len(s), bool)
    for t in tools:
        left &= ~takes(mesh, t, s)
    return s.subset(left)


def buyer_of(mesh, tools, samples):
    tree = TriangleTree(mesh)
    fields = {t.id: field_of(tree, t) for t in tools}
    return ToolRequirement(view_of(as_part(mesh), samples, fields), LIFT, Clearances())


def asked(mesh, tools, samples):
    return propose(samples, buyer_of(mesh, tools, samples))


def areas(found, samples):
    """Area by what is said of the samples, mm²."""
    area = samples.area[found.rows]
    area = area * (samples.area.sum() / area.sum())
    return {str(w): float(area[found.why == w].sum()) for w in set(found.why.tolist())}


def grown(tools, found):
    """The proposed tools as they would be bought, in the holders they were measured with."""
    holders = {t.id: t.holder for t in tools}
    return [t.body(f"N{k}", 50 + k, holders[t.holder_of]) for k, t in enumerate(found.tools)]


def channel():
    """Walls 9 high and 1.8 apart on a plate, closed at one end: a deep narrow channel with two corners."""
    return terraces([0, 6, 9, 10.8, 13.8, 20], [0, 3, 5, 15, 18],
                    [[2] * 5, [2, 11, 11, 11, 2], [2, 11, 2, 11, 2], [2] * 5])


AT_HAND = [ball(4.0, "T1", neck=14.0, shank=6.0, stickout=30.0, holder=HOLDER),
           tool(4.0, 0.0, "T2", neck=14.0, shank=6.0, stickout=30.0, holder=HOLDER)]


def test_what_is_proposed_takes_what_is_claimed_wherever_the_grid_lies():
    mesh = channel()
    left = remainder(mesh, AT_HAND)
    found = asked(mesh, AT_HAND, left)
    got = areas(found, left)
    assert found.tools and got["taken"] > 0.9 * float(left.area.sum())
    taken = left.subset(found.rows[found.why == "taken"])
    for margin in (4.0, 4.13, 4.27):
        by_tool = np.array([takes(mesh, body, taken, margin) for body in grown(AT_HAND, found)])
        assert by_tool.any(axis=0).all()
        scale = got["taken"] / float(taken.area.sum())
        for k in range(len(by_tool)):  # each is worth its price: it alone takes a least zone
            alone = by_tool[k] & ~np.delete(by_tool, k, axis=0).any(axis=0)
            assert scale * float(taken.area[alone].sum()) >= LEAST_ZONE_MM2
    for t in found.tools:
        assert t.neck_length_mm <= MAX_SLENDERNESS * t.diameter_mm + 1e-9
        assert t.stickout_mm >= t.neck_length_mm + t.shank_diameter_mm - 1e-9
        assert t.flute_length_mm <= t.neck_length_mm


def test_no_shorter_neck_would_do():
    mesh = channel()
    left = remainder(mesh, AT_HAND)
    found = asked(mesh, AT_HAND, left)
    taken = left.subset(found.rows[found.why == "taken"])
    bodies = grown(AT_HAND, found)
    got = np.array([takes(mesh, body, taken) for body in bodies])
    for k, body in enumerate(bodies):
        shorter = replace(body, neck_length=body.neck_length - 2.0)
        assert not (np.delete(got, k, axis=0).any(axis=0) | takes(mesh, shorter, taken)).all()


def test_a_longer_neck_of_a_cutter_at_hand_is_named_as_such():
    """In a channel 3.5 wide the ball of 3 at hand is the stoutest of the series that fits, only too short."""
    mesh = terraces([0, 10, 13.5, 24], [0, 40], [[16, 2, 16]])
    short = ball(3.0, "T1", neck=6.0, shank=6.0, stickout=40.0, holder=HOLDER)
    s = samples_of(mesh, 4.0)
    left = s.subset((np.abs(s.points[:, 0] - 11.75) < 1.76) & (s.points[:, 2] > 4.0) & (s.points[:, 2] < 15.9)
                    & (np.abs(s.normals[:, 0]) > 0.9) & (s.area > 0))
    left = left.subset(~takes(mesh, short, left))
    found = asked(mesh, [short], left)
    (t,) = found.tools
    assert t.instead_of == "T1" and t.diameter_mm == 3.0 and t.neck_length_mm > 6.0 and t.stickout_mm >= 40.0
    assert set(found.why) == {"taken"}


def test_a_ball_to_buy_has_flutes_up_the_whole_of_its_corner():
    """Over open ground no neck is needed; a ball of 40 with flutes of 4 mm is no tool."""
    mesh = terraces([0, 60], [0, 60], [[2]])
    short = ball(3.0, "T1", neck=5.0, shank=8.0, stickout=40.0)
    requirement = buyer_of(mesh, [short], samples_of(mesh, 0.1))
    need = requirement.need(CuttingPart(40.0, 20.0, "T1", False), np.array([[30.0, 30.0, 2.0]]))
    assert need[0, 0] == 20.0 and need[0, 1] >= 20.0


def test_beside_a_high_wall_one_stout_tool_does():
    mesh = terraces([0, 12, 40], [-20, 34], [[14, 2]])
    short = ball(3.0, "T1", neck=5.0, shank=8.0, stickout=40.0)
    s = samples_of(mesh, 3.0)
    wall = s.subset((s.normals[:, 0] > 0.9) & (np.abs(s.points[:, 0] - 12) < 1e-9) & (s.area > 0)
                    & (s.points[:, 2] > 4.0))
    left = wall.subset(~takes(mesh, short, wall))
    found = asked(mesh, [short], left)
    assert len(found.tools) == 1 and set(found.why) == {"taken"}


def test_under_a_roof_and_in_a_slot_too_narrow_nothing_is_proposed():
    roof = joined(terraces([0, 20], [0, 20], [[2]]), box_mesh([5, 5, 6], [15, 15, 8]))
    s = samples_of(roof, 2.0, {2})
    under = s.subset((np.abs(s.points[:, :2] - 10) < 4.5).all(axis=1) & (s.points[:, 2] < 2.001))
    found = asked(roof, AT_HAND, under)
    assert found.tools == () and set(found.why) == {"undercut"}
    slot = terraces([0, 8, 8.3, 16], [0, 12], [[14, 2, 14]])
    s = samples_of(slot, 8.0)
    deep = s.subset((s.points[:, 0] > 7.9) & (s.points[:, 0] < 8.4) & (s.points[:, 2] < 5.0) & (s.area > 0)
                    & (s.points[:, 1] > 1.0) & (s.points[:, 1] < 11.0) & (s.points[:, 2] > 2.5))
    found = asked(slot, AT_HAND, deep)
    assert found.tools == () and set(found.why) == {"slender"}
    requirement, thin = buyer_of(slot, AT_HAND, deep), CuttingPart(0.2, 0.1, "T1", False)
    rows, tips = requirement.touches(thin, deep)
    assert len(rows) == len(deep) and (requirement.need(thin, tips)[:, 0] > MAX_SLENDERNESS * 0.2).all()


def test_what_a_tool_at_hand_touches_needs_none_and_a_little_is_not_worth_one():
    mesh = channel()
    s = samples_of(mesh, 4.0)
    top = s.subset((s.normals[:, 2] > 0.99) & (s.points[:, 2] > 10.9) & (s.area > 0))
    found = asked(mesh, AT_HAND, top)
    assert found.tools == () and set(found.why) == {"pass"}
    left = remainder(mesh, AT_HAND)
    found = asked(mesh, AT_HAND, left)
    few = found.rows[found.why == "taken"][:4]
    assert float(left.area[few].sum()) < LEAST_ZONE_MM2
    found = asked(mesh, AT_HAND, left.subset(few))
    assert found.tools == () and set(found.why) == {"too little"}
    assert asked(mesh, AT_HAND, left.subset(np.zeros(0, int))).tools == ()


def test_lengths_of_the_catalogue():
    np.testing.assert_array_equal(catalogue(np.array([0.2, 3.0, 3.01, 20.0, 20.1, 25.0, 26.0])),
                                  [1, 3, 4, 20, 25, 25, 30])


@pytest.mark.parametrize("seed", range(8))
def test_the_cover_is_the_best_of_all_subsets(seed):
    """Against every subset of ten tools: number of tools and area left, a tool worth a least zone."""
    rng = np.random.default_rng(seed)
    area = rng.uniform(0.5, 2.0) * rng.uniform(0.0, 1.0, 30)
    candidates = []
    for _ in range(10):
        body = ball(float(rng.choice([1.0, 2.0, 4.0])), neck=float(rng.integers(2, 20)))
        rows = np.flatnonzero(rng.random(30) < 0.35)
        cutter = CuttingPart(body.diameter, body.corner_radius, "T1", bool(rng.random() < 0.3))
        candidates.append(tool_proposal._Candidate(cutter, body, rows, np.zeros((len(rows), 2))))

    def cost(chosen):
        got = np.zeros(30, bool)
        for c in chosen:
            got[c.rows] = True
        ties = sum(tool_proposal.PER_SLENDER * c.slenderness / MAX_SLENDERNESS
                   + tool_proposal.PER_NEW * (not c.cutter.at_hand)
                   - tool_proposal.PER_STOUT * c.body.diameter / max(DIAMETERS) for c in chosen)
        return len(chosen) + ties + float(area[~got & reachable].sum()) / LEAST_ZONE_MM2

    reachable = np.zeros(30, bool)
    for c in candidates:
        reachable[c.rows] = True
    best = min(cost(s) for k in range(11) for s in combinations(candidates, k))
    assert cost(tool_proposal._fewest(candidates, area)) == pytest.approx(best, abs=2e-6)
