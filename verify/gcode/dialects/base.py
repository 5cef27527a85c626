"""Base class and helpers of the readers of controls."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

from geometry.errors import ProgramError
from verify.assumptions import Assumed
from verify.gcode.block_words import NUMBER, WORK_OFFSETS, BlockError
from verify.gcode.cutter_compensation import FANUC_STYLE, Style
from verify.gcode.flow.input_increment import Increment
from verify.gcode.frames import Frame
from verify.kinematics import Kinematics
from verify.program.move_log import Log
from verify.program.program import State

ZEROS = tuple(WORK_OFFSETS.values())
"""The work offsets of a control from the first on, as setups name them."""


class Machine(Protocol):
    """The part of the reader that a dialect may look at while it decides which line runs next.

    s       : modal state after the blocks so far; log : record of the reading
    machine : rotary axes of the machine, or None; rotary : their letters
    radii   : mm by T number, radius of the tools of the setup
    teeth   : numbers of teeth by T number, of the tools for which the setup states it
    elements : number of moves of compensated contours so far; idle : blocks since the last one
    counts  : whether words count in the least increment of the control in this reading
    fine_line : first line of a word that is finer, and may add up with others or move a centre; 0 for none
    """

    s: State
    log: Log
    machine: Kinematics | None
    rotary: str
    radii: dict[int, float]
    teeth: dict[int, int]
    elements: int
    idle: int
    counts: bool
    fine_line: int

    def here(self) -> list[float]:
        """(3,) mm, the programmed place in the coordinates of the blocks; nan where it is unknown."""

    def served(self, key: int | str) -> float:
        """A parameter that the control serves."""

    def angle(self, degrees: float) -> float:
        """An angle from -180 to 180 deg in the range that this reading takes for ATAN and ASIN."""


class DialectReader:
    """Reader of the words of one control, line by line; it keeps the state that later lines depend on.

    notes   : notes to report; the caller clears them
    remarks : remarks on the latest line; the caller clears them
    functions : M words of the latest line that count as functions of the machine; the caller clears them
    refused_m : M words that are not followed, and what they do
    unbounded : whether, somewhere, no word bounds the deviation from the path
    bounds_path : whether the control has such a word
    home_from : first tool change, counted from 0, before which our programs send the spindle home; None: the control
                retracts by itself
    gives_up_length : whether the length offset is off at these tool changes too
    further_words : G words of ``block_words.FURTHER`` that the control has
    repeats : letters that give the number of holes of a drilling cycle, the first one present counts
    style   : how the control compensates a cutter radius; it may change from line to line
    frame   : from programmed coordinates to those of the work offset, mm, None where both are the same. The reader
              applies it to X, Y, Z, arcs and cycles of the blocks that follow; shifts by words of blocks (G92, G10)
              come after it
    assumed : what lines leave to the control, each kind once
    names   : T numbers by the names (ids) of the tools of the setup
    shrinking_pecks : whether I, J, K of G73 and G83 are the first peck, by how much each is shorter, and the shortest
    own_speed : whether a word has made each axis go at its own speed in a rapid
    contour_feed : whether, on outside arcs of compensated contours, F is the feed of the contour, not of the centre
    lean    : deg, by which words let the control turn the tool axis off its way while it cuts, 0 where none states it
    dropped : word that has dropped the length offset, other than G49; '' for none
    looks_ahead : most blocks without a move in the plane between two moves of a compensated contour through which the
              control finds the second one
    increment : what the control counts in, None where it keeps all digits
    """

    style: Style = FANUC_STYLE
    further_words: frozenset[float] = frozenset()
    refused_m: Mapping[int, str] = {}
    repeats = "LK"

    bounds_path = True
    home_from: int | None = None
    gives_up_length = False
    own_speed = False
    shrinking_pecks = False
    contour_feed = False
    looks_ahead: float = math.inf
    increment: Increment | None = None

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.remarks: list[str] = []
        self.functions: list[int] = []
        self.assumed: list[Assumed] = []
        self.unbounded = False
        self._free = False
        self.dropped = ""
        self.lean = 0.0
        self.frame: Frame | None = None
        self.zero_names: dict[str, str] = {}
        self.names: Mapping[str, int] = {}

    def order(self, lines: Sequence[str], machine: Machine) -> Iterator[tuple[int, str]]:
        """Lines with their numbers, from 1, in the order they run: repeats, calls and jumps are followed here.

        Each line goes through ``blocks``, and its blocks run, before the next one is drawn: the state of ``machine`` is
        then that before the line. A line may come as other text than it has in the program (variables replaced).

        Raises BlockError where the order cannot be known; the reading ends there, at ``machine.log.line``.
        """
        yield from enumerate(lines, 1)

    def keep_frames(self, ended: DialectReader) -> bool:
        """Take the coordinates over that parameters of the control may keep when a program ends.

        ended : a reader of this kind at the end of a program

        Returns whether any stay. Modes of Fanuc and Haas stay as a whole (``verify.gcode.flow.second_run``).
        """
        return False

    def function(self, number: int) -> None:
        """Take an M word without a meaning here as a function of the machine (``verify.gcode.machine_words``).

        Raises
        ------
        BlockError
            The manual of the control says that it moves something, changes the order, or waits for an answer.
        """
        if what := self.refused_m.get(number):
            raise BlockError(f"M{number} ({what}) is not followed")
        self.functions.append(number)

    def leave_open(self, assumed: Assumed) -> None:
        """Keep what a line leaves to the control, the first of each kind."""
        if all(a.what != assumed.what for a in self.assumed):
            self.assumed.append(assumed)

    def tip_turned(self, machine: Kinematics, was: Sequence[float], turn: Sequence[float]) -> None:
        """A block turns the axes from ``was`` to ``turn``, (2,) deg, evenly, while the control keeps the tip."""

    def bound(self, known: bool) -> None:
        """From here on a word bounds the deviation from the path (``known``), or none does."""
        self._free |= not known
        self.unbounded = self._free

    def zero(self, number: int, word: str) -> str:
        """As ``zero_word``; remarks call the work offset ``word`` from here on."""
        found = zero_word(number, word)
        self.zero_names[found] = word
        return found

    def blocks(self, raw: str) -> Sequence[str | tuple[int, str]]:
        """Blocks of one line in the words of ``verify.gcode.block_words``; none for a line without effect.

        A block that belongs to an earlier line comes with that line's number.

        Raises BlockError where the line cannot be read, or could be read in two ways.
        """
        raise NotImplementedError


def zero_word(number: int, word: str) -> str:
    """The word of work offset ``number`` of the control, counted from 1; ``word`` is its name in the program.

    Raises
    ------
    BlockError
        No setup can name that work offset.
    """
    if not 1 <= number <= len(ZEROS):
        raise BlockError(f"{word} is work offset {number} of the control; a setup can name the first {len(ZEROS)}")
    return ZEROS[number - 1]


def too_many_jumps(log: Log, limit: int) -> ProgramError:
    """The error of a program that makes more jumps than the limit allows, at the line that is read."""
    return ProgramError(f"{log.name}, line {log.line}: the program makes more than {limit} jumps; a loop may have no "
                        "end", code="program_too_long", subjects=(f"line {log.line}",), measured=limit + 1,
                        limit=limit, remedy="correct the condition of the loop or jump, or split the program")


class Jumps:
    """Counts the jumps of a program, and ends loops without end.

    log : record of the reading
    """

    def __init__(self, log: Log) -> None:
        self.log, self.count = log, 0
        self._before: dict[int, str] = {}

    def add(self, limit: int) -> None:
        """Count a jump.

        Raises
        ------
        ProgramError
            Code program_too_long: more than ``limit``.
        """
        self.count += 1
        if self.count > limit:
            raise too_many_jumps(self.log, limit)

    def back(self, at: int, state: object) -> None:
        """A jump back from line ``at``, counted already; ``state`` has all that decides which lines run next.

        Raises
        ------
        ProgramError
            Code program_too_long: the state is that of the time before.
        """
        now, name = repr(state), f"line {self.log.line}"
        if self._before.get(at) == now:
            raise ProgramError(f"{self.log.name}, {name}: the jump back finds all values and modes as they were the "
                               "time before, so the loop has no end", code="program_too_long", subjects=(name,),
                               measured=self.count, remedy="correct the condition of the loop or jump")
        self._before[at] = now


__all__ = ["NUMBER", "ZEROS", "BlockError", "DialectReader", "Jumps", "zero_word"]
