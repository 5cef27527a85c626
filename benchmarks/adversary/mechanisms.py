"""All mechanisms by name, and those that the proof does not promise yet."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.adversary import good_programs, harm_bodies, harm_planted, harm_reading, harm_surface
from benchmarks.adversary.adversary_case import Case

Mechanism = Callable[[np.random.Generator], Case]

HARMFUL: dict[str, Mechanism] = {**harm_surface.MECHANISMS, **harm_bodies.MECHANISMS, **harm_reading.MECHANISMS,
                                 **harm_planted.MECHANISMS}
GOOD: dict[str, Mechanism] = {**good_programs.MECHANISMS}

NOT_YET = {
    "rapid over face": "the rapid clearance does not hold upward",
    "empty spindle": "a spindle without a tool has no nose",
    "longer tool at top": "where a tool is changed is not known",
    "chip too thick": "chips are not counted in programs of others",
    "deep slot": "bending is not computed in programs of others",
    "surface speed": "cutting speed is not held against a bound",
}
"""Mechanisms of which some cases are still called proved, or refused where they are good, with the reason."""
