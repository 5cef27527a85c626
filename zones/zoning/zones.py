"""Which tool cuts which area from where: samples of the machinable area become zones.

1. Every sample has a *region* in each view (``zones.plan_view.regions``: SCZ, or SCZI on, under or over a connection) and a
   *form*: level, steep or shallow.
2. Views are asked in turn. Between two opposite ones the walls are shared out first (``zones.zoning.cutting_planes``).
3. In each region and form tools are tried from the stoutest on. A tool takes the samples its cutting part can touch,
   down to the cutting plane where its shank or holder first meets the surroundings (the neck rule, cell by cell);
   what lies deeper, or where it does not fit, is left to the next tool. What no other tool takes either is then given
   to the stoutest one that stands clear of it, below its cutting plane or not.
4. What is left of many regions is pooled: a tool that has a zone anyway, or gets enough of it all, takes its share.
5. Samples of one region, form, tool and view are one zone. A cell under or over a connection joins the zone of its
   channel or wall where the same tool gets there from the same side; else it is a zone of its own.
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

# What a tool has to gain to be used in a region, whatever the size of that: 1 mm² is 25 planning samples, on which an
# area is known to a fifth; where samples stand wider, 25 of them. It is also what a tool to buy has to gain.
LEAST_ZONE_MM2 = 1.0
CERTAIN = 25
# What a tool that is used anyway has to gain for one more zone: a way there but no change; five samples.
LEAST_PART_MM2 = 0.2
THERE = 5
SMALL_REGION_MM2 = 30.0  # a region this small gets one tool, not a tool change for every corner
ONE_TOOL_SHARE = 0.97


@dataclass(frozen=True, eq=False)
class ZoneArea:
    """A machinable zone: what one tool cuts in one region from one side. Heights and tips in the access frame, mm.

    id      : 'Z3'
    access  : 'A1'
    region  : 'C2' a connection, 'H1' a channel, 'W1' the outside of a wall, 'top', 'floor' or 'free'; 'H1 over C2'
              where the zone is only such a cell, 'H1.2' where the region has several places
    merged  : names of the SCZI cells that were joined to it
    samples : (k,) indices into the samples of the machinable area
    tips    : (k, 3) float64, an admissible tip for each
    planes  : height of the cutting plane by name of the cell, below which the tool must not be asked; left out
              where there is none
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
        """The highest of its cutting planes, -inf where there is none."""
        return max(self.planes.values(), default=-np.inf)

    def below_plane(self, names: NDArray[np.object_], heights: F64) -> NDArray[np.bool_]:
        """(n,) bool: samples of cells ``names`` at ``heights`` that lie deeper than this tool may be asked."""
        limit = np.array([self.planes.get(n, -np.inf) for n in names]) if self.planes else -np.inf
        return np.asarray(heights < limit)


@dataclass(frozen=True)
class Mcz:
    """Main computable zone: what one tool can touch along one axis, mm²; by its cutting part alone, and whole."""

    access: str
    tool: str
    cutter_area: float
    area: float


@dataclass(frozen=True, eq=False)
class Zoning:
    """Zones in machining order, main computable zones, cutting planes, and (n,) bool which samples some zone holds.

    reach : of every view, what each tool reaches
    """

    zones: tuple[ZoneArea, ...]
    mcz: tuple[Mcz, ...]
    planes: tuple[RegionPlane, ...]
    taken: NDArray[np.bool_]
    reach: tuple[Mapping[str, Reach], ...] = field(default=(), repr=False)


