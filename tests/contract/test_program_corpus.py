"""A corpus of programs as shops write them against its judges: every move of every program."""

import pytest

from tests.drawn_paths import departure, feed, rapid
from tests.program_corpus import corpus, judged, not_followed, read_of
from tests.rs274 import ABSENT, RS274, difference, judge
from verify.gcode.reader import read_program

PROGRAMS = corpus(samples=False)
DRAWN = [p for p in PROGRAMS if p.drawn is not None]
REFUSED = [p for p in PROGRAMS if p.refused]
TWINS = [p for p in PROGRAMS if p.twin]


def wrong(programs, folder):
    """Names and reasons of programs that are not as their judge has them."""
    found = []
    for n, program in enumerate(programs):
        (folder / str(n)).mkdir()
        row = judged(program, folder / str(n))
        if row.outcome != ("refused" if program.refused else "equal"):
            found.append(f"{program.name}: {row.outcome}: {row.why}")
    return "\n".join(found)


@pytest.mark.skipif(RS274 is None, reason=ABSENT)
@pytest.mark.parametrize("share", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 8))])
def test_programs_make_the_moves_of_linuxcncs_interpreter(share, tmp_path):
    """Programs of LinuxCNC, and twins of the others in plain words."""
    assert not wrong(TWINS[share::8], tmp_path)


def test_programs_make_the_moves_that_are_drawn_by_hand(tmp_path):
    assert not wrong(DRAWN, tmp_path)


def test_what_is_refused_is_named_and_on_the_list(tmp_path):
    assert not wrong(REFUSED, tmp_path)
    assert {p.refused for p in REFUSED} <= not_followed()


def test_the_corpus_is_large():
    assert len(PROGRAMS) >= 240 and len(REFUSED) <= 0.1 * len(PROGRAMS)
    assert {p.dialect for p in PROGRAMS} == {"linuxcnc", "fanuc", "haas", "siemens", "heidenhain"}


def test_the_judges_are_awake(tmp_path):
    program = next(p for p in DRAWN if p.name == "places by AC and IC")
    with pytest.raises(ValueError, match="off piece"):
        departure(read_of(program), [program.drawn.path[0], feed(10, 5.002, 0), *program.drawn.path[2:]])
    with pytest.raises(ValueError, match="kind"):
        departure(read_of(program), [rapid(0, 0, 0), rapid(10, 5, 0), *program.drawn.path[2:]])
    if RS274 is not None:
        by = judge("G21 G90 G0 X0 Y0 Z0\nG1 X5.002 F100\nM2\n", tmp_path)
        assert difference(read_program("G21 G90 G0 X0 Y0 Z0\nG1 X5 F100\nM2\n"), by)
