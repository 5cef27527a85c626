"""Tilts that match curvature, against printed values and the proof's own sweep."""

from __future__ import annotations

import numpy as np
import pytest

from tests.hand_parts import ball, tool
from toolpath.five_axis.curvature_matching import clear_tilt, gouge_depth, matching_tilt, mean_direction, strip_width
from toolpath.passes.cutter_locations import tips
from verify.moves import Moves
from verify.surface.removal import residual_on_normals
from verify.tool_axes import ToolAxes

H = 0.005
# R, r, radii of curvature across and along the feed; match in degrees; strips at the match, one and three degrees more
PRINTED = [(6, 0, 60, 150, 5.739, 6.623, 3.542, 2.131, 0.00375), (10, 0, 80, 300, 7.181, 8.887, 4.613, 2.762, 0.00407),
           (30, 0, 120, 600, 14.478, 16.904, 8.189, 4.863, 0.00529),
           (6, 1, 60, 150, 4.861, 6.064, 3.277, 1.975, 0.00368)]


def one(value):
    return np.array([float(value)])


@pytest.mark.parametrize("row", PRINTED)
def test_printed_matches_and_strips(row):
    big, r, across, along, degrees, *widths, depth = row
    body = tool(2.0 * big, r)
    match = matching_tilt(one(1 / across), body)
    assert np.degrees(match[0]) == pytest.approx(degrees, abs=6e-4)
    got = [strip_width(match + np.radians(more), one(1 / across), one(1 / along), body, H)[0] for more in (0, 1, 3)]
    assert got == pytest.approx(widths, abs=6e-4)
    less = gouge_depth(match - np.radians(0.5), one(1 / across), one(1 / along), body)[0]
    assert less == pytest.approx(depth, abs=6e-6)
    assert gouge_depth(match, one(1 / across), one(1 / along), body)[0] == pytest.approx(0.0, abs=1e-12)


def swept(body, tilt, across, along, offsets):
    """What a tool leaves that is fed round the inside of a ring: radii of curvature ``across`` and ``along`` the feed.

    offsets : mm on the surface, from the contact; along = 0 is a plane
    """
    way = np.linspace(-8.0, 8.0, 321)
    turn = way / along if along else np.zeros_like(way)
    inward = -np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    ahead = np.column_stack([-np.sin(turn), np.cos(turn), 0.0 * turn])
    contact = -along * inward if along else np.column_stack([0.0 * way, way, 0.0 * way])
    axis = np.cos(tilt) * inward + np.sin(tilt) * ahead
    tip = tips(contact, inward, body, axis)
    bend = offsets / across if across else np.zeros_like(offsets)
    if across:
        point = np.column_stack([along - across + across * np.cos(bend), 0.0 * bend, across * np.sin(bend)])
    else:
        point = np.column_stack([0.0 * offsets, 0.0 * offsets, offsets])
    normal = -np.column_stack([np.cos(bend), 0.0 * bend, np.sin(bend)])
    count = len(tip) - 1
    moves = Moves(tip[:-1], tip[1:], np.ones(count, bool), np.zeros(count, np.int32),
                  ToolAxes.between(axis[:-1], axis[1:]))
    return residual_on_normals(point, normal, np.full(len(point), 1.0), moves, [body], bow=1e-5)[0]


def strip(left, offsets, height):
    """Width of the strip round the contact in which no more than a height is left."""
    edges = []
    for way in (1, -1):
        k = np.flatnonzero((way * offsets >= 0) & (left <= height))
        side = offsets[k][np.argsort(way * offsets[k])]
        edges.append(side[-1])
    return edges[0] - edges[1]


@pytest.mark.parametrize("row", PRINTED)
@pytest.mark.parametrize("more", [0.0, 1.0, 3.0])
def test_strips_are_what_the_proof_sees(row, more):
    big, r, across, along = row[:4]
    body = tool(2.0 * big, r)
    tilt = matching_tilt(one(1 / across), body) + np.radians(more)
    width = strip_width(tilt, one(1 / across), one(1 / along), body, H)[0]
    offsets = np.linspace(-0.75 * width, 0.75 * width, 6001)
    left = swept(body, tilt[0], across, along, offsets)
    assert left.min() > -2e-5
    assert width == pytest.approx(strip(left, offsets, H), rel=0.03)


@pytest.mark.parametrize("row", PRINTED)
def test_less_tilt_than_the_match_cuts_in(row):
    big, r, across, along = row[:4]
    body = tool(2.0 * big, r)
    tilt = matching_tilt(one(1 / across), body) - np.radians(0.5)
    depth = gouge_depth(tilt, one(1 / across), one(1 / along), body)[0]
    reach = strip_width(tilt, one(1 / across), one(1 / along), body, H)[0]
    left = swept(body, tilt[0], across, along, np.linspace(-0.6 * reach, 0.6 * reach, 4001))
    assert -left.min() == pytest.approx(depth, rel=0.1)  # second order; printed against brute: within 8 %


