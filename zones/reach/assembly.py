"""A tool assembly as stacked discs, grown by the clearances."""

from __future__ import annotations

from dataclasses import dataclass

from geometry.tool_body import ToolBody

FRUSTUM_SLICES = 6


@dataclass(frozen=True)
class Clearances:
    """Radial clearances around the assembly, mm; ``approach`` is to what is below it, in a rapid down before a cut."""

    neck: float = 0.05
    shank: float = 0.2
    holder: float = 1.0
    rapid: float = 1.0
    approach: float = 0.0


@dataclass(frozen=True)
class Disc:
    """A flat-bottomed cylinder of the assembly that is wider than the cutter: radius with clearance, height, mm."""

    name: str
    radius: float
    height: float


def discs_of(tool: ToolBody, clear: Clearances) -> tuple[Disc, ...]:
    """Shank and holder as stacked cylinders that enclose them, clearance included.

    Frusta are cut into slices, each as wide as its widest end. Bodies no wider than the cutter are left out.
    """
    out: list[Disc] = []
    if tool.shank_diameter > 2.0 * tool.widest_radius + 1e-9:
        out.append(Disc("shank", tool.shank_diameter / 2 + clear.shank, tool.neck_length))
    z = tool.stickout
    for seg in tool.holder:
        n = 1 if abs(seg.diameter - seg.diameter_top) < 1e-9 else FRUSTUM_SLICES
        for k in range(n):
            a = seg.diameter + (seg.diameter_top - seg.diameter) * k / n
            b = seg.diameter + (seg.diameter_top - seg.diameter) * (k + 1) / n
            out.append(Disc("holder", max(a, b) / 2 + clear.holder, z + seg.length * k / n))
        z += seg.length
    return tuple(d for d in out if d.radius > tool.widest_radius + 1e-9)
