"""Words that turn, scale and mirror the programmed coordinates: G68, G69, G51, G50, G51.1, G50.1.

The control mirrors first, then scales, then rotates; all of them count from the zero of the work offset.
"""

from __future__ import annotations

import math

from verify.gcode.block_words import MOTION_CODES, Block, BlockError
from verify.gcode.contour_motion import ContourMotion
from verify.gcode.frames import Frame, rotation, scaling
from verify.program.arc_chords import PLANE_AXES

Axes = list[float | None]
SAME = 1e-9  # mm


class FrameWords(ContourMotion):
    """Rotation, scale and mirrors in force; together they are the frame of the state.

    mirrors : mm by axis, 0 to 2, the programmed coordinate that stays
    turned  : the word that began or ended a rotation, until a move names both axes of the plane; '' for none
    numbers : (3,) mm, the programmed place before that word
    """

    def __init__(self, *arguments: object, **named: object) -> None:
        super().__init__(*arguments, **named)
        self.rotated: Frame | None = None
        self.scaled: Frame | None = None
        self.mirrors: dict[int, float] = {}
        self.turned, self.numbers = "", [math.nan] * 3

    def _unturn(self, word: float) -> None:
        """G69 and G50: no rotation, no scale."""
        if (self.rotated if word == 69 else self.scaled) is None:
            return
        self._settled(f"G{word:g}")
        if word == 69:
            self.turned, self.numbers = "G69", self._here()
            self.rotated = None
        else:
            self.scaled = None
        self._combine()

    def _turn_word(self, block: Block, axes: Axes) -> None:
        """Run G68, G51, G51.1 or G50.1 with the coordinates of its block."""
        word = next(g for g in block.codes if g in (68, 51, 51.1, 50.1))
        self._settled(f"G{word:g}")
        if moved := [g for g in block.codes if g in MOTION_CODES - {80}]:
            raise BlockError(f"G{word:g} and G{moved[0]:g} in one block: both use the coordinates")
        if self.s.relative:
            raise BlockError(f"G{word:g} in incremental coordinates (G91), which controls read differently")
        if word == 68:
            self._rotate(block.values, axes)
        elif word == 51:
            self._scale(block.values, axes)
        else:
            self._mirror(word, axes)
        self._combine()

    def _rotate(self, values: dict[str, float], axes: Axes) -> None:
        if "R" not in values or not values.keys().isdisjoint("IJK"):
            raise BlockError("G68 without R, or with I, J, K (a rotation in space): only a rotation in the plane can "
                             "be read")
        if self.rotated is not None:
            raise BlockError("G68 while a rotation is in force: end it with G69 first")
        centre = self._centre(axes, "G68")
        plane = PLANE_AXES[self.s.plane][:2]
        if any(k in self.mirrors for k in plane):
            raise BlockError("G68 in a mirror of the plane, which turns the other way on some controls",
                             "write the mirrored contour out")
        if self.scaled is not None and any(abs(self.scaled.out(centre)[k] - centre[k]) > SAME for k in plane):
            raise BlockError("G68 in a scale that moves its centre, which some controls scale too",
                             "rotate about the centre of the scale")
        self.turned, self.numbers = "G68", self._here()
        self.rotated = rotation(self.s.plane, math.radians(values["R"]), centre)

    def _check_turned(self, axes: Axes) -> None:
        """Refuse the first move behind a rotation that names one axis of the plane, where the other may go two ways.

        Fanuc: parameter 11600#5 (AX1) takes it where the tool stands, or at its number of before, turned.
        """
        others = [k for k in PLANE_AXES[self.s.plane][:2] if axes[k] is None]
        if self.s.relative or len(others) == 2:
            return
        if others and abs(self._here()[others[0]] - self.numbers[others[0]]) > SAME:
            raise BlockError(f"a move with one axis of the plane behind {self.turned}: a parameter decides where the "
                             "other one goes", "name both axes in the first move")
        self.turned = ""

    def _scale(self, values: dict[str, float], axes: Axes) -> None:
        if self.scaled is not None:
            raise BlockError("G51 while a scale is in force: end it with G50 first")
        each = [values.get(c) for c in "IJK"]
        factors = [values.get("P", 1.0) if e is None else e for e in each]
        if "P" not in values and all(e is None for e in each):
            raise BlockError("G51 without a scale (P, or I, J, K)")
        self.scaled = scaling(factors, self._centre(axes, "G51"))

    def _mirror(self, word: float, axes: Axes) -> None:
        named = {k: a * self.s.scale for k, a in enumerate(axes) if a is not None}
        if self.rotated is not None or self.scaled is not None:
            raise BlockError(f"G{word:g} while a rotation or a scale is in force, which Fanuc forbids",
                             "mirror before them, or write the contour out")
        if word == 51.1:
            if not named:
                raise BlockError("G51.1 needs X, Y or Z")
            self.mirrors.update(named)
        elif self.mirrors and not named:
            raise BlockError("G50.1 without axes: manuals end a mirror by its axes only", "name the axes: G50.1 X0 Y0")
        else:
            self.mirrors = {k: at for k, at in self.mirrors.items() if k not in named}

    def _select_zero(self, name: str) -> None:
        if self.s.frame is not None and self._foreign:
            raise BlockError(f"{name} while the coordinates are rotated, scaled or mirrored, which Fanuc forbids",
                             "end the rotation, scale or mirror before it")
        super()._select_zero(name)

    def _centre(self, axes: Axes, word: str) -> list[float]:
        """(3,) mm, programmed coordinates: those named, those of the tool elsewhere."""
        here = [p - o for p, o in zip(self._here(), self.s.origin, strict=True)]
        centre = [h if a is None else a * self.s.scale for a, h in zip(axes, here, strict=True)]
        i = {17: (0, 1), 18: (2, 0), 19: (1, 2)}[self.s.plane]
        if any(math.isnan(centre[k]) for k in (i if word == "G68" else range(3))):
            raise BlockError(f"{word} about a place that the program has not stated: give its coordinates")
        return centre

    def _combine(self) -> None:
        """Put the frame of the state together."""
        parts = [self.rotated, self.scaled]
        if self.mirrors:
            parts.append(scaling([-1.0 if k in self.mirrors else 1.0 for k in range(3)],
                                 [self.mirrors.get(k, 0.0) for k in range(3)]))
        frame: Frame | None = None
        for part in parts:
            frame = part if frame is None else frame if part is None else frame @ part
        self.s.frame = frame
