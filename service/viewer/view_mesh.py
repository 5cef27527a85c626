"""The part for a page: facets with their zone or entry of the remainder, and the measured deviation.

Faces with samples of the proof are divided to about ``PITCH`` and cut where the label of the nearest sample of the same
face changes. A corner carries the worst deviation of the samples that are nearest to it. Other faces keep the facets of
the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32
from geometry.mesh_queries.keyed_nearest import KeyedPoints
from geometry.part import EdgeKind, Part
from geometry.sampling import SurfaceSamples
from geometry.trimming.facet_sheet import FacetSheet, refined, sheet_of, sides_of
from geometry.trimming.label_query import LabelQuery, bisect
from service.viewer.view_file import Chunk, Column

PITCH, MAX_FACETS = 0.4, 120_000  # mm between nodes, wider where they would make more facets than that
NEAR = 0.1  # mm, how near a border is to the change of label
GRID, UNIT = 0.001, 127  # mm of places; length of normals
LEFT_UNIT, MAX_LEFT_UNITS = 0.0002, 32_000  # mm, unit of deviations, and its largest number
NOBODY = -1  # label of faces without samples
UNJUDGED, JUDGED, UNCUT = 0, 1, 2  # of a corner
MAX_FACETS_ONE_LEVEL = 24_000  # up to here there is no rough level
CELLS = 90  # of the rough level, along the diagonal of the part
I64 = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Judged:
    """The figures of the proof at its samples, setup frame.

    samples : SurfaceSamples, n of them
    label   : (n,) int64, index: zone or entry of the remainder, from 0
    excess  : (n,) float64, mm over the allowance, negative where cut too deep
    reached : (n,) bool, whether a feed move removed stock there
    scallop, gouge : mm, allowed
    """

    samples: SurfaceSamples
    label: I64
    excess: F64
    reached: NDArray[np.bool_]
    scallop: float
    gouge: float

    @property
    def badness(self) -> F64:
        """Excess over the allowed value, (n,) float64, dimensionless."""
        low, high = max(self.gouge, 1e-9), max(self.scallop, 1e-9)
        return np.asarray(np.where(self.excess > 0.0, self.excess / high, -self.excess / low))


@dataclass(frozen=True, eq=False)
class Facets:
    """Facets with one label each.

    place   : (n, 3) float64, mm, setup frame, corners
    normal  : (n, 3) float64, dimensionless, setup frame, unit, at the corners
    face    : (n,) int32, index: face number of each corner
    left    : (n,) float64, mm, worst deviation near a corner
    judged  : (n,) int64, index: UNJUDGED, JUDGED or UNCUT
    corners : (t, 3) int64, index: corners of each facet
    label   : (t,) int64, index: label of each facet
    """

    place: F64
    normal: F64
    face: I32
    left: F64
    judged: I64
    corners: I64
    label: I64


def facets_of(part: Part, judged: Judged) -> Facets:
    """The facets of a part, setup frame, with labels and deviations from samples."""
    s = judged.samples
    faces = [int(f) for f in np.unique(s.face)]
    others = [f.number for f in part.faces if f.number not in set(faces)]
    sheets, near = [], s.by_face
    if faces:
        def label(points: F64, _normals: F64, face: I32) -> I64:
            row = near.nearest(face.astype(np.int64), points)[:, 0]
            return np.where(row >= 0, judged.label[row], NOBODY)

        area = float(part.mesh.areas[np.isin(part.mesh.face_ids, faces)].sum())
        pitch = max(PITCH, float(np.sqrt(2.0 * area / MAX_FACETS)))
        sheets.append(_cut(refined(sheet_of(part, faces), pitch), LabelQuery(label)))
    if others:
        bare = sheet_of(part, others)
        bare.label = np.full(len(bare.corners), NOBODY, np.int64)
        sheets.append(bare)
    first = np.cumsum([0, *(len(x.nodes) for x in sheets)])
    nodes, face = np.concatenate([x.nodes for x in sheets]), np.concatenate([x.face for x in sheets])
    corners = np.concatenate([x.corners + n for x, n in zip(sheets, first[:-1], strict=True)])
    normal = nodes[:, 5:] / np.maximum(np.linalg.norm(nodes[:, 5:], axis=1), 1e-12)[:, None]
    left, known = _measured(nodes[:, :3], face, judged, near)
    return Facets(np.ascontiguousarray(nodes[:, :3]), normal, face, left, known, corners,
                  np.concatenate([x.label for x in sheets]))


def _cut(sheet: FacetSheet, ask: LabelQuery) -> FacetSheet:
    """Cut the facets of a sheet along straight lines where the label of their corners changes."""
    at = ask(sheet.nodes, sheet.face)
    mixed = (at[sheet.corners] != at[sheet.corners[:, :1]]).any(axis=1)
    whole, c = sheet.corners[~mixed], sheet.corners[mixed]
    low, high, sides = sides_of(c)
    crossed = np.flatnonzero(at[low] != at[high])
    a, b = low[crossed], high[crossed]
    share, _, _ = bisect(ask, sheet.nodes[a], sheet.nodes[b], sheet.face[a], at[a], at[b], NEAR, False)
    node = np.full(len(low), -1, np.int64)
    node[crossed] = sheet.add(sheet.nodes[a] + share[:, None] * (sheet.nodes[b] - sheet.nodes[a]), sheet.face[a])
    m = node[sides]
    corners, labels = [whole], [at[whole[:, 0]]]
    two = (m < 0).any(axis=1)
    turn = (np.argmax(m[two] < 0, axis=1)[:, None] + 2 + np.arange(3)) % 3  # the lone corner first
    k, x = np.take_along_axis(c[two], turn, 1), np.take_along_axis(m[two], turn, 1)
    for rows, owner in ((np.stack([k[:, 0], x[:, 0], x[:, 2]], 1), k[:, 0]),
                        (np.stack([x[:, 0], k[:, 1], k[:, 2]], 1), k[:, 1]),
                        (np.stack([x[:, 0], k[:, 2], x[:, 2]], 1), k[:, 1])):
        corners.append(rows)
        labels.append(at[owner])
    k, x = c[~two], m[~two]
    middle = sheet.add(sheet.nodes[k].mean(axis=1), sheet.face[k[:, 0]])
    for j in range(3):
        corners += [np.stack([x[:, j - 1], k[:, j], middle], 1), np.stack([k[:, j], x[:, j], middle], 1)]
        labels += [at[k[:, j]], at[k[:, j]]]
    sheet.corners, sheet.label = np.concatenate(corners), np.concatenate(labels)
    return sheet


def _measured(place: F64, face: I32, judged: Judged, near: KeyedPoints) -> tuple[F64, I64]:
    """Worst deviation at each place, (n,) float64, mm, and its kind, (n,) int64, index.

    It covers the samples whose nearest place of the same face this is; without any, the nearest sample counts.
    """
    s = judged.samples
    left, known = np.zeros(len(place)), np.full(len(place), UNJUDGED, np.int64)
    if not len(s):
        return left, known
    owner = KeyedPoints(face.astype(np.int64), place).nearest(s.face.astype(np.int64), s.points)[:, 0]
    order = np.lexsort((judged.badness, owner))
    order = order[owner[order] >= 0]
    last = np.append(owner[order][1:] != owner[order][:-1], True)
    best = np.full(len(place), -1, np.int64)
    best[owner[order[last]]] = order[last]
    lone = np.flatnonzero((best < 0) & np.isin(face, np.unique(s.face)))
    best[lone] = near.nearest(face[lone].astype(np.int64), place[lone])[:, 0]
    rows = np.flatnonzero(best >= 0)
    left[rows] = judged.excess[best[rows]]
    uncut = ~judged.reached[best[rows]] & (left[rows] > judged.scallop + 1e-6)
    known[rows] = np.where(uncut, UNCUT, JUDGED)
    return left, known


def mesh_chunks(f: Facets, low: F64) -> tuple[list[Chunk], list[Chunk]]:
    """The facets as chunks, one for each label: a rough level to show first, and the fine level that replaces it.

    low : (3,) float64, mm, setup frame, zero of the grid
    """
    if len(f.corners) <= MAX_FACETS_ONE_LEVEL:
        return _by_label(f, low, 0), []
    return _by_label(clustered(f), low, 0), _by_label(f, low, 1)


def clustered(f: Facets) -> Facets:
    """The facets with all corners of a face in one grid cell merged; facets that lose a corner are left out."""
    cell = max(float(np.linalg.norm(np.ptp(f.place, axis=0))) / CELLS, 1e-9)
    x, y, z = (np.floor((f.place - f.place.min(axis=0)) / cell).astype(np.int64)).T
    # no coordinate has more than CELLS + 1 of them; one number is sorted several times faster than a row
    key = ((x * (CELLS + 1) + y) * (CELLS + 1) + z) * (int(f.face.max()) + 1) + f.face
    _, first, group = np.unique(key, return_index=True, return_inverse=True)
    group = group.reshape(-1)
    count = np.bincount(group).astype(np.float64)[:, None]
    mean = [np.stack([np.bincount(group, weights=v[:, k]) for k in range(3)], axis=1) / count
            for v in (f.place, f.normal)]
    normal = mean[1] / np.maximum(np.linalg.norm(mean[1], axis=1), 1e-12)[:, None]
    corners = group[f.corners]
    keep = ((corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0]))
    return Facets(mean[0], normal, f.face[first], f.left[first], f.judged[first], corners[keep], f.label[keep])


def _by_label(f: Facets, low: F64, lod: int) -> list[Chunk]:
    out = []
    for label in np.unique(f.label).tolist():
        corners = f.corners[f.label == label]
        is_used = np.zeros(len(f.place), np.bool_)
        is_used[corners] = True
        used, row = np.flatnonzero(is_used), np.cumsum(is_used) - 1
        left = np.clip(np.rint(f.left[used] / LEFT_UNIT), -MAX_LEFT_UNITS, MAX_LEFT_UNITS)
        out.append(Chunk("mesh", {"label": int(label), "lod": lod}, {
            "place": Column(np.rint((f.place[used] - low) / GRID), 4, "steps"),
            "normal": Column(np.rint(f.normal[used] * UNIT), 1, "signed"),
            "face": Column(f.face[used], 4, "steps"), "left": Column(left, 2, "signed"),
            "judged": Column(f.judged[used], 1),
            "corners": Column(row[corners], 4, "steps")}))
    return out


def edge_chunk(part: Part, low: F64, spacing: float) -> Chunk:
    """Sharp edges of the part as polylines; column ``begins`` holds the first point of each.

    low     : (3,) float64, mm, setup frame, zero of the grid
    spacing : mm between points
    """
    lines = []
    for e in part.edges:
        if e.kind is not EdgeKind.SMOOTH and len(e.points) > 1:
            way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(e.points, axis=0), axis=1))])
            rows = np.unique(np.searchsorted(way, np.arange(0.0, way[-1], spacing)))
            lines.append(e.points[np.unique([*rows, len(way) - 1])])
    points: F64 = np.concatenate(lines) if lines else np.zeros((0, 3))
    begins = np.cumsum([0, *(len(x) for x in lines)])
    return Chunk("edges", {"lod": 0}, {"place": Column(np.rint((points - low) / GRID), 4, "steps"),
                                       "begins": Column(begins, 4, "steps")})


def top_of(part: Part, faces: Sequence[int]) -> list[float] | None:
    """A place at the upper end of faces for their label, (3,) mm, setup frame; None where they have no facets."""
    points = part.mesh.triangles[np.isin(part.mesh.face_ids, list(faces))].reshape(-1, 3)
    if not len(points):
        return None
    rim = points[points[:, 2] >= points[:, 2].max() - 0.02 * max(float(np.ptp(points[:, 2])), 1e-9)]
    near = rim[np.argmin(np.linalg.norm(rim - 0.5 * (rim.min(axis=0) + rim.max(axis=0)), axis=1))]
    return [round(v, 3) + 0.0 for v in near.tolist()]


__all__ = ["Facets", "Judged", "clustered", "edge_chunk", "facets_of", "mesh_chunks", "top_of"]
