"""Places of stock that samples fall on here and there."""

import numpy as np
import pytest

from geometry.sampling import SurfaceSamples
from tests.pocket_case import SETUP
from verify.findings import Source
from verify.work.stock_places import StandingStock, stock_findings

SOURCE = Source(("p.ngc",), np.zeros(1, np.int32), np.ones(1, np.int32), np.ones(1, np.int32))


def found(x, stands, y=0.0):
    n = len(x)
    points = np.column_stack([x, np.full(n, y), np.zeros(n)])
    samples = SurfaceSamples(points, np.tile([0.0, 0.0, 1.0], (n, 1)), np.full(n, 0.01), np.full(n, 7, np.int32),
                             np.zeros(n, np.int32))
    stock = StandingStock(np.full(n, 0.02), np.zeros(n, np.int32), np.zeros((n, 3)))
    return stock_findings(samples, stock, 1.0, SOURCE, SETUP, stands)


def everywhere(points, normals):
    assert points.shape == normals.shape and np.allclose(np.linalg.norm(normals, axis=1), 1.0)
    return np.ones(len(points), bool)


@pytest.mark.parametrize(("x", "findings"), [
    ([0, 2, 4, 6, 8, 10], 1), ([0, 2, 4, 6], 0), ([0, 7, 14, 21, 28, 35], 0), ([0, 0.1, 2, 2.1, 4, 4.1, 20, 22], 1)])
def test_samples_on_one_fin_are_one_place(x, findings):
    """Each stands for 0.01 mm²: five make a place, where no gap is over 6 mm."""
    told, rows = found(np.array(x, float), everywhere)
    assert len(told) == findings and (not told or told[0].area == pytest.approx(0.06))
    assert rows.sum() == 6 * findings


def test_what_is_cut_between_parts_places():
    x = np.array([0.0, 2.0, 4.0, 6.0, 8.0, 10.0])
    assert not found(x, lambda points, normals: np.abs(points[:, 0] - 5.0) > 0.06)[0]
    assert not found(x, None)[0]


def test_places_that_are_large_enough_stay_apart():
    x = np.concatenate([np.arange(6) * 0.1, 3.0 + np.arange(6) * 0.1])
    assert [f.area for f in found(x, everywhere)[0]] == pytest.approx([0.06, 0.06])
