"""Base class and helpers of the readers of controls."""

from __future__ import annotations

from verify.gcode.block_words import NUMBER, WORK_OFFSETS, BlockError

ZEROS = tuple(WORK_OFFSETS.values())
"""The work offsets of a control from the first on, as setups name them."""


class DialectReader:
    """Reader of the words of one control, line by line; it keeps the state that later lines depend on.

    notes   : notes to report; the caller clears them
    remarks : remarks on the latest line; the caller clears them
    unbounded : whether, somewhere, no word bounds the deviation from the path
    bounds_path : whether the control has such a word
    home_from : first tool change, counted from 0, before which our programs send the spindle home; None: the control
                retracts by itself
    gives_up_length : whether the length offset is off at these tool changes too
    """

    bounds_path = True
    home_from: int | None = None
    gives_up_length = False

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.remarks: list[str] = []
        self.unbounded = False
        self._free = False

    def bound(self, known: bool) -> None:
        """From here on a word bounds the deviation from the path (``known``), or none does."""
        self._free |= not known
        self.unbounded = self._free

    def blocks(self, raw: str) -> list[str]:
        """Blocks of one line in the words of ``verify.gcode.block_words``; none for a line without effect.

        Raises BlockError where the line cannot be read, or could be read in two ways.
        """
        raise NotImplementedError


def zero_word(number: int, word: str) -> str:
    """The word of work offset ``number`` of the control, counted from 1; ``word`` is its name in the program.

    Raises
    ------
    BlockError
        No setup can name that work offset.
    """
    if not 1 <= number <= len(ZEROS):
        raise BlockError(f"{word} is work offset {number} of the control; a setup can name the first {len(ZEROS)}")
    return ZEROS[number - 1]


__all__ = ["NUMBER", "ZEROS", "BlockError", "DialectReader", "zero_word"]
