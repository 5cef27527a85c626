"""What no tool of the setup reaches, why, and which tool would.

A sample nobody took is asked, in this order: is something above it (undercut); could a cutter of the setup
touch it if shank and holder were out of the way (then how much longer a neck it needs); would a thinner ball or
a sharp-cornered end fit (then how thick it may be). What is left after that is a corner no rotating tool makes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.bvh import TriangleTree
from geometry.mesh import F64
from geometry.part import Part
from geometry.rays import first_hits
from geometry.sampling import SurfaceSamples
from geometry.toolbody import ToolBody
from zones.model import Decomposition
from zones.reach import LEVEL_TOLERANCE, Clearances, TipField, contact_tips, lattice_step, touchable
from zones.zoning import SEEN

SHARES = (0.75, 0.5, 0.35, 0.25, 0.15, 0.08)  # of the thinnest cutter at hand, tried from stout to thin
LEAST_DIAMETER = 0.1  # mm, the thinnest ball anybody is asked to buy
ASKED_AT_MOST = 6000  # samples that are asked one by one; the rest follow the nearest in kind by random choice


@dataclass(frozen=True)
class Remainder:
    """Area of one region that stays, for one reason.

    faces      : face numbers; area : mm²
    reason     : 'undercut', 'undercut behind connection C2', 'shank', 'holder', 'gap', 'corner', 'sharp corner'
                 or 'pass'
    would_need : the tool that would do, or what else would; empty where no tool would
    at         : a point of it, mm
    """

    faces: tuple[int, ...]
    area: float
    reason: str
    would_need: dict[str, object]
    at: tuple[float, float, float]


def explain(samples: SurfaceSamples, regions: dict[int, str], fields: dict[str, TipField], part: Part,
            tree: TriangleTree, decomposition: Decomposition, lift: float,
            given_up: NDArray[np.bool_] | None = None) -> list[Remainder]:
    """Group samples that stay by region and reason.

    samples  : SurfaceSamples that no proved pass covers, mm, access frame
    regions  : region of every face number
    fields   : TipField by tool id, what was at hand
    lift     : mm, distance along the normal within which a touch counts
    given_up : (n,) bool, samples a tool could touch but no pass of the plan does

    Returns
    -------
    list of Remainder
        Largest area first; areas sum to that of the samples.
    """
    n = len(samples)
    if not n:
        return []
    rng = np.random.default_rng(7)
    asked = np.sort(rng.choice(n, ASKED_AT_MOST, replace=False)) if n > ASKED_AT_MOST else np.arange(n)
    few = samples.subset(asked)
    weight = float(samples.area.sum()) / max(float(few.area.sum()), 1e-12)
    reason, need = _reasons(few, fields, part, tree, decomposition, lift)
    if given_up is not None:
        for k in np.flatnonzero(given_up[asked] & np.isin(reason, ("gap", "corner", "sharp corner"))):
            reason[k], need[k] = "pass", {}
    groups: dict[tuple[str, str], list[int]] = {}
    for row in range(len(few)):
        groups.setdefault((regions[int(few.face[row])], str(reason[row])), []).append(row)
    out = []
    for (_, why), members in groups.items():
        m = np.array(members)
        out.append(Remainder(tuple(int(f) for f in np.unique(few.face[m])), float(few.area[m].sum()) * weight, why,
                             _strictest([need[k] for k in members]), tuple(few.points[m[len(m) // 2]].tolist())))
    return sorted(out, key=lambda r: (-r.area, r.reason, r.faces))


Needs = list[dict[str, object]]


def _strictest(needs: Needs) -> dict[str, object]:
    """One tool that does for all: the thinnest and longest asked for by 98 % of the samples."""
    some = [n for n in needs if n]
    if not some:
        return {}
    out: dict[str, object] = {"kind": some[0]["kind"]} if "kind" in some[0] else {}
    for key, quantile in (("diameter_mm", 0.02), ("neck_length_mm", 0.98), ("stickout_mm", 0.98)):
        values = [float(str(n[key])) for n in some if key in n]
        if values:
            out[key] = round(float(np.quantile(values, quantile)), 3)
    return out


def _reasons(few: SurfaceSamples, fields: dict[str, TipField], part: Part, tree: TriangleTree,
             decomposition: Decomposition, lift: float) -> tuple[NDArray[np.object_], Needs]:
    n = len(few)
    reason = np.full(n, "", dtype=object)
    need: Needs = [{} for _ in range(n)]
    owner = {f: c.id for c in decomposition.connections for f in c.faces}
    up = np.tile(np.array([0.0, 0.0, 1.0]), (n, 1))
    _, above = first_hits(tree, few.points + 0.02 * few.normals, up, 1e-4, 1e6)
    above = np.asarray(above)
    under = (few.normals[:, 2] <= SEEN) | (above >= 0)
    for k in np.flatnonzero(under):
        c = owner.get(int(part.mesh.face_ids[above[k]])) if above[k] >= 0 else None
        reason[k] = f"undercut behind connection {c}" if c and c != owner.get(int(few.face[k])) else "undercut"
        need[k] = {"kind": "other access"}
    for tid in sorted(fields, key=lambda t: (fields[t].tool.diameter, t)):
        left = np.flatnonzero(reason == "")
        if len(left):
            _too_short(fields[tid], few, left, lift, reason, need)
    thinnest = min((f.tool for f in fields.values()), key=lambda t: t.diameter)
    _too_thick(thinnest, few, tree, part, lift, reason, need)
    reason[reason == ""] = "sharp corner"
    return reason, need


def _too_short(field: TipField, few: SurfaceSamples, left: NDArray[np.int64], lift: float,
               reason: NDArray[np.object_], need: Needs) -> None:
    by_cutter, by_tool, _ = touchable(field, few.points[left], few.normals[left], lift)
    tips = contact_tips(field.tool, few.points[left], few.normals[left], lift)
    who = field.blocker(tips)
    limit = field.noncut[field.coarse.cells(tips[:, :2])]
    for k in np.flatnonzero(by_cutter & ~by_tool):
        short = float(limit[k] - tips[k, 2]) + 2 * LEVEL_TOLERANCE
        i = int(left[k])
        if who[k] == 2:
            reason[i] = "holder"
            need[i] = {"kind": field.tool.kind, "diameter_mm": field.tool.diameter,
                       "stickout_mm": field.tool.stickout + max(short, 0.0)}
        else:
            reason[i] = "shank"
            need[i] = {"kind": field.tool.kind, "diameter_mm": field.tool.diameter,
                       "neck_length_mm": field.tool.neck_length + max(short, 0.0)}


def _too_thick(thinnest: ToolBody, few: SurfaceSamples, tree: TriangleTree, part: Part, lift: float,
               reason: NDArray[np.object_], need: Needs) -> None:
    top = float(part.bounds[1, 2])
    trials: list[tuple[str, float, float]] = []
    for share in (1.0, *SHARES):
        d = max(thinnest.diameter * share, LEAST_DIAMETER)
        trials.extend([("ball", d, d / 2), ("flat", d, 0.0)])
    ahead: F64 | None = None
    for kind, d, corner in trials:
        left = np.flatnonzero(reason == "")
        if not len(left):
            return
        if ahead is None:
            ahead, _ = first_hits(tree, few.points, few.normals, 1e-3, 1e6)
        body = replace(thinnest, diameter=d, corner_radius=corner, shank_diameter=d, neck_diameter=d, holder=())
        field = TipField(tree, body, Clearances(), part.bounds, d, lattice_step(body))
        fits, _, tips = touchable(field, few.points[left], few.normals[left], lift)
        upright = (few.normals[left, 2] > 1 - 1e-6) | (np.abs(few.normals[left, 2]) < 0.05)
        for k in np.flatnonzero(fits & (upright | (kind == "ball"))):
            i = int(left[k])
            reason[i] = "gap" if float(ahead[i]) < thinnest.diameter * 1.5 else "corner"
            need[i] = {"kind": kind, "diameter_mm": d, "neck_length_mm": top - float(tips[k, 2])}
