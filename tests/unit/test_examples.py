"""The family's truth, checked on the finished solids instead of the generating curves."""

from __future__ import annotations

import json

import numpy as np
import pytest

from examples.demo import write_demo
from examples.family import RECIPES, FamilyPart, draw_layout, make_part
from examples.gaps import channels
from examples.layout import Layout, LayoutError, Plate, check
from examples.walls import LEFT, RIGHT, WallSpec

cq = pytest.importorskip("cadquery")

CASES = [("demo", 0), ("narrow", 1), ("leaning_pair", 1), ("three_walls", 1), ("impeller", 1), ("random", 12)]


@pytest.fixture(scope="module")
def parts() -> dict[tuple[str, int], FamilyPart]:
    return {(name, seed): make_part(seed, name) for name, seed in CASES}


@pytest.fixture(scope="module")
def bridges(parts) -> dict[tuple[str, int], list]:
    """Of every connection: the walls it overlaps, what is left of it outside walls and base, and the walls around."""
    out = {}
    for case, part in parts.items():
        walls, base = [w.solid() for w in part.layout.walls], part.layout.base.solid()
        out[case] = []
        for spec in part.layout.connections:
            solid = spec.solid()
            near = [k for k, w in enumerate(walls) if w.distance(solid) < 1e-6]
            overlaps = {k for k in near if walls[k].intersect(solid).Volume() > 1e-3}
            out[case].append((overlaps, set(near), solid.cut(*(walls[k] for k in near), base), walls))
    return out


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c[0]}-{c[1]}")
def test_every_part_is_one_closed_solid_on_its_seat(parts, case):
    solid = parts[case].shape
    assert solid.isValid() and solid.Volume() > 0 and len(solid.Solids()) == 1
    assert all(shell.wrapped.Closed() for shell in solid.Shells())
    assert solid.BoundingBox().zmin == pytest.approx(0.0, abs=1e-6)
    tops = max(w["z"][1] for w in parts[case].truth["walls"])
    assert solid.BoundingBox().zmax >= tops - 1e-6


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c[0]}-{c[1]}")
def test_every_connection_bridges_exactly_its_two_walls(parts, bridges, case):
    for spec, (overlaps, near, visible, walls) in zip(parts[case].layout.connections, bridges[case], strict=True):
        assert overlaps == near == set(spec.indices)
        assert len(visible.Solids()) == 1, "what is left outside the walls is one piece"
        assert all(visible.distance(walls[k]) < 1e-5 for k in near)


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c[0]}-{c[1]}")
def test_z_range_and_void_below_each_connection(parts, bridges, case):
    part = parts[case]
    base = part.layout.base.solid()
    for truth, (_, _, visible, _) in zip(part.truth["connections"], bridges[case], strict=True):
        box = visible.BoundingBox(1e-4)
        assert (box.zmin, box.zmax) == pytest.approx(truth["z"], abs=0.3)
        assert (visible.distance(base) < 1e-6) == truth["floor_contact"]
        x, y, z = truth["point"]
        floor = part.layout.walls[0].z_floor
        column = [part.shape.isInside(cq.Vector(x, y, h)) for h in np.linspace(z, floor + 0.05, 9)]
        assert column[0] and not all(column), "void somewhere below the middle of the span"
        assert part.shape.isInside(cq.Vector(x, y, floor - 0.1))


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c[0]}-{c[1]}")
def test_gap_is_the_distance_between_the_wall_solids(parts, case):
    part = parts[case]
    for channel in part.truth["channels"]:
        if not channel["primary"]:
            continue
        a, b = (part.layout.walls[k] for k in channel["walls"])
        distance = a.solid().distance(b.solid())
        if channel["border"] and part.layout.name == "impeller":
            assert distance <= channel["gap_min"] * 1.001
        else:
            assert distance == pytest.approx(channel["gap_min"], rel=0.02)


def test_gap_of_parallel_arcs_and_leaning_planes():
    angle = np.linspace(0.3, -0.3, 15) + 0.5 * np.pi
    arcs = [
        WallSpec("curved", r * np.column_stack([np.cos(angle), np.sin(angle)]), 4.0, 10.0, (2.0, 2.0)) for r in (40, 45)
    ]
    assert channels(arcs)[0].gap_min == pytest.approx(3.0, abs=1e-3)
    lean = np.tan(np.radians(10))
    planes = [
        WallSpec("straight", np.array([[-20.0, y], [20.0, y]]), 4.0, 10.0, (2.0, 2.0), (lean, lean)) for y in (0, 6)
    ]
    assert channels(planes)[0].gap_min == pytest.approx(4.0 * np.cos(np.radians(10)), rel=1e-9)


