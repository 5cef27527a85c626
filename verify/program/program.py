"""Result of a reading, and its modal state."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, I32
from verify.assumptions import Assumed

if TYPE_CHECKING:
    from verify.gcode.frames import Frame

NAN = math.nan


@dataclass(frozen=True)
class Remark:
    """A readable word or block that should not be run: line and message."""

    line: int
    message: str


@dataclass(frozen=True)
class StopPoint:
    """Place where the program stops for a tool change, ends or goes home: line, event, tool, its tip and axis.

    tip, axis : (3,) mm and unit, tip to spindle, setup frame; X and Y of the tip may be nan where the axis is +Z
    room      : whether the tool goes on from there in a rapid, and has to keep its clearance
    """

    line: int
    event: str
    tool: int
    tip: tuple[float, float, float]
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    room: bool = False


@dataclass(frozen=True)
class Pause:
    """State of the machine where a program changes a tool, waits for the operator (M0, M1) or ends.

    event   : 'tool change', 'M0', 'M1' or 'end of the program'
    tool    : T number of the new tool, 0 for none; at other events the tool in the spindle
    moves   : number of moves before it
    speed   : 1/min, 0 where the spindle stands
    coolant : whether it is on; tcp : whether tool centre point control is on
    relative : whether coordinates are incremental (G91)
    home    : whether the spindle went to a fixed place of the machine and has not come down since
    counted : whether a length offset is in force, or may be because the program has not stated it
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


@dataclass(frozen=True)
class TravelPlane:
    """A plane of a STEP-NC file to which a control may take the tool in a rapid.

    line  : of the instance that names it; what : 'security plane' or 'retract plane'
    point : (3,) mm, setup frame; normal : (3,) unit, setup frame
    """

    line: int
    what: str
    point: tuple[float, float, float]
    normal: tuple[float, float, float]


@dataclass(frozen=True)
class Swap:
    """A tool change where the spindle stood: the new tool hangs from the same place.

    old, new : T numbers, 0 for an empty spindle
    longer   : mm, length of the new tool less that of the old one
    height   : mm, Z of the tip of the old tool, setup frame
    moves    : number of moves before it
    """

    line: int
    old: int
    new: int
    longer: float
    height: float
    moves: int


@dataclass(frozen=True, eq=False)
class Poses:
    """Tool axes and rotary angles of moves.

    start_axis, end_axis : (m, 3) float64 unit vectors, tip to spindle, setup frame; between them the axis follows the
        shorter great circle, within ``turn_subdivision.TURN`` rad of the control
    start_turn, end_turn : (m, 2) float64, rad, the rotary axes, the tilting one first
    """

    start_axis: F64
    end_axis: F64
    start_turn: F64
    end_turn: F64


class RotaryStart(NamedTuple):
    """A rotary axis: the number of moves before the program states its angle, and the angle at its end, deg.

    An axis that is never stated has the number of all moves.
    """

    letter: str
    moves: int
    end: float


