"""Record of a reading: moves, remarks and errors with their lines, each of bounded number."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.errors import ProgramError
from geometry.mesh import F64
from verify.program.axis_log import TurnLog
from verify.program.move_kinds import FEED
from verify.program.program import Pause, Remark, StopPoint, Swap

MAX_ERRORS = 20
MAX_REMARKS = 20
MAX_MOVES = 5_000_000
MAX_MOVES_A_BLOCK = 200_000
_CHUNK = 65_536
Row = tuple[float, float, float, float, float, float, int, float, int, int]


class Log:
    """Record of one reading.

    name : of the program
    line : 1-based number of the current line
    passed : numbers of lines that ran without a block of their own: jumps, calls, values
    cools   : whether a word says that the coolant is on or off
    path_stated : number of moves before the first word of a path mode (G61, G64), None without one
    repeats : line of the M99 or GOTOS that begins the program again, 0 for none
    lengths : mm by T number, the first length that the program gives a tool, and its line
    functions : first line of each M word that counts as a function of the machine
    speeds, unknown, stops, blend, leaves, changes, unbounded, pauses, places, dwells, swaps, unplaced,
    by_joints, lifts, kept_on, ways_told, senses : as in ``Program``
    taps : move that begins a tapping cycle, and whether the spindle turns back on the way out
    rows : latest moves as (start x, y, z, end x, y, z, kind, feed, tool, line), mm and mm/min; call ``flush`` at 65 536
    """

    full = _CHUNK

    def __init__(self, name: str) -> None:
        self.name = name
        self.line = 0
        self.passed: set[int] = set()
        self.rows: list[Row] = []
        self.errors: list[tuple[int, str]] = []
        self.notes: list[str] = []
        self.functions: dict[int, int] = {}
        self._remarks: dict[tuple[str, object], Remark] = {}
        self._count: dict[str, int] = {}
        self.ways_told: set[int] = set()
        self._chunks: list[F64] = []
        self._moves = 0
        self._feeds = False
        self.speeds: dict[int, tuple[float, int]] = {}
        self.unknown: list[tuple[int, int]] = []
        self.stops: list[StopPoint] = []
        self.blend = self.leaves = 0.0
        self.changes = self.repeats = 0
        self.places: list[tuple[int, int, float]] = []
        self.dwells: list[tuple[int, int, float]] = []
        self.swaps: list[Swap] = []
        self.unplaced: list[int] = []
        self.lifts: list[tuple[int, bool]] = []
        self.by_joints: set[int] = set()
        self.kept_on: list[int] = []
        self.taps: list[tuple[int, bool]] = []
        self.unbounded = False
        self.cools = False
        self.path_stated: int | None = None
        self.pauses: list[Pause] = []
        self.lengths: dict[int, tuple[float, int]] = {}
        self.turned = TurnLog()
        self._remedy: str | None = None
        self._states: list[tuple[int, float, bool]] = [(0, 0.0, False)]
        self.zeros: list[tuple[int, int]] = [(0, 0)]
        self.senses: list[tuple[int, int]] = [(0, 0)]
        self._coordinates: dict[tuple[float, ...], int] = {(): 0}

    def pass_line(self, line: int) -> None:
        """Go to a line that runs, though it may have no block of its own."""
        self.line = line
        self.passed.add(line)

    def tap(self, left: bool, *, out: bool = True) -> None:
        """The line of the next move taps; left: a left-hand thread; out: the spindle turns back on the way out."""
        self.taps.append((self.count, out))
        if left:
            self.remark("left_tap", "the cycle taps a left-hand thread, and turns the spindle backwards", self.line)

    @property
    def count(self) -> int:
        """Number of moves written."""
        return self._moves + len(self.rows)

    @property
    def moved(self) -> bool:
        """Whether any move was written."""
        return bool(self.rows) or self._moves > 0

    @property
    def cuts(self) -> bool:
        """Whether any feed move was written."""
        return any(row[6] == FEED for row in self.rows) or any((c[:, 6] == FEED).any() for c in self._chunks)

    def error(self, message: str, line: int | None = None, remedy: str | None = None) -> None:
        """Record a line that cannot be read, the current one where ``line`` is None; the first remedy is reported."""
        if not self.errors:
            self._remedy = remedy
        self.errors.append((line or self.line, message))

    def remark(self, key: str, message: str, detail: object = None, line: int | None = None) -> None:
        """Record a remark, once for each key and detail; 20 of one key are kept and the rest counted."""
        if (key, detail) in self._remarks:
            return
        self._count[key] = self._count.get(key, 0) + 1
        if self._count[key] <= MAX_REMARKS:
            self._remarks[key, detail] = Remark(line or self.line, message)

    def note(self, message: str) -> None:
        """Record a note, once each, twenty at most."""
        if message not in self.notes and len(self.notes) < MAX_REMARKS:
            self.notes.append(message)

    def remarks(self) -> tuple[Remark, ...]:
        """All remarks by line; the last one kept of a key gives the number of those left out."""
        kept = {key: max((r for (k, _), r in self._remarks.items() if k == key), key=lambda r: r.line)
                for key, n in self._count.items() if n > MAX_REMARKS}
        more = {id(r): f" (and {self._count[key] - MAX_REMARKS} more such lines)" for key, r in kept.items()}
        return tuple(sorted((Remark(r.line, r.message + more.get(id(r), "")) for r in self._remarks.values()),
                            key=lambda r: (r.line, r.message)))

    def move(self, start: Sequence[float], end: Sequence[float], kind: int, feed: float, tool: int, axes: int) -> None:
        """Write a move between places (3,), mm; ``axes`` as in ``Program.unknown``, 0 where the start is known."""
        if len(self.rows) >= self.full:
            self.flush()
        if axes:
            self.unknown.append((self.count, axes))
        self.rows.append((*start, *end, kind, feed, tool, self.line))  # type: ignore[arg-type]

    def turns(self, tool: int, speed: float) -> None:
        """Record that a tool turns at ``speed``, 1/min."""
        if speed > self.speeds.get(tool, (0.0, 0))[0]:
            self.speeds[tool] = speed, self.line

    def runs(self, speed: float, coolant: bool) -> None:
        """Record spindle speed, 1/min (0: it stands), and coolant from the next move on."""
        if (speed, coolant) != self._states[-1][1:]:
            self._states.append((self.count, speed, coolant))

    def spins(self, backwards: bool) -> None:
        """The spindle turns that way from the next move on; the line of the word that reversed it is kept."""
        if backwards != (self.senses[-1][1] > 0):
            self.senses.append((self.count, self.line if backwards else 0))

    def counts_in(self, coordinates: tuple[float, ...]) -> None:
        """Record the coordinates of the next move on: shift, mm, and matrices of frames; () for those of the setup."""
        number = self._coordinates.setdefault(coordinates, len(self._coordinates))
        if number != self.zeros[-1][1]:
            self.zeros.append((self.count, number))

    def states(self) -> tuple[F64, NDArray[np.bool_]]:
        """Spindle speed, (m,) float64, 1/min, and coolant, (m,) bool, of all moves."""
        begun, speed, coolant = zip(*self._states, strict=True)
        row = np.searchsorted(np.array(begun), np.arange(self.count), side="right") - 1
        return np.array(speed)[row], np.array(coolant)[row]

    def room(self, moves: float) -> None:
        """Refuse a block of ``moves`` moves that is too long, before it is written.

        Raises
        ------
        ProgramError
            Code program_too_long: over 200 000 moves in the block or 5 000 000 in the program.
        """
        if moves > MAX_MOVES_A_BLOCK:
            self._too_long(f"one block makes {moves:.6g} moves", moves, MAX_MOVES_A_BLOCK, self.line)
        if self.count + moves > MAX_MOVES:
            self._too_long("the program makes too many moves", self.count + moves, MAX_MOVES, self.line)

    def flush(self) -> None:
        """Pack the latest moves. Raises ProgramError as ``room`` does where the program has too many."""
        if not self.rows:
            return
        if self.count > MAX_MOVES:
            self._too_long("the program makes too many moves", self.count, MAX_MOVES,
                           self.rows[MAX_MOVES - self._moves][9])
        self._moves += len(self.rows)
        chunk = np.array(self.rows, dtype=np.float64)
        self._feeds |= bool((chunk[:, 6] == FEED).any())
        self._chunks.append(chunk)
        self.rows.clear()

    def take_feeds(self) -> bool:
        """Whether any feed move was written since the last call."""
        self.flush()
        feeds, self._feeds = self._feeds, False
        return feeds

    def table(self) -> F64:
        """(m, 10) float64, mm: all rows, as ``rows`` has them, in the setup frame."""
        self.flush()
        return np.concatenate(self._chunks) if self._chunks else np.zeros((0, 10))

    def raise_errors(self) -> None:
        """Refuse a program with lines that cannot be read.

        Raises
        ------
        ProgramError
            The subjects name the lines.
        """
        if not self.errors:
            return
        errors = list(dict.fromkeys(self.errors))  # a line in a loop is named once
        line, message = errors[0]
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise ProgramError(f"{self.name}, line {line}: {message}{more}",
                           subjects=tuple(f"line {n}" for n, _ in errors), measured=[m for _, m in errors],
                           remedy=self._remedy or "correct the named lines, or remove words that the reader does not "
                                                  "know")

    def _too_long(self, problem: str, moves: float, limit: int, line: int) -> None:
        raise ProgramError(f"{self.name}, line {line}: {problem} ({limit} allowed)", code="program_too_long",
                           subjects=(f"line {line}",), measured=int(min(moves, 1e18)), limit=limit,
                           remedy="correct the turns, radius, peck, repeats or rotary words of the line, or split "
                                  "the program")
