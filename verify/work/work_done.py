"""Work that was asked and is not done: stock that stands where a tool of the program can touch the part.

A face that is asked must be within tolerance wherever the tools that the program uses can touch it. Theory with the
error bounds: docs/theory/work-done.md. Coordinates are float64, mm, in the frame of the proof.

Notation: h is the scallop height, e the largest error of a residual against the exact part; heights are those over the
stock allowance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32
from geometry.mesh_queries.keyed_nearest import KeyedPoints
from geometry.mesh_queries.nearest import nearest
from geometry.sampling import SurfaceSamples, joined
from geometry.tool_body import ToolBody
from verify.findings import Source
from verify.model import Asked, Finding, FindingKind, ProofSetup, ScoredSamples, WorkDone
from verify.moves import Moves
from verify.surface.sample_scores import proved_samples
from verify.tool_axes import UPRIGHT
from verify.work.asked_faces import (
    ASIDE,
    ASIDE_ROOM,
    OFF_FACETS,
    Cutting,
    Measured,
    distance_aside,
    passed_faces,
    thinned,
    worked_faces,
)
from verify.work.fine_steps import in_fine_steps
from verify.work.hidden_faces import hidden_work
from verify.work.moved_tools import MAX_WAY, Left, touched_on_from
from verify.work.stock_places import StandingStock, stock_findings
from verify.work.unread_work import UnreadWork
from verify.work.ways_out import ROUNDING, WaysOut, ways_out

MAX_TRIED = 12_000  # samples with stock that tools are tried on; the others share the answer of their neighbour
LEAST_TRIED = 50  # of them on each face
MAX_WAYS = 1500  # samples whose shortest way out is looked for; the same for the others
LIFT_SHARE = 0.1  # of h: distance at which a tool on an open face touches a sample
CORNER_SHARE = 0.5  # of h: the same in a corner
SHARED = 0.02  # of the allowance: where its end is nearer to another face by more, that face has it too
MAX_AXES = 24
SAME_AXIS = float(np.radians(0.01))
NOT_IN_PROGRAM, LEFT = "not_in_program", "pass"  # words of the remainder
UNDERCUT, CORNER, SHARP_CORNER = "undercut", "corner", "sharp corner"
BOOL = NDArray[np.bool_]
INT = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class _Limits:
    """Heights over the allowance, mm: h, e, and distances at which tools touch on open faces and in corners."""

    h: float
    error: float
    lift: float
    near: float

    @classmethod
    def of(cls, setup: ProofSetup, error: float, facet: float) -> _Limits:
        """The limits of a proof; error : mm, of a residual against the mesh; facet : mm, as in ``Asked``."""
        h = setup.scallop_height
        lift = max(1.5 * facet, LIFT_SHARE * h)
        return cls(h, error + facet, lift, max(CORNER_SHARE * h, lift))

    @property
    def face(self) -> float:
        """Largest height on an open face."""
        return self.h + self.error

    @property
    def corner(self) -> float:
        """Largest height in a corner."""
        return self.h + self.near + self.error


def work_done(asked: Asked, measured: Measured, cutting: Cutting, cut: BOOL, source: Source,
              unread: UnreadWork | None = None) -> tuple[WorkDone, list[Finding]]:
    """Stock that stands on the faces that were asked, where the tools of the program can touch the part.

    cut    : (m,) bool, whether each move removes stock
    unread : what lines behind the end of the program would do; where no faces are named, theirs are asked too

    Returns WorkDone, and a finding ``stock_left`` for each connected place of a face.

    Notes
    -----
    A sample is a finding in two cases.

    1. A tool touches it with room of h + e to everything else, and more than h + e stands on it. That room keeps away
       from stock that other faces may keep.
    2. A tool without such room comes within h / 2 of it, anywhere or on its own ways, and more than 1.5 h + e stands on
       it, along the normal and along the shortest way out. Of stock that a drill or tap left, the depth that it must
       still go counts instead.
       The sharp edge of a flat end comes near a slope in this sense where moves have left stock that is even to h, as
       the fine steps do that finish a slope.

    Beside a place of the same face that is cut, stock of which a way out is h + e or shorter is none.
    """
    s, setup = measured.samples, cutting.setup
    faces = worked_faces(s, measured.residual, measured.mover, measured.reach, cutting) if asked.faces is None else \
        tuple(sorted(asked.faces & set(np.unique(s.face).tolist())))
    if asked.faces is None and cut.any():
        faces = tuple(sorted({*faces, *passed_faces(s, measured.residual, measured.mover, faces, cutting)}))
    if asked.faces is None and unread is not None:
        faces = tuple(sorted({*faces, *unread.faces}))
    reason = np.full(len(s), "", dtype=object)
    stays = ~proved_samples(measured.residual, setup) & (measured.residual > setup.stock_allowance)
    on_asked = np.isin(s.face, faces)
    reason[stays & ~on_asked] = NOT_IN_PROGRAM
    rows = np.flatnonzero(stays & on_asked)
    if asked.faces is None and not faces and cut.any():
        return WorkDone(s, faces, reason), [_beside(cut, source)]
    if not len(rows):
        return WorkDone(s, faces, reason), []
    tried = _tried(rows, s.face)
    used = cut if cut.any() else cutting.moves.feed
    numbers = {*np.unique(cutting.moves.tool[used]).tolist(), *(unread.tools if unread is not None else ())}
    tools = [cutting.tools[k] for k in sorted(numbers)]
    few = s.subset(tried)
    standing, left, why = _standing(asked, measured, cutting, few, tried, tools, cutting_axes(cutting.moves, used))
    found = np.flatnonzero(left)
    face = _Limits.of(setup, measured.error, asked.facet).face

    def stands(points: F64, normals: F64) -> BOOL:
        length, _ = cutting.way_through_stock(points, normals, cutting.farthest, OFF_FACETS)
        return np.asarray(length - setup.stock_allowance > face)

    findings, told = stock_findings(few.subset(found), standing.subset(found), len(rows) / len(tried), source, setup,
                                    stands)
    why[found] = np.where(told, "", LEFT)
    near = KeyedPoints(few.face.astype(np.int64), few.points)
    reason[rows] = why[near.nearest(s.face[rows].astype(np.int64), s.points[rows])[:, 0]]
    return WorkDone(s, faces, reason), findings


def with_hidden(scored: ScoredSamples, asked: Asked, cutting: Cutting) -> ScoredSamples:
    """The samples, and those of hidden faces that the program works on; no zone answers for them."""
    if asked.sample is None:
        return scored
    faces = hidden_work(asked.hidden, cutting, _Limits.of(cutting.setup, 0.0, asked.facet).near)
    if not faces:
        return scored
    more = asked.sample(np.flatnonzero(np.isin(cutting.tree.mesh.face_ids, faces)))
    return ScoredSamples(joined([scored.samples, more]), np.zeros(len(scored.samples) + len(more), np.int32))


def _beside(cut: BOOL, source: Source) -> Finding:
    """The finding of a program that removes stock, but none that stands on a judged face."""
    m = int(np.flatnonzero(cut)[0])
    return Finding(FindingKind.NOTHING_CUT, source.names[source.program[m]], int(source.line[m]), None, None, None, 0.0,
                   0.0, "the program removes stock, but none that stands on a face of the part: check the program zero "
                   "and the tool")


def cutting_axes(moves: Moves, used: BOOL) -> F64:
    """Axes along which tools cut, the most used first.

    used : (m,) bool, the moves that count

    Returns (k, 3) float64, unit, setup frame, tip to spindle, k at most 24.

    An axis nearer than 0.01 degrees to a more used one is the same. Where there are more than 24, that angle doubles
    until there are not.
    """
    if moves.axes is None or not used.any():
        return np.array([[0.0, 0.0, 1.0]])
    size = np.linalg.norm(moves.end[used] - moves.start[used], axis=1) + 1e-9
    axes, place = np.unique(np.round(moves.axes.only(used).middle, 6) + 0.0, axis=0, return_inverse=True)
    weight = np.bincount(place.reshape(-1), weights=size, minlength=len(axes))
    axes = axes[np.lexsort((np.arange(len(axes)), -weight))]
    axes = axes / np.linalg.norm(axes, axis=1)[:, None]
    angle = SAME_AXIS
    while len(kept := _apart(axes, angle)) > MAX_AXES:
        angle *= 2.0
    return np.asarray(axes[kept])


def _apart(axes: F64, angle: float) -> list[int]:
    """The first of (k, 3) axes, and each further one that is ``angle`` rad from all chosen; more than 24 end it."""
    left, kept = np.arange(len(axes)), list[int]()
    while len(left) and len(kept) <= MAX_AXES:
        kept.append(int(left[0]))
        left = left[axes[left] @ axes[left[0]] < np.cos(angle)]
    return kept


def _tried(rows: INT, face: I32) -> INT:
    """Samples that tools are tried on, ascending: all of ``rows``, or an even share of those on each face."""
    if len(rows) <= MAX_TRIED:
        return rows
    share, parts = MAX_TRIED / len(rows), [rows[face[rows] == n] for n in np.unique(face[rows])]
    return np.sort(np.concatenate([thinned(p, max(int(share * len(p)), min(len(p), LEAST_TRIED))) for p in parts]))


def _standing(asked: Asked, measured: Measured, cutting: Cutting, few: SurfaceSamples, tried: INT,
              tools: Sequence[ToolBody], axes: F64) -> tuple[StandingStock, BOOL, NDArray[np.object_]]:
    """Stock on the tried samples, which of them are findings, and why the others are none."""
    limits = _Limits.of(cutting.setup, measured.error, asked.facet)
    along, mover = measured.residual[tried].copy(), measured.mover[tried].copy()
    far = np.flatnonzero(along >= measured.reach * (1.0 - 1e-9))
    along[far], mover[far] = cutting.way_through_stock(few.points[far], few.normals[far], cutting.farthest, OFF_FACETS)
    height = along - cutting.setup.stock_allowance
    high = np.flatnonzero((height > limits.face) & ~_shared(few, cutting, limits.error))
    left, why = np.zeros(len(tried), np.bool_), np.full(len(tried), LEFT, dtype=object)
    by, face = np.concatenate([measured.mover, mover]), np.concatenate([measured.samples.face, few.face])
    cutter = np.where(by >= 0, cutting.moves.tool[by], -1)
    own = {t.id: np.unique(face[cutter == k]) for k, t in enumerate(cutting.tools) if t in tools and t.named}

    def reached(rows: INT, lift: float, room: float) -> BOOL:
        return _reached(asked, few.subset(rows), tools, axes, own, lift, room)

    left[high] = reached(high, limits.lift, limits.face)
    tight = high[~left[high]]
    touched = tight[reached(tight, limits.near, 0.0)]
    beyond = np.setdiff1d(tight, touched)
    fine = np.zeros(len(tried), np.bool_)
    fine[beyond] = in_fine_steps(few, height, mover, beyond, limits.h + 2.0 * limits.error, measured, cutting)
    by_ways = asked.touch.on_ways(few.subset(beyond), tools, axes, limits.near, fine[beyond])
    touched = np.union1d(touched, beyond[by_ways])
    stepped = np.setdiff1d(beyond[fine[beyond]], touched)
    touched = np.union1d(touched, stepped[asked.touch.edges(few.subset(stepped), tools, axes, limits.near)])
    beyond = np.setdiff1d(beyond, touched)
    why[beyond] = asked.touch.reasons(few.subset(beyond), tools, axes)
    tight_for = (UNDERCUT, CORNER, SHARP_CORNER) if cutting.moves.axes is not None else (UNDERCUT, CORNER)
    below = beyond[np.isin(why[beyond], tight_for) & (height[beyond] > limits.corner)]
    stood = Left(few.subset(below), why[below] == UNDERCUT, along[below], mover[below], fine[below])
    below = below[touched_on_from(measured, stood, axes, limits.h, limits.lift, limits.near, limits.face, cutting)]
    touched = np.union1d(touched, below)
    deep = _missing_depths(few, touched, mover, axes, limits.lift, cutting)
    corner = np.zeros(len(tried), np.bool_)
    corner[touched[np.where(deep.found, deep.length, height[touched]) > limits.corner]] = True
    left |= corner
    rows, aside = _sides(measured, few, tried, height, np.flatnonzero(left), corner, cutting.setup)
    ways = _ways(few, rows, np.isin(rows, below), axes, cutting.setup.stock_allowance + limits.h, cutting)
    way, drilled = ways.length, np.isin(rows, touched[deep.found])
    nearer = (way < height[rows]) & (aside <= ASIDE * way + ASIDE_ROOM)
    left[rows[~drilled & ((nearer & (way <= limits.face)) | (corner[rows] & (way <= limits.corner)))]] = False
    direction = few.normals.copy()
    moved = (ways.mover >= 0) & (nearer | (mover[rows] < 0))
    mover[rows[moved]] = ways.mover[moved]
    height[rows[nearer]], direction[rows[nearer]] = way[nearer], ways.direction[nearer]
    rows = touched[deep.found]
    height[rows], mover[rows], direction[rows] = (a[deep.found] for a in (deep.length, deep.mover, deep.direction))
    direction -= np.einsum("ij,ij->i", direction, few.normals)[:, None] * few.normals
    return StandingStock(np.where(np.isfinite(height), height, MAX_WAY), mover, direction), left, why


def _shared(few: SurfaceSamples, cutting: Cutting, error: float) -> BOOL:
    """Samples in a corner over which the allowances of two faces meet, (n,) bool; error : mm, of a residual.

    The end of the allowance over such a place is nearer to the other face than the allowance is thick. What stands
    there belongs to that face, too, and its places beside the corner tell how high it is.
    """
    allowance = cutting.setup.stock_allowance
    if allowance <= 0.0 or not len(few):
        return np.zeros(len(few), np.bool_)
    ends = few.points + allowance * few.normals
    return np.asarray(nearest(cutting.tree, ends)[0] < allowance - max(SHARED * allowance, 2.0 * error))


@dataclass(frozen=True, eq=False)
class _MissingDepths:
    """How much deeper a drill or tap must go, at n samples, where that is known.

    found  : (n,) bool
    length : (n,) float64, mm over the allowance
    direction : (n, 3) float64, unit, setup frame: its axis along walls, where the stock ends at one height; the normal
              elsewhere, as the point of the tool leaves stock of one depth along it
    mover  : (n,) int32, index, the move that is too short
    """

    found: BOOL
    length: F64
    direction: F64
    mover: I32


def _missing_depths(few: SurfaceSamples, rows: INT, mover: I32, axes: F64, lift: float,
                    cutting: Cutting) -> _MissingDepths:
    """Depths that drills and taps miss at some samples, (r,) int64, index, which tools touch.

    mover : (n,) int32, index, of all samples: the move that left the stock on the normal; axes : (k, 3), unit, of tools
    lift  : mm, how far off the surface the ways begin, against the facets of the hole

    Such a tool takes stock off along its axis only, however near its hole is to the sample. It counts where it left
    the stock on the normal too, or where no move did, or where the sample is as far from its axis as it is wide: a tap
    or reamer in the hole of another drill.
    """
    moves, normals, by = cutting.moves, few.normals[rows], mover[rows]
    axis = np.tile(axes[0], (len(rows), 1))
    if moves.axes is not None:
        axis[by >= 0] = moves.axes.only(by[by >= 0].astype(np.int64)).middle
    alone = np.array([t.along_axis_only for t in cutting.tools], np.bool_)
    if not len(rows) or not alone.any():
        return _MissingDepths(np.zeros(len(rows), np.bool_), np.zeros(len(rows)), axis, by)
    allowance = cutting.setup.stock_allowance
    start = few.points[rows] + (allowance + lift) * normals
    length, end = cutting.way_through_stock(start, axis, cutting.farthest, ROUNDING)
    tool, before = moves.tool[end], np.where(by >= 0, moves.tool[by], -1)
    radius = np.array([t.radius for t in cutting.tools])[tool]
    off = np.abs(np.linalg.norm(np.cross(few.points[rows] - moves.end[end], axis), axis=1) - radius)
    own = (before == tool) | (by < 0) | (off <= allowance + cutting.setup.scallop_height)
    # what the start off the surface takes from the way, up to the cone of the tool
    up = np.einsum("ij,ij->i", normals, axis)
    slope = np.array([t.cone_height / t.corner_width if t.cone_height > 0.0 else 0.0 for t in cutting.tools])[tool]
    length = length + lift * (up + slope * np.sqrt(np.clip(1.0 - up * up, 0.0, 1.0)))
    way = np.where((np.abs(up) > UPRIGHT)[:, None], normals, axis)
    return _MissingDepths(np.isfinite(length) & (end >= 0) & alone[tool] & own, length, way, end)


def _reached(asked: Asked, few: SurfaceSamples, tools: Sequence[ToolBody], axes: F64,
             own: Mapping[str, NDArray[np.int32]], lift: float, room: float) -> BOOL:
    """Samples that tools touch.

    own : by tool id, faces that a drill, tap, chamfer or thread mill has cut; it touches no other, as it does one kind
          of work
    """
    out = asked.touch.reaches(few, [t for t in tools if not t.named], axes, lift, room)
    for tool in tools:
        rows = np.flatnonzero(~out & np.isin(few.face, own.get(tool.id, ())))
        if len(rows):
            out[rows] = asked.touch.reaches(few.subset(rows), [tool], axes, lift, room)
    return out


def _sides(measured: Measured, few: SurfaceSamples, tried: INT, height: F64, rows: INT, corner: BOOL,
           setup: ProofSetup) -> tuple[INT, F64]:
    """Those of ``rows`` whose way out counts, (r,) index, and mm from each to a place of its face that is cut, (r,).

    They stand in corners, or their normal does not lead out of the stock, or they stand at the side of a place: stock
    that a cut passes along the face is as high as the way out to that cut, not as the way across it.
    """
    s = measured.samples
    good = np.flatnonzero(proved_samples(measured.residual, setup) & np.isin(s.face, np.unique(few.face[rows])))
    aside = distance_aside(s, good, tried[rows])
    blocked = ~np.isfinite(height[rows])
    wanted = corner[rows] | blocked | (aside <= ASIDE * np.minimum(height[rows], MAX_WAY) + ASIDE_ROOM)
    return rows[wanted], np.where(blocked, 0.0, aside)[wanted]


def _ways(few: SurfaceSamples, rows: INT, below: BOOL, axes: F64, lift: float, cutting: Cutting) -> WaysOut:
    """Shortest ways out of the stock on some samples, (r,) index; axes : (k, 3) float64, unit; lift : mm.

    below : (r,) bool, samples to which a tool comes below an overhang

    Of more than ``MAX_WAYS`` samples an even share is followed; each other one gets the way of the nearest of its face,
    to the same top: the plane square to that way at its end.
    """
    chosen = thinned(rows, MAX_WAYS)
    ways = ways_out(few.points[chosen], few.normals[chosen], axes, lift, MAX_WAY, cutting, below[np.isin(rows, chosen)])
    if len(chosen) == len(rows):
        return ways
    near = KeyedPoints(few.face[chosen].astype(np.int64), few.points[chosen])
    of = near.nearest(few.face[rows].astype(np.int64), few.points[rows])[:, 0]
    none, direction = of < 0, ways.direction[of]
    nearer = np.einsum("ij,ij->i", direction, few.points[rows] - few.points[chosen][of])
    return WaysOut(np.where(none, np.inf, np.maximum(ways.length[of] - nearer, 0.0)), direction,
                   np.where(none, -1, ways.mover[of]).astype(np.int32))
