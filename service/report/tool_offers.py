"""The tools to add to a setup. Zones are built again with them, so that each promised area is that of a real zone."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.tool_body import ToolBody
from schemas.tools import Tool
from service.stages.job_inputs import JobInputs
from service.stages.preparation import Prepared, tip_field
from zones.reach.access_reach import Reach
from zones.reach.access_view import View
from zones.reach.tip_field import TipField, touchable
from zones.remainder.obstructions import in_sight
from zones.remainder.reasons import ProposalVerdict
from zones.remainder.tool_proposal import ToolProposal, ToolToAdd, propose
from zones.remainder.tool_requirements import ToolRequirement
from zones.zoning.zones import LEAST_ZONE_MM2, Zoning, build_zones

LENGTHS = ("diameter_mm", "corner_radius_mm", "flute_length_mm", "neck_diameter_mm", "neck_length_mm",
           "shank_diameter_mm", "stickout_mm")


@dataclass(frozen=True, eq=False)
class Offer:
    """A tool to add to a setup.

    access   : id of the access it is for
    proposed : its shape
    body     : the same with an id and a number that are free in the setup
    area_mm2 : area of the remainder in the zones of the tool
    """

    access: str
    proposed: ToolToAdd
    body: ToolBody
    area_mm2: float = 0.0


@dataclass(frozen=True, eq=False)
class _Added:
    """Tip limit and reach of a tool that is not in the setup, in one view."""

    limit: TipField
    reach: Reach


@dataclass(frozen=True, eq=False)
class Offers:
    """All tools to add, the area they empty, mm², and the area that stays by reason, mm²."""

    tools: tuple[Offer, ...]
    emptied_mm2: float
    stays_mm2: dict[str, float]


def offers(ready: Prepared) -> Offers:
    """The smallest set of tools to add.

    Each access gets the samples of the remainder that it sees and no access before it does. Zones are built again with
    the added tools, for the remainder only. A tool whose zones hold less than the least area of a zone is dropped, the
    smallest first, and several at once where they hold less than that together. Then zones are built once more.
    """
    rest = ~ready.zoning.taken & (ready.samples.area > 0)
    proposals = _proposals(ready, np.flatnonzero(rest))
    found = _numbered(ready.inputs, [(v.id, t) for v, _, p in proposals for t in p.tools])
    area, zoning = ready.samples.area, ready.zoning
    added = [_added(ready, view, found, rest) for view in ready.views]
    while found:
        zoning = _again(ready, {o.body.id for o in found}, added)
        found = [replace(o, area_mm2=sum(float(area[z.samples[rest[z.samples]]].sum()) for z in zoning.zones
                                         if z.tool.id == o.body.id)) for o in found]
        kept = _worth_it(found)
        if len(kept) == len(found):
            break
        found = kept
    if not found:
        zoning = ready.zoning
    stays = float(area[~zoning.taken].sum())
    emptied = float(area[~ready.zoning.taken].sum()) - stays
    return Offers(tuple(found), emptied, _stays(proposals, area, zoning.taken, stays))


def _proposals(ready: Prepared, rest: NDArray[np.int64]) -> list[tuple[View, NDArray[np.int64], ToolProposal]]:
    """Each view with its samples of the remainder and the proposal for them; the last view gets all that are left."""
    out = []
    for k, view in enumerate(ready.views):
        last = k == len(ready.views) - 1
        here = in_sight(view.samples.subset(rest), view.obstacles) | last
        mine, rest = rest[here], rest[~here]
        requirement = ToolRequirement(view, ready.lift, ready.inputs.clearances)
        out.append((view, mine, propose(view.samples.subset(mine), requirement)))
    return out


def _numbered(inputs: JobInputs, tools: Sequence[tuple[str, ToolToAdd]]) -> list[Offer]:
    """The tools with numbers above those of the setup, and ids of 'P' and the number."""
    bodies = {b.id: b for b in inputs.bodies}
    number = max(b.number for b in bodies.values())
    out = []
    for access, t in tools:
        number += 1
        while f"P{number}" in bodies:
            number += 1
        out.append(Offer(access, t, t.body(f"P{number}", number, bodies[t.holder_of].holder)))
    return out


def _added(ready: Prepared, view: View, found: Sequence[Offer], rest: NDArray[np.bool_]) -> dict[str, _Added]:
    """The tools by id in one view: their tip limit and their reach.

    rest : (n,) bool, samples of the remainder; the reach of the others is not computed
    """
    rows, s = np.flatnonzero(rest), view.samples
    standing = next(iter(view.fields.values())).standing
    out = {}
    for o in found:
        limit = tip_field(ready.inputs, ready.blank, view.rotation, standing, view.part.bounds, o.body)
        few = touchable(limit, s.points[rows], s.normals[rows], ready.lift)
        reach = Reach(np.zeros(len(s), np.bool_), np.zeros(len(s), np.bool_), np.zeros((len(s), 3)))
        reach.by_cutter[rows], reach.by_tool[rows], reach.tips[rows] = few
        out[o.body.id] = _Added(limit, reach)
    return out


def _again(ready: Prepared, ids: Container[str], added: Sequence[Mapping[str, _Added]]) -> Zoning:
    """Zones with some of the tools in ``added`` beside those of the setup, in every view."""
    new = [{t: a for t, a in here.items() if t in ids} for here in added]
    views = [replace(v, fields={**v.fields, **{t: a.limit for t, a in n.items()}})
             for v, n in zip(ready.views, new, strict=True)]
    known = [{**r, **{t: a.reach for t, a in n.items()}} for r, n in zip(ready.zoning.reach, new, strict=True)]
    return build_zones(views, ready.decomposition, ready.inputs.quality.scallop_height_mm, ready.lift, known=known)


def _worth_it(found: Sequence[Offer]) -> list[Offer]:
    """The tools without those to drop now: none, one, or several that together hold less than the least zone."""
    by_area = sorted(found, key=lambda o: o.area_mm2)
    if by_area[0].area_mm2 >= LEAST_ZONE_MM2:
        return list(found)
    held = np.cumsum([o.area_mm2 for o in by_area])
    drop = {o.body.id for o in by_area[:max(1, int(np.searchsorted(held, LEAST_ZONE_MM2)))]}
    return [o for o in found if o.body.id not in drop]


def _stays(proposals: Sequence[tuple[View, NDArray[np.int64], ToolProposal]], area: NDArray[np.float64],
           taken: NDArray[np.bool_], total: float) -> dict[str, float]:
    """Area that stays, mm², by reason, scaled from the samples of the proposals to ``total``."""
    stays: dict[str, float] = {}
    for _, mine, proposal in proposals:
        rows = mine[proposal.rows]
        why = np.where(proposal.why == ProposalVerdict.TAKEN, ProposalVerdict.TOO_LITTLE, proposal.why)
        weight = float(area[mine].sum()) / max(float(area[rows].sum()), 1e-300)
        for reason in sorted(set(map(str, why[~taken[rows]]))):
            stays[reason] = stays.get(reason, 0.0) + weight * float(area[rows[~taken[rows] & (why == reason)]].sum())
    whole = sum(stays.values())
    return {k: v * total / whole for k, v in sorted(stays.items())} if whole > 0.0 else {}


def as_dict(inputs: JobInputs, found: Offers) -> dict[str, Any]:
    """The proposal of a report: the tools, the area they empty and the area that stays by reason; mm and mm²."""
    tools = []
    for o in found.tools:
        t = o.proposed
        lengths = {k: round(getattr(t, k), 4) for k in LENGTHS}
        cone = {"taper_angle_deg": t.taper_angle_deg} if t.taper_angle_deg else {}
        tools.append({"kind": t.kind, **lengths, **cone, "slenderness": round(t.neck_length_mm / t.diameter_mm, 2),
                      "instead_of": t.instead_of or None, "like": t.holder_of, "access": o.access,
                      "area_mm2": round(o.area_mm2, 3), "tool": _entry(inputs, o)})
    return {"tools": tools, "emptied_mm2": round(found.emptied_mm2, 3),
            "stays_mm2": {k: round(v, 3) for k, v in found.stays_mm2.items()}}


def _entry(inputs: JobInputs, offer: Offer) -> dict[str, Any]:
    """The tool as an entry of ``tools`` of a setup, in the holder of the tool that it resembles."""
    t = offer.proposed
    like = next(x for x in inputs.tools if x.id == t.holder_of)
    lengths = {k: round(getattr(t, k), 4) for k in LENGTHS}
    assert like.gauge_length_mm is not None and like.stickout_mm is not None  # every Tool fills both in
    gauge = like.gauge_length_mm - like.stickout_mm + t.stickout_mm
    entry = Tool(id=offer.body.id, number=offer.body.number, kind=t.kind, taper_angle_deg=t.taper_angle_deg,
                 flutes=like.flutes,
                 center_cutting=like.center_cutting, gauge_length_mm=round(gauge, 4), max_rpm=like.max_rpm,
                 holder=like.holder, **lengths)
    return entry.model_dump(mode="json")


__all__ = ["Offer", "Offers", "as_dict", "offers"]
