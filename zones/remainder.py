"""What no tool of the setup reaches, why, and which tool would.

A sample nobody took is asked, in this order: is something above it (undercut); can a tool at hand touch it after
all (then it was too little for a zone, or no pass got there); could a cutter of the setup touch it if shank and
holder were out of the way (then how much longer a tool it needs); would a thinner ball or a sharp-cornered end fit
(then how thick it may be). What is left after that is a corner no rotating tool makes. With several access
directions each is asked, and the one counts along which least is in the way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.bvh import TriangleTree
from geometry.drop import drop_tips
from geometry.mesh import F64
from geometry.part import Part
from geometry.rays import first_hits
from geometry.sampling import SurfaceSamples
from geometry.toolbody import ToolBody
from zones.catalogue import DIAMETERS
from zones.faces import connection_of
from zones.machinable import SEEN
from zones.model import Decomposition
from zones.reach import LEVEL_TOLERANCE, Clearances, TipField, lattice_step, touchable
from zones.regions import Labels
from zones.view import View

ASKED_AT_MOST = 6000  # samples that are asked one by one; the rest follow the nearest in kind by random choice
# how much is in the way of a sample along an access direction, least first; 'undercut ...' comes last
GRAVITY = {"pass": 0, "holder": 1, "shank": 2, "gap": 3, "corner": 4, "sharp corner": 5}


@dataclass(frozen=True)
class Remainder:
    """Area of one region that stays, for one reason, and the one tool that would do.

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


