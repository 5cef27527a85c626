"""Engaged angle of cutters: by tool, and findings where it is above a limit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.findings import Source, chains, worst_of
from verify.kernels.engaged import FRONT, window_angles
from verify.material.stock_pass import parts
from verify.model import Engagement, Finding, FindingKind
from verify.moves import Moves
from verify.tool_axes import sector_frames

RESOLUTION = 2 * math.pi / FRONT
"""rad, width of a sector; the sectors at both ends of an engaged arc count whole."""


def in_parts(moves: Moves, tools: Sequence[ToolBody]) -> tuple[Moves, NDArray[np.int64]]:
    """Split moves into the parts of ``verify.material.stock_pass.parts``.

    Returns the p parts as moves, in mm, and (p,) int64, index, the original move of each.
    """
    first = parts(moves, tools)
    count = np.diff(first)
    of = np.repeat(np.arange(len(moves)), count)
    share = (np.arange(len(of)) - first[of]) / count[of]
    start, way = moves.start[of], moves.end[of] - moves.start[of]
    ends = (share + 1.0 / count[of])[:, None]
    return Moves(start + share[:, None] * way, start + ends * way, moves.feed[of], moves.tool[of],
                 None if moves.axes is None else moves.axes.only(of)), of


def engaged_angles(bits: NDArray[np.int64], moves: Moves, tools: Sequence[ToolBody]) -> F64:
    """Engaged angle of each part of a move.

    bits : (m,) int64, dimensionless, a bit for each sector as ``StockPass.engaged``

    Returns (m,) float64, rad, 0 to pi.
    """
    start, end = np.ascontiguousarray(moves.start), np.ascontiguousarray(moves.end)
    radius = np.array([t.radius for t in tools])
    return np.asarray(window_angles(bits, start, end, *sector_frames(moves.axes, len(moves)), moves.tool, moves.feed,
                                    radius))


def engagements(angle: F64, moves: Moves, tools: Sequence[ToolBody]) -> dict[int, Engagement]:
    """Largest engaged angle of each tool in stock, and the 99th percentile over its path in stock, by T number.

    angle : (m,) float64, rad, as ``engaged_angles``
    """
    length, out = np.linalg.norm(moves.end - moves.start, axis=1), {}
    for k, tool in enumerate(tools):
        own = np.flatnonzero((moves.tool == k) & (angle > 0.0))
        if len(own) == 0:
            continue
        order = own[np.argsort(angle[own], kind="stable")]
        way = np.cumsum(length[order])
        out[tool.number] = Engagement(float(angle[order[-1]]),
                                      float(angle[order[int(np.searchsorted(way, 0.99 * way[-1]))]]))
    return out


def engagement_findings(angle: F64, moves: Moves, of: NDArray[np.int64], source: Source,
                        limits: Mapping[int, float]) -> list[Finding]:
    """Findings where the engaged angle is above the limit of the tool, by neighbouring lines.

    angle     : (m,) float64, rad, as ``engaged_angles``
    moves, of : parts of moves and their original moves, (m,) int64, index, as ``in_parts``
    limits    : rad by T number

    Angles are known to ``RESOLUTION``, so a finding needs more than the limit plus ``RESOLUTION``.
    """
    source = Source(source.names, source.program[of], source.line[of], source.tool[of])
    limit = np.array([limits.get(int(t), math.inf) for t in source.tool.tolist()])
    bad = np.flatnonzero(angle > limit + RESOLUTION)
    out = []
    groups = chains(source.program[bad], source.line[bad], moves.end[bad], source.tool[bad])
    for rows in worst_of(groups, angle[bad]):
        m = int(bad[rows[0]])
        lines = source.line[bad[rows]]
        x, y, z = (round(float(v), 6) for v in moves.end[m])
        span = "" if lines.min() == lines.max() else f", lines {lines.min()} to {lines.max()}"
        out.append(Finding(FindingKind.ENGAGEMENT, source.names[source.program[m]], int(source.line[m]), None, None,
                           (x, y, z), float(math.degrees(angle[m] - limit[m])), float(math.degrees(limit[m])),
                           f"T{source.tool[m]}: engaged angle {math.degrees(angle[m]):.0f} deg (limit "
                           f"{math.degrees(limit[m]):.0f} deg){span}", len(rows), tip=(x, y, z)))
    return out
