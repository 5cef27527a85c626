"""The plan nobody optimised, which whole jobs are held against. Not to be changed: rows made with it would not hold.

The same zones, each with the stoutest tool that fits it, and the same feeds. Stock comes off in levels a layer apart,
ring by ring, over all that a tool has to finish; walls are finished level by level, shallow areas to and fro, planes by
rings. The tool goes up to the clearance plane after every pass and comes down in air or on a ramp over the next.
Nothing is chosen by time. ``benchmarks/jobs/whole_job.py`` has the numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from geometry.mesh import F64
from toolpath.linking.linker import Linker
from toolpath.linking.ways_in import Way, WaysIn
from toolpath.passes.contours import dilated
from toolpath.passes.pass_family import FinishTarget
from toolpath.passes.pass_order import nearest_order
from toolpath.passes.trimmed_faces import Faces
from toolpath.plan_settings import CutData, Pattern, PlanSettings
from toolpath.planning.job_plan import Plan
from toolpath.planning.zone_finishing import Finish, motions_of, step_of, turned
from toolpath.planning.zone_layout import ZoneLayout
from toolpath.stock.cut_history import Depths, Walked
from toolpath.stock.stock_map import StockMap
from toolpath.strategies import depth_layers
from toolpath.workingsteps import Workingstep
from zones.reach.tip_field import TipField
from zones.zoning.zones import ZoneArea


class FromAbove(WaysIn):
    """Ways in that never go on from the end of a pass."""

    def straight_on(self, points: F64, closed: bool) -> Way | None:
        """None."""
        return None


class Retracting(Linker):
    """A linker whose passes all begin at the clearance plane."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.ways = FromAbove(self.go, self.depths, self.gone, self.engaged)


class Plain(Finish):
    """The finish of one zone by the usual passes alone."""

    def _linker(self) -> Linker:
        return Retracting(self.field, self.stock, motions_of(self.cut, self.settings), self.depths,
                          self.settings.found)


def plan_job(zones: Sequence[ZoneArea], checks: Sequence[FinishTarget], fields: Mapping[str, TipField],
             cut_data: dict[str, CutData], stock: StockMap, settings: PlanSettings,
             progress: Callable[[float], None] | None = None, first_step: int = 1,
             trimmed: Mapping[str, Sequence[Faces]] | None = None, **_: object) -> Plan:
    """Plan all zones, tool by tool; arguments as of ``toolpath.planning.job_plan.plan_job``, without ``trimmed``."""
    settings = replace(settings, turning=None, pattern=Pattern.ZIGZAG)
    steps: list[Workingstep] = []
    begun: list[Finish] = []
    check_of = {z.id: c for z, c in zip(zones, checks, strict=True)}
    for tid in dict.fromkeys(z.tool.id for z in zones):
        mine = [z for z in zones if z.tool.id == tid]
        field, cut, walked, depths = fields[tid], cut_data[tid], Walked(), Depths(stock.lattice)
        if settings.roughing:
            steps.extend(_levels(mine, field, cut, stock, settings, depths, f"S{len(steps) + first_step:02d}"))
        own = [Plain(ZoneLayout(zone, check_of[zone.id], field, cut, settings), stock, settings, walked, depths)
               for zone in mine if settings.finishing]
        for finish in own:
            steps.extend(finish.walk(f"S{len(steps) + first_step:02d}"))
        begun.extend(own)
        if progress is not None:
            progress(0.9 * len(begun) / len(zones))
    for finish in begun:  # what stock of other zones was in the way of
        steps.extend(finish.walk_again(f"S{len(steps) + first_step:02d}", settings.scallop_height))
    return Plan(tuple(steps), tuple(finish.plan() for finish in begun))


def _levels(zones: Sequence[ZoneArea], field: TipField, cut: CutData, stock: StockMap, settings: PlanSettings,
            depths: Depths, step_id: str) -> list[Workingstep]:
    """The stock over all zones of a tool, level by level; at most one workingstep."""
    lat, tool = field.lattice, field.tool
    tips = np.vstack([z.tips for z in zones])
    linker = Retracting(field, stock, motions_of(cut, settings), depths, settings.found)
    step, allowance = 0.85 * cut.step_down, max(0.1 * cut.step_down, 1.5 * lat.step)
    bottom, top = float(tips[:, 2].min()) + allowance, stock.highest
    heights = depth_layers.layer_heights(top, bottom, step) if top > bottom else []
    for k, z in enumerate(heights):
        area = np.zeros((lat.ny, lat.nx), np.bool_)
        for low in heights[k:]:  # where the tool, or what stands over it, comes when it is deeper
            here = lat.mask(tips[tips[:, 2] <= low + 1e-6, :2])
            for disc in (None, *field.discs):
                wide = 0.5 * tool.radius if disc is None else field.disc_radius(disc, 0.0)
                if here.any() and (disc is None or low + disc.height < z + step):
                    area |= dilated(here, max(wide / lat.step, 1.5))
        for lines in depth_layers.layer(field, stock, z, depth_layers.LayerArea(area), allowance, 0.8 * tool.radius):
            for line in nearest_order(lines, linker.at, False):
                linker.add(turned(line, settings), 0.1 * lat.step)
        unseen = np.zeros((lat.ny, lat.nx), np.bool_)
        for line in nearest_order(depth_layers.rim(field, stock, z, area, unseen, allowance,
                                             0.5 * settings.chordal_tolerance, False), linker.at, False):
            linker.add(turned(line, settings))
    if not linker.passes:
        return []
    ids = " ".join(z.id for z in zones)
    return [step_of(step_id, f"{step_id} levels {tool.id} {ids}", None, zones, "roughing", "depth_layers", tool, cut,
                    0.8 * tool.radius, linker.finish(), settings)]
