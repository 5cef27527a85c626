"""Stock below overhangs and in slots as wide as a mill: whether the tools of a program could have cut it.

No tool has room beside such places, so they are not known from the part alone. Tools are moved on from where the
program had them (``verify.work.own_poses``). Theory: docs/theory/work-done.md.
Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.mesh import F64, I32
from geometry.sampling import SurfaceSamples
from verify.surface.sample_scores import proved_samples
from verify.work.asked_faces import Cutting, Measured, thinned
from verify.work.own_poses import Poses, joined, poses_at, slid_poses
from verify.work.standing_room import Surroundings, free_poses
from verify.work.ways_out import ways_out

MAX_TRIED, LEAST_TRIED, MAX_ALL = 120, 20, 1500  # samples that are tried: of a face, of each of many faces, and of all
SLID_FROM = 2  # finished samples that a tool is slid from to each: the nearest ones, and those of the nearest normal
ALIKE = 20.0  # mm: the distance that counts as much as a normal square to the other
MAX_WAY = 12.0  # mm, longest way out that is looked for
BOOL = NDArray[np.bool_]
INT = NDArray[np.int64]


def touched_on_from(measured: Measured, few: SurfaceSamples, hidden: BOOL, along: F64, mover: I32, fine: BOOL,
                    axes: F64, scallop: float, lift: float, slack: float, cutting: Cutting) -> BOOL:
    """Samples that a tool of the program touches, moved on from where it cut.

    few   : SurfaceSamples, n of them, setup frame
    hidden : (n,) bool, whether something hangs over them
    along : (n,) float64, mm of stock on their normals; mover : (n,) int32, index, the move that left it
    fine  : (n,) bool, whether fine steps left it, as edges finish slopes
    axes  : (k, 3) float64, unit, setup frame, tip to spindle, axes that the program cuts with
    scallop : mm, by which stock may be uneven
    lift  : mm, how far off the surface ways out begin
    slack : mm by which the cutting part may enter the surface, for facets and rounding

    Returns (n,) bool.

    Each sample is tried along its normal, along its shortest way out, and from places of its face that are finished. Of
    more than ``MAX_TRIED`` on a face, or fewer of many faces, an even share is tried; each other one shares the answer
    of the nearest, unless more stands on it.
    """
    out = np.zeros(len(few), np.bool_)
    finished = proved_samples(measured.residual, cutting.setup) & (measured.mover >= 0)
    faces, around = np.unique(few.face), Surroundings.of(cutting)
    most = max(LEAST_TRIED, min(MAX_TRIED, MAX_ALL // max(len(faces), 1)))
    for face in faces:
        rows = np.flatnonzero(few.face == face)
        tried = thinned(rows, most)
        near, answer = few.subset(tried), np.zeros(len(tried), np.bool_)
        good = thinned(np.flatnonzero(finished & (measured.samples.face == face)), most)
        ways = ways_out(near.points, near.normals, axes, lift, MAX_WAY, cutting, np.ones(len(tried), np.bool_))
        poses = joined([_moved_on(near, near.normals, along[tried], mover[tried], cutting),
                        _moved_on(near, ways.direction, ways.length, ways.mover, cutting),
                        *_slid(measured, good, near, cutting)])
        asked = poses.only(~poses.edge | fine[tried[poses.row]])
        answer[asked.row[free_poses(asked, hidden[tried[asked.row]], around, cutting, slack)]] = True
        of = cKDTree(near.points).query(few.points[rows])[1]
        out[rows] = answer[of] & (along[rows] <= along[tried[of]] + scallop)
    return out


def _moved_on(samples: SurfaceSamples, ways: F64, left: F64, mover: I32, cutting: Cutting) -> Poses:
    """Poses at samples, from where the moves left stock on ways out of them."""
    return poses_at(samples.points, samples.normals, ways, left, mover, cutting.moves, cutting.tools,
                    cutting.setup.stock_allowance)


def _slid(measured: Measured, good: INT, near: SurfaceSamples, cutting: Cutting) -> list[Poses]:
    """Poses at samples, slid there from the nearest finished ones of the face, (g,) index."""
    s = measured.samples.subset(good)
    touched = _moved_on(s, s.normals, np.maximum(measured.residual[good], 0.0), measured.mover[good], cutting)
    touched = touched.only(np.unique(touched.row, return_index=True)[1])
    if not len(touched):
        return []
    from_, n = s.subset(touched.row), min(SLID_FROM, len(touched))
    near_by = cKDTree(from_.points).query(near.points, k=n)[1].reshape(len(near), -1)
    alike = cKDTree(np.hstack([from_.points, ALIKE * from_.normals])).query(
        np.hstack([near.points, ALIKE * near.normals]), k=n)[1].reshape(len(near), -1)
    return [slid_poses(near.points, near.normals, touched.only(column), s.points, s.normals, cutting.tools)
            for column in np.hstack([near_by, alike]).T]


__all__ = ["MAX_WAY", "touched_on_from"]
