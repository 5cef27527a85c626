"""Walls finished by the flank of a tool that leans as they do (``toolpath.flank``), as motions with ways in and out.

A pass is one step of work: the tool comes down along its own axis beside the wall, goes to it, along it, off it, and up
along its axis again; where it turns to the next one it is outside of everything. What it would meet of part, fixtures
and stock is asked pose by pose; where that is something, the wall is left to the usual passes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.toolbody import ToolBody
from toolpath.family import Target
from toolpath.flank import ALONG, UP, Piece, Wall, Wanted, bands
from toolpath.motion import Motion, Trajectory
from toolpath.posed import Blocked
from toolpath.settings import CutData, PlanSettings, Turning
from toolpath.stock import StockMap
from toolpath.strategies.isoparametric import Faces, leveller
from zones.reach import Disc

NAME = "flank"
LEAST_SERVED = 0.5  # of a wall's lattice: a wall of which less is wanted is left to others
BORDER = 0.02  # of what is wanted, at either border of a band: a few places beyond it do not move it
LEAST_LEAN = math.radians(0.5)  # a wall that leans less is cut as well by the flank of an upright tool
LEAD = 0.5  # of the radius, off the wall, where the tool comes down and goes up; at most
MOST_LEAD = 1.5  # mm
THICK = 0.1  # of the diameter: what the flank may take off at once
LOOK = 0.25  # of the radius, between poses that are held against stock and part on the ways in and out
IN_FRONT = 0.5  # mm above the start of a cut where the approach slows down
UP_Z = np.array([0.0, 0.0, 1.0])
AROUND = np.array([[math.cos(a), math.sin(a)] for a in np.arange(12) * math.pi / 6])


@dataclass(frozen=True, eq=False)
class Flanked:
    """What flank passes of a zone would be.

    runs    : the trajectories of each pass, from the highest down
    refused : why walls have none, in words
    """

    runs: tuple[tuple[Trajectory, ...], ...]
    refused: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What a leaning tool must not meet, access frame.

    enters  : whether it enters part or fixtures
    turning : what the machine can do
    stock   : StockMap as it stands
    discs   : shank and holder with their clearance
    """

    enters: Blocked
    turning: Turning
    stock: StockMap
    discs: tuple[Disc, ...]

    def blocked(self, tips: F64, axes: F64, tool: ToolBody) -> NDArray[np.bool_]:
        """(n,) bool: poses in which it meets part, fixtures or table, or that the machine cannot take."""
        low = lowest(tips, axes, tool, self.discs, self.turning.up)
        return self.enters(tips, axes) | ~self.turning.stands(axes) | (low < self.turning.table)

    def met(self, tips: F64, axes: F64, tool: ToolBody, thick: float) -> NDArray[np.bool_]:
        """(n,) bool: poses at which stock is in shank or holder, or thicker than ``thick`` mm at the flank."""
        return loaded(self.stock, tips, axes, tool, self.discs, thick)


def flanked(faces: Sequence[Faces], target: Target, tool: ToolBody, cut: CutData, settings: PlanSettings,
            around: Surroundings, allowance: float) -> Flanked:
    """The flank passes for what of walls is wanted.

    faces     : of the zone, exact
    target    : Target; walls are wanted where its points are
    around    : Surroundings
    allowance : mm, to leave on the part
    """
    wanted = Wanted(settings.scallop_height, 0.25 * settings.chordal_tolerance, 0.25 * settings.chordal_tolerance)
    near, runs, refused = cKDTree(target.points), [], []
    for face in faces:
        try:
            for iso in face.over_square:
                wall = Wall(leveller(iso))
                pieces = _pieces(wall, near, target.spacing, tool, wanted, around, allowance)
                if isinstance(pieces, str):
                    refused.append(f"{face.name}: {pieces}")
                    continue
                for piece in pieces:
                    made = _run(piece, tool, cut, settings, around)
                    if isinstance(made, str):
                        refused.append(f"{face.name}: {made}")
                    else:
                        runs.append(made)
        except GeometryError as refusal:
            refused.append(f"{face.name}: {refusal.message}")
    return Flanked(tuple(runs), tuple(dict.fromkeys(refused)))


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


