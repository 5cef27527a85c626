"""The NC reader on machines with rotary axes: words, tool centre point control, poses, times, pieces."""

import math

import numpy as np
import pytest

from geometry.errors import CamError, ProgramError
from verify.gcode.reader import FEED, RAPID, read_program
from verify.kinematics import Kinematics
from verify.program.arc_chords import CHORD
from verify.program.turn_subdivision import MAX_TURN, TURN, axis_pieces

PIVOTS = {"table-table-AC": ((3.0, -2.0, -40.0), (1.5, 4.0, -7.0)),
          "head-table-BC": ((0.0, 0.0, 60.0), (12.0, -5.0, 3.0)), "head-head-BC": ((0.0, 0.0, 60.0),)}
HEAD = "%\nG21 G90 G17 G94 G40 G49 G54 G61\nT1 M6\nS1000 M3\nG43 H1\nG0 {0}0 C0\nX0 Y0\nZ10\n"
TAIL = "M30\n%\n"
GAUGE = 80.0


def read(body, kind="table-table-AC", pivots=True, **options):
    machine = Kinematics(kind, PIVOTS[kind] if pivots else None)
    return read_program(HEAD.format(kind[-2]) + body + TAIL, kinematics=machine, gauge_length={1: GAUGE}, **options)


def between(a, b, share):
    """Great circles from unit vectors a to b, evenly, at shares of the way; all (n, ...)."""
    angle = 2 * np.arcsin(np.linalg.norm(b - a, axis=1)[:, None] / 2)
    with np.errstate(invalid="ignore"):
        bow = (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle)
    return np.where(angle < 1e-9, a, bow)


def strayed(p, rows, path, machine, count=40):
    """How far rows of a program leave what the control does: tip, mm, and axis, rad.

    path : shares of the block to (joints or tips, angles rad, whether they are joints)
    """
    n, turns = len(rows), np.concatenate([p.poses.start_turn[rows, 1], p.poses.end_turn[rows[-1:], 1]])
    ends = np.linspace(0, 1, n + 1) if np.ptp(turns) == 0 else (turns - turns[0]) / (turns[-1] - turns[0])
    share = np.tile((np.arange(count) + 0.5) / count, n)
    row = np.repeat(rows, count)
    t = np.repeat(ends[:-1], count) + share * np.repeat(np.diff(ends), count)
    places, turns, joints = path(t[:, None])
    want = machine.tip(places, turns, GAUGE) if joints else places
    tip = p.start[row] + share[:, None] * (p.end[row] - p.start[row])
    axis = between(p.poses.start_axis[row], p.poses.end_axis[row], share[:, None])
    off = 2 * np.arcsin(np.linalg.norm(axis - machine.axis(turns), axis=1) / 2)
    return np.linalg.norm(tip - want, axis=1).max(), off.max()


@pytest.mark.parametrize("kind", PIVOTS)
@pytest.mark.parametrize("tcp", [True, False])
@pytest.mark.parametrize("start, end", [
    ((0, 0, 10, 0, 0), (30, -20, 5, 70, 0)), ((0, 0, 10, 40, 0), (0, 0, 10, 40, 360)),
    ((5, 5, 5, -30, 20), (6, 4, 5, 65, 400)), ((0, 50, 0, 0, 0), (10, 50, 0, 2, 180)),
    ((0, 0, 0, 90, 0), (0, 30, 0, 90, 90)), ((9, 0, 0, -1, 10), (9, 1, 0, 1, 12))])
def test_pieces_stay_as_near_as_promised_to_what_the_control_does(kind, tcp, start, end):
    a, b = (np.array(x, float) for x in (start, end))
    machine = Kinematics(kind, PIVOTS[kind])
    words = ["X{} Y{} Z{}".format(*x[:3]) + f" {kind[-2]}{x[3]} C{x[4]}" for x in (start, end)]
    p = read(f"{'M428' if tcp else ''}\nG0 {words[0]}\nG1 {words[1]} F100\n", kind)
    rows = np.flatnonzero(p.line == p.line[-1])
    path = lambda t: (a[:3] + t * (b[:3] - a[:3]), np.radians(a[3:] + t * (b[3:] - a[3:])), not tcp)  # noqa: E731
    tip, axis = strayed(p, rows, path, machine)
    assert tip <= CHORD and axis <= TURN
    np.testing.assert_allclose(np.abs(np.diff(np.concatenate([p.poses.start_turn[rows], p.poses.end_turn[rows[-1:]]]),
                                              axis=0)).max(), np.radians(np.abs(b - a)[3:].max()) / len(rows))
    np.testing.assert_allclose(p.start[rows[1:]], p.end[rows[:-1]], atol=1e-12)
    assert np.radians(np.abs(b - a)[3:]).max() / len(rows) <= MAX_TURN


