"""The demo part of ``zonemill demo`` and the README, and a small one for ``zonemill warm``, with their setups.

Both parts are committed as STEP files in ``examples/parts``, so that a first job needs no cadquery.
``python -m examples.demo`` draws them anew with the cadquery that is installed.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from examples.setups import setup_with, tool

PARTS = Path(__file__).resolve().parent / "parts"


def demo_setup() -> dict[str, Any]:
    """Setup of the demo part: flat 4, ball 3, and a long-necked ball of 1 mm for the narrow stretch."""
    return setup_with(
        [tool(1, "flat", 4.0, 14.0), tool(2, "ball", 3.0, 14.0), tool(3, "ball", 1.0, 13.0, shank=4.0)], scallop=0.02
    )


def small_setup() -> dict[str, Any]:
    """Setup of the small part: flat 3 and ball 1 in a box of stock, scallop 0.1 mm."""
    setup = setup_with([tool(1, "flat", 3.0, 5.0), tool(2, "ball", 1.0, 3.5)], scallop=0.1)
    setup["stock"] = {"kind": "box", "margin_mm": 2.0}
    return setup


def write_demo(directory: str | Path) -> tuple[Path, Path]:
    """Write demo.step and demo.setup.json into a folder; the same bytes every time.

    Returns the two paths.
    """
    return _write(directory, "demo", demo_setup())


def write_small(directory: str | Path) -> tuple[Path, Path]:
    """Write small.step and small.setup.json: a wall and a rounded bar on a plate, on which every strategy is used.

    Returns the two paths.
    """
    return _write(directory, "small", small_setup())


def draw_demo() -> bytes:
    """The demo part as STEP text, drawn by the family's generator; needs cadquery."""
    from examples.family.recipes import make_part, step_bytes

    return step_bytes(make_part(0, "demo").shape, "demo")


def draw_small() -> bytes:
    """The small part as STEP text; needs cadquery."""
    import cadquery as cq

    from examples.family.recipes import step_bytes

    plate = cq.Workplane().box(10.0, 8.0, 1.0, centered=(True, True, False))
    wall = cq.Workplane().box(1.5, 8.0, 4.0, centered=(True, True, False)).translate((-2.0, 0.0, 0.0))
    bar = cq.Workplane("XZ").center(2.5, 0.5).circle(1.2).extrude(8.0).translate((0.0, 4.0, 0.0))
    return step_bytes(plate.union(wall).union(bar).val(), "small")


def _write(directory: str | Path, name: str, setup: dict[str, Any]) -> tuple[Path, Path]:
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    step_path, setup_path = folder / f"{name}.step", folder / f"{name}.setup.json"
    shutil.copyfile(PARTS / step_path.name, step_path)
    setup_path.write_text(json.dumps(setup, indent=1) + "\n")
    return step_path, setup_path


if __name__ == "__main__":
    PARTS.joinpath("demo.step").write_bytes(draw_demo())
    PARTS.joinpath("small.step").write_bytes(draw_small())
