"""LinuxCNC's sample programs, each with a tool, a blank and the part it is right for.

The part is a height field just below everything its feed moves cover: the lowest the cutter comes over each node of a
grid (``foreign_twin.envelope``), the least of a node and its eight neighbours, and ``MARGIN`` under that. The cutter is
taken ``grown`` larger, by what a round of its radius can dip between two nodes. So no cut reaches the part, and on
floors it passes over it by ``gap`` alone.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.faults.fault_case import as_part
from benchmarks.foreign.foreign_twin import SPACING, envelope
from geometry.mesh import F64, TriangleMesh
from geometry.part import Part
from geometry.tool_body import HolderFrustum, ToolBody
from verify.gcode.reader import FEED, read_program
from verify.kinematics import Kinematics
from verify.model import ProofSetup, StockKind
from verify.program.program import Program

MARGIN = 0.01
MACHINE = Kinematics("table-table-AC", ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
HOLDER = (HolderFrustum(16.0, 22.0, 12.0), HolderFrustum(26.0, 26.0, 30.0))
_DEMOS = "examples/sample-configs/sim/axis/vismach/5axis/table-rotary-tilting/demos"
_CRAFT = "examples/sample-configs/sim/craftsman/screens"


def samples_root() -> Path | None:
    """The folder share/doc/linuxcnc beside LinuxCNC's interpreter; None where that is not installed."""
    found = shutil.which("rs274")
    root = Path(found).resolve().parents[1] / "share" / "doc" / "linuxcnc" if found else None
    return root if root is not None and root.is_dir() else None


@dataclass(frozen=True)
class Foreign:
    """A sample program and how it is run.

    file  : under the folder of samples; diameter, flutes : of the tool, mm; ball : whether it ends in one
    blank : (x0, y0, z0, x1, y1, z1), mm, or (x, y, z, radius, height) of a cylinder
    step  : mm between the nodes of the part; points : mm between those of stock under a tool that leans
    spacing : mm between the poses a tool that leans is run through stock at
    neck  : mm of neck over the flutes, 5 % thinner; shank : diameter, 0 for that of the cutter; sticking : mm of it
    """

    name: str
    file: str
    diameter: float
    ball: bool
    flutes: float
    blank: tuple[float, ...]
    step: float
    leaning: bool = False
    points: float = 0.5
    spacing: float = 0.05
    neck: float = 1.0
    shank: float = 0.0
    sticking: float = 5.0

    @property
    def tool(self) -> ToolBody:
        """T1: cutter, neck, shank and holder."""
        d, top = self.diameter, self.flutes + self.neck
        return ToolBody("T1", 1, d, 0.5 * d if self.ball else 0.0, self.flutes, 0.95 * d, top, self.shank or d,
                        top + self.sticking, HOLDER)

    @property
    def cutter(self) -> F64:
        """(radius, ball, flutes) as the twin takes it, mm."""
        return np.array([0.5 * self.diameter, float(self.ball), self.flutes])

    @property
    def bodies(self) -> F64:
        """(b, 5) rows (z0, z1, r0, r1, clearance) of neck, shank and holder, mm."""
        t, s = self.tool, self.setup
        rows = [(t.flute_length, t.neck_length, 0.5 * t.neck_diameter, 0.5 * t.neck_diameter,
                 min(s.clearance_neck, 0.25 * (t.diameter - t.neck_diameter))),
                (t.neck_length, t.stickout, 0.5 * t.shank_diameter, 0.5 * t.shank_diameter,
                 s.clearance_shank if t.shank_diameter > t.diameter else 0.0)]
        z = t.stickout
        for part in t.holder:
            rows.append((z, z + part.length, 0.5 * part.diameter, 0.5 * part.diameter_top, s.clearance_holder))
            z += part.length
        return np.array(rows)

    @property
    def end(self) -> float:
        """mm, radius of the region that cuts straight down: all of a flat, the inner half of a ball."""
        return 0.25 * self.diameter if self.ball else 0.5 * self.diameter

    @property
    def box(self) -> F64:
        """(2, 3) float64 bounds of the blank, mm."""
        b = self.blank
        if len(b) == 6:
            return np.array(b, dtype=np.float64).reshape(2, 3)
        x, y, z, r, height = b
        return np.array([[x - r, y - r, z], [x + r, y + r, z + height]])

    def filled(self, first: F64, h: float, shape: tuple[int, int, int]) -> NDArray[np.bool_]:
        """Which of the points ``h`` mm apart from (3,) mm on lie in the blank."""
        b = self.blank
        x, y, z = (first[c] + h * np.arange(shape[c]) for c in range(3))
        low, high = self.box
        inside = [(v >= low[c]) & (v <= high[c]) for c, v in enumerate((x, y, z))]
        plan = inside[0][:, None] & inside[1][None, :]
        if len(b) == 5:
            plan &= np.hypot(x[:, None] - b[0], y[None, :] - b[1]) <= b[3]
        return np.asarray(plan[:, :, None] & inside[2])

    @cached_property
    def setup(self) -> ProofSetup:
        """Blank, clearances and machine of the proof; the gouge tolerance is 0.001 mm, a tenth of ``MARGIN``."""
        base = ProofSetup(stock_kind=StockKind.BOX, stock_box=self.box, gouge_tolerance=0.001,
                          line_spacing=min(0.15, self.step), kinematics=MACHINE if self.leaning else None)
        if len(self.blank) == 5:
            return replace(base, stock_kind=StockKind.CYLINDER, stock_cylinder=self.blank)  # type: ignore[arg-type]
        return base

    @property
    def grown(self) -> float:
        """mm, how much larger the cutter is taken: what its round dips at most across a cell. The rim of
        a flat that leans is an ellipse from above, whose tip is far sharper than the tool."""
        least = 0.25 if self.leaning and not self.ball else min(0.5 * self.diameter, 2.0)
        return self.step**2 / (4.0 * least) + 0.001

    @property
    def gap(self) -> float:
        """mm, least way from what the cutter covers down to the part."""
        return MARGIN + self.grown

    def text(self, root: Path) -> str:
        """The program as it is delivered."""
        return (root / self.file).read_text(errors="replace")


