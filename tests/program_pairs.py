"""Programs of a control compared with the same moves in plain words."""

import numpy as np

from verify.gcode.reader import read_program
from verify.kinematics import Kinematics

NAMES = {"MILL_D10": 1, "drill 8": 2, "T3": 3}
RADII = {1: 5.0, 2: 4.0, 3: 3.0}
SIEMENS = ("G710 G17 G90 G94 G54", "T1 M6", "D1", "S1000 M3 F200", "G0 X0 Y0 Z50")
HEIDENHAIN = ("BEGIN PGM A MM", "TOOL CALL 1 Z S1000 F200", "M3", "L X+0 Y+0 Z+50 R0 FMAX", "L F200")
LINUXCNC = ("G21 G17 G90 G94 G54 G40", "T1 M6", "G43 H1", "S1000 M3 F200", "G0 X0 Y0 Z50")
PIVOTS = {"table-table-AC": ((10.0, 5.0, -60.0), (10.0, 5.0, -40.0)), "table-table-BC": ((0.0, 0.0, -30.0), (4.0, 0.0,
                                                                                                             -30.0)),
          "head-head-BC": ((0.0, 0.0, 150.0),), "head-table-BC": ((0.0, 0.0, 150.0), (0.0, 0.0, -30.0))}


def kinematics(kind):
    """A machine of that kind with pivots; None for none."""
    return Kinematics(kind, PIVOTS.get(kind)) if kind else None


def read(lines, dialect, kind=None, head=True, **more):
    """The program with its usual head and end."""
    opening = {"siemens": SIEMENS, "heidenhain": HEIDENHAIN, "linuxcnc": LINUXCNC}[dialect] if head else ()
    end = {"heidenhain": "END PGM A MM"}.get(dialect, "M30")
    given = {"names": NAMES, "radii": RADII, "tools": {1, 2, 3}, "gauge_length": {1: 60.0, 2: 60.0, 3: 60.0}, **more}
    body = lines.split("\n") if isinstance(lines, str) else list(lines)
    return read_program("\n".join([*opening, *body, end, ""]), dialect=dialect, kinematics=kinematics(kind), **given)


def apart(first, second):
    """Largest distance of two programs, move for move, mm: ends, and starts where both know them."""
    a, b = (_moving(p) for p in (first, second))
    assert len(a) == len(b), (len(a), len(b), first.end[a].round(3).tolist()[:40], second.end[b].round(3).tolist()[:40])
    assert (first.kind[a] == second.kind[b]).all(), "kinds differ"
    if first.poses is not None or second.poses is not None:
        axes = [np.tile([0.0, 0.0, 1.0], (len(k), 1)) if p.poses is None else p.poses.end_axis[k]
                for p, k in ((first, a), (second, b))]
        assert np.abs(axes[0] - axes[1]).max() < 1e-6, "tool axes differ"
    return float(np.abs(first.end[a] - second.end[b]).max()) if len(a) else 0.0


def same_feeds(first, second):
    """Whether the feed moves of both have equal feeds."""
    a, b = (_moving(p) for p in (first, second))
    return bool(np.allclose(first.feed[a], second.feed[b], equal_nan=True))


def _moving(p):
    moves = (np.abs(p.start - p.end) > 1e-7).any(axis=1)
    if p.poses is not None:
        moves |= (np.abs(p.poses.start_axis - p.poses.end_axis) > 1e-9).any(axis=1)
    return np.flatnonzero(moves)
