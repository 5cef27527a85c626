"""Offset tables that a program writes: G10 for work offsets, tool lengths and cutter radii, and the offsets in force.

The proof knows the zero of the setup and the true lengths of the tools, not the numbers of the machine. The first value
that a program writes for the work offset of the setup, or for a length, stands for what is true; later values count as
differences from it. Another work offset written in the same coordinates is then known too. Wear is always a difference.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import TYPE_CHECKING

from verify.assumptions import Assumed, AssumedKind
from verify.gcode.block_words import WORK_OFFSETS, BlockError, whole
from verify.gcode.modal_state import Modes

if TYPE_CHECKING:
    from verify.gcode.dialects.base import DialectReader

LENGTHS_APART = 1.0
"""mm by which written lengths of two tools may differ from what the setup says: measured ones differ by tenths."""
Axes = list[float | None]
NAMES = list(WORK_OFFSETS.values())


class OffsetTables(Modes):
    """Tables of work offsets, lengths and radii as far as the program writes them.

    zeros   : mm by name of a work offset, (3,) from the zero of the setup, nan where unknown
    written : mm by name, (3,) as the program wrote them in machine coordinates, nan where it has not
    lengths : mm by H number, the first value written and the present one; the first is nan where G91 only added to it
    wear    : mm by H number
    registers : mm by D number, radius that the program wrote; radius_wear : mm by D number
    measured : T numbers of the tools whose length the setup states
    pending  : line of the G10 that wrote the length in force, number of moves before it, H number, and mm by which it
               changed; None where G43 came after it
    tables_written : line of the latest G10 that wrote one of these, 0 for none
    """

    zeros: dict[str, list[float]]
    written: dict[str, list[float]]
    lengths: dict[int, tuple[float, float]]
    wear: dict[int, float]
    registers: dict[int, float]
    radius_wear: dict[int, float]
    radii: dict[int, float]
    tables_written = 0
    measured: Collection[int] = ()
    pending: tuple[int, int, int, float] | None = None
    register: int | None
    control: DialectReader | None

    def _open_tables(self) -> None:
        """Empty tables; only the work offset of the setup is known."""
        self.zeros, self.written = {self.work_offset: [0.0] * 3}, {}
        self.lengths, self.wear, self.registers, self.radius_wear, self.radii = {}, {}, {}, {}, {}

    def _zero_name(self, name: str) -> str:
        """The word of the program for a work offset."""
        raise NotImplementedError

    @property
    def _foreign(self) -> bool:
        """Whether the control has the words of LinuxCNC translated: its G10 counts tool data in its own way."""
        raise NotImplementedError

    def _set_table(self, values: dict[str, float], axes: Axes) -> None:
        """Run G10 L1, L2 and L10 to L13; L20 has its own place."""
        self.tables_written = self.log.line
        kind = int(values.get("L", -1))
        if kind == 2:
            return self._set_zero(values, axes)
        if "P" not in values:
            raise BlockError(f"G10 L{kind} needs P, the number of the tool or register")
        if kind in (1, 10, 11, 12, 13) and any(a is not None for a in axes[:2]):
            raise BlockError(f"G10 L{kind} with X or Y (the offset of a turning tool)")
        number = whole(values, "P", 1)
        if kind == 1 and not self._foreign:
            if "R" in values:
                self.registers[number] = values["R"] * self.s.scale
            if axes[2] is not None:
                self._set_length(number, axes[2] * self.s.scale)
        elif kind in (1, 10, 11, 12, 13) and self._foreign and "R" in values:
            self._set_register(kind, number, values["R"] * self.s.scale)
        else:
            raise BlockError(f"G10 L{kind} (a changed tool table)")
        self.log.note(f"line {self.log.line}: G10 L{kind} P{number} writes the tool table of the control")
        return None

    def _set_register(self, kind: int, number: int, value: float) -> None:
        s = self.s
        if kind in (1, 10):
            self._set_length(number, value)
            self._pend_length(number)
        elif kind == 11:
            self.wear[number] = value + (self.wear.get(number, 0.0) if s.relative else 0.0)
            self._pend_length(number)
        elif kind == 12 and s.relative and number not in self.registers:
            self.radius_wear[number] = value + self.radius_wear.get(number, 0.0)
        elif kind == 12:
            self.registers[number] = value + (self.registers[number] if s.relative else 0.0)
        else:
            self.radius_wear[number] = value + (self.radius_wear.get(number, 0.0) if s.relative else 0.0)

    def _set_length(self, number: int, value: float) -> None:
        first, now = self.lengths.get(number, (math.nan, 0.0))
        if self.s.relative and self._foreign:  # adds to what the control holds
            self.lengths[number] = first, now + value
        else:
            self.log.lengths.setdefault(number, (value, self.log.line))
            self.lengths[number] = value if math.isnan(first) else first, value

    def _judge_lengths(self) -> None:
        """Remark lengths of tools that the program gives and that differ otherwise than those of the setup."""
        given = {t: (value, line) for t, (value, line) in self.log.lengths.items() if t in self.measured}
        if not given:
            return
        first, *rest = given
        for t in rest:
            (a, _), (b, line) = given[first], given[t]
            apart, wanted = b - a, self.hangs[t] - self.hangs[first]
            if abs(apart - wanted) > LENGTHS_APART:
                self.log.remark("lengths", f"the program gives T{first} the length {a:g} mm and T{t} {b:g} mm, "
                                f"{apart:g} mm more; by their gauge_length_mm it is {wanted:g} mm more", t, line)

    def _pend_length(self, number: int) -> None:
        """Keep that the length in force was written: parameters decide whether it counts at once."""
        s = self.s
        changed = self._length_error(number) - s.length
        if self._foreign and s.offset is not None and number == self.register and abs(changed) > 1e-9:
            self.pending = self.log.line, self.log.count, number, changed

    def _settle_length(self) -> None:
        """Tell of moves since the length in force was written, before another one comes into force."""
        if self.pending is None or self.control is None:
            return
        line, count, number, by = self.pending
        self.pending = None
        if self.log.count > count:
            self.control.leave_open(Assumed(
                AssumedKind.LENGTH_REGISTER, f"H{number}, which line {line} writes while it is in force, counts from "
                "the next G43 on", f"where the control takes it at once, the tool goes {abs(by):g} mm "
                f"{'lower' if by < 0.0 else 'higher'}", "G43 H behind the G10 (parameter 5001#6 of Fanuc)"))

    def _length_error(self, number: int) -> float:
        """mm, by which length offset H ``number`` differs from the length of its tool."""
        first, now = self.lengths.get(number, (0.0, 0.0))
        return now - (0.0 if math.isnan(first) else first) + self.wear.get(number, 0.0)

    def _own_register(self, number: int) -> bool:
        """Whether a register that no tool has by number belongs to the tool in the spindle.

        Shops number further registers in tens: H21, H51 or H101 with T1. Another difference may be a mistake.
        """
        tool = self.s.tool
        return number in self.lengths or (self._foreign and tool > 0 and number > tool and (number - tool) % 10 == 0)

    def _written_radius(self, number: int, tool: float | None) -> float | None:
        """mm, radius in D ``number`` where the program wrote it; ``tool`` is the radius of the tool, or None.

        Whether a register holds radius or diameter is a setting of the control: the nearer one counts.
        """
        wear = self.radius_wear.get(number, 0.0)
        held = self.registers.get(number, tool if number in self.radius_wear else None)
        if held is None:
            return None
        if number in self.registers and self._foreign and tool is not None and abs(held - 2 * tool) < abs(held - tool):
            held /= 2
            self.log.note(f"D{number} counts as a diameter: {2 * held:g} mm is nearer to that of the tool than to its "
                          "radius")
        return held + wear

    def _set_zero(self, values: dict[str, float], axes: Axes) -> None:
        """G10 L2: a work offset in machine coordinates."""
        s = self.s
        number = 0 if values.get("P") == 0 else whole(values, "P", len(NAMES) + 1)
        if "R" in values and values["R"] != 0:
            raise BlockError("G10 L2 with R (a rotated frame)")
        if number > len(NAMES):
            raise BlockError(f"G10 L2 needs P, the number of the work offset from 0 to {len(NAMES)}")
        if number == 0 and self._foreign:
            if any(axes):
                raise BlockError("G10 L2 P0 (a common shift of all work offsets)")
            return
        name = NAMES[number - 1] if number else s.work_offset
        for k, axis in enumerate(axes):
            if axis is not None:
                self._write_zero(name, k, axis * s.scale)
        self._take_zero()
        self.log.note(f"line {self.log.line}: G10 L2 writes {name}; the first values written for {self.work_offset} "
                      "count as the zero of the setup")

    def _write_zero(self, name: str, k: int, value: float) -> None:
        own = self.work_offset
        written = self.written.setdefault(name, [math.nan] * 3)
        zero = self.zeros.setdefault(name, [math.nan] * 3)
        if self.s.relative:
            if name != own and math.isnan(written[k]):
                raise BlockError(f"G10 L2 in G91 of {name}, which the program has not written before")
            if math.isnan(written[k]):
                written[k] = 0.0
            value += written[k]
        first = math.isnan(written[k])
        if name == own and first:
            if zero[k] != 0 or self.log.cuts:
                raise BlockError(f"G10 L2 of {own} after feed moves: the zero before it is unknown")
            self.s.position[k] = math.nan
            written[k] = value
            for other, numbers in self.written.items():
                if other != own and not math.isnan(numbers[k]):
                    self.zeros[other][k] = numbers[k] - value
            return
        base = self.written.get(own, [math.nan] * 3)[k] - self.zeros[own][k]
        written[k] = value
        zero[k] = value - base

    def _select_zero(self, name: str) -> None:
        """Put a work offset in force."""
        s = self.s
        s.work_offset = name
        if name != self.work_offset and any(map(math.isnan, self.zeros.get(name, [math.nan]))):
            self.log.remark("work_offset", f"{self._zero_name(name)} is not the work offset of the setup "
                            f"({self.work_offset})", name)
        self._take_zero()

    def _take_zero(self) -> None:
        own = self.zeros[self.work_offset]
        held = self.zeros.get(self.s.work_offset, own)
        self.s.table = [o if math.isnan(z) else z for z, o in zip(held, own, strict=True)]
