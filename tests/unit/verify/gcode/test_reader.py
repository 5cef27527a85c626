"""The NC reader: moves by hand, modal states, arcs, cycles."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import CamError, ProgramError
from geometry.sampling import sample_surface
from tests.pocket_case import SETUP, TOOL, ZONES, block, program
from tests.pocket_case import text as joined
from tests.time_limits import in_time
from verify.gcode.reader import FEED, RAPID, read_program
from verify.model import FindingKind, ScoredSamples
from verify.program.move_log import Log
from verify.prove import error_bound, prove

HEAD = "%\nG21 G90 G17 G94 G40 G49 G54 G61\nT1 M6\nS1000 M3\nG0 X0 Y0\nG43 H1 Z10\n"
TAIL = "M30\n%\n"
_FEW = sample_surface(block().mesh, 1.0, seed=3)
SAMPLES = ScoredSamples(_FEW, np.zeros(len(_FEW), np.int32))


def read(body, **options):
    return read_program(HEAD + body + TAIL, **options)


def cuts(program):
    keep = program.kind == FEED
    return program.start[keep], program.end[keep]


def test_modal_lines():
    p = read("G1 Z-1 F200\nX10\nY5.5 F300\nN40 G1X0Y0Z-.5\nG0 Z10\n")
    assert p.kind.tolist() == [RAPID, FEED, FEED, FEED, FEED, RAPID]
    np.testing.assert_array_equal(p.end[1:], [[0, 0, -1], [10, 0, -1], [10, 5.5, -1], [0, 0, -0.5], [0, 0, 10]])
    np.testing.assert_array_equal(p.feed[1:5], [200, 200, 300, 300])
    assert p.line[1:].tolist() == [7, 8, 9, 10, 11] and (p.tool == 1).all() and p.remarks == ()


def test_comments_words_run_together_and_several_g_words():
    p = read("(one) G1 G17 Z-1 F200 ; tail\n; only\n(a)(b)\n\ng1x1y2z3f4\nG0G90X5\n")
    np.testing.assert_array_equal(p.end[1:], [[0, 0, -1], [1, 2, 3], [5, 2, 3]])


def test_relative_and_inch():
    p = read("G1 F100\nG91 X1\nX1 Y1\nG90 G20 X1\nF10 X1 Y1.5\nG21 X2\n")
    np.testing.assert_allclose(p.end[1:], [[1, 0, 10], [2, 1, 10], [25.4, 1, 10], [25.4, 38.1, 10], [2, 38.1, 10]])
    assert p.feed[4] == pytest.approx(254)
    assert read("G1 G20 X1 F10\n").feed[1] == pytest.approx(10)  # LinuxCNC reads F in the old unit


@pytest.mark.parametrize("plane, i, j, k", [("G17", 0, 1, 2), ("G18", 2, 0, 1), ("G19", 1, 2, 0)])
@pytest.mark.parametrize("word, sense", [("G2", -1), ("G3", 1)])
def test_arcs_in_three_planes(plane, i, j, k, word, sense):
    """A quarter from (r, 0) round the centre at the start minus r, with a rise along the third axis."""
    r, rise = 5.0, 2.0
    start = np.array([0.0, 0.0, 10.0])
    end = start.copy()
    end[i] -= r
    end[j] += sense * r
    end[k] += rise
    xyz = " ".join(f"{a}{v:.4f}" for a, v in zip("XYZ", end, strict=True))
    p = read(f"{plane} {word} {xyz} {'IJK'[i]}{-r} F100\nG17\n")
    _, e = cuts(p)
    centre = start[[i, j]] - [r, 0]
    np.testing.assert_allclose(np.hypot(*(e[:, [i, j]] - centre).T), r, atol=1e-9)
    angle = np.arctan2(e[:, j] - centre[1], e[:, i] - centre[0]) * sense
    assert (np.diff(angle) > 0).all() and angle[-1] == pytest.approx(math.pi / 2)
    np.testing.assert_allclose(e[:, k], start[k] + rise * angle / (math.pi / 2), atol=1e-9)
    step = np.diff(angle).max()
    assert r * (1 - math.cos(step / 2)) <= 1e-3


@pytest.mark.parametrize("words", ["X10 Y0 R5", "X10 Y0 I5 J0", "G90.1 X10 Y0 I5 J0"])
def test_half_circle_by_radius_and_centres(words):
    _, e = cuts(read(f"G2 {words} F100\n"))
    assert e[:, 1].max() == pytest.approx(5, abs=2e-3) and e[-1].tolist() == [10, 0, 10]


@pytest.mark.parametrize("radius, top", [(10, 10 - math.sqrt(75)), (-10, 10 + math.sqrt(75))])
def test_radius_sign_chooses_the_way(radius, top):
    _, e = cuts(read(f"G2 X10 Y0 R{radius} F100\n"))
    assert e[:, 1].max() == pytest.approx(top, abs=2e-3)


def test_full_circle_is_closed_and_as_long_as_it_should_be():
    s, e = cuts(read("G3 I3 F100\n"))
    assert np.linalg.norm(e - s, axis=1).sum() == pytest.approx(6 * math.pi, rel=1e-3)
    np.testing.assert_allclose(e[-1], s[0])


def test_feed_modes():
    p = read("G93 G1 X10 F2\nG95 X20 F0.1\nG94 X30 F50\n")
    np.testing.assert_allclose(p.feed[1:], [20, 100, 50])


def test_drilling_cycles():
    p = read("G98 G81 X5 Y5 Z-3 R1 F80\nX9\nG80\nG0 X0\n")
    np.testing.assert_array_equal(p.end[1:], [[5, 5, 10], [5, 5, 1], [5, 5, -3], [5, 5, 10], [9, 5, 10], [9, 5, 1],
                                              [9, 5, -3], [9, 5, 10], [0, 5, 10]])
    p = read("G99 G83 X0 Y0 Z-3 R1 Q2 F80\nG80\n")
    down = p.end[p.kind == FEED][:, 2]
    np.testing.assert_array_equal(down, [-1, -3])
    assert p.end[-1, 2] == 1
    p = read("G82 X0 Y0 Z-3 R1 P0.5 F80\nG80\nG4 P2\n")
    assert p.dwell == 2.5
    assert (read("G73 X0 Y0 Z-3 R1 Q1 F80\nG80\n").kind == FEED).sum() == 4


def test_a_drilling_cycle_in_inverse_time_is_refused():
    """rs274 says: Cannot feed with zero feed rate."""
    with pytest.raises(ProgramError, match="line 8: a drilling cycle in inverse time"):
        read("G93\nG81 X0 Y0 Z-3 R1 F80\n")


def test_machine_moves_leave_axes_unknown_until_programmed():
    p = read("G1 Z-1 F100\nG0 Z10\nG53 G0 Z0\nG0 X50\nG0 Z5\nG28\nG0 X1 Y1\nZ3\n")
    np.testing.assert_array_equal(p.end[-2:], [[50, 0, 5], [1, 1, 3]])
    assert p.start[-1].tolist() == [1, 1, 3]


def test_tool_change_needs_its_length_again():
    p = read("G1 Z1 F100\nG0 Z20\nT2 M6\nM3\nG0 X5\nG43 H2 Z9\nG1 Z-1\n")
    assert p.tool.tolist()[-2:] == [2, 2] and p.remarks == ()
    p = read("G1 Z1 F100\nG0 Z20\nT2 M6\nM3\nG0 X5 Z9\nG1 Z-1\n")
    assert {"length offset H1 and tool T2" in r.message for r in p.remarks} >= {True}


@pytest.mark.parametrize("body, word", [
    ("G55 G0 X1\n", "G55"), ("G43 H3 Z5\n", "H3"), ("G49\nG1 Z1 F100\n", "G43"), ("M5\nG1 Z1 F100\n", "spindle"),
    ("/G0 X1\n", "/")])
def test_remarks_name_what_should_not_run(body, word):
    p = read(body)
    assert any(word in r.message for r in p.remarks) and all(r.line >= 7 for r in p.remarks)


def test_each_move_knows_the_word_that_reversed_the_spindle():
    p = read("G1 Z1 F100\nM4\nX1\nX2\nM5\nM3\nX3\n")
    assert p.reversed_by[-4:].tolist() == [0, 8, 8, 0]


@pytest.mark.parametrize("body, line, words", [
    # path blending: bare and P0 are without bound, P and Q in the unit of the program
    ("G64\n", 7, ("G64", "any amount", "0.01 mm")), ("G64 P0\n", 7, ("any amount",)),
    ("G64 P1.0\n", 7, ("G64 P1", "1 mm", "limit 0.01 mm")), ("G64 P0.011\n", 7, ("0.011 mm",)),
    ("G64 P-1\n", 7, ("G64 P-1",)), ("G64 P0.005 Q1\n", 7, ("G64 Q1",)),
    # spindle
    ("S0\nG1 Z1 F100\n", 8, ("spindle standing", "S0")), ("S0 M3\nG1 Z1 F100\n", 8, ("S0",)),
    ("G1 Z1 F100\nS0\nZ2\n", 9, ("S0",)), ("M5 G1 Z1 F100\n", 7, ("no M3",)), ("G2 I5 S0 F100\n", 7, ("S0",)),
    ("G81 X1 Y1 Z-1 R1 S0 F100\nG80\n", 7, ("S0",)), ("T2 M6\nG43 H2 Z5\nG1 Z1 F100\n", 9, ("no M3",)),
    ("S-5\n", 7, ("S-5",)),
    # machine coordinates: only home is above everything
    ("G53 G0 Z-200\n", 7, ("G53 Z-200",)),
    ("G53 G0 Z0\nG53 G0 X0 Y0\nG0 Z5\nX1 Y1\n", 9, ("program X and Y",)), ("G91 G53 G0 Z0\nG90\n", 7, ("G91",)),
    ("G53 G0 Z0\nG1 X5 F100\n", 8, ("not stated",)),
    # unit
    ("G20\nG0 Z1\n", 7, ("G20", "within")),
    # words no code takes
    ("D1 L5 Q17\n", 7, ("D1, L5, Q17",)), ("G1 X1 K5 F100\n", 7, ("K5",)), ("X1 I5\n", 7, ("I5",)),
    ("G1 X1 R9 P9 F100\n", 7, ("R9, P9",)), ("G0 X1\nX2 H1\n", 8, ("H1",)), ("G2 X10 R5 I5 F100\n", 7, ("I5",)),
    ("G0 R5\n", 7, ("R5",)), ("G2 I5 F100\nR5 P2\n", 8, ("R5, P2",)), ("G28 R1\n", 7, ("R1",)),
    ("G81 X1 Y1 Z-1 R1 Q2 F100\nG80\n", 7, ("Q2",)),
    # incremental coordinates forgotten
    ("G1 X1 F100\nG91\n" + "X1\n" * 50, 8, ("G91", "never switches back")),
    ("G0 Z20\nT2 M6\nG43 H2 M3\nG91 G0 Z-5\nG90 Z20\n", 10, ("Z-5", "line 10", "not stated")),
])
def test_what_a_machine_might_do_otherwise_is_named_on_its_line(body, line, words):
    assert [r for r in read(body).remarks if r.line == line and all(w in r.message for w in words)], read(body).remarks


def test_a_cut_behind_a_change_of_pallets_is_told():
    told = [r for r in read("G1 X1 F100\nM60\nG0 Z9\nG1 X2\nX3\n").remarks if "pallet" in r.message]
    assert [r.line for r in told] == [10] and "M60 of line 8" in told[0].message
    assert not [r for r in read("G1 X1 F100\nG53 G0 Z0\nM60\n").remarks if "pallet" in r.message]


@pytest.mark.parametrize("body", ["G53 G0 X0 Y0 Z0\n", "G53 G0 X5\n", "G28\n"])
def test_x_and_y_go_to_places_of_the_machine_from_a_known_height(body):
    assert [(s.line, s.tip[2], s.room) for s in read(body).stops if "fixed place" in s.event] == [(7, 10.0, True)]


@pytest.mark.parametrize("body", [
    "G64 P0.01\nG1 Z1 F100\n", "G61\n", "G61.1\n", "G64 P0.002 Q0.002\n", "G53 G0 Z0\nX5 Y5\nZ5\nG1 Z1 F100\n",
    "G53 G0 Z0\nG53 G0 X0 Y0\nG0 X1 Y1\nZ5\n", "G91 G28 Z0\nG28 X0 Y0\nG90\nG0 X1 Y1\nZ5\n",
    "G1 X1 F100\nG91 G28 Z0\n", "G91\nG1 X1 F100\nX1\n", "G1 X1 F100\nG91 X1\nG90 X5\n",
    "G91\nG1 X1 F9\nG90 G0 X9\nG91\nG1 X1\n", "G80 G0 X1\n", "G0 G80 X1\n", "G17 G40 G49 G80 G90\nG43 H1\n",
    "G2 X10 I5 K0 F100\n", "G2 I5 P3 F100\n", "G81 X1 Y1 Z-1 R1 K2 F100\nG80\n", "G73 X1 Y1 Z-1 R1 Q1 P1 F100\nG80\n",
    "S500\nG1 X1 F100\n", "M7\nM8\nM9\n", "G21\n"])
def test_harmless_habits_are_not_remarked(body):
    assert read(body).remarks == ()


def test_speed_never_given():
    p = read_program("%\nG21 G90 G61\nT1 M6\nM3\nG43 H1\nG0 X0 Y0\nZ5\nG1 Z1 F100\nM30\n%\n")
    assert [(r.line, "no S given" in r.message) for r in p.remarks] == [(8, True)]


def test_blending_limit_is_the_tolerance_of_the_setup():
    assert read("G64 P0.02\n", blend_limit=0.03).remarks == ()
    assert "0.001 mm" in read("G64 P0.002\n", blend_limit=0.001).remarks[0].message
    lines = program()
    lines.insert(2, "G64 P0.002")
    found = {tolerance: prove([("a", joined(lines))], block(), (TOOL,), replace(SETUP, gouge_tolerance=tolerance),
                              SAMPLES, ZONES).findings for tolerance in (0.01, 0.03)}
    assert [(f.kind, f.line) for f in found[0.01]] == [(FindingKind.PROGRAM, 3)] and found[0.03] == ()


@pytest.mark.parametrize(("words", "blend", "leaves"), [
    ("G64 P0.002", 0.002, 0.004), ("G64 P0.002 Q0", 0.002, 0.002), ("G64 P0.002 Q0.001", 0.002, 0.003),
    ("G61", 0.0, 0.0)])
def test_points_are_left_out_by_p_where_no_q_is_said(words, blend, leaves):
    """LinuxCNC's default; what both allow is in the error bound."""
    lines = program()
    lines.insert(2, words)
    p = read_program(joined(lines))
    assert (p.blend, p.leaves) == pytest.approx((blend, leaves))
    assert error_bound([p]) - error_bound([read_program(joined(program()))]) == pytest.approx(leaves)