def test_side_normals_point_out_of_the_material():
    wall = WallSpec("curved", np.array([[-10, 0], [-3, 1], [3, 1], [10, 0]], float), 0.0, 8.0, (2.0, 1.0), (0.1, 0.0))
    solid = wall.solid()
    u, v = np.linspace(0.1, 0.9, 5), np.full(5, 0.5)
    for side in (LEFT, RIGHT):
        p, n = wall.side_point(side, u, v), wall.side_normal(side, u, v)
        for q, m in zip(p, n, strict=True):
            assert not solid.isInside(cq.Vector(*(q + 1e-3 * m)), 1e-7)
            assert solid.isInside(cq.Vector(*(q - 1e-3 * m)), 1e-7)


def test_the_leaning_pair_is_undercut_on_one_side_only(parts):
    for wall in parts["leaning_pair", 1].layout.walls:
        up = {side: wall.side_normal(side, np.array([0.5]), np.array([0.5]))[0, 2] for side in (LEFT, RIGHT)}
        assert min(up.values()) < -0.02 < 0.02 < max(up.values())


def test_narrow_is_narrow_and_demo_is_small(parts):
    assert parts["narrow", 1].truth["channels"][0]["gap_min"] == pytest.approx(0.8, rel=0.02)
    demo = parts["demo", 0]
    assert demo.shape.Area() < 9000 and len(demo.truth["walls"]) == 3 and len(demo.truth["connections"]) == 3


def test_fillets_keep_one_solid():
    part = make_part(0, "wavy", fillet=0.8)
    assert part.truth["fillet"] == 0.8 and part.shape.isValid()
    assert "TORUS" in {f.geomType() for f in part.shape.Faces()} or len(part.shape.Faces()) > 30


def test_same_seed_same_bytes(tmp_path):
    first = [p.read_bytes() for p in make_part(3, "narrow").write(tmp_path / "a")]
    again = [p.read_bytes() for p in make_part(3, "narrow").write(tmp_path / "b")]
    assert first == again
    header = first[0].decode().partition("DATA;")[0]
    assert "1970-01-01T00:00:00" in header
    other = make_part(4, "narrow").write(tmp_path / "c")[0].read_bytes()
    assert other != first[0]


def test_the_step_file_reads_back_with_the_same_volume(tmp_path, parts):
    step, truth, setup = parts["demo", 0].write(tmp_path)
    read = cq.importers.importStep(str(step)).val()
    assert read.Volume() == pytest.approx(parts["demo", 0].shape.Volume(), rel=1e-6)
    assert json.loads(truth.read_text())["recipe"] == "demo"
    assert json.loads(setup.read_text())["tools"]


def test_setups_are_valid_and_their_lengths_consistent(tmp_path, parts):
    from schemas.setup import Setup

    setups = [p.setup for p in parts.values()] + [json.loads(write_demo(tmp_path)[1].read_text())]
    for setup in setups:
        Setup.model_validate(setup)
        for tool in setup["tools"]:
            assert 0 < tool["flute_length_mm"] < tool["neck_length_mm"] < tool["stickout_mm"]
            assert tool["neck_diameter_mm"] < tool["diameter_mm"] <= tool["shank_diameter_mm"]


def test_overrides_and_refusals():
    layout = draw_layout(5, walls=3, connections=0, gap=(2.0, 4.0))
    assert len(layout.walls) == 3 and layout.connections == []
    gaps = {g.walls: g.gap_min for g in layout.gaps()}
    assert all(1.99 <= gaps[k, k + 1] <= 4.01 for k in range(2))
    block = WallSpec("straight", np.array([[-20.0, 0.0], [20.0, 0.0]]), 4.0, 8.0, (6.0, 6.0))
    with pytest.raises(LayoutError, match="block"):
        check(Layout("bad", Plate((-30, -10, 30, 10), 4.0), [block]))


def test_every_recipe_is_drawn_for_several_seeds():
    for name in RECIPES:
        for seed in range(2):
            layout = draw_layout(seed, name)
            assert len(layout.walls) >= 2
            if name != "random":
                assert layout.connections, f"{name}-{seed} has no connection"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_random_parts_are_valid(seed):
    part = make_part(seed)
    assert part.shape.isValid() and 2 <= len(part.truth["walls"]) <= 6
