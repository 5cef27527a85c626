"""The demo part through the whole chain: proved, complete in its books, accepted by judges of others, repeatable."""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from service.cli import app
from verify.gcode.reader import read_program

SHARED = Path(__file__).parents[2].parent / "shared"
CHECK = SHARED / "stepnc" / "p21check.py"
GCODE = SHARED / "tools" / "gcode_check.sh"
FILES = {"program.linuxcnc.ngc": "program", "job.stpnc": "stepnc", "job.arm.stpnc": "stepnc-arm", "zones.json": "zones",
         "preview.png": "preview", "deviation.png": "deviation", "sheet.html": "sheet", "sheet.pdf": "sheet",
         "view.bin": "view"}
LOWERED = 0.05

# The first test waits for the whole chain, kernels compiled on the way.
pytestmark = pytest.mark.timeout(900)


@pytest.fixture(scope="module")
def report(demo_job):
    return demo_job.report


@pytest.fixture(scope="module")
def program(demo_job):
    return (demo_job.out / "program.linuxcnc.ngc").read_text()


def test_it_is_proved_without_a_finding(report):
    assert report["state"] == "proved"
    assert report["findings"] == [] and report["finding_counts"] == {}


def test_its_walls_and_connections_are_the_generators(report, demo_truth):
    truth = demo_truth
    assert len(report["walls"]) == len(truth["walls"])
    assert len(report["connections"]) == len(truth["connections"])
    wanted = sorted(c["gap_min"] for c in truth["channels"])
    assert sorted(c["gap_min_mm"] for c in report["channels"]) == pytest.approx(wanted, abs=0.02)


def test_the_files_are_there_and_are_those_the_report_names(demo_job, report):
    assert {f.name for f in demo_job.out.iterdir()} == {*FILES, "report.json"}
    assert {f["name"]: f["kind"] for f in report["files"]} == FILES
    for f in report["files"]:
        assert hashlib.sha256((demo_job.out / f["name"]).read_bytes()).hexdigest() == f["sha256"], f["name"]
    assert json.loads((demo_job.out / "report.json").read_text()) == report
    zones = json.loads((demo_job.out / "zones.json").read_text())
    assert {"part", "walls", "connections", "channels", "zones", "remainder", "proposal"} <= set(zones)
    assert zones == {k: report[k] for k in zones}
    with Image.open(demo_job.out / "preview.png") as picture:
        assert min(picture.size) > 600 and len(picture.convert("RGB").getcolors(1 << 24)) > 50


def test_every_zone_keeps_the_budget(report):
    assert report["gouge_max_mm"] <= 0.01
    steps = {s["id"]: s for s in report["steps"]}
    for z in report["zones"]:
        s = z["scallop_mm"]
        assert 0 <= z["gouge_mm"] <= 0.01 and s["p50"] <= s["p99"] <= s["max"] <= s["requested"] == 0.02, z["id"]
        assert z["coverage"] == pytest.approx(1) and (z["passes"] > 0) == (z["strategy"] != "depth_layers")
        assert steps[z["step"]]["tool"] == z["tool"] and set(z["faces"]) <= set(steps[z["step"]]["faces"])
        assert z["depth_mm"][0] >= z["depth_mm"][1]


def test_every_square_millimetre_is_proved_or_in_the_remainder(report):
    """Entries below 0.005 mm² are left out of the remainder; areas are rounded to 0.001."""
    stays = sum(r["area_mm2"] for r in report["remainder"])
    whole = report["machinable_area_mm2"]
    assert report["coverage"] * whole + stays == pytest.approx(whole, abs=0.05)
    assert report["coverage"] > 0.9 and report["reach_coverage"] > 0.999
    assert not report["complete"] and all(r["faces"] and r["reason"] for r in report["remainder"])


def test_the_machinable_area_is_that_of_the_faces(demo_job, report):
    """The seat is left out, and what no upward line of sight exists for; the rest of the surface is all there."""
    from geometry.step_import.reader import read_part

    part = read_part(demo_job.part)
    bottom = part.mesh.areas[part.mesh.normals[:, 2] < -0.999].sum()
    assert report["machinable_area_mm2"] <= part.mesh.areas.sum() - bottom + 1.0
    assert report["machinable_area_mm2"] >= 0.95 * (part.mesh.areas.sum() - bottom)


def test_the_undercuts_are_named_by_their_connection(report):
    behind = {r["reason"].rsplit(" ", 1)[1] for r in report["remainder"] if r["reason"].startswith("undercut behind")}
    assert behind == {c["id"] for c in report["connections"]}


def test_no_rapid_moves_z_and_xy_at_once(report, program):
    path = read_program(program)
    rapid = path.kind == 0
    moved = abs(path.end - path.start)[rapid] > 1e-9
    assert rapid.any() and not (moved[:, 2] & moved[:, :2].any(axis=1)).any()
    assert {s["id"] for s in report["steps"]} == set(re.findall(r"^\((S\d+) ", program, flags=re.MULTILINE))


