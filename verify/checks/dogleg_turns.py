"""How far a rapid that turns the tool or the part may leave its straight way, where each axis moves at its own speed.

Every joint goes from its first place to its last, and stops there. So all poses of such a rapid lie in the box of its
joints. Between two poses of the box the linear joints carry the tool by no more than the diagonal of the box. An axis
that turns by w moves a place at the distance r from it by no more than w r. So no place of part, stock and fixtures
comes nearer to the tool than at the first pose by more than

    s = |dJ| + w1 r1 + w2 r2

where r is the largest distance of such a place from the axis of a table, or of the tool from the swivel of a head. The
proof keeps s free round the tool, besides the clearance of rapids. A block of more than one piece counts whole.

Arrays are float64, lengths mm, angles rad.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.blank.blank import stock_bounds
from verify.kinematics import Kinematics
from verify.model import ProofSetup
from verify.program.move_kinds import FEED
from verify.program.program import Program
from verify.tool_bodies import Bodies

STILL = 1e-9  # mm, and rad


class JointBoxes(NamedTuple):
    """The joints of the block of each move.

    low, high : (m, 3) float64, mm, machine frame, linear joints
    turn      : (m, 2) float64, rad, ways of the tilting and the turning axis
    chosen    : (m,) bool, rapids in which a rotary axis turns while another axis moves
    """

    low: F64
    high: F64
    turn: F64
    chosen: NDArray[np.bool_]


def bounded(p: Program, setup: ProofSetup) -> bool:
    """Whether the setup gives what the ways of turning rapids need: pivots, and gauge lengths of tools in a head."""
    kinematics = setup.kinematics
    if p.poses is None or kinematics is None or kinematics.pivots is None:
        return False
    return not kinematics.tilts_head or all(int(t) in setup.gauge_length for t in np.unique(p.tool) if t > 0)


def strays(p: Program, bounds: F64, tools: Sequence[ToolBody], setup: ProofSetup) -> F64:
    """How much nearer each move may bring the tool to part, stock or fixtures than its straight way.

    bounds : (2, 3) float64, mm, setup frame, of the part

    Returns (m,) float64, mm; 0 for feed moves, for rapids that turn one axis alone or none, and where it is unknown.
    """
    boxes = _boxes(p, setup)
    if boxes is None or setup.kinematics is None:
        return np.zeros(len(p))
    kinematics = setup.kinematics
    solids = [bounds, stock_bounds(bounds, setup), *(np.asarray(f, dtype=np.float64) for f in setup.fixtures)]
    radii = _table_radii(kinematics, np.stack([c for b in solids for c in _corners(b)]))
    swing = _lengths(p, tools, setup) + (kinematics.points()[0][2] if kinematics.tilts_head else 0.0)
    tilt = swing if kinematics.tilts_head else np.full(len(p), radii[0])
    spin = swing if kinematics.turns_head else np.full(len(p), radii[1])
    out = np.linalg.norm(boxes.high - boxes.low, axis=1) + boxes.turn[:, 0] * tilt + boxes.turn[:, 1] * spin
    return np.where(boxes.chosen, out, 0.0)


def drops(p: Program, tools: Sequence[ToolBody], setup: ProofSetup) -> F64:
    """How much lower over the table each move may bring the tool than its straight way.

    Returns (m,) float64, mm, as ``strays``. A table that turns about Z of the part changes no height.
    """
    boxes = _boxes(p, setup)
    if boxes is None or setup.kinematics is None:
        return np.zeros(len(p))
    kinematics, long = setup.kinematics, _lengths(p, tools, setup)
    pivot = np.array(kinematics.points()[0])
    if kinematics.tilts_head:
        out = (long + pivot[2]) * (boxes.turn[:, 0] + (boxes.turn[:, 1] if kinematics.turns_head else 0.0))
    else:
        far = np.linalg.norm(np.maximum(np.abs(boxes.low - pivot), np.abs(boxes.high - pivot)), axis=1)
        out = (far + long) * boxes.turn[:, 0]
    return np.where(boxes.chosen, out + np.linalg.norm(boxes.high - boxes.low, axis=1), 0.0)


def _boxes(p: Program, setup: ProofSetup) -> JointBoxes | None:
    """The boxes of all moves; None where rapids are straight or the ways of turning ones are not bounded."""
    if not setup.dogleg or len(p) == 0 or p.poses is None or setup.kinematics is None or not bounded(p, setup):
        return None
    numbers, which = np.unique(p.tool, return_inverse=True)
    gauge = np.array([setup.gauge_length.get(int(t), 0.0) for t in numbers])[which]
    turns = np.stack([p.poses.start_turn, p.poses.end_turn])
    joints = np.stack([setup.kinematics.joints(tip, turn, gauge)
                       for tip, turn in zip((p.start, p.end), turns, strict=True)])
    rapid = p.kind != FEED
    new = np.ones(len(p), np.bool_)
    new[1:] = (p.line[1:] != p.line[:-1]) | ~rapid[1:] | ~rapid[:-1]
    first, block = np.flatnonzero(new), np.cumsum(new) - 1
    low, high = (np.minimum.reduceat(joints.min(axis=0), first)[block],
                 np.maximum.reduceat(joints.max(axis=0), first)[block])
    turn = (np.maximum.reduceat(turns.max(axis=0), first) - np.minimum.reduceat(turns.min(axis=0), first))[block]
    several = (high - low > STILL).sum(axis=1) + (turn > STILL).sum(axis=1) > 1
    return JointBoxes(low, high, turn, rapid & (turn > STILL).any(axis=1) & several)


def _corners(box: F64) -> F64:
    return np.stack(np.meshgrid(*np.asarray(box, dtype=np.float64).T, indexing="ij"), -1).reshape(-1, 3)


def _table_radii(kinematics: Kinematics, places: F64) -> tuple[float, float]:
    """Largest distances of places (n, 3), mm, from the tilting and the turning axis of a table; 0 for those of a head.

    The turning axis takes the places round before the tilting one does.
    """
    if kinematics.turns_head:
        return 0.0, 0.0
    tilting, turning = np.array(kinematics.points())
    spin = float(np.hypot(*(places - turning)[:, :2].T).max())
    if kinematics.tilts_head:
        return 0.0, spin
    aside = float(np.hypot(*(tilting - turning)[:2])) + spin
    return float(np.hypot(aside, np.abs(places[:, 2] - tilting[2]).max())), spin


def _lengths(p: Program, tools: Sequence[ToolBody], setup: ProofSetup) -> F64:
    """(m,) mm: longest way from the tip, or in a head from the spindle face, to a place of the assembly."""
    out = np.zeros(len(p))
    for tool in tools:
        rows = Bodies.of([tool], setup).rows
        high = max([tool.flute_length, setup.gauge_length.get(tool.number, 0.0), *rows[:, 1].tolist()])
        wide = max([tool.widest_radius, *rows[:, 2].tolist(), *rows[:, 3].tolist()])
        out[p.tool == tool.number] = np.hypot(high, wide)
    return out


__all__ = ["bounded", "drops", "strays"]
