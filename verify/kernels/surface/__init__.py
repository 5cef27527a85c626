"""Compiled loops about the surface of the part: depths of gouges, what is left near it, flat places; no stock."""

import geometry.kernel_cache.cache  # noqa: F401  names the folders of compiled kernels