def loaded(stock: StockMap, tips: F64, axes: F64, tool: ToolBody, discs: Sequence[Disc],
           thick: float) -> NDArray[np.bool_]:
    """(n,) bool: poses at which stock stands in shank or holder, or deeper in the cutting part than ``thick`` mm.

    tips, axes : (n, 3) float64, mm and unit

    Each body is a bundle of places along its axis, in the middle and round it, two lattice steps apart; stock is in it
    where one of them lies under the cover of its cell. So what stands in a cell the wall runs through counts as
    stock: the cutting part is asked one and a half steps inside as well.
    """
    step = stock.lattice.step
    spacing, high = 2.0 * step, stock.highest
    inner = tool.radius - thick - 1.5 * step
    bodies = [(inner, tool.corner_radius + 0.0, tool.stickout), *((d.radius, d.height, math.inf) for d in discs)]
    out = np.zeros(len(tips), np.bool_)
    side = np.cross(axes, np.where(np.abs(axes[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(axes, side)
    for radius, begin, end in bodies:
        room = (high - float(tips[:, 2].min())) / max(float(axes[:, 2].min()), 1e-3) + max(radius, 0.0)
        top = min(end, max(room, begin))
        rings = np.linspace(0.0, max(radius, 0.0), int(np.ceil(max(radius, 0.0) / spacing)) + 1)
        for h in np.linspace(begin, top, int(np.ceil((top - begin) / spacing)) + 1):
            middle = tips + h * axes
            for ring in rings:
                for c, s in AROUND if ring > 0.0 else AROUND[:1]:
                    place = middle + ring * (c * side + s * other)
                    here = stock.lattice.inside(place)
                    under = stock.cover[stock.lattice.cells(place)] > place[:, 2]
                    out |= here & under
    return out


def _pieces(wall: Wall, near: cKDTree, spacing: float, tool: ToolBody, wanted: Wanted, around: Surroundings,
            allowance: float) -> list[Piece] | str:
    """The pieces of a wall's passes, from the highest band down, or why there are none, in words."""
    place, _, eta = wall.lattice(ALONG, UP)
    size = max(wall.length / ALONG, wall.height / UP)
    asked = near.query(place.reshape(-1, 3))[0].reshape(UP, ALONG) <= spacing + size
    if asked.mean() < LEAST_SERVED * np.ptp(eta):
        return f"{100.0 * asked.mean():.0f} % of it is wanted, too little for a pass along the whole"
    rows = np.repeat(eta, asked.sum(axis=1))
    low, high = (float(np.quantile(rows, q)) for q in (BORDER, 1.0 - BORDER))
    low, high = 0.0 if low < 2.0 / UP else low, 1.0 if high > 1.0 - 2.0 / UP else high
    out: list[Piece] = []
    made = bands(wall, tool, wanted, low, high, allowance)
    if min(float((b.poses(UP)[1] @ UP_Z).min()) for b in made) > math.cos(LEAST_LEAN):
        return "it is upright, and so would the tool be"
    for band in made:
        mine = asked[(eta >= band.low - 1e-9) & (eta <= band.high + 1e-9)].mean(axis=0) > 0.5
        pieces = band.pieces(lambda tip, axis: around.blocked(tip, axis, tool), wanted.chord, mine)
        out += [p.reversed() if _against(p) else p for p in pieces]
    return out or "the tool is nowhere free along it"


def _against(piece: Piece) -> bool:
    """Whether the wall is not on the right of the way, seen from the spindle: there a right-hand cutter climbs."""
    way = np.diff(piece.tips, axis=0)
    left = np.cross(0.5 * (piece.axes[1:] + piece.axes[:-1]), way)
    return float((left * 0.5 * (piece.away[1:] + piece.away[:-1])).sum()) < 0.0


def _run(piece: Piece, tool: ToolBody, cut: CutData, settings: PlanSettings,
         around: Surroundings) -> tuple[Trajectory, ...] | str:
    """A pass with its ways in and out, or why there is none, in words."""
    thick = THICK * tool.diameter
    piece = piece if settings.climb or settings.either_way else piece.reversed()
    if not around.turning.follows(piece.tips, piece.axes):
        return "the rotary axes do not get along it"
    met = around.met(*_filled(piece, LOOK * tool.radius), tool, thick)
    if met.any():
        return "there is more stock beside it than a flank may take off"
    ways = [_way_in(p, tool, settings, around, thick) for p in (piece, piece.reversed())]
    if ways[0] is None or ways[1] is None:
        return "the tool does not get there along its own axis"
    first, last = ways[0], ways[1][::-1]
    out: list[Trajectory] = []

    def go(motion: Motion, points: F64, feed: float, axis: F64) -> None:
        if float(np.linalg.norm(points[-1] - points[0])) > 1e-6:
            out.append(Trajectory(motion, np.ascontiguousarray(points), feed, np.tile(axis, (len(points), 1))))

    a, b = piece.axes[0], piece.axes[-1]
    high = float((first[0] - first[1]) @ a)
    slow = first[1] + min(IN_FRONT, high) * a
    go(Motion.APPROACH, np.array([first[0], slow]), cut.link_feed, a)
    go(Motion.APPROACH, np.array([slow, first[1]]), cut.plunge_feed, a)
    go(Motion.CONNECT, first[1:], cut.feed, a)
    out.append(Trajectory(Motion.CUT, piece.tips, cut.feed, piece.axes))
    go(Motion.CONNECT, last[:2], cut.feed, b)
    go(Motion.LIFT, last[1:], cut.link_feed, b)
    return tuple(out)


def _filled(piece: Piece, spacing: float) -> tuple[F64, F64]:
    """Poses of a piece with others between them, ``spacing`` mm apart at most at the tip."""
    tips, axes = [piece.tips[:1]], [piece.axes[:1]]
    for k in range(len(piece.tips) - 1):
        count = max(math.ceil(float(np.linalg.norm(piece.tips[k + 1] - piece.tips[k])) / spacing), 1)
        share = np.arange(1, count + 1)[:, None] / count
        tips.append((1.0 - share) * piece.tips[k] + share * piece.tips[k + 1])
        between = (1.0 - share) * piece.axes[k] + share * piece.axes[k + 1]
        axes.append(between / np.linalg.norm(between, axis=1, keepdims=True))
    return np.vstack(tips), np.vstack(axes)


def _way_in(piece: Piece, tool: ToolBody, settings: PlanSettings, around: Surroundings, thick: float) -> F64 | None:
    """(3, 3) mm: above everything, beside the beginning of a piece, and the beginning; None where none is free.

    Off the wall where there is room for that, else straight down along the flank.
    """
    axis, tip = piece.axes[0], piece.tips[0]
    aside = piece.away[0] - (piece.away[0] @ axis) * axis
    aside /= np.linalg.norm(aside)
    for lead, stock in ((min(LEAD * tool.radius, MOST_LEAD), 0.0), (0.25 * min(LEAD * tool.radius, MOST_LEAD), 0.0),
                        (0.0, thick)):
        beside = tip + lead * aside
        dip = tip[2] - float(lowest(tip[None], axis[None], tool, around.discs, UP_Z)[0])
        high = (settings.clearance + max(dip, 0.0) - beside[2]) / axis[2]
        if high <= 0.0:
            return None
        down = beside + np.linspace(high, 0.0, int(np.ceil(high / (LOOK * tool.radius))) + 5)[:, None] * axis
        over = beside + np.linspace(0.0, 1.0, 5)[:, None] * (tip - beside)
        axes = np.tile(axis, (len(down), 1))
        if around.blocked(down, axes, tool).any() or around.blocked(over, axes[:len(over)], tool).any():
            continue
        if not around.met(down, axes, tool, stock).any():
            return np.array([beside + high * axis, beside, tip])
    return None
