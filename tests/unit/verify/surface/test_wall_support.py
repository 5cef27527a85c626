"""Support of shelves, floors and webs with heads: pairs of parts and orders that differ in one length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import sample_surface
from geometry.tool_body import ToolBody
from tests.hand_parts import terraces
from tests.profile_parts import profile
from tests.thin_wall_case import FOOT, LEFT, RIGHT, TOP, wall_part
from verify.findings import Source
from verify.model import Finding, ProofSetup, ScoredSamples, Support
from verify.moves import Moves
from verify.surface.slender_walls import ThinWalls
from verify.surface.wall_support import CutTimes, _free_ways, supported

FLAT = ToolBody("T1", 1, 6.0, 0.0, 12.0, 5.8, 20.0, 6.0, 40.0)
SLOT = ToolBody("T2", 2, 12.0, 0.0, 2.0, 3.0, 15.0, 12.0, 40.0)
SMALL = ToolBody("T3", 3, 6.0, 0.0, 1.0, 2.0, 15.0, 6.0, 40.0)
TOOLS = [FLAT, SLOT, SMALL]
BLOCK = ProofSetup(stock_kind="box", margin=1.0, uncertainty=0.0)
Pass = tuple[int, float, float]
"""A pass along Y: index of the tool, X and Z of its tip, mm."""
UNDER, SHELF = 4.0, 6.0  # Z of the slot and of the shelf over it
LAST = 20.0


def judged(mesh: TriangleMesh, passes: list[Pass], setup: ProofSetup = BLOCK) -> tuple[Support, list[Finding]]:
    start = np.array([[x, -8.0, z] for _, x, z in passes])
    moves = Moves(start, start + [0.0, 8.0 + LAST, 0.0], np.ones(len(passes), np.bool_),
                  np.array([tool for tool, _, _ in passes], np.int32))
    samples = sample_surface(mesh, 40.0, seed=3)
    line = np.arange(len(passes), dtype=np.int32)
    source = Source(("p",), np.zeros(len(passes), np.int32), line, np.array([TOOLS[t].number for t, _, _ in passes]))
    scored = ScoredSamples(samples, np.zeros(len(samples), np.int32))
    return supported(TriangleTree(mesh), scored, setup, moves, TOOLS, source, [])


def shelf(thick: float, wide: float) -> TriangleMesh:
    """A block with a slot in its side and a shelf over it, free at X 0."""
    return profile([0.0, UNDER, SHELF, SHELF + thick], [14.0, 14.0 - wide, 14.0], 12.0, shift=14.0)


def above(edge: float, thick: float) -> Pass:
    """The top faced up to X ``edge``."""
    return 0, edge - 3.0, SHELF + thick


def below(edge: float) -> Pass:
    """The slot cut up to X ``edge``."""
    return 1, edge - 6.0, UNDER


def order(name: str, thick: float, wide: float) -> list[Pass]:
    slot = [below(e) for e in np.arange(wide, 0.0, -0.8)[::-1].tolist()]
    rest = [above(e, thick) for e in (6.0, 10.0, 14.0, 17.0)]
    if name == "slot first":
        return [*slot, above(2.0, thick), *rest]
    if name == "top first":
        return [above(2.0, thick), *rest, *slot]
    bands = np.linspace(0.0, wide, 1 + int(np.ceil(wide / 1.2)))[1:].tolist()
    return [*(p for e in bands for p in (above(e, thick), below(e))), *rest]


@pytest.mark.parametrize("name", ["slot first", "top first"])
@pytest.mark.parametrize(("thick", "wide"), [(0.3, 2.4), (0.3, 4.4), (0.1, 4.4), (0.5, 4.4), (0.1, 0.8)])
def test_a_shelf_wider_than_its_limit_needs_its_stock(name, thick, wide):
    support, found = judged(shelf(thick, wide), order(name, thick, wide))
    assert bool(found) == support.found == (wide > 11.0 * thick)
    if found:
        assert found[0].depth == pytest.approx(wide, abs=0.35) and found[0].limit == pytest.approx(10.0 * thick)
        assert "floor or shelf" in found[0].message
        assert support.most == pytest.approx(wide / thick, rel=0.1)


def test_a_shelf_that_is_cut_from_its_free_end_in_turn_keeps_its_support():
    support, found = judged(shelf(0.3, 4.4), order("in turn", 0.3, 4.4))
    assert not found and support.walls == 1 and support.places > 100 and 2.0 < support.most < 10.0


def floor(thick: float) -> TriangleMesh:
    """A frame with a floor 12 mm wide, at the bottom."""
    return terraces([0, 1, 13, 14], [0, 1, 13, 14], [[3, 3, 3], [3, thick, 3], [3, 3, 3]])


def stripes(*heights: float) -> list[Pass]:
    """Passes side by side at each height; they cut the frame too, which no rule here asks about."""
    return [(0, x, z) for z in heights for x in (4.0, 7.0, 10.0)]


OVER_AIR = replace(BLOCK, margin=0.0, table=-5.0, table_known=True)


@pytest.mark.parametrize("thick", [0.1, 0.2, 1.0])
@pytest.mark.parametrize("skin", [None, 0.05])
def test_a_thin_floor_over_nothing_is_found_and_a_stout_one_not(thick, skin):
    """Under the end of the tool it is free as far as the stock of the next pass; roughed first, up to the frame."""
    passes = stripes(2.0, thick) if skin is None else stripes(2.0, thick + skin, thick)
    support, found = judged(floor(thick), passes, OVER_AIR)
    assert bool(found) == (thick < 0.5)
    if found:
        way = (3.0, 6.0) if skin is None else (6.0, 6.0)
        assert way[0] - 0.4 <= support.most * thick <= way[1] + 10.0 * thick


@pytest.mark.parametrize("setup", [
    replace(OVER_AIR, table=0.0), replace(OVER_AIR, table=None, table_known=False),
    replace(OVER_AIR, fixtures=(np.array([[-1.0, -1.0, -5.0], [15.0, 15.0, 0.0]]),))])
def test_a_floor_on_the_table_or_a_fixture_is_held(setup):
    assert judged(floor(0.1), stripes(2.0, 0.15, 0.1), setup)[0].walls == 0


def test_a_fixture_beside_a_floor_holds_nothing():
    beside = replace(OVER_AIR, fixtures=(np.array([[20.0, -1.0, -5.0], [30.0, 15.0, 0.0]]),))
    below_it = replace(OVER_AIR, fixtures=(np.array([[-1.0, -1.0, -5.0], [15.0, 15.0, -1.0]]),))
    for setup in (beside, below_it):
        assert judged(floor(0.1), stripes(2.0, 0.15, 0.1), setup)[1]


def test_stock_below_that_stays_holds_a_floor():
    """A blank that goes on below the part: no move finishes the underside, so nothing is judged."""
    thicker = replace(OVER_AIR, stock_box=np.array([[0.0, 0.0, -3.0], [14.0, 14.0, 3.0]]))
    assert judged(floor(0.1), stripes(2.0, 0.15, 0.1), thicker)[0].places == 0


def web(high: float, column: bool = False) -> TriangleMesh:
    """A web 0.3 mm thick with a head 1 mm wide and high, flush with its left side; a column may hold the head."""
    row = [8.0, 0.3, 1.0]
    rows = [row, [8.0, 8.0, 8.0]] if column else [row]
    return profile([0.0, 2.0, 2.0 + high, 3.0 + high], rows, 12.0, ends=[0.0, 11.0, 12.0] if column else None)


def left_then_under(high: float) -> list[Pass]:
    """The left side to the foot, then the right side of head and of the web below it."""
    depths = np.arange(2.0 + high, 2.0, -1.0).tolist()[1:] + [2.0]
    return [*((0, -3.0, z) for z in depths), (0, 4.0, 2.0 + high), *((2, 3.3, z) for z in depths)]


@pytest.mark.parametrize(("high", "column", "bad"), [(5.8, False, True), (4.0, False, True), (2.0, False, False),
                                                      (5.0, True, False)])
def test_a_head_holds_a_web_where_something_else_holds_the_head(high, column, bad):
    support, found = judged(web(high, column), left_then_under(high))
    assert bool(found) == bad
    if bad:
        assert found[0].depth == pytest.approx(high, abs=0.4)


def test_stock_on_the_free_end_of_a_wall_does_not_hold_it():
    """Both sides are cut below the top 2 mm, whose stock stays: 8 mm of the wall are free, 4 from it or the foot."""
    depths = np.arange(TOP - 3.0, FOOT - 0.5, -1.0).tolist()
    island = [*((2, LEFT - 3.0, z) for z in depths), *((2, RIGHT + 3.0, z) for z in depths)]
    in_turn = [(0, x, z) for z in np.arange(TOP - 1.0, FOOT - 0.5, -1.0).tolist() for x in (LEFT - 3.0, RIGHT + 3.0)]
    assert judged(wall_part().mesh, in_turn)[1] == []
    (found,) = judged(wall_part().mesh, island)[1]
    assert found.depth == pytest.approx(TOP - 2.0 - FOOT, abs=0.4)


def test_a_thin_edge_is_held_by_what_holds_the_wall_beside_it():
    """The way down along the edge of a blade finds no support within its own short limit; 0.5 mm aside a strut does."""
    none = np.zeros((2, 3))
    points = np.array([[0.0, 0.0, 10.0], [0.5, 0.0, 10.0]])
    walls = ThinWalls(np.arange(2), points, none, points, none, np.array([1.2, 1.2]), np.array([True, False]),
                      np.array([6.6, 12.6]), np.array([np.inf, 3.7]), np.zeros(2, np.int64), 0.3)
    cut = CutTimes(np.array([0, 0]), np.array([5, 5]), np.array([1, 1]))
    free, judged = _free_ways(walls, [cut, cut], 0.0)
    assert judged.tolist() == [True, False]
    assert free[0] == pytest.approx(0.5 + 3.7)
