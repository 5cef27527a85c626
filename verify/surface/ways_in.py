"""How far the cut stands inside the part where it is deeper than half of what is thick there.

The depth of a gouge is its depth below the surface, which is at most half the thickness of the part. A program that is
5 mm too low in a floor of 6 mm has a gouge of 3 mm. Its offset is the shortest way from the old surface through what
was removed to what remains. Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

import math

import numpy as np

from geometry.mesh import F64, I32
from geometry.mesh_queries.rays import first_hits
from geometry.sampling import SurfaceSamples
from verify.findings import Source
from verify.model import Finding, FindingKind
from verify.surface.asked_faces import ASIDE, ASIDE_ROOM, Cutting, distance_aside, thinned
from verify.surface.removal import residual_on_normals
from verify.tool_axes import square_to

AROUND, SLOPES = 16, (0.0, math.radians(30.0), math.radians(60.0))  # directions round the inward normal, at each slope
INSET = 1e-3  # mm below the surface, where ways begin
MAX_OF_FACE, MAX_ALL = 150, 1500  # samples whose ways are looked for
MAX_STEPS = 40  # cuts that one way may pass
DEEP = 0.2  # mm: shallower gouges are as deep as they are below the surface
MORE = 1.1  # times the depth below the surface, from which on the way is told as well
SHARE = 0.9  # of the samples of a face with a way: the way that so many do not exceed


def ways_in(points: F64, normals: F64, cutting: Cutting) -> tuple[F64, F64]:
    """Length of ways from gouged samples through what was removed to what remains of the part.

    points, normals : (n, 3) float64, mm and unit, setup frame, on the surface of the part

    Returns (n,) float64, mm, along the inward normal, and (n,) float64, mm, the shortest; inf where ways leave the
    part.

    Notes
    -----
    Ways run along the inward normal and 48 directions round it; the true way is shorter by 3.5 % at most (cos 15
    degrees), out of a cut with a plane bottom.
    """
    n = len(points)
    x = square_to(normals)
    y = np.cross(normals, x)
    turn = 2.0 * math.pi * np.arange(AROUND) / AROUND
    level = np.cos(turn)[:, None, None] * x + np.sin(turn)[:, None, None] * y
    ways = np.concatenate([-normals[None], *(math.cos(s) * level - math.sin(s) * normals for s in SLOPES)])
    start = np.broadcast_to(points - INSET * normals, ways.shape).reshape(-1, 3)
    ways = np.ascontiguousarray(ways.reshape(-1, 3))
    leaves, _ = first_hits(cutting.tree, start, ways)
    length, rows = np.zeros(len(ways)), np.arange(len(ways))
    for _ in range(MAX_STEPS):
        at = start[rows] + length[rows, None] * ways[rows]
        left, _ = residual_on_normals(at, -ways[rows], np.zeros(len(rows)), cutting.moves, cutting.tools,
                                      threads=cutting.threads)
        length[rows] -= left
        rows = rows[(left < -INSET) & (length[rows] < leaves[rows])]
        if not len(rows):
            break
    reached = np.where(length < leaves, length + INSET, np.inf).reshape(-1, n)
    return np.asarray(reached[0]), np.asarray(reached.min(axis=0))


def deep_findings(samples: SurfaceSamples, residual: F64, mover: I32, cutting: Cutting,
                  source: Source) -> list[Finding]:
    """A finding for each face into which the cut goes farther than the depth of its gouges below the surface.

    The cut goes as far as the way along the normal; beside a place of the same face that stands, as far as the shortest
    way, since a cut that passes along a face takes away whole rays below its edge. Places that are cut right through
    count only where the whole face is: what remains lies aside of them, up to 15 % farther.

    samples  : SurfaceSamples, n of them, frame of the proof
    residual : (n,) float64, mm, negative where gouged
    mover    : (n,) int32, index, the move that cut deepest
    """
    rows = np.flatnonzero((residual < -DEEP) & (mover >= 0))
    if not len(rows):
        return []
    faces = np.unique(samples.face[rows])
    most = max(min(MAX_OF_FACE, MAX_ALL // len(faces)), 5)
    chosen = [thinned(rows[samples.face[rows] == face], most) for face in faces]
    tried = np.concatenate(chosen)
    along, way = ways_in(samples.points[tried], samples.normals[tried], cutting)
    aside = distance_aside(samples, np.flatnonzero(np.isin(samples.face, faces) & (residual >= -DEEP)), tried)
    way = np.where((aside > ASIDE * way + ASIDE_ROOM) & np.isfinite(along), along, way)
    out, parts = [], np.cumsum([len(c) for c in chosen])[:-1]
    for mine, own, straight in zip(chosen, np.split(way, parts), np.split(along, parts), strict=True):
        known = np.flatnonzero(np.isfinite(own) & (np.isfinite(straight) | ~np.isfinite(straight).any()))
        if not len(known):
            continue
        order = known[np.argsort(own[known], kind="stable")]
        k = int(order[min(int(SHARE * len(order)), len(order) - 1)])
        deepest = float(-residual[samples.face == samples.face[mine[k]]].min())
        if own[k] > MORE * deepest:
            m, point = int(mover[mine[k]]), samples.points[mine[k]]
            x, y, z = (round(float(v), 6) for v in point)
            out.append(Finding(
                FindingKind.GOUGE, source.names[source.program[m]], int(source.line[m]), None,
                f"F{samples.face[mine[k]]}", (x, y, z), float(own[k]), cutting.setup.gouge_tolerance,
                f"T{source.tool[m]} cuts {own[k]:.4f} mm off the face; the deepest place is {deepest:.4f} mm below the "
                "surface", len(known)))
    return out
