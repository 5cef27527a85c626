"""Mutated programs: a reading ends in finite moves or in an error with a line, and no word is skipped in silence."""

import random
import time

import numpy as np
import pytest

from geometry.errors import CamError
from tests.shop_programs import LINUXCNC, PAIRS, linuxcnc, pair
from verify.gcode.reader import read_program

RADII = dict.fromkeys(range(1, 100), 3.0)
SIEMENS = ("G90 G71 G17\nT1 M6\nD1\nS1000 M3\nG54\nG0 X0 Y0 Z5\nG1 Z-1 F300\nG1 X10\nG2 X20 Y0 I5 J0\nG641 ADIS=0.01\n"
           "X30 Y5\nG91 X1\nG90\nM30\n")
HEIDENHAIN = ("0 BEGIN PGM P MM\n1 TOOL CALL 1 Z S1000\n2 L X+0 Y+0 R0 FMAX M3\n3 L Z+5 R0 FMAX\n4 L Z-1 R0 F300\n"
              "5 L X+10 R0\n6 CC X+15 Y+0\n7 C X+20 Y+0 DR-\n8 L Z+50 R0 FMAX M30\n9 END PGM P MM\n")
CORPUS = [("linuxcnc", linuxcnc(name)) for name in LINUXCNC] + [pair(name)[:2] for name in PAIRS] + [
    ("siemens", SIEMENS), ("heidenhain", HEIDENHAIN)]
SCRAPS = ["#", "[", "]", "(", ")", ";", "/", "%", "G", "X", "-", ".", "1e9", "99999999999", "M98 P1", "M99", "GOTO 1",
          "G91", "G41", "G40", "G68 R7.", "O5", "N1", "\u00e4", "\x00", " ", "WHILE[1]DO1", "END1", "G81 R1. Z-1.", "=",
          "*", "nan", "G20", "G18", "G2", "M6", "#1=#1+1", "G10 L2 P1 X1.", "LBL 1", "CALL LBL 1", "R1=R1+1", "REPEAT"]


def mutated(text, r):
    """The text with one to four small changes."""
    for _ in range(r.randint(1, 4)):
        lines = text.split("\n")
        at, kind = r.randrange(len(lines)), r.randrange(7)
        if kind == 0:
            del lines[at]
        elif kind == 1:
            lines.insert(r.randrange(len(lines) + 1), lines[at])
        elif kind == 2:
            lines[at] = lines[at] + r.choice(SCRAPS)
        elif kind == 3:
            lines.insert(at, r.choice(SCRAPS))
        elif lines[at]:
            k = r.randrange(len(lines[at]))
            middle = {4: "", 5: r.choice(SCRAPS), 6: lines[at][k] + r.choice("0123456789.-XYZGM#")}[kind]
            lines[at] = lines[at][:k] + middle + lines[at][k + 1:]
        text = "\n".join(lines)
    return text


def check(seed):
    """Read one mutated program; whether it could be read."""
    r = random.Random(seed)
    dialect, text = r.choice(CORPUS)
    text = mutated(text, r)
    try:
        p = read_program(text, dialect=dialect, radii=RADII)
    except CamError as error:
        assert error.code in ("bad_program", "program_too_long"), (seed, text)
        assert "not a text file" in error.message or error.subjects[0].startswith("line "), (seed, text)
        return False
    assert np.isfinite(p.start).all() and np.isfinite(p.end).all(), (seed, text)
    assert p.lines >= p.line.max(initial=0), (seed, text)
    return True


def test_mutated_programs_are_read_or_refused_with_a_line():
    assert 30 < sum(check(seed) for seed in range(150)) < 140


@pytest.mark.slow
def test_two_thousand_mutated_programs_are_read_or_refused_with_a_line():
    begin, took = time.perf_counter(), []
    for seed in range(1000, 3000):
        check(seed)
        took.append(time.perf_counter() - begin)
        begin = time.perf_counter()
    assert sorted(took)[-20] < 2.0


@pytest.mark.parametrize("word", ["G199", "G12.7", "U1.5", "W2.", "V0.5", "G68.3 I5.", "G7.1 C1.", "G31", "X1.X2.",
                                  "G38.2", "Q$"])
def test_no_word_is_skipped_in_silence(word):
    """A word that no reader knows, put into any move of a program that is read, is refused or named."""
    for dialect, text in CORPUS:
        lines = text.split("\n")
        moves = [k for k, line in enumerate(lines) if line.startswith(("X", "G1 X", "L X", "5 L"))
                 and not any(c in line for c in "#[(;")]
        if not moves or "GOTO" in text:  # which may jump over it
            continue
        lines[moves[0]] += " " + word
        try:
            p = read_program("\n".join(lines), dialect=dialect, radii=RADII)
        except CamError as error:
            assert any(s == f"line {moves[0] + 1}" for s in error.subjects), (text, error.message)
        else:
            assert any(r.line == moves[0] + 1 for r in p.remarks), (word, "\n".join(lines))
