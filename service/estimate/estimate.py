"""An estimate of memory and time as it is handed on. This module imports little, for worker and command line.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

BASE = "program and libraries"
WAITING = "waiting for memory"
"""The stage of a job that waits."""


@dataclass(frozen=True)
class Share:
    """A share of an estimate: what takes it, how many there are, MB and processor seconds."""

    what: str
    count: int
    memory_mb: int
    seconds: float


@dataclass(frozen=True)
class Estimate:
    """What a job is expected to take.

    memory_mb : MB, resident at its peak, with its child processes
    seconds   : of processor, of all its processes
    basis     : the shares that this is the sum of
    """

    memory_mb: int
    seconds: float
    basis: tuple[Share, ...]

    @property
    def largest(self) -> str:
        """What takes the most memory beside the program itself."""
        return max((s for s in self.basis if s.what != BASE), key=lambda s: s.memory_mb, default=self.basis[0]).what

    @property
    def sentence(self) -> str:
        """The estimate in words."""
        return (f"estimate: {self.memory_mb} MB of memory, {self.seconds:g} s of processor; "
                f"the most for the {self.largest}")

    def as_dict(self) -> dict[str, Any]:
        """Plain data, as reports and jobs have it."""
        return {"memory_mb": self.memory_mb, "seconds": self.seconds,
                "basis": [{"what": s.what, "count": s.count, "memory_mb": s.memory_mb, "seconds": s.seconds}
                          for s in self.basis]}


__all__ = ["BASE", "WAITING", "Estimate", "Share"]
