"""What a machinist is to be told of a job although it is no fault of the program: figures that were cut back.

A caution has the form of an error (``geometry.errors.CamError``): what, where, measured, limit, remedy. It stands in
the report under ``warnings``, as a sentence in ``part.warnings``, and those known before the paths in the header of
the program too.
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
from toolpath.linking.ramp_entry import LEAST_RUN
from toolpath.plan_settings import Leaned
from toolpath.planning.zone_finishing import LEANING, ZonePlan, upright_way
from toolpath.strategies import inclined_axis
from toolpath.tool_deflection import Bend
from toolpath.workingsteps import Motion, Workingstep
from verify.model import Support
from zones.features.wall_slenderness import slender_walls
from zones.model import Wall

MOST_REASONS = 3  # a caution says
MOSTLY = 0.5  # of what a tool that is asked to lean cuts in a zone: where more is upright it is told of
MOST_RATIO = 10.0
"""Height of a wall over its thickness, above which it is told of."""


@dataclass(frozen=True)
class JobCaution:
    """One of them.

    kind      : 'limited', 'dry', 'thin_wall', 'support', 'deflection', 'tool_life', 'center_cutting' or 'upright'
    subjects  : ids of tools, steps, walls
    measured, limit : in the unit the message says
    at        : mm, setup frame, where it is of a place
    """

    kind: str
    subjects: tuple[str, ...]
    message: str
    measured: float
    limit: float
    remedy: str
    at: tuple[float, float, float] | None = None

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
    """Speeds and feeds of tools that tool or machine do not allow, in the order of the tools."""
    out = []
    for tool in inputs.tools:
        for field, asked, limit in cutting_data(inputs.material, tool, inputs.machine).cut_back:
            whose = "machine.max_feed_mm_min"
            if field == "spindle_rpm":
                whose = "its max_rpm" if limit == tool.max_rpm else "machine.max_rpm"
            message = f"tool {tool.id}: {field} {asked:g} is more than {whose} {limit:g}"
            out.append(JobCaution("limited", (tool.id,), message, asked, limit,
                               f"it runs at {limit:g}; ask for no more, or correct the limit"))
    return out


def dry(inputs: JobInputs) -> list[JobCaution]:
    """Tools that cut without coolant at figures that are meant for it."""
    out = []
    for tool in inputs.tools if inputs.machine.coolant == "off" else ():
        if tool.spindle_rpm is None or tool.feed_mm_min is None:
            speed = cutting_data(inputs.material, tool, inputs.machine).cutting_speed
            out.append(JobCaution("dry", (tool.id,),
                               f"tool {tool.id} cuts dry, at {speed:.0f} m/min, and its speed or feed is a figure for "
                               "coolant", speed, math.nan, "give its spindle_rpm and feed_mm_min for dry cutting"))
    return out


def uncut_centres(inputs: JobInputs, steps: Sequence[Workingstep]) -> list[JobCaution]:
    """Tools that do not cut to the centre and go down into stock: nothing here knows how wide their core is."""
    used = {s.tool.id: s.tool for s in steps if s.operation != "finishing"}
    return [JobCaution("center_cutting", (tool.id,),
                    f"tool {tool.id} does not cut to its centre, and its ways down into stock, of 3 degrees at most, "
                    f"may be {LEAST_RUN * used[tool.id].radius:.2f} mm long where there is no more room",
                    LEAST_RUN * used[tool.id].radius, tool.diameter_mm,
                    "look at its first cuts in closed pockets, drill them first, or take one that cuts to the centre")
            for tool in inputs.tools if not tool.center_cutting and tool.id in used]


def upright(asked: Leaned | None, zones: Sequence[ZonePlan], steps: Sequence[Workingstep]) -> list[JobCaution]:
    """Zones finished by an upright tool, or mostly so, although it is asked to lean there, each with the reasons."""
    out = []
    for z in zones:
        mine = [s for s in steps if s.zone == z.zone.id]
        if inclined_axis.asked(asked, z.zone.form, z.zone.tool) is None or not mine:  # where layers leave nothing there are none
            continue
        way, whole = upright_way(mine), sum(t.length for s in mine for t in s.trajectories if t.motion is Motion.CUT)
        told = [str(r["reason"]) for r in z.rejected if r["strategy"] == inclined_axis.NAME]
        if z.strategy not in LEANING:
            found, without = "stays upright", "it is finished in bands, or no pass lies on it"
        elif way > MOSTLY * whole:
            found, without = f"is upright along {way:.0f} of {whole:.0f} mm it cuts", "no axis near is free there"
        else:
            continue
        why = "; ".join(told[:MOST_REASONS]) or without
        out.append(JobCaution("upright", (z.zone.id, z.zone.tool.id),
                           f"zone {z.zone.id}: tool {z.zone.tool.id} is asked to lean and {found} ({why})",
                           way, MOSTLY * whole,
                           "give it a slimmer or longer tool, another lean, or leave it as it is"))
    return out


def walls_to_cut(ready: Prepared) -> list[Wall]:
    """Walls of which anything is to be cut."""
    cut = set(np.unique(ready.samples.face).tolist())
    return [w for w in ready.decomposition.walls if cut & set(w.faces)]


def thin_walls(ready: Prepared) -> list[JobCaution]:
    """Walls to be cut that are more than ``MOST_RATIO`` times as high as thick, each once, where it is worst."""
    view = ready.views[0]
    out = []
    for s in slender_walls(view.part, view.tree, walls_to_cut(ready), MOST_RATIO):
        x, y, z = view.back(np.array(s.at)).tolist()
        message = (f"wall {s.wall} is {s.thickness:.2f} mm thick and {s.height:.2f} high near X{x:.2f} Y{y:.2f} "
                   f"Z{z:.2f}: {s.ratio:.1f} to 1 (limit {MOST_RATIO:g} to 1), so it gives way and swings")
        out.append(JobCaution("thin_wall", (s.wall,), message, s.ratio, MOST_RATIO,
                           "hold it or fill the room beside it, cut both its sides down in turn, or make it thicker",
                           (x, y, z)))
    return out


def unheld(support: Support) -> list[JobCaution]:
    """That thin walls are finished without support, where the proof of a job does not hold that against it.

    support : of the proof, its place in the setup frame
    """
    if not support.over or support.found:
        return []
    message = (f"thin walls are finished where they are free for up to {support.most:.1f} times their thickness "
               f"(limit {support.limit:g} times), at {support.over} of {support.places} places")
    return [JobCaution("support", (), message, support.most, support.limit,
                    "hold them or fill the room beside them, or cut their two sides down in turn", support.at)]


def bent(steps: Sequence[Workingstep]) -> list[JobCaution]:
    """Tools that would bend too far, in layers and in finishing, each with the worst of its steps."""
    groups: dict[tuple[str, str], list[tuple[Workingstep, Bend]]] = {}
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
            remedy = "its feed is the setup's own and stays; take a shorter or thicker tool"
        else:
            remedy = f"its feed is eased to {100.0 * bend.share:.0f} %, with {bend.deflection:.3f} mm; a shorter or " \
                     "thicker tool needs no easing"
        out.append(JobCaution("deflection", (tool, *(s.id for s, _ in group)), message, bend.full, bend.limit, remedy))
    return out


def lives_ended(inputs: JobInputs, steps: Sequence[Workingstep]) -> list[JobCaution]:
    """Tools that take more than one cutter, and steps that one cutter does not last for, in the order of the tools."""
    out = []
    for tool in inputs.tools:
        mine = [s for s in steps if s.tool.id == tool.id]
        if tool.life_min is None or not mine:
            continue
        asked = [s.id for s in mine if s.fresh]
        if asked:
            total = float(sum(minutes_in_cut(s).sum() for s in mine))
            message = (f"tool {tool.id} is in cut for {total:.3g} min and lasts for {tool.life_min:g}: the program "
                       f"stops for a fresh cutter before {', '.join(asked)}")
            out.append(JobCaution("tool_life", (tool.id, *asked), message, total, tool.life_min,
                               f"have {len(asked) + 1} cutters at hand"))
        for step, minutes in [(s.id, float(minutes_in_cut(s).sum())) for s in mine]:
            if minutes > tool.life_min * (1.0 + 1e-9):
                message = f"{step} keeps tool {tool.id} in cut for {minutes:.3g} min (limit {tool.life_min:g} min)"
                out.append(JobCaution("tool_life", (tool.id, step), message, minutes, tool.life_min,
                                   "the tool never goes up in it, so no cutter is changed; take one that lasts longer"))
    return out


def sentences(cautions: Sequence[JobCaution]) -> tuple[str, ...]:
    """The sentences of cautions."""
    return tuple(c.sentence for c in cautions)


__all__ = ["JobCaution", "bent", "limited", "lives_ended", "sentences", "thin_walls", "uncut_centres", "unheld",
           "walls_to_cut"]
