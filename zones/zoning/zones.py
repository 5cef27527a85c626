"""Zones: samples of the machinable area, by tool and access direction [Arivazhagan2020].

1. Every sample has a *region* in each view (``zones.plan_view.regions``: SCZ, or SCZI on, under or over a connection)
   and a *form*: level, steep or shallow.
2. The views take samples in turn. Two opposite views first share out the walls (``zones.zoning.cutting_planes``).
3. In each region and form, tools are tried from the stoutest on. A tool takes the samples that its cutting part can
   touch, down to the cutting plane where its shank or holder first meets the surroundings (the neck rule, cell by
   cell). Deeper samples, and places where it does not fit, are left to the next tool. Samples that no other tool takes
   go to the stoutest tool that stays clear of obstacles there, below its cutting plane or not.
4. The rest of all regions is pooled. A tool takes its share if it has a zone already, or gets enough of the pool.
5. Samples of one region, form, tool and view are one zone. A cell under or over a connection joins the zone of its
   channel or wall where the same tool gets there from the same side; otherwise it is a zone of its own.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from zones.machinable_area import AreaForm
from zones.model import Decomposition
from zones.plan_view.categories import Categories, Category
from zones.plan_view.regions import base_of
from zones.reach.access_reach import Reach, Sight
from zones.reach.access_view import View
from zones.reach.openness import OPEN_SHARE, open_share
from zones.reach.tip_field import TipField
from zones.zoning.cutting_planes import PLANE_MARGIN, RegionPlane, neck_planes, shares

# Least area that a tool must gain to be used in a region of any size: 1 mm² is 25 planning samples, on which an area is
# known to a fifth. Where samples stand wider, 25 of them count. A tool to buy must gain the same.
LEAST_ZONE_MM2 = 1.0
CERTAIN = 25
# Least area for one more zone of a tool in use, which costs a link but no tool change: five planning samples, and one
# where samples stand so wide that it is more. What the tool touches and nobody cuts would be stock left.
LEAST_PART_MM2 = 0.2
SMALL_REGION_MM2 = 30.0  # a smaller region gets one tool, not a tool change for every corner
ONE_TOOL_SHARE = 0.97


@dataclass(frozen=True, eq=False)
class ZoneArea:
    """A machinable zone: the area that one tool cuts in one region from one side. Heights and tips, mm, access frame.

    id      : 'Z3'
    access  : 'A1'
    region  : 'C2' a connection, 'H1' a channel, 'W1' the outside of a wall, 'top', 'floor' or 'free'; 'H1 over C2'
              where the zone is only such a cell, 'H1.2' where the region has several places
    merged  : names of the SCZI cells that belong to it
    samples : (k,) int64, index of the samples of the machinable area
    tips    : (k, 3) float64, mm, an admissible tip for each
    planes  : height of the cutting plane by name of the cell, the depth limit of the tool; without cells that have none
    rejected: alternatives with the reason and the numbers
    category: profile type and level of its walls
    """

    id: str
    access: str
    kind: str
    region: str
    form: AreaForm
    tool: ToolBody
    samples: NDArray[np.int64]
    tips: F64
    faces: tuple[int, ...]
    top: float
    bottom: float
    planes: Mapping[str, float] = field(default_factory=dict)
    merged: tuple[str, ...] = ()
    rejected: tuple[dict[str, object], ...] = ()
    category: Category = Category()

    @property
    def plane(self) -> float:
        """The highest of its cutting planes, mm, -inf where there is none."""
        return max(self.planes.values(), default=-np.inf)

    def below_plane(self, names: NDArray[np.object_], heights: F64) -> NDArray[np.bool_]:
        """(n,) bool: samples below the cutting plane of their cell.

        names   : (n,) object, str, names of the cells
        heights : (n,) float64, mm, of the samples, access frame
        """
        limit = np.array([self.planes.get(n, -np.inf) for n in names]) if self.planes else -np.inf
        return np.asarray(heights < limit)


@dataclass(frozen=True)
class Mcz:
    """Main computable zone: area that one tool can touch along one axis, mm², by its cutting part alone and as a whole.

    Defined in [Arivazhagan2020].
    """

    access: str
    tool: str
    cutter_area: float
    area: float


@dataclass(frozen=True, eq=False)
class Zoning:
    """Zones in machining order, main computable zones, cutting planes, and (n,) bool, samples in some zone.

    reach : Reach of each tool for every view
    """

    zones: tuple[ZoneArea, ...]
    mcz: tuple[Mcz, ...]
    planes: tuple[RegionPlane, ...]
    taken: NDArray[np.bool_]
    reach: tuple[Mapping[str, Reach], ...] = field(default=(), repr=False)


def build_zones(views: Sequence[View], decomposition: Decomposition, scallop: float, lift: float,
                categories: Categories | None = None, known: Sequence[Mapping[str, Reach]] = ()) -> Zoning:
    """Give every sample of the machinable area to the stoutest tool that can touch it [Arivazhagan2020].

    views         : in the order they are machined; the same samples and tools in each
    decomposition : in the frame of the first view
    scallop       : mm, allowed cusp
    lift          : mm, distance along the normal within which a touch counts
    categories    : profiles of the regions; zones have none where None
    known         : for each view, Reach of some tools from an earlier computation

    Returns
    -------
    Zoning
        Zones in machining order: views in turn, tools by size, simple profiles first, then from the top. Samples
                                  outside
        all zones are out of reach.
    """
    sights = [Sight(v, decomposition, scallop, lift, known[k] if known else None) for k, v in enumerate(views)]
    area = views[0].samples.area
    mcz = tuple(Mcz(s.view.id, t, float(area[r.by_cutter].sum()), float(area[r.by_tool].sum()))
                for s in sights for t, r in s.reach.items())
    taken = np.zeros(len(area), np.bool_)
    found: list[ZoneArea] = []
    first_choice, between = shares(sights)
    rounds = [first_choice, [~taken] * len(sights)] if len(sights) > 1 else [[~taken]]
    for allowed in rounds:
        for sight, mine in zip(sights, allowed, strict=True):
            for base, form, members in sight.groups(mine & ~taken):
                for zone in _split(sight, members, base, form):
                    taken[zone.samples] = True
                    found.append(zone)
    found = _joined([*found, *_gleaned(sights, found, taken)], views)
    if categories is not None:
        found = [replace(z, category=categories.of(z.region)) for z in found]
    place = {v.id: k for k, v in enumerate(views)}
    found.sort(key=lambda z: (place[z.access], -z.tool.diameter, -z.tool.taper, z.tool.stickout, z.tool.id, _stage(z),
                              z.category.rank, -z.top, z.region, z.form))
    zones = tuple(replace(z, id=f"Z{k}") for k, z in enumerate(found, start=1))
    return Zoning(zones, mcz, (*between, *_neck_planes(zones, sights)), taken, tuple(s.reach for s in sights))


def _neck_planes(zones: Sequence[ZoneArea], sights: Sequence[Sight]) -> list[RegionPlane]:
    """The planes at which zones end, highest first in each region."""
    out = set()
    above = {s.view.id: {high + PLANE_MARGIN for bands in s.bands.values() for _, high in bands} for s in sights}
    for z in zones:
        for name, height in z.planes.items():
            moved = height in above[z.access]
            out.add((z.access, name, -height, z.tool.id, "neck, moved above a connection" if moved else "neck"))
    return [RegionPlane(access, -low, name, tool, reason) for access, name, low, tool, reason in sorted(out)]


def _stage(zone: ZoneArea) -> int:
    """Rank of a zone in the order: tops and connections, then walls, then floors, so that nothing is undercut."""
    if zone.form is AreaForm.STEEP:
        return 1
    return 2 if base_of(zone.region) == "floor" else 0


@dataclass
class _Take:
    """Samples of a group that one tool takes, and its cutting planes by cell."""

    rows: NDArray[np.int64]
    planes: dict[int, float]
    tried: tuple[dict[str, object], ...]


def least_area(area: F64, worth: float, samples: int) -> float:
    """Least area that a tool must gain, mm²: ``worth``, and at least the area of this many samples.

    area : (n,) float64, mm², area of each sample; 0 on borders
    """
    inner = area[area > 0]
    return max(worth, samples * float(inner.mean())) if len(inner) else worth


def _gleaned(sights: Sequence[Sight], found: Sequence[ZoneArea], taken: NDArray[np.bool_]) -> list[ZoneArea]:
    """Zones of the samples that are too few in each single region; updates ``taken``.

    Tools with a zone in a view come first, since they are in use already. Then come tools that gain enough of all
    regions together, the stoutest first.
    """
    out: list[ZoneArea] = []
    for sight in sights:
        here = [z for z in found if z.access == sight.view.id]
        used = {z.tool.id for z in here}
        order = sight.order(AreaForm.STEEP)
        for tid in [*(t for t in order if t in used), *(t for t in order if t not in used)]:
            own = {(z.region, z.form) for z in here if z.tool.id == tid}
            parts = _parts(sight, sight.gets(tid) & ~taken, own)
            rows = np.concatenate([members for *_, members in parts]) if parts else np.zeros(0, np.int64)
            area = sight.samples.area[rows]
            if tid not in used and float(area.sum()) < least_area(area, LEAST_ZONE_MM2, CERTAIN):
                continue
            taken[rows] = True
            for base, form, members in parts:
                out.extend(_zones_of(sight, tid, _Take(members, {}, ()), base, form, (base, form) in own))
    return out


def _parts(sight: Sight, rows: NDArray[np.bool_], own: Container[tuple[str, AreaForm]]
           ) -> list[tuple[str, AreaForm, NDArray[np.int64]]]:
    """Groups of (n,) bool samples that are worth a zone of a tool in use.

    Every addition to one of its ``own`` zones of a whole region is. Samples under or over a connection, where the tool
    has no other zone in that region, must be worth a zone of their own.
    """
    out = []
    for base, form, members in sight.groups(rows):
        area = sight.samples.area[members]
        least = 0.0 if (base, form) in own else LEAST_PART_MM2
        if float(area.sum()) > 0.0 and float(area.sum()) >= least:
            out.append((base, form, members))
    return out


def _split(sight: Sight, members: NDArray[np.int64], base: str, form: AreaForm) -> list[ZoneArea]:
    left = members
    area, regions, code = sight.samples.area, sight.view.labels.regions, sight.view.labels.code
    least = least_area(area[members], LEAST_ZONE_MM2, CERTAIN)
    tried: list[dict[str, object]] = []
    out: dict[str, _Take] = {}
    order = sight.order(form)
    if float(area[members].sum()) < SMALL_REGION_MM2:
        gets = {t: float(area[members[sight.gets(t)[members]]].sum()) for t in order}
        most = max(gets.values())
        order.sort(key=lambda t: gets[t] < ONE_TOOL_SHARE * most)
    for tid, ruled in [*((t, True) for t in order), *((t, False) for t in order)]:
        if float(area[left].sum()) < least:
            break
        planes = neck_planes(sight, left, tid, base) if ruled else {}
        limit = np.array([planes.get(c, -np.inf) for c in range(len(regions))])[code[left]]
        take = left[sight.gets(tid)[left] & (sight.samples.points[left, 2] >= limit)]
        got = float(area[take].sum())
        if got < least:
            if ruled:
                tried.append(_refusal(sight, left, tid, form, got, least, max(planes.values(), default=-np.inf)))
            continue
        left = left[~np.isin(left, take)]
        if tid in out:
            out[tid].rows, out[tid].planes = np.sort(np.concatenate([out[tid].rows, take])), {}
        else:
            out[tid] = _Take(take, planes, tuple(tried))
        tried.append({"tool": tid, "reason": "cuts another part of this region",
                      "value": round(got, 3), "limit": round(float(area[members].sum()), 3)})
    return [z for tid, t in out.items() for z in _zones_of(sight, tid, t, base, form)]


def _zones_of(sight: Sight, tid: str, take: _Take, base: str, form: AreaForm,
              has_plain: bool = False) -> list[ZoneArea]:
    """One zone where the tool also cuts the plain cells of the region (or has them already), else one for each cell."""
    labels = sight.view.labels
    cells = np.unique(labels.code[take.rows]).tolist()
    plain = has_plain or any(labels.regions[c].name == base for c in cells)
    parts = [(base, cells)] if plain else [(labels.regions[c].name, [c]) for c in cells]
    out = []
    for name, codes in parts:
        rows = take.rows[np.isin(labels.code[take.rows], codes)]
        kind = "SCZI" if base.startswith("C") or not plain else "SCZ"
        planes = {labels.regions[c].name: take.planes[c] for c in codes if c in take.planes}
        merged = tuple(sorted(labels.regions[c].name for c in codes if labels.regions[c].name != name))
        out.append(_zone(sight, tid, rows, kind, name, form, planes, merged, take.tried))
    return out


def _zone(sight: Sight, tid: str, rows: NDArray[np.int64], kind: str, name: str, form: AreaForm,
          planes: dict[str, float], merged: tuple[str, ...], tried: tuple[dict[str, object], ...]) -> ZoneArea:
    z = sight.samples.points[rows, 2]
    return ZoneArea("", sight.view.id, kind, name, form, sight.view.fields[tid].tool, rows,
                    sight.reach[tid].tips[rows], tuple(int(f) for f in np.unique(sight.samples.face[rows])),
                    float(z.max()), float(z.min()), planes, merged, tried)


def _joined(zones: list[ZoneArea], views: Sequence[View]) -> list[ZoneArea]:
    """Zones with one for each view, region, form and tool, since later rounds may add to the first."""
    heights = {v.id: v.samples.points[:, 2] for v in views}
    names = {v.id: v.labels.names for v in views}
    face = views[0].samples.face
    groups: dict[tuple[str, str, AreaForm, str], list[ZoneArea]] = {}
    for z in zones:
        groups.setdefault((z.access, z.region, z.form, z.tool.id), []).append(z)
    out = []
    for (access, *_), same in groups.items():
        first = same[0]
        if len(same) > 1:
            rows = np.concatenate([z.samples for z in same])
            order = np.argsort(rows, kind="stable")
            h = heights[access][rows]
            keeps = not any(z.planes or first.below_plane(names[access][z.samples], heights[access][z.samples]).any()
                            for z in same[1:])
            first = replace(first, samples=rows[order], tips=np.vstack([z.tips for z in same])[order],
                            faces=tuple(int(f) for f in np.unique(face[rows])), top=float(h.max()),
                            bottom=float(h.min()), planes=first.planes if keeps else {},
                            merged=tuple(sorted({m for z in same for m in z.merged})))
        out.append(first)
    return out


def _refusal(sight: Sight, left: NDArray[np.int64], tid: str, form: AreaForm, got: float, min_area: float,
             plane: float) -> dict[str, object]:
    tool, usable, by_cutter = sight.view.fields[tid].tool, sight.can[tid][left], sight.reach[tid].by_cutter[left]
    if not usable.any():
        return {"tool": tid, "reason": f"a sharp-cornered end leaves steps on {form} area", "value": 0.0,
                "limit": 0.0}
    if not (usable & by_cutter).any():
        return {"tool": tid, "reason": "too thick to touch it", "value": tool.diameter, "limit": 0.0}
    if np.isfinite(plane) and got < min_area:
        return {"tool": tid, "reason": "shank or holder meets the surroundings above it",
                "value": round(tool.neck_length, 3), "limit": round(plane, 3)}
    return {"tool": tid, "reason": "adds less area than is worth a zone", "value": round(got, 3),
            "limit": round(min_area, 3)}


def is_open(zone: ZoneArea, field: TipField, area: F64) -> bool:
    """Whether passes can leave the zone: over nearly all of its area the tool can leave the part at its level.

    area : (n,) float64, mm², of all samples of the machinable area

    Passes along steep area stay at one height, so the level is that of each tip. Other passes follow the surface, so
    the level is that of the highest tip. A zone partly enclosed by walls or connections on all sides is closed.
    """
    level = zone.tips[:, 2] if zone.form is AreaForm.STEEP else zone.tips[:, 2].max()
    return open_share(field, zone.tips, level, area[zone.samples]) > OPEN_SHARE
