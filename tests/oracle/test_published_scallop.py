"""The thesis understood: its passes come out of its measure, and its measure calls a slope along the feed scallop."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from examples.family.thesis import ThesisSurface, surface
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from tests.oracle.published_scallop import published_passes, published_scallop

SLOPE = 0.2  # of the surfaces at their borders
# Passes of tables 4.5 and A.1 at uv 0.025; the 189 stands apart from the five others and from what comes out here.
CASES = [
    (ThesisSurface.CONCAVE, 6.35, 0.130, 83), (ThesisSurface.CONVEX, 6.35, 0.130, 83),
    pytest.param(ThesisSurface.CONCAVE, 1.5875, 0.035, 211, marks=pytest.mark.slow),
    pytest.param(ThesisSurface.CONVEX, 1.5875, 0.035, 211, marks=pytest.mark.slow),
]


@cache
def facets(kind):
    return TriangleTree(surface(kind).discretised(0.025, 0.025))


def test_the_mended_tables_have_the_area_the_thesis_prints():
    for kind in (ThesisSurface.CONCAVE, ThesisSurface.CONVEX):
        areas = [surface(kind).discretised(du, du).areas.sum() for du in (0.025, 0.05, 0.1)]
        assert np.abs(np.array(areas) - [2563.455, 2563.437, 2563.365]).max() < 6e-4
    # printed: 2533.631; the freeform table as printed is another surface than the one that was cut
    assert surface(ThesisSurface.FREEFORM).discretised(0.025, 0.025).areas.sum() == pytest.approx(2573.252, abs=1e-3)


@pytest.mark.parametrize(("kind", "radius", "scallop", "printed"), CASES)
def test_pass_counts_of_the_thesis(kind, radius, scallop, printed):
    assert len(published_passes(facets(kind), radius, scallop)) == pytest.approx(printed, rel=0.05)


@pytest.mark.parametrize("kind", [ThesisSurface.CONCAVE, pytest.param(ThesisSurface.CONVEX, marks=pytest.mark.slow)])
def test_the_middle_radius_hangs_on_half_a_micron(kind):
    """159 and 161 are printed. What the artefact leaves of 0.065 mm is 0.002 mm, so 0.0005 mm more take off 10 %."""
    exact = len(published_passes(facets(kind), 3.175, 0.065))
    published = {ThesisSurface.CONCAVE: 159, ThesisSurface.CONVEX: 161}[kind]
    assert len(published_passes(facets(kind), 3.175, 0.0655)) <= published <= exact
    assert exact == pytest.approx({ThesisSurface.CONCAVE: 159, ThesisSurface.CONVEX: 161}[kind], rel=0.07)


@pytest.mark.parametrize("radius", [1.5875, 3.175, 6.35])
@pytest.mark.parametrize("step", [1e-3, 0.3])
def test_on_a_slope_along_the_feed_the_measure_counts_what_no_pass_can_remove(radius, step):
    z = SLOPE * 100.0
    plane = TriangleMesh([[0, 0, 0], [100, 0, z], [100, 100, z], [0, 100, 0]], [[0, 1, 2], [0, 2, 3]])
    measured = published_scallop(TriangleTree(plane), np.array([40.0, 50.0]), 50.0, np.full(2, step), radius)
    lean = np.hypot(1.0, SLOPE)  # 1 / cos of the slope
    true = radius - np.sqrt(radius**2 - step**2 / 4)
    assert np.abs(measured - (radius * (lean - 1.0) + true)).max() < 1e-9


@pytest.mark.parametrize(("radius", "excessive", "fine"),
                         [(1.5875, 0.030, 0.035), (3.175, 0.060, 0.065), (6.35, 0.125, 0.130)])
def test_the_least_scallop_of_the_thesis_is_that_artefact(radius, excessive, fine):
    """Between the scallops the thesis finds excessive and fine lies the gap of a slope of 0.2, whatever the step."""
    gap = radius * (np.hypot(1.0, SLOPE) - 1.0)
    assert excessive < gap < fine
    x = np.arange(3.0, 48.0)
    for kind in (ThesisSurface.CONCAVE, ThesisSurface.CONVEX):
        measured = published_scallop(facets(kind), x, 25.0, np.full(len(x), 1e-3), radius)
        assert measured.max() == pytest.approx(gap, rel=0.05)


def test_no_scallop_below_it_leads_on():
    passes = published_passes(facets(ThesisSurface.CONCAVE), 1.5875, 0.030, most=60)
    assert len(passes) == 60 and np.diff(passes[-10:]).max() < 0.01