@pytest.mark.skipif(not CHECK.exists(), reason="the schema checker ../shared/stepnc/p21check.py is not there")
@pytest.mark.parametrize(("name", "schema"), [("job.arm.stpnc", "iso14649_milling.exp"),
                                              ("job.stpnc", "ap238e3_aim_lf.exp")])
def test_schemas_accept_the_step_nc_files(demo_job, report, name, schema):
    done = subprocess.run([sys.executable, str(CHECK), "--schema", str(CHECK.parent / "schemas" / schema), "--rules",
                           str(demo_job.out / name)], capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stdout[-2000:]
    assert not [x for x in done.stdout.splitlines() if ": W " in x or ": E " in x], done.stdout[-2000:]
    text = (demo_job.out / name).read_text()
    assert all(s["name"] in text for s in report["steps"])


@pytest.mark.skipif(not GCODE.exists(), reason="the interpreter script ../shared/tools/gcode_check.sh is not there")
def test_linuxcnc_accepts_the_program(demo_job):
    if not shutil.which("rs274"):
        pytest.skip("LinuxCNC's rs274 is not installed")
    done = subprocess.run(["bash", str(GCODE), str(demo_job.out / "program.linuxcnc.ngc")], capture_output=True,
                          text=True, timeout=120)
    if done.returncode == 2:
        pytest.skip("LinuxCNC's interpreter could not be run here: " + done.stderr.strip()[-200:])
    assert done.returncode == 0, done.stdout


def lowered(program, report):
    """The program with one G1 of a floor pass set lower, and its line number.

    A line of the finishing pass on the base that names X or Y alone stands on the base, or no higher than a touch. Of
    these the one farthest inside the outline counts: at its edge another line may have cut the side below.
    """
    zone = next(z for z in report["zones"] if z["region"] == "floor" and z["strategy"] == "planar_floor")
    height = zone["depth_mm"][1]
    lines = program.split("\n")
    begin = next(k for k, line in enumerate(lines) if line.startswith(f"({zone['step']} "))
    end = next(k for k in range(begin + 2, len(lines)) if lines[k].startswith("(S"))
    z, level, here = None, [], np.full(2, np.nan)
    outline = np.array(report["part"]["bbox_mm"])[:, :2]
    for k in range(begin + 1, end):
        word = re.search(r"Z(-?[\d.]+)", lines[k])
        z = float(word[1]) if word else z
        for axis, value in re.findall(r"([XY])(-?[\d.]+)", lines[k]):
            here["XY".index(axis)] = float(value)
        plain = re.fullmatch(r"(X-?[\d.]+)?\s*(Y-?[\d.]+)?", lines[k]) and lines[k]
        if plain and not word and z is not None and abs(z - height) < 0.005 and not re.search(r"[ZFG(]", lines[k + 1]):
            level.append((float(min(*(here - outline[0]), *(outline[1] - here))), k))
    at = max(level)[1]
    lines[at] += f" Z{height - LOWERED:g}"
    lines[at + 1] += f" Z{height + 0.005:g}"
    return "\n".join(lines), at + 1


@pytest.mark.slow
def test_one_lowered_move_is_found_on_its_line(demo_job, report, program, tmp_path):
    text, line = lowered(program, report)
    file = tmp_path / "lowered.ngc"
    file.write_text(text)
    got = CliRunner().invoke(app, ["verify", str(demo_job.part), "--setup", str(demo_job.setup), "--program",
                                   str(file)])
    assert got.exit_code == 3, got.stderr
    answer = json.loads(got.stdout)
    assert answer["state"] == "unproved"
    gouges = [f for f in answer["findings"] if f["kind"] == "gouge"]
    # The place is the end of one move and the start of the next.
    assert gouges and {f["line"] for f in gouges} <= {line, line + 1}
    assert max(f["depth"] for f in gouges) == pytest.approx(LOWERED, abs=0.005)
    assert {f["face"] for f in gouges} <= {f for z in report["zones"] if z["region"] == "floor" for f in z["faces"]}


@pytest.mark.slow
def test_the_same_input_gives_the_same_bytes(demo_job, tmp_path):
    """In a process of its own, on one thread, with another hash seed."""
    run = subprocess.run([sys.executable, "-m", "service.cli", "plan", str(demo_job.part), "--setup",
                          str(demo_job.setup), "--out", str(tmp_path)], capture_output=True, text=True, timeout=280,
                         cwd=Path(__file__).parents[2],
                         env={**os.environ, "NUMBA_NUM_THREADS": "1", "PYTHONHASHSEED": "17"})
    assert run.returncode == 0, run.stderr[-2000:]
    for name in (*FILES, "report.json"):
        assert (tmp_path / name).read_bytes() == (demo_job.out / name).read_bytes(), name
