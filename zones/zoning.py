"""Which tool cuts which area: samples of the machinable area become zones.

1. Ma, the machinable area: faces the access direction sees, without the seat and the excluded ones.
2. Every face belongs to a *region*: a connection, a channel, the outside of a wall, wall tops, floors, or
   free surface. Every sample has a *form*: level, steep or shallow.
3. Tools are tried from the stoutest on. A tool takes the samples its cutting part can touch, down to the
   cutting plane where its shank or holder first meets the surroundings (the neck rule); what lies deeper, or
   where it does not fit, is left to the next tool. What no other tool takes either is then given to the stoutest
   one that stands clear of it, below its cutting plane or not.
4. Samples of one region, form and tool are one zone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from geometry.bvh import TriangleTree
from geometry.mesh import F64
from geometry.part import Part
from geometry.rays import first_hits
from geometry.sampling import SurfaceSamples
from geometry.toolbody import ToolBody
from zones.model import Decomposition
from zones.reach import TipField, touchable

STEEP = 0.70710678  # n_z below: steeper than 45 degrees, cut by waterlines
LEVEL = 1.0 - 1e-6  # n_z above: a level plane, a flat end leaves no cusp
SEEN = -0.02  # n_z above: the access direction sees it
SEEN_SHARE = 0.005  # of the area of a face
LEAST_ZONE_MM2 = 1.0
LEAST_ZONE_SHARE = 0.002
SMALL_REGION_MM2 = 30.0  # a region this small gets one tool, not a tool change for every corner
ONE_TOOL_SHARE = 0.97
PLANE_MARGIN = 0.02  # mm, cutting plane above the first sample a shank or holder forbids


class Form(StrEnum):
    """How a sample is cut."""

    LEVEL = "level"
    SHALLOW = "shallow"
    STEEP = "steep"


@dataclass(frozen=True, eq=False)
class ZoneArea:
    """A machinable zone: what one tool cuts in one region.

    id      : 'Z3'
    region  : 'C2' a connection, 'H1' a channel, 'W1' the outside of a wall, 'top', 'floor' or 'free'
    samples : (k,) indices into the samples of the machinable area
    tips    : (k, 3) float64, mm, an admissible tip for each
    plane   : z of the cutting plane below which the tool must not be asked, -inf where none
    rejected: alternatives with the reason and the numbers
    """

    id: str
    kind: str
    region: str
    form: Form
    tool: ToolBody
    samples: NDArray[np.int64]
    tips: F64
    faces: tuple[int, ...]
    top: float
    bottom: float
    plane: float
    rejected: tuple[dict[str, object], ...] = field(default=())


def machinable_faces(samples: SurfaceSamples, decomposition: Decomposition, wanted: set[int] | None,
                     excluded: set[int]) -> set[int]:
    """Numbers of the faces of the machinable area Ma.

    By default every face of which the access direction sees at least ``SEEN_SHARE``, without the seat; else the
    faces asked for. The share keeps the answer from hanging on one facet of rounding at the rim of an underside.
    """
    total = np.bincount(samples.face, weights=samples.area)
    part = np.bincount(samples.face, weights=samples.area * (samples.normals[:, 2] > SEEN), minlength=len(total))
    seen = {int(f) for f in np.flatnonzero((part > 0) & (part >= SEEN_SHARE * total))}
    chosen = seen - set(decomposition.seat) if wanted is None else set(wanted)
    return chosen - excluded


def forms_of(normals: F64) -> NDArray[np.object_]:
    """Form of each sample by its outward unit normal (n, 3)."""
    out = np.full(len(normals), Form.SHALLOW, dtype=object)
    out[normals[:, 2] > LEVEL] = Form.LEVEL
    out[normals[:, 2] < STEEP] = Form.STEEP
    return out


def face_regions(part: Part, decomposition: Decomposition, samples: SurfaceSamples,
                 tree: TriangleTree) -> dict[int, str]:
    """Region of every face number.

    Steep faces of a wall belong to the channel that most of their outward rays cross, else to the outside of
    the wall; the other faces follow from their role.
    """
    region: dict[int, str] = {}
    wall_of: dict[int, str] = {}
    for w in decomposition.walls:
        for f in w.faces:
            wall_of[f] = w.id
            region[f] = "top"
        for f in w.sides:
            region[f] = w.id
    channel_of = {frozenset(c.walls): c.id for c in decomposition.channels}
    for face, channel in _facing_channels(decomposition, samples, tree, part, wall_of, channel_of).items():
        region[face] = channel
    for c in decomposition.connections:
        for f in c.faces:
            region[f] = c.id
    for info in part.faces:
        if info.number not in region:
            role = decomposition.face_role.get(info.number, "free")
            region[info.number] = "floor" if role in ("floor", "base") else "free"
    return region


def _facing_channels(decomposition: Decomposition, samples: SurfaceSamples, tree: TriangleTree, part: Part,
                     wall_of: dict[int, str], channel_of: dict[frozenset[str], str]) -> dict[int, str]:
    sides = np.array(sorted({f for w in decomposition.walls for f in w.sides}), dtype=np.int64)
    if not len(sides) or not channel_of:
        return {}
    pick = np.flatnonzero(np.isin(samples.face, sides) & (np.abs(samples.normals[:, 2]) < STEEP))[::4]
    _, hit = first_hits(tree, samples.points[pick], samples.normals[pick], 1e-4, 1e6)
    votes: dict[int, dict[str, int]] = {}
    total: dict[int, int] = {}
    for k, triangle in zip(pick.tolist(), np.asarray(hit).tolist(), strict=True):
        face = int(samples.face[k])
        total[face] = total.get(face, 0) + 1
        if triangle < 0:
            continue
        other = wall_of.get(int(part.mesh.face_ids[triangle]))
        if other is None:
            continue
        channel = channel_of.get(frozenset((wall_of[face], other)))
        if channel:
            mine = votes.setdefault(face, {})
            mine[channel] = mine.get(channel, 0) + 1
    out = {}
    for face, mine in votes.items():
        best = min(mine, key=lambda c: (-mine[c], c))
        if mine[best] >= 0.3 * total[face]:
            out[face] = best
    return out


def able(tool: ToolBody, normals: F64, scallop: float) -> NDArray[np.bool_]:
    """(n,) bool: a strategy exists for this tool on samples with these normals (n, 3).

    A corner of radius r cuts everything; a sharp-cornered flat end cuts level planes and walls so upright that
    steps of at least 0.1 mm keep the scallop.
    """
    if tool.corner_radius > 0:
        return np.ones(len(normals), np.bool_)
    nz = normals[:, 2]
    return np.asarray((nz > LEVEL) | (np.abs(nz) <= 0.5 * scallop / 0.1))


def preference(tool: ToolBody, form: Form) -> tuple[float, float, float]:
    """Sort key of the tools for a form, best first: flat ends on level planes, then stout and short ones."""
    kind = {"flat": 0.0, "bull": 1.0, "ball": 2.0}[tool.kind] if form is Form.LEVEL else 0.0
    return (kind, -tool.diameter, tool.stickout)


def build_zones(samples: SurfaceSamples, regions: dict[int, str], fields: dict[str, TipField], scallop: float,
                lift: float) -> list[ZoneArea]:
    """Give every sample of the machinable area to the stoutest tool that can touch it.

    samples : of the machinable area
    regions : region of every face number
    fields  : TipField by tool id
    scallop : mm, allowed cusp
    lift    : mm, distance along the normal within which a touch counts

    Returns
    -------
    list of ZoneArea
        In machining order (tools by size, then from the top); samples in none of them are out of reach.
    """
    forms = forms_of(samples.normals)
    region = np.array([regions[int(f)] for f in samples.face], dtype=object)
    reach = {tid: touchable(f, samples.points, samples.normals, lift) for tid, f in fields.items()}
    can = {tid: able(f.tool, samples.normals, scallop) for tid, f in fields.items()}
    found: list[ZoneArea] = []
    for name in sorted(set(region.tolist())):
        for form in Form:
            members = np.flatnonzero((region == name) & (forms == form))
            if len(members):
                found.extend(_split(samples, members, str(name), form, fields, reach, can))
    found.sort(key=lambda z: (-z.tool.diameter, z.tool.stickout, z.tool.id, _stage(z), -z.top, z.region, z.form))
    return [_named(z, k) for k, z in enumerate(found, start=1)]


def _stage(zone: ZoneArea) -> int:
    """Tops and connections before walls, walls before floors: nothing is undercut while it still stands."""
    if zone.form is Form.STEEP:
        return 1
    return 2 if zone.region == "floor" else 0


def _named(zone: ZoneArea, k: int) -> ZoneArea:
    from dataclasses import replace

    return replace(zone, id=f"Z{k}")


Reach = dict[str, tuple[NDArray[np.bool_], NDArray[np.bool_], F64]]


def _split(samples: SurfaceSamples, members: NDArray[np.int64], name: str, form: Form, fields: dict[str, TipField],
           reach: Reach, can: dict[str, NDArray[np.bool_]]) -> list[ZoneArea]:
    left = members
    area = samples.area
    least = max(LEAST_ZONE_MM2, LEAST_ZONE_SHARE * float(area[members].sum()))
    tried: list[dict[str, object]] = []
    out: dict[str, ZoneArea] = {}
    order = sorted(fields, key=lambda t: (*preference(fields[t].tool, form), t))
    if float(area[members].sum()) < SMALL_REGION_MM2:
        gets = {t: float(area[members[can[t][members] & reach[t][1][members]]].sum()) for t in order}
        most = max(gets.values())
        order.sort(key=lambda t: gets[t] < ONE_TOOL_SHARE * most)
    for tid, ruled in [*((t, True) for t in order), *((t, False) for t in order)]:
        if float(area[left].sum()) < least:
            break
        tool = fields[tid].tool
        by_cutter, by_tool, tips = reach[tid]
        usable = can[tid][left]
        stopped = left[usable & by_cutter[left] & ~by_tool[left]] if ruled else left[:0]
        plane = float(samples.points[stopped, 2].max()) + PLANE_MARGIN if len(stopped) else -np.inf
        take = left[usable & by_tool[left] & (samples.points[left, 2] >= plane)]
        got = float(area[take].sum())
        if got < least:
            if ruled:
                tried.append(_refusal(tool, form, usable, by_cutter[left], got, least, plane))
            continue
        left = left[~np.isin(left, take)]
        before = out.get(tid)
        if before is not None:
            take = np.sort(np.concatenate([before.samples, take]))
        pts = samples.points[take]
        out[tid] = ZoneArea("", "SCZI" if name.startswith("C") else "SCZ", name, form, tool, take, tips[take],
                            tuple(int(f) for f in np.unique(samples.face[take])), float(pts[:, 2].max()),
                            float(pts[:, 2].min()), plane, before.rejected if before is not None else tuple(tried))
        tried.append({"tool": tid, "reason": "cuts another part of this region",
                      "value": round(got, 3), "limit": round(float(area[members].sum()), 3)})
    return list(out.values())


def _refusal(tool: ToolBody, form: Form, usable: NDArray[np.bool_], by_cutter: NDArray[np.bool_], got: float,
             least: float, plane: float) -> dict[str, object]:
    if not usable.any():
        return {"tool": tool.id, "reason": f"a sharp-cornered end leaves steps on {form} area", "value": 0.0,
                "limit": 0.0}
    if not (usable & by_cutter).any():
        return {"tool": tool.id, "reason": "too thick to touch it", "value": tool.diameter, "limit": 0.0}
    if np.isfinite(plane) and got < least:
        return {"tool": tool.id, "reason": "shank or holder meets the surroundings above it",
                "value": round(tool.neck_length, 3), "limit": round(plane, 3)}
    return {"tool": tool.id, "reason": "adds less area than is worth a zone", "value": round(got, 3),
            "limit": round(least, 3)}


def is_open(zone: ZoneArea, field: TipField) -> bool:
    """Whether passes can leave the zone: at its deepest tips the free region leads out of the part.

    A zone with walls or connections all round is closed.
    """
    from scipy import ndimage

    deep = zone.tips[zone.tips[:, 2] <= np.quantile(zone.tips[:, 2], 0.1) + 1e-9]
    labels, _ = ndimage.label(field.height <= float(deep[:, 2].max()) + 1e-3)
    border = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    inside = labels[field.lattice.cells(deep[:, :2])]
    return bool(np.isin(inside[inside > 0], border[border > 0]).mean() > 0.5) if (inside > 0).any() else False
