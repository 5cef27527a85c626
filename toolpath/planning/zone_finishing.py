"""The finish of one zone: its strategy, cut round by round until the residual is small enough, and the choice of
strategy.

Formulas lay out the passes of a zone; the residual is then measured at the zone's samples. Where more is left than the
budget allows, passes are added between, only there, each round half as far apart. So the narrowest spot never sets the
step for a whole zone.

A pass is left out where shank or holder would meet stock that other zones still have to remove.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.feeds.feed_changes import with_few_changes
from toolpath.five_axis.oriented_motion import TURN_S, Runs, Surroundings
from toolpath.five_axis.oriented_pass import enters
from toolpath.lines import Line, thinned, true_runs
from toolpath.linking.linker import Linker
from toolpath.linking.ramp_entry import RAMP_SHARE
from toolpath.linking.rapid_travel import Motions
from toolpath.passes.needed_lines import Reach, needed
from toolpath.passes.pass_order import nearest_order
from toolpath.plan_checkpoint import FinishSnapshot
from toolpath.plan_settings import CutData, PlanSettings
from toolpath.planning.candidates import compared
from toolpath.planning.layouts_ahead import side_by_side
from toolpath.planning.zone_layout import Rounds, Strategy, ZoneLayout, linked
from toolpath.poses import Blocked
from toolpath.stock.cut_history import Depths, Walked, still_to_walk
from toolpath.stock.engagement import UNBOUNDED
from toolpath.stock.residual_map import ResidualMap
from toolpath.stock.stock_map import SKIN, StockMap
from toolpath.stock.wall_skin import Skins
from toolpath.strategies import (
    curvature_matched,
    flank,
    inclined_axis,
    planar_floor,
    touch_points,
    zigzag,
)
from toolpath.workingsteps import Trajectory, TrajectoryKind, Workingstep
from zones.machinable_area import AreaForm
from zones.zoning.zones import ZoneArea

REFINEMENTS = 4
LEANING = frozenset((flank.NAME, curvature_matched.NAME, inclined_axis.NAME))  # strategies of a tool that leans
SPARED = 0.25  # of the scallop: where other lines leave no more, a line is not needed
OVERRUN = 0.3  # radii that a line runs past the last sample that needs it
WHOLE = 0.5  # of the samples: where more need lines, those laid out for all are there already
MIN_AGAIN = 4  # moves that a line repeats before they are left out
AS_IT_IS = 1e-9  # mm, tolerance of a line that is thinned out already


@dataclass(frozen=True, eq=False)
class ZonePlan:
    """Plan of a zone.

    step     : id of its first finishing workingstep, of the layers where these leave nothing to finish; None where
               nothing could be planned
    side_step: mm between passes as laid out
    passes   : count of cutting passes between links, in all its workingsteps
    left     : (k,) int64, index of the zone's checks that the planner measures above the budget
    rejected : other patterns with their figures
    """

    zone: ZoneArea
    step: str | None
    strategy: str
    side_step: float
    passes: int
    left: NDArray[np.int64]
    rejected: tuple[dict[str, object], ...] = ()


class Finish:
    """The finish of one zone, repeated where stock was in the way and is gone later.

    layout          : ZoneLayout, the passes that the zone may get
    stock, settings : as in ``plan_job``
    walked, depths  : where its tool has been, shared by its zones
    snapshot        : state of an interrupted plan, to continue from
    """

    def __init__(self, layout: ZoneLayout, stock: StockMap, settings: PlanSettings, walked: Walked | None = None,
                 depths: Depths | None = None, snapshot: FinishSnapshot | None = None) -> None:
        self.layout, self.zone, self.field, self.faces = layout, layout.zone, layout.field, layout.faces
        self.stock, self.settings, self.full, self.given = stock, settings, layout.full, layout.given
        self.checks = checks = layout.checks
        self.residual = ResidualMap(checks.points + settings.stock_allowance * checks.normals, checks.normals,
                                    margin=1.5 * settings.scallop_height, covers=checks.covers)
        self.strategy = layout.usual if snapshot is None else Strategy(
            snapshot.strategy, snapshot.side_step, _laid_later(layout, snapshot.strategy), snapshot.ordered,
            snapshot.rejected)
        self.cut = layout.eased(self.strategy)
        self.layers: Workingstep | None = None  # the last measured ones
        self.step: str | None = None
        self.settled = False  # the strategy is chosen, and holds for the bands below
        self.begun_with = ""  # name of the strategy before the usual one
        self.passes = 0
        self.met = np.zeros(len(checks.points), np.bool_)
        self.walked = Walked() if walked is None else walked
        self.depths = Depths(stock.lattice) if depths is None else depths
        if snapshot is not None:
            self._restore(snapshot)

    def snapshot(self) -> FinishSnapshot:
        """State of the finish, to continue from later."""
        s, layers = self.strategy, None if self.layers is None else self.layers.id
        return FinishSnapshot(self.zone.id, self.residual.residual, self.met, layers, self.step, self.settled,
                         self.begun_with, self.passes, s.name, s.side_step, s.ordered, s.rejected)

    def _restore(self, snapshot: FinishSnapshot) -> None:
        if len(snapshot.residual) != len(self.met) or len(snapshot.met) != len(self.met):
            raise ValueError(f"the checkpoint of {snapshot.zone} has other checks")
        self.residual.residual, self.met = snapshot.residual.copy(), snapshot.met.copy()
        self.step, self.settled = snapshot.step, snapshot.settled
        self.begun_with, self.passes = snapshot.begun_with, snapshot.passes

    def measure(self, layers: Workingstep) -> None:
        """Count what layers have cut: where they leave no more than the scallop, as along slots, no pass follows."""
        self.layers = layers
        self.residual.cut_all([t.points for t in layers.trajectories if t.motion is TrajectoryKind.CUT], layers.tool)

    def above(self, plane: float) -> NDArray[np.bool_]:
        """Whether checks are finished above a height of contact, mm, with a tip that stays above it, (n,) bool."""
        low = plane - self.field.tool.end_height - 1e-6
        return np.asarray((self.checks.points[:, 2] >= plane) & (self.checks.tips[:, 2] >= low))

    def walk(self, step_id: str, wanted: NDArray[np.bool_] | None = None) -> list[Workingstep]:
        """The workingsteps of the zone; none without passes.

        wanted : (n,) bool, samples to finish; None: all

        The zone is planned by each strategy that may suit it, until no more than the scallop is left:

        - its usual passes,
        - passes along the borders of its faces, where these are not much longer than the usual ones,
        - flank passes, where the flank of a tilted tool fits its walls,
        - curvature-matched passes, where a tilted end has the curvature of its faces,
        - inclined-axis passes, where the setup requests a tilt.

        The strategy that leaves the fewest samples above the scallop wins, among equals the fastest. Where the setup
        requests a tilt, upright passes win only where no tilted ones exist. Among tilted ones the least upright share
        of the way wins, to a tenth, before the time: samples that tilted passes leave are finished upright too. The
        choice holds for the bands below. A zone in bands has no tilted passes.
        """
        every = np.ones(len(self.checks.points), np.bool_) if wanted is None else wanted
        if not bool((every & (self.residual.residual > self._aims(self.settings.budget.done))).any()):
            return []
        if self.settled:
            return self._rounds(step_id, every)
        self.settled = True
        other, refused = self.layout.along_borders
        leans = self.settings.turning is not None and bool(self.faces) and len(every) > 0 and bool(every.all())
        if other is None and not leans:
            self.strategy = replace(self.strategy, rejected=(*self.strategy.rejected, *refused))
            return self._rounds(step_id, every)
        tries = [self._copied(s) for s in (self.strategy, other) if s is not None]
        made = side_by_side([partial(t._rounds, step_id, every) for t in tries])
        seconds = [sum(step.seconds for step in steps) for steps in made]
        leaning, untilted = self._leaning(min(seconds)) if leans else ([], ())
        refused += untilted
        for name, runs in leaning:
            tries.append(self._copied(self.strategy))
            made.append(tries[-1]._led(step_id, name, runs, every))
            seconds.append(sum(step.seconds for step in made[-1]) + TURN_S * len(runs))
        limits = self._aims(self.settings.scallop_height)[:self.given]
        left = [int((t.residual.residual[:self.given] > limits).sum()) for t in tries]
        tilts = leans and inclined_axis.requested_lean(self.settings.leaned, self.zone.form,
                                                       self.field.tool) is not None
        found = compared(tries, made, seconds, left, [upright_way(steps) for steps in made] if tilts else None)
        best = min(found, key=attrgetter("key"))
        rejected = [*best.finish.strategy.rejected, *refused]
        rejected += [lost.rejected_for(best) for lost in found if lost is not best]
        self._adopt(best.finish, tuple(rejected))
        return best.steps

    def _adopt(self, chosen: Finish, rejected: tuple[dict[str, object], ...]) -> None:
        """Take over what a copy has cut; stock and history, which other zones share, keep their identity."""
        self.stock.become(chosen.stock)
        self.walked.become(chosen.walked)
        self.depths.become(chosen.depths)
        self.strategy = replace(chosen.strategy, rejected=rejected)
        self.cut, self.residual, self.met = chosen.cut, chosen.residual, chosen.met
        self.step, self.begun_with, self.passes = chosen.step, chosen.begun_with, chosen.passes

    def _leaning(self, max_seconds: float) -> tuple[list[TiltedPasses], tuple[dict[str, object], ...]]:
        """Passes of a tilted tool, by the name of their strategy, and reasons for missing ones.

        max_seconds : s, time of the usual passes
        """
        alone = [one for face in self.faces for one in face.alone or (face,)]
        given = self.checks, self.field.tool, self.cut, self.settings
        found: list[tuple[str, Runs]] = []
        if self.zone.form is AreaForm.STEEP:
            found.append((flank.NAME, flank.flanked(alone, *given, self._surroundings(), self.field.allowance)
                          if not (why := no_flank(self.field.tool)) else Runs((), (why,))))
        arcs = self.field.tool.arcs is not None
        if self.zone.form is not AreaForm.LEVEL and arcs:
            found.append((curvature_matched.NAME, Runs((), (UPRIGHT_ONLY,))))
        elif self.zone.form is not AreaForm.LEVEL and curvature_matched.suits(self.field.tool):
            curved = [face for face in alone if not face.flat]
            found.append((curvature_matched.NAME,
                          curvature_matched.matched(curved, *given, self._surroundings(), self.field.allowance,
                                                    max_seconds)))
        if (leaned := inclined_axis.requested_lean(self.settings.leaned, self.zone.form,
                                                   self.field.tool)) is not None:
            found.append((inclined_axis.NAME, Runs((), (UPRIGHT_ONLY,)) if arcs else
                          inclined_axis.inclined_passes(self.faces, self.checks, self.field, self.cut, self.settings,
                                                        self._surroundings(), self._enters(inclined_axis.WARY),
                                                        leaned)))
        return [(name, runs.runs) for name, runs in found if runs.runs], tuple(
            {"strategy": name, "reason": reason} for name, runs in found for reason in runs.refused)

    def _surroundings(self) -> Surroundings:
        field, settings = self.field, self.settings
        met = self._enters()
        assert settings.turning is not None
        skins = Skins(self.residual.copied(), settings.scallop_height, self.stock.lattice.step)
        return Surroundings(met, settings.turning, self.stock.copied(), field.discs, field.clear, skins)

    def _enters(self, more: float = 0.0) -> Blocked:
        """Whether the tool enters part or fixtures; more : mm beside the clearance of neck, shank and holder."""
        field, c = self.field, self.field.clear
        clear = replace(c, neck=c.neck + more, shank=c.shank + more, holder=c.holder + more)
        return enters(field.tree, field.tool, clear, field.allowance - self.settings.lift)

    def _led(self, step_id: str, name: str, runs: Sequence[tuple[Trajectory, ...]],
             wanted: NDArray[np.bool_]) -> list[Workingstep]:
        """A workingstep for each pass of a tilted tool, and one for the rest."""
        zone, number = self.zone, int(step_id[1:])
        steps, faces = [], " ".join(f"F{f}" for f in self.zone.faces[:12])
        for k, run in enumerate(runs):
            here = f"S{number + k:02d}"
            steps.append(step_of(here, f"{here} {zone.id} {name} {self.field.tool.id} {faces}", zone.id, [zone],
                                 "finishing", name, self.field.tool, self.cut, 0.0, run, self.settings))
            for t in run:
                if t.motion is TrajectoryKind.CUT and t.axes is not None:
                    self.residual.cut_leaning(t.points, t.axes, self.field.tool)
                    self.stock.cut_leaning(t.points, t.axes, self.field.tool)
        rest = self._rounds(f"S{number + len(runs):02d}", wanted)
        self.step, self.passes, self.begun_with = step_id, self.passes + len(runs), name
        return [*steps, *rest]

    def _copied(self, strategy: Strategy) -> Finish:
        """This finish with another strategy, cut on its own."""
        out = copy.copy(self)
        out.cut = self.layout.eased(strategy)
        out.residual, out.stock = self.residual.copied(), self.stock.copied()
        out.met, out.strategy = self.met.copy(), strategy
        out.walked, out.depths = self.walked.copied(), self.depths.copied()
        return out

    def walk_again(self, step_id: str, min_left: float) -> list[Workingstep]:
        """A workingstep for samples with more than ``min_left`` mm left at which stock was in the way and is gone
        now."""
        k = np.flatnonzero(self.met & (self.residual.residual > self._aims(min_left)))
        freed = np.zeros(len(self.met), np.bool_)
        freed[k] = ~self.stock.meets_bodies(self.checks.tips[k], self.field.discs)
        return self._rounds(step_id, freed)

    def _rounds(self, step_id: str, wanted: NDArray[np.bool_]) -> list[Workingstep]:
        """All rounds for the samples ``wanted``, as one workingstep."""
        linker = self._linker()
        budget = self._aims(self.settings.budget.done)
        failing = np.flatnonzero(wanted & (self.residual.residual > budget))
        for k in range(REFINEMENTS + 2):
            if not len(failing):
                break
            for lines in self._needed(k, failing):
                self._add(linker, lines, k)
            failing = np.flatnonzero(wanted & (self.residual.residual > budget))
        self.met[failing] = self.stock.meets_bodies(self.checks.tips[failing], self.field.discs)
        if not linker.passes:
            return []
        zone, name = self.zone, self.strategy.name
        self.step, self.passes = self.step or step_id, self.passes + linker.passes
        faces = " ".join(f"F{f}" for f in zone.faces[:12])
        return [step_of(step_id, f"{step_id} {zone.id} {name} {zone.tool.id} {faces}", zone.id, [zone], "finishing",
                      name, self.field.tool, self.cut, self.strategy.side_step, linker.finish(), self.settings)]

    def _linker(self) -> Linker:
        return Linker(self.field, self.stock, motions_of(self.cut, self.settings), self.depths, self.settings.found,
                      engaged=self.cut.engaged, walls=self.zone.form is AreaForm.STEEP)

    def plan(self) -> ZonePlan:
        """The outcome for the zone."""
        left = np.flatnonzero((self.residual.residual > self._aims(self.settings.scallop_height))[:self.given])
        name, step, side_step = self.begun_with or self.strategy.name, self.step, self.strategy.side_step
        if step is None and self.layers is not None and self.given and not len(left):
            name, step, side_step = self.layers.strategy, self.layers.id, self.layers.side_step
        return ZonePlan(self.zone, step, name, side_step, self.passes, left, self.strategy.rejected)

    def _aims(self, aim: float) -> F64:
        return self.settings.found.aims(self.zone.id, aim, len(self.checks.points))

    def _groups(self, k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
        if k > REFINEMENTS:  # where stock is in the way of neck, shank or holder, passes come once it is gone
            free = failing[~self.stock.meets_bodies(self.checks.tips[failing], self.field.discs)]
            return [touch_points.touches(self.field, self.checks.tips[free], self.checks.normals[free])]
        every = np.arange(len(self.checks.points))
        # a band has levels of its own, which go no deeper than it does
        whole = (k == 0 and not self.strategy.ordered and not self.settings.planes
                 and len(failing) > WHOLE * len(every))
        return self.strategy.rounds(k, every if whole else failing)

    def _needed(self, k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
        """Lines of round k, of the first one as far as a failing sample needs them.

        Later rounds come to what the first one left, also where stock was in the way of the line that it needed.
        """
        groups, tool, settings = self._groups(k, failing), self.field.tool, self.settings
        if k:
            return groups
        overrun = OVERRUN * tool.radius
        reach = Reach(self.strategy.side_step + self.checks.spacing, self.checks.spacing, overrun,
                      2.0 * overrun + linked(tool, self.cut, settings))
        aim = self._aims(SPARED * settings.scallop_height)
        return needed(groups, self.residual, tool, failing, self.checks.tips, aim, reach)

    def _add(self, linker: Linker, lines: list[Line], k: int) -> None:
        """Cut lines of round k and measure them."""
        tool, settings = self.field.tool, self.settings
        floor = self.strategy.name == "planar_floor"
        thin = min(settings.budget.chord, planar_floor.EXACT) if floor else None
        skin, slope = SKIN * tool.diameter, RAMP_SHARE * math.tan(settings.ramp_angle)
        ordered = self.strategy.ordered and k <= REFINEMENTS
        if not ordered:
            lines = nearest_order(lines, linker.at, settings.cut_direction.both_ways)
        for line in lines:
            if not self.strategy.ordered:
                line = turned(line, settings)
            for piece in self._unwalked(line):
                # two lines may differ in their points and be the same once these are thinned out
                way = Line(thinned(piece.points, linker.motions.tolerance if thin is None else thin), piece.closed)
                left = self._unwalked(way)
                if len(left) == 1 and left[0] is way:
                    self._add_one(linker, piece, skin, slope, thin)
                else:
                    for rest in left:
                        self._add_one(linker, rest, skin, slope, AS_IT_IS)

    def _add_one(self, linker: Linker, line: Line, skin: float, slope: float, thin: float | None) -> None:
        """Cut a line with the layers above it and measure them."""
        tool, steep = self.field.tool, self.zone.form is AreaForm.STEEP
        before, refused, whole = len(linker.trajectories), linker.refused, False
        care = self.settings.found.care(tool, line.points)
        for layer in zigzag.skimmed(line, self.stock, tool, care * skin, care * slope, steep):
            if layer is line:
                whole = linker.add(line, thin)
            else:  # where the tool has been before, it cannot reach the stock that the map still shows
                way = Line(thinned(layer.points, linker.motions.tolerance), layer.closed)
                for rest in self._unwalked(way):
                    linker.add(rest, AS_IT_IS)
            if linker.refused > refused:  # the stock it leaves is too much for the layer below
                break
        cuts = [t.points for t in linker.trajectories[before:] if t.motion is TrajectoryKind.CUT]
        for points in cuts:
            self.residual.cut(points, tool)
        for points in [line.points, *cuts] if whole else cuts:
            self.walked.add(points)

    def _unwalked(self, line: Line) -> list[Line]:
        """The parts of a line that this tool has not cut before; the rest is only measured, since it would leave the
        same.

        Lines are cut to the samples they serve. So those of a later round may be part of an earlier one, and those of
        neighbouring zones part of each other.
        """
        fresh = self.walked.fresh(line)
        for a, b in true_runs(~fresh):
            self.residual.cut(line.points[a:b + 1], self.field.tool)
        again = Walked.again(line)
        for a, b in true_runs(again):
            again[a:b] &= b - a >= MIN_AGAIN  # places where a line crosses or touches itself
        fresh &= ~again  # the first pass over a place is measured there
        return still_to_walk(line, fresh)


UPRIGHT_ONLY = "a circle segment mill is planned upright only"


def no_flank(tool: ToolBody) -> str:
    """Why the flank of a tool does not fit walls; empty where it is a cylinder."""
    if tool.arcs is not None:
        return UPRIGHT_ONLY
    return "the side of the tool leans" if tool.taper > 0.0 else ""


TiltedPasses = tuple[str, Sequence[tuple[Trajectory, ...]]]
"""Name of a strategy and the trajectories of each of its passes."""

def _laid_later(layout: ZoneLayout, name: str) -> Rounds:
    """The rounds of a strategy from a checkpoint, laid out again when the first is needed, which may be never."""
    return lambda k, failing: layout.named(name).rounds(k, failing)


def turned(line: Line, settings: PlanSettings) -> Line:
    """A line in climb order, or reversed where the setup wants conventional milling."""
    return line if settings.cut_direction.climbs else line.reversed()


def upright_way(steps: Iterable[Workingstep]) -> float:
    """Length, mm, that the tool cuts upright in finishing steps."""
    return sum(t.length for s in steps if s.strategy not in LEANING
               for t in s.trajectories if t.motion is TrajectoryKind.CUT)


def motions_of(cut: CutData, settings: PlanSettings) -> Motions:
    """Feeds and heights of a step for the linker.

    Where the engaged angle has a limit, the feed of layers is made for thin chips. That of a finish is not, nor that of
    skims.
    """
    skimmed = math.inf if cut.finish is None or cut.engaged >= UNBOUNDED else cut.finish.feed
    return Motions(cut.feed, cut.plunge_feed, cut.link_feed, settings.rates.rapid, settings.clearance,
                   settings.rapid_floor, settings.ramp_angle, cut.step_down, settings.budget.chord, skimmed,
                   settings.rates)


def step_of(step_id: str, name: str, zone: str | None, zones: Sequence[ZoneArea], operation: str, strategy: str,
            tool: ToolBody, cut: CutData, side_step: float, walked: tuple[Trajectory, ...],
            settings: PlanSettings) -> Workingstep:
    """The workingstep of some trajectories for some zones; side_step in mm, the rest as in ``Workingstep``."""
    faces = tuple(sorted({f for z in zones for f in z.faces}))
    tips = np.vstack([z.tips for z in zones])
    lo, hi = tips[:, :2].min(axis=0), tips[:, :2].max(axis=0)
    outline = np.array([lo, [hi[0], lo[1]], hi, [lo[0], hi[1]], lo])
    return Workingstep(step_id, name, zone, faces, operation, strategy, tool, cut.spindle_rpm, cut.feed, side_step,
                       settings.scallop_height, settings.chordal_tolerance, with_few_changes(walked, settings.rates),
                       outline, max(z.top for z in zones), min(z.bottom for z in zones), settings.cut_direction,
                       rates=settings.rates, bend=cut.bend)
