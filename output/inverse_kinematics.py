"""Inverse kinematics of five-axis machines: angles of the rotary axes for a tool axis, and the linear joints then.

All frames are the setup frame. It is fixed to the part and coincides with the machine frame while both rotary axes
stand at zero; the linear joints then equal the tip with the length offset on. Axes are named as in [ISO841]. With T the
tilt (about X for A, about Y for B) and S the turn about Z (C), all right-handed,

    table-table   place = q1 + T (q2 + S (p - q2) - q1), tool along Z        axis on the part = S' T' e_z
    head-table    place = q2 + S (p - q2), tool along T e_z                  axis on the part = S' T e_z
    head-head     place = p, tool along S T e_z                              axis on the part = S T e_z

So the tilt is the angle of the axis to Z, with either sign. The azimuth of the axis is C, but for its sign and an
offset of a quarter or half turn: ``_AZIMUTH``. Where the axis stands along Z, C is free; it is set between the angles
before and after.

A head with the length L from swivel to tip has its joints at place - L (e_z - h), where h is the tool axis in the
machine.

Each tool axis has two solutions, and each of them again after whole turns. Along a path the solutions with the least
total turning are taken. They change from one branch to the other only at the pole, where the branches meet: a change in
the middle of a pass would swing the tool while its tip stands in the material.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import OutputError
from geometry.mesh import F64

POLE = 1e-9  # rad; an axis nearer to Z has no azimuth
POLE_PASSAGE = 1e-5  # rad; a path nearer to Z goes through the pole, and the tilt may change its sign there
FULL_TURN = 2.0 * math.pi
MAX_HALVINGS = 24  # of a block
LIMIT_SLACK = 1e-9  # rad beyond a limit, for rounding
CHECKED_SHARES = (0.25, 0.5, 0.75)  # of a block, where it is compared with the planned path
_LETTER = {"A": 0, "B": 1}
_AZIMUTH = {  # azimuth of the axis, rad, where the tilt is positive: first + second * C
    "table-table-AC": (0.5 * math.pi, -1.0),
    "table-table-BC": (math.pi, -1.0),
    "head-table-BC": (0.0, -1.0),
    "head-head-BC": (0.0, 1.0),
    "head-head-AC": (-0.5 * math.pi, 1.0),
}


@dataclass(frozen=True, eq=False)
class RotaryMachine:
    """A machine with a tilting axis and C.

    kind   : 'table-table-AC', 'table-table-BC', 'head-table-BC', 'head-head-BC' or 'head-head-AC'
    pivots : mm, setup frame at zero, or None. Table-table: a point on the tilting and one on the turning axis.
             Head-table: (0, 0, spindle face up to the swivel) and a point on the turning axis. Head-head: the first
             alone
    limits : (2, 2) float64, rad, least and greatest right-handed angle of the tilting and the turning axis, or None
    tcp    : the control keeps the tip; otherwise programs contain joint positions, and pivots are needed
    sense  : 1, or -1 for an axis that programs count the other way; angles here are always right-handed

    Raises
    ------
    OutputError
        bad_kinematics: an unknown kind; no_pivots: there are none although the control does not keep the tip.
    """

    kind: str
    pivots: tuple[tuple[float, float, float], ...] | None = None
    limits: F64 | None = None
    tcp: bool = True
    sense: tuple[int, int] = (1, 1)

    def __post_init__(self) -> None:
        if self.kind not in _AZIMUTH:
            raise OutputError(f"unknown kinematics {self.kind!r}", code="bad_kinematics", measured=self.kind,
                              limit=sorted(_AZIMUTH), remedy="machine.kinematics is one of " + ", ".join(_AZIMUTH))
        if self.pivots is None and not self.tcp:
            raise OutputError("a program of joint positions needs the pivots of the rotary axes", code="no_pivots",
                              subjects=("machine.pivots_mm",),
                              remedy="give machine.pivots_mm, or set machine.tcp true where the control keeps the tip")

    @property
    def letters(self) -> str:
        """The two rotary letters, the tilting axis first."""
        return self.kind[-2:]

    def words(self, turns: F64) -> F64:
        """Converts right-handed angles to the angles of programs and back.

        turns : (..., 2) float64, rad or deg, of the tilting and the turning axis

        Returns (..., 2) float64, rad or deg as given; the function is its own inverse.
        """
        return turns if self.sense == (1, 1) else np.asarray(turns * np.array(self.sense))

    @property
    def tilts_head(self) -> bool:
        """Whether the tilting axis carries the tool."""
        return self.kind.startswith("head")

    @property
    def turns_head(self) -> bool:
        """Whether C carries the tool."""
        return self.kind.startswith("head-head")

    def axes(self, turns: F64) -> F64:
        """Tool axes for angles of the rotary axes.

        turns : (n, 2) float64, rad

        Returns (n, 3) float64, unit, setup frame, tip to spindle.

        Notes
        -----
        The products of rotations in the docstring of the module, with the axis names of [ISO841].
        """
        first, sense = _AZIMUTH[self.kind]
        tilt, azimuth = turns[:, 0], first + sense * turns[:, 1]
        flat = np.sin(tilt)
        return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.cos(tilt)], axis=1)

    def turns(self, axes: F64) -> F64:
        """Both solutions of the rotary axes for tool axes.

        axes : (n, 3) float64, unit, tip to spindle, setup frame

        Returns
        -------
        (n, 2, 2) float64, rad
            [:, 0] tilts to the positive side and [:, 1] to the negative one, C in (-pi, pi], 0 at the pole.

        Notes
        -----
        The inverse of ``axes``, with the axis names of [ISO841]: the tilt is the angle to Z, C follows from the
        azimuth.
        """
        first, sense = _AZIMUTH[self.kind]
        flat = np.hypot(axes[:, 0], axes[:, 1])
        tilt = np.arctan2(flat, axes[:, 2])
        azimuth = np.where(flat > POLE, np.arctan2(axes[:, 1], axes[:, 0]), first)
        one = sense * (azimuth - first)
        out = np.stack([np.stack([tilt, one], axis=1), np.stack([-tilt, one + math.pi], axis=1)], axis=1)
        out[:, 1, 1] = np.where(flat > POLE, out[:, 1, 1], 0.0)
        out[..., 1] -= FULL_TURN * np.ceil((out[..., 1] - math.pi) / FULL_TURN)
        return out

    def stands(self, axes: F64) -> NDArray[np.bool_]:
        """Whether the rotary axes can stand inside their limits for tool axes.

        axes : (n, 3) float64, unit, tip to spindle, setup frame

        Returns (n,) bool.
        """
        both = self.turns(axes)
        if self.limits is None:
            return np.ones(len(axes), np.bool_)
        low, high = self.limits[:, 0] - LIMIT_SLACK, self.limits[:, 1] + LIMIT_SLACK
        least = both[..., 1] + FULL_TURN * np.ceil((low[1] - both[..., 1]) / FULL_TURN)
        tilts = (both[..., 0] >= low[0]) & (both[..., 0] <= high[0])
        return np.asarray((tilts & (least <= high[1])).any(axis=1))

    def even(self, axis: F64, degrees: float) -> F64:
        """Four tool axes near one, at which both rotary axes stand at whole multiples of an angle.

        axis    : (3,) float64, unit, tip to spindle, setup frame
        degrees : deg, the angle

        Returns (4, 3) float64, unit, setup frame.
        """
        step = math.radians(degrees)
        low = np.floor(self.turns(axis[None])[0, 0] / step)
        return self.axes(step * np.array([low, low + [1, 0], low + [0, 1], low + [1, 1]]))

    def joints(self, tips: F64, turns: F64, gauge: float) -> F64:
        """Positions of the linear joints.

        tips  : (n, 3) float64, mm, setup frame
        turns : (n, 2) float64, rad, angles of the rotary axes
        gauge : mm, spindle face to tip; it counts where the head tilts

        Returns (n, 3) float64, mm, machine coordinates.
        Raises OutputError (no_pivots) where the machine has no pivots.
        """
        return self._places(tips, turns) - self._swing(turns, gauge)

    def tips(self, joints: F64, turns: F64, gauge: float) -> F64:
        """Positions of the tip; the inverse of ``joints``.

        joints : (n, 3) float64, mm, machine coordinates
        turns  : (n, 2) float64, rad, angles of the rotary axes
        gauge  : mm, spindle face to tip

        Returns (n, 3) float64, mm, setup frame.
        Raises OutputError (no_pivots) where the machine has no pivots.
        """
        place = joints + self._swing(turns, gauge)
        if self.turns_head:
            return place
        pivots = self._points()
        if not self.tilts_head:
            place = pivots[0] + _applied(self._tilt(turns).transpose(0, 2, 1), place - pivots[0])
        return np.asarray(pivots[1] + _applied(_turn_matrix(2, -turns[:, 1]), place - pivots[1]))

    def follow(self, axes: F64, start: F64 | None = None) -> F64:
        """Angles of the rotary axes along a path, with the least total turning.

        axes  : (n, 3) float64, unit, setup frame, along the path; neighbours less than half a turn apart
        start : (2,) float64, rad, angles before the path; None: any, the smallest angles first

        Returns
        -------
        (n, 2) float64, rad
            Within the limits; no step of C is longer than half a turn.

        Raises
        ------
        OutputError
            rotary_limit: the axes cannot follow the path inside their limits. The message gives point, axis and angle.
        """
        out = np.zeros((len(axes), 2))
        free = np.hypot(axes[:, 0], axes[:, 1]) <= POLE
        known = np.flatnonzero(~free)
        over = math.pi if self.limits is None or self.limits[0, 1] >= math.pi else -math.pi
        out[:, 0] = np.where(axes[:, 2] < 0.0, over, 0.0)
        if len(known):
            out[known] = self._least_turning(self.turns(axes[known]), _through_pole(axes, known), start)
            out[:, 1] = np.interp(np.arange(len(axes)), known, out[known, 1])
        else:
            out[:, 1] = 0.0 if start is None else start[1]
        self._check(out)
        return out

    def course(self, tips: F64, axes: F64, tolerance: float, swing: float, gauge: float,
               turns: F64 | None = None) -> tuple[F64, F64]:
        """A path with the further points that the rotary axes need to follow it.

        tips, axes : (n, 3) float64, mm and unit, setup frame; straight between tips, great circles between axes
        tolerance  : mm, largest deviation of the tip where the program contains joint positions
        swing      : rad, largest deviation of the axis from its great circle
        gauge      : mm, spindle face to tip
        turns      : (n, 2) float64, rad, angles of the rotary axes at the points; None: as ``follow`` returns them

        Returns
        -------
        tips, turns : (m, 3) float64, mm, setup frame, and (m, 2) float64, rad, m >= n, with the given points among them

        Raises
        ------
        OutputError
            As ``follow``; pole_crossing: the axis passes so near Z that no step is short enough.

        Notes
        -----
        The axis between two points is that of the great circle, by the formula sin((1 - t) a) / sin a of
        [Shoemake1985].
        """
        turns = self.follow(axes) if turns is None else turns
        for _ in range(MAX_HALVINGS):
            off = np.flatnonzero(self._off(tips, axes, turns, tolerance, swing, gauge))
            if not len(off):
                return tips, turns
            middle = axes[off] + axes[off + 1]
            middle /= np.linalg.norm(middle, axis=1, keepdims=True)
            near = 0.5 * (turns[off] + turns[off + 1])
            tips = np.insert(tips, off + 1, 0.5 * (tips[off] + tips[off + 1]), axis=0)
            axes = np.insert(axes, off + 1, middle, axis=0)
            turns = np.insert(turns, off + 1, self._nearest(middle, near), axis=0)
        where = tips[off[0]]
        raise OutputError(f"the tool axis passes so near Z at ({', '.join(f'{v:.3f}' for v in where)}) that the rotary "
                          "axes cannot follow it", code="pole_crossing", subjects=(_place(where),),
                          measured=float(np.degrees(np.hypot(*axes[off[0], :2]))), limit=float(np.degrees(swing)),
                          remedy="tilt the tool to one side of Z along the whole pass")

    def _nearest(self, axes: F64, near: F64) -> F64:
        """(n, 2) rad: for each axis the solution nearest to ``near`` (n, 2)."""
        both = self.turns(axes)
        free = np.hypot(axes[:, 0], axes[:, 1]) <= POLE
        both[free, :, 1] = near[free, None, 1]
        both[..., 1] += FULL_TURN * np.rint((near[:, None, 1] - both[..., 1]) / FULL_TURN)
        far = np.abs(both - near[:, None]).max(axis=2)
        return np.asarray(both[np.arange(len(axes)), np.argmin(far, axis=1)])

    def _off(self, tips: F64, axes: F64, turns: F64, tolerance: float, swing: float,
             gauge: float) -> NDArray[np.bool_]:
        """(n - 1,) bool: blocks on which axis or tip deviate by more than allowed."""
        out = np.zeros(len(tips) - 1, np.bool_)
        joints = None if self.tcp else self.joints(tips, turns, gauge)
        for share in CHECKED_SHARES:
            there = (1.0 - share) * turns[:-1] + share * turns[1:]
            got, wanted = self.axes(there), _great(axes[:-1], axes[1:], share)
            out |= np.linalg.norm(got - wanted, axis=1) > swing
            if joints is not None:
                at = self.tips((1.0 - share) * joints[:-1] + share * joints[1:], there, gauge)
                out |= np.linalg.norm(at - (1.0 - share) * tips[:-1] - share * tips[1:], axis=1) > tolerance
        return out

    def _least_turning(self, both: F64, poled: NDArray[np.bool_], start: F64 | None) -> F64:
        """(n, 2) rad: the sequence of solutions that turns least in total.

        both  : (n, 2, 2), both solutions at each point; whole turns of C may be added
        poled : (n - 1,) bool, whether the move to the next point goes through the pole. Only there the tilt may change
                its
                sign; elsewhere the axis would swing through Z and back
        """
        rows = self._choices(both, 0.0 if start is None else float(start[1]), poled)
        other = np.repeat([False, True], rows.shape[1] // 2)
        changed = other[:, None] != other
        least = np.full(rows.shape[:2], math.inf)
        came = np.zeros(rows.shape[:2], np.int64)
        came_from = np.zeros(2) if start is None else start
        if self.limits is None:
            rows[0, :, 1] += FULL_TURN * np.rint((came_from[1] - rows[0, :, 1]) / FULL_TURN)
        least[0] = np.abs(rows[0] - came_from).max(axis=1)
        least[0, np.isnan(least[0])] = math.inf
        if not np.isfinite(least[0]).any():
            self._refuse(both[0], 0)
        wraps = self.limits is None
        for k in range(1, len(rows)):
            there = np.broadcast_to(rows[k][None], (rows.shape[1], rows.shape[1], 2)).copy()  # from, to
            if wraps:  # the whole turns that bring it nearest
                there[..., 1] += FULL_TURN * np.rint((rows[k - 1][:, None, 1] - there[..., 1]) / FULL_TURN)
            step = np.abs(there - rows[k - 1][:, None])
            cost = np.where(step[..., 1] <= math.pi + POLE, step.max(axis=2), math.inf) + least[k - 1][:, None]
            cost[np.isnan(cost) | (changed & ~poled[k - 1])] = math.inf
            came[k], least[k] = np.argmin(cost, axis=0), cost.min(axis=0)
            if wraps:
                rows[k] = there[came[k], np.arange(rows.shape[1])]
            if not np.isfinite(least[k]).any():
                self._refuse(both[k], k)
        at = int(np.argmin(least[-1]))
        out = np.empty((len(rows), 2))
        for k in range(len(rows) - 1, -1, -1):
            out[k] = rows[k, at]
            at = int(came[k, at])
        return out

    def _choices(self, both: F64, start: float, poled: NDArray[np.bool_]) -> F64:
        """(n, m, 2) rad: the solutions to choose from, nan outside the limits; without limits just the two.

        Wide limits hold more whole turns than the path can reach from the ``start`` of C. One row of solutions
        therefore spans no more than C turns in total, and lies as near to ``start`` as the limits allow.
        """
        if self.limits is None:
            return both.copy()
        low, high = self.limits[1]
        step = np.diff(both[:, 0, 1])
        most = float(np.abs(step - FULL_TURN * np.rint(step / FULL_TURN)).sum())
        most += FULL_TURN * (2 + np.count_nonzero(poled))
        here = min(max(start, low), high)
        low, high = max(low, here - most), min(high, here + most)
        turns = np.arange(math.floor((low - math.pi) / FULL_TURN), math.ceil((high + math.pi) / FULL_TURN) + 1)
        rows = np.repeat(both, len(turns), axis=1)
        rows[..., 1] += np.tile(FULL_TURN * turns, 2)
        least, greatest = np.array([self.limits[0], [low, high]]).T
        beyond = ((rows < least - LIMIT_SLACK) | (rows > greatest + LIMIT_SLACK)).any(axis=2)
        rows[beyond] = np.nan
        rows[:, :, 1] = np.clip(rows[:, :, 1], low, high)
        rows[:, :, 0] = np.clip(rows[:, :, 0], *self.limits[0])
        return rows

    def _check(self, turns: F64) -> None:
        """Refuse angles outside the limits."""
        if self.limits is None:
            return
        out = (turns < self.limits[:, 0] - LIMIT_SLACK) | (turns > self.limits[:, 1] + LIMIT_SLACK)
        if out.any():
            k = int(np.flatnonzero(out.any(axis=1))[0])
            self._refuse(np.array([turns[k], turns[k]]), k)

    def _refuse(self, both: F64, place: int) -> None:
        both = self.words(both)
        limits = [[-math.inf, math.inf]] * 2 if self.limits is None else program_limits(self.limits, self.sense)
        needed = " or ".join(" ".join(f"{letter}{math.degrees(v):.3f}"
                                      for letter, v in zip(self.letters, row.tolist(), strict=True))
                             for row in both)
        allowed = ", ".join(f"{letter} {math.degrees(lo):g} to {math.degrees(hi):g}"
                            for letter, (lo, hi) in zip(self.letters, limits, strict=True))
        raise OutputError(f"the rotary axes cannot follow the path: point {place + 1} needs "
                          f"{needed} deg, the limits are {allowed}", code="rotary_limit",
                          subjects=("machine.rotary_deg",),
                          measured=np.degrees(both).tolist(), limit=np.degrees(limits).tolist(),
                          remedy="end the pass before this point, or use another tool axis")

    def _points(self) -> F64:
        if self.pivots is None:
            raise OutputError(f"the pivots of {self.kind} are missing", code="no_pivots",
                              subjects=("machine.pivots_mm",), remedy="give machine.pivots_mm")
        return np.array(self.pivots)

    def _tilt(self, turns: F64) -> F64:
        return _turn_matrix(_LETTER[self.letters[0]], turns[:, 0])

    def _swing(self, turns: F64, gauge: float) -> F64:
        """(n, 3) mm: offset between joints and tip that the tilted head makes."""
        out = np.zeros((len(turns), 3))
        if not self.tilts_head:
            return out
        tool = self._tilt(turns)[:, :, 2]
        if self.turns_head:
            tool = _applied(_turn_matrix(2, turns[:, 1]), tool)
        out[:, 2] = 1.0
        return np.asarray((self._points()[0, 2] + gauge) * (out - tool))

    def _places(self, tips: F64, turns: F64) -> F64:
        """(n, 3) mm: places of the part in machine coordinates."""
        if self.turns_head:
            return tips
        pivots = self._points()
        out = pivots[1] + _applied(_turn_matrix(2, turns[:, 1]), tips - pivots[1])
        return out if self.tilts_head else pivots[0] + _applied(self._tilt(turns), out - pivots[0])


def program_limits(limits: F64, sense: tuple[int, int]) -> F64:
    """Converts limits of right-handed angles to limits of program angles and back.

    limits : (2, 2) float64, rad or deg, least and greatest angle of both rotary axes
    sense  : 1 or -1 for each axis, as in ``RotaryMachine``

    Returns (2, 2) float64, rad or deg as given; the function is its own inverse.
    """
    out = np.array(limits, dtype=np.float64)
    for row, sign in enumerate(sense):
        if sign < 0:
            out[row] = -out[row, ::-1]
    return out


def _through_pole(axes: F64, known: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(k - 1,) bool: whether the great circles between consecutive axes, rows ``known`` (k,) of (n, 3), go through Z.
    """
    a, b = axes[known[:-1]], axes[known[1:]]
    cross = np.cross(a, b)
    size = np.linalg.norm(cross, axis=1)
    n = cross / np.maximum(size, 1e-300)[:, None]
    foot = np.array([0.0, 0.0, 1.0]) - n[:, 2:] * n  # projection of Z onto the great circle
    within = ((np.cross(a, foot) * n).sum(axis=1) >= 0.0) & ((np.cross(foot, b) * n).sum(axis=1) >= 0.0)
    near = np.hypot(axes[known, 0], axes[known, 1]) <= POLE_PASSAGE
    out = (np.diff(known) > 1) | near[:-1] | near[1:] | ((size > POLE) & within & (np.abs(n[:, 2]) <= POLE_PASSAGE))
    return np.asarray(out)


def _turn_matrix(axis: int, angle: F64) -> F64:
    """(n, 3, 3): right-handed turns about X, Y or Z (0, 1, 2) by (n,) rad."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = np.zeros((len(angle), 3, 3))
    out[:, axis, axis] = 1.0
    out[:, i, i] = out[:, j, j] = np.cos(angle)
    out[:, j, i] = np.sin(angle)
    out[:, i, j] = -out[:, j, i]
    return out


def _applied(matrices: F64, vectors: F64) -> F64:
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors))


def _great(a: F64, b: F64, share: float) -> F64:
    """(n, 3) unit: the axis at a share of the great circle."""
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ni,ni->n", a, b))
    small = angle < 1e-6
    size = np.where(small, 1.0, np.sin(np.where(small, 1.0, angle)))
    p = np.where(small, 1.0 - share, np.sin((1.0 - share) * angle) / size)
    q = np.where(small, share, np.sin(share * angle) / size)
    out = p[:, None] * a + q[:, None] * b
    return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))


def _place(point: F64) -> str:
    return "(" + ", ".join(f"{v:.3f}" for v in point) + ")"


__all__ = ["RotaryMachine", "program_limits"]
