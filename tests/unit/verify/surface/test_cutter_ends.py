"""Ends of cutters where paths turn, against closed forms on an inclined plane and at a wall."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.tool_body import ToolBody
from tests.hand_parts import box_mesh, prism, terraces, tool
from verify.findings import Source
from verify.model import ProofSetup
from verify.moves import Moves
from verify.surface.cutter_ends import rapid_presses, tip_gouges, turning_feet
from verify.tool_axes import ToolAxes

DEG = 20.0
WIDE = 30.0
HIGH = WIDE * math.tan(math.radians(DEG))
NORMAL = np.array([math.sin(math.radians(DEG)), 0.0, math.cos(math.radians(DEG))])


def slope():
    """A wedge that falls along X from HIGH to 0."""
    part = prism([(0.0, 0.0), (WIDE, 0.0), (0.0, HIGH)], [(0, 1, 2)], 10.0)
    return TriangleTree(part.mesh)


def moves(*tips):
    at = np.array(tips, float)
    n = len(at) - 1
    return Moves(at[:-1].copy(), at[1:].copy(), np.ones(n, bool), np.zeros(n, np.int32))


def tip_of(body, depth, x=12.0, y=1.234):
    """The tip of a tool over x that stands ``depth`` mm deep in the slope."""
    ring, ball = body.radius - body.corner_radius, body.corner_radius
    face = HIGH - (x - ring) * math.tan(math.radians(DEG))  # under the middle of the corner, uphill
    return np.array([x, y, face + (ball - depth) / NORMAL[2] - ball])


@pytest.mark.parametrize("body", [tool(6.0, 0.0), tool(6.0, 3.0), tool(6.0, 1.0), tool(0.12, 0.0), tool(0.12, 0.06)])
@pytest.mark.parametrize("depth", [0.012, 0.002])
def test_the_deepest_place_of_a_dip_into_a_slope_is_found(body, depth):
    tip = tip_of(body, depth)
    feet, _ = turning_feet(slope(), moves(tip + [0, 0, 2.0], tip, tip + [0, 0, 2.0]), [body], 1.2 * depth)
    assert len(feet.points)
    ring, ball = body.radius - body.corner_radius, body.corner_radius
    deepest = tip + [-ring - ball * NORMAL[0], 0.0, ball * (1.0 - NORMAL[2])]
    away = np.linalg.norm(feet.points - (deepest + depth * NORMAL), axis=1)
    assert away.min() < max(0.012 * body.radius, 1e-6)  # along the rim, where the depth hardly changes
    assert feet.normals[away.argmin()] == pytest.approx(NORMAL, abs=1e-6)


def test_a_path_that_goes_on_gives_none_and_neither_does_one_that_stays_within_the_tolerance():
    body = tool(6.0, 3.0)
    row = [tip_of(body, 0.05, y=y) for y in (-14.0, 0.0, 14.0)]
    assert not len(turning_feet(slope(), moves(*row), [body], 0.01)[0].points)
    tip = tip_of(body, 0.0039)
    assert not len(turning_feet(slope(), moves(tip + [0, 0, 2.0], tip, tip + [0, 0, 2.0]), [body], 0.01)[0].points)


def test_the_depths_are_those_of_the_dips():
    body, depths = tool(1.0, 0.5), [0.02, 0.05, 0.011]
    tips = [tip_of(body, d, y=3.0 * k) for k, d in enumerate(depths)]
    path = [p for tip in tips for p in (tip + [0, 0, 2.0], tip, tip + [0, 0, 2.0])]
    feet, _ = turning_feet(slope(), moves(*path), [body], 0.01)
    own = [feet.depth[np.abs(feet.points[:, 1] - 3.0 * k) < 0.1].max() for k in range(3)]
    assert own == pytest.approx(depths, abs=1e-6)
    assert (np.diff(feet.depth) <= 0.0).all()


def test_a_thin_tool_is_followed_along_its_way():
    body = tool(0.12, 0.06)
    row = [tip_of(body, 0.02, y=y) for y in (-0.5, 0.5)]
    feet, _ = turning_feet(slope(), moves(row[0] - [0, 40.0, 0], *row, row[1] + [0, 40.0, 0]), [body], 0.01)
    gaps = np.diff(np.unique(np.round(feet.points[:, 1], 6)))
    assert len(feet.points) > 180 and gaps.max() < 0.11


def test_few_places_along_a_long_way_are_told():
    body = tool(6.0, 0.0)
    tips = [np.array([15.0, y, 12.0]) for y in (-8.0, 8.0) * 1000]
    _, notes = turning_feet(slope(), moves(*tips), [body], 0.01)
    assert len(notes) == 1 and notes[0].what == "between_samples" and "T1" in notes[0].effect and notes[0].value > 0.5
    assert not turning_feet(slope(), moves(*tips[:100]), [body], 0.01)[1]


def test_a_stretch_of_a_wall_that_is_bitten_from_the_side():
    mesh = terraces([0, 20, 40], [0, 30], [[0.0, 8.0]], -5.0)
    body = tool(6.0, 0.0)
    out, bite = np.array([15.0, 10.0, 0.0]), np.array([17.03, 10.0, 0.0])
    feet, _ = turning_feet(TriangleTree(mesh), moves(out, bite, out), [body], 0.01)
    on_wall = feet.points[np.abs(feet.points[:, 0] - 20.0) < 1e-9]
    assert len(on_wall) and np.abs(on_wall[:, 1] - 10.0).min() < 0.02 and on_wall[:, 2].max() == pytest.approx(0.05)


@pytest.mark.parametrize("corner", [0.0, 0.3, 1.0])
def test_the_upper_end_of_a_cone_that_bites_into_a_wall(corner):
    """Beside a wall that is higher than the flutes, the rim where they end is nearer than all below it."""
    mesh = terraces([0, 20, 40], [0, 30], [[0.0, 8.0]], -5.0)
    body = replace(tool(2.0, corner), flute_length=5.0, neck_length=5.0, taper=math.tan(math.radians(10.0)))
    deep = 0.03
    out, bite = (np.array([20.0 - body.widest_radius + d, 10.0, 0.5]) for d in (-2.0, deep))
    feet, _ = turning_feet(TriangleTree(mesh), moves(out, bite, out), [body], 0.01)
    k = int(np.argmax(feet.depth))
    assert feet.depth[k] == pytest.approx(deep, abs=1e-3)
    assert feet.points[k] == pytest.approx([20.0, 10.0, 5.5], abs=0.02)


@pytest.mark.parametrize("kind", ["straight on", "in place"])
def test_a_rim_is_looked_at_where_its_axis_turns_back(kind):
    """A cone beside an upright wall leans towards it and back: its upper rim is deepest where the turn ends."""
    over, lean = 0.02, math.radians(15.0)
    mill = ToolBody("T1", 1, 1.0, 0.0, 2.0, 0.7, 20.0, 0.7, 20.0, taper=math.tan(math.radians(20.0)))
    reach = 2.0 * math.sin(lean) + mill.widest_radius * math.cos(lean)
    way = 0.05 + 0.5 * np.arange(3) if kind == "straight on" else np.full(3, 0.05)
    tips = np.column_stack([way, np.full(3, 1.0 - reach + over), np.full(3, -3.5)])
    axes = np.array([[0.0, 0.0, 1.0], [0.0, math.sin(lean), math.cos(lean)], [0.0, 0.0, 1.0]])
    moves = Moves(tips[:2], tips[1:], np.ones(2, np.bool_), np.zeros(2, np.int64), ToolAxes.between(axes[:2], axes[1:]))
    wall = box_mesh([-10.0, 1.0, -4.0], [10.0, 3.0, 0.0])
    feet, _ = turning_feet(TriangleTree(wall), moves, [mill], 0.01)
    assert len(feet.depth) and feet.depth.max() == pytest.approx(over, abs=1e-3)


OVERHANG = prism([(6.0, 8.0), (10.0, 4.0), (10.0, 0.0), (16.0, 0.0), (16.0, 10.0), (6.0, 10.0)],
                 [(0, 1, 5), (1, 4, 5), (1, 2, 3), (1, 3, 4)], 12.0)  # x + z = 14 faces down


@pytest.mark.parametrize("depth", [0.03, 0.08, -0.01])
@pytest.mark.parametrize("y", [4.513, 3.07])
def test_the_upper_rim_of_a_slot_cutter_under_an_overhang_is_found(depth, y):
    body = replace(tool(2.0, 0.0, neck=18.0, stickout=30.0), flute_length=0.5, neck_diameter=0.7)
    x = 14.0 - 7.511 - 1.0 + depth * math.sqrt(2.0)
    at = [(x - 4.0, y, 7.011), (x, y, 7.011), (x - 4.0, y, 7.011)]
    feet, _ = turning_feet(TriangleTree(OVERHANG.mesh), moves(*at), [body], 0.01)
    assert (len(feet.points) > 0) == (depth > 0)
    assert not len(feet.depth) or feet.depth.max() == pytest.approx(depth, rel=0.02)
    thick = replace(body, neck_diameter=2.0)  # a side that goes on up meets the overhang with all its length
    assert len(turning_feet(TriangleTree(OVERHANG.mesh), moves(*at), [thick], 0.01)[0].points) == 0


@pytest.mark.parametrize("angle, diameter, depth", [(150.0, 4.0, 0.03), (90.0, 3.0, 0.02), (120.0, 2.0, 0.03)])
def test_the_rim_of_a_chamfer_mill_pressed_aside_into_a_wall_is_found(angle, diameter, depth):
    high = 0.5 * diameter / math.tan(math.radians(0.5 * angle))
    body = ToolBody("T1", 1, diameter, 0.0, high, 0.8, 18.0, 0.8, 30.0, (), "chamfer", 0.0, high)
    wall = TriangleTree(box_mesh((8.0, 0.0, 0.0), (16.0, 12.0, 9.0)))
    at = (8.0 - 0.5 * diameter + depth, 4.513, 3.0)
    feet, _ = turning_feet(wall, moves((2.0, 4.513, 3.0), at, (2.0, 4.513, 3.0)), [body], 0.01)
    assert feet.depth.max() == pytest.approx(depth, rel=1e-6)


def test_the_point_of_a_chamfer_mill_is_found_along_its_way_and_in_rapids_without_clearance():
    plate, half = TriangleTree(box_mesh((0.0, 0.0, 0.0), (16.0, 12.0, 3.0))), math.radians(10.0)
    body = ToolBody("T1", 1, 3.0, 0.0, 8.6, 3.0, 8.6, 3.0, 30.0, (), "chamfer", 0.0, 1.5 / math.tan(half))
    across = moves((-5.0, 6.03, 2.95), (21.0, 6.03, 2.95))
    none = np.zeros(1, np.int32)
    gouges = tip_gouges(plate, across, [body], Source(("p",), none, none + 7, none + 1), 0.01)
    assert [(f.line, round(f.depth, 6)) for f in gouges] == [(7, 0.05)]
    setup = ProofSetup(clearance_rapid=0.0, gouge_tolerance=0.01)
    rapid = replace(across, feed=np.zeros(1, bool))
    found = rapid_presses(plate, rapid, [body], setup)
    assert found[:, 2].max() == pytest.approx(0.05) and set(found[:, 0]) == {0.0}
    assert not len(rapid_presses(plate, across, [body], setup))
    assert not len(rapid_presses(plate, rapid, [body], replace(setup, clearance_rapid=1.0)))
