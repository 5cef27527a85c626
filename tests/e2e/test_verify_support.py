"""Thin walls keep their support: programs of one wall that differ in the order of their cuts, and what is found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from geometry.sampling import sample_surface
from tests.hand_parts import as_part, terraces
from tests.thin_wall_case import (
    FOOT,
    LEFT,
    RIGHT,
    SETUP,
    THICK,
    TOOL,
    TOP,
    ZONES,
    in_turn,
    program,
    scored,
    wall_part,
    whole,
)
from verify.findings import Source
from verify.model import FindingKind, ScoredSamples
from verify.moves import Moves
from verify.prove import Proof, prove
from verify.surface.wall_support import supported
from verify.tool_axes import ToolAxes

PART = wall_part()
SCORED = scored(PART)
LIMIT = 10.0 * THICK


def run(*programs, setup=SETUP, threads=2, part=PART, asked=SCORED) -> Proof:
    return prove([(f"p{k}.ngc", text) for k, text in enumerate(programs)], part, [TOOL], setup, asked, ZONES,
                 threads=threads)


def test_one_side_to_the_foot_before_the_other_is_found_with_its_place():
    text = program([*whole("left"), *whole("right")])
    proof = run(text)
    assert proof.counts == {"support": 1}
    (found,) = proof.findings
    assert found.kind is FindingKind.SUPPORT and found.zone in ZONES and found.face is not None
    assert found.depth == pytest.approx(TOP - FOOT, abs=0.3) and found.limit == pytest.approx(LIMIT)
    x, _, z = found.point
    assert x in (LEFT, RIGHT) and z == pytest.approx(TOP, abs=0.3)
    # what is to blame are the cuts of the second side
    assert found.line >= text.splitlines().index("(cut right 11)") and "in turn" in found.message
    # within two distances of places (half a thickness each) above the limit an order may pass
    share = 1.0 - THICK / (TOP - FOOT - LIMIT)
    assert proof.support.found and proof.support.places > 1000
    assert proof.support.over / proof.support.places == pytest.approx(share, abs=0.02)
    assert proof.support.most == pytest.approx((TOP - FOOT) / THICK, rel=0.03)


@pytest.mark.parametrize("depth", [1.0, 2.0, 4.0, 5.0])
def test_both_sides_in_turn_are_right_and_told_as_far_as_they_are_free(depth):
    proof = run(program(in_turn(depth)))
    assert proof.no_findings and not proof.support.found and proof.support.over == 0
    assert proof.support.walls == 1 and proof.support.limit == 10.0
    assert proof.support.most * THICK == pytest.approx(depth, abs=0.3)


def test_a_wall_at_the_face_of_the_blank_is_held_by_the_stock_of_its_other_side():
    """Its outer side is that of a sawn block, and loses no stock. Roughed to the foot, the inner side holds it not."""
    part = as_part(terraces([LEFT, RIGHT, 12.5], [0, 16], [[TOP, FOOT]]))
    block, asked = replace(SETUP, margin=0.0), scored(part)
    proof = run(program(whole("right")), setup=block, part=part, asked=asked)
    assert proof.no_findings and proof.support.walls == 1 and proof.support.most < 3.0
    roughed = run(program([*whole("right", 0.3), *whole("right")]), setup=block, part=part, asked=asked)
    assert roughed.counts == {"support": 1} and roughed.findings[0].depth == pytest.approx(TOP - FOOT, abs=0.3)


def test_bands_deeper_than_the_limit_are_found_in_those_that_are():
    proof = run(program(in_turn(6.0)))
    (found,) = proof.findings
    assert found.depth == pytest.approx(6.0, abs=0.3) and found.point[2] > TOP - 1.2  # below, less than 5 were free
    assert 0.1 < proof.support.over / proof.support.places < 0.3


@pytest.mark.parametrize("roughing", [in_turn(1.0, left=0.3), [*whole("left", 0.3), *whole("right", 0.3)]])
def test_a_wall_that_is_roughed_to_the_foot_has_no_support_when_it_is_finished(roughing):
    assert run(program([*roughing, *in_turn(4.0)])).counts == {"support": 1}


def test_roughed_and_finished_band_by_band_it_has():
    cuts = []
    for top in (12.0, 8.0, 4.0):
        bottom = max(top - 4.0, FOOT)
        for left in (0.3, 0.0):
            cuts += [*whole("left", left, top=top, bottom=bottom), *whole("right", left, top=top, bottom=bottom)]
    assert run(program(cuts)).no_findings


def test_stock_as_thick_as_the_wall_holds_it_and_less_does_not():
    """Both sides are cut beside the wall to the foot first, with so much left on it."""
    for left, counts in ((1.1 * THICK, {}), (0.8 * THICK, {"support": 1})):
        assert run(program([*in_turn(10.0, left), *in_turn(4.0)])).counts == counts


def test_a_side_in_a_program_of_its_own_is_found_there():
    proof = run(program(whole("left")), program(whole("right")))
    assert [f.program for f in proof.findings] == ["p1.ngc"]


def test_a_wall_somebody_holds_is_told_of_and_no_finding():
    proof = run(program([*whole("left"), *whole("right")]), setup=replace(SETUP, walls_in_turn=False))
    assert proof.no_findings and proof.support.over > 1000 and not proof.support.found
    assert proof.support.at[2] == pytest.approx(TOP, abs=0.3)


def test_a_part_without_high_thin_walls_is_not_asked():
    proof = run(program([*whole("left"), *whole("right")]), setup=replace(SETUP, free_ratio=21.0))
    assert proof.no_findings and proof.support.walls == proof.support.places == 0


@pytest.mark.parametrize("margin", [0.1, 0.4])
def test_where_the_blank_is_thinner_than_the_wall_half_of_it_counts(margin):
    """A casting nearer to the part than the wall is thick: the order is what a program can do for it."""
    near_net = replace(SETUP, stock_kind="part_offset", margin=margin, uncertainty=0.0)
    assert run(program(in_turn(4.0)), setup=near_net).no_findings
    assert run(program([*whole("left"), *whole("right")]), setup=near_net).counts == {"support": 1}


def divided(text: str, parts: int) -> str:
    """A program whose feed moves along Y come in so many blocks each."""
    out = []
    for line in text.splitlines():
        steps = [f"Y{-4 + 24 * (k + 1) / parts:.4f}" for k in range(parts)] if line == "Y20" else [line]
        out += steps
    return "\n".join(out) + "\n"


def diluted(text: str, count: int) -> str:
    """A program with so many short feed moves beside the wall before its end, where everything is cut."""
    idle = ["G0 X4 Y1", "G1 Z2 F800", *(f"Y{1.0 + 0.01 * (k % 100):.2f}" for k in range(count)), "G0 Z20"]
    head, _, tail = text.partition("M5\n")
    return head + "\n".join(idle) + "\nM5\n" + tail


@pytest.mark.slow
@pytest.mark.parametrize("depth", [6.0, 5.0])
def test_how_a_program_is_divided_into_blocks_changes_nothing(depth):
    text = program(in_turn(depth))
    usual = run(text)
    for other in (run(divided(text, 30)), run(diluted(text, 3000)), run(divided(text, 30), setup=SETUP, threads=1)):
        found = {k: n for k, n in other.counts.items() if k == "support"}
        assert found == usual.counts and other.support.places == usual.support.places
        assert other.support.most == pytest.approx(usual.support.most, abs=0.1)
        assert other.support.over == pytest.approx(usual.support.over, abs=0.02 * usual.support.places)


def test_threads_do_not_change_a_byte():
    text = program(in_turn(6.0))
    one, two = (run(text, threads=n) for n in (1, 2))
    assert one.findings == two.findings and one.support == two.support


def moves(cuts, angle: float = 0.0, parts: int = 1) -> Moves:
    """The cuts as moves, turned about Z; each in so many pieces."""
    start = np.array([[LEFT - 2.0 - left if side == "left" else RIGHT + 2.0 + left, -4.0, z] for side, z, left in cuts])
    end = start + [0.0, 24.0, 0.0]
    share = np.arange(parts + 1) / parts
    points = start[:, None] + share[None, :, None] * (end - start)[:, None]
    c, s = np.cos(angle), np.sin(angle)
    points = points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    n = len(cuts) * parts
    start, end = (np.ascontiguousarray(p.reshape(-1, 3)) for p in (points[:, :-1], points[:, 1:]))
    return Moves(start, end, np.ones(n, np.bool_), np.zeros(n, np.int32))


def judged(cuts, angle: float = 0.0, parts: int = 1, density: float = 60.0, axes=None, lean=None):
    c, s = np.cos(angle), np.sin(angle)
    m = PART.mesh
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ (np.eye(3) if lean is None else lean)
    mesh = type(m)(m.vertices @ turn, m.faces, m.face_ids)
    samples = sample_surface(mesh, density, seed=3)
    way = moves(cuts, angle, parts)
    if lean is not None:
        way = replace(way, start=way.start @ lean, end=way.end @ lean)
    if axes is not None:
        way = replace(way, axes=ToolAxes.between(axes, axes))
    none = np.zeros(len(way), np.int32)
    asked, source = ScoredSamples(samples, np.zeros(len(samples), np.int32)), Source(("p",), none, none, none)
    setup = replace(SETUP, stock_kind="part_offset", margin=3.0)
    return supported(TriangleTree(mesh), asked, setup, way, [TOOL], source, [])[0]


@pytest.mark.parametrize("cuts", [in_turn(3.0), in_turn(7.0), [*whole("left"), *whole("right")]])
def test_it_hangs_neither_on_the_frame_nor_on_how_fine_moves_and_samples_are(cuts):
    usual = judged(cuts)
    for other in (judged(cuts, 0.7), judged(cuts, 2.9), judged(cuts, parts=40), judged(cuts, density=150.0)):
        assert other.walls == 1 and bool(other.over) == bool(usual.over)
        assert other.most == pytest.approx(usual.most, abs=0.8)
        assert other.over / other.places == pytest.approx(usual.over / usual.places, abs=0.03)


def test_tools_of_which_axes_are_known_are_judged_alike():
    """The kernels of leaning tools, with an axis that stands up."""
    plain = judged(in_turn(7.0))
    axes = np.tile([0.0, 0.0, 1.0], (len(in_turn(7.0)), 1))
    assert judged(in_turn(7.0), axes=axes) == plain


def test_an_order_is_a_finding_where_one_axis_cuts_and_a_figure_where_several_do():
    cuts = [*whole("left"), *whole("right")]
    axes = np.tile([0.0, 0.0, 1.0], (len(cuts), 1))
    assert judged(cuts, axes=axes).found
    axes[-1] = [0.0, np.sin(0.01), np.cos(0.01)]
    leaning = judged(cuts, axes=axes)
    assert leaning.over > 1000 and not leaning.found


@pytest.mark.parametrize("order", [in_turn(2.0), [*whole("left"), *whole("right")]])
def test_a_leaning_wall_is_judged_along_itself(order):
    """Wall and tool lean by 12 degrees about Y; stock and order are the same."""
    lean = np.radians(12.0)
    turn = np.array([[np.cos(lean), 0.0, -np.sin(lean)], [0.0, 1.0, 0.0], [np.sin(lean), 0.0, np.cos(lean)]])
    plain, leaning = judged(order), judged(order, axes=np.tile(turn[2], (len(order), 1)), lean=turn)
    assert leaning.walls == 1 and leaning.most == pytest.approx(plain.most, abs=1.0)
    assert bool(leaning.over) == bool(plain.over)
