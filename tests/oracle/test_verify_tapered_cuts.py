"""Cuts of tapered mills by closed forms: what stays on walls, lines and grids of stock, engaged angles, necks."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.tool_body import ToolBody
from tests.hand_parts import box_mesh
from verify.kernels.stock import NECK, PLUNGE
from verify.kernels.surface.remains import _carried, fill_pieces
from verify.material.engagement import engaged_angles, in_parts
from verify.material.stock_field import run_field, stock_field
from verify.material.stock_lines import blank, run_stock
from verify.model import ProofSetup
from verify.moves import BOW, Moves, cutter_sizes, cutter_table
from verify.surface.removal import residual_on_normals
from verify.tool_axes import ToolAxes
from verify.tool_bodies import Bodies

BLANK = ProofSetup(stock_kind="box", margin=0.0, uncertainty=0.0, line_spacing=0.1)
ENDS = {"ball": 0.5, "bull": 0.2, "flat": 0.0}  # corner radius, mm, of a tip of 1 mm


def mill(end, degrees, flutes=6.0):
    tool = ToolBody("T1", 1, 1.0, ENDS[end], flutes, 1.0, flutes, 1.0, 25.0, taper=math.tan(math.radians(degrees)))
    return replace(tool, neck_diameter=2.0 * tool.widest_radius, shank_diameter=2.0 * tool.widest_radius)


def profile(tool, rho):
    """Height of the cutting part over its tip at distances rho from the axis."""
    a, r, (wide, high) = tool.radius - tool.corner_radius, tool.corner_radius, tool.corner_end
    over = np.clip(rho - a, 0.0, wide - a)
    return r - np.sqrt(np.maximum(r * r - over * over, 0.0)) + np.where(
        rho > wide, high + (rho - wide) / tool.taper - (r - np.sqrt(np.maximum(r * r - (wide - a)**2, 0.0))), 0.0)


def along(*tips, axis=None):
    at = np.array(tips, float)
    n = len(at) - 1
    axes = None if axis is None else ToolAxes.between(np.tile(axis, (n, 1)), np.tile(axis, (n, 1)))
    return Moves(at[:-1].copy(), at[1:].copy(), np.ones(n, bool), np.zeros(n, np.int32), axes)


def turned_about_y(degrees):
    """Takes the Z axis to an axis that leans towards X."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


