"""Passes of a leaning tool as motions: what of them is free of stock, their feeds, their ways in and out.

A pass is one step of work: the tool comes down along its own axis beside the beginning, goes to it, along the pass, off
it, and up along its axis again; where it turns to the next one it is outside of everything. On and off a wall that its
flank cuts it goes on an arc where there is room (``toolpath.linking.lead_arcs``). What it would meet of part, fixtures and stock is
asked pose by pose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.five_axis.oriented_piece import MIN_PIECE, Piece, raised_poses, thinned_poses
from toolpath.lines import dense, true_runs
from toolpath.linking.lead_arcs import arc_onto, radii
from toolpath.plan_settings import CutData, PlanSettings, RotaryAxes
from toolpath.poses import Blocked, places_along
from toolpath.stock.stock_map import SKIN, StockMap
from toolpath.stock.tool_shell import shells
from toolpath.stock.wall_skin import Skins
from toolpath.workingsteps import Trajectory, TrajectoryKind
from zones.reach.assembly import Clearances, Disc

TURN_S = 4.0  # what it takes to go outside of everything, turn there and come back
LEAD = 0.5  # of the radius, off the surface, where the tool comes down and goes up; at most
MAX_LEAD = 1.5  # mm
THICK = 0.12  # of the diameter: what a leaning tool may take off at once
LOOK = 0.25  # of the radius, between poses that are held against stock and part on the ways in and out
MIN_UP = 0.1  # of an axis, upwards: what lies flatter does not get above everything along itself
MIN_WAY = 1e-3  # mm, across the axis, that says where a pass comes from
SQUARE = 0.7  # of a way off the wall, square to the pass: where it is less the pass does not go along the wall
IN_FRONT = 0.5  # mm above the start of a cut where the approach slows down
UP_Z = np.array([0.0, 0.0, 1.0])
ROUND_END = 0.5  # of the corner, from the rim in: there its end is steeper than 30 degrees and cuts sideways
STEEPER = 1e-6  # mm, of a step: no steeper than the ramp, for all that is known
DIP = 0.5  # of the skin, what a pass may go down steeper than the ramp
SKIMMED = 0.75  # of the skin, under what goes down steeper than that all the same: it adds up along a way
LAYER, MAX_LAYERS = 0.9, 24  # of what its end may take, between layers of a pass on it; how many
WIDENED = 1.5  # of the radius: what a layer of a pass is long, at least, where it goes on before and behind
CELLS = 1.5  # lattice steps in from the flank, where nodes in the wall are no longer met
LOADED = "there is more stock in its way than a leaning tool may take off"
STEADY = 0.8  # feeds of neighbouring blocks go in steps of that
MIN_FEED = 0.1  # mm/min
MIN_PACE = 0.01  # of the feed: a tip that goes slower beside its flank all but stands


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What a leaning tool must not meet, access frame.

    enters  : whether it enters part or fixtures
    turning : what the machine can do
    stock   : StockMap as it stands; passes are taken off it, one after the other
    discs   : shank and holder with their clearance
    clear   : Clearances
    skins   : what stands on the samples of the zone, taken off likewise; None where nobody measured it
    """

    enters: Blocked
    turning: RotaryAxes
    stock: StockMap
    discs: tuple[Disc, ...]
    clear: Clearances
    skins: Skins | None = None

    def blocked(self, tips: F64, axes: F64, tool: ToolBody) -> NDArray[np.bool_]:
        """(n,) bool: poses in which it meets part, fixtures or table, or that the machine cannot take."""
        low = lowest(tips, axes, tool, self.discs, self.turning.up)
        lies = np.minimum(axes @ self.turning.up, axes[:, 2]) < MIN_UP
        return self.enters(tips, axes) | lies | ~self.turning.stands(axes) | (low < self.turning.table)

    def met(self, tips: F64, axes: F64, tool: ToolBody, thick: float, under: float | None = None) -> NDArray[np.bool_]:
        """(n,) bool: poses at which stock is in neck, shank or holder, or thicker than ``thick`` mm at the flank or
        ``under`` mm under the end, as ``loaded`` has it, or neck, shank or holder may be in a skin on a wall."""
        out = loaded(self.stock, tips, axes, tool, self.discs, self.clear, thick, under)
        free = np.flatnonzero(~out)
        if self.skins is not None and len(free):
            out[free] = self.skins.near(tips[free], axes[free], tool, self.discs, self.clear)
        return out

    def copied(self) -> Surroundings:
        """The same with stock of its own."""
        return replace(self, stock=self.stock.copied(), skins=None if self.skins is None else self.skins.copied())

    def become(self, other: Surroundings) -> None:
        """Take over the stock of a copy."""
        self.stock.become(other.stock)
        if self.skins is not None and other.skins is not None:
            self.skins.become(other.skins)

    def cut(self, tips: F64, axes: F64, tool: ToolBody) -> None:
        """Take a pass off stock and skins."""
        self.stock.cut_leaning(tips, axes, tool)
        if self.skins is not None:
            self.skins.cut_leaning(tips, axes, tool)


