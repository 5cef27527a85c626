"""Plunges of ends, and of cores that do not cut, that may come down between the lines or nodes of the stock.

A ray goes up the axis from where the tip of each steep descent ends. What the moves before it have left on that ray is
exact, so no spacing matters. Coordinates are float64, mm, in the setup frame.

Notation: s is the skin of a tool, the depth that a steep descent may take off; e is the depth that ramps could have
earned meanwhile. Straight down the skin of a tool that does not cut to its centre is what its core may press.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.blank.blank import stock_on_normals
from verify.kernels.stock import PLUNGE, ROUNDING
from verify.material.stock_pass import descents, hollow_ends
from verify.model import ProofSetup
from verify.moves import Moves
from verify.surface.removal import first_below

SKINS = 3.0  # skins of stock over an end that many small steps may not take off together
HALVINGS = 12  # of the stock over an end: its depth is known to 1/4096 of it
INT = NDArray[np.int64]


def fine_plunges(moves: Moves, tools: Sequence[ToolBody], fine: Sequence[ToolBody], bounds: F64, setup: ProofSetup,
                 threads: int = 2, hollow: Sequence[ToolBody] = ()) -> F64:
    """Plunges along the middle of the axis of fine tools.

    tools  : those that ``Moves.tool`` refers to; fine : the ones that are looked at
    bounds : (2, 3) float64, mm, of the part, setup frame
    hollow : those that are looked at where they go straight down only

    Returns (e, 7) float64, mm, rows of ``verify.material.stock_pass.StockPass.events``.

    Notes
    -----
    A descent is a plunge where it is the first move that leaves less than s over its end. Small steps are one too, if a
    steep descent was the first to leave less than 3 s there, and ramps could have earned less than 2 s since.
    """
    steep, earned = descents(moves, tools, setup)
    rows = np.flatnonzero(steep & np.isin(moves.tool, [k for k, t in enumerate(tools) if t in fine or t in hollow]))
    if not len(rows):
        return np.zeros((0, 7))
    up = np.tile([0.0, 0.0, 1.0], (len(moves), 1)) if moves.axes is None else np.asarray(moves.axes.middle)
    straight = np.linalg.norm(np.cross(moves.end[rows] - moves.start[rows], up[rows]), axis=1) <= ROUNDING
    rows, straight = (v[straight | np.isin(moves.tool[rows], [k for k, t in enumerate(tools) if t in fine])]
                      for v in (rows, straight))
    tip, up, which = moves.end[rows], up[rows], moves.tool[rows]
    core, _, pressed, _ = hollow_ends(tools, setup)[which].T
    skin = setup.plunge_skin * np.array([t.diameter for t in tools])[which]
    skin = np.where(straight & (core > 0.0), np.minimum(skin, pressed), skin)
    over = stock_on_normals(tip, up, bounds, setup, np.inf)

    def first(some: INT, level: F64) -> INT:
        return first_below(tip[some], up[some], level, moves, tools, threads=threads).astype(np.int64)

    dug = np.zeros(len(rows))
    high = np.flatnonzero(over > skin)
    at_once = high[first(high, skin[high]) == rows[high]]
    low, top = skin[at_once], over[at_once]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + top)
        whole = first(at_once, middle) == rows[at_once]
        low, top = np.where(whole, middle, low), np.where(whole, top, middle)
    dug[at_once] = low
    higher = np.setdiff1d(high[over[high] > SKINS * skin[high]], at_once)
    began = first(higher, SKINS * skin[higher])
    steps = (began >= 0) & (began <= rows[higher])
    steps &= steep[began] & (moves.tool[began] == moves.tool[rows[higher]])
    steps &= earned[rows[higher]] - earned[began] < (SKINS - 1.0) * skin[higher]
    dug[higher[steps]] = SKINS * skin[higher[steps]]
    found = np.flatnonzero(dug > 0.0)
    return np.column_stack([rows[found], np.full(len(found), PLUNGE), dug[found], np.zeros(len(found)), tip[found]])


__all__ = ["fine_plunges"]
