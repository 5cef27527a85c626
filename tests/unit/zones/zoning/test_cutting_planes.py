"""Cutting planes: the neck rule cell by cell, snapping, and sharing walls between two opposite accesses."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import as_part, ball, field_of, samples_of, terraces, view_of
from zones.machinable_area import AreaForm
from zones.model import Decomposition
from zones.plan_view.regions import RegionLocator
from zones.reach.access_view import View, access_rotation, turned, turned_samples
from zones.zoning.cutting_planes import PLANE_MARGIN, snapped
from zones.zoning.zones import build_zones

NOTHING = Decomposition((), (), ())
DOWN = access_rotation((0, 0, -1))


def test_a_plane_through_a_connection_moves_to_just_above_it() -> None:
    assert snapped(5.0, [(4.0, 6.0)]) == 6.0 + PLANE_MARGIN
    assert snapped(3.0, [(4.0, 6.0)]) == 3.0
    assert snapped(6.5, [(4.0, 6.0)]) == 6.5
    # moving it above one may bring it into the next
    assert snapped(5.0, [(5.5, 8.0), (4.0, 6.0)]) == 8.0 + PLANE_MARGIN


@pytest.mark.parametrize("direction", [(0, 0, 1), (0, 0, -2), (1, 0, 0), (-3, 0, 0), (0.2, -0.5, 0.6)])
def test_the_frame_of_an_access_is_right_handed_with_z_along_it(direction) -> None:
    r = access_rotation(direction)
    assert np.allclose(r @ r.T, np.eye(3)) and np.linalg.det(r) == pytest.approx(1.0)
    assert np.allclose(r[2], np.array(direction) / np.linalg.norm(direction))


def test_turning_there_and_back_gives_the_part_back() -> None:
    part = as_part(terraces([0, 10, 24], [0, 12], [[12, 2]]))
    r = access_rotation((0.3, 0.1, 0.8))
    again = turned(turned(part, r), r.T)
    assert np.allclose(again.mesh.vertices, part.mesh.vertices) and np.allclose(again.bounds, part.bounds)
    assert turned(part, np.eye(3)) is part


def slot(height: float):
    """A block with a slot 10 mm wide through its whole height, and samples of the two sides of the slot."""
    mesh = terraces([0, 6, 16, 22], [0, 20], [[height, 0, height]])
    part = as_part(mesh)
    samples = samples_of(mesh, 8.0)
    side = (np.abs(samples.normals[:, 0]) > 0.9) & (samples.points[:, 0] > 5.9) & (samples.points[:, 0] < 16.1)
    return part, samples.subset(side)


def both_sides(part, samples, tools) -> list[View]:
    """The part from +Z and from -Z."""
    out = []
    for name, rotation in (("A1", np.eye(3)), ("A2", DOWN)):
        here, seen = turned(part, rotation), turned_samples(samples, rotation)
        first = view_of(part, samples, {})
        fields = {t.id: field_of(here.mesh, t) for t in tools}
        tree = TriangleTree(here.mesh)
        locator = RegionLocator(here, NOTHING, first.locator.channels, first=name == "A1")
        labels = locator.of(seen.points, seen.normals, seen.face, (samples.points, samples.normals))
        out.append(View(name, rotation, here, tree, tree, seen, labels, fields, locator, np.eye(3)))
    return out


def heights(views, zone) -> np.ndarray:
    """Heights of the samples of a zone in the frame of the first view."""
    return views[0].samples.points[zone.samples, 2]


def test_no_plane_where_the_first_access_gets_the_whole_height() -> None:
    part, samples = slot(14.0)
    zones = build_zones(both_sides(part, samples, [ball(4, neck=30.0)]), NOTHING, 0.02, 0.002)
    assert {z.access for z in zones.zones} == {"A1"} and zones.planes == () and zones.taken.all()


def test_half_height_where_both_get_their_half() -> None:
    part, samples = slot(20.0)
    views = both_sides(part, samples, [ball(4, neck=13.0, shank=12.0)])
    zones = build_zones(views, NOTHING, 0.02, 0.002)
    assert zones.taken.all() and {z.form for z in zones.zones} == {AreaForm.STEEP}
    plane = zones.planes[0]
    assert plane.reason == "between A1 and A2" and plane.height == pytest.approx(10.0, abs=0.1)
    upper, lower = zones.zones
    assert (upper.access, lower.access) == ("A1", "A2")
    assert heights(views, upper).min() >= plane.height > heights(views, lower).max()


def test_a_band_neither_reaches_stays() -> None:
    part, samples = slot(40.0)
    views = both_sides(part, samples, [ball(4, neck=13.0, shank=12.0)])
    zones = build_zones(views, NOTHING, 0.02, 0.002)
    z = samples.points[:, 2]
    # the tip stands the cutter's radius below a contact, so 13 of neck reach 11 deep at the wall
    assert z[~zones.taken].min() == pytest.approx(11.0, abs=0.5) and z[~zones.taken].max() == pytest.approx(29, abs=0.5)
    assert {zone.access for zone in zones.zones} == {"A1", "A2"}


def test_what_only_the_second_access_sees_is_its_own() -> None:
    mesh = terraces([0, 6, 16, 22], [0, 20], [[14, 4, 14]])
    part, samples = as_part(mesh), samples_of(mesh, 6.0)
    floor = samples.subset((samples.normals[:, 2] < -0.9) & (samples.area > 0))
    views = both_sides(part, floor, [ball(4, neck=30.0)])
    zones = build_zones(views, NOTHING, 0.02, 0.002)
    assert {z.access for z in zones.zones} == {"A2"} and zones.taken.all()
    assert {m.access: m.area > 0 for m in zones.mcz} == {"A1": False, "A2": True}