@dataclass(frozen=True, eq=False)
class Runs:
    """What passes of a leaning tool would be.

    runs    : the trajectories of each pass, in the order they are walked
    refused : why there are no others, in words
    """

    runs: tuple[tuple[Trajectory, ...], ...]
    refused: tuple[str, ...]


def in_turn(found: Sequence[tuple[str, Piece]], tool: ToolBody, cut: CutData, settings: PlanSettings,
            around: Surroundings, divided: float = math.inf) -> Runs:
    """Passes as far as they can be walked one after the other, each off the stock that those before it leave.

    found   : name of the face and pass, for each
    around  : Surroundings; its stock is taken off
    divided : mm; what is longer and cannot be walked as a whole is walked in halves; such passes are layered already
    """
    runs: list[tuple[Trajectory, ...]] = []
    refused: list[str] = []
    for name, piece in found:
        layers = lowered(piece, tool, around) if piece.on_end and math.isinf(divided) else [piece]
        before = around.copied() if len(layers) > 1 else None
        mine: list[tuple[Trajectory, ...]] = []
        for layer in layers:
            made, why = _walked(layer, tool, cut, settings, around, divided)
            refused += [f"{name}: {reason}" for reason in why]
            mine += made
        if before is not None and not made:  # layers for nothing
            around.become(before)
            mine = []
        runs += mine
    return Runs(tuple(runs), tuple(dict.fromkeys(refused)))


def _walked(piece: Piece, tool: ToolBody, cut: CutData, settings: PlanSettings, around: Surroundings,
            divided: float) -> tuple[list[tuple[Trajectory, ...]], list[str]]:
    """What of a pass is walked, taken off the stock, and why the rest is not, in words."""
    todo = free_parts(piece, tool, settings, around, skims=math.isfinite(divided))
    runs, refused = [], [] if todo else [LOADED]
    while todo:
        part = todo.pop(0)
        made = with_ways(part, tool, cut, settings, around)
        if isinstance(made, str):
            if len(part.tips) > 2 and part.length > divided:
                rows, half = np.arange(len(part.tips), dtype=np.float64), len(part.tips) // 2
                todo[:0] = [part.at(rows[:half + 1]), part.at(rows[half:])]
            else:
                refused.append(made)
            continue
        runs.append(made)
        for t in made:
            if t.motion is TrajectoryKind.CUT and t.axes is not None:
                around.cut(t.points, t.axes, tool)
    return runs, refused


def lowest(tips: F64, axes: F64, tool: ToolBody, discs: Sequence[Disc], up: F64) -> F64:
    """(n,) float64, mm: how low a tool reaches along ``up`` (3,), with shank and holder grown by their clearance.

    tips, axes : (n, 3) float64, mm and unit, leaning less than 90 degrees off ``up``
    """
    rise = axes @ up
    lean = np.sqrt(np.maximum(1.0 - rise * rise, 0.0))
    out = tool.corner_radius * (rise - 1.0) - (tool.radius - tool.corner_radius) * lean
    for d in discs:
        out = np.minimum(out, d.height * rise - d.radius * lean)
    return np.asarray(tips @ up + out)


