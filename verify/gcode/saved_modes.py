"""Modes that M70 to M73 save and restore."""

from __future__ import annotations

from dataclasses import dataclass, replace

from verify.gcode.block_words import BlockError
from verify.program.program import NAN, State

_FIELDS = ("plane", "scale", "relative", "centre_absolute", "feed_mode", "feed", "speed", "spindle", "offset",
           "work_offset", "retract_to_r")


@dataclass
class _Level:
    modes: State | None = None
    at_return: bool = False


class SavedModes:
    """Saved modes: one set for the main program and one for each call."""

    def __init__(self) -> None:
        self._levels = [_Level()]

    def run(self, word: int, state: State) -> None:
        """M70 saves the modes, M73 saves them until the subroutine returns, M72 restores and M71 discards them.

        Raises BlockError where no modes are saved.
        """
        level = self._levels[-1]
        if word in (70, 73):
            level.modes, level.at_return = replace(state), word == 73
        elif level.modes is None:
            raise BlockError(f"M{word} without an M70 of the same subroutine before it")
        elif word == 72:
            if level.modes.tcp_word != state.tcp_word:
                raise BlockError("M72 would switch tool centre point control (G43.4): program that word instead")
            _restore(level.modes, state)
        else:
            level.modes, level.at_return = None, False

    def enter(self) -> None:
        """A subroutine begins."""
        self._levels.append(_Level())

    def leave(self, state: State) -> None:
        """A subroutine ends: the modes that its M73 saved are restored."""
        level = self._levels.pop()
        if level.at_return and level.modes is not None:
            _restore(level.modes, state)


def _restore(kept: State, state: State) -> None:
    other_feed = kept.feed_mode != state.feed_mode
    for name in _FIELDS:
        setattr(state, name, getattr(kept, name))
    if other_feed:  # F of one feed mode is meaningless in another: LinuxCNC needs a new F
        state.feed = NAN
