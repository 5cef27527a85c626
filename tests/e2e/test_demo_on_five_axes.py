"""The demo part on a machine whose axis moves: proved, its walls by the flanks of tools that have no corner."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from examples.demo import demo_setup
from examples.family.recipes import make_part
from service import pipeline
from service.from_wire import parse_setup

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

MACHINE = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-30, 110], [-360, 360]]}


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder: Path = tmp_path_factory.mktemp("five")
    step, _, _ = make_part(0, "demo").write(folder)
    setup = parse_setup(json.dumps({**demo_setup(), "machine": MACHINE}))
    return pipeline.plan(step, setup, folder / "out", lambda _stage, _share: None)


def test_it_is_proved_with_all_that_can_be_reached(report: dict[str, Any]) -> None:
    assert report["state"] == "proved", report["findings"][:3]
    assert report["findings"] == [] and report["reach_coverage"] > 0.99


def test_flats_finish_walls_by_their_flank(report: dict[str, Any]) -> None:
    flats = {t["id"] for t in demo_setup()["tools"] if t["kind"] == "flat"}
    walls = [z for z in report["zones"] if z["form"] == "steep"]
    flanked = [z for z in walls if z["strategy"] == "flank" and z["tool"] in flats]
    area = sum(z["proved_area_mm2"] for z in flanked)
    assert area > 0.25 * sum(z["area_mm2"] for z in walls)
    assert all(z["coverage"] > 0.98 for z in flanked)
