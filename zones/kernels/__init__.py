"""Compiled loops of the zones layer."""

import geometry.kernels.cache  # noqa: F401  names the folders of compiled kernels
