"""Walls, connections and channels of hand-made parts: exact counts, gaps, roles."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from geometry.part import Part
from tests.decomposition_shapes import SHAPES, to_part
from zones.features.decomposition import decompose
from zones.model import Decomposition

pytest.importorskip("cadquery")


@cache
def part_of(name: str) -> Part:
    return to_part(SHAPES[name][0]())


@cache
def found(name: str) -> Decomposition:
    return decompose(part_of(name))


@pytest.mark.parametrize("name", SHAPES)
def test_counts_are_exact(name: str) -> None:
    d = found(name)
    assert (len(d.walls), len(d.connections), len(d.channels)) == SHAPES[name][1]


@pytest.mark.parametrize("name", SHAPES)
def test_every_face_has_one_role(name: str) -> None:
    part, d = part_of(name), found(name)
    assert sorted(d.face_role) == [f.number for f in part.faces]
    assert set(d.face_role.values()) <= {"wall", "connection", "floor", "base", "fillet", "free"}
    owned = [f for w in d.walls for f in w.faces] + [f for c in d.connections for f in c.faces]
    assert len(owned) == len(set(owned))
    assert {f for f, r in d.face_role.items() if r in ("wall", "connection")} == set(owned)


def test_gap_thickness_and_heights_of_a_pair() -> None:
    d = found("square bar")
    assert d.channels[0].gap_min == pytest.approx(8.0, rel=1e-6)
    assert d.channels[0].walls == ("W1", "W2")
    for wall in d.walls:
        assert wall.thickness == pytest.approx(2.0, rel=1e-6)
        assert (wall.z_bottom, wall.z_top) == pytest.approx((4.0, 17.0))
    assert (d.connections[0].z_bottom, d.connections[0].z_top) == pytest.approx((9.0, 12.0))


def test_strut_inside_a_ring_joins_two_stretches_of_one_wall() -> None:
    d = found("ring with a strut")
    assert d.connections[0].walls == ("W1", "W1")
    assert d.channels[0].walls == ("W1", "W1")
    assert d.channels[0].gap_min == pytest.approx(36.0, rel=2e-3)


def test_gap_of_wavy_walls_equals_dense_rays_between_the_curves() -> None:
    """The sides are one curve, nearly 2 sin(x / 8), 8 apart along y: the normal ray is shortest on the slope."""
    x = np.linspace(0, 50, 2001)
    slope = 0.25 * np.cos(x / 8)
    nx, ny = -slope / np.hypot(slope, 1), 1 / np.hypot(slope, 1)
    low, high = np.zeros_like(x), np.full_like(x, 20.0)
    for _ in range(60):
        t = 0.5 * (low + high)
        short = 2 * np.sin(x / 8) + t * ny < 8 + 2 * np.sin((x + t * nx) / 8)
        low, high = np.where(short, t, low), np.where(short, high, t)
    inside = (x + t * nx >= 0) & (x + t * nx <= 50)
    assert found("wavy walls").channels[0].gap_min == pytest.approx(t[inside].min(), rel=2e-3)


def test_bar_leaves_no_trace_in_the_gap() -> None:
    assert found("fillets at a bar").channels[0].gap_min == pytest.approx(found("two walls").channels[0].gap_min)


def test_connection_touching_the_floor_keeps_both_walls() -> None:
    assert found("bar from the floor").connections[0].walls == ("W1", "W2")


def test_fillets_get_their_own_role() -> None:
    for name in ("fillets at the foot", "fillets at a bar", "fillets at a round bar"):
        assert "fillet" in found(name).face_role.values()
    assert "fillet" not in found("rounded tops").face_role.values()


def test_seat_is_the_lowest_plane_and_floor_looks_up() -> None:
    part, d = part_of("two walls"), found("two walls")
    assert len(d.seat) == 1
    seat = part.mesh.triangles[part.mesh.face_ids == d.seat[0]]
    assert np.allclose(seat[..., 2], 0.0)
    floors = [f for f, r in d.face_role.items() if r == "floor"]
    assert floors and all(np.allclose(part.mesh.triangles[part.mesh.face_ids == f][..., 2], 4.0) for f in floors)


def test_part_without_walls_says_so() -> None:
    assert any("no wall" in w for w in found("block").warnings)


def test_flanks_of_a_short_stem_belong_to_the_fork_and_are_no_chamfers() -> None:
    d = found("fork with a short stem")
    assert len(d.connections[0].faces) == 8 and "fillet" not in d.face_role.values()
