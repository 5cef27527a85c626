"""The layout of a zone: the passes of each strategy, as part, tool, access, zone and tolerances decide them.

Nothing here knows the stock. So the layouts of all zones can be computed side by side and before their turn
(``toolpath.planning.layouts_ahead``), and a second plan of the same job takes them as they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.move_timing import leg_seconds
from geometry.tool_body import ToolBody
from toolpath.counterexamples import NONE
from toolpath.lines import Line
from toolpath.passes.contours import serving
from toolpath.passes.isoparametric_passes import Flank, side_step
from toolpath.passes.pass_family import FinishTarget, Promise
from toolpath.passes.reach_border import beyond
from toolpath.passes.trimmed_faces import Faces
from toolpath.plan_settings import CutData, Pattern, PlanSettings
from toolpath.strategies import isoparametric, planar_floor, waterline, zigzag
from toolpath.tool_deflection import left_by_layers
from zones.machinable_area import AreaForm
from zones.reach.tip_field import TipField
from zones.zoning.zones import ZoneArea

LINK_LEGS = 3.0  # moves of a diameter each from a pass to the next: up, across and down again
BORDER_SHARE = 0.1  # of the distance between passes on a plane: precision of the border of an area
WORTH_A_TRY = 1.5  # of the way of the usual passes: longer iso-parametric ones are not tried

T = TypeVar("T")
Rejected = tuple[dict[str, object], ...]
"""Strategies that were not taken, with the reason and its figures, as the report has them."""
Rounds = Callable[[int, NDArray[np.int64]], list[list[Line]]]
"""Lines of round k for the samples that still need some (index into the zone's checks)."""


class Once(Generic[T]):
    """A value that the first thread to ask computes, while others wait. After a failure the next one tries again."""

    def __init__(self, make: Callable[[], T]) -> None:
        self._make, self._lock, self._made = make, Lock(), list[T]()

    def __call__(self) -> T:
        """The value; raises what computing it raises."""
        with self._lock:
            if not self._made:
                self._made.append(self._make())
            return self._made[0]


@dataclass(frozen=True)
class Strategy:
    """A strategy as it is laid out on a zone.

    side_step : mm between passes
    ordered   : lines come in their order of machining
    rejected  : strategies it was preferred to
    """

    name: str
    side_step: float
    rounds: Rounds
    ordered: bool
    rejected: Rejected = ()


class ZoneLayout:
    """The passes of a zone, computed when they are asked for, from any thread.

    zone, field, settings : as in ``plan_job``; of the settings only those that a stock or a proof does not change
    given     : count of the zone's checks
    checks    : FinishTarget, these and places along the border of what the tool reaches
    full, cut : CutData as the setup has it, and eased for the usual strategy
    """

    def __init__(self, zone: ZoneArea, checks: FinishTarget, field: TipField, cut: CutData, settings: PlanSettings,
                 faces: Sequence[Faces] = ()) -> None:
        self.zone, self.field, self.settings, self.faces = zone, field, settings, faces
        self.full, self.given = cut.finish or cut, len(checks.points)
        self._checks = Once(lambda: self._with_border(checks))
        self._usual = Once(self._lay_usual)
        self._along_borders = Once(self._lay_along_borders)

    @property
    def checks(self) -> FinishTarget:
        """What the passes are measured at: the zone's checks first."""
        return self._checks()

    @property
    def usual(self) -> Strategy:
        """The usual strategy of the form of the zone."""
        return self._usual()

    @property
    def along_borders(self) -> tuple[Strategy | None, Rejected]:
        """Passes along the borders of the faces, None where none is worth a try, and the reasons."""
        return self._along_borders()

    def compute_usual(self) -> None:
        """Compute the usual strategy with its first round."""
        if self.given:
            self.usual.rounds(0, np.arange(len(self.checks.points)))

    def compute_along_borders(self) -> None:
        """Compute the passes along the borders of the faces."""
        self._along_borders()

    def eased(self, strategy: Strategy) -> CutData:
        """Feeds at which the passes of a strategy do not deflect the tool too far, given the stock that layers
        leave."""
        left = left_by_layers(self.full.step_down, self.field.lattice.step)
        if self.zone.form is AreaForm.STEEP:
            return self.full.under(strategy.side_step, left)
        return self.full.under(left, strategy.side_step)

    def named(self, name: str) -> Strategy:
        """The strategy of a checkpoint, which laid out the same zone."""
        if self.usual.name == name:
            return self.usual
        other, _ = self.along_borders
        assert other is not None and other.name == name, "the layout depends on the inputs of a plan alone"
        return other

    def _with_border(self, checks: FinishTarget) -> FinishTarget:
        field, settings, form = self.field, self.settings, self.zone.form
        if not len(checks.points) or form is AreaForm.STEEP or _has_floor(self.zone, field.tool):
            return checks
        r = field.tool.tip_curvature or field.tool.radius
        precision = BORDER_SHARE * math.sqrt(8.0 * settings.scallop_height * r)
        return checks.joined(beyond(field, checks, settings.lift, precision, self.zone.faces))

    def _lay_usual(self) -> Strategy:
        checks = self.checks
        return _once(_strategy(self.zone, checks, self.field, self.full, self.settings), len(checks.points))

    def _lay_along_borders(self) -> tuple[Strategy | None, Rejected]:
        settings, steep, tool = self.settings, self.zone.form is AreaForm.STEEP, self.field.tool
        requested = not steep and settings.pattern is not Pattern.AUTO
        suited = isoparametric.suits(tool) and self.zone.form is not AreaForm.LEVEL and not requested
        suited = suited and not (steep and tool.taper > 0.0)  # along walls they count on an upright flank
        faces = [face for face in self.faces if not face.flat]
        if not (suited and faces and self.given):
            words = f"its passes count on one round corner, and tool {tool.id} is a {tool.form}"
            return None, _refused((words,)) if tool.arcs is not None and faces and self.given else ()
        checks, usual = self.checks, self.usual
        every, scallop, chord = np.arange(len(checks.points)), settings.budget.laid, settings.budget.chord
        cut = self.eased(usual)
        link = linked(tool, cut, settings)  # between passes that end elsewhere than the next begins
        way = sum(line.length + (0.0 if line.closed or not steep else link)
                  for lines in usual.rounds(0, every) for line in lines)
        level = float(side_step(np.zeros(1), tool.corner_radius, scallop)[0])
        level = max(level, usual.side_step) if steep else level
        least = self.given * checks.spacing**2 / level
        if least > WORTH_A_TRY * way:
            return None, (_not_taken("longer even on a plane, with links, mm", least, way),)
        flank = Flank(tool.radius + self.field.allowance,
                      min(cut.step_down, tool.flute_length - tool.corner_radius)) if steep else None
        found = isoparametric.course(faces, checks, self.field, scallop, chord, flank)
        refused = _refused(found.refused)
        if not found.groups:
            return None, refused
        there = found.way + (link * sum(len(group) for group in found.groups) if steep else 0.0)
        if there > WORTH_A_TRY * way:
            return None, (*refused, _not_taken("longer, with links, mm", there, way))
        made, failed = isoparametric.laid(found, self.field, scallop, chord, settings.lift)
        refused = (*refused, *_refused(failed))

        def rounds(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
            if k or not len(failing):
                return usual.rounds(k, failing)
            if len(failing) == len(every):
                return made
            tips, over = checks.tips[failing], 0.3 * tool.radius
            return [serving(lines, tips, 1.5 * found.side_step, checks.spacing, over, over) for lines in made]

        return Strategy(isoparametric.NAME, found.side_step, rounds, not steep, usual.rejected), refused


def layouts_of(zones: Sequence[ZoneArea], checks: Sequence[FinishTarget], fields: Mapping[str, TipField],
               cut_data: Mapping[str, CutData], settings: PlanSettings,
               trimmed: Mapping[str, Sequence[Faces]]) -> dict[str, ZoneLayout]:
    """A layout for each zone, by its id, nothing of it computed yet; arguments as of ``plan_job``."""
    settings = replace(settings, found=NONE, planes=())  # what a proof changes is not of the layout
    return {z.id: ZoneLayout(z, c, fields[z.tool.id], cut_data[z.tool.id], settings, trimmed.get(z.id, ()))
            for z, c in zip(zones, checks, strict=True)}


def linked(tool: ToolBody, cut: CutData, settings: PlanSettings) -> float:
    """Way in cut, mm, that takes as long as a link from a pass to the next."""
    return LINK_LEGS * leg_seconds(tool.diameter, cut.link_feed / 60.0, settings.rates) * cut.feed / 60.0


def _refused(reasons: Sequence[str]) -> tuple[dict[str, object], ...]:
    return tuple({"strategy": isoparametric.NAME, "reason": reason} for reason in reasons)


def _not_taken(reason: str, value: float, limit: float) -> dict[str, object]:
    return {"strategy": isoparametric.NAME, "reason": reason, "value": round(value, 1), "limit": round(limit, 1)}


def _has_floor(zone: ZoneArea, tool: ToolBody) -> bool:
    """Whether a zone is finished by a flat end that stands on it."""
    return zone.form is AreaForm.LEVEL and tool.flat_radius > 0.0


def _strategy(zone: ZoneArea, checks: FinishTarget, field: TipField, cut: CutData,
              settings: PlanSettings) -> Strategy:
    """The strategy of a zone."""
    tool, chord, normals = field.tool, settings.budget.chord, checks.normals
    cusp = settings.budget.cusp
    if zone.form is AreaForm.STEEP:
        step = waterline.level_step(tool, normals, cusp, cut.step_down)
        step = cut.bearable(step, left_by_layers(cut.step_down, field.lattice.step))

        def waterlines(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
            tips = checks.tips[failing]
            if k == 0:
                levels, window = waterline.heights(float(tips[:, 2].max()), float(tips[:, 2].min()), step), step
            else:
                window = step / 2.0 ** k
                levels = waterline.lowest_of_groups(tips[:, 2], window)
            return waterline.waterlines(field, tips, levels, 1.001 * window, chord)

        return Strategy("waterline", step, waterlines, False)
    if _has_floor(zone, tool):

        def planes(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
            if k > planar_floor.MAX_FINER:
                return []
            covers = None if checks.covers is None else checks.covers[failing]
            return planar_floor.planes(field, checks.tips[failing], chord, k, covers)

        return Strategy("planar_floor", 1.6 * tool.flat_radius, planes, False)
    wide = float(side_step(np.zeros(1), tool.tip_curvature, settings.budget.laid)[0]) or tool.radius
    wide = min(wide, tool.diameter)
    eased = cut.under(left_by_layers(cut.step_down, field.lattice.step), wide)
    promise = Promise(settings.budget.laid, settings.chordal_tolerance, 0.3 * tool.radius,
                      linked(tool, eased, settings))
    layout = zigzag.laid(field, checks, promise, settings.pattern, settings.cut_direction.climbs)

    def dragged(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
        if k:
            return [layout.between(k, failing)]
        return [list(layout.lines) if len(failing) == len(checks.points) else layout.near(failing)]

    return Strategy(str(layout.pattern), layout.side_step, dragged, True, tuple(
        {"strategy": str(other), "reason": "longer, with links", "value": round(way, 1),
         "limit": round(layout.way, 1)} for other, way in layout.rejected))


def _once(strategy: Strategy, count: int) -> Strategy:
    """The strategy with its first round for all samples kept: it is needed for its way, and again to be cut."""
    first = Once(lambda: strategy.rounds(0, np.arange(count)))

    def rounds(k: int, failing: NDArray[np.int64]) -> list[list[Line]]:
        return strategy.rounds(k, failing) if k or len(failing) < count else first()

    return replace(strategy, rounds=rounds)
