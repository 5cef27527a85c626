"""Shared by all passes over the stock: moves that plunge or need no clearance, and tables of events.

Tables of events are float64 rows (move, code, depth, clearance, x, y, z), mm, in the setup frame.
"""

from __future__ import annotations

import math
import queue
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.kernels.clash import ASIDE
from verify.kernels.engaged import WINDOW
from verify.kernels.stock import UNITS
from verify.kernels.tables import ContactLimits, RapidArrays
from verify.model import ProofSetup
from verify.moves import Moves

EVENTS = 4096
ANOTHER_TOOL = 1e6  # mm
TAP_CORE = 0.75  # radii: what is nearer to the axis of a tap of unknown pitch, the hole must have taken
PRESSED = 0.01  # diameters: a hollow end takes a stub that high, straight down too
SAME = 1e-6  # mm, and rad: closer ends of moves and axes are the same
BESIDE = 5e-3  # mm: chords of two passes over one wall, and the decimals of their programs, differ by no more
UPRIGHT = 0.5 * math.pi - 1e-9  # rad: a ramp that goes straight down
Spare = queue.SimpleQueue[NDArray[np.int64]]


def descents(moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup,
             ways: WaysInCut | None = None) -> tuple[NDArray[np.bool_], F64]:
    """Feed moves that descend steeper than their tool may, and the depth that ramps could have removed so far.

    ways : of the moves; None: unknown, and then every way counts as if it were in the cut

    Down is along the tool axis, for a turning tool along its axis half way. Moves of tools that cut straight down do
    not count, nor those of mills that cut to their centre and whose ramp angle is a right angle.

    Returns
    -------
    steep  : (m,) bool
    earned : (m,) float64, mm: sideways travel in the cut of all feed moves so far that are not steep, times the
             tangent of the angle, but of each move no more than its depth of cut; a tool change adds ``ANOTHER_TOOL``

    Notes
    -----
    A part of a move (``parts``) is in the cut where it takes something off. So a nick at the end of a way in air counts
    with half a radius at most.
    """
    if not len(moves):
        return np.zeros(0, np.bool_), np.zeros(0)
    d = moves.end - moves.start
    angle = np.array([setup.ramp_angles.get(t.number, setup.ramp_angle) for t in tools])
    slope = np.tan(angle)[moves.tool]
    if moves.axes is None:
        rise, aside = d[:, 2], np.hypot(d[:, 0], d[:, 1])
    else:
        up = moves.axes.middle
        rise = np.einsum("ij,ij->i", d, up)
        aside = np.linalg.norm(d - rise[:, None] * up, axis=1)
    whole = np.array([t.number not in setup.cores for t in tools])  # cuts to its centre
    straight = np.array([t.cuts_down for t in tools]) | (whole & (angle >= UPRIGHT))
    steep = moves.feed & (-rise > aside * slope + 1e-9) & ~straight[moves.tool]
    pays = aside * slope
    if ways is not None:
        pays = np.minimum(aside * ways.share * slope, ways.depth)
    earned = np.cumsum(np.where(moves.feed & ~steep, pays, 0.0))
    changed = np.concatenate([[False], moves.tool[1:] != moves.tool[:-1]])
    return np.asarray(steep), np.asarray(earned + ANOTHER_TOOL * np.cumsum(changed))


def hollow_ends(tools: Sequence[ToolBody], setup: ProofSetup) -> F64:
    """What the end of each tool that does not cut to its centre may stand over.

    Returns (k, 4) float64, rows of ``verify.kernels.stock.HollowEnd``, mm and dimensionless; core 0 for a tool that
    cuts to its centre.

    Notes
    -----
    A ramp of the angle r that turns round passes 4 c before the ring round a core of radius c has come over each place
    that the core stood on, so the stub of a sound ramp is at most 4 c tan(r) high. Where the tips lie no more than e
    apart while the core stands on a place, a sound ramp leaves 2 e tan(r).
    """
    if not tools:
        return np.zeros((1, 4))
    radius = np.array([0.5 * setup.cores.get(t.number, 0.0) for t in tools])
    slope = np.tan([setup.ramp_angles.get(t.number, setup.ramp_angle) for t in tools])
    skin = PRESSED * np.array([t.diameter for t in tools])
    return np.column_stack([radius, 4.0 * radius * slope + skin, skin, slope])


def ways_before(moves: Moves) -> F64:
    """(m,) float64, mm: sideways travel of all upright feed moves before each move.

    Each rapid and each tool change adds ``ANOTHER_TOOL`` mm.
    """
    d = moves.end - moves.start
    cuts = ~moves.feed
    cuts[1:] |= moves.tool[1:] != moves.tool[:-1]
    aside = np.where(moves.feed, np.hypot(d[:, 0], d[:, 1]), 0.0)
    return np.asarray(np.cumsum(aside) - aside + ANOTHER_TOOL * np.cumsum(cuts))


