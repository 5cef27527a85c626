"""What all files of controls share."""

from __future__ import annotations

from verify.gcode.block_words import NUMBER, WORK_OFFSETS, BlockError

ZEROS = tuple(WORK_OFFSETS.values())
"""The zeros of a control from the first on, as setups name them."""


class DialectReader:
    """One control, asked line by line; what it keeps is what later lines depend on.

    notes   : what was understood and should be known; whoever asks takes them away
    remarks : what was understood and should not be run, of the line asked last; taken away likewise
    unbounded : whether no word says, somewhere, how far the control may leave the path
    bounds_path : whether it has such a word
    home_from : from which tool change on, counted from 0, a program that was written here has sent the spindle home
                before; None: the control goes up by itself
    gives_up_length : whether no length offset is in force there either
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
        """From here on a word says how far the control may leave the path, or no longer does."""
        self._free |= not known
        self.unbounded = self._free

    def blocks(self, raw: str) -> list[str]:
        """The blocks one line stands for, in the words of ``verify.gcode.block_words``; none for a line without effect.

        Raises BlockError where the line cannot be read, or could be read in two ways.
        """
        raise NotImplementedError


def zero_word(number: int, said: str) -> str:
    """The word for a zero of the control, counted from 1; BlockError for one that no setup can name."""
    if not 1 <= number <= len(ZEROS):
        raise BlockError(f"{said} is zero {number} of the control, and a setup names the first {len(ZEROS)}")
    return ZEROS[number - 1]


__all__ = ["NUMBER", "ZEROS", "BlockError", "DialectReader", "zero_word"]
