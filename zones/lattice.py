"""The lattice of plan positions for reach and contours."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from zones.kernels.distance_transform import nearest_blocked
from zones.kernels.lattice import LatticeFrame


def lattice_step(tool: ToolBody) -> float:
    """Spacing of the planning lattice of a tool, mm.

    A free strip ``PLAY_STEPS`` wide (the diagonal of a cell) is connected on the lattice in any direction. Narrower
    strips are not planned; see ``touchable``.
    """
    return float(np.clip(tool.radius / 10.0, 0.05, 0.15))


def blocked_beside(free: NDArray[np.bool_], step: float) -> tuple[F64, NDArray[np.int32]]:
    """Distance of each node from the nearest one that is not free, and which that is.

    free : (ny, nx) bool, not all of them free
    step : mm, spacing of the nodes

    Returns (ny, nx) float64, mm, and (2, ny, nx) int32, rows and columns; of several at one distance any.
    """
    far, near = np.empty(free.shape), np.empty((2, *free.shape), np.int32)
    nearest_blocked(np.ascontiguousarray(free), step, far, near)
    return far, near


@dataclass(frozen=True)
class Lattice:
    """A square grid over the plan view; node (i, j) is at (x0 + j*step, y0 + i*step), mm."""

    x0: float
    y0: float
    step: float
    nx: int
    ny: int

    @classmethod
    def over(cls, bounds: F64, margin: float, step: float) -> Lattice:
        """A lattice that covers bounds with a margin around them, mm.

        bounds : (2, 2) float64 or (2, 3), mm, access frame, least and greatest corner
        """
        x0, y0 = bounds[0, 0] - margin, bounds[0, 1] - margin
        nx = int(math.ceil((bounds[1, 0] + margin - x0) / step)) + 1
        ny = int(math.ceil((bounds[1, 1] + margin - y0) / step)) + 1
        return cls(float(x0), float(y0), float(step), nx, ny)

    @classmethod
    def on_multiples(cls, bounds: F64, margin: float, step: float) -> Lattice:
        """``over`` with nodes at whole multiples of the step; two such lattices share the nodes of their overlap.

        bounds : (2, 2) float64 or (2, 3), mm, access frame, least and greatest corner
        """
        lower = np.floor((bounds[0, :2] - margin) / step)
        nx, ny = (np.ceil((bounds[1, :2] + margin) / step) - lower + 1).astype(int).tolist()
        return cls(float(lower[0] * step), float(lower[1] * step), float(step), nx, ny)

    @property
    def frame(self) -> LatticeFrame:
        """Places of the nodes, for kernels."""
        return LatticeFrame(self.x0, self.y0, self.step)

    def within(self, other: Lattice) -> tuple[slice, slice] | None:
        """Rows and columns of this lattice in another one of the same multiples; None where some are missing there."""
        j, i = (round((a - b) / self.step) for a, b in ((self.x0, other.x0), (self.y0, other.y0)))
        if i < 0 or j < 0 or i + self.ny > other.ny or j + self.nx > other.nx:
            return None
        return slice(i, i + self.ny), slice(j, j + self.nx)

    def cells(self, xy: F64) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Row and column of the nearest node, both (n,) int64, index, clipped to the lattice.

        xy : (n, 2) float64, mm, in the access frame, z ignored
        """
        j = np.clip(np.rint((xy[:, 0] - self.x0) / self.step).astype(np.int64), 0, self.nx - 1)
        i = np.clip(np.rint((xy[:, 1] - self.y0) / self.step).astype(np.int64), 0, self.ny - 1)
        return i, j

    def inside(self, xy: F64) -> NDArray[np.bool_]:
        """(n,) bool: places within half a step of the lattice. xy : (n, 2) float64, mm, access frame."""
        j, i = (xy[:, 0] - self.x0) / self.step, (xy[:, 1] - self.y0) / self.step
        return np.asarray((j >= -0.5) & (j <= self.nx - 0.5) & (i >= -0.5) & (i <= self.ny - 0.5))

    def nodes(self, i: NDArray[np.int64], j: NDArray[np.int64], z: float) -> F64:
        """Nodes at height z, (n, 3) float64, mm, access frame. i, j : (n,) int64, index of row and column."""
        return np.column_stack([self.x0 + self.step * j, self.y0 + self.step * i, np.full(len(i), z)])

    def mask(self, xy: F64) -> NDArray[np.bool_]:
        """(ny, nx) bool: nodes that are nearest to one of the places. xy : (n, 2) float64, mm, access frame."""
        out = np.zeros((self.ny, self.nx), dtype=np.bool_)
        if len(xy):
            out[self.cells(xy)] = True
        return out
