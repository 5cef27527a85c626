"""Passes over shallow area as the planner lays them: on the tip limit, within the scallop, in their order."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.mesh_queries.drop import drop_tips
from geometry.sampling import sample_surface
from tests.hand_parts import SURFACES, ball, dome, field_of, terraces, tool
from tests.plan_checks import dense
from toolpath.cutter.cutter import Cutter
from toolpath.cutter.swept_envelope import Envelope
from toolpath.passes.pass_family import FinishTarget, Promise
from toolpath.plan_settings import Pattern
from toolpath.strategies import zigzag
from zones.reach.tip_field import touchable


def kind(body):
    return body.kind


def laid(field, keep, density, scallop, pattern=Pattern.ZIGZAG, chord=0.004, climb=True):
    """Layout over what the tool reaches of a mesh, and those points, normals and tips."""
    samples = with_normals(field.tree.mesh, keep, density)
    able, _, tips = touchable(field, samples.points, samples.normals, 0.0)
    target = FinishTarget(samples.points[able], samples.normals[able], tips[able], density ** -0.5)
    return zigzag.laid(field, target, Promise(scallop, chord, 0.3, 20.0), pattern, climb), target


def with_normals(mesh, keep, density):
    samples = sample_surface(mesh, density, seed=3)
    return samples.subset(keep(samples) & (samples.normals[:, 2] > 0.3))


EVERY_DAY = ("dome", "walls")  # the other surfaces are in the slow set


@pytest.mark.parametrize("body", [ball(3.0), tool(3.0, 0.6)], ids=kind)
@pytest.mark.parametrize(("name", "pattern"),
                         [pytest.param(n, p, marks=() if n in EVERY_DAY else pytest.mark.slow)
                          for n, p in [*((n, p) for n in SURFACES for p in (Pattern.ZIGZAG, Pattern.ONE_WAY)),
                                       ("dome", Pattern.SPIRAL), ("valley", Pattern.SPIRAL)]])
def test_passes_run_on_the_tip_limit_and_keep_the_scallop(name, body, pattern):
    tol, h = 0.004, 0.03
    field = field_of(SURFACES[name](), body)
    layout, target = laid(field, lambda s: np.ones(len(s), bool), 20.0, h, pattern, tol)
    assert layout.pattern is pattern and len(layout.places) > 3
    for line in layout.lines:
        p = dense(line.points, 0.02)
        limit = drop_tips(field.tree, p[:, :2], body.radius, body.corner_radius)
        slope = np.diff(p[:, 2]) / np.maximum(np.hypot(*np.diff(p[:, :2], axis=0).T), 1e-12)
        off = (p[:-1, 2] - limit[:-1]) / np.hypot(1.0, slope)  # across the path
        gentle = np.abs(slope) < 3.0
        assert off[gentle].min(initial=0.0) >= -1.1 * tol  # at a kink
        assert off[gentle].max(initial=0.0) <= 1.5 * tol
    left = Envelope([line.points for line in layout.lines], Cutter.of(body)).along(target.points, target.normals)
    assert (left <= 1.03 * h).mean() > 0.99


def test_every_second_pass_is_walked_back_and_one_way_is_not():
    field = field_of(dome(), ball(3.0))
    for pattern, turns in ((Pattern.ZIGZAG, True), (Pattern.ONE_WAY, False)):
        layout, _ = laid(field, lambda s: s.face == 2, 20.0, 0.05, pattern)
        assert len(layout.lines) == len(layout.places) >= 8
        ways = np.sign([(line.points[-1, :2] - line.points[0, :2]) @ layout.swath.feed for line in layout.lines])
        assert (ways[1:] == (-ways[:-1] if turns else ways[:-1])).all()
        if not turns:  # the stock is to the left of the feed, so climb milling goes against it
            other, _ = laid(field, lambda s: s.face == 2, 20.0, 0.05, pattern, climb=False)
            assert (ways == -1).all() and len(other.lines) == len(layout.lines)
            np.testing.assert_array_equal(other.lines[0].points, layout.lines[0].points[::-1])
        at = np.array([line.points[0, :2] @ layout.swath.side for line in layout.lines])
        np.testing.assert_allclose(at, layout.places, atol=1e-9)
        assert (np.diff(at) > 0).all()


def test_passes_are_broken_at_a_wall_and_stay_on_the_floor_they_serve():
    mesh, body = terraces([0, 6, 12], [0, 8], [[2, 7]]), ball(3.0)
    layout, target = laid(field_of(mesh, body), lambda s: (s.normals[:, 2] > 0.5) & (s.points[:, 2] < 3.0), 20.0, 0.05)
    assert target.points[:, 2].max() < 2.001 and len(layout.lines) >= 6
    for line in layout.lines:
        assert line.points[:, 2].max() < 2.1  # not on the higher terrace, nor on its rim


def test_auto_takes_the_pattern_that_is_less_way_and_tells_the_other():
    field = field_of(dome(), ball(3.0))
    layout, _ = laid(field, lambda s: np.hypot(*s.points[:, :2].T) < 5.0, 20.0, 0.02, Pattern.AUTO)
    (other, way), = layout.rejected
    assert {layout.pattern, other} == {Pattern.ZIGZAG, Pattern.SPIRAL} and way > layout.way
    assert layout.way == pytest.approx(sum(line.length for line in layout.lines) + 20.0 * len(layout.lines))


def test_refining_puts_passes_only_where_samples_fail():
    layout, target = laid(field_of(dome(), ball(3.0)), lambda s: s.face == 2, 20.0, 0.03)
    failing = np.flatnonzero(np.hypot(*(target.points[:, :2] - [2.0, 1.0]).T) < 0.6)
    for k in (1, 2, 3):
        lines = layout.between(k, failing)
        near = np.vstack([line.points[:, :2] for line in lines])
        assert np.abs(near @ layout.swath.side - (target.tips[failing, :2] @ layout.swath.side).mean()).max() < 1.2
        assert sum(line.length for line in lines) < 2.5 * len(lines)
        at = {round(float(line.points[0, :2] @ layout.swath.side), 6) for line in lines}
        assert not at & set(np.round(layout.places, 6).tolist())
    assert layout.between(1, failing[:0]) == []


@pytest.mark.parametrize("climb", [True, False])
def test_a_spiral_goes_inwards_with_the_stock_on_the_side_asked_for(climb):
    field = field_of(dome(), ball(3.0))
    layout, _ = laid(field, lambda s: np.hypot(*s.points[:, :2].T) < 4.0, 20.0, 0.03, Pattern.SPIRAL, climb=climb)
    line, = layout.lines
    x, y = line.points[:, 0], line.points[:, 1]
    turned = np.unwrap(np.arctan2(y, x))
    assert np.hypot(x[0], y[0]) > 3.0 > 0.6 > np.hypot(x[-1], y[-1])
    assert bool(turned[-1] < turned[0]) is climb  # clockwise: stock, inside, on the right