@dataclass(frozen=True, eq=False)
class Paths:
    """Moves of a program for the twin: (m, 3) mm, (m, 2, 2) rad A and C at both ends, (m,) feed and line."""

    start: F64
    end: F64
    turns: F64
    feed: F64
    line: F64


def paths(case: Foreign, text: str) -> tuple[Program, Paths]:
    """The program as read, and its moves; a first descent that states no height comes from above the blank.

    The reading itself is held against LinuxCNC's interpreter (tests/contract/test_reader_against_rs274.py).
    """
    p = read_program(text, name=case.name, tools=frozenset({1}), kinematics=case.setup.kinematics,
                     gauge_length={}, spindle_tool=1)
    start = p.start.copy()
    for move, axes in p.unknown.tolist():
        if axes == 4 and (start[move, :2] == p.end[move, :2]).all():
            start[move, 2] = max(case.box[1, 2] + case.setup.clearance_rapid, p.end[move, 2])
    turns = np.zeros((len(p), 2, 2))
    if p.poses is not None:
        turns = np.stack([p.poses.start_turn, p.poses.end_turn], 1)
    return p, Paths(start, p.end.copy(), np.ascontiguousarray(turns), p.kind == FEED, p.line)


def covered(case: Foreign, moves: Paths, grow: float, shift: float = 0.0) -> tuple[F64, F64, float]:
    """Lowest z of the cutter over the nodes of the part's grid moved by ``shift`` steps in x and y.

    Returns (nx, ny) float64 mm, inf where it never comes, the origin (2,) mm, and mm between nodes. Feed moves alone.
    """
    counts = np.maximum(np.round((case.box[1] - case.box[0])[:2] / case.step).astype(int), 2)
    step = float(((case.box[1] - case.box[0])[:2] / counts).min())
    origin = case.box[0, :2] + shift * step
    out = np.full(tuple((counts + 1).tolist()), np.inf)
    envelope(out, origin, step, moves.start, moves.end, moves.turns, moves.feed, case.cutter, grow, SPACING)
    return out, origin, step


def least_of_neighbours(heights: F64) -> F64:
    """(nx, ny) float64, mm: the least of each node and its eight neighbours."""
    for axis in (0, 1):
        padded = np.pad(heights, [(1, 1) if a == axis else (0, 0) for a in (0, 1)], mode="edge")
        n = heights.shape[axis]
        heights = np.minimum.reduce([np.take(padded, range(k, k + n), axis) for k in (0, 1, 2)])
    return heights