def build_zones(views: Sequence[View], decomposition: Decomposition, scallop: float, lift: float,
                categories: Categories | None = None, known: Sequence[Mapping[str, Reach]] = ()) -> Zoning:
    """Give every sample of the machinable area to the stoutest tool that can touch it.

    views         : in the order they are machined; the same samples and tools in each
    decomposition : in the frame of the first view
    scallop       : mm, allowed cusp
    lift          : mm, distance along the normal within which a touch counts
    categories    : profiles of the regions; none are given where None
    known         : per view, what some tools reach, where that was found before

    Returns
    -------
    Zoning
        Zones in machining order: views in turn, tools by size, simple profiles first, then from the top; samples in
        none of them are out of reach.
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
    found.sort(key=lambda z: (place[z.access], -z.tool.diameter, z.tool.stickout, z.tool.id, _stage(z), z.category.rank,
                              -z.top, z.region, z.form))
    zones = tuple(replace(z, id=f"Z{k}") for k, z in enumerate(found, start=1))
    return Zoning(zones, mcz, (*between, *_neck_planes(zones, sights)), taken, tuple(s.reach for s in sights))


def _neck_planes(zones: Sequence[ZoneArea], sights: Sequence[Sight]) -> list[RegionPlane]:
    """The planes the zones end at, highest first in each region."""
    out = set()
    above = {s.view.id: {high + PLANE_MARGIN for bands in s.bands.values() for _, high in bands} for s in sights}
    for z in zones:
        for name, height in z.planes.items():
            moved = height in above[z.access]
            out.add((z.access, name, -height, z.tool.id, "neck, moved above a connection" if moved else "neck"))
    return [RegionPlane(access, -low, name, tool, reason) for access, name, low, tool, reason in sorted(out)]


def _stage(zone: ZoneArea) -> int:
    """Tops and connections before walls, walls before floors: nothing is undercut while it still stands."""
    if zone.form is AreaForm.STEEP:
        return 1
    return 2 if base_of(zone.region) == "floor" else 0


@dataclass
class _Take:
    """What one tool gets of a group, and its cutting planes by cell."""

    rows: NDArray[np.int64]
    planes: dict[int, float]
    tried: tuple[dict[str, object], ...]


def least_area(area: F64, worth: float, samples: int) -> float:
    """What a tool has to gain of some samples, mm²: ``worth``, and no less than so many samples stand for.

    area : (n,) float64, mm², what each stands for; 0 on borders
    """
    inner = area[area > 0]
    return max(worth, samples * float(inner.mean())) if len(inner) else worth


def _gleaned(sights: Sequence[Sight], found: Sequence[ZoneArea], taken: NDArray[np.bool_]) -> list[ZoneArea]:
    """Zones of what was too little region by region; ``taken`` is kept up to date.

    Tools that have a zone in a view come first, for they are in the spindle anyway; then those that gain enough of all
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
    """Groups of (n,) bool samples that are worth a zone to a tool in use.

    Whatever adds to one of its ``own`` zones of a whole region is; what lies under or over a connection, where it has
    no other zone in that region, has to be worth one of its own.
    """
    out = []
    for base, form, members in sight.groups(rows):
        area = sight.samples.area[members]
        least = 0.0 if (base, form) in own else least_area(area, LEAST_PART_MM2, THERE)
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


def _zones_of(sight: Sight, tid: str, take: _Take, base: str, form: AreaForm, has_plain: bool = False) -> list[ZoneArea]:
    """One zone where the tool cuts the plain cells of the region too (or has them already), else one for each cell."""
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
    """Zones of one view, region, form and tool made one: later rounds may add to what the first one took."""
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


def _refusal(sight: Sight, left: NDArray[np.int64], tid: str, form: AreaForm, got: float, least: float,
             plane: float) -> dict[str, object]:
    tool, usable, by_cutter = sight.view.fields[tid].tool, sight.can[tid][left], sight.reach[tid].by_cutter[left]
    if not usable.any():
        return {"tool": tid, "reason": f"a sharp-cornered end leaves steps on {form} area", "value": 0.0,
                "limit": 0.0}
    if not (usable & by_cutter).any():
        return {"tool": tid, "reason": "too thick to touch it", "value": tool.diameter, "limit": 0.0}
    if np.isfinite(plane) and got < least:
        return {"tool": tid, "reason": "shank or holder meets the surroundings above it",
                "value": round(tool.neck_length, 3), "limit": round(plane, 3)}
    return {"tool": tid, "reason": "adds less area than is worth a zone", "value": round(got, 3),
            "limit": round(least, 3)}


def is_open(zone: ZoneArea, field: TipField, area: F64) -> bool:
    """Whether passes can leave the zone: over nearly all its area the tool can go out of the part at its level.

    area : (n,) float64, mm², of all samples of the machinable area

    Passes along steep area stay at one height, so there the level is that of each tip; others follow the surface, so
    it is that of the highest. A zone with walls or connections all round some of it is closed.
    """
    level = zone.tips[:, 2] if zone.form is AreaForm.STEEP else zone.tips[:, 2].max()
    return open_share(field, zone.tips, level, area[zone.samples]) > OPEN_SHARE
