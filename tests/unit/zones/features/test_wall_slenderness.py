"""High thin walls: thickness and height of walls whose profile is known, one warning a wall."""

from __future__ import annotations

import math

import cadquery as cq
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from tests.decomposition_shapes import box, plate, to_part
from zones.features.decomposition import decompose
from zones.features.wall_slenderness import Slender, slender_walls


def walls_of(shape, ratio: float = 10.0) -> list[Slender]:
    part = to_part(shape)
    return slender_walls(part, TriangleTree(part.mesh), decompose(part).walls, ratio)


def prism(profile: list[tuple[float, float]], length: float = 40.0):
    """A wall along x of a profile in y and z, foot at z = 4."""
    return cq.Workplane("YZ").polyline(profile).close().extrude(length)


def test_an_upright_wall_has_the_thickness_and_height_of_its_box():
    (found,) = walls_of(plate().union(box(40, 1.0, 15, 0, 0, 3)))
    assert found.wall == "W1"
    assert found.thickness == pytest.approx(1.0, abs=1e-6) and found.height == pytest.approx(14.0, abs=1e-6)
    assert found.at[1] == pytest.approx(0.0, abs=1e-6) or found.at[1] == pytest.approx(1.0, abs=1e-6)
    assert 4.0 <= found.at[2] <= 18.0 and 0.0 <= found.at[0] <= 40.0


def test_the_stated_ratio_is_the_border():
    shape = plate().union(box(40, 1.5, 15, 0, 0, 3))  # 14 / 1.5 = 9.33
    assert walls_of(shape, 9.4) == [] and len(walls_of(shape, 9.3)) == 1


def test_a_leaning_wall_is_measured_square_to_itself():
    lean, thick, high = math.radians(20.0), 1.2, 20.0
    shift, wide = high * math.tan(lean), thick / math.cos(lean)
    (found,) = walls_of(plate().union(prism([(0, 4), (wide, 4), (wide + shift, 4 + high), (shift, 4 + high)])))
    assert found.thickness == pytest.approx(thick, rel=1e-3) and found.height == pytest.approx(high, abs=1e-6)


def test_a_tapered_wall_counts_by_its_middle():
    """2 mm at the foot, 1 at the top, 16 high: rays from either side are 1.5 in the middle, to the lean of 1.8 deg."""
    (found,) = walls_of(plate().union(prism([(0, 4), (2, 4), (1.5, 20), (0.5, 20)])))
    assert found.thickness == pytest.approx(1.5, rel=0.05) and found.height == pytest.approx(16.0, abs=1e-6)


def test_a_low_thin_stretch_of_a_high_wall_is_not_thin():
    """2 mm over 16 of height, and 1 mm where it is 6 high: 8 and 6, though 16 over 1 would be 16."""
    shape = plate().union(box(20, 2.0, 17, 0, 0, 3)).union(box(20, 1.0, 7, 20, 0.5, 3))
    assert walls_of(shape) == []


def test_each_wall_is_named_once_and_a_ring_is_cut_in_one_place():
    ring = cq.Workplane().circle(14.0).circle(13.2).extrude(14.0).translate((25, 5, 3))
    found = walls_of(plate(80, 50).union(ring).union(box(20, 0.9, 14, 0, -14, 3)).union(box(20, 4, 14, 45, -14, 3)))
    assert len(found) == 2 and len({s.wall for s in found}) == 2
    thick = sorted(s.thickness for s in found)
    assert thick[0] == pytest.approx(0.8, abs=0.03) and thick[1] == pytest.approx(0.9, abs=1e-6)  # 0.03 mm: the chord
    assert all(s.height == pytest.approx(13.0, abs=0.01) for s in found)
