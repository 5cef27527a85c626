"""The brute-force reach against a pocket whose unreachable corners are known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.reach import brute_reach
from tests.pocket_case import block

STEP = 0.1
LENGTH, WIDTH, DEEP, R = 20.0, 12.0, 5.0, 2.0
AROUND = 2 * (40.0 + 30.0) * 10.0
TOP = 40.0 * 30.0 - LENGTH * WIDTH
WALLS = 2 * (LENGTH + WIDTH) * DEEP
ALL = AROUND + TOP + WALLS + LENGTH * WIDTH


def setup(kind: str, holder_gap: float | None = None) -> dict:
    holder = [] if holder_gap is None else [{"diameter_mm": 30.0, "diameter_top_mm": 30.0, "length_mm": 20.0}]
    tool = {"id": "T1", "diameter_mm": 2 * R, "corner_radius_mm": R if kind == "ball" else 0.0,
            "shank_diameter_mm": 2 * R, "neck_length_mm": 30.0, "stickout_mm": holder_gap or 40.0, "holder": holder}
    return {"tools": [tool], "fixtures": [], "operations": {"faces": None, "exclude_faces": []},
            "clearance_mm": {"shank": 0.2, "holder": 1.0, "rapid": 1.0}, "quality": {"scallop_height_mm": 0.01}}


def test_flat_end_leaves_the_corner_strips_and_the_corners_of_the_floor():
    """Strips R wide on both sides of every upright corner, and (1 - pi/4) R² in every corner of the floor."""
    left = 8 * R * DEEP + 4 * (1 - math.pi / 4) * R**2
    found = brute_reach.estimate(block().mesh, setup("flat"), STEP)
    assert found["machinable_area_mm2"] == pytest.approx(ALL)
    assert found["touched"]["coverage"] == pytest.approx(1 - left / ALL, abs=0.002)
    assert 0 <= found["touched"]["at_step"] - (1 - left / ALL) < 16 * DEEP * STEP / ALL


def test_ball_end_leaves_a_strip_all_round_the_floor_as_well():
    """Floor nearer than R to a wall, walls nearer than R to the floor, and the corner strips above that."""
    floor = LENGTH * WIDTH - (LENGTH - 2 * R) * (WIDTH - 2 * R)
    walls = WALLS - 2 * (LENGTH + WIDTH - 4 * R) * (DEEP - R)
    found = brute_reach.estimate(block().mesh, setup("ball"), STEP)
    assert found["touched"]["coverage"] == pytest.approx(1 - (floor + walls) / ALL, abs=0.004)


def test_what_a_ball_leaves_within_the_scallop_is_clean():
    """Beside a wall the ball stands within h of the floor for sqrt(2 R h - h²) beyond its last touch."""
    h = 0.05
    given = setup("ball") | {"quality": {"scallop_height_mm": h}}
    strip = R - math.sqrt(2 * R * h - h * h)
    floor = LENGTH * WIDTH - (LENGTH - 2 * strip) * (WIDTH - 2 * strip)
    walls = WALLS - 2 * (LENGTH + WIDTH - 4 * strip) * (DEEP - strip)
    found = brute_reach.estimate(block().mesh, given, 0.5 * STEP)
    assert found["clean"]["coverage"] == pytest.approx(1 - (floor + walls) / ALL, abs=0.006)
    assert found["clean"]["coverage"] > found["touched"]["coverage"] + 0.01


def test_holder_keeps_a_short_tool_out():
    """A holder 3 mm above the tip and wider than the pocket stops 2 mm above the floor."""
    mesh = block().mesh
    given = setup("flat", holder_gap=3.0)
    samples = brute_reach.drawn(mesh, given)
    found, points = brute_reach.brute_reach(mesh, given, STEP, samples), samples.points
    inside = (np.abs(points[:, 0]) <= 10.001) & (np.abs(points[:, 1]) <= 6.001)
    assert not found.touched[inside & (points[:, 2] < -3.1)].any()
    assert found.touched[inside & (points[:, 2] > -2.9) & (points[:, 2] < -0.1)].mean() > 0.6


def test_dilation_of_a_disc_is_the_slow_one():
    """The queue against a plain maximum over the nodes of the disc."""
    height = np.random.default_rng(3).random((23, 31))
    reach, half = brute_reach.disc_rows(0.35, 0.1)
    slow = brute_reach.dilate(height, *brute_reach.cutter_profile(0.35, 0.0, 0.1))
    assert np.array_equal(brute_reach.disc_extreme(height, reach, half, 1.0), slow)