def parts(moves: Moves, tools: Sequence[ToolBody]) -> NDArray[np.int64]:
    """(m + 1,) int64, index: first of the even parts of each move that engaged angles refer to; last, their number.

    Feed moves of a tool that does not turn have parts of half a radius at most. Contacts at one end of a long move then
    do not add to those at the other end. All other moves have one part.
    """
    part_length = WINDOW * np.array([t.radius for t in tools])[moves.tool] if len(moves) else np.zeros(0)
    length = np.linalg.norm(moves.end - moves.start, axis=1)
    whole = ~moves.feed if moves.axes is None else ~moves.feed | (moves.axes.angle > 0.0)
    count = np.where(whole, 1, np.maximum(np.ceil(length / np.maximum(part_length, 1e-9) - 1e-9), 1)).astype(np.int64)
    return np.concatenate([[0], np.cumsum(count)])


@dataclass(frozen=True, eq=False)
class Ways:
    """What each of m moves, or parts of moves, takes off the stock.

    volume : (m,) float64, mm³
    depth  : (m,) float64, mm, deepest cut along the tool axis: the highest stock over the tip where the flutes take it
    """

    volume: F64
    depth: F64

    def of_moves(self, first: NDArray[np.int64]) -> Ways:
        """The same by move.

        first : (n + 1,) int64, index, first part of each move, as ``parts``
        """
        if len(first) < 2:
            return Ways(np.zeros(0), np.zeros(0))
        return Ways(np.add.reduceat(self.volume, first[:-1]), np.maximum.reduceat(self.depth, first[:-1]))

    def in_cut(self, first: NDArray[np.int64]) -> WaysInCut:
        """What of each move is in the cut.

        first : (n + 1,) int64, index, first part of each move, as ``parts``
        """
        if len(first) < 2:
            return WaysInCut(np.zeros(0), np.zeros(0))
        takes = np.add.reduceat((self.volume > 0.0).astype(np.float64), first[:-1])
        return WaysInCut(takes / np.diff(first), self.of_moves(first).depth)


@dataclass(frozen=True, eq=False)
class WaysInCut:
    """The way of each of m moves in the cut.

    share : (m,) float64, dimensionless, share of its length in which it takes something off the stock
    depth : (m,) float64, mm, as in ``Ways``
    """

    share: F64
    depth: F64

    def only(self, chosen: NDArray[np.bool_]) -> WaysInCut:
        """The moves where ``chosen`` (m,) bool is true."""
        return WaysInCut(self.share[chosen], self.depth[chosen])


def ways_of(tables: Sequence[NDArray[np.int64]]) -> Ways:
    """What parts of moves take, added up over the tables of all threads.

    tables : (p, 2) int64 each, 1e-9 mm³ and 1e-9 mm, as ``verify.kernels.stock.CutTotals``
    """
    return Ways(np.sum([t[:, 0] for t in tables], axis=0) / UNITS, np.max([t[:, 1] for t in tables], axis=0) / UNITS)


@dataclass(frozen=True, eq=False)
class StockPass:
    """Result of one pass over the stock.

    events : (e, 7) float64, mm, rows (move, code, depth, clearance, x, y, z) sorted by move
    lost   : number of events lost because a table is full
    cut    : (m,) bool, moves that removed stock
    engaged : (p,) int64, bits, sectors of the cutter in stock (``verify.kernels.engaged``), by parts of moves
    ways   : Ways, what each of the p parts takes
    under  : (m,) bool, moves whose flutes were under stock, or None where that makes no difference
    """

    events: F64
    lost: int
    cut: NDArray[np.bool_]
    engaged: NDArray[np.int64]
    ways: Ways
    under: NDArray[np.bool_] | None = None


def end_radii(tools: Sequence[ToolBody], holes: Mapping[int, float] | None = None) -> F64:
    """(k,) float64, mm: radius of the end-cutting region of each tool (see ``verify.material.stock_lines``).

    holes : mm by T number, diameters of the holes that taps need, as ``ProofSetup.tap_holes``
    """
    known = holes or {}
    share = {"flat": lambda t: t.radius, "ball": lambda t: 0.5 * t.radius,
             "bull": lambda t: t.dull_radius, "drill": lambda t: t.radius,
             "lens": lambda t: t.dull_radius, "barrel": lambda t: t.dull_radius,
             "thread_mill": lambda t: t.radius, "tap": lambda t: 0.5 * known.get(t.number, 2.0 * TAP_CORE * t.radius),
             "chamfer": lambda t: 0.5 * t.tip_diameter if t.tip_diameter > 0.0 else t.radius}
    return np.array([share[t.end](t) for t in tools])


