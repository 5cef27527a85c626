"""Lines that are needed: against samples whose residual is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from tests.hand_parts import ball, tool
from toolpath.lines import Line
from toolpath.passes.needed_lines import Reach, needed
from toolpath.stock.residual_map import UNTOUCHED, ResidualMap

REACH = Reach(beside=0.6, spacing=0.2, overrun=0.3, join=0.5)


def plane(across=2.0, along=10.0):
    """Samples of a level plane at z = 0, and tips of an end that stands on them."""
    x, y = np.meshgrid(np.arange(0.05, along, 0.1), np.arange(0.05, across, 0.1))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return points, ResidualMap(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), margin=0.1)


def row(y, x0=0.0, x1=10.0):
    return Line(np.array([[x0, y, 0.0], [x1, y, 0.0]]), False)


def kept(lines, residual, body, points, aim=0.01, reach=REACH):
    failing = np.flatnonzero(residual.residual > aim)
    groups = needed([lines], residual, body, failing, points, np.full(len(points), aim), reach)
    assert len(groups) == 1
    return groups[0]


def test_every_line_of_a_plane_is_kept_and_no_line_twice():
    points, residual = plane()
    lines = [row(y) for y in (0.5, 1.5)]
    body = tool(1.0, 0.0)
    assert kept(lines, residual, body, points) == lines
    assert (residual.residual == UNTOUCHED).all()
    assert len(kept([*lines, row(0.5)], residual, body, points)) == 2


def test_a_line_where_nothing_is_left_to_do_is_dropped():
    points, residual = plane()
    body = tool(1.0, 0.0)
    residual.cut(row(0.5).points, body)
    found = kept([row(0.5), row(1.5)], residual, body, points)
    assert len(found) == 1 and found[0].points[0, 1] == 1.5


def test_a_line_is_cut_to_what_needs_it_and_an_overrun():
    points, residual = plane(1.0)
    body = tool(1.0, 0.0)
    residual.cut(row(0.5, -1.0, 6.0).points, body)
    (piece,) = kept([row(0.5)], residual, body, points)
    # samples from 6.55 on are left; a place of the line serves those within 0.6 mm
    assert piece.points[:, 0].max() == pytest.approx(10.0)
    assert 6.5 - 0.6 - 0.3 - 0.25 <= piece.points[:, 0].min() <= 6.5 - 0.3


def test_where_no_line_reaches_the_aim_the_best_one_counts():
    points, residual = plane(0.8)
    body = ball(1.0)  # leaves 0.5 - sqrt(0.25 - d^2) at the distance d
    lines = [row(0.2), row(0.6)]
    assert kept(lines, residual, body, points, aim=0.001) == lines


def test_a_line_answers_for_no_sample_farther_up_a_wall_than_its_reach():
    # the side of a flat end takes the whole wall at once; the passes are made for 0.5 mm of it
    z, y = np.meshgrid(np.arange(0.05, 2.0, 0.1), np.arange(0.05, 6.0, 0.1))
    points = np.column_stack([np.zeros(z.size), y.ravel(), z.ravel()])
    residual = ResidualMap(points, np.tile([1.0, 0.0, 0.0], (len(points), 1)), margin=0.1)
    body = tool(2.0, 0.0)
    tips = points + [1.0, 0.0, 0.0]
    levels = [Line(np.array([[1.0, 6.0, h], [1.0, 0.0, h]]), False) for h in (1.5, 1.0, 0.5, 0.0)]
    assert len(kept(levels, residual, body, tips)) == 4
    high = Reach(beside=5.0, spacing=0.2, overrun=0.3, join=0.5)
    assert len(kept(levels, residual, body, tips, reach=high)) == 1


def test_a_line_of_many_points_serves_flat_places_as_the_straight_line_does():
    # the squares round the samples end just where the cutter does: no disc takes one, the whole strip takes all
    x = np.arange(0.05, 10.0, 0.1)
    points = np.column_stack([x, np.full(len(x), 0.05), np.zeros(len(x))])
    residual = ResidualMap(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), margin=0.1,
                           covers=np.full(len(points), 0.05 - 1e-9))
    many = Line(np.column_stack([np.arange(0.0, 10.0, 0.03), np.full(334, 0.5), np.zeros(334)]), False)
    assert kept([many], residual, tool(1.0, 0.0), points) == [many]


def test_samples_high_above_a_level_line_keep_what_they_have_and_the_others_are_measured_as_ever():
    z, y = np.meshgrid(np.arange(0.05, 4.0, 0.1), np.arange(0.05, 6.0, 0.1))
    points = np.column_stack([np.zeros(z.size), y.ravel(), z.ravel()])
    maps = [ResidualMap(points, np.tile([1.0, 0.0, 0.0], (len(points), 1)), margin=0.1,
                        covers=np.full(len(points), 0.05)) for _ in range(2)]
    line = np.array([[1.02, 6.0, 0.5], [1.02, 0.0, 0.5]])
    maps[0].cut(line, tool(2.0, 0.4))
    maps[1].cut(line, tool(2.0, 0.4), above=1.0)
    near = points[:, 2] <= 1.5
    assert (maps[0].residual[near] == maps[1].residual[near]).all() and (maps[0].residual < UNTOUCHED).any()
    assert (maps[1].residual[points[:, 2] > 1.6] == UNTOUCHED).all()
    assert (maps[0].residual[points[:, 2] > 1.6] < UNTOUCHED).any()
