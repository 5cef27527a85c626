"""The tip path along a way: chord, breaks, corners."""

from __future__ import annotations

import numpy as np
import pytest

from tests.plan_checks import dense
from toolpath.passes.dragged_path import SMALLEST, STEEPEST, follow, pieces


def waves(xy):
    return np.sin(2.0 * xy[:, 0]) * np.cos(1.3 * xy[:, 1])


@pytest.mark.parametrize("tolerance", [0.05, 0.005, 0.0005])
def test_the_path_keeps_its_chord_and_no_more_points_than_that_takes(tolerance):
    way = np.array([[-3.0, -1.0], [4.0, 2.0]])
    points, broken = follow(waves, way, 0.5, tolerance)
    assert not broken.any()
    np.testing.assert_array_equal(points[:, 2], waves(points[:, :2]))
    fine = dense(points, 0.002)
    assert np.abs(fine[:, 2] - waves(fine[:, :2])).max() <= 1.2 * tolerance
    thin, = pieces(waves, way, 0.5, tolerance)
    fine = dense(thin, 0.002)
    assert np.abs(fine[:, 2] - waves(fine[:, :2])).max() <= 1.2 * tolerance
    # a chord f leaves f^2 |z''| / 8; two to three times the least number of points is what halves of tolerances cost
    run = np.hypot(*(way[1] - way[0]))
    assert len(thin) <= 3.0 * run / np.sqrt(8.0 * tolerance / 2.8) + 4


def test_the_chord_falls_with_the_square_of_the_step():
    way = np.array([[0.3, 0.0], [0.9, 0.0]])
    steps = 0.200001 / 2.0 ** np.arange(5)
    left = []
    for step in steps:
        points, _ = follow(waves, way, float(step), 1.0)
        fine = dense(points, 1e-4)
        left.append(np.abs(fine[:, 2] - waves(fine[:, :2])).max())
    assert np.polyfit(np.log(steps), np.log(left), 1)[0] == pytest.approx(2.0, abs=0.1)


def test_two_kinks_that_cancel_in_the_middle_are_seen():
    def kinked(xy):
        return np.maximum(0.0, 0.3 - np.abs(xy[:, 0] - 0.25)) - np.maximum(0.0, 0.3 - np.abs(xy[:, 0] - 0.75))

    points, _ = follow(kinked, np.array([[0.0, 0.0], [1.0, 0.0]]), 1.0, 0.001)
    fine = dense(points, 0.001)
    assert np.abs(fine[:, 2] - kinked(fine[:, :2])).max() <= 0.0012


def test_a_jump_breaks_the_path_and_what_lies_under_nothing_does():
    def limit(xy):
        x = xy[:, 0]
        return np.where(x < 1.0, 0.0, np.where(x < 2.0, 5.0, np.where(x < 3.0, -np.inf, np.inf)))

    points, broken = follow(limit, np.array([[0.0, 0.0], [4.0, 0.0]]), 0.3, 0.01)
    runs = pieces(limit, np.array([[0.0, 0.0], [4.0, 0.0]]), 0.3, 0.01)
    assert [p[0, 2] for p in runs] == [0.0, 5.0] and all((p[:, 2] == p[0, 2]).all() for p in runs)
    assert runs[0][-1, 0] == pytest.approx(1.0, abs=SMALLEST) and runs[1][0, 0] == pytest.approx(1.0, abs=SMALLEST)
    assert len(points) < 60 and broken.any()


def test_what_rises_steeply_but_does_not_jump_is_one_path():
    slope = 0.9 * STEEPEST
    way = np.array([[0.0, 0.0], [2.0, 0.0]])
    points, broken = follow(lambda xy: slope * np.maximum(xy[:, 0] - 1.0, 0.0), way, 0.3, 1e-3)
    assert not broken.any() and points[-1, 2] == pytest.approx(slope)


def test_corners_of_the_way_are_kept():
    way = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [1.0, 2.0]])
    points, broken = follow(waves, way, 0.4, 0.01)
    assert not broken.any()
    for corner in way:
        assert (np.abs(points[:, :2] - corner).max(axis=1) < 1e-12).any()
    np.testing.assert_array_equal(points[0, :2], way[0])
    np.testing.assert_array_equal(points[-1, :2], way[-1])