def loaded(stock: StockMap, tips: F64, axes: F64, tool: ToolBody, discs: Sequence[Disc], clear: Clearances,
           thick: float, under: float | None = None) -> NDArray[np.bool_]:
    """(n,) bool: poses at which stock stands in neck, shank or holder, or deeper in the cutting part than ``thick`` mm.

    Under the end of the tool ``under`` mm may stand; where None, as much, and no more than the skin a way down takes.

    tips, axes : (n, 3) float64, mm and unit

    Bodies are places on their shells (``toolpath.stock.tool_shell``); stock is what the nearest node shows, half a cell aside.
    Less than 1.5 steps deep the cutting part is not asked: nodes in the wall are there. Where that is more than twice
    ``thick`` the lattice is too coarse to tell, and every pose counts as loaded.
    """
    step = stock.lattice.step
    deep = max(thick, CELLS * step)
    if not len(tips) or thick > 0.0 and deep > 2.0 * thick:
        return np.ones(len(tips), np.bool_)
    over, across = stock.highest - float(tips[:, 2].min()), step * math.hypot(*stock.top.shape)
    room = max(min(over / max(float(axes[:, 2].min()), 1e-3), over + across), 0.0)  # along the axis, until out of it
    under = max(min(thick, SKIN * tool.diameter) if under is None else under, CELLS * step)
    wide = max((tool.radius, *(d.radius for d in discs)))
    return stock.stands_in(tips, axes, *shells(tool, discs, clear, deep, under, step, room + wide))


def lowered(piece: Piece, tool: ToolBody, around: Surroundings) -> list[Piece]:
    """A pass on the end of a tool, preceded by itself raised, layer by layer from the highest down, where more stands
    over it than the end takes off at once.

    Where not even ``MAX_LAYERS`` are enough it is left out of all of them, and of the pass itself by ``free_parts``.
    What a pose is free of, part and fixtures, it stays free of when raised along its axis.
    """
    return [layer for _, layer in layers_over(piece, tool, around)]


def layers_over(piece: Piece, tool: ToolBody, around: Surroundings,
                share: float = LAYER, widened: bool = False) -> list[tuple[int, Piece]]:
    """The same with how many layers each is raised by, 0 for the pass itself, which is last.

    share   : of what its end may take, a layer
    widened : a layer that would be too short to be walked goes on before and behind; else it is left out. No more is
              left under the pass than lets it go downhill (``free_parts``)
    """
    thick, under = THICK * tool.diameter, SKIMMED * SKIN * tool.diameter if widened else None
    layer = share * max(min(thick, SKIN * tool.diameter), CELLS * around.stock.lattice.step)
    dense = piece.at(places_along(piece.tips, piece.axes, piece.reach, LOOK * tool.radius))
    need, todo = np.zeros(len(dense.tips), np.int64), np.arange(len(dense.tips))
    for k in range(MAX_LAYERS + 1):
        there = dense.raised(k * layer)
        todo = todo[around.met(there.tips[todo], there.axes[todo], tool, thick, under)]
        need[todo] = k + 1
        if not len(todo):
            break
    need[todo] = 0
    free = np.ones(len(need), np.bool_)
    free[todo] = False
    at, out = np.arange(len(need), dtype=np.float64), list[tuple[int, Piece]]()
    gone = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(dense.tips, axis=0), axis=1))])
    for k in range(int(need.max()), 0, -1):
        own = np.flatnonzero(binary_dilation(need >= k))
        low, high = gone[own[0]], gone[own[-1]]
        more = max(WIDENED * tool.radius - (high - low), 0.0) if widened else 0.0
        # to begin again in the middle of it costs more than to go on
        through = free & (gone >= low - more) & (gone <= high + more)
        out += [(k, part.raised(k * layer)) for part in dense.parts(through, at, MIN_PIECE * tool.radius)]
    return [*out, (0, piece)]


