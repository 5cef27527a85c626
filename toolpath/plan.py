"""From zones to workingsteps: layers, then the finish of every zone, tool by tool, measured as it goes.

Where stock was in the way of a finish (``toolpath.finish``) that is gone since, the zone gets another workingstep for
what it lacks: after the other zones of its tool, and, where more than the scallop is left, after the last tool.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from toolpath.clearing import Clearing
from toolpath.engaged import SKIN_SHARE, UNBOUNDED
from toolpath.family import Target
from toolpath.finish import PASS_SHARE, Finish, ZonePlan, motions_of, step_of, turned
from toolpath.levels import dilated
from toolpath.linking import FLUTE_SHARE, Linker
from toolpath.motion import Workingstep
from toolpath.order import nearest_order
from toolpath.pacing import Pace
from toolpath.settings import CutData, PlanSettings
from toolpath.stock import StockMap
from toolpath.strategies import layers
from toolpath.strategies.isoparametric import Faces
from toolpath.walked import Depths, Walked
from zones.machinable import Form
from zones.reach import TipField
from zones.zoning import ZoneArea

AGAIN_SHARE = 0.95  # of the progress, before zones are gone over again
# A ring is right to one lattice step; the rest keeps it off the part after thinning to a tenth of a step.
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
             trimmed: Mapping[str, Sequence[Faces]] | None = None) -> Plan:
    """Plan all zones.

    zones    : in machining order
    checks   : what each zone is measured at and will be judged on, in the order of the zones
    fields   : TipField by tool id
    cut_data : CutData by tool id
    stock    : StockMap, lowered as the plan grows
    progress : called with the share done, 0 to 1
    first_step : number of the first workingstep
    trimmed  : exact faces by zone id, in the frame of the zones; zones that have none get no iso-parametric passes

    Returns
    -------
    Plan
    """
    steps: list[Workingstep] = []
    begun: list[Finish] = []
    order = list(dict.fromkeys(z.tool.id for z in zones))
    check_of = {z.id: c for z, c in zip(zones, checks, strict=True)}
    done = 0

    def following() -> str:
        return f"S{len(steps) + first_step:02d}"

    for tid in order:
        mine = [z for z in zones if z.tool.id == tid]
        field, cut = fields[tid], cut_data[tid]
        walked, depths = Walked(), Depths(stock.lattice)
        layered = _layers(mine, field, cut, stock, settings, depths, following()) if settings.roughing else None
        steps.extend([] if layered is None else [layered])
        own: list[Finish] = []
        for zone in mine:
            if settings.finishing:
                faces = (trimmed or {}).get(zone.id, ())
                own.append(Finish(zone, check_of[zone.id], field, cut, stock, settings, faces, walked,
                                  depths))
                if layered is not None:
                    own[-1].measure(layered)
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


def _layers(zones: Sequence[ZoneArea], field: TipField, cut: CutData, stock: StockMap, settings: PlanSettings,
            depths: Depths, step_id: str) -> Workingstep | None:
    """One workingstep that takes the stock above all zones of a tool off in depth layers."""
    lat, tool = field.lattice, field.tool
    tips = np.vstack([z.tips for z in zones])
    allowance = max(0.1 * cut.step_down, LATTICE_CARE * lat.step)
    pace = Pace(cut.feed, cut.link_feed, partial(cut.feed_under, tool), cut.step_down)
    linker = Linker(field, stock, motions_of(cut, settings), depths, settings.found, pace, cut.engaged)
    walls = np.vstack([np.zeros((0, 3)), *(z.tips for z in zones if z.form is Form.STEEP)])
    chord = 0.5 * settings.chordal_tolerance
    bounded = cut.engaged < UNBOUNDED
    # the finish of a floor has the whole front in what is left on it
    low = min(allowance, 0.5 * SKIN_SHARE * tool.radius) if bounded else allowance
    bottom = float(tips[:, 2].min()) + low
    top = stock.highest
    if top <= bottom:
        return None
    swept, step = top, 0.85 * cut.step_down
    heights = layers.layer_heights(top, bottom, step)
    if bounded:
        floors = [f.bottom + low for f in zones if f.form is Form.LEVEL]
        heights = sorted({*heights, *(z for z in floors if bottom < z < top)}, reverse=True)
    for z, below in zip(heights, _areas(field, tips, heights, step), strict=True):
        if bounded:
            Clearing(linker, z, below, allowance, 0.8 * tool.radius, settings.climb, settings.either_way,
                     layers.STOCK_WORTH, 0.1 * lat.step).walk()
        for lines in layers.layer(field, stock, z, below, allowance, 0.8 * tool.radius):
            for line in nearest_order(lines, linker.at, False):
                linker.add(turned(line, settings), 0.1 * lat.step)
        finished = lat.mask(walls[np.abs(walls[:, 2] - z) <= 2.0 * cut.step_down, :2])
        unseen = z <= swept - FLUTE_SHARE * tool.flute_length
        swept = z if unseen else swept
        rims = layers.rim(field, stock, z, below, finished, allowance, chord, unseen)
        for line in nearest_order(rims, linker.at, False):
            linker.add(turned(line, settings))
    if not linker.passes:
        return None
    ids = " ".join(z.id for z in zones)
    return step_of(step_id, f"{step_id} layers {tool.id} {ids}", None, zones, "roughing", "layers", tool, cut,
                   0.8 * tool.radius, linker.finish(), settings)


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
