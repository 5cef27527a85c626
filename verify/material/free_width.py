"""How wide a holder may be where the setup names none. Lengths are mm, in the setup frame."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from geometry.mesh import TriangleMesh
from geometry.tool_body import ToolBody
from verify.kernels.free_width import free_widths
from verify.material.stock_lines import blank
from verify.model import ProofSetup
from verify.moves import Moves, cutter_table

SPACING = 0.25  # mm between the lines, wider where that needs over MAX_LINES
MAX_LINES = 400_000
LARGEST = 100.0  # mm, radius that is looked at


def free_holder_width(mesh: TriangleMesh, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup,
                      threads: int) -> dict[int, tuple[float, int]]:
    """Diameter that is free above the stickout of each tool without a holder, by its place in ``tools``.

    mesh  : of the part
    moves : of upright tools

    Returns the diameter, mm, 200 where no more was looked at, and the move (index, -1 for none) that allows no more.
    Part, stock in process and fixtures count. It is too small by up to 1.5 spacings of the lines, 0.35 mm on parts of
    up to 25,000 mm², and never too large for anything that is wider than a spacing.
    """
    size = mesh.bounds[1, :2] - mesh.bounds[0, :2] + 2.0 * (setup.margin + setup.uncertainty)
    lines = blank(mesh, max(SPACING, math.sqrt(float(size.prod()) / MAX_LINES)), setup, threads=threads)
    bare = [t.number > 0 and not t.holder for t in tools]
    stickouts = np.where(bare, [max(t.stickout, t.flute_length) for t in tools], np.nan)
    least, where = np.full(len(tools), LARGEST), np.full(len(tools), -1, np.int64)
    boxes = np.array([np.asarray(f, dtype=np.float64) for f in setup.fixtures]).reshape(-1, 2, 3)
    free_widths(lines.height, lines.origin, lines.step, moves.arrays, cutter_table(tools), stickouts, boxes, least,
                where)
    aside = math.sqrt(0.5) * lines.step  # what stands may begin so much before its first line
    return {k: (2.0 * max(float(least[k]) - (aside if where[k] >= 0 else 0.0), 0.0), int(where[k]))
            for k in np.flatnonzero(bare).tolist()}


__all__ = ["LARGEST", "free_holder_width"]
