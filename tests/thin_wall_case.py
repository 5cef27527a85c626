"""A plate with a wall twenty times as high as thick, and programs for it that differ in the order of their cuts."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from geometry.part import Part
from geometry.sampling import sample_surface
from geometry.tool_body import ToolBody
from tests.hand_parts import as_part, terraces
from verify.model import ProofSetup, ScoredSamples

THICK, FOOT, TOP = 0.5, 2.0, 12.0
LEFT, RIGHT = 6.0, 6.5  # X of its sides
TOOL = ToolBody("T1", 1, 4.0, 0.0, 12.0, 3.8, 20.0, 6.0, 40.0)
SETUP = ProofSetup(stock_kind="box", margin=0.5, uncertainty=0.0, rapid_feed=5000.0)
ZONES = ("Z1", "Z2")
Cut = tuple[str, float, float]
"""A side, 'left' or 'right', the height it is cut down to, and what is left on the wall, mm."""


def wall_part(rib: bool = False) -> Part:
    """The plate 12.5 x 16 x 2 with its wall 10 mm high; with a rib on its right side in the middle, or without."""
    row = [FOOT, TOP, FOOT]
    return as_part(terraces([0, LEFT, RIGHT, 12.5], [0, 7, 9, 16], [row, [FOOT, TOP, TOP if rib else FOOT], row]))


def scored(part: Part) -> ScoredSamples:
    """The left side is zone 1, the right one zone 2."""
    s = sample_surface(part.mesh, 100.0, seed=5)
    upright = np.abs(s.normals[:, 0]) > 0.9
    left, right = (upright & (np.abs(s.points[:, 0] - x) < 1e-9) for x in (LEFT, RIGHT))
    return ScoredSamples(s, np.where(left, 1, np.where(right, 2, 0)).astype(np.int32))


def whole(side: str, left: float = 0.0, step: float = 1.0, top: float = TOP, bottom: float = FOOT) -> list[Cut]:
    """One side from ``top`` to ``bottom``."""
    return [(side, z, left) for z in np.arange(top - step, bottom - 1e-9, -step).tolist()]


def in_turn(depth: float, left: float = 0.0) -> list[Cut]:
    """Both sides, by bands of ``depth``."""
    out: list[Cut] = []
    for top in np.arange(TOP, FOOT + 1e-9, -depth).tolist():
        bottom = max(top - depth, FOOT)
        out += [*whole("left", left, top=top, bottom=bottom), *whole("right", left, top=top, bottom=bottom)]
    return out


def program(cuts: Iterable[Cut]) -> str:
    """The top of the wall, then the cuts, each in two passes along Y that come from air."""
    out = ["%", "G21 G90 G17 G94 G40 G49 G54 G61",
           "T1 M6", "S8000 M3", "G0 G43 H1 Z20", "X6.25 Y-4", "G1 Z12 F800", "Y20",
           "G0 Z20"]
    for side, z, left in cuts:
        x, away = (LEFT - 2.0 - left, -3.4) if side == "left" else (RIGHT + 2.0 + left, 3.4)
        for at in (x, x + away):
            out += [f"(cut {side} {z:g})", f"G0 X{at:g} Y-4", f"G1 Z{z:g} F800", "Y20", "G0 Z20"]
    return "\n".join([*out, "M5", "M30", "%"]) + "\n"
