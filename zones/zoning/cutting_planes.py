"""Cutting planes: the depth limit of each tool, and the split between two opposite sides [Arivazhagan2020].

Ln is the depth at which shank or holder of a tool first meets its surroundings (the neck rule). From one side a plane
lies where a tool ends, so that the shortest and stoutest tool that gets there cuts every depth; planes every Ln gain
nothing. From two opposite sides there is no plane where the stoutest tool reaches the whole height from the first.
Otherwise it lies at half height where both reach their half, else at the deepest reach from the first.
This is step 2 of the four-step algorithm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from zones.machinable_area import AreaForm
from zones.plan_view.regions import base_of
from zones.reach.access_reach import Sight

PLANE_MARGIN = 0.02  # mm, cutting plane above the first sample a shank or holder forbids
OPPOSITE = -0.99  # d1·d2 below: two views look at each other
SHARED_SHARE = 0.995  # of an area: a tool that gets this share counts as getting all of it
FITS_SHARE = 0.5  # of an area: least share that the cutting part must touch for the neck to decide


@dataclass(frozen=True)
class RegionPlane:
    """A plane that limits the depth of a tool in a region.

    height : mm along the access direction
    region : name of the cell, or of the region two opposite accesses share
    tool   : id, None between two accesses
    reason : 'neck', 'neck, moved above a connection', or 'between A1 and A2'
    """

    access: str
    height: float
    region: str
    tool: str | None
    reason: str


def snapped(plane: float, bands: Sequence[tuple[float, float]]) -> float:
    """A cutting plane moved to just above the connections that it cuts through, mm [Arivazhagan2020].

    So the area above it keeps one approach, and one tool cuts the flanks of a connection.
    """
    for low, high in sorted(bands):
        if low < plane < high + PLANE_MARGIN:
            plane = high + PLANE_MARGIN
    return plane


def neck_planes(sight: Sight, left: NDArray[np.int64], tid: str, base: str) -> dict[int, float]:
    """Cutting plane of a tool by cell, mm, access frame: the neck rule of [Arivazhagan2020], snapped to connections.

    left : (k,) int64, index of the samples that no tool has taken yet
    """
    r, code = sight.reach[tid], sight.view.labels.code
    stopped = left[sight.can[tid][left] & r.by_cutter[left] & ~r.by_tool[left]]
    out: dict[int, float] = {}
    for cell in np.unique(code[stopped]).tolist():
        plane = float(sight.samples.points[stopped[code[stopped] == cell], 2].max()) + PLANE_MARGIN
        own = sight.view.labels.regions[cell]
        out[cell] = snapped(plane, sight.bands.get(base_of(base), ())) if own.kind == "SCZ" else plane
    return out


def shares(sights: Sequence[Sight]) -> tuple[list[NDArray[np.bool_]], list[RegionPlane]]:
    """Samples that each view takes first, (n,) bool for each, and the planes between two views [Arivazhagan2020].

    A view takes all samples, but of walls in reach of two opposite views only its own side.

    There is no plane where the stoutest tool of the earlier view reaches the whole height. Otherwise the plane is at
    half height where both reach their half with the stoutest tool, else at the deepest reach of the earlier view.
    """
    allowed = [np.ones(len(s.samples), np.bool_) for s in sights]
    planes: list[RegionPlane] = []
    for i, a in enumerate(sights):
        for j in range(i + 1, len(sights)):
            b = sights[j]
            if float(a.view.direction @ b.view.direction) > OPPOSITE:
                continue
            for base, form, members in a.groups(np.asarray(a.form == AreaForm.STEEP)):
                through, plane = common_plane(a, b, members, form)
                if not np.isfinite(plane):
                    continue
                planes.append(RegionPlane(a.view.id, plane, base, None, f"between {a.view.id} and {b.view.id}"))
                z = a.samples.points[through, 2]
                allowed[i][through[z < plane]] = False
                allowed[j][through[z >= plane]] = False
    return allowed, planes


def common_plane(a: Sight, b: Sight, members: NDArray[np.int64], form: AreaForm) -> tuple[NDArray[np.int64], float]:
    """Samples that two opposite views share, and the height of the plane between them, mm, in the frame of ``a``.

    members : (k,) int64, index of samples of one region and form
    Returns (m,) int64, index of the samples, and the height, mm.

    The stoutest tool decides whose cutting part touches most of the samples that any tool touches from both sides. The
    height is -inf where ``a`` needs no plane.
    """
    area = a.samples.area

    def by_both(t: str) -> NDArray[np.int64]:
        return members[(a.can[t] & a.reach[t].by_cutter & b.can[t] & b.reach[t].by_cutter)[members]]

    shared = {t: by_both(t) for t in a.order(form)}
    most = max((float(area[rows].sum()) for rows in shared.values()), default=0.0)
    if most <= 0.0:
        return members[:0], -np.inf
    tool = next(t for t, rows in shared.items() if area[rows].sum() >= FITS_SHARE * most)
    rows = np.unique(np.concatenate(list(shared.values())))
    z, by_a, by_b = a.samples.points[shared[tool], 2], *(s.reach[tool].by_tool[shared[tool]] for s in (a, b))

    def whole(got: NDArray[np.bool_], where: NDArray[np.bool_]) -> bool:
        mine = area[shared[tool]]
        return bool(mine[where & ~got].sum() <= (1.0 - SHARED_SHARE) * mine[where].sum())

    if whole(by_a, np.ones(len(z), np.bool_)):
        return rows, -np.inf
    half = 0.5 * float(z.min() + z.max())
    if whole(by_a, z >= half) and whole(by_b, z < half):
        return rows, half
    return rows, float(z[~by_a].max()) + PLANE_MARGIN
