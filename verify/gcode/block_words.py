"""Splits the text of one block into words and checks which may stand together.

This module refuses a block that a control could read in two ways: two words of one modal group, a fraction at an
address of whole numbers, a character outside ASCII.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from verify.gcode.machine_words import USER_M

CYCLES = frozenset({73, 74, 76, 81, 82, 83, 84, 85, 86, 89})
MOTION_CODES = frozenset({0, 1, 2, 3, 80}) | CYCLES
SHIFTS: frozenset[float] = frozenset({10, 52, 92, 92.1, 92.2, 92.3})
"""Words that move program zero."""
COMPENSATES: frozenset[float] = frozenset({40, 41, 42, 41.1, 42.1})
"""Words of cutter radius compensation."""
TURNS: frozenset[float] = frozenset({68, 51, 51.1, 50.1})
"""Words that turn, scale or mirror the programmed coordinates and take coordinates themselves."""
IDLE: frozenset[float] = frozenset({8, 97})
IDLE_M = frozenset({19, 48, 49, 50, 51, 52, 53, 62, 63, 64, 65, 66, 67, 68})
"""G and M words of LinuxCNC that move nothing: radius mode, speeds, overrides, orientation, inputs and outputs."""
FURTHER: frozenset[float] = TURNS | {76}
"""Words that LinuxCNC does not have, or has with another meaning; a dialect names those that it has."""
SAVES = frozenset({70, 71, 72, 73})
"""M words that save modes, discard them and restore them."""
WORK_OFFSETS = {54: "G54", 55: "G55", 56: "G56", 57: "G57", 58: "G58", 59: "G59", 59.1: "G59.1", 59.2: "G59.2",
                59.3: "G59.3"}
LARGEST = 1e15
"""The largest number of a word: above it float64 no longer resolves whole millimetres."""

FARTHEST = 1e8
"""mm or deg, the largest X, Y, Z, A, B or C: no machine is larger, and turning moves are split into pieces."""

NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)"
# at most 8 digits before the point, so a match is below FARTHEST; longer numbers go through the full block
_SHORT = r"[+-]?(?:[0-9]{1,8}(?:\.[0-9]*)?|\.[0-9]+)"

def straight(rotary: str) -> Callable[[str], re.Match[str] | None]:
    """The matcher of a plain straight move, words in the usual order: groups G, X, Y, Z, rotary words, F."""
    words = "".join(rf"(?:{letter}({_SHORT}) ?)?" for letter in f"XYZ{rotary}F")
    return re.compile(rf"(?:N[0-9]+ ?)?(?:G0?([01]) ?)?{words}\r?").fullmatch


_PLACES = frozenset("XYZABC")
_WORD = re.compile(rf"([A-Z@^])({NUMBER})")
_COMMENT = re.compile(r"\([^()]*\)")
_SCRIPT = re.compile(r"[;(]\s*PY\s*,", re.IGNORECASE)
_ABORT = re.compile(r"\(\s*ABORT,", re.IGNORECASE)
_FOREIGN = re.compile(r"[^\t -~]")
_M_CODES = frozenset({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 30, 60, 61}) | SAVES
_ROTARY = "ABC"
_TCP_G, _TCP_M = 43.4, frozenset({428, 429})  # tool centre point control: Fanuc's word, LinuxCNC's switch
_WHOLE = "THLM"

# The modal groups of RS274: a control refuses two words of one, or takes the last; G80 has a group of its own on Fanuc.
_G_GROUPS: tuple[frozenset[float], ...] = (
    frozenset({4, 28, 30, 53}) | SHIFTS | TURNS, MOTION_CODES - {80}, CYCLES | {80}, frozenset({17, 18, 19}),
    frozenset({90, 91}), frozenset({90.1, 91.1}), frozenset({93, 94, 95}), frozenset({20, 21}),
    frozenset({43, 43.4, 49}),
    frozenset({98, 99}), frozenset(WORK_OFFSETS), frozenset({61, 61.1, 64}), COMPENSATES, frozenset({15}),
    frozenset({50}), frozenset({69}), IDLE,
)
_M_GROUPS: tuple[frozenset[float], ...] = (frozenset({0, 1, 2, 30, 60}), frozenset({6, 61}), frozenset({3, 4, 5}),
                                           frozenset({7, 8, 9}), _TCP_M, SAVES)
_G_CODES = frozenset().union(*_G_GROUPS) - {_TCP_G} - FURTHER
_HINTS = {
    5: "a spline", 5.1: "a spline", 5.2: "a spline",
    28.1: "the place of G28, written into the control", 30.1: "the place of G30, written into the control",
    33: "threading", 38.2: "probing", 43.4: "tool centre point control", 43.5: "tool centre point control by vectors",
    65: "a macro call", 66: "a macro call", 68: "a rotated frame", 68.2: "a tilted plane", 76: "threading",
    87: "back boring", 88: "boring with a manual retract",
}
_M_HINTS = {428: "tool centre point control", 429: "tool centre point control", 430: "user-defined kinematics"}
NO_MACHINE = "give the machine of the setup its rotary axes: machine.kind 5-axis and machine.kinematics"


class BlockError(ValueError):
    """A block that cannot be read, or could be read in two ways; the reader adds the line.

    remedy : remedy of the error, or None where the message suffices
    line   : line of the word that cannot be read, from 1, where it is another one than that of the block; or None
    """

    def __init__(self, message: str, remedy: str | None = None, line: int | None = None) -> None:
        super().__init__(message)
        self.remedy, self.line = remedy, line


@dataclass
class Block:
    """Words of one block.

    codes   : G words in the order written
    ms      : M words
    values  : number of every other letter but N, as written (units and modes of the program)
    deleted : whether it begins with the block delete sign /
    idle    : whether it has M words of ``IDLE_M`` or functions
    functions : M words that run a program of the user
    """

    codes: list[float] = field(default_factory=list)
    ms: list[int] = field(default_factory=list)
    values: dict[str, float] = field(default_factory=dict)
    deleted: bool = False
    idle: bool = False
    functions: list[int] = field(default_factory=list)


def parse_block(text: str, rotary: str = "", further: Collection[float] = ()) -> Block:
    """Words of one line of a program; comments, blank lines and Fanuc O numbers give an empty block.

    text   : the line
    rotary : letters of the machine's rotary axes, such as 'AC'; '' where it has none
    further : G words of ``FURTHER`` that the control has

    Raises
    ------
    BlockError
        Text that is not a word, an unknown word, an open comment, or a character outside ASCII. A repeated letter, or
        two words of one modal group. A fraction at an address of whole numbers, or a number above 1e15.

    Notes
    -----
    The modal groups and the order of words are those of RS274/NGC [Kramer2000].
    """
    text = "".join(bare(text).upper().split())
    block = Block(deleted=text.startswith("/"))
    text = text[1:] if block.deleted else text
    if text.startswith("O"):
        if re.fullmatch(r"O[0-9]+", text):
            return block
        raise BlockError(f"cannot read the subroutine or macro word '{text[:40]}'")
    words = _WORD.findall(text)
    if "".join(a + b for a, b in words) != text:
        raise BlockError(f"cannot read '{text[:60]}'")
    for letter, digits in words:
        _add(block, letter, digits, rotary, further)
    if block.values.get("D", 0.0) % 1 or block.values.get("D", 0.0) < 0:
        if {41.1, 42.1}.isdisjoint(block.codes):
            raise BlockError(f"unknown word D{block.values['D']:g}: D takes a whole number from 0")
    _check_groups("G", block.codes, _G_GROUPS)
    _check_groups("M", block.ms, _M_GROUPS)
    return block


def bare(text: str) -> str:
    """A line without its comments.

    Raises
    ------
    BlockError
        An open comment, one that LinuxCNC runs as Python or that ends the program, a character outside ASCII.
    """
    if _SCRIPT.search(text):
        raise BlockError("LinuxCNC runs this comment as Python ('py,')")
    if _ABORT.search(text):
        raise BlockError("the program stops here with an alarm ('abort,'), and what follows is never run")
    text = _COMMENT.sub(" ", text).split(";", 1)[0]
    if "(" in text or ")" in text:
        raise BlockError("a comment is not closed")
    if strange := _FOREIGN.search(text.strip()):
        raise BlockError(f"a character that is not part of a word: {ascii(strange.group())}")
    return text


def _add(block: Block, letter: str, digits: str, rotary: str, further: Collection[float]) -> None:
    number = float(digits)
    if not abs(number) <= LARGEST:
        raise BlockError(f"{letter}{digits[:12]}... is a number of {len(digits)} characters, above {LARGEST:g}")
    if letter in _PLACES and abs(number) > FARTHEST:
        raise BlockError(f"{letter}{digits} is farther than any machine moves ({FARTHEST:g})",
                         "look for a missing decimal point")
    if letter == "G":
        if number not in _G_CODES and number not in further and not (rotary and number == _TCP_G):
            hint = _HINTS.get(number)
            name = digits if "." in digits else f"{number:g}"
            raise BlockError(f"unknown word G{name}" + (f" ({hint})" if hint else ""),
                             NO_MACHINE if number == _TCP_G else None)
        block.codes.append(number)
        return
    if letter == "N":
        return
    if letter in _ROTARY and letter not in rotary:
        if number == 0:  # an axis that the machine has not, or that the setup does not name, stays where it is
            return
        raise BlockError(f"unknown word {letter}{digits} (the rotary axes of the machine are {' and '.join(rotary)})"
                         if rotary else f"unknown word {letter}{digits} (the machine has no rotary axis)",
                         None if rotary else NO_MACHINE)
    if letter == "M" and (number in IDLE_M or number in USER_M):
        block.idle = True
        if number in USER_M:
            block.functions.append(int(number))
        elif number == 19:
            block.ms.append(19)
        return
    if letter not in "XYZABCIJKRPQLFSTHDM@^" and not (letter == "E" and block.idle):
        raise BlockError(f"unknown word {letter}{digits}")
    if letter in _WHOLE and (number != int(number) or number < 0):
        raise BlockError(f"unknown word {letter}{digits}: {letter} takes a whole number from 0")
    if letter == "M":
        if number not in _M_CODES and not (rotary and number in _TCP_M):
            hint = _M_HINTS.get(int(number))
            raise BlockError(f"unknown word M{digits}" + (f" ({hint})" if hint else ""),
                             NO_MACHINE if number in _TCP_M else None)
        block.ms.append(int(number))
    elif letter in block.values:
        raise BlockError(f"the word {letter} appears twice")
    else:
        block.values[letter] = number


def _check_groups(letter: str, codes: list[float] | list[int], groups: tuple[frozenset[float], ...]) -> None:
    if len(codes) < 2:
        return
    for group in groups:
        found = [c for c in codes if c in group]
        if len(found) > 1:
            names = " and ".join(f"{letter}{c:g}" for c in found)
            raise BlockError(f"{names} in one block are of one modal group, and controls differ in which one counts")


def used_letters(block: Block, motion: float | None, moves: bool, pecks: str = "", repeats: str = "LK") -> str:
    """Letters whose number some code of the block uses.

    motion : G number in force
    moves  : whether the block makes a move of that motion
    pecks  : further letters of peck cycles
    repeats : letters that give the number of holes of a cycle, the first one present counts
    """
    used = "XYZABCFST" + ("PQRLE" if block.idle else "") + ("Q" if 61 in block.ms else "")
    if 10 in block.codes:
        return used + "LPR"
    if not TURNS.isdisjoint(block.codes):
        return used + ("R" if 68 in block.codes else "PIJK" if 51 in block.codes else "")
    if 43 in block.codes or _TCP_G in block.codes:
        used += "H"
    if 64 in block.codes:
        used += "PQ"
    if not {41, 42, 41.1, 42.1}.isdisjoint(block.codes):
        used += "D"
    if 4 in block.codes:
        return used + "P"
    if not moves:
        return used
    used += "@^"
    if motion in (2, 3):
        return used + ("RP" if "R" in block.values else "IJKP")
    if motion in CYCLES:
        used += "R" + next((c for c in repeats if c in block.values), "")
        used += pecks if motion in (73, 83) else ""
        return used + {81: "", 85: "", 82: "P", 86: "P", 89: "P", 76: "PQIJ"}.get(int(motion or 0), "PQ")
    return used


def whole(values: dict[str, float], letter: str, otherwise: int) -> int:
    """The count of a word such as turns or repeats, from 1; ``otherwise`` where the letter is absent.

    Raises
    ------
    BlockError
        A fraction, zero or a negative number.
    """
    number = values.get(letter, float(otherwise))
    if number < 1 or math.modf(number)[0] != 0:
        raise BlockError(f"{letter}{number:g} is not a count: {letter} takes a whole number from 1")
    return int(number)
