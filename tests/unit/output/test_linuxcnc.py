"""The LinuxCNC writer, read back by a few lines that know nothing of it."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import OutputError
from output.gcode.dialects.linuxcnc import LinuxCnc
from output.gcode.program_writer import path_tolerance
from tests.golden_file import assert_golden
from tests.synthetic_plan import BALL, CLEAR, FLAT, line, long_plan, plan, step, tiny, write_linuxcnc
from tests.time_limits import in_time
from toolpath.workingsteps import Trajectory, TrajectoryKind

WORD = re.compile(r"([A-Z])(-?\d+\.?\d*)")


def moves(text):
    """(motion, feed, point) of every line that moves, modal words carried on."""
    at, motion, feed, out = {"X": None, "Y": None, "Z": None}, None, None, []
    for block in text.splitlines():
        words = WORD.findall(re.sub(r"\(.*?\)", "", block))
        for letter, value in words:
            if letter == "G" and value in ("0", "1"):
                motion = int(value)
            elif letter == "F":
                feed = float(value)
            elif letter in at:
                at[letter] = float(value)
        if any(letter in at for letter, _ in words):
            out.append((motion, feed, tuple(at.values())))
    return out


def code(text):
    return [b for b in text.splitlines() if b and not b.startswith("(")]


def test_golden():
    assert_golden("tiny.linuxcnc.ngc", write_linuxcnc(tiny()))


def test_same_bytes_twice():
    assert write_linuxcnc(plan()) == write_linuxcnc(plan())


def test_every_line_is_short_ascii_without_nested_comments():
    text = write_linuxcnc(plan())
    assert text.isascii()
    lines = text.splitlines()
    assert max(map(len, lines)) <= LinuxCnc.line
    assert lines[0] == lines[-1] == "%"
    for block in lines:
        if "(" in block or ")" in block:
            assert re.fullmatch(r"\([^()]*\)", block)
            assert not re.match(r"\((msg|debug|print|log)", block, re.IGNORECASE)


def test_header_says_what_the_machinist_checks():
    text = write_linuxcnc(plan())
    head = text[: text.index("G21")]
    for words in ("zonemill 0.1.0", "abababababababab", "cdcdcdcdcdcdcdcd", "Mueller's", "[rush]", "Ti-6Al-4V",
                  "Work offset G54", "Program zero", "X 0 to 30, Y 0 to 20, Z 0 to 15", "Clearance plane Z 25",
                  "T1: ball D3, corner R1.5, flute length 9, neck D2.8 to 20, shank D6, stickout 45", "flat D6"):
        assert words in head


def test_header_says_how_deep_the_tip_goes():
    text = write_linuxcnc(plan())
    words = re.sub(r"\(.*\)|G53.*", "", text)
    depths = [float(z) for z in re.findall(r"Z(-?[\d.]+)", words)]
    assert f"(Lowest Z of the tip {min(depths):g})" in text and "nothing may stand there" not in text
    high = replace(plan().stock, lower=np.array([0.0, 0.0, min(depths) + 2.5]))
    assert f"(Lowest Z of the tip {min(depths):g}, 2.5 below the stock box: nothing may stand there)" in \
        write_linuxcnc(plan(stock=high))


def test_long_labels_are_wrapped():
    text = write_linuxcnc(plan(labels={"note": "word " * 100}))
    assert max(map(len, text.splitlines())) <= LinuxCnc.line
    assert text.count("word") == 100


def test_steps_are_named_with_zone_strategy_faces_and_depth():
    text = write_linuxcnc(plan())
    assert "(S03 Z3 finishing waterline T1: F12 F13; Z 10 down to 4)" in text
    assert "(S01 several zones roughing depth_layers T7: no faces" in text


@pytest.mark.parametrize("seed", range(5))
def test_points_read_back_within_half_the_grid(seed):
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(scale=10.0 ** rng.integers(-6, 2, (400, 1)), size=(400, 3)), axis=0) - 5.0
    text = write_linuxcnc(plan(step(1, BALL, "zigzag", trajectories=(Trajectory(TrajectoryKind.CUT, points, 300.0),))))
    read = np.array([p for g, _, p in moves(text) if g == 1])
    wanted = points[0]
    k = 0
    for p in points:  # every planned point is met in order, each within the grid
        if np.abs(p - wanted).max() > 0 and k < len(read) and np.abs(read[k] - p).max() <= 0.5e-4 + 1e-9:
            k += 1
        else:
            here = read[k - 1] if k else points[0]
            assert np.abs(here - p).max() <= 0.5e-4 + 1e-9
        wanted = p
    assert k == len(read)


def test_numbers_are_plain():
    numbers = [n for block in code(write_linuxcnc(plan())) for _, n in re.findall(r"([XYZ])(\S+)", block)]
    assert numbers
    for n in numbers:
        assert re.fullmatch(r"-?\d+\.\d{0,4}", n) and not n.startswith("-0.0000")
        assert n.endswith(".") or not n.endswith("0")


def test_no_minus_zero_and_repeats_dropped():
    body = code(write_linuxcnc(tiny()))
    assert "-0" not in "\n".join(body)
    assert [b for b in body if b.startswith(("X10", "Y2.5"))] == ["X10. F600", "Y2.5"]


def test_only_changing_words_are_written():
    previous = {}
    for block in code(write_linuxcnc(plan())):
        for letter, value in WORD.findall(block):
            if letter in "XYZF":
                assert previous.get(letter) != value
                previous[letter] = value
        if " M6" in block:
            previous.clear()


def test_order_of_words_at_a_tool_change():
    body = code(write_linuxcnc(plan()))
    changes = [i for i, b in enumerate(body) if b.endswith(" M6")]
    assert [body[i] for i in changes] == ["T7 M6", "T2 M6", "T1 M6", "T7 M6"]
    for n, i in enumerate(changes):
        number = body[i][1:].split()[0]
        assert body[i + 1] == f"G43 H{number}"
        assert body[i + 2] == "S12000 M3 M8"
        assert body[i + 3] == "G0 Z25."
        assert re.fullmatch(r"X\S+ Y\S+", body[i + 4])
        if n:
            assert body[i - 3:i] == ["M5", "M9", "G53 G0 Z0."]
    assert body[-4:] == ["M5", "M9", "M30", "%"]


def test_safe_before_every_tool_change_and_at_the_end():
    low = step(1, FLAT, "planar_floor", trajectories=(line(TrajectoryKind.CUT, (0, 0, 1), (5, 0, 1), feed=100),))
    text = write_linuxcnc(plan(low, step(2, BALL, "waterline")))
    assert "M9\nG53 G0 Z0.\n" in text[: text.index("T1 M6")]
    at = moves(text[: text.index("G53")])
    assert at[-1][0] == 0 and at[-1][2][2] == CLEAR
    assert moves(write_linuxcnc(plan(low)))[-1] == (0, 100.0, (5.0, 0.0, CLEAR))


def test_rapids_never_slant_and_steps_that_do_not_join_go_over_the_clearance_plane():
    a = step(1, BALL, "planar_floor", trajectories=(line(TrajectoryKind.CUT, (0, 0, 1), (5, 0, 1), feed=100),))
    b = step(2, BALL, "planar_floor", trajectories=(line(TrajectoryKind.CUT, (9, 3, 2), (5, 0, 2), feed=100),))
    path = moves(write_linuxcnc(plan(a, b)))
    for (_, _, p), (g, _, q) in zip(path, path[1:], strict=False):
        if g == 0 and None not in p:
            assert p[2] == q[2] or p[:2] == q[:2]
            assert p[:2] == q[:2] or p[2] >= CLEAR
    assert [q for g, _, q in path if g == 0][-4:] == [(5, 0, CLEAR), (9, 3, CLEAR), (9, 3, 2), (5, 0, CLEAR)]


def test_path_mode_is_never_looser_than_half_the_chord():
    fine = step(1, BALL, "waterline")
    object.__setattr__(fine, "chordal_tolerance", 0.0008)
    assert path_tolerance(plan()) == 0.001
    assert path_tolerance(plan(fine)) == pytest.approx(0.0004)
    assert "G64 P0.0004" in write_linuxcnc(plan(fine))


def reject(code_wanted, *steps, **changes):
    with pytest.raises(OutputError) as e:
        write_linuxcnc(plan(*steps, **changes))
    assert e.value.code == code_wanted
    return e.value


def moving(*trajectories):
    return step(1, BALL, "waterline", trajectories=trajectories)


def test_rejects():
    cut = line(TrajectoryKind.CUT, (0, 0, 0), (1, 0, 0), feed=100)
    slanted = reject("slanted_rapid", moving(cut, line(TrajectoryKind.RAPID, (1, 0, 0), (1, 2, 3))))
    assert "(1.0000, 2.0000, 3.0000)" in slanted.subjects and "S01" in slanted.subjects
    gap = reject("gap_in_path", moving(cut, line(TrajectoryKind.LIFT, (1, 0, 0.01), (1, 0, 5), feed=100)))
    assert gap.measured == pytest.approx(0.01)
    reject("bad_feed", moving(line(TrajectoryKind.CUT, (0, 0, 0), (1, 0, 0), feed=0)))
    reject("bad_feed", moving(line(TrajectoryKind.CUT, (0, 0, 0), (1, 0, 0), feed=float("nan"))))
    reject("bad_coordinate", moving(line(TrajectoryKind.CUT, (0, 0, 0), (float("nan"), 0, 0), feed=100)))
    reject("bad_trajectory", moving(Trajectory(TrajectoryKind.CUT, np.zeros((1, 3)), 100.0)))
    reject("empty_step", step(1, BALL, "waterline", trajectories=()))
    reject("id_twice", step(1, BALL, "waterline"), step(1, BALL, "planar_floor"))
    reject("bad_work_offset", work_offset="G60")
    with pytest.raises(OutputError):
        write_linuxcnc(plan(steps=()))


def test_half_a_million_points_in_seconds():
    big = long_plan(500_000)
    start = time.perf_counter()
    text = write_linuxcnc(big)
    assert in_time(time.perf_counter() - start, 20.0)  # 1.6 s when alone on one core
    assert text.count("\n") > 490_000
