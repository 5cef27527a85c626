"""Regions of points: channels, outsides, and cells over and under connections, against rays straight up and down."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.rays import first_hits
from geometry.part import Part
from geometry.sampling import SurfaceSamples, sample_surface
from tests.decomposition_shapes import SHAPES, to_part
from zones.features.decomposition import decompose
from zones.model import Decomposition
from zones.plan_view.categories import Categories
from zones.plan_view.channel_plan import ChannelPlan
from zones.plan_view.channel_strips import ChannelStrip, spread
from zones.plan_view.regions import Labels, RegionLocator

pytest.importorskip("cadquery")


@cache
def measured(name: str) -> tuple[Part, Decomposition, ChannelPlan, SurfaceSamples, Labels]:
    part = to_part(SHAPES[name][0]())
    d = decompose(part)
    plan = ChannelPlan.of(part, d)
    samples = sample_surface(part.mesh, 12.0, seed=4)
    return part, d, plan, samples, RegionLocator(part, d, plan).of(samples.points, samples.normals, samples.face)


def area_of(name: str, region: str) -> float:
    *_, samples, labels = measured(name)
    return float(samples.area[labels.names == region].sum())


def test_the_sides_that_look_at_each_other_are_the_channel() -> None:
    part, d, *_, samples, labels = measured("two walls")
    inner = (np.abs(samples.normals[:, 1]) > 0.99) & (samples.points[:, 1] > -8.01) & (samples.points[:, 1] < 0.01)
    outer = (np.abs(samples.normals[:, 1]) > 0.99) & ((samples.points[:, 1] < -9.9) | (samples.points[:, 1] > 1.9))
    outer &= (samples.points[:, 2] > 4.01) & (np.abs(samples.points[:, 1]) < 10.1)
    assert set(labels.names[inner]) == {"H1"}
    assert set(labels.names[outer]) == {"W1", "W2"}
    assert {"top", "floor"} <= set(labels.names)


def test_a_bar_makes_cells_over_and_under_it_as_wide_as_it_is() -> None:
    # the bar is 4 wide and 3 high, its top at 12 of walls that end at 17, its underside at 9 over a floor at 4
    part, d, *_ = measured("square bar")
    c = d.connections[0]
    width = float(np.ptp(part.mesh.triangles[np.isin(part.mesh.face_ids, c.faces)][:, :, 0]))
    assert area_of("square bar", "H1 over C1") == pytest.approx(2 * width * (17 - c.z_top), rel=0.06)
    assert area_of("square bar", "H1 under C1") == pytest.approx(2 * width * (c.z_bottom - 4), rel=0.06)
    *_, samples, labels = measured("square bar")
    floor = (labels.names == "floor under C1") & (samples.normals[:, 2] > 0.99)
    assert float(samples.area[floor].sum()) == pytest.approx(8 * width, rel=0.06)


@pytest.mark.parametrize("name", ["square bar", "two bars over each other", "fork", "blades joined by struts"])
def test_cells_agree_with_rays_along_the_access(name: str) -> None:
    part, d, _, samples, labels = measured(name)
    faces = {f: c.id for c in d.connections for f in c.faces}
    tree = TriangleTree(part.mesh)
    start = samples.points + 0.02 * samples.normals
    under = np.array([bool(labels.regions[k].under) for k in labels.code])
    over = np.array([bool(labels.regions[k].over) for k in labels.code])
    wrong = 0.0
    for way, said in (((0.0, 0.0, 1.0), under), ((0.0, 0.0, -1.0), over)):
        _, hit = first_hits(tree, start, way)
        met = np.array([h >= 0 and int(part.mesh.face_ids[h]) in faces for h in np.asarray(hit).tolist()])
        own = np.isin(samples.face, list(faces))
        wrong += float(samples.area[(met & ~said) & ~own].sum())
    assert wrong <= 1e-3 * float(samples.area.sum())


def test_levels_of_connections_stack() -> None:
    *_, samples, labels = measured("two bars over each other")
    assert any(r.over and r.under for r in labels.regions)
    between = [r for r in labels.regions if r.over and r.under][0]
    assert between.kind == "SCZI" and between.name in ("H1 over C1 under C2", "H1 over C2 under C1")


def test_a_ring_faces_itself() -> None:
    _, d, plan, *_ = measured("ring with a strut")
    assert d.channels[0].walls == ("W1", "W1")
    assert area_of("ring with a strut", "H1") > 0 and area_of("ring with a strut", "W1") > 0
    assert {c.closed for c in plan.curves} == {True}
    inner, outer = Categories(plan).of("H1"), Categories(plan).of("W1")
    assert [s.profile.type for s in inner.sides] == ["C4"] and [s.profile.type for s in outer.sides] == ["C1"]


def test_straight_walls_have_no_profile_and_are_simple() -> None:
    *_, plan, _, _ = measured("two walls")
    found = Categories(plan).of("H1")
    assert [s.profile.type for s in found.sides] == [None, None] and found.rank == 0
    assert Categories(plan).of("floor").profile is None


def test_every_point_has_one_region_whatever_the_view() -> None:
    part, d, plan, samples, labels = measured("square bar")
    assert (labels.code >= 0).all() and len(labels.code) == len(samples)
    flip = np.diag([1.0, -1.0, -1.0])
    from zones.reach.access_view import turned, turned_samples

    here, seen = turned(part, flip), turned_samples(samples, flip)
    other = RegionLocator(here, d, plan, first=False).of(seen.points, seen.normals, seen.face,
                                                    (samples.points, samples.normals))
    base = np.array([labels.regions[k].base for k in labels.code])
    assert (np.array([other.regions[k].base for k in other.code]) == base).all()
    swapped = [(labels.regions[a].over, labels.regions[a].under) == (other.regions[b].under, other.regions[b].over)
               for a, b in zip(labels.code, other.code, strict=True)]
    assert np.mean(swapped) > 0.999


def test_rays_start_evenly_and_point_to_the_left() -> None:
    points, normals = spread(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]), False, 0.5)
    assert len(points) == 15 and np.allclose(np.diff(points[:7, 0]), 0.5)
    assert np.allclose(normals[0], [0, 1]) and np.allclose(normals[-1], [-1, 0])
    ring, _ = spread(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]), True, 0.5)
    assert not np.allclose(ring[0], ring[-1])


def test_a_strip_is_as_wide_as_its_rays_are_long() -> None:
    x = np.linspace(0, 5, 6)
    strip = ChannelStrip("H1", np.column_stack([x, 0 * x]), np.column_stack([x, 0 * x + 2]))
    assert strip.area.area == pytest.approx(10.0) and np.allclose(strip.centre_line[:, 1], 1.0)
