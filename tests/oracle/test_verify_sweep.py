"""Swept intervals against a twin that samples the tool at many places of the move."""

import numpy as np
import pytest

from geometry.kernels.cutter_sizes import CutterSizes
from verify.kernels.sweep import cutter_interval


def static_interval(q, n, radius, corner, length):
    """Interval of a ray in a tool standing at the origin, by walking along the ray."""
    t = np.linspace(-8, 8, 8_001)
    p = q + t[:, None] * n
    rho, h = np.hypot(p[:, 0], p[:, 1]), p[:, 2]
    over = np.maximum(rho - (radius - corner), 0.0)
    bottom = np.where(rho <= radius, corner - np.sqrt(np.maximum(corner**2 - over**2, 0.0)), np.inf)
    inside = (rho <= radius) & (h >= bottom) & (h <= length)
    return (t[inside].min(), t[inside].max()) if inside.any() else (np.inf, -np.inf)


def swept_twin(q, n, d, tool, steps=401):
    """The twin: the least and greatest t over many standing tools along the move."""
    both = [static_interval(q - s * d, n, *tool) for s in np.linspace(0, 1, steps)]
    return min(b[0] for b in both), max(b[1] for b in both)


@pytest.mark.parametrize("tool", [(1.5, 1.5, 6.0), (1.5, 1.5, 2.0), (2.0, 0.0, 5.0), (2.0, 0.5, 5.0)])
def test_interval_is_the_union_of_standing_tools(tool):
    rng = np.random.default_rng(7)
    met = 0
    for case in range(40):
        d = rng.normal(size=3) * np.array([[1, 1, 1], [1, 1, 0], [0, 0, 1], [1, 0, 0.02]][case % 4])
        n = rng.normal(size=3) * np.array([[1, 1, 1], [1, 1, 0], [0, 0, 1]][case % 3])
        n /= np.linalg.norm(n)
        q = rng.uniform([-2.5, -2.5, -1], [2.5, 2.5, 5])
        lo, hi = cutter_interval(*q, *n, *d, CutterSizes(*tool))
        tlo, thi = swept_twin(q, n, d, tool, 61)
        if np.isinf(tlo):
            continue
        met += 1
        # the walk has a step of 2e-3 along the ray and misses less than the gap between standing tools
        assert lo <= tlo + 1e-9 and hi >= thi - 1e-9
        for t in (lo + 1e-7, 0.5 * (lo + hi), hi - 1e-7):
            assert touches(q + t * n, d, tool), (case, t, lo, hi)
    assert met > 8


def touches(p, d, tool):
    """Whether some place of the move holds p, by minimising the signed depth over a fine and a refined grid."""
    radius, corner, length = tool
    s = np.linspace(0, 1, 2_001)
    for _ in range(2):
        w = p - s[:, None] * d
        rho, h = np.hypot(w[:, 0], w[:, 1]), w[:, 2]
        over = np.maximum(rho - (radius - corner), 0.0)
        low = np.where(h >= corner, rho - radius,
                       np.where(h >= 0, np.hypot(over, corner - h) - corner, np.maximum(-h, rho - radius)))
        depth = np.maximum(low, h - length)
        k = int(np.argmin(depth))
        s = np.linspace(max(s[max(k - 1, 0)], 0), s[min(k + 1, len(s) - 1)], 2_001)
    return depth.min() <= 2e-6
