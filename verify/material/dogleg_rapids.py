"""Rapids of machines that run each linear axis at its own speed: the whole box of the move, as sweeps that fill it.

The path through the box depends on unknown rates and accelerations, so the whole box between both ends must be clear.
Sweeps along its longest side fill it, a quarter of the tool radius apart: between them a cylinder misses 1/128 of its
radius at the sides of the box, and a ball as much below. A box that needs over 20 000 sweeps is a finding instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from verify.findings import Source
from verify.model import Finding, FindingKind
from verify.moves import Moves
from verify.tool_axes import ToolAxes

STILL = 1e-9
SHARE = 4.0
MAX_SWEEPS = 20_000


def spread(moves: Moves, slides: F64 | None, radius: F64, clear: float) -> tuple[Moves, NDArray[np.int64]]:
    """Rapids in several linear axes as sweeps through their box.

    moves  : of a machine with doglegs
    slides : (m, 3, 3) float64, dimensionless, rows: directions of the linear axes in the frame of the part; None: along
             the frame
    radius : (m,) float64, mm, tool radius of each move
    clear  : mm, height above which a rapid of an upright tool meets nothing and stays as it is

    Returns
    -------
    The moves with each such rapid replaced, and (k,) int64, index, the original move of each of them.

    Notes
    -----
    Rapids that turn the tool stay as they are, and so do boxes of too many sweeps (``box_findings``). Sweeps never go
    up the tool axis, so none counts as a lift.
    """
    boxed, parts = _boxed(moves, slides, clear)
    chosen = np.flatnonzero(boxed & (_sweep_counts(parts, radius) <= MAX_SWEEPS))
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
                 moves.feed[rows], moves.tool[rows], axes, None if moves.stray is None else moves.stray[rows]), rows


def box_findings(moves: Moves, slides: F64 | None, radius: F64, clear: float, source: Source) -> list[Finding]:
    """Findings of rapids whose box needs too many sweeps.

    slides : (m, 3, 3) float64, dimensionless, directions of the linear axes in the frame of the part, or None
    radius : (m,) float64, mm, tool radius of each move
    clear  : mm, as for ``spread``
    """
    boxed, parts = _boxed(moves, slides, clear)
    counts = _sweep_counts(parts, radius)
    return [Finding(FindingKind.RAPID, source.names[source.program[m]], int(source.line[m]), None, None,
                    tuple(round(float(v), 6) for v in moves.end[m]), 0.0, 0.0,  # type: ignore[arg-type]
                    f"T{source.tool[m]}: the box of this rapid ({np.abs(parts[m]).max():.0f} mm long, rapid_motion "
                    "dogleg) is too large to be checked for so thin a tool: move Z alone, or X and Y alone")
            for m in np.flatnonzero(boxed & (counts > MAX_SWEEPS)).tolist()]


def _boxed(moves: Moves, slides: F64 | None, clear: float) -> tuple[NDArray[np.bool_], F64]:
    """(m,) rapids in several linear axes that may meet something, and (m, 3) mm, the travel of each axis."""
    d = moves.end - moves.start
    parts = d if slides is None else np.einsum("mij,mj->mi", slides, d)
    several = (np.abs(parts) > STILL).sum(axis=1) > 1
    low = np.minimum(moves.start[:, 2], moves.end[:, 2]) < clear
    if moves.axes is not None:
        several &= moves.axes.angle == 0.0
        low |= moves.axes.axis[:, 2] < 1.0 - 1e-12
    return np.asarray(~moves.feed & several & low), np.asarray(parts)


def _sweep_counts(parts: F64, radius: F64) -> F64:
    """(m,) number of sweeps that fill each box: rows across its two shorter sides."""
    rows = 1.0 + np.ceil(np.sort(np.abs(parts), axis=1)[:, :2] * SHARE / radius[:, None])
    return np.asarray(rows.prod(axis=1))


def _sweeps(start: F64, parts: F64, basis: F64, axis: F64, apart: float) -> tuple[F64, F64]:
    """Starts and ends (k, 3), mm, of sweeps along the longest side of one box, not up ``axis``."""
    along = int(np.argmax(np.abs(parts)))
    u, v = (c for c in range(3) if c != along)
    steps = [np.linspace(0.0, parts[c], 1 + int(np.ceil(abs(parts[c]) / apart))) for c in (u, v)]
    p, q = (x.reshape(-1, 1) for x in np.meshgrid(*steps, indexing="ij"))
    a = start + p * basis[u] + q * basis[v]
    b = a + parts[along] * basis[along]
    return (b, a) if parts[along] * float(basis[along] @ axis) > 0.0 else (a, b)
