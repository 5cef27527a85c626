"""Small jobs planned and proved from blanks with a shape of their own: bars that stand and lie, a casting."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from service import pipeline
from service.cli import app
from service.from_wire import parse_setup
from tests.step_files import write_step

cq = pytest.importorskip("cadquery")

FLAT = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 10, "stickout_mm": 24}
SETUP = {"tools": [FLAT], "quality": {"scallop_height_mm": 0.05, "chordal_tolerance_mm": 0.01},
         "material": "AlMgSi1 6082"}


def quiet(_stage: str, _share: float) -> None:
    """No progress."""


def planned(part: Path, out: Path, *, blank: Path | None = None, **fields: object) -> dict[str, Any]:
    return pipeline.plan(part, parse_setup(json.dumps({**SETUP, **fields})), out, quiet, blank_path=blank)


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A block 8 x 6 x 4 with a step 2 deep over half its length, its foot in the origin."""
    shape = cq.Workplane().box(8, 6, 4, centered=False).cut(cq.Workplane().box(4, 6, 2, centered=False)
                                                            .translate((0, 0, 2)))
    return write_step(shape, tmp_path_factory.mktemp("step") / "step.step")


LEANING = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-30, 110], [-360, 360]],
           "orientations": "given"}
BAR = {"x": 4, "y": 3, "bottom": 0, "diameter": 11, "height": 5}


def test_from_a_standing_bar(part: Path, tmp_path: Path) -> None:
    """Proved; and not from a bar that is higher than the one it was planned from."""
    stock = {"kind": "cylinder", "cylinder_mm": BAR, "uncertainty_mm": 0.1}
    report = planned(part, tmp_path, stock=stock)
    assert report["state"] == "proved" and report["findings"] == [] and report["coverage"] > 0.99
    text = (tmp_path / "program.linuxcnc.ngc").read_text()
    higher = {**SETUP, "stock": {**stock, "cylinder_mm": {**BAR, "height": 15}}}
    again = pipeline.verify_program(part, parse_setup(json.dumps(higher)), text, quiet)
    assert again["state"] == "unproved" and set(again["finding_counts"]) & {"collision", "rapid", "plunge"}
    same = pipeline.verify_program(part, parse_setup(json.dumps({**SETUP, "stock": stock})), text, quiet)
    assert not same["findings"]


@pytest.mark.parametrize("direction", [pytest.param([0, 1, 0], marks=pytest.mark.slow), [0, 0.6, 0.8]])
@pytest.mark.slow
def test_from_a_bar_that_lies_or_leans_along_the_access(part: Path, tmp_path: Path, direction: list[float]) -> None:
    stock = {"kind": "cylinder", "cylinder_mm": BAR, "uncertainty_mm": 0.1}
    report = planned(part, tmp_path, stock=stock, access=[{"direction": direction}])
    assert report["state"] == "proved" and report["findings"] == []
    assert report["coverage"] > 0.3 and report["reach_coverage"] > 0.95


@pytest.mark.slow
def test_from_a_bar_on_a_machine_that_leans_its_table(part: Path, tmp_path: Path) -> None:
    """From above and from the side of the step, one after the other from the same bar, proved on the grid."""
    stock = {"kind": "cylinder", "cylinder_mm": {**BAR, "bottom": -3, "height": 8}, "uncertainty_mm": 0.1}
    access = [{}, {"id": "A2", "direction": [0, -0.8, 0.6]}]
    report = planned(part, tmp_path, stock=stock, machine=LEANING, access=access)
    assert report["state"] == "proved" and report["findings"] == [] and report["coverage"] > 0.9

def casting(path: Path, high: float = 1.0) -> Path:
    """The step part grown by about 1 mm aside and ``high`` above, edges of its own, standing flush on the seat."""
    def box(x: float, y: float, z: float, at: tuple[float, float, float]) -> Any:
        return cq.Workplane().box(x, y, z, centered=False).translate(at)

    low, wall = box(10, 8, 2 + high, (-1, -1, 0)), box(6, 8, 4 + high, (3, -1, 0))
    return write_step(low.union(wall).edges("|Z").fillet(1.2), path)


def on_command_line(command: str, part: Path, folder: Path, setup: dict[str, Any], *more: str) -> Any:
    path = folder / "setup.json"
    path.write_text(json.dumps(setup))
    return CliRunner().invoke(app, [command, str(part), "--setup", str(path), *more])


@pytest.mark.slow
def test_from_a_casting_in_a_step_file_on_the_command_line(part: Path, tmp_path: Path) -> None:
    """Planned and proved, the blank named from the folder of the setup; not proved of a casting that is 9 mm higher."""
    casting(tmp_path / "casting.step")
    casting(tmp_path / "higher.step", 10.0)
    setup = {**SETUP, "stock": {"kind": "step", "step_file": "casting.step", "uncertainty_mm": 0.2}}
    got = on_command_line("plan", part, tmp_path, setup, "--out", str(tmp_path / "out"))
    report = json.loads(got.stdout)
    assert got.exit_code == 0 and report["state"] == "proved" and report["coverage"] > 0.99
    bytes_of_it = (tmp_path / "casting.step").read_bytes()
    assert report["inputs"]["stock_sha256"] == hashlib.sha256(bytes_of_it).hexdigest()
    program = tmp_path / "out" / "program.linuxcnc.ngc"
    assert f"stock sha256 {report['inputs']['stock_sha256'][:16]}" in program.read_text()
    again = on_command_line("verify", part, tmp_path, setup, "--program", str(program))
    assert again.exit_code == 0 and not json.loads(again.stdout)["findings"]
    setup["stock"]["step_file"] = "higher.step"
    higher = on_command_line("verify", part, tmp_path, setup, "--program", str(program))
    assert higher.exit_code == 3 and set(json.loads(higher.stdout)["finding_counts"]) & {"collision", "rapid", "plunge"}


@pytest.mark.parametrize("direction", [[0, 1, 0], [0, 0.6, 0.8]])
@pytest.mark.slow
def test_from_a_casting_seen_from_aside(part: Path, tmp_path: Path, direction: list[float]) -> None:
    report = planned(part, tmp_path, stock={"kind": "step", "uncertainty_mm": 0.2}, access=[{"direction": direction}],
                     blank=casting(tmp_path / "casting.step"))
    assert report["state"] == "proved" and report["findings"] == [] and report["reach_coverage"] > 0.95


@pytest.mark.slow
def test_from_a_casting_on_a_machine_that_leans_its_table(part: Path, tmp_path: Path) -> None:
    report = planned(part, tmp_path, stock={"kind": "step", "uncertainty_mm": 0.2}, machine=LEANING,
                     access=[{}, {"id": "A2", "direction": [0, -0.8, 0.6]}], blank=casting(tmp_path / "casting.step"))
    assert report["state"] == "proved" and report["findings"] == [] and report["coverage"] > 0.9
