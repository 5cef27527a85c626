"""A hollow top on a machine that turns: cut by the tilted end of a bull nose in a few passes, and all of it proved."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from service import pipeline
from service.from_wire import parse_setup

cq = pytest.importorskip("cadquery")
# A job of a minute; its parts are tested in tests/unit/toolpath/strategies/test_curvature_matched.py.
pytestmark = pytest.mark.slow

TOOL = {"id": "T1", "kind": "bull", "corner_radius_mm": 1, "flutes": 3, "diameter_mm": 8, "flute_length_mm": 14,
        "neck_diameter_mm": 7.6, "neck_length_mm": 24, "shank_diameter_mm": 8, "stickout_mm": 40,
        "holder": [{"diameter_mm": 20, "length_mm": 30}]}
MACHINE = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-30, 110], [-360, 360]],
           "orientations": "given"}
SETUP = {"tools": [TOOL], "quality": {"scallop_height_mm": 0.02, "chordal_tolerance_mm": 0.006},
         "material": "AlMgSi1 6082", "stock": {"margin_mm": 0.8, "uncertainty_mm": 0.1}, "machine": MACHINE}
LONG, WIDE = 26.0, 18.0


def quiet(_stage: str, _share: float) -> None:
    """No progress."""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The job: a block whose top is hollow, 40 mm round across and 130 along, and twists a little."""
    folder = tmp_path_factory.mktemp("hollow")
    rows = [[cq.Vector(x, y, 6.0 + x * x / 260.0 + y * y / 80.0 + x * y / 900.0)
             for y in np.linspace(-WIDE, WIDE, 13)] for x in np.linspace(-LONG, LONG, 13)]
    top = cq.Face.makeSplineApprox(rows, tol=1e-4, minDeg=3, maxDeg=3)
    above = cq.Workplane(obj=cq.Solid.extrudeLinear(top, cq.Vector(0, 0, 40)))
    block = cq.Workplane().box(LONG, WIDE, 20, centered=(True, True, False)).cut(above)
    cq.exporters.export(block, str(folder / "hollow.step"))
    return pipeline.plan(folder / "hollow.step", parse_setup(json.dumps(SETUP)), folder / "out", quiet)


def test_the_hollow_is_cut_by_the_tilted_end_and_proved(report: dict[str, Any]) -> None:
    assert report["state"] == "proved", report["findings"]
    (zone,) = [z for z in report["zones"] if z["form"] == "shallow"]
    assert zone["strategy"] == "curvature_matched" and zone["coverage"] > 0.999
    assert zone["scallop_mm"]["max"] <= 0.02
    assert report["gouge_max_mm"] <= 0.01


def test_it_takes_a_part_of_what_an_upright_tool_takes(report: dict[str, Any]) -> None:
    """104.6 s of 124.3, links counted: layers leave little above the hollow, which spares the upright end more."""
    (zone,) = [z for z in report["zones"] if z["form"] == "shallow"]
    (upright,) = [r for r in zone["rejected"] if str(r["reason"]).startswith("takes longer")
                  and r["strategy"] in ("spiral", "zigzag")]
    assert upright["limit"] < 0.86 * upright["value"]
