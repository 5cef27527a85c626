"""Typical programs of shops beside the project, against the plate and its tools: what is read, and what is refused.

Read means exit 0 or 3. Their worth as programs does not matter: they were not written for this plate.
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from geometry.errors import ProgramError
from schemas.report import Verification
from service.cli import app
from service.from_wire import parse_setup
from service.pipeline import verify_program
from service.verification.program_first import read_first
from tests.step_files import write_step
from tests.time_limits import in_time

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases"
NC, PLATE = CASES / "nc", CASES / "parts" / "plain_plate_300.step"
pytestmark = pytest.mark.skipif(not PLATE.is_file(), reason="the collection of cases (../shared/cases) is not here")

FLAT = {"id": "T1", "kind": "flat", "diameter_mm": 8, "flute_length_mm": 24, "stickout_mm": 40}
# program, dialect, kinematics of a machine with rotary axes, T number and moves that must be read
READ = [("siemens_typical.mpf", "siemens", None, 10), ("haas_typical.nc", "haas", None, 3),
        ("s_traori_vec.mpf", "siemens", "table-table-AC", 1), ("h_tcpm.h", "heidenhain", "table-table-BC", 1),
        ("h_m128f.h", "heidenhain", "table-table-AC", 1)]


def setup_text(dialect, kinematics=None):
    """The setup of the cases with its drill; on five axes an 8 mm flat alone."""
    setup = json.loads((NC / "plate_setup.json").read_text())
    setup["machine"] = {"kind": "3-axis", "dialects": [dialect]}
    if kinematics:
        setup |= {"machine": {"kind": "5-axis", "kinematics": kinematics, "dialects": [dialect],
                              "iso_axes": []}, "tools": [FLAT]}
    return json.dumps(setup)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A block of 40 x 30 x 10 mm whose top is at Z0, with a bore, in place of the plate."""
    import cadquery as cq

    block = cq.Workplane("XY").box(40, 30, 10).translate((10, 5, -5)).faces(">Z").workplane().hole(3.0, 9.0)
    return write_step(block, tmp_path_factory.mktemp("typical") / "block.step")


@pytest.mark.parametrize(("name", "dialect", "kinematics", "tool"), READ)
def test_the_program_is_read(name, dialect, kinematics, tool):
    setup = parse_setup(setup_text(dialect, kinematics))
    program = read_first(setup, (NC / name).read_text(), ending=Path(name).suffix).read
    assert tool in program.tool and len(program) > 4


@pytest.mark.slow
@pytest.mark.parametrize(("name", "dialect", "kinematics"), [case[:3] for case in READ])
def test_the_program_is_judged_on_a_small_block(small, name, dialect, kinematics):
    setup = parse_setup(setup_text(dialect, kinematics))
    report = verify_program(small, setup, (NC / name).read_text(), lambda _stage, _share: None,
                            ending=Path(name).suffix)
    Verification.model_validate(report)
    assert report["state"] in ("proved", "clean", "unproved")


def test_fanuc_is_refused_for_what_is_not_in_the_file_alone():
    with pytest.raises(ProgramError) as caught:
        read_first(parse_setup(setup_text("fanuc")), (NC / "fanuc_typical.nc").read_text(), ending=".nc")
    assert caught.value.subjects == ("line 15",) and "M98 P2000" in caught.value.message


@pytest.mark.slow
def test_the_refusal_comes_before_the_plate_is_read(tmp_path):
    (tmp_path / "setup.json").write_text(setup_text("fanuc"))
    began = time.monotonic()
    got = subprocess.run([sys.executable, "-m", "service.cli", "verify", str(PLATE), "--setup",
                          str(tmp_path / "setup.json"), "--program", str(NC / "fanuc_typical.nc")],
                         capture_output=True, text=True, check=False, cwd=Path(__file__).resolve().parents[2])
    assert got.returncode == 2 and "M98 P2000" in got.stderr and "prove" not in got.stderr
    assert in_time(time.monotonic() - began, 2.0)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "dialect"), [("siemens_typical.mpf", "siemens"), ("haas_typical.nc", "haas")])
def test_the_plate_itself_with_its_drill(tmp_path, name, dialect):
    (tmp_path / "setup.json").write_text(setup_text(dialect))
    got = CliRunner().invoke(app, ["verify", str(PLATE), "--setup", str(tmp_path / "setup.json"), "--program",
                                   str(NC / name)])
    assert got.exit_code in (0, 3), got.stderr
