"""Points spread evenly over a mesh, each with the area it represents."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from geometry.kernels.sampling import COSINE, SINE, graded_places, lattice_places, mark_near
from geometry.mesh import F64, I32, TriangleMesh
from geometry.mesh_queries.keyed_nearest import KeyedPoints

# Least cosine between the normals of facet and surface. Below it the facet is a sliver or folded, or the surface is
# singular.
BELIEVED_DOT = 0.5
PLANE = 1e-12  # components of normals that differ by no more are those of one plane
# Middles of the sides of triangles nearer than this are one, mm: such a side lies inside a face.
SAME_SIDE = 1e-5


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Samples of a surface, in the frame of the mesh.

    points   : (n, 3) float64, mm
    normals  : (n, 3) float64, unit, out of the material
    area     : (n,) float64, mm², area that each sample represents; sums to the sampled area
    face     : (n,) int32, number of the B-rep face
    triangle : (n,) int32, index of the triangle
    covers   : (n,) float64, mm, or None: radius of the flat place round a sample that the sample stands for, 0 where it
               stands for its point alone; None: 0 for all
    """

    points: F64
    normals: F64
    area: F64
    face: I32
    triangle: I32
    covers: F64 | None = None

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def by_face(self) -> KeyedPoints:
        """The points with their faces as keys."""
        return KeyedPoints(self.face.astype(np.int64), self.points)

    def subset(self, keep: np.ndarray) -> SurfaceSamples:
        """The selected samples. keep : (n,) bool mask, or (k,) int64 index of the samples."""
        return SurfaceSamples(self.points[keep], self.normals[keep], self.area[keep], self.face[keep],
                              self.triangle[keep], None if self.covers is None else self.covers[keep])


def sample_surface(mesh: TriangleMesh, density: float, *, seed: int = 0,
                   triangles: np.ndarray | None = None) -> SurfaceSamples:
    """Spread samples over the triangles of a mesh by stratified cumulative area.

    mesh      : TriangleMesh
    density   : float, samples per mm²
    seed      : int, two different seeds never share a sample
    triangles : (k,) int64, index of the triangles to sample, all when None

    Returns
    -------
    SurfaceSamples
        Triangles come in the given order. The running area is cut into equal strata with one jittered sample each, so a
        triangle of area a gets a*density samples within one.
    """
    chosen = np.arange(len(mesh.faces)) if triangles is None else np.asarray(triangles)
    areas = mesh.areas[chosen]
    total = float(areas.sum())
    n = max(1, round(total * density)) if total > 0 else 0
    rng = np.random.default_rng(seed)
    ends = np.cumsum(areas)
    marks = (np.arange(n) + rng.random(n)) * (total / max(n, 1))
    pick = np.minimum(np.searchsorted(ends, marks, side="right"), max(len(chosen) - 1, 0))
    tri = chosen[pick].astype(np.int32)
    r1, r2 = np.sqrt(rng.random(n)), rng.random(n)
    t = mesh.triangles[tri]
    pts = (1 - r1)[:, None] * t[:, 0] + (r1 * (1 - r2))[:, None] * t[:, 1] + (r1 * r2)[:, None] * t[:, 2]
    return SurfaceSamples(np.ascontiguousarray(pts), np.ascontiguousarray(mesh.normals[tri]),
                          np.full(n, total / max(n, 1)), mesh.face_ids[tri], tri)


def lattice_samples(mesh: TriangleMesh, spacing: float) -> SurfaceSamples:
    """Samples on one square lattice, seen along the axis that each triangle faces most.

    mesh    : TriangleMesh
    spacing : mm between the lines of the lattice

    Returns
    -------
    SurfaceSamples
        Each represents the area of its cell on the slope of its triangle. A triangle that faces two axes nearly equally
        has both lattices. On a flat surface no place is farther than 0.87 of the spacing from a sample, edges apart:
        cells are one spacing wide in one direction and at most sqrt(3) spacings in the other.
    """
    triangles, normals = np.ascontiguousarray(mesh.triangles), np.ascontiguousarray(mesh.normals)
    room = round(1.2 * float(mesh.areas.sum()) / spacing**2) + 64
    while True:
        points, area, tri = np.empty((room, 3)), np.empty(room), np.empty(room, np.int32)
        count = lattice_places(triangles, normals, spacing, points, area, tri)
        if count <= room:
            break
        room = count
    points, tri = points[:count].copy(), tri[:count].copy()
    return SurfaceSamples(points, np.ascontiguousarray(normals[tri]), area[:count].copy(), mesh.face_ids[tri], tri)


