"""The lattice of plan positions that reach and contours are computed on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody


def lattice_step(tool: ToolBody) -> float:
    """Spacing of the planning lattice of a tool, mm.

    A free strip as wide as ``PLAY_STEPS`` of these is connected on the lattice whatever its direction: the
    diagonal of a cell. Narrower strips are not planned; ``touchable`` says so.
    """
    return float(np.clip(tool.radius / 10.0, 0.05, 0.15))


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
        """A lattice that covers ``bounds`` (2, >=2) mm and ``margin`` mm around it."""
        x0, y0 = bounds[0, 0] - margin, bounds[0, 1] - margin
        nx = int(math.ceil((bounds[1, 0] + margin - x0) / step)) + 1
        ny = int(math.ceil((bounds[1, 1] + margin - y0) / step)) + 1
        return cls(float(x0), float(y0), float(step), nx, ny)

    @classmethod
    def on_multiples(cls, bounds: F64, margin: float, step: float) -> Lattice:
        """``over``, with nodes at whole multiples of the step: two of these share the nodes of their overlap."""
        lower = np.floor((bounds[0, :2] - margin) / step)
        nx, ny = (np.ceil((bounds[1, :2] + margin) / step) - lower + 1).astype(int).tolist()
        return cls(float(lower[0] * step), float(lower[1] * step), float(step), nx, ny)

    def within(self, other: Lattice) -> tuple[slice, slice] | None:
        """Rows and columns of this lattice in another one of the same multiples; None where they are not all there."""
        j, i = (round((a - b) / self.step) for a, b in ((self.x0, other.x0), (self.y0, other.y0)))
        if i < 0 or j < 0 or i + self.ny > other.ny or j + self.nx > other.nx:
            return None
        return slice(i, i + self.ny), slice(j, j + self.nx)

    def cells(self, xy: F64) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Row and column of the node nearest to each of xy (n, 2) mm, clipped to the lattice."""
        j = np.clip(np.rint((xy[:, 0] - self.x0) / self.step).astype(np.int64), 0, self.nx - 1)
        i = np.clip(np.rint((xy[:, 1] - self.y0) / self.step).astype(np.int64), 0, self.ny - 1)
        return i, j

    def inside(self, xy: F64) -> NDArray[np.bool_]:
        """(n,) bool: which of (n, 2) mm lie within half a step of the lattice."""
        j, i = (xy[:, 0] - self.x0) / self.step, (xy[:, 1] - self.y0) / self.step
        return np.asarray((j >= -0.5) & (j <= self.nx - 0.5) & (i >= -0.5) & (i <= self.ny - 0.5))

    def nodes(self, i: NDArray[np.int64], j: NDArray[np.int64], z: float) -> F64:
        """(n, 3) mm: nodes in rows i and columns j (n,), at height z, mm."""
        return np.column_stack([self.x0 + self.step * j, self.y0 + self.step * i, np.full(len(i), z)])

    def mask(self, xy: F64) -> NDArray[np.bool_]:
        """(ny, nx) bool: nodes that are nearest to one of xy (n, 2) mm."""
        out = np.zeros((self.ny, self.nx), dtype=np.bool_)
        if len(xy):
            out[self.cells(xy)] = True
        return out
