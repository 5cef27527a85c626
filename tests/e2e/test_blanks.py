"""Small jobs planned and proved from blanks with a shape of their own: bars that stand and lie."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from service import chain
from service.convert import parse_setup
from tests.step_files import write_step

cq = pytest.importorskip("cadquery")

FLAT = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 10, "stickout_mm": 24}
SETUP = {"tools": [FLAT], "quality": {"scallop_height_mm": 0.05, "chordal_tolerance_mm": 0.01},
         "material": "AlMgSi1 6082"}


def quiet(_stage: str, _share: float) -> None:
    """No progress."""


def planned(part: Path, out: Path, **fields: object) -> dict[str, Any]:
    return chain.plan(part, parse_setup(json.dumps({**SETUP, **fields})), out, quiet)


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A block 8 x 6 x 4 with a step 2 deep over half its length, its foot in the origin."""
    shape = cq.Workplane().box(8, 6, 4, centered=False).cut(cq.Workplane().box(4, 6, 2, centered=False)
                                                            .translate((0, 0, 2)))
    return write_step(shape, tmp_path_factory.mktemp("step") / "step.step")


BAR = {"x": 4, "y": 3, "bottom": 0, "diameter": 11, "height": 5}


def test_from_a_standing_bar(part: Path, tmp_path: Path) -> None:
    """Proved; and not from a bar that is higher than the one it was planned from."""
    stock = {"kind": "cylinder", "cylinder_mm": BAR, "uncertainty_mm": 0.1}
    report = planned(part, tmp_path, stock=stock)
    assert report["state"] == "proved" and report["findings"] == [] and report["coverage"] > 0.99
    text = (tmp_path / "program.linuxcnc.ngc").read_text()
    higher = {**SETUP, "stock": {**stock, "cylinder_mm": {**BAR, "height": 15}}}
    again = chain.verify_program(part, parse_setup(json.dumps(higher)), text, quiet)
    assert again["state"] == "unproved" and set(again["finding_counts"]) & {"collision", "rapid", "plunge"}
    same = chain.verify_program(part, parse_setup(json.dumps({**SETUP, "stock": stock})), text, quiet)
    assert not same["findings"]


@pytest.mark.parametrize("direction", [[0, 1, 0], [0, 0.6, 0.8]])
def test_from_a_bar_that_lies_or_leans_along_the_access(part: Path, tmp_path: Path, direction: list[float]) -> None:
    stock = {"kind": "cylinder", "cylinder_mm": BAR, "uncertainty_mm": 0.1}
    report = planned(part, tmp_path, stock=stock, access=[{"direction": direction}])
    assert report["state"] == "proved" and report["findings"] == []
    assert report["coverage"] > 0.3 and report["reach_coverage"] > 0.95


def test_from_a_bar_on_a_machine_that_leans_its_table(part: Path, tmp_path: Path) -> None:
    """From above and from the side of the step, one after the other from the same bar, proved on the grid."""
    stock = {"kind": "cylinder", "cylinder_mm": {**BAR, "bottom": -3, "height": 8}, "uncertainty_mm": 0.1}
    machine = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-30, 110], [-360, 360]],
               "orientations": "given"}
    access = [{}, {"id": "A2", "direction": [0, -0.8, 0.6]}]
    report = planned(part, tmp_path, stock=stock, machine=machine, access=access)
    assert report["state"] == "proved" and report["findings"] == [] and report["coverage"] > 0.9
