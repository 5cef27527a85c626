"""Passes of a nose that leans as it is asked to: what they leave by the proof's measure, how they get round a post."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.surfaces.nurbs import NurbsSurface
from service.stages.cautions import upright
from tests.hand_parts import ball, box_mesh, joined, samples_of, tool
from tests.unit.toolpath.five_axis.test_matched_passes import measured
from tests.unit.toolpath.strategies.test_curvature_matched import (
    FEED,
    FREE,
    HOLLOW,
    LIFT,
    LOOP,
    SCALLOP,
    SURFACE,
    cuts,
    settings_of,
)
from toolpath.five_axis.axis_smoothing import AxisLimits
from toolpath.five_axis.oriented_motion import SKIMMED, Surroundings, free_parts
from toolpath.five_axis.oriented_pass import enters
from toolpath.five_axis.oriented_piece import Piece
from toolpath.passes.pass_family import FinishTarget
from toolpath.passes.trimmed_faces import TrimmedFace
from toolpath.plan_settings import CutData, ToolLean
from toolpath.stock.stock_map import SKIN, StockMap
from toolpath.strategies import inclined_axis
from toolpath.workingsteps import Trajectory, TrajectoryKind
from zones.machinable_area import AreaForm
from zones.reach.assembly import Clearances

BALL = ball(6.0)
TILTED, LEADING = ToolLean(0.0, np.radians(15.0)), ToolLean(np.radians(10.0), 0.0)
POST = joined(HOLLOW, box_mesh([4, 4, -1], [9, 9, 30]))


def found(leaned=TILTED, mesh=HOLLOW, allowance=0.0, turning=FREE, body=BALL, margin=0.1, beyond=-20.0):
    tree, clear = TriangleTree(mesh), Clearances()
    samples = samples_of(HOLLOW, 2.0, {2})
    rows = samples.points[:, 1] > beyond
    target = FinishTarget(samples.points[rows], samples.normals[rows], samples.points[rows], 0.7)
    around = Surroundings(enters(tree, body, clear, allowance - LIFT), turning,
                          StockMap.around(tree, HOLLOW.bounds, margin, 0.25), (), clear)
    wider = replace(clear, neck=clear.neck + inclined_axis.WARY, shank=clear.shank + inclined_axis.WARY)
    cut = CutData(10_000, FEED, 200, 3000, 3.6)
    return inclined_axis.inclined_passes([TrimmedFace(2, SURFACE, (LOOP,), 1600.0)], target,
                                         SimpleNamespace(tool=body, allowance=allowance),
                                         cut, settings_of(turning), around,
                                         enters(tree, body, wider, allowance - LIFT), leaned), around


def normals_at(poses, radius):
    """Tool axes, the hollow's normals (z = x² / 120 + y² / 300) where a ball stands on it, and mm its centre is off."""
    tips, axes = (np.vstack(k) for k in zip(*poses, strict=True))
    centre = tips + radius * axes
    x, y = centre[:, 0], centre[:, 1]
    for _ in range(30):  # a ball much smaller than the hollow is round: the foot moves less and less
        normal = np.column_stack([-x / 60.0, -y / 150.0, np.ones(len(x))])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        x, y = (centre - radius * normal)[:, :2].T
    return axes, normal, np.linalg.norm(centre - np.column_stack([x, y, x * x / 120.0 + y * y / 300.0]), axis=1)


@pytest.fixture(scope="module")
def tilted():
    return found()[0]


@pytest.fixture(scope="module")
def past_a_post():
    return found(mesh=POST)


def test_it_leaves_no_more_than_the_scallop_and_cuts_no_deeper(tilted):
    left = measured(SURFACE, BALL, cuts(tilted))
    assert left.max() <= SCALLOP and left.min() > -0.002
    assert not tilted.refused


def test_it_leans_off_the_normal_as_asked_to_one_side_of_all_passes(tilted):
    axes, normals, far = normals_at(cuts(tilted), BALL.radius)
    np.testing.assert_allclose(far, BALL.radius, atol=0.002)
    lean = np.degrees(np.arccos(np.clip((axes * normals).sum(axis=1), -1.0, 1.0)))
    assert np.percentile(np.abs(lean - 15.0), 99) < 0.5 and np.abs(lean - 15.0).max() < 2.0
    assert (np.linalg.norm(axes[1:] - axes[:-1], axis=1)).max() < 0.1  # nor does it swing over from pass to pass


def test_passes_to_and_fro_are_one_run_where_nothing_is_between_them(tilted):
    (run,) = tilted.runs
    assert sum(len(t.points) for t in run) > 1000


