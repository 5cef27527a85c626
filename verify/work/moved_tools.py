"""Stock below overhangs and in slots as wide as a mill: whether the tools of a program could have cut it.

No tool has room beside such places, so they are not known from the part alone. Tools are moved on from where the
program had them (``verify.work.own_poses``). Theory: docs/theory/work-done.md.
Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.mesh import F64, I32
from geometry.sampling import SurfaceSamples
from verify.surface.sample_scores import proved_samples
from verify.work.asked_faces import Cutting, Measured, thinned
from verify.work.own_poses import UPRIGHT_TOOL, Poses, joined, poses_at, slid_poses
from verify.work.standing_room import Surroundings, free_poses, moved_aside
from verify.work.ways_out import ways_out

MAX_TRIED, LEAST_TRIED, MAX_ALL = 120, 20, 1500  # samples that are tried: of a group, of each of many, and of all
BORDER = 0.4  # mm from a finished place of the same face: there the program stopped
FARTHER = 0.002  # mm: so much farther from it, or higher, a sample there may be than the one whose answer it shares
CUSPS = 3.0  # scallop heights: places with less stock count as finished where few of a face are within tolerance
ENOUGH_FINISHED = 0.05  # of a face
SLID_FROM = 2  # finished samples that a tool is slid from to each: the nearest ones, and those of the nearest normal
ASIDE, MAX_ASIDE = 3, 2.0  # poses of each sample that are moved aside, and mm that these are from the program's
ALIKE = 20.0  # mm: the distance that counts as much as a normal square to the other
MAX_WAY = 12.0  # mm, longest way out that is looked for
BOOL = NDArray[np.bool_]
INT = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Left:
    """Stock on n samples that tools do not reach in the usual ways.

    samples : SurfaceSamples, setup frame
    hidden  : (n,) bool, whether something hangs over them
    along   : (n,) float64, mm of stock on their normals; mover : (n,) int32, index, the move that left it
    fine    : (n,) bool, whether fine steps left it, as edges finish slopes
    """

    samples: SurfaceSamples
    hidden: BOOL
    along: F64
    mover: I32
    fine: BOOL

    def only(self, rows: INT) -> Left:
        """Those of some rows, (r,) int64, index."""
        return Left(self.samples.subset(rows), self.hidden[rows], self.along[rows], self.mover[rows], self.fine[rows])


def touched_on_from(measured: Measured, left: Left, axes: F64, scallop: float, lift: float, slack: float, room: float,
                    cutting: Cutting) -> BOOL:
    """Samples that a tool of the program touches, moved on from where it cut.

    left  : Left, on n samples
    axes  : (k, 3) float64, unit, setup frame, tip to spindle, axes that the program cuts with
    scallop : mm, by which stock may be uneven
    lift  : mm, how far off the surface ways out begin
    slack : mm by which the cutting part may enter the surface, for facets and rounding
    room  : mm that it keeps from all other places where it is moved aside

    Returns (n,) bool.

    Each sample is tried along its normal, along its shortest way out, and from places of its face that are finished.
    Those within ``BORDER`` of such a place, where the program stopped, are a group of their own on each face. Of more
    than ``MAX_TRIED`` in a group, twice that there, or fewer of many faces, an even share is tried. Each other one
    shares the answer of the nearest in its group, unless more stands on it; at the border, where less reaches it, also
    unless it is farther from what is finished.
    """
    face, points = left.samples.face, left.samples.points
    out, away = np.zeros(len(face), np.bool_), np.full(len(face), np.inf)
    finished = proved_samples(measured.residual, cutting.setup) & (measured.mover >= 0)
    cusps = (measured.residual <= cutting.setup.stock_allowance + CUSPS * scallop) & (measured.mover >= 0)
    faces, around = np.unique(face), Surroundings.of(cutting)
    upright = np.ones(len(face), np.bool_)
    if cutting.moves.axes is not None:  # of leaning tools a border is as uncertain as their height over the floor
        upright[:] = left.mover >= 0
        upright[upright] = cutting.moves.axes.only(left.mover[upright].astype(np.int64)).middle[:, 2] >= UPRIGHT_TOOL
    most = max(LEAST_TRIED, min(MAX_TRIED, MAX_ALL // max(len(faces), 1)))
    for n in faces:
        rows, mine = np.flatnonzero(face == n), measured.samples.face == n
        good = np.flatnonzero(finished & mine)
        if len(good) < ENOUGH_FINISHED * mine.sum():
            good = np.flatnonzero(cusps & mine)
        if len(good):
            away[rows] = cKDTree(measured.samples.points[good]).query(points[rows])[0]
        border = (away[rows] <= BORDER) & upright[rows]
        for own, at_border in ((rows[border], True), (rows[~border], False)):
            if len(own):
                tried = thinned(own, 2 * most if at_border else most)
                answer = _tried(measured, thinned(good, most), left.only(tried), axes, (lift, slack, room), around,
                                cutting)
                of = cKDTree(points[tried]).query(points[own])[1]
                like = left.along[own] <= left.along[tried[of]] + (FARTHER if at_border else scallop)
                if at_border:
                    like &= away[own] <= away[tried[of]] + FARTHER
                out[own] = answer[of] & like
    return out


def _tried(measured: Measured, good: INT, left: Left, axes: F64, lengths: tuple[float, float, float],
           around: Surroundings, cutting: Cutting) -> BOOL:
    """``touched_on_from`` for n samples of one face.

    good    : (g,) int64, index, finished samples of it
    lengths : mm, lift, slack and room
    """
    lift, slack, room = lengths
    near, answer = left.samples, np.zeros(len(left.samples), np.bool_)
    ways = ways_out(near.points, near.normals, axes, lift, MAX_WAY, cutting, np.ones(len(near), np.bool_))
    poses = joined([_moved_on(near, near.normals, left.along, left.mover, cutting),
                    _moved_on(near, ways.direction, ways.length, ways.mover, cutting),
                    *_slid(measured, good, near, cutting)])
    asked = poses.only(~poses.edge | left.fine[poses.row])
    free = free_poses(asked, left.hidden[asked.row], around, cutting, slack)
    answer[asked.row[free]] = True
    asked = asked.only(_nearest(asked, ~free & ~answer[asked.row] & ~left.hidden[asked.row]))
    answer[asked.row[moved_aside(asked, near.points[asked.row], near.normals[asked.row], around, cutting, room)]] = True
    return answer


def _nearest(poses: Poses, may: BOOL) -> INT:
    """Of poses that may be moved aside, (n,) bool, the ``ASIDE`` of each place that are nearest to the program's, (k,)
    index. A leaning tool is none of them: its end is as near to a floor as it stands."""
    far = np.linalg.norm(poses.shift, axis=1)
    rows = np.flatnonzero(may & ~poses.turned & (far <= MAX_ASIDE) & (poses.axes[:, 2] >= UPRIGHT_TOOL))
    rows = rows[np.lexsort((far[rows], poses.row[rows]))]
    _, first, count = np.unique(poses.row[rows], return_index=True, return_counts=True)
    return rows[np.arange(len(rows)) - np.repeat(first, count) < ASIDE]


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


__all__ = ["MAX_WAY", "Left", "touched_on_from"]
