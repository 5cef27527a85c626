"""A plain plate with coarse samples inside its planes, against the same plate with close samples everywhere."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.jobs.plain_plates import TOOLS, plate
from schemas.setup import Setup
from service.pipeline import plan
from service.stages import sample_spacing
from tests.step_files import write_step

pytest.importorskip("cadquery")


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
