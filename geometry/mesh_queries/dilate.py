"""Dilation of a height field by a disc: what an upright cylinder of that radius would rest on."""

from __future__ import annotations

from enum import Enum

import numba
import numpy as np
from numpy.typing import NDArray

from geometry.errors import GeometryError
from geometry.kernels import dilate as kernels
from geometry.mesh import F64


class Rounding(Enum):
    """Which cells belong to a disc.

    CENTRES : those whose centre is at most the radius away from the centre of the middle cell
    OUTWARD : those with any point at most the radius away from any point of the middle cell (cells are closed
              squares), so that for a field that holds the maximum of each cell the result is nowhere below
              the true dilation
    """

    CENTRES = "centres"
    OUTWARD = "outward"


def disc_chords(radius_cells: float, rounding: Rounding) -> NDArray[np.int64]:
    """(K,) int64: half length in cells of the chord in the row k of a disc; K - 1 is its last row.

    radius_cells : float, radius over cell width, >= 0
    """
    # Cells k rows or columns apart are `gap` apart: between centres, or between the nearest points.
    nearer = 0 if rounding is Rounding.CENTRES else 1
    gap = np.maximum(np.arange(int(radius_cells) + 1 + nearer) - nearer, 0).astype(np.float64)
    return np.floor(np.sqrt(radius_cells**2 - gap**2) + 1e-12).astype(np.int64) + nearer


def dilate_disc(height: F64, radius_cells: float, rounding: Rounding = Rounding.CENTRES) -> F64:
    """Maximum of a height field over a disc round each cell; what lies outside the field does not count.

    height       : (ny, nx) float64, mm; -inf where there is nothing
    radius_cells : float, radius of the disc over the width of a cell, >= 0
    rounding     : Rounding, which cells the disc holds

    Returns
    -------
    (ny, nx) float64, mm
        Exact maxima of the input over the cells of the disc.

    Raises
    ------
    GeometryError
        The field is not (ny, nx) without NaN, or the radius is negative or not finite.
    """
    field = np.ascontiguousarray(height, dtype=np.float64)
    if field.ndim != 2 or np.isnan(field).any():
        raise GeometryError(f"a height field must be (ny, nx) without NaN, got shape {field.shape}",
                            code="bad_array", subjects=("height",))
    if not (np.isfinite(radius_cells) and radius_cells >= 0.0):
        raise GeometryError(f"the radius of a disc must be finite and >= 0, got {radius_cells} cells",
                            code="bad_radius", subjects=("radius_cells",), measured=radius_cells, limit=0.0)
    half = disc_chords(float(radius_cells), rounding)[: max(len(field), 1)]
    out = np.empty_like(field)
    if numba.get_num_threads() == 1:
        kernels.dilate_rows(field, half, out)
    else:
        kernels.dilate_parallel(field, half, out)
    return out
