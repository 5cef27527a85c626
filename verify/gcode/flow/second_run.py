"""The second run of a program: it begins with what the first one leaves on the control.

M99 at the end of a main program begins it again at once, with all modes as they are. After M2 and M30 the tables stay
that G10 writes; Fanuc and Haas may keep modes too, which parameters decide (3402 of Fanuc, setting 56 of Haas). The
reader reads such a program again from what is left, and compares the moves. So a mode or a value that the program
states anew before it counts makes no difference.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from geometry.mesh import F64
from verify.program.move_kinds import FEED
from verify.program.program import State

SAME = 1e-6  # mm: closer places are the same
TABLES = ("zeros", "written", "lengths", "wear", "registers", "radius_wear")
"""Attributes of the reader that stay on a control when a program ends."""
KEPT_MODES = ("fanuc", "haas")
"""Controls that may keep modes at the end of a program; the others set them back, but for these."""
KEPT_BY_LINUXCNC = ("scale", "centre_absolute", "tcp_switch")
"""Modes of the state that M2 and M30 of LinuxCNC leave as they are: G20 and G21, G90.1, M428."""


class Change(NamedTuple):
    """Where a second run goes other ways: the line, and what is other there."""

    line: int
    what: str


def first_change(first: F64, second: F64, errors: list[tuple[int, str]]) -> Change | None:
    """The first line at which the second run of a program is not the first one again; None where it is.

    first, second : (m, 10) and (n, 10) float64, rows of ``Log.table``, mm and mm/min
    errors        : of the second run

    Notes
    -----
    Before the first feed move only ends of moves count, below the highest place of the first run: where that comes
    from is not known, and rapids up there meet nothing.
    """
    if errors:
        return Change(errors[0][0], f"an error ({errors[0][1]})")
    one, two = (int(np.argmax(t[:, 6] == FEED)) if (t[:, 6] == FEED).any() else len(t) for t in (first, second))
    high = float(first[:, 5].max(initial=-np.inf)) - SAME
    ends, now = ({int(row[9]): row[3:6] for row in t} for t in (first[:one], second[:two]))  # of each line the last
    for line in sorted(ends.keys() & now.keys()):
        was, to = ends[line], now[line]
        if min(was[2], to[2]) < high and _others(was[None], to[None]).any():
            return Change(line, "another place")
    a, b = first[one:], second[two:]
    n = min(len(a), len(b))
    moved, fed = _others(a[:n, :6], b[:n, :6]), _others(a[:n, 7:8] / 1e3, b[:n, 7:8] / 1e3)
    other = moved | fed | (a[:n, 6] != b[:n, 6]) | (a[:n, 8] != b[:n, 8])
    if other.any():
        k = int(np.argmax(other))
        return Change(int(b[k, 9]), "another feed" if fed[k] and not moved[k] else "another way")
    if len(a) != len(b):
        return Change(int((b if len(b) > n else a)[n, 9]), "another number of moves")
    return None


def left_modes(begin: State, end: State, assumed: tuple[str, ...] | None = None, tilted: bool = False) -> list[str]:
    """Modes of coordinates and feed that a program leaves otherwise than it found them, in words.

    tilted  : whether a tilted plane is in force at the end
    assumed : G words that the program does not state before its first move; None: all modes count, stated or not
    """
    unsaid = {"G90", "G17", "G94", f"T{begin.tool} M6"} if assumed is None else set(assumed)
    left = {
        "a rotation, a scale or a mirror": end.frame is not None,
        "a tilted plane": tilted,
        "millimetres" if end.scale == 1.0 else "inches": end.scale != begin.scale,
        "G90.1": end.centre_absolute and not begin.centre_absolute,
        "tool centre point control": end.tcp and not begin.tcp,
        end.work_offset: end.work_offset != begin.work_offset,
        "G91": end.relative and not begin.relative and "G90" in unsaid,
        f"G{end.plane}": end.plane != begin.plane and "G17" in unsaid,
        f"G{end.feed_mode}": end.feed_mode != begin.feed_mode and "G94" in unsaid,
        "G99" if end.retract_to_r else "G98": end.retract_to_r != begin.retract_to_r,
        "another length of the tool": abs(end.length - begin.length) > SAME,
        f"T{end.tool} in the spindle": bool(begin.tool) and end.tool != begin.tool and f"T{begin.tool} M6" in unsaid,
        "a shifted zero": not np.allclose(end.origin, begin.origin, atol=SAME),
    }
    return [word for word, on in left.items() if on]


def _others(a: F64, b: F64) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(n,) bool, rows of two tables that differ; two unknown places, nan, are the same."""
    return np.asarray(~(np.isclose(a, b, rtol=0.0, atol=SAME, equal_nan=True)).all(axis=1))


__all__ = ["KEPT_BY_LINUXCNC", "KEPT_MODES", "TABLES", "Change", "first_change", "left_modes"]
