"""A plain plate with coarse samples inside its planes, against the same plate with close samples everywhere."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.jobs.plain_plates import TOOLS, plate
from schemas.setup import Setup
from service.pipeline import plan, verify_program
from service.stages import sample_spacing
from tests.step_files import PARTS, write_step

pytest.importorskip("cadquery")
CASE = PARTS.parent / "cases" / "parts" / "plain_plate_300.step"


@pytest.mark.slow
def test_a_plate_is_proved_with_few_samples_as_with_many(tmp_path, monkeypatch):
    path = write_step(plate(60.0), tmp_path / "plate.step")
    setup = Setup.model_validate({"tools": TOOLS})
    reports = {}
    for name, least in (("few", 300.0), ("many", np.inf)):
        monkeypatch.setattr(sample_spacing, "LEAST_AREA", least)
        reports[name] = plan(path, setup, tmp_path / name, lambda *_: None)
    few, many = reports["few"], reports["many"]
    assert few["state"] == many["state"] == "proved" and not few["findings"]
    assert few["coverage"] == pytest.approx(many["coverage"], abs=2e-3)
    assert few["reach_coverage"] == pytest.approx(many["reach_coverage"], abs=1e-3)
    assert [(z["tool"], z["strategy"]) for z in few["zones"]] == \
        [(z["tool"], z["strategy"]) for z in many["zones"]]


@pytest.mark.slow
@pytest.mark.skipif(not CASE.is_file(), reason="the collection of cases (../shared/cases) is not here")
def test_the_large_plate_of_the_cases_is_proved_with_few_samples(tmp_path):
    """300 x 200 mm; with 100 samples a mm² it took 131 s and more."""
    report = plan(CASE, Setup.model_validate({"tools": TOOLS}), tmp_path, lambda *_: None)
    assert report["state"] == "proved" and not report["findings"] and report["coverage"] > 0.9999
    assert report["proof"]["samples"] < 20.0 * sum(d["area_mm2"] for d in report["deviation"])


FACING = [f"G0 X-20 Y{y:g} Z10\nG1 Z{{z}} F500\nX20\nG0 Z10" for y in (-9, -5, -1, 3, 7, 11)]
PIT = "G0 X3.1 Y-2.3\nG1 Z-0.05 F100\nG0 Z10"


def facing(height: float, *more: str) -> str:
    """Level passes 4 mm apart over a plate of 30 x 20 mm, by a flat end of 6 mm."""
    return "\n".join(["G21 G90 G17 G40 G54 G94 G61", "T1 M6", "G43 H1", "S5000 M3",
                      *(line.replace("{z}", f"{height:g}") for line in FACING), *more, "M5", "M30"]) + "\n"


@pytest.mark.slow
@pytest.mark.parametrize(("text", "kinds"), [(facing(0.0), set()), (facing(0.02), {"stock_left"}),
                                             (facing(0.0, PIT), {"gouge"})])
def test_a_program_is_judged_with_few_samples_as_with_many(tmp_path, monkeypatch, text, kinds):
    import cadquery as cq

    path = write_step(cq.Workplane().box(30.0, 20.0, 5.0, centered=(True, True, False)).translate((0, 0, -5.0)),
                      tmp_path / "plate.step")
    setup = Setup.model_validate({"tools": TOOLS, "stock": {"kind": "box", "margin_mm": 1.0, "uncertainty_mm": 0.0}})
    reports = {}
    for name, least in (("few", 300.0), ("all of them few", 50.0), ("many", np.inf)):
        monkeypatch.setattr(sample_spacing, "LEAST_AREA", least)
        reports[name] = verify_program(path, setup, text, lambda *_: None)
    few, many = reports["few"], reports["many"]
    for report in reports.values():
        assert report["state"] == many["state"] and report["finding_counts"] == many["finding_counts"]
    assert kinds <= {f["kind"] for f in few["findings"]} and (kinds or not few["findings"])
    assert few["coverage"] == pytest.approx(many["coverage"], abs=2e-3) and few["asked"] == many["asked"]
    for one, other in zip(few["findings"], many["findings"], strict=True):
        assert (one["kind"], one["face"]) == (other["kind"], other["face"])
        assert one["line"] in other.get("lines", [other["line"]])
        assert one["depth"] == pytest.approx(other["depth"], abs=0.005)
        assert one["area"] == pytest.approx(other["area"], rel=0.02) or one["kind"] == "gouge"
    assert few["proof"]["samples"] < 0.7 * many["proof"]["samples"]
    assert sum(e["area_mm2"] for e in few["remainder"]) == pytest.approx(
        sum(e["area_mm2"] for e in many["remainder"]), rel=5e-3)
