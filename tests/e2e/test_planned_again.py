"""A planner that goes down too steeply where no proof has told it of a place: planned again, its job is proved."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
import pytest

from service import pipeline
from service.from_wire import parse_setup
from service.stages import plan_prove_loop
from toolpath.linking import ways_in

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

TOO_STEEP = 12.0  # of the ramp angle
TOOL = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 9, "neck_diameter_mm": 3.8,
        "neck_length_mm": 16, "shank_diameter_mm": 6, "stickout_mm": 28,
        "holder": [{"diameter_mm": 20, "length_mm": 30}]}
SETUP = {"tools": [TOOL], "stock": {"kind": "box", "margin_mm": 0.6, "uncertainty_mm": 0.2},
         "quality": {"scallop_height_mm": 0.04, "chordal_tolerance_mm": 0.005}}


def _planned(folder: Path, told: list[float]) -> dict[str, Any]:
    """The report of a block with a closed pocket."""
    pocket = cq.Workplane().box(13, 8, 6, centered=False).translate((4.5, 4, 4))
    step = folder / "pocket.step"
    cq.exporters.export(cq.Workplane().box(22, 16, 10, centered=False).cut(pocket), str(step))
    return pipeline.plan(step, parse_setup(SETUP), folder / "out", lambda _stage, share: told.append(share))


@pytest.fixture(autouse=True)
def steep(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Ways down are too steep where the plan takes no care."""
    right = ways_in.way_down

    def way_down(points: Any, closed: bool, over: float, tool: Any, angle: float, care: float,
                 stands: float) -> Any:
        return right(points, closed, over, tool, angle if care < 1.0 else TOO_STEEP * angle, care, stands)

    monkeypatch.setattr(ways_in, "way_down", way_down)
    yield


def test_planned_once_it_is_unproved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan_prove_loop, "MAX_PLANS", 1)
    report = _planned(tmp_path, [])
    assert report["state"] == "unproved" and set(report["finding_counts"]) == {"plunge"}
    assert all(f["tip"] is not None for f in report["findings"])
    assert not any("planned again" in w for w in report["part"]["warnings"])


def test_planned_again_it_is_proved_and_says_what_was_changed(tmp_path: Path) -> None:
    shares: list[float] = []
    report = _planned(tmp_path, shares)
    assert report["state"] == "proved" and not report["findings"] and report["reach_coverage"] > 0.999
    told = [w for w in report["part"]["warnings"] if "planned again" in w]
    assert any("with care near X" in w and "steeper than the ramp angle" in w for w in told)
    assert np.all(np.diff(shares) >= 0.0) and shares[-1] == 1.0