@pytest.mark.parametrize("lean", [0.0, 30.0])
@pytest.mark.parametrize("degrees", [3.0, 2.0, 4.5])
@pytest.mark.parametrize("end", ENDS)
def test_what_a_groove_leaves_on_a_wall_of_three_degrees(end, degrees, lean):
    """Nothing where the side leans as the wall does; one that leans less leaves a wedge, one that leans more cuts."""
    tool, like = mill(end, degrees), mill(end, 3.0)
    (wide, high), (w, h0) = tool.corner_end, like.corner_end
    h = np.linspace(0.2, 5.5, 41)
    h = h[h > max(h0, high)]
    c, s = math.cos(math.radians(3.0)), math.sin(math.radians(3.0))
    points = np.column_stack([np.zeros(len(h)), w + like.taper * (h - h0), h])
    normals = np.tile([0.0, -c, s], (len(h), 1))
    # the side is met where w + m (h - h0) - t c = wide + m' (h + t s - high)
    want = (points[:, 1] - wide - tool.taper * (h - high)) / (c + tool.taper * s)
    spin = turned_about_y(lean)
    moves = along(*(np.array([[-30.0, 0, 0], [30.0, 0, 0]]) @ spin.T), axis=spin[:, 2] if lean else None)
    left, mover = residual_on_normals(points @ spin.T, normals @ spin.T, np.full(len(h), 3.0), moves, [tool])
    np.testing.assert_allclose(left, want, atol=1e-6)
    assert (mover == 0).all()
    if degrees == 3.0:
        assert abs(left).max() < 1e-6


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("lean", [0.0, 20.0])
def test_a_tool_that_turns_leaves_what_standing_tools_on_its_way_leave(end, lean):
    """Chords of the turning move are known to ``BOW``, and rays that graze the tool to a little more."""
    tool, rng = mill(end, 8.0), np.random.default_rng(4)
    a, b = (turned_about_y(v)[:, 2] for v in (lean, lean + 12.0))
    moves = Moves(np.array([[0.0, 0, 0]]), np.array([[4.0, 1, 0.5]]), np.ones(1, bool), np.zeros(1, np.int32),
                  ToolAxes.between(a[None], b[None]))
    points = rng.uniform([-1, -2, 0], [6, 3, 6], (90, 3))
    normals = rng.normal(size=(90, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    left, _ = residual_on_normals(points, normals, np.full(90, 2.0), moves, [tool])
    cutters = cutter_table([tool])
    pieces, k = fill_pieces(np.array([0]), 1, moves.arrays, moves.axes.arrays(1e-6), cutters, np.array([9.0]), 0.0, 0.0,
                            0.0, 1e3)
    met = 0
    for p, n, t in zip(points, normals, left.tolist(), strict=True):
        near = [min(_carried(*(p + v * n), row, j, cutters) for row, j in zip(pieces, k, strict=True))
                for v in np.linspace(0.0, t, 25)]
        if t < 0.0:  # inside: what the deepest piece leaves lies within others
            assert max(near) < 3.0 * BOW
            continue
        assert min(near) > -3.0 * BOW
        if t < 2.0:
            met += 1
            assert abs(near[-1]) < 3.0 * BOW
    assert met > 3


@pytest.mark.parametrize("degrees", [3.0, 20.0])
@pytest.mark.parametrize("end", ENDS)
def test_a_slot_leaves_its_profile_on_every_line(end, degrees):
    tool = mill(end, degrees)
    field = blank(box_mesh((-5, -4, -9), (5, 4, 0)), 0.1, BLANK)
    run = run_stock(field, along((-20, 0, -3), (20, 0, -3)), [tool], BLANK)
    y = field.origin[1] + (np.arange(field.height.shape[1]) + 0.5) * field.step
    want = np.minimum(-3.0 + profile(tool, np.abs(y)), 0.0)
    held = field.height > -20
    np.testing.assert_allclose(field.height[held], np.broadcast_to(want, field.height.shape)[held], atol=1e-12)
    assert len(run.events) == 0
    # all of the front is in the cut, and the cut is as deep as the slot
    moves = along((-20, 0, -3), (20, 0, -3))
    parts, _ = in_parts(moves, [tool])
    angle = engaged_angles(run.engaged, parts, [tool])
    inside = np.abs(parts.start[:, 0]) < 3.0
    assert angle[inside].min() > math.pi - 0.11
    assert run.ways.depth.max() == pytest.approx(3.0, abs=1e-9)
    wide = 2.0 * (tool.corner_end[0] + tool.taper * (3.0 - tool.corner_end[1]))
    rho = (np.arange(1000) + 0.5) / 2000.0 * wide
    area = float((3.0 - profile(tool, rho)).mean()) * wide
    assert run.ways.volume.sum() == pytest.approx(10.0 * area, rel=0.03)


def test_a_side_that_skims_a_wall_is_no_deep_cut():
    """What a cone takes off a wall of its own slope, a hundredth of its way aside, says nothing of the depth."""
    tool = mill("flat", 3.0)
    field = blank(box_mesh((-5, -4, -9), (5, 4, 0)), 0.1, BLANK)
    moves = along((-20, 0, -3), (20, 0, -3), (20, 0.002, -3), (-20, 0.002, -3))
    run = run_stock(field, moves, [tool], BLANK)
    first = np.flatnonzero(in_parts(moves, [tool])[1] == 2)
    assert run.ways.depth[first].max() == 0.0 and run.ways.volume[first].sum() > 0.0


def volume(tool, deep):
    """Of a hole bored straight down, by thin discs."""
    z = (np.arange(20_000) + 0.5) / 20_000 * deep
    a, r, (wide, high) = tool.radius - tool.corner_radius, tool.corner_radius, tool.corner_end
    low = np.minimum(z, high)
    rho = np.where(z < high, a + np.sqrt(np.maximum(low * (2.0 * r - low), 0.0)), wide + tool.taper * (z - high))
    return float((math.pi * rho**2).mean() * deep)


@pytest.mark.parametrize("end", ENDS)
def test_the_volume_of_a_bored_hole_on_the_grid(end):
    tool, deep = mill(end, 12.0), 5.0
    field = stock_field(box_mesh((-4, -4, -8), (4, 4, 0)), BLANK, 0.06)
    up = np.array([0.0, 0.0, 1.0])
    run = run_field(field, along((0, 0, 2), (0, 0, -deep), axis=up), [tool], BLANK)
    assert run.ways.volume.sum() == pytest.approx(volume(tool, deep), rel=0.01)
    # and straight into full stock it is a plunge, as deep as the hole less the mean depth of the end
    plunge = [e for e in run.events if e[1] == PLUNGE]
    assert len(plunge) == 1 and plunge[0][2] == pytest.approx(deep, rel=0.03)


@pytest.mark.parametrize("lean", [10.0, 25.0])
def test_the_volume_of_a_leaning_hole_on_the_grid(lean):
    """A cone cut off by the top face: its section is an ellipse. The tip is the flat of a tapered_flat."""
    tool, along_axis = mill("flat", 15.0), 4.0
    axis = turned_about_y(lean)[:, 2]
    field = stock_field(box_mesh((-5, -4, -7), (6, 4, 0)), BLANK, 0.06)
    run = run_field(field, along(3.0 * axis, -along_axis * axis, axis=axis), [tool], BLANK)
    below = tool.radius / tool.taper  # from the tip to where the cone ends
    whole, t, b = along_axis + below, math.radians(lean), math.radians(15.0)
    across = whole * math.sin(b) * math.cos(t) / math.sqrt(math.cos(t + b) * math.cos(t - b))
    long = whole * math.sin(b) * math.cos(b) * math.cos(t) / (math.cos(t + b) * math.cos(t - b))
    want = math.pi * long * across * whole * math.cos(t) / 3.0 - math.pi * tool.radius**2 * below / 3.0
    # the flutes end over the top face on the lower side, and the rim of the box does not reach there
    assert tool.flute_length * math.cos(t) - tool.widest_radius * math.sin(t) > along_axis * math.cos(t)
    assert run.ways.volume.sum() == pytest.approx(want, rel=0.01)


@pytest.mark.parametrize("end", ENDS)
def test_a_plunge_of_a_tapered_mill_on_lines(end):
    tool, down = mill(end, 5.0), along((0, 0, 1), (0, 0, -2))
    field = blank(box_mesh((-6, -6, -10), (6, 6, 0)), 0.1, BLANK)
    worst = max(e[2] for e in run_stock(field, down, [tool], BLANK).events if e[1] == PLUNGE)
    assert worst == pytest.approx(2.0, abs=0.02)
    # a ramp over a groove that it leaves is none
    ramp = along((-5, 0, 0), (5, 0, -0.4), (-5, 0, -0.8), (5, 0, -1.2))
    field = blank(box_mesh((-6, -6, -10), (6, 6, 0)), 0.1, BLANK)
    assert not len(run_stock(field, ramp, [tool], BLANK).events)


def test_a_neck_may_be_as_wide_as_the_end_of_the_cone():
    tool = mill("ball", 5.0)
    assert 2.0 * tool.widest_radius > 1.9 > tool.diameter
    for neck, clearance in ((2.0 * tool.widest_radius, 0.0), (2.0 * tool.widest_radius - 0.02, 0.005), (1.0, None)):
        rows = Bodies.of([replace(tool, neck_diameter=neck, neck_length=12.0)], BLANK).rows
        own = rows[rows[:, 5] == NECK]
        assert own[:, 0].tolist() == [tool.flute_length] and own[:, 1].tolist() == [12.0]
        assert own[0, 2] - own[0, 4] == pytest.approx(0.5 * neck)
        assert own[0, 4] == pytest.approx(BLANK.clearance_neck if clearance is None else clearance)
    assert cutter_sizes(tool).radius == pytest.approx(tool.widest_radius)


def test_the_neck_over_a_cone_meets_what_the_flutes_did_not_reach():
    """A slot deeper than the flutes are long: the stock beside the neck is in its way, unless the neck is thin."""
    thick, thin = mill("ball", 5.0, 3.0), replace(mill("ball", 5.0, 3.0), neck_diameter=0.5, neck_length=8.0)
    for tool, meets in ((thick, True), (thin, True)):
        field = blank(box_mesh((-5, -4, -9), (5, 4, 0)), 0.1, BLANK)
        run = run_stock(field, along((-20, 0, -4), (20, 0, -4)), [tool], BLANK)
        assert any(e[2] > e[3] for e in run.events) == meets
    # slots one over the other, each no deeper than the flutes, are free for the thin one
    for tool, meets in ((thick, True), (thin, False)):
        field = blank(box_mesh((-5, -4, -9), (5, 4, 0)), 0.1, BLANK)
        events = [e for z in (-2.0, -4.0)
                  for e in run_stock(field, along((-20, 0, z), (20, 0, z)), [tool], BLANK).events]
        assert any(e[2] > e[3] for e in events) == meets
