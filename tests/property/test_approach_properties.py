"""What must hold for the approach over any part: longer tools, thinner necks, moved parts, more obstacles."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import sample_surface
from tests.hand_parts import (
    HOLDER,
    SHORT_TOOLS,
    blocks,
    box_mesh,
    dome,
    joined,
    low_walls,
    slope_field,
)
from zones.reach.approach_cones import approach, directions_over_hemisphere
from zones.reach.assembly import Clearances

LIFT = 0.005
CLEAR = Clearances()
DIRECTIONS = directions_over_hemisphere(60, whole=True)
SHAPES = {
    "low walls": low_walls,
    "hollow": lambda: slope_field(lambda x, y: 0.12 * x * x - 0.04 * y * y + 0.3 * np.sin(2.0 * y), n=30),
    "dome": lambda: dome(radius=8.0, size=9.0, n=20),
    "blocks": lambda: blocks(3),
}


@cache
def part(name):
    mesh = SHAPES[name]()
    return mesh, sample_surface(mesh, 120.0 / float(mesh.areas.sum()), seed=4)


def asked(mesh, s, body, directions=DIRECTIONS):
    return approach(TriangleTree(mesh), body, CLEAR, s.points, s.normals, directions, LIFT)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("kind", SHORT_TOOLS)
@pytest.mark.parametrize("change", [{"neck_length": 4.0}, {"stickout": 9.0}, {"neck_length": 7.0, "stickout": 9.0},
                                    {"neck_diameter": 0.8}, {"shank_diameter": 2.6}, {"holder": HOLDER[:0]}],
                         ids=lambda c: " ".join(c))
def test_a_longer_or_thinner_assembly_never_loses_a_direction(change, kind, name):
    mesh, s = part(name)
    before = asked(mesh, s, SHORT_TOOLS[kind])
    after = asked(mesh, s, replace(SHORT_TOOLS[kind], **change))
    assert before.any() and not (before & ~after).any()
    if "stickout" in change and "neck_length" in change:
        assert after.sum() > before.sum()


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("kind", SHORT_TOOLS)
def test_moving_part_and_directions_together_changes_nothing(kind, name):
    mesh, s = part(name)
    before = asked(mesh, s, SHORT_TOOLS[kind])
    rng = np.random.default_rng(8)
    for _ in range(3):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turn *= np.sign(np.linalg.det(turn))
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn, rng.uniform(-50, 50, 3)
        there = replace(s, points=s.points @ turn.T + matrix[:3, 3], normals=s.normals @ turn.T)
        after = asked(mesh.transformed(matrix), there, SHORT_TOOLS[kind], DIRECTIONS @ turn.T)
        # a flat end on a level place tries fixed positions of the axis frame, and that frame turns about the axis
        skip = np.zeros_like(before) if kind == "ball" else s.normals @ DIRECTIONS.T > 1 - 1e-6
        assert ((before != after) & ~skip).sum() == 0


@pytest.mark.parametrize("name", SHAPES)
def test_a_fixture_never_adds_a_direction(name):
    mesh, s = part(name)
    before = asked(mesh, s, SHORT_TOOLS["ball"])
    lo, hi = mesh.bounds
    clamp = box_mesh(lo + 0.3 * (hi - lo), lo + [0.6, 0.6, 1.3] * (hi - lo))
    after = asked(joined(mesh, clamp), s, SHORT_TOOLS["ball"])
    assert not (after & ~before).any() and after.sum() < before.sum()
