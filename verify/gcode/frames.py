"""Programmable frames: shifts, rotations, mirrors and scales between programmed coordinates and the work offset."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.mesh import F64
from verify.gcode.block_words import BlockError
from verify.program.arc_chords import PLANE_AXES

_TINY = 1e-12


@dataclass(frozen=True, eq=False)
class Frame:
    """An affine map from programmed coordinates, mm, to those of the work offset, mm: ``matrix @ place + shift``.

    matrix : (3, 3) float64, dimensionless, of full rank
    shift  : (3,) float64, mm
    """

    matrix: F64
    shift: F64

    def __matmul__(self, inner: Frame) -> Frame:
        """The frame that applies ``inner`` first."""
        return Frame(self.matrix @ inner.matrix, self.matrix @ inner.shift + self.shift)

    def out(self, place: Sequence[float]) -> list[float]:
        """(3,) mm, a programmed place in the work offset; nan where it depends on an unknown coordinate."""
        return [constant + sum([m * place[k] for k, m in terms]) for constant, terms in self._rows]

    def back(self, place: Sequence[float]) -> list[float]:
        """(3,) mm, a place of the work offset in programmed coordinates; nan where that is unknown."""
        return self._inverse.out(place)

    @cached_property
    def _rows(self) -> list[tuple[float, list[tuple[int, float]]]]:
        """By row: the shift, and the columns that count with their factors; an unknown place spoils no other row."""
        return [(constant, [(k, m) for k, m in enumerate(row) if abs(m) > _TINY])
                for row, constant in zip(self.matrix.tolist(), self.shift.tolist(), strict=True)]

    @cached_property
    def _inverse(self) -> Frame:
        inverse: F64 = np.asarray(np.linalg.inv(self.matrix), dtype=np.float64)
        return Frame(inverse, -inverse @ self.shift)

    def scale_in(self, plane: int) -> float:
        """Length of the image of a unit vector of a plane (17, 18 or 19), where all its directions agree.

        Raises
        ------
        BlockError
            They do not agree: a circle becomes an ellipse.
        """
        i, j, _ = PLANE_AXES[plane]
        lengths = np.linalg.norm(self.matrix[:, [i, j]], axis=0)
        if np.ptp(lengths) > 1e-9 or abs(float(self.matrix[:, i] @ self.matrix[:, j])) > 1e-9:
            raise BlockError("an arc, or cutter radius compensation, while the axes have different scales: a circle is "
                             "no circle then")
        return float(lengths[0])


def about(matrix: F64, centre: Sequence[float]) -> Frame:
    """The frame with a given matrix that leaves one place where it is.

    matrix : (3, 3) float64, dimensionless, for programmed coordinates
    centre : (3,) mm, programmed coordinates

    A coordinate of the centre that is unknown (nan) may not count: the matrix must leave it alone.
    """
    free = [abs(matrix[k, k] - 1) < _TINY and np.abs(np.delete(matrix[k], k)).max() < _TINY
            and np.abs(np.delete(matrix[:, k], k)).max() < _TINY for k in range(3)]
    fixed = np.array([0.0 if f else c for f, c in zip(free, centre, strict=True)])
    return Frame(matrix, fixed - matrix @ fixed)


def rotation(plane: int, angle: float, centre: Sequence[float] = (0.0, 0.0, 0.0)) -> Frame:
    """Rotation in a plane.

    plane  : 17, 18 or 19
    angle  : rad, positive from the first to the second axis of the plane
    centre : (3,) mm
    """
    i, j, _ = PLANE_AXES[plane]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = math.cos(angle)
    matrix[j, i] = math.sin(angle)
    matrix[i, j] = -matrix[j, i]
    return about(matrix, centre)


def scaling(factors: Sequence[float], centre: Sequence[float] = (0.0, 0.0, 0.0)) -> Frame:
    """Scales, or mirrors where factors are negative, along X, Y, Z from ``centre``, (3,) mm.

    Raises
    ------
    BlockError
        A factor is 0.
    """
    if min(abs(f) for f in factors) < 1e-9:
        raise BlockError("a scale of 0")
    return about(np.diag(np.array(factors, dtype=np.float64)), centre)


def translation(shift: Sequence[float]) -> Frame:
    """Shift along X, Y, Z by ``shift``, (3,) mm."""
    return Frame(np.eye(3), np.array(shift, dtype=np.float64))


__all__ = ["Frame", "about", "rotation", "scaling", "translation"]
