"""A part of the five-axis sweep whose first plan digs 0.171 mm of 0.150 in one place: planned again, it is proved."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.five_axis_gain import MACHINE
from examples.family import make_part
from service import chain
from service.convert import parse_setup

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


def _planned(folder: Path, told: list[float]) -> dict[str, Any]:
    made = make_part(101, "random", walls=3, connections=1, gap=(0.8, 6.0))
    step, _, _ = made.write(folder)
    setup = parse_setup(json.dumps({**made.setup, "machine": MACHINE}))
    return chain.plan(step, setup, folder / "out", lambda _stage, share: told.append(share))


def test_planned_once_it_is_unproved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chain, "PLANS", 1)
    report = _planned(tmp_path, [])
    assert report["state"] == "unproved" and report["finding_counts"]["plunge"] == 1
    assert report["findings"][0]["tip"] is not None
    assert not any("planned again" in w for w in report["part"]["warnings"])


def test_planned_again_it_is_proved_and_says_what_was_changed(tmp_path: Path) -> None:
    shares: list[float] = []
    report = _planned(tmp_path, shares)
    assert report["state"] == "proved" and not report["findings"] and report["reach_coverage"] > 0.9999
    told = [w for w in report["part"]["warnings"] if "planned again" in w]
    assert any("with care near X8.52 Y1.90 Z12.46" in w and "0.171 mm" in w for w in told)
    assert shares == sorted(shares) and shares[-1] == 1.0
