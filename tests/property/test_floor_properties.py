"""Level floor between upright walls that meet at any angle, lying any way: reach and passes against plane geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from geometry.mesh_queries.drop import drop_tips
from tests.hand_parts import box_mesh, field_of, joined, tool
from tests.plan_checks import dense
from toolpath.strategies import planar_floor
from zones.reach.tip_field import INSIDE, touchable

LIFT, CHORD = 0.002, 0.002
LONG = 14.0  # mm, of the walls
SPACING = 0.02  # mm, of the places looked at along a line
TOOLS = [tool(4.0, 0.0), tool(4.0, 0.5), tool(1.5, 0.0)]
CASES = [(90.0, 0.0), (90.0, 22.5), (180.0, 22.5), (180.0, 7.0), (60.0, 35.0), (25.0, 50.0), (25.0, 0.0)]
cases = pytest.mark.parametrize(("opening", "turn"), CASES)
tools = pytest.mark.parametrize("body", TOOLS, ids=lambda b: f"{b.kind}{b.diameter:g}")


def turned(mesh, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return mesh.transformed(np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))


def wedge(opening, turn):
    """A plate at z = 0 and two upright walls from the origin, ``opening`` degrees apart and lying any way."""
    left = turned(box_mesh([-2, 0, 0], [LONG, 2, 5]), turn + opening / 2)
    right = turned(box_mesh([-2, -2, 0], [LONG, 0, 5]), turn - opening / 2)
    return joined(box_mesh([-20, -20, -2], [20, 20, 0]), left, right)


def inward(opening, turn):
    """(2, 2) unit normals of the walls in plan, into the wedge."""
    a, b = math.radians(turn + opening / 2 - 90), math.radians(turn - opening / 2 + 90)
    return np.array([[math.cos(a), math.sin(a)], [math.cos(b), math.sin(b)]])


def places(opening, turn, out, count=1500):
    """(n, 2) places of the wedge within ``out`` mm of the origin, half of them within 0.3 mm of a wall."""
    rng = np.random.default_rng(round(opening * 100 + turn))
    rho = out * np.sqrt(rng.uniform(0.0, 1.0, count))
    half = math.radians(opening / 2)
    beside = np.minimum(rng.uniform(1e-4, 0.3, count) / np.maximum(rho, 1e-3), half)
    angle = np.where(rng.uniform(size=count) < 0.5, rng.uniform(-half, half, count),
                     rng.choice([-1.0, 1.0], count) * (half - beside))
    angle += math.radians(turn)
    return np.column_stack([rho * np.cos(angle), rho * np.sin(angle)])


def off_free(xy, normals, radius):
    """Distance (n,) mm of places (n, 2) from where the axis of a cutter may stand: ``radius`` off both walls."""
    def onto(p, n):
        return p + np.maximum(radius - p @ n, 0.0)[:, None] * n

    first, second = onto(xy, normals[0]), onto(xy, normals[1])
    apex = radius * normals.sum(axis=0) / (1.0 + normals[0] @ normals[1])
    out = np.hypot(*(xy - apex).T)
    for foot, other in ((first, normals[1]), (second, normals[0])):
        free = foot @ other >= radius - 1e-12
        out[free] = np.hypot(*(xy - foot)[free].T)
    return np.where((xy @ normals.T >= radius).all(axis=1), 0.0, out)


def asked(body, opening, turn):
    """Field, points, what reach says of them, their tips, and how far free places are from them less the flat."""
    field = field_of(wedge(opening, turn), body)
    xy = places(opening, turn, LONG - body.diameter - 1.0)
    points = np.column_stack([xy, np.zeros(len(xy))])
    _, takes, tips = touchable(field, points, np.tile([0.0, 0.0, 1.0], (len(xy), 1)), LIFT)
    short = off_free(xy, inward(opening, turn), body.radius) - (body.radius - body.corner_radius)
    return field, points, takes, tips, short


@tools
@cases
def test_reach_over_a_floor_is_that_of_plane_geometry(opening, turn, body):
    field, _, takes, _, short = asked(body, opening, turn)
    assert takes.mean() > 0.05
    assert short[takes].max() <= 0.0  # nothing that cannot be touched
    missed = ~takes & (short < -INSIDE - 1e-4)
    # beside one wall nothing is missed, in a corner what is covered from the end of the free region alone
    assert not missed.any() if opening == 180.0 else short[missed].min(initial=0.0) > -1.1 * field.lattice.step
    assert missed.mean() < (0.005 if opening >= 60.0 else 0.05)


@tools
@cases
def test_level_passes_touch_all_that_is_in_reach(opening, turn, body):
    field, points, takes, tips, _ = asked(body, opening, turn)
    points, tips = points[takes], tips[takes]
    flat = body.radius - body.corner_radius
    left = np.arange(len(points))
    counts = []
    for finer in range(planar_floor.MAX_FINER + 1):
        lines = [line for group in planar_floor.planes(field, tips[left], CHORD, finer) for line in group]
        walked = np.vstack([dense(line.points, SPACING) for line in lines])
        assert np.ptp(walked[:, 2]) == 0.0  # level, whatever stands beside it
        low = drop_tips(field.tree, walked[:, :2], body.radius - 2 * INSIDE, max(body.corner_radius - 2 * INSIDE, 0.0))
        assert (low <= LIFT + 1e-6).all()
        # a place between two that are looked at is no farther off than half of what lies between
        away = cKDTree(walked[:, :2]).query(points[left, :2])[0]
        left = left[away > flat + INSIDE + (math.hypot(flat, SPACING / 2) - flat)]
        counts.append(len(left))
        if not len(left):
            break
    assert counts[-1] == 0, counts
