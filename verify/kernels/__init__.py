"""Compiled loops of the witness; they import numpy, numba and math only."""

import geometry.kernels.cache  # noqa: F401  names the folders of compiled kernels
