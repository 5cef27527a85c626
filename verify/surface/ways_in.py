"""How far a cut goes into the part along the normals of a face, where that is more than the depth of its gouges.

The depth of a gouge is the way from the surface to what is left, or from what is gone to the surface. Near other faces
that is less than the offset by which a whole face was cut too deep: a step 3 mm wide that is cut 5 mm too low has what
is left 3 mm aside of it. A pass along a wall that is shifted by more than its tool is wide leaves the wall and cuts a
slot behind it, whose places may be nearer to the faces above and below than to the wall. Coordinates are float64, mm,
in the frame of the proof.
"""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64, I32
from geometry.mesh_queries.rays import first_hits
from geometry.sampling import SurfaceSamples
from verify.findings import Source
from verify.model import Finding, FindingKind
from verify.surface.removal import residual_on_normals
from verify.work.asked_faces import ASIDE, ASIDE_ROOM, Cutting, distance_aside, thinned

INSET = 1e-3  # mm below the surface, where ways begin
MAX_OF_FACE, MAX_ALL = 150, 1500  # samples whose ways are looked for
MAX_STEPS = 40  # cuts that one way may pass
DEEP = 0.2  # mm: shallower gouges are as deep as they are below the surface
MORE = 1.1  # times the depth below the surface, from which on the way is told as well
SHARE = 0.9  # of the samples of a face with a way: the way that so many do not exceed
BEHIND = 0.2  # of the area of a face, behind which a cut is told
FRONT = 5.0  # mm, or a diameter of the tool: so much may stand in front of a cut that is told of a face
ALIKE = 0.9  # times the way of the face: half of its ways are at least as long


def ways_in(points: F64, normals: F64, cutting: Cutting, begin: F64 | None = None) -> tuple[F64, F64]:
    """Length of ways along the inward normal, from gouged samples through what was removed to what remains.

    points, normals : (n, 3) float64, mm and unit, setup frame, on the surface of the part
    begin           : (n,) float64, mm below the surface, where something was removed; None: there

    Returns the length, (n,) float64, mm from the surface, inf where a way leaves the part; and where it would leave it,
    (n,) float64, mm.
    """
    start, ways = points - INSET * normals, np.ascontiguousarray(-normals)
    leaves, _ = first_hits(cutting.tree, start, ways)
    length, rows = np.zeros(len(ways)) if begin is None else begin - INSET, np.arange(len(ways))
    for _ in range(MAX_STEPS):
        at = start[rows] + length[rows, None] * ways[rows]
        left, _ = residual_on_normals(at, -ways[rows], np.zeros(len(rows)), cutting.moves, cutting.tools,
                                      threads=cutting.threads)
        length[rows] -= left
        rows = rows[(left < -INSET) & (length[rows] < leaves[rows])]
        if not len(rows):
            break
    return np.asarray(np.where(length < leaves, length + INSET, np.inf)), leaves + INSET


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
    along, _ = ways_in(samples.points[tried], samples.normals[tried], cutting)
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


def slot_findings(samples: SurfaceSamples, residual: F64, cutting: Cutting, source: Source) -> list[Finding]:
    """A finding for each face behind which a cut passes, no farther than ``FRONT`` or than its tool is wide.

    samples  : SurfaceSamples, n of them, frame of the proof
    residual : (n,) float64, mm, negative where gouged

    Notes
    -----
    A face has one where ``BEHIND`` of its area has such a cut behind it, at nearly the same distance. Ways on which the
    cut leaves the part do not count. So a cut that ends a face, crosses it, or lies far inside is none of its own. What
    the same moves cut is told of the face that it is nearest to.
    """
    if not (residual < -DEEP).any():
        return []
    numbers = np.unique(samples.face).tolist()
    most = max(min(MAX_OF_FACE, MAX_ALL // len(numbers)), 5)
    chosen = [thinned(np.flatnonzero(samples.face == face), most) for face in numbers]
    tried = np.concatenate(chosen)
    front, end, mover = _behind(samples.points[tried], samples.normals[tried], cutting)
    first = np.cumsum([0, *map(len, chosen)])
    told = []
    for k, face in enumerate(numbers):
        own = np.arange(first[k], first[k + 1])
        known, area = own[np.isfinite(end[own])], samples.area[tried]
        if area[known].sum() >= BEHIND * area[own].sum():
            order = known[np.argsort(end[known], kind="stable")]
            n = int(order[min(int(SHARE * len(order)), len(order) - 1)])
            if end[order[len(order) // 2]] >= ALIKE * end[n]:
                told.append((float(end[n]), face, n, known))
    out, taken = [], np.zeros(0, np.int32)
    for depth, face, n, known in sorted(told, key=lambda t: t[:2]):
        if np.isin(mover[known], taken).mean() > 0.5:
            continue
        taken = np.union1d(taken, mover[known])
        m, at = int(mover[n]), samples.points[tried[n]] - depth * samples.normals[tried[n]]
        x, y, z = (round(float(v), 6) for v in at)
        out.append(Finding(
            FindingKind.GOUGE, source.names[source.program[m]], int(source.line[m]), None, f"F{face}", (x, y, z),
            depth, cutting.setup.gouge_tolerance, f"T{source.tool[m]} cuts behind the face, {depth:.4f} mm into the "
            f"part; {front[n]:.4f} mm of the part stand in front of the cut", len(known)))
    return out


def _behind(points: F64, normals: F64, cutting: Cutting) -> tuple[F64, F64, I32]:
    """Cuts behind a surface that stands.

    points, normals : (n, 3) float64, mm and unit, setup frame, on the surface of the part

    Returns where the cut begins and where it ends, (n,) float64 and (n,) float64, mm from the surface along the inward
    normal, and (n,) int32, index, the move with which it begins. The end is inf where there is none, where more than
    ``FRONT`` and the diameter of its tool stands in front of it, where it leaves the part, and where less stands beyond
    it than in front: then it is one behind the surface there.
    """
    deep = max(cutting.setup.gouge_tolerance, INSET)  # a tool that touches the surface is no cut behind it
    ways = np.ascontiguousarray(-normals)
    begin, mover = residual_on_normals(points + deep * ways, ways, np.full(len(ways), cutting.farthest), cutting.moves,
                                       cutting.tools, threads=cutting.threads)
    most = np.maximum(np.array([2.0 * t.widest_radius for t in cutting.tools])[cutting.moves.tool[mover]], FRONT)
    front, end = begin + deep, np.full(len(ways), np.inf)
    rows = np.flatnonzero((mover >= 0) & (front > DEEP) & (front < most))
    if len(rows):
        to, leaves = ways_in(points[rows], normals[rows], cutting, front[rows] + INSET)
        end[rows] = np.where(front[rows] <= leaves - to, to, np.inf)
    return front, end, mover
