"""Programs, and tools of programs, whose feed moves take nothing off: wrong zero, unit or tool length.

Arrays are float64, mm or dimensionless for directions, in the frame of the proof.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.mesh_queries.nearest import nearest
from geometry.sampling import SurfaceSamples
from geometry.tool_body import ToolBody
from verify.findings import Source
from verify.material.stock_pass import along_axis
from verify.model import Asked, Finding, FindingKind
from verify.moves import Moves
from verify.surface.guard_points import convex_edges
from verify.surface.removal import residual_on_normals
from verify.work.asked_faces import OFF_FACETS, Cutting, thinned

MAX_RAYS = 100_000  # samples that a tool is looked for at; and as many places on edges, and of its tip
SAME_AXIS = 1e-4  # of the coordinates of a unit vector: closer axes are one
BOOL = NDArray[np.bool_]


def idle_programs(names: Sequence[str], cut: BOOL, moves: Moves, source: Source, fine: Sequence[ToolBody],
                  asked: Asked | None) -> list[Finding]:
    """Programs whose feed moves never meet the stock: wrong zero, or inch for mm.

    names : of the programs, in the order they run
    cut   : (m,) bool, moves that remove stock
    fine  : tools so thin that the stock model may not show their cuts
    asked : the work to do; where no program does any, that is a kind of its own
    """
    kind = FindingKind.PROGRAM if asked is None or cut.any() else FindingKind.NOTHING_CUT
    out, traceless = [], np.isin(source.tool, [t.number for t in fine])
    for number, name in enumerate(names):
        own = (source.program == number) & moves.feed
        if own.any() and not cut[own].any() and not traceless[own].all():
            m = int(np.flatnonzero(own)[0])
            out.append(Finding(kind, name, int(source.line[m]), None, None, None, 0.0, 0.0,
                               "no feed move meets the stock: check the unit, the program zero and the tool"))
    return out


def idle_tools(cut: BOOL, speed: F64, zeros: NDArray[np.int64], source: Source, samples: SurfaceSamples, within: float,
               cutting: Cutting, fine: Sequence[ToolBody]) -> list[Finding]:
    """Tools that feed in air from beginning to end, in programs whose other tools cut: a wrong length, as a rule.

    cut     : (m,) bool, moves that remove stock
    speed   : (m,) float64, 1/min, of the spindle, 0 where it stands
    zeros   : (m,) int64, dimensionless, number of the coordinates that each move counts in
    samples : SurfaceSamples of the part
    within  : mm; a tool that comes so near to part or stock passes over finished ground
    fine    : tools so thin that the stock model may not show their cuts

    Notes
    -----
    A tool with the spindle standing is no cutter (a probe), nor is one that only comes down and leaves aside. Taps and
    thread mills work in walls that the part shows with or without the thread: their radius is added to ``within``.

    Of a tool that does cut, two kinds of moves are looked at by themselves. Where it never turns in a feed move: those
    along each of its axes, as without tool centre point control a head carries it past the part. And those in
    each of the shifts and frames of the program, which may lie elsewhere; there a layer above the stock may count
    down to it, so a diameter is added to ``within``.
    """
    moves, out, traceless = cutting.moves, list[Finding](), {t.number for t in fine}
    works = _works(moves, cutting.tools) & (speed > 0.0)
    for number, name in enumerate(source.names):
        mine = source.program == number
        if not cut[mine].any():
            continue  # the program as a whole is told
        for k in np.unique(moves.tool[mine & works]).tolist():
            tool, own = cutting.tools[k], mine & moves.feed & (moves.tool == k)
            if tool.number in traceless:
                continue
            room = within + (tool.radius if tool.kind in ("tap", "thread_mill") else 0.0)
            for part in _parts(own, moves, zeros) if cut[own].any() else [_Part(own, "", "the length of the tool")]:
                far = room + tool.diameter if part.shifted else room
                if cut[part.moves].any() or not (part.moves & works).any() or _comes_near(part.moves, samples, far,
                                                                                          cutting):
                    continue
                lines = source.line[part.moves]
                out.append(Finding(FindingKind.NOTHING_CUT, name, int(lines.min()), None, None, None, 0.0, 0.0,
                                   f"T{tool.number}: no feed move{part.where} meets part or stock, lines {lines.min()} "
                                   f"to {lines.max()}: check {part.check}", int(part.moves.sum())))
    return out


class _Part(NamedTuple):
    """Feed moves of a tool, (m,) bool: where they are, in words, what to check, and whether their zero is shifted."""

    moves: BOOL
    where: str
    check: str
    shifted: bool = False


def _parts(own: BOOL, moves: Moves, zeros: NDArray[np.int64]) -> list[_Part]:
    """The feed moves ``own`` (m,) bool of a tool by its axis, where it turns in none, else by their coordinates."""
    rows, out = np.flatnonzero(own), []
    if moves.axes is not None and moves.axes.angle[rows].max() <= 0.0:
        axes, of = np.unique(np.round(moves.axes.axis[rows] / SAME_AXIS), axis=0, return_inverse=True)
        for k, axis in enumerate(axes * SAME_AXIS if len(axes) > 1 else ()):
            way = ", ".join(f"{v + 0.0:.3g}" for v in axis)
            out.append(_Part(_only(own, rows[of.ravel() == k]), f" along the axis ({way})",
                             "rotary axes, pivots and tool centre point control"))
    if not out:
        numbers = np.unique(zeros[rows])
        out = [_Part(_only(own, rows[zeros[rows] == k]), " in these shifted or turned coordinates", "shift and frame",
                     shifted=True) for k in numbers[numbers > 0]]
    return out


def _only(own: BOOL, rows: NDArray[np.int64]) -> BOOL:
    out = np.zeros(len(own), np.bool_)
    out[rows] = True
    return out


def _works(moves: Moves, tools: Sequence[ToolBody]) -> BOOL:
    """(m,) bool, feed moves that would cut: not up along the axis, and down along it only where the tool comes back
    up the same way, or is one that cuts along its axis."""
    if not len(moves):
        return np.zeros(0, np.bool_)
    rise, straight, linked = along_axis(moves)
    back = np.zeros(len(moves), np.bool_)
    back[:-1] = straight[1:] & linked[1:] & (rise[1:] > 0.0)
    drills = np.array([t.along_axis_only for t in tools])[moves.tool]
    return np.asarray(moves.feed & (~straight | ((rise < 0.0) & (back | drills))))


def _comes_near(own: BOOL, samples: SurfaceSamples, within: float, cutting: Cutting) -> bool:
    """Whether some moves come nearer than ``within`` mm to the part, or to the stock before the first of them.

    own : (m,) bool, the moves, all of one tool, none of which cuts
    """
    moves, mesh = cutting.moves, cutting.tree.mesh
    mine = moves.only(own)
    rows = thinned(np.arange(len(mine)), MAX_RAYS)
    tips = np.concatenate([mine.end[rows], 0.5 * (mine.start[rows] + mine.end[rows])])
    if (nearest(cutting.tree, tips, within)[0] < within).any():
        return True
    before = moves.only(np.arange(len(moves)) < np.flatnonzero(own)[0])
    edge, bisector, _ = convex_edges(mesh)
    for points, normals in ((samples.points, samples.normals), (edge, bisector)):
        some = thinned(np.arange(len(points)), MAX_RAYS)
        places, ways = points[some], normals[some]
        blank = np.minimum(*cutting.blank_on_rays(places, ways, cutting.farthest, OFF_FACETS))
        left, _ = residual_on_normals(places, ways, blank, before, cutting.tools, threads=cutting.threads)
        _, mover = residual_on_normals(places, ways, np.maximum(left, 0.0) + within, mine, cutting.tools,
                                       threads=cutting.threads)
        if (mover >= 0).any():
            return True
    return False


__all__ = ["idle_programs", "idle_tools"]
