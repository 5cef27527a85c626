"""How far a face lies behind the cut, along its normals, where that is more than the depth of its gouges.

The depth of a gouge is the way from the surface to what is left, or from what is gone to the surface. Near other faces
that is less than the offset by which a whole face was cut too deep: a step 3 mm wide that is cut 5 mm too low has what
is left 3 mm aside of it. Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64, I32
from geometry.mesh_queries.rays import first_hits
from geometry.sampling import SurfaceSamples
from verify.findings import Source
from verify.model import Finding, FindingKind
from verify.surface.asked_faces import ASIDE, ASIDE_ROOM, Cutting, distance_aside, thinned
from verify.surface.removal import residual_on_normals

INSET = 1e-3  # mm below the surface, where ways begin
MAX_OF_FACE, MAX_ALL = 150, 1500  # samples whose ways are looked for
MAX_STEPS = 40  # cuts that one way may pass
DEEP = 0.2  # mm: shallower gouges are as deep as they are below the surface
MORE = 1.1  # times the depth below the surface, from which on the way is told as well
SHARE = 0.9  # of the samples of a face with a way: the way that so many do not exceed


def ways_in(points: F64, normals: F64, cutting: Cutting) -> F64:
    """Length of ways along the inward normal, from gouged samples through what was removed to what remains.

    points, normals : (n, 3) float64, mm and unit, setup frame, on the surface of the part

    Returns (n,) float64, mm; inf where a way leaves the part.
    """
    start, ways = points - INSET * normals, np.ascontiguousarray(-normals)
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
    return np.asarray(np.where(length < leaves, length + INSET, np.inf))


def deep_findings(samples: SurfaceSamples, residual: F64, mover: I32, cutting: Cutting,
                  source: Source) -> list[Finding]:
    """A finding for each face into which the cut goes farther along the normal than its gouges are deep.

    Samples beside a place of the same face that stands do not count, since a cut that passes along a face takes away
    whole rays below its edge. Nor do those where the part is cut right through.

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
    along = ways_in(samples.points[tried], samples.normals[tried], cutting)
    aside = distance_aside(samples, np.flatnonzero(np.isin(samples.face, faces) & (residual >= -DEEP)), tried)
    way = np.where(aside > ASIDE * along + ASIDE_ROOM, along, np.inf)
    out, parts = [], np.cumsum([len(c) for c in chosen])[:-1]
    for mine, own in zip(chosen, np.split(way, parts), strict=True):
        known = np.flatnonzero(np.isfinite(own))
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
