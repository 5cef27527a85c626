"""One zone is one connected place in plan: pockets apart are regions apart, whatever bridges them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import shapely

from geometry.part import Part
from geometry.sampling import SurfaceSamples, sample_surface
from tests.decomposition_shapes import box, outline, plate, to_part
from zones.features.decomposition import decompose
from zones.model import Decomposition
from zones.plan_view.categories import Categories
from zones.plan_view.channel_plan import ChannelPlan
from zones.plan_view.free_places import MATERIAL, LevelPlaces
from zones.plan_view.plan_cover import FACES_UP, cover_border
from zones.plan_view.plan_map import PlanMap
from zones.plan_view.regions import Labels, Region, RegionLocator, base_of, connections_of, place_of

pytest.importorskip("cadquery")


def tray(webs, *, bar=False):
    """A box 60 x 40 with sides 2 thick and 20 high on a floor at 4, webs across it at x, each with its height."""
    part = box(60, 40, 24, 0, 0, 0).cut(box(56, 36, 20, 2, 2, 4))
    for x, height in webs:
        part = part.union(box(2, 37, height + 1, x, 1.5, 3))
    return part.union(box(3, 37, 3, 10, 1.5, 14)) if bar else part


@cache
def measured(webs, bar=False) -> tuple[Part, Decomposition, ChannelPlan, SurfaceSamples, Labels]:
    part = to_part(tray(webs, bar=bar))
    d = decompose(part)
    plan = ChannelPlan.of(part, d)
    samples = sample_surface(part.mesh, 6.0, seed=4)
    return part, d, plan, samples, RegionLocator(part, d, plan).of(samples.points, samples.normals, samples.face)


def spans(names, samples, web) -> dict[str, bool]:
    """By region: whether it has points on both sides of the plane x = web between its walls and on its floor."""
    inner = (samples.points[:, 0] > 2.5) & (samples.points[:, 0] < 57.5) & (samples.points[:, 1] > 1.99)
    inner &= (samples.points[:, 1] < 38.01) & (samples.points[:, 2] < 23.99)
    return {n: bool(np.ptp(np.sign(samples.points[(names == n) & inner, 0] - web)) > 1)
            for n in set(names[inner].tolist()) if n != "top"}


def test_pockets_apart_are_regions_apart():
    *_, plan, samples, labels = measured(((29.0, 20.0),))
    names = labels.names
    assert not any(spans(names, samples, 30.0).values())
    grounds = {r.ground for r in labels.regions}
    assert {g for g in grounds if g.startswith("floor")} >= {"floor.1", "floor.2"}
    per = {b: sorted(g for g in grounds if base_of(g) == b and g.startswith("H")) for b in plan.names}
    assert per == {"H1": ["H1.1", "H1.2"], "H2": ["H2.1", "H2.2"]}
    # numbered from left to right, and both pockets of one size
    place = np.array([r.place for r in labels.regions])[labels.code]
    wall = np.char.startswith(names.astype(str), "H")
    assert samples.points[place == 1, 0].max() < 30 < samples.points[place == 2, 0].min()
    sizes = [samples.area[wall & (place == k)].sum() for k in (1, 2)]
    assert sizes[0] == pytest.approx(sizes[1], rel=0.01) and sizes[0] == pytest.approx(2 * (27 + 36) * 20, rel=0.02)


def test_a_rib_below_the_level_of_the_channel_parts_nothing():
    _, d, plan, samples, labels = measured(((29.0, 3.0),))
    assert [c.walls for c in d.channels] == [("W1", "W1")]
    assert {r.ground for r in labels.regions} == {"H1", "W1", "floor", "top"}
    assert spans(labels.names, samples, 30.0) == {"H1": True, "floor": True}


def test_a_bar_parts_nothing():
    *_, one = measured(((29.0, 20.0),))
    *_, two = measured(((29.0, 20.0),), True)
    assert any(r.connections for r in two.regions)
    inside = ({r.ground for r in found.regions if r.base[0] in "Hf"} for found in (one, two))
    assert next(inside) == next(inside)


def test_three_pockets_each_have_their_own_profile():
    *_, plan, _, labels = measured(((19.0, 20.0), (39.0, 20.0)))
    found = Categories(plan)
    grounds = {r.ground for r in labels.regions if r.base.startswith("H")}
    assert sorted(place_of(g) for g in grounds) == [0, 0, 0, 1, 2, 3]
    for g in grounds:
        assert all(not s.profile.closed for s in found.of(g).sides)  # no pocket has the whole ring


def test_names_say_base_place_and_connections():
    r = Region("H1", ("C2",), ("C10", "C3"), 2)
    assert r.name == "H1.2 over C2 under C10 C3" and r.ground == "H1.2"
    assert (base_of(r.name), place_of(r.name), connections_of(r.name)) == ("H1", 2, ["C2", "C10", "C3"])
    assert Region("floor").name == "floor" and place_of("floor") == 0 and connections_of("C1") == ["C1"]


def test_places_share_edges_not_points():
    # two squares of air that touch in a corner of a chequered block
    block = shapely.union_all([shapely.box(0, 0, 9, 9).difference(shapely.box(1, 1, 8, 8)),
                               shapely.box(1, 1, 4, 4), shapely.box(4, 4, 8, 8)])
    places = LevelPlaces.of(directed(block))
    a, b, outside, inside = places.at(np.array([[6.0, 2.0], [2.0, 6.0], [-3.0, 4.0], [2.0, 2.0]])).tolist()
    assert {a, b} == {1, 2} and outside == 0 and inside == MATERIAL
    assert b == 1  # it begins farther left
    assert places.nearest(np.array([[2.0, 3.9]]), (1, 2)).tolist() == [1]


def test_where_a_web_ends_at_leaning_walls_is_no_place():
    # the walls lean away from each other, so the end of the web is a hole in what they cover
    walls = [outline("YZ", [(y, 3), (y + 2, 3), (y + 2 + s, 17), (y + s, 17)], 50, (0, 0, 0))
             for y, s in ((-13, -6), (0, 6))]
    part = to_part(plate(60, 60).union(walls[0]).union(walls[1]).union(box(12, 20.6, 3, 18, -15.8, 11)))
    d = decompose(part)
    assert len(d.connections) == 1
    plan = ChannelPlan.of(part, d)
    assert all(r.own == (0,) and set(r.places.outlines) == {0} for r in plan.parting.regions.values())


def directed(shape) -> np.ndarray:
    """Borders of polygons, what they cover to the left."""
    rings = [np.asarray(r.coords) for p in shapely.get_parts(shape)
             for q in [shapely.orient_polygons(p)] for r in (q.exterior, *q.interiors)]
    return np.concatenate([np.stack([r[:-1], r[1:]], axis=1) for r in rings])


def test_what_stands_above_a_level():
    # an upright triangle roof: z from 0 at x = 0 to 10 at x = 10
    roof = np.array([[0.0, 0, 0], [10, 0, 10], [10, 5, 10], [0, 5, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    for level in (2.0, 7.0):
        covered = PlanMap.of_cover("roof", cover_border(roof, faces, level)).shape("roof")
        assert covered.area == pytest.approx(5 * (10 - level), abs=0.01)
        assert covered.bounds == pytest.approx((level, 0.0, 10.0, 5.0), abs=2e-3)
    assert not len(cover_border(roof, faces, 11.0))
    assert PlanMap.of_cover("roof", cover_border(roof, faces, 11.0)).shape("roof").is_empty


@pytest.mark.parametrize("level", [3.0, 9.0, 15.5, 19.0])
def test_what_a_part_covers_is_the_union_of_its_triangles(level):
    part = to_part(tray(((20.0, 9.5), (40.0, 25.0)), bar=True).union(
        outline("YZ", [(8, 2), (12, 2), (19, 30), (17, 30)], 8, (25, 0, 0))))
    mesh = part.mesh
    up = mesh.faces[mesh.normals[:, 2] > FACES_UP]
    found = PlanMap.of_cover("part", cover_border(mesh.vertices, up, level)).shape("part")
    pieces = []
    for t in mesh.vertices[up]:
        ring = [t[k] for k in range(3)]
        kept = []
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):  # Sutherland and Hodgman against the level
            kept += [a] if a[2] > level else []
            if (a[2] > level) != (b[2] > level):
                kept.append(a + (level - a[2]) / (b[2] - a[2]) * (b - a))
        if len(kept) > 2:
            pieces.append(shapely.Polygon([p[:2] for p in kept]))
    wanted = shapely.union_all(pieces).buffer(0)
    assert wanted.area > 100
    assert found.symmetric_difference(wanted).area < 2e-3 * wanted.length


def test_folds_in_plan_do_not_matter():
    # a steep strip whose triangles look up and down by turns, with its upper border at y = 1
    x = np.linspace(0, 10, 11)
    low = np.stack([x, np.where(np.arange(11) % 2, 0.02, -0.02), np.zeros(11)], axis=1)
    top = np.stack([x, np.where(np.arange(11) % 2, -0.01, 0.01), np.full(11, 5.0)], axis=1)
    back = np.stack([x, np.ones(11), np.full(11, 5.0)], axis=1)
    v = np.concatenate([low, top, back])
    k = np.arange(10)
    bands = [np.concatenate([np.stack([o + k, o + k + 1, o + k + 12], axis=1),
                             np.stack([o + k, o + k + 12, o + k + 11], axis=1)]) for o in (0, 11)]
    covered = PlanMap.of_cover("strip", cover_border(v, np.concatenate(bands))).shape("strip")
    assert covered.geom_type == "Polygon" and not covered.interiors
    assert covered.area == pytest.approx(10.0, abs=0.15)
