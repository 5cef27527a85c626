"""Drills that go on in their hole with their flutes shut in, and drills that cut with one side only.

What stands round a drill is asked of the stock exactly, on rays along its axis (``verify.surface.removal``), so no
spacing matters. Coordinates are float64, mm, in the setup frame.

Notation: D is the diameter of a drill, R its radius. A place stands before a move where the blank had it and no move
before took it away.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.cutting_mechanics import bending_stress, compliance
from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.tool_body import ToolBody
from verify.assumptions import Assumed, AssumedKind
from verify.blank.blank import WITHIN, blank_holds
from verify.cutting_words import CuttingWords
from verify.material.cutting_loads import BEND_TIMES, CutSequence
from verify.model import Finding, FindingKind, ProofSetup
from verify.surface.removal import first_below

RING, AROUND = 1.1, 8  # radii at which a wall beside a drill is looked for, and directions
WEB = 0.2
"""Radii of the core of a drill, on which no lip cuts: its point is seated where stock stands under all of it."""
ON_LIPS = np.array([0.2, 0.45, 0.7, 0.95])  # radii along a lip
STEP, LEAST, PLACES = 0.25, 4, 64  # diameters between places along a move, least and most places on it
IN_ONE_GO, IN_A_PECK = 0.5, 1.5
"""Diameters that a drill may go on with its flutes shut in, from the top of its hole, and once it has left the hole."""
BEHIND = 0.125  # diameters over the point at which a wall all round shows that it is in its hole
GUIDED = 0.5  # diameters over its point at which a wall all round guides a drill
INT = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class DrillLoads:
    """Findings of drills, and what they take for granted."""

    findings: list[Finding]
    assumed: list[Assumed]


def drill_loads(cuts: CutSequence, tools: Sequence[ToolBody], words: Mapping[int, CuttingWords], setup: ProofSetup,
                part: TriangleTree, threads: int = 2) -> DrillLoads:
    """Findings ``load`` of drills in their holes, one for each drill and fault.

    words  : by T number; part : TriangleTree, of the part

    Notes
    -----
    Flutes are shut in where their upper end is in stock all round. From there on chips have no way out. The way that a
    drill cuts so counts from where its tip was last out of its hole. If it then began to cut within its hole, it pecks.

    A drill with some of its core in air at its tip cuts with one side where one lip has more stock before it than the
    other, by b mm of radius, unless a wall all round its body guides it. The force on that lip, kc h^(-mc) f b, bends
    the bar of the drill [Kienzle1952] [Timoshenko1955]: f is the feed per tooth, h = f sin(half of the point angle).
    """
    out = DrillLoads([], [])
    for k, tool in enumerate(tools):
        rows = np.flatnonzero((cuts.moves.tool == k) & cuts.run.cut & cuts.moves.feed)
        if tool.named != "drill" or not len(rows):
            continue
        drill = _Drill(cuts, tools, k, setup, part, threads)
        said = words.get(tool.number)
        shut = drill.shut_in(rows)
        if shut is not None and (said is None or not said.flutes_given):
            out.assumed.append(Assumed(
                AssumedKind.FLUTE_LENGTH, f"T{tool.number}: flutes longer than {tool.flute_length:g} mm",
                "chips jam in flutes that end below the top of the hole", "flute_length_mm of the drill"))
        elif shut is not None:
            out.findings.append(shut)
        if said is not None and said.kc is not None and said.mc is not None:
            out.findings.extend(drill.one_sided(rows, said, said.kc, said.mc))
    return out


@dataclass(frozen=True, eq=False)
class _Drill:
    """One drill, the ``row``-th tool, among all moves."""

    cuts: CutSequence
    tools: Sequence[ToolBody]
    row: int
    setup: ProofSetup
    part: TriangleTree
    threads: int

    @property
    def tool(self) -> ToolBody:
        """The drill."""
        return self.tools[self.row]

    def shut_in(self, rows: INT) -> Finding | None:
        """The finding of the longest way that the drill cuts with its flutes shut in; rows : (r,) of its cuts."""
        moves, tool = self.cuts.moves, self.tool
        of, tips, up = self._along(rows)
        under = blank_holds(tips + tool.flute_length * up, up, self.part, self.setup)
        if not under.any():
            return None
        cutting = self._walls(tips, up, ON_LIPS[-1] * tool.cone_height, of, ON_LIPS[-1]).any(axis=1)
        shut = np.flatnonzero(under & cutting)
        shut = shut[self._walls(tips[shut], up[shut], tool.flute_length, of[shut]).all(axis=1)]
        long = np.zeros(len(moves))
        np.add.at(long, of[shut], self._steps(of)[shut])
        begun = np.flatnonzero(cutting)
        begun = begun[np.unique(of[begun], return_index=True)[1]]  # where each move begins to cut
        in_hole = np.zeros(len(moves), np.bool_)
        in_hole[of[begun]] = self._inside(tips[begun], up[begun], of[begun])
        own = np.flatnonzero(moves.tool == self.row)
        stays = self._inside(moves.end[own], self._up(own), own + 1)
        worst, found, total, pecks, fresh = 1.0, (-1, 0.0, 0.0), 0.0, False, True
        is_cut = np.isin(own, of[begun])
        for m, inside, cut in zip(own.tolist(), stays.tolist(), is_cut.tolist(), strict=True):
            pecks, fresh = (bool(in_hole[m]), False) if fresh and cut else (pecks, fresh)
            total += float(long[m])
            limit = (IN_A_PECK if pecks else IN_ONE_GO) * tool.diameter
            if long[m] > 0.0 and total > worst * limit:
                worst, found = total / limit, (m, total, limit)
            total, fresh = (total, fresh) if inside else (0.0, True)
        if found[0] < 0:
            return None
        return self._finding(*found, f"the drill goes on for {found[1]:.2f} mm while its flutes of "
                             f"{tool.flute_length:g} mm are shut in by its hole, so chips have no way out "
                             f"({found[2]:.2f} mm are allowed): lift it out of the hole between short pecks, or use a "
                             "drill with longer flutes")

    def one_sided(self, rows: INT, said: CuttingWords, kc: float, mc: float) -> Iterator[Finding]:
        """The finding of the place where one lip bends the drill most; rows : (r,) of its cuts."""
        tool, cuts = self.tool, self.cuts
        rows = rows[(cuts.speed[rows] > 0.0) & (cuts.feed[rows] > 0.0)]
        if not len(rows):
            return
        of, tips, up = self._along(rows)
        seated = self._stands(tips, up, of)
        seated[seated] = self._walls(tips[seated], up[seated], 0.0, of[seated], WEB).all(axis=1)
        of, tips, up = of[~seated], tips[~seated], up[~seated]
        if not len(of):
            return
        lips = np.stack([self._ring(tips, up, r * tool.radius, r * tool.cone_height) for r in ON_LIPS], axis=2)
        met = self._stands(lips.reshape(-1, 3), np.repeat(up, AROUND * len(ON_LIPS), axis=0),
                           np.repeat(of, AROUND * len(ON_LIPS))).reshape(len(of), AROUND, len(ON_LIPS))
        wide = met.mean(axis=2) * tool.radius
        more = np.abs(wide - np.roll(wide, AROUND // 2, axis=1)).max(axis=1)
        lone = np.flatnonzero(more > 0.0)
        lone = lone[~_all_round(self._walls(tips[lone], up[lone], tool.cone_height + GUIDED * tool.diameter, of[lone]))]
        if not len(lone):
            return
        f = cuts.feed[of[lone]] / (cuts.speed[of[lone]] * said.flutes)
        sine = math.sin(math.atan2(tool.radius, tool.cone_height))
        force = kc * (f * sine) ** (-mc) * f * more[lone]
        i = int(np.argmax(force))
        bend, limit = float(force[i]) * compliance(tool), BEND_TIMES * said.bend
        stress, strong = bending_stress(tool, float(force[i]), 0.0)
        if bend > limit or stress > strong:
            yield self._finding(int(of[lone[i]]), bend, limit, "the drill cuts with one side only, its core in air: "
                                f"{more[lone[i]]:.2f} mm of one lip push it aside with {force[i]:.0f} N and bend its "
                                f"tip by {bend:.3f} mm ({BEND_TIMES:g} times the limit is {limit:.3f} mm): mill that "
                                "place")

    def _along(self, rows: INT) -> tuple[INT, F64, F64]:
        """Places of the tip along moves, evenly: the move of each (p,), tips and axes (p, 3)."""
        moves = self.cuts.moves
        length = np.linalg.norm(moves.end[rows] - moves.start[rows], axis=1)
        count = np.ceil(length / (STEP * self.tool.diameter)).clip(LEAST, PLACES).astype(np.int64)
        of = np.repeat(rows, count)
        part = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + 1
        share = ((part - 0.5) / np.repeat(count, count))[:, None]
        return of, moves.start[of] + share * (moves.end[of] - moves.start[of]), self._up(of)

    def _up(self, rows: INT) -> F64:
        axes = self.cuts.moves.axes
        return np.tile([0.0, 0.0, 1.0], (len(rows), 1)) if axes is None else np.asarray(axes.axis[rows])

    def _ring(self, tips: F64, up: F64, radius: float, high: float) -> F64:
        """(p, AROUND, 3) float64, mm: places round the axes, ``high`` mm over the tips."""
        other = np.where(np.abs(up[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        u = np.cross(up, other)
        u /= np.linalg.norm(u, axis=1)[:, None]
        v, turn = np.cross(up, u), np.arange(AROUND) * (2.0 * math.pi / AROUND)
        round_ = np.cos(turn)[:, None] * u[:, None] + np.sin(turn)[:, None] * v[:, None]
        return np.asarray((tips + high * up)[:, None] + radius * round_)

    def _steps(self, of: INT) -> F64:
        """(p,) float64, mm: the way for which each place of ``_along`` stands."""
        moves = self.cuts.moves
        count = np.bincount(of, minlength=len(moves))
        return np.asarray(np.linalg.norm(moves.end[of] - moves.start[of], axis=1) / count[of])

    def _inside(self, tips: F64, up: F64, before: INT) -> NDArray[np.bool_]:
        """(p,) bool: whether walls stand all round the point before moves (p,)."""
        high = self.tool.cone_height + BEHIND * self.tool.diameter
        return np.asarray(self._walls(tips, up, high, before).all(axis=1))

    def _walls(self, tips: F64, up: F64, high: float, before: INT, wide: float = RING) -> NDArray[np.bool_]:
        """(p, AROUND) bool: whether stock stands ``wide`` radii beside the axis, ``high`` mm over the tip, before each
        move (p,)."""
        at = self._ring(tips, up, wide * self.tool.radius, high).reshape(-1, 3)
        return self._stands(at, np.repeat(up, AROUND, axis=0), np.repeat(before, AROUND)).reshape(len(tips), AROUND)

    def _stands(self, points: F64, up: F64, before: INT) -> NDArray[np.bool_]:
        """(p,) bool: whether places stand before moves."""
        out = np.zeros(len(points), np.bool_)
        rows = np.flatnonzero(blank_holds(points, up, self.part, self.setup))
        if len(rows):
            gone = first_below(points[rows], up[rows], np.full(len(rows), WITHIN), self.cuts.moves, self.tools,
                               threads=self.threads)
            out[rows] = (gone < 0) | (gone >= before[rows])
        return out

    def _finding(self, m: int, depth: float, limit: float, text: str) -> Finding:
        program, line = self.cuts.place(m)
        x, y, z = (round(float(v), 6) for v in self.cuts.moves.end[m])
        return Finding(FindingKind.LOAD, program, line, None, None, (x, y, z), depth, limit,
                       f"T{self.tool.number}: {text}", tip=(x, y, z))


def _all_round(walls: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(p,) bool: whether walls (p, AROUND) stand in every half of the directions."""
    half = AROUND // 2
    wrapped = np.concatenate([walls, walls[:, :half]], axis=1)
    return np.all([wrapped[:, k:k + half].any(axis=1) for k in range(AROUND)], axis=0)


__all__ = ["DrillLoads", "drill_loads"]