def test_pieces_are_no_more_than_needed():
    """A pure tilt is a great circle, a turn at the pole moves no axis, a circle at 45 degrees meets the bound."""
    assert axis_pieces((0, 0), (1.5, 0)) == math.ceil(1.5 / MAX_TURN) == axis_pieces((0, 0), (0, 1.5))
    n = axis_pieces((math.pi / 4, 0), (math.pi / 4, math.tau))
    machine = Kinematics("table-table-AC")
    f = np.linspace(0, 1, 41)[:, None]
    circle = machine.axis(np.array([[math.pi / 4, 0]]) + f * [[0, math.tau / n]])
    bow = between(np.repeat(circle[:1], 41, 0), np.repeat(circle[-1:], 41, 0), f)
    assert 0.9 * TURN < np.linalg.norm(bow - circle, axis=1).max() <= TURN


@pytest.mark.parametrize("kind", PIVOTS)
@pytest.mark.parametrize("tcp", [True, False])
def test_an_arc_that_turns_an_axis(kind, tcp):
    machine = Kinematics(kind, PIVOTS[kind])
    tilt = kind[-2]
    p = read(f"{'M428' if tcp else ''}\nG0 X20 Y0 Z0 {tilt}20 C10\nG3 X0 Y20 Z3 I-20 J0 {tilt}50 C200 F100\n", kind)
    rows = np.flatnonzero(p.line == p.line[-1])

    def path(t):
        angle = t * math.pi / 2
        place = np.column_stack([20 * np.cos(angle), 20 * np.sin(angle), 3 * t])
        return place, np.radians([20, 10] + t * [30, 190]), not tcp

    tip, axis = strayed(p, rows, path, machine)
    assert tip <= CHORD and axis <= TURN
    assert p.minutes[rows].sum() == pytest.approx(math.hypot(10 * math.pi, 3) / 100, rel=1e-4)


def test_the_tip_stays_with_centre_point_control():
    p = read("G43.4 H1\nG1 A30 C90 F900\nX10 Z5\nG49\n")
    turning = np.flatnonzero(p.line == 10)
    assert len(turning) > 1 and (p.end[turning] == [0, 0, 10]).all() and (p.end[-1] == [10, 0, 5]).all()
    np.testing.assert_allclose(p.poses.end_turn[-1], np.radians([30, 90]))
    want = Kinematics("table-table-AC").axis(np.radians([[30.0, 90.0]]))[0]
    np.testing.assert_array_equal(p.poses.start_axis[-1], want)
    np.testing.assert_array_equal(p.poses.end_axis[-1], want)
    assert (p.poses.end_axis[0] == [0, 0, 1]).all()


