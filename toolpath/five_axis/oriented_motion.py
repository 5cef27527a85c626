"""Passes of a tilted tool as motions: where they are free of stock, their feeds, their ways in and out.

A pass is one step of work. The tool comes down along its own axis beside the beginning, moves to it, along the pass,
off it, and up along its axis again. It turns to the next pass outside of everything. On and off a wall that its flank
cuts it moves on an arc where there is room (``toolpath.linking.lead_arcs``). Each pose is checked against part,
fixtures and stock.

Arrays are float64. Tips are in mm, axes dimensionless unit vectors from tip to spindle, both in the access frame.
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

TURN_S = 4.0  # s to move outside of everything, turn there and come back
LEAD = 0.5  # radii off the surface, at most, where the tool comes down and goes up
MAX_LEAD = 1.5  # mm
THICK = 0.12  # diameters: depth of stock that a tilted tool may take at once
LOOK = 0.25  # radii between poses that are checked against stock and part on the ways in and out
MIN_UP = 0.1  # upward part of an axis: a flatter tool does not get above everything along its axis
MIN_WAY = 1e-3  # mm across the axis that give the direction of a pass
SQUARE = 0.7  # part of the direction off the wall square to the pass: with less the pass does not follow the wall
IN_FRONT = 0.5  # mm above the start of a cut where the approach slows down
UP_Z = np.array([0.0, 0.0, 1.0])
ROUND_END = 0.5  # of the corner, from the rim in: there the end is steeper than 30 degrees and cuts sideways
STEEPER = 1e-6  # mm of a step: rounding of the ramp angle
DIP = 0.5  # share of the skin that a pass may descend steeper than the ramp
SKIMMED = 0.75  # share of the skin that may stand under a steeper descent: it adds up along a way
LAYER, MAX_LAYERS = 0.9, 24  # layer height as a share of the depth that the end may take; number of layers
WIDENED = 1.5  # radii: least length of a layer that is extended before and behind
CELLS = 1.5  # lattice steps in from the flank, where nodes in the wall are no longer met
LOADED = "more stock stands in the way than a tilted tool may remove at once"
STEADY = 0.8  # ratio between feeds of neighbouring blocks
MIN_FEED = 0.1  # mm/min
MIN_PACE = 0.01  # share of the feed: a slower tip beside its flank almost stands


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Obstacles of a tilted tool, access frame.

    enters  : whether the tool enters part or fixtures
    turning : RotaryAxes of the machine
    stock   : StockMap as it stands; passes lower it one after the other
    discs   : shank and holder with their clearance
    clear   : Clearances
    skins   : thin material on the samples of the zone, lowered likewise; None where it is not measured
    """

    enters: Blocked
    turning: RotaryAxes
    stock: StockMap
    discs: tuple[Disc, ...]
    clear: Clearances
    skins: Skins | None = None

    def blocked(self, tips: F64, axes: F64, tool: ToolBody) -> NDArray[np.bool_]:
        """Whether poses meet part, fixtures or table, or cannot be taken by the machine, (n,) bool.

        tips, axes : (n, 3) float64, mm and unit, access frame
        """
        low = lowest(tips, axes, tool, self.discs, self.turning.up)
        lies = np.minimum(axes @ self.turning.up, axes[:, 2]) < MIN_UP
        return self.enters(tips, axes) | lies | ~self.turning.stands(axes) | (low < self.turning.table)

    def met(self, tips: F64, axes: F64, tool: ToolBody, thick: float, under: float | None = None) -> NDArray[np.bool_]:
        """Whether stock stands in the tool at poses, (n,) bool, as ``loaded`` counts it, or neck, shank or holder may
        be in a skin.

        tips, axes : (n, 3) float64, mm and unit, access frame
        thick      : mm, depth of stock that the flank may take
        under      : mm, stock that may stand under the end; None as in ``loaded``
        """
        out = loaded(self.stock, tips, axes, tool, self.discs, self.clear, thick, under)
        free = np.flatnonzero(~out)
        if self.skins is not None and len(free):
            out[free] = self.skins.near(tips[free], axes[free], tool, self.discs, self.clear)
        return out

    def copied(self) -> Surroundings:
        """A copy with its own stock."""
        return replace(self, stock=self.stock.copied(), skins=None if self.skins is None else self.skins.copied())

    def become(self, other: Surroundings) -> None:
        """Takes over the stock of a copy."""
        self.stock.become(other.stock)
        if self.skins is not None and other.skins is not None:
            self.skins.become(other.skins)

    def cut(self, tips: F64, axes: F64, tool: ToolBody) -> None:
        """Removes a pass from stock and skins.

        tips, axes : (n, 3) float64, mm and unit, access frame
        """
        self.stock.cut_leaning(tips, axes, tool)
        if self.skins is not None:
            self.skins.cut_leaning(tips, axes, tool)


