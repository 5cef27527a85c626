"""Corners of Siemens contours: RND and RNDM round them, CHF and CHR cut them off.

A move before a corner is held back until the next one is known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from verify.gcode.dialects.base import BlockError
from verify.gcode.dialects.corners import Leg, chamfer, rounding
from verify.gcode.dialects.siemens.siemens_paths import SiemensPaths
from verify.gcode.dialects.stated_places import digits
from verify.program.arc_chords import PLANE_AXES, ArcError, centre_from_radius


@dataclass(frozen=True)
class Cornered:
    """A move in the plane next to a corner.

    number : its line; head : other words of its block; word : G0 to G3; leg : in the plane, mm
    end    : (3,) mm; feed : the F word, or ''; corner : name and size, mm, of the corner at its end, None for none
    modal  : the F word in force at its end, or ''; rate : the F word of its corner, or ''
    """

    number: int
    head: tuple[str, ...]
    word: str
    leg: Leg
    end: tuple[float, ...]
    feed: str
    corner: tuple[str, float] | None = None
    modal: str = ""
    rate: str = ""


class SiemensCorners(SiemensPaths):
    """Moves that are held back.

    held   : the move before a corner, None for none
    always : mm, radius of RNDM, 0 for none; slow : feed of all corners (FRCM), 0 for that of the moves
    number : of the line
    """

    def __init__(self) -> None:
        super().__init__()
        self.held: Cornered | None = None
        self.always = self.slow = 0.0
        self.number = 0

    @property
    def cornering(self) -> bool:
        """Whether a corner is pending, or every corner is rounded."""
        return self.held is not None or self.always > 0

    def here(self) -> list[float]:
        """(3,) mm, the programmed place after all moves, also the one held back."""
        return super().here() if self.held is None else list(self.held.end)

    def unheld(self, word: str) -> None:
        """Refuse a block between a corner and the move after it.

        Raises
        ------
        BlockError
            A move is held back.
        """
        if self.held is not None:
            raise BlockError(f"{word} between a corner (RND, RNDM, CHF, CHR) and the move after it")

    def corner_of(self, values: Mapping[str, float]) -> tuple[str, float] | None:
        """Name and size, mm, of the corner at the end of a block.

        Raises
        ------
        BlockError
            Two corners, or a negative size.
        """
        self.slow = values.get("FRCM", self.slow)
        if "RNDM" in values:
            self.always = values["RNDM"] * self.unit
        named = [(k, values[k] * self.unit) for k in ("RND", "CHR", "CHF") if k in values]
        if len(named) > 1 or any(size < 0 for _, size in named) or self.always < 0:
            raise BlockError("two corners in one block, or a corner with a negative size")
        corner = named[0] if named else ("RNDM", self.always)
        return corner if corner[1] > 0 else None

    def cornered(self, head: Sequence[str], word: str, end: Sequence[float], centre: Mapping[str, str],
                 values: Mapping[str, float], corner: tuple[str, float] | None) -> list[str | tuple[int, str]]:
        """Blocks of a move at a corner: what was held back, the corner, and the move unless it is held back itself.

        head   : other words of its block; word : G0 to G3; end : (3,) mm
        centre : words I, J, K from the start; values : CR and F
        corner : at its end, None for none

        Raises
        ------
        BlockError
            The corner does not fit.
        """
        start = self.known("a corner (RND, CHF, CHR)")
        i, j, k = PLANE_AXES[self.machine.s.plane]
        if abs(end[k] - start[k]) > 1e-9:
            raise BlockError("a corner (RND, CHF, CHR) between moves that leave the plane")
        middle = self._centre(start, end, word, centre, values)
        leg = Leg(complex(start[i], start[j]), complex(end[i], end[j]), middle, word == "G3")
        s = self.machine.s
        modal = "" if math.isnan(s.feed) or s.feed_mode == 93 else f"F{digits(s.feed / s.scale)}"
        if self.held is not None:
            modal = self.held.modal
        if "F" in values:
            modal = f"F{digits(values['F'])}"
        slow = values.get("FRC", self.slow)
        feed = modal if word != "G0" or "F" in values else ""
        others = tuple(w for w in head if w not in ("G0", "G1", "G2", "G3"))
        move = Cornered(self.number, others, word, leg, tuple(end), feed, corner, modal,
                        f"F{digits(slow)}" if slow else "")
        out: list[str | tuple[int, str]] = []
        if self.held is not None:
            if any(w.startswith(("G40", "G41", "G42")) for w in move.head):
                raise BlockError("a corner (RND, CHF, CHR) where cutter radius compensation begins or ends")
            held, self.held = self.held, None
            try:
                between, move = self._between(held, move)
            except BlockError as problem:
                raise BlockError(str(problem), problem.remedy, held.number) from None
            out += between
        t = leg.tangent(True)
        way = [0.0] * 3
        way[i], way[j] = t.real, t.imag
        self.heading = (list(end), way)
        if corner is not None:
            self.held = move
            return out
        return [*out, self._text(move)]

    def changes_plane(self, codes: Sequence[int]) -> bool:
        """Whether the G words of a block select another plane."""
        return any(n in (17, 18, 19) and n != self.machine.s.plane for n in codes)

    def flushed(self) -> list[str | tuple[int, str]]:
        """The block of the move held back, with its corner left out.

        The control puts no corner between moves of which one leaves the plane, where the plane changes, and at the end
        of the program.
        """
        held, self.held = self.held, None
        if held is None:
            return []
        if held.corner is not None:
            self.left_out(held.corner[0], held.number)
        return [(held.number, self._text(held))]

    def left_out(self, name: str, number: int) -> None:
        """Note a corner that the control does not put in; ``name`` is its word, ``number`` its line."""
        if name != "RNDM":
            self.notes.append(f"line {number}: {name}= puts no corner here, as a move next to it leaves the plane, the "
                              "plane changes, or no move follows")

    def _between(self, first: Cornered, second: Cornered) -> tuple[list[str | tuple[int, str]], Cornered]:
        """Blocks of the move before a corner and of the corner, and the shortened move after it."""
        assert first.corner is not None
        name, size = first.corner
        i, j, _ = PLANE_AXES[self.machine.s.plane]
        if name in ("RND", "RNDM"):
            arc = rounding(first.leg, second.leg, size)
            if arc is None:
                return [(first.number, self._text(first))], second
            p, q, centre, left = arc
            piece = Leg(p, q, centre, left)
        else:
            if name == "CHF":
                ratio = first.leg.tangent(True).conjugate() * second.leg.tangent(False)
                half = 0.5 * math.atan2(abs(ratio.imag), ratio.real)
                size = size / (2 * math.cos(half)) if math.cos(half) > 1e-6 else math.inf
            p, q = chamfer(first.leg, second.leg, size)
            piece = Leg(p, q)
        end, onward = list(first.end), list(first.end)
        end[i], end[j], onward[i], onward[j] = p.real, p.imag, q.real, q.imag
        word = "G1" if piece.centre is None else "G3" if piece.left else "G2"
        if first.word == "G0" and word == "G1":
            word = "G0"
        short = replace(first, leg=replace(first.leg, end=p), end=tuple(end))
        corner = Cornered(first.number, (), word, piece, tuple(onward), first.rate if word != "G0" else "")
        if corner.feed:
            second = replace(second, feed=second.modal)
        return ([(first.number, self._text(short)), (first.number, self._text(corner))],
                replace(second, leg=replace(second.leg, start=q)))

    def _centre(self, start: Sequence[float], end: Sequence[float], word: str, centre: Mapping[str, str],
                values: Mapping[str, float]) -> complex | None:
        """Centre of an arc along the axes of the plane, mm; None for a line."""
        if word in ("G0", "G1"):
            return None
        axes = PLANE_AXES[self.machine.s.plane]
        if "CR" in values:
            try:
                u, v = centre_from_radius(np.array(start), np.array(end), values["CR"] * self.unit, word == "G2", axes)
            except ArcError as problem:
                raise BlockError(str(problem)) from None
            return complex(u, v)
        offsets = [float(centre.get("IJK"[n], "0")) * self.unit for n in axes[:2]]
        if not any(offsets):
            raise BlockError("an arc without its centre or radius next to a corner (RND, CHF, CHR)")
        return complex(start[axes[0]] + offsets[0], start[axes[1]] + offsets[1])

    def _text(self, move: Cornered) -> str:
        i, j, _ = PLANE_AXES[self.machine.s.plane]
        words = [f"{'XYZ'[n]}{digits(move.end[n] / self.unit)}" for n in sorted((i, j))]
        if move.leg.centre is not None:
            off = (move.leg.centre - move.leg.start) / self.unit
            words += [f"{'IJK'[i]}{digits(off.real)}", f"{'IJK'[j]}{digits(off.imag)}"]
        return " ".join([*move.head, move.word, *words, *([move.feed] if move.feed else [])])


__all__ = ["Cornered", "SiemensCorners"]
