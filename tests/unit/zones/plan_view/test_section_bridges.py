"""Bridges over interruptions: arcs go on as arcs, straight ends stay straight, others get the chord."""

from __future__ import annotations

import numpy as np
import pytest

from zones.plan_view.section_bridges import bridge, direction

RADIUS = 10.0


def arc(first: float, last: float, count: int = 60) -> np.ndarray:
    """Nodes on a circle about the origin, from one direction of their radius to another (rad), unevenly spaced."""
    share = np.linspace(0, 1, count) ** 1.3
    angle = first + (last - first) * share
    return RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])


@pytest.mark.parametrize("degrees", [5, 20, 45, 90])
@pytest.mark.parametrize("way", [1, -1])
def test_an_arc_goes_on_as_an_arc(degrees: float, way: int) -> None:
    gap = np.radians(degrees)
    before, after = arc(0, way * 0.7), arc(way * (0.7 + gap), way * (1.4 + gap))
    middle = bridge(before, after, 1.5)
    chord = 2 * RADIUS * np.sin(gap / 2)
    assert np.abs(np.hypot(*middle.T) - RADIUS).max() < 1e-3 * chord
    whole = np.vstack([before[-1:], middle, after[:1]])
    step = np.diff(whole, axis=0)
    heading = np.degrees(np.unwrap(np.arctan2(step[:, 1], step[:, 0])))
    assert np.all(np.diff(heading) * way > 0) and np.diff(heading).max() < 6
    assert abs(heading[-1] - heading[0]) == pytest.approx(degrees * (1 - 1 / len(step)), abs=0.5)


def test_straight_ends_in_line_need_no_point_between() -> None:
    before, after = np.array([[0.0, 0], [5, 0]]), np.array([[8.0, 0], [9, 0], [20, 0]])
    assert bridge(before, after, 1.5).shape == (0, 2)


def test_an_s_leaves_both_ends_in_their_own_direction() -> None:
    before, after = np.array([[-5.0, 0], [-1, 0], [0, 0]]), np.array([[6.0, 2], [7, 2], [11, 2]])
    middle = np.vstack([[0, 0], bridge(before, after, 1.5), [6, 2]])
    assert (np.diff(middle[:, 1]) > 0).all()
    assert middle[:, 1] + middle[::-1, 1] == pytest.approx(2.0)
    first = middle[1] - middle[0]
    assert abs(np.arctan2(first[1], first[0])) < 0.1


def test_ends_that_lead_elsewhere_are_joined_by_the_chord() -> None:
    before, after = np.array([[0.0, -5], [0, 0]]), np.array([[6.0, 0], [12, 0]])
    assert bridge(before, after, 1.5).shape == (0, 2)


def test_the_direction_of_an_end_is_that_of_the_curve_there_and_not_of_its_chord() -> None:
    nodes = arc(0, 1.0, 200)
    assert direction(nodes, 1.5) == pytest.approx([0, 1], abs=2e-3)
    assert direction(nodes[::-1], 1.5) == pytest.approx([np.sin(1), -np.cos(1)], abs=2e-3)
    noisy = nodes + np.random.default_rng(2).normal(0, 1e-3, nodes.shape)
    assert direction(noisy, 1.5) == pytest.approx([0, 1], abs=1e-2)


def test_two_nodes_give_their_own_direction() -> None:
    assert direction(np.array([[1.0, 1], [4, 5]]), 1.0) == pytest.approx([0.6, 0.8])
