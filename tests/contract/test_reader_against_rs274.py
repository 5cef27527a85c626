"""The reader against LinuxCNC's own interpreter: foreign samples that lie beside it, and random programs."""

import random

import pytest

from geometry.errors import ProgramError
from tests.linuxcnc_samples import has_gaps, programs, without_own_words
from tests.random_programs import RandomContour, RandomProgram, expression
from tests.rs274 import ABSENT, DIAMETER, RS274, difference, judge
from verify.gcode.reader import read_program

pytestmark = pytest.mark.skipif(RS274 is None, reason=ABSENT)
RADII = dict.fromkeys(range(1, 100), DIAMETER / 2)


def judged_by(text, folder):
    folder.mkdir()
    return judge(text, folder)


PROGRAMS = programs() if RS274 else []


@pytest.mark.skipif(not PROGRAMS, reason="LinuxCNC's samples are not installed beside it")
def test_samples_are_read_as_linuxcnc_reads_them(tmp_path):
    """Whatever the reader takes must run as the interpreter runs it, move by move; the rest it must refuse by line.

    M100 to M199 call programs of the machine. The interpreter alone has none and refuses them, so the judge reads the
    sample without them.
    """
    moving, wrong = [], []
    for n, (name, text) in enumerate(PROGRAMS):
        try:
            program = read_program(text, name=name, radii=RADII)
        except ProgramError as refused:
            assert refused.subjects, name
            continue
        judged = judged_by(without_own_words(text), tmp_path / str(n))
        found = judged.refused or difference(program, judged, has_gaps(text))
        if found:
            wrong.append(f"{name}: {found}")
        elif len(program) > 20:
            moving.append(name)
    assert not wrong, wrong
    assert len(moving) >= 15, moving


@pytest.mark.slow
def test_random_programs_run_as_linuxcnc_runs_them(tmp_path):
    """Arcs in three planes, helices, cycles, polar words, shifts, expressions, flow: every move and feed, in order."""
    same = 0
    for seed in range(60):
        text = RandomProgram(seed).text()
        judged = judged_by(text, tmp_path / str(seed))
        if judged.refused:
            continue
        wrong = difference(read_program(text), judged)
        assert not wrong, f"seed {seed}: {wrong}\n{text}"
        same += 1
    assert same >= 55


def test_random_contours_are_offset_as_linuxcnc_offsets_them(tmp_path):
    """G41 and G42 with lines, arcs, moves along the third axis, sharp and tangent corners, in two planes.

    The reader may refuse a contour that LinuxCNC cuts into with a first or last element that is too short.
    """
    same = refused = 0
    for seed in range(60):
        text = RandomContour(seed).text()
        judged = judged_by(text, tmp_path / str(seed))
        try:
            program = read_program(text, radii=RADII)
        except ProgramError as problem:
            refused += not judged.refused
            assert "radius" in problem.message, text
            continue
        if judged.refused:
            continue
        wrong = difference(program, judged)
        assert not wrong, f"seed {seed}: {wrong}\n{text}"
        same += 1
    assert same >= 40 and refused <= 3


def test_random_expressions_have_linuxcncs_value(tmp_path):
    """What the reader takes LinuxCNC takes, with the same value; it may refuse what has none in mathematics."""
    same = 0
    for seed in range(100):
        text = ("G21 G90 F100\nG0 X0 Y0 Z0\n#1=1.5 #2=1\n#<a>=0.25 #<_b_>=2\n"
                f"#60={expression(random.Random(seed)).replace('#<_b>', '#<_b_>')}\n"
                "G1 X[#60 MOD 100] Y[ABS[#60] LT 1000] Z[#60 LT 0]\nM2\n")
        judged = judged_by(text, tmp_path / str(seed))
        try:
            program = read_program(text)
        except ProgramError as refused:
            assert judged.refused or "value" in refused.message, text
            continue
        wrong = judged.refused or difference(program, judged)
        assert not wrong, f"seed {seed}: {wrong}\n{text}"
        same += 1
    assert same >= 70


def test_the_judge_is_awake(tmp_path):
    """A reading with one end turned wrong must be found, or the tests above show nothing."""
    text = "G21 G90 G0 X0 Y0 Z0\nG1 X5 F100\nG2 X10 I2.5\nM2\n"
    judged = judged_by(text, tmp_path / "right")
    assert difference(read_program(text), judged) == ""
    for wrong in ("X5 F100", "X5.001 F100"), ("F100", "F101"), ("G2 X", "G3 X"), ("G1 X", "G0 X"):
        assert difference(read_program(text.replace(*wrong)), judged), wrong
    assert judged_by("G1 X1\nM2\n", tmp_path / "refused").refused
