"""The way down along a ramp, move by move."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def ease(points, lift, slope, rounding):
    """Raise ``lift`` (n,) in place until no move along points (n, 3) loses more of it than its length allows.

    slope    : greatest loss per mm in plan
    rounding : mm, held back of every loss, so that what the program rounds stays within the slope; a move too short
               for any loss is level, and the next ones catch up
    """
    for k in range(1, len(points)):
        run = np.sqrt((points[k, 0] - points[k - 1, 0]) ** 2 + (points[k, 1] - points[k - 1, 1]) ** 2)
        lift[k] = max(lift[k], lift[k - 1] - max(slope * run - rounding, 0.0))
