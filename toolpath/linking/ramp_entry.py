"""Ways down onto a pass: ramps along the pass itself, never steeper than the ramp angle of the tool.

A closed pass is followed round, an open one back and forth along its beginning. Height is lost at an even rate until
the pass is reached. Where a pass is inclined itself, less of the angle is left. Places are tips in mm, access frame.
"""

from __future__ import annotations

import math

import numpy as np

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.kernels.ramp import ease
from toolpath.stock.stock_map import SKIN

RAMP_SHARE = 0.9  # of the steepest ramp allowed
EASE_SHARE = 0.98  # of that ramp, for one move that catches up
ROUNDING = 1.1e-4  # mm: on a move of a few um the rounding of Z in the program alone would be too steep
LEANING = 0.5  # of the steepest ramp: a pass that leans more is gone down steeper than that where it goes down itself
IN_CUT, LEAST_IN_CUT = 0.5, 0.25  # of the way that works off what such a way down digs
MIN_RUN = 0.25  # radii, there and back on an open line: least length of a ramp
MAX_LEGS = 400


def way_down(points: F64, closed: bool, over: float, tool: ToolBody, angle: float, care: float,
             stands: float = 1.0) -> F64 | None:
    """A pass with a way down from ``over`` above it: round the loop, or back and forth along its beginning.

    points : (n, 3) float64, mm, access frame, the pass
    closed : whether it ends where it begins
    over   : mm, height of the start of the way above the start of the pass
    angle  : rad, steepest descent of the tool
    care   : share of that angle and of a skin that is used
    stands : share of the pass under stock, of the part that the way follows

    Returns
    -------
    (m, 3) float64, mm, access frame, or None
        The way and after it the whole pass; None where the pass is too short for a ramp.

    Notes
    -----
    Where the pass itself goes up or down, the ramp has less to descend by. Going downhill, a pass inclined by more than
    half of the ramp is dug into by all the height lost since the tool was there before. So what is lost between, D, is
    no more than the level or rising way works off: back and forth that is half of the way. Only way in the cut works
    anything off, and the first ways leave the stock for a part of theirs, so ``IN_CUT`` of what lies under stock
    counts. Over a pass with the lean l the way in the cut grows by D / l each time. With a ramp t, what is dug and not
    worked off adds up to D l / 2 t until it is long enough, so D is no more than a skin over 1 + l / 2 t.
    """
    slope, skin = steepest_ramp(angle, care), care * SKIN * tool.diameter
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1))])
    total = float(s[-1])
    if total < MIN_RUN * tool.radius * (2.0 if closed else 1.0):
        return None  # back and forth on the spot is drilling
    lean = _steepest(ramped_part(points, closed, over, slope))
    digs, rest = lean > LEANING * slope, slope - lean
    leg = min(total, max(0.5 * over / slope, 1e-9), skin / slope if digs else math.inf)
    if digs:
        level = _not_down(points, (1.0 / RAMP_SHARE - 1.0) * slope) if closed else 0.5
        lost = skin / (1.0 + 0.5 * lean / math.tan(angle))
        rest = min(IN_CUT * max(stands, LEAST_IN_CUT) * slope * level, lost / (total if closed else 2.0 * leg))
    if rest <= 0.0:
        return None
    need, most = over / rest, math.tan(angle) * EASE_SHARE - (0.0 if digs else lean)
    if closed:
        laps = math.ceil(need / total)
        if laps > MAX_LEGS:
            return None
        walked = np.concatenate([points] + [points[1:]] * laps)
        t = np.concatenate([s] + [s[1:] + total * k for k in range(1, laps + 1)])
        down = _with_knot(walked, t, need)
        lift = np.maximum(over * (1.0 - down[1] / need), 0.0)
        path = _eased(down[0], lift, most)
        last = int(np.searchsorted(down[1], need + total - 1e-9))
        return np.ascontiguousarray(path[: last + 1])
    legs = max(2, 2 * math.ceil(need / (2.0 * leg)))
    if legs > MAX_LEGS:
        return None
    head, hs = _with_knot(points, s, leg)
    head, hs = head[hs <= leg + 1e-9], hs[hs <= leg + 1e-9]
    ways, lifts = [points[:1]], [np.array([over])]
    for k in range(legs):
        xy, along = (head, hs) if k % 2 == 0 else (head[::-1], leg - hs[::-1])
        ways.append(xy[1:])
        lifts.append(over * (1.0 - (k + along[1:] / leg) / legs))
    lifts.append(np.zeros(len(points) - 1))
    return _eased(np.vstack([*ways, points[1:]]), np.concatenate(lifts), most)


def steepest_ramp(angle: float, care: float) -> float:
    """What a ramp goes down at most, mm per mm in plan.

    angle : rad, steepest descent of the tool;  care : share of that angle that is used
    """
    return care * math.tan(angle) * RAMP_SHARE


def ramped_part(points: F64, closed: bool, over: float, slope: float) -> F64:
    """The part of a pass that a way down follows, (k, 3) float64, mm, access frame: a closed pass is followed whole.

    points : (n, 3) float64, mm, access frame, the pass;  closed : whether it ends where it begins
    over   : mm, height of the start of the way above the start of the pass
    slope  : mm per mm in plan, steepest ramp
    """
    return points if closed else head_of(points, 0.5 * over / slope)


def digs_down(points: F64, closed: bool, over: float, slope: float) -> bool:
    """Whether a way down goes down steeper than a ramp where the pass goes down itself.

    points : (n, 3) float64, mm, access frame, the pass;  closed, over, slope : as in ``ramped_part``
    """
    return _steepest(ramped_part(points, closed, over, slope)) > LEANING * slope


def head_of(points: F64, length: float) -> F64:
    """The beginning of a polyline, ``length`` mm long in plan, with at least two points, (m, 3) float64, mm.

    points : (n, 3) float64, mm, access frame
    """
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1))])
    head, at = _with_knot(points, s, length)
    return head[:max(2, int(np.searchsorted(at, length, side="right")))]


def _eased(points: F64, lift: F64, max_slope: float) -> F64:
    """Points raised by ``lift``, and more where a short move would be too steep for its share of the descent.

    max_slope : mm per mm in plan, lift that one move may lose
    """
    ease(points, lift, max_slope, ROUNDING)
    return np.ascontiguousarray(points + np.column_stack([np.zeros((len(points), 2)), lift]))


def _steepest(points: F64) -> float:
    """The most a polyline (n, 3), mm, goes up or down, mm per mm in plan."""
    move = np.diff(points, axis=0)
    rise = np.maximum(np.abs(move[:, 2]) - ROUNDING, 0.0)
    return float((rise / np.maximum(np.hypot(move[:, 0], move[:, 1]), 1e-12)).max(initial=0.0))


def _not_down(points: F64, slope: float) -> float:
    """Share in plan of a polyline (n, 3), mm, that does not go down steeper than ``slope``, mm per mm."""
    move = np.diff(points, axis=0)
    run = np.hypot(move[:, 0], move[:, 1])
    return float(run[-move[:, 2] <= slope * run].sum() / run.sum())


def _with_knot(points: F64, s: F64, at: float) -> tuple[F64, F64]:
    """A polyline and its arc lengths with one more point at arc length ``at`` where it lies inside."""
    if at <= s[0] or at >= s[-1]:
        return points, s
    k = int(np.searchsorted(s, at))
    if abs(s[k] - at) < 1e-12:
        return points, s
    t = (at - s[k - 1]) / (s[k] - s[k - 1])
    new = points[k - 1] + t * (points[k] - points[k - 1])
    return np.insert(points, k, new, axis=0), np.insert(s, k, at)
