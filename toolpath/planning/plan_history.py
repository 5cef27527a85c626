"""States of a plan between its acts, from which the next plan of the same access continues.

An act of a plan asks the counterexamples about places and zones (``toolpath.counterexamples``). Where the proof found
nothing new at these, the act makes the same workingsteps again. So the next plan begins at the newest kept state before
the first act that asked about something new. It ends with the same bytes as a plan from the beginning.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from toolpath.counterexamples import NONE, Asked, Counterexamples
from toolpath.plan_checkpoint import PlanSnapshot

T = TypeVar("T")
MAX_BYTES = 64_000_000  # of the arrays of the states of an access
MAX_SHARE = 0.25  # of these, that one state may take: else so few would be kept that nothing is gained


@dataclass(frozen=True, eq=False)
class _State:
    """A state, when it was reached, s of a monotonic clock, and the bytes of its arrays."""

    snapshot: PlanSnapshot
    reached: float
    size: int


class PlanHistory:
    """The acts of the last plan of an access, with what each asked, and states between some of them.

    max_bytes : of the arrays of all states together; 0: none is kept
    """

    def __init__(self, max_bytes: int = MAX_BYTES) -> None:
        self._max_bytes, self._found = max_bytes, NONE
        self._asked: list[Asked] = []
        self._states: list[_State] = []
        self._whole = True  # every act since the first is known
        self._begun = time.monotonic()

    def taken(self, found: Counterexamples, use: Callable[[PlanSnapshot], T]) -> T | None:
        """Result of ``use`` for the newest state that a plan with these counterexamples has too; None without one.

        found : counterexamples of the plan to come; the last plan had fewer
        """
        new = found.since(self._found)
        same = next((k for k, act in enumerate(self._asked) if act.meets(new)), len(self._asked))
        states = [s for s in self._states if s.snapshot.acts <= same]
        return use(states[-1].snapshot) if states and self._whole and not new.unheld else None

    def begin(self, found: Counterexamples, acts: int) -> None:
        """Note that a plan begins with so many acts done; what is known of later ones is forgotten."""
        self._found, self._whole = found, acts <= len(self._asked) and (self._whole or acts == 0)
        del self._asked[acts:]
        self._states = [s for s in self._states if s.snapshot.acts <= acts]

    def done(self, asked: Asked, snapshot: Callable[[], PlanSnapshot]) -> None:
        """Note an act that was done.

        asked    : what it asked
        snapshot : the state behind it; its arrays may be those of the plan

        The state of a large blank takes too many bytes and is not kept: the next plan then begins from the beginning.
        """
        self._asked.append(asked)
        if not self._whole or not self._max_bytes:
            return
        now = snapshot()
        size = _bytes_of(now)
        if size > MAX_SHARE * self._max_bytes:
            return
        self._states.append(_State(now.apart(), time.monotonic(), size))
        while len(self._states) > 1 and sum(s.size for s in self._states) > self._max_bytes:
            at = [self._begun, *(s.reached for s in self._states)]
            del self._states[int(np.argmin(np.array(at)[2:] - np.array(at)[:-2]))]  # the others stay spread out


def _bytes_of(snapshot: PlanSnapshot) -> int:
    """Bytes of the arrays that a state does not share with others."""
    layers = [t.layers for t in snapshot.tools if t.layers is not None]
    arrays = [snapshot.stock.top, snapshot.stock.cover, *(s.loose for s in layers),
              *(a for t in snapshot.tools for f in t.finishes for a in (f.residual, f.met))]
    return sum(a.nbytes for a in arrays)


__all__ = ["PlanHistory"]
