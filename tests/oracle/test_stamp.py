"""The stock lowered along a path against position after position, byte for byte."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.kernels.drop import bull_of
from geometry.kernels.tapered import tapered_of
from toolpath.kernels.stock import HALF_DIAGONAL, stamp
from zones.kernels.lattice import LatticeFrame

WIDER = 1.6  # times that the side of a tapered mill is wider than its end


def twin(top, cover, frame, points, radius, corner, taper=0.0):
    """Every position on its own, over all nodes at once; radius : mm, of the end where the side leans."""
    x, y = np.meshgrid(frame.x0 + frame.step * np.arange(top.shape[1]), frame.y0 + frame.step * np.arange(top.shape[0]))

    def bottom(rho):
        u = rho - (end - corner)
        with np.errstate(invalid="ignore"):
            curve = np.where(u <= 0.0, 0.0, corner - np.sqrt(np.maximum(corner * corner - u * u, 0.0)))
        if taper == 0.0:
            return curve
        return np.where(rho > join, corner * (1.0 - taper / long) + (rho - join) / taper, curve)

    end, long = radius, np.sqrt(1.0 + taper * taper)
    join = end - corner * (1.0 - 1.0 / long)
    radius = radius if taper == 0.0 else WIDER * radius

    for a, b in zip(points[:max(len(points) - 1, 1)], np.vstack([points[1:], points[-1:]]), strict=False):
        pieces = max(1, int(np.ceil(np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2) / (0.7 * frame.step))))
        for t in np.arange(pieces + 1) / pieces:
            cx, cy, cz = a + t * (b - a)
            rho = np.sqrt((x - cx) ** 2 + (y - cy) ** 2)
            half = HALF_DIAGONAL * frame.step
            lowered = (rho <= radius) & (cover > cz)
            top[lowered] = np.minimum(top, cz + bottom(rho))[lowered]
            lowered &= rho + half <= radius
            cover[lowered] = np.minimum(cover, cz + bottom(rho + half))[lowered]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("corner", [0.0, 0.4, 1.0])
def test_a_tapered_mill_lowers_with_its_side(seed, corner):
    rng = np.random.default_rng(seed)
    frame = LatticeFrame(*rng.uniform(-1.0, 1.0, 2), 0.1)
    top = rng.uniform(0.0, 2.0, (50, 40))
    cover = top + rng.uniform(0.0, 0.3, top.shape)
    points = np.column_stack([frame.x0 + rng.uniform(0.0, 4.0, 6), frame.y0 + rng.uniform(0.0, 5.0, 6),
                              [1.4, 1.0, 1.0, 0.3, 0.3, 0.5]])
    given = top.copy(), cover.copy()
    stamp(*given, frame, points, tapered_of(1.0, corner, 0.2, WIDER))
    twin(top, cover, frame, points, 1.0, corner, 0.2)
    np.testing.assert_allclose(given[0], top, rtol=0, atol=1e-12)
    np.testing.assert_allclose(given[1], cover, rtol=0, atol=1e-12)
    assert (top < 1.0).mean() > 0.2


@pytest.mark.parametrize("seed", range(8))
def test_a_level_move_lowers_what_its_positions_lower(seed):
    rng = np.random.default_rng(seed)
    frame = LatticeFrame(*rng.uniform(-1.0, 1.0, 2), float(rng.choice([0.1, 0.15])))
    ny, nx = rng.integers(30, 60, 2)
    top = rng.uniform(0.0, 2.0, (ny, nx))
    cover = top + rng.uniform(0.0, 0.3, (ny, nx))
    for radius, corner in ((1.0, 0.0), (1.5, 1.5), (1.5, 0.4)):
        points = np.column_stack([frame.x0 + rng.uniform(-1.0, frame.step * nx + 1.0, 7),
                                  frame.y0 + rng.uniform(-1.0, frame.step * ny + 1.0, 7),
                                  [1.4, 1.4, 1.0, 0.9, 0.9, 0.9, 0.9]])
        points[4, 0], points[5, 1], points[6] = points[3, 0], points[4, 1], points[5]  # along y, along x, and nowhere
        given = top.copy(), cover.copy()
        stamp(*given, frame, points, bull_of(radius, corner))
        twin(top, cover, frame, points, radius, corner)
        assert np.array_equal(given[0], top) and np.array_equal(given[1], cover)
    assert (top < 1.0).mean() > 0.2
