"""Places of a control whose coordinates are turned: what it knows of a place that the reader cannot say yet.

In a turned frame one coordinate of a control is several of the setup. After a move to the top of the travel only some
of a control's coordinates are known, and a rapid above everything may name the others one by one. Such a rapid is held
back until the place is known whole: its coordinates are kept here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from geometry.mesh import F64
from verify.gcode.dialects.base import BlockError, DialectReader, Machine
from verify.gcode.frames import Frame


class StatedPlaces(DialectReader):
    """A reader of words that may turn its coordinates.

    machine : the reader that runs the blocks
    pending : (3,) mm, coordinates of rapids that are held back, nan elsewhere
    """

    machine: Machine

    def __init__(self) -> None:
        super().__init__()
        self.pending = [math.nan] * 3

    @property
    def unit(self) -> float:
        """mm for one unit of the program."""
        return self.machine.s.scale

    def here(self) -> list[float]:
        """(3,) mm, the programmed place in the coordinates of the control; nan where it is unknown."""
        place = self.machine.here()
        return [p if p == p else q for p, q in zip(place, self.pending, strict=True)]

    def known(self, word: str) -> list[float]:
        """The place where the block starts, (3,) mm.

        Raises
        ------
        BlockError
            It is unknown; ``word`` is what needs it.
        """
        place = self.here()
        if any(math.isnan(v) for v in place):
            raise BlockError(f"{word} needs a place that the program has stated, in X, Y and Z")
        return place

    def uncompensated(self, word: str) -> None:
        """Refuse a block that cutter radius compensation does not go with.

        Raises
        ------
        BlockError
            Compensation is on; ``word`` names the block.
        """
        if self.machine.s.side:
            raise BlockError(f"{word} while cutter radius compensation is on", "end the compensation in a block before")

    def forget(self) -> None:
        """Drop what is held back: the tool went to a place of the machine, or the coordinates are others now."""
        self.pending = [math.nan] * 3

    def settle(self, words: Mapping[str, str], rapid: bool) -> dict[str, str] | None:
        """Words X, Y, Z of a move so that the reader knows its end; None where a rapid is held back.

        words : text of the numbers by letter, absolute, in units of the program
        rapid : whether the move is one

        Raises
        ------
        BlockError
            A feed move to a place that is not known whole.
        """
        out = dict(words)
        if self.frame is None or not words.keys() & set("XYZ"):
            return out
        named = [float(words[k]) * self.unit if k in words else math.nan for k in "XYZ"]
        full = [n if n == n else h for n, h in zip(named, self.here(), strict=True)]
        known = self.machine.here()
        for group in coupled(self.frame.matrix):
            if all(math.isnan(named[k]) for k in group):
                continue
            if any(math.isnan(full[k]) for k in group):
                if not rapid:
                    raise BlockError("a move in turned coordinates (a tilted plane, a rotation) starts at a place that "
                                     "the program has not stated")
                for k in group:
                    self.pending[k] = full[k]
                    out.pop("XYZ"[k], None)
                continue
            for k in group:
                if math.isnan(named[k]) and math.isnan(known[k]):
                    out["XYZ"[k]] = digits(full[k] / self.unit)
                self.pending[k] = math.nan
        return out if out.keys() & set("XYZ") else None


def coupled(matrix: F64) -> list[list[int]]:
    """Groups of axes whose coordinates a frame mixes.

    matrix : (3, 3) float64, dimensionless, of the frame to the setup frame
    """
    mixed = (np.abs(matrix) > 1e-12) | (np.abs(matrix.T) > 1e-12)
    left, out = set(range(3)), []
    while left:
        group = {min(left)}
        while True:
            more = {j for i in group for j in range(3) if mixed[i, j]} - group
            if not more:
                break
            group |= more
        out.append(sorted(group))
        left -= group
    return out


def digits(number: float) -> str:
    """A number as text without an exponent, which reads back to within 1e-12."""
    text = repr(float(number))
    return f"{number:.12f}" if "e" in text or "n" in text else text


def level(frame: Frame) -> bool:
    """Whether a frame leaves the Z axis along Z."""
    m = frame.matrix
    return bool(np.abs([m[0, 2], m[1, 2], m[2, 0], m[2, 1]]).max() < 1e-12 and m[2, 2] > 0)


__all__ = ["StatedPlaces", "coupled", "digits", "level"]
