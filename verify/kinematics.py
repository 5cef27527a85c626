"""Forward kinematics of five-axis machines, the verifier's own: where the tip is and how the tool stands on the part.

Three frames. The setup frame is fixed to the part; the machine frame does not move and falls on the setup frame while
both rotary axes stand at zero; the joints are the linear axes, zeroed so that there they are the tip in the setup
frame with the length offset on. With Rx, Ry, Rz the right-handed turns about the axes, A, B, C the angles as
programmed, T the tilt (Rx(A) or Ry(B)):

- A table carries the part. A point p of the part is at q1 + T (q2 + Rz(C) (p - q2) - q1) in the machine
  (table-table), or at q2 + Rz(C) (p - q2) (head-table). q1 lies on the tilting axis, q2 on the turning axis.
- A head carries the tool. Its axis is h = T e_z (head-table) or h = Rz(C) T e_z (head-head). Its tip swings round the
  swivel at the distance L = swivel to spindle face + gauge length: it is at j + L (e_z - h).

``tip`` and ``axis`` follow from the tip of the tool at the point of the part; ``joints`` is the inverse.
The sense of the angles is that of LinuxCNC's xyzac-trt and xyzbc-trt: with A30 C90 the point (10, 0, 5) of the part
stands at (0, 6.160, 9.330). Names and positive directions of the axes are those of [ISO841].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from geometry.errors import VerificationError
from geometry.mesh import F64

_PLANES = {"A": (1, 2), "B": (2, 0), "C": (0, 1)}  # a turn about X, Y or Z takes the first axis to the second
KINDS = ("table-table-AC", "table-table-BC", "head-table-BC", "head-head-BC", "head-head-AC")
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Kinematics:
    """One five-axis machine.

    kind   : one of KINDS, the rotary axes by where they sit, tilting one first
    pivots : mm, setup frame with both rotary axes at zero, or None where the setup gives none. Table-table: a point on
             the tilting and one on the turning axis. Head-table: (0, 0, spindle face up to the swivel) and a point on
             the turning axis. Head-head: (0, 0, spindle face up to the swivel).
    sense  : of the words of the two axes. 1: as above. -1: a positive angle of a table axis turns the tool right-handed
             as seen from the table [ISO841], so the table turns the other way.
    limits : deg, least and greatest angle of the tilting and the turning axis, or None

    Raises
    ------
    VerificationError
        Code bad_kinematics: an unknown kind, too few or too many pivots, a swivel that is not above the spindle face.
    """

    kind: str
    pivots: tuple[Point, ...] | None = None
    sense: tuple[int, int] = (1, 1)
    limits: tuple[tuple[float, float], tuple[float, float]] | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise VerificationError(f"unknown kinematics {self.kind!r}", code="bad_kinematics", measured=self.kind,
                                    limit=list(KINDS), remedy=f"machine.kinematics is one of {', '.join(KINDS)}")
        if self.pivots is None:
            return
        if len(self.pivots) != self.pivot_count:
            raise VerificationError(f"{self.kind} has {self.pivot_count} pivots, {len(self.pivots)} are given",
                                    code="bad_kinematics", measured=len(self.pivots), limit=self.pivot_count,
                                    remedy="machine.pivots_mm lists the tilting axis first, then the turning one; a "
                                           "head-head machine has one")
        if self.tilts_head and (self.pivots[0][0] != 0 or self.pivots[0][1] != 0 or self.pivots[0][2] < 0):
            raise VerificationError(f"the swivel of {self.kind} is at {list(self.pivots[0])}", code="bad_kinematics",
                                    measured=list(self.pivots[0]), limit=[0, 0, 0],
                                    remedy="the first of machine.pivots_mm is [0, 0, distance from the spindle face "
                                           "up to the swivel]")

    @property
    def letters(self) -> str:
        """The two rotary words, the tilting axis first."""
        return self.kind[-2:]

    @property
    def table_letters(self) -> str:
        """The words of the axes that turn the table, the tilting axis first."""
        return "".join(letter for letter, head in zip(self.letters, (self.tilts_head, self.turns_head), strict=True)
                       if not head)

    @property
    def tilts_head(self) -> bool:
        """Whether the tilting axis carries the tool, not the part."""
        return self.kind.startswith("head")

    @property
    def turns_head(self) -> bool:
        """Whether the turning axis carries the tool, not the part."""
        return self.kind.startswith("head-head")

    @property
    def pivot_count(self) -> int:
        """How many pivots describe the machine."""
        return 1 if self.turns_head else 2

    def axis(self, turn: F64) -> F64:
        """Tool axis on the part.

        turn : (n, 2) float64, rad, angles in the order of ``letters``

        Returns (n, 3) float64 unit vectors, dimensionless, tip to spindle, setup frame.

        Notes
        -----
        Head-head: Rz(C) T e_z. Head-table: Rz(-C) T e_z. Table-table: Rz(-C) T^-1 e_z. Names of the turns: [ISO841].
        """
        tilt, spin = self._right_handed(turn).T
        up = np.zeros((len(turn), 3))
        up[:, 2] = 1.0
        if self.turns_head:
            return _turned("C", spin, _turned(self.letters[0], tilt, up))
        return _turned("C", -spin, _turned(self.letters[0], tilt if self.tilts_head else -tilt, up))

    def tip(self, joints: F64, turn: F64, gauge: F64 | float) -> F64:
        """Tip from the linear joints.

        joints : (n, 3) float64, mm, machine frame, zeroed as the module says
        turn   : (n, 2) float64, rad, angles of the rotary words, signs as in [ISO841]
        gauge  : (n,) float64 or one number, mm, spindle face to tip; counts where a head swings the tool

        Returns (n, 3) float64, mm, setup frame. Raises VerificationError (no_pivots) where no pivots are given.
        """
        turn = self._right_handed(turn)
        return self._on_part(joints + self._swing(turn, gauge), turn)

    def joints(self, tip: F64, turn: F64, gauge: F64 | float) -> F64:
        """Linear joints from the tip; the inverse of ``tip``.

        tip   : (n, 3) float64, mm, setup frame
        turn  : (n, 2) float64, rad, angles of the rotary words, signs as in [ISO841]
        gauge : (n,) float64 or one number, mm, spindle face to tip

        Returns (n, 3) float64, mm, machine frame. Raises VerificationError (no_pivots) where no pivots are given.
        """
        turn = self._right_handed(turn)
        return self._in_machine(tip, turn) - self._swing(turn, gauge)

    def slides(self, turn: F64) -> F64:
        """Where the linear axes of the machine point on the part.

        turn : (n, 2) float64, rad

        Returns (n, 3, 3) float64, dimensionless, setup frame: rows are the directions of X, Y and Z.
        """
        out = np.tile(np.eye(3), (len(turn), 1, 1))
        if self.turns_head:
            return out
        turn = self._right_handed(turn)
        for row in range(3):
            way = out[:, row].copy()
            if not self.tilts_head:
                way = _turned(self.letters[0], -turn[:, 0], way)
            out[:, row] = _turned("C", -turn[:, 1], way)
        return out

    def points(self) -> tuple[Point, ...]:
        """The pivots, mm.

        Raises
        ------
        VerificationError
            Code no_pivots: none are given.
        """
        if self.pivots is None:
            raise VerificationError(f"the pivots of {self.kind} are not known", code="no_pivots",
                                    subjects=("machine.pivots_mm",), remedy="give machine.pivots_mm")
        return self.pivots

    def _right_handed(self, turn: F64) -> F64:
        """(n, 2) rad: right-handed turns of heads and tables for the angles of the words."""
        return turn if self.sense == (1, 1) else turn * np.array(self.sense, dtype=np.float64)

    def _swing(self, turn: F64, gauge: F64 | float) -> Any:
        """(n, 3) mm, offset by which the head carries the tip off the joints: L (e_z - h)."""
        pivots = self.points()
        if not self.tilts_head:
            return 0.0
        tilt, spin = turn.T
        off = np.zeros((len(turn), 3))
        off[:, 2] = pivots[0][2] + np.asarray(gauge)
        tool = _turned(self.letters[0], tilt, off)
        return off - (_turned("C", spin, tool) if self.turns_head else tool)

    def _in_machine(self, points: F64, turn: F64) -> F64:
        """(n, 3) mm, places of the machine where points of the part stand."""
        if self.turns_head:
            return points
        pivots = np.array(self.points())
        out = pivots[1] + _turned("C", turn[:, 1], points - pivots[1])
        return out if self.tilts_head else pivots[0] + _turned(self.letters[0], turn[:, 0], out - pivots[0])

    def _on_part(self, places: F64, turn: F64) -> F64:
        """(n, 3) mm, points of the part that stand at places of the machine."""
        if self.turns_head:
            return places
        pivots = np.array(self.points())
        if not self.tilts_head:
            places = pivots[0] + _turned(self.letters[0], -turn[:, 0], places - pivots[0])
        return np.asarray(pivots[1] + _turned("C", -turn[:, 1], places - pivots[1]))


def _turned(letter: str, angle: F64, points: F64) -> F64:
    """Points (n, 3) turned about X (A), Y (B) or Z (C) by angles (n,), rad."""
    i, j = _PLANES[letter]
    c, s = np.cos(angle), np.sin(angle)
    out = points.copy()
    out[:, i] = c * points[:, i] - s * points[:, j]
    out[:, j] = s * points[:, i] + c * points[:, j]
    return out
