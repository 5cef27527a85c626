"""Work left undone is ``clean``, not ``proved``: the pocket plate cut rightly and 1 mm too high, and its siblings."""

import json
import re
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import pytest
from typer.testing import CliRunner

from schemas.report import Verification
from service.cli import app
from service.from_wire import parse_setup
from service.stages.job_inputs import JobInputs
from service.stages.job_part import read_job_part
from service.verification.program_first import read_first
from service.verification.program_proof import proved_program

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases"
PLATE, NC = CASES / "parts" / "pocket_plate.step", CASES / "nc"
pytestmark = pytest.mark.skipif(not PLATE.is_file(), reason="the collection of cases (../shared/cases) is not here")


def quiet(_stage, _share):
    """No progress."""


@pytest.fixture(scope="module")
def verify():
    """Verify a text against the plate: (text, changes of the setup) -> the report. The plate is read once."""
    raw = json.loads((NC / "pocket_setup.json").read_text())
    job = read_job_part(PLATE, parse_setup(json.dumps(raw)), quiet)

    @lru_cache
    def report(text, changes):
        setup = parse_setup(json.dumps({**raw, **json.loads(changes)}))
        mine = replace(job, inputs=JobInputs.of(setup))
        return proved_program(mine, read_first(setup, text, ending=".ngc"), lambda _share: None).report

    return lambda text, **changes: report(text, json.dumps(changes, sort_keys=True))


def right():
    return (NC / "pocket_ok.ngc").read_text()


def higher(text, by):
    """The text with every Z word raised."""
    return "\n".join(line if "G53" in line else re.sub(r"Z(-?[\d.]+)", lambda m: f"Z{float(m[1]) + by:.4f}", line)
                     for line in text.split("\n"))


def left(report):
    """Height, area and lines of the stock that was left, by face; the highest of each."""
    out = {}
    for f in report["findings"]:
        if f["kind"] == "stock_left":
            out.setdefault(f["face"], (f["depth"], f["area"], f["lines"]))
    return out


def test_a_right_program_of_some_faces_is_proved_and_the_other_faces_are_remainder(verify):
    report = verify(right())
    Verification.model_validate(report)
    assert report["state"] == "proved" and report["findings"] == []
    assert report["coverage"] == pytest.approx(0.53, abs=0.01)
    rest = {e["reason"]: e for e in report["remainder"]}
    assert set(rest["not_in_program"]["faces"]).isdisjoint(report["asked"]["faces"])
    assert report["asked"]["by"] == "program" and len(rest["not_in_program"]["faces"]) == 8


def test_a_program_1_mm_too_high_is_clean_and_says_where_and_how_much(verify):
    report = verify((NC / "pocket_1mm_high.ngc").read_text())
    Verification.model_validate(report)
    assert report["state"] == "clean" and set(report["finding_counts"]) == {"stock_left"}
    found = left(report)
    for face in (top_of(report), floor_of(report)):
        height, area, lines = found[face]
        assert height == pytest.approx(1.0, abs=0.005) and area > 100 and lines == sorted(lines) and lines
    assert max(height for height, _, _ in found.values()) == pytest.approx(1.0, abs=0.005)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "code", "state"), [("pocket_ok", 0, "proved"), ("pocket_1mm_high", 3, "clean")])
def test_the_command_line_tells_them_apart(name, code, state):
    got = CliRunner().invoke(app, ["verify", str(PLATE), "--setup", str(NC / "pocket_setup.json"), "--program",
                                   str(NC / f"{name}.ngc")])
    assert got.exit_code == code and json.loads(got.stdout)["state"] == state and f"{state}: " in got.stderr


def top_of(report):
    """The face with the largest area is the top."""
    return max(report["deviation"], key=lambda d: d["area_mm2"])["face"]


def floor_of(report):
    """The floor of the pocket is the second largest of the asked faces."""
    asked = [d for d in report["deviation"] if d["face"] in report["asked"]["faces"]]
    return sorted(asked, key=lambda d: -d["area_mm2"])[1]["face"]


@pytest.mark.slow
@pytest.mark.parametrize("by", [0.04, 0.3, 2.0, 3.9, 5.0])
def test_every_height_is_found(verify, by):
    report = verify(higher(right(), by))
    assert report["state"] == "clean"
    assert any(abs(h - by) <= max(0.1 * by, 0.005) for h, _, _ in left(report).values())


@pytest.mark.slow
@pytest.mark.parametrize("by", [0.04, 0.3, 2.0, 5.0])
def test_every_depth_is_found(verify, by):
    report = verify(higher(right(), -by))
    assert report["state"] == "unproved"
    assert any(f["kind"] == "gouge" and abs(f["depth"] - by) <= max(0.1 * by, 0.005) for f in report["findings"])


@pytest.mark.slow
def test_faces_of_the_setup_are_asked_whether_the_program_works_on_them_or_not(verify):
    whole = verify(right())
    side = max(whole["remainder"][0]["patches"], key=lambda p: p["area_mm2"])["face"]
    top = top_of(whole)
    wanted = sorted({*whole["asked"]["faces"], top, side}, key=lambda f: int(f[1:]))
    report = verify(right(), operations={"faces": wanted})
    assert report["state"] == "clean" and report["asked"] == {"by": "setup", "faces": wanted}
    assert set(left(report)) == {side} and left(report)[side][0] == pytest.approx(1.0, abs=0.005)


@pytest.mark.slow
def test_a_face_that_the_setup_excludes_is_not_asked_and_not_to_be_cut(verify):
    top, height = top_of(verify(right())), 2.0
    cut = verify(right(), operations={"exclude_faces": [top]})
    assert top not in cut["asked"]["faces"] and cut["finding_counts"] == {"excluded_face": 1}
    (found,) = cut["findings"]
    assert found["face"] == top and found["depth"] == pytest.approx(height, abs=0.005) and found["line"] > 0
    unasked = verify(right(), operations={"faces": [top]})
    assert unasked["state"] == "unproved" and {f["kind"] for f in unasked["findings"]} == {"excluded_face"}
    assert "operations.faces does not name it" in unasked["findings"][0]["message"]
    kept = verify(higher(right(), 0.2), operations={"exclude_faces": [top]})
    assert "excluded_face" not in kept["finding_counts"]


@pytest.mark.slow
def test_without_finishing_no_face_is_asked(verify):
    report = verify(higher(right(), 1.0), operations={"finishing": False})
    assert report["state"] == "proved" and report["asked"] == {"by": "nothing", "faces": []}


def test_a_program_that_takes_nothing_off_is_clean(verify):
    report = verify(higher(right(), 30.0))
    assert report["state"] == "clean" and report["finding_counts"] == {"nothing_cut": 1}
    assert report["findings"][0]["line"] > 1


@pytest.mark.slow
def test_harm_beside_work_undone_is_unproved(verify):
    raised = higher(right(), 1.0)
    text = raised.replace("X4 Z7.0000\n", "X4 Z7.0000\nX0 Z5.0000\nX4 Z7.0000\n", 1)  # the floor lies at 6
    assert text != raised
    report = verify(text)
    assert report["state"] == "unproved" and {"stock_left"} < set(report["finding_counts"])
