"""The order of lines against a search through all lines for each of them."""

import math

import numpy as np
import pytest

from tests.linked_plate import loop, straight
from toolpath.lines import Line
from toolpath.passes.pass_order import nearest_order


def slow_order(lines, at, either):
    """Each time the line with the nearest start, the first of equals; one look at every line left."""
    left, out, here = list(lines), [], at
    while left:
        best, flip, start, least = 0, False, 0, math.inf
        for k, line in enumerate(left if here is not None else []):
            if line.closed:
                d2 = ((line.points[:, :2] - here[:2]) ** 2).sum(axis=1)
                j = int(np.argmin(d2))
                if d2[j] < least:
                    best, flip, start, least = k, False, j, float(d2[j])
                continue
            for back in (False, True) if either else (False,):
                d = float(((line.points[-1 if back else 0, :2] - here[:2]) ** 2).sum())
                if d < least:
                    best, flip, start, least = k, back, 0, d
        line = left.pop(best)
        line = line.reversed() if flip else line
        if line.closed and start:
            loop = line.points[:-1]
            line = Line(np.vstack([loop[start:], loop[:start + 1]]), True)
        out.append(line)
        here = line.points[-1]
    return out


@pytest.mark.parametrize("either", [False, True])
@pytest.mark.parametrize("start", [None, np.array([1.0, 2.0]), np.array([0.0, 0.0, 5.0])])
@pytest.mark.parametrize("seed", range(6))
def test_the_order_is_that_of_a_search_through_all_lines(seed, start, either):
    rng = np.random.default_rng(seed)
    lines = []
    for _ in range(int(rng.integers(0, 40))):
        points = rng.integers(0, 6, (int(rng.integers(2, 9)), 3)).astype(float)  # on a lattice many are as near
        closed = bool(rng.random() < 0.5)
        lines.append(Line(np.vstack([points, points[:1]]) if closed else points, closed))
    found, expected = nearest_order(lines, start, either), slow_order(lines, start, either)
    assert [line.points.tolist() for line in found] == [line.points.tolist() for line in expected]
    assert [line.closed for line in found] == [line.closed for line in expected]


def test_order_goes_to_the_nearest_start():
    lines = [straight(0, 1, y, 0) for y in (5.0, 1.0, 3.0)]
    got = nearest_order(lines, np.array([0.0, 0, 9]), False)
    assert [p.points[0, 1] for p in got] == [1, 3, 5]
    assert all((p.points[0, 0], p.points[-1, 0]) == (0, 1) for p in got)  # climb is kept
    free = nearest_order(lines, np.array([0.0, 0, 9]), True)
    assert [p.points[0, 0] for p in free] == [0, 1, 0]  # to and fro
    assert nearest_order([], None, True) == []


def test_a_loop_begins_at_its_nearest_point_and_keeps_its_sense():
    line = loop(5.0, 0.0)
    (got,) = nearest_order([line], np.array([15.0, 30.0, 0]), True)
    assert got.closed and got.points[0, :2] == pytest.approx([15, 20], abs=0.4)
    assert (got.points[0] == got.points[-1]).all() and got.length == pytest.approx(line.length)

    def area(p):
        return 0.5 * float(np.sum(p[:-1, 0] * p[1:, 1] - p[1:, 0] * p[:-1, 1]))
    assert math.copysign(1, area(got.points)) == math.copysign(1, area(line.points))
