"""Compiled loops of the toolpath layer."""

import geometry.kernels.cache  # noqa: F401  keys numba's cache before the first kernel is met
