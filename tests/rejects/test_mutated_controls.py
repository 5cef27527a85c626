"""Mutated programs of Siemens and Heidenhain controls raise only errors of the project, and cost bounded time."""

import time

import pytest

from geometry.errors import CamError, InternalError
from tests import heidenhain_pairs, siemens_pairs
from tests.golden_file import FOLDER
from tests.mutated_programs import mutated
from tests.program_pairs import HEIDENHAIN, NAMES, RADII, SIEMENS, kinematics
from verify.gcode.dialects.heidenhain import heidenhain_flow
from verify.gcode.dialects.siemens import siemens_flow
from verify.gcode.reader import read_program

SPACE = {
    "siemens": ['TRAORI\nG54\nORIWKS\nG0 X0 Y0 Z9\nG1 X20 A3=0.1 B3=0.2 C3=1\nTRAFOOF\nG54\nG0 Z50',
                'CYCLE800(1,"TC1",200000,57,5,6,7,20,30,0,0,0,0,-1,0,1)\nG0 X10 Y20\nZ30\nG41 G1 X20\nY30\nG40 '
                'X40\nCYCLE800()'],
    "heidenhain": ["M128\nL A+10 C+20 F100\nLN X+1 Y+1 Z+1 TX+0.1 TY+0 TZ+1\nM129",
                   "PLANE SPATIAL SPA+20 SPB+30 SPC+40 TURN MB MAX FMAX\nL X+1 Y+1 FMAX\nL Z+5 FMAX\nL X+9 RL F9\nRND "
                   "R2\nL Y+20\n"
                   "DEP LT LEN5\nPLANE RESET TURN FMAX"],
}
HEADS = {"siemens": (SIEMENS, "M30"), "heidenhain": (HEIDENHAIN, "END PGM A MM")}


def corpus(dialect):
    """Whole programs with every word that is followed."""
    pairs = {"siemens": siemens_pairs.PAIRS, "heidenhain": heidenhain_pairs.PAIRS}[dialect]
    bodies = [given for given, _ in pairs.values()] + SPACE[dialect]
    head, end = HEADS[dialect]
    ending = {"siemens": "mpf", "heidenhain": "h"}[dialect]
    golden = [(FOLDER / f"{name}.{dialect}.{ending}").read_text() for name in ("tiny", "arcs")]
    return ["\n".join([*head, body, end, ""]) for body in bodies] + golden


def check(dialect, seeds, monkeypatch):
    """Read mutated programs; returns how many are read and how many refused."""
    monkeypatch.setattr(siemens_flow, "MAX_JUMPS", 2000)
    monkeypatch.setattr(heidenhain_flow, "MAX_JUMPS", 2000)
    texts, read, refused = corpus(dialect), 0, 0
    for seed in seeds:
        text = mutated(seed, texts)
        kind = (None, "table-table-AC", "head-head-BC", "table-table-BC")[seed % 4]
        begun = time.perf_counter()
        try:
            read_program(text, dialect=dialect, kinematics=kinematics(kind), names=NAMES, radii=RADII, tools={1, 2, 3},
                         gauge_length={1: 60.0, 2: 60.0, 3: 60.0})
            read += 1
        except InternalError:
            raise
        except CamError as error:
            assert error.message and str(error), seed
            refused += 1
        except Exception as error:
            raise AssertionError(f"seed {seed}: {type(error).__name__}: {error}\n{text}") from error
        assert time.perf_counter() - begun < 60, seed
    return read, refused


@pytest.mark.parametrize("dialect", ["siemens", "heidenhain"])
def test_a_few(dialect, monkeypatch):
    read, refused = check(dialect, range(60), monkeypatch)
    assert read > 5 and refused > 5


@pytest.mark.slow
@pytest.mark.parametrize("dialect", ["siemens", "heidenhain"])
def test_two_thousand(dialect, monkeypatch):
    read, refused = check(dialect, range(1000, 3000), monkeypatch)
    assert read > 200 and refused > 200