def explain(samples: SurfaceSamples, labels: Labels, views: Sequence[View], decomposition: Decomposition,
            lift: float, given_up: NDArray[np.bool_] | None = None) -> list[Remainder]:
    """Group samples that stay by region and reason.

    samples  : SurfaceSamples that no proved pass covers, mm, frame of the first view
    labels   : their regions
    views    : the access directions with the tools at hand
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
    reason, need = _of_views(few, views, decomposition, lift)
    if given_up is not None:
        for k in np.flatnonzero(given_up[asked] & np.isin(reason, ("gap", "corner", "sharp corner"))):
            reason[k], need[k] = "pass", {}
    base = [labels.regions[c].base for c in labels.code[asked]]
    groups: dict[tuple[str, str, str, str], list[int]] = {}
    for row in range(len(few)):
        kind = str(need[row].get("kind"))  # a ball and a flat end are two tools to buy
        groups.setdefault((base[row], str(reason[row]), kind, str(need[row].get("access"))), []).append(row)
    out = []
    for (_, why, *_), members in groups.items():
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
    out: dict[str, object] = {k: some[0][k] for k in ("kind", "access") if k in some[0]}
    for key, quantile in (("diameter_mm", 0.02), ("neck_length_mm", 0.98), ("stickout_mm", 0.98)):
        values = [float(str(n[key])) for n in some if key in n]
        if values:
            exact = 1e3 * float(np.quantile(values, quantile))
            out[key] = (math.floor(exact + 1e-6) if key == "diameter_mm" else math.ceil(exact - 1e-6)) / 1e3
    return out


def _of_views(few: SurfaceSamples, views: Sequence[View], decomposition: Decomposition,
              lift: float) -> tuple[NDArray[np.object_], Needs]:
    """Reason and need of each sample along the view in which least is in its way.

    few : in the frame of the first view
    """
    reason = np.full(len(few), "", dtype=object)
    need: Needs = [{} for _ in range(len(few))]
    gravity = np.full(len(few), np.inf)
    for view in views:
        turn = views[0].rotation @ view.rotation.T
        here = few if view is views[0] else replace(few, points=few.points @ turn, normals=few.normals @ turn)
        why, needs = _reasons(here, dict(view.fields), view.part, view.tree, decomposition, lift)
        how = np.array([GRAVITY.get(str(w), len(GRAVITY)) for w in why])
        for k in np.flatnonzero(how < gravity):
            named = len(views) > 1 and needs[k] and needs[k].get("kind") != "other access"
            reason[k], need[k] = why[k], {**needs[k], "access": view.id} if named else needs[k]
        gravity = np.minimum(gravity, how)
    return reason, need


def _reasons(few: SurfaceSamples, fields: dict[str, TipField], part: Part, tree: TriangleTree,
             decomposition: Decomposition, lift: float) -> tuple[NDArray[np.object_], Needs]:
    n = len(few)
    reason = np.full(n, "", dtype=object)
    need: Needs = [{} for _ in range(n)]
    owner = connection_of(part, decomposition)
    up = np.tile(np.array([0.0, 0.0, 1.0]), (n, 1))
    _, above = first_hits(tree, few.points + 0.02 * few.normals, up, 1e-4, 1e6)
    above = np.asarray(above)
    under = (few.normals[:, 2] <= SEEN) | (above >= 0)
    for k in np.flatnonzero(under):
        c = owner.get(int(part.mesh.face_ids[above[k]])) if above[k] >= 0 else None
        reason[k] = f"undercut behind connection {c}" if c and c != owner.get(int(few.face[k])) else "undercut"
        need[k] = {"kind": "other access"}
    open_to = np.flatnonzero(reason == "")
    asked = [(fields[t], *touchable(fields[t], few.points[open_to], few.normals[open_to], lift))
             for t in sorted(fields, key=lambda t: (fields[t].tool.diameter, t))]
    cuts = [np.full(len(open_to), f.tool.corner_radius > 0) | _upright(few.normals[open_to]) for f, *_ in asked]
    for (_, _, by_tool, _), able in zip(asked, cuts, strict=True):
        reason[open_to[by_tool & able]] = "pass"
    for (field, by_cutter, _, tips), able in zip(asked, cuts, strict=True):
        stopped = np.flatnonzero(by_cutter & able & (reason[open_to] == ""))
        _too_short(field, tips[stopped], open_to[stopped], reason, need)
    thinnest = min((f.tool for f in fields.values()), key=lambda t: t.diameter)
    _too_thick(thinnest, few, tree, part, lift, reason, need)
    reason[reason == ""] = "sharp corner"
    return reason, need


def _too_short(field: TipField, tips: F64, rows: NDArray[np.int64], reason: NDArray[np.object_],
               need: Needs) -> None:
    """Shank or holder stop a tool whose cutting part gets to samples ``rows`` at tips (n, 3)."""
    tool, short = field.tool, _shortfall(field, tips)
    for k, shank, holder in zip(rows.tolist(), short["shank"].tolist(), short["holder"].tolist(), strict=True):
        neck = tool.neck_length + max(shank, 0.0)
        reason[k] = "holder" if holder >= shank else "shank"
        need[k] = {"kind": tool.kind, "diameter_mm": tool.diameter, "neck_length_mm": neck,
                   "stickout_mm": max(tool.stickout + max(holder, 0.0), neck)}


def _shortfall(field: TipField, tips: F64) -> dict[str, F64]:
    """How much higher above the tip shank and holder would have to begin at tips (n, 3), mm; -inf where free.

    Seen from a cell diagonal around, so that the tool that is asked for also passes the coarse look-up.
    """
    out = {name: np.full(len(tips), -np.inf) for name in ("shank", "holder")}
    for d in field.discs:
        limit = field.disc_limit(d, drop_tips(field.tree, tips[:, :2], field.disc_radius(d, 1.0), 0.0))
        out[d.name] = np.maximum(out[d.name], limit - tips[:, 2] + 2 * LEVEL_TOLERANCE)
    return out


def _upright(normals: F64) -> NDArray[np.bool_]:
    """(n,) bool: level or so steep that a sharp-cornered end cuts it without steps."""
    return np.asarray((normals[:, 2] > 1 - 1e-6) | (np.abs(normals[:, 2]) < 0.05))


def _too_thick(thinnest: ToolBody, few: SurfaceSamples, tree: TriangleTree, part: Part, lift: float,
               reason: NDArray[np.object_], need: Needs) -> None:
    top = float(part.bounds[1, 2])
    trials: list[tuple[str, float, float]] = []
    for d in (thinnest.diameter, *(d for d in DIAMETERS if d < thinnest.diameter)):
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
        for k in np.flatnonzero(fits & (_upright(few.normals[left]) | (kind == "ball"))):
            i = int(left[k])
            reason[i] = "gap" if float(ahead[i]) < thinnest.diameter * 1.5 else "corner"
            need[i] = {"kind": kind, "diameter_mm": d, "neck_length_mm": top - float(tips[k, 2])}
