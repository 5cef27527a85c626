"""All mechanisms by name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.adversary import good_programs, harm_bodies, harm_drills, harm_planted, harm_reading, harm_surface
from benchmarks.adversary.adversary_case import Case

Mechanism = Callable[[np.random.Generator], Case]

HARMFUL: dict[str, Mechanism] = {**harm_surface.MECHANISMS, **harm_bodies.MECHANISMS, **harm_reading.MECHANISMS,
                                 **harm_planted.MECHANISMS, **harm_drills.MECHANISMS}
GOOD: dict[str, Mechanism] = {**good_programs.MECHANISMS}
