"""Points of the part that are checked in addition to the scored samples, and true depths of gouges.

Points are float64, mm, in the setup frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.mesh_queries.rays import first_hits
from geometry.sampling import SurfaceSamples, lattice_samples
from geometry.tool_body import ToolBody
from verify.assumptions import Assumed, AssumedKind
from verify.kernels.surface.depth import deepest
from verify.moves import Moves
from verify.progress import Report, silent
from verify.tool_axes import square_to

GUARD_SPACING = 0.18
HOLE = 0.87  # of the spacing: no place of a flat is farther from a sample
MAX_GUARD_SAMPLES = 1_000_000
EDGE_SPACING = 0.1
INSET = 1e-3  # mm, of the ends of edges
SHARP = math.radians(20.0)
DEPTH_BATCH = 2048  # rays between two reports
PATH_BATCH = 200_000  # places of a path at a time
CLOSER_REACH, CLOSER_STEP = 0.15, 0.02
FIRST_STEP = 0.1  # mm between the nine places of a first look
DEEP_A_MOVE, DEEP_APART = 4, 0.5  # gouges that get closer points: of each move, and in each cube of so many mm one
PATH_ROOM = 0.05  # mm between tool and surface, at which a place of the path counts
AROUND = 8  # places of the rim of a fine tool
FINE = 0.5  # mm, radius of tools whose rim is looked at too
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
    """Even samples of the whole part: no place of a flat is farther than ``HOLE`` times the spacing from one."""
    return lattice_samples(mesh, guard_spacing(mesh))


def wide_samples(mesh: TriangleMesh) -> list[Assumed]:
    """What is taken for granted on a part so large that its samples are wider apart than usual."""
    spacing = guard_spacing(mesh)
    if spacing <= GUARD_SPACING:
        return []
    return [Assumed(AssumedKind.BETWEEN_SAMPLES, round(spacing, 3),
                    f"the part is large: a gouge narrower than {spacing:.2f} mm may be missed aside of the path of the "
                    "middle of a tool", "verify the program on a piece of the workpiece")]


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


def path_points(tree: TriangleTree, moves: Moves, tools: Sequence[ToolBody], tolerance: float
                ) -> Iterator[tuple[F64, NDArray[np.int64]]]:
    """Places of the surface under the paths of tools that may gouge between the samples of the lattice.

    tolerance : mm, of gouges

    Yields batches of (k, 3) float64, mm, setup frame, on the mesh, and their triangles, (k,) int64, index.

    Notes
    -----
    A lattice with the largest hole h shows a cut by a ball of radius R that is h² / 2R deep. Tools with that over 0.6
    of the tolerance are followed: the middle of the corner of each, and eight places of the rim of those finer than
    ``FINE``, in steps of half a radius and at most the spacing of the lattice. The place of the surface nearest to
    each is a place to look at. So a pit is looked at in its middle, whatever its radius.
    """
    radius, spacing = np.array([t.radius for t in tools]), guard_spacing(tree.mesh)
    rows = fine_moves(tree.mesh, moves, tools, tolerance)
    step = np.minimum(0.5 * radius, spacing)[moves.tool[rows]]
    count = np.ceil(np.linalg.norm(moves.end[rows] - moves.start[rows], axis=1) / step).astype(np.int64) + 1
    ends = np.cumsum(count)
    first = 0
    while first < len(rows):
        last = max(int(np.searchsorted(ends, ends[first] - count[first] + PATH_BATCH, side="right")), first + 1)
        yield _under(tree, moves.only(rows[first:last]), count[first:last], tools, tolerance)
        first = last


def fine_moves(mesh: TriangleMesh, moves: Moves, tools: Sequence[ToolBody], tolerance: float) -> NDArray[np.int64]:
    """Feed moves of tools that may gouge between samples, (k,) int64, index.

    tolerance : mm, of gouges
    """
    if not len(moves):
        return np.zeros(0, np.int64)
    least = (HOLE * guard_spacing(mesh))**2 / (2.0 * (1.0 - CLOSER_SHARE) * max(tolerance, 1e-6))
    return np.flatnonzero(moves.feed & (np.array([t.radius for t in tools]) < least)[moves.tool])


def path_places(moves: Moves, count: NDArray[np.int64]) -> tuple[F64, F64, NDArray[np.int64]]:
    """Even places of the tip along moves, both ends among them.

    count : (m,) int64, dimensionless, places of each move

    Returns
    -------
    tip  : (k, 3) float64, mm, setup frame
    axis : (k, 3) float64, unit, setup frame, tip to spindle
    of   : (k,) int64, index, the move of each
    """
    of = np.repeat(np.arange(len(moves)), count)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)) / np.maximum(count - 1, 1)[of]
    tip = moves.start[of] + share[:, None] * (moves.end - moves.start)[of]
    if moves.axes is None:
        return tip, np.tile([0.0, 0.0, 1.0], (len(of), 1)), of
    turn, axis = (share * moves.axes.angle[of])[:, None], moves.axes.axis[of]
    return tip, np.cos(turn) * axis + np.sin(turn) * np.cross(moves.axes.about[of], axis), of


def _inner_ball(tool: ToolBody) -> float:
    """Radius of a ball on the tip that the end holds, mm; 0 for a sharp one. Circle segment mills are wider than
    ``FINE``."""
    return tool.corner_radius if tool.arcs is None else min(tool.arcs.low, tool.radius)


def _under(tree: TriangleTree, moves: Moves, count: NDArray[np.int64], tools: Sequence[ToolBody], tolerance: float
           ) -> tuple[F64, NDArray[np.int64]]:
    """Places of the surface and their triangles under ``count`` (m,) even places of each move, both ends among them."""
    tip, z, of = path_places(moves, count)
    radius, corner = (np.array(size)[moves.tool[of]]
                      for size in ([t.radius for t in tools], [_inner_ball(t) for t in tools]))
    middle = tip + corner[:, None] * z
    # a ball that is one tolerance deep under one place of a cell is 0.4 of it deep at any other
    least = float(radius.min(initial=np.inf))
    cell = min(0.25 * least, math.sqrt((1.0 - CLOSER_SHARE) * least * max(tolerance, 1e-6)))
    one = _apart(middle, cell)
    middle, z, radius, corner = middle[one], z[one], radius[one], corner[one]
    reach = float(radius.max(initial=0.0)) + PATH_ROOM
    away, row, foot = nearest(tree, middle, reach)
    near = away <= np.where(radius <= FINE, radius, corner) + PATH_ROOM
    feet, rows = [foot[near]], [row[near]]
    rim = np.flatnonzero((radius <= FINE) & (corner < radius) & (away <= radius + PATH_ROOM))
    x = square_to(z[rim])
    y = np.cross(z[rim], x)
    for turn_ in 2.0 * math.pi * np.arange(AROUND) / AROUND:
        at = middle[rim] + (radius - corner)[rim, None] * (math.cos(turn_) * x + math.sin(turn_) * y)
        gap, row, foot = nearest(tree, at, reach)
        near = gap <= corner[rim] + PATH_ROOM
        feet.append(foot[near])
        rows.append(row[near])
    points, row = np.concatenate(feet), np.concatenate(rows)
    one = _apart(points, cell)
    return _off_edges(tree, points[one], row[one]), row[one]


def _off_edges(tree: TriangleTree, points: F64, row: NDArray[np.int64]) -> F64:
    """Places (n, 3), mm, of triangles ``row`` (n,), moved ``INSET`` into them.

    The normal ray of a wall that begins on its upper edge runs in the face above, where cuts end.
    """
    way = tree.mesh.triangles[row].mean(axis=1) - points
    size = np.linalg.norm(way, axis=1)
    return np.asarray(points + np.minimum(INSET / np.maximum(size, 1e-12), 0.5)[:, None] * way)


def _apart(points: F64, cell: float) -> NDArray[np.int64]:
    """Of points (n, 3), mm, the first in each cube of ``cell`` mm, (k,) int64, index."""
    cells = np.floor(points / cell).astype(np.int64)
    cells -= cells.min(axis=0, initial=0)
    _, ny, nz = (cells.max(axis=0, initial=0) + 1).tolist()
    return np.sort(np.unique((cells[:, 0] * ny + cells[:, 1]) * nz + cells[:, 2], return_index=True)[1])


def closer_seeds(points: F64, residual: F64, mover: I32, tolerance: float) -> tuple[F64, F64]:
    """Samples round which the surface gets closer points: the lowest of every 0.15 mm cell.

    points    : (n, 3) float64, mm, setup frame, samples with little or no rest material
    residual  : (n,) float64, mm, rest material on their normals
    mover     : (n,) int32, index, the move that cut each
    tolerance : mm, of gouges

    Returns
    -------
    doubtful : (k, 3) float64, mm, setup frame: all that are within the tolerance, where a gouge may lie between samples
    deep     : (d, 3) float64, mm, setup frame: places of gouges, whose depth is to be measured better. The four deepest
               of each move, and one in each cube of 0.5 mm
    """
    order = np.argsort(residual, kind="stable")
    _, first = np.unique(np.floor(points[order] / CLOSER_REACH).astype(np.int64), axis=0, return_index=True)
    rows = order[np.sort(first)]
    deep, doubtful = rows[residual[rows] < -tolerance], rows[residual[rows] >= -tolerance]
    by_move = np.argsort(mover[deep], kind="stable")
    _, begin, count = np.unique(mover[deep][by_move], return_index=True, return_counts=True)
    nth = np.empty(len(deep), np.int64)
    nth[by_move] = np.arange(len(deep)) - np.repeat(begin, count)
    deep = deep[nth < DEEP_A_MOVE]
    return points[doubtful], points[deep[_apart(points[deep], DEEP_APART)]]


def first_points(tree: TriangleTree, seeds: F64) -> tuple[F64, F64, NDArray[np.int64]]:
    """Nine places of the surface round each seed, 0.1 mm apart, those of a seed in a row.

    seeds : (k, 3) float64, mm, setup frame

    Returns places, (9 k, 3) float64, mm, normals, (9 k, 3) float64, unit, in the setup frame, and the triangles, (9 k,)
    int64, index.
    """
    return _round(tree, seeds, np.array([-FIRST_STEP, 0.0, FIRST_STEP]))


def worth_a_look(residual: F64, tolerance: float) -> NDArray[np.bool_]:
    """Seeds round which a gouge may lie between the nine places of ``first_points``.

    residual : (9 k,) float64, mm, on the normals of those places; tolerance : mm, of gouges

    Returns (k,) bool: the deepest place, as much deeper as the nine differ, is deeper than the tolerance.
    """
    left = residual.reshape(-1, 9)
    low = left.min(axis=1)
    return np.asarray(low - (np.minimum(left.max(axis=1), 0.0) - low) < -tolerance)


def closer_points(tree: TriangleTree, seeds: F64) -> tuple[F64, F64, NDArray[np.int64]]:
    """Places of the surface round seeds, 0.02 mm apart, for gouges that are deepest between samples.

    seeds : (k, 3) float64, mm, setup frame; the places cover 0.15 mm to all sides of each

    Returns places on the mesh, (m, 3) float64, mm; normals of their triangles, (m, 3) float64, unit; both in the setup
    frame; and the triangles, (m,) int64, index.
    """
    return _round(tree, seeds, np.arange(-CLOSER_REACH, CLOSER_REACH + 1e-9, CLOSER_STEP))


def _round(tree: TriangleTree, seeds: F64, steps: F64) -> tuple[F64, F64, NDArray[np.int64]]:
    """``closer_points`` at ``steps`` (s,) mm to both sides."""
    if len(seeds) == 0:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64)
    _, row, _ = nearest(tree, seeds)
    n = tree.mesh.normals[row]
    across = np.where(np.abs(n[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    u = across - np.einsum("ij,ij->i", across, n)[:, None] * n
    u /= np.linalg.norm(u, axis=1)[:, None]
    v = np.cross(n, u)
    a, b = (x.reshape(-1, 1) for x in np.meshgrid(steps, steps, indexing="ij"))
    there = (seeds[:, None] + a * u[:, None] + b * v[:, None]).reshape(-1, 3)
    _, row, foot = nearest(tree, there)
    return _off_edges(tree, foot, row), tree.mesh.normals[row], row


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
    """Whether points are in the part, by the first hits of two opposite oblique rays.

    points : (n, 3) float64, mm, setup frame

    Returns (n,) bool. One ray that leaves the part suffices: the other may pass a hole of the mesh, or enter another
    solid.
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
