"""The order of lines against a search through all lines for each of them."""

import math

import numpy as np
import pytest

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
