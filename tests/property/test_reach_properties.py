"""What must hold for reach over any part: thinner and longer tools, moved parts, fixtures."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import sample_surface, with_surface_normals
from tests.hand_parts import (
    SHORT_TOOLS,
    ball,
    bent_strip,
    blocks,
    box_mesh,
    dome,
    joined,
    low_walls,
    slope_field,
    tool,
    walls,
)
from zones.lattice import lattice_step
from zones.reach.assembly import Clearances
from zones.reach.tip_field import LOOKUP_STEP, TipField, touchable

LIFT = 0.005
MARGIN = 8.0  # of the fields: the same for tools of any diameter


SHAPES = {
    "walls": walls,
    "low walls": low_walls,
    "hollow": lambda: slope_field(lambda x, y: 0.12 * x * x - 0.04 * y * y + 0.3 * np.sin(2.0 * y), n=40),
    "dome": lambda: dome(radius=8.0, size=9.0, n=30),
    **{f"blocks {k}": lambda k=k: blocks(k) for k in range(6)},
}
@cache
def part(name):
    mesh = SHAPES[name]()
    s = sample_surface(mesh, 6.0, seed=4)
    return mesh, s.subset(s.normals[:, 2] > -0.02)


def reach(mesh, samples, body, clear=None, bounds=None):
    """by_cutter, by_tool and tips of the samples; ``bounds`` where the mesh holds more than the part."""
    field = TipField(TriangleTree(mesh), body, clear or Clearances(), mesh.bounds if bounds is None else bounds,
                     MARGIN, lattice_step(body))
    return touchable(field, samples.points, samples.normals, LIFT)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("kind", ["ball", "flat", "bull"])
def test_a_thinner_cutter_reaches_no_less(kind, name):
    mesh, samples = part(name)
    corner = {"ball": lambda d: d / 2, "flat": lambda d: 0.0, "bull": lambda d: 0.2}[kind]
    before = None
    for diameter in (6.0, 4.0, 2.5, 1.5, 0.8):
        # the shank no wider than the cutter: a wide one may well stand clear of a wall beside a thick cutter only
        by_cutter, by_tool, _ = reach(mesh, samples, tool(diameter, corner(diameter), shank=diameter))
        assert (by_cutter == by_tool).all()
        if before is not None:
            assert not (before & ~by_tool).any()
        before = by_tool
    assert before.any()


def test_thinner_cutters_do_reach_more():
    for name in ("low walls", "blocks 1", "hollow"):
        mesh, samples = part(name)
        share = [reach(mesh, samples, ball(d))[1].mean() for d in (6.0, 1.5)]
        assert share[1] > share[0] + 0.02, name


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("kind", SHORT_TOOLS)
@pytest.mark.parametrize("longer", [{"flute_length": 6.0}, {"neck_length": 4.0}, {"stickout": 9.0},
                                    {"neck_length": 7.0, "stickout": 9.0}],
                         ids=lambda c: " ".join(c))
def test_a_longer_tool_reaches_no_less(longer, kind, name):
    mesh, samples = part(name)
    short = SHORT_TOOLS[kind]
    by_cutter, by_tool, _ = reach(mesh, samples, short)
    more_cutter, more_tool, _ = reach(mesh, samples, replace(short, **longer))
    assert (by_cutter == more_cutter).all()
    assert not (by_tool & ~more_tool).any()
    assert not (more_tool & ~more_cutter).any()


@pytest.mark.parametrize("kind", SHORT_TOOLS)
def test_neck_and_stickout_do_count(kind):
    mesh, samples = part("walls")
    short = SHORT_TOOLS[kind]
    high_neck, high_holder, both = (int(reach(mesh, samples, replace(short, **change))[1].sum()) for change in (
        {"neck_length": 7.0}, {"stickout": 14.0}, {"neck_length": 7.0, "stickout": 14.0}))
    assert both > 1.1 * high_neck and both > 1.1 * high_holder


def moved(samples, mesh, angle, shift):
    c, s = math.cos(angle), math.sin(angle)
    matrix = np.array([[c, -s, 0, shift[0]], [s, c, 0, shift[1]], [0, 0, 1, shift[2]], [0, 0, 0, 1.0]])
    turn = matrix[:3, :3]
    return (mesh.transformed(matrix),
            replace(samples, points=np.ascontiguousarray(samples.points @ turn.T + matrix[:3, 3]),
                    normals=np.ascontiguousarray(samples.normals @ turn.T)))


MOVES = [(0.0, (3.37, -120.11, 0.0)), (math.pi / 2, (0.0, 0.0, 0.0)), (0.7, (11.0, 4.0, -30.0)),
         (2.9, (-0.03, 0.07, 5.0))]


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("move", MOVES, ids=lambda m: f"{m[0]:.1f}")
def test_reach_moves_with_the_part(move, name):
    mesh, samples = part(name)
    there_mesh, there = moved(samples, mesh, *move)
    for kind, body in SHORT_TOOLS.items():
        by_cutter, by_tool, _ = reach(mesh, samples, body)
        cutter_there, tool_there, _ = reach(there_mesh, there, body)
        # the cutter is exact: only samples at the very limit may turn over, and where a flat bottom is put over a
        # sample in one of eight directions, those that need just one between them
        assert (by_cutter != cutter_there).mean() <= (0.004 if kind == "ball" else 0.02)
        # shank and holder: between an assembly wider and one narrower by the diagonal of the look-up
        diagonal = LOOKUP_STEP * math.sqrt(2.0)
        wide = Clearances(shank=0.2 + diagonal, holder=1.0 + diagonal)
        slim = Clearances(shank=0.2 - diagonal, holder=1.0 - diagonal)
        sure, may = reach(mesh, samples, body, wide)[1], reach(mesh, samples, body, slim)[1]
        assert (sure & ~tool_there).mean() <= 0.004 + (by_cutter != cutter_there).mean()
        assert (tool_there & ~may).mean() <= 0.004 + (by_cutter != cutter_there).mean()
        assert abs(by_tool.mean() - tool_there.mean()) <= 0.06


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("kind", SHORT_TOOLS)
def test_a_fixture_never_adds_reach(kind, name):
    mesh, samples = part(name)
    rng = np.random.default_rng(9)
    by_cutter, by_tool, _ = reach(mesh, samples, SHORT_TOOLS[kind])
    lo, hi = mesh.bounds
    for _ in range(3):
        corner = lo + rng.uniform(-0.2, 0.9, 3) * (hi - lo)
        clamp = box_mesh(corner, corner + rng.uniform(1.0, 5.0, 3))
        fixed_cutter, fixed_tool, _ = reach(joined(mesh, clamp), samples, SHORT_TOOLS[kind], bounds=mesh.bounds)
        assert not (fixed_cutter & ~by_cutter).any()
        assert not (fixed_tool & ~by_tool).any()


def test_a_fixture_over_a_floor_takes_what_it_covers():
    mesh, samples = part("low walls")
    clamp = box_mesh([5.0, 2.0, 2.0], [9.0, 6.5, 4.0])
    before = reach(mesh, samples, ball(2.0))[1]
    after = reach(joined(mesh, clamp), samples, ball(2.0), bounds=mesh.bounds)[1]
    p = samples.points
    under = (p[:, 0] > 5) & (p[:, 0] < 9) & (p[:, 1] > 2) & (p[:, 1] < 6.5) & (p[:, 2] < 2.001)
    assert before[under].mean() > 0.7 and not after[under].any()
    far = p[:, 0] < 3.0
    assert (before[far] == after[far]).all()


CHORD = 0.003


def share_reached(mesh, body, exact=True):
    """Share of the samples of a strip, its rim included, that a tool touches within 1.5 chords of the mesh."""
    s = sample_surface(mesh, 60.0, seed=3)
    if exact:
        s = with_surface_normals(s, mesh)
    field = TipField(TriangleTree(mesh), body, Clearances(), mesh.bounds, MARGIN, lattice_step(body))
    return touchable(field, s.points, s.normals, 1.5 * CHORD)[1].mean()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ["ball", "flat", "bull"])
@pytest.mark.parametrize("upright", [True, False])
def test_a_cutter_thinner_than_a_round_reaches_it_whole(seed, kind, upright):
    if kind == "flat" and not upright:
        pytest.skip("a sharp end reaches slopes at steps only")
    if kind == "bull" and not upright:
        pytest.skip("of a trough a bull's flat bottom reaches what its corner fits into")
    rng = np.random.default_rng(seed)
    radius = rng.uniform(0.8, 9.0)
    mesh = bent_strip(radius, CHORD, upright=upright, seed=seed)
    # up to the play a tool must have beside a wall, half of it on either side
    for thick in (0.3, 0.6, 0.8, 0.95, (radius - 0.11) / radius):
        if thick > (radius - 0.11) / radius:
            continue
        r = thick * radius
        body = tool(2 * r, {"ball": r, "flat": 0.0, "bull": 0.4 * r}[kind], shank=2 * r)
        assert share_reached(mesh, body) == 1.0, (radius, thick)


@pytest.mark.parametrize("upright", [True, False])
def test_normals_of_facets_keep_a_cutter_out_of_a_round(upright):
    """The sideways shift of the contact, R delta, brings the axis nearer to the wall than the lift makes up for."""
    mesh, body = bent_strip(5.0, CHORD, upright=upright), ball(8.0, shank=8.0)
    assert share_reached(mesh, body, exact=False) < 0.9
    assert share_reached(mesh, body) == 1.0


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("upright", [True, False])
def test_any_cutter_reaches_a_bulge_whole(seed, upright):
    radius = np.random.default_rng(seed).uniform(0.3, 4.0)
    mesh = bent_strip(radius, CHORD, hollow=False, upright=upright, seed=seed)
    for r in (0.5, 3.0, 10.0):
        assert share_reached(mesh, ball(2 * r, shank=2 * r)) == 1.0, (radius, r)
        if upright:
            assert share_reached(mesh, tool(2 * r, 0.0, shank=2 * r)) == 1.0, (radius, r)


def test_a_cutter_thicker_than_a_round_reaches_its_ends_only():
    """It passes within the lift of the round up to the angle a, (R - radius)(1 - cos a) = lift, and a facet."""
    mesh = bent_strip(5.0, CHORD)
    ends = 2 * (math.acos(1 - (1.5 + 1.0) * CHORD / 1.0) + 2 * math.acos(1 - CHORD / 5.0))
    assert share_reached(mesh, tool(12.0, 0.0, shank=12.0)) < ends / (math.pi / 2)
