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
    "pecks paid in air": "way aside in air earns descent",
    "no centre, straight": "what cuts to the centre does not count below the skin",
    "helix in core": "the core of a mill that does not cut to its centre is not known",
    "G92 before G52": "G52 and G92 share a register in every dialect",
    "no path tolerance": "a program that states no path mode is taken to keep its corners",
    "stray early end": "faces that only unread lines cut are not asked",
    "dogleg rapid": "rapids are straight lines unless the setup says otherwise",
    "sense of rotary axes": "table axes count as LinuxCNC counts them",
    "chip too thick": "chips are not counted in programs of others",
    "deep slot": "bending is not computed in programs of others",
    "surface speed": "cutting speed is not held against a bound",
    "spring pass": "good programs: a pass over finished ground is a finding",
    "ways of writing": "good programs: M3 with M8 in a block of Fanuc is a finding",
}
"""Mechanisms of which some cases are still called proved, or refused where they are good, with the reason."""
