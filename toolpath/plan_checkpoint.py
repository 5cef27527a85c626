"""A plan in progress: the state that its remaining acts need, as plain values and arrays.

A plan is a sequence of acts: the layers of a tool in a band, the finish of a zone in a band, or a repeated finish of a
zone. A checkpoint holds all state between two acts. It leaves out whatever follows from the inputs of the plan, such as
lattices, lines of passes and areas of layers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from toolpath.stock.stock_map import StockSnapshot
from toolpath.workingsteps import Workingstep

T = TypeVar("T")


class Lines(Protocol):
    """Several lines, each (n, 3) float64, mm, access frame."""

    def lines(self) -> list[F64]:
        """The lines, each (n, 3) float64, mm, access frame."""


@dataclass(frozen=True, eq=False)
class SharedLines:
    """Several lines that a state shares with the plan it is of; a plan only adds lines."""

    kept: tuple[F64, ...]

    @classmethod
    def of(cls, lines: Sequence[F64]) -> SharedLines:
        """Keeps lines, each (n, 3) float64, mm, access frame, as they are."""
        return cls(tuple(lines))

    def lines(self) -> list[F64]:
        """The lines, each (n, 3) float64, mm, access frame."""
        return list(self.kept)


@dataclass(frozen=True, eq=False)
class PackedLines:
    """Several lines in one array.

    points : (n, 3) float64, mm, access frame, line after line
    counts : (k,) int64, count of points of each line
    """

    points: F64
    counts: NDArray[np.int64]

    @classmethod
    def of(cls, lines: Sequence[F64]) -> PackedLines:
        """Joins lines.

        lines : each (n, 3) float64, mm, access frame, tips
        """
        return cls(np.concatenate([np.zeros((0, 3)), *lines]), np.array([len(line) for line in lines], np.int64))

    def lines(self) -> list[F64]:
        """The lines that were joined, each (n, 3) float64, mm, access frame."""
        return np.split(self.points, np.cumsum(self.counts)[:-1]) if len(self.counts) else []


@dataclass(frozen=True, eq=False)
class FinishSnapshot:
    """State of a ``Finish``: residual (n,) float64, mm, and met (n,) bool at its checks, and its strategy without the
    lines."""

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
    """State of the layers of a tool.

    top     : mm, height of the stock when the layers were laid out
    swept   : mm, height at which all walls were last followed
    above   : mm, height of the last layer
    heights : (n,) float64, mm, of the whole layers to come, descending
    floors  : (m,) float64, mm, of the layers to come above floors, and of one that takes the last of loose pieces
    loose   : (ny, nx) bool on the lattice, places of pieces that layers cut away, for they would come loose
    """

    top: float
    swept: float
    above: float
    heights: F64
    floors: F64
    loose: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ToolSnapshot:
    """State of a tool: moves walked and cut, its layers with the ids of their workingsteps, and the zones it has
    begun."""

    walked: Lines
    depths: Lines
    layers: LayersSnapshot | None
    layered: tuple[str, ...]
    finishes: tuple[FinishSnapshot, ...]


@dataclass(frozen=True, eq=False)
class PlanSnapshot:
    """State of a plan after so many acts."""

    acts: int
    steps: tuple[Workingstep, ...]
    stock: StockSnapshot
    tools: tuple[ToolSnapshot, ...]

    def apart(self) -> PlanSnapshot:
        """The same state in arrays of its own; lines stay shared."""
        stock = replace(self.stock, top=self.stock.top.copy(), cover=self.stock.cover.copy())
        tools = [replace(t, finishes=tuple(replace(f, residual=f.residual.copy(), met=f.met.copy())
                                           for f in t.finishes)) for t in self.tools]
        return replace(self, stock=stock, tools=tuple(tools))


class CheckpointKeeper:
    """Keeps a plan in progress and may restore it from an earlier attempt; this one keeps nothing."""

    def taken(self, use: Callable[[PlanSnapshot], T]) -> T | None:
        """Result of ``use`` for the kept plan; None where none is kept, or where ``use`` cannot restore it.

        ``use`` then raises AttributeError, IndexError, KeyError, TypeError or ValueError and has changed nothing.
        """
        del use
        return None

    def done(self, snapshot: Callable[[], PlanSnapshot]) -> None:
        """Called after each act; ``snapshot`` is evaluated where keeping is worthwhile."""


NOTHING = CheckpointKeeper()

__all__ = ["NOTHING", "CheckpointKeeper", "FinishSnapshot", "LayersSnapshot", "Lines", "PackedLines", "PlanSnapshot",
           "SharedLines", "StockSnapshot", "ToolSnapshot"]
