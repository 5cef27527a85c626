"""Facets leave a surface with the square of their steps."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.passes.faceting import facet_deviation
from examples.family.thesis import Kind, surface


@pytest.mark.parametrize("kind", Kind)
def test_the_deviation_falls_with_the_square_of_the_step(kind):
    steps = 2.0 / np.array([40, 56, 80])
    s = surface(kind)
    worst = [facet_deviation(s, s.discretised(step, step)).largest for step in steps]
    assert abs(np.polyfit(np.log(steps), np.log(worst), 1)[0] - 2.0) < 0.1
