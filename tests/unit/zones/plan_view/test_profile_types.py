"""The ten profile types: curves drawn by hand-set rules, the decision table's edges, margins, levels."""

from __future__ import annotations

import importlib.util
import re

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.surfaces.bspline import SplineCurve
from tests.profile_curves import DRAW, draw
from tests.source_tree import ROOT
from zones.plan_view.curve_bends import BendSide, _pivots, measure_bends, size_of
from zones.plan_view.profile_types import LEVEL, ROUND, SKEW, Level, ProfileType, VoidSide, classify

# Limits were chosen on seeds below 1000; scores are taken on these.
SCORE = 20_000
EQUATION_3 = np.array([(100, 0), (196, 34), (281, 102), (346, 199), (383, 321), (385, 459), (350, 606), (274, 751),
                       (156, 886), (0, 1000)], float)
T = np.linspace(0, 2 * np.pi, 400, endpoint=False)


def polar(r) -> np.ndarray:
    return np.column_stack([r * np.cos(T), r * np.sin(T)])


def wave(ups: float, slope: float = 1.0) -> np.ndarray:
    """A sine that starts upwards, with ``ups`` crests."""
    x = np.linspace(0, (2 * ups - 1) * np.pi, 600)
    return np.column_stack([x, slope * np.sin(x)])


@pytest.mark.parametrize("kind", DRAW)
def test_drawn_curves_have_the_type_they_were_drawn_for(kind: str) -> None:
    found = [classify(*draw(kind, SCORE + i)).type for i in range(15)]
    assert found == [kind] * 15


@pytest.mark.slow
@pytest.mark.parametrize("kind", DRAW)
def test_ninety_nine_of_a_hundred_drawn_curves(kind: str) -> None:
    right = sum(classify(*draw(kind, SCORE + i)).type == kind for i in range(400))
    assert right >= 396


def test_equation_three_is_single_up_or_down_with_the_side_of_the_void() -> None:
    """Walked as printed the curve turns left: it bulges to the right."""
    curve = SplineCurve(EQUATION_3).at(np.linspace(0, 1, 300))
    assert classify(curve).type == ProfileType.C4
    assert classify(curve, void=VoidSide.RIGHT).type == ProfileType.C1
    assert classify(curve[::-1]).type == ProfileType.C1


@pytest.mark.parametrize(("points", "closed", "kind"), [
    ([(0, 0), (50, 1)], False, None),
    ([(0, 0), (40, 0), (40, 15)], False, "C4"),
    ([(40, 15), (40, 0), (0, 0)], False, "C1"),
    ([(0, 0), (10, 0), (10, 10), (20, 10)], False, "C1"),
    (wave(1), False, "C1"), (wave(1) * [1, -1], False, "C4"), (wave(1.5), False, "C1"), (wave(2), False, "C2"),
    (wave(3), False, "C3"), (wave(2.5), False, "C2"), (wave(4), False, "C10"), (wave(9), False, "C10"),
    (polar(1.0), True, "C4"), (polar(1.0)[::-1], True, "C1"),
    (polar(1 + 0.2 * np.cos(3 * T)), True, "C10"), (polar(1 + 0.2 * np.cos(4 * T)), True, "C10"),
    (polar(1 + 0.2 * np.cos(5 * T)), True, "C5"), (polar(1 + 0.2 * np.cos(6 * T)), True, "C10"),
    (polar(1 + 0.2 * np.cos(5 * T))[::-1], True, "C5"), (polar(1 + 0.6 * np.cos(2 * T)), True, "C6"),
    (polar(1 + 0.6 * np.cos(2 * T))[::-1], True, "C6"), (polar(1.0) * [3, 1], True, "C4"),
    ([(0, 0), (0, 30), (50, 30), (50, 0)], True, "C1"), ([(50, 0), (50, 30), (0, 30), (0, 0)], True, "C4"),
    ([(0, 0), (0, 30), (20, 30), (20, 10), (30, 10), (30, 30), (50, 30), (50, 0)], True, "C1"),
])
def test_every_curve_has_its_place_in_the_table(points, closed, kind) -> None:
    assert classify(points, closed).type == kind


def test_levels_are_those_of_the_paper() -> None:
    by = {v: {t.value for t in ProfileType if LEVEL[t] == v} for v in Level}
    assert by == {Level.SIMPLE: {"C1", "C4"}, Level.MEDIUM: {"C2", "C3", "C6"},
                  Level.HIGH: {"C5", "C7", "C8", "C9", "C10"}}
    assert classify([(0, 0), (1, 0)]).level == Level.SIMPLE and classify(wave(2)).level == Level.MEDIUM