def graded_samples(mesh: TriangleMesh, triangles: np.ndarray, spacing: float, parts: int,
                   margin: float) -> SurfaceSamples:
    """Samples of a flat face on a square lattice: coarse inside, fine near its borders.

    mesh      : TriangleMesh
    triangles : (k,) int64, index of the triangles of the face, all in one plane
    spacing   : mm, side of a coarse cell
    parts     : number of fine samples along the side of a split cell, odd
    margin    : mm; a cell as near to a border as that is split, and so is every cell that meets one

    Returns
    -------
    SurfaceSamples
        A coarse sample is the middle of a cell that lies wholly in the face, and is farther from the borders of the
        face than half a cell and ``margin``; ``covers`` is half the diagonal of the cell. Fine
        samples have equal areas that fill the rest of the face. No place of the face, borders apart, is farther than
        0.71 spacing from a coarse sample or 0.71 spacing / parts from a fine one.
    """
    first, second = lattice_axes(mesh.normals[triangles[:1]])
    origin = mesh.triangles[triangles[0], 0]
    flat = np.ascontiguousarray((mesh.triangles[triangles] - origin) @ np.stack([first[0], second[0]], axis=1))
    low = np.floor(flat.min(axis=(0, 1)) / spacing).astype(np.int64) - 1
    size = np.floor(flat.max(axis=(0, 1)) / spacing).astype(np.int64) + 2 - low
    near = np.zeros((int(size[0]), int(size[1])), np.bool_)
    # a border runs no farther than half their distance from one of its places
    mark_near(_border_places(flat, spacing / 8.0), spacing, margin + spacing / 16.0, int(low[0]), int(low[1]), near)
    total = float(mesh.areas[triangles].sum())
    room = round(1.2 * (total / spacing**2 + float(near.sum()) * parts**2)) + 64
    while True:
        out, coarse, owner = np.empty((room, 2)), np.empty(room, np.bool_), np.empty(room, np.int32)
        count = graded_places(flat, spacing, parts, int(low[0]), int(low[1]), near, out, coarse, owner)
        if count <= room:
            break
        room = count
    out, coarse, tri = out[:count], coarse[:count], np.asarray(triangles[owner[:count]], np.int32)
    points = origin + out[:, :1] * first[0] + out[:, 1:] * second[0]
    fine = int((~coarse).sum())
    rest = (total - float(coarse.sum()) * spacing**2) / max(fine, 1)
    return SurfaceSamples(np.ascontiguousarray(points), np.ascontiguousarray(mesh.normals[tri]),
                          np.where(coarse, spacing**2, rest), mesh.face_ids[tri], tri,
                          np.where(coarse, spacing * np.sqrt(0.5), 0.0))


def split_cells(samples: SurfaceSamples, parts: int) -> tuple[SurfaceSamples, np.ndarray]:
    """The fine samples of coarse cells.

    samples : SurfaceSamples of ``graded_samples``, coarse ones only
    parts   : number of fine samples along the side of a cell

    Returns SurfaceSamples of equal areas, and (m,) int64, index of the coarse sample of each.
    """
    covers = np.zeros(0) if samples.covers is None else samples.covers
    first, second = lattice_axes(samples.normals)
    side = np.sqrt(2.0) * covers
    across = (np.arange(parts) + 0.5) / parts - 0.5
    a, b = (x.reshape(-1) for x in np.meshgrid(across, across, indexing="ij"))
    row = np.repeat(np.arange(len(samples)), parts**2)
    a, b = np.tile(a, len(samples)) * side[row], np.tile(b, len(samples)) * side[row]
    out = samples.subset(row)
    points = out.points + a[:, None] * first[row] + b[:, None] * second[row]
    return replace(out, points=np.ascontiguousarray(points), area=out.area / parts**2, covers=np.zeros(len(row))), row


def lattice_axes(normals: F64) -> tuple[F64, F64]:
    """The two axes of the lattice of ``graded_samples`` on planes.

    normals : (n, 3) float64, dimensionless unit vectors, in the frame of the planes

    Returns two (n, 3) float64 arrays, dimensionless unit vectors, in the same frame.

    The lattice is turned by the angle whose tangent is the golden section against the axes of the frame, since what is
    long and narrow on a part mostly lies along these.
    """
    one = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    one = one - np.einsum("ij,ij->i", one, normals)[:, None] * normals
    one /= np.linalg.norm(one, axis=1)[:, None]
    other = np.cross(normals, one)
    return COSINE * one + SINE * other, COSINE * other - SINE * one