def test_a_lead_leans_forward_in_passes_of_both_directions():
    runs, _ = found(LEADING)
    ways = []
    for run in runs.runs:
        tips, axes = (np.vstack(k) for k in zip(*cuts(SimpleNamespace(runs=(run,))), strict=True))
        along = tips[-1] - tips[0]
        along /= np.linalg.norm(along)
        normal = normals_at([(tips, axes)], BALL.radius)[1]
        assert np.degrees(np.arcsin(((axes - normal) @ along).mean())) == pytest.approx(10.0, abs=1.0)
        ways.append(along)
    ways = np.array(ways)
    assert (ways @ ways[0] > 0.9).sum() > 10 and (ways @ ways[0] < -0.9).sum() > 10


def test_each_face_leans_to_its_own_freer_side_however_its_parameters_run():
    """Two bulging walls back to back, the parameters of one turned round: upwards is left of one's passes, right of the
    other's, and downwards no tool goes."""
    knots, at = np.array([0.0, 0, 0, 0, 1, 1, 1, 1]), np.linspace(-10.0, 10.0, 4)
    y, z = np.meshgrid(at, at[::-1] * 0.5, indexing="ij")
    control = np.stack([12.0 - 0.02 * y * y, y, z], axis=-1)
    walls = [NurbsSurface(control, knots, knots, side=-1), NurbsSurface((control * [-1, -1, 1])[::-1], knots, knots)]
    g = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, 24)] * 2), axis=-1).reshape(-1, 2)
    points, normals = (np.vstack(k) for k in zip(*(w.points_and_normals(g) for w in walls), strict=True))
    assert (points[:, 0] * normals[:, 0] > 0.0).all()
    mesh, clear = box_mesh([-30, -30, -40], [30, 30, -30]), Clearances()
    tree = TriangleTree(mesh)
    around = Surroundings(enters(tree, BALL, clear), FREE, StockMap.around(tree, mesh.bounds, 0.1, 0.5), (), clear)
    faces = [TrimmedFace(k, w, (LOOP,), 200.0) for k, w in enumerate(walls)]
    runs = inclined_axis.inclined_passes(faces, FinishTarget(points, normals, points, 1.0),
                                         SimpleNamespace(tool=BALL, allowance=0.0),
                                         CutData(10_000, FEED, 200, 3000, 3.6), settings_of(), around,
                                         enters(tree, BALL, clear),
                   ToolLean(0.0, np.radians(65.0), np.radians(65.0)))
    tips, axes = (np.vstack(k) for k in zip(*cuts(runs), strict=True))
    centre = tips + BALL.radius * axes
    for side in (1.0, -1.0):
        mine = side * centre[:, 0] > 0.0
        assert np.linalg.norm(np.diff(centre[mine], axis=0), axis=1).sum() > 500.0
        np.testing.assert_allclose(np.degrees(np.arccos(axes[mine, 2])), 25.0, atol=3.0)


def test_a_nose_goes_downhill_where_a_thin_skin_is_under_it_and_nowhere_deeper():
    """Down along its axis by 1 in 5, into stock with a level top at 0, from 1 mm above it."""
    x = np.linspace(-5.0, 5.0, 101)
    up = np.tile([0.0, 0.0, 1.0], (101, 1))
    piece = Piece(np.column_stack([x, np.zeros(101), -0.2 * x]), up, up, BALL.radius, on_end=True)
    mesh = box_mesh([-20, -20, -30], [20, 20, -20])
    tree, clear = TriangleTree(mesh), Clearances()
    around = Surroundings(enters(tree, BALL, clear), FREE, StockMap.box(
        tree, np.array([-20.0, -20, -30]), np.array([20.0, 20, 0]), 0.1), (), clear)
    assert not free_parts(piece, BALL, settings_of(), around)  # so of a matched end, which has no layers for that
    (part,) = free_parts(piece, BALL, settings_of(), around, skims=True)
    most = SKIMMED * SKIN * BALL.diameter
    assert part.tips[0, 0] == -5.0 and -0.5 * most > part.tips[-1, 2] > -most - 1e-9


def test_an_allowance_is_left_on_all_of_it():
    left = measured(SURFACE, BALL, cuts(found(allowance=0.2)[0])) - 0.2
    assert left.max() <= SCALLOP and left.min() > -0.002


@pytest.mark.slow
def test_a_bull_nose_leaves_no_more_in_the_middle_and_cuts_no_deeper():
    body = tool(8.0, 1.0)
    left = measured(SURFACE, body, cuts(found(LEADING, body=body, beyond=8.0)[0])).reshape(120, 120)
    asked = left[90:-12, 12:-12]  # y > 10
    assert asked.max() <= SCALLOP and left.min() > -0.01


