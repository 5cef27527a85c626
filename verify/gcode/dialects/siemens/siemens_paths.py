"""Moves of Siemens controls that depend on where the tool is: polar words, circles by a point or a tangent, vectors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from verify.gcode.dialects.base import BlockError
from verify.gcode.dialects.oriented_moves import STRAIGHT
from verify.gcode.dialects.siemens.siemens_swivel import SiemensFrames
from verify.gcode.dialects.stated_places import digits
from verify.program.arc_chords import PLANE_AXES


class SiemensPaths(SiemensFrames):
    """Poles, directions and tool vectors.

    pole    : (3,) mm, of polar words
    polar   : radius, mm, and angle, deg, of the latest polar words
    """

    def __init__(self) -> None:
        super().__init__()
        self.pole = [0.0, 0.0, 0.0]
        self.polar = [math.nan, math.nan]

    def tangent_arc(self, words: Mapping[str, str]) -> str:
        """CT: the arc that goes on in the direction of the move before it.

        words : of the end, absolute, in units of the program

        Raises
        ------
        BlockError
            It leaves the plane, or has no direction to continue.
        """
        start, way = self.direction("CT")
        i, j, k = PLANE_AXES[self.machine.s.plane]
        end = [float(words["XYZ"[n]]) * self.unit if "XYZ"[n] in words else start[n] for n in range(3)]
        if abs(end[k] - start[k]) > 1e-9:
            raise BlockError("CT in space: only an arc in the plane is followed")
        u, v = (way[i], way[j]), (end[i] - start[i], end[j] - start[j])
        size, far = math.hypot(*u), math.hypot(*v)
        if size < STRAIGHT or far < STRAIGHT:
            raise BlockError("CT needs a direction in the plane, and an end away from its start")
        normal = (-u[1] / size, u[0] / size)
        aside = normal[0] * v[0] + normal[1] * v[1]
        text = " ".join(f"{a}{w}" for a, w in words.items())
        if abs(aside) < 1e-9 * far:
            self.heading = (end, way)
            return f"G1 {text}"
        radius = far * far / (2 * aside)  # positive to the left
        centre = (radius * normal[0], radius * normal[1])
        self._head(end, (start[i] + centre[0], start[j] + centre[1]), radius > 0)
        return (f"G{3 if radius > 0 else 2} {text} {'IJK'[i]}{digits(centre[0] / self.unit)} "
                f"{'IJK'[j]}{digits(centre[1] / self.unit)}")

    def point_arc(self, words: Mapping[str, str], through: Mapping[str, float]) -> str:
        """CIP: the circle through an intermediate point.

        words   : of the end, absolute, in units of the program
        through : X, Y, Z of the point by letter, mm; an absent one is that of the start

        Raises
        ------
        BlockError
            The three points are on a line, or the circle leaves the plane.
        """
        start = self.known("CIP")
        i, j, k = PLANE_AXES[self.machine.s.plane]
        end = [float(words["XYZ"[n]]) * self.unit if "XYZ"[n] in words else start[n] for n in range(3)]
        via = [through.get("XYZ"[n], start[n]) for n in range(3)]
        if max(abs(end[k] - start[k]), abs(via[k] - start[k])) > 1e-6:
            raise BlockError("CIP in space: only a circle in the plane is followed")
        (ax, ay), (bx, by), (cx, cy) = ((p[i], p[j]) for p in (start, via, end))
        d = 2 * ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
        if abs(d) < 1e-9 * max(math.dist(start, end), 1.0):
            raise BlockError("CIP: start, intermediate point and end are on a line")
        b2, c2 = (bx - ax)**2 + (by - ay)**2, (cx - ax)**2 + (cy - ay)**2
        centre = (((cy - ay) * b2 - (by - ay) * c2) / d, ((bx - ax) * c2 - (cx - ax) * b2) / d)
        self._head(end, (ax + centre[0], ay + centre[1]), d > 0)
        text = " ".join(f"{a}{w}" for a, w in words.items())
        return (f"G{3 if d > 0 else 2} {text} {'IJK'[i]}{digits(centre[0] / self.unit)} "
                f"{'IJK'[j]}{digits(centre[1] / self.unit)}")

    def _head(self, end: Sequence[float], centre: tuple[float, float], left: bool) -> None:
        """Keep the direction at the end of an arc."""
        i, j, _ = PLANE_AXES[self.machine.s.plane]
        way = [0.0] * 3
        way[i], way[j] = -(end[j] - centre[1]), end[i] - centre[0]
        self.heading = (list(end), way if left else [-v for v in way])

    def note_arc(self, out: Sequence[str]) -> None:
        """Keep the direction at the end of an arc given by its centre, from the words of its block."""
        named = {w[0]: float(w[1:]) for w in out if w[0] in "XYZIJK"}
        start = self.here()
        i, j, _ = PLANE_AXES[self.machine.s.plane]
        motion = [w for w in out if w in ("G2", "G3")]
        if self.relative or not motion or not {"IJK"[i], "IJK"[j]} & named.keys():
            self.heading = None
            return
        end = [named["XYZ"[n]] * self.unit if "XYZ"[n] in named else start[n] for n in range(3)]
        centre = (start[i] + named.get("IJK"[i], 0.0) * self.unit, start[j] + named.get("IJK"[j], 0.0) * self.unit)
        self._head(end, centre, motion[0] == "G3")

    def set_pole(self, code: int, places: Mapping[str, float]) -> None:
        """G110 (from the latest place), G111 (from the zero), G112 (from the latest pole)."""
        base = self.known("G110") if code == 110 else [0.0] * 3 if code == 111 else self.pole
        self.pole = [b + self.unit * places.get(k, 0.0) if code != 111 or k in places else p
                     for k, b, p in zip("XYZ", base, self.pole, strict=True)]

    def polar_end(self, radius: float | None, angle: float | None) -> tuple[float, float]:
        """End of polar words along the axes of the plane, mm; an absent word keeps its value.

        Raises
        ------
        BlockError
            There is none to keep.
        """
        self.polar = [p if v is None else v for p, v in zip(self.polar, (radius, angle), strict=True)]
        if any(math.isnan(v) for v in self.polar):
            raise BlockError("polar words need RP and AP")
        i, j, _ = PLANE_AXES[self.machine.s.plane]
        turn = math.radians(self.polar[1])
        return self.pole[i] + self.polar[0] * math.cos(turn), self.pole[j] + self.polar[0] * math.sin(turn)


__all__ = ["SiemensPaths"]
