"""Tilted planes: places that a program counts in a turned frame, put back into the setup's."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from geometry.mesh import F64
from verify.gcode.block_words import BlockError


def turn(axis: int, angle: float) -> F64:
    """(3, 3): right-handed about X, Y or Z (0, 1, 2) by rad."""
    out = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[i, i] = out[j, j] = math.cos(angle)
    out[j, i] = math.sin(angle)
    out[i, j] = -out[j, i]
    return out


def placed(plane: F64, at: Sequence[float], named: Mapping[str, str]) -> list[float]:
    """X, Y, Z in the setup frame of a move that names some of them in a plane.

    plane : (3, 3) float64, columns are its axes in the setup frame, each of unit length
    at    : mm, or what the program counts in: where the tool stands, setup frame, nan where nobody knows
    named : numbers by letter

    Raises BlockError where one that is not named is not known.
    """
    linear = [float(named[k]) if k in named else math.nan for k in "XYZ"]
    there = plane @ np.where(np.isnan(linear), np.array(at) @ plane, linear)
    if np.isnan(there).any():
        raise BlockError("a move in a tilted plane from a place the program has not stated")
    return [float(v) for v in there]


__all__ = ["placed", "turn"]