def free_parts(piece: Piece, tool: ToolBody, settings: PlanSettings, around: Surroundings,
               skims: bool = False) -> list[Piece]:
    """What of a pass has no more stock beside it than the flank may take off, and none in neck, shank and holder.

    Over what stands on the floor a flank is raised along its axis. Where it goes down steeper than the ramp, as behind
    what it was raised over, it would dig with the end of the tool: that part is walked the other way, uphill; of a pass
    on the end it is left out.

    skims : a pass on the end goes downhill where no more than most of a skin is under it, as an upright one does: axes
            that turn less than the surface go down on one side of each wave of it
    """
    thick, least = THICK * tool.diameter, MIN_PIECE * tool.radius

    def loaded_at(tips: F64, axes: F64) -> NDArray[np.bool_]:
        return around.met(tips, axes, tool, thick) | settings.found.bars(tool, tips)

    dense = piece.at(places_along(piece.tips, piece.axes, piece.reach, LOOK * tool.radius))
    met = loaded_at(dense.tips, dense.axes)
    if met.any():
        up, met = raised_poses(dense.tips, dense.axes,
                               lambda tips, axes: loaded_at(tips, axes) | around.blocked(tips, axes, tool),
                               tool.radius, 0.0 if piece.on_end else piece.reach)
        dense = replace(dense, tips=dense.tips + up[:, None] * dense.axes)
        met = binary_dilation(met)
    slope = math.tan(settings.ramp_angle)
    down = _descends(dense, slope, DIP * SKIN * tool.diameter)
    if skims and down.any():
        down[down] = around.met(dense.tips[down], dense.axes[down], tool, thick, SKIMMED * SKIN * tool.diameter)
        down = binary_dilation(down)
    at = np.arange(len(met), dtype=np.float64)
    uphill = [] if piece.on_end else [p.reversed() for p in dense.parts(binary_dilation(down) & ~met, at, least)]
    parts = [*dense.parts(~(met | down), at, least), *(_begun_level(part, slope, least) for part in uphill)]
    return [p.at(thinned_poses(p.tips, p.axes, p.reach, 0.25 * settings.chordal_tolerance).astype(np.float64))
            for p in parts if p is not None]


def _begun_level(piece: Piece, slope: float, least: float) -> Piece | None:
    """A part without what of either end goes down along the axis steeper than ``slope``; None if under ``least`` mm.

    There is fresh stock at an end: over the brink of a valley the tool would dig into it however short the way is.
    """
    steep = _steps_down(piece, slope)[1]
    level = np.flatnonzero(~steep)
    if not len(level):
        return None
    kept = piece.at(np.arange(level[0], level[-1] + 2, dtype=np.float64))
    return kept if kept.length >= least else None


def _steps_down(piece: Piece, slope: float) -> tuple[F64, NDArray[np.bool_]]:
    """(n - 1,) mm that each step goes down along the axis, and (n - 1,) bool whether steeper than ``slope``."""
    way, axis = np.diff(piece.tips, axis=0), 0.5 * (piece.axes[1:] + piece.axes[:-1])
    down = np.asarray(-(way * axis).sum(axis=1))
    return down, down > slope * np.linalg.norm(way + down[:, None] * axis, axis=1) + STEEPER


def _descends(piece: Piece, slope: float, most: float) -> NDArray[np.bool_]:
    """(n,) bool: poses on a way down along the axis that is steeper than ``slope`` and takes more than ``most`` mm."""
    down, steep = _steps_down(piece, slope)
    out = np.zeros(len(piece.tips), np.bool_)
    for i, j in true_runs(steep):
        out[i:j + 1] |= down[i:j].sum() > most
    return out


