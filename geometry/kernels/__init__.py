"""Compiled loops. They import numpy, numba and math only and never raise."""

import geometry.kernel_cache.cache  # noqa: F401  names the folders of compiled kernels
