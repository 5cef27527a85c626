"""Cautions: what a machinist has to know of a job although the program has no fault.

A caution has the form of an error (``geometry.errors.CamError``): what, where, measured, limit, remedy. The report
lists it under ``warnings`` and as a sentence in ``part.warnings``. Cautions that are known before the paths are laid
also stand in the header of the program.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from service.cutting_data import cutting_data
from service.stages.job_inputs import JobInputs
from service.stages.preparation import Prepared
from toolpath.feeds.tool_life import minutes_in_cut
from toolpath.linking.ramp_entry import MIN_RUN
from toolpath.plan_settings import ToolLean
from toolpath.planning.zone_finishing import LEANING, ZonePlan, upright_way
from toolpath.strategies import inclined_axis
from toolpath.tool_deflection import DeflectionEstimate
from toolpath.workingsteps import TrajectoryKind, Workingstep
from verify.cutting_words import ProgramCaution
from verify.model import Support
from zones.features.wall_slenderness import slender_walls
from zones.model import Wall

MAX_TIMES = 10.0  # a caution whose value stays past so many times its limit is a finding
MAX_REASONS = 3  # of one caution
MAX_UPRIGHT_SHARE = 0.5  # of the cutting length of a zone; above it a zone that should lean gets a caution
MAX_HEIGHT_RATIO = 10.0
"""Height of a wall over its thickness, dimensionless. A higher wall gets a caution."""


@dataclass(frozen=True)
class JobCaution:
    """One caution of a job.

    kind      : 'limited', 'dry', 'thin_wall', 'support', 'deflection', 'tool_life', 'center_cutting' or 'upright'
    subjects  : ids of tools, steps, walls
    measured, limit : in the unit of the message; limit is nan where there is none
    stays     : what the program keeps of the measured value; None: nothing that could be too much
    at        : mm, setup frame; None where the caution has no place
    """

    kind: str
    subjects: tuple[str, ...]
    message: str
    measured: float
    limit: float
    remedy: str
    at: tuple[float, float, float] | None = None
    stays: float | None = None

    @property
    def grave(self) -> bool:
        """Whether the program goes so far over the limit that it is a finding.

        >>> JobCaution("deflection", ("T1",), "", 0.9, 0.05, "", stays=0.6).grave
        True
        >>> JobCaution("deflection", ("T1",), "", 0.9, 0.05, "", stays=0.2).grave
        False
        """
        return self.stays is not None and self.stays > MAX_TIMES * self.limit

    @property
    def sentence(self) -> str:
        """Message and remedy in one."""
        return f"{self.message}; {self.remedy}"

    def as_dict(self) -> dict[str, Any]:
        """Plain data for the report."""
        return {"kind": self.kind, "subjects": list(self.subjects), "message": self.message,
                "measured": _rounded(self.measured), "limit": _rounded(self.limit), "remedy": self.remedy,
                "at_mm": None if self.at is None else [_rounded(v) for v in self.at]}


def _rounded(value: float) -> float | None:
    return round(value, 5) + 0.0 if math.isfinite(value) else None


def limited(inputs: JobInputs) -> list[JobCaution]:
    """One caution for each speed and feed of the setup over a limit of tool or machine, in the order of the tools."""
    out = []
    for tool in inputs.tools:
        for field, requested, limit in cutting_data(inputs.material, tool, inputs.machine).cut_back:
            source = "machine.max_feed_mm_min"
            if field == "spindle_rpm":
                source = "its max_rpm" if limit == tool.max_rpm else "machine.max_rpm"
            message = f"tool {tool.id}: {field} {requested:g} is more than {source} {limit:g}"
            out.append(JobCaution("limited", (tool.id,), message, requested, limit,
                                  f"it runs at {limit:g}; lower the figure, or correct the limit"))
    return out


def dry(inputs: JobInputs) -> list[JobCaution]:
    """One caution for each tool that cuts dry at speeds or feeds meant for coolant."""
    out = []
    for tool in inputs.tools if inputs.machine.coolant == "off" else ():
        if tool.spindle_rpm is None or tool.feed_mm_min is None:
            speed = cutting_data(inputs.material, tool, inputs.machine).cutting_speed
            message = (f"tool {tool.id} cuts dry at {speed:.0f} m/min; its speed or feed is meant for cutting with "
                       "coolant")
            out.append(JobCaution("dry", (tool.id,), message, speed, math.nan,
                                  "give spindle_rpm and feed_mm_min for dry cutting"))
    return out


def cooled(inputs: JobInputs) -> list[JobCaution]:
    """One caution for each tool that states another coolant than the machine; the plan follows the machine."""
    machine = inputs.machine.coolant
    return [JobCaution("coolant", (t.id,), f"tool {t.id} states coolant {t.coolant}, but the program has {machine}",
                       math.nan, math.nan, "correct coolant of the tool or of the machine")
            for t in inputs.tools if t.coolant is not None and t.coolant != machine]


def uncut_centres(inputs: JobInputs, steps: Sequence[Workingstep]) -> list[JobCaution]:
    """One caution for each tool that ramps into stock and does not cut to its centre."""
    used = {s.tool.id: s.tool for s in steps if s.operation != "finishing"}
    out = []
    for tool in inputs.tools:
        if tool.center_cutting or tool.id not in used:
            continue
        shortest = MIN_RUN * used[tool.id].radius
        message = (f"tool {tool.id} does not cut to its centre; its ramps into stock, of 3 degrees at most, may be as "
                   f"short as {shortest:.2f} mm where there is no more room")
        remedy = "watch its first cuts in closed pockets, drill them first, or use a centre-cutting tool"
        out.append(JobCaution("center_cutting", (tool.id,), message, shortest, tool.diameter_mm, remedy))
    return out


def upright(requested: ToolLean | None, zones: Sequence[ZonePlan], steps: Sequence[Workingstep]) -> list[JobCaution]:
    """One caution for each zone that an upright tool finishes, wholly or mostly, although the setup lets it lean there.

    requested : the tilt that the setup gives; None: none, so there is no caution
    """
    out = []
    for z in zones:
        mine = [s for s in steps if s.zone == z.zone.id]
        if inclined_axis.requested_lean(requested, z.zone.form, z.zone.tool) is None or not mine:
            continue
        way = upright_way(mine)
        whole = sum(t.length for s in mine for t in s.trajectories if t.motion is TrajectoryKind.CUT)
        reasons = [str(r["reason"]) for r in z.rejected if r["strategy"] == inclined_axis.NAME]
        if z.strategy not in LEANING:
            state, default_reason = "stays upright", "it is finished in bands, or no pass lies on it"
        elif way > MAX_UPRIGHT_SHARE * whole:
            state = f"is upright along {way:.0f} of {whole:.0f} mm of cut"
            default_reason = "no tilt near the requested one is free of collision"
        else:
            continue
        why = "; ".join(reasons[:MAX_REASONS]) or default_reason
        out.append(JobCaution("upright", (z.zone.id, z.zone.tool.id),
                              f"zone {z.zone.id}: the setup asks tool {z.zone.tool.id} to lean, but it {state} ({why})",
                              way, MAX_UPRIGHT_SHARE * whole,
                              "use a slimmer or longer tool, change the lean, or accept the upright tool"))
    return out


def walls_to_cut(ready: Prepared) -> list[Wall]:
    """Walls with at least one sample on a face to be cut."""
    cut = set(np.unique(ready.samples.face).tolist())
    return [w for w in ready.decomposition.walls if cut & set(w.faces)]


def thin_walls(ready: Prepared) -> list[JobCaution]:
    """One caution, at the worst place, for each wall to be cut with a height over ``MAX_HEIGHT_RATIO`` thicknesses."""
    view = ready.views[0]
    out = []
    for s in slender_walls(view.part, view.tree, walls_to_cut(ready), MAX_HEIGHT_RATIO):
        x, y, z = view.back(np.array(s.at)).tolist()
        message = (f"wall {s.wall} is {s.thickness:.2f} mm thick and {s.height:.2f} high near X{x:.2f} Y{y:.2f} "
                   f"Z{z:.2f}: {s.ratio:.1f} to 1 (limit {MAX_HEIGHT_RATIO:g} to 1), so it deflects and vibrates")
        out.append(JobCaution("thin_wall", (s.wall,), message, s.ratio, MAX_HEIGHT_RATIO,
                              "support it or fill the room beside it, cut both its sides in turn, or make it thicker",
                              (x, y, z), s.ratio))
    return out


def unheld(support: Support) -> list[JobCaution]:
    """A caution that thin walls are finished without support, where the proof makes no finding of it.

    support : of the proof, its place in the setup frame
    """
    if not support.over or support.found:
        return []
    message = (f"thin walls are finished where they stand free over up to {support.most:.1f} times their thickness "
               f"(limit {support.limit:g} times), at {support.over} of {support.places} places")
    return [JobCaution("support", (), message, support.most, support.limit,
                       "support them or fill the room beside them, or cut their two sides in turn", support.at,
                       support.most)]


def bent(steps: Sequence[Workingstep]) -> list[JobCaution]:
    """One caution for each tool that would bend over its limit, in roughing and in finishing, with its worst step."""
    groups: dict[tuple[str, str], list[tuple[Workingstep, DeflectionEstimate]]] = {}
    for s in steps:
        if s.bend is not None and s.bend.full > s.bend.limit:
            groups.setdefault((s.tool.id, s.operation), []).append((s, s.bend))
    out = []
    for (tool, operation), group in groups.items():
        worst, bend = max(group, key=lambda pair: pair[1].full / pair[1].limit)
        more = f" and {len(group) - 1} other steps" if len(group) > 1 else ""
        message = (f"tool {tool} in {worst.id} {worst.strategy}{more}, {operation}: its tip would bend "
                   f"{bend.full:.3f} mm (limit {bend.limit:.3f} mm)")
        if bend.fixed:
            remedy = "its feed is given by the setup and stays; use a shorter or thicker tool"
        else:
            remedy = (f"the plan lowers its feed to {100.0 * bend.share:.0f} %, where it bends "
                      f"{bend.deflection:.3f} mm; a shorter or thicker tool keeps its feed")
        out.append(JobCaution("deflection", (tool, *(s.id for s, _ in group)), message, bend.full, bend.limit, remedy,
                              stays=bend.deflection))
    return out


def lives_ended(inputs: JobInputs, steps: Sequence[Workingstep]) -> list[JobCaution]:
    """One caution for each tool that needs several cutters and for each step longer than a cutter lasts."""
    out = []
    for tool in inputs.tools:
        mine = [s for s in steps if s.tool.id == tool.id]
        if tool.life_min is None or not mine:
            continue
        fresh = [s.id for s in mine if s.fresh]
        if fresh:
            total = float(sum(minutes_in_cut(s).sum() for s in mine))
            message = (f"tool {tool.id} is in cut for {total:.3g} min and lasts for {tool.life_min:g} min: the program "
                       f"stops for a fresh cutter before {', '.join(fresh)}")
            out.append(JobCaution("tool_life", (tool.id, *fresh), message, total, tool.life_min,
                                  f"have {len(fresh) + 1} cutters ready"))
        for step, minutes in [(s.id, float(minutes_in_cut(s).sum())) for s in mine]:
            if minutes > tool.life_min * (1.0 + 1e-9):
                message = f"{step} keeps tool {tool.id} in cut for {minutes:.3g} min (limit {tool.life_min:g} min)"
                remedy = "the tool never retracts in this step, so no cutter is changed; use one that lasts longer"
                out.append(JobCaution("tool_life", (tool.id, step), message, minutes, tool.life_min, remedy))
    return out


def exceeded(inputs: JobInputs, cautions: Sequence[ProgramCaution]) -> list[JobCaution]:
    """The cautions of a proof: where a program exceeds what its tools and the material recommend."""
    ids = {body.number: t.id for t, body in zip(inputs.tools, inputs.bodies, strict=True)}
    return [JobCaution(c.kind, (ids[c.tool],), c.message, c.measured, c.limit, c.remedy) for c in cautions]


def sentences(cautions: Sequence[JobCaution]) -> tuple[str, ...]:
    """Message and remedy of each caution, as one sentence each."""
    return tuple(c.sentence for c in cautions)


__all__ = ["JobCaution", "bent", "cooled", "exceeded", "limited", "lives_ended", "sentences", "thin_walls",
           "uncut_centres", "unheld", "walls_to_cut"]