def test_joints_go_where_the_controller_was_seen():
    """With the pivots at zero, joints (0, 6.160, 9.330) at A30 C90 hold the tip at (10, 0, 5); and back by M428."""
    machine = Kinematics("table-table-AC", ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    text = HEAD.format("A") + "G1 X0 Y6.160 Z9.330 A30 C90 F100\nM428\nX11\nM429\nG91 Z2\n" + TAIL
    p = read_program(text, kinematics=machine)
    at = {n: p.end[p.line == n][-1] for n in (9, 11, 13)}
    np.testing.assert_allclose(at[9], [10, 0, 5], atol=1e-3)
    np.testing.assert_allclose(at[11], [11, 0, 5], atol=1e-3)
    np.testing.assert_allclose(at[13], at[11] + 2 * p.poses.end_axis[-1], atol=1e-9)


@pytest.mark.parametrize("off", ["G49", "G43 H1", "M428\nG49\nM429"])
@pytest.mark.parametrize("body", ["G0 A0\n", "G1 C5 F500\n", "G0 A45\n", "G0 X50\n", "G91 G28 C0\n"])
def test_without_pivots_nothing_moves_from_where_tip_control_went_off(off, body):
    """The part turns under a tool that stands beside it, and nothing says where the joints are."""
    with pytest.raises(ProgramError, match="pivots"):
        read(f"G43.4 H1\nG1 A30 C90 F900\nX10 Z5\n{off}\n{body}", pivots=False)


@pytest.mark.parametrize("body", ["G53 G0 Z0\nG0 A0 C0\n", "G91 G28 Z0\nG90\nG0 A0 C0\n", "G43.4 H1\nG0 X0 Y0 Z90\n",
                                  "G0 A30\n", "M5\n"])
def test_home_or_tip_control_puts_an_end_to_that(body):
    read(f"G43.4 H1\nG1 A30 C90 F900\nX10 Z5\nG49\n{body}", pivots=False)


def test_a_table_stands_still_while_the_linear_axes_drill():
    p = read("G0 A90 C0\nG0 Y-60 Z20\nG81 X0 Z10 R15 F80\nG80\n")
    holes = np.flatnonzero(p.kind == FEED)
    np.testing.assert_allclose((p.end - p.start)[holes], [[0, -5, 0]], atol=1e-9)  # A90 lays the tool along +Y
    np.testing.assert_allclose(p.minutes[holes], 5 / 80)


@pytest.mark.parametrize("body, minutes", [
    ("G93 G1 X30 A5 F4\n", 0.25), ("G93 G1 A5 F2\n", 0.5), ("G93 G1 X30 F4\n", 0.25),
    ("G1 X30 Y40 A5 F100\n", 0.5), ("G1 A30 C40 F100\n", 0.5), ("G20\nG1 A30 C40 F100\nG21\n", 0.5),
    ("G1 X30 Y40 F100\n", 0.5), ("G95 G1 C50 F0.1\n", 0.5)])
def test_times(body, minutes):
    p = read("M428\n" + body)
    assert p.minutes[p.kind == FEED].sum() == pytest.approx(minutes)
    assert np.isnan(p.minutes[p.kind == RAPID]).all() and (p.feed[p.kind == FEED] >= 0).all()


def test_incremental_words_turn_on_from_where_the_axes_stand():
    p = read("M428\nG0 A10\nG91 A5 C-30\nG90\n")
    np.testing.assert_allclose(np.degrees(p.poses.end_turn[-1]), [15, -30])


def test_axes_that_never_leave_zero_change_nothing():
    body = "G1 Z-1 F200\nX10\nG2 X20 R5\nG0 Z10\n"
    plain = read_program(HEAD.format("A").replace("G0 A0 C0\nX0", "G0\nX0") + body + TAIL)
    five = read(body + "G0 A0 C0\nM428\nM429\nG53 G0 A0\n")
    assert five.poses is None and plain.poses is None
    for name in ("start", "end", "kind", "feed", "minutes", "tool"):
        np.testing.assert_array_equal(getattr(five, name)[:len(plain)], getattr(plain, name))


@pytest.mark.parametrize("body, message, remedy", [
    ("G1 B5 F100\n", "unknown word B5 (the rotary axes of the machine are A and C)", "correct"),
    ("G43.5 H1\n", "unknown word G43.5", "correct"),
    ("G68.2 X0\n", "unknown word G68.2 (a tilted plane)", "correct"),
    ("M430\n", "unknown word M430 (user-defined kinematics)", "correct"),
    ("G92 A0\n", "G92 A (a shifted rotary zero)", "correct"),
    ("M70\nG43.4 H1\nM72\n", "M72 would switch tool centre point control (G43.4)", "correct"),
    ("G43 G43.4 H1\n", "G43 and G43.4 in one block", "correct"),
    ("M428 M429\n", "M428 and M429 in one block", "correct"),
    ("G81 X1 Y1 Z-1 R1 A5 F100\n", "a drilling cycle turns a rotary axis in its block", "correct"),
    ("G2 G4 P1 A5\n", "coordinates in a block with G4", "correct"), ("G80\nA5\n", "without a motion word", "correct"),
    ("G0 A30\n", "without tool centre point control at A30 C0", "machine.pivots_mm"),
    ("M428\nA30\nM429\nX0 Y0 Z0\n", "without tool centre point control at A30 C0", "machine.pivots_mm"),
    ("G93 G1 A5\n", "needs F in every block", "correct"), ("G1 A5\n", "without a feed", "correct")])
def test_what_cannot_be_read_is_named(body, message, remedy):
    with pytest.raises(ProgramError) as caught:
        read(body, pivots=False)
    assert message in caught.value.measured[0] and remedy in caught.value.remedy
    assert int(caught.value.subjects[0].split()[1]) >= 9


@pytest.mark.parametrize("word", ["A5", "B5", "C5", "G43.4", "M428", "M429"])
def test_without_rotary_axes_their_words_are_refused_by_name(word):
    with pytest.raises(ProgramError) as caught:
        read_program(f"%\nG21\n{word}\nM30\n%\n")
    assert f"line 3: unknown word {word}" in str(caught.value) and "machine.kinematics" in caught.value.remedy


def test_a_head_without_the_length_of_its_tool_is_refused():
    machine = Kinematics("head-head-BC", PIVOTS["head-head-BC"])
    with pytest.raises(ProgramError, match="gauge length of T1") as caught:
        read_program(HEAD.format("B") + "G0 B30\n" + TAIL, kinematics=machine)
    assert "gauge_length_mm" in caught.value.remedy


def test_home_and_machine_coordinates():
    """At home the axes turn unseen; what was turned with the control keeping the tip leaves no place known."""
    p = read("G53 G0 Z0\nG53 G0 A30 C90\nM428\nG0 X1 Y2 Z60\nG53 G0 Z0\nG28 A0 C0\nX0 Y0\nZ20\n")
    assert p.remarks == () and not (p.line == 10).any()
    first = int(np.flatnonzero(p.line == 12)[0])
    assert p.unknown.tolist()[-2:] == [[first, 15], [len(p) - 1, 4]]
    np.testing.assert_allclose(np.degrees(p.poses.end_turn[first]), [30, 90])
    assert (p.poses.end_turn[-1] == 0).all() and (p.start[-1] == p.end[-1]).all()
    q = read("G0 A30\nG91 G28 Z0 A0\nG90\n")
    assert [(r.line, "rotary axis turns" in r.message) for r in q.remarks] == [(10, True)]


def test_what_is_taken_for_granted():
    machine = Kinematics("table-table-AC")
    text = "G0 X0 Y0 Z50\nS1000 M3\nG61\nG1 X5 F100\nM30\n"
    p = read_program(text, kinematics=machine, spindle_tool=3, tools={1, 3})
    assert p.assumed == ("G21", "G90", "G17", "G94", "G54", "T3 M6", "G43 H3", "A0", "C0")
    assert (p.tool == 3).all() and p.remarks == ()
    p = read_program("T1 M6\nG43 H1\nG0 A0\n" + text, kinematics=machine, spindle_tool=3, tools={1, 3})
    assert p.assumed[5:] == ("C0",) and (p.tool == 1).all()
    with pytest.raises(ProgramError, match="the tool in the spindle, T9, is not"):
        read_program(text, spindle_tool=9, tools={1})


def test_plain_lines_under_centre_point_control_keep_their_pose():
    p = read("M428\nG0 A20 C5\nG1 F100\n" + "".join(f"X{k}\n" for k in range(1, 9)))
    rows = np.flatnonzero(p.line > 11)
    np.testing.assert_array_equal(p.end[rows, 0], np.arange(1, 9))
    np.testing.assert_allclose(np.degrees(p.poses.start_turn[rows]), np.tile([20, 5], (8, 1)))
    np.testing.assert_allclose(p.minutes[rows], 0.01)


@pytest.mark.parametrize("kind", PIVOTS)
def test_any_words_give_poses_that_hang_together_or_an_error_with_a_line(kind):
    """Random words: what is read is finite, axes have length one, and each known move begins where the last ended."""
    rng = np.random.default_rng(5)
    words = "G0 G1 G2 G3 G17 G18 G28 G43 G43.4 G49 G53 G81 G90 G91 G93 G94 M428 M429 M6".split()
    numbers = "0 1 2 5 -3 0.5 12.75 360 -90 40".split()
    read_through = turned = 0
    for _ in range(800):
        body = ""
        for _ in range(rng.integers(1, 6)):
            letters = rng.choice([*"XYZXYZIJKRPF", kind[-2], "C", "C"], rng.integers(0, 6))
            picked = [a + str(rng.choice(numbers)) for a in dict.fromkeys(letters.tolist())]
            body += " ".join([*rng.choice(words, rng.integers(0, 2)), *picked]) + "\n"
        try:
            p = read("G0 F100\n" + body, kind)
        except CamError as error:
            assert error.subjects[0].startswith("line ") and error.code == "bad_program", body
            continue
        read_through += 1
        assert np.isfinite(p.start).all() and np.isfinite(p.end).all(), body
        if p.poses is None:
            continue
        turned += 1
        for axis in (p.poses.start_axis, p.poses.end_axis):
            np.testing.assert_allclose(np.linalg.norm(axis, axis=1), 1.0, atol=1e-12)
        if len(p.unknown) == 1:  # nothing but the start of the program is unknown
            np.testing.assert_allclose(p.start[1:], p.end[:-1], atol=1e-9, err_msg=body)
            np.testing.assert_allclose(p.poses.start_turn[1:], p.poses.end_turn[:-1], atol=1e-12, err_msg=body)
    assert read_through > 60 and turned > 30


def test_what_home_and_increments_say_of_where_an_axis_stood():
    machine = Kinematics("table-table-AC")
    for words, taken in (("G0 A0", ("C0",)), ("G91 G0 A5 C5", ("A0", "C0")), ("G28", ()), ("G91 G28 C0", ("A0",)),
                         ("G53 G0 A0 C0", ()), ("G0", ("A0", "C0"))):
        p = read_program(f"T1 M6\nG43 H1\nM428\n{words}\nG90 G0 X0 Y0 Z50\nM30\n", kinematics=machine)
        assert tuple(w for w in p.assumed if w in ("A0", "C0")) == taken, words


@pytest.mark.parametrize(("body", "line"), [
    ("G0 A30\nG1 X1 F100\n", 9), ("M429\nG0 A30\nG1 X1 F100\n", 0), ("M428\nG0 A30\nG1 X1 F100\n", 0),
    ("G43.4 H1\nG0 A30\nG1 X1 F100\n", 0), ("G0 A30\nM428\nG1 X1 F100\n", 9), ("G1 X1 F100\n", 0)])
def test_tip_control_that_no_word_states_is_told(body, line):
    """LinuxCNC starts in the first kinematics of its configuration, which may control the tip or not."""
    p = read(body)
    told = [a for a in p.open if str(a.what) != "modes_left"]  # M428 behind the turn stays for the next run
    assert [(str(a.what), f"line {line})" in str(a.value)) for a in told] == [("tip_control", True)] * bool(line)
    assert (told != list(p.open)) is (body == "G0 A30\nM428\nG1 X1 F100\n")


@pytest.mark.parametrize(("limits", "turn"), [
    (None, [-30.0, 0.0]), (((-10.0, 110.0), (-360.0, 360.0)), [30.0, 180.0]),
    (((-10.0, 110.0), (-360.0, 0.0)), [30.0, -180.0]), (((-5.0, 5.0), (-360.0, 360.0)), [-30.0, 0.0])])
def test_a_plane_takes_the_position_of_the_axes_that_is_within_their_range(limits, turn):
    """Fanuc, parameters 19741 to 19744: G53.1 takes the solution within the range; outside of it only where none is."""
    machine = Kinematics("table-table-AC", ((0.0, 0.0, -20.0), (0.0, 0.0, 0.0)), limits=limits)
    text = ("%\nO1\nG21 G90 G17 G94 G54\nT1 M6\nS900 M3\nG0 G43 H1 Z90.\nX0. Y0. A0. C0.\n"
            "G68.2 X0. Y0. Z0. I0. J30. K0.\nG53.1\nG0 X1. Y1.\nZ80.\nG69\nM30\n%\n")
    p = read_program(text, dialect="fanuc", kinematics=machine, gauge_length={1: 60.0})
    assert np.degrees(p.poses.end_turn[p.line == 9][-1]) == pytest.approx(turn)


@pytest.mark.parametrize("on", ["G234 H01 X40. Y-8. Z34.", "G43.4 H01 X40. Y-8. Z34."])
def test_g234_of_haas_takes_the_length_that_g28_drops(on):
    """Haas manual: G234 H01 turns tool centre point control on with length offset 1."""
    text = (f"%\nO1\nG21 G17 G90 G94\nG91 G28 Z0.\nG90\nT1 M6\nG54\nS5000 M3\nG0 B45. C0.\n{on}\n"
            "G1 X20. F500.\nG0 Z60.\nG49\nM30\n%\n")
    machine = Kinematics("table-table-BC", ((0.0, 0.0, -50.0), (0.0, 0.0, -50.0)))
    assert read_program(text, dialect="haas", kinematics=machine, gauge_length={1: 100.0}).remarks == ()
