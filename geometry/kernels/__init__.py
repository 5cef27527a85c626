"""Compiled loops. They import numpy, numba and math only and never raise."""

import geometry.kernels.cache  # noqa: F401  keys numba's cache before the first kernel is met
