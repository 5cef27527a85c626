"""Work left undone is ``clean``, not ``proved``: the pocket plate cut rightly and 1 mm too high, and its siblings."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from schemas.report import Verification
from service.cli import app

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases"
PLATE, NC = CASES / "parts" / "pocket_plate.step", CASES / "nc"
pytestmark = pytest.mark.skipif(not PLATE.is_file(), reason="the collection of cases (../shared/cases) is not here")


@pytest.fixture(scope="module")
def verify(tmp_path_factory):
    """Verify a text against the plate: (text, changes of the setup) -> exit code, report, stderr."""
    folder, known = tmp_path_factory.mktemp("clean"), {}

    def call(text, **changes):
        key = text, json.dumps(changes, sort_keys=True)
        if key not in known:
            (folder / "p.ngc").write_text(text)
            (folder / "s.json").write_text(json.dumps({**json.loads((NC / "pocket_setup.json").read_text()),
                                                       **changes}))
            got = CliRunner().invoke(app, ["verify", str(PLATE), "--setup", str(folder / "s.json"), "--program",
                                           str(folder / "p.ngc")])
            known[key] = got.exit_code, json.loads(got.stdout), got.stderr
        return known[key]

    return call


def right():
    return (NC / "pocket_ok.ngc").read_text()


def higher(text, by):
    """The text with every Z word raised."""
    return re.sub(r"Z(-?[\d.]+)", lambda m: f"Z{float(m[1]) + by:.4f}", text)


def left(report):
    """Height, area and lines of the stock that was left, by face; the highest of each."""
    out = {}
    for f in report["findings"]:
        if f["kind"] == "stock_left":
            out.setdefault(f["face"], (f["depth"], f["area"], f["lines"]))
    return out


def test_a_right_program_of_some_faces_is_proved_and_the_other_faces_are_remainder(verify):
    code, report, _ = verify(right())
    Verification.model_validate(report)
    assert code == 0 and report["state"] == "proved" and report["findings"] == []
    assert report["coverage"] == pytest.approx(0.53, abs=0.01)
    rest = {e["reason"]: e for e in report["remainder"]}
    assert set(rest["not_in_program"]["faces"]).isdisjoint(report["asked"]["faces"])
    assert report["asked"]["by"] == "program" and len(rest["not_in_program"]["faces"]) == 8


def test_a_program_1_mm_too_high_is_clean_and_says_where_and_how_much(verify):
    code, report, said = verify((NC / "pocket_1mm_high.ngc").read_text())
    Verification.model_validate(report)
    assert code == 3 and report["state"] == "clean" and set(report["finding_counts"]) == {"stock_left"}
    found = left(report)
    for face in (top_of(report), floor_of(report)):
        height, area, lines = found[face]
        assert height == pytest.approx(1.0, abs=0.005) and area > 100 and lines == sorted(lines) and lines
    assert max(height for height, _, _ in found.values()) == pytest.approx(1.0, abs=0.005)
    assert said.splitlines()[-6].startswith("clean:") or "clean: " in said


def top_of(report):
    """The face with the largest area is the top."""
    return max(report["deviation"], key=lambda d: d["area_mm2"])["face"]


def floor_of(report):
    """The floor of the pocket is the second largest of the asked faces."""
    asked = [d for d in report["deviation"] if d["face"] in report["asked"]["faces"]]
    return sorted(asked, key=lambda d: -d["area_mm2"])[1]["face"]


@pytest.mark.slow
@pytest.mark.parametrize("by", [0.04, 0.3, 2.0, 3.9])
def test_every_height_is_found(verify, by):
    code, report, _ = verify(higher(right(), by))
    assert code == 3 and report["state"] == "clean"
    assert any(abs(h - by) <= max(0.1 * by, 0.005) for h, _, _ in left(report).values())


def test_faces_of_the_setup_are_asked_whether_the_program_works_on_them_or_not(verify):
    _, whole, _ = verify(right())
    (side, *_), top = [e["faces"] for e in whole["remainder"] if e["reason"] == "not_in_program"][0], top_of(whole)
    code, report, _ = verify(right(), operations={"faces": [top, side]})
    assert code == 3 and report["state"] == "clean" and report["asked"] == {"by": "setup", "faces": sorted(
        [top, side], key=lambda f: int(f[1:]))}
    assert set(left(report)) == {side} and left(report)[side][0] == pytest.approx(1.0, abs=0.005)
    code, report, _ = verify(right(), operations={"exclude_faces": [top]})
    assert code == 0 and top not in report["asked"]["faces"]


def test_without_finishing_no_face_is_asked(verify):
    code, report, _ = verify(higher(right(), 1.0), operations={"finishing": False})
    assert code == 0 and report["state"] == "proved" and report["asked"] == {"by": "nothing", "faces": []}


def test_a_program_that_takes_nothing_off_is_clean(verify):
    code, report, _ = verify(higher(right(), 30.0))
    assert code == 3 and report["state"] == "clean" and report["finding_counts"] == {"nothing_cut": 1}
    assert report["findings"][0]["line"] > 1


def test_harm_beside_work_undone_is_unproved(verify):
    text = right().replace("G0 Z15\nX-4 Y0\nZ11", "G0 Z15\nX-4 Y0\nZ7", 1)
    code, report, _ = verify(higher(text, 1.0))
    assert code == 3 and report["state"] == "unproved" and {"stock_left"} < set(report["finding_counts"])
