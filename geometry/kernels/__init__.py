"""Compiled loops. They import numpy, numba and math only and never raise."""

import geometry.kernels.cache  # noqa: F401  names the folders of compiled kernels
