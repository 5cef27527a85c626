"""The bending of a stepped tool against closed forms and against a beam integrated in small steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geometry.cutting_mechanics import (
    CARBIDE,
    CORE,
    bending_stress,
    compliance,
    cutting_force,
    cutting_forces,
    diameter_in_cut,
    diameters_in_cut,
    engaged_angle,
    strength,
)
from geometry.tool_body import ToolBody

TOOLS = [
    ToolBody("T1", 1, 1.0, 0.5, 3.0, 0.9, 13.0, 4.0, 29.0),
    ToolBody("T2", 2, 4.0, 0.0, 12.0, 3.8, 14.0, 6.0, 30.0),
    ToolBody("T3", 3, 6.0, 1.0, 18.0, 6.0, 18.0, 6.0, 40.0),
    ToolBody("T4", 4, 3.0, 1.5, 9.0, 2.8, 45.0, 6.0, 45.0),
    ToolBody("T5", 5, 1.0, 0.5, 15.0, 3.0, 25.0, 6.0, 40.0, taper=math.tan(math.radians(5.0))),
    ToolBody("T6", 6, 4.0, 0.0, 12.0, 6.0, 12.0, 8.0, 30.0, taper=math.tan(math.radians(30.0))),
    ToolBody("T7", 7, 0.2, 0.05, 2.0, 0.25, 2.0, 3.0, 20.0, taper=math.tan(math.radians(0.5))),
]
TAPERED = TOOLS[4:]


def bar(tool: ToolBody, z):
    """Diameter of the bar that a tool is at heights z, mm."""
    wide, high = tool.corner_end
    flutes = 2.0 * CORE * (wide + tool.taper * np.maximum(z - high, 0.0))
    return np.where(z < tool.flute_length, flutes,
                    np.where(z < tool.neck_length, tool.neck_diameter, tool.shank_diameter))


def integrated(tool: ToolBody, count: int = 200_000) -> float:
    """mm/N: the curvature M / (E I) of the beam summed twice from the holder down to the tip, by midpoints."""
    edges = np.linspace(tool.stickout, 0.0, count + 1)
    z, dz = 0.5 * (edges[1:] + edges[:-1]), tool.stickout / count
    wide = bar(tool, z)
    slope = np.cumsum(z / (CARBIDE * math.pi * wide**4 / 64.0)) * dz
    return float((slope - 0.5 * np.diff(slope, prepend=0.0)).sum() * dz)


@pytest.mark.parametrize("tool", TOOLS, ids=lambda t: t.id)
def test_a_stepped_tool_bends_as_the_beam_summed_twice(tool):
    assert compliance(tool) == pytest.approx(integrated(tool), rel=1e-5)


def test_a_bar_bends_by_f_l3_over_3ei():
    bar = ToolBody("T1", 1, 5.0, 0.0, 20.0, 5.0, 20.0, 4.0, 50.0)  # flutes of 5 as a bar of 4, shank of 4
    inertia = math.pi * 4.0**4 / 64.0
    assert compliance(bar) == pytest.approx(50.0**3 / (3.0 * 600e3 * inertia), rel=1e-12)
    assert compliance(bar, 300e3) == pytest.approx(2.0 * compliance(bar), rel=1e-12)


def test_a_slot_by_hand():
    """Two teeth of 10 mm, 2 mm deep, 0.05 mm a tooth in a slot: one tooth in cut, h = 2 fz / pi, b = 2."""
    tool = ToolBody("T1", 1, 10.0, 0.0, 20.0, 10.0, 20.0, 10.0, 40.0)
    assert engaged_angle(tool, 2.0, 10.0) == math.pi
    chip = 2.0 * 0.05 / math.pi
    wanted = 2.0 * chip**0.75 * 2000.0
    assert cutting_force(2000.0, 0.25, 0.05, 2.0, 10.0, tool, 2) == pytest.approx(wanted)
    assert cutting_force(2000.0, 0.25, 0.05, 2.0, 10.0, tool, 4) == pytest.approx(2.0 * wanted)


@pytest.mark.parametrize(("depth", "width"), [(0.5, 3.0), (1.5, 0.4), (3.0, 6.0)])
def test_the_mean_chip_is_that_along_the_engaged_arc(depth, width):
    tool, per_tooth, z = ToolBody("T1", 1, 6.0, 0.0, 20.0, 6.0, 20.0, 6.0, 40.0), 0.03, 3
    phi = engaged_angle(tool, depth, width)
    angles = (np.arange(100_000) + 0.5) / 100_000 * phi
    chip = float((per_tooth * np.sin(angles)).mean())
    wanted = max(1.0, z * phi / (2.0 * math.pi)) * depth * chip**0.8 * 1500.0
    assert cutting_force(1500.0, 0.2, per_tooth, depth, width, tool, z) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("depth", [0.05, 0.5, 1.5, 2.5])
def test_a_round_corner_spreads_the_same_chip_over_a_longer_edge(depth):
    """With mc = 0 force is area times kc, whatever the corner; else the thinner chip costs more."""
    ball, flat = (ToolBody("T1", 1, 3.0, r, 9.0, 2.8, 20.0, 6.0, 45.0) for r in (1.5, 0.0))
    slot = [cutting_force(1000.0, mc, 0.02, depth, 3.0, t, 2) for mc in (0.0, 0.25) for t in (ball, flat)]
    assert slot[0] == pytest.approx(slot[1]) and slot[2] > slot[3]


@pytest.mark.parametrize("tool", TAPERED, ids=lambda t: t.id)
def test_a_cone_is_a_stack_of_many_thin_cylinders(tool):
    """Bars that step up evenly bend as the cone does, the more the more of them."""
    wide, high = tool.corner_end
    total, low = 0.0, 0.0
    edges = np.concatenate([[high], np.linspace(high, tool.flute_length, 20_001)[1:]])
    for top in edges.tolist():
        d = 2.0 * CORE * (wide + tool.taper * max(0.5 * (low + top) - high, 0.0))
        total += (top**3 - low**3) / (3.0 * CARBIDE * math.pi * d**4 / 64.0)
        low = top
    short = ToolBody("T", 1, tool.diameter, tool.corner_radius, tool.flute_length, 1.0, tool.flute_length, 1.0,
                     tool.flute_length, taper=tool.taper)
    assert compliance(short) == pytest.approx(total, rel=1e-7)


def test_a_side_that_hardly_leans_bends_as_an_upright_one():
    upright = ToolBody("T1", 1, 3.0, 1.5, 9.0, 2.8, 20.0, 6.0, 45.0)
    leaning = ToolBody("T1", 1, 3.0, 1.5, 9.0, 2.8, 20.0, 6.0, 45.0, taper=1e-9)
    assert compliance(leaning) == pytest.approx(compliance(upright), rel=1e-7)
    assert bending_stress(leaning, 100.0, 2.0) == pytest.approx(bending_stress(upright, 100.0, 2.0), rel=1e-7)


@pytest.mark.parametrize("depth", [0.0, 0.3, 2.0])
@pytest.mark.parametrize("tool", TAPERED, ids=lambda t: t.id)
def test_the_stress_is_the_largest_share_of_the_strength_anywhere(tool, depth):
    z = np.linspace(0.0, tool.stickout, 400_001)[:-1]
    d = bar(tool, z)
    share = 32.0 * 50.0 * np.maximum(z - 0.5 * depth, 0.0) / (math.pi * d**3) / np.array([strength(1.0)]) * d**0.25
    stress, strong = bending_stress(tool, 50.0, depth)
    assert stress / strong == pytest.approx(float(share.max()), rel=1e-4)


@pytest.mark.parametrize("tool", TOOLS, ids=lambda t: t.id)
def test_diameters_in_the_cut_are_those_of_the_profile(tool):
    wide, high = tool.corner_end
    depth = np.linspace(1e-3, 1.5 * tool.flute_length, 301)
    got = diameters_in_cut(tool, depth)
    assert got.tolist() == pytest.approx([diameter_in_cut(tool, a) for a in depth.tolist()], abs=1e-12)
    r = tool.corner_radius
    for a, d in zip(depth.tolist(), got.tolist(), strict=True):
        over = 0.5 * d - (tool.radius - r)
        if a < high:
            assert over**2 + (r - a) ** 2 == pytest.approx(r * r, abs=1e-12)
        else:
            assert 0.5 * d == pytest.approx(wide + tool.taper * (min(a, tool.flute_length) - high), abs=1e-12)


@pytest.mark.parametrize("tool", TAPERED, ids=lambda t: t.id)
def test_a_leaning_side_spreads_the_same_chip_over_a_longer_edge(tool):
    """With mc = 0 the force of one tooth is area times kc; the edge of a cone is as long as it leans."""
    high, depth = tool.corner_end[1], 0.6 * tool.flute_length
    slot = diameter_in_cut(tool, depth)
    forces = [cutting_force(1000.0, mc, 0.02, depth, slot, tool, 2) for mc in (0.0, 0.25)]
    assert forces[0] == pytest.approx(1000.0 * depth * 0.02 * 2.0 / math.pi)
    arc = math.hypot(high, tool.corner_end[0] - tool.radius + tool.corner_radius)
    edge = arc + (depth - high) * math.hypot(1.0, tool.taper)
    chip = 0.02 * depth / edge * 2.0 / math.pi
    assert forces[1] == pytest.approx(edge * chip**0.75 * 1000.0)
    many = cutting_forces(1000.0, 0.25, np.array([0.02]), np.array([depth]), np.array([slot]), tool, 2)
    assert float(many[0]) == pytest.approx(forces[1])