def event_table() -> F64:
    """An empty table of events, (e + 1, 7) float64, mm; the kernels keep the number of events in its last row."""
    return np.zeros((EVENTS + 1, 7))


def noted(events: F64) -> F64:
    """The events of a table.

    events : (k + 1, 7) float64, mm, as ``event_table``

    Returns its filled rows, (e, 7) float64, mm.
    """
    return events[:int(events[-1, 0])].copy()


def free_rapids(moves: Moves) -> NDArray[np.bool_]:
    """(m,) bool: rapids that need no clearance.

    They are retracts along the tool axis, and returns along it no deeper than a feed move before, without a sideways
    move since: a peck. An unprogrammed move, as after a visit to a fixed place of the machine, counts as sideways.
    """
    rise, straight, linked = along_axis(moves)
    out = np.asarray(~moves.feed & straight & (rise > 0))
    for m in np.flatnonzero(~moves.feed & straight & (rise < 0)).tolist():
        height, i = 0.0, m - 1  # of the end of move i over the start of move m
        while i >= 0 and linked[i + 1] and straight[i] and not out[m]:
            out[m] = moves.feed[i] and height <= rise[m] + 1e-9
            height -= rise[i]
            i -= 1
    return out


def rapid_arrays(moves: Moves, setup: ProofSetup) -> RapidArrays:
    """The distances that rapids keep: ``clearance_approach`` straight down before a cut, else ``clearance_rapid``.

    A rapid that may leave its straight way keeps as much more.
    """
    free, (rise, straight, linked) = free_rapids(moves), along_axis(moves)
    down = ~moves.feed & straight & (rise <= 0.0)
    onto = np.zeros(len(free), np.bool_)  # a move straight down that a feed move follows, or another such move
    for m in np.flatnonzero(down)[::-1].tolist():
        onto[m] = m + 1 < len(free) and linked[m + 1] and (moves.feed[m + 1] or onto[m + 1])
    room = np.where(onto, min(setup.clearance_approach, setup.clearance_rapid), setup.clearance_rapid)
    room = room if moves.stray is None else room + moves.stray
    return RapidArrays(free, np.where(moves.feed | free, 0.0, room))


def contact_limits(setup: ProofSetup) -> ContactLimits:
    """What counts as a contact."""
    return ContactLimits(setup.clearance_rapid, setup.gouge_tolerance, BESIDE)


def along_axis(moves: Moves) -> tuple[F64, NDArray[np.bool_], NDArray[np.bool_]]:
    """How each of m moves goes along the tool axis.

    Returns
    -------
    rise     : (m,) float64, mm, how far it goes up
    straight : (m,) bool, whether it goes along the axis only
    linked   : (m,) bool, whether it goes on where the move before ends
    """
    d = moves.end - moves.start
    up = np.tile([0.0, 0.0, 1.0], (len(d), 1)) if moves.axes is None else moves.axes.axis
    rise = np.einsum("ij,ij->i", d, up)
    straight = np.linalg.norm(d - rise[:, None] * up, axis=1) <= ASIDE
    if moves.axes is not None:
        straight &= moves.axes.angle == 0.0
    linked = np.zeros(len(d), np.bool_)
    linked[1:] = (moves.tool[1:] == moves.tool[:-1]) & (np.abs(moves.start[1:] - moves.end[:-1]) <= SAME).all(axis=1)
    linked[1:] &= np.einsum("ij,ij->i", up[1:], up[:-1]) >= 1.0 - SAME**2
    return rise, straight, linked


def gather(results: list[object]) -> tuple[F64, int]:
    """Events of all jobs in one table, and the number of lost events.

    results : for every job its events, (k, 7) float64, mm, and the number it found

    Returns the events, (e, 7) float64, mm, sorted by move, code and falling depth, and the number lost.
    """
    parts = [r for r in results if isinstance(r, tuple)]
    if not parts:
        return np.zeros((0, 7)), 0
    events = np.concatenate([p[0] for p in parts])
    lost = sum(p[1] - len(p[0]) for p in parts)
    order = np.lexsort((events[:, 6], events[:, 5], events[:, 4], -events[:, 2], events[:, 1], events[:, 0]))
    return events[order], int(lost)


def tables_for(threads: int, shape: tuple[int, ...]) -> tuple[list[NDArray[np.int64]], Spare]:
    """A table of zeros for each thread, and a queue from which jobs borrow them.

    shape : of a table, such as (m, 4)

    Returns the tables, each of that shape (m, k), int64, count or bits, and the queue. An operation that does not
    depend on order combines them, so the result is the same for any assignment of jobs to threads.
    """
    tables, spare = [np.zeros(shape, np.int64) for _ in range(max(1, threads))], Spare()
    for table in tables:
        spare.put(table)
    return tables, spare
