"""Runs the moves through the stock and collects contacts, with the stock model that suits their tool axes.

Arrays of coordinates are float64, mm, in the setup frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, TriangleMesh
from geometry.tool_body import ToolBody
from verify.blank.blank import stands_over_air
from verify.checks.clear_height import top_of_all
from verify.kernels.stock import FIXTURE, HOLDER, NECK, PLUNGE, SHANK
from verify.kernels.tables import RapidArrays
from verify.material.collision import fixture_points, run_clashes
from verify.material.dogleg_rapids import spread
from verify.material.fixture_contact import fixture_contacts
from verify.material.loose_stock import LoosePiece, loose_lines, loose_nodes
from verify.material.stock_field import DistanceField, run_field, stock_field
from verify.material.stock_lines import blank, run_bodies, run_stock
from verify.material.stock_pass import StockPass, Ways, end_radii, parts, rapid_arrays
from verify.model import ProofSetup
from verify.moves import Moves
from verify.progress import Report, StageProgress
from verify.tool_axes import ToolAxes

LINES_APART, NODES_APART = 0.7, 0.6  # radii of the finest end between lines, and between nodes


@dataclass(frozen=True, eq=False)
class MaterialContacts:
    """Result of one pass over the stock and the points of the part.

    run     : StockPass; its events include those of the part, the deeper first
    spacing : mm between the lines or nodes of the stock
    upright : whether the stock was a field of vertical lines
    loose   : pieces of the stock that the moves cut off from what is held
    """

    run: StockPass
    spacing: float
    upright: bool
    loose: Sequence[LoosePiece]


def contacts(mesh: TriangleMesh, points: F64, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup,
             slides: F64 | None, threads: int, progress: Callable[[float], None]) -> MaterialContacts:
    """Run all moves through the stock and past the part.

    mesh   : of the part, mm, setup frame
    points : (n, 3) float64, mm, setup frame, of the part; necks, shanks and holders are checked against them
    slides : (m, 3, 3) float64, dimensionless, directions of the linear axes for each move, setup frame, or None; used
             only where rapids are doglegs (``verify.material.dogleg_rapids``)

    Tools along Z use vertical lines of one height (``verify.material.stock_lines``) [VanHook1986]. Tilted tools, and
    flutes that cut below overhangs, use a field of distances (``verify.material.stock_field``).
    """
    stages, given, origin = StageProgress(progress), moves, None
    spacing = stock_spacing(setup, moves, tools)
    if setup.dogleg:
        moves, origin = spread(moves, slides, *dogleg_limits(mesh, moves, tools, setup))
    upright, dug = moves.axes is None, np.zeros((0, 7))
    if upright:
        run, spacing, loose = _lines(mesh, spacing, moves, tools, setup, threads, stages.span(0.0, 0.6))
        upright = not _undercuts(run, moves, setup)
        dug = dug if upright else run.events[run.events[:, 1] == PLUNGE]  # lines know plunges better than the field
        moves = moves if upright else replace(moves, axes=ToolAxes.upright(len(moves)))
    held = fixture_points(setup, mesh.bounds, moves, tools)
    if upright:
        met, lost = run_bodies(points, moves, tools, setup, threads=threads, progress=stages.span(0.6, 0.8))
        met, lost = _with_points(met, lost, points, ~moves.feed, False, moves, tools, setup, threads)
        stages.tell(0.9)
        met, lost = _with_points(met, lost, held, np.ones(len(moves), np.bool_), True, moves, tools, setup, threads)
    else:
        field = stock_field(mesh, setup, stock_spacing(setup, moves, tools), threads=threads,
                            progress=stages.span(0.0, 0.15))
        run = run_field(field, moves, tools, setup, threads=threads, progress=stages.span(0.15, 0.7))
        loose = loose_nodes(field, mesh, setup)
        fixed = np.repeat([False, True], [len(points), len(held)])
        met, lost = run_clashes(np.concatenate([points, held]), fixed, moves, tools, setup, threads=threads,
                                progress=stages.span(0.7, 1.0))
        known = (run.events[:, 1] == PLUNGE) & np.isin(run.events[:, 0], dug[:, 0])
        run = replace(run, events=np.concatenate([run.events[~known], dug]))
        spacing = field.step
    met = np.concatenate([met, fixture_contacts(moves, tools, setup, mesh.bounds, rapid_arrays(moves, setup))])
    return MaterialContacts(_of_origin(_merge(run.events, met), run, lost, origin, moves, given, tools),
                    spacing, upright, loose)


def _lines(mesh: TriangleMesh, spacing: float, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup,
           threads: int, progress: Report) -> tuple[StockPass, float, list[LoosePiece]]:
    """The pass over lines of one height, mm between them, and the loose pieces of what stands after it."""
    stages = StageProgress(progress)
    lines = blank(mesh, spacing, setup, threads=threads, progress=stages.span(0.0, 0.2))
    run = run_stock(lines, moves, tools, setup, threads=threads, progress=stages.span(0.2, 1.0))
    return run, lines.step, loose_lines(lines, mesh, setup)


def _undercuts(run: StockPass, moves: Moves, setup: ProofSetup) -> bool:
    """Whether flutes cut below stock or part without contact of a body above them; lines of one height cannot show it.

    A box or an upright cylinder has no overhang until a feed move cuts it from below.
    """
    if run.under is None:
        return False
    under = run.under if stands_over_air(setup) else run.under & moves.feed
    met = run.events[(run.events[:, 2] > run.events[:, 3]) & np.isin(run.events[:, 1] % FIXTURE, (NECK, SHANK, HOLDER))]
    under[met[:, 0].astype(np.int64)] = False
    return bool(under.any())


def stock_spacing(setup: ProofSetup, moves: Moves, tools: Sequence[ToolBody]) -> float:
    """Distance between lines or nodes of the stock, mm: that of the setup, or less for the thinnest cutting end.

    A square lattice has a line in every circle of radius 1 / sqrt 2 of its spacing. Lines are twice as close, and nodes
    closer still, since an end may come down on rest material that is narrower than itself. An end with a narrow tip
    counts as half its radius. A line stands in every core that does not cut. A tool that only goes at rapid counts with
    its clearance.
    """
    fed = np.unique(moves.tool[moves.feed])
    carried = min((tools[k].radius + setup.clearance_rapid for k in np.setdiff1d(moves.tool, fed)), default=np.inf)
    used = [tools[k] for k in fed]
    wide = np.maximum(end_radii(used, setup.tap_holes),
                      [0.5 * t.radius if t.cone_height > 0.0 else 0.0 for t in used])
    if moves.axes is not None:
        return min(setup.line_spacing, NODES_APART * float(wide.min(initial=carried)))
    core = np.array([setup.cores[t.number] for t in used if setup.cores.get(t.number, 0.0) > 0.0])
    return min(setup.line_spacing, LINES_APART * float(wide.min(initial=carried)),
               LINES_APART * float(core.min(initial=np.inf)))


def unseen(tools: Sequence[ToolBody], spacing: float, upright: bool) -> list[ToolBody]:
    """The tools whose end may come down between lines or nodes of the stock that are ``spacing`` mm apart."""
    min_radius = spacing / (LINES_APART if upright else NODES_APART) - 1e-9
    return [t for t, end in zip(tools, end_radii(tools).tolist(), strict=True) if end < min_radius and not t.cuts_down]


def unseen_cores(tools: Sequence[ToolBody], setup: ProofSetup, spacing: float, upright: bool) -> list[ToolBody]:
    """The tools whose core that does not cut may come down between lines, or at all where nodes do not judge it."""
    seen = spacing / LINES_APART - 1e-9 if upright else np.inf
    return [t for t in tools if 0.0 < setup.cores.get(t.number, 0.0) < seen]


def dogleg_limits(mesh: TriangleMesh, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup) -> tuple[F64, float]:
    """(m,) float64 tool radii, and the height above which a rapid of an upright tool meets nothing, mm."""
    radius = np.array([t.widest_radius for t in tools])[moves.tool] if len(moves) else np.zeros(0)
    return radius, top_of_all(mesh.bounds, setup) + setup.clearance_rapid


def _with_points(met: F64, lost: int, points: F64, chosen: NDArray[np.bool_], fixed: bool, moves: Moves,
                 tools: Sequence[ToolBody], setup: ProofSetup, threads: int) -> tuple[F64, int]:
    """Events and losses, with the contacts of the chosen moves at points of fixtures or part added."""
    rows, (free, room) = np.flatnonzero(chosen), rapid_arrays(moves, setup)
    more, away = run_clashes(points, np.full(len(points), fixed), moves.only(chosen), tools, setup, threads=threads,
                             rapids=RapidArrays(free[chosen], room[chosen]))
    more[:, 0] = rows[more[:, 0].astype(np.int64)]
    return np.concatenate([met, more]), lost + away


def _of_origin(events: F64, run: StockPass, lost: int, origin: NDArray[np.int64] | None, moves: Moves, given: Moves,
               tools: Sequence[ToolBody]) -> StockPass:
    """The pass in terms of the original moves, where some rapids were spread out."""
    if origin is None:
        return StockPass(events, run.lost + lost, run.cut, run.engaged, run.ways)
    events = events.copy()
    events[:, 0] = origin[events[:, 0].astype(np.int64)]
    cut = np.zeros(len(given), np.bool_)
    cut[origin[run.cut]] = True
    first, there = parts(moves, tools), parts(given, tools)
    engaged, of = np.zeros(there[-1], np.int64), np.repeat(np.arange(len(moves)), np.diff(first))
    part = there[origin[of]] + (np.arange(len(of)) - first[of]) * moves.feed[of]
    np.bitwise_or.at(engaged, part, run.engaged)
    volume, depth = np.zeros(there[-1]), np.zeros(there[-1])
    np.add.at(volume, part, run.ways.volume)
    np.maximum.at(depth, part, run.ways.depth)
    return StockPass(events, run.lost + lost, cut, engaged, Ways(volume, depth))


def machined(mesh: TriangleMesh, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup, step: float, *,
             box: F64 | None = None, threads: int = 2,
             progress: Callable[[float], None] | None = None) -> DistanceField:
    """The stock after all feed moves.

    step : mm between nodes, wider where that needs over 24 million nodes
    box  : (2, 3) float64, mm, setup frame, region of interest, made a few steps wider; all of the stock where None
    progress : called with 0..1, never less than before; an exception from it ends the work at once
    """
    stages = StageProgress(progress)
    field = stock_field(mesh, setup, step, box=box, threads=threads, progress=stages.span(0.0, 0.2))
    run_field(field, moves.only(moves.feed), tools, setup, bare=True, threads=threads, progress=stages.span(0.2, 1.0))
    return field


def _merge(a: F64, b: F64) -> F64:
    """Events of both passes, the deeper first where both have the same body in the same move."""
    events = np.concatenate([a, b])
    order = np.lexsort((events[:, 6], events[:, 5], events[:, 4], -events[:, 2], events[:, 1], events[:, 0]))
    return np.asarray(events[order])