@pytest.mark.parametrize("degrees", [5, 15, 19, 21, 25, 60, 170, 300])
def test_an_arc_is_a_bend_from_twenty_degrees_on_and_its_margin_says_how_far(degrees: float) -> None:
    a = np.radians(degrees) * np.linspace(0.5, -0.5, 200)
    found = classify(np.column_stack([-np.sin(a), np.cos(a)]))
    assert found.type == ("C1" if degrees > 20 else None)
    assert found.margin == pytest.approx(abs(degrees - 20) / max(degrees, 20), abs=0.01)
    assert found.second == (None if degrees > 20 else "C1")
    if degrees > 20:
        assert np.degrees(found.bends[0].turn) == pytest.approx(degrees, rel=0.01)
        assert found.roundness == pytest.approx(1.0, abs=0.02)


def test_bends_alternate_and_add_up_to_the_turn() -> None:
    for kind in ("C3", "C8", "C10", "C1"):
        p, _ = draw(kind, 7)
        measures = measure_bends(p)
        for level in measures.levels:
            ways = [b.way for b in level.bends]
            assert all(a != b for a, b in zip(ways, ways[1:], strict=False))
        bends = measures.levels[0].bends
        signed = sum(b.turn * (-1 if b.way == BendSide.UP else 1) for b in bends)
        assert signed == pytest.approx(measures.turn, abs=1e-9)


def _bumped(depth: float) -> np.ndarray:
    """A half circle with a dent of a given depth in the middle of it."""
    a = np.linspace(np.pi, 0, 800)
    r = 1 - depth * np.exp(-((a - np.pi / 2) / 0.1) ** 2)
    return np.column_stack([r * np.cos(a), r * np.sin(a)])


def test_a_dent_below_the_limit_belongs_to_the_bend_around_it() -> None:
    assert classify(_bumped(0.0)).type == classify(_bumped(0.004)).type == "C1"
    assert len(classify(_bumped(0.004)).bends) == 1
    assert classify(_bumped(0.08)).type == "C2"


@pytest.mark.parametrize(("kind", "seed", "noise_seed", "sigma"), [
    ("C6", 3600, 3600, 0.01), ("C6", 3094, 819169803, 0.01), ("C6", 1847, 641801295, 0.005),
    ("C4", 6418, 3626198101, 0.005), ("C4", 7830, 74946420, 0.01), ("C1", 1354, 3339749106, 0.005),
])
def test_noise_neither_hides_a_waist_nor_bends_an_end(kind: str, seed: int, noise_seed: int, sigma: float) -> None:
    """Draws that were taken for another type by margins of up to 0.35, and a random one of their kind."""
    p, closed = draw(kind, seed)
    noise = np.random.default_rng(noise_seed).normal(size=p.shape) * sigma * size_of(p, closed)
    found = classify(p + noise, closed)
    assert found.type == kind and found.margin > 0.2


@pytest.mark.parametrize(("fillet", "sigma"), [(0.02, 0.0), (0.1, 0.002), (0.2, 0.01)])
def test_the_sharpness_of_a_waist_does_not_make_it_low(fillet: float, sigma: float) -> None:
    """Two discs joined by two fillets: low over its own chord, each of them is deep under the line over both discs."""
    across = np.arccos(0.8 / (1 + fillet))
    lobe, turn = np.linspace(np.pi - across, across - np.pi, 500), np.linspace(-across, across - np.pi, 100)[1:-1]
    right = np.column_stack([0.8 + np.cos(lobe), np.sin(lobe)])
    upper = fillet * np.column_stack([np.cos(turn), np.sin(turn)]) + [0, (1 + fillet) * np.sin(across)]
    ring = np.vstack([right, upper * [1, -1], (right * [-1, 1])[::-1], upper[::-1]])
    noise = np.random.default_rng(5).normal(size=ring.shape) * sigma * size_of(ring, True)
    found = classify(ring + noise, True)
    assert found.type == "C6" and found.margin > 0.6


def _leaned(shift: float) -> np.ndarray:
    """Three equal humps on a line whose spacing makes them lean to the left (shift > 0)."""
    x = np.linspace(0, 1, 900)
    y = 0.12 * np.abs(np.sin(3 * np.pi * x)) ** 1.5 * (1 - 2.2 * shift * (x - 0.5))
    return np.column_stack([x, y])


