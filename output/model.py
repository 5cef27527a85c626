"""The workplan that every writer turns into text: plain values, tool tip, setup frame, mm."""

from __future__ import annotations

from dataclasses import dataclass, field

from geometry.mesh import F64
from geometry.toolbody import ToolBody
from toolpath.motion import Motion, Trajectory, Workingstep


@dataclass(frozen=True, eq=False)
class StockBox:
    """Bounding box of the stock, mm: lower and upper corner (3,)."""

    lower: F64
    upper: F64


@dataclass(frozen=True, eq=False)
class Workplan:
    """A job for one access direction: everything a writer needs.

    clearance_plane : z in mm above which rapids in XY are free
    labels          : passed through to headers
    comments        : header lines for the machinist (ASCII, no parentheses)
    """

    name: str
    steps: tuple[Workingstep, ...]
    tools: tuple[ToolBody, ...]
    clearance_plane: float
    work_offset: str
    stock: StockBox
    material: str
    part_sha256: str
    setup_sha256: str
    version: str
    labels: dict[str, str] = field(default_factory=dict)
    comments: tuple[str, ...] = ()


__all__ = ["Motion", "StockBox", "Trajectory", "Workingstep", "Workplan"]
