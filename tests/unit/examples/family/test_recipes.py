"""The family's truth, checked on the finished solids instead of the generating curves."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest
from shapely.geometry import Polygon, box

from examples.demo import write_demo
from examples.family.freewall import FreeWall
from examples.family.gaps import channels
from examples.family.joins import fork, join, within_hub
from examples.family.layout import HubDisc, LayoutError, PartLayout, Plate, WindowSpec, check
from examples.family.profiles import BENDS, OPEN_TYPES, DrawnProfile, bends, clear, draw_closed, draw_open, skew, spline
from examples.family.recipes import NUMBERS, RECIPES, FamilyPart, draw_layout, make_part
from examples.family.walls import LEFT, RIGHT, WallSpec

cq = pytest.importorskip("cadquery")

EVERY_DAY = [("narrow", 1), ("leaning_pair", 1)]
CASES = [pytest.param(c, id=f"{c[0]}-{c[1]}", marks=() if c in EVERY_DAY else pytest.mark.slow)
         for c in (("demo", 0), *EVERY_DAY, ("three_walls", 1), ("impeller", 1), ("random", 12))]


@cache
def part_of(case: tuple[str, int]) -> FamilyPart:
    name, seed = case
    return make_part(seed, name)


@cache
def bridges_of(case: tuple[str, int]) -> list:
    """Of every connection: the walls it overlaps, what is left of it outside walls and base, and the walls around."""
    layout, out = part_of(case).layout, []
    walls, base = [w.solid() for w in layout.walls], layout.base.solid()
    for spec in layout.connections:
        solid = spec.solid()
        near = [k for k, w in enumerate(walls) if w.distance(solid) < 1e-6]
        overlaps = {k for k in near if walls[k].intersect(solid).Volume() > 1e-3}
        out.append((overlaps, set(near), solid.cut(*(walls[k] for k in near), base), walls))
    return out


@pytest.mark.parametrize("case", CASES)
def test_every_part_is_one_closed_solid_on_its_seat(case):
    solid = part_of(case).shape
    assert solid.isValid() and solid.Volume() > 0 and len(solid.Solids()) == 1
    assert all(shell.wrapped.Closed() for shell in solid.Shells())
    assert solid.BoundingBox().zmin == pytest.approx(0.0, abs=1e-6)
    tops = max(w["z"][1] for w in part_of(case).truth["walls"])
    assert solid.BoundingBox().zmax >= tops - 1e-6


@pytest.mark.parametrize("case", CASES)
def test_every_connection_bridges_exactly_its_two_walls(case):
    for spec, (overlaps, near, visible, walls) in zip(part_of(case).layout.connections, bridges_of(case), strict=True):
        assert overlaps == near == set(spec.indices)
        assert len(visible.Solids()) == 1, "what is left outside the walls is one piece"
        assert all(visible.distance(walls[k]) < 1e-5 for k in near)


@pytest.mark.parametrize("case", CASES)
def test_z_range_and_void_below_each_connection(case):
    part = part_of(case)
    base = part.layout.base.solid()
    for truth, (_, _, visible, _) in zip(part.truth["connections"], bridges_of(case), strict=True):
        box = visible.BoundingBox(1e-4)
        assert (box.zmin, box.zmax) == pytest.approx(truth["z"], abs=0.3)
        assert (visible.distance(base) < 1e-6) == truth["floor_contact"]
        x, y, z = truth["point"]
        floor = part.layout.walls[0].z_floor
        column = [part.shape.isInside(cq.Vector(x, y, h)) for h in np.linspace(z, floor + 0.05, 9)]
        assert column[0] and not all(column), "void somewhere below the middle of the span"
        assert part.shape.isInside(cq.Vector(x, y, floor - 0.1))


@pytest.mark.parametrize("case", CASES)
def test_gap_is_the_distance_between_the_wall_solids(case):
    part = part_of(case)
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


def test_the_leaning_pair_is_undercut_on_one_side_only():
    for wall in part_of(("leaning_pair", 1)).layout.walls:
        up = {side: wall.side_normal(side, np.array([0.5]), np.array([0.5]))[0, 2] for side in (LEFT, RIGHT)}
        assert min(up.values()) < -0.02 < 0.02 < max(up.values())


@pytest.mark.slow
def test_narrow_is_narrow_and_demo_is_small():
    assert part_of(("narrow", 1)).truth["channels"][0]["gap_min"] == pytest.approx(0.8, rel=0.02)
    demo = part_of(("demo", 0))
    assert demo.shape.Area() < 9000 and len(demo.truth["walls"]) == 3 and len(demo.truth["connections"]) == 3


@pytest.mark.slow
def test_fillets_keep_one_solid():
    part = make_part(0, "wavy", fillet=0.8)
    assert part.truth["fillet"] == 0.8 and part.shape.isValid()
    assert "TORUS" in {f.geomType() for f in part.shape.Faces()} or len(part.shape.Faces()) > 30


@pytest.mark.slow
def test_same_seed_same_bytes(tmp_path):
    first = [p.read_bytes() for p in make_part(3, "narrow").write(tmp_path / "a")]
    again = [p.read_bytes() for p in make_part(3, "narrow").write(tmp_path / "b")]
    assert first == again
    header = first[0].decode().partition("DATA;")[0]
    assert "1970-01-01T00:00:00" in header
    other = make_part(4, "narrow").write(tmp_path / "c")[0].read_bytes()
    assert other != first[0]


@pytest.mark.slow
def test_the_step_file_reads_back_with_the_same_volume(tmp_path):
    step, truth, setup = part_of(("demo", 0)).write(tmp_path)
    read = cq.importers.importStep(str(step)).val()
    assert read.Volume() == pytest.approx(part_of(("demo", 0)).shape.Volume(), rel=1e-6)
    assert json.loads(truth.read_text())["recipe"] == "demo"
    assert json.loads(setup.read_text())["tools"]


@pytest.mark.parametrize("case", CASES)
def test_setups_are_valid_and_their_lengths_consistent(tmp_path, case):
    from schemas.setup import Setup

    for setup in (part_of(case).setup, json.loads(write_demo(tmp_path)[1].read_text())):
        Setup.model_validate(setup)
        for tool in setup["tools"]:
            assert 0 < tool["flute_length_mm"] < tool["neck_length_mm"] < tool["stickout_mm"]
            assert tool["neck_diameter_mm"] < tool["diameter_mm"] <= tool["shank_diameter_mm"]


@pytest.mark.slow
def test_overrides_and_refusals():
    layout = draw_layout(5, walls=3, connections=0, gap=(2.0, 4.0))
    assert len(layout.walls) == 3 and layout.connections == []
    gaps = {g.walls: g.gap_min for g in layout.gaps()}
    assert all(1.99 <= gaps[k, k + 1] <= 4.01 for k in range(2))
    block = WallSpec("straight", np.array([[-20.0, 0.0], [20.0, 0.0]]), 4.0, 8.0, (6.0, 6.0))
    with pytest.raises(LayoutError, match="block"):
        check(PartLayout("bad", Plate((-30, -10, 30, 10), 4.0), [block]))


@pytest.mark.slow
def test_every_recipe_is_drawn_for_several_seeds():
    for name in RECIPES:
        for seed in range(2):
            layout = draw_layout(seed, name, **({"walls": 3, "connections": 2} if name.startswith("mixed") else {}))
            assert len(layout.walls) >= 2
            if name != "random" and not name.startswith("mixed"):
                assert layout.connections, f"{name}-{seed} has no connection"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_random_parts_are_valid(seed):
    part = make_part(seed)
    assert part.shape.isValid() and 2 <= len(part.truth["walls"]) <= 6


MIXED = [(7, {}), (3, {"walls": 2, "connections": 3}), (5, {"walls": 3, "connections": 2, "arrangement": "radial"})]


@pytest.fixture(scope="module")
def mixed() -> list[FamilyPart]:
    return [make_part(seed, "mixed", **overrides) for seed, overrides in MIXED]


def test_a_new_recipe_changes_no_part_of_an_old_one():
    assert {k: NUMBERS[k] for k in ("demo", "impeller", "leaning_pair", "narrow", "random", "three_walls", "wavy")} == {
        "demo": 0, "impeller": 1, "leaning_pair": 2, "narrow": 3, "random": 4, "three_walls": 5, "wavy": 6}
    assert set(NUMBERS) == set(RECIPES) and len(set(NUMBERS.values())) == len(NUMBERS)


def test_the_paper_s_curve_has_its_knots_and_ends():
    control = np.array([(100, 0), (196, 34), (281, 102), (346, 199), (383, 321), (385, 459), (350, 606), (274, 751),
                        (156, 886), (0, 1000)], float)
    curve = spline(control)
    assert curve.k == 4 and len(curve.t) == 15 and np.allclose(np.diff(curve.t[4:11]), 1 / 6)
    assert np.allclose(curve([0.0, 1.0]), control[[0, -1]])


@pytest.mark.parametrize("kind", OPEN_TYPES)
def test_open_profiles_show_the_bends_they_are_drawn_with(kind):
    for seed in range(20):
        profile = draw_open(np.random.default_rng(seed), kind, 60.0)
        left, right = profile.labels
        curve = profile.curve(np.linspace(0, 1, 3001))
        turns = [turn for turn, _ in bends(curve) if abs(turn) > 8]
        assert [int(np.sign(t)) for t in turns] == list(BENDS[kind])
        assert all(abs(t) >= 35 for t in turns)
        assert clear(left, curve, False) and clear(right, curve[::-1], False)
        assert np.allclose(curve[[0, -1], 1], 0.0, atol=1e-9)


def test_skewed_profiles_mirror_each_other_and_level_ones_are_level():
    for seed in range(10):
        lean = {k: skew(draw_open(np.random.default_rng(seed), k, 50.0).curve(np.linspace(0, 1, 2001)))
                for k in ("C3", "C7", "C8", "C9")}
        assert lean["C7"] < -0.155 and lean["C8"] > 0.155 and abs(lean["C3"]) < 0.04 and abs(lean["C9"]) < 0.04


@pytest.mark.parametrize(("kind", "ups"), [("C5", 5), ("C6", 2), ("oval", 0)])
def test_closed_profiles_run_round_once(kind, ups):
    for seed in range(10):
        curve = draw_closed(np.random.default_rng(seed), kind, 12.0).curve(np.linspace(0, 1, 3001))[:-1]
        inside = [turn for turn, _ in bends(curve, closed=True)]
        assert sum(inside) == pytest.approx(-360.0, abs=0.5)
        assert sum(turn > 30 for turn in inside) == ups


@pytest.mark.slow
def test_mixed_parts_are_one_solid_and_their_truth_is_on_it(mixed):
    for part in mixed:
        solid, truth = part.shape, part.truth
        assert solid.isValid() and len(solid.Solids()) == 1 and all(s.wrapped.Closed() for s in solid.Shells())
        for wall in truth["walls"]:
            assert len(wall["profiles"]) == 2 and np.array(wall["control_points"]).shape == (10, 2)
            for point in wall["side_points"]:
                assert cq.Vertex.makeVertex(*point).distance(solid) < 1e-3
        for connection in truth["connections"]:
            assert solid.isInside(cq.Vector(*connection["point"]))
            assert 2 <= len(connection["walls"]) <= 3
        assert truth["features"] == sorted(truth["features"])


def test_mixed_gaps_are_distances_of_the_wall_solids(mixed):
    for part in mixed:
        for channel in part.truth["channels"]:
            i, j = channel["walls"]
            if channel["primary"] and i != j and part.layout.fillet == 0:
                distance = part.layout.walls[i].solid().distance(part.layout.walls[j].solid())
                assert distance <= channel["gap_min"] * 1.001
                if "radial" not in part.truth["features"]:
                    assert distance == pytest.approx(channel["gap_min"], rel=0.02)


def ring(radius: float) -> FreeWall:
    angle = np.arange(10) * 2 * np.pi / 10
    profile = DrawnProfile("oval", radius * np.column_stack([np.cos(angle), np.sin(angle)]), closed=True)
    return FreeWall("closed", profile.control, 4.0, 10.0, (2.0, 2.0), profile=profile)


@pytest.mark.slow
def test_gap_of_nested_rings_and_of_a_ring_with_itself():
    outer, inner = ring(20.0), ring(12.0)
    far = np.hypot(*outer.side_curve(LEFT).T).min() - np.hypot(*inner.side_curve(RIGHT).T).max()
    found = {g.walls: g.gap_min for g in channels([outer, inner], n_u=121, n_v=3)}
    assert found[0, 1] == pytest.approx(far, abs=1e-3)
    assert found[1, 1] == pytest.approx(2 * np.hypot(*inner.side_curve(LEFT).T).min(), abs=1e-2)


@pytest.mark.slow
def test_a_wall_that_rays_only_graze_stops_them():
    def straight(a: tuple[float, float], b: tuple[float, float]) -> FreeWall:
        line = DrawnProfile(None, np.linspace(a, b, 10))
        return FreeWall("straight", line.control, 4.0, 10.0, (2.0, 2.0), profile=line)

    pair = [straight((-15, 0), (15, 0)), straight((-15, 18), (15, 18))]
    across = straight((-1, 4), (2, 14))
    free, shaded = (channels(walls, n_u=601, n_v=3)[0] for walls in (pair, [*pair, across]))
    shadow = np.ptp(np.concatenate([across.side_curve(s)[:, 0] for s in (LEFT, RIGHT)]))
    assert free.walls == shaded.walls == (0, 1)
    assert free.area - shaded.area == pytest.approx(2 * 10.0 * shadow, rel=0.03)


@pytest.mark.parametrize("options", [{}, {"strips": 4}, {"merged": True}])
def test_free_walls_are_valid_whatever_their_faces(options):
    profile = draw_open(np.random.default_rng(1), "C2", 45.0)
    wall = FreeWall("curved", profile.control, 4.0, 12.0, (2.0, 1.6), (0.08, -0.05), profile=profile, **options)
    solid = wall.solid()
    assert solid.isValid() and solid.Closed()
    u, v = np.linspace(0.1, 0.9, 5), np.full(5, 0.5)
    for side, label in zip((LEFT, RIGHT), profile.labels, strict=True):
        assert clear(label, wall.side_curve(side), False)
        for q, m in zip(wall.side_point(side, u, v), wall.side_normal(side, u, v), strict=True):
            assert not solid.isInside(cq.Vector(*(q + 1e-2 * m))) and solid.isInside(cq.Vector(*(q - 1e-2 * m)))


def test_a_fork_ends_in_every_wall_it_names():
    x = np.linspace(-25, 25, 10)[:, None]
    lines = [DrawnProfile(None, np.column_stack([x, np.full_like(x, y)])) for y in (0.0, 10.0)]
    walls = [FreeWall("straight", p.control, 4.0, 12.0, (2.0, 2.0), profile=p) for p in lines]
    spec = fork(walls, 0, LEFT, 0.5, 10.0, spread=0.5, width=1.4, depth=1.6)
    assert spec.indices == (0, 1) and spec.visible.geom_type == "Polygon"
    solid = spec.solid()
    assert solid.isValid() and solid.BoundingBox().zmin == pytest.approx(9.2)
    assert all(solid.intersect(w.solid()).Volume() > 0.5 for w in walls)


def test_a_hub_that_swallows_a_connection_or_an_end_of_it_is_noticed():
    x = np.linspace(-15, 15, 10)

    def straight(y: float, thickness: float) -> FreeWall:
        line = DrawnProfile(None, np.column_stack([x, np.full(10, y)]))
        return FreeWall("straight", line.control, 4.0, 12.0, (thickness, thickness), profile=line)

    walls = [straight(y, 2.0) for y in (0.0, 8.0)]
    spec = join(walls, 0, LEFT, 0.5, "bar", (9.0, 9.0), width=2.0, depth=2.0)

    def hub(radius: float, height: float) -> HubDisc:
        return HubDisc(30.0, 4.0, (radius, radius), height)

    assert not within_hub(Plate((-20, -20, 20, 20), 4.0), walls, spec)
    assert within_hub(hub(3.0, 8.0), walls, spec)
    assert not within_hub(hub(3.0, 3.0), walls, spec), "the bar passes over the hub"
    assert not within_hub(hub(0.5, 8.0), walls, spec), "the hub is within the wall"

    pair = [straight(y, 6.0) for y in (-4.0, 4.0)]
    beside = join(pair, 0, LEFT, 19.0 / 30.0, "bar", (9.0, 9.0), width=2.0, depth=2.0)
    assert within_hub(hub(3.0, 8.0), pair, beside), "three quarters of the bar lie within the hub"
    assert not within_hub(hub(2.0, 8.0), pair, beside), "a quarter of the bar lies within the hub"


class Corner:
    """A square wall round nothing, stood in for where only its plan matters; u is the place along its lower leg."""

    closed, thickness = True, (2.0, 2.0)

    def section(self, z: float) -> Polygon:
        return box(0, 0, 20, 20).difference(box(2, 2, 18, 18))

    def axis_point(self, u: float, z: float) -> np.ndarray:
        return np.array([20.0 * u, 1.0])

    def plan_normal(self, u: np.ndarray) -> np.ndarray:
        return np.array([[0.0, 1.0]])


@pytest.mark.parametrize(("u", "width", "passes"), [(0.5, 4.0, True), (0.5, 17.0, False), (0.12, 4.0, False)])
def test_an_opening_goes_all_the_way_through_its_wall(u, width, passes):
    window = WindowSpec(0, Corner(), u, width, (5.0, 8.0))
    assert window.fits(PartLayout("", Plate((-5, -5, 25, 25), 4.0), [Corner()], []), []) == passes


def test_joins_find_the_other_stretch_of_the_same_wall():
    wall = ring(12.0)
    with pytest.raises(LayoutError, match="too far"):
        join([wall], 0, LEFT, 0.3, "bar", (9.0, 9.0), width=1.5, depth=1.5)
    small = ring(6.0)
    spec = join([small], 0, LEFT, 0.3, "bar", (9.0, 9.0), width=1.5, depth=1.5)
    assert spec.indices == (0, 0)


@pytest.mark.slow
def test_reach_of_a_part_is_a_share_with_its_error(tmp_path):
    part = make_part(7, "mixed")
    _, truth, _ = part.write(tmp_path, reach=True)
    reach = json.loads(truth.read_text())["reach"]
    assert 0.3 < reach["share"] < 1.0 and reach["error"] < 0.03
    assert max(reach["by_tool"].values()) <= reach["share"] + reach["error"]


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("seed", range(20))
def test_mixed_layouts_keep_the_numbers_of_the_family(seed):
    layout = draw_layout(seed, "mixed")
    assert 2 <= len(layout.walls) <= 12 and 0 <= len(layout.connections) <= 16
    gaps = [g.gap_min for g in layout.gaps(n_u=121, n_v=3)]
    assert not gaps or min(gaps) > 0.25