def test_skew_decides_left_and_right_and_gives_the_margin() -> None:
    for shift in (-0.9, -0.45, 0.0, 0.45, 0.9):
        found = classify(_leaned(shift))
        assert found.type == ("C3" if abs(found.skew) <= SKEW else "C7" if found.skew < 0 else "C8")
        assert np.sign(round(found.skew, 3)) == -np.sign(shift)
    strong = classify(_leaned(0.9))
    assert strong.type == "C7" and strong.second == "C3"
    assert strong.margin == pytest.approx((abs(strong.skew) - SKEW) / abs(strong.skew))
    assert classify(_leaned(-0.9)).type == "C8"


def test_arcs_are_round_and_sines_are_not() -> None:
    for i in range(5):
        assert classify(*draw("C9", 300 + i)).roundness > ROUND + 0.08
    for slope in (0.4, 0.7, 1.5):
        assert classify(wave(3, slope)).roundness < ROUND - 0.06


def test_bends_of_a_ring_start_at_its_least_curvature() -> None:
    """Two lobes of different size: the bends come in the same order wherever the list of points starts."""
    ring = polar((1 + 0.45 * np.cos(2 * T)) * (1 + 0.2 * np.cos(T)) * (1 + 0.15 * np.sin(T)))
    lists = [classify(np.roll(ring, k, axis=0), True).bends for k in (0, 37, 211)]
    for other in lists[1:]:
        assert [b.way for b in other] == [b.way for b in lists[0]]
        assert [b.turn for b in other] == pytest.approx([b.turn for b in lists[0]], abs=np.radians(3))
    assert lists[0][0].way == BendSide.UP
    turns = [b.turn * (-1 if b.way == BendSide.UP else 1) for b in lists[0]]
    assert sum(turns) == pytest.approx(2 * np.pi, rel=1e-6)


def test_a_ring_that_never_turns_back_is_one_bend_of_a_whole_turn() -> None:
    for points, kind in ((polar(1.0) * [1.5, 1], "C4"), ((polar(1.0) * [1.5, 1])[::-1], "C1")):
        found = classify(points, True)
        assert found.type == kind and len(found.bends) == 1
        assert found.bends[0].turn == pytest.approx(2 * np.pi) and found.margin == 1.0 and found.second is None


@pytest.mark.parametrize("points", [[(0, 0)], [(1, 1), (1, 1)], np.zeros((0, 2)), [(0, 0), (np.inf, 1)], [(0, 0, 1)]])
def test_no_curve_no_type(points) -> None:
    with pytest.raises(GeometryError):
        classify(points)


def test_turning_points_leave_no_ripple_and_lose_no_turn() -> None:
    """Between two of them the direction never turns back by more than the ripple; all but the outer legs exceed it."""
    for seed in range(200):
        rng = np.random.default_rng(seed)
        theta = rng.normal(size=int(rng.integers(2, 60))).cumsum()
        pivots = _pivots(theta.tolist(), 0.5)
        assert pivots[0] == 0 and pivots[-1] == len(theta) - 1
        legs = np.diff(theta[pivots])
        assert (legs[1:] * legs[:-1] <= 0).all() and (np.abs(legs[1:-1]) > 0.5).all()
        for i, j in zip(pivots[:-1], pivots[1:], strict=True):
            way = theta[i:j + 1] * (1 if theta[j] >= theta[i] else -1)
            assert (np.maximum.accumulate(way) - way).max() <= 0.5


def test_the_pictures_are_those_the_script_draws(tmp_path) -> None:
    """Every example is of its type, and the committed pictures show it: same text, numbers within half a pixel."""
    spec = importlib.util.spec_from_file_location("profile_types", ROOT / "docs" / "figures" / "profile_types.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    drawn = script.draw_all(tmp_path)
    assert [p.name for p in drawn] == [f"profile-{k.lower()}.svg" for k in ("C1", "C2", "C3", "C4", "C5", "C6", "C7",
                                                                           "C8", "C9", "C10")]
    for new in drawn:
        old = (ROOT / "docs" / "images" / new.name).read_text(encoding="utf-8")
        text = new.read_text(encoding="utf-8")
        numbers = re.compile(r"-?\d+\.\d")
        assert numbers.sub("", old) == numbers.sub("", text)
        was, now = ([float(n) for n in numbers.findall(t)] for t in (old, text))
        assert now == pytest.approx(was, abs=0.5)
