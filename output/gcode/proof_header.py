"""Writes the figures of the proof into the header of a program that has been proved without them.

A program is proved as text, so the proved text cannot contain the figures of its proof. The writer therefore reserves
comment lines (``AWAITED``); ``filled`` puts the figures into these lines. No other line changes or moves, so line
numbers in findings, notes and pictures stay valid. The pipeline compares the two texts before delivery
(``verify.comparison.program_equivalence.carried``).
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from geometry.errors import InternalError
from output.gcode.dialects.base import Dialect

WIDE = 64
"""Most characters of a line of figures, so that it fits into one comment on every control."""
LINES = 7
AWAITED: tuple[str, ...] = tuple(f"Proof {k}: not made yet ".ljust(WIDE, ".") for k in range(1, LINES + 1))
"""Reserved lines of a program during the proof, as wide as any line that replaces them."""


def filled(text: str, dialect: Dialect, figures: Sequence[str]) -> str:
    """The program with figures in its reserved lines.

    text    : written from a plan whose ``figures`` are AWAITED
    figures : LINES of at most WIDE characters

    Returns the text with the same number of lines, no larger, all other lines unchanged.

    Raises
    ------
    InternalError
        no_room: the text lacks the reserved lines, or the figures are too many or too wide.
    """
    if len(figures) != LINES or max(map(len, figures)) > WIDE:
        raise InternalError("the figures of the proof do not fit into the header", code="no_room",
                            measured=[len(f) for f in figures], limit=[WIDE] * LINES)
    for kept, figure in zip(AWAITED, figures, strict=True):
        old, new = dialect.comment(kept), dialect.comment(figure)
        new += dialect.comment("") * (len(old) - len(new))
        if len(new) != len(old):
            raise InternalError(f"{dialect.title}: '{figure}' needs more lines than are reserved for it",
                                code="no_room", measured=len(new), limit=len(old))
        for before, after in zip(old, new, strict=True):
            # a control that numbers its blocks has the number before the comment
            found = re.search(rf"^([0-9]+ )?{re.escape(before)}$", text, flags=re.MULTILINE)
            if found is None:
                raise InternalError(f"{dialect.title}: the program has no line '{before}'", code="no_room",
                                    subjects=(before,))
            text = f"{text[:found.start()]}{found[1] or ''}{after}{text[found.end():]}"
    return text


__all__ = ["AWAITED", "LINES", "WIDE", "filled"]