def _border_places(flat: F64, apart: float) -> F64:
    """Places (n, 2) along the sides of triangles (m, 3, 2) that belong to one triangle only, ``apart`` mm apart."""
    ends = np.stack([flat, np.roll(flat, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    _, group, count = np.unique(np.round(ends.mean(axis=1) / SAME_SIDE).astype(np.int64), axis=0, return_inverse=True,
                                return_counts=True)
    ends = ends[count[group.reshape(-1)] == 1]
    steps = np.maximum(1, np.ceil(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / apart)).astype(np.int64) + 1
    row = np.repeat(np.arange(len(ends)), steps)
    share = (np.arange(len(row)) - np.repeat(np.cumsum(steps) - steps, steps)) / (steps[row] - 1)
    return np.ascontiguousarray(ends[row, 0] + share[:, None] * (ends[row, 1] - ends[row, 0]))


def sample_borders(mesh: TriangleMesh, spacing: float, inset: float, triangles: np.ndarray) -> SurfaceSamples:
    """Samples on or just inside the borders between faces; they represent no area.

    mesh      : TriangleMesh
    spacing   : mm along a border
    inset     : mm, how far inside the triangle a sample lies at most
    triangles : (k,) int64, index of the triangles to search

    Returns
    -------
    SurfaceSamples
        Along every edge of the chosen triangles whose other triangle belongs to another face.
    """
    f = mesh.faces
    ends = np.sort(np.stack([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]], axis=1).reshape(-1, 2), axis=1)
    key = ends[:, 0].astype(np.int64) * len(mesh.vertices) + ends[:, 1]
    _, group = np.unique(key, return_inverse=True)
    face = np.repeat(mesh.face_ids, 3).astype(np.int64)
    least = np.full(group.max() + 1, np.iinfo(np.int64).max)
    most = np.full(group.max() + 1, np.iinfo(np.int64).min)
    np.minimum.at(least, group, face)
    np.maximum.at(most, group, face)
    border = (least != most)[group].reshape(-1, 3)
    chosen = np.zeros(len(f), np.bool_)
    chosen[triangles] = True
    tri, side = np.nonzero(border & chosen[:, None])
    a, b = mesh.vertices[f[tri, side]], mesh.vertices[f[tri, (side + 1) % 3]]
    apex = mesh.vertices[f[tri, (side + 2) % 3]]
    count = np.maximum(1, np.ceil(np.linalg.norm(b - a, axis=1) / spacing)).astype(np.int64)
    row = np.repeat(np.arange(len(tri)), count)
    place = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    t = ((place + 0.5) / count[row])[:, None]
    on = a[row] + t * (b[row] - a[row])
    inward = apex[row] - on
    length = np.linalg.norm(inward, axis=1, keepdims=True)
    points = on + inward * np.minimum(inset / np.maximum(length, 1e-12), 0.3)
    return SurfaceSamples(np.ascontiguousarray(points), np.ascontiguousarray(mesh.normals[tri[row]]),
                          np.zeros(len(row)), mesh.face_ids[tri[row]], tri[row].astype(np.int32))


def with_surface_normals(samples: SurfaceSamples, mesh: TriangleMesh) -> SurfaceSamples:
    """The same samples with the normals of the exact surface instead of those of their facets.

    samples : SurfaceSamples of ``mesh``; their places stay on the facets, which tools are checked against
    mesh    : TriangleMesh; without corner normals the samples come back unchanged

    Returns
    -------
    SurfaceSamples
        The normals at the three corners, weighted by the barycentric coordinates of the sample. Error: second order in
        the size of the facet, and third order on arcs; a facet's own normal is off by half the turn across it. The
        facet's normal stays where a corner has none, or where the two differ by more than 60 degrees.
    """
    if mesh.corner_normals is None or not len(samples):
        return samples
    plane = np.asarray((np.abs(mesh.corner_normals - mesh.normals[:, None]) <= PLANE).all(axis=(1, 2)))
    rows = np.flatnonzero(~plane[samples.triangle])
    triangle = samples.triangle[rows]
    t = mesh.triangles[triangle]
    share = _barycentric(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0], samples.points[rows] - t[:, 0])
    normals = np.einsum("ij,ijk->ik", share, mesh.corner_normals[triangle])
    length = np.linalg.norm(normals, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        normals /= length[:, None]
        good = np.einsum("ij,ij->i", normals, samples.normals[rows]) > BELIEVED_DOT
    out = samples.normals.copy()
    out[rows[good]] = normals[good]
    return replace(samples, normals=out)


def _barycentric(u: F64, v: F64, w: F64) -> F64:
    """Shares (n, 3) of the corners a, a + u, a + v of triangles in the points a + w, not below 0; all (n, 3)."""
    uu, uv, vv = (np.einsum("ij,ij->i", p, q) for p, q in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("ij,ij->i", w, u), np.einsum("ij,ij->i", w, v)
    det = np.maximum(uu * vv - uv * uv, 1e-300)
    second = np.clip((wu * vv - wv * uv) / det, 0.0, 1.0)
    third = np.clip((wv * uu - wu * uv) / det, 0.0, 1.0 - second)
    return np.stack([1.0 - second - third, second, third], axis=1)


def joined(parts: list[SurfaceSamples]) -> SurfaceSamples:
    """Several sets of samples as one, in order; of none, no samples."""
    if not parts:
        none = np.zeros(0, np.int32)
        return SurfaceSamples(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), none, none)
    covers = None
    if any(p.covers is not None for p in parts):
        covers = np.concatenate([np.zeros(len(p)) if p.covers is None else p.covers for p in parts])
    return SurfaceSamples(np.concatenate([p.points for p in parts]), np.concatenate([p.normals for p in parts]),
                          np.concatenate([p.area for p in parts]), np.concatenate([p.face for p in parts]),
                          np.concatenate([p.triangle for p in parts]), covers)
