"""Faces that no axis looks at, and that a program works on all the same.

A slot cutter cuts the ceiling of its slot, and a flank that leans too little cuts towards an overhanging wall. Such
faces are no machinable area, since nothing sees them. Where a program works on them they are judged as the others.

Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from geometry.sampling import sample_surface
from verify.surface.removal import residual_on_normals
from verify.work.asked_faces import OFF_FACETS, WORKED_SHARE, Cutting, thinned
from verify.work.own_poses import poses_at
from verify.work.standing_room import Surroundings, free_poses

PLACES = 100  # of each face
POSED = 25  # of them, evenly chosen, to which tools are moved on


def hidden_work(hidden: Collection[int], cutting: Cutting, slack: float) -> tuple[int, ...]:
    """Faces on which feed moves remove stock, and to which their tools can be moved on.

    hidden : face numbers that are asked about
    slack  : mm by which the cutting part may enter the surface, for facets and rounding

    Returns face numbers, ascending: those where both hold for a fifth of ``PLACES`` places.

    Notes
    -----
    A way from the face to a cut counts up to the width of the tool. A mill that goes through the plate cuts before the
    chamfer of the underside, too; but its tool cannot be moved on to that, as the side of the plate stands there.
    """
    mesh, moves = cutting.tree.mesh, cutting.moves
    feeds = np.flatnonzero(moves.feed)
    chosen = np.flatnonzero(np.isin(mesh.face_ids, list(hidden)))
    if not len(chosen) or not len(feeds):
        return ()
    chosen = chosen[np.argsort(mesh.face_ids[chosen], kind="stable")]
    each = np.split(chosen, np.flatnonzero(np.diff(mesh.face_ids[chosen])) + 1)
    one = [sample_surface(mesh, PLACES / float(mesh.areas[t].sum()), triangles=t) for t in each]
    points, normals = (np.concatenate([getattr(s, name) for s in one]) for name in ("points", "normals"))
    face = np.concatenate([s.face for s in one])
    most = 2.0 * max(cutting.tools[k].widest_radius for k in np.unique(moves.tool[feeds]))
    initial = np.minimum(*cutting.blank_on_rays(points, normals, most, OFF_FACETS))
    left, by = residual_on_normals(points, normals, initial, moves.only(feeds), cutting.tools, threads=cutting.threads)
    total, cut = np.bincount(face), np.bincount(face[by >= 0], minlength=int(face.max()) + 1)
    worked = np.flatnonzero(cut >= np.maximum(WORKED_SHARE * total, 1))
    rows = [thinned(np.flatnonzero((by >= 0) & (face == n)), POSED) for n in worked]
    out, around = list[int](), Surroundings.of(cutting)
    for n, mine in zip(worked.tolist(), rows, strict=True):
        poses = poses_at(points[mine], normals[mine], normals[mine], np.maximum(left[mine], 0.0),
                         feeds[by[mine]].astype(np.int32), moves, cutting.tools, cutting.setup.stock_allowance)
        held = np.unique(poses.row[free_poses(poses, np.ones(len(poses), np.bool_), around, cutting, slack)])
        if len(held) / len(mine) * cut[n] >= WORKED_SHARE * total[n]:
            out.append(n)
    return tuple(out)


__all__ = ["hidden_work"]
