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
class StopPoint:
    """Where the program stops to change the tool, or ends: line, what it is, tool in the spindle, its tip and its axis.

    tip, axis : (3,) mm and unit, tip to spindle, setup frame; X and Y of the tip may be nan where the axis is +Z
    """

    line: int
    event: str
    tool: int
    tip: tuple[float, float, float]
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Pause:
    """How a program leaves the machine where it changes a tool, waits for somebody (M0, M1) or ends.

    event   : 'tool change', 'M0', 'M1' or 'end of the program'
    tool    : T number that is put in, 0 for none; of other pauses the one in the spindle
    moves   : that were made before it
    speed   : 1/min, 0 where the spindle stands;  coolant, tcp : whether it runs, whether the control keeps the tip
    relative : whether coordinates are incremental (G91)
    home    : whether the spindle was sent to a place of the machine's own and has not come down since
    counted : whether a length offset is in force, or may be, as no word has said
    """

    line: int
    event: str
    tool: int
    moves: int
    speed: float
    coolant: bool
    tcp: bool
    relative: bool
    home: bool
    counted: bool


@dataclass(frozen=True, eq=False)
class Poses:
    """How the tool stands on the part, move by move.

    start_axis, end_axis : (m, 3) float64 unit vectors, tip to spindle, setup frame; between them the axis goes along
        the shorter great circle, within ``turn_subdivision.TURN`` rad of what the control does
    start_turn, end_turn : (m, 2) float64, rad, the rotary axes, the tilting one first
    """

    start_axis: F64
    end_axis: F64
    start_turn: F64
    end_turn: F64


@dataclass(frozen=True, eq=False)
class Program:
    """A program as straight moves of the tool tip in the setup frame.

    name    : of the program
    start, end : (m, 3) float64, mm; an axis whose start is unknown starts where it ends
    unknown : (k, 2) int64, moves with such axes, and which as a sum of 1 for X, 2 for Y, 4 for Z, and of 8 where a
              rotary axis turns or stands off 0: such a move holds where it ends, the way there is not known
    kind    : (m,) int8, RAPID or FEED (arcs are FEED polylines within 1e-3 mm)
    feed    : (m,) float64, mm/min along X, Y, Z of the program, 0 where only a rotary axis turns; nan for rapids
    minutes : (m,) float64, min a feed move takes; nan for rapids
    tool    : (m,) int32, T number in the spindle, 0 for none
    line    : (m,) int32, 1-based line of the source
    dwell   : s of G4 and drilling dwells
    speeds  : by T number, the highest S it turned at, 1/min, and the line
    stops   : where a tool change or the end came at a known height
    assumed : words in force without having been stated before the first move
    blend   : mm, the most G64 lets the control round a corner by, as far as a P bounds it
    leaves  : mm, the most it lets the control leave the path by: that, and what points may be left out by (Q) beside it
    lines   : number of lines read
    remarks : what should not be run
    poses   : None where the tool stands along Z throughout: no rotary axis ever leaves 0
    notes   : what was done and should be known
    speed   : (m,) float64, 1/min, at which the spindle turns, 0 where it stands
    coolant : (m,) bool
    changes : times a tool was taken out of the spindle for another, or for nothing
    dialect : whose words it was written in
    unbounded : whether no word bounds, somewhere, what the control leaves the path by: ``leaves`` does not hold there
    pauses  : in order
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
    stops: tuple[StopPoint, ...]
    assumed: tuple[str, ...]
    blend: float
    minutes: F64
    poses: Poses | None = None
    notes: tuple[str, ...] = ()
    speed: F64 = field(default_factory=lambda: np.zeros(0))
    coolant: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    changes: int = 0
    dialect: str = "linuxcnc"
    unbounded: bool = False
    pauses: tuple[Pause, ...] = ()
    leaves: float = 0.0

    def __len__(self) -> int:
        return len(self.start)


@dataclass
class State:
    """Everything modal.

    position  : mm, nan where the program has not stated it or a machine move left it; the tip with tool centre point
                control, else the linear joints
    turn      : deg, the rotary axes, tilting one first
    tcp_word, tcp_switch : tool centre point control by G43.4, by M428
    speed     : as S, nan before the first
    sent      : whether Z was ever sent to a place of the machine's own
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
    coolant: bool = False
    selected: int = 0
    tool: int = 0
    offset: int | None = None
    work_offset: str = "G54"
    retract_to_r: bool = False
    cycle: dict[str, float] = field(default_factory=dict)
    parked: bool = False
    sent: bool = False
    turn: list[float] = field(default_factory=lambda: [0.0, 0.0])
    tcp_word: bool = False
    tcp_switch: bool = False
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
    def home(self) -> bool:
        """Whether Z was sent to a place of the machine's own and has not been stated since."""
        return self.sent and math.isnan(self.position[2])

    @property
    def turning(self) -> bool:
        """Whether the spindle runs."""
        return self.spindle and self.speed > 0

    @property
    def tcp(self) -> bool:
        """Whether the control keeps the tip where the program says while axes turn."""
        return self.tcp_word or self.tcp_switch

    @property
    def tilted(self) -> bool:
        """Whether a rotary axis stands off 0."""
        return self.turn[0] != 0 or self.turn[1] != 0
