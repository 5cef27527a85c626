"""Teeth of taps and thread mills: where they touch the part, and thread mills that are drawn out of their thread.

The proof simulates such a tool as a cylinder as wide as its teeth, so it cannot see that the teeth stand in grooves. A
tooth leaves its groove aside or along the helix. Along its axis by more than a pitch it tears the thread.

Coordinates are in the setup frame, lengths in mm.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.mesh_queries.rays import first_hits
from geometry.tool_body import ToolBody
from verify.checks.sideways_cuts import one_a_line
from verify.checks.thread_phase import off_phase, turns_of
from verify.findings import Source
from verify.model import Finding
from verify.moves import Moves
from verify.tool_axes import ToolAxes

COARSEST = 0.5
"""Pitch over the diameter that no thread has. The coarsest of ISO 261, M1 x 0.25, has a quarter."""
USUAL = 0.1
"""Pitch over the diameter of a thread mill that is taken where neither setup nor program shows one."""
ASIDE = 0.4
"""Pitches by which teeth that leave a thread go aside at least. Threads of ISO 68 are 0.54 deep."""
PITCH_ERROR = 0.02
"""Share by which the helices of a thread mill may differ from its pitch."""
SHARP = math.radians(75.0)  # a corner that is no part of a helix
HEIGHTS = 0.25  # radii between the places on the axis from which a wall is looked for
PLACES = 256  # at most, along one axis and along one move
ROUND = 32  # directions in which a wall is looked for where a floor is nearer
GROOVE = 0.75  # of a turn, without the rise of a thread, along a wall
HELIX = 256  # moves on helices that are looked at for the pitch
FULL = 2.0 * math.pi
SAME = 1e-6  # mm


def teeth_touch(tree: TriangleTree, tips: F64, up: F64, radius: float, length: float,
                slack: float) -> NDArray[np.bool_]:
    """(n,) bool: whether a wall of the part stands beside the teeth, no farther from them than ``slack``.

    tips   : (n, 3) float64, mm, setup frame
    up     : (n, 3) float64, unit, setup frame, tool axes
    radius, length : mm, of the teeth

    What is below the tip or above the teeth does not count.
    """
    if not len(tips):
        return np.zeros(0, np.bool_)
    steps = min(max(math.ceil(length / (HEIGHTS * radius)), 1), PLACES)
    high = (np.arange(steps) + 0.5) * (length / steps)
    at = (tips[:, None, :] + high[:, None] * up[:, None, :]).reshape(-1, 3)
    axis = np.repeat(up, steps, axis=0)
    far, _, place = nearest(tree, at, radius + slack)
    near, over = np.isfinite(far), np.tile(high, len(tips))
    beside = np.einsum("ij,ij->i", place - at, axis) + over
    out = near & (beside >= -SAME) & (beside <= length + SAME)
    # what is nearer below or above may hide a wall: look for it square to the axis
    hidden = np.flatnonzero(near & ~out)
    if len(hidden):
        u, v = _square(axis[hidden])
        for turn in np.arange(ROUND) * (2.0 * math.pi / ROUND):
            met, _ = first_hits(tree, at[hidden], math.cos(turn) * u + math.sin(turn) * v, t_max=radius + slack)
            out[hidden] |= np.isfinite(met)
    return np.asarray(out.reshape(len(tips), steps).any(axis=1))


def taps_in_holes(moves: Moves, tools: Sequence[ToolBody], tree: TriangleTree, slack: float) -> NDArray[np.bool_]:
    """(m, 2) bool: moves of taps whose teeth touch the part where the move begins, and where it ends.

    slack : mm, farther from the part a tooth does not touch it
    """
    out = np.zeros((len(moves), 2), np.bool_)
    for k, tool in enumerate(tools):
        rows = np.flatnonzero(moves.tool == k) if tool.kind == "tap" else np.zeros(0, np.int64)
        up = np.tile([0.0, 0.0, 1.0], (len(rows), 1)) if moves.axes is None else moves.axes.axis[rows]
        for j, tips in enumerate((moves.start, moves.end)):
            out[rows, j] = teeth_touch(tree, tips[rows], up, tool.radius, tool.flute_length, slack)
    return out


def drawn_thread_mills(moves: Moves, cut: NDArray[np.bool_], tools: Sequence[ToolBody], source: Source,
                       tree: TriangleTree, slack: float, pitches: Mapping[int, float]) -> list[Finding]:
    """One finding for each line in which a thread mill goes along its axis while its teeth stand in a wall.

    cut : (m,) bool, whether each move removes stock; slack : mm, farther from the part a tooth does not touch it
    pitches : mm by T number, as the tools state them

    A thread mill whose helices have another pitch than it states is a finding too, and one that runs along a wall
    without the rise of a thread. The depth of a finding is the way along the axis in the wall, the pitch of the
    helices, or the way along the wall, mm.

    Notes
    -----
    P is the pitch of the helices of the tool. A thread is at least P / 2 deep, so teeth that are no farther than
    ``ASIDE`` of P from a place where they cut or touched the part are in the thread still. While a tool stays that near
    to one place across its axis, it must not go more than P along the axis with its teeth in a wall. Of other moves
    that touch the part at both ends, what counts is how much they rise beyond the coarsest thread of that diameter.
    """
    found: list[Finding] = []
    for k, tool in enumerate(tools):
        if tool.kind != "thread_mill":
            continue
        for program in np.unique(source.program[moves.tool == k]).tolist():
            for axis, rows in _by_axis(moves, np.flatnonzero((moves.tool == k) & (source.program == program))):
                depth = np.zeros(len(moves))
                over = tree.mesh.vertices @ axis
                touches = partial(_touches, tree, axis, tool, slack)
                whole = _Way.of(moves.only(rows), rows, axis)
                at, measured = _pitch_of(whole, cut[rows], tool.diameter, touches)
                pitch = pitches.get(tool.number, measured or USUAL * tool.diameter)
                if measured and abs(measured - pitch) > PITCH_ERROR * pitch:
                    found.extend(one_a_line(rows[[at]], np.full(len(moves), measured), moves.start, source,
                                            partial(_off_pitch, tool.number, pitch, measured)))
                found.extend(_off_phase(whole, rows, cut, tool, pitches, touches, moves, source))
                level = np.zeros(len(moves))
                level[rows] = _grooves(whole, tool.radius, pitch, touches)
                found.extend(one_a_line(np.flatnonzero(level), level, moves.start, source,
                                        partial(_groove_words, tool.number, level)))
                way, of = whole.parted(pitch)
                torn = _ToothWay(way, cut[rows][of], tool, (over.min(), over.max()), touches, pitch).torn()
                np.maximum.at(depth, rows[of], torn)
                found.extend(one_a_line(np.flatnonzero(depth), depth, moves.start, source,
                                        partial(_words, tool.number, depth)))
    return found


def _off_pitch(number: int, pitch: float, measured: float, _m: int) -> str:
    return (f"T{number} is a thread mill of the pitch {pitch:g} mm, and its helices rise {measured:.4g} mm a turn: a "
            "thread is milled with a helix of its pitch")


def _off_phase(way: _Way, rows: NDArray[np.intp], cut: NDArray[np.bool_], tool: ToolBody, pitches: Mapping[int, float],
               touches: Callable[[F64], NDArray[np.bool_]], moves: Moves, source: Source) -> list[Finding]:
    """Findings of passes that do not run in the thread of earlier ones; only where the tool states its pitch.

    A pitch that helices show may be the lead of a thread of several starts, which are out of phase by right.
    """
    pitch = pitches.get(tool.number)
    if pitch is None:
        return []
    turns = [t for first, last in _helices(way)
             for t in turns_of(np.concatenate([way.flat[first:last], way.flat_end[last - 1:last]]),
                               np.r_[way.high[first:last], way.high_end[last - 1]], first, pitch)]
    turns = [t for t in turns if cut[rows[t.move]] or touches(way.end[t.move:t.move + 1])[0]]
    off = off_phase(turns, pitch, tool.flute_length, ASIDE * pitch)
    depth = np.zeros(len(moves))
    bad = rows[[m for m, _ in off]]
    depth[bad] = [by for _, by in off]
    return one_a_line(bad, depth, moves.start, source, lambda m: (
        f"T{tool.number} mills a thread {depth[m]:.3f} mm out of phase with the thread that it has milled there: its "
        "teeth cut the crests off" if depth[m] else
        f"T{tool.number} mills a thread of the other hand over the thread that it has milled there"))


def _groove_words(number: int, way: F64, m: int) -> str:
    return (f"T{number} is a thread mill and goes {way[m]:.3f} mm along a wall without the rise of a thread: its teeth "
            "leave grooves there")


def _words(number: int, depth: F64, m: int) -> str:
    return (f"T{number} is a thread mill and goes {depth[m]:.3f} mm along its axis while its teeth stand in the wall; "
            "it leaves a thread aside, by more than half a pitch")


class _Way(NamedTuple):
    """Consecutive moves of one tool with one axis.

    flat, flat_end : (m, 2) float64, mm, square to the axis; high, high_end : (m,) float64, mm, of the tip along it
    start, end     : (m, 3) float64, mm; feed : (m,) bool; axis : (3,) unit
    joined         : (m,) bool, whether each move begins where the one before ends
    """

    flat: F64
    flat_end: F64
    high: F64
    high_end: F64
    start: F64
    end: F64
    feed: NDArray[np.bool_]
    axis: F64
    joined: NDArray[np.bool_]

    @classmethod
    def of(cls, moves: Moves, rows: NDArray[np.intp], axis: F64) -> _Way:
        """Moves of the tool axis ``axis`` (3,), and their rows (r,) in the program."""
        start, end = moves.start, moves.end
        u, v = (w[0] for w in _square(axis[None]))
        joined = np.zeros(len(rows), np.bool_)
        joined[1:] = np.diff(rows) <= 1
        joined[1:] &= (np.abs(start[1:] - end[:-1]) <= SAME).all(axis=1)
        return cls(np.column_stack([start @ u, start @ v]), np.column_stack([end @ u, end @ v]), start @ axis,
                   end @ axis, start, end, moves.feed, axis, joined)

    def parted(self, pitch: float) -> tuple[_Way, NDArray[np.int64]]:
        """The same in pieces that go no farther aside than a tenth of a pitch (mm) where they rise by more than one.

        Returns also (p,) int64, index, the move of each piece.
        """
        steep = np.abs(self.rise) > np.maximum(pitch, self.aside)
        count = np.where(steep, np.ceil(self.aside / (0.1 * pitch)), 1.0).clip(1, PLACES).astype(np.int64)
        moves, of = Moves(self.start, self.end, self.feed, np.zeros(len(count), np.int32)).parted(count)
        way = _Way.of(moves, of, self.axis)
        way.joined[:] &= (np.diff(of, prepend=-1) == 0) | self.joined[of]
        return way, of

    @property
    def rise(self) -> F64:
        """(m,) float64, mm along the axis."""
        return self.high_end - self.high

    @property
    def aside(self) -> F64:
        """(m,) float64, mm across the axis."""
        return np.asarray(np.linalg.norm(self.flat_end - self.flat, axis=1))

    @property
    def corner(self) -> F64:
        """(m - 1,) float64, rad, -pi to pi: how the way turns across the axis from each move to the next."""
        d = self.flat_end - self.flat
        return np.asarray((np.diff(np.arctan2(d[:, 1], d[:, 0])) + math.pi) % (2.0 * math.pi) - math.pi)

    @property
    def turn(self) -> F64:
        """(m,) float64, rad: how far each move turns across the axis, half of the corners at its ends."""
        goes = self.feed & (self.aside > SAME)
        off = np.where(self.joined[1:] & goes[1:] & goes[:-1], np.abs(self.corner), 0.0)
        return np.asarray(0.5 * (np.r_[off, 0.0] + np.r_[0.0, off]))


@dataclass(frozen=True, eq=False)
class _ToothWay:
    """A thread mill on its way.

    cut     : (m,) bool, moves that remove stock
    part    : lowest and highest place of the part along the axis, mm
    touches : of tips (n, 3), mm: whether the teeth touch the part; pitch : mm
    """

    way: _Way
    cut: NDArray[np.bool_]
    tool: ToolBody
    part: tuple[float, float]
    touches: Callable[[F64], NDArray[np.bool_]]
    pitch: float

    def torn(self) -> F64:
        """(m,) float64, mm along the axis in the wall, at the moves with which it becomes more than a pitch; else 0."""
        out = self._climbs()
        for first, last in self._standing():
            heights = np.concatenate([self.way.high[first:last], self.way.high_end[first:last]])
            if heights.max() - heights.min() <= self.pitch + SAME:
                continue
            low, high, at = math.inf, -math.inf, -1
            for m in range(first, last):
                inside = self._in_wall(m, first)
                if len(inside):
                    low, high = min(low, float(inside.min())), max(high, float(inside.max()))
                if at < 0 and high - low > self.pitch + SAME:
                    at = m
            if at >= 0:
                out[at] = high - low
        return out

    def _standing(self) -> Iterator[tuple[int, int]]:
        """Ranges of joined moves that stay within ``ASIDE`` of a pitch of the place where the first begins."""
        way, off, first = self.way, ASIDE * self.pitch, 0
        for m in range(len(way.feed)):
            if m > first and not (way.joined[m] and math.dist(way.flat_end[m], way.flat[first]) <= off):
                yield first, m
                first = m
            if math.dist(way.flat_end[m], way.flat[m]) > off:
                first = m + 1
        if first < len(way.feed):
            yield first, len(way.feed)

    def _in_wall(self, m: int, before: int) -> F64:
        """(n,) float64, mm: heights on a move at which the teeth stand in a wall or in what moves before ``before``
        cut."""
        way, long = self.way, self.tool.flute_length
        begin, end = np.clip([way.high[m], way.high_end[m]], self.part[0] - long, self.part[1]).tolist()
        count = min(max(math.ceil(abs(end - begin) / (0.25 * self.pitch)), 1), PLACES)
        high = np.linspace(begin, end, count + 1)
        share = (high - way.high[m]) / way.rise[m] if abs(way.rise[m]) > SAME else np.linspace(0.0, 1.0, count + 1)
        inside = self.touches(way.start[m] + share[:, None] * (way.end[m] - way.start[m]))
        for low in self._threads(before, way.flat[m]):
            inside |= (high < low + long - SAME) & (high + long > low + SAME)
        return np.asarray(high[inside])

    def _threads(self, before: int, place: F64) -> F64:
        """(n,) float64, mm: heights of the tip at ends of earlier ways aside that cut or touched a wall near a place
        (2,)."""
        way = self.way
        near = np.linalg.norm(way.flat_end[:before] - place, axis=1) <= ASIDE * self.pitch
        rows = np.flatnonzero(way.feed[:before] & (way.aside[:before] > SAME) & near)
        return np.unique(way.high_end[rows[self.cut[rows] | self.touches(way.end[rows])]])

    def _climbs(self) -> F64:
        """As ``torn``, of ways aside along a wall that rise steeper than any thread of that diameter."""
        way = self.way
        out, more = np.zeros(len(way.feed)), np.zeros(len(way.feed))
        beyond = np.abs(way.rise) - (way.aside + self.tool.radius * way.turn) / FULL
        steep = np.flatnonzero(way.feed & (beyond > SAME) & (way.aside > SAME))
        steep = steep[self.touches(way.start[steep]) & self.touches(way.end[steep])]
        more[steep], total = beyond[steep], 0.0
        for m in range(len(more)):
            total = (total if way.joined[m] and way.feed[m] else 0.0) + more[m]
            if more[m] > 0.0 and total > self.pitch + SAME:
                out[m], total = total, 0.0
        return out


def _grooves(way: _Way, radius: float, pitch: float, touches: Callable[[F64], NDArray[np.bool_]]) -> F64:
    """(m,) float64, mm along a wall without the rise of a thread, at the moves with which it becomes too much; else 0.

    radius, pitch : mm, of the teeth; touches : as in ``_ToothWay``

    Leads in and out touch the wall on a part of their way. More than a radius, or than ``GROOVE``, is a groove. Rise
    and turn are those of half a radius of way, as the corners of fine chords are rounded.
    """
    out, turned = np.zeros(len(way.feed)), np.zeros(len(way.feed))
    level = np.zeros(len(way.feed), np.bool_)
    goes = way.feed & (way.aside > SAME)
    for first, last in zip(*_runs(goes, _smooth(way, goes)), strict=True):
        inner = way.corner[first:last - 1]
        turned[first:last] = 0.5 * (np.r_[inner, 0.0] + np.r_[0.0, inner])
        at, high, angle = (np.r_[0.0, np.cumsum(v[first:last])] for v in (way.aside, way.rise, turned))
        ends = [0.5 * (at[1:] + at[:-1]) + side * HEIGHTS * radius for side in (-1.0, 1.0)]
        rise, turn = (np.abs(np.interp(ends[1], at, v) - np.interp(ends[0], at, v)) for v in (high, angle))
        level[first:last] = rise <= np.maximum(0.5 * pitch * turn / FULL, SAME)
    counts = np.where(level, np.ceil(way.aside / (HEIGHTS * radius)), 0.0).clip(0, PLACES).astype(np.int64)
    of = np.repeat(np.arange(len(level)), counts)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts) + 0.5) / np.repeat(counts, counts)
    beside = touches(way.start[of] + share[:, None] * (way.end[of] - way.start[of]))
    shares = np.bincount(of[beside], minlength=len(level)) / np.maximum(counts, 1)
    along = shares > 0.0
    for first, last in zip(*_runs(along, along[1:] & along[:-1] & way.joined[1:]), strict=True):
        length, turn = ((shares * v)[first:last] for v in (way.aside, turned))
        over = (np.cumsum(length) > radius) | (np.abs(np.cumsum(turn)) > GROOVE * FULL)
        if over.any():
            out[first + int(np.argmax(over))] = float(length.sum())
    return out


def _touches(tree: TriangleTree, axis: F64, tool: ToolBody, slack: float, tips: F64) -> NDArray[np.bool_]:
    """``teeth_touch`` of a tool whose axis is ``axis`` (3,)."""
    return teeth_touch(tree, tips, np.tile(axis, (len(tips), 1)), tool.radius, tool.flute_length, slack)


def _pitch_of(way: _Way, cut: NDArray[np.bool_], diameter: float,
              touches: Callable[[F64], NDArray[np.bool_]]) -> tuple[int, float]:
    """A move of the helices that cut or touch the part, and their pitch, mm; 0 where there is none.

    cut, touches : as in ``_ToothWay``; diameter : mm, of the teeth

    The pitch is the greatest rise over a whole turn, as leads in and out rise less.
    """
    corner = way.corner
    at, pitch = [], []
    for first, last in _helices(way):
        inner = corner[first:last - 1]
        turned = np.concatenate([[0.0], np.cumsum(0.5 * (np.r_[inner[:1], inner] + np.r_[inner, inner[-1:]]))])
        turned *= np.sign(turned[-1])
        high = np.r_[way.high[first:last], way.high_end[last - 1]]
        ends = np.searchsorted(turned, turned + 0.99 * FULL)
        whole = np.flatnonzero(ends < len(turned))
        ends = ends[whole]
        rise = np.abs(high[ends] - high[whole]) * FULL / (turned[ends] - turned[whole])
        at.append(first + (whole + ends) // 2)
        pitch.append(rise)
    rows, values = np.concatenate([np.zeros(0, np.int64), *at]), np.concatenate([np.zeros(0), *pitch])
    sound = (values > SAME) & (values <= COARSEST * diameter)
    rows, values = rows[sound], values[sound]
    some = np.linspace(0, len(rows) - 1, min(len(rows), HELIX)).astype(np.int64)
    some = some[cut[rows[some]] | touches(way.end[rows[some]])]
    if not len(some):
        return -1, 0.0
    best = some[int(np.argmax(values[some]))]
    return int(rows[best]), float(values[best])


def _helices(way: _Way) -> Iterator[tuple[int, int]]:
    """First and one past the last of each run of moves that turns by half a turn or more without a sharp corner."""
    corner, goes = way.corner, way.feed & (way.aside > SAME)
    for first, last in zip(*_runs(goes, _smooth(way, goes)), strict=True):
        if last - first >= 3 and abs(corner[first:last - 1].sum()) >= 0.5 * FULL:
            yield first, last


def _smooth(way: _Way, goes: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(m - 1,) bool: moves that go (m,), joined to the next one without a sharp corner."""
    return np.asarray(goes[1:] & goes[:-1] & way.joined[1:] & (np.abs(way.corner) < SHARP))


