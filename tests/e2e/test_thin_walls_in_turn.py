"""A job with a high thin wall goes down by bands, and what it was before would not be proved."""

from __future__ import annotations

import json

import pytest

from examples.setups import setup_with, tool
from schemas.setup import Setup
from service import pipeline
from service.stages import plan_prove_loop
from service.stages.preparation import prepare
from service.stages.wall_support import FREE_RATIO, PLANNED_RATIO, band_planes
from tests.decomposition_shapes import box

pytestmark = pytest.mark.slow

cq = pytest.importorskip("cadquery")

FLAT, BALL = tool(1, "flat", 4.0, 12.0), tool(2, "ball", 2.0, 12.0)


def base():
    return box(14, 8, 3, -7, -4, 0)


def written(shape, path):
    cq.exporters.export(shape, str(path))
    return path


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    """0.6 mm thick and 9.5 high."""
    return written(base().union(box(0.6, 8, 10, 0, -4, 2.5)), tmp_path_factory.mktemp("wall") / "wall.step")


def setup(tools=(FLAT,), **changes) -> Setup:
    plain = setup_with(list(tools), scallop=0.02)  # layers leave more than two of it
    plain |= {"stock": {"kind": "box", "margin_mm": 1.0}, "material": "AlMgSi1 6082", **changes}
    return Setup.model_validate(plain)


def plan(step, folder, asked):
    return pipeline.plan(step, asked, folder, lambda *_: None)


def test_the_plan_holds_both_sides_and_the_order_of_before_does_not(wall, tmp_path, monkeypatch):
    banded = plan(wall, tmp_path / "banded", setup())
    assert banded["state"] == "proved" and "program.linuxcnc.ngc" in {f["name"] for f in banded["files"]}
    support = banded["proof"]["support"]
    assert support["walls"] == 1 and support["places"] > 100 and support["places_over"] == 0
    assert support["most_ratio"] <= PLANNED_RATIO + 1.0 and support["limit_ratio"] == FREE_RATIO
    steps = [s["strategy"] for s in banded["steps"]]
    last_layers = len(steps) - 1 - steps[::-1].index("depth_layers")
    assert steps.count("depth_layers") == 2 and steps.index("waterline") < last_layers
    monkeypatch.setattr(plan_prove_loop, "band_planes", lambda *_: ())
    monkeypatch.setattr(plan_prove_loop, "MAX_PLANS", 1)
    whole = plan(wall, tmp_path / "whole", setup())
    assert whole["state"] == "unproved" and set(whole["finding_counts"]) == {"support"}
    assert 14.0 < whole["proof"]["support"]["most_ratio"] < 9.5 / 0.6 + 1.0  # the last layer at the foot still stands
    assert not [f for f in whole["files"] if f["kind"] == "program"]
    assert whole["coverage"] == pytest.approx(banded["coverage"], abs=1e-3)


def test_a_wall_that_is_held_otherwise_is_cut_as_it_comes_and_told_of(wall, tmp_path):
    asked = setup(operations={"walls_in_turn": False})
    ready = prepare(wall, asked, lambda *_: None)
    assert band_planes(ready, ready.views[0]) == ()
    report = plan(wall, tmp_path, asked)
    assert report["state"] == "proved" and [s["strategy"] for s in report["steps"]].count("depth_layers") == 1
    (told,) = [w for w in report["warnings"] if w["kind"] == "support"]
    assert told["measured"] > 14.0 and told["limit"] == FREE_RATIO
    assert told["at_mm"][2] == pytest.approx(12.5, abs=0.4) and told["message"] in " ".join(report["part"]["warnings"])
    assert json.loads((tmp_path / "report.json").read_text())["warnings"] == report["warnings"]


def test_tools_after_each_other_keep_it_too(tmp_path):
    """A ball finishes a lying bar, its tip a radius lower than its contact: beside the wall stock goes that far too."""
    shape = base().union(box(0.6, 8, 10, 0, -4, 2.5)).union(
        cq.Workplane("XZ").center(4.0, 3.0).circle(1.5).extrude(8.0).translate((0.0, 4.0, 0.0)))
    report = plan(written(shape, tmp_path / "bar.step"), tmp_path / "job", setup((FLAT, BALL)))
    assert report["state"] == "proved" and report["proof"]["support"]["walls"] == 1
    assert {s["tool"] for s in report["steps"]} == {"T1", "T2"} and report["proof"]["support"]["most_ratio"] < 9.0


def test_what_no_decomposition_calls_a_wall_is_planned_again_in_bands(tmp_path):
    """A pin of 0.6 mm, 9.5 high."""
    shape = base().union(cq.Workplane().circle(0.3).extrude(10.0).translate((0, 0, 2.5))).union(
        box(2, 8, 6, 4.5, -4, 2.5))
    step = written(shape, tmp_path / "pin.step")
    ready = prepare(step, setup(), lambda *_: None)
    assert band_planes(ready, ready.views[0]) == ()
    report = plan(step, tmp_path / "job", setup())
    assert report["state"] == "proved" and report["proof"]["support"]["most_ratio"] <= FREE_RATIO
    assert any("planned again, in lower bands" in w for w in report["part"]["warnings"])


def test_a_wall_that_connections_hold_needs_no_bands(tmp_path):
    """Ribs on one side, 4 mm apart: no place of the wall is as far from all of them as it is from the foot."""
    shape = base().union(box(0.6, 8, 10, 0, -4, 2.5))
    ribs = [box(2.0, 0.8, 10, -2.0, y, 2.5) for y in (-4.0, -0.4, 3.2)]
    held = shape
    for rib in ribs:
        held = held.union(rib)
    asked = setup()
    ready, alone = (prepare(written(s, tmp_path / f"{k}.step"), asked, lambda *_: None)
                    for k, s in enumerate((held, shape)))
    assert band_planes(ready, ready.views[0]) == ()
    assert len(band_planes(alone, alone.views[0])) == 1


def test_bands_go_no_deeper_than_to_what_holds_a_wall(tmp_path):
    """Two and a half times as thick up to a half of its height, a wall is free above that alone."""
    shape = base().union(box(0.6, 8, 16, 0, -4, 2.5))
    held = shape.union(box(1.5, 8, 7.0, -0.45, -4, 2.5))
    asked = setup([tool(1, "flat", 4.0, 20.0)])
    high, low = (prepare(written(s, tmp_path / f"{k}.step"), asked, lambda *_: None)
                 for k, s in enumerate((shape, held)))
    low_planes, high_planes = band_planes(low, low.views[0]), band_planes(high, high.views[0])
    assert len(low_planes) == 1 and min(low_planes) > 9.5
    assert len(high_planes) > len(low_planes) and min(high_planes) < 9.5


def test_roughing_alone_holds_a_thin_wall_too(wall, tmp_path):
    """No finish follows, so layers take the wall to size one by one, while the stock below still holds it."""
    alone = plan(wall, tmp_path / "alone", setup(operations={"finishing": False}))
    assert alone["state"] == "proved" and {s["operation"] for s in alone["steps"]} == {"roughing"}
    assert alone["proof"]["support"]["places"] > 100 and alone["proof"]["support"]["places_over"] == 0
