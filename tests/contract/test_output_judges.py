"""What the writers make, judged by programs of others: the EXPRESS schemas and LinuxCNC's interpreter."""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from output.stepnc.ap238 import write_stepnc_aim
from output.stepnc.iso14649 import write_stepnc_arm
from output.workplan import Ap238
from tests import rs274
from tests.synthetic_plan import (
    BALL,
    SEGMENTS,
    TAPERED,
    block_mesh,
    clamped,
    full,
    long_plan,
    plan,
    segment,
    shaped,
    step,
    tapered,
    tiny,
    write_linuxcnc,
)
from toolpath.workingsteps import TrajectoryKind
from verify.gcode.reader import read_program

SHARED = Path(__file__).parents[2].parent / "shared"
CHECK = SHARED / "stepnc" / "p21check.py"
GCODE = SHARED / "tools" / "gcode_check.sh"
JOBS = {"five steps": plan, "tiny": tiny, "flat": lambda: plan(flat_step()), "long": lambda: long_plan(20_000, 40),
        "along borders": lambda: plan(step(1, BALL, "isoparametric"))}
TAPERS = {kind: partial(tapered, kind) for kind in TAPERED} | {kind: partial(segment, kind) for kind in SEGMENTS}
MORE = TAPERS | {"all there is": full, "with shapes": shaped, "a mesh as blank": lambda: shaped(
    cylinder=None, stock_mesh=block_mesh(), stock_words="solid of a STEP file"), "a block": lambda: shaped(
    cylinder=None, stock_words=""), "turning, all": lambda: shaped(job=clamped())}
TURNING = {"one clamping": clamped, "a head": lambda: clamped("head-head-AC", tcp=False)}

RESTART = {"restart points": lambda: replace(plan(), restart=True),
           "restart points on five axes": lambda: replace(clamped(), restart=True)}


def flat_step():
    """A floor: no height between top and bottom, no chordal tolerance, no side step."""
    floor = step(1, BALL, "planar_floor")
    for name, value in (("top", floor.bottom), ("chordal_tolerance", 0.0), ("side_step", 0.0)):
        object.__setattr__(floor, name, value)
    return floor


@pytest.mark.skipif(not CHECK.exists(), reason="the schema checker ../shared/stepnc/p21check.py is not there")
@pytest.mark.parametrize("job", (JOBS | MORE | TURNING).values(), ids=JOBS | MORE | TURNING)
@pytest.mark.parametrize(("write", "schema"), [(write_stepnc_arm, "iso14649_milling.exp"),
                                               (write_stepnc_aim, "ap238e3_aim_lf.exp")], ids=["arm", "aim"])
def test_schema_accepts(write, schema, job, tmp_path):
    said = checked(write(job()), schema, tmp_path)
    if write is write_stepnc_arm:
        assert "unreferenced: PROJECT x1 (e.g. #1)\n" in said


@pytest.mark.skipif(not CHECK.exists(), reason="the schema checker ../shared/stepnc/p21check.py is not there")
@pytest.mark.parametrize(("job", "kind"), [(full, "ball"), (clamped, "ball"), (tapered, "tapered")])
def test_the_schema_of_the_first_edition_accepts(job, kind, tmp_path):
    text = write_stepnc_aim(replace(job(), ap238=Ap238.INTEGRATED_CNC))
    assert "FILE_SCHEMA(('INTEGRATED_CNC_SCHEMA'))" in text and f"'{kind} endmill'" in text
    checked(text, "ap238e1_aim_lf.exp", tmp_path)


def checked(text, schema, folder):
    """What the checker says of a file that it has nothing against."""
    file = folder / "job.stpnc"
    file.write_text(text)
    done = subprocess.run([sys.executable, str(CHECK), "--schema", str(CHECK.parent / "schemas" / schema), "--rules",
                           "--roots", str(file)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout
    assert not [x for x in done.stdout.splitlines() if ": W " in x or ": E " in x], done.stdout
    return done.stdout


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
@pytest.mark.parametrize("job", (JOBS | TURNING | RESTART).values(), ids=JOBS | TURNING | RESTART)
def test_linuxcnc_accepts(job, tmp_path):
    """Slow because the script installs LinuxCNC where it is absent."""
    if not shutil.which("rs274") and os.geteuid() != 0:
        pytest.skip("LinuxCNC's rs274 is not installed and only root can install it")
    file = tmp_path / "program.ngc"
    file.write_text(write_linuxcnc(job()))
    done = subprocess.run(["bash", str(GCODE), "--tcp", str(file)], capture_output=True, text=True, timeout=600)
    if done.returncode == 2:
        pytest.skip("LinuxCNC's interpreter could not be run here: " + done.stderr.strip()[-200:])
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("job", JOBS.values(), ids=JOBS)
def test_the_verifiers_reader_finds_the_planned_path(job):
    """verify imports nothing of output: what it reads must be the plan, point for point, within the grid."""
    wanted = job()
    program = read_program(write_linuxcnc(wanted), tools={t.number for t in wanted.tools})
    assert not program.remarks
    for s in wanted.steps:
        feeds = [t.points for t in s.trajectories if t.motion is not TrajectoryKind.RAPID]
        planned = np.concatenate([np.hstack([p[:-1], p[1:]]) for p in feeds])
        moving = np.abs(planned[:, :3] - planned[:, 3:]).max(axis=1) > 1.5e-4  # longer than the grid: surely written
        mine = (program.tool == s.tool.number) & (program.kind != 0)
        read = np.hstack([program.start[mine], program.end[mine]])
        distance, _ = cKDTree(read).query(planned[moving], p=np.inf)
        assert distance.max() <= 0.5e-4 + 1e-9
    assert np.nanmax(program.feed) == max(t.feed for s in wanted.steps for t in s.trajectories)


@pytest.mark.skipif(rs274.RS274 is None, reason=rs274.ABSENT)
def test_linuxcnc_runs_from_every_label_as_the_reader_does(tmp_path):
    """Whoever starts there has run nothing before: the interpreter gets the text from the label on."""
    lines = write_linuxcnc(RESTART["restart points"]()).splitlines(keepends=True)
    labels = [k for k, line in enumerate(lines) if re.fullmatch(r"N[0-9]+", line.strip())]
    assert len(labels) == 5
    for k in labels:
        text = "%\n" + "".join(lines[k:])
        folder = tmp_path / str(k)
        folder.mkdir()
        judged = rs274.judge(text, folder)
        assert not judged.refused and rs274.difference(read_program(text), judged, gaps=True) == ""
