"""Cutting planes: how deep a tool may be asked, and who cuts what between two opposite sides.

Ln is the depth at which shank or holder of a tool first meets its surroundings (the neck rule). From one side a
plane stands where a tool ends, so that every depth is cut by the shortest and stoutest tool that gets there; planes
every Ln would gain nothing. From two opposite sides there is none where the stoutest tool gets the whole height from
the first; else one at half height where both get their half; else one at the deepest reach from the first.
Source: ALGORITHMS 1, step 2 of the 4-step algorithm.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from zones.machinable import Form
from zones.sight import Sight

PLANE_MARGIN = 0.02  # mm, cutting plane above the first sample a shank or holder forbids
OPPOSITE = -0.99  # d1·d2 below: two views look at each other
SHARED_SHARE = 0.995  # of an area a tool must get to be said to get all of it


def snapped(plane: float, bands: Sequence[tuple[float, float]]) -> float:
    """A cutting plane moved to just above the connections it would cut through, mm.

    So what lies above it keeps one approach, and the flanks of a connection are cut by one tool.
    """
    for low, high in sorted(bands):
        if low < plane < high + PLANE_MARGIN:
            plane = high + PLANE_MARGIN
    return plane


def neck_planes(sight: Sight, left: NDArray[np.int64], tid: str, base: str) -> dict[int, float]:
    """Cutting plane of a tool by cell: the neck rule, snapped to connections of the channel."""
    r, code = sight.reach[tid], sight.view.labels.code
    stopped = left[sight.can[tid][left] & r.by_cutter[left] & ~r.by_tool[left]]
    out: dict[int, float] = {}
    for cell in np.unique(code[stopped]).tolist():
        plane = float(sight.samples.points[stopped[code[stopped] == cell], 2].max()) + PLANE_MARGIN
        own = sight.view.labels.regions[cell]
        out[cell] = snapped(plane, sight.bands.get(base, ())) if own.kind == "SCZ" else plane
    return out


def shares(sights: Sequence[Sight]) -> list[NDArray[np.bool_]]:
    """What each view is asked for first: all, but of walls in reach of two opposite views only its own side.

    No plane where the stoutest tool of the earlier view gets the whole height. Else the plane is at half height
    where both get their half with the stoutest tool; else at the deepest reach of the earlier one.
    Source: ALGORITHMS 1, step 2 of the 4-step algorithm.
    """
    allowed = [np.ones(len(s.samples), np.bool_) for s in sights]
    for i, a in enumerate(sights):
        for j in range(i + 1, len(sights)):
            b = sights[j]
            if float(a.view.direction @ b.view.direction) > OPPOSITE:
                continue
            both = np.any([a.gets(t) for t in a.reach], axis=0) & np.any([b.gets(t) for t in b.reach], axis=0)
            for _, form, members in a.groups(both & (a.form == Form.STEEP)):
                z, plane = a.samples.points[members, 2], common_plane(a, b, members, form)
                allowed[i][members[z < plane]] = False
                allowed[j][members[z >= plane]] = False
    return allowed


def common_plane(a: Sight, b: Sight, members: NDArray[np.int64], form: Form) -> float:
    """Height in the frame of ``a`` of the plane between two opposite views; -inf where ``a`` needs none."""
    z, area = a.samples.points[members, 2], a.samples.area[members]
    mine, other = a.gets(a.order(form)[0])[members], b.gets(b.order(form)[0])[members]

    def whole(got: NDArray[np.bool_], rows: NDArray[np.bool_]) -> bool:
        return bool(area[rows & got].sum() >= SHARED_SHARE * area[rows].sum())

    if whole(mine, np.ones(len(z), np.bool_)):
        return -np.inf
    half = 0.5 * float(z.min() + z.max())
    if whole(mine, z >= half) and whole(other, z < half):
        return half
    missed = z[~mine]
    return float(missed.max()) + PLANE_MARGIN if len(missed) else -np.inf
