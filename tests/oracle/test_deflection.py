"""The bending of a stepped tool against closed forms and against a beam integrated in small steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from geometry.cutting_mechanics import CARBIDE, CORE, compliance, cutting_force, engaged_angle
from geometry.tool_body import ToolBody

TOOLS = [
    ToolBody("T1", 1, 1.0, 0.5, 3.0, 0.9, 13.0, 4.0, 29.0),
    ToolBody("T2", 2, 4.0, 0.0, 12.0, 3.8, 14.0, 6.0, 30.0),
    ToolBody("T3", 3, 6.0, 1.0, 18.0, 6.0, 18.0, 6.0, 40.0),
    ToolBody("T4", 4, 3.0, 1.5, 9.0, 2.8, 45.0, 6.0, 45.0),
]


def integrated(tool: ToolBody, count: int = 200_000) -> float:
    """mm/N: the curvature M / (E I) of the beam summed twice from the holder down to the tip, by midpoints."""
    edges = np.linspace(tool.stickout, 0.0, count + 1)
    z, dz = 0.5 * (edges[1:] + edges[:-1]), tool.stickout / count
    wide = np.where(z < tool.flute_length, CORE * tool.diameter,
                    np.where(z < tool.neck_length, tool.neck_diameter, tool.shank_diameter))
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
