"""Open and closed zones: read off the geometry, so that congruent channels get one verdict."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import pytest

from geometry.part import Part
from geometry.sampling import joined, sample_borders, sample_surface
from tests.decomposition_shapes import box, to_part
from tests.hand_parts import as_part, ball, field_of, samples_of, terraces, tool, view_of
from zones.features.decomposition import decompose
from zones.kernels.flood import escape_heights
from zones.machinable_area import AreaForm
from zones.model import Decomposition
from zones.plan_view.regions import base_of
from zones.reach.openness import escape_field, open_share
from zones.reach.tip_field import TipField
from zones.zoning.zones import build_zones, is_open


def escapes(height):
    height = np.ascontiguousarray(height, dtype=np.float64)
    return escape_heights(height, np.argsort(height, axis=None, kind="stable"))


def slow_escapes(height):
    """Heights are let fall along the steepest way out until none changes."""
    out = np.full(np.array(height.shape) + 2, -np.inf)
    out[1:-1, 1:-1] = np.inf
    while True:
        least = np.minimum.reduce([out[:-2, 1:-1], out[2:, 1:-1], out[1:-1, :-2], out[1:-1, 2:]])
        new = np.maximum(height, least)
        if np.array_equal(new, out[1:-1, 1:-1]):
            return new
        out[1:-1, 1:-1] = new


@pytest.mark.parametrize("seed", range(6))
def test_escape_heights_are_those_of_the_slow_way(seed):
    rng = np.random.default_rng(seed)
    height = rng.integers(0, 8, (23, 17)).astype(float) if seed % 2 else rng.normal(size=(14, 31))
    height[rng.random(height.shape) < 0.05] = np.inf
    np.testing.assert_array_equal(escapes(height), slow_escapes(height))


def test_a_bowl_with_a_lip():
    height = np.full((7, 9), 5.0)
    height[2:5, 2:6] = 1.0
    height[3, 6:] = 2.5  # a groove through the lip
    out = escapes(height)
    assert (out[2:5, 2:6] == 2.5).all() and (out[0] == 5.0).all() and out[3, 8] == 2.5


def share_of(mesh, body, inside):
    """Share of the wall area inside a box that is open."""
    field = field_of(mesh, body)
    samples = samples_of(mesh, 12.0)
    view = view_of(as_part(mesh), samples, {body.id: field})
    zones = [z for z in build_zones([view], Decomposition((), (), ()), 0.02, 0.002).zones if z.form is AreaForm.STEEP]
    rows, tips = (np.concatenate([getattr(z, a) for z in zones]) for a in ("samples", "tips"))
    p = samples.points[rows]
    mine = ((p[:, :2] > inside[0]) & (p[:, :2] < inside[1])).all(axis=1)
    return open_share(field, tips[mine], tips[mine, 2], samples.area[rows[mine]])


def test_a_groove_is_open_down_to_its_sill():
    # a groove 8 wide and 6 deep between blocks; at one end a sill 2 high, the other end is walled up
    mesh = terraces([0, 4, 24, 26], [0, 6, 14, 20], [[10, 10, 10], [10, 4, 6], [10, 10, 10]])
    share = share_of(mesh, tool(4.0, 0.0), ((3.9, 5.9), (23.0, 14.1)))
    assert share == pytest.approx(4.0 / 6.0, abs=0.04)  # above the sill all can leave, below it none


def test_a_pocket_is_closed_and_a_channel_open():
    pocket = terraces([0, 4, 16, 20], [0, 4, 16, 20], [[8, 8, 8], [8, 2, 8], [8, 8, 8]])
    channel = terraces([0, 4, 16, 20], [0, 4, 16, 20], [[8, 2, 8], [8, 2, 8], [8, 2, 8]])
    for body in (ball(4.0), tool(3.0, 0.0)):
        assert share_of(pocket, body, ((3.9, 3.9), (16.1, 16.1))) < 0.01
        assert share_of(channel, body, ((3.9, -0.1), (16.1, 20.1))) > 0.99


def hub(angle: float, closed: bool) -> Part:
    """Eight equal channels between eight blades on a hub with a boss; a ring round all of them where ``closed``."""
    import cadquery as cq

    part = cq.Workplane().circle(16).extrude(3).union(cq.Workplane().circle(3.5).extrude(12))
    for k in range(8):
        part = part.union(box(9.5, 1.2, 9, 3, -0.6, 2).rotate((0, 0, 0), (0, 0, 1), 45 * k + angle))
    if closed:
        part = part.union(cq.Workplane().circle(13.5).circle(12).extrude(11))
    return to_part(part)


@pytest.mark.parametrize(("angle", "closed", "seed"), [(3.0, False, 1), (17.3, False, 2), (3.0, True, 3)])
def test_eight_congruent_channels_get_one_verdict(angle, closed, seed):
    pytest.importorskip("cadquery")
    part = hub(angle, closed)
    d = decompose(part)
    mesh = part.mesh
    up = np.flatnonzero((mesh.normals[:, 2] > -0.02) & (mesh.triangles[:, :, 2].min(axis=1) > 2.9))
    samples = joined([sample_surface(mesh, 25.0, seed=seed, triangles=up), sample_borders(mesh, 0.2, 0.0, up)])
    bodies = [tool(3.0, 0.0, "T1"), ball(2.0, "T2"), ball(1.0, "T3")]
    fields: dict[str, TipField] = {b.id: field_of(mesh, b) for b in bodies}
    view = view_of(part, samples, fields, d)
    verdicts = defaultdict(dict)
    for z in build_zones([view], d, 0.02, 0.003).zones:
        if base_of(z.region)[0] == "H" and z.form is AreaForm.STEEP:
            verdicts[z.tool.id][z.region] = is_open(z, fields[z.tool.id], samples.area)
    assert max(len(v) for v in verdicts.values()) >= 8
    for tool_id, v in verdicts.items():
        assert set(v.values()) == {not closed}, tool_id


def test_the_escape_field_is_never_below_the_tip_limit_of_the_best_node_near():
    field = field_of(terraces([0, 4, 16, 20], [0, 4, 16, 20], [[8, 8, 8], [8, 2, 8], [8, 8, 8]]), ball(4.0))
    out = escape_field(field)
    assert out is escape_field(field) and out.shape == field.height.shape
    i, j = field.lattice.cells(np.array([[10.0, 10.0], [-3.0, 10.0]]))
    assert out[i[0], j[0]] == pytest.approx(8.0, abs=1e-6) and out[i[1], j[1]] < 0.1
