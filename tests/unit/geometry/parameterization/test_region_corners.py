"""Corners of regions with more, fewer and exactly four, with notches, and none at all."""

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.parameterization.quad_grid import even
from geometry.parameterization.region_corners import find_corners
from tests.square_regions import region


def border(polygon, spacing=0.25):
    p = np.asarray(polygon, float)
    around = np.vstack([p, p[:1]])
    return np.vstack([even(np.array([a, b]), max(2, int(np.linalg.norm(b - a) / spacing)) + 1)[:-1]
                      for a, b in zip(around[:-1], around[1:], strict=True)])


def corners_of(polygon):
    b = border(polygon)
    found = find_corners(b)
    return b[found.at], found


def same(places, wanted, near=0.3):
    return len(places) == len(wanted) and all(
        np.linalg.norm(np.asarray(w) - places, axis=1).min() < near for w in wanted)


def test_a_rectangle_has_its_corners():
    places, found = corners_of([(0, 0), (30, 0), (30, 10), (0, 10)])
    assert same(places, [(0, 0), (30, 0), (30, 10), (0, 10)], 1e-9)
    assert found.sharp == 4 and found.turn == pytest.approx(np.pi / 2)


def test_a_ribbon_has_both_corners_of_its_narrow_ends():
    """52 mm by 1.7 mm, bent: the ends are narrower than the wider window."""
    t = np.linspace(0, 1, 81)
    low = np.column_stack([52 * t, 2 * np.sin(5 * t)])
    b = border(np.vstack([low, (low + [0, 1.7])[::-1]]))
    places = b[find_corners(b).at]
    assert same(places, [low[0], low[-1], low[-1] + [0, 1.7], low[0] + [0, 1.7]], 1e-6)


def test_a_triangle_gets_its_fourth_corner_on_a_side():
    places, found = corners_of([(0, 0), (20, 0), (10, 9)])
    assert found.sharp == 3
    for corner in ((0, 0), (20, 0), (10, 9)):
        assert np.linalg.norm(places - corner, axis=1).min() < 1e-9


def test_a_pentagon_gives_up_its_bluntest_corner():
    places, found = corners_of([(0, 0), (20, 0), (20, 10), (10, 12.0), (0, 10)])
    assert found.sharp == 5 and same(places, [(0, 0), (20, 0), (20, 10), (0, 10)], 1e-9)


def test_an_l_keeps_its_notch_inside_a_side():
    places, found = corners_of([(0, 0), (20, 0), (20, 8), (8, 8), (8, 20), (0, 20)])
    assert found.sharp == 5
    assert np.linalg.norm(places - (8, 8), axis=1).min() > 2.0
    for corner in ((20, 0), (20, 8), (8, 20), (0, 20)):
        assert np.linalg.norm(places - corner, axis=1).min() < 1e-9


def test_a_disc_is_quartered():
    t = np.linspace(0, 2 * np.pi, 241)[:-1]
    found = find_corners(10 * np.column_stack([np.cos(t), np.sin(t)]))
    assert found.sharp == 0
    assert np.diff(np.append(found.at, found.at[0] + 240)) == pytest.approx(60, abs=1)


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.9])
@pytest.mark.parametrize("start", [0, 37])
def test_corners_do_not_depend_on_where_a_border_begins_or_how_it_lies(turn, start):
    sides = region(bump=0.2, notch=-0.17, size=40.0)
    b = np.vstack([even(s, 81)[:-1] for s in sides])
    c, s = np.cos(turn), np.sin(turn)
    moved = np.roll(b, -start, axis=0) @ np.array([[c, s], [-s, c]])
    places = b[(find_corners(moved).at + start) % len(b)]
    assert same(places, [s[0] for s in sides], 1e-6)


def test_sides_run_from_corner_to_corner():
    b = border([(0, 0), (30, 0), (30, 10), (0, 10)])
    sides = find_corners(b).sides(b)
    for k, side in enumerate(sides):
        assert (side[-1] == sides[(k + 1) % 4][0]).all()
    assert sum(len(s) - 1 for s in sides) == len(b)


def test_a_border_the_wrong_way_round_is_refused():
    with pytest.raises(GeometryError) as refusal:
        find_corners(np.array([(0, 0), (0, 1), (1, 1), (1, 0)], float))
    assert refusal.value.code == "bad_border"
