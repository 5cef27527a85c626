"""Rays that are level but for rounding, and moves that plunge: where one slope over the other costs all digits."""

from __future__ import annotations

import math

import pytest

from verify.kernels.sweep import cylinder_interval


@pytest.mark.parametrize("tilt", [0.0, 1e-12, -4.4e-8, 3e-7, -1e-5, 1e-3])
def test_a_plunge_beside_a_wall_stays_beside_it(tilt: float) -> None:
    """A flat end of radius 2 goes straight down 2.33 mm from the point: the ray meets it 0.361 mm out."""
    nx, ny = -0.0370859275, 0.999312080
    qx, qy, qz = 0.968064, -2.120989, 9.424108 - 16.7
    lo, hi = cylinder_interval(qx, qy, qz, nx, ny, tilt, 0.0, 0.0, -8.8, 2.0, 0.0, 12.0)
    a, b, c = nx * nx + ny * ny, qx * nx + qy * ny, qx * qx + qy * qy - 4.0
    root = math.sqrt(b * b - a * c)
    assert lo == pytest.approx((-b - root) / a, abs=1e-9)
    assert hi == pytest.approx((-b + root) / a, abs=1e-9)
