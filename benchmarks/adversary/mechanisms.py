"""All mechanisms by name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.adversary import harm_bodies, harm_surface
from benchmarks.adversary.adversary_case import Case

Mechanism = Callable[[np.random.Generator], Case]

HARMFUL: dict[str, Mechanism] = {**harm_surface.MECHANISMS, **harm_bodies.MECHANISMS}
GOOD: dict[str, Mechanism] = {}
