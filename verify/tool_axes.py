"""Tool axes of moves: along Z, tilted, or turning. Axes are float64 unit vectors, dimensionless, in the setup frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from verify.kernels.engaged import carried_frames
from verify.kernels.tables import AxisArrays

STILL = 1e-9  # rad: an axis that turns by less stands still; that is 1e-7 mm at 100 mm

UPRIGHT = float(np.sin(np.radians(3.0)))  # share of the axis in a normal up to which a face is a wall
LEVEL = float(np.cos(np.radians(3.0)))  # share from which it is a floor or a ceiling; slopes lie between


@dataclass(frozen=True, eq=False)
class ToolAxes:
    """Tool axes of moves, as the kernels take them (see ``verify.kernels.pose``).

    axis  : (m, 3) float64, unit, tip to spindle, at the start of each move
    about : (m, 3) float64, unit, perpendicular to ``axis``: the axis turns about it
    angle : (m,) float64, rad, turn over the move; 0 where the axis stands still
    """

    axis: F64
    about: F64
    angle: F64

    @classmethod
    def between(cls, start: F64, end: F64) -> ToolAxes:
        """Axes that turn evenly along great circles [Shoemake1985].

        start, end : (m, 3) float64, unit, setup frame

        Two opposite axes do not determine a circle: any is taken.
        """
        cross = np.cross(start, end)
        sine = np.linalg.norm(cross, axis=1)
        angle = np.arctan2(sine, np.einsum("ij,ij->i", start, end))
        still = angle < STILL
        about = np.divide(cross, sine[:, None], out=np.zeros_like(cross), where=(sine > 1e-300)[:, None])
        loose = still | (sine < 1e-12)
        about[loose] = square_to(start[loose])
        # the kernels need a right angle to the last digit
        about -= np.einsum("ij,ij->i", about, start)[:, None] * start
        about /= np.linalg.norm(about, axis=1)[:, None]
        return cls(np.ascontiguousarray(start), about, np.where(still, 0.0, angle))

    @property
    def middle(self) -> F64:
        """(m, 3) float64, unit, setup frame: axes half way along the great circle [Shoemake1985]."""
        half = 0.5 * self.angle[:, None]
        return np.asarray(np.cos(half) * self.axis + np.sin(half) * np.cross(self.about, self.axis))

    @property
    def swing(self) -> F64:
        """(m, 3) float64, dimensionless, setup frame: axes at the end less those at the start."""
        turn = self.angle[:, None]
        return np.asarray((np.cos(turn) - 1.0) * self.axis + np.sin(turn) * np.cross(self.about, self.axis))

    def arrays(self, bow: float) -> AxisArrays:
        """The axes for kernels. bow : mm, error allowed where the tool turns."""
        return AxisArrays(self.axis, self.about, self.angle, bow)

    def only(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> ToolAxes:
        """The axes where ``chosen``, (m,) bool, is true, or those of its rows, (k,) int64, index."""
        return ToolAxes(self.axis[chosen], self.about[chosen], self.angle[chosen])

    def parted(self, of: NDArray[np.int64], share: F64, count: NDArray[np.int64]) -> ToolAxes:
        """The axes of pieces of moves.

        of    : (k,) int64, index, the move of each piece; count : (k,) int64, dimensionless, pieces of that move
        share : (k,) float64, dimensionless, 0 to 1, where in its move each piece begins
        """
        turn, axis, about = (share * self.angle[of])[:, None], self.axis[of], self.about[of]
        return ToolAxes(np.cos(turn) * axis + np.sin(turn) * np.cross(about, axis), about, self.angle[of] / count)

    @classmethod
    def upright(cls, count: int) -> ToolAxes:
        """``count`` moves of a tool along +Z."""
        return cls(np.tile([0.0, 0.0, 1.0], (count, 1)), np.tile([1.0, 0.0, 0.0], (count, 1)), np.zeros(count))


def square_to(axis: F64) -> F64:
    """Unit vectors perpendicular to axes; X for +Z.

    axis : (m, 3) float64, unit, any frame

    Returns (m, 3) float64, unit, in the same frame.
    """
    seed = np.where(np.abs(axis[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    out = seed - np.einsum("ij,ij->i", seed, axis)[:, None] * axis
    return np.asarray(out / np.linalg.norm(out, axis=1)[:, None])


def sector_frames(axes: ToolAxes | None, count: int) -> tuple[F64, F64]:
    """X and Y perpendicular to the tool axis half way along each of ``count`` moves.

    Returns two (m, 3) float64 arrays, unit, setup frame: setup X and Y for a tool along +Z, and turned about the axis
    as little as possible from move to move.
    """
    axis = np.tile([0.0, 0.0, 1.0], (count, 1)) if axes is None else np.ascontiguousarray(axes.middle)
    x = square_to(axis)
    carried_frames(axis, x)
    return x, np.asarray(np.cross(axis, x))
