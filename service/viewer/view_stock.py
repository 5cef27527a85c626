"""The stock for a page: the field of the proof on a coarse grid, from the blank on, as changes in each stretch of time.

The cuts of the proof make it, so it is right for tilted and turning tools and for several accesses on one blank.
Between two states the page cuts the same grid with the tool along the track that it draws.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry.part import Part
from geometry.tool_body import ToolBody
from service.stages.access_plan import ProofFrame
from service.viewer.view_file import Chunk, Column
from verify.checks.program_sequence import FramedProgram
from verify.material.machined_part import LEVELS, stock_in_time
from verify.model import ProofSetup

NODES, STRETCHES = 200_000, 32


def stock_chunk(read: Sequence[FramedProgram], part: Part, tools: Sequence[ToolBody], setup: ProofSetup,
                frame: ProofFrame, *,
                open_: bool) -> Chunk:
    """Blank, part and the changes as a chunk of kind 'field'.

    read  : the programs
    part, tools, setup : as the proof took them
    frame : of the proof and of the grid
    open_ : whether the program may be shown; else seconds are whole

    Raises
    ------
    CamError
        As ``verify.material.machined_part.stock_in_time``.
    """
    stock = stock_in_time(read, part, tools, setup, stretches=STRETCHES, nodes=NODES)
    ended = 1000.0 * (stock.ended if open_ else np.rint(stock.ended))
    about = {"lod": 1, "rotation": [round(v, 9) for v in frame.rotation.ravel().tolist()],
             "origin_mm": [round(v, 6) for v in stock.origin.tolist()], "step_mm": round(stock.step, 6),
             "shape": list(stock.first.shape), "levels": LEVELS}
    return Chunk("field", about, {
        "first": Column(stock.first.ravel(), 1, "signed"), "part": Column(stock.part.ravel(), 1, "signed"),
        "ended": Column(np.rint(ended), 4, "steps"), "begins": Column(stock.begins, 4, "steps"),
        "node": Column(stock.node, 4, "steps"), "value": Column(stock.value, 1, "signed")})


__all__ = ["stock_chunk"]
