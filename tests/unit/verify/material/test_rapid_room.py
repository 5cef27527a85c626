"""The room that rapids keep: everywhere, less straight down before a cut, none on the way up."""

import numpy as np
import pytest

from geometry.tool_body import HolderFrustum, ToolBody
from tests.pocket_case import block
from verify.kernels.stock import CUTTER, HOLDER, SHANK
from verify.material.stock_field import run_field, stock_field
from verify.material.stock_lines import blank, run_stock
from verify.material.stock_pass import BESIDE, rapid_arrays
from verify.model import ProofSetup, StockKind
from verify.moves import Moves
from verify.tool_axes import ToolAxes

SETUP = ProofSetup(stock_kind=StockKind.BOX, margin=0.0, uncertainty=0.0, clearance_rapid=1.0, clearance_approach=0.2,
                   gouge_tolerance=0.5)
MESH = block().mesh  # X -20 to 20, Y -15 to 15, Z -10 to 0
TOOLS = {"flat": ToolBody("T1", 1, 8.0, 0.0, 12.0, 8.0, 12.0, 8.0, 30.0),
         "ball": ToolBody("T1", 1, 8.0, 4.0, 12.0, 8.0, 12.0, 8.0, 30.0),
         "bull": ToolBody("T1", 1, 8.0, 1.0, 12.0, 8.0, 12.0, 8.0, 30.0),
         "drill": ToolBody("T1", 1, 8.0, 0.0, 12.0, 8.0, 12.0, 8.0, 30.0, named="drill", cone_height=3.0)}


def chain(*places, feed):
    p = np.array(places, float)
    return Moves(p[:-1], p[1:], np.array(feed), np.zeros(len(feed), np.int32))


def test_only_straight_down_before_a_cut_is_an_approach():
    moves = chain((0, 0, 20), (0, 0, 5), (0, 0, 1), (0, 0, -1), (0, 0, 9), (5, 0, 9), (5, 0, 2), (9, 0, 2),
                  feed=[False, False, True, False, False, False, False])
    free, room = rapid_arrays(moves, SETUP)
    assert free.tolist() == [False, False, False, True, False, False, False]
    assert room.tolist() == [0.2, 0.2, 0.0, 0.0, 1.0, 1.0, 1.0]
    slanting = chain((0, 0, 20), (1, 0, 1), (1, 0, -1), feed=[False, True])
    assert rapid_arrays(slanting, SETUP).room.tolist() == [1.0, 0.0]
    wide = ProofSetup(clearance_rapid=0.1, clearance_approach=0.2)
    assert rapid_arrays(chain((0, 0, 9), (0, 0, 1), (0, 0, 0), feed=[False, True]), wide).room.tolist() == [0.1, 0.0]


def gaps(moves, tool, field):
    """Distances that events of each body tell, mm; negative inside."""
    if field:
        moves = Moves(moves.start, moves.end, moves.feed, moves.tool, ToolAxes.upright(len(moves)))
        run = run_field(stock_field(MESH, SETUP, 0.3), moves, [tool], SETUP)
    else:
        run = run_stock(blank(MESH, 0.3, SETUP), moves, [tool], SETUP)
    out = {}
    for _, code, depth, clearance, *_ in run.events.tolist():
        out[int(code)] = min(out.get(int(code), np.inf), clearance - depth)
    return out


@pytest.mark.parametrize("field", [False, True], ids=["lines", "field"])
@pytest.mark.parametrize("kind", TOOLS)
@pytest.mark.parametrize("height", [0.001, 0.4, 0.9, 1.0, 1.3])
def test_a_rapid_keeps_its_clearance_to_what_is_below(kind, height, field):
    told = gaps(chain((-10, 0, height), (10, 0, height), feed=[False]), TOOLS[kind], field)
    assert told.keys() == ({CUTTER} if height < 0.999 else set())
    if told:  # a point comes down between nodes that are 0.3 mm apart
        assert height - 1e-6 <= told[CUTTER] <= height + ((0.1 if kind == "drill" else 0.03) if field else 2e-3)


@pytest.mark.parametrize("field", [False, True], ids=["lines", "field"])
@pytest.mark.parametrize(("height", "near"), [(0.1, True), (0.25, False)])
def test_straight_down_before_a_cut_the_approach_counts(height, near, field):
    down = chain((0, 0, 9), (0, 0, height), (0, 0, height - 0.001), feed=[False, True])
    assert gaps(down, TOOLS["flat"], field) == ({CUTTER: pytest.approx(height, abs=2e-3)} if near else {})


@pytest.mark.parametrize("field", [False, True], ids=["lines", "field"])
@pytest.mark.parametrize(("aside", "above"), [(0.3, 0.4), (0.6, 0.45), (0.75, 0.7), (0.9, 0.5)])
def test_past_an_edge_the_distance_counts(aside, above, field):
    """A flat end that passes the block beside its upper edge; the first line stands up to a spacing inside it."""
    told = gaps(chain((24.0 + aside, -30, above), (24.0 + aside, 30, above), feed=[False]), TOOLS["flat"], field)
    distance = np.hypot(aside, above)
    assert told.keys() == ({CUTTER} if distance < 1.0 else set())
    if told:
        assert distance - 1e-6 <= told[CUTTER] <= distance + 0.2


@pytest.mark.parametrize("field", [False, True], ids=["lines", "field"])
@pytest.mark.parametrize(("gap", "near"), [(0.3, True), (1.2, False)])
def test_a_holder_keeps_it_too(gap, near, field):
    """The holder over the block, the thin tool beside it."""
    tool = ToolBody("T1", 1, 2.0, 0.0, 8.0, 2.0, 8.0, 2.0, 12.0, (HolderFrustum(30.0, 30.0, 20.0),))
    told = gaps(chain((28, -5, gap - 12.0), (28, 5, gap - 12.0), feed=[False]), tool, field)
    assert told == ({HOLDER: pytest.approx(gap, abs=2e-3)} if near else {})


@pytest.mark.parametrize("field", [False, True], ids=["lines", "field"])
@pytest.mark.parametrize(("over", "found"), [(0.45, True), (0.4 * BESIDE, False)])
def test_the_slack_of_a_shank_is_never_the_gouge_tolerance(over, found, field):
    """Flutes of 5 mm pass the side of the block, 10 mm high: the shank above them enters by ``over``."""
    tool = ToolBody("T1", 1, 8.0, 0.0, 5.0, 8.0, 5.0, 8.0, 60.0)
    y = -19.0 + over
    told = gaps(chain((-30, y, -9.0), (30, y, -9.0), feed=[True]), tool, field)
    if found:
        assert told[SHANK] == pytest.approx(-over, abs=0.31)
    else:
        assert SHANK not in told
