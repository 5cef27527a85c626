"""Program zero: G92 to G92.3, G52, G10 L20, and the places of polar words.

All of them are exact, because the zero of the setup is known: a shift is the place of the tip minus its programmed
number. ``verify.gcode.offset_tables`` runs the other forms of G10.

LinuxCNC keeps the shifts of G52 and G92 in one register: the later word replaces the shift of the axes it names. Fanuc
and Haas have two. There G52 is a local system within the shifted one, ``G52 X0`` ends only that, and G92 ends the local
shift of the axes that it names. G92.1 of Fanuc presets the named axes, which ends both of their shifts; Haas has no
G92.1. No control is counted on to end a shift at M30: parameters decide it there.
"""

from __future__ import annotations

import math

from verify.gcode.block_words import MOTION_CODES, WORK_OFFSETS, Block, BlockError, whole
from verify.gcode.offset_tables import OffsetTables

Axes = list[float | None]


class Origins(OffsetTables):
    """Shifts of program zero, and polar words of the running block."""

    polar: tuple[float | None, float | None] | None = None

    @property
    def cancel_shift(self) -> str:
        """What ends all shifts on this control, in words of a remark."""
        if self._foreign:
            return "cancel it with G52 X0 Y0 Z0, and with a G92 that sets the old numbers again"
        return "cancel it with G92.1"

    def _shift_origin(self, block: Block, axes: Axes) -> None:
        """Run the word of a block that moves program zero."""
        word = next(g for g in block.codes if g in (10, 52, 92, 92.1, 92.2, 92.3))
        moved = [g for g in block.codes if g in MOTION_CODES - {80}]
        if moved:
            raise BlockError(f"G{word:g} and G{moved[0]:g} in one block: both use the coordinates")
        if self.polar:
            raise BlockError(f"polar words with G{word:g}: it takes X, Y and Z")
        if turned := [letter for letter in self.rotary if letter in block.values]:
            raise BlockError(f"G{word:g} {turned[0]} (a shifted rotary zero): it takes X, Y and Z")
        if word == 92.1 and self._foreign:
            return self._preset(axes)
        if word in (92.1, 92.2, 92.3):
            if any(a is not None for a in axes):
                raise BlockError(f"G{word:g} takes no coordinates")
            return self._recall(word)
        s = self.s
        if word == 10 and block.values.get("L") in (1, 2, 10, 11, 12, 13):
            return self._set_table(block.values, axes)
        if all(a is None for a in axes):
            raise BlockError(f"G{word:g} needs X, Y or Z")
        if s.frame is not None:
            raise BlockError(f"G{word:g} while the coordinates are rotated, scaled or mirrored")
        if word == 10:
            return self._table(block.values, axes)
        if word == 52 and self._foreign and s.relative:
            raise BlockError("G52 in incremental coordinates (G91), which controls read differently")
        local = s.local if self._foreign else s.shift
        for k, axis in enumerate(axes):
            if axis is None:
                continue
            if word == 52:
                local[k] = axis * s.scale
            else:
                s.shift[k] = self._known(k, word) - s.table[k] - axis * s.scale - (s.length if k == 2 else 0.0)
                s.local[k] = 0.0
        s.kept = list(s.shift)
        self._tell(f"G{word:g}")
        return None

    def _preset(self, axes: Axes) -> None:
        """G92.1 of Fanuc: the axes named have no shift, neither of G92 nor of G52."""
        if all(a is None for a in axes) or any(axes):
            raise BlockError("G92.1 names the axes that it sets back, each with 0", "write G92.1 X0 Y0 Z0")
        if self.s.side or (self.s.offset and axes[2] is not None):
            raise BlockError("G92.1 while a tool length (G43) or cutter radius compensation is on: the control drops "
                             "it", "end them before, and state them again behind it")
        for k, axis in enumerate(axes):
            if axis is not None:
                self.s.shift[k] = self.s.local[k] = 0.0
        self._tell("G92.1")

    def _recall(self, word: float) -> None:
        s = self.s
        s.shift = list(s.kept) if word == 92.3 else [0.0] * 3
        if word == 92.1:
            s.kept = [0.0] * 3
        if word == 92.3:
            if not any(s.shift):
                raise BlockError("G92.3 restores a shift that the program has not set but a program before; set it "
                                 "with G92")
            self._tell("G92.3")

    def _table(self, values: dict[str, float], axes: Axes) -> None:
        """G10 L20 of the work offset of the setup: the place of the tip gets the programmed numbers."""
        s = self.s
        names = list(WORK_OFFSETS.values())
        if values.get("L") != 20:
            kind = f"L{values['L']:g}" if "L" in values else "without L"
            raise BlockError(f"G10 {kind} (a changed offset table): only L20 can be read; it states a place")
        if "R" in values:
            raise BlockError("G10 with R (a rotated frame)")
        number = 0 if values.get("P") == 0 else whole(values, "P", len(names) + 1)
        if number > len(names):
            raise BlockError(f"G10 L20 needs P, the number of the work offset from 0 to {len(names)}")
        own = names[number - 1] if number else s.work_offset
        zero = self.zeros.setdefault(own, [math.nan] * 3)
        for k, axis in enumerate(axes):
            if axis is not None:
                moved = self._known(k, 10) - s.shift[k] - s.local[k] - axis * s.scale - (s.length if k == 2 else 0.0)
                if own in self.written:
                    self.written[own][k] += moved - zero[k]
                zero[k] = moved
        self._take_zero()
        self.log.remark("offset_table", f"G10 L20 writes {own} into the offset table of the control: the next run of "
                        "the program starts from another zero", self.log.line)

    def _known(self, k: int, word: float) -> float:
        s = self.s
        place = s.position[k]
        if k == 2 and s.length_off:
            raise BlockError(f"G{word:g} Z while the length offset is off does not name the place of the tip; give G43 "
                             f"H{s.tool} first")
        if math.isnan(place):
            raise BlockError(f"G{word:g} {'XYZ'[k]} sets an unknown shift because the program has not stated "
                             f"{'XYZ'[k]}; state the place first")
        return place

    def _tell(self, word: str) -> None:
        moved = [g92 + g52 for g92, g52 in zip(self.s.shift, self.s.local, strict=True)]
        shift = " ".join(f"{a}{v:.4f}" for a, v in zip("XYZ", moved, strict=True) if v)
        self.log.note(f"line {self.log.line}: {word} moves program zero to {shift or 'the zero of the setup'} mm")

    def _polar_words(self, block: Block) -> None:
        """Store the polar words of a block; ``_polar_place`` gives its coordinates."""
        self.polar = None
        values = block.values
        if values.keys().isdisjoint("@^"):
            return
        if self.s.plane != 17:
            raise BlockError(f"polar words in plane G{self.s.plane}: they are read in G17 only")
        if not values.keys().isdisjoint("XY"):
            raise BlockError("polar words and X or Y in one block")
        if not {28, 30, 53}.isdisjoint(block.codes):
            raise BlockError("polar words in a move to a fixed place of the machine (G28, G30, G53)")
        self.polar = values.get("@"), values.get("^")

    def _polar_place(self, radius: float | None, angle: float | None) -> tuple[float, float]:
        """X and Y, mm in the setup frame, of the polar words: radius and angle round program zero from the X axis.

        An absent word, and both words in incremental coordinates, continue from the place of the tip.
        """
        s = self.s
        x, y = s.position[0] - s.origin[0], s.position[1] - s.origin[1]
        whole_place = radius is not None and angle is not None and not s.relative
        if math.isnan(x + y) and not whole_place:
            raise BlockError("a polar word continues from a place that the program has not stated")
        if x == 0 and y == 0 and (s.relative or (angle is None and radius is not None)):
            raise BlockError("polar words continue from program zero, which has no angle: give @ and ^ in G90")
        here, turned = math.hypot(x, y), math.degrees(math.atan2(y, x)) if not whole_place else 0.0
        if s.relative:
            distance, turned = here + (radius or 0.0) * s.scale, turned + (angle or 0.0)
        else:
            distance = here if radius is None else radius * s.scale
            turned = turned if angle is None else angle
        return (s.origin[0] + distance * math.cos(math.radians(turned)),
                s.origin[1] + distance * math.sin(math.radians(turned)))
