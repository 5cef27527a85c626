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


def test_walls_of_flats_have_flank_passes_or_say_why_not(report: dict[str, Any]) -> None:
    flats = {t["id"] for t in demo_setup()["tools"] if t["kind"] == "flat"}
    walls = [z for z in report["zones"] if z["form"] == "steep" and z["tool"] in flats]
    assert all(z["coverage"] > 0.98 for z in walls)
    told = {z["id"]: [r for r in z["rejected"] if r["strategy"] == "flank"] for z in walls if z["strategy"] != "flank"}
    assert all(told.values()), told
    # the largest wall was cut both ways, and the sooner one was taken
    largest = max(walls, key=lambda z: z["area_mm2"])
    assert {largest["strategy"], *(r["strategy"] for r in largest["rejected"])} >= {"flank", "waterline"}
    assert any("takes longer" in r["reason"] and r["value"] > r["limit"] for r in largest["rejected"])