def test_unit_in_force_scales_what_blending_may_take():
    p = read_program("%\nG20 G90 G64 P0.001\nT1 M6\nM30\n%\n")
    assert "0.0254 mm" in p.remarks[0].message and p.remarks[0].line == 2


def test_remarks_of_one_kind_are_bounded_and_counted():
    p = read("X1 D1\n" * 1000)
    assert len(p.remarks) == 20 and "980 more" in p.remarks[-1].message


def test_incremental_slip_is_simulated_exactly():
    p = read("G1 X1 F100\nG91\nX1\nX-3 Z1\n")
    np.testing.assert_array_equal(p.end[1:], [[1, 0, 10], [2, 0, 10], [-1, 0, 11]])
    assert p.line[1:].tolist() == [7, 9, 10]


def test_many_moves_keep_their_order_across_chunks(monkeypatch):
    monkeypatch.setattr(Log, "full", 7)
    p = read("G1 F100\n" + "".join(f"X{k}\n" for k in range(1, 50)) + "G2 I1\nG91 G1 X1\nG90 X0\n")
    np.testing.assert_array_equal(p.start[1:], p.end[:-1])
    assert p.end[1:50, 0].tolist() == list(range(1, 50)) and (np.diff(p.line) >= 0).all()


def test_pecks_end_on_the_depth():
    down = read("G83 X0 Y0 Z-1 R1 Q0.3 F80\nG80\n")
    np.testing.assert_allclose(down.end[down.kind == FEED][:, 2], [0.7, 0.4, 0.1, -0.2, -0.5, -0.8, -1.0])


