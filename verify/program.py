"""What a reading gives, and the modal state it keeps."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32

NAN = math.nan


@dataclass(frozen=True)
class Remark:
    """Something readable that should not be run: where and what."""

    line: int
    message: str


@dataclass(frozen=True)
class Stop:
    """Where the program stops to change the tool, or ends: line, what it is, tool in the spindle and its height, mm."""

    line: int
    what: str
    tool: int
    z: float


@dataclass(frozen=True, eq=False)
class Program:
    """A program as straight moves of the tool tip in the setup frame.

    name    : of the program
    start, end : (m, 3) float64, mm; an axis whose start is unknown starts where it ends
    unknown : (k, 2) int64, moves with such axes, and which as a sum of 1 for X, 2 for Y, 4 for Z
    kind    : (m,) int8, RAPID or FEED (arcs are FEED polylines within 1e-3 mm)
    feed    : (m,) float64, mm/min; nan for rapids
    tool    : (m,) int32, T number in the spindle, 0 for none
    line    : (m,) int32, 1-based line of the source
    dwell   : s of G4 and drilling dwells
    speeds  : by T number, the highest S it turned at, 1/min, and the line
    stops   : where a tool change or the end came at a known height
    assumed : words in force without having been stated before the first move
    blend   : mm, the most G64 lets the control leave the path by, as far as a P bounds it
    lines   : number of lines read
    remarks : what should not be run
    notes   : what was done and should be known
    """

    name: str
    start: F64
    end: F64
    kind: NDArray[np.int8]
    feed: F64
    tool: I32
    line: I32
    dwell: float
    speeds: dict[int, tuple[float, int]]
    lines: int
    remarks: tuple[Remark, ...]
    unknown: NDArray[np.int64]
    stops: tuple[Stop, ...]
    assumed: tuple[str, ...]
    blend: float
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.start)


@dataclass
class State:
    """Everything modal.

    position  : mm, nan where the program has not stated it or a machine move left it
    speed     : as S, nan before the first
    parked    : whether X or Y stand at a place of the machine's own (G53, G28, G30)
    cycle     : words of the drilling cycle in force, and where its series began
    table     : mm, by how much G10 moved the zero of the work offset
    shift     : mm, by how much G92 or G52 moved program zero
    kept      : mm, the shift that G92.3 brings back
    """

    position: list[float] = field(default_factory=lambda: [NAN, NAN, NAN])
    motion: float | None = None
    plane: int = 17
    scale: float = 1.0
    relative: bool = False
    centre_absolute: bool = False
    feed_mode: int = 94
    feed: float = NAN
    speed: float = NAN
    spindle: bool = False
    selected: int = 0
    tool: int = 0
    offset: int | None = None
    work_offset: str = "G54"
    retract_to_r: bool = False
    cycle: dict[str, float] = field(default_factory=dict)
    parked: bool = False
    ended: bool = False
    table: list[float] = field(default_factory=lambda: [0.0] * 3)
    shift: list[float] = field(default_factory=lambda: [0.0] * 3)
    kept: list[float] = field(default_factory=lambda: [0.0] * 3)

    @property
    def origin(self) -> list[float]:
        """mm, where program zero lies in the setup frame."""
        return [a + b for a, b in zip(self.table, self.shift, strict=True)]

    @property
    def length_off(self) -> bool:
        """Whether Z of the control is not that of the tip, for want of the length offset of the tool."""
        return self.tool > 0 and self.offset != self.tool

    @property
    def turning(self) -> bool:
        """Whether the spindle runs."""
        return self.spindle and self.speed > 0
