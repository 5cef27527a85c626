"""The finish of one zone: its strategy, walked round by round until nothing is left, and the choice among several.

The passes of a zone are laid out by formula and then measured at the zone's samples; where more is left than
the budget allows, passes are put in between, only there, each time half as far apart. So the narrowest spot
never sets the step for a whole zone.

A pass is left out where shank or holder would meet stock that other zones still have to take off.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.five_axis.oriented_motion import TURN_S, Runs, Surroundings
from toolpath.five_axis.oriented_pass import enters
from toolpath.lines import Line, thinned, true_runs
from toolpath.linking.linker import Linker
from toolpath.linking.ramp_entry import RAMP_SHARE
from toolpath.linking.rapid_travel import Motions
from toolpath.passes.contours import serving
from toolpath.passes.isoparametric_passes import Flank, side_step
from toolpath.passes.pass_family import Promise, Target
from toolpath.passes.pass_order import nearest_order
from toolpath.passes.reach_border import beyond
from toolpath.passes.trimmed_faces import Faces
from toolpath.plan_checkpoint import FinishNow
from toolpath.plan_settings import CutData, Pattern, PlanSettings
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
    isoparametric,
    planar_floor,
    touch_points,
    waterline,
    zigzag,
)
from toolpath.tool_deflection import left_by_layers
from toolpath.workingsteps import Motion, Trajectory, Workingstep
from zones.machinable_area import AreaForm
from zones.reach.tip_field import TipField
from zones.zoning.zones import ZoneArea

LAID_SHARE = 0.8  # of the allowed scallop, given to passes whose envelope is measured; program and facets take the rest
CUSP_SHARE = 0.55  # of the allowed scallop, given to the distance between passes; reach and chord take the rest
LINK_S = 1.2  # what going up, over and down again takes: links of the demo part, seconds each
PASS_SHARE = 0.85  # a sample is done when the measured residual is within this share of the scallop
REFINEMENTS = 4
LEANING = frozenset((flank.NAME, curvature_matched.NAME, inclined_axis.NAME))  # strategies of a tool that leans
UPRIGHT = 10  # of a zone asked to lean that is walked upright, of so many parts: which strategy leaves fewest
LEAST_AGAIN = 4  # moves of a line that it walks a second time, to be left out
AS_IT_IS = 1e-9  # mm, of a line that is thinned out already
BORDER_SHARE = 0.1  # of the distance between passes on a plane: how well the border of an area is known
WORTH_A_TRY = 1.5  # of the way of the usual passes: iso-parametric ones that are more are not walked


@dataclass(frozen=True, eq=False)
class ZonePlan:
    """What was planned for a zone.

    step     : id of its first finishing workingstep, of the layers where these leave nothing to finish; None where
               nothing could be planned
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


