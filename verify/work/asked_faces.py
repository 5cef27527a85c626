"""The faces that a program works on, and stock on normals farther than the proof looks everywhere.

Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.keyed_nearest import KeyedPoints
from geometry.mesh_queries.rays import first_hits
from geometry.sampling import SurfaceSamples
from geometry.tool_body import ToolBody
from verify.blank.blank import stock_bounds, stock_on_normals
from verify.model import ProofSetup
from verify.moves import Moves
from verify.surface.removal import residual_on_normals
from verify.surface.sample_scores import proved_samples

WORKED_SHARE = 0.2  # of the area of a face, along whose normals feed moves remove stock
MAX_ASKED = 400  # samples of a face that are followed to the end of the stock; their share is known to 2 %
MAX_GOOD = 200_000  # good samples among which the nearest one is looked for
LEAST_PASSED, MAX_PASSED = 50, 40_000  # samples of each face, and of all, that are followed tool by tool
ASIDE, ASIDE_ROOM = 2.0, 0.3  # shortest ways, and mm: a good place of the same face so near makes a sample a side
OFF_FACETS = 0.02  # mm from a sample on: facets of its own surface are no obstacle of its ray
BOOL = NDArray[np.bool_]
INT = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Cutting:
    """Part, blank and moves of a proof, for rays that are followed farther than ``prove`` does everywhere.

    tree    : TriangleTree of the part
    tools   : those that ``Moves.tool`` refers to
    threads : the results have the same bytes for any number
    """

    tree: TriangleTree
    setup: ProofSetup
    moves: Moves
    tools: Sequence[ToolBody]
    threads: int = 2

    @property
    def farthest(self) -> float:
        """Mm, at least as long as any way through stock or part."""
        low, high = stock_bounds(self.tree.mesh.bounds, self.setup)
        bounds = self.tree.mesh.bounds
        return float(np.linalg.norm(np.maximum(high, bounds[1]) - np.minimum(low, bounds[0]))) + 1.0

    def way_through_stock(self, points: F64, directions: F64, most: float, start: float) -> tuple[F64, I32]:
        """Length of stock along rays up to where a move has cut it, or up to the outside of the blank.

        points, directions : (n, 3) float64, mm and unit, setup frame; points lie outside of the part or on it
        most  : mm; stock is followed no farther
        start : mm; nearer facets of the part are no obstacle

        Returns
        -------
        length : (n,) float64, mm; 0 where the ray begins outside of the stock, inf where it meets the part first or is
                 not out of the stock after ``most``
        mover  : (n,) int32, index, the move that ended the stock; -1 where none did
        """
        if not len(points):
            return np.zeros(0), np.zeros(0, np.int32)
        stock, wall = self.blank_on_rays(points, directions, most, start)
        initial = np.minimum(stock, wall)
        left, mover = residual_on_normals(points, directions, initial, self.moves, self.tools, threads=self.threads)
        outside = (stock < wall) & (stock < most)
        return np.where((mover >= 0) | outside, np.maximum(left, 0.0), np.inf), mover

    def blank_on_rays(self, points: F64, directions: F64, most: float, start: float) -> tuple[F64, F64]:
        """Stock of the blank on rays, and where they first hit the part.

        points, directions : (n, 3) float64, mm and unit, setup frame; points lie outside of the part or on it
        most  : mm; stock is followed no farther
        start : mm; nearer facets of the part are no obstacle

        Returns
        -------
        stock : (n,) float64, mm, not above ``most``
        wall  : (n,) float64, mm; inf where the ray meets no part
        """
        stock = stock_on_normals(points, directions, self.tree.mesh.bounds, self.setup, most)
        return stock, first_hits(self.tree, points, directions, t_min=start)[0]


@dataclass(frozen=True, eq=False)
class Measured:
    """Samples as a proof has measured them.

    samples  : SurfaceSamples, n of them
    residual : (n,) float64, mm of stock on their normals after all moves, not above ``reach``
    mover    : (n,) int32, index, the move that left it, -1 where none did
    reach    : mm
    error    : mm, largest error of a residual against the mesh
    """

    samples: SurfaceSamples
    residual: F64
    mover: I32
    reach: float
    error: float


@dataclass(frozen=True, eq=False)
class FinishedPlanes:
    """Planes of the part that a run of feed moves finishes.

    run    : (m,) int64, index, run of each move: moves without a rapid between them
    width  : mm, how far from a plane a place counts as in it
    own    : (k,) int64, index, the run that finished each finished sample
    points, normals : (k, 3) float64, mm and unit, of these, frame of the proof
    """

    run: INT
    width: float
    own: INT
    points: F64
    normals: F64

    @classmethod
    def of(cls, samples: SurfaceSamples, residual: F64, mover: I32, cutting: Cutting) -> FinishedPlanes:
        """The planes on which samples are within tolerance.

        samples  : SurfaceSamples, n of them, frame of the proof
        residual : (n,) float64, mm of stock on their normals; mover : (n,) int32, index, as ``worked_faces`` takes them
        """
        setup, run = cutting.setup, np.cumsum(~cutting.moves.feed).astype(np.int64)
        width = max(setup.scallop_height, setup.gouge_tolerance)
        rows = np.flatnonzero((mover >= 0) & proved_samples(residual, setup))
        return cls(run, width, run[mover[rows]], samples.points[rows], samples.normals[rows])

    def holds(self, points: F64, normals: F64, height: F64, mover: I32) -> BOOL:
        """Whether what a move leaves above a place lies in a plane that its run finishes.

        points, normals : (n, 3) float64, mm and unit, samples of the part, frame of the proof
        height : (n,) float64, mm of stock on each normal; mover : (n,) int32, index, -1 where no move left it

        Returns (n,) bool; false where the height is within the width itself.
        """
        out = np.zeros(len(points), np.bool_)
        rows = np.flatnonzero((mover >= 0) & (height > self.width) & np.isfinite(height))
        if not len(rows):
            return out
        ends = points[rows] + height[rows, None] * normals[rows]
        keys, of = _distinct(_plane_keys(self.run[mover[rows]], ends, normals[rows], self.width))
        mine = np.isin(self.own, keys[:, 0])  # of few runs anything is asked
        planes, _ = _distinct(_plane_keys(self.own[mine], self.points[mine], self.normals[mine], self.width))
        finished = frozenset(map(tuple, planes.tolist()))
        known = np.array([any((*k[:4], k[4] + d) in finished for d in (-1, 0, 1)) for k in map(tuple, keys.tolist())])
        out[rows] = known[of]
        return out


def _distinct(rows: INT) -> tuple[INT, INT]:
    """The distinct rows of whole numbers (n, k), and which of them each is, (n,); by one number each, where that is
    exact."""
    low = rows.min(axis=0, initial=0)
    span = (rows.max(axis=0, initial=0) - low + 1).tolist()
    if math.prod(span) >= 2**62:
        distinct, of = np.unique(rows, axis=0, return_inverse=True)
        return distinct, of.reshape(-1)
    number = np.zeros(len(rows), np.int64)
    for column, size in zip((rows - low).T, span, strict=True):
        number = number * size + column
    _, first, of = np.unique(number, return_index=True, return_inverse=True)
    return rows[first], of.reshape(-1)


def _plane_keys(run: INT, points: F64, normals: F64, width: float) -> INT:
    """(n, 5) int64: run, normal in thousandths, and distance of the plane from the origin in widths."""
    away = np.floor(np.einsum("ij,ij->i", points, normals) / width).astype(np.int64)
    return np.column_stack([run, np.round(1000.0 * normals).astype(np.int64), away])


def worked_faces(samples: SurfaceSamples, residual: F64, mover: I32, reach: float, cutting: Cutting) -> tuple[int, ...]:
    """Faces along whose normals feed moves remove stock on a fifth of the area or more, whatever they leave.

    Stock that moves take off on their way over a face while they finish another one does not count: facing the top of a
    plate is no work on the floors of its pockets. Where no face reaches a fifth, all faces that stock is removed from.

    samples  : SurfaceSamples, n of them
    residual : (n,) float64, mm of stock on their normals after all moves, not above ``reach``
    mover    : (n,) int32, index, the move that left it, -1 where none cut the first ``reach`` mm

    Returns face numbers, ascending.

    Notes
    -----
    Where more than ``reach`` stands, the ray is followed to the end of the stock or to the part. At most ``MAX_ASKED``
    samples of a face are: the error of the share is 2 % (one standard deviation).
    """
    planes = FinishedPlanes.of(samples, residual, mover, cutting)
    touched = mover >= 0
    cut = touched & ~planes.holds(samples.points, samples.normals, residual, mover)
    unknown = ~touched & (residual >= reach * (1.0 - 1e-9))
    numbers, place = np.unique(samples.face, return_inverse=True)
    total, sure, more = (np.bincount(place, weights=samples.area * of, minlength=len(numbers))
                         for of in (np.ones(len(cut)), cut, unknown))
    worked = sure >= WORKED_SHARE * total
    open_ = ~worked & (sure + more >= WORKED_SHARE * total)
    rows = [thinned(np.flatnonzero(unknown & (place == k)), MAX_ASKED) for k in np.flatnonzero(open_)]
    if rows:
        chosen = np.concatenate(rows)
        points, normals = samples.points[chosen], samples.normals[chosen]
        left, by = cutting.way_through_stock(points, normals, cutting.farthest, OFF_FACETS)
        counts = (by >= 0) & ~planes.holds(points, normals, left, by)
        ends = np.cumsum([len(r) for r in rows])
        area = np.split(samples.area[chosen], ends[:-1])
        for k, mine, each in zip(np.flatnonzero(open_), np.split(counts, ends[:-1]), area, strict=True):
            share = float(each[mine].sum()) / max(float(each.sum()), 1e-300)
            worked[k] = sure[k] + more[k] * share >= WORKED_SHARE * total[k]
            more[k] *= share
    if not worked.any():
        worked = sure + np.where(open_, more, 0.0) > 0.0
    return tuple(int(n) for n in numbers[worked])


def passed_faces(samples: SurfaceSamples, residual: F64, mover: I32, known: Sequence[int],
                 cutting: Cutting) -> tuple[int, ...]:
    """Faces that a tool before the last one works on, though a later tool takes off all that it leaves there.

    What a tool takes off above a face on its way over another one does not count: where it leaves a plane, and works as
    much, or on a fifth of the area, towards a parallel face that lies higher. So a tool that roughs the top of a plate
    does not work on the floors of its pockets.

    samples  : SurfaceSamples, n of them
    residual : (n,) float64, mm of stock on their normals after all moves; mover : (n,) int32, index, the move that left
               it, -1 for none
    known    : face numbers that are worked on anyway

    Returns face numbers, ascending, without those known.
    """
    stretch = np.cumsum(np.concatenate([[0], np.diff(cutting.moves.tool[cutting.moves.feed]) != 0]))
    numbers, place = np.unique(samples.face, return_inverse=True)
    if stretch[-1] == 0 or len(numbers) == len(known):
        return ()
    share = max(LEAST_PASSED, min(MAX_ASKED, MAX_PASSED // len(numbers)))
    rows = np.concatenate([thinned(np.flatnonzero(place == k), share) for k in range(len(numbers))])
    points, normals, of = samples.points[rows], samples.normals[rows], place[rows]
    # each sample stands for an even part of its face
    weight = (np.bincount(place, weights=samples.area) / np.bincount(of))[of]
    planes, feeds = FinishedPlanes.of(samples, residual, mover, cutting), np.flatnonzero(cutting.moves.feed)
    left = np.minimum(*cutting.blank_on_rays(points, normals, cutting.farthest, OFF_FACETS))
    found, rest = set[int](), ~np.isin(numbers, known)
    for k in range(int(stretch[-1])):
        own = feeds[stretch == k]
        left, by = residual_on_normals(points, normals, left, cutting.moves.only(own), cutting.tools,
                                       threads=cutting.threads)
        cut = by >= 0
        by[cut] = own[by[cut]]
        worked = cut & ~planes.holds(points, normals, left, by)
        enough = np.bincount(of, weights=weight * worked) >= WORKED_SHARE * np.bincount(of, weights=weight)
        if (enough & rest).any():
            worked &= ~_on_the_way(points, normals, left, of, weight, cut, planes.width)
            enough = np.bincount(of, weights=weight * worked) >= WORKED_SHARE * np.bincount(of, weights=weight)
            found.update(numbers[enough & rest].tolist())
    return tuple(sorted(found))


def _on_the_way(points: F64, normals: F64, left: F64, face: INT, weight: F64, cut: BOOL, width: float) -> BOOL:
    """Whether what a tool takes off above a place belongs to a parallel face that lies higher.

    points, normals : (n, 3) float64, mm and unit; left : (n,) float64, mm that the tool leaves on each normal
    face   : (n,) int64, index, from 0; weight : (n,) float64, mm² that each place stands for
    cut    : (n,) bool, places above which the tool takes something off

    Returns (n,) bool.
    """
    out, total, rows = np.zeros(len(points), np.bool_), np.bincount(face, weights=weight), np.flatnonzero(cut)
    ends = points[rows] + left[rows, None] * normals[rows]
    plane = _plane_keys(np.zeros(len(rows), np.int64), ends, normals[rows], width)
    own = np.einsum("ij,ij->i", points[rows], normals[rows])
    keys, group = np.unique(np.column_stack([plane, face[rows]]), axis=0, return_inverse=True)
    group = group.reshape(-1)
    area = np.bincount(group, weights=weight[rows])
    height = np.bincount(group, weights=weight[rows] * own) / area
    at: dict[tuple[int, ...], list[int]] = {}
    for k, key in enumerate(map(tuple, keys.tolist())):
        at.setdefault(key[:5], []).append(k)
    belongs = np.zeros(len(keys), np.bool_)
    for k, key in enumerate(map(tuple, keys.tolist())):
        beside = (b for d in (-1, 0, 1) for b in at.get((*key[:4], key[4] + d), ()))
        belongs[k] = any(height[b] > height[k] + width
                         and area[b] >= min(WORKED_SHARE * total[keys[b, 5]], area[k]) for b in beside)
    out[rows] = belongs[group]
    return out


def distance_aside(samples: SurfaceSamples, good: INT, rows: INT) -> F64:
    """Distance of some samples from the nearest good one of the same face, (r,) float64, mm; inf where there is none.

    good, rows : (g,) and (r,) int64, index; of more than ``MAX_GOOD`` good samples an even share counts
    """
    good, out = thinned(good, MAX_GOOD), np.full(len(rows), np.inf)
    if len(good) and len(rows):
        near = KeyedPoints(samples.face[good].astype(np.int64), samples.points[good])
        of = near.nearest(samples.face[rows].astype(np.int64), samples.points[rows])[:, 0]
        there = of >= 0
        out[there] = np.linalg.norm(samples.points[good[of[there]]] - samples.points[rows[there]], axis=1)
    return out


def thinned(rows: INT, most: int) -> INT:
    """At most ``most`` of ``rows``, evenly; all of them where there are no more.

    rows : (n,) int64, index

    Returns (k,) int64, index.
    """
    if len(rows) <= most:
        return rows
    return rows[np.floor(np.arange(most) * (len(rows) / most)).astype(np.int64)]
