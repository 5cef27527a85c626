"""A clean case of the fault table: part, tools, program and what is known of each of its lines.

Programs are written by ``Script``: every line of motion says all its words, so one can be taken out, put in or changed
without turning its neighbours into something else. The five-axis machine is a tilting and turning table; its formulas
stand here once more, for the generators and the twin, and are not those of the proof.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from benchmarks.faults.fault_solids import Solid
from geometry.mesh import F64, TriangleMesh
from geometry.part import FaceInfo, Part
from geometry.sampling import SurfaceSamples, sample_surface
from geometry.tool_body import ToolBody
from verify.model import ProofSetup, ScoredSamples

PIVOTS = ((0.0, -3.0, -25.0), (1.0, 2.0, -10.0))  # mm: a point on the tilting axis A, one on the turning axis C
DENSITY = 100.0  # samples a mm²


class Mode(StrEnum):
    """What X, Y, Z of a program are: the tip of a tool along Z, the tip of one that leans, or the linear joints."""

    UPRIGHT = "upright"
    CENTRE = "centre"
    JOINTS = "joints"


@dataclass(frozen=True, eq=False)
class Step:
    """One line of motion.

    row    : index of the line; rapid, arc : what it is
    tip    : (3,) mm, where it ends; turn : (2,) deg, A and C there, None where the line has no rotary words
    tool   : T number; run : the finishing pass it belongs to, -1 for none
    normal : (3,) unit, of the part where the finished line touches it, or None
    """

    row: int
    rapid: bool
    arc: bool
    tip: F64
    turn: tuple[float, float] | None
    tool: int
    run: int
    normal: F64 | None


@dataclass(frozen=True, eq=False)
class Case:
    """A part, its program, and what the faults are planted by.

    lines, steps : of the program; runs : zone name of each finishing pass
    solid  : the part, exact; part its mesh
    room   : (x, y, z, depth) mm, a place inside the stock the first tool may go down at, from z, before any cut
    across : (2, 2) mm, x and y of a way over the blank from outside to outside, free of clamps, at the start
    blank_top, safe : mm
    """

    name: str
    mode: Mode
    lines: tuple[str, ...]
    steps: tuple[Step, ...]
    runs: tuple[str, ...]
    tools: tuple[ToolBody, ...]
    setup: ProofSetup
    solid: Solid
    part: Part
    scored: ScoredSamples
    zones: tuple[str, ...]
    room: tuple[float, float, float, float]
    across: F64
    blank_top: float
    safe: float

    @property
    def text(self) -> str:
        """The program."""
        return "\n".join(self.lines) + "\n"


def tool_axis(turn: F64) -> F64:
    """(n, 3) unit vectors tip to spindle on the part for (n, 2) angles A and C, rad."""
    a, c = turn.T
    return np.column_stack([np.sin(a) * np.sin(c), np.sin(a) * np.cos(c), np.cos(a)])


def angles(axis: F64) -> tuple[float, float]:
    """A and C in deg that hold the tool along a unit vector (3,)."""
    return math.degrees(math.acos(min(1.0, float(axis[2])))), math.degrees(math.atan2(axis[0], axis[1]))


def _table(turn: F64) -> F64:
    """(n, 3, 3) turns of the table: first about Z by C, then about X by A."""
    a, c = turn.T
    zero, one = np.zeros_like(a), np.ones_like(a)
    spin = np.array([[np.cos(c), -np.sin(c), zero], [np.sin(c), np.cos(c), zero], [zero, zero, one]])
    tilt = np.array([[one, zero, zero], [zero, np.cos(a), -np.sin(a)], [zero, np.sin(a), np.cos(a)]])
    return np.einsum("ijn,jkn->nik", tilt, spin), np.moveaxis(tilt, 2, 0)  # type: ignore[return-value]


def to_joints(tip: F64, turn: F64) -> F64:
    """Joints (n, 3), mm, that hold the tip at (n, 3) mm of the part with the table at (n, 2) rad."""
    both, tilt = _table(turn)
    q1, q2 = np.array(PIVOTS[0]), np.array(PIVOTS[1])
    return q1 + np.einsum("nij,j->ni", tilt, q2 - q1) + np.einsum("nij,nj->ni", both, tip - q2)


def to_tip(joints: F64, turn: F64) -> F64:
    """Tip (n, 3) mm on the part for joints (n, 3) mm and the table at (n, 2) rad."""
    both, tilt = _table(turn)
    q1, q2 = np.array(PIVOTS[0]), np.array(PIVOTS[1])
    return q2 + np.einsum("nji,nj->ni", both, joints - q1 - np.einsum("nij,j->ni", tilt, q2 - q1))


def place_words(mode: Mode, tip: F64, turn: tuple[float, float] | None) -> str:
    """X, Y, Z, and A, C where they are given, of a line; tip (3,) mm, turn deg."""
    if turn is not None and mode == Mode.JOINTS:
        tip = to_joints(tip[None], np.radians([turn]))[0]
    xyz = " ".join(f"{name}{value + 0.0:.4f}" for name, value in zip("XYZ", np.round(tip, 4).tolist(), strict=True))
    return xyz if turn is None else f"{xyz} A{turn[0]:.4f} C{turn[1]:.4f}"


@dataclass
class Script:
    """Writes a program and keeps what each line is."""

    mode: Mode
    safe: float
    lines: list[str] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)
    runs: list[str] = field(default_factory=list)
    tool: int = 0
    run: int = -1

    def begin(self) -> None:
        """The head of the program."""
        self.lines += ["%", "G21 G90 G17 G94 G40 G49 G54 G61"]

    def change(self, number: int, x: float, y: float, feed: float) -> None:
        """Load a tool and bring it to the safe height over (x, y), mm; feed in mm/min."""
        self.tool = number
        self.lines += [f"T{number} M6", f"S{6000 + 1000 * number} M3"]
        leaning = number > 1 and self.mode == Mode.CENTRE
        self.lines += [f"G43.4 H{number}" if leaning else f"G43 H{number}"]
        if self.mode != Mode.UPRIGHT:
            self.lines += ["G0 A0 C0"]
        self.lines += [f"G0 X{x:.4f} Y{y:.4f}", f"G0 Z{self.safe:.4f}", f"F{feed:g}"]
        self._note(len(self.lines) - 2, True, False, np.array([x, y, self.safe]), None, None)

    def zone(self, name: str | None) -> None:
        """Begin another finishing pass of a zone; None ends the last one."""
        self.run = -1
        if name is not None:
            self.run = len(self.runs)
            self.runs.append(name)

    def go(self, tip: Sequence[float] | F64, turn: tuple[float, float] | None = None, normal: F64 | None = None, *,
           rapid: bool = False) -> None:
        """A straight move of the tip to (3,) mm with the table at (A, C) deg."""
        at = np.asarray(tip, float)
        self.lines.append(f"{'G0' if rapid else 'G1'} {place_words(self.mode, at, turn)}")
        self._note(len(self.lines) - 1, rapid, False, at, turn, normal)

    def arc(self, tip: Sequence[float] | F64, centre: Sequence[float], clockwise: bool,
            normal: F64 | None = None) -> None:
        """An arc in XY from where the tip stands to (3,) mm round ``centre`` (x, y) mm."""
        at, was = np.asarray(tip, float), np.round(self.steps[-1].tip, 4)
        i, j = np.round(np.asarray(centre) - was[:2], 4).tolist()
        word = "G2" if clockwise else "G3"
        self.lines.append(f"{word} {place_words(self.mode, at, None)} I{i + 0.0:.4f} J{j + 0.0:.4f}")
        self._note(len(self.lines) - 1, False, True, at, None, normal)

    def lift(self) -> None:
        """A rapid straight up to the safe height."""
        self.go([*self.steps[-1].tip[:2], self.safe], rapid=True)

    def end(self) -> None:
        """The tail of the program."""
        self.lines += ["M5", "M30", "%"]

    def _note(self, row: int, rapid: bool, arc: bool, tip: F64, turn: tuple[float, float] | None,
              normal: F64 | None) -> None:
        self.steps.append(Step(row, rapid, arc, tip, turn, self.tool, self.run, normal))


def as_part(mesh: TriangleMesh) -> Part:
    """The mesh as a Part without edges."""
    faces = tuple(FaceInfo(int(f), "other", float(mesh.areas[mesh.face_ids == f].sum()), False, 0.0, 0.0)
                  for f in np.unique(mesh.face_ids))
    return Part(mesh, faces, (), mesh.volume, mesh.bounds, "mm", 0.0005, 0.1, 0.0005, (), "0" * 64)


def samples_on(solid: Solid, mesh: TriangleMesh, faces: Sequence[int], seed: int) -> SurfaceSamples:
    """Samples of some faces, moved onto the exact surface with its normals."""
    s = sample_surface(mesh, DENSITY, seed=seed, triangles=np.flatnonzero(np.isin(mesh.face_ids, faces)))
    points, normals = solid.settled(s.points, s.normals)
    return SurfaceSamples(np.ascontiguousarray(points), np.ascontiguousarray(normals), s.area, s.face, s.triangle)
