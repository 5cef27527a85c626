"""The least increment that a control counts in, and how far a program goes elsewhere because of it.

Fanuc and Haas: a control of increment system IS-B counts coordinates in 0.001 mm or 0.0001 inch, and angles in 0.001
deg. It rounds a word that takes a variable to that increment, and drops the digits of a number behind it. One absolute
place is wrong by an increment at most. Increments (G91), shifts (G92) and places that a macro reads back (#5041) add
the error up. So the reader reads such a program once more as a control counts, and compares the ways.

Siemens: a control rounds a programmed place to its calculation resolution. Machine data 10200 and 10210 set it, as
delivered to 0.001 mm and 0.001 deg, in inches too. Increments (G91, IC) and places that are read back ($AA_IW) add up.

An arc by its radius needs no sum. Near half a circle an error d of the radius r moves the centre by sqrt(2 r d).
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from verify.gcode.flow.second_run import Change

ALLOWED = 2.5
"""Least increments by which two ways may differ: an absolute word makes one, a shift another, an arc the rest."""
STEP, INCH_STEP = 1e-3, 2.54e-3
"""mm, the least input increment in G21 and in G20."""
TURN_STEP = math.radians(1e-3)
"""rad, the least input increment of an angle."""
SHORT_CHORD = 1.5
"""Radii, the chord of an arc from which on its centre hangs on its radius: 97 deg."""
_FINE = re.compile(r"([ABCIJKQRXYZ])(\s*[+-]?\s*[0-9]*\.[0-9]{3})([0-9]*[1-9])", re.IGNORECASE)
_G_WORD = re.compile(r"G\s*([0-9]+\.?[0-9]*)", re.IGNORECASE)
_CHUNK = 256
MAX_SUSPECTS = 500  # lines that are compared as polylines
_NOISE = 1e-7  # of an increment: digits that float64 adds

I64 = NDArray[np.int64]


class Increment(NamedTuple):
    """What a control counts in, and what it does with words that are finer.

    step, inch_step : mm, in a program in mm and in inches
    why, remedy     : of a finding, in words
    """

    step: float
    inch_step: float
    why: str
    remedy: str


INPUT = Increment(
    STEP, INCH_STEP, "this word is finer than the least input increment (IS-B: 0.001 mm, 0.0001 inch, 0.001 deg): a "
    "control rounds it where it takes a variable, and drops the digits of a number behind it",
    "write absolute places (G90), or round the variables before they add up; give arcs of about half a circle by I, J "
    "and K")
"""Fanuc and Haas."""
RESOLUTION = Increment(
    STEP, STEP, "this word is finer than the calculation resolution (machine data 10200 and 10210, as delivered 0.001 "
    "mm and 0.001 deg), and a control rounds it",
    "write absolute places (G90, AC), or round the values before they add up; give arcs of about half a circle by I, "
    "J and K. A control whose machine data 10200 and 10210 are larger keeps more digits")
"""Siemens."""


class Way(NamedTuple):
    """A reading: rows of ``Log.table`` (m, 10), and the angles of the rotary axes after them, (m, 2) rad or None."""

    table: F64
    angles: F64 | None


def counted(letter: str, number: float, codes: Collection[float], inch: bool, vectors: bool = False) -> float:
    """A word of a variable as the control takes it: the number rounded to the least input increment.

    codes   : G words of the block
    inch    : whether it is in G20
    vectors : whether I, J and K are directions of the tool

    >>> counted("X", 12.34567, (), False), counted("X", 12.34567, (), True), counted("C", 12.34567, (), True)
    (12.346, 12.3457, 12.346)
    """
    places = _places(letter, codes, inch, vectors)
    if places is None or not math.isfinite(number):
        return number
    steps = math.floor(abs(number) * 10**places + 0.5 + _NOISE)
    return round(math.copysign(steps / 10**places, number), places)


def is_fine(number: float, taken: float, letter: str, inch: bool) -> bool:
    """Whether a word takes another number than it has, beyond the noise of float64."""
    return abs(number - taken) * 10 ** (4 if inch and letter not in "ABC" else 3) > _NOISE


def is_fine_arc(start: F64, end: F64, radius: float, step: float) -> bool:
    """Whether digits behind ``step``, mm, decide where the centre of an arc by its radius is.

    start, end : (2,) float64, mm, in the plane of the arc
    radius     : mm, negative for the longer arc

    Up to ``SHORT_CHORD`` the centre moves by 1.5 errors of the radius and 1.1 of the half chord.

    >>> is_fine_arc(np.zeros(2), np.array([4.0, 0.0]), 2.0004, 1e-3)
    True
    >>> is_fine_arc(np.zeros(2), np.array([4.0, 0.0]), 2.0, 1e-3)
    False
    >>> is_fine_arc(np.zeros(2), np.array([2.0, 0.0]), 2.0004, 1e-3)
    False
    """
    if radius > 0.0 and math.dist(start, end) < SHORT_CHORD * radius:
        return False
    counts = np.array([*start, *end, radius]) / step
    return bool((np.abs(counts - np.round(counts)) > _NOISE).any())


def without_fine_digits(text: str, inch: bool, vectors: bool = False) -> str:
    """A block as the control takes it: the digits of its numbers behind the least input increment dropped.

    inch, vectors : as for ``counted``

    >>> without_fine_digits("G1 X-.0009 Y1.2345 F99.1234", False)
    'G1 X-.000 Y1.234 F99.1234'
    """
    if _FINE.search(text) is None:
        return text
    codes = [float(g) for g in _G_WORD.findall(text)]

    def short(found: re.Match[str]) -> str:
        places = _places(found[1].upper(), codes, inch, vectors)
        return found[0] if places is None else found[1] + found[2] + found[3][:places - 3]

    return _FINE.sub(short, text)


def _places(letter: str, codes: Collection[float], inch: bool, vectors: bool) -> int | None:
    """Decimals of a word that the control takes; None where its increment is another one, or none is known."""
    if letter not in "ABCIJKQRXYZ" or (letter == "R" and 68 in codes):
        return None
    if letter in "IJK" and (vectors or not {43.5, 51, 68.2}.isdisjoint(codes)):
        return None
    return 4 if inch and letter not in "ABC" else 3


def first_drift(first: Way, second: Way, errors: list[tuple[int, str]], step: float, reach: float) -> Change | None:
    """The first line at which a control that counts in ``step``, mm, goes elsewhere; None where there is none.

    first, second : the reading of all digits, and that of a control
    errors        : of the second one
    reach         : mm, how far the tip may be from a rotary axis

    Notes
    -----
    Arcs may have another number of chords in the second reading, and moves without length may be missing there. So rows
    are compared first, and the lines where they differ as polylines.
    """
    if errors:
        return Change(errors[0][0], f"an error ({errors[0][1]})")
    bound = ALLOWED * step
    ways, runs = (first, second), (_runs(first.table), _runs(second.table))
    if _common(ways, runs) < max(map(len, runs)) - 1:
        ways = _longer(first, bound), _longer(second, bound)
        runs = _runs(ways[0].table), _runs(ways[1].table)
    same = _common(ways, runs)
    line, most = 0, 0.0
    for k in _suspects(ways, runs, same, bound, reach):
        a, b = (w.table[r[k]:r[k + 1]] for w, r in zip(ways, runs, strict=True))
        apart = _apart(a, b)
        if apart > bound + _by_turn(ways, runs[0][k + 1] - 1, runs[1][k + 1] - 1, reach):
            line, most = line or int(a[0, 9]), max(most, apart)
    if line:
        return Change(line, "another way" if math.isinf(most) else f"places {most:.3g} mm away")
    for way, run in zip(ways, runs, strict=True):
        if same < len(run) - 1:
            return Change(int(way.table[run[same], 9]), "another number of moves")
    return _first_turn(ways, runs, same)


def _runs(table: F64) -> I64:
    """(k + 1,) rows at which the moves of another line begin, and the number of rows."""
    return np.concatenate([[0], np.flatnonzero(np.diff(table[:, 9])) + 1, [len(table)]]) if len(table) else np.zeros(
        1, np.int64)


def _common(ways: tuple[Way, Way], runs: tuple[I64, I64]) -> int:
    """Number of runs from the first on that are of the same lines."""
    n = min(map(len, runs)) - 1
    other = ways[0].table[runs[0][:n], 9] != ways[1].table[runs[1][:n], 9]
    return int(np.argmax(other)) if other.any() else n


def _longer(way: Way, least: float) -> Way:
    """A way without its moves up to ``least``, mm; moves of unknown length stay."""
    keep = ~(np.linalg.norm(way.table[:, 3:6] - way.table[:, :3], axis=1) <= least)
    return Way(way.table[keep], None if way.angles is None else way.angles[keep])


def _suspects(ways: tuple[Way, Way], runs: tuple[I64, I64], same: int, bound: float, reach: float) -> list[int]:
    """Of the first ``same`` runs, in order, those whose rows differ; of many the first ones, and the worst."""
    counts = np.diff(runs[0][:same + 1]), np.diff(runs[1][:same + 1])
    alike = np.flatnonzero(counts[0] == counts[1])
    found = np.ones(same, dtype=bool)
    worst = -1
    if len(alike):
        inner = np.arange(counts[0][alike].sum()) - np.repeat(np.cumsum(counts[0][alike]) - counts[0][alike],
                                                              counts[0][alike])
        i, j = (np.repeat(r[alike], counts[0][alike]) + inner for r in runs)
        apart = _rows_apart(ways[0].table[i], ways[1].table[j])
        over = apart > bound + _by_turn(ways, i, j, reach)
        run = np.repeat(alike, counts[0][alike])
        found[alike] = False
        found[run[over]] = True
        if over.any():
            worst = int(run[np.argmax(np.where(over, apart, 0.0))])
    first = np.flatnonzero(found)[:MAX_SUSPECTS].tolist()
    return first if worst in (-1, *first) else [*first, worst]


def _by_turn(ways: tuple[Way, Way], i: Any, j: Any, reach: float) -> Any:
    """mm, by which tips may differ because the axes stand at other angles behind rows i and j: a step each."""
    if ways[0].angles is None or ways[1].angles is None:
        return 0.0
    return np.minimum(np.abs(ways[0].angles[i] - ways[1].angles[j]).sum(axis=-1), 2 * TURN_STEP) * reach


def _first_turn(ways: tuple[Way, Way], runs: tuple[I64, I64], same: int) -> Change | None:
    """The first line behind which a rotary axis stands elsewhere."""
    if ways[0].angles is None or ways[1].angles is None:
        return None
    i, j = (r[1:same + 1] - 1 for r in runs)
    off = np.abs(ways[0].angles[i] - ways[1].angles[j]).max(axis=1, initial=0.0)
    over = off > ALLOWED * TURN_STEP
    if not over.any():
        return None
    return Change(int(ways[0].table[i[np.argmax(over)], 9]), f"angles {math.degrees(off.max()):.3g} deg away")


def _rows_apart(a: F64, b: F64) -> F64:
    """(n,) mm, distance of the ends of moves; 0 between unknown ones, inf where kind or tool or one place is known."""
    off = a[:, :6] - b[:, :6]
    off[np.isnan(a[:, :6]) & np.isnan(b[:, :6])] = 0.0
    off[np.isnan(off)] = np.inf
    out = np.maximum(np.linalg.norm(off[:, :3], axis=1), np.linalg.norm(off[:, 3:], axis=1))
    out[(a[:, 6] != b[:, 6]) | (a[:, 8] != b[:, 8])] = np.inf
    return np.asarray(out)


def _apart(a: F64, b: F64) -> float:
    """mm, largest distance of the corners of one line's moves from the moves of the other, and between their ends."""
    if np.isnan(a[:, :6]).any() or np.isnan(b[:, :6]).any() or not np.array_equal(_kinds(a), _kinds(b)):
        n = min(len(a), len(b))
        return float(_rows_apart(a[:n], b[:n]).max()) if len(a) == len(b) else math.inf
    ends = max(math.dist(a[0, :3], b[0, :3]), math.dist(a[-1, 3:6], b[-1, 3:6]))
    return max(ends, _from_polyline(a, b), _from_polyline(b, a))


