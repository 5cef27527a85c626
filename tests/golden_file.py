"""Golden files: compare with the one in tests/golden; ZONEMILL_GOLDEN=1 rewrites it, and the diff is reviewed."""

from __future__ import annotations

import os
from pathlib import Path

FOLDER = Path(__file__).parent / "golden"


def assert_golden(name: str, text: str) -> None:
    path = FOLDER / name
    if os.environ.get("ZONEMILL_GOLDEN") == "1":
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="ascii", newline="\n")
    assert path.exists(), f"no golden file {name}: write it with ZONEMILL_GOLDEN=1"
    assert text == path.read_text(encoding="ascii"), f"{name} differs; if that is meant, run with ZONEMILL_GOLDEN=1"
