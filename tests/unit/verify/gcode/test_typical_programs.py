"""The typical programs of shops that lie beside the project: what is refused, and that the rest is read."""

from pathlib import Path

import pytest

from geometry.errors import ProgramError
from verify.gcode.reader import FEED, read_program

CASES = Path(__file__).resolve().parents[5] / "shared" / "cases" / "nc"
pytestmark = pytest.mark.skipif(not CASES.exists(), reason="the shared cases are not there")
TOOLS, RADII = {3, 10}, {3: 1.5, 10: 5.0}


def read(name, dialect, change=("", "")):
    text = (CASES / name).read_text().replace(*change)
    return read_program(text, name=name, dialect=dialect, tools=TOOLS, radii=RADII)


def test_fanuc_is_refused_for_the_missing_subprogram_alone():
    with pytest.raises(ProgramError) as caught:
        read("fanuc_typical.nc", "fanuc")
    assert "M98 P2000: the program O2000 is not in the file" in caught.value.message
    assert caught.value.subjects == ("line 15",)


def test_fanuc_with_its_subprogram_follows_the_contour():
    p = read("fanuc_typical.nc", "fanuc", ("N17 M30\n", "N17 M30\nO2000\nM99\n"))
    cuts = p.end[p.kind == FEED].tolist()
    assert cuts == [[-30, 0, -2], [-20, 5, -2], [50, 5, -2], [50, 20, -2]] and p.remarks == ()


def test_haas_is_read_with_its_drill():
    p = read("haas_typical.nc", "haas")
    drilled = p.end[(p.kind == FEED) & (p.tool == 3)]
    assert p.remarks == () and p.changes == 1
    assert drilled[:, 2].min() == -9 and set(drilled[:, 0]) == {10, 20} and len(drilled) == 28
