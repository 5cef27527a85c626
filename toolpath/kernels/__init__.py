"""Compiled loops of the toolpath layer."""

import geometry.kernels.cache  # noqa: F401  names the folders of compiled kernels
