"""What a program asks of the machine, and ways nobody wrote down: doglegs, unstated starts, stops in the stock."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from geometry.mesh import F64
from verify.cycles import FEED
from verify.model import Finding, FindingKind, ProofSetup
from verify.program import Program
from verify.stock import stock_bounds

LEAST_BELOW = 0.01  # mm under the part that nobody need be told of
Z_AXIS = 4


def top_of_all(bounds: F64, setup: ProofSetup) -> float:
    """Height that neither part (bounds (2, 3), mm), stock nor fixtures exceed before the first cut, mm."""
    return max(float(bounds[1, 2]), float(stock_bounds(bounds, setup)[1, 2]), *(float(f[1, 2]) for f in setup.fixtures),
               -np.inf)


def from_above(program: Program, height: float) -> Program:
    """The program with every descent that only lacks the height it starts from begun at ``height`` mm, or higher.

    Start, home and tool change are above everything, so that is where the tool comes from, and the way down is
    simulated like any other. Other unknown starts are left to ``way_findings``.
    """
    start, minutes = program.start.copy(), program.minutes.copy()
    for move, axes in program.unknown.tolist():
        if axes == Z_AXIS and (start[move, :2] == program.end[move, :2]).all():
            start[move, 2] = max(height, program.end[move, 2])
            minutes[move] = (start[move, 2] - program.end[move, 2]) / program.feed[move]
    return replace(program, start=start, minutes=minutes)


def way_findings(read: Sequence[Program], top: float, setup: ProofSetup) -> list[Finding]:
    """Ways that cannot be simulated and are not clear above everything, and stops below it.

    top : mm, as ``top_of_all``
    """
    return [found for p in read for found in (*_blind(p, top, setup), *_doglegs(p, top, setup), *_low_stops(p, top))]


def _blind(p: Program, top: float, setup: ProofSetup) -> Iterator[Finding]:
    clear = top + setup.clearance_rapid - 1e-6
    for move, axes in p.unknown.tolist():
        a, b = p.start[move], p.end[move]
        lowest = min(a[2], b[2])
        if lowest >= clear or (axes == Z_AXIS and (a[:2] == b[:2]).all()):
            continue
        names = "".join(name for k, name in enumerate("XYZ") if axes & (1 << k))
        yield _finding(FindingKind.PROGRAM, p, move, float(clear - lowest), float(clear),
                       f"the way to {_place(b)} starts at a place the program has not stated ({names}) and goes below "
                       f"Z{clear:.3f}, so it cannot be simulated: state X and Y first, then come down")


def _doglegs(p: Program, top: float, setup: ProofSetup) -> Iterator[Finding]:
    if not setup.dogleg or len(p) == 0:
        return
    clear = top + setup.clearance_rapid - 1e-6
    moved = (np.abs(p.end - p.start) > 1e-9).sum(axis=1) > 1
    low = np.minimum(p.start[:, 2], p.end[:, 2])
    bad = np.flatnonzero((p.kind != FEED) & moved & (low < clear))
    if len(bad):
        m = int(bad[0])
        yield _finding(FindingKind.RAPID, p, m, float(clear - low[bad].min()), float(clear),
                       f"a rapid moves several axes below Z{clear:.3f}; on this machine (rapid_motion dogleg) its way "
                       "is no straight line, so it cannot be simulated: move Z alone, or X and Y above that", len(bad))


def _low_stops(p: Program, top: float) -> Iterator[Finding]:
    for stop in p.stops:
        if stop.z < top - 1e-6:
            yield Finding(FindingKind.PROGRAM, p.name, stop.line, None, None, None, top - stop.z, top,
                          f"{stop.what} with T{stop.tool} at Z{stop.z:.3f}, below the top of stock and fixtures "
                          f"(Z{top:.3f}): lift the tool first")


def limit_findings(read: Sequence[Program], setup: ProofSetup) -> list[Finding]:
    """What the machine or a tool cannot do: travel, feed, spindle speed; one finding per program and limit."""
    return [found for p in read for found in (*_travel(p, setup), *_feeds(p, setup), *_speeds(p, setup))]


def _travel(p: Program, setup: ProofSetup) -> Iterator[Finding]:
    """Where the travel lies is for the operator to set, so what the spindle's moves span is held against it.

    To blame is the end that lies further from most of the program: one word without its point is the line named.
    """
    if setup.travel is None or len(p) == 0:
        return
    lengths = {int(t): setup.gauge_length.get(int(t), 0.0) for t in np.unique(p.tool)}
    spindle = p.end + np.array([[0.0, 0.0, lengths[t]] for t in p.tool.tolist()])
    for axis, limit in enumerate(np.asarray(setup.travel, dtype=np.float64).tolist()):
        low, high = int(np.argmin(spindle[:, axis])), int(np.argmax(spindle[:, axis]))
        span = float(spindle[high, axis] - spindle[low, axis])
        if span > limit + 1e-6:
            ends = " to ".join(f"{p.end[m, axis]:.3f} (line {p.line[m]})" for m in (low, high))
            more = f" and tool lengths from {lengths[int(p.tool[low])]:g} to {lengths[int(p.tool[high])]:g} mm" \
                if axis == 2 and any(lengths.values()) else ""
            middle = float(np.median(spindle[:, axis]))
            far = low if middle - spindle[low, axis] > spindle[high, axis] - middle else high
            yield _finding(FindingKind.LIMIT, p, far, span - limit, limit,
                           f"the program moves over {span:.3f} mm in {'XYZ'[axis]}, from {ends}{more}; the machine "
                           f"travels {limit:g} mm")


def _feeds(p: Program, setup: ProofSetup) -> Iterator[Finding]:
    if setup.max_feed is None:
        return
    over = np.flatnonzero(p.feed > setup.max_feed * (1.0 + 1e-9))
    if len(over):
        m = int(over[np.argmax(p.feed[over])])
        yield _finding(FindingKind.LIMIT, p, m, float(p.feed[m]) - setup.max_feed, setup.max_feed,
                       f"F{p.feed[m]:g} is over the {setup.max_feed:g} mm/min the machine feeds at", len(over))


def _speeds(p: Program, setup: ProofSetup) -> Iterator[Finding]:
    for tool, (speed, line) in sorted(p.speeds.items()):
        limit = setup.max_rpm.get(tool)
        if limit is not None and speed > limit * (1.0 + 1e-9):
            yield Finding(FindingKind.LIMIT, p.name, line, None, None, None, speed - limit, limit,
                          f"S{speed:g} with T{tool} is over the {limit:g} 1/min it may turn at")


def notes_on(p: Program, bottom: float) -> Iterator[str]:
    """What is no finding and should be known: words taken for granted; tips below ``bottom`` mm, the part's underside.

    The proof knows of no table that is not a fixture of the setup.
    """
    if p.assumed:
        yield f"{p.name} does not state {', '.join(p.assumed)} before its first move; it was read as if it did"
    if len(p) and float(p.end[:, 2].min()) < bottom - LEAST_BELOW:
        m = int(np.argmin(p.end[:, 2]))
        yield (f"{p.name}, line {p.line[m]} goes to Z{p.end[m, 2]:.3f}, {bottom - p.end[m, 2]:.3f} mm below the "
               "part; what stands there is not known unless it is a fixture of the setup")


def _place(point: F64) -> str:
    return " ".join(f"{name}{value:.3f}" for name, value in zip("XYZ", point.tolist(), strict=True))


def _finding(kind: FindingKind, p: Program, move: int, over: float, limit: float, message: str,
             count: int = 1) -> Finding:
    x, y, z = (round(float(v), 6) for v in p.end[move])
    return Finding(kind, p.name, int(p.line[move]), None, None, (x, y, z), over, limit, message, count)