def _runs(goes: NDArray[np.bool_], linked: NDArray[np.bool_]) -> tuple[list[int], list[int]]:
    """First and one past the last of each run of moves that go (m,), each linked (m - 1,) to the one before."""
    starts = goes & np.r_[True, ~linked]
    ends = goes & np.r_[~linked, True]
    return np.flatnonzero(starts).tolist(), (np.flatnonzero(ends) + 1).tolist()


def _by_axis(moves: Moves, rows: NDArray[np.intp]) -> Iterator[tuple[F64, NDArray[np.intp]]]:
    """The moves among ``rows`` on which the tool does not turn, by tool axis (3,)."""
    if moves.axes is None:
        yield np.array([0.0, 0.0, 1.0]), rows
        return
    axes: ToolAxes = moves.axes
    still = rows[axes.angle[rows] == 0.0]
    kinds, of = np.unique(np.round(axes.axis[still], 6), axis=0, return_inverse=True)
    for k in range(len(kinds)):
        own = still[of.reshape(-1) == k]
        yield axes.axis[own[0]], own


def _square(axis: F64) -> tuple[F64, F64]:
    """Two (n, 3) unit vectors square to each axis (n, 3) and to each other."""
    other = np.where(np.abs(axis[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    u = np.cross(axis, other)
    u /= np.linalg.norm(u, axis=1)[:, None]
    return u, np.cross(axis, u)


__all__ = ["COARSEST", "drawn_thread_mills", "taps_in_holes", "teeth_touch"]
