"""Rows sorted by cell, against numpy's stable sort."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.binning import by_cell, limits_of


@pytest.mark.parametrize("count", [1, 7, 300])
def test_rows_by_cell_are_those_of_a_stable_sort(count: int) -> None:
    key = np.random.default_rng(count).integers(0, count, 500)
    order, first = by_cell(key, count)
    assert np.array_equal(order, np.argsort(key, kind="stable"))
    assert np.array_equal(first, np.searchsorted(key[order], np.arange(count + 1)))


def test_without_rows_all_cells_are_empty() -> None:
    order, first = by_cell(np.zeros(0, np.int64), 3)
    assert len(order) == 0 and first.tolist() == [0, 0, 0, 0]


def test_limits_are_column_by_column() -> None:
    points = np.random.default_rng(1).normal(size=(50, 3))
    low, high = limits_of(points)
    assert np.array_equal(low, points.min(axis=0)) and np.array_equal(high, points.max(axis=0))
