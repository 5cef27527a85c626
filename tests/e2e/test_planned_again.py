"""A part of the five-axis sweep whose first plan cuts too deep in one place: planned again, it is proved."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.five_axis.five_axis_gain import MACHINE
from examples.family.recipes import make_part
from service import pipeline
from service.from_wire import parse_setup
from service.stages import plan_prove_loop

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


def _planned(folder: Path, told: list[float]) -> dict[str, Any]:
    made = make_part(101, "random", walls=3, connections=1, gap=(0.8, 6.0))
    step, _, _ = made.write(folder)
    setup = parse_setup(json.dumps({**made.setup, "machine": MACHINE}))
    return pipeline.plan(step, setup, folder / "out", lambda _stage, share: told.append(share))


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The report of the first plan alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan_prove_loop, "MAX_PLANS", 1)
        return _planned(tmp_path_factory.mktemp("once"), [])


def test_planned_once_it_is_unproved(once: dict[str, Any]) -> None:
    assert once["state"] == "unproved" and once["finding_counts"] == {"load": 1}
    assert once["findings"][0]["tip"] is not None
    assert not any("planned again" in w for w in once["part"]["warnings"])


def test_planned_again_it_is_proved_and_says_what_was_changed(once: dict[str, Any], tmp_path: Path) -> None:
    shares: list[float] = []
    report = _planned(tmp_path, shares)
    assert report["state"] == "proved" and not report["findings"] and report["reach_coverage"] > 0.9999
    told = [w for w in report["part"]["warnings"] if "planned again" in w]
    (dug,) = once["findings"]
    x, y, z = dug["point"]
    assert any(f"with care near X{x:.2f} Y{y:.2f} Z{z:.2f}" in w and dug["message"] in w for w in told)
    assert shares == sorted(shares) and shares[-1] == 1.0
