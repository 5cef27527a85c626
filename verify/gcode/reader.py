"""NC text to moves of the tool tip: the verifier's own reader of LinuxCNC and Fanuc words, for three to five axes.

One modal machine reads a program line by line [Kramer2000]. A stage before it evaluates parameters, expressions and
O-words of LinuxCNC (``control_flow``) and translates the words of other controls (``dialects``). One regular expression
reads the common line, a straight move in modal coordinates; everything else goes through the full block
(``block_words``).
The reader skips nothing. A word that it does not know is a ``ProgramError`` with its line. A readable word that a
machinist should not run is a ``Remark``, and the reading goes on: length offset off, another work offset, spindle
stopped, path blending beyond the tolerance, a word that no code uses.

Assumptions: home (G53 Z0, G28, G30), a tool change and the start of a program are above everything; axes of unknown
position are known again once programmed. Before the program states them, the unit is mm and rotary axes stand at 0;
``Program.assumed`` lists these assumptions. LinuxCNC starts in G64 without a tolerance; on other controls parameters
decide (``Program.unbounded``).
"""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

import numpy as np

from geometry.errors import ProgramError, VerificationError
from geometry.mesh import F64
from verify.assumptions import Assumed, AssumedKind
from verify.gcode.block_motion import BlockMotion
from verify.gcode.block_words import Block, BlockError, parse_block, straight, used_letters
from verify.gcode.dialects import CONTROLS, DIALECTS, LINUXCNC, translated_blocks
from verify.gcode.flow.control_flow import Flow, has_flow
from verify.gcode.flow.input_increment import Way, first_drift
from verify.gcode.flow.second_run import KEPT_BY_LINUXCNC, KEPT_MODES, TABLES, Change, first_change, left_modes
from verify.gcode.flow.system_parameters import served
from verify.gcode.machine_words import functions_note
from verify.gcode.program_text import cleaned
from verify.kinematics import Kinematics
from verify.program.arc_chords import CHORD
from verify.program.move_kinds import FEED, RAPID
from verify.program.move_log import MAX_ERRORS, Log
from verify.program.program import NAN, Program, Remark
from verify.progress import Report, silent

BLEND_LIMIT = 0.01
_BINARY = re.compile("[\x00-\x08]")
_CLOSES = re.compile(r"%$|(?:\d+\s+)?END PGM\b")  # what may stand behind the end of a program
_RETURNS = re.compile(r"\bM99\b|\b(?:M17|RET|ENDPROC)\b|\bLBL 0\b|\bENDSUB\b", re.IGNORECASE)
# what begins another program or a part of one
_OPENS = re.compile(r"[O:]\s*[0-9<]|%_N_|PROC\b|LBL\b|\d+\s+(?:BEGIN|LBL)\b", re.IGNORECASE)
CLOSED = 2  # lines with a bare %: the second one ends the file
REPORT_LINES = 4096  # lines between two reports of progress


