"""A corpus of programs as shops write them against LinuxCNC's interpreter: every move of every program."""

import pytest

from geometry.errors import ProgramError
from tests.rs274 import ABSENT, DIAMETER, RS274, difference, judge
from tests.shop_programs import LINUXCNC, PAIRS, linuxcnc, pair
from verify.gcode.reader import read_program

pytestmark = pytest.mark.skipif(RS274 is None, reason=ABSENT)
RADII = dict.fromkeys(range(1, 100), DIAMETER / 2)
GAPS = ("two tools", "home and back")


def test_programs_of_linuxcnc_make_the_moves_of_its_interpreter(tmp_path):
    wrong = []
    for n, name in enumerate(LINUXCNC):
        (tmp_path / str(n)).mkdir()
        judged = judge(linuxcnc(name), tmp_path / str(n))
        try:
            found = judged.refused or difference(read_program(linuxcnc(name), radii=RADII), judged, name in GAPS)
        except ProgramError as refused:
            found = refused.message
        if found:
            wrong.append(f"{name}: {found}")
    assert not wrong, "\n".join(wrong)


def test_programs_of_fanuc_and_haas_make_the_moves_of_their_twins(tmp_path):
    """The twin has the same moves in plain words; the interpreter runs it."""
    wrong = []
    for n, name in enumerate(PAIRS):
        dialect, text, twin = pair(name)
        (tmp_path / str(n)).mkdir()
        judged = judge(twin, tmp_path / str(n))
        try:
            found = judged.refused or difference(read_program(text, dialect=dialect, radii=RADII), judged)
        except ProgramError as refused:
            found = refused.message
        if found:
            wrong.append(f"{name}: {found}")
    assert not wrong, "\n".join(wrong)


def test_the_corpus_is_large():
    assert len(LINUXCNC) + len(PAIRS) >= 80
