"""Passes with a tool axis of their own everywhere: where they reach, what they leave, and where they must not go."""

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.parameterization.grid_map import GridMap
from geometry.surfaces.nurbs import NurbsSurface
from tests.hand_parts import ball, tool
from toolpath.five_axis.oriented_pass import enters, lead_and_tilt, leaned, posed
from toolpath.passes.forward_step import PassProfile, steps
from toolpath.passes.isoparametric_passes import Flank, IsoSurface, lay_out
from toolpath.passes.pass_family import FinishTarget
from toolpath.passes.trimmed_faces import TrimmedFace
from toolpath.strategies.isoparametric import course
from verify.moves import Moves
from verify.surface.removal import residual_on_normals
from verify.tool_axes import ToolAxes
from zones.reach.assembly import Clearances
from zones.reach.tip_field import TipField

SCALLOP, CHORD, RADIUS = 0.02, 0.004, 3.0
KNOTS = np.array([0.0, 0, 0, 1, 1, 1])


def wall(lean, bend=0.0, at=0.0, high=12.0):
    """30 mm long, leaning by degrees, bent along by 1/mm; its outside looks to less y. Below 0 it hangs over."""
    x, z = np.meshgrid([-15.0, 0.0, 15.0], [0.0, 0.5 * high, high], indexing="ij")
    y = at + np.tan(np.radians(lean)) * z + 0.5 * bend * np.array([225.0, -225.0, 225.0])[:, None]
    return NurbsSurface(np.stack([x, y, z], -1), KNOTS, KNOTS, (3, 3))


def tree_of(*surfaces):
    meshes = [s.discretised(0.02, 0.02) for s in surfaces]
    first = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return TriangleTree(TriangleMesh(np.vstack([m.vertices for m in meshes]),
                                     np.vstack([m.faces + n for m, n in zip(meshes, first, strict=False)])))


def opposite(at, high):
    """A wall that looks the other way."""
    net = wall(0.0, 0.0, at, high).control
    return NurbsSurface(net[::-1], KNOTS, KNOTS, (3, 3))


def walked(surface, body, field, tree, scallop=SCALLOP):
    """All passes over a surface: tips and axes of the pieces, and how much of them could not be walked, 0 to 1."""
    at = np.linspace(0.0, 1.0, 5)
    iso = IsoSurface(surface, GridMap.of(np.dstack(np.meshgrid(at, at))))
    blocked = enters(tree, body, Clearances())
    pieces, left, way = [], 0.0, 0.0
    for eta in lay_out(iso, body.corner_radius, scallop - CHORD).tolist():
        profile = PassProfile.of(iso.curve(eta), CHORD, body.corner_radius)
        made = posed(profile, steps(profile, body.corner_radius, CHORD, scallop), body, field, blocked, CHORD, 0.003)
        pieces += made.pieces
        left, way = left + sum(b - a for a, b in made.left), way + profile.length
    return pieces, left / way


def left_by(pieces, body, surface, count=60):
    """(n,) mm left on normals by the verifier, its tool turning with the moves."""
    start, end = (np.vstack([tip[k] for tip, _ in pieces]) for k in (slice(None, -1), slice(1, None)))
    a, b = (np.vstack([axis[k] for _, axis in pieces]) for k in (slice(None, -1), slice(1, None)))
    moves = Moves(start, end, np.ones(len(start), bool), np.zeros(len(start), np.int32), ToolAxes.between(a, b))
    uv = np.stack(np.meshgrid(np.linspace(0.02, 0.98, count), np.linspace(0.0, 1.0, count)), -1).reshape(-1, 2)
    points, normals = surface.points_and_normals(uv)
    return residual_on_normals(points, normals, np.full(len(points), 10.0), moves, [body])[0]


@pytest.mark.parametrize("bend", [0.03, -0.02])
def test_a_wall_that_hangs_over_is_reached_by_leaning(bend):
    surface, body = wall(-8.0, bend), ball(2.0 * RADIUS)
    tree = tree_of(surface)
    _, missed = walked(surface, body, leaned(0.0), tree)
    assert missed > 0.8  # upright, only its lower rim is free of the overhang
    pieces, missed = walked(surface, body, leaned(np.radians(15.0)), tree)
    assert missed == 0.0
    left = left_by(pieces, body, surface)
    assert 0.5 * SCALLOP < left.max() <= SCALLOP and left.min() > -1.05 * CHORD


@pytest.mark.parametrize("corner", [3.0, 1.0])
def test_lead_and_tilt_keep_the_scallop_of_a_ball_and_of_a_bull_nose(corner):
    surface, body = wall(25.0, 0.03), tool(6.0, corner)
    pieces, missed = walked(surface, body, lead_and_tilt(np.radians(6.0), np.radians(20.0)), tree_of(surface))
    assert missed == 0.0
    left = left_by(pieces, body, surface)
    assert left.max() <= SCALLOP and left.min() > -1.2 * CHORD