@dataclass(frozen=True, eq=False)
class Program:
    """A program as straight moves of the tool tip in the setup frame.

    name    : of the program
    start, end : (m, 3) float64, mm; an axis whose start is unknown starts where it ends
    unknown : (k, 2) int64, moves with such axes, and the axes as a sum of 1 for X, 2 for Y, 4 for Z, and 8 where a
              rotary axis turns or is not at 0: only the end of such a move is known
    kind    : (m,) int8, RAPID or FEED (arcs are FEED polylines within 1e-3 mm)
    feed    : (m,) float64, mm/min along X, Y, Z of the program, 0 where only a rotary axis turns; nan for rapids
    minutes : (m,) float64, min, of feed moves; nan for rapids
    tool    : (m,) int32, T number in the spindle, 0 for none
    line    : (m,) int32, 1-based line of the source
    dwell   : s of G4 and drilling dwells
    speeds  : by T number, the highest S it turned at, 1/min, and the line
    stops   : tool changes, the end, and ways to a fixed place of the machine, where their height is known
    assumed : words that the first move needs and the program has not stated before it
    blend   : mm, largest rounding of a corner that G64 P allows
    dwells  : line, number of moves before it and s of each G4
    places  : coordinates of the machine (G53) by line: line, axis 0 to 2, and mm
    planes  : security planes of a STEP-NC file, and retract planes that lie lower than the path before them ends
    open    : what it leaves to the control
    cools   : whether a word says that the coolant is on or off
    cut_off : line that ends the program although lines of it follow, 0 where none do
    swaps   : tool changes where the spindle stood; unplaced : lines of those at a place that nothing states
    by_joints : T numbers whose tip was computed from the joints of a tilted head, by their gauge length
    leaves  : mm, largest deviation from the path that G64 allows: ``blend`` and the tolerance Q of dropped points
    lines   : number of lines read
    remarks : words and blocks that should not be run
    poses   : None where the tool stands along Z throughout: no rotary axis ever leaves 0
    notes   : notes to report
    speed   : (m,) float64, 1/min, of the spindle, 0 where it stands
    coolant : (m,) bool
    changes : number of times that a tool left the spindle
    dialect : dialect of the text
    own_speed : whether a word of the program makes each axis go at its own speed in a rapid
    lifts   : rows of no length that stand for a way home in Z from a known place: row, and whether it goes along the
              tool, not along Z of the machine
    kept_on : lines that turn tool centre point control on by G43.4 while it is on
    starts  : of the rotary axes
    ways_told : lines whose rotary words state the way, not only the angle
    taps    : lines of tapping cycles and moves, and whether the spindle turns the other way on the way out
    unbounded : whether, somewhere, no word bounds the deviation from the path: ``leaves`` does not hold there
    pauses  : in order
    zeros   : coordinates in force: number of moves before, and a number that is the same for the same coordinates
    senses  : of the spindle: number of moves before, and the line of the word that turns it backwards, 0 for forwards
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
    places: tuple[tuple[int, int, float], ...] = ()
    cut_off: int = 0
    planes: tuple[TravelPlane, ...] = ()
    open: tuple[Assumed, ...] = ()
    cools: bool = True
    dwells: tuple[tuple[int, int, float], ...] = ()
    swaps: tuple[Swap, ...] = ()
    unplaced: tuple[int, ...] = ()
    by_joints: frozenset[int] = frozenset()
    own_speed: bool = False
    lifts: tuple[tuple[int, bool], ...] = ()
    kept_on: tuple[int, ...] = ()
    taps: Mapping[int, bool] = field(default_factory=dict)
    ways_told: frozenset[int] = frozenset()
    starts: tuple[RotaryStart, ...] = ()
    zeros: tuple[tuple[int, int], ...] = ()
    senses: tuple[tuple[int, int], ...] = ()

    def __len__(self) -> int:
        return len(self.start)

    @property
    def reversed_by(self) -> NDArray[np.int64]:
        """(m,) int64, index, line of the word that has the spindle turn backwards in each move, 0 where it does not."""
        return _in_force(self.senses, len(self))

    @property
    def counts_in(self) -> NDArray[np.int64]:
        """(m,) int64, dimensionless, number of the coordinates that each move counts in, as ``zeros`` has them."""
        return _in_force(self.zeros, len(self))


def _in_force(changes: tuple[tuple[int, int], ...], count: int) -> NDArray[np.int64]:
    """(count,) int64, dimensionless, the value in force in each move; changes: number of moves before, value."""
    begun, value = np.array(changes or [(0, 0)], np.int64).T
    return value[np.searchsorted(begun, np.arange(count), side="right") - 1]


@dataclass
class State:
    """The modal state.

    position  : mm, nan where the program has not stated it or after a move in machine coordinates; the tip with tool
                centre point control, else the linear joints
    turn      : deg, the rotary axes, the tilting one first
    tcp_word, tcp_switch : tool centre point control by G43.4, by M428
    speed     : the S word, nan before the first
    along_tool : whether the next way home in Z goes along the tool (M140 MB MAX)
    sent      : whether Z was ever sent to a fixed place of the machine
    parked    : whether X or Y stand at a fixed place of the machine (G53, G28, G30)
    lost      : whether the tool stands where it stood while its coordinates are unknown, for tool centre point control
                went off with turned axes and the setup has no pivots
    cycle     : words of the drilling cycle in force, and the height where its series began
    table     : mm, shift of the work offset by G10
    shift     : mm, shift of program zero by G92, and by G52 where both share one register
    local     : mm, shift by G52 on a control with a register of its own for it
    kept      : mm, the shift that G92.3 restores
    length    : mm, by which the length offset in force differs from the length of the tool
    side      : of the cutter radius compensation in force, 1 left, -1 right, 0 off; d : its register
    frame     : rotation, mirror and scale of the programmed coordinates, None for none
    override  : factor of feeds that the program states (OVR of Siemens)
    """

    position: list[float] = field(default_factory=lambda: [NAN, NAN, NAN])
    motion: float | None = None
    plane: int = 17
    scale: float = 1.0
    relative: bool = False
    centre_absolute: bool = False
    feed_mode: int = 94
    feed: float = NAN
    override: float = 1.0
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
    lost: bool = False
    sent: bool = False
    along_tool: bool = False
    turn: list[float] = field(default_factory=lambda: [0.0, 0.0])
    tcp_word: bool = False
    tcp_switch: bool = False
    ended: bool = False
    table: list[float] = field(default_factory=lambda: [0.0] * 3)
    shift: list[float] = field(default_factory=lambda: [0.0] * 3)
    local: list[float] = field(default_factory=lambda: [0.0] * 3)
    kept: list[float] = field(default_factory=lambda: [0.0] * 3)
    length: float = 0.0
    side: int = 0
    d: int | None = None
    frame: Frame | None = None

    @property
    def origin(self) -> list[float]:
        """mm, where program zero lies in the setup frame."""
        table, shift, local = self.table, self.shift, self.local
        return [table[0] + shift[0] + local[0], table[1] + shift[1] + local[1],
                table[2] + shift[2] + local[2] + self.length]

    @property
    def length_off(self) -> bool:
        """Whether Z of the control is not that of the tip because the length offset of the tool is off."""
        return self.tool > 0 and self.offset != self.tool

    @property
    def home(self) -> bool:
        """Whether Z went to a fixed place of the machine and has not been stated since."""
        return self.sent and math.isnan(self.position[2])

    @property
    def turning(self) -> bool:
        """Whether the spindle runs."""
        return self.spindle and self.speed > 0

    @property
    def tcp(self) -> bool:
        """Whether tool centre point control is on."""
        return self.tcp_word or self.tcp_switch

    @property
    def tilted(self) -> bool:
        """Whether a rotary axis is not at 0."""
        return self.turn[0] != 0 or self.turn[1] != 0
