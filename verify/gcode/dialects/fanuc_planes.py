"""Fanuc in space: tilted planes (G68.2 with G53.1) and tool axes by vectors (G43.5)."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from verify.gcode.dialects.base import BlockError, DialectReader, Machine
from verify.gcode.dialects.orientation import angles_of, needed
from verify.gcode.dialects.tilted_planes import turn
from verify.gcode.frames import Frame

CHOICE = ("G53.1 and tool vectors leave the control two settings of the rotary axes: the proof takes the one that "
          "turns less, and even turns between two vectors")

UPRIGHT = 1.0 - 1e-12
"""Share of Z in a unit tool axis from which on it is upright."""


class FanucPlanes(DialectReader):
    """The plane and the vectors in force.

    machine : the reader that runs the blocks
    tilted  : whether G53.1 has set the tool square to the plane; vectors : whether G43.5 is on
    """

    machine: Machine
    tilted = vectors = False

    def plane(self, values: Mapping[str, str]) -> None:
        """G68.2: a plane by its origin (X, Y, Z) and its Euler angles (I, J, K) about Z, X and Z, deg.

        Raises
        ------
        BlockError
            Another form of the word, or a plane or rotation is in force.
        """
        if float(values.get("P", "0")) != 0 or not values.keys() <= set("GNXYZIJKP"):
            raise BlockError("G68.2 in another form than by Euler angles (P1 to P4, Q, R)",
                             "let the post write G68.2 X Y Z I J K")
        s = self.machine.s
        if self.frame is not None or s.frame is not None:
            raise BlockError("G68.2 while a plane, rotation or scale is in force: end it with G69 first")
        if s.relative:
            raise BlockError("G68.2 in incremental coordinates (G91)")
        i, j, k = (math.radians(float(values.get(c, "0"))) for c in "IJK")
        origin = [float(values.get(c, "0")) * s.scale for c in "XYZ"]
        self.frame = Frame(turn(2, i) @ turn(0, j) @ turn(2, k), np.array(origin))

    def square(self, values: Mapping[str, str]) -> list[str]:
        """Blocks of G53.1: the rotary axes set the tool square to the plane, then the coordinates are those of its tip.

        Raises
        ------
        BlockError
            No plane is in force, or the machine has no rotary axes and the plane is tilted.
        """
        if self.frame is None:
            raise BlockError("G53.1 without G68.2")
        axis = self.frame.matrix[:, 2]
        if self.machine.machine is None and axis[2] > UPRIGHT:  # nothing turns
            return []
        machine = needed(self.machine.machine, "G53.1")
        s = self.machine.s
        sign = {1.0: 1, 2.0: -1}.get(float(values.get("P", "0")), 0)
        angles = angles_of(machine, axis.tolist(), s.turn, sign, machine.limits)
        self.notes.append(CHOICE)
        self.tilted = True
        words = " ".join(f"{c}{a:.9f}" for c, a in zip(machine.letters, angles, strict=True))
        return [f"G90 G0 {words}", "M428", *([f"G{s.motion:g}"] if s.motion in (1, 2, 3) else [])]

    def level(self) -> list[str]:
        """Blocks of G69 after a plane; none without one."""
        was, self.frame, self.tilted = self.tilted, None, False
        return ["M429"] if was else []

    def vector(self, values: Mapping[str, str], arc: bool) -> list[str]:
        """Rotary words of a block with a tool vector I, J, K, which is that of the tip to the spindle.

        Raises
        ------
        BlockError
            The block is an arc, or the vector has no length.
        """
        if arc:
            raise BlockError("I, J, K of an arc while they are tool vectors (G43.5)")
        machine = needed(self.machine.machine, "G43.5")
        axis = [float(values.get(c, "0")) for c in "IJK"]
        if math.hypot(*axis) < 1e-6:
            raise BlockError("a tool vector of length 0")
        self.notes.append(CHOICE)
        angles = angles_of(machine, axis, self.machine.s.turn, limits=machine.limits)
        return [f"{c}{a:.9f}" for c, a in zip(machine.letters, angles, strict=True)]
