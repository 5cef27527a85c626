"""What a planner may ask beyond the zones: the tools to add, and from where each zone could be approached."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.rays import first_hits
from geometry.sampling import SurfaceSamples
from service.prepare import Prepared, clearances
from zones.approach import Cone, approach, directions_over_hemisphere, zone_cone
from zones.machinable import SEEN
from zones.proposal import Proposal, propose
from zones.sight import able
from zones.view import View
from zones.zoning import ZoneArea

CONE_SAMPLES = 40  # of a zone that are asked
CONE_DIRECTIONS = 91  # over the half of the sphere round the access
CONE_SEED = 3
LENGTHS = ("diameter_mm", "corner_radius_mm", "flute_length_mm", "neck_diameter_mm", "neck_length_mm",
           "shank_diameter_mm", "stickout_mm")
SKIN = 0.02  # mm off the surface where a ray upward starts


def proposals(ready: Prepared) -> list[tuple[View, Proposal]]:
    """The smallest change of the tool set for each access, for what is in sight of it and of none before it."""
    rest = np.flatnonzero(~ready.zoning.taken & (ready.samples.area > 0))
    scallop = ready.setup.quality.scallop_height_mm
    out = []
    for k, view in enumerate(ready.views):
        last = k == len(ready.views) - 1
        open_up = _open(view, view.samples.subset(rest))
        mine = rest if last else rest[open_up]
        rest = rest[:0] if last else rest[~open_up]
        out.append((view, propose(view.samples.subset(mine), view.fields, view.obstacles, view.part, ready.lift,
                                  clearances(ready.setup),
                                  lambda tool, normals: able(tool, normals, scallop))))
    return out


def _open(view: View, samples: SurfaceSamples) -> NDArray[np.bool_]:
    """(n,) bool: faces the access and nothing stands above."""
    if not len(samples):
        return np.zeros(0, np.bool_)
    _, above = first_hits(view.tree, samples.points + SKIN * samples.normals, (0.0, 0.0, 1.0), 1e-4)
    return np.asarray((samples.normals[:, 2] > SEEN) & (np.asarray(above) < 0))


def cone_of(ready: Prepared, zone: ZoneArea) -> Cone | None:
    """The approach cone of a zone with its tool, in the setup frame, round or beside the axis it was cut from.

    It holds that axis. None where not even that gets 98 % of the area that was asked.
    """
    view = ready.view(zone.access)
    rows = np.flatnonzero(view.samples.area[zone.samples] > 0)
    if len(rows) > CONE_SAMPLES:
        rows = np.sort(np.random.default_rng(CONE_SEED).choice(rows, CONE_SAMPLES, replace=False))
    if not len(rows):
        return None
    few = view.samples.subset(zone.samples[rows])
    directions = directions_over_hemisphere(CONE_DIRECTIONS)
    got = approach(view.obstacles, zone.tool, clearances(ready.setup), few.points, few.normals, directions,
                   ready.lift, ready.setup.quality.stock_allowance_mm, zone.tips[rows])
    cone = zone_cone(got, few.area, directions, holds_first=True)
    return None if cone is None else Cone(view.back(cone.axis), cone.half_angle, cone.share, cone.resolution)


def as_dict(found: list[tuple[View, Proposal]]) -> dict[str, Any]:
    """The proposal of a report: one list of tools, what they empty, what stays by reason; mm and mm²."""
    tools: list[dict[str, Any]] = []
    stays: dict[str, float] = {}
    for view, proposal in found:
        for t in proposal.tools:
            lengths = {k: round(getattr(t, k), 4) for k in LENGTHS}
            tools.append({"kind": t.kind, **lengths, "slenderness": round(t.neck_length_mm / t.diameter_mm, 2),
                          "instead_of": t.instead_of or None, "access": view.id, "area_mm2": round(t.area_mm2, 3)})
        for reason, area in proposal.stays_mm2.items():
            stays[reason] = stays.get(reason, 0.0) + area
    return {"tools": tools, "emptied_mm2": round(sum(p.emptied_mm2 for _, p in found), 3),
            "stays_mm2": {k: round(v, 3) for k, v in sorted(stays.items())}}


__all__ = ["as_dict", "cone_of", "proposals"]
