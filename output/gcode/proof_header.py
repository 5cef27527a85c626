"""The figures of the proof in the header of a program that was proved before they were known.

A program is proved as text, so its figures cannot stand in the text that is proved. Lines are kept free for them: the
program is written and proved with comments that say so (``AWAITED``), and delivered with other words in these comments
(``filled``). No other line changes and none moves, so that lines that findings, notes and pictures name stay where
they are. Whoever delivers it reads both texts and holds them against one another (``verify.comparison.program_equivalence.carried``).
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from geometry.errors import InternalError
from output.gcode.dialects.base import Dialect

WIDE = 64
"""Characters of a line of figures, so that it is one comment on every control."""
LINES = 7
AWAITED: tuple[str, ...] = tuple(f"Proof {k}: not made yet ".ljust(WIDE, ".") for k in range(1, LINES + 1))
"""What stands in a program while it is proved: as wide as anything that comes into its place."""


def filled(text: str, dialect: Dialect, figures: Sequence[str]) -> str:
    """A program with figures in the lines kept for them.

    text    : written from a plan whose ``figures`` are AWAITED
    figures : LINES of at most WIDE characters

    Returns the text, no line more or less, no larger, all other lines as they were.

    Raises
    ------
    InternalError
        Code no_room: the text has no such lines, or there are more or wider figures than room.
    """
    if len(figures) != LINES or max(map(len, figures)) > WIDE:
        raise InternalError("the figures of the proof have no room in the header", code="no_room",
                            measured=[len(f) for f in figures], limit=[WIDE] * LINES)
    for kept, figure in zip(AWAITED, figures, strict=True):
        old, new = dialect.comment(kept), dialect.comment(figure)
        new += dialect.comment("") * (len(old) - len(new))
        if len(new) != len(old):
            raise InternalError(f"{dialect.title}: '{figure}' takes more lines than were kept for it", code="no_room",
                                measured=len(new), limit=len(old))
        for before, after in zip(old, new, strict=True):
            # of a control that numbers its blocks the number stands before it
            found = re.search(rf"^([0-9]+ )?{re.escape(before)}$", text, flags=re.MULTILINE)
            if found is None:
                raise InternalError(f"{dialect.title}: the program has no line '{before}'", code="no_room",
                                    subjects=(before,))
            text = f"{text[:found.start()]}{found[1] or ''}{after}{text[found.end():]}"
    return text


__all__ = ["AWAITED", "LINES", "WIDE", "filled"]
