"""Compiled loops of the witness; they import numpy, numba and math only."""

import geometry.kernels.cache  # noqa: F401  keys numba's cache before the first kernel is met
