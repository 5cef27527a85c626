"""Compiled loops of the zones layer."""

import geometry.kernels.cache  # noqa: F401  keys numba's cache before the first kernel is met
