"""Tip limit and touch against the assembly as stacked discs over dense points of the part."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.sampling import sample_surface
from geometry.tool_body import HolderFrustum
from tests.hand_parts import ball, dome, field_of, low_walls, tool
from tests.oracle.naive_drop import lift_of_points
from zones.reach.assembly import Clearances
from zones.reach.tip_field import LOOKUP_STEP, touchable

CLEAR = Clearances(shank=0.2, holder=1.0)
BODIES = {
    "shank": ball(2.0, neck=2.5, shank=4.0),
    "holder": ball(2.0, neck=3.0, shank=3.0, stickout=4.0, holder=(HolderFrustum(6, 14, 5), HolderFrustum(14, 14, 9))),
    "flat": tool(2.0, 0.0, neck=2.0, shank=3.0, stickout=5.0, holder=(HolderFrustum(9, 9, 20),)),
    "bull": tool(3.0, 0.5, neck=2.0, shank=5.0),
}
pytestmark = pytest.mark.slow
MESHES = {"walls": low_walls, "dome": lambda: dome(radius=8.0, size=9.0, n=40)}


def solid_points(mesh):
    """Points so dense on the surface, corners included, that any disc wider than 0.2 mm holds some."""
    return np.vstack([mesh.vertices, sample_surface(mesh, 300.0, seed=3).points])


def slow_limit(points, xy, body, grow):
    """Tip limits of the assembly, its shank and holder made wider by ``grow``: each body a stack of thin discs."""
    out = np.empty(len(xy))
    for k, (x, y) in enumerate(xy):
        best = lift_of_points(points, x, y, body.radius, body.corner_radius)
        parts = [(body.neck_length, body.shank_diameter / 2 + CLEAR.shank, body.shank_diameter / 2 + CLEAR.shank)]
        z = body.stickout
        for seg in body.holder:
            for t in np.linspace(0, 1, 41):
                r = 0.5 * (seg.diameter + t * (seg.diameter_top - seg.diameter)) + CLEAR.holder
                parts.append((z + t * seg.length, r, r))
            z += seg.length
        for height, r, _ in parts:
            best = max(best, lift_of_points(points, x, y, r + grow, 0.0) - height)
        out[k] = best
    return out


@pytest.mark.parametrize("shape", MESHES)
@pytest.mark.parametrize("name", BODIES)
def test_the_tip_limit_is_never_below_the_truth_and_little_above(shape, name):
    mesh, body = MESHES[shape](), BODIES[name]
    field = field_of(mesh, body, clear=CLEAR)
    points = solid_points(mesh)
    rng = np.random.default_rng(5)
    lo, hi = mesh.bounds[0, :2] - 1.5, mesh.bounds[1, :2] + 1.5
    xy = lo + rng.random((60, 2)) * (hi - lo)
    got = field.tips(xy)
    # sampling of the surface alone costs the twin a little height: at most its slope times the spacing
    assert (got >= slow_limit(points, xy, body, 0.0) - 1e-9).all()
    # not more than a look-up cell and one slice of a frustum too careful
    slice_ = max((abs(s.diameter_top - s.diameter) / 12 for s in body.holder), default=0.0)
    wide = slow_limit(points, xy, body, LOOKUP_STEP * np.sqrt(2.0) + slice_ + 0.1)
    assert (got <= np.maximum(wide, slow_limit(points, xy, body, 0.0)) + 0.08).mean() > 0.95


@pytest.mark.parametrize("name", BODIES)
def test_what_is_touchable_is_what_some_tip_of_the_twin_allows(name):
    mesh, body = low_walls(), BODIES[name]
    field = field_of(mesh, body, clear=CLEAR)
    points = solid_points(mesh)
    s = sample_surface(mesh, 0.6, seed=8)
    s = s.subset(s.normals[:, 2] > -0.02)
    by_cutter, by_tool, tips = touchable(field, s.points, s.normals, 0.005)
    assert (by_tool <= by_cutter).all() and by_tool.any() and not by_tool.all()
    free = slow_limit(points, tips[by_tool][:, :2], body, 0.0)
    assert (free <= tips[by_tool][:, 2] + 1e-4).all()
    # a tip that the cutter alone may take, but neither shank nor holder: the twin with a cell more agrees
    stopped = by_cutter & ~by_tool
    limit = slow_limit(points, tips[stopped][:, :2], body, LOOKUP_STEP * np.sqrt(2.0) + 0.7)
    assert (limit > tips[stopped][:, 2] - 1e-6).mean() > 0.95 if stopped.any() else True