@pytest.mark.parametrize(("degrees", "printed"), [(5.0, 3.373), (3.0, 4.338)])
def test_on_a_plane_a_tilted_flat_goes_several_times_as_far_as_a_ball(degrees, printed):
    height, flat, round_end = 0.01, tool(12.0, 0.0), ball(12.0)
    steps = []
    for body, tilt in ((flat, np.radians(degrees)), (round_end, 0.0)):
        offsets = np.linspace(-2.0, 2.0, 8001)
        steps.append(strip(swept(body, tilt, 0.0, 0.0, offsets), offsets, height))
    assert steps[0] / steps[1] == pytest.approx(printed, rel=0.01)
    assert steps[0] == pytest.approx(strip_width(one(np.radians(degrees)), one(0), one(0), flat, height)[0], rel=1e-3)


def off_quadric(body, tilt, turn, k_1, k_2):
    """The least of the end above z = (k_1 x^2 + k_2 y^2) / 2 at rest, on the origin, its axis behind at ``turn``."""
    big, r = body.radius - body.corner_radius, body.corner_radius
    f = np.array([np.cos(turn), np.sin(turn), 0.0])
    axis = np.cos(tilt) * np.array([0.0, 0, 1]) - np.sin(tilt) * f
    tip = tips(np.zeros((1, 3)), np.array([[0.0, 0, 1]]), body, axis)[0]
    a = np.linspace(0.0, 2.0 * np.pi, 721)
    l = np.cross(axis, f)  # noqa: E741
    l /= np.linalg.norm(l)  # noqa: E741
    rim = tip + r * axis + big * (np.cos(a)[:, None] * l + np.sin(a)[:, None] * np.cross(axis, l))
    x, y = rim[:, 0].copy(), rim[:, 1].copy()
    for _ in range(60):  # foot points
        high = rim[:, 2] - 0.5 * (k_1 * x * x + k_2 * y * y)
        x, y = rim[:, 0] + high * k_1 * x, rim[:, 1] + high * k_2 * y
    high = rim[:, 2] - 0.5 * (k_1 * x * x + k_2 * y * y)
    return float((high * np.sqrt(1.0 + (k_1 * x) ** 2 + (k_2 * y) ** 2)).min() - r)


@pytest.mark.parametrize("body", [tool(12.0, 0.0), tool(12.0, 1.0)], ids=["flat", "bull"])
@pytest.mark.parametrize(("k_1", "k_2"), [(1 / 60, 1 / 150), (1 / 40, -1 / 90), (-1 / 90, -1 / 300)])
def test_at_the_clear_tilt_no_part_of_the_end_enters_whatever_way_it_leans(body, k_1, k_2):
    tilt = clear_tilt(one(max(k_1, 0.0)), body)[0] + 1e-4
    for turn in np.linspace(0.0, np.pi, 13):
        assert off_quadric(body, tilt, turn, k_1, k_2) > -1e-6


def test_matched_along_the_lesser_curvature_the_heel_cuts_in():
    """The end matched to 150 mm across a feed along which it is 60 mm; printed for a round surface: 0.716 mm deep."""
    body = tool(12.0, 0.0)
    match = matching_tilt(one(1 / 150), body)[0]
    assert off_quadric(body, match, np.pi / 2, 1 / 150, 1 / 60) < -0.5
    assert off_quadric(body, clear_tilt(one(1 / 60), body)[0], np.pi / 2, 1 / 150, 1 / 60) > -1e-3


def test_no_match_on_level_convex_and_too_hollow_places():
    body = tool(12.0, 0.0)
    assert np.isnan(matching_tilt(np.array([0.0, -0.01, 0.2]), body)).all()
    assert clear_tilt(np.array([0.0, -0.01]), body).tolist() == [0.0, 0.0]
    assert np.isnan(clear_tilt(np.array([0.2]), body)).all()
    assert np.isnan(matching_tilt(one(1.1), tool(12.0, 1.0))).all()  # not even the corner fits


@pytest.mark.parametrize(("degrees", "printed"),
                         [((88, -88, 89, -89), 90.0), ((70, 85, -85), 83.4), ((40, 50, 60), 50.0)])
def test_directions_are_meant_mod_pi(degrees, printed):
    mean, spread = mean_direction(np.radians(degrees), np.ones(len(degrees)))
    assert abs((np.degrees(mean) - printed + 90.0) % 180.0 - 90.0) < 0.05
    assert 0.0 <= spread < 0.2
    assert mean_direction(np.array([0.0, np.pi / 2]), np.ones(2))[1] == pytest.approx(1.0)
