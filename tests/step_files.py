"""STEP files for tests: small shapes written by the CAD kernel, and the real parts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

PARTS = Path(__file__).resolve().parents[2] / "shared" / "parts"


def write_step(shape: Any, path: Path, unit: str = "MM", *, assembly: bool = False) -> Path:
    """Write a cadquery object or kernel shape; ``unit`` is the kernel's word (MM, CM, M, INCH).

    assembly : a compound is written as an assembly with a product for each member, else as one product
    """
    from OCP.Interface import Interface_Static
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

    while hasattr(shape, "val") or hasattr(shape, "wrapped"):
        shape = shape.val() if hasattr(shape, "val") else shape.wrapped
    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("xstep.cascade.unit", "MM")
    Interface_Static.SetCVal_s("write.step.unit", unit)
    Interface_Static.SetIVal_s("write.step.assembly", int(assembly))
    try:
        writer.Transfer(shape, STEPControl_AsIs)
        writer.Write(str(path))
    finally:
        Interface_Static.SetCVal_s("write.step.unit", "MM")
        Interface_Static.SetIVal_s("write.step.assembly", 2)
    return path


def real_part(name: str) -> Path:
    """A part of the shared collection; skips the test where the collection is absent."""
    path = PARTS / name
    if not path.exists():
        pytest.skip(f"the shared part {name} is not here")
    return path
