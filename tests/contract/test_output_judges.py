"""What the writers make, judged by programs of others: the EXPRESS schemas and LinuxCNC's interpreter."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from output.linuxcnc import write_linuxcnc
from output.stepnc_aim import write_stepnc_aim
from output.stepnc_arm import write_stepnc_arm
from tests.synthetic_plan import BALL, long_plan, plan, step, tiny

SHARED = Path(__file__).parents[2].parent / "shared"
CHECK = SHARED / "stepnc" / "p21check.py"
GCODE = SHARED / "tools" / "gcode_check.sh"
JOBS = {"five steps": plan, "tiny": tiny, "flat": lambda: plan(flat_step()), "long": lambda: long_plan(20_000, 40)}


def flat_step():
    """A floor: no height between top and bottom, no chordal tolerance, no side step."""
    floor = step(1, BALL, "floor")
    for name, value in (("top", floor.bottom), ("chordal_tolerance", 0.0), ("side_step", 0.0)):
        object.__setattr__(floor, name, value)
    return floor


@pytest.mark.skipif(not CHECK.exists(), reason="the schema checker ../shared/stepnc/p21check.py is not there")
@pytest.mark.parametrize("job", JOBS.values(), ids=JOBS)
@pytest.mark.parametrize(("write", "schema"), [(write_stepnc_arm, "iso14649_milling.exp"),
                                               (write_stepnc_aim, "ap238e3_aim_lf.exp")], ids=["arm", "aim"])
def test_schema_accepts(write, schema, job, tmp_path):
    file = tmp_path / "job.stpnc"
    file.write_text(write(job()))
    done = subprocess.run([sys.executable, str(CHECK), "--schema", str(CHECK.parent / "schemas" / schema), "--rules",
                           "--roots", str(file)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout
    assert not [x for x in done.stdout.splitlines() if ": W " in x or ": E " in x], done.stdout
    if write is write_stepnc_arm:
        assert "unreferenced: PROJECT x1 (e.g. #1)\n" in done.stdout


def test_the_judge_is_awake(tmp_path):
    """A file with one reference turned wrong must be refused, or the test above shows nothing."""
    if not CHECK.exists():
        pytest.skip("the schema checker ../shared/stepnc/p21check.py is not there")
    file = tmp_path / "job.stpnc"
    file.write_text(write_stepnc_arm(tiny()).replace("=WORKPLAN('main workplan',(#", "=WORKPLAN('main workplan',(#1,#"))
    done = subprocess.run([sys.executable, str(CHECK), "--schema",
                           str(CHECK.parent / "schemas" / "iso14649_milling.exp"), "--rules", str(file)],
                          capture_output=True, text=True, timeout=120)
    assert done.returncode != 0


@pytest.mark.slow
@pytest.mark.skipif(not GCODE.exists(), reason="the interpreter script ../shared/tools/gcode_check.sh is not there")
@pytest.mark.parametrize("job", JOBS.values(), ids=JOBS)
def test_linuxcnc_accepts(job, tmp_path):
    """Slow because the script installs LinuxCNC where it is absent."""
    if not shutil.which("rs274") and os.geteuid() != 0:
        pytest.skip("LinuxCNC's rs274 is not installed and only root can install it")
    file = tmp_path / "program.ngc"
    file.write_text(write_linuxcnc(job()))
    done = subprocess.run(["bash", str(GCODE), str(file)], capture_output=True, text=True, timeout=600)
    if done.returncode == 2:
        pytest.skip("LinuxCNC's interpreter could not be run here: " + done.stderr.strip()[-200:])
    assert done.returncode == 0, done.stdout