class Reader(BlockMotion):
    """One reading of one program; use ``read_program``.

    dialect      : of the program
    leaves_modes : what the next run of the program takes for granted
    full_turns   : whether ATAN and ASIN of Fanuc give 0 to 360 deg; parameter 6004#0 decides
    angle_line   : first line of an angle that would differ then, 0 for none
    """

    dialect = LINUXCNC
    leaves_modes: tuple[Assumed, ...] = ()
    full_turns = False
    angle_line = 0
    _noted: tuple[object, ...] = (None, None, 0.0, 0.0, 0.0)

    def read(self, text: str, report: Report = silent, dialect: str = LINUXCNC) -> Program:
        """Moves and remarks of ``text``; raises as ``read_program`` says, and what ``report`` raises."""
        log, lines, self.fits, self.dialect = self.log, text.split("\n"), dialect == LINUXCNC, dialect
        self.s.retract_to_r = dialect == LINUXCNC  # as it starts
        if dialect != LINUXCNC:
            self.control = CONTROLS[dialect]()
            self.control.names = self.names
        begin, seen = self._copy(), bytearray(len(lines) + 2)
        percents = self._scan(_reported(self._blocks(text, lines), len(lines), report), seen)
        cut_off = self._name_unread(lines, seen) if self.s.ended or percents == CLOSED else 0
        compensated = self.s.side != 0 and not self.ends_contour
        self._finish()
        self.stop("end of the program")
        self.pause("end of the program", self.s.tool)
        if not self.s.ended and percents < CLOSED and not log.errors:
            log.error(f"{log.name} does not end with M2, M30 or a closing %: it may be incomplete", len(lines))
        log.raise_errors()
        if self.s.relative and self.incremental_after_cuts and self.incremental_moved:
            log.remark("incremental", "the program switches to incremental coordinates (G91) after absolute cuts and "
                       "never switches back", line=self.incremental_line)
        if any(self.s.shift) or any(self.s.local):
            log.remark("shift_left", "the program ends with its zero shifted (G92, G52), and a control keeps the shift "
                       f"for the next run: {self.cancel_shift}")
        if log.functions:
            log.notes.append(functions_note(log.functions))
        table = log.table()
        self._path_mode(table)
        self._judge_lengths()
        self._turn_angles(begin, text, lines, table)
        self._count_words(begin, text, lines, table)
        self._run_again(begin, text, lines, table, compensated)
        speed, coolant = log.states()
        start, end, feed = (np.ascontiguousarray(table[:, k]) for k in (slice(0, 3), slice(3, 6), 7))
        return Program(log.name, start, end, table[:, 6].astype(np.int8), feed, table[:, 8].astype(np.int32),
                       table[:, 9].astype(np.int32), self.dwell, dict(log.speeds), len(lines), log.remarks(),
                       np.array(log.unknown, np.int64).reshape(-1, 2), tuple(log.stops), self.assumed, log.blend,
                       log.turned.minutes(np.linalg.norm(end - start, axis=1), feed),
                       log.turned.poses(len(table), self.machine), tuple(log.notes), speed, coolant, log.changes,
                       dialect, log.unbounded, tuple(log.pauses), log.leaves, tuple(log.places), cut_off,
                       open=self._left_open(), starts=self._starts(), cools=log.cools, dwells=tuple(log.dwells),
                       swaps=tuple(log.swaps), unplaced=tuple(log.unplaced), by_joints=frozenset(log.by_joints),
                       lifts=tuple(log.lifts), kept_on=tuple(log.kept_on), ways_told=frozenset(log.ways_told),
                       taps={int(table[row, 9]): out for row, out in log.taps if row < len(table)},
                       own_speed=self.control is not None and self.control.own_speed, zeros=tuple(log.zeros),
                       senses=tuple(log.senses))

    def _blocks(self, text: str, lines: list[str]) -> Iterable[tuple[int, str]]:
        """Blocks of the program with their lines, in the words of this reader and the order they run."""
        if self.control is not None:
            return translated_blocks(lines, self.control, self)
        return Flow(lines, self).blocks() if has_flow(text) else enumerate(lines, 1)

    def _copy(self) -> Reader:
        """A reader in the state of this one, with an empty log."""
        same = (self.tools, self.machine, self.gauge, self.hangs, self.radii, self.names)
        return copy.deepcopy(self, {id(self.log): Log(self.log.name), **{id(s): s for s in same}})

    def _run_again(self, begin: Reader, text: str, lines: list[str], table: F64, compensated: bool) -> None:
        """Remark where a second run goes other ways than the first one, because of what the first one leaves.

        begin : the reader before the first block; compensated : whether a contour is open that the beginning does not
        close
        """
        log = self.log
        curved = Change(int(table[0, 9]), "G41 or G42 in force") if compensated and len(table) else None
        tilted = self.control is not None and self.control.frame is not None
        if log.repeats:
            again = self._copy()
            again.s.ended = False
            left = left_modes(begin.s, self.s, tilted=tilted)
            why = f" ({', '.join(left)})" if left else ""
            if change := curved or again._change(text, lines, table):
                log.remark("second_run", f"the program begins again with what it has left{why}: the second round has "
                           f"{change.what} in line {change.line}; set it back before this line", line=log.repeats)
            return
        if self.tables_written:
            again = begin._copy()
            for name in TABLES:
                setattr(again, name, copy.deepcopy(getattr(self, name)))
            again._take_zero()
            if change := again._change(text, lines, table):
                log.remark("second_run", "G10 leaves another value in the tables of the control than the program began "
                           f"with: its next run has {change.what} in line {change.line}; write the first value at the "
                           "beginning of the program, or back at its end", line=self.tables_written)
                return
        left = [*left_modes(begin.s, self.s, self.assumed, tilted), *(["G41 or G42"] if curved else [])]
        keeps = self.dialect in KEPT_MODES
        if not keeps:  # the tool stays on every control
            stays = ("in the spindle", *(("inches", "millimetres", "G90.1", "point control") if self.fits else ()))
            left = [word for word in left if word.endswith(stays)]
        if left or tilted:
            again = self._copy() if keeps else begin._copy()
            if not keeps and again.control is not None and self.control is not None and again.control.keep_frames(
                    self.control):
                left.append("a shift, a turn, a mirror, a scale or a tilted plane")
            again.s.ended = again.s.spindle = again.s.coolant = False
            again.s.position, again.s.tool = [NAN] * 3, self.s.tool
            for name in KEPT_BY_LINUXCNC if self.fits else ():
                setattr(again.s, name, getattr(self.s, name))
            if left and (change := curved or again._change(text, lines, table)):
                self.leaves_modes = (Assumed(
                    AssumedKind.MODES_LEFT, f"set back before the next run: {log.name} leaves {', '.join(left)}",
                    f"otherwise the next run has {change.what} in line {change.line} (LinuxCNC keeps these; else "
                    "parameter 3402 of Fanuc, setting 56 of Haas, machine data of Siemens, MP7300 or clearMode of "
                    "Heidenhain decide)",
                    "state them at the beginning of the program, or set them back at its end"),)

    def _turn_angles(self, begin: Reader, text: str, lines: list[str], table: F64) -> None:
        """Remark where the range of ATAN and ASIN, which a parameter of the control decides, changes the moves."""
        if not self.angle_line:
            return
        again = begin._copy()
        again.full_turns = True
        if change := again._change(text, lines, table):
            self.log.remark("angles", "ATAN or ASIN gives a negative angle here, or 360 deg more, as parameter 6004#0 "
                            f"decides; with the other range the program has {change.what} in line {change.line}: add "
                            "360 where the angle is less than 0", line=self.angle_line)

    def _count_words(self, begin: Reader, text: str, lines: list[str], table: F64) -> None:
        """Remark where a control that counts in its least increment goes elsewhere."""
        increment = None if self.control is None else self.control.increment
        if not self.fine_line or increment is None:
            return
        again = begin._copy()
        again.counts = True
        step = increment.step if self.s.scale == 1.0 else increment.inch_step
        first = self._way(table)
        if change := again._change(text, lines, table, lambda: first_drift(
                first, again._way(again.log.table()), again.log.errors, step, self._reach(table))):
            self.log.remark("increment", f"{increment.why}. So it has {change.what} in line {change.line}: "
                            f"{increment.remedy}", line=self.fine_line)

    def _way(self, table: F64) -> Way:
        """The reading as ``first_drift`` compares it; ``table`` (m, 10) is its log."""
        poses = self.log.turned.poses(len(table), self.machine)
        return Way(table, None if poses is None else poses.end_turn)

    def _reach(self, table: F64) -> float:
        """mm, how far the tip may be from a rotary axis."""
        if self.machine is None or self.machine.pivots is None or not len(table):
            return 0.0
        far = float(np.nanmax(np.abs(table[:, :6]), initial=0.0)) * math.sqrt(3.0)
        return far + max(math.hypot(*p) for p in self.machine.pivots) + max(self.gauge.values(), default=0.0)

    def _change(self, text: str, lines: list[str], table: F64,
                compared: Callable[[], Change | None] | None = None) -> Change | None:
        """The first line at which this reader, which stands at the beginning, runs otherwise than ``table`` (m, 10).

        compared : gives that line once this reader has run; None: any difference counts
        """
        try:
            self._scan(self._blocks(text, lines), bytearray(len(lines) + 2))
            self._finish()
            return compared() if compared else first_change(table, self.log.table(), self.log.errors)
        except ProgramError:  # it is too long, which the first run is not
            return Change(self.log.line, "too many moves")

    def _left_open(self) -> tuple[Assumed, ...]:
        """What the program leaves to the control."""
        self._settle_length()
        if self.control is not None:
            return (*self.control.assumed, *self.leaves_modes)
        if not self.by_axes:
            return self.leaves_modes
        return (*self.leaves_modes, Assumed(AssumedKind.TIP_CONTROL, f"off ({self.log.name}, line {self.by_axes})",
                        "kinematics such as xyzac-trt start with it on: X, Y and Z are then the tip, and the tool goes "
                        "elsewhere", "program M428 or M429 before the rotary axes turn"),)

    def angle(self, degrees: float) -> float:
        """An angle from -180 to 180 deg in the range that this reading takes for ATAN and ASIN."""
        self.angle_line = self.angle_line or (self.log.line if degrees < 0.0 else 0)
        return degrees + 360.0 if degrees < 0.0 and self.full_turns else degrees

    def served(self, key: int | str) -> float:
        """A parameter that the control serves (``verify.gcode.flow.system_parameters``)."""
        return served(self.s, key)

    def here(self) -> list[float]:
        """(3,) mm, the programmed place in the coordinates of the blocks; nan where it is unknown."""
        return self._here()

    def enter(self) -> None:
        """A subroutine begins: it has saved no modes."""
        self.saved.enter()

    def leave(self) -> None:
        """A subroutine ends: the modes that its M73 saved come back."""
        self.saved.leave(self.s)

    def _path_mode(self, table: F64) -> None:
        """Tell where the first feed move of ``table`` (m, 10) runs in a path mode that nothing states before it."""
        first = int(np.argmax(table[:, 6] == FEED)) if len(table) else 0
        if not len(table) or table[first, 6] != FEED:
            return
        if self.log.path_stated is not None and self.log.path_stated <= first:
            return
        if self.fits:
            self.log.remark("blending", "neither G61 nor G64 stands before this feed move: LinuxCNC starts in G64 "
                            "without a P, which lets the control leave the path by any amount (limit "
                            f"P{self.blend_limit:g} mm)", line=int(table[first, 9]))
        else:
            self.log.unbounded = True

    def _finish(self) -> None:
        """Write what a contour still holds back."""
        try:
            self._end_contour()
        except BlockError as problem:
            self.log.error(str(problem), remedy=problem.remedy)

    def _name_unread(self, lines: list[str], seen: bytearray) -> int:
        """Note the lines behind the end of the program that did not run.

        Returns the line of the end where such lines go on with the program, 0 where they begin another one.
        """
        end = self.log.line
        bare = (lines[k - 1].split("(")[0].split(";")[0].strip() for k in range(end + 1, len(lines) + 1))
        texts = [(k, text) for k, text in enumerate(bare, end + 1) if text and not _CLOSES.match(text)]
        rest = _unread(texts, [bool(seen[k]) or k in self.log.passed for k, _ in texts])
        if not rest:
            return 0
        first = rest[0][0]
        other = _OPENS.match(rest[0][1])
        what = f"{len(rest)} lines from {first} to {rest[-1][0]}"
        self.log.note(f"line {end} ends the program; {what} stand behind it and are not read"
                      + (f": line {first} begins another program" if other else ""))
        return 0 if other else end

    def _scan(self, blocks: Iterable[tuple[int, str]], seen: bytearray) -> int:
        """Run blocks with their lines; the fast path serves plain straight moves in the plain state only.

        seen : (lines + 2,) set to 1 at the number of each line that ran
        """
        s, log, fast, rows, full = self.s, self.log, straight(self.rotary), self.log.rows, Log.full
        percents = 0
        plain = begun = False
        for number, raw in blocks:
            seen[number] = 1
            if plain and (m := fast(raw)):
                g, x, y, z, *turns, f = m.groups()
                if g is not None:
                    s.motion = float(g)
                if s.motion == 1 or s.motion == 0:
                    if f is not None:
                        s.feed = float(f)
                    if any(turns):
                        if s.tcp and (s.motion == 0 or s.feed > 0):
                            log.line = number
                            self._tip_to((x, y, z), turns)
                            continue
                    else:
                        if x is None and y is None and z is None:
                            continue
                        px, py, pz = s.position
                        ex = px if x is None else float(x)
                        ey = py if y is None else float(y)
                        ez = pz if z is None else float(z)
                        s.position = [ex, ey, ez]
                        if len(rows) >= full:
                            log.flush()
                        if s.motion == 0:
                            rows.append((px, py, pz, ex, ey, ez, RAPID, NAN, s.tool, number))
                            continue
                        if s.feed > 0:
                            rows.append((px, py, pz, ex, ey, ez, FEED, s.feed * s.override, s.tool, number))
                            continue
                        s.position = [px, py, pz]
            log.line = number
            text = raw.strip()
            if text == "%":
                percents += 1
                if percents == 1 and begun:
                    log.error("a % within a program that does not begin with one")
                if percents == CLOSED:
                    break
                continue
            if text:
                begun = True
                self._block(text)
            if s.ended or len(log.errors) >= MAX_ERRORS:
                break
            plain = self._is_plain()
        return percents

    def _is_plain(self) -> bool:
        """Whether a straight move now needs nothing but its numbers."""
        s = self.s
        return (not s.relative and s.scale == 1.0 and s.feed_mode == 94 and s.turning and s.tool > 0
                and s.offset == s.tool and s.work_offset == self.work_offset and (s.tcp or not s.tilted)
                and not any(s.origin) and not self.pallet and self.actual is None and self._frame() is None
                and not self.turned
                and not any(math.isnan(v) for v in s.position))

    def _block(self, text: str) -> None:
        """Run one block. Order as on the control: speed, tool, spindle, modes, feed, motion, end."""
        before = len(self.log.errors)
        try:
            block = parse_block(text, self.rotary, self.control.further_words if self.control else ())
            for function in block.functions:
                self.log.functions.setdefault(function, self.log.line)
            self._set_modes(block)
            self._note_coordinates()
            self._move(block)
        except BlockError as problem:
            return self.log.error(str(problem), remedy=problem.remedy)
        if block.deleted:
            self.log.remark("block_delete", "a block with / depends on a switch of the machine; the proof runs it")
        if len(self.log.errors) == before:
            self._name_unused(block)
        if 2 in block.ms or 30 in block.ms:
            self.s.ended = True
        return None

    def _note_coordinates(self) -> None:
        """Record shifts and frames that are in force now."""
        frames = (None if self.control is None else self.control.frame, self.s.frame)
        key = (*frames, *self.s.origin)
        if key != self._noted:
            self._noted = key
            numbers = [n for f in frames if f is not None for n in (*f.matrix.flat, *f.shift)]
            shift = self.s.origin if any(self.s.origin) else []
            self.log.counts_in(tuple(round(float(n), 6) for n in (*shift, *numbers)))

    def _name_unused(self, block: Block) -> None:
        motion = self.s.motion
        moves = {28, 30, 53}.isdisjoint(block.codes) and not block.values.keys().isdisjoint(
            "XYZABCIJK@^" if motion in (2, 3) else "XYZABC@^")
        shrinks = self.control is not None and self.control.shrinking_pecks
        repeats = "LK" if self.control is None else self.control.repeats
        used = used_letters(block, motion, moves, "IJK" if shrinks else "", repeats)
        idle = [f"{letter}{number:g}" for letter, number in block.values.items() if letter not in used]
        if idle:
            self.log.remark("unused", f"no code of this block uses {', '.join(idle)}", self.log.line)


