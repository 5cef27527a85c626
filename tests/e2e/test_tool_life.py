"""A tool whose life ends in the middle of a job: the program stops for a fresh cutter, and is proved as it stands."""

from __future__ import annotations

import json

import pytest

from examples.demo import write_small
from service import pipeline
from service.from_wire import parse_setup

pytestmark = pytest.mark.slow

pytest.importorskip("cadquery")


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("life")
    step, setup = write_small(folder)
    raw = json.loads(setup.read_text())
    for tool in raw["tools"]:
        tool["life_min"] = 2.0
    return pipeline.plan(step, parse_setup(json.dumps(raw)), folder / "out", lambda *_: None), folder / "out"


def test_no_cutter_is_longer_in_cut_than_it_lasts(planned):
    report, _ = planned
    assert report["state"] == "proved" and report["findings"] == []
    worn = [t for t in report["tools"] if t["cutters"] > 1]
    assert worn
    for t in report["tools"]:
        assert t["minutes_in_cut"] <= t["life_min"] * t["cutters"] and t["metres_in_cut"] > 0.0
    told = [w for w in report["warnings"] if w["kind"] == "tool_life" and "fresh cutter" in w["message"]]
    assert [w["subjects"][0] for w in told] == [t["id"] for t in worn]
    for w, t in zip(told, worn, strict=True):  # what the plan counts is never less than what the proof finds in stock
        assert w["measured"] >= t["minutes_in_cut"] and len(w["subjects"]) == t["cutters"]


def test_steps_in_parts_are_in_report_program_and_step_nc(planned):
    report, out = planned
    fresh = [s["id"] for s in report["steps"] if s["fresh_cutter"]]
    assert fresh and len({s["id"] for s in report["steps"]}) == len(report["steps"])
    text = (out / "program.linuxcnc.ngc").read_text()
    assert text.count("T0 M6") == text.count("\nM0\n") == len(fresh)
    for file in ("job.stpnc", "job.arm.stpnc"):
        assert (out / file).read_text().count(" fresh cutter'") >= len(fresh)
    parts = {s["id"]: s["zone"] for s in report["steps"]}
    for zone in report["zones"]:
        assert [i for i, z in parts.items() if z == zone["id"]] == zone["steps"] or not any(
            z == zone["id"] for z in parts.values())
