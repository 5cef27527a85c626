"""Checks of array arguments, shared by the wrappers above the kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from geometry.errors import GeometryError
from geometry.mesh import F64


def finite_points(values: ArrayLike, width: int, name: str) -> F64:
    """Points in the form that every kernel takes.

    values : (n, width) float64 or what numpy makes it of, mm or dimensionless; nothing at all counts as n = 0
    width  : int, columns
    name   : str, the caller's name for them

    Returns
    -------
    (n, width) float64, mm or dimensionless as given, C-contiguous

    Raises
    ------
    GeometryError
        Code 'bad_array': another shape, no numbers, or a row that is not finite. The subject is ``name`` with the row.
    """
    try:
        points = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise GeometryError(f"{name} must be numbers of shape (n, {width}): {error}", code="bad_array",
                            subjects=(name,)) from error
    if points.shape == (0,):
        return points.reshape(0, width)
    if points.ndim != 2 or points.shape[1] != width:
        raise GeometryError(f"{name} must have shape (n, {width}), got {points.shape}", code="bad_array",
                            subjects=(name,))
    if not np.isfinite(points).all():
        row = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise GeometryError(f"{name}[{row}] is not finite", code="bad_array", subjects=(f"{name}[{row}]",))
    return points
