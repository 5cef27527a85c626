"""Coordinates of Heidenhain controls: datum shift, mirror, rotation, scale, PLANE, and tool centre point control."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping

import numpy as np

from geometry.mesh import F64
from verify.gcode.dialects.base import BlockError, DialectReader
from verify.gcode.dialects.heidenhain.heidenhain_q import VALUE
from verify.gcode.dialects.orientation import angles_of, needed
from verify.gcode.dialects.oriented_moves import OrientedMoves
from verify.gcode.dialects.stated_places import digits
from verify.gcode.dialects.tilted_planes import turn
from verify.gcode.frames import Frame, about, rotation, scaling, translation
from verify.kinematics import Kinematics

_ORIGIN = (0.0, 0.0, 0.0)
SAME = 1e-9  # mm
SAME_AXIS = 1e-6
"""Largest distance of two unit tool axes that count as one."""
_PLANE = re.compile(r"PLANE (SPATIAL|EULER|VECTOR|RELATIV|AXIAL|RESET|PROJECTED|POINTS)\s*(.*)")
_NAMES = {"SPATIAL": ("SPA", "SPB", "SPC"), "EULER": ("EULPR", "EULNU", "EULROT"), "RELATIV": ("SPA", "SPB", "SPC"),
          "VECTOR": ("BX", "BY", "BZ", "NX", "NY", "NZ"), "AXIAL": ("A", "B", "C")}
_OPTION = re.compile(rf"\s*(?:(MOVE|TURN|STAY)|DIST\s*({VALUE})|(F)\s*(MAX|AUTO|{VALUE})|MB\s*(MAX|{VALUE})|"
                     r"SYM\s*([+-])|"
                     rf"(SYM)?\s*SEQ\s*([+-])|(COORD ROT|TABLE ROT))(?=\s|$)")


class HeidenhainFrames(OrientedMoves):
    """Transformations in force.

    shift, spun, factor, mirrored : datum shift, mm; rotation, rad; scale; axes that are mirrored
    plane  : (3, 3) axes of the tilted plane in the columns, None for none
    swung  : whether its rotary axes are turned by PLANE or after it, the tip kept by the reader
    wanted : tool axis that the plane needs before a move in it, None where it stands there
    unspun : (3,) mm, the place before the rotation changed, until a move names X and Y; None for none
    longer : mm, by which TOOL CALL says that the tool is longer (DL)
    spat   : whether rotary words are spatial angles (FUNCTION TCPM ... AXIS SPAT)
    """

    vector_words, tcp_word = "a tool vector (TX, TY, TZ)", "M128"

    def __init__(self) -> None:
        super().__init__()
        self.shift = [0.0] * 3
        self.spun, self.factor = 0.0, 1.0
        self.mirrored = ""
        self.plane: F64 | None = None
        self.swung = self.spat = False
        self.wanted: F64 | None = None
        self.unspun: list[float] | None = None
        self.longer = 0.0
        self.value: Callable[[str], float] = float

    def _reframe(self) -> None:
        """State the frame of the blocks that follow."""
        self.uncompensated("a change of the coordinates")
        self.frame = self._whole()
        self.forget()

    def _whole(self) -> Frame | None:
        """The transformations in force as one frame."""
        parts: list[Frame] = []
        if self.longer:
            axis = np.array([0.0, 0.0, 1.0]) if self.plane is None else self.plane[:, 2]
            parts.append(translation((self.longer * axis).tolist()))
        if any(self.shift):
            parts.append(translation(self.shift))
        if self.plane is not None:
            parts.append(about(self.plane, _ORIGIN))
        if self.mirrored:
            parts.append(scaling([-1.0 if k in self.mirrored else 1.0 for k in "XYZ"]))
        if self.spun:
            parts.append(rotation(17, self.spun))
        if self.factor != 1.0:
            parts.append(scaling([self.factor] * 3))
        whole: Frame | None = None
        for part in parts:
            whole = part if whole is None else whole @ part
        return whole

    def keep_frames(self, ended: DialectReader) -> bool:
        """Take shift, mirror, rotation, scale and plane over: MP7300 or clearMode decide whether M30 ends them."""
        if isinstance(ended, HeidenhainFrames):
            self.shift, self.spun, self.factor = list(ended.shift), ended.spun, ended.factor
            self.mirrored, self.plane, self.swung, self.wanted = ended.mirrored, ended.plane, ended.swung, ended.wanted
            self.frame = self._whole()
        return self.frame is not None

    def reset_frames(self) -> None:
        """A preset ends datum shift, mirror, rotation and scale."""
        if any(self.shift) or self.spun or self.factor != 1.0 or self.mirrored:
            self.shift, self.spun, self.factor, self.mirrored = [0.0] * 3, 0.0, 1.0, ""
            self._reframe()

    def is_set(self, kind: str) -> bool:
        """Whether a MIRROR, ROTATION or SCALE is in force."""
        return {"MIRROR": bool(self.mirrored), "ROTATION": self.spun != 0.0, "SCALE": self.factor != 1.0}[kind]

    def shift_datum(self, places: dict[str, tuple[float, bool]]) -> None:
        """Cycle 7 or TRANS DATUM: shifts of X, Y, Z, mm, and whether each adds to the one in force.

        Raises
        ------
        BlockError
            The order of transformations is not certain.
        """
        new = list(self.shift)
        for letter, (value, adds) in places.items():
            k = "XYZ".index(letter)
            new[k] = value + (new[k] if adds else 0.0)
        if new == self.shift:
            return
        if self.plane is not None:
            raise BlockError("a datum shift in a tilted plane is not followed", "shift the datum before PLANE")
        if any(new) and (self.spun or self.factor != 1.0 or self.mirrored):
            raise BlockError("a datum shift while mirror, rotation or scale is on: which comes first is not certain",
                             "shift the datum first, then mirror, turn or scale")
        self.shift = new
        self._reframe()

    def mirror(self, axes: str) -> None:
        """Cycle 8: the axes that are mirrored.

        Raises
        ------
        BlockError
            With a rotation or a plane.
        """
        if axes and (self.spun or self.plane is not None):
            raise BlockError("a mirror with a rotation or a tilted plane: which comes first is not certain")
        self.mirrored = axes
        self._reframe()

    def rotate(self, angle: float, adds: bool) -> None:
        """Cycle 10: rotation about the datum, rad, in the plane XY.

        Raises
        ------
        BlockError
            With a mirror.
        """
        turned = angle + (self.spun if adds else 0.0)
        if turned != self.spun:
            self.unspun = self.here()
        self.spun = turned
        if self.spun and self.mirrored:
            raise BlockError("a rotation with a mirror: which comes first is not certain")
        self._reframe()

    def settle(self, words: Mapping[str, str], rapid: bool) -> dict[str, str] | None:
        """As ``StatedPlaces.settle``; the first move behind a rotation names both axes, where it matters.

        The control turns an axis when it is named first. Where one that is not named goes is not said.

        Raises
        ------
        BlockError
            It names one of both, or as there.
        """
        others = [k for k in "XY" if k not in words]
        if self.unspun is not None and len(others) < 2:
            k = "XYZ".index(others[0]) if others else 0
            if others and abs(self.here()[k] - self.unspun[k]) > SAME:
                raise BlockError(f"a move without {others[0]} behind a rotation (cycle 10): it is not certain where "
                                 "the control takes it", "name X and Y in the first move")
            self.unspun = None
        return super().settle(words, rapid)

    def scale(self, factor: float) -> None:
        """Cycle 11: one scale for all axes.

        Raises
        ------
        BlockError
            It is not above 0.
        """
        if not factor > 1e-6:
            raise BlockError(f"cycle 11 with the scale {factor:g}")
        self.factor = factor
        if factor != 1.0:
            self.notes.append("cycle 11 scales X, Y and Z; on some controls machine parameter 7410 leaves Z as it is")
        self._reframe()

    def lengthen(self, delta: float) -> None:
        """TOOL CALL with DL, mm."""
        if delta != self.longer:
            self.longer = delta
            self._reframe()

    def tilt(self, text: str) -> list[str]:
        """Blocks of a PLANE function.

        Raises
        ------
        BlockError
            It cannot be followed.
        """
        m = _PLANE.fullmatch(text)
        if m is None or m[1] in ("PROJECTED", "POINTS"):
            raise BlockError(f"cannot read '{text[:60]}': PLANE SPATIAL, EULER, VECTOR, RELATIV, AXIAL and RESET are "
                             f"followed")
        kind, rest = m[1], m[2]
        numbers, rest = self._numbers(kind, rest)
        options = _options(rest, text)
        way = options.get("way", "STAY" if kind == "RESET" else "")
        if not way:
            raise BlockError(f"'{text[:60]}' without MOVE, TURN or STAY")
        if self.relative:
            raise BlockError("PLANE in incremental coordinates")
        if kind == "RESET":
            return self._untilt(way, options)
        if self.mirrored or self.spun or self.factor != 1.0:
            raise BlockError("PLANE while mirror, rotation or scale is on: which comes first is not certain")
        matrix = self._matrix(kind, numbers)
        if self.tcp and not self.swung:
            if way != "STAY":
                raise BlockError(f"cannot read '{text[:60]}': PLANE with {way} while M128 is on",
                                 "program M129 before it, or STAY")
            self.plane = matrix
            self._reframe()
            return []
        return self._towards(matrix, way, options, text)

    def _numbers(self, kind: str, rest: str) -> tuple[list[float], str]:
        """Values of the plane by the order of their names, and the options behind them."""
        out = []
        for name in _NAMES.get(kind, ()):
            m = re.match(rf"\s*{name}\s*({VALUE})(?![A-Z0-9.])", rest)
            if m is None and kind in ("RELATIV", "AXIAL"):
                out.append(math.nan)
                continue
            if m is None:
                raise BlockError(f"PLANE {kind} without {name}")
            out.append(self.value(m[1]))
            rest = rest[m.end():]
        return out, rest

    def _matrix(self, kind: str, numbers: list[float]) -> F64:
        """Axes of the plane in the setup frame, in the columns."""
        if kind == "VECTOR":
            b, n = np.array(numbers[:3]), np.array(numbers[3:])
            if not float(np.linalg.norm(n)) > 1e-6:
                raise BlockError("PLANE VECTOR with a normal of length 0")
            z = n / np.linalg.norm(n)
            x = b - (b @ z) * z
            if not float(np.linalg.norm(x)) > 1e-6:
                raise BlockError("PLANE VECTOR whose base vector is its normal")
            x = x / np.linalg.norm(x)
            return np.column_stack([x, np.cross(z, x), z])
        if kind == "AXIAL":
            machine = needed(self.machine.machine, "PLANE AXIAL")
            if machine.tilts_head:
                raise BlockError("PLANE AXIAL on a machine whose head tilts is not followed", "use PLANE SPATIAL")
            extra = [k for k, v in zip("ABC", numbers, strict=True) if v == v and k not in machine.letters]
            if extra:
                raise BlockError(f"PLANE AXIAL {extra[0]}: the rotary axes are {' and '.join(machine.letters)}")
            now = dict(zip("ABC", (0.0 if v != v else v for v in numbers), strict=True))
            angles = np.radians([[now[k] for k in machine.letters]])
            return np.asarray(machine.slides(angles)[0].T)
        alpha, beta, gamma = (math.radians(0.0 if v != v else v) for v in numbers)
        if kind == "EULER":
            return np.asarray(turn(2, alpha) @ turn(0, beta) @ turn(2, gamma))
        whole = turn(2, gamma) @ turn(1, beta) @ turn(0, alpha)
        if kind == "RELATIV" and self.plane is not None:
            whole = self.plane @ whole
        return np.asarray(whole)

    def _towards(self, matrix: F64, way: str, options: dict[str, str], text: str) -> list[str]:
        """Blocks that turn the rotary axes to a plane, or leave that to a block after it (STAY)."""
        axis = matrix[:, 2]
        machine = self.machine.machine
        upright = bool(np.abs(axis[:2]).max() < 1e-12 and axis[2] > 0)
        if machine is None:
            if not upright:
                needed(None, "PLANE")
            self.plane = matrix if np.abs(matrix - np.eye(3)).max() > 1e-12 else None
            self._reframe()
            return self._lifted(options) if way != "STAY" else []
        now = self.machine.s.turn
        angles = angles_of(machine, axis.tolist(), now, {"+": 1, "-": -1}.get(options.get("seq", ""), 0),
                           machine.limits)
        if upright:
            angles = [0.0, 0.0]
        self._state_angles(machine, angles)
        kept = self.swung
        self.plane = matrix if np.abs(matrix - np.eye(3)).max() > 1e-12 else None
        self._reframe()  # the blocks below run in the new coordinates
        self.wanted = None if way != "STAY" else np.asarray(axis)
        self.swung = way != "STAY" and not upright
        if way == "STAY":
            return ["M429"] if kept else []
        out = [*self._lifted(options), *self._turned(machine, angles, way, options, kept)]
        on = [w for w in out if w in ("M428", "M429")][-1:] or ["M428" if kept else "M429"]
        return out if (on[0] == "M428") == self.swung else [*out, "M428" if self.swung else "M429"]

    def _state_angles(self, machine: Kinematics, angles: list[float]) -> None:
        """Q120 to Q122 hold the angles of A, B and C."""
        self.plane_angles = dict(zip(machine.letters, angles, strict=True))

    plane_angles: dict[str, float] = {}

    def _lifted(self, options: dict[str, str]) -> list[str]:
        """MB: a retract along the tool before the axes turn."""
        if "mb" not in options:
            return []
        return self.retract(options["mb"], "")

    def retract(self, far: str, feed: str) -> list[str]:
        """Blocks of a retract along the tool axis: MAX, to the end of the travel, or by a distance.

        feed : F word of the move, '' for a rapid
        """
        if far == "MAX":
            self.forget()
            self.machine.s.along_tool = True
            return ["G0 G53 Z0"]
        distance = self.value(far) * self.unit
        here = self.known("M140")
        axis = np.array([0.0, 0.0, 1.0])
        machine = self.machine.machine
        if machine is not None:
            axis = machine.axis(np.radians([self.machine.s.turn]))[0]
        if self.frame is not None:
            axis = np.linalg.solve(self.frame.matrix, axis)
            axis = axis / np.linalg.norm(axis)
        end = [h + distance * float(a) for h, a in zip(here, axis, strict=True)]
        places = " ".join(f"{k}{digits(v / self.unit)}" for k, v in zip("XYZ", end, strict=True))
        return [f"G1 {places} {feed}" if feed else f"G0 {places}"]

    def _turned(self, machine: Kinematics, angles: list[float], way: str, options: dict[str, str],
                kept: bool) -> list[str]:
        """Blocks that turn the axes: TURN leaves the linear axes where they are, MOVE keeps the tip at the part."""
        words = " ".join(f"{k}{digits(v)}" for k, v in zip(machine.letters, angles, strict=True))
        if way == "TURN":
            return [*(["M429"] if kept else []), f"G0 {words}"]
        far = self.value(options["dist"]) * self.unit if "dist" in options else 0.0
        out = [] if kept else ["M428"]
        place = self.machine.s.position
        if not far or any(math.isnan(v) for v in place):
            return [*out, f"G0 {words}"]
        now = list(self.machine.s.turn)
        if not kept and any(now):
            raise BlockError("PLANE with DIST while rotary axes are turned already")
        count = max(1, math.ceil(max(abs(a - b) for a, b in zip(angles, now, strict=True)) / 2.0))
        old = machine.axis(np.radians([now]))[0]
        inverse = None if self.frame is None else self.frame
        for k in range(1, count + 1):
            turned = [b + (a - b) * k / count for a, b in zip(angles, now, strict=True)]
            axis = machine.axis(np.radians([turned]))[0]
            tip = [p + far * float(b - a) for p, a, b in zip(place, old, axis, strict=True)]
            tip = tip if inverse is None else inverse.back(tip)
            out.append(" ".join(["G0", *(f"{a}{digits(v / self.unit)}" for a, v in zip("XYZ", tip, strict=True)),
                                 *(f"{a}{digits(v)}" for a, v in zip(machine.letters, turned, strict=True))]))
        return out

    def _untilt(self, way: str, options: dict[str, str]) -> list[str]:
        """PLANE RESET."""
        machine = self.machine.machine
        kept = self.swung
        self.plane, self.wanted, self.swung = None, None, False
        self._reframe()
        if way == "STAY":
            return ["M429"] if kept else []
        if machine is None:
            return self._lifted(options)
        if self.tcp:
            raise BlockError(f"PLANE RESET {way} while M128 is on", "program M129 before it, or STAY")
        out = self._lifted(options)
        if any(self.machine.s.turn):
            out += self._turned(machine, [0.0, 0.0], way, options, kept)
        on = [w for w in out if w in ("M428", "M429")][-1:] or ["M428" if kept else "M429"]
        return out if on[0] == "M429" else [*out, "M429"]

    def arrived(self, angles: dict[str, float]) -> bool:
        """Whether rotary words bring the tool to the axis that a plane with STAY needs."""
        machine = self.machine.machine
        if self.wanted is None or machine is None:
            return False
        turns = [angles.get(k, t) for k, t in zip(machine.letters, self.machine.s.turn, strict=True)]
        return bool(np.linalg.norm(machine.axis(np.radians([turns]))[0] - self.wanted) < SAME_AXIS)


def _options(rest: str, text: str) -> dict[str, str]:
    """Options of a PLANE function by name: way, dist, mb, seq."""
    out: dict[str, str] = {}
    at = 0
    while rest[at:].strip():
        m = _OPTION.match(rest, at)
        if m is None:
            raise BlockError(f"cannot read '{rest[at:].strip()[:40]}' in '{text[:50]}'")
        at = m.end()
        if m[1]:
            out["way"] = m[1]
        elif m[2]:
            out["dist"] = m[2]
        elif m[5]:
            out["mb"] = m[5]
        elif m[6] or m[8]:
            out["seq"] = m[6] or m[8]
    return out


__all__ = ["HeidenhainFrames"]