class Finish:
    """The finish of one zone: walked once, and again where stock was in the way that is gone since.

    zone, checks, field, cut, stock, settings : as ``plan_job`` has them; faces : of the zone, exact and trimmed
    walked, depths : where its tool has been, shared by its zones
    now : where it was when it was kept, to go on from there
    """

    def __init__(self, zone: ZoneArea, checks: Target, field: TipField, cut: CutData, stock: StockMap,
                 settings: PlanSettings, faces: Sequence[Faces] = (), walked: Walked | None = None,
                 depths: Depths | None = None, now: FinishNow | None = None) -> None:
        anew = partial(Finish, zone, checks, field, cut, stock, settings, faces, walked, depths)
        self.full = cut = cut.finish or cut
        self.zone, self.field, self.cut, self.stock, self.settings = zone, field, cut, stock, settings
        self.given = len(checks.points)
        if len(checks.points) and zone.form is not AreaForm.STEEP and not _has_floor(zone, field.tool):
            r = field.tool.corner_radius or field.tool.radius
            checks = checks.joined(beyond(field, checks, settings.lift, BORDER_SHARE * math.sqrt(
                8.0 * settings.scallop_height * r), zone.faces))
        self.checks = checks
        self.residual = ResidualMap(checks.points + settings.stock_allowance * checks.normals, checks.normals,
                                    margin=1.5 * settings.scallop_height)
        self.strategy = _once(_strategy(zone, checks, field, cut, settings), len(checks.points)) if now is None else (
            _Strategy(now.strategy, now.side_step, _laid_later(anew, now.strategy), now.ordered, now.rejected))
        self.cut = self._eased(cut, self.strategy)
        self.faces = faces
        self.layers: Workingstep | None = None  # those that were measured
        self.step: str | None = None
        self.settled = False  # the strategy is chosen, and stays for the bands below
        self.begun_with = ""  # name of the strategy that went before the usual one
        self.passes = 0
        self.met = np.zeros(len(checks.points), np.bool_)
        self.walked = Walked() if walked is None else walked
        self.depths = Depths(stock.lattice) if depths is None else depths
        if now is not None:
            self._go_on(now)

    def now(self) -> FinishNow:
        """Where it is, to go on with another time."""
        s, layers = self.strategy, None if self.layers is None else self.layers.id
        return FinishNow(self.zone.id, self.residual.residual, self.met, layers, self.step, self.settled,
                         self.begun_with, self.passes, s.name, s.side_step, s.ordered, s.rejected)

    def _go_on(self, now: FinishNow) -> None:
        if len(now.residual) != len(self.met) or len(now.met) != len(self.met):
            raise ValueError(f"what is kept of {now.zone} has other checks")
        self.residual.residual, self.met = now.residual.copy(), now.met.copy()
        self.step, self.settled, self.begun_with, self.passes = now.step, now.settled, now.begun_with, now.passes

    def measure(self, layers: Workingstep) -> None:
        """Count what layers have cut: where they leave no more than the scallop, as along slots, no pass follows."""
        self.layers = layers
        for t in layers.trajectories:
            if t.motion is Motion.CUT:
                self.residual.cut(t.points, layers.tool)

    def above(self, plane: float) -> NDArray[np.bool_]:
        """(n,) bool: which checks are finished above a height of contact, mm, and with a tip that stays above it."""
        low = plane - self.field.tool.corner_radius - 1e-6
        return np.asarray((self.checks.points[:, 2] >= plane) & (self.checks.tips[:, 2] >= low))

    def walk(self, step_id: str, wanted: NDArray[np.bool_] | None = None) -> list[Workingstep]:
        """The workingsteps of the zone, of the samples ``wanted`` (n,) or of all; none where no pass is walked.

        Where passes along the borders of its faces are not much more way than the usual ones, where the flank of a tool
        that leans lies on its walls, or where its tilted end has the curvature of its faces, these are walked as well,
        each until no more than the scallop is left; where noses are asked to lean, passes of one that does as well.
        What leaves the fewest samples above it stays, of those that leave as many the fastest. Where the tool is asked
        to lean, an upright one only where none leans, and before the fastest what walks least upright, to a tenth: what
        passes that lean leave is walked upright too. It stays for the bands below too, and a zone in bands has no
        leaning passes.
        """
        every = np.ones(len(self.checks.points), np.bool_) if wanted is None else wanted
        if not bool((every & (self.residual.residual > self._aims(PASS_SHARE * self.settings.scallop_height))).any()):
            return []
        if self.settled:
            return self._rounds(step_id, every)
        self.settled = True
        other, refused = self._along_borders()
        leans = self.settings.turning is not None and bool(self.faces) and len(every) > 0 and bool(every.all())
        if other is None and not leans:
            self.strategy = replace(self.strategy, rejected=(*self.strategy.rejected, *refused))
            return self._rounds(step_id, every)
        tries = [self._copied(s) for s in (self.strategy, other) if s is not None]
        made = [t._rounds(step_id, every) for t in tries]
        seconds = [sum(step.seconds for step in steps) for steps in made]
        leaning, unled = self._leaning(min(seconds)) if leans else ([], ())
        refused += unled
        for name, runs in leaning:
            tries.append(self._copied(self.strategy))
            made.append(tries[-1]._led(step_id, name, runs, every))
            seconds.append(sum(step.seconds for step in made[-1]) + TURN_S * len(runs))
        most = self._aims(self.settings.scallop_height)[:self.given]
        left = [int((t.residual.residual[:self.given] > most).sum()) for t in tries]
        asked = leans and inclined_axis.asked(self.settings.leaned, self.zone.form, self.field.tool) is not None
        way = [upright_way(steps) if asked else 0.0 for steps in made]
        upright = [0 if not asked else round(UPRIGHT * w / max(*way, 1e-9)) if t.begun_with else UPRIGHT + 1
                   for t, w in zip(tries, way, strict=True)]
        best = min(range(len(tries)), key=lambda k: (not made[k], left[k], upright[k], seconds[k]))
        rejected = [*tries[best].strategy.rejected, *refused]
        for k, lost in enumerate(tries):
            why: dict[str, object] = {"reason": "no pass is walked", "value": 0, "limit": 0}
            if made[k] and left[k] > left[best]:
                why = {"reason": "more samples are left above the scallop", "value": left[k], "limit": left[best]}
            elif made[k] and upright[k] > UPRIGHT >= upright[best]:
                why = {"reason": "the tool is asked to lean and this is upright, s", "value": round(seconds[k], 1),
                       "limit": round(seconds[best], 1)}
            elif made[k] and upright[k] > upright[best]:
                why = {"reason": "the tool is asked to lean and more of this is upright, mm", "value": round(way[k], 1),
                       "limit": round(way[best], 1)}
            elif made[k]:
                why = {"reason": "takes longer at equal scallop, s", "value": round(seconds[k], 1),
                       "limit": round(seconds[best], 1)}
            if k != best:
                rejected.append({"strategy": lost.begun_with or lost.strategy.name, **why})
        stock, walked, depths, taken = self.stock, self.walked, self.depths, tries[best]
        stock.become(taken.stock)
        walked.become(taken.walked)
        depths.become(taken.depths)
        self.__dict__.update(taken.__dict__ | {"stock": stock, "walked": walked, "depths": depths,
                                               "strategy": replace(taken.strategy, rejected=tuple(rejected))})
        return made[best]

    def _leaning(self, most: float) -> tuple[list[Led], tuple[dict[str, object], ...]]:
        """Passes of a leaning tool, by the name of their strategy, and why there are none; most : s, the usual ones."""
        alone = [one for face in self.faces for one in face.alone or (face,)]
        given = self.checks, self.field.tool, self.cut, self.settings
        found: list[tuple[str, Runs]] = []
        if self.zone.form is AreaForm.STEEP:
            found.append((flank.NAME, flank.flanked(alone, *given, self._surroundings(), self.field.allowance)))
        if self.zone.form is not AreaForm.LEVEL and curvature_matched.suits(self.field.tool):
            curved = [face for face in alone if not face.flat]
            found.append((curvature_matched.NAME, curvature_matched.matched(curved, *given, self._surroundings(), self.field.allowance,
                                                        most)))
        if (leaned := inclined_axis.asked(self.settings.leaned, self.zone.form, self.field.tool)) is not None:
            found.append((inclined_axis.NAME, inclined_axis.led(self.faces, self.checks, self.field, self.cut, self.settings,
                                            self._surroundings(), self._enters(inclined_axis.WARY), leaned)))
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
        """A workingstep for each pass of a leaning tool, and one for what these leave."""
        zone, number = self.zone, int(step_id[1:])
        steps, faces = [], " ".join(f"F{f}" for f in self.zone.faces[:12])
        for k, run in enumerate(runs):
            here = f"S{number + k:02d}"
            steps.append(step_of(here, f"{here} {zone.id} {name} {self.field.tool.id} {faces}", zone.id, [zone],
                                 "finishing", name, self.field.tool, self.cut, 0.0, run, self.settings))
            for t in run:
                if t.motion is Motion.CUT and t.axes is not None:
                    self.residual.cut_leaning(t.points, t.axes, self.field.tool)
                    self.stock.cut_leaning(t.points, t.axes, self.field.tool)
        rest = self._rounds(f"S{number + len(runs):02d}", wanted)
        self.step, self.passes, self.begun_with = step_id, self.passes + len(runs), name
        return [*steps, *rest]

    def _along_borders(self) -> tuple[_Strategy | None, tuple[dict[str, object], ...]]:
        """Passes along the borders of the faces, None where there are none worth a try, and why."""
        settings, usual, steep = self.settings, self.strategy, self.zone.form is AreaForm.STEEP
        asked = not steep and settings.pattern is not Pattern.AUTO
        suited = isoparametric.suits(self.field.tool) and self.zone.form is not AreaForm.LEVEL and not asked
        faces = [face for face in self.faces if not face.flat]
        if not (suited and faces and len(self.checks.points)):
            return None, ()
        every, scallop = np.arange(len(self.checks.points)), LAID_SHARE * settings.scallop_height
        link = LINK_S * self.cut.feed / 60.0  # between passes that end elsewhere than the next begins
        way = sum(line.length + (0.0 if line.closed or not steep else link)
                  for lines in usual.rounds(0, every) for line in lines)
        level = float(side_step(np.zeros(1), self.field.tool.corner_radius, scallop)[0])
        level = max(level, usual.side_step) if steep else level
        least = self.given * self.checks.spacing**2 / level
        if least > WORTH_A_TRY * way:
            return None, (_not_taken("more way even on a plane, links counted, mm", least, way),)
        chord = 0.5 * settings.chordal_tolerance
        found = isoparametric.course(faces, self.checks, self.field, scallop, chord,
                                     self._flank() if steep else None)
        refused = _refused(found.refused)
        if not found.groups:
            return None, refused
        there = found.way + (link * sum(len(group) for group in found.groups) if steep else 0.0)
        if there > WORTH_A_TRY * way:
            return None, (*refused, _not_taken("more way, links counted, mm", there, way))
        made, failed = isoparametric.laid(found, self.field, scallop, chord, settings.lift)
        refused = (*refused, *_refused(failed))

        def rounds(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
            if k or not len(failing):
                return usual.rounds(k, failing)
            if len(failing) == len(every):
                return made
            tips, over = self.checks.tips[failing], 0.3 * self.field.tool.radius
            return [serving(lines, tips, 1.5 * found.side_step, self.checks.spacing, over, over) for lines in made]

        return _Strategy(isoparametric.NAME, found.side_step, rounds, not steep, usual.rejected), refused

    def _flank(self) -> Flank:
        tool, above = self.field.tool, self.field.tool.flute_length - self.field.tool.corner_radius
        return Flank(tool.radius + self.field.allowance, min(self.cut.step_down, above))

    def _eased(self, cut: CutData, strategy: _Strategy) -> CutData:
        """Feeds at which the passes of a strategy do not bend the tool too far, what layers leave in front of them."""
        left = left_by_layers(cut.step_down, self.field.lattice.step)
        if self.zone.form is AreaForm.STEEP:
            return cut.under(strategy.side_step, left)
        return cut.under(left, strategy.side_step)

    def _copied(self, strategy: _Strategy) -> Finish:
        """This finish with another strategy, to be walked on its own."""
        out = copy.copy(self)
        out.cut = self._eased(self.full, strategy)
        out.residual, out.stock = self.residual.copied(), self.stock.copied()
        out.met, out.strategy = self.met.copy(), strategy
        out.walked, out.depths = self.walked.copied(), self.depths.copied()
        return out

    def walk_again(self, step_id: str, least: float) -> list[Workingstep]:
        """A workingstep for samples with more than ``least`` mm left at which stock was in the way that is gone now."""
        k = np.flatnonzero(self.met & (self.residual.residual > self._aims(least)))
        freed = np.zeros(len(self.met), np.bool_)
        freed[k] = ~self.stock.meets_bodies(self.checks.tips[k], self.field.discs)
        return self._rounds(step_id, freed)

    def _rounds(self, step_id: str, wanted: NDArray[np.bool_]) -> list[Workingstep]:
        """All rounds for the samples ``wanted``, as one workingstep."""
        linker = self._linker()
        budget = self._aims(PASS_SHARE * self.settings.scallop_height)
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
        return [step_of(step_id, f"{step_id} {zone.id} {name} {zone.tool.id} {faces}", zone.id, [zone], "finishing",
                      name, self.field.tool, self.cut, self.strategy.side_step, linker.finish(), self.settings)]

    def _linker(self) -> Linker:
        return Linker(self.field, self.stock, motions_of(self.cut, self.settings), self.depths, self.settings.found,
                      engaged=self.cut.engaged, walls=self.zone.form is AreaForm.STEEP)

    def plan(self) -> ZonePlan:
        """What became of the zone."""
        left = np.flatnonzero((self.residual.residual > self._aims(self.settings.scallop_height))[:self.given])
        name, step = self.begun_with or self.strategy.name, self.step
        if step is None and self.layers is not None and self.given and not len(left):
            name, step = self.layers.strategy, self.layers.id
        return ZonePlan(self.zone, step, name, self.strategy.side_step, self.passes, left, self.strategy.rejected)

    def _aims(self, aim: float) -> F64:
        return self.settings.found.aims(self.zone.id, aim, len(self.checks.points))

    def _groups(self, k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
        if k > REFINEMENTS:
            return [touch_points.touches(self.field, self.checks.tips[failing])]
        return self.strategy.rounds(k, failing)

    def _add(self, linker: Linker, lines: list[Line], k: int) -> None:
        """Walk lines of round k and measure them."""
        tool, settings = self.field.tool, self.settings
        thin = min(0.5 * settings.chordal_tolerance, planar_floor.EXACT) if self.strategy.name == "planar_floor" else None
        skin, slope = SKIN * tool.diameter, RAMP_SHARE * math.tan(settings.ramp_angle)
        ordered = self.strategy.ordered and k <= REFINEMENTS
        if not ordered:
            lines = nearest_order(lines, linker.at, settings.either_way)
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
        """Walk a line with the layers above it and measure them."""
        tool, steep = self.field.tool, self.zone.form is AreaForm.STEEP
        before, refused, whole = len(linker.trajectories), linker.refused, False
        care = self.settings.found.care(tool, line.points)
        for layer in zigzag.skimmed(line, self.stock, tool, care * skin, care * slope, steep):
            if layer is line:
                whole = linker.add(line, thin)
            else:  # where the tool has been before, what the stock still shows is out of its reach
                way = Line(thinned(layer.points, linker.motions.tolerance), layer.closed)
                for rest in self._unwalked(way):
                    linker.add(rest, AS_IT_IS)
            if linker.refused > refused:  # what it would have taken is too much for the layer below
                break
        cuts = [t.points for t in linker.trajectories[before:] if t.motion is Motion.CUT]
        for points in cuts:
            self.residual.cut(points, tool)
        for points in [line.points, *cuts] if whole else cuts:
            self.walked.add(points)

    def _unwalked(self, line: Line) -> list[Line]:
        """What of a line was not walked before by this tool; the rest is only measured, it would leave the same.

        Lines are cut to the samples they serve, so those of a later round may be part of an earlier one, and those of
        zones side by side part of each other.
        """
        fresh = self.walked.fresh(line)
        for a, b in true_runs(~fresh):
            self.residual.cut(line.points[a:b + 1], self.field.tool)
        again = Walked.again(line)
        for a, b in true_runs(again):
            again[a:b] &= b - a >= LEAST_AGAIN  # places where a line crosses or touches itself
        fresh &= ~again  # that is measured where it is walked first
        return still_to_walk(line, fresh)


def _refused(reasons: Sequence[str]) -> tuple[dict[str, object], ...]:
    return tuple({"strategy": isoparametric.NAME, "reason": reason} for reason in reasons)


def _not_taken(reason: str, value: float, limit: float) -> dict[str, object]:
    return {"strategy": isoparametric.NAME, "reason": reason, "value": round(value, 1), "limit": round(limit, 1)}


def _has_floor(zone: ZoneArea, tool: ToolBody) -> bool:
    """Whether a zone is finished by a flat end that stands on it."""
    return zone.form is AreaForm.LEVEL and tool.radius > tool.corner_radius


Led = tuple[str, Sequence[tuple[Trajectory, ...]]]
"""Name of a strategy and the trajectories of each of its passes."""

Rounds = Callable[[int, NDArray[np.int64]], list[list[Line]]]
"""Lines of round k for the samples (indices into the zone's checks) that still need some."""


@dataclass(frozen=True)
class _Strategy:
    """Name, distance between passes in mm, rounds, whether lines come in their order of machining, and what was
    considered and not taken."""

    name: str
    side_step: float
    rounds: Rounds
    ordered: bool
    rejected: tuple[dict[str, object], ...] = ()


def _strategy(zone: ZoneArea, checks: Target, field: TipField, cut: CutData,
              settings: PlanSettings) -> _Strategy:
    """How a zone is finished."""
    tool, chord, normals = field.tool, 0.5 * settings.chordal_tolerance, checks.normals
    cusp = CUSP_SHARE * settings.scallop_height
    if zone.form is AreaForm.STEEP:
        step = waterline.level_step(tool, normals, cusp, cut.step_down)

        def waterlines(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
            tips = checks.tips[failing]
            if k == 0:
                levels, window = waterline.heights(float(tips[:, 2].max()), float(tips[:, 2].min()), step), step
            else:
                window = step / 2.0 ** k
                levels = waterline.lowest_of_groups(tips[:, 2], window)
            return waterline.waterlines(field, tips, levels, 1.001 * window, chord)

        return _Strategy("waterline", step, waterlines, False)
    if _has_floor(zone, tool):

        def planes(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
            return planar_floor.planes(field, checks.tips[failing], chord, k) if k <= planar_floor.MOST_FINER else []

        return _Strategy("planar_floor", 1.6 * (tool.radius - tool.corner_radius), planes, False)
    promise = Promise(LAID_SHARE * settings.scallop_height, settings.chordal_tolerance, 0.3 * tool.radius,
                      LINK_S * cut.feed / 60.0)
    layout = zigzag.laid(field, checks, promise, settings.pattern, settings.climb or settings.either_way)

    def dragged(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
        if k:
            return [layout.between(k, failing)]
        return [list(layout.lines) if len(failing) == len(checks.points) else layout.near(failing)]

    return _Strategy(str(layout.pattern), layout.side_step, dragged, True, tuple(
        {"strategy": str(other), "reason": "more way, links counted", "value": round(way, 1),
         "limit": round(layout.way, 1)} for other, way in layout.rejected))


def _once(strategy: _Strategy, count: int) -> _Strategy:
    """The strategy with the first round for all samples kept: it is asked for its way, and walked."""
    kept: list[list[list[Line]]] = []

    def rounds(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
        if k or len(failing) < count:
            return strategy.rounds(k, failing)
        if not kept:
            kept.append(strategy.rounds(k, failing))
        return kept[0]

    return replace(strategy, rounds=rounds)


def _laid_later(anew: Callable[[], Finish], name: str) -> Rounds:
    """The rounds of a strategy that was laid out before: again when the first is asked for, which may be never."""
    @cache
    def laid() -> Rounds:
        fresh = anew()
        if fresh.strategy.name == name:
            return fresh.strategy.rounds
        other, _ = fresh._along_borders()
        assert other is not None and other.name == name, "what is laid out follows from the inputs of a plan alone"
        return other.rounds

    return lambda k, failing: laid()(k, failing)


def turned(line: Line, settings: PlanSettings) -> Line:
    """A line in climb order, the other way where the setup wants conventional milling."""
    return line if settings.climb or settings.either_way else line.reversed()


def upright_way(steps: Iterable[Workingstep]) -> float:
    """mm that the tool cuts upright in finishing steps."""
    return sum(t.length for s in steps if s.strategy not in LEANING for t in s.trajectories if t.motion is Motion.CUT)


def motions_of(cut: CutData, settings: PlanSettings) -> Motions:
    """Feeds and heights of a step, as the linker wants them.

    Where the engaged angle has a limit layers are fed for thin chips; a finish is not, nor what is skimmed like one.
    """
    skimmed = math.inf if cut.finish is None or cut.engaged >= UNBOUNDED else cut.finish.feed
    return Motions(cut.feed, cut.plunge_feed, cut.link_feed, settings.rates.rapid, settings.clearance,
                   settings.rapid_floor, settings.ramp_angle, cut.step_down, 0.5 * settings.chordal_tolerance, skimmed)


def step_of(step_id: str, name: str, zone: str | None, zones: Sequence[ZoneArea], operation: str, strategy: str,
            tool: ToolBody, cut: CutData, side_step: float, walked: tuple[Trajectory, ...],
            settings: PlanSettings) -> Workingstep:
    """The workingstep of what was walked for some zones; side_step in mm, the rest as ``Workingstep`` has it."""
    faces = tuple(sorted({f for z in zones for f in z.faces}))
    tips = np.vstack([z.tips for z in zones])
    lo, hi = tips[:, :2].min(axis=0), tips[:, :2].max(axis=0)
    outline = np.array([lo, [hi[0], lo[1]], hi, [lo[0], hi[1]], lo])
    return Workingstep(step_id, name, zone, faces, operation, strategy, tool, cut.spindle_rpm, cut.feed, side_step,
                       settings.scallop_height, settings.chordal_tolerance, walked, outline,
                       max(z.top for z in zones), min(z.bottom for z in zones), settings.climb, rates=settings.rates,
                       bend=cut.bend, either_way=settings.either_way)