def with_ways(piece: Piece, tool: ToolBody, cut: CutData, settings: PlanSettings,
              around: Surroundings) -> tuple[Trajectory, ...] | str:
    """A pass with its ways in and out, or why there is none, in words."""
    thick, chord = THICK * tool.diameter, 0.25 * settings.chordal_tolerance
    walked = around.turning.along(piece.tips, piece.axes)
    if walked is None:
        return "the rotary axes do not get along it"
    tips, axes, least = walked
    feeds = paced(tips, axes, piece.reach, cut.feed, least)
    if feeds is None:
        return "the tip would all but stand while the flank goes round it, or an axis turns"
    dense = Piece(tips, axes, axes, piece.reach).at(places_along(tips, axes, piece.reach, LOOK * tool.radius))
    if around.met(dense.tips, dense.axes, tool, thick).any():
        return LOADED
    straight_up = [(tips[-1:], thick, SKIN * tool.diameter)]  # where it has been it may go as it stands
    back = piece.reversed()
    ways = [_way_in(piece, tool, settings, around, _leads(piece, tool, thick, chord)),
            _way_in(back, tool, settings, around, straight_up if piece.on_end else _leads(back, tool, thick, chord))]
    if ways[0] is None or ways[1] is None:
        return "the tool does not get there along its own axis"
    (top, first, near), (out_top, last, off) = ways[0], ways[1]
    last = last[::-1]
    out: list[Trajectory] = []

    def go(motion: TrajectoryKind, points: F64, feed: float, axis: F64) -> None:
        if float(np.linalg.norm(points[-1] - points[0])) > 1e-6:
            out.append(Trajectory(motion, np.ascontiguousarray(points), feed, np.tile(axis, (len(points), 1))))

    a, b = axes[0], axes[-1]
    go(TrajectoryKind.APPROACH, np.array([top, first[0] + near * a]), cut.link_feed, a)
    go(TrajectoryKind.APPROACH, np.array([first[0] + near * a, first[0]]), cut.plunge_feed, a)
    go(TrajectoryKind.CONNECT, first, cut.feed, a)
    for i, j in _steady(feeds):
        out.append(Trajectory(TrajectoryKind.CUT, tips[i:j + 1], float(feeds[i:j].min()), axes[i:j + 1]))
    go(TrajectoryKind.CONNECT, last, cut.feed, b)
    go(TrajectoryKind.LIFT, np.array([last[-1], last[-1] + off * b]), cut.feed, b)
    go(TrajectoryKind.LIFT, np.array([last[-1] + off * b, out_top]), cut.link_feed, b)
    return tuple(out)


def paced(tips: F64, axes: F64, reach: float, feed: float, least: F64) -> F64 | None:
    """(n - 1,) mm/min of the tip, so that no place of the flank goes faster than ``feed`` and the machine keeps up.

    tips, axes : (n, 3) float64, mm and unit
    reach      : mm from the tip, how far up the flank is at work
    least      : (n - 1,) minutes each block takes the machine

    None where the tip would go slower than ``MIN_PACE`` of the feed for the flank's sake, or in a block slower than
    ``MIN_FEED``: a tip that all but stands says nothing of how long an axis takes to turn. On a straight move of the
    tip with an evenly turning axis no place between tip and ``reach`` goes farther than the farther of both ends.
    """
    gone = [np.linalg.norm(np.diff(tips + h * axes, axis=0), axis=1) for h in (0.0, reach)]
    minutes = np.maximum(gone[0], gone[1]) / feed
    if gone[0].sum() < MIN_PACE * feed * minutes.sum():
        return None
    minutes = np.maximum(minutes, least)
    if (gone[0] < MIN_FEED * minutes).any():
        return None
    return np.maximum(np.minimum(gone[0] / np.maximum(minutes, 1e-12), feed), MIN_FEED)


def _steady(feeds: F64) -> list[tuple[int, int]]:
    """Runs of blocks (first, one past the last) whose feeds are within a step of ``STEADY``."""
    level = np.floor(np.log(feeds / feeds.max()) / math.log(STEADY) + 1e-9)
    at = [0, *(np.flatnonzero(np.diff(level)) + 1).tolist(), len(feeds)]
    return list(zip(at[:-1], at[1:], strict=True))


Lead = tuple[F64, float, float]
"""A way (k, 3), mm, from beside the beginning of a pass to it, k = 1 for straight down on it, and what stock the tool
may meet where it comes down, mm, at its flank and under its end."""