def test_any_words_give_a_program_or_an_error_with_a_line():
    """Random words: a reading ends in moves that are finite, or names a line; nothing else escapes."""
    rng = np.random.default_rng(7)
    words = ("G0 G1 G2 G3 G4 G17 G18 G19 G20 G21 G28 G30 G40 G43 G49 G53 G54 G61 G64 G73 G80 G81 G82 G83 G90 G91 G90.1 "
             "G93 G94 G95 G98 G99 M3 M5 M6 M0").split()
    numbers = "0 1 2 5 -3 0.5 .001 12.75 1e3 100000 999999999999 0.0000001 -0".split()
    read_through = 0
    for _ in range(1500):
        body = ""
        for _ in range(rng.integers(1, 5)):
            letters = rng.choice(list("XYZIJKRPQLFSTHD"), rng.integers(0, 6), replace=False)
            body += " ".join([*rng.choice(words, rng.integers(0, 3)), *(a + str(rng.choice(numbers)) for a in letters)])
            body += "\n"
        try:
            p = read("G0 F100\n" + body)
        except CamError as error:
            assert error.subjects[0].startswith("line ") and error.code in ("bad_program", "program_too_long"), body
            continue
        read_through += 1
        assert np.isfinite(p.start).all() and np.isfinite(p.end).all() and math.isfinite(p.dwell), body
        assert (p.feed[p.kind == FEED] >= 0).all(), body
    assert read_through > 50


