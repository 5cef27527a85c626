"""From zones to workingsteps: layers, then the finish of every zone, tool by tool, measured along the way.

Stock may block a finish (``toolpath.planning.zone_finishing``) and be gone later. The zone then gets another
workingstep for what is missing: after the other zones of its tool, and, where more than the scallop is left, after the
last tool.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from geometry.mesh import F64
from toolpath.counterexamples import WatchedExamples
from toolpath.passes.pass_family import FinishTarget
from toolpath.passes.trimmed_faces import Faces
from toolpath.plan_checkpoint import (
    NOTHING,
    CheckpointKeeper,
    FinishSnapshot,
    LayersSnapshot,
    Lines,
    PackedLines,
    PlanSnapshot,
    SharedLines,
    ToolSnapshot,
)
from toolpath.plan_settings import CutData, PlanSettings
from toolpath.planning.depth_bands import largest_corner
from toolpath.planning.layouts_ahead import computed_ahead
from toolpath.planning.plan_history import PlanHistory
from toolpath.planning.tool_layers import ToolLayers
from toolpath.planning.zone_finishing import Finish, ZonePlan
from toolpath.planning.zone_layout import ZoneLayout, layouts_of
from toolpath.roughing.sized_walls import SizedWalls
from toolpath.stock.cut_history import Depths, Walked
from toolpath.stock.stock_map import StockMap
from toolpath.workingsteps import Workingstep
from zones.reach.tip_field import TipField
from zones.zoning.zones import ZoneArea

AGAIN_SHARE = 0.95  # of the progress, before zones are finished again

Progress = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class Plan:
    """Workingsteps in machining order and the outcome of each zone."""

    steps: tuple[Workingstep, ...]
    zones: tuple[ZonePlan, ...]


def plan_job(zones: Sequence[ZoneArea], checks: Sequence[FinishTarget], fields: Mapping[str, TipField],
             cut_data: dict[str, CutData], stock: StockMap, settings: PlanSettings,
             progress: Progress | None = None, first_step: int = 1,
             trimmed: Mapping[str, Sequence[Faces]] | None = None, keeper: CheckpointKeeper = NOTHING,
             layouts: Mapping[str, ZoneLayout] | None = None, history: PlanHistory | None = None) -> Plan:
    """Plan all zones.

    zones    : in machining order
    checks   : samples at which each zone is measured and judged, in the order of the zones
    fields   : TipField by tool id
    cut_data : CutData by tool id
    stock    : StockMap, lowered as the plan grows
    progress : called with the share done, 0 to 1
    first_step : number of the first workingstep
    trimmed  : exact faces by zone id, in the frame of the zones; other zones get no iso-parametric passes
    keeper   : called after each act; where it keeps an unfinished plan of the same inputs, that is continued with the
               same result as without the interruption
    layouts  : ZoneLayout by zone id, of an earlier plan of the same zones, checks, fields, cut data, tolerances and
               faces; None: laid out here
    history  : PlanHistory of an earlier plan of the same arguments but ``settings.found``, which only grows; this plan
               continues from a state of it, with the same result as from the beginning; None: nothing is kept

    Returns
    -------
    Plan
    """
    order = list(dict.fromkeys(z.tool.id for z in zones))
    check_of = {z.id: c for z, c in zip(zones, checks, strict=True)}
    if layouts is None:
        layouts = layouts_of(zones, checks, fields, cut_data, settings, trimmed or {})
    found = WatchedExamples.of(settings.found)
    settings = replace(settings, found=found)
    history = history or PlanHistory(max_bytes=0)
    under = largest_corner(zones)  # below each plane: stouter tools take off what the tips of later ones need away

    def begin(snapshot: PlanSnapshot | None = None) -> _Work:
        jobs = [_ToolJob([z for z in zones if z.tool.id == tid], check_of, fields[tid], cut_data[tid], stock, settings,
                         layouts, under) for tid in order]
        for k, job in enumerate(jobs):
            job.before = jobs[:k]
        return _Work(jobs, stock, settings, snapshot)

    work = keeper.taken(begin) or history.taken(found, begin) or begin()
    history.begin(found, work.acts)
    begun, all_zones, done = work.acts, len(zones) * (len(settings.planes) + 1), 0
    with computed_ahead([layouts[z.id] for z in zones] if settings.finishing and not begun else []) as settle:
        for job in work.jobs:
            job.settle = settle
        for k, (finished, act) in enumerate(work.to_do()):
            if k >= begun:
                settle()
                work.steps.extend(act(len(work.steps) + first_step))
                work.acts = k + 1
                keeper.done(work.snapshot)
                history.done(found.questions.taken(), work.state)
            done += finished
            if progress is not None:
                progress(AGAIN_SHARE * done / all_zones)
    if progress is not None:
        progress(1.0)
    return Plan(tuple(work.steps), tuple(f.plan() for job in work.jobs for f in job.begun))


Act = Callable[[int], list[Workingstep]]
"""An act of a plan: makes its workingsteps, given the number of the first."""


class _Work:
    """A plan in progress: acts done, the workingsteps they made, the state of each tool.

    snapshot : state of an interrupted plan of the same inputs, to continue from
    """

    def __init__(self, jobs: Sequence[_ToolJob], stock: StockMap, settings: PlanSettings,
                 snapshot: PlanSnapshot | None = None) -> None:
        self.jobs, self.stock, self.settings = jobs, stock, settings
        self.acts, self.steps = 0, list[Workingstep]()
        if snapshot is not None:
            self.acts, self.steps = snapshot.acts, list(snapshot.steps)
            made = {s.id: s for s in self.steps}
            for job, tool in zip(jobs, snapshot.tools, strict=True):
                job.restore(tool, made)
            stock.restore(snapshot.stock)  # last: the stock stays unchanged where the rest does not fit

    def snapshot(self) -> PlanSnapshot:
        """State of the plan."""
        return PlanSnapshot(self.acts, tuple(self.steps), self.stock.snapshot(),
                            tuple(job.snapshot() for job in self.jobs))

    def state(self) -> PlanSnapshot:
        """State of the plan, with the arrays that later acts write into."""
        return PlanSnapshot(self.acts, tuple(self.steps), self.stock.snapshot(),
                            tuple(job.snapshot(SharedLines.of) for job in self.jobs))

    def to_do(self) -> Iterator[tuple[int, Act]]:
        """All acts in their order, done or not, and how many zones of a band are finished with each."""
        settings = self.settings
        for plane in [*settings.planes, -math.inf]:
            # a tool also roughs for those after it, so it is left out only where none of these has work here
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
                    yield 0, partial(job.again, zone, settings.budget.done)
        for job in self.jobs:  # another tool removed the stock in the way: worth a tool change for the rest
            for zone in job.zones:
                yield 0, partial(job.again, zone, settings.scallop_height)


def _nothing_ahead() -> None:
    """Nothing is computed by other threads."""


def _nothing(number: int) -> list[Workingstep]:
    del number
    return []


class _ToolJob:
    """Work of one tool: its layers and the finish of its zones, band by band from the top."""

    def __init__(self, zones: Sequence[ZoneArea], checks: Mapping[str, FinishTarget], field: TipField, cut: CutData,
                 stock: StockMap, settings: PlanSettings, layouts: Mapping[str, ZoneLayout], under: float) -> None:
        self.zones, self.checks, self.field, self.cut, self.stock = zones, checks, field, cut, stock
        self.settings, self.layouts, self.under = settings, layouts, under
        self.walked, self.depths = Walked(), Depths(stock.lattice)
        self.layers: ToolLayers | None = None
        self.settle: Callable[[], None] = _nothing_ahead  # called now and then, see ``computed_ahead``
        self.layered: list[Workingstep] = []
        self.finishes: dict[str, Finish] = {}
        self.before: Sequence[_ToolJob] = ()  # of the tools before this one

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
        """The layers of a band that ends at a height of contact, mm, and the cuts that leave even stock.

        number : of the first of the workingsteps, of which there are two at most
        """
        if self.layers is None:
            self.layers = self._layers()
        made = self.layers.down_to(plane - self.under, number, self._sized_walls(), self.settle)
        self.layered.extend(made)
        for f in self.begun:
            for step in made:
                f.measure(step)
        return made

    def _sized_walls(self) -> SizedWalls:
        """The walls that this tool and those before it have brought to size so far, and the rest of them."""
        begun = [f for job in (*self.before, self) for f in job.begun]
        known = {f.zone.id for f in begun}
        rest = [self.checks[z.id] for z in self.zones if z.id not in known]
        return SizedWalls.of(self.field.tool, [
            *((f.checks, f.residual.residual <= self.settings.scallop_height) for f in begun),
            *((c, np.zeros(len(c.points), np.bool_)) for c in rest)])

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

    def again(self, zone: ZoneArea, min_left: float, number: int) -> list[Workingstep]:
        """Another finish of a begun zone, where more than ``min_left`` mm is left; number : of the first."""
        f = self.finishes.get(zone.id)
        return [] if f is None else f.walk_again(f"S{number:02d}", min_left)

    def snapshot(self, lines: Callable[[Sequence[F64]], Lines] = PackedLines.of) -> ToolSnapshot:
        """State of the tool; lines : makes one value of several lines."""
        return ToolSnapshot(lines(self.walked.ways), lines(self.depths.ways),
                       None if self.layers is None else self.layers.snapshot(), tuple(s.id for s in self.layered),
                       tuple(f.snapshot() for f in self.begun))

    def restore(self, snapshot: ToolSnapshot, steps: Mapping[str, Workingstep]) -> None:
        """Take over the state of an interrupted plan, before any work; steps : that it made, by id."""
        for way in snapshot.walked.lines():
            self.walked.add(way)
        for way in snapshot.depths.lines():
            self.depths.cut(way)
        self.layered = [steps[s] for s in snapshot.layered]
        if snapshot.layers is not None:
            self.layers = self._layers(snapshot.layers)
        zones = {z.id: z for z in self.zones}
        for there in snapshot.finishes:
            self.finishes[there.zone] = f = self._finish(zones[there.zone], there)
            f.layers = None if there.layers is None else steps[there.layers]

    def _layers(self, snapshot: LayersSnapshot | None = None) -> ToolLayers:
        return ToolLayers(self.zones, self.field, self.cut, self.stock, self.settings, self.depths, self.under,
                          snapshot)

    def _finish(self, zone: ZoneArea, snapshot: FinishSnapshot | None = None) -> Finish:
        return Finish(self.layouts[zone.id], self.stock, self.settings, self.walked, self.depths, snapshot)
