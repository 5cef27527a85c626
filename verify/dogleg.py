"""Rapids of machines that run each linear axis at its own speed: the whole box of the move, as sweeps that fill it.

Which way through the box such a machine takes depends on rates and accelerations nobody states, so everything between
both ends along the linear axes must be clear. The box is filled with sweeps along its longest side. Between sweeps an
eighth of the tool radius apart, a cylinder misses 1/512 of its radius at the sides of the box and a ball as much below.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from verify.removal import Moves
from verify.toolaxes import ToolAxes

STILL = 1e-9
SHARE = 8.0
MOST = 60


def spread(moves: Moves, slides: F64 | None, radius: F64, clear: float) -> tuple[Moves, NDArray[np.int64]]:
    """Rapids in several linear axes as sweeps through their box.

    moves  : of a machine with doglegs
    slides : (m, 3, 3) float64, rows: where the linear axes of the machine point on the part; None: along the frame
    radius : (m,) float64, mm, of the tool of each move
    clear  : mm, a rapid of an upright tool that stays above it meets nothing and is left as it is

    Returns
    -------
    The moves with each such rapid replaced, and (k,) int64, which move each of them comes from.

    Notes
    -----
    Rapids that turn the tool are left as they are. Sweeps never go up the tool, so none is taken for a lift.
    At most 60 x 60 of them fill a box, so beyond 7.5 tool radii they are wider apart.
    """
    d = moves.end - moves.start
    parts = d if slides is None else np.einsum("mij,mj->mi", slides, d)
    several = (np.abs(parts) > STILL).sum(axis=1) > 1
    low = np.minimum(moves.start[:, 2], moves.end[:, 2]) < clear
    if moves.axes is not None:
        several &= moves.axes.angle == 0.0
        low |= moves.axes.axis[:, 2] < 1.0 - 1e-12
    chosen = np.flatnonzero(~moves.feed & several & low)
    if len(chosen) == 0:
        return moves, np.arange(len(moves), dtype=np.int64)
    starts, ends, origin = [], [], []
    for m in chosen.tolist():
        basis = np.eye(3) if slides is None else slides[m]
        axis = np.array([0.0, 0.0, 1.0]) if moves.axes is None else moves.axes.axis[m]
        a, b = _sweeps(moves.start[m], parts[m], basis, axis, float(radius[m]) / SHARE)
        starts.append(a)
        ends.append(b)
        origin.append(np.full(len(a), m))
    rest = np.setdiff1d(np.arange(len(moves)), chosen)
    rows = np.concatenate([rest, *origin])
    order = np.argsort(rows, kind="stable")
    rows = rows[order]
    axes = moves.axes
    if axes is not None:
        axes = ToolAxes(axes.axis[rows], axes.about[rows], axes.angle[rows])
    return Moves(np.concatenate([moves.start[rest], *starts])[order], np.concatenate([moves.end[rest], *ends])[order],
                 moves.feed[rows], moves.tool[rows], axes), rows


def _sweeps(start: F64, parts: F64, basis: F64, axis: F64, apart: float) -> tuple[F64, F64]:
    """Starts and ends (k, 3), mm, of sweeps along the longest side of one box, not up ``axis``."""
    along = int(np.argmax(np.abs(parts)))
    u, v = (c for c in range(3) if c != along)
    steps = [np.linspace(0.0, parts[c], 1 + min(MOST, int(np.ceil(abs(parts[c]) / apart)))) for c in (u, v)]
    p, q = (x.reshape(-1, 1) for x in np.meshgrid(*steps, indexing="ij"))
    a = start + p * basis[u] + q * basis[v]
    b = a + parts[along] * basis[along]
    return (b, a) if parts[along] * float(basis[along] @ axis) > 0.0 else (a, b)