@pytest.mark.slow
def test_it_goes_round_a_post_and_never_into_it(past_a_post):
    runs, around = past_a_post
    for tips, axes in cuts(runs):
        assert not around.blocked(tips, axes, BALL).any()
    axes, normals, _ = normals_at(cuts(runs), BALL.radius)
    lean = np.degrees(np.arccos(np.clip((axes * normals).sum(axis=1), -1.0, 1.0)))
    assert np.median(lean) == pytest.approx(15.0, abs=0.1)
    assert lean.max() > 17.0  # somewhere another axis than the one wanted is the nearest that is free
    assert lean.max() < 15.0 + np.degrees(inclined_axis.LIMITS.cone) + 1.0


@pytest.mark.slow
def test_led_axes_leave_less_at_a_post_than_those_wanted_alone(past_a_post, monkeypatch):
    def uncut(runs):
        g = (np.arange(120) + 0.5) / 120 * 40.0 - 20.0
        x, y = np.meshgrid(g, g, indexing="ij")
        outside = np.maximum(np.abs(x - 6.5), np.abs(y - 6.5)).ravel() > 2.5 + BALL.radius
        return int((measured(SURFACE, BALL, cuts(runs))[outside] > SCALLOP).sum())

    monkeypatch.setattr(inclined_axis, "LIMITS", AxisLimits(1e-4, inclined_axis.LIMITS.per_mm))
    assert uncut(past_a_post[0]) < 0.5 * uncut(found(mesh=POST)[0])


def test_what_the_machine_cannot_take_is_left_with_the_reason():
    runs, _ = found(turning=replace(FREE, stands=lambda axes: np.zeros(len(axes), bool)), beyond=18.0)
    assert not runs.runs and runs.refused == ("the tool is almost nowhere free",)


def test_level_zones_and_tools_without_a_corner_are_not_asked_and_walls_only_by_name():
    asked = ToolLean(0.1, 0.2, walls=1.0)
    assert inclined_axis.requested_lean(None, AreaForm.SHALLOW, BALL) is None
    assert inclined_axis.requested_lean(asked, AreaForm.LEVEL, BALL) is None
    assert inclined_axis.requested_lean(asked, AreaForm.SHALLOW, tool(6.0, 0.0)) is None
    assert inclined_axis.requested_lean(asked, AreaForm.SHALLOW, BALL) == asked
    assert inclined_axis.requested_lean(asked, AreaForm.STEEP, BALL) == ToolLean(0.0, 1.0, 1.0)
    assert inclined_axis.requested_lean(TILTED, AreaForm.STEEP, BALL) is None


def test_a_zone_that_stays_upright_although_asked_to_lean_is_a_caution_with_the_reason():
    def zone(name, form, strategy, *reasons, body=BALL):
        return SimpleNamespace(zone=SimpleNamespace(id=name, form=form, tool=body), strategy=strategy, step="S01",
                               rejected=tuple({"strategy": inclined_axis.NAME, "reason": r} for r in reasons))

    def step(name, strategy, way=30.0):
        points = np.array([[0.0, 0, 0], [way, 0, 0], [way, 0, 9.0]])
        return SimpleNamespace(zone=name, strategy=strategy, trajectories=[
            Trajectory(TrajectoryKind.CUT, points[:2], FEED), Trajectory(TrajectoryKind.LIFT, points[1:], FEED)])

    zones = [zone("Z1", AreaForm.SHALLOW, "inclined_axis"),
             zone("Z2", AreaForm.SHALLOW, "zigzag", "a reason", "another"),
             zone("Z3", AreaForm.STEEP, "waterline"), zone("Z4", AreaForm.SHALLOW, "depth_layers"),
             zone("Z5", AreaForm.SHALLOW, "zigzag"), zone("Z6", AreaForm.SHALLOW, "zigzag", body=tool(6.0, 0.0)),
             zone("Z7", AreaForm.SHALLOW, "inclined_axis"),
             zone("Z8", AreaForm.SHALLOW, "curvature_matched", "too slow")]
    steps = [step(z.zone.id, z.strategy) for z in zones if z.strategy != "depth_layers"]
    steps += [step(None, "depth_layers"), step("Z1", "zigzag", 29.0), step("Z7", "zigzag", 31.0),
              step("Z8", "spiral", 90.0)]
    first, second, third, fourth = upright(TILTED, zones, steps)
    assert first.subjects == ("Z2", "T1") and "stays upright (a reason; another)" in first.message
    assert (first.measured, first.limit) == (30.0, 15.0)
    assert second.subjects == ("Z5", "T1") and "no pass lies on it" in second.message
    assert third.subjects == ("Z7", "T1")
    assert "along 31 of 61 mm of cut (no tilt near the requested one is free of collision)" in third.message
    assert fourth.subjects == ("Z8", "T1") and "along 90 of 120 mm of cut (too slow)" in fourth.message
    asked = ToolLean(0.0, 0.2, walls=1.0)
    assert [c.subjects[0] for c in upright(asked, zones, steps)] == ["Z2", "Z3", "Z5", "Z7", "Z8"]
    assert not upright(None, zones, steps)
