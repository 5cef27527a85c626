"""From zones to workingsteps: layers, then the finish of every zone, tool by tool, measured as it goes.

The passes of a zone are laid out by formula and then measured at the zone's samples; where more is left than
the budget allows, passes are put in between, only there, each time half as far apart. So the narrowest spot
never sets the step for a whole zone.

A pass is left out where shank or holder would meet stock that other zones still have to take off. Once that stock is
gone the zone gets another workingstep for what it lacks: after the other zones of its tool, and, where more than the
scallop is left, after the last tool.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.toolbody import ToolBody
from toolpath.border import beyond
from toolpath.family import Promise, Target
from toolpath.levels import Line, dilated
from toolpath.linking import FLUTE_SHARE, RAMP_SHARE, Linker, Motions, nearest_order
from toolpath.motion import Motion, Workingstep
from toolpath.residual import ResidualMap
from toolpath.stock import SKIN, StockMap
from toolpath.strategies import floor, layers, spot, zigzag, zlevel
from toolpath.strategies.zigzag import Pattern
from zones.machinable import Form
from zones.reach import TipField
from zones.zoning import ZoneArea

LAID_SHARE = 0.8  # of the allowed scallop, given to passes whose envelope is measured; program and facets take the rest
CUSP_SHARE = 0.55  # of the allowed scallop, given to the distance between passes; reach and chord take the rest
LINK_S = 1.2  # what going up, over and down again takes: links of the demo part, seconds each
PASS_SHARE = 0.85  # a sample is done when the measured residual is within this share of the scallop
REFINEMENTS = 4
AGAIN_SHARE = 0.95  # of the progress, before zones are gone over again
BORDER_SHARE = 0.1  # of the distance between passes on a plane: how well the border of an area is known
# A ring is right to one lattice step; the rest keeps it off the part after thinning to a tenth of a step.
LATTICE_CARE = 1.5

DRAGGED = (Pattern.ZIGZAG, Pattern.ONE_WAY, Pattern.SPIRAL)  # lines that come in their order of machining

Progress = Callable[[float], None]


@dataclass(frozen=True)
class CutData:
    """How fast one tool cuts: 1/min and mm/min; step_down in mm, the deepest layer it takes."""

    spindle_rpm: float
    feed: float
    plunge_feed: float
    link_feed: float
    step_down: float


@dataclass(frozen=True)
class PlanSettings:
    """Tolerances and heights of a plan; mm and rad.

    lift            : distance along the normal within which a touch counts as reach
    clearance       : height of rapid moves across
    rapid_floor     : height down to which a rapid may go
    either_way      : walls may be cut in both directions; climb : else climb, or conventional when False
    pattern         : of passes over shallow area
    """

    scallop_height: float
    chordal_tolerance: float
    stock_allowance: float
    lift: float
    clearance: float
    rapid_floor: float
    ramp_angle: float
    roughing: bool = True
    finishing: bool = True
    climb: bool = True
    either_way: bool = False
    pattern: Pattern = Pattern.AUTO


@dataclass(frozen=True, eq=False)
class ZonePlan:
    """What was planned for a zone.

    step     : id of its first finishing workingstep, None where nothing could be planned
    side_step: mm between passes as laid out
    passes   : cutting passes between links, of all its workingsteps
    left     : (k,) indices into the zone's checks that the planner's own measure finds above the budget
    rejected : other patterns with their figures
    """

    zone: ZoneArea
    step: str | None
    strategy: str
    side_step: float
    passes: int
    left: NDArray[np.int64]
    rejected: tuple[dict[str, object], ...] = ()


@dataclass(frozen=True, eq=False)
class Plan:
    """Workingsteps in machining order and what became of each zone."""

    steps: tuple[Workingstep, ...]
    zones: tuple[ZonePlan, ...]


def plan_job(zones: Sequence[ZoneArea], checks: Sequence[Target], fields: Mapping[str, TipField],
             cut_data: dict[str, CutData], stock: StockMap, settings: PlanSettings,
             progress: Progress | None = None, first_step: int = 1) -> Plan:
    """Plan all zones.

    zones    : in machining order
    checks   : what each zone is measured at and will be judged on, in the order of the zones
    fields   : TipField by tool id
    cut_data : CutData by tool id
    stock    : StockMap, lowered as the plan grows
    progress : called with the share done, 0 to 1
    first_step : number of the first workingstep

    Returns
    -------
    Plan
    """
    steps: list[Workingstep] = []
    begun: list[_Finish] = []
    order = list(dict.fromkeys(z.tool.id for z in zones))
    check_of = {z.id: c for z, c in zip(zones, checks, strict=True)}
    done = 0

    def following() -> str:
        return f"S{len(steps) + first_step:02d}"

    for tid in order:
        mine = [z for z in zones if z.tool.id == tid]
        field, cut = fields[tid], cut_data[tid]
        if settings.roughing:
            step = _layers(mine, field, cut, stock, settings, following())
            steps.extend([] if step is None else [step])
        own: list[_Finish] = []
        for zone in mine:
            if settings.finishing:
                own.append(_Finish(zone, check_of[zone.id], field, cut, stock, settings))
                steps.extend(own[-1].walk(following()))
            done += 1
            if progress is not None:
                progress(AGAIN_SHARE * done / len(zones))
        for f in own:
            steps.extend(f.walk_again(following(), PASS_SHARE * settings.scallop_height))
        begun.extend(own)
    for f in begun:  # stock that took another tool to get away: worth changing back for what would stay otherwise
        steps.extend(f.walk_again(following(), settings.scallop_height))
    if progress is not None:
        progress(1.0)
    return Plan(tuple(steps), tuple(f.plan() for f in begun))


def _motions(cut: CutData, settings: PlanSettings) -> Motions:
    return Motions(cut.feed, cut.plunge_feed, cut.link_feed, settings.clearance, settings.rapid_floor,
                   settings.ramp_angle, cut.step_down, 0.5 * settings.chordal_tolerance)


def _layers(zones: Sequence[ZoneArea], field: TipField, cut: CutData, stock: StockMap, settings: PlanSettings,
            step_id: str) -> Workingstep | None:
    """One workingstep that takes the stock above all zones of a tool off in depth layers."""
    lat, tool = field.lattice, field.tool
    tips = np.vstack([z.tips for z in zones])
    allowance = max(0.1 * cut.step_down, LATTICE_CARE * lat.step)
    linker = Linker(field, stock, _motions(cut, settings))
    walls = np.vstack([np.zeros((0, 3)), *(z.tips for z in zones if z.form is Form.STEEP)])
    chord = 0.5 * settings.chordal_tolerance
    bottom = float(tips[:, 2].min()) + allowance
    top = stock.highest
    if top <= bottom:
        return None
    swept, step = top, 0.85 * cut.step_down
    heights = layers.layer_heights(top, bottom, step)
    for z, below in zip(heights, _areas(field, tips, heights, step), strict=True):
        for lines in layers.layer(field, stock, z, below, allowance, 0.8 * tool.radius):
            for line in nearest_order(lines, linker.at, False):
                linker.add(_turned(line, settings), 0.1 * lat.step)
        finished = lat.mask(walls[np.abs(walls[:, 2] - z) <= 2.0 * cut.step_down, :2])
        unseen = z <= swept - FLUTE_SHARE * tool.flute_length
        swept = z if unseen else swept
        rims = layers.rim(field, stock, z, below, finished, allowance, chord, unseen)
        for line in nearest_order(rims, linker.at, False):
            linker.add(_turned(line, settings))
    if not linker.passes:
        return None
    ids = " ".join(z.id for z in zones)
    return _step(step_id, f"{step_id} layers {tool.id} {ids}", None, zones, "roughing", "layers", tool, cut,
                 0.8 * tool.radius, linker, settings)


def _areas(field: TipField, tips: F64, heights: Sequence[float], step: float) -> list[NDArray[np.bool_]]:
    """(ny, nx) bool a layer: where stock is to go down to it.

    That is where this tool has something to finish below, and where shank and holder come once the tool is down in
    any deeper layer: what stands there would meet them.

    tips    : (n, 3) float64, mm, what is finished; heights : mm, of the layers, descending
    """
    lat = field.lattice

    def own(z: float) -> NDArray[np.bool_]:
        mask = lat.mask(tips[tips[:, 2] <= z + 1e-6, :2])
        return dilated(mask, max(0.5 * field.tool.radius / lat.step, 1.5)) if mask.any() else mask

    out: list[NDArray[np.bool_]] = []
    rising = list(heights[::-1])
    for z in rising:
        area = own(z)
        for disc in field.discs:
            low = z + step - disc.height
            deeper = [k for k in range(len(out)) if rising[k] <= low]
            reach = own(low) | out[deeper[-1]] if deeper else own(low)
            if reach.any():
                area = area | dilated(reach, field.disc_radius(disc, 0.0) / lat.step)
        out.append(area)
    return out[::-1]


def _turned(line: Line, settings: PlanSettings) -> Line:
    """A line in climb order, the other way where the setup wants conventional milling."""
    return line if settings.climb or settings.either_way else line.reversed()


class _Finish:
    """The finish of one zone: walked once, and again where stock was in the way that is gone since.

    zone, checks, field, cut, stock, settings : as ``plan_job`` has them
    """

    def __init__(self, zone: ZoneArea, checks: Target, field: TipField, cut: CutData, stock: StockMap,
                 settings: PlanSettings) -> None:
        self.zone, self.field, self.cut, self.stock, self.settings = zone, field, cut, stock, settings
        self.given = len(checks.points)
        if len(checks.points) and zone.form is not Form.STEEP and not _has_floor(zone, field.tool):
            r = field.tool.corner_radius or field.tool.radius
            checks = checks.joined(beyond(field, checks, settings.lift, BORDER_SHARE * math.sqrt(
                8.0 * settings.scallop_height * r), zone.faces))
        self.checks = checks
        self.residual = ResidualMap(checks.points + settings.stock_allowance * checks.normals, checks.normals,
                                    margin=1.5 * settings.scallop_height)
        self.strategy = _strategy(zone, checks, field, cut, settings)
        self.step: str | None = None
        self.passes = 0
        self.met = np.zeros(len(checks.points), np.bool_)
        self.walked: set[bytes] = set()

    def walk(self, step_id: str) -> list[Workingstep]:
        """The workingstep of the zone; none where no pass is walked."""
        return self._rounds(step_id, np.ones(len(self.checks.points), np.bool_))

    def walk_again(self, step_id: str, least: float) -> list[Workingstep]:
        """A workingstep for samples with more than ``least`` mm left at which stock was in the way that is gone now."""
        k = np.flatnonzero(self.met & (self.residual.residual > least))
        freed = np.zeros(len(self.met), np.bool_)
        freed[k] = ~self.stock.meets_bodies(self.checks.tips[k], self.field.discs)
        return self._rounds(step_id, freed)

    def _rounds(self, step_id: str, wanted: NDArray[np.bool_]) -> list[Workingstep]:
        """All rounds for the samples ``wanted``, as one workingstep."""
        linker = Linker(self.field, self.stock, _motions(self.cut, self.settings))
        budget = PASS_SHARE * self.settings.scallop_height
        failing = np.flatnonzero(wanted & (self.residual.residual > budget))
        for k in range(REFINEMENTS + 2):
            if not len(failing):
                break
            for lines in self._groups(k, failing):
                self._add(linker, lines, k)
            failing = np.flatnonzero(wanted & (self.residual.residual > budget))
        self.met[failing] = self.stock.meets_bodies(self.checks.tips[failing], self.field.discs)
        if not linker.passes:
            return []
        zone, name = self.zone, self.strategy.name
        self.step, self.passes = self.step or step_id, self.passes + linker.passes
        faces = " ".join(f"F{f}" for f in zone.faces[:12])
        return [_step(step_id, f"{step_id} {zone.id} {name} {zone.tool.id} {faces}", zone.id, [zone], "finishing",
                      name, self.field.tool, self.cut, self.strategy.side_step, linker, self.settings)]

    def plan(self) -> ZonePlan:
        """What became of the zone."""
        left = np.flatnonzero(self.residual.residual[:self.given] > self.settings.scallop_height)
        return ZonePlan(self.zone, self.step, self.strategy.name, self.strategy.side_step, self.passes, left,
                        self.strategy.rejected)

    def _groups(self, k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
        if k > REFINEMENTS:
            return [spot.touches(self.field, self.checks.tips[failing])]
        return self.strategy.rounds(k, failing)

    def _add(self, linker: Linker, lines: list[Line], k: int) -> None:
        """Walk lines of round k and measure them."""
        tool, settings, name = self.field.tool, self.settings, self.strategy.name
        thin = min(0.5 * settings.chordal_tolerance, floor.EXACT) if name == "floor" else None
        skin, slope = SKIN * tool.diameter, RAMP_SHARE * math.tan(settings.ramp_angle)
        if name not in DRAGGED or k > REFINEMENTS:
            lines = nearest_order(lines, linker.at, settings.either_way)
        for line in lines:
            if name not in DRAGGED:
                line = _turned(line, settings)
            key = (np.round(line.points, 5) + 0.0).tobytes()
            if key in self.walked:  # what it left, it leaves again
                continue
            before, last = len(linker.trajectories), 0
            for layer in zigzag.skimmed(line, self.stock, tool, skin, slope):
                last = len(linker.trajectories)
                linker.add(layer, thin)
            cuts = [t.points for t in linker.trajectories[before:] if t.motion is Motion.CUT]
            for points in cuts:
                self.residual.cut(points, tool)
            whole = [t.points for t in linker.trajectories[last:] if t.motion is Motion.CUT]
            if sum(Line(p, False).length for p in whole) > line.length - 1e-3:
                self.walked.add(key)


def _has_floor(zone: ZoneArea, tool: ToolBody) -> bool:
    """Whether a zone is finished by a flat end that stands on it."""
    return zone.form is Form.LEVEL and tool.radius > tool.corner_radius


Rounds = Callable[[int, NDArray[np.int64]], list[list[Line]]]
"""Lines of round k for the samples (indices into the zone's checks) that still need some."""


@dataclass(frozen=True)
class _Strategy:
    """Name, distance between passes in mm, rounds, and what was considered and not taken."""

    name: str
    side_step: float
    rounds: Rounds
    rejected: tuple[dict[str, object], ...] = ()


def _strategy(zone: ZoneArea, checks: Target, field: TipField, cut: CutData,
              settings: PlanSettings) -> _Strategy:
    """How a zone is finished."""
    tool, chord, normals = field.tool, 0.5 * settings.chordal_tolerance, checks.normals
    cusp = CUSP_SHARE * settings.scallop_height
    if zone.form is Form.STEEP:
        step = zlevel.level_step(tool, normals, cusp, cut.step_down)

        def waterlines(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
            tips = checks.tips[failing]
            if k == 0:
                levels, window = zlevel.heights(float(tips[:, 2].max()), float(tips[:, 2].min()), step), step
            else:
                window = step / 2.0 ** k
                levels = zlevel.lowest_of_groups(tips[:, 2], window)
            return zlevel.waterlines(field, tips, levels, 1.001 * window, chord)

        return _Strategy("zlevel", step, waterlines)
    if _has_floor(zone, tool):

        def planes(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
            return floor.planes(field, checks.tips[failing], chord, k) if k <= floor.MOST_FINER else []

        return _Strategy("floor", 1.6 * (tool.radius - tool.corner_radius), planes)
    promise = Promise(LAID_SHARE * settings.scallop_height, settings.chordal_tolerance, 0.3 * tool.radius,
                      LINK_S * cut.feed / 60.0)
    layout = zigzag.laid(field, checks, promise, settings.pattern, settings.climb or settings.either_way)

    def dragged(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
        if k:
            return [layout.between(k, failing)]
        return [list(layout.lines) if len(failing) == len(checks.points) else layout.near(failing)]

    return _Strategy(str(layout.pattern), layout.side_step, dragged, tuple(
        {"strategy": str(other), "reason": "more way, links counted", "value": round(way, 1),
         "limit": round(layout.way, 1)} for other, way in layout.rejected))


def _step(step_id: str, name: str, zone: str | None, zones: Sequence[ZoneArea], operation: str, strategy: str,
          tool: ToolBody, cut: CutData, side_step: float, linker: Linker, settings: PlanSettings) -> Workingstep:
    faces = tuple(sorted({f for z in zones for f in z.faces}))
    tips = np.vstack([z.tips for z in zones])
    lo, hi = tips[:, :2].min(axis=0), tips[:, :2].max(axis=0)
    outline = np.array([lo, [hi[0], lo[1]], hi, [lo[0], hi[1]], lo])
    return Workingstep(step_id, name, zone, faces, operation, strategy, tool, cut.spindle_rpm, cut.feed, side_step,
                       settings.scallop_height, settings.chordal_tolerance, linker.finish(), outline,
                       max(z.top for z in zones), min(z.bottom for z in zones), settings.climb)
