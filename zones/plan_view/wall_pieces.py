"""The section of one wall in short pieces, and the pieces with the other side of the wall behind them."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from geometry.mesh import F64
from geometry.mesh_queries.rays import first_hits
from zones.model import Wall
from zones.plan_view.mesh_slices import Slice, Slicer

# Lengths are multiples of the thickness of the wall.
BACKED_REACH = 3.0
BACKED_DOT = -0.8
PIECE = 0.5
PIECES = 400
MIN_STRETCH = 1.0
CORNER = np.radians(45.0)

FREE, MINE, OTHER = 0, 1, 2


class Pieces:
    """One wall cut at one height: arrays of pieces in walking order, the void on their left.

    owner  : (f,) int64, index of the wall of each face, -1 for a free face
    a, b   : (p, 2) float64, mm, ends
    way    : (p, 2) float64, unit direction
    length : (p,) float64, mm
    kind   : (p,) int, MINE on the wall, OTHER on a connection or another wall, else FREE
    face   : (p,) int, B-rep face numbers
    loop   : (p,) int, label of the loop
    inner  : (p,) bool, the piece continues the one before it, which was cut for its length
    """

    def __init__(self, slicer: Slicer, owner: np.ndarray, index: int, wall: Wall, z: float) -> None:
        self.mesh, self.wall, self.z = slicer.mesh, wall, z
        self.thick = max(wall.thickness, 1e-9)
        self.cut: Slice = slicer.cut(z)
        own = owner[self.cut.face]
        self.seg_kind = np.where(own == index, MINE, np.where(own == -1, FREE, OTHER))
        self._make_pieces()

    def _make_pieces(self) -> None:
        cut = self.cut
        length = np.linalg.norm(cut.end - cut.start, axis=1)
        mine = self.seg_kind == MINE
        pitch = max(PIECE * self.thick, float(length[mine].sum()) / PIECES)
        loops = [w for w in cut.loops if mine[w].any()]
        walk = np.concatenate(loops) if loops else np.zeros(0, np.int64)
        loop = np.repeat(np.arange(len(loops)), [len(w) for w in loops])
        keep = length[walk] > 1e-9 * max(self.thick, 1.0)
        walk, loop = walk[keep], loop[keep]
        count = np.where(mine[walk], np.maximum(np.ceil(length[walk] / pitch), 1), 1).astype(int)
        row = np.repeat(walk, count)
        first = np.cumsum(count) - count
        k = np.arange(len(row)) - np.repeat(first, count)
        n = np.repeat(count, count)
        step = (cut.end - cut.start)[row]
        self.a, self.b = cut.start[row] + step * (k / n)[:, None], cut.start[row] + step * ((k + 1) / n)[:, None]
        self.inner = k > 0
        self.kind, self.face, self.loop = self.seg_kind[row], cut.face[row], np.repeat(loop, count)
        self.length = np.linalg.norm(self.b - self.a, axis=1)
        self.way = (self.b - self.a) / np.maximum(self.length, 1e-30)[:, None]
        self.first, self.count = np.full(len(cut.face), -1), np.ones(len(cut.face), int)
        self.first[walk], self.count[walk] = first, count

    @cached_property
    def hit(self) -> np.ndarray:
        """(p,) int64, index of the piece behind the material; -2 when that is no piece, -1 when unbacked."""
        out = np.full(len(self.a), -1)
        mine = np.flatnonzero(self.kind == MINE)
        inward = np.column_stack([self.way[mine, 1], -self.way[mine, 0], np.zeros(len(mine))])
        middle = np.column_stack([0.5 * (self.a + self.b)[mine], np.full(len(mine), self.z)])
        t, seg = first_hits(self.cut.tree, middle, inward, t_min=1e-4 * self.thick)
        seg = seg.astype(np.int64)
        across = self.cut.end[seg] - self.cut.start[seg]
        size = np.maximum(np.linalg.norm(across, axis=1), 1e-30)
        outward = np.column_stack([-across[:, 1], across[:, 0]]) / size[:, None]
        own = np.column_stack([-self.way[mine, 1], self.way[mine, 0]])
        dot = np.einsum("ij,ij->i", outward, own)
        # Flanks of a connection may lie on a face of the wall; behind them lies the connection.
        backed = (seg >= 0) & (t <= BACKED_REACH * self.thick) & (dot < BACKED_DOT) & (self.seg_kind[seg] != OTHER)
        at = middle[:, :2] + np.where(np.isfinite(t), t, 0.0)[:, None] * inward[:, :2]
        share = np.einsum("ij,ij->i", at - self.cut.start[seg], across) / size**2
        piece = self.first[seg] + np.clip((share * self.count[seg]).astype(int), 0, self.count[seg] - 1)
        out[mine] = np.where(backed, np.where(self.first[seg] >= 0, piece, -2), -1)
        return out

    def stretches(self) -> list[list[int]]:
        """Maximal runs of backed pieces, cut at convex corners, in walking order; a whole loop may be one."""
        out = []
        backed = self.hit != -1
        for loop in np.unique(self.loop[self.kind == MINE]):
            rows = np.flatnonzero(self.loop == loop)
            before = np.roll(rows, 1)
            turn = turn_between(self.way[before], self.way[rows])
            opens = backed[rows] & (~backed[before] | (turn < -CORNER))
            if not opens.any():
                if backed[rows].all():
                    out.append(rows.tolist())
                continue
            rows = np.roll(rows, -int(np.argmax(opens)))
            opens = np.roll(opens, -int(np.argmax(opens)))
            for run in np.split(rows, np.flatnonzero(opens)[1:]):
                held = run[:int(np.argmin(backed[run]))] if not backed[run].all() else run
                if self.length[held].sum() >= MIN_STRETCH * self.thick:
                    out.append(held.tolist())
        return out


def turn_between(a: F64, b: F64) -> F64:
    """Signed angle between unit directions, positive to the left.

    a, b : (n, 2) float64, dimensionless, unit vectors in plan of the access frame
    Returns (n,) float64, rad.
    """
    return np.asarray(np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1)))
