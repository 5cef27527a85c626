"""The demo part and its setup, as ``zonemill demo`` and the README use them."""

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
    from examples.family import make_part, step_bytes

    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    step, setup = folder / "demo.step", folder / "demo.setup.json"
    step.write_bytes(step_bytes(make_part(0, "demo").shape, "demo"))
    setup.write_text(json.dumps(demo_setup(), indent=1) + "\n")
    return step, setup