def _unread(texts: Sequence[tuple[int, str]], ran: Sequence[bool]) -> list[tuple[int, str]]:
    """The lines of which neither they nor another one of their subprogram ran.

    texts : lines behind the end of a program, with their numbers; ran : of each whether it ran

    A subprogram goes from its head to its return: lines that a condition left out belong to it.
    """
    rest: list[tuple[int, str]] = []
    begin = 0
    while begin < len(texts):
        end = begin
        while end < len(texts) and _OPENS.match(texts[end][1]):
            end += 1
        opened = end > begin
        while end < len(texts) and not _OPENS.match(texts[end][1]) and not (
                end > begin and _RETURNS.search(texts[end - 1][1])):
            end += 1
        part = range(begin, end)
        if not (opened and any(ran[begin:end])):
            rest += [texts[n] for n in part if not ran[n]
                     and not (_RETURNS.search(texts[n][1]) and n > begin and ran[n - 1])]
        begin = end
    return rest


def _reported(blocks: Iterable[tuple[int, str]], lines: int, report: Report) -> Iterator[tuple[int, str]]:
    """The blocks unchanged; reports the share of the lines every ``REPORT_LINES`` blocks."""
    for count, block in enumerate(blocks, 1):
        if count % REPORT_LINES == 0:
            report(block[0] / lines)
        yield block


