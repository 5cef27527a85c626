"""Rotary angles of tool axes, and the pieces of a block whose tool axis keeps to a great circle.

Angles are deg in the order of ``Kinematics.letters``, the tilting axis first. Axes are unit vectors, tip to spindle, in
the setup frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from geometry.mesh import F64
from verify.gcode.block_words import NO_MACHINE, BlockError
from verify.kinematics import Kinematics

Limits = tuple[tuple[float, float], tuple[float, float]]
POLE = 1e-7
"""rad from +Z: a tool axis nearer than this is upright, and the turning axis may stand anywhere."""
CLOSE = 1e-5
"""rad, largest distance of the middle of a piece from the great circle."""
STEP = 0.02
"""rad, steps in which the angles are followed along a great circle."""
MAX_HALVINGS = 14
SAME_WAY = 1e-4
"""rad, between two ways of the tool axis from which on they count as two: 0.01 mm at 100 mm."""


def needed(machine: Kinematics | None, word: str) -> Kinematics:
    """The machine.

    Raises
    ------
    BlockError
        It has no rotary axes; ``word`` is what needs them.
    """
    if machine is None:
        raise BlockError(f"{word} turns the tool axis, and the machine has no rotary axes", NO_MACHINE)
    return machine


def angles_of(machine: Kinematics, axis: Sequence[float], near: Sequence[float], sign: int = 0,
              limits: Limits | None = None) -> list[float]:
    """The two rotary angles, deg, that give the tool this axis.

    axis : (3,) dimensionless, tip to spindle, setup frame, of any length
    near : (2,) deg; of the two solutions the one that turns less from here
    sign : 1 or -1: the solution whose tilting angle has this sign, however far
    limits : deg, least and greatest angle of both axes: what is outside of them counts only where all is

    Notes
    -----
    The forward equations are those of ``Kinematics.axis``. Upright, the turning axis keeps its angle.
    """
    x, y, z = axis
    tilt = math.atan2(math.hypot(x, y), z)
    if tilt < POLE:
        return [0.0, near[1]]
    spins = 1.0 if machine.turns_head else -1.0
    tilts = 1.0 if machine.tilts_head else -1.0
    found = []
    for a in (tilt, -tilt):
        base = math.atan2(-math.sin(a), 0.0) if machine.letters[0] == "A" else math.atan2(0.0, math.sin(a))
        turn = [tilts * math.degrees(a) * machine.sense[0],
                spins * math.degrees(math.atan2(y, x) - base) * machine.sense[1]]
        turn[1] = near[1] + math.remainder(turn[1] - near[1], 360.0)
        found.append(turn)
    if sign:
        found = [t for t in found if t[0] * sign > 0] or found
    if limits is not None:
        found = [[t[0], _wound(t[1], limits[1])] for t in found]
        found = [t for t in found if all(low - CLOSE <= a <= high + CLOSE
                                         for a, (low, high) in zip(t, limits, strict=True))] or found
    return min(found, key=lambda t: abs(t[0] - near[0]) + abs(t[1] - near[1]))


def _wound(angle: float, limits: tuple[float, float]) -> float:
    """The same angle, deg, by whole turns within limits where it can be."""
    if angle < limits[0] - CLOSE:
        return angle + 360.0 * math.ceil((limits[0] - CLOSE - angle) / 360.0)
    return angle - 360.0 * math.ceil(max(angle - limits[1] - CLOSE, 0.0) / 360.0)


def great_circle(machine: Kinematics, start: Sequence[float], end: Sequence[float], axis: Sequence[float], *,
                 stated: bool = True) -> list[tuple[float, list[float]]]:
    """Shares of a block and the angles there, so that even turns between them keep to the great circle.

    start : (2,) deg, angles where the block begins
    end   : (2,) deg, angles where it ends
    axis  : (3,) dimensionless, tool axis at the end, setup frame
    stated : whether it has to end there; else these are the angles to choose by where it begins upright, and it ends
             where the circle leads to

    Returns shares in order, the last 1. A share of 0 is a turn in place before the block: the tool is upright, and only
    the turning axis moves.

    Raises
    ------
    BlockError
        The axis turns to its opposite, or the circle leads to other angles of the same tool axis than ``end``.

    Notes
    -----
    The tool axis moves evenly along the great circle between its two ends [Shoemake1985].
    """
    a = machine.axis(np.radians([start]))[0]
    b = np.array(axis) / np.linalg.norm(axis)
    angle = math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))
    if angle < POLE:
        return [(1.0, list(end) if stated else list(start))]
    if math.pi - angle < 1e-6:
        raise BlockError("the tool axis turns to its opposite: the great circle between both is not determined")
    circle = a, b, angle
    out: list[tuple[float, list[float]]] = []
    turn = list(start)
    if math.hypot(a[0], a[1]) < POLE:
        turn = [start[0], angles_of(machine, _on_circle(*circle, 0.5).tolist(), end)[1]]
        if abs(turn[1] - start[1]) > 1e-9:
            out.append((0.0, list(turn)))
    last, steps = turn, math.ceil(angle / STEP)
    for k in range(1, steps + 1):
        last = angles_of(machine, _on_circle(*circle, k / steps).tolist(), last)
    if stated:
        off = max(abs(p - q) for p, q in zip(last, end, strict=True))
        upright = math.hypot(b[0], b[1]) < POLE
        if off > 0.01 and not (upright and abs(last[0] - end[0]) < 0.01):
            raise BlockError(f"the great circle to this tool axis ends at {last[0]:.3f} and {last[1]:.3f} deg, not at "
                             f"{end[0]:g} and {end[1]:g}")
        last = list(end)
    _halve(machine, circle, (0.0, turn), (1.0, last), out, 0)
    return out


def ways_differ(machine: Kinematics, start: Sequence[float], end: Sequence[float]) -> bool:
    """Whether even turns of the axes lead the tool axis elsewhere than the great circle between its ends.

    start, end : (2,) deg, angles where the block begins and ends
    """
    a, b = (math.radians(abs(q - p)) for p, q in zip(start, end, strict=True))
    if b * math.hypot(b, 2.0 * a) <= 8.0 * SAME_WAY:  # as ``verify.program.turn_subdivision`` has it
        return False
    share = np.linspace(0.0, 1.0, 9)
    turns = np.radians(start) + share[:, None] * np.radians(np.subtract(end, start))
    axes = machine.axis(turns)
    angle = math.atan2(float(np.linalg.norm(np.cross(axes[0], axes[-1]))), float(axes[0] @ axes[-1]))
    if angle > math.pi - POLE:
        return True
    circle = [_on_circle(axes[0], axes[-1], angle, s) if angle > POLE else axes[0] for s in share.tolist()]
    return bool(np.abs(axes - circle).max() > SAME_WAY)


def _on_circle(a: F64, b: F64, angle: float, share: float) -> F64:
    return np.asarray((math.sin((1 - share) * angle) * a + math.sin(share * angle) * b) / math.sin(angle))


def _halve(machine: Kinematics, circle: tuple[F64, F64, float], first: tuple[float, list[float]],
           last: tuple[float, list[float]], out: list[tuple[float, list[float]]], depth: int) -> None:
    """Append the pieces between two shares, halved until their middles are on the circle."""
    share = 0.5 * (first[0] + last[0])
    wanted = _on_circle(*circle, share)
    even = [0.5 * (p + q) for p, q in zip(first[1], last[1], strict=True)]
    off = float(np.linalg.norm(machine.axis(np.radians([even]))[0] - wanted))
    if off < CLOSE or depth >= MAX_HALVINGS:
        out.append(last)
        return
    middle = (share, angles_of(machine, wanted.tolist(), first[1]))
    _halve(machine, circle, first, middle, out, depth + 1)
    _halve(machine, circle, middle, last, out, depth + 1)


__all__ = ["angles_of", "great_circle", "needed", "ways_differ"]
