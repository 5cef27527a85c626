"""The tools a dry check proposes, put into the setup as they stand, do what it says of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from schemas.setup import Setup
from service.from_wire import parse_setup
from service.report.report import dry_report
from service.stages.preparation import prepare
from tests.step_files import write_step

pytestmark = pytest.mark.slow

cq = pytest.importorskip("cadquery")

HOLDER = [{"diameter_mm": 16, "diameter_top_mm": 22, "length_mm": 20}, {"diameter_mm": 22, "length_mm": 20}]
AT_HAND = [
    {"id": "T1", "kind": "flat", "diameter_mm": 5, "flute_length_mm": 12, "neck_diameter_mm": 4.7, "neck_length_mm": 16,
     "shank_diameter_mm": 6, "stickout_mm": 30, "holder": HOLDER, "max_rpm": 18000},
    {"id": "T2", "kind": "ball", "diameter_mm": 4, "flutes": 3, "flute_length_mm": 10, "neck_length_mm": 12,
     "neck_diameter_mm": 3.8, "shank_diameter_mm": 6, "stickout_mm": 28, "holder": HOLDER, "gauge_length_mm": 80}]
ONE_FAT = [{"id": "T1", "kind": "flat", "diameter_mm": 12, "flute_length_mm": 20, "stickout_mm": 40, "holder": HOLDER}]


def box(x, y, z, *size):
    return cq.Workplane().box(*size, centered=False).translate((x, y, z))


def channel():
    """Walls 3 apart, closed at one end and bridged in the middle."""
    shape = box(0, 0, 0, 24, 14, 12).cut(box(-1, 5, 3, 22, 3, 10))
    return shape.union(box(9, 4, 8, 3, 5, 2))


def pockets():
    """Three square pockets, the corners of each less than a zone is made of for most tools."""
    shape = box(0, 0, 0, 34, 14, 8)
    for x in (2, 13, 24):
        shape = shape.cut(box(x, 3, 4, 8, 8, 5))
    return shape


def slot():
    """A narrow slot beside a wide step."""
    return box(0, 0, 0, 26, 16, 10).cut(box(14, -1, 6, 13, 18, 5)).cut(box(4, -1, 3, 1.7, 18, 8))


def dry(step: Path, tools: list[dict[str, Any]]) -> tuple[Setup, dict[str, Any]]:
    setup = parse_setup(json.dumps({"tools": tools, "quality": {"scallop_height_mm": 0.05}}))
    return setup, dry_report(prepare(step, setup, lambda _stage, _share: None))


def held(report: dict[str, Any]) -> float:
    return float(sum(z["area_mm2"] for z in report["zones"]))


@pytest.mark.parametrize(("make", "tools"), [(channel, AT_HAND), (pockets, AT_HAND), (slot, ONE_FAT)],
                         ids=["channel", "pockets", "slot"])
def test_the_proposed_tools_appended_as_they_stand_keep_the_promise(make, tools, tmp_path):
    step = write_step(make(), tmp_path / "part.step")
    before, report = dry(step, tools)
    proposal = json.loads(json.dumps(report["proposal"]))
    assert proposal["tools"] and proposal["emptied_mm2"] > 1.0
    after, again = dry(step, [*tools, *(t["tool"] for t in proposal["tools"])])
    assert held(again) - held(report) == pytest.approx(proposal["emptied_mm2"], rel=0.01)
    assert sum(t["area_mm2"] for t in proposal["tools"]) == pytest.approx(proposal["emptied_mm2"], rel=0.01)
    stays = sum(x["area_mm2"] for x in again["remainder"])
    assert sum(proposal["stays_mm2"].values()) == pytest.approx(stays, rel=0.01, abs=0.05)
    by_tool = {t["tool"]["id"]: sum(z["area_mm2"] for z in again["zones"] if z["tool"] == t["tool"]["id"])
               for t in proposal["tools"]}
    assert all(by_tool[t["tool"]["id"]] >= t["area_mm2"] - 0.01 >= 0.99 for t in proposal["tools"])
    assert [t.model_dump() for t in after.tools[:len(tools)]] == [t.model_dump() for t in before.tools]
    for got, t in zip(after.tools[len(tools):], proposal["tools"], strict=True):
        like = next(x for x in before.tools if x.id == t["like"])
        assert got.holder == like.holder and got.flutes == like.flutes and got.max_rpm == like.max_rpm
        usual = 6.0 if got.diameter_mm <= 6.0 else like.shank_diameter_mm  # no thin cutter on the shank of a fat one
        assert got.stickout_mm == t["stickout_mm"] and got.shank_diameter_mm == min(like.shank_diameter_mm, usual)
        assert got.gauge_length_mm - got.stickout_mm == pytest.approx(like.gauge_length_mm - like.stickout_mm)
