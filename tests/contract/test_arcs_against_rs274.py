"""LinuxCNC's own interpreter on programs with arcs and helices: it takes them, and goes where the reader goes."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from output.arc_fitting import fitted
from tests import rs274
from tests.arc_plans import HALF, round_clamped, round_plan
from tests.synthetic_plan import write_linuxcnc
from verify.gcode.reader import read_program

CHECK = Path(__file__).resolve().parents[3] / "shared" / "tools" / "gcode_check.sh"
JOBS = {"three axes": round_plan, "restart points": lambda: replace(round_plan(), restart=True)}

pytestmark = pytest.mark.skipif(rs274.RS274 is None, reason=rs274.ABSENT)


@pytest.mark.parametrize("job", JOBS.values(), ids=JOBS)
def test_the_interpreter_goes_where_the_reader_goes(job, tmp_path):
    text = write_linuxcnc(job())
    judged = rs274.judge(text, tmp_path)
    assert not judged.refused and sum(len(m.points) > 1 for m in judged.moves) >= 25
    assert rs274.difference(read_program(text), judged, gaps=True) == ""


def test_points_are_left_out_by_p_unless_q_is_0(tmp_path):
    """What the reader takes for granted of G64 P, and why programs say Q0."""
    text = write_linuxcnc(round_plan())
    for words, said in (("P0.001 Q0", "0.0000"), ("P0.001", "0.0010")):
        assert not rs274.judge(text.replace("P0.001 Q0\n", f"{words}\n"), tmp_path).refused
        assert f"SET_NAIVECAM_TOLERANCE({said})" in (tmp_path / "out.txt").read_text()


def test_an_arc_that_is_none_is_refused(tmp_path):
    """Or the test above shows nothing: ends on two circles."""
    text = write_linuxcnc(round_plan())
    begin, _, rest = text.partition("\nG3 ")
    words, _, more = rest.partition("\n")
    wrong = " ".join(w if w[0] != "I" else f"I{float(w[1:]) + 0.05}" for w in words.split())
    assert rs274.judge(f"{begin}\nG3 {wrong}\n{more}", tmp_path).refused


@pytest.mark.skipif(not CHECK.exists() or not shutil.which("bash"), reason="gcode_check.sh is not there")
@pytest.mark.parametrize("job", [round_plan, lambda: fitted(round_clamped(), HALF)], ids=["three axes", "a clamping"])
def test_the_script_accepts(job, tmp_path):
    file = tmp_path / "program.ngc"
    file.write_text(write_linuxcnc(job()))
    done = subprocess.run(["bash", str(CHECK), "--tcp", str(file)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and "arc 0" not in done.stdout, done.stdout
