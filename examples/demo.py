"""The demo part of ``zonemill demo`` and the README, and a small one for ``zonemill warm``, with their setups."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from examples.setups import setup_with, tool


def demo_setup() -> dict[str, Any]:
    """Setup of the demo part: flat 4, ball 3, and a long-necked ball of 1 mm for the narrow stretch."""
    return setup_with(
        [tool(1, "flat", 4.0, 14.0), tool(2, "ball", 3.0, 14.0), tool(3, "ball", 1.0, 13.0, shank=4.0)], scallop=0.02
    )


def write_demo(directory: str | Path) -> tuple[Path, Path]:
    """Write demo.step and demo.setup.json into a folder; the same bytes every time.

    Returns the two paths.
    """
    from examples.family.recipes import make_part

    return _write(directory, "demo", make_part(0, "demo").shape, demo_setup())


def write_small(directory: str | Path) -> tuple[Path, Path]:
    """Write small.step and small.setup.json: a wall and a rounded bar on a plate, which every strategy has a part in.

    Returns the two paths.
    """
    import cadquery as cq

    plate = cq.Workplane().box(10.0, 8.0, 1.0, centered=(True, True, False))
    wall = cq.Workplane().box(1.5, 8.0, 4.0, centered=(True, True, False)).translate((-2.0, 0.0, 0.0))
    bar = cq.Workplane("XZ").center(2.5, 0.5).circle(1.2).extrude(8.0).translate((0.0, 4.0, 0.0))
    shape = plate.union(wall).union(bar).val()
    tools = [tool(1, "flat", 3.0, 5.0), tool(2, "ball", 1.0, 3.5)]
    setup = setup_with(tools, scallop=0.1)
    setup["stock"] = {"kind": "box", "margin_mm": 2.0}
    return _write(directory, "small", shape, setup)


def _write(directory: str | Path, name: str, shape: Any, setup: dict[str, Any]) -> tuple[Path, Path]:
    from examples.family.recipes import step_bytes

    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    step_path, setup_path = folder / f"{name}.step", folder / f"{name}.setup.json"
    step_path.write_bytes(step_bytes(shape, name))
    setup_path.write_text(json.dumps(setup, indent=1) + "\n")
    return step_path, setup_path
