"""The reader against LinuxCNC's own interpreter: foreign samples that lie beside it, and random programs."""

import os
import random
import re
from pathlib import Path

import pytest

from geometry.errors import ProgramError
from tests.random_programs import RandomContour, RandomProgram, expression
from tests.rs274 import ABSENT, DIAMETER, RS274, difference, judge
from verify.gcode.reader import read_program

pytestmark = pytest.mark.skipif(RS274 is None, reason=ABSENT)
PREFIX = Path(RS274).resolve().parents[1] if RS274 else Path()
FOLDERS = [PREFIX / "share" / "doc" / "linuxcnc" / "examples" / "nc_files", PREFIX / "share" / "linuxcnc" / "ncfiles",
           PREFIX / "share" / "doc" / "linuxcnc" / "examples" / "sample-configs"]
RADII = dict.fromkeys(range(1, 100), DIAMETER / 2)
_CALLED = re.compile(r"^\s*o<([\w-]+)>\s*call\b", re.IGNORECASE | re.MULTILINE)
_DEFAULT = re.compile(r"=\s*#([0-9]+)\s*\(=\s*([-+.0-9]+)")
_SUB = re.compile(r"^\s*o<([\w-]+)>\s*sub\b(.*?)^\s*o<\1>\s*endsub[^\n]*", re.IGNORECASE | re.MULTILINE | re.DOTALL)


def sample_files():
    """Every sample once, by name; the folders are links to one another in part."""
    found = {}
    for folder in FOLDERS:
        for root, _, names in os.walk(folder, followlinks=True):
            for name in sorted(names):
                if name.endswith((".ngc", ".nc", ".tap")):
                    text = (Path(root) / name).read_text(errors="replace")
                    found.setdefault(text, f"{Path(root).name}/{name}")
    return sorted(((name, text) for text, name in found.items()), key=lambda pair: pair[0])


def complete(name, text, subs):
    """A program of a sample: the subroutines it calls are put in front, and one that is a subroutine is called with the
    values its comments propose. It starts at the zero where the interpreter does."""
    stem = Path(name).stem.lower()
    own = _SUB.search(text)
    if own and own[1].lower() == stem:
        given = {int(n): value for n, value in _DEFAULT.findall(own[0])}
        values = " ".join(f"[{given.get(n, '1')}]" for n in range(1, max(given, default=0) + 1))
        text = f"G21 F100 S100 M3\no<{own[1]}> call {values}\nM2\n"
        needed = [stem]
    else:
        needed = []
    needed += [called.lower() for called in _CALLED.findall(text)]
    have = {found[1].lower() for found in _SUB.finditer(text)}
    front = []
    while needed:
        called = needed.pop()
        if called in have or called not in subs:
            continue
        have.add(called)
        front.append(subs[called] + "\n")
        needed += [more.lower() for more in _CALLED.findall(subs[called])]
    lines = text.split("\n")
    at = 1 if lines[0].strip() == "%" else 0
    return "\n".join([*lines[:at], *front, "G0 X0 Y0 Z0", *lines[at:]])


def programs():
    files = sample_files()
    subs = {found[1].lower(): found[0] for name, text in files for found in _SUB.finditer(text)
            if found[1].lower() == Path(name).stem.lower()}
    return [(name, complete(name, text, subs)) for name, text in files]


def has_gaps(text):
    """Whether a program goes to the machine's own places or changes a tool, after which the reader waits for axes."""
    return re.search(r"(?i)G\s*0*(28|30|53)(?![0-9])|M\s*0*6(?![0-9])", text) is not None


def judged_by(text, folder):
    folder.mkdir()
    return judge(text, folder)


PROGRAMS = programs() if RS274 else []


@pytest.mark.skipif(not PROGRAMS, reason="LinuxCNC's samples are not installed beside it")
def test_samples_are_read_as_linuxcnc_reads_them(tmp_path):
    """Whatever the reader takes must run as the interpreter runs it, move by move; the rest it must refuse by line."""
    moving, wrong = [], []
    for n, (name, text) in enumerate(PROGRAMS):
        try:
            program = read_program(text, name=name, radii=RADII)
        except ProgramError as refused:
            assert refused.subjects, name
            continue
        judged = judged_by(text, tmp_path / str(n))
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