@dataclass(frozen=True, eq=False)
class Runs:
    """Passes of a tilted tool.

    runs    : the trajectories of each pass, in the order of machining
    refused : reasons for passes that are missing
    """

    runs: tuple[tuple[Trajectory, ...], ...]
    refused: tuple[str, ...]


def in_turn(found: Sequence[tuple[str, Piece]], tool: ToolBody, cut: CutData, settings: PlanSettings,
            around: Surroundings, divided: float = math.inf) -> Runs:
    """Passes as far as they can be cut one after the other, each in the stock that the earlier ones leave.

    found   : name of the face and pass, for each
    around  : Surroundings; its stock is lowered
    divided : mm; a longer pass that cannot be cut as a whole is cut in halves; such passes are layered already
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
    """The parts of a pass that are cut, removed from the stock, and the reasons for the rest."""
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
    """Lowest point of a tool along ``up``, with shank and holder grown by their clearance, (n,) float64, mm.

    tips, axes : (n, 3) float64, mm and unit, access frame, tilted less than 90 degrees off ``up``
    up         : (3,) float64, unit, access frame
    """
    rise = axes @ up
    lean = np.sqrt(np.maximum(1.0 - rise * rise, 0.0))
    out = tool.corner_radius * (rise - 1.0) - (tool.radius - tool.corner_radius) * lean
    for d in discs:
        out = np.minimum(out, d.height * rise - d.radius * lean)
    return np.asarray(tips @ up + out)


def loaded(stock: StockMap, tips: F64, axes: F64, tool: ToolBody, discs: Sequence[Disc], clear: Clearances,
           thick: float, under: float | None = None) -> NDArray[np.bool_]:
    """Whether stock stands in neck, shank or holder at poses, or deeper in the cutting part than ``thick`` mm, (n,)
    bool.

    tips, axes : (n, 3) float64, mm and unit, access frame
    thick      : mm, depth of stock in the flank
    under      : mm, stock under the end of the tool; None: as much as ``thick``, but no more than a skin

    Notes
    -----
    Bodies are places on their shells (``toolpath.stock.tool_shell``). Stock is the height at the nearest node, half a
    cell aside. Stock less than 1.5 steps deep in the cutting part does not count, since nodes in the wall lie there.
    Where that is more than twice ``thick`` the lattice is too coarse, and every pose counts as loaded.
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
    """A pass on the end of a tool, preceded by raised copies of itself where more stands over it than the end takes at
    once.

    The highest layer comes first. Where ``MAX_LAYERS`` are not enough a place is left out of all of them, and
    ``free_parts`` leaves it out of the pass itself. A pose that is free of part and fixtures stays free when raised
    along its axis.
    """
    return [layer for _, layer in layers_over(piece, tool, around)]


def layers_over(piece: Piece, tool: ToolBody, around: Surroundings,
                share: float = LAYER, widened: bool = False) -> list[tuple[int, Piece]]:
    """The layers of ``lowered`` with the number of layers each is raised by; 0 for the pass itself, which is last.

    share   : layer height as a share of the depth that the end may take
    widened : a layer too short to be cut is extended before and behind; else it is left out. The layers then leave so
              little under the pass that it may go downhill (``free_parts``)
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
    """The parts of a pass with no more stock beside the tool than its flank may take, and none in neck, shank and
    holder.

    Over obstacles on the floor a flank is raised along its axis. Where it goes down steeper than the ramp, as behind an
    obstacle, the end of the tool would dig. A flank cuts that part in the other direction, uphill; a pass on the end
    leaves it out.

    skims : a pass on the end may go downhill over no more than most of a skin, as an upright one does: axes that turn
            less than the surface go down on one side of each wave of it
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
    return [p.at(thinned_poses(p.tips, p.axes, p.reach, settings.budget.rounding).astype(np.float64))
            for p in parts if p is not None]


def _begun_level(piece: Piece, slope: float, min_length: float) -> Piece | None:
    """A part without its ends that go down along the axis steeper than ``slope``; None if shorter than ``min_length``
    mm.

    Fresh stock stands at an end: over the brink of a valley the tool would dig into it, however short the descent.
    """
    steep = _steps_down(piece, slope)[1]
    level = np.flatnonzero(~steep)
    if not len(level):
        return None
    kept = piece.at(np.arange(level[0], level[-1] + 2, dtype=np.float64))
    return kept if kept.length >= min_length else None


