"""Sheets and what they join: parts of which the thin places are known from their drawing."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.sheet_pieces import SheetPieces, sheet_pieces, sheets_of
from tests.hand_parts import terraces
from tests.profile_parts import profile

THICK, FOOT, HIGH = 0.3, 2.0, 5.8
TOP = FOOT + HIGH


def head(width: float = 1.0, rows=None, ends=None) -> SheetPieces:
    """A web with a head, on a base 8 mm wide; all three are flush at X 0."""
    mesh = profile([0.0, FOOT, TOP, TOP + 1.0], rows or [8.0, THICK, width], 12.0, ends=ends)
    return sheet_pieces(TriangleTree(mesh), 2.0 * THICK, 10.0 * THICK)


ON_THE_WEB = np.array([[0.5 * THICK, 6.0, 5.0]])
ON_HEAD = np.array([[0.5, 6.0, TOP + 1.0], [1.0, 6.0, TOP + 0.5], [0.7, 3.0, TOP]])
ON_BASE = np.array([[4.0, 6.0, 0.0], [8.0, 6.0, 1.0], [4.0, 3.0, FOOT]])


def stand(pieces: SheetPieces, places) -> list[bool]:
    sheet = pieces.sheet_at(ON_THE_WEB)
    return pieces.stand_without(places, np.repeat(sheet, len(places))).tolist()


@pytest.mark.parametrize("width", [0.8, 1.0, 3.0, 12.0])
def test_a_head_does_not_stand_without_its_web_and_the_foot_does(width):
    """Also a head wider than the base. The end faces of the web lie in the planes of those of base and head."""
    pieces = head(width)
    assert stand(pieces, ON_HEAD * [width, 1.0, 1.0]) == [False] * 3 and stand(pieces, ON_BASE) == [True] * 3


def test_a_head_that_a_column_joins_with_the_base_stands():
    pieces = head(rows=[[8.0, THICK, 1.0], [8.0, 8.0, 8.0]], ends=[0.0, 11.0, 12.0])
    assert stand(pieces, ON_HEAD) == [True] * 3


def test_a_head_on_two_webs_stands_without_one_of_them():
    """From above: a frame of a base, two webs apart by 4 mm and a plate over both."""
    v = [0.0, FOOT, TOP, TOP + 1.0]
    filled = profile(v, [5.0, 5.0, 5.0], 12.0)
    hollow = terraces([FOOT, TOP], [0.0, 12.0], [[4.4]])
    x, y, z = hollow.vertices.T
    low, high, middle = FOOT, TOP, THICK
    inner = type(hollow)(np.column_stack([z + middle, y, x]), hollow.faces, hollow.face_ids)
    # the hole goes through along Y: its sides look inwards, and the end faces have a hole where its own lie
    sides = np.abs(inner.normals[:, 1]) < 0.5
    outer = np.abs(filled.normals[:, 1]) < 0.5
    ends = []
    for at, turn in ((0.0, False), (12.0, True)):
        for x0, x1, z0, z1 in ((0, 5, 0, low), (0, 5, high, high + 1), (0, middle, low, high), (4.7, 5, low, high)):
            quad = np.array([[x0, at, z0], [x1, at, z0], [x1, at, z1], [x0, at, z1]], dtype=np.float64)
            ends.append(quad[::-1] if turn else quad)
    quads = np.concatenate(ends)
    start = 4 * np.arange(len(ends))[:, None]
    mesh = type(hollow)(
        np.concatenate([filled.vertices, inner.vertices, quads]),
        np.concatenate([filled.faces[outer], inner.faces[sides] + len(filled.vertices),
                        np.concatenate([start + [0, 1, 2], start + [0, 2, 3]]) + len(filled.vertices)
                        + len(inner.vertices)]),
        np.zeros(int(outer.sum()) + int(sides.sum()) + 2 * len(ends), np.int32))
    assert mesh.volume == pytest.approx(5.0 * 12.0 * (TOP + 1.0) - 4.4 * 12.0 * HIGH)
    pieces = sheet_pieces(TriangleTree(mesh), 2.0 * THICK, 10.0 * THICK)
    assert stand(pieces, np.array([[2.0, 6.0, TOP + 1.0], [2.0, 6.0, 0.0]])) == [True, True]


def test_a_solid_without_thin_places_has_no_sheet():
    pieces = sheet_pieces(TriangleTree(terraces([0, 8], [0, 8], [[8.0]])), 0.5, 5.0)
    assert pieces.sheets == 0 and pieces.sheet_at(ON_THE_WEB).tolist() == [-1]
    assert pieces.stand_without(ON_BASE, np.array([-1, -1, -1])).all()


def test_places_share_a_sheet_by_nearness_direction_and_thickness():
    x = np.arange(40) * 0.5
    middle = np.column_stack([x, np.zeros(40), np.zeros(40)])
    up, reach = np.tile([0.0, 0.0, 1.0], (40, 1)), np.full(40, 0.8)

    def count(normals=up, thickness=1.0, gap=0.0):
        at = middle + np.where(x[:, None] >= 10.0, [gap, 0.0, 0.0], 0.0)
        return len(np.unique(sheets_of(at, normals, reach, thickness * np.ones(40))))

    assert count() == 1 and count(gap=0.5) == 2
    assert count(thickness=np.where(x < 10.0, 1.0, 2.1)) == 2 and count(thickness=1.0 + 0.05 * x) == 1
    assert count(normals=np.where(x[:, None] < 10.0, up, [0.0, 1.0, 0.0])) == 2


@pytest.mark.parametrize(("places", "off", "stands"), [(20, 0.5, False), (5, 0.5, True), (20, 3.0, True)])
def test_only_what_is_near_and_more_than_a_fragment_is_sure_to_hang(places, off, stands):
    """A sheet on a base, and a head that only the sheet joins with it: of few places, or far from where it is met."""
    count = [30, 40, places]
    node = np.repeat(np.arange(3), count)
    points = np.zeros((len(node), 3))
    points[node == 1, 2] = -10.0
    points[node == 2, 2] = 10.0
    known = SheetPieces(points, points, node, 1, np.array([[0, 1], [0, 2]]), np.array([False, True, False]), 1.0)
    assert known.stand_without(np.array([[0.0, 0.0, 10.0 + off]]), np.zeros(1, np.int64)).tolist() == [stands]
