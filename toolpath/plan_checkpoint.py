"""A plan under way: what of it the acts that follow need, as plain values and arrays.

A plan is a row of acts, each the layers of a tool in a band, the finish of a zone in a band, or one more go at a zone.
Between two of them all there is to know is here, and what can be laid out anew from the inputs of the plan is not:
lattices, lines of passes, areas of layers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from toolpath.stock.stock_map import StockSnapshot
from toolpath.workingsteps import Workingstep

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class PackedLines:
    """Lines one behind the other: points (n, 3) float64, mm, and how many each has, (k,) int64."""

    points: F64
    counts: NDArray[np.int64]

    @classmethod
    def of(cls, lines: Sequence[F64]) -> PackedLines:
        """Lines (n, 3), mm, joined."""
        return cls(np.concatenate([np.zeros((0, 3)), *lines]), np.array([len(line) for line in lines], np.int64))

    def lines(self) -> list[F64]:
        """The lines that were joined."""
        return np.split(self.points, np.cumsum(self.counts)[:-1]) if len(self.counts) else []


@dataclass(frozen=True, eq=False)
class FinishSnapshot:
    """A ``Finish``: residual (n,) mm and met (n,) bool at its checks, and of its strategy all but the lines."""

    zone: str
    residual: F64
    met: NDArray[np.bool_]
    layers: str | None
    step: str | None
    settled: bool
    begun_with: str
    passes: int
    strategy: str
    side_step: float
    ordered: bool
    rejected: tuple[dict[str, object], ...]


@dataclass(frozen=True, eq=False)
class LayersSnapshot:
    """The layers of a tool: how high stock stood when they were laid out, what they have come to, mm, and how many
    are left."""

    top: float
    swept: float
    above: float
    left: int


@dataclass(frozen=True, eq=False)
class ToolSnapshot:
    """What a tool has walked and cut; its layers and the ids of their workingsteps; its zones that have been begun."""

    walked: PackedLines
    depths: PackedLines
    layers: LayersSnapshot | None
    layered: tuple[str, ...]
    finishes: tuple[FinishSnapshot, ...]


@dataclass(frozen=True, eq=False)
class PlanSnapshot:
    """A plan after so many acts."""

    acts: int
    steps: tuple[Workingstep, ...]
    stock: StockSnapshot
    tools: tuple[ToolSnapshot, ...]


class CheckpointKeeper:
    """Who is told of a plan under way, and may know it from an attempt before; this one keeps nothing."""

    def taken(self, use: Callable[[PlanSnapshot], T]) -> T | None:
        """What ``use`` makes of the plan that is kept; None where there is none, or one that it makes nothing of.

        ``use`` raises AttributeError, IndexError, KeyError, TypeError or ValueError then, and has changed nothing.
        """
        del use
        return None

    def done(self, now: Callable[[], PlanSnapshot]) -> None:
        """An act is over; ``now`` is asked where this is worth keeping."""


NOTHING = CheckpointKeeper()

__all__ = ["NOTHING", "FinishSnapshot", "CheckpointKeeper", "LayersSnapshot", "PlanSnapshot", "StockSnapshot", "ToolSnapshot", "PackedLines"]