def read_program(text: str, *, name: str = "program", tools: Collection[int] | None = None,
                 work_offset: str = "G54", blend_limit: float = BLEND_LIMIT, kinematics: Kinematics | None = None,
                 gauge_length: Mapping[int, float] | None = None, spindle_tool: int = 0,
                 report: Report = silent, dialect: str = LINUXCNC, radii: Mapping[int, float] | None = None,
                 names: Mapping[str, int] | None = None, change: Sequence[float] | None = None,
                 lengths: Mapping[int, float] | None = None, teeth: Mapping[int, int] | None = None,
                 measured: Collection[int] = (), chord: float = CHORD, max_feed: float | None = None) -> Program:
    """Read a program of three, four or five axes.

    text        : the program
    tools       : T numbers of the tool table; any number is accepted when None
    work_offset : the one of the setup, for example 'G54'
    blend_limit : mm, deviation that path blending (G64 P, Q) may have without a remark
    kinematics  : rotary axes of the machine; without them no rotary word is known
    gauge_length : mm by T number, spindle face to tip; a machine whose head tilts needs them in programs without
                  tool centre point control
    spindle_tool : T number in the spindle, its length offset on, before the first line; 0 for none
    report      : called with the share read, 0 to 1, every 4096 lines; an exception from it ends the reading
    dialect     : one of ``verify.gcode.dialects.DIALECTS``
    radii       : mm by T number, radius of the cutting part, for cutter radius compensation
    names       : T numbers by the ids of the tools, for programs that name their tools
    change      : mm, setup frame, Z or X, Y and Z of the spindle face at a tool change; None where it is not stated
    lengths     : mm by T number, spindle face to tip, of the tools whose length is known
    teeth       : numbers of teeth by T number, where they are known, for feeds per tooth
    measured    : T numbers of those whose length the setup states
    chord       : mm, from 0.0002 to 0.001, by which chords may leave their arcs
    max_feed    : mm/min of the machine, above which no word of the control takes the tool; None: not known

    Returns
    -------
    Program
        Tip moves in mm; arcs and turning blocks in pieces within 1e-3 mm of the path of the control.

    Raises
    ------
    ProgramError
        Lines that cannot be read; the subjects name them. Reasons are unknown words, two words of one modal group, a
        feed move without a feed, and an arc without a centre or with ends on two circles. Further reasons are a tool
        that is not in the table, an incomplete program, and a move of the joints off rotary zero without known
        pivots. Without a line: ``spindle_tool`` is not in the table. Code program_too_long: a block of more than
        200 000 moves, a program of more than 5 000 000, or a loop without an end.
    VerificationError
        Code unknown_dialect.

    Notes
    -----
    Words, modal groups and order of execution are those of RS274/NGC [Kramer2000] as LinuxCNC runs them.
    """
    if dialect not in DIALECTS:
        raise VerificationError(f"no reader knows the dialect '{dialect}'", code="unknown_dialect", measured=dialect,
                                limit=sorted(DIALECTS), remedy=f"name one of {', '.join(sorted(DIALECTS))}")
    text = cleaned(text)
    if "\r" in text:
        lone = text.count("\n", 0, text.index("\r")) + 1
        raise ProgramError(f"{name}, line {lone} holds a carriage return (CR) without a line feed (LF): controls "
                           "differ in whether a line ends there", subjects=(f"line {lone}",),
                           remedy="end every line by LF, or by CR and LF")
    if _BINARY.search(text):
        raise ProgramError(f"{name} is not a text file", remedy="send the NC program as text")
    if spindle_tool and tools is not None and spindle_tool not in tools:
        raise ProgramError(f"{name}: the tool in the spindle, T{spindle_tool}, is not in the tool table",
                           subjects=(f"T{spindle_tool}",), measured=spindle_tool, limit=sorted(tools),
                           remedy="give a tool of the table as spindle_tool")
    reader = Reader(Log(name), tools, work_offset, blend_limit, kinematics, gauge_length, spindle_tool)
    reader.radii, reader.names, reader.teeth = dict(radii or {}), dict(names or {}), dict(teeth or {})
    reader.chord, reader.max_feed = chord, max_feed
    reader.measured = frozenset(lengths or ()) & frozenset(measured)
    reader.change = None if change is None else tuple(change)
    reader.hangs, reader.stays = {0: 0.0, **(lengths or {})}, dialect == LINUXCNC
    return reader.read(text, report, dialect)


__all__ = ["FEED", "RAPID", "Program", "Reader", "Remark", "read_program"]
