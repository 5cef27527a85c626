"""Plans of small parts: steps, names, order, data on them, what the switches do, and the depth of the layers."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tests.hand_parts import Case, ball, corner, dome, low_walls, plan_part, slope_field, terraces, tool
from tests.plan_checks import SlowStock, brute_residual, dense, worst_meeting
from toolpath.lines import Line
from toolpath.passes.pass_family import FinishTarget
from toolpath.plan_settings import CutData, Pattern, PlanSettings
from toolpath.planning.job_plan import AGAIN_SHARE, plan_job
from toolpath.planning.tool_layers import ISLAND, LOOSE_SHARE
from toolpath.planning.zone_finishing import Finish
from toolpath.planning.zone_layout import ZoneLayout
from toolpath.stock.cut_history import OVERLAP, Depths, Walked
from toolpath.stock.stock_map import StockMap
from toolpath.strategies.depth_layers import EVEN
from toolpath.tool_deflection import left_by_layers
from toolpath.workingsteps import CutDirection, TrajectoryKind
from zones.machinable_area import AreaForm

STEP_DOWN = 0.3  # tool diameters, as ``plan_part`` has it
CUT = {"T1": CutData(11_000, 810, 210, 3100, 0.9), "T2": CutData(12_000, 820, 220, 3200, 1.2)}


def valley():
    return slope_field(lambda x, y: 0.08 * x * x - 0.03 * y * y)


CASES = {
    "corner": lambda: plan_part(corner(), [ball(3.0), tool(4.0, 0.0, "T2")]),
    "corner by bull": lambda: plan_part(corner(), [tool(4.0, 0.5)], near_net=False),
    "walls": lambda: plan_part(low_walls(), [ball(2.5), ball(1.5, "T2")]),
    "dome": lambda: plan_part(dome(size=8.0), [ball(4.0)], near_net=False),
    "valley": lambda: plan_part(valley(), [tool(4.0, 1.0)], near_net=False),
    "ramp of 3 %": lambda: plan_part(slope_field(lambda x, y: 0.03 * x), [ball(4.0)], near_net=False),
    "ramp of 10 %": lambda: plan_part(slope_field(lambda x, y: 0.1 * x), [ball(4.0)], near_net=False),
}


@cache
def case(name: str) -> Case:
    return CASES[name]()


def replanned(c: Case, stock: StockMap | None = None, checks=None, cut=None, progress=None, **changes) -> Case:
    """The same part and zones planned again with other settings, stock or data."""
    before = stock or c.stock_before
    work = StockMap(before.lattice, before.top.copy(), before.cover.copy(), before.part)
    settings: PlanSettings = replace(c.settings, **changes)
    cut = cut or {t: CutData(10_000, 800, 200, 3000, STEP_DOWN * f.tool.diameter) for t, f in c.fields.items()}
    checks = checks or [FinishTarget(c.samples.points[z.samples], c.samples.normals[z.samples], z.tips, 0.2)
                        for z in c.zones]
    plan = plan_job(c.zones, checks, c.fields, cut, work, settings, progress)
    return replace(c, settings=settings, stock_before=before, plan=plan)


def bytes_of(c: Case) -> list[bytes]:
    return [p.tobytes() for _, p in c.moves(*TrajectoryKind)]


@pytest.mark.slow
def test_a_later_round_walks_only_what_no_earlier_one_has():
    """Rounds ask for the first six tenths of a line, for its first four, and for all of it."""
    c = case("walls")
    zone = next(z for z in c.zones if z.form is AreaForm.STEEP)
    check = FinishTarget(c.samples.points[zone.samples], c.samples.normals[zone.samples], zone.tips, 0.2)
    cut = CutData(10_000, 800, 200, 3000, 0.75)
    stock = StockMap(c.stock_before.lattice, c.stock_before.top.copy())
    finish = Finish(ZoneLayout(zone, check, c.fields[zone.tool.id], cut, c.settings), stock, c.settings)
    line = max((q for lines in finish.strategy.rounds(0, np.arange(len(zone.tips))) for q in lines),
               key=lambda q: len(q.points))
    points = line.points[:-1] if line.closed else line.points
    cuts = [int(share * len(points)) for share in (0.6, 0.4, 1.0)]

    def rounds(k, _failing):
        return [[Line(points[:cuts[k]], False)]] if k < 3 else []

    finish.strategy = replace(finish.strategy, rounds=rounds)
    finish._needed = finish._groups  # whole lines, also where no sample needs them
    (step,) = finish.walk("S01")
    level = [t.points[np.abs(t.points[:, 2] - points[0, 2]) < 1e-9] for t in step.trajectories
             if t.motion is TrajectoryKind.CUT]
    level = [p for p in level if len(p) > 1]
    assert len(level) == 2  # nothing at all in the second round
    second = level[1]
    begin = int(np.linalg.norm(points - second[0], axis=1).argmin())
    assert cuts[0] - OVERLAP - 2 <= begin <= cuts[0]  # the third goes on from where the first ended
    assert np.linalg.norm(second[-1] - points[-1]) < 1e-6


def test_what_layers_have_finished_gets_no_pass_and_says_so():
    """What a finish has cut is measured as if layers had: once nothing is left, not even another way is tried."""
    c = case("walls")
    zone = next(z for z in c.zones if z.form is AreaForm.STEEP)
    check = FinishTarget(c.samples.points[zone.samples], c.samples.normals[zone.samples], zone.tips, 0.2)
    cut = CutData(10_000, 800, 200, 3000, 0.75)

    def fresh():
        stock = StockMap(c.stock_before.lattice, c.stock_before.top.copy())
        return Finish(ZoneLayout(zone, check, c.fields[zone.tool.id], cut, c.settings), stock, c.settings)

    first = fresh()
    (step,) = first.walk("S05")
    assert not len(first.plan().left) and first.plan().step == "S05"
    part = replace(step, id="S02", strategy="depth_layers",
                   trajectories=step.trajectories[:len(step.trajectories) // 2])
    half, whole = fresh(), fresh()
    half.measure(part)
    assert half.walk("S06") and half.plan().strategy == "waterline" and half.plan().step == "S06"
    whole.measure(replace(part, trajectories=step.trajectories))
    whole.layout = None  # not even asked
    assert whole.walk("S06") == []
    made = whole.plan()
    assert (made.step, made.strategy, made.passes, len(made.left)) == ("S02", "depth_layers", 0, 0)


def test_zones_of_a_tool_do_not_walk_the_same_line_twice():
    """The second of two zones asks for the line of the first and for one more; both count for it as walked."""
    c = case("walls")
    zone = next(z for z in c.zones if z.form is AreaForm.STEEP)
    check = FinishTarget(c.samples.points[zone.samples], c.samples.normals[zone.samples], zone.tips, 0.2)
    cut = CutData(10_000, 800, 200, 3000, 0.75)
    stock = StockMap(c.stock_before.lattice, c.stock_before.top.copy())
    walked, depths = Walked(), Depths(stock.lattice)
    made, left = [], []
    for count in (1, 2):
        layout = ZoneLayout(zone, check, c.fields[zone.tool.id], cut, c.settings)
        finish = Finish(layout, stock, c.settings, walked, depths)
        lines = [q for group in finish.strategy.rounds(0, np.arange(len(zone.tips))) for q in group][:count]

        def rounds(k, _failing, lines=lines):
            return [lines] if k == 0 else []

        finish.strategy = replace(finish.strategy, rounds=rounds)
        made.append([t.points for s in finish.walk("S01") for t in s.trajectories if t.motion is TrajectoryKind.CUT])
        left.append(finish.residual.residual.copy())
    ends = [{p.round(6).tobytes() for t in cuts for p in t} for cuts in made]
    assert made[0] and made[1] and len(ends[0] & ends[1]) <= OVERLAP + 1
    assert (left[1] <= left[0] + 0.005).all() and (left[1] < left[0] - 0.005).any()


# -- steps --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CASES)
def test_steps_are_numbered_and_named_after_zone_strategy_tool_and_faces(name):
    c = case(name)
    assert [s.id for s in c.plan.steps] == [f"S{k:02d}" for k in range(1, len(c.plan.steps) + 1)]
    zones = {z.id: z for z in c.zones}
    for s in c.plan.steps:
        words = s.name.split()
        if s.operation == "roughing":
            mine = [z for z in c.zones if z.tool.id == s.tool.id]
            assert words == [s.id, "depth_layers", s.tool.id, *(z.id for z in mine)] and s.zone is None
            assert set(s.faces) == {f for z in mine for f in z.faces}
        else:
            z = zones[s.zone]
            assert words == [s.id, z.id, s.strategy, s.tool.id, *(f"F{f}" for f in z.faces[:12])]
            assert s.operation == "finishing" and s.faces == tuple(sorted(z.faces)) and s.tool is z.tool
            assert (s.top, s.bottom) == (z.top, z.bottom)


@pytest.mark.slow
def test_a_name_holds_a_dozen_faces_and_the_step_all_of_them():
    xs, heights = np.arange(0.0, 26.0), np.where(np.arange(25) % 2, 4.0, 2.0)
    c = plan_part(terraces(xs, [0, 4], [heights]), [ball(0.9)], roughing=False, density=6.0, scallop=0.05)
    many = [s for s in c.plan.steps if len(s.faces) > 12]
    assert many and all(sum(w.startswith("F") for w in s.name.split()) == 12 for s in many)


@pytest.mark.parametrize("name", CASES)
def test_tools_come_in_the_order_of_the_zones_and_layers_before_the_finish(name):
    c = case(name)
    order = list(dict.fromkeys(z.tool.id for z in c.zones))
    used = [s.tool.id for s in c.plan.steps]
    assert list(dict.fromkeys(used)) == order
    changes = 1 + sum(a != b for a, b in zip(used[:-1], used[1:], strict=True))
    assert changes == len(order)  # no tool comes back
    for tid in order:
        mine = [s for s in c.plan.steps if s.tool.id == tid]
        assert [s.operation for s in mine][1:] == ["finishing"] * (len(mine) - 1)
        layers = {s.id for s in mine if s.operation == "roughing"}  # which leave some zones nothing to finish
        assert [s.zone for s in mine if s.zone] == [p.zone.id for p in c.plan.zones
                                                    if p.zone.tool.id == tid and p.step not in layers]
    assert c.plan.steps[0].operation == "roughing"


@pytest.mark.parametrize("name", CASES)
def test_what_became_of_a_zone_agrees_with_its_step(name):
    c = case(name)
    steps = {s.id: s for s in c.plan.steps}
    assert [p.zone.id for p in c.plan.zones] == [z.id for z in c.zones]
    for p in c.plan.zones:
        s = steps[p.step]
        layers = s.operation == "roughing"  # which left nothing to finish
        assert (s.zone, s.strategy, s.side_step) == (None if layers else p.zone.id, p.strategy, p.side_step)
        if layers:
            assert set(p.zone.faces) <= set(s.faces) and not len(p.left) and not p.passes
            continue
        own = [t for s in c.plan.steps if s.zone == p.zone.id for t in s.trajectories]
        cuts = [t.motion is TrajectoryKind.CUT for t in own]  # a way down at a feed of its own is part of its pass
        assert p.passes == sum(b and not a for a, b in zip([False, *cuts], cuts, strict=False)) > 0
        flat = p.zone.tool.radius - p.zone.tool.corner_radius
        dragged = {"zigzag", "spiral"}
        want = {AreaForm.STEEP: {"waterline"}, AreaForm.LEVEL: {"planar_floor"} if flat > 0 else dragged,
                AreaForm.SHALLOW: dragged}
        assert p.strategy in want[p.zone.form]


@pytest.mark.parametrize("name", CASES)
def test_the_outline_is_closed_and_holds_every_tip_of_the_step(name):
    c = case(name)
    for s in c.plan.steps:
        mine = [z for z in c.zones if z.id == s.zone or (s.zone is None and z.tool.id == s.tool.id)]
        tips = np.vstack([z.tips for z in mine])[:, :2]
        lo, hi = s.outline.min(axis=0), s.outline.max(axis=0)
        assert (s.outline[0] == s.outline[-1]).all() and len(s.outline) == 5
        np.testing.assert_array_equal([lo, hi], [tips.min(axis=0), tips.max(axis=0)])
        assert s.top == max(z.top for z in mine) and s.bottom == min(z.bottom for z in mine)


def test_every_step_carries_the_data_of_its_own_tool():
    c = replanned(case("corner"), cut=CUT)
    assert {s.tool.id for s in c.plan.steps} == {"T1", "T2"}
    for s in c.plan.steps:
        cut = CUT[s.tool.id]
        assert (s.spindle_rpm, s.feed) == (cut.spindle_rpm, cut.feed)
        assert (s.scallop_height, s.chordal_tolerance) == (c.settings.scallop_height, c.settings.chordal_tolerance)
        feeds = {m: {t.feed for t in s.trajectories if t.motion is m} for m in TrajectoryKind}
        assert feeds[TrajectoryKind.CUT] == {cut.feed} and feeds[TrajectoryKind.CONNECT] <= {cut.feed, cut.link_feed}
        assert feeds[TrajectoryKind.APPROACH] <= {cut.plunge_feed, cut.feed, cut.link_feed}
        # off a wall on an arc, then up
        assert {cut.link_feed} <= feeds[TrajectoryKind.LIFT] <= {cut.feed, cut.link_feed}
        assert feeds[TrajectoryKind.RAPID] == {0.0}
        # a descent ends at the plunge feed, or where nothing stands at that of the cut; a way in level may be a link
        for a, b in zip(s.trajectories[:-1], s.trajectories[1:], strict=True):
            if a.motion is TrajectoryKind.APPROACH and b.motion is TrajectoryKind.CUT:
                level = bool((np.diff(a.points[:, 2]) == 0.0).all())
                assert a.feed in (cut.feed, cut.link_feed if level else cut.plunge_feed)


# -- switches -----------------------------------------------------------------------------------------------------


def test_roughing_switched_off_leaves_the_finish_alone():
    c = replanned(case("corner"), roughing=False)
    assert {s.operation for s in c.plan.steps} == {"finishing"}
    assert [s.id for s in c.plan.steps] == ["S01", "S02", "S03"]
    assert [s.zone for s in c.plan.steps] == [z.id for z in c.zones]


def test_finishing_switched_off_leaves_the_layers_alone():
    """At the same heights, and more of them along walls (below)."""
    full = replanned(case("corner"))
    c = replanned(full, finishing=False)
    assert c.plan.zones == () and {s.strategy for s in c.plan.steps} == {"depth_layers"}
    ways = [[np.vstack([w.points for w in s.trajectories if w.motion is TrajectoryKind.CUT]) for s in plan.steps
             if s.operation == "roughing" and s.tool.id == "T2"] for plan in (full.plan, c.plan)]
    levels = [{round(z, 6) for p in way for z, flat in zip(p[1:, 2], np.diff(p[:, 2]) == 0.0, strict=True) if flat}
              for way in ways]
    assert levels[0] == levels[1] and len(levels[0]) > 2
    assert replanned(full, roughing=False, finishing=False).plan.steps == ()


@pytest.mark.slow
def test_layers_alone_take_walls_to_size_as_they_go_down():
    """What a finish would take off goes in every layer, so that a wall is never cut free before it is to size."""
    plans = [replanned(case("walls"), finishing=finishing).plan for finishing in (True, False)]
    way = [sum(w.length for s in p.steps if s.operation == "roughing" for w in s.trajectories
               if w.motion is TrajectoryKind.CUT)
           for p in plans]
    assert way[1] > 1.1 * way[0] > 0.0


def test_the_side_of_the_cut_is_told_on_every_step_and_free_where_both_ways_are_allowed():
    c = case("corner")
    climb, conventional = replanned(c), replanned(c, cut_direction=CutDirection.CONVENTIONAL)
    assert all(s.cut_direction.climbs for s in climb.plan.steps)
    assert not any(s.cut_direction.climbs for s in conventional.plan.steps)
    assert bytes_of(climb) != bytes_of(conventional)
    assert bytes_of(replanned(c, cut_direction=CutDirection.EITHER)) != bytes_of(climb)


def test_progress_is_told_after_the_layers_and_for_every_zone():
    told: list[float] = []
    c = replanned(case("corner"), progress=told.append)
    assert told == sorted(told) and told[0] == 0.0 and told[-1] == 1.0
    assert sorted(set(told[:-1])) == pytest.approx([AGAIN_SHARE * k / len(c.zones) for k in range(len(c.zones) + 1)])


def test_nothing_to_machine_makes_an_empty_plan():
    c = case("corner")
    plan = plan_job([], [], c.fields, CUT, c.stock_before, c.settings)
    assert plan.steps == () and plan.zones == ()


@pytest.mark.parametrize("pattern", Pattern)
def test_zones_no_sample_of_which_is_judged_get_no_passes(pattern):
    c = case("dome")
    none = [FinishTarget(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), 0.2) for _ in c.zones]
    again = replanned(c, checks=none, pattern=pattern, roughing=False)
    assert again.plan.steps == ()
    assert all(p.step is None and p.passes == 0 and not len(p.left) for p in again.plan.zones)


@pytest.mark.parametrize("name", ["walls", "corner"])
def test_rings_are_loose_and_rims_finishes_and_links_are_not(name):
    c = case(name)
    for s in c.plan.steps:
        for t in s.trajectories:
            assert t.loose == 0.0 or s.operation == "roughing" and t.motion is TrajectoryKind.CUT
            assert 0.0 <= t.loose <= LOOSE_SHARE * left_by_layers(STEP_DOWN * s.tool.diameter,
                                                                   c.fields[s.tool.id].lattice.step)
    ways = [t.loose for s in c.plan.steps for t in s.trajectories
            if s.operation == "roughing" and t.motion is TrajectoryKind.CUT]
    assert max(ways) > 0.0 == min(ways)


# -- what is left -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_what_no_pass_gets_to_is_told_and_nothing_else():
    c = case("dome")
    buried = np.arange(0, 40)
    checks = []
    for z in c.zones:
        points, normals = c.samples.points[z.samples].copy(), c.samples.normals[z.samples]
        points[buried] -= 0.2 * normals[buried]  # asked for, but inside the part
        checks.append(FinishTarget(points, normals, z.tips, 0.2))
    again = replanned(c, checks=checks)
    moves = again.moves(TrajectoryKind.CUT)
    for p, check in zip(again.plan.zones, checks, strict=True):
        assert len(p.left) > 20
        left = brute_residual(check.points, moves)
        rest = np.setdiff1d(np.arange(len(left)), p.left)
        assert (left[p.left] > 0.95 * c.settings.scallop_height).all()
        assert (left[rest] <= c.settings.scallop_height + 1e-4).all()


@pytest.mark.parametrize("name", ["corner", "corner by bull"])
def test_no_sample_of_a_level_area_stays_uncovered_by_the_flat(name):
    c = case(name)
    floors = [p for p in c.plan.zones if p.strategy == "planar_floor"]
    assert floors
    for p in floors:
        body = p.zone.tool
        step = next(s for s in c.plan.steps if s.id == p.step)
        walked = np.vstack([dense(t.points, 0.04) for t in step.trajectories if t.motion is TrajectoryKind.CUT])
        points = c.samples.points[p.zone.samples]
        at = walked[np.abs(walked[:, 2, None] - np.unique(points[:, 2].round(3))).min(axis=1) < 0.005]
        away, which = cKDTree(at[:, :2]).query(points[:, :2])
        u = np.maximum(away - (body.radius - body.corner_radius), 0.0)
        over = np.where(u < max(body.corner_radius, 0.006), u * u / max(2 * body.corner_radius, 0.006), np.inf)
        assert (over <= c.settings.scallop_height).mean() == 1.0
        assert len(p.left) == 0


# -- depth of the layers ------------------------------------------------------------------------------------------

LAG = 4  # tips of a pass that do not cut yet where the next is measured: what is in front of the cutter, not below it
ASIDE = 0.25  # mm off the radius: the strip at a wall, which layers leave, may stand higher


def depth_at(stock: SlowStock, tip, body, aside: float = ASIDE) -> float:
    """How far stock stands above the bottom of a cutter at a tip, within its radius less ``aside``."""
    seen = body.radius - aside
    rho = np.hypot(stock.x[None, :] - tip[0], stock.y[:, None] - tip[1])
    near = rho <= seen
    u = np.maximum(rho[near] - (body.radius - body.corner_radius), 0.0)
    rise = body.corner_radius - np.sqrt(np.maximum(body.corner_radius**2 - u * u, 0.0))
    return float((stock.top[near] - tip[2] - rise).max(initial=0.0))


def deepest_layer(c: Case, aside: float = ASIDE) -> float:
    """The deepest cut of a roughing step, in step_down of its tool."""
    stock, worst = SlowStock(c), 0.0
    for s in c.plan.steps:
        for t in s.trajectories:
            if t.motion is TrajectoryKind.RAPID:
                continue
            p = dense(t.points, stock.step)
            for k, tip in enumerate(p):
                if s.operation == "roughing" and t.motion is TrajectoryKind.CUT and k % 3 == 0:
                    worst = max(worst, depth_at(stock, tip, s.tool, aside) / (STEP_DOWN * s.tool.diameter))
                if k >= LAG:
                    stock.sink(p[k - LAG], s.tool, 0.0)
            for tip in p[-LAG:]:
                stock.sink(tip, s.tool, 0.0)
    return worst


@pytest.mark.parametrize("name", ["corner", "dome", "valley"])
def test_no_layer_is_deeper_than_the_step_down_and_the_island_it_may_find(name):
    worst = deepest_layer(case(name))
    assert 0.5 < worst <= 1.0 + ISLAND


def test_stock_above_the_part_is_taken_in_layers_too():
    c = case("corner by bull")
    lo, hi = c.part.mesh.bounds
    stock = StockMap.box(c.tree, lo - 1.0, hi + [1.0, 1.0, 4.0], 0.12)
    high = replanned(c, stock=stock, clearance=13.0, rapid_floor=12.0)
    # Rings turn short of the sharp corner between the walls; what two layers leave there, 0.5 mm wide, goes with
    # the first rim.
    assert deepest_layer(high, 0.55) <= 1.0 + 1e-6


@pytest.mark.slow
def test_a_short_neck_beside_a_wide_block_never_meets_what_stands_there():
    body = ball(3.0, neck=4.5, shank=8.0)
    c = plan_part(corner(), [body], near_net=False, spare=6.0, density=8.0, scallop=0.05)
    deep, where = worst_meeting(c)
    assert deep <= 0.02, where
    assert min(z.bottom for z in c.zones) < c.stock_before.highest - 4.5  # deeper than the neck is long
    assert len(c.zones) == 2 and all(len(z.left) == 0 for z in c.plan.zones)


def above_part(c: Case, **changes) -> np.ndarray:
    """Stock along the normal over all samples of the zones that look up, mm, once the layers are done."""
    lat = c.stock_before.lattice
    stock = StockMap(lat, c.stock_before.top.copy(), c.stock_before.cover.copy(), c.stock_before.part)
    checks = [FinishTarget(c.samples.points[z.samples], c.samples.normals[z.samples], z.tips, 0.2) for z in c.zones]
    cut = {t: CutData(10_000, 800, 200, 3000, STEP_DOWN * f.tool.diameter) for t, f in c.fields.items()}
    plan_job(c.zones, checks, c.fields, cut, stock, replace(c.settings, finishing=False, **changes))
    mine = np.concatenate([z.samples for z in c.zones if z.form is not AreaForm.LEVEL])
    points, normals = c.samples.points[mine], c.samples.normals[mine]
    up = normals[:, 2] > 0.3
    return (stock.top[lat.cells(points[up, :2])] - points[up, 2]) * normals[up, 2]


@pytest.mark.parametrize("name", ["dome", "valley", "ramp of 3 %", "ramp of 10 %"])
def test_semi_finishing_leaves_even_stock(name):
    """A layer leaves stairs as high as it is deep; layers between them a quarter of that and what is left at walls."""
    c = case(name)
    deepest = STEP_DOWN * max(f.tool.diameter for f in c.fields.values())
    allowed = EVEN * deepest + 0.1 * deepest
    before, after = above_part(c), above_part(c, semi_finishing=True)
    assert np.quantile(after, 0.99) <= allowed
    assert np.ptp(np.quantile(after, [0.3, 0.99])) < 0.8 * np.ptp(np.quantile(before, [0.3, 0.99]))


def test_semi_finishing_is_a_workingstep_after_the_layers_of_its_tool():
    c = case("corner")
    done = replanned(c, semi_finishing=True).plan.steps
    kinds = [(s.tool.id, s.operation) for s in done]
    assert len({s.id for s in done}) == len(done)
    tool, _ = next(k for k in kinds if k[1] == "semi_finishing")
    first = kinds.index((tool, "semi_finishing"))
    assert kinds[first - 1] == (tool, "roughing") and (tool, "finishing") in kinds[first:]
    assert all(s.operation != "semi_finishing" for s in replanned(c).plan.steps)


@pytest.mark.slow
def test_walls_that_layers_take_to_size_are_fed_as_in_a_finish():
    """Once a flute length layers follow walls with nothing left; what bends the tool there stays on the part."""
    c = case("walls")
    cut = {t: CutData(10_000, 800, 200, 3000, STEP_DOWN * f.tool.diameter,
                      finish=CutData(10_000, 500, 200, 3000, STEP_DOWN * f.tool.diameter)) for t, f in c.fields.items()}
    slow, fast = [], []
    for step in replanned(c, cut=cut).plan.steps:
        if step.operation == "roughing":
            for way in (w for w in step.trajectories if w.motion is TrajectoryKind.CUT):
                field = c.fields[step.tool.id]
                level = way.points[np.abs(way.points[:, 2] - way.points[:, 2].min()) < 1e-9]
                near = field.nearest_blocked(float(level[0, 2]))
                if near is not None:
                    steps = near[0][field.lattice.cells(level[:, :2])].min() / field.lattice.step
                    (fast if way.feed > 500 else slow).append(steps)
    assert len(fast) > 4 and min(fast) > 0.99 and min(slow) == 0.0
