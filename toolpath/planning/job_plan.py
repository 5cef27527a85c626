"""From zones to workingsteps: layers, then the finish of every zone, tool by tool, measured as it goes.

Where stock was in the way of a finish (``toolpath.planning.zone_finishing``) that is gone since, the zone gets another workingstep for
what it lacks: after the other zones of its tool, and, where more than the scallop is left, after the last tool.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from toolpath.feeds.feed_scheduling import Pace
from toolpath.linking.linker import FLUTE_SHARE, Linker
from toolpath.passes.contours import dilated
from toolpath.passes.pass_family import Target
from toolpath.passes.pass_order import nearest_order
from toolpath.passes.trimmed_faces import Faces
from toolpath.plan_checkpoint import NOTHING, FinishNow, Keeper, LayersNow, PlanNow, ToolNow, Ways
from toolpath.plan_settings import CutData, PlanSettings
from toolpath.planning.depth_bands import largest_corner
from toolpath.planning.zone_finishing import PASS_SHARE, Finish, ZonePlan, motions_of, step_of, turned
from toolpath.roughing.engagement_limited_clearing import Clearing
from toolpath.stock.cut_history import Depths, Walked
from toolpath.stock.engagement import SKIN_SHARE, UNBOUNDED
from toolpath.stock.stock_map import SURE_RIM, StockMap
from toolpath.strategies import depth_layers
from toolpath.tool_deflection import effective_diameter
from toolpath.workingsteps import Workingstep
from zones.machinable_area import AreaForm
from zones.reach.tip_field import TipField
from zones.zoning.zones import ZoneArea

AGAIN_SHARE = 0.95  # of the progress, before zones are gone over again
# A ring is right to one lattice step; the rest keeps it off the part after thinning to a tenth of a step.
THIN = 2.0  # scallops: what stands no farther off a wall is what a finish leaves
LATTICE_CARE = 1.5

Progress = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class Plan:
    """Workingsteps in machining order and what became of each zone."""

    steps: tuple[Workingstep, ...]
    zones: tuple[ZonePlan, ...]


def plan_job(zones: Sequence[ZoneArea], checks: Sequence[Target], fields: Mapping[str, TipField],
             cut_data: dict[str, CutData], stock: StockMap, settings: PlanSettings,
             progress: Progress | None = None, first_step: int = 1,
             trimmed: Mapping[str, Sequence[Faces]] | None = None, keeper: Keeper = NOTHING) -> Plan:
    """Plan all zones.

    zones    : in machining order
    checks   : what each zone is measured at and will be judged on, in the order of the zones
    fields   : TipField by tool id
    cut_data : CutData by tool id
    stock    : StockMap, lowered as the plan grows
    progress : called with the share done, 0 to 1
    first_step : number of the first workingstep
    trimmed  : exact faces by zone id, in the frame of the zones; zones that have none get no iso-parametric passes
    keeper   : told after each act; where it knows a plan of the very same inputs that was under way, that is gone on
               with, and ends as one that was never cut off

    Returns
    -------
    Plan
    """
    order = list(dict.fromkeys(z.tool.id for z in zones))
    check_of = {z.id: c for z, c in zip(zones, checks, strict=True)}
    under = largest_corner(zones)  # below each plane: stouter tools take off what the tips of later ones need away

    def begin(now: PlanNow | None = None) -> _Work:
        jobs = [_ToolJob([z for z in zones if z.tool.id == tid], check_of, fields[tid], cut_data[tid], stock, settings,
                         trimmed or {}, under) for tid in order]
        return _Work(jobs, stock, settings, now)

    work = keeper.taken(begin) or begin()
    begun, all_zones, done = work.acts, len(zones) * (len(settings.planes) + 1), 0
    for k, (finished, act) in enumerate(work.to_do()):
        if k >= begun:
            work.steps.extend(act(len(work.steps) + first_step))
            work.acts = k + 1
            keeper.done(work.now)
        done += finished
        if progress is not None and finished:
            progress(AGAIN_SHARE * done / all_zones)
    if progress is not None:
        progress(1.0)
    return Plan(tuple(work.steps), tuple(f.plan() for job in work.jobs for f in job.begun))


Act = Callable[[int], list[Workingstep]]
"""Something whole of a plan: given the number of the first workingstep it makes, these."""


class _Work:
    """A plan under way: acts done, the workingsteps they made, what each tool has done.

    now : how far one like this came, to go on from there
    """

    def __init__(self, jobs: Sequence[_ToolJob], stock: StockMap, settings: PlanSettings,
                 now: PlanNow | None = None) -> None:
        self.jobs, self.stock, self.settings = jobs, stock, settings
        self.acts, self.steps = 0, list[Workingstep]()
        if now is not None:
            self.acts, self.steps = now.acts, list(now.steps)
            made = {s.id: s for s in self.steps}
            for job, there in zip(jobs, now.tools, strict=True):
                job.go_on(there, made)
            stock.go_on(now.stock)  # last, for it is not made anew where the rest does not fit

    def now(self) -> PlanNow:
        """How far it is."""
        return PlanNow(self.acts, tuple(self.steps), self.stock.now(), tuple(job.now() for job in self.jobs))

    def to_do(self) -> Iterator[tuple[int, Act]]:
        """All acts in their order, done or not, and how many zones of a band are finished with each."""
        settings = self.settings
        for plane in [*settings.planes, -math.inf]:
            # a tool takes stock off for those after it too, so it is left out only where none of these has work here
            last = max((k for k, job in enumerate(self.jobs) if job.has_work(plane)), default=-1)
            for k, job in enumerate(self.jobs):
                if k <= last and settings.roughing:
                    yield 0, partial(job.layer, plane)
                if k > last or not settings.finishing:
                    yield len(job.zones), _nothing
                    continue
                for zone in job.zones:
                    yield 1, partial(job.finish, zone, plane)
                for zone in job.zones:
                    yield 0, partial(job.again, zone, PASS_SHARE * settings.scallop_height)
        for job in self.jobs:  # stock that took another tool to get away: worth changing back for what would stay else
            for zone in job.zones:
                yield 0, partial(job.again, zone, settings.scallop_height)


def _nothing(number: int) -> list[Workingstep]:
    del number
    return []


class _ToolJob:
    """What one tool does: its layers and the finish of its zones, band by band from the top."""

    def __init__(self, zones: Sequence[ZoneArea], checks: Mapping[str, Target], field: TipField, cut: CutData,
                 stock: StockMap, settings: PlanSettings, trimmed: Mapping[str, Sequence[Faces]], under: float) -> None:
        self.zones, self.checks, self.field, self.cut, self.stock = zones, checks, field, cut, stock
        self.settings, self.trimmed, self.under = settings, trimmed, under
        self.walked, self.depths = Walked(), Depths(stock.lattice)
        self.layers: _Layers | None = None
        self.layered: list[Workingstep] = []
        self.finishes: dict[str, Finish] = {}

    @property
    def begun(self) -> list[Finish]:
        """The zones that have been begun, in machining order."""
        return [self.finishes[z.id] for z in self.zones if z.id in self.finishes]

    def has_work(self, plane: float) -> bool:
        """Whether anything of its zones is above a height, mm, and was not above the plane before."""
        above = [h for h in self.settings.planes if h > plane]
        top = min(above, default=math.inf)
        return plane == -math.inf or any(
            bool(((z[:, 2] >= plane) & (z[:, 2] < top)).any()) for z in (self.checks[a.id].points for a in self.zones))

    def layer(self, plane: float, number: int) -> list[Workingstep]:
        """The layers of a band that ends at a height of contact, mm, and what follows to leave even stock.

        number : of the first of the workingsteps, of which there are two at most
        """
        if self.layers is None:
            self.layers = self._layers()
        made = self.layers.down_to(plane - self.under, number)
        self.layered.extend(made)
        for f in self.begun:
            for step in made:
                f.measure(step)
        return made

    def finish(self, zone: ZoneArea, plane: float, number: int) -> list[Workingstep]:
        """The finish of a zone down to a height, mm; number : of the first of the workingsteps."""
        self.stock.settle()
        f = self.finishes.get(zone.id)
        if f is None:
            f = self._finish(zone)
            for layered in self.layered:
                f.measure(layered)
            self.finishes[zone.id] = f
        wanted = None if plane == -math.inf and not self.settings.planes else f.above(plane)
        return f.walk(f"S{number:02d}", wanted)

    def again(self, zone: ZoneArea, least: float, number: int) -> list[Workingstep]:
        """Another go at a zone that has been begun, where more than ``least`` mm is left; number : of the first."""
        f = self.finishes.get(zone.id)
        return [] if f is None else f.walk_again(f"S{number:02d}", least)

    def now(self) -> ToolNow:
        """How far it is."""
        return ToolNow(Ways.of(self.walked.ways), Ways.of(self.depths.ways),
                       None if self.layers is None else self.layers.now(), tuple(s.id for s in self.layered),
                       tuple(f.now() for f in self.begun))

    def go_on(self, now: ToolNow, steps: Mapping[str, Workingstep]) -> None:
        """Become what one like this, that had done nothing, had come to; steps : that were made, by id."""
        for way in now.walked.lines():
            self.walked.add(way)
        for way in now.depths.lines():
            self.depths.cut(way)
        self.layered = [steps[s] for s in now.layered]
        if now.layers is not None:
            self.layers = self._layers(now.layers)
        zones = {z.id: z for z in self.zones}
        for there in now.finishes:
            self.finishes[there.zone] = f = self._finish(zones[there.zone], there)
            f.layers = None if there.layers is None else steps[there.layers]

    def _layers(self, now: LayersNow | None = None) -> _Layers:
        return _Layers(self.zones, self.field, self.cut, self.stock, self.settings, self.depths, self.under, now)

    def _finish(self, zone: ZoneArea, now: FinishNow | None = None) -> Finish:
        return Finish(zone, self.checks[zone.id], self.field, self.cut, self.stock, self.settings,
                      self.trimmed.get(zone.id, ()), self.walked, self.depths, now)


class _Layers:
    """The stock above all zones of a tool, taken off in depth layers, some of them at a time."""

    def __init__(self, zones: Sequence[ZoneArea], field: TipField, cut: CutData, stock: StockMap,
                 settings: PlanSettings, depths: Depths, under: float, now: LayersNow | None = None) -> None:
        self.zones, self.field, self.cut, self.stock = zones, field, cut, stock
        self.settings, self.depths = settings, depths
        lat, tool = field.lattice, field.tool
        self.tips = tips = np.vstack([z.tips for z in zones])
        self.allowance = max(0.1 * cut.step_down, LATTICE_CARE * lat.step)
        # without a finish to follow, rims take every wall to size layer by layer, where what is below still holds it
        steep = [z.tips for z in zones if z.form is AreaForm.STEEP and settings.finishing]
        self.walls = np.vstack([np.zeros((0, 3)), *steep])
        self.bounded = cut.engaged < UNBOUNDED
        # the finish of a floor has the whole front in what is left on it
        low = min(self.allowance, 0.5 * SKIN_SHARE * tool.radius) if self.bounded else self.allowance
        bottom, step = float(tips[:, 2].min()) + low, 0.85 * cut.step_down
        self.top = top = stock.highest if now is None else now.top
        self.swept, self.above = (top, top) if now is None else (now.swept, now.above)
        self.left: list[tuple[float, NDArray[np.bool_]]] = []
        if top <= bottom or now is not None and not now.left:
            return
        heights = depth_layers.layer_heights(top, bottom, step)
        also = [f.bottom + low for f in zones if f.form is AreaForm.LEVEL] if self.bounded else []
        also += [plane - under for plane in settings.planes]
        if also:
            heights = sorted({*heights, *(z for z in also if bottom < z < top)}, reverse=True)
        self.left = list(zip(heights, _areas(field, tips, heights, step), strict=True))
        if now is not None:
            del self.left[:-now.left]

    def now(self) -> LayersNow:
        """How far they are."""
        return LayersNow(self.top, self.swept, self.above, len(self.left))

    def down_to(self, lowest: float, number: int) -> list[Workingstep]:
        """The layers from ``lowest`` mm up that were not walked before, as one workingstep, and where even stock is to
        stay another of those between them; number : of the first."""
        field, cut, settings, tool, lat = self.field, self.cut, self.settings, self.field.tool, self.field.lattice
        linker = self._linker()
        chord = 0.5 * settings.chordal_tolerance
        between: list[float] = []
        while self.left and self.left[0][0] >= lowest - 1e-9:
            z, below = self.left.pop(0)
            self.stock.settle()
            between.extend(depth_layers.between(self.above, z, cut.step_down))
            self.above = z
            self._walk(linker, z, below)
            finished = lat.mask(self.walls[np.abs(self.walls[:, 2] - z) <= 2.0 * cut.step_down, :2])
            unseen = z <= self.swept - FLUTE_SHARE * tool.flute_length
            self.swept = z if unseen else self.swept
            rims = depth_layers.rim(field, self.stock, z, below, finished, self.allowance, chord, unseen,
                              min(THIN * settings.scallop_height, 0.5 * self.allowance) if settings.finishing else 0.0)
            deep = FLUTE_SHARE * tool.flute_length if unseen else cut.step_down
            usual, linker.pace = linker.pace, self._rim_pace(deep)
            for line in nearest_order(rims, linker.at, False):
                linker.add(turned(line, settings))
            linker.pace = usual
        made = self._step(number, "roughing", linker)
        if not settings.semi_finishing:
            return made
        linker = self._linker()
        for z in between:
            self._walk(linker, z, _own(field, self.tips, z))
        return made + self._step(number + len(made), "semi_finishing", linker)

    def _rim_pace(self, depth: float) -> Pace:
        """Feeds along a wall that is taken to size, so deep, mm: bending the tool no more than a finish may.

        What stock does not show is no wider than its lattice can hide, what it shows is wider by that at most, and
        beside a wall no wider than the allowance. In a slot too narrow for a ring a rim is all there is: there the feed
        is that of layers.
        """
        cut, tool, hides = self.cut, self.field.tool, SURE_RIM * self.field.lattice.step
        fine = cut.finish or cut
        widest = fine.under(depth, self.allowance).feed

        def seen(deep: float, angle: float) -> float:
            wide = 0.5 * tool.diameter * (1.0 - math.cos(angle)) + hides
            least = widest if wide >= self.allowance else fine.under(depth, wide).feed
            return min(least, cut.feed_under(tool, deep, angle))

        return Pace(min(cut.feed, widest), cut.link_feed, seen, cut.step_down, fine.under(depth, hides).feed)

    def _thinner(self) -> CutData:
        """The cut of what stands between layers: a slot at most, a part of a layer deep."""
        depth = depth_layers.EVEN * self.cut.step_down
        return self.cut.under(depth, 0.5 * effective_diameter(self.field.tool.diameter, self.field.tool.corner_radius,
                                                              depth))

    def _linker(self) -> Linker:
        cut, tool = self.cut, self.field.tool
        pace = Pace(cut.feed, cut.link_feed, partial(cut.feed_under, tool), cut.step_down)
        return Linker(self.field, self.stock, motions_of(cut, self.settings), self.depths, self.settings.found, pace,
                      cut.engaged)

    def _walk(self, linker: Linker, z: float, area: NDArray[np.bool_]) -> None:
        """Go over the stock that stands above a height, mm, in an area, down to it."""
        settings, side, fine = self.settings, 0.8 * self.field.tool.radius, 0.1 * self.field.lattice.step
        if self.bounded:
            Clearing(linker, z, area, self.allowance, side, settings.climb, settings.either_way, depth_layers.STOCK_WORTH,
                     fine).walk()
        for lines in depth_layers.layer(self.field, self.stock, z, area, self.allowance, side):
            for line in nearest_order(lines, linker.at, False):
                linker.add(turned(line, settings), fine)

    def _step(self, number: int, operation: str, linker: Linker) -> list[Workingstep]:
        """What a linker walked as a workingstep; none where that is nothing."""
        if not linker.passes:
            return []
        step_id, tool, ids = f"S{number:02d}", self.field.tool, " ".join(z.id for z in self.zones)
        kind, cut = ("depth_layers", self.cut) if operation == "roughing" else ("between layers", self._thinner())
        return [step_of(step_id, f"{step_id} {kind} {tool.id} {ids}", None, self.zones, operation, "depth_layers", tool,
                        cut, 0.8 * tool.radius, linker.finish(), self.settings)]


def _own(field: TipField, tips: F64, z: float) -> NDArray[np.bool_]:
    """(ny, nx) bool: where of the tips (n, 3), mm, that are finished, some lie at a height or lower."""
    lat = field.lattice
    mask = lat.mask(tips[tips[:, 2] <= z + 1e-6, :2])
    return dilated(mask, max(0.5 * field.tool.radius / lat.step, 1.5)) if mask.any() else mask


def _areas(field: TipField, tips: F64, heights: Sequence[float], step: float) -> list[NDArray[np.bool_]]:
    """(ny, nx) bool a layer: where stock is to go down to it.

    That is where this tool has something to finish below, and where shank and holder come once the tool is down in
    any deeper layer: what stands there would meet them.

    tips    : (n, 3) float64, mm, what is finished; heights : mm, of the layers, descending
    """
    lat = field.lattice
    out: list[NDArray[np.bool_]] = []
    rising = list(heights[::-1])
    for z in rising:
        area = _own(field, tips, z)
        for disc in field.discs:
            low = z + step - disc.height
            deeper = [k for k in range(len(out)) if rising[k] <= low]
            reach = _own(field, tips, low) | out[deeper[-1]] if deeper else _own(field, tips, low)
            if reach.any():
                area = area | dilated(reach, field.disc_radius(disc, 0.0) / lat.step)
        out.append(area)
    return out[::-1]