def test_a_course_over_a_face_is_walked_leaning_with_the_material_on_the_right():
    """The strategy as the planner calls it, on a wall an upright tool cannot touch."""
    surface, body = wall(-8.0, 0.02), ball(2.0 * RADIUS)
    tree = tree_of(surface)
    s = np.stack(np.meshgrid(np.linspace(0.02, 0.98, 60), np.linspace(0.0, 1.0, 40)), -1).reshape(-1, 2)
    points, normals = surface.points_and_normals(s)
    field = TipField(tree, body, Clearances(), np.array([points.min(axis=0), points.max(axis=0)]), 5.0, 0.2)
    face = TrimmedFace(3, surface, (np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]),), 360.0)
    found = course([face], FinishTarget(points, normals, points, 0.5), field, SCALLOP, CHORD, Flank(RADIUS, 0.0))
    free = enters(tree, body, Clearances())
    groups = []
    for stretches in found.groups:
        made = [posed(*s.stepped(RADIUS, SCALLOP, CHORD), body, leaned(np.radians(15.0)), free, CHORD, 0.003)
                for s in stretches]
        groups.append([one.reversed() if s.turned else one for s, one in zip(stretches, made, strict=True)])
    assert not any(one.left for group in groups for one in group)
    pieces = [piece for group in groups for one in group for piece in one.pieces]
    left = left_by(pieces, body, surface)
    assert left.max() <= SCALLOP and left.min() > -1.05 * CHORD
    for tip, _ in pieces:
        assert tip[-1, 0] < tip[0, 0]  # the wall is at greater y
    heights = [group[0].pieces[0][0][:, 2].mean() for group in groups]
    assert heights == sorted(heights, reverse=True)


def test_what_the_shank_would_hit_is_left_and_told():
    """In a channel 9 mm wide and 30 mm deep the tool of 6 mm has room to lean by about 5 degrees, no more."""
    surface = wall(-2.0, 0.0, 0.0, 12.0)
    body, tree = ball(2.0 * RADIUS), tree_of(surface, opposite(-9.0, 30.0))
    pieces, missed = walked(surface, body, leaned(np.radians(15.0)), tree)
    assert missed > 0.9
    pieces, missed = walked(surface, body, leaned(np.radians(4.0)), tree)
    assert missed == 0.0 and left_by(pieces, body, surface).max() <= SCALLOP


def test_the_centre_keeps_its_way_where_the_axis_turns_fast():
    """Straight tips and turning axes: the ball is off by a tenth of the tolerance at most between locations."""
    surface, body = wall(30.0, 0.0), ball(2.0 * RADIUS)

    def turning(contact, normal, way):
        angle = 0.4 * np.sin(contact[:, 0])
        return np.column_stack([np.sin(angle), -0.3 * np.ones(len(angle)), np.cos(angle)])

    pieces, missed = walked(surface, body, turning, tree_of(surface))
    assert missed == 0.0
    for tip, axis in pieces:
        middle = 0.5 * (tip[1:] + tip[:-1])
        between = axis[1:] + axis[:-1]
        between /= np.linalg.norm(between, axis=1)[:, None]
        centre = tip + RADIUS * axis
        off = middle + RADIUS * between - 0.5 * (centre[1:] + centre[:-1])
        assert np.linalg.norm(off, axis=1).max() <= 0.1 * CHORD + 1e-9
    left = left_by(pieces, body, surface)
    assert left.max() <= SCALLOP and left.min() > -1.2 * CHORD


def dome():
    """The top of a ball of 20 mm, 30 degrees to each side of its crest, crossed by a pass."""
    turn = np.radians(30.0)
    x, z, w = 20.0 * np.sin(turn), 20.0 * np.cos(turn), np.cos(turn)
    profile = np.array([[-x, z], [0.0, 20.0 / w], [x, z]])
    net = np.stack([np.insert(profile, 1, y, axis=1) for y in (-5.0, 5.0)], axis=1)
    weights = np.repeat(np.array([1.0, w, 1.0])[:, None], 2, axis=1)
    surface = NurbsSurface(net, KNOTS, np.array([0.0, 0, 1, 1]), (3, 2), weights)
    middle = surface.points_and_normals(np.array([[0.5, 0.5]]))[1][0, 2]
    return surface if middle > 0.0 else NurbsSurface(net, KNOTS, np.array([0.0, 0, 1, 1]), (3, 2), weights, side=-1)


def over_the_crest(surface, field, blocked):
    def curve(t):
        return surface.points_and_normals(np.column_stack([t, 0.5 + 0 * t]))

    profile = PassProfile.of(curve, CHORD, RADIUS)
    return posed(profile, steps(profile, RADIUS, CHORD), ball(2.0 * RADIUS), field, blocked, CHORD)


def jumping(contact, normal, way):
    """30 degrees to the left before the crest, to the right behind it."""
    angle = np.where(contact[:, 0] > 0.0, 0.5, -0.5)
    return np.column_stack([np.sin(angle), 0 * angle, np.cos(angle)])


def test_where_the_field_of_axes_jumps_the_pass_ends_and_is_told():
    made = over_the_crest(dome(), jumping, lambda tip, axis: np.zeros(len(tip), bool))
    assert len(made.pieces) == 2 and len(made.left) == 1
    assert made.left[0][0] == pytest.approx(20.0 * np.radians(30.0), abs=0.01) and np.ptp(made.left[0]) < 0.001
    for _, axis in made.pieces:
        assert np.degrees(np.arccos(np.clip((axis[1:] * axis[:-1]).sum(axis=1), -1, 1))).max() < 0.1


def test_leaning_fades_over_a_crest_and_what_stands_in_the_way_of_the_swing_is_seen():
    free = over_the_crest(dome(), leaned(0.5), lambda tip, axis: np.zeros(len(tip), bool))
    assert len(free.pieces) == 1 and not free.left

    def between(tip, axis):  # something that only tools leaning by 8 to 9 degrees to the right meet
        lean = np.degrees(np.arctan2(axis[:, 0], axis[:, 2]))
        return (lean > 8.0) & (lean < 9.0)

    met = over_the_crest(dome(), leaned(0.5), between)
    assert len(met.pieces) == 2 and len(met.left) == 1


def test_a_field_without_an_axis_is_refused_with_the_place():
    surface = wall(10.0)
    with pytest.raises(GeometryError) as error:
        walked(surface, ball(6.0), lambda contact, normal, way: 0.0 * normal, tree_of(surface))
    assert error.value.code == "bad_axis" and "(" in str(error.value)
