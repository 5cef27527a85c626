"""Arcs and longer lines for planned passes: what they leave the plan by, and what no control is asked to do."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import ProgramError
from output.arc_fitting import BLOCK, MAX_ARC_RADIUS, MAX_SWEEP, SAG, fitted, stretches
from output.gcode.dialects import DIALECTS, Switches
from output.gcode.program_writer import write_program
from output.program_grid import GRID, GridArc, pieces, to_grid
from output.stepnc.ap238 import write_stepnc_aim
from output.stepnc.iso14649 import write_stepnc_arm
from tests.arc_plans import HALF, SHAPES, cutting, dense, off, round_clamped, round_plan, turn
from tests.golden_file import assert_golden
from tests.synthetic_plan import BALL, clamped, leaning, step, write_linuxcnc
from toolpath.linking.lead_arcs import arc_onto
from toolpath.workingsteps import Trajectory, TrajectoryKind
from verify.comparison.program_equivalence import difference
from verify.comparison.stepnc_agreement import check_agreement
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics
from verify.stepnc.reader import read_stepnc

GRAIN = 2.0e-4  # mm, of the grid: of a point, and of a centre


def cut_of(work, k=0):
    """The cut of the k-th step."""
    return next(t for t in work.steps[k].trajectories if t.motion is TrajectoryKind.CUT)


def drawn(piece):
    """Points of a piece as a control goes along it, mm: of an arc far more than anybody needs."""
    if not isinstance(piece, GridArc):
        return dense(piece * GRID)
    (a, b), c = (np.array(p[:2]) * GRID for p in (piece.start, piece.end)), np.array(piece.centre) * GRID
    s = np.linspace(0.0, 1.0, 200)
    r = np.linalg.norm(a - c) + s * (np.linalg.norm(b - c) - np.linalg.norm(a - c))
    angle = math.atan2(*(a - c)[::-1]) + s * piece.sweep
    z = (piece.start[2] + s * (piece.end[2] - piece.start[2])) * GRID
    return np.column_stack([c[0] + r * np.cos(angle), c[1] + r * np.sin(angle), z])


def written(way):
    return list(pieces(to_grid(way.points), way.arcs))


@pytest.mark.parametrize("tolerance", [HALF, 5e-4, 2e-2])
@pytest.mark.parametrize("name", SHAPES)
def test_both_ways_within_the_tolerance(name, tolerance):
    """By the slow twin: dense points of each against every piece of the other."""
    planned = SHAPES[name]
    way = cut_of(fitted(cutting(planned), tolerance))
    gone = np.vstack([drawn(p) for p in written(way)])
    assert off(gone[::3], planned) <= tolerance + GRAIN
    assert off(dense(planned, 4), gone) <= tolerance + GRAIN
    assert off(dense(way.points, 2), planned) <= tolerance + 1e-9 + GRAIN  # the polyline of STEP-NC
    assert off(way.points, gone) <= GRAIN and off(gone[::3], way.points) <= SAG + GRAIN
    assert (way.points[[0, -1]] == planned[[0, -1]]).all()


@pytest.mark.parametrize("seed", range(12))
def test_any_path_within_the_tolerance(seed):
    """Arcs, corners, lines and noise by chance, level and not."""
    rng = np.random.default_rng(seed)
    rows, at, ahead = [np.zeros(3)], np.zeros(3), 0.0
    for _ in range(40):
        ahead += rng.choice([0.0, rng.normal(0.0, 0.4)])
        bend, n, size = rng.choice([0.0, rng.normal(0.0, 0.05)]), int(rng.integers(1, 30)), rng.uniform(0.01, 0.4)
        climb = rng.choice([0.0, rng.normal(0.0, 0.05)])
        for _ in range(n):
            ahead += bend
            at = at + [size * math.cos(ahead), size * math.sin(ahead), climb * size]
            rows.append(at + rng.normal(0.0, rng.choice([0.0, 1e-4]), 3))
    planned = np.array(rows)
    way = cut_of(fitted(cutting(planned), HALF))
    gone = np.vstack([drawn(p) for p in written(way)])
    assert off(gone[::7], planned) <= HALF + GRAIN
    assert off(planned, gone) <= HALF + GRAIN


def test_a_ring_is_three_arcs_and_a_helix_goes_down_evenly():
    for name, turns, sense in (("ring", 3, True), ("ring to the right", 3, False), ("helix", 4, True)):
        way = cut_of(fitted(cutting(SHAPES[name]), HALF))
        assert len(written(way)) == len(way.arcs) == turns and {a.left for a in way.arcs} == {sense}
    radii = [np.linalg.norm(way.points[a.first, :2] - a.centre) for a in way.arcs[:3]]
    assert np.abs(np.array(radii) - 4.0).max() < HALF + GRAIN


@pytest.mark.parametrize("name", ["steep helix", "too large", "zigzag", "hexagon", "straight"])
def test_what_is_no_arc_stays_lines(name):
    way = cut_of(fitted(cutting(SHAPES[name]), HALF))
    assert not way.arcs and len(way.points) <= len(SHAPES[name])
    assert name != "straight" or len(way.points) == 2


def test_words_that_every_control_takes():
    """Ends apart, both on one circle to what the grid allows, less than a half turn, no radius without measure."""
    arcs = [p for s in round_plan().steps for t in s.trajectories for p in written(t) if isinstance(p, GridArc)]
    assert len(arcs) >= 25
    for arc in arcs:
        ra, rb = (math.dist(p[:2], arc.centre) * GRID for p in (arc.start, arc.end))
        assert abs(ra - rb) <= 1.5e-4 and 0.05 <= ra <= MAX_ARC_RADIUS + GRID
        assert math.dist(arc.start[:2], arc.end[:2]) >= 200 and abs(arc.sweep) <= MAX_SWEEP + 1e-6
        assert (arc.sweep > 0.0) is arc.left


def test_links_and_a_tool_that_turns_are_not_touched():
    work = cutting(SHAPES["ring"])
    down = replace(work.steps[0].trajectories[2], motion=TrajectoryKind.CONNECT)
    ways = (*work.steps[0].trajectories[:2], down, *work.steps[0].trajectories[3:])
    same = fitted(replace(work, steps=(replace(work.steps[0], trajectories=ways),)), HALF)
    assert same.steps[0].trajectories == ways
    swings = clamped()
    swings = replace(swings, steps=(replace(step(1, BALL, "waterline", trajectories=leaning(4.0, 5.0)), access="I1"),))
    cuts = [t for t in fitted(swings, HALF).steps[0].trajectories if t.axes is not None]
    assert cuts and cuts[0] is swings.steps[0].trajectories[2]


@pytest.mark.parametrize("motion", [TrajectoryKind.APPROACH, TrajectoryKind.LIFT])
def test_arcs_on_and_off_a_wall_are_written_as_arcs(motion):
    lead = arc_onto(np.array([3.0, 4.0, 1.0]), np.array([0.6, 0.8, 0.0]), np.array([-0.8, 0.6, 0.0]), 2.0, 0.5 * HALF)
    work = cutting(lead)
    steps = work.steps[0]
    ways = (*steps.trajectories[:2], replace(steps.trajectories[2], motion=motion), *steps.trajectories[3:])
    made = fitted(replace(work, steps=(replace(steps, trajectories=ways),)), HALF).steps[0].trajectories[2]
    (arc,) = made.arcs
    assert (arc.first, arc.last) == (0, len(made.points) - 1) and arc.left
    np.testing.assert_allclose(arc.centre, [3.0 - 1.6, 4.0 + 1.2], atol=0.01)


def test_the_budget_is_told():
    work = cutting(SHAPES["ring"])
    assert fitted(work, HALF).steps[0].chordal_tolerance == pytest.approx(0.005)
    assert fitted(work, 0.0) is work


@pytest.mark.parametrize("name", SHAPES)
def test_a_loose_pass_has_more_room_and_the_one_beside_it_has_not(name):
    work = cutting(SHAPES[name])
    ways = work.steps[0].trajectories
    k = next(k for k, t in enumerate(ways) if t.motion is TrajectoryKind.CUT)
    more = replace(work.steps[0], trajectories=(*ways[:k], replace(ways[k], loose=0.02), *ways[k:]))
    alone = cut_of(fitted(work, HALF))
    step = fitted(replace(work, steps=(more,)), HALF).steps[0]
    loose, exact = step.trajectories[k:k + 2]
    np.testing.assert_allclose(exact.points, alone.points, atol=1e-9)
    assert [(a.first, a.last, a.left) for a in exact.arcs] == [(a.first, a.last, a.left) for a in alone.arcs]
    assert off(np.vstack([drawn(p) for p in written(loose)])[::3], SHAPES[name]) <= HALF + 0.02 + GRAIN
    assert len(written(loose)) <= len(written(exact))
    assert step.chordal_tolerance == pytest.approx(work.steps[0].chordal_tolerance + HALF + 0.02)


@pytest.mark.parametrize("share", [0.0, 0.37])
@pytest.mark.parametrize("name", SHAPES)
def test_a_loose_pass_goes_through_the_place_where_its_tool_comes_down_again(name, share):
    """It passes beside it otherwise, and the tool comes down into the sliver that stays there."""
    work = cutting(SHAPES[name])
    ways = work.steps[0].trajectories
    k = next(k for k, t in enumerate(ways) if t.motion is TrajectoryKind.CUT)
    path = ways[k].points
    places = [(1.0 - share) * path[i] + share * path[i + 1] for i in range(1, len(path) - 1, max(len(path) // 7, 1))]
    above = [Trajectory(TrajectoryKind.APPROACH, np.array([p + [0.0, 0.0, 5.0], p]), 100.0) for p in places]

    def nearest(loose, after, tool=work.steps[0].tool):
        first = replace(work.steps[0], trajectories=(*ways[:k], replace(ways[k], loose=loose), *ways[k + 1:]))
        again = replace(work.steps[0], tool=tool, trajectories=tuple(after))
        pieces_ = written(cut_of(fitted(replace(work, steps=(first, again)), HALF)))
        assert off(np.vstack([drawn(p) for p in pieces_])[::3], path) <= HALF + loose + GRAIN
        ends = np.vstack([p[[0, -1]] if not isinstance(p, GridArc) else [p.start, p.end] for p in pieces_]) * GRID
        drawn_ = np.vstack([drawn(p) for p in pieces_] + [ends])
        return max(np.linalg.norm(drawn_ - p, axis=1).min() for p in places)

    assert nearest(0.02, above) <= GRID
    if name in ("ring", "helix", "sine"):
        assert nearest(0.02, []) > 20 * GRID
    aside = [replace(t, points=t.points - [0.0, 0.0, 0.01]) for t in above]  # deeper than the cut: nothing it relies on
    other = replace(work.steps[0].tool, id="T99")
    assert nearest(0.02, aside) == pytest.approx(nearest(0.02, []))
    assert nearest(0.02, above, other) == pytest.approx(nearest(0.02, []))


def test_blocks_end_where_many_passes_are_gone_along_at_once():
    """The same whatever lies beside a pass; a long one is cut where its blocks end, no more."""
    long = np.vstack([turn(5.0, 0.1 * k, 0.1 * k + 0.1, centre=(0.0, 0.0, 1.0))[:-1] for k in range(900)])
    alone = stretches(SHAPES["sine"], np.array([900]), np.array([True]), HALF)
    beside = stretches(np.vstack([long, SHAPES["sine"]]), np.array([len(long), 900]), np.array([True, True]), HALF)
    mine = beside.first >= len(long)
    assert (beside.last[mine] - len(long) == alone.last).all() and (beside.is_arc[mine] == alone.is_arc).all()
    assert 30 <= int((~mine).sum()) <= 32 + len(long) / BLOCK


OTHERS = ("fanuc", "haas", "siemens", "heidenhain")


def read(work, text, dialect):
    c = work.clamping
    return read_program(text, name=dialect, dialect=dialect, work_offset=work.work_offset,
                        kinematics=Kinematics(c.machine.kind, c.machine.pivots) if c else None,
                        gauge_length=c.gauges if c else {})


def write(work, dialect):
    return write_program(work, DIALECTS[dialect](Switches()))


@pytest.mark.parametrize("dialect", OTHERS)
def test_all_controls_say_the_same_arcs(dialect):
    work = round_plan()
    first = read(work, write_linuxcnc(work), "linuxcnc")
    text = write(work, dialect)
    assert not first.remarks and difference(first, read(work, text, dialect)) == ""
    assert len(re.findall(r"(?:^|\s)(?:G[23]|CP?) (?:X|IPA)\S+ .*", text)) >= 25


@pytest.mark.parametrize("dialect", DIALECTS)
def test_golden(dialect):
    """A quarter to the left, a line, a quarter down to the right."""
    way = np.vstack([turn(5.0, 0.0, 1.6), turn(2.0, 1.6 + math.pi, math.pi, -0.25, (
        10.0 + 7.0 * math.cos(1.6), 8.0 + 7.0 * math.sin(1.6), 4.0))[1:]])
    work = fitted(replace(cutting(way), steps=cutting(way).steps), HALF)
    assert_golden(f"arcs.{dialect}.{DIALECTS[dialect].ending}", write(work, dialect))


MUTATIONS = {
    "linuxcnc": [(r"\nG3 ", "\nG2 "), (r"\nG2 ", "\nG3 "), (r" I(-?\d)", r" I1\1"),
                 (r"(\nG3 .* J-?\d*\.\d)", r"\g<1>9"), (r"\nG91\.1", "\nG90.1"), (r"(\nG3 .*) I\S+ J\S+", r"\1")],
    "fanuc": [(r"\nG3 ", "\nG2 "), (r" J(-?\d)", r" J1\1")],
    "siemens": [(r"\nG2 ", "\nG3 "), (r"(\nG3 .* I-?\d*\.\d)", r"\g<1>9")],
    "heidenhain": [(r"DR\+", "DR-"), (r"CC X\+(\d)", r"CC X+1\1"), (r"IPA\+", "IPA-"), (r"IPA\+(\d)", r"IPA+1\1"),
                   (r"(CP IPA\S+) Z\+3", r"\1 Z+4")],
}


@pytest.mark.parametrize(("dialect", "change"), [(d, c) for d, cs in MUTATIONS.items() for c in cs])
def test_planted_differences_are_found(dialect, change):
    work = round_plan()
    text = write(work, dialect)
    wrong, count = re.subn(*change, text, count=1)
    assert count and wrong != text
    first = read(work, write(work, "haas"), "haas")
    try:
        assert difference(first, read(work, wrong, dialect)) != ""
    except ProgramError:
        pass  # refused outright: found as well


def test_a_chord_more_is_no_difference_but_another_way_is():
    """What rounding may do to the number of chords of an arc: the same arc in two programs that end by 0.1 um apart."""
    head = "G21 G17 G90 G94 G54 G64 P0.001\nT1 M6\nG43 H1\nS900 M3 M8\nG0 X0. Y0.\nZ0.\n"
    chord = 4 * math.asin(math.sqrt(1e-3 / 2))
    more = set()
    for k in range(3, 40):
        x, y = math.cos(k * chord) - 1.0, math.sin(k * chord)
        texts = [f"{head}G3 X{x + d:.7f} Y{y:.7f} I-1. J0. F100\nG1 X0.\nM5\nM9\nM30\n" for d in (-1e-6, 1e-6)]
        one, other = (read_program(t) for t in texts)
        assert difference(one, other) == difference(other, one) == ""
        more.add(len(one) - len(other))
        wide = texts[1].replace("I-1.", "I-1.05")
        try:
            assert k < 15 or difference(one, read_program(wide)) != ""
        except ProgramError:
            pass  # ends on two circles
    assert more > {0}
    apart = texts[0].replace("G3", "G2")
    assert difference(one, read_program(apart)) != ""


@pytest.mark.parametrize("write_stepnc", [write_stepnc_aim, write_stepnc_arm])
@pytest.mark.parametrize("job", ["three axes", "a clamping", "restart"])
def test_stepnc_agrees(job, write_stepnc):
    work = {"three axes": round_plan, "a clamping": lambda: fitted(round_clamped(), HALF),
            "restart": lambda: replace(round_plan(), restart=True)}[job]()
    nc = read(work, write_linuxcnc(work), "linuxcnc")
    c = work.clamping
    got = read_stepnc(write_stepnc(work), kinematics=Kinematics(c.machine.kind, c.machine.pivots) if c else None)
    assert check_agreement(nc, got).tip <= 1e-3


def test_arcs_of_a_clamping_stand_where_the_rotary_axes_do():
    """Upright, the frame turned about Z: arcs; leaning: straight moves. All controls the same."""
    work = fitted(round_clamped(), HALF)
    text = write_linuxcnc(work)
    parts = text.split("(S0")[1:]  # in the last the tool stands upright, but C off 0
    assert [bool(re.search(r"^G[23] ", p, re.MULTILINE)) for p in parts] == [True, True, False, False]
    first = read(work, text, "linuxcnc")
    for dialect in OTHERS:
        assert difference(first, read(work, write(work, dialect), dialect)) == "", dialect
    plain = read(round_clamped(), write_linuxcnc(round_clamped()), "linuxcnc")
    assert off(first.end[~np.isnan(first.feed)][::9], plain.end[~np.isnan(plain.feed)]) < HALF + 1e-3 + GRAIN


def test_a_million_points_in_seconds():
    """Complexity: n log b; here 200 000."""
    rows = np.vstack([SHAPES["sine"] + [0.0, 0.1 * k, 0.0] for k in range(222)])
    fit = stretches(rows, np.full(222, 900), np.ones(222, np.bool_), HALF)
    assert len(fit.first) < 0.1 * len(rows)
