"""The faces that a program works on, and stock on normals farther than the proof looks everywhere.

Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

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

WORKED_SHARE = 0.2  # of the area of a face, along whose normals feed moves remove stock
MAX_ASKED = 400  # samples of a face that are followed to the end of the stock; their share is known to 2 %
MAX_GOOD = 200_000  # good samples among which the nearest one is looked for
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

        points, directions : (n, 3) float64, mm and unit; points lie outside of the part or on it
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
        stock = stock_on_normals(points, directions, self.tree.mesh.bounds, self.setup, most)
        wall, _ = first_hits(self.tree, points, directions, t_min=start)
        initial = np.minimum(stock, wall)
        left, mover = residual_on_normals(points, directions, initial, self.moves, self.tools, threads=self.threads)
        outside = (stock < wall) & (stock < most)
        return np.where((mover >= 0) | outside, np.maximum(left, 0.0), np.inf), mover


def worked_faces(samples: SurfaceSamples, residual: F64, mover: I32, reach: float, cutting: Cutting) -> tuple[int, ...]:
    """Faces along whose normals feed moves remove stock on a fifth of the area or more, whatever they leave.

    Where no face reaches a fifth, all faces that stock is removed from.

    samples  : SurfaceSamples, n of them
    residual : (n,) float64, mm of stock on their normals after all moves, not above ``reach``
    mover    : (n,) int32, index, the move that left it, -1 where none cut the first ``reach`` mm

    Returns face numbers, ascending.

    Notes
    -----
    Where more than ``reach`` stands, the ray is followed to the end of the stock or to the part. At most ``MAX_ASKED``
    samples of a face are: the error of the share is 2 % (one standard deviation).
    """
    cut = mover >= 0
    unknown = ~cut & (residual >= reach * (1.0 - 1e-9))
    numbers, place = np.unique(samples.face, return_inverse=True)
    total, sure, more = (np.bincount(place, weights=samples.area * of, minlength=len(numbers))
                         for of in (np.ones(len(cut)), cut, unknown))
    worked = sure >= WORKED_SHARE * total
    open_ = ~worked & (sure + more >= WORKED_SHARE * total)
    rows = [thinned(np.flatnonzero(unknown & (place == k)), MAX_ASKED) for k in np.flatnonzero(open_)]
    if rows:
        chosen = np.concatenate(rows)
        _, by = cutting.way_through_stock(samples.points[chosen], samples.normals[chosen], cutting.farthest, OFF_FACETS)
        ends = np.cumsum([len(r) for r in rows])
        for k, mine in zip(np.flatnonzero(open_), np.split(by >= 0, ends[:-1]), strict=True):
            worked[k] = sure[k] + more[k] * float(mine.mean()) >= WORKED_SHARE * total[k]
            more[k] *= float(mine.mean())
    if not worked.any():
        worked = sure + np.where(open_, more, 0.0) > 0.0
    return tuple(int(n) for n in numbers[worked])


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
    """At most ``most`` of ``rows``, (n,) int64, index, evenly; all of them where there are no more."""
    if len(rows) <= most:
        return rows
    return rows[np.floor(np.arange(most) * (len(rows) / most)).astype(np.int64)]
