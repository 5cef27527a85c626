"""CYCLE800 and programmable frames of Siemens: TRANS, ROT, MIRROR, SCALE and their additive forms."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from geometry.mesh import F64
from verify.gcode.dialects.base import BlockError, DialectReader
from verify.gcode.dialects.orientation import angles_of, needed
from verify.gcode.dialects.oriented_moves import OrientedMoves
from verify.gcode.dialects.stated_places import digits, level
from verify.gcode.dialects.tilted_planes import turn
from verify.gcode.frames import Frame, about, rotation, scaling, translation

SWINGS = {1: ("G0 G53 Z0",), 2: ("G0 G53 Z0", "G0 G53 X0 Y0")}
"""Retracts of CYCLE800 before it turns axes, in words of the reader."""
_ORIGIN = (0.0, 0.0, 0.0)
SAME = 1e-9  # mm


class SiemensFrames(OrientedMoves):
    """Frames in force.

    programmed : the programmable frame, None for none
    swivel     : the plane of CYCLE800, None for none
    swung      : whether that plane has its rotary axes turned, the tip kept by the reader
    shifted    : axes whose coordinates have changed since their last absolute word
    """

    vector_words, tcp_word = "a tool vector (A3, B3, C3)", "TRAORI"

    def __init__(self) -> None:
        super().__init__()
        self.programmed: Frame | None = None
        self.swivel: Frame | None = None
        self.swung = False
        self.shifted: set[str] = set()

    def keep_frames(self, ended: DialectReader) -> bool:
        """Take the plane of CYCLE800 over: machine data decide whether M30 ends it."""
        if isinstance(ended, SiemensFrames):
            self.frame = self.swivel = ended.swivel
            self.swung = ended.swung
        return self.frame is not None

    def _reframe(self) -> None:
        """State the frame of the blocks that follow."""
        self.uncompensated("a change of the coordinates (TRANS, ROT, MIRROR, SCALE, CYCLE800)")
        whole = self.swivel
        if self.programmed is not None:
            whole = self.programmed if whole is None else whole @ self.programmed
        before, self.frame = self.here(), whole
        self.forget()
        self.shifted |= {k for k, a, b in zip("XYZ", before, self.here(), strict=True) if not abs(a - b) <= SAME}

    def counts(self, letter: str, relative: bool) -> None:
        """Take a word of an axis.

        Raises
        ------
        BlockError
            It is an increment, and the coordinates of its axis have changed since its last absolute word.
        """
        if relative and letter in self.shifted:
            raise BlockError(f"an increment of {letter} behind a change of its coordinates (a frame, a tool length): "
                             "setting data 42440 and 42442 decide whether the control goes the change too",
                             f"program {letter} in absolute coordinates first")
        self.shifted.discard(letter)

    def program_frame(self, word: str, places: Mapping[str, float], values: Mapping[str, float]) -> None:
        """TRANS, ROT, MIRROR or SCALE (which replace the frame) or ATRANS, AROT, AMIRROR, ASCALE (which add to it).

        places : numbers of X, Y, Z; values : those of RPL

        Raises
        ------
        BlockError
            The frame cannot be followed.
        """
        additive = len(word) > 3 and word[0] == "A"
        kind = word[1:] if additive else word
        if not places and "RPL" not in values:
            if additive:
                raise BlockError(f"{word} without an axis")
            self.programmed = None
            return self._reframe()
        step = self._step(kind, places, values)
        old = self.programmed if additive else None
        new = step if old is None else old @ step
        if not self.tcp and not self.swung and not level(new):
            raise BlockError(f"{word} tilts the coordinates, and nothing keeps the tip (TRAORI, CYCLE800)",
                             "turn about Z only, or use CYCLE800")
        self.programmed = new
        return self._reframe()

    def program_again(self, frame: Frame | None) -> None:
        """Put a programmable frame of before in force, or none."""
        self.programmed = frame
        self._reframe()

    def _step(self, kind: str, places: Mapping[str, float], values: Mapping[str, float]) -> Frame:
        numbers = [places.get(k, 0.0) for k in "XYZ"]
        if kind == "TRANS":
            return translation([self.unit * v for v in numbers])
        if kind == "SCALE":
            return scaling([places.get(k, 1.0) for k in "XYZ"])
        if kind == "MIRROR":
            return scaling([-1.0 if k in places else 1.0 for k in "XYZ"])
        if "RPL" in values:
            if places:
                raise BlockError("RPL with axes in one ROT")
            return rotation(self.machine.s.plane, math.radians(values["RPL"]))
        x, y, z = (math.radians(v) for v in numbers)
        return about(turn(2, z) @ turn(1, y) @ turn(0, x), _ORIGIN)

    def swivelled(self, parts: Sequence[str], number: Callable[[str], float]) -> list[str]:
        """Blocks of CYCLE800: turn the coordinates, and the rotary axes where it says so, or end that.

        parts  : its arguments as text
        number : evaluates one

        Raises
        ------
        BlockError
            The call cannot be followed.
        """
        if list(parts) == [""]:
            out = ["M429"] if self.swung else []
            self.swivel, self.swung = None, False
            self._reframe()
            return out
        call = f"CYCLE800({','.join(parts)})"[:60]
        if not 14 <= len(parts) <= 16 or parts[15:] not in ([], [""], ["0"], ["1"]):
            raise BlockError(f"{call} needs its 15 arguments as plain numbers, the second a name; the last may "
                             "be left out")
        retract, state, mode = (number(parts[k] or "0") for k in (0, 2, 3))
        before, angles, after = ([number(v or "0") for v in parts[k:k + 3]] for k in (4, 7, 10))
        direction = number(parts[13] or "0")
        if direction == 0.0 and not self.tcp:
            raise BlockError(f"{call} needs direction 0, which moves no axis, and TRAORI on, or direction -1 or 1")
        if direction not in (-1.0, 0.0, 1.0) or (direction and self.tcp):
            raise BlockError(f"{call} needs direction 0, which moves no axis, while TRAORI is on, else -1 or 1")
        if state % 100000 or not 0 <= state <= 200000:
            raise BlockError(f"{call} needs a new plane that does not follow the tip (0, 100000, 200000)")
        if mode != 57.0 and (any(angles) or mode >= 64 or mode < 0):
            raise BlockError(f"{call} needs a rotation axis by axis about X, Y, Z (57)")
        if not direction and retract:
            raise BlockError(f"{call} needs a call without retract (0) where it moves no axis")
        if self.relative:
            raise BlockError(f"{call} in incremental coordinates")
        if not self.swung and self.swivel is not None:
            raise BlockError(f"{call} in incremental coordinates, or within the plane of another CYCLE800")
        a, b, c = (math.radians(v) for v in angles)
        matrix = turn(0, a) @ turn(1, b) @ turn(2, c)
        out = self._swing(call, retract, matrix, direction) if direction else []
        shifts = [[self.unit * v for v in shift] for shift in (before, after)]
        self.swivel = translation(shifts[0]) @ about(matrix, _ORIGIN) @ translation(shifts[1])
        if direction and not any(angles) and not any(before) and not any(after):
            self.swivel = None
        self.programmed = None
        self._reframe()
        return out

    def _swing(self, call: str, retract: float, matrix: F64, direction: float) -> list[str]:
        """Blocks that turn the rotary axes to the plane with these axes as columns."""
        out = ["M429"] if self.swung else []
        if retract in SWINGS:
            out += SWINGS[int(retract)]
        elif retract:
            raise BlockError(f"{call} retracts along the tool ({retract:g}): only Z (1) or Z, X and Y (2) of the "
                             f"machine "
                             "are followed")
        upright = bool(np.abs(matrix[:2, 2]).max() < 1e-12 and matrix[2, 2] > 0)
        if upright and self.machine.machine is None:
            return out
        machine = needed(self.machine.machine, "CYCLE800")
        near = self.machine.s.turn
        angles = [0.0, 0.0] if upright else angles_of(machine, matrix[:, 2].tolist(), near, int(direction),
                                                            machine.limits)
        out.append("G0 " + " ".join(f"{k}{digits(v)}" for k, v in zip(machine.letters, angles, strict=True)))
        self.swung = not upright
        if self.swung:
            out.append("M428")
        return out


__all__ = ["SiemensFrames"]
