"""Compiled loops of the toolpath layer."""

import geometry.kernel_cache.cache  # noqa: F401  names the folders of compiled kernels
