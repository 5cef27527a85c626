"""Limits of the machine, and unprogrammed moves: doglegs, unstated starts, stops in the stock.

Arrays are float64, lengths mm, points in the setup frame.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.checks.clear_height import UP, Z_AXIS, _top_along, top_of_all
from verify.checks.dogleg_turns import bounded
from verify.checks.table_clearance import UPRIGHT, lowest_places
from verify.model import Finding, FindingKind, ProofSetup
from verify.program.move_kinds import FEED
from verify.program.program import Program

MIN_BELOW = 0.01  # mm: tips less far below the part are not noted
MIN_ANGLE = 1e-6  # deg: less beyond a limit is rounding
RATE_ROUNDING = 1e-6  # share of a rate that is rounding: angles and minutes come from decimals


def way_findings(p: Program, bounds: F64, tools: Sequence[ToolBody], setup: ProofSetup) -> list[Finding]:
    """Findings of moves whose path is unknown and not above everything, and of stops below it.

    bounds : (2, 3) float64, mm, setup frame, of the part
    """
    top, low = top_of_all(bounds, setup), low_places(p, tools, setup)
    return [*_blind(p, bounds, top, low, setup), *_doglegs(p, top, low, setup), *_low_stops(p, bounds, setup),
            *_low_planes(p, bounds, setup)]


def low_places(p: Program, tools: Sequence[ToolBody], setup: ProofSetup) -> F64:
    """(m,) float64, mm, lowest place of the tool on each move: the holder of a tilted tool may be below its tip."""
    low = np.minimum(p.start[:, 2], p.end[:, 2])
    return low if p.poses is None else np.minimum(low, lowest_places(p, tools, setup, leaning=True))


def _blind(p: Program, bounds: F64, top: float, low: F64, setup: ProofSetup) -> Iterator[Finding]:
    """Moves from a place the program has not stated that do not end above everything.

    Above is along Z of the machine. That is the tool axis on a machine whose table tilts, else Z of the setup frame.
    The whole tool must be above; low : (m,) float64, mm, lowest place of the tool on each move.
    """
    clear = top + setup.clearance_rapid - 1e-6
    tables = setup.kinematics is not None and not setup.kinematics.tilts_head
    for move, axes in p.unknown.tolist():
        a, b = p.start[move], p.end[move]
        if axes == Z_AXIS and (a[:2] == b[:2]).all():
            continue
        names = "".join(name for k, name in enumerate("XYZ") if axes & (1 << k))
        way = f"the move to {_place(b)} starts at a place that the program has not stated ({names})"
        axis = UP if p.poses is None else p.poses.end_axis[move]
        if tables and axis[2] < 1.0 - UPRIGHT:
            limit = _top_along(axis, bounds, setup) + setup.clearance_rapid
            lowest = min(float(a @ axis), float(b @ axis))
            if lowest < limit - 1e-6:
                yield _finding(FindingKind.PROGRAM, p, move, limit - lowest, limit,
                               f"{way}. It ends {limit - lowest:.3f} mm too low along the tool axis and cannot be "
                               "simulated: move farther out first, then along the tool axis")
        elif low[move] < clear:
            yield _finding(FindingKind.PROGRAM, p, move, float(clear - low[move]), float(clear),
                           f"{way}. It goes below Z{clear:.3f} and cannot be simulated: program X and Y first, then "
                           "Z")


def _doglegs(p: Program, top: float, low: F64, setup: ProofSetup) -> Iterator[Finding]:
    """Rapids that turn an axis while another moves.

    Rapids of linear axes alone are simulated (``verify.material.dogleg_rapids``). So are turns whose ways are bounded
    (``verify.checks.dogleg_turns``).

    low : (m,) float64, mm, lowest place of the tool on each move
    """
    if not setup.dogleg or p.poses is None or bounded(p, setup):
        return
    clear = top + setup.clearance_rapid - 1e-6
    start, end = joints_of(p, setup) or (p.start, p.end)
    turning = (p.poses.start_turn != p.poses.end_turn).sum(axis=1)
    several = (np.abs(end - start) > 1e-9).sum(axis=1) + turning > 1
    bad = np.flatnonzero((p.kind != FEED) & (turning > 0) & several & (low < clear))
    if len(bad):
        m = int(bad[0])
        yield _finding(FindingKind.RAPID, p, m, float(clear - low[bad].min()), float(clear),
                       f"a rapid below Z{clear:.3f} turns a rotary axis while another axis moves. Its path is unknown "
                       "on this machine (rapid_motion dogleg, no machine.pivots_mm): turn above that height, or move "
                       "one axis at a time",
                       len(bad))


def _low_stops(p: Program, bounds: F64, setup: ProofSetup) -> Iterator[Finding]:
    """Stops at which part, blank or fixtures reach higher along the tool axis than the tip."""
    for stop in p.stops:
        axis = np.array(stop.axis)
        top = _top_along(axis, bounds, setup) + (setup.clearance_rapid if stop.room else 0.0)
        at = float(np.where(axis != 0.0, np.array(stop.tip) * axis, 0.0).sum())
        if at < top - 1e-6:
            what = "the top of stock and fixtures" + (" and the rapid clearance" if stop.room else "")
            along = f"Z{at:.3f}, below {what} (Z{top:.3f})" if stop.axis[2] == 1.0 else \
                f"{at:.3f} mm along its axis, where stock and fixtures reach {top:.3f} mm"
            yield Finding(FindingKind.PROGRAM, p.name, stop.line, None, None, None, top - at, top,
                          f"{stop.event} with T{stop.tool} at {along}: retract the tool first")


def _low_planes(p: Program, bounds: F64, setup: ProofSetup) -> Iterator[Finding]:
    """Planes of a STEP-NC file that part, blank and fixtures reach, or come nearer to than the rapid clearance.

    A control may take the tool to such a plane and along it, although the paths of the file stay above.
    """
    for plane in p.planes:
        normal = np.array(plane.normal)
        top, at = _top_along(normal, bounds, setup), float(np.array(plane.point) @ normal)
        limit = top + setup.clearance_rapid
        if at < limit - 1e-6:
            where = f"Z{at:.3f}" if plane.normal[2] > 1.0 - 1e-9 else f"{at:.3f} mm along its normal"
            yield Finding(FindingKind.RAPID, p.name, plane.line, None, None, plane.point, limit - at, limit,
                          f"the {plane.what} at {where} is {abs(top - at):.3f} mm {'under' if at < top else 'over'} "
                          f"the top of part, stock and fixtures ({top:.3f}): a control goes there in a rapid")


def limit_findings(read: Sequence[Program], setup: ProofSetup) -> list[Finding]:
    """Findings of exceeded limits: travel, angles, rates, feed, spindle speed; one per program and limit."""
    return [found for p in read for found in (*_travel(p, setup), *_places(p, setup), *_angles(p, setup),
                                              *_rates(p, setup), *_feeds(p, setup), *_speeds(p, setup))]


def joints_of(p: Program, setup: ProofSetup) -> tuple[F64, F64] | None:
    """Linear joints where every move starts and ends; None where the pivots they need are not given.

    Returns two (m, 3) float64 arrays, mm, machine frame. While the rotary axes stand at 0 the joints are the tip.
    """
    if p.poses is None or setup.kinematics is None:
        return p.start, p.end
    if setup.kinematics.pivots is None:
        return None
    gauge = _gauges(p, setup)
    return (setup.kinematics.joints(p.start, p.poses.start_turn, gauge),
            setup.kinematics.joints(p.end, p.poses.end_turn, gauge))


def _gauges(p: Program, setup: ProofSetup) -> F64:
    """(m,) mm from the spindle face to the tip, move by move."""
    numbers, which = np.unique(p.tool, return_inverse=True)
    lengths = np.array([setup.gauge_length.get(int(t), 0.0) for t in numbers])
    return np.asarray(lengths[which])


def _travel(p: Program, setup: ProofSetup) -> Iterator[Finding]:
    """Compare the span of the spindle's moves with the travel; the operator sets where the travel lies.

    The finding names the end that is farther from the median of the program, so a word that lacks its decimal point
    is the line named. Of two equally far ends it names the later one, where the travel runs out.
    """
    if setup.travel is None or len(p) == 0:
        return
    joints = joints_of(p, setup)
    if joints is None:
        return
    end, lengths = joints[1], _gauges(p, setup)
    spindle = end + np.column_stack([np.zeros((len(p), 2)), lengths])
    lines = spindle[np.r_[p.line[1:] != p.line[:-1], True]]  # one place a line, however many pieces it has
    for axis, limit in enumerate(np.asarray(setup.travel, dtype=np.float64).tolist()):
        low, high = int(np.argmin(spindle[:, axis])), int(np.argmax(spindle[:, axis]))
        span = float(spindle[high, axis] - spindle[low, axis])
        if span > limit + 1e-6:
            ends = " to ".join(f"{end[m, axis]:.3f} (line {p.line[m]})" for m in (low, high))
            more = f" and tool lengths from {lengths[low]:g} to {lengths[high]:g} mm" \
                if axis == 2 and lengths.any() else ""
            subject = "the program moves" if p.poses is None else "the program moves the linear axes"
            below, above = np.abs(spindle[[low, high], axis] - np.median(lines[:, axis])).tolist()
            far = max(low, high) if abs(below - above) < 1e-9 else low if below > above else high
            yield _finding(FindingKind.LIMIT, p, far, span - limit, limit,
                           f"{subject} over {span:.3f} mm in {'XYZ'[axis]}, from {ends}{more}; the travel of the "
                           f"machine is {limit:g} mm")


def _places(p: Program, setup: ProofSetup) -> Iterator[Finding]:
    """Coordinates of the machine (G53) that lie farther from its zero than its whole travel."""
    if setup.travel is None:
        return
    for axis, limit in enumerate(np.asarray(setup.travel, dtype=np.float64).tolist()):
        beyond = [(abs(value) - limit, line, value) for line, k, value in p.places if k == axis]
        over, line, value = max(beyond, default=(0.0, 0, 0.0), key=lambda b: b[0])
        if over > 1e-6:
            yield Finding(FindingKind.LIMIT, p.name, line, None, None, None, over, limit,
                          f"{'XYZ'[axis]}{value:g} in coordinates of the machine (G53) is {over:.3f} mm beyond its "
                          f"travel of {limit:g} mm", sum(b[0] > 1e-6 for b in beyond))


def _angles(p: Program, setup: ProofSetup) -> Iterator[Finding]:
    if p.poses is None or setup.kinematics is None or setup.rotary_limits is None:
        return
    turn, (low, high) = np.degrees(p.poses.end_turn), np.degrees(setup.rotary_limits).T
    beyond = np.maximum(low - turn, turn - high)
    for k, letter in enumerate(setup.kinematics.letters):
        m = int(np.argmax(beyond[:, k]))
        if beyond[m, k] > MIN_ANGLE:
            limit = float(high[k] if turn[m, k] > high[k] else low[k])
            yield _finding(FindingKind.LIMIT, p, m, float(beyond[m, k]), limit,
                           f"{letter}{turn[m, k]:g} is outside the range of {letter}, {low[k]:g} to {high[k]:g} deg",
                           int((beyond[:, k] > MIN_ANGLE).sum()))


def _rates(p: Program, setup: ProofSetup) -> Iterator[Finding]:
    """Feed moves that need a linear axis faster than its rapid, or a rotary axis faster than its rate.

    Near the pole a slow tip makes the rotary axes fast.
    """
    if p.poses is None or setup.kinematics is None:
        return
    joints, fed = joints_of(p, setup), p.minutes > 0
    if joints is not None:
        yield from _racing(p, np.abs(joints[1] - joints[0]), fed, "XYZ", setup.rapid_feed, "mm/min")
    if setup.rotary_rate is not None:
        turned = np.degrees(np.abs(p.poses.end_turn - p.poses.start_turn))
        yield from _racing(p, turned, fed, setup.kinematics.letters, float(np.degrees(setup.rotary_rate)), "deg/min")


def _racing(p: Program, way: F64, fed: NDArray[np.bool_], letters: str, limit: float, unit: str) -> Iterator[Finding]:
    """One finding per axis whose travel, (m, n), over the minutes of its move is faster than a limit."""
    rate = np.divide(way, p.minutes[:, None], out=np.zeros(way.shape), where=fed[:, None])
    over = rate > limit * (1.0 + RATE_ROUNDING)
    for k in np.flatnonzero(over.any(axis=0)).tolist():
        m = int(np.argmax(rate[:, k]))
        yield _finding(FindingKind.LIMIT, p, m, float(rate[m, k]) - limit, limit,
                       f"the feed needs {rate[m, k]:.6g} {unit} of {letters[k]}; the limit of the machine is {limit:g} "
                       f"{unit}: feed slower, or tilt the tool away from the pole", int(over[:, k].sum()))


def _feeds(p: Program, setup: ProofSetup) -> Iterator[Finding]:
    if setup.max_feed is None:
        return
    over = np.flatnonzero(p.feed > setup.max_feed * (1.0 + 1e-9))
    if len(over):
        m = int(over[np.argmax(p.feed[over])])
        yield _finding(FindingKind.LIMIT, p, m, float(p.feed[m]) - setup.max_feed, setup.max_feed,
                       f"F{p.feed[m]:g} is above the largest feed of the machine, {setup.max_feed:g} mm/min", len(over))


def _speeds(p: Program, setup: ProofSetup) -> Iterator[Finding]:
    for tool, (speed, line) in sorted(p.speeds.items()):
        limit = setup.max_rpm.get(tool)
        if limit is not None and speed > limit * (1.0 + 1e-9):
            yield Finding(FindingKind.LIMIT, p.name, line, None, None, None, speed - limit, limit,
                          f"S{speed:g} with T{tool} is above its largest speed, {limit:g} 1/min")


def notes_on(p: Program, bottom: float, setup: ProofSetup) -> Iterator[str]:
    """Notes that are not findings: assumed words, tips below the part, and axes that could not be checked.

    bottom : mm, underside of the part

    The proof knows a table only where it is a fixture of the setup.
    """
    yield from (f"{p.name}, {note}" for note in p.notes)
    if p.assumed:
        yield f"{p.name} does not state {', '.join(p.assumed)} before its first move; the proof assumes it"
    if len(p) and float(p.end[:, 2].min()) < bottom - MIN_BELOW:
        m = int(np.argmin(p.end[:, 2]))
        yield (f"{p.name}, line {p.line[m]} goes to Z{p.end[m, 2]:.3f}, {bottom - p.end[m, 2]:.3f} mm below the "
               "part; the proof knows only fixtures of the setup there")
    if joints_of(p, setup) is None:
        yield (f"{p.name} turns rotary axes and machine.pivots_mm is not given: travel and rates of the linear axes "
               "were not checked")


def _place(point: F64) -> str:
    return " ".join(f"{name}{value:.3f}" for name, value in zip("XYZ", point.tolist(), strict=True))


def _finding(kind: FindingKind, p: Program, move: int, over: float, limit: float, message: str,
             count: int = 1) -> Finding:
    x, y, z = (round(float(v), 6) for v in p.end[move])
    return Finding(kind, p.name, int(p.line[move]), None, None, (x, y, z), over, limit, message, count)
