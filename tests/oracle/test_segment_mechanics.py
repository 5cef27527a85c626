"""Bending, diameter and edge of circle segment mills against sums over thin slices of their outline."""

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
)
from tests.oracle.test_verify_segments import barrel, lens, random_mills


def test_a_mill_bends_as_its_slices_do():
    for tool in (barrel(10.0, 85.0, 1.0), barrel(8.0, 30.0, 0.5, 15.0, 0.5), lens(10.0, 40.0, 1.0)):
        z = (np.arange(400_000) + 0.5) / 400_000 * tool.stickout
        arcs = tool.arcs
        d = np.where(z < tool.flute_length, 2.0 * CORE * arcs.widths(np.maximum(z, arcs.join_up)), tool.shank_diameter)
        want = float((z**2 / (math.pi * d**4 / 64.0)).mean()) * tool.stickout / CARBIDE
        assert compliance(tool) == pytest.approx(want, rel=0.01)
        assert compliance(tool) > 0.99 * want  # chords of the large arc lie inside it
        force = 100.0
        stress = 32.0 * force * np.maximum(z - 1.0, 0.0) / (math.pi * d**3)
        assert bending_stress(tool, force, 2.0)[0] <= 1.05 * stress.max()


def test_diameter_and_edge_are_those_of_the_outline():
    for tool in random_mills(6, 40):
        depth = np.linspace(0.01, 0.99, 20) * tool.flute_length
        wide = diameters_in_cut(tool, depth)
        assert wide.tolist() == [diameter_in_cut(tool, float(a)) for a in depth]
        assert (np.diff(wide) >= -1e-12).all() and wide.max() <= tool.diameter + 1e-9
        edge, arcs = tool.arcs.edge_lengths(depth), tool.arcs
        for a, got in zip(depth, edge, strict=True):
            h = a * np.linspace(0.0, 1.0, 20_001)**2
            way = np.hypot(np.diff(h), np.diff(arcs.widths(h))).sum()
            assert 0.85 * way <= got <= 1.001 * way  # an arc counts as its chord
        one = np.ones_like(depth)
        forces = cutting_forces(2000.0, 0.25, 0.05 * one, depth, 0.3 * one, tool, 2)
        assert forces.tolist() == pytest.approx(
            [cutting_force(2000.0, 0.25, 0.05, float(a), 0.3, tool, 2) for a in depth])