def _way_in(piece: Piece, tool: ToolBody, settings: PlanSettings, around: Surroundings,
            leads: Sequence[Lead]) -> tuple[F64, F64, float] | None:
    """A place (3,) above everything and a way (k, 3) from under it to the beginning of a piece, mm; None where none is
    free.

    With it mm above the beginning of that way, down to where nothing stands near the tool. Beside the beginning where
    there is room for that; else straight down: along a wall where the end of the tool is round enough not to dig up
    what stands there, and on its end where there is no more than a skin under it.
    """
    axis, thick = piece.axes[0], THICK * tool.diameter
    for way, stock, under in leads:
        beside = way[0]
        dip = beside[2] - float(lowest(beside[None], axis[None], tool, around.discs, UP_Z)[0])
        high = (settings.clearance + max(dip, 0.0) - beside[2]) / axis[2]
        if high <= 0.0:
            return None
        down = beside + np.linspace(high, 0.0, int(np.ceil(high / (LOOK * tool.radius))) + 5)[:, None] * axis
        over = dense(way, min(LOOK * tool.radius, MAX_LEAD / 4.0))
        axes = np.tile(axis, (max(len(down), len(over)), 1))
        if (around.blocked(down, axes[:len(down)], tool).any() or around.blocked(over, axes[:len(over)], tool).any()
                or len(way) > 2 and (around.met(over, axes[:len(over)], tool, thick)
                                     | settings.found.bars(tool, over)).any()):
            continue
        axes = axes[:len(down)]
        if not (around.met(down, axes, tool, stock, under) | settings.found.bars(tool, down)).any():
            return beside + high * axis, way, min(_near(down, axes, tool, around), high)
    return None


def _near(down: F64, axes: F64, tool: ToolBody, around: Surroundings) -> float:
    """mm above the end of a way down, from where on something may stand in the cells at the rim of the tool.

    down, axes : (n, 3) float64, mm and unit, the last at the bottom
    """
    wide = 2.0 * CELLS * around.stock.lattice.step
    grown = replace(tool, diameter=tool.diameter + 2.0 * wide, corner_radius=tool.corner_radius + wide)
    met = np.flatnonzero(around.met(down - wide * axes, axes, grown, 0.0, 0.0))
    high = np.linalg.norm(down - down[-1], axis=1)
    return IN_FRONT + max(SKIN * tool.diameter, float(high[max(met[0] - 1, 0)]) if len(met) else 0.0)


def _leads(piece: Piece, tool: ToolBody, thick: float, chord: float) -> list[Lead]:
    """Where the tool may come down at the beginning of a piece, the best first."""
    room, skin, axis, tip = min(LEAD * tool.radius, MAX_LEAD), SKIN * tool.diameter, piece.axes[0], piece.tips[0]

    def straight(aside: F64) -> F64:
        return np.array([tip + aside, tip])

    if piece.on_end:
        on_the_spot, ahead = [(tip[None], 0.0, skin)], _ahead(piece)
        return on_the_spot if ahead is None else [(straight(-room * ahead), 0.0, 0.0), *on_the_spot]
    aside = piece.away[0] - (piece.away[0] @ axis) * axis
    aside /= np.linalg.norm(aside)
    down_the_wall = [(tip[None], thick, min(thick, skin))] if ROUND_END * tool.corner_radius >= thick else []
    return [*((arc, 0.0, 0.0) for arc in _arcs_onto(piece, tool, aside, chord)), (straight(room * aside), 0.0, 0.0),
            (straight(0.25 * room * aside), 0.0, 0.0), *down_the_wall]


def _ahead(piece: Piece) -> F64 | None:
    """(3,) float64, unit: where a pass goes first, square to the tool; None where it stays where it begins."""
    axis, way = piece.axes[0], piece.tips[1:] - piece.tips[0]
    way = way - (way @ axis)[:, None] * axis
    size = np.linalg.norm(way, axis=1)
    far = np.flatnonzero(size > MIN_WAY)
    return way[far[0]] / size[far[0]] if len(far) else None


def _arcs_onto(piece: Piece, tool: ToolBody, aside: F64, chord: float) -> list[F64]:
    """Arcs (k, 3), mm, onto the beginning of a pass, square to the tool there.

    aside : (3,) float64, unit, off the wall; chord : mm, what the chords of the arcs may be under them
    """
    ahead = _ahead(piece)
    if ahead is None:
        return []
    off = aside - (aside @ ahead) * ahead
    if float(np.linalg.norm(off)) < SQUARE:
        return []
    length = float(np.linalg.norm(np.diff(piece.tips, axis=0), axis=1).sum())
    off /= np.linalg.norm(off)
    return [arc_onto(piece.tips[0], ahead, off, r, chord) for r in radii(tool.diameter, length) if r <= MAX_LEAD]