def _kinds(rows: F64) -> F64:
    """Kinds and tools of moves, one for each series of equal ones."""
    kinds = rows[:, [6, 8]]
    return kinds[np.concatenate([[True], (np.diff(kinds, axis=0) != 0).any(axis=1)])]


def _from_polyline(rows: F64, line: F64) -> float:
    """mm, largest distance of the ends of moves from the moves of ``line``, those about as far along it."""
    n, m = len(rows), len(line)
    aside = abs(n - m) + 2
    worst = 0.0
    for k in range(0, n, _CHUNK):
        last = min(k + _CHUNK, n)
        near = line[max(0, k * m // n - aside):min(m, last * m // n + aside + 1)]
        way = near[:, 3:6] - near[:, :3]
        square = np.maximum((way * way).sum(axis=1), 1e-300)
        to = rows[k:last, None, 3:6] - near[None, :, :3]
        share = np.clip((to * way).sum(axis=2) / square, 0.0, 1.0)
        worst = max(worst, float(np.linalg.norm(to - share[..., None] * way, axis=2).min(axis=1).max()))
    return worst


__all__ = ["INCH_STEP", "INPUT", "RESOLUTION", "STEP", "Increment", "Way", "counted", "first_drift", "is_fine",
           "is_fine_arc", "without_fine_digits"]