def heights_of_part(case: Foreign, moves: Paths) -> tuple[F64, F64, float]:
    """Heights (nx, ny) float64 mm of the part the program is right for, origin (2,) mm, mm between nodes."""
    out, origin, step = covered(case, moves, case.grown)
    top = least_of_neighbours(np.minimum(out, case.box[1, 2])) - MARGIN
    if len(case.blank) == 5:
        x, y = (origin[c] + step * np.arange(n) for c, n in enumerate(top.shape))
        inside = np.hypot(x[:, None] - case.blank[0], y[None, :] - case.blank[1]) < case.blank[3] - 2.0 * step
        top = np.where(inside, top, case.box[0, 2] + 0.02)
    return np.maximum(top, case.box[0, 2] + 0.02), origin, step


def part_of(heights: F64, origin: F64, step: float, bottom: float) -> Part:
    """The solid between ``bottom`` and heights (nx, ny), mm, at nodes ``step`` mm apart from ``origin`` (2,) mm."""
    nx, ny = heights.shape
    x, y = np.meshgrid(origin[0] + step * np.arange(nx), origin[1] + step * np.arange(ny), indexing="ij")
    top = np.stack([x, y, heights], -1).reshape(-1, 3)
    i = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    upper = np.concatenate([np.stack([i, i + ny, i + ny + 1], 1), np.stack([i, i + ny + 1, i + 1], 1)])
    rim = np.concatenate([np.arange(nx - 1) * ny, (nx - 1) * ny + np.arange(ny - 1),
                          (nx - 1 - np.arange(nx - 1)) * ny + ny - 1, ny - 1 - np.arange(ny - 1)])
    low, k, j = top[rim].copy(), len(top), np.arange(len(rim))
    low[:, 2] = bottom
    nxt = (j + 1) % len(rim)
    sides = np.concatenate([np.stack([rim, k + j, k + nxt], 1), np.stack([rim, k + nxt, rim[nxt]], 1)])
    base = np.stack([np.full(len(rim), k + len(rim)), k + nxt, k + j], 1)
    ids = np.repeat([1, 2, 3], [len(upper), len(sides), len(base)]).astype(np.int32)
    middle = np.array([[*low[:, :2].mean(axis=0), bottom]])
    return as_part(TriangleMesh(np.vstack([top, low, middle]), np.concatenate([upper, sides, base]), ids))


def _inch(*values: float) -> tuple[float, ...]:
    return tuple(25.4 * v for v in values)


def _nc(name: str) -> str:
    return f"examples/nc_files/{name}.ngc"


CASES = (
    Foreign("3D_Chips", _nc("3D_Chips"), 10.0, True, 45.0, (-50, -50, -50, 50, 50, 0), 0.25),
    Foreign("3dtest", _nc("3dtest"), 1.0, True, 70.0, (-2, -2, -4, 60, 60, 1), 0.15),
    Foreign("arcspiral", _nc("arcspiral"), 3.175, True, 12.0, (-55, -55, -8, 55, 55, 0), 0.25),
    Foreign("cds", _nc("cds"), 6.35, False, 30.0, _inch(0, 0, 0, 4, 4, 2), 0.25),
    Foreign("flowsnake", _nc("flowsnake"), 0.06, True, 2.0, (-0.2, -0.2, -0.5, 4.2, 4.2, 0.02), 0.008),
    Foreign("hole-circle", _nc("hole-circle"), 6.0, False, 20.0, (-50, -45, -15, 50, 45, -1), 0.25),
    Foreign("polar", _nc("polar"), 6.0, False, 20.0, (-70, -70, -20, 135, 90, 0), 0.4),
    Foreign("spiral", _nc("spiral"), 3.175, False, 12.0, (-55, -55, -8, 55, 55, 0), 0.25),
    Foreign("tort", _nc("tort"), 2.0, True, 80.0, (-35, -35, -22, 52, 54, 5), 0.2),
    Foreign("craftsmancnc", f"{_CRAFT}/craftsmancnc.ngc", 0.3, True, 4.0, (0, 0, -3, 90, 31, 0), 0.08),
    Foreign("boat-xyzac", f"{_DEMOS}/boat-xyzac.ngc", 10.0, False, 22.0, (-50, -27, -20, 47, 24, 0), 0.2, True),
    Foreign("impeller-7bl-xyzac", f"{_DEMOS}/impeller-7bl-xyzac.ngc", 3.0, True, 70.0, (0, 0, -4, 46, 44), 0.35, True,
            points=0.6),
)
SHORT = Foreign("spiral, 1.5 mm flutes", _nc("spiral"), 3.175, False, 1.5, (-55, -55, -8, 55, 55, 0), 0.3, shank=6.0,
                sticking=15.0, neck=0.7)
"""A program with a tool that is too short for it: contacts the twin has to agree on."""
