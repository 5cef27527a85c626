"""The hole that a tap needs before it cuts.

``diameter_mm`` of a tap is the outer diameter of its teeth, or the diameter of its hole where the part shows the hole
before the thread. Diameter and pitch together tell which. Lengths are mm.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.assumptions import Assumed, AssumedKind
from verify.checks.program_sequence import FramedProgram
from verify.cutting_words import CuttingWords
from verify.program.move_kinds import FEED
from verify.program.program import Program

METRIC: dict[float, tuple[float, ...]] = {
    1: (0.25,), 1.2: (0.25,), 1.4: (0.3,), 1.6: (0.35,), 1.8: (0.35,), 2: (0.4, 0.25), 2.5: (0.45, 0.35),
    3: (0.5, 0.35), 3.5: (0.6, 0.35), 4: (0.7, 0.5), 5: (0.8, 0.5), 6: (1, 0.75), 7: (1, 0.75), 8: (1.25, 1),
    10: (1.5, 1.25, 1), 12: (1.75, 1.5, 1.25), 14: (2, 1.5), 16: (2, 1.5), 18: (2.5, 2, 1.5), 20: (2.5, 2, 1.5),
    22: (2.5, 2, 1.5), 24: (3, 2), 27: (3, 2), 30: (3.5, 2), 33: (3.5, 2), 36: (4, 3), 39: (4, 3), 42: (4.5, 3),
    45: (4.5, 3), 48: (5, 3), 52: (5, 4), 56: (5.5, 4), 60: (5.5, 4), 64: (6, 4)}
"""Pitches by diameter, mm, the coarse one first [ISO262]."""
SECOND = frozenset({1.4, 1.8, 3.5, 7, 14, 18, 22, 27, 33, 39, 45, 52, 60})
"""Diameters of second choice, mm [ISO262]."""
INCH: dict[float, tuple[int, ...]] = {
    0.06: (80,), 0.073: (64, 72), 0.086: (56, 64), 0.099: (48, 56), 0.112: (40, 48), 0.125: (40, 44),
    0.138: (32, 40), 0.164: (32, 36), 0.19: (24, 32), 0.216: (24, 28), 0.25: (20, 28), 0.3125: (18, 24),
    0.375: (16, 24), 0.4375: (14, 20), 0.5: (13, 20), 0.5625: (12, 18), 0.625: (11, 18), 0.75: (10, 16),
    0.875: (9, 14), 1.0: (8, 12)}
"""Threads to the inch by diameter in inches: coarse and fine series of unified threads [ASME2003]."""
MINOR = 1.0825
"""Pitches by which the hole of a thread of 60 degrees is narrower than its outer diameter [ISO68]."""
HOLE = (0.85, 1.1)  # pitches: least and most by which holes of such threads are drawn narrower
TOO_NARROW = 0.02, 0.05  # share by which a hole may be narrower than its thread asks, and than it is drawn
SAME_PITCH, SAME_SIZE = 0.02, 0.02  # share, and mm: other threads are no nearer


def thread_rank(diameter: float, pitch: float, more: tuple[float, float] | None = None) -> int | None:
    """How usual the threads are whose outer diameter is ``diameter`` plus ``more`` pitches, 0 for the most; None: none.

    diameter, pitch : mm; more : least and most, dimensionless; None: none more

    >>> thread_rank(5.0, 0.8), thread_rank(4.2, 0.8), thread_rank(4.2, 0.8, HOLE)
    (0, None, 0)
    """
    near = [(size - diameter, step, rank) for size, step, rank in _SERIES if abs(step - pitch) <= SAME_PITCH * step]
    return min((rank for over, step, rank in near if (
        abs(over) <= SAME_SIZE if more is None else more[0] * step <= over <= more[1] * step)), default=None)


def _series() -> Iterator[tuple[float, float, int]]:
    """Outer diameter and pitch of each thread, mm, and its rank."""
    for size, steps in METRIC.items():
        yield from ((size, step, (k > 0) + (size in SECOND)) for k, step in enumerate(steps))
    for inch, counts in INCH.items():
        yield from ((25.4 * inch, 25.4 / count, int(k > 0)) for k, count in enumerate(counts))


_SERIES = tuple(_series())


def needed_hole(diameter: float, pitch: float) -> tuple[float, bool]:
    """Diameter of the hole that must stand before a tap, mm, and whether ``diameter`` counts as that of its teeth.

    diameter, pitch : mm

    Notes
    -----
    D and P of a usual thread [ISO262] [ASME2003] are outer diameter and pitch, unless a more or as usual thread has a
    hole of D. Else D is the hole itself.

    >>> [round(x, 2) for x in (needed_hole(5.0, 0.8)[0], needed_hole(4.2, 0.8)[0])]
    [4.05, 3.99]
    """
    outer, inner = thread_rank(diameter, pitch), thread_rank(diameter, pitch, HOLE)
    if outer is not None and (inner is None or outer < inner):
        return (1.0 - TOO_NARROW[0]) * (diameter - MINOR * pitch), True
    return (1.0 - TOO_NARROW[1]) * diameter, False


def tap_holes(read: Sequence[FramedProgram], tools: Sequence[ToolBody], words: Mapping[int, CuttingWords],
              stated: Mapping[int, float]) -> tuple[dict[int, float], dict[int, Assumed]]:
    """The hole that each tap needs, mm by T number, and what that takes for granted, by T number.

    words  : by T number, where a tap may state its pitch
    stated : mm by T number, holes that the setup states

    The pitch is that of the tap, or feed over speed of the moves that go deepest. A tap of unknown pitch is left out.
    """
    holes, taken = {}, {}
    for tool in (t for t in tools if t.kind == "tap"):
        if tool.number in stated:
            holes[tool.number] = (1.0 - TOO_NARROW[0]) * stated[tool.number]
            continue
        said = words.get(tool.number)
        pitches = [said.pitch] if said is not None and said.pitch is not None else [
            pitch for r in read for pitch in _pitches(r.program, tool.number)]
        wide = [(*needed_hole(tool.diameter, pitch), pitch) for pitch in pitches]
        if not wide:
            continue
        holes[tool.number], outer, pitch = max(wide)
        if outer:
            taken[tool.number] = Assumed(
                AssumedKind.TAP_DIAMETER, f"T{tool.number}: a thread of {tool.diameter:g} mm, pitch {pitch:.3g} mm",
                f"if {tool.diameter:g} mm is the hole of a larger thread, the tap breaks where the hole was drilled "
                "narrower", "core_diameter_mm of the tap: the hole that it needs")
    return holes, taken


def _pitches(p: Program, number: int) -> Iterator[float]:
    """Feed over speed, mm, of the deepest feed move of a tap along each of its axes."""
    if not len(p.speed):
        return
    rows = np.flatnonzero((p.tool == number) & (p.kind == FEED) & (p.minutes > 0.0) & (p.speed > 0.0))
    rows = rows[np.linalg.norm(p.end[rows] - p.start[rows], axis=1) > 0.0]
    if not len(rows):
        return
    up: F64 = np.tile([0.0, 0.0, 1.0], (len(rows), 1)) if p.poses is None else p.poses.end_axis[rows]
    _, of = np.unique(np.round(up, 6), axis=0, return_inverse=True)
    group: NDArray[np.intp] = of.reshape(-1)
    high = np.einsum("ij,ij->i", p.end[rows], up)
    for k in range(int(group.max()) + 1):
        own = np.flatnonzero(group == k)
        m = rows[own[int(np.argmin(high[own]))]]
        yield float(np.linalg.norm(p.end[m] - p.start[m]) / (p.minutes[m] * p.speed[m]))


__all__ = ["needed_hole", "tap_holes", "thread_rank"]
