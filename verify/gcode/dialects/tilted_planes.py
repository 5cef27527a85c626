"""Tilted planes: turns coordinates of a tilted plane back into the setup frame."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from geometry.mesh import F64
from verify.gcode.block_words import BlockError


def turn(axis: int, angle: float) -> F64:
    """(3, 3) float64, dimensionless: right-handed rotation in one frame about X, Y or Z (0, 1, 2) by ``angle`` rad."""
    out = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[i, i] = out[j, j] = math.cos(angle)
    out[j, i] = math.sin(angle)
    out[i, j] = -out[j, i]
    return out


def placed(plane: F64, at: Sequence[float], named: Mapping[str, str]) -> list[float]:
    """End of a move in the setup frame whose words are coordinates of a plane.

    plane : (3, 3) float64, dimensionless, columns are its axes in the setup frame, each of unit length
    at    : place of the tool, setup frame, in the unit of the program (mm or inch), nan where unknown
    named : numbers by letter

    Raises BlockError where the coordinate of an absent word is unknown.
    """
    linear = [float(named[k]) if k in named else math.nan for k in "XYZ"]
    there = plane @ np.where(np.isnan(linear), np.array(at) @ plane, linear)
    if np.isnan(there).any():
        raise BlockError("a move in a tilted plane starts at a place that the program has not stated")
    return [float(v) for v in there]


__all__ = ["placed", "turn"]
