"""Points of the part that are checked in addition to the scored samples, and true depths of gouges.

Points are float64, mm, in the setup frame.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.mesh_queries.rays import first_hits
from geometry.sampling import SurfaceSamples, lattice_samples
from verify.kernels.surface.depth import deepest
from verify.progress import Report, silent

GUARD_SPACING = 0.18
MAX_GUARD_SAMPLES = 1_000_000
EDGE_SPACING = 0.1
INSET = 1e-3  # mm, of the ends of edges
SHARP = math.radians(20.0)
DEPTH_BATCH = 2048  # rays between two reports
CLOSER_REACH, CLOSER_STEP = 0.15, 0.02
MAX_SEEDS, MAX_DEEP, DEEP_A_MOVE = 4500, 1500, 4
SURE = 5.0  # gouge tolerances: deeper gouges are found without closer points
CLOSER_SHARE = 0.4  # of the gouge tolerance: samples cut deeper get closer points round them
ASIDE = np.array([0.3571, 0.2833, 0.8901]) / np.linalg.norm([0.3571, 0.2833, 0.8901])  # no edge or face lies along it
FACETS_OFF = 2e-3
"""mm, largest distance of facets below samples on the exact surface."""


def guard_spacing(mesh: TriangleMesh) -> float:
    """Distance between lattice lines of ``guard_samples``, mm: 0.18, wider on parts that need over a million samples.

    A ball of radius R that gouges deeper than (0.87 spacing)² / 2R + 0.4 of the tolerance cuts one of them.
    """
    return max(GUARD_SPACING, (float(mesh.areas.sum()) / MAX_GUARD_SAMPLES) ** 0.5)


def guard_samples(mesh: TriangleMesh) -> SurfaceSamples:
    """Even samples of the whole part: no place of a flat is farther than 0.87 ``guard_spacing`` from one."""
    return lattice_samples(mesh, guard_spacing(mesh))


def guard_notes(mesh: TriangleMesh, left_out: int = 0) -> list[str]:
    """Notes that the part is too large for the usual sample distance, or that seeds were left out."""
    out, spacing = [], guard_spacing(mesh)
    if spacing > GUARD_SPACING:
        out.append(f"the part is large: the samples for gouges outside zones are {spacing:.2f} mm apart, not "
                   f"{GUARD_SPACING} mm")
    if left_out:
        out.append(f"the gouges are so many that {left_out} places were not checked closely; gouges there may be a "
                   "little deeper than reported")
    return out


def convex_edges(mesh: TriangleMesh, spacing: float = EDGE_SPACING) -> tuple[F64, F64, I32]:
    """Points along the sharp convex edges of a mesh, and its tips, for gouges between surface samples.

    spacing : mm between points

    Returns points, (n, 3) float64, mm, frame of the mesh; bisectors of the two normals, (n, 3) float64, unit; and face
    numbers, (n,) int32, index. Sharp means more than 20 degrees between the normals.
    """
    _, same = np.unique(np.round(mesh.vertices, 7), axis=0, return_inverse=True)
    corners = same.reshape(-1)[mesh.faces]
    sides = corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    owner = np.repeat(np.arange(len(mesh.faces)), 3)
    key = np.sort(sides, axis=1)
    order = np.lexsort((owner, key[:, 1], key[:, 0]))
    key, owner, ends = key[order], owner[order], mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)[order]
    pair = np.flatnonzero((key[:-1] == key[1:]).all(axis=1))
    a, b = owner[pair], owner[pair + 1]
    n1, n2 = mesh.normals[a], mesh.normals[b]
    p, q = mesh.vertices[ends[pair, 0]], mesh.vertices[ends[pair, 1]]
    below = np.einsum("ij,ij->i", n1, mesh.triangles[b].mean(axis=1) - p)
    sharp = (np.einsum("ij,ij->i", n1, n2) < math.cos(SHARP)) & (below < 0)
    p, q, n1, n2, a = p[sharp], q[sharp], n1[sharp], n2[sharp], a[sharp]
    middle = n1 + n2
    length = np.linalg.norm(middle, axis=1)
    keep = length > 1e-6
    p, q, middle, a = p[keep], q[keep], middle[keep] / length[keep, None], a[keep]
    count = np.maximum(np.ceil(np.linalg.norm(q - p, axis=1) / spacing).astype(int), 1) + 1
    row = np.repeat(np.arange(len(p)), count)
    f = (np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)) / (count[row] - 1)
    # not on the end itself: the ray of a vertical edge would run in the top face, where cuts end
    f = np.clip(f, *(np.array([[1.0], [-1.0]]) * INSET / np.maximum(np.linalg.norm(q - p, axis=1)[row], 4.0 * INSET)
                     + np.array([[0.0], [1.0]])))
    at, up, face = _tips(mesh, same.reshape(-1))
    return (np.concatenate([p[row] + f[:, None] * (q - p)[row], at]), np.concatenate([middle[row], up]),
            np.concatenate([mesh.face_ids[a[row]], face]))


def _tips(mesh: TriangleMesh, same: NDArray[np.int64]) -> tuple[F64, F64, I32]:
    """Vertices at which the part comes to a point, in the form of ``convex_edges``: a cone tip has no sharp edges.

    same : (v,) int64, number of the place of each vertex
    """
    corners, count = same[mesh.faces], int(same.max(initial=-1)) + 1
    place = np.zeros((count, 3))
    place[same] = mesh.vertices
    up = np.zeros((count, 3))
    for k in range(3):
        np.add.at(up, corners[:, k], mesh.normals)
    up /= np.maximum(np.linalg.norm(up, axis=1), 1e-300)[:, None]
    lean, high = np.ones(count), np.full(count, -np.inf)
    owner = np.zeros(count, np.int64)
    for k in range(3):
        c = corners[:, k]
        np.minimum.at(lean, c, np.einsum("ij,ij->i", up[c], mesh.normals))
        for j in (1, 2):
            away = place[corners[:, (k + j) % 3]] - place[c]
            np.maximum.at(high, c, np.einsum("ij,ij->i", away, up[c]))
        owner[c] = np.arange(len(c))
    tip = np.flatnonzero((lean < math.cos(SHARP)) & (high < 0.0))
    return place[tip], up[tip], mesh.face_ids[owner[tip]]


def closer_seeds(points: F64, residual: F64, mover: I32, sure: float) -> tuple[F64, int]:
    """Samples round which the surface gets closer points: the lowest of every 0.15 mm cell, up to a limit.

    points   : (n, 3) float64, mm, setup frame, samples with little or no rest material
    residual : (n,) float64, mm, rest material on their normals
    mover    : (n,) int32, index, the move that cut each
    sure     : mm; gouges deeper than this are found anyway, so the four deepest of each move suffice

    Returns (k, 3) float64, mm, setup frame, and the number left out: the 4500 deepest of the shallow ones and 1500
    others are kept.
    """
    order = np.argsort(residual, kind="stable")
    _, first = np.unique(np.floor(points[order] / CLOSER_REACH).astype(np.int64), axis=0, return_index=True)
    rows = order[np.sort(first)]
    deep, shallow = rows[residual[rows] < -sure], rows[residual[rows] >= -sure]
    by_move = np.argsort(mover[deep], kind="stable")
    _, begin, count = np.unique(mover[deep][by_move], return_index=True, return_counts=True)
    nth = np.empty(len(deep), np.int64)
    nth[by_move] = np.arange(len(deep)) - np.repeat(begin, count)
    deep = deep[nth < DEEP_A_MOVE]
    out = np.concatenate([deep[:MAX_DEEP], shallow[:MAX_SEEDS]])
    return points[out], max(len(deep) - MAX_DEEP, 0) + max(len(shallow) - MAX_SEEDS, 0)


def closer_points(tree: TriangleTree, seeds: F64) -> tuple[F64, F64, NDArray[np.int64]]:
    """Places of the surface round seeds, 0.02 mm apart, for gouges that are deepest between samples.

    seeds : (k, 3) float64, mm, setup frame; the places cover 0.15 mm to all sides of each

    Returns places on the mesh, (m, 3) float64, mm; normals of their triangles, (m, 3) float64, unit; both in the setup
    frame; and the triangles, (m,) int64, index.
    """
    if len(seeds) == 0:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64)
    _, row, _ = nearest(tree, seeds)
    n = tree.mesh.normals[row]
    across = np.where(np.abs(n[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    u = across - np.einsum("ij,ij->i", across, n)[:, None] * n
    u /= np.linalg.norm(u, axis=1)[:, None]
    v = np.cross(n, u)
    steps = np.arange(-CLOSER_REACH, CLOSER_REACH + 1e-9, CLOSER_STEP)
    a, b = (x.reshape(-1, 1) for x in np.meshgrid(steps, steps, indexing="ij"))
    there = (seeds[:, None] + a * u[:, None] + b * v[:, None]).reshape(-1, 3)
    _, row, foot = nearest(tree, there)
    return foot, tree.mesh.normals[row], row


def gouge_depths(tree: TriangleTree, points: F64, normals: F64, along: F64, report: Report = silent) -> F64:
    """Depth of gouges: the largest distance from the surface along the removed stretch of each inward ray.

    points, normals : (n, 3) float64, mm and unit, setup frame, normals outwards
    along           : (n,) float64, mm removed along the inward normal, > 0
    report          : called with the share done, 0 to 1; an exception from it ends the work

    Returns (n,) float64, mm: the largest distance to the mesh on the stretch, up to where the ray leaves the part.

    Notes
    -----
    A cut that grazes the top of a wall removes whole rays of samples just below the top edge; the depth of a gouge is
    its depth below the surface. It is as exact as ``verify.kernels.surface.depth.deepest``. A ray that leaves the part
    within 1e-4 mm counts 0.
    """
    out = np.zeros(len(points))
    for i in range(0, len(points), DEPTH_BATCH):
        rows = slice(i, i + DEPTH_BATCH)
        out[rows] = _depths(tree, points[rows], normals[rows], along[rows])
        report(min((i + DEPTH_BATCH) / len(points), 1.0))
    return out


def inside_part(tree: TriangleTree, points: F64) -> NDArray[np.bool_]:
    """Whether places are in the part, by the first hits of two opposite oblique rays.

    points : (n, 3) float64, mm, frame of the mesh

    Returns (n,) bool.

    One ray that leaves the part suffices: the other may pass a hole of the mesh, or enter another solid.
    """
    out = np.zeros(len(points), np.bool_)
    for way in (ASIDE, -ASIDE):
        _, hit = first_hits(tree, points, np.broadcast_to(way, points.shape))
        out |= (hit >= 0) & (tree.mesh.normals[hit] @ way > 0.0)
    return out


def _depths(tree: TriangleTree, points: F64, normals: F64, along: F64) -> F64:
    through, hit = first_hits(tree, points, -normals, t_min=1e-4)
    # a sample of the exact surface may lie above its facet: there the ray does not leave the part
    over = (hit >= 0) & (through < FACETS_OFF) & (np.einsum("ij,ij->i", tree.mesh.normals[hit], normals) > 0)
    if over.any():
        low = through[over]
        again, hit[over] = first_hits(tree, points[over] - low[:, None] * normals[over], -normals[over], t_min=1e-4)
        through[over] = low + again
    # at a razor edge the ray has left the part before t_min: the next facet faces it, except at the opposite edge of a
    # hollow whose rims have one height; then the middle is not in the part
    leaves = np.einsum("ij,ij->i", tree.mesh.normals[hit], normals) < 0
    ends = np.flatnonzero((hit >= 0) & leaves)
    leaves[ends] = inside_part(tree, points[ends] - 0.5 * through[ends, None] * normals[ends])
    stretch = np.minimum(along, np.where((hit >= 0) & leaves, through, 0.0))
    t, out = tree.arrays, np.empty(len(points))
    deepest(t.lower, t.upper, t.child, t.first, t.size, t.corners, np.ascontiguousarray(points),
            np.ascontiguousarray(normals), stretch, out)
    return np.minimum(out, along)