def _steps_down(piece: Piece, slope: float) -> tuple[F64, NDArray[np.bool_]]:
    """(n - 1,) mm that each step goes down along the axis, and (n - 1,) bool whether steeper than ``slope``."""
    way, axis = np.diff(piece.tips, axis=0), 0.5 * (piece.axes[1:] + piece.axes[:-1])
    down = np.asarray(-(way * axis).sum(axis=1))
    return down, down > slope * np.linalg.norm(way + down[:, None] * axis, axis=1) + STEEPER


def _descends(piece: Piece, slope: float, allowed: float) -> NDArray[np.bool_]:
    """Whether poses lie on a descent along the axis steeper than ``slope`` that removes more than ``allowed`` mm, (n,)
    bool."""
    down, steep = _steps_down(piece, slope)
    out = np.zeros(len(piece.tips), np.bool_)
    for i, j in true_runs(steep):
        out[i:j + 1] |= down[i:j].sum() > allowed
    return out


def with_ways(piece: Piece, tool: ToolBody, cut: CutData, settings: PlanSettings,
              around: Surroundings) -> tuple[Trajectory, ...] | str:
    """A pass with its ways in and out, or the reason why there is none."""
    thick, chord = THICK * tool.diameter, settings.budget.rounding
    walked = around.turning.along(piece.tips, piece.axes)
    if walked is None:
        return "the rotary axes cannot follow the pass"
    tips, axes, least = walked
    feeds = paced(tips, axes, piece.reach, cut.feed, least)
    if feeds is None:
        return "the tip would almost stand still while the flank or a rotary axis turns"
    dense = Piece(tips, axes, axes, piece.reach).at(places_along(tips, axes, piece.reach, LOOK * tool.radius))
    if around.met(dense.tips, dense.axes, tool, thick).any():
        return LOADED
    straight_up = [(tips[-1:], thick, SKIN * tool.diameter)]  # where it has been it may go as it stands
    back = piece.reversed()
    ways = [_way_in(piece, tool, settings, around, _leads(piece, tool, thick, chord)),
            _way_in(back, tool, settings, around, straight_up if piece.on_end else _leads(back, tool, thick, chord))]
    if ways[0] is None or ways[1] is None:
        return "the tool cannot reach the pass along its own axis"
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


def paced(tips: F64, axes: F64, reach: float, feed: float, min_minutes: F64) -> F64 | None:
    """Feeds of the tip, (n - 1,) float64, mm/min: no place of the flank exceeds ``feed``, and the machine keeps up.

    tips, axes  : (n, 3) float64, mm and unit, access frame
    reach       : mm from the tip, how far up the flank cuts
    min_minutes : (n - 1,) float64, min, shortest time of each block on the machine

    Returns None where the tip would be slower than ``MIN_PACE`` of the feed for the sake of the flank, or slower than
    ``MIN_FEED`` in a block: an almost standing tip does not define how long an axis takes to turn. On a straight move
    of the tip with an evenly turning axis no place between tip and ``reach`` moves farther than the farther of both
    ends.
    """
    gone = [np.linalg.norm(np.diff(tips + h * axes, axis=0), axis=1) for h in (0.0, reach)]
    minutes = np.maximum(gone[0], gone[1]) / feed
    if gone[0].sum() < MIN_PACE * feed * minutes.sum():
        return None
    minutes = np.maximum(minutes, min_minutes)
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

    The third value is the height, mm, above the beginning of that way down to which nothing stands near the tool. The
    tool comes down beside the beginning where there is room. Else it comes straight down: along a wall where its end is
    round enough not to dig, and on its end where there is no more than a skin under it. Beside a wall it comes down
    into no more than a skin where no way is free of stock.
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
    """Height above the end of a way down, mm, from where on something may stand in the cells at the rim of the tool.

    down, axes : (n, 3) float64, mm and unit, access frame, the last at the bottom
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
    ways = [*_arcs_onto(piece, tool, aside, chord), straight(room * aside), straight(0.25 * room * aside)]
    # over a floor that is finished later the pass takes a skin under its end, and so does the way to it
    return [*((way, 0.0, 0.0) for way in ways), *down_the_wall, *((way, 0.0, skin) for way in ways)]


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
