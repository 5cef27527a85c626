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
from verify.work.asked_faces import OFF_FACETS, WORKED_SHARE, Cutting
from verify.work.own_poses import poses_at
from verify.work.standing_room import free_poses

PLACES = 100  # of each face


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
    faces = [n for n in sorted(hidden) if (mesh.face_ids == n).any()]
    if not faces or not len(feeds):
        return ()
    one = [sample_surface(mesh, PLACES / float(mesh.areas[mesh.face_ids == n].sum()),
                          triangles=np.flatnonzero(mesh.face_ids == n)) for n in faces]
    points, normals = (np.concatenate([getattr(s, name) for s in one]) for name in ("points", "normals"))
    face = np.concatenate([s.face for s in one])
    most = 2.0 * max(cutting.tools[k].widest_radius for k in np.unique(moves.tool[feeds]))
    initial = np.minimum(*cutting.blank_on_rays(points, normals, most, OFF_FACETS))
    left, by = residual_on_normals(points, normals, initial, moves.only(feeds), cutting.tools, threads=cutting.threads)
    total, cut = np.bincount(face), np.bincount(face[by >= 0], minlength=int(face.max()) + 1)
    rows = np.flatnonzero((by >= 0) & (cut >= WORKED_SHARE * total)[face])
    if not len(rows):
        return ()
    poses = poses_at(points[rows], normals[rows], normals[rows], np.maximum(left[rows], 0.0),
                     feeds[by[rows]].astype(np.int32), moves, cutting.tools, cutting.setup.stock_allowance)
    held = np.zeros(len(rows), np.bool_)
    for n in np.unique(face[rows]):
        mine = poses.only(face[rows[poses.row]] == n)
        held[mine.row[free_poses(mine, cutting, slack)]] = True
    touched = np.bincount(face[rows[held]], minlength=len(total))
    return tuple(n for n in faces if touched[n] >= WORKED_SHARE * total[n])


__all__ = ["hidden_work"]
