"""Compiled loops of the witness; they import numpy, numba and math only."""

import geometry.kernel_cache.cache  # noqa: F401  names the folders of compiled kernels