def test_file_without_percent_and_windows_lines():
    assert len(read_program("G21 G90\r\nT1 M6\r\nG43 H1\r\nM3 S9\r\nG0 X0 Y0 Z5\r\nG1 X1 F9\r\nX2\r\nM2\r\n")) == 3


def test_a_carriage_return_within_a_line_is_refused():
    """LinuxCNC takes all up to the line feed for the comment: G0 Z15 does not run."""
    text = "G21 G90\nT1 M6\nG43 H1\nM3 S9\nG0 X0 Y0 Z5\n; up\rG0 Z15\nG1 X1 F9\nM2\n"
    with pytest.raises(ProgramError, match="line 6 holds a carriage return"):
        read_program(text)
    assert len(read_program(text.replace("; up\r", "").replace("\n", "\r"))) == 3
    assert len(read_program(text.replace("; up\r", "").replace("\n", "\r\r\n") + "\r")) == 3


def test_speed_of_plain_lines():
    import time
    body = "G1 Z-1 F200\n" + "".join(f"X{k % 60}.125 Y{k % 37}.5 Z-1.0625\n" for k in range(50_000))
    begin = time.perf_counter()
    assert len(read(body)) > 50_000
    assert in_time(time.perf_counter() - begin, 2.0)


@pytest.mark.parametrize(("mode", "line"), [("", 6), ("G61", 0), ("G61.1", 0), ("G64 P0.001", 0), ("G64", 1)])
def test_linuxcnc_starts_in_g64_without_a_tolerance(mode, line):
    """A program that states no path mode gets the finding that G64 gets; the word has to stand before the first cut."""
    p = read_program(f"G21 G90 G17 G94 G54 {mode}\nT1 M6\nS900 M3\nG43 H1\nG0 X0 Y0 Z5\nG1 Z1 F100\nX5\nM2\n")
    assert [(r.line, "by any amount" in r.message) for r in p.remarks] == ([(line, True)] if line else [])


def test_a_path_mode_after_the_first_cut_does_not_count_for_it():
    p = read_program("G21 G90 G17 G94 G54\nT1 M6\nS900 M3\nG43 H1\nG0 X0 Y0 Z5\nG1 Z1 F100\nG61 X5\nM2\n")
    assert [r.line for r in p.remarks] == [6]
    assert read_program("G21 G90\nG0 X0 Y0\nZ5\nM2\n").remarks == ()


@pytest.mark.parametrize(("lines", "told"), [
    ("T1 M6\nG43 H1\nM61 Q2\nG43 H2\n", True), ("M61 Q1\nG43 H1\n", False), ("T1 M6\nM61 Q1\nG43 H1\n", False),
    ("T1 M6\nG43 H1\nM0\nM61 Q2\nG43 H2\n", False), ("T1 M6\nT0 M6\nM61 Q2\nG43 H2\n", False)])
def test_a_number_of_a_tool_that_nobody_changed_is_a_finding(lines, told):
    p = read_program(f"G21 G90 G94 G17 G54\n{lines}S1000 M3\nG0 X0 Y0 Z9\nG1 Z0 F99\nM2\n")
    assert any("a tool change is missing" in r.message for r in p.remarks) == told
