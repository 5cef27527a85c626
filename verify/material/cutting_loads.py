"""Load on the tools in their cuts, held against physical bounds and against the words of tool and material.

Over a bound no cutter of the kind survives: finding ``load``. Between the recommendation and the bound: a caution.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from geometry.cutting_mechanics import (
    CHIP_SHARE,
    bending_stress,
    buckling,
    compliance,
    cutting_forces,
    cutting_powers,
    diameters_in_cut,
    drill_loads,
)
from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.checks.program_sequence import FramedProgram
from verify.cutting_words import CuttingWords, ProgramCaution
from verify.findings import Source
from verify.material.stock_pass import StockPass, parts
from verify.model import Finding, FindingKind
from verify.moves import Moves

DRILL_SHARE = 0.1
"""Feed of a drill in a turn over its diameter that it does not bear. Tables have up to 0.04 [ProtoCutter2026]."""
SPEED_TIMES = 30.0
"""Cutting speed over the recommended one that no cutter bears. High-speed cutting reaches 28 [Schulz1992]."""
TAP_SPEEDS = 0.4, 1.0
"""Cutting speed of a tap over that recommended for milling: a caution, and what no tap bears. Tables of taps have up to
0.2 [Lavallee2026]; the fastest in aluminium found went at 180 m/min, 0.72 [Agapiou1994]."""
RECOMMENDED_TIMES = 2.0
"""Chip and speed over the recommended ones that give a caution: the recommendations are deliberately low."""
BEND_TIMES = 10.0
"""Deflection over the limit that is a finding, as in a plan: the cut is not where it should be."""
FINEST, COARSEST = 0.01, 0.5
"""Pitch over the diameter outside of which there is no thread: the coarsest of ISO 261, M1 x 0.25, has a quarter, and
fine threads of 1 mm go up to 100 mm."""
PITCH_ERROR = 0.02
"""Share by which feed over speed of a tap may differ from its pitch: what a floating holder takes up."""
MAX_POWER, MAX_TORQUE, MAX_THRUST = 150.0, 3000.0, 50e3
"""kW, Nm and N that no machining centre has. Large ones for titanium have 60 kW [ModernMachineShop2026] and 2700 Nm
[CuttingTool2026]; the thrust is a guess of several times what feed drives give."""
POWER_TIMES = 2.0
"""Power of a cut over that of the machine that is a finding: spindles bear some overload, and the estimate errs."""
MIN_TAKEN = 0.25  # of the volume of a window, taken at a feed or faster, so that the feed counts for all of it
WINDOW, SPACINGS = 0.5, 4.0  # radii of way, and spacings of the stock, over which a cut is measured; the greater counts
DWELL_TURNS = 10.0  # turns of the spindle that a tool may stand in its cut: a spot face takes three
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class CutSequence:
    """The m moves of all programs with what they do in the stock.

    moves, source, run, first : of the proof; first part of each move, as ``verify.material.stock_pass.parts``
    stretches, of : the parts as moves, and (p,) int64, index, the move of each
    feed    : (m,) float64, mm/min of the fastest place of the flutes in the cut; 0 for rapids
    middle  : (m,) float64, mm/min half way up the cut; both are the feed of the tip where the tool does not swing
    speed   : (m,) float64, 1/min; coolant : (m,) bool
    minutes : (m,) float64, min, time of each move
    cutter  : (m,) int64, count of tool changes and stops before each move: a fresh cutter may be in the spindle
    dwells  : line, program, move before and s of each dwell, inf where the operator ends it
    spacing : mm, of the stock
    underside : mm, least Z of the part
    """

    moves: Moves
    source: Source
    run: StockPass
    first: NDArray[np.int64]
    stretches: Moves
    of: NDArray[np.int64]
    feed: F64
    middle: F64
    speed: F64
    coolant: NDArray[np.bool_]
    minutes: F64
    cutter: NDArray[np.int64]
    dwells: tuple[tuple[int, int, int, float], ...]
    spacing: float
    underside: float

    def place(self, m: int) -> tuple[str, int]:
        """Program and line of a move."""
        return self.source.names[self.source.program[m]], int(self.source.line[m])


def cut_sequence(read: Sequence[FramedProgram], known: NDArray[np.bool_], run: StockPass, moves: Moves, source: Source,
                 tools: Sequence[ToolBody], stretches: Moves, of: NDArray[np.int64], took: F64,
                 spacing: float, underside: float) -> CutSequence:
    """The moves of a proof with their feeds, speeds and times.

    known     : (n,) bool, which moves of the programs the proof counts
    stretches : (p,) parts of moves, as ``verify.material.engagement.in_parts``; of : (p,) int64, index, move of each
    took  : (m,) float64, min, time of each counted move; spacing : mm, of the stock
    underside : mm, least Z of the part
    """
    programs = [r.program for r in read]
    fast, middle = _lengths(moves, run.ways.of_moves(parts(moves, tools)).depth, tools)
    minutes = np.concatenate([np.zeros(0), *(p.minutes for p in programs)])[known]
    feed, half = (np.divide(length, minutes, out=np.zeros(len(moves)), where=moves.feed & (minutes > 0.0))
                  for length in (fast, middle))
    speed = np.concatenate([np.zeros(0), *(p.speed if len(p.speed) else np.zeros(len(p)) for p in programs)])[known]
    coolant = np.concatenate([np.zeros(0, np.bool_), *(p.coolant if len(p.coolant) else np.zeros(len(p), np.bool_)
                                                       for p in programs)])[known]
    changed, begun = [np.zeros(0, np.int64)], 0
    dwells: list[tuple[int, int, int, float]] = []
    row = np.cumsum(known) - 1  # the last counted move up to each move of the programs
    for k, p in enumerate(programs):
        stops = np.zeros(len(p) + 1, np.int64)
        np.add.at(stops, [s.moves for s in p.pauses if s.event in ("tool change", "M0")], 1)
        changed.append(np.cumsum(stops[:-1]) + (changed[-1][-1] + 1 if len(changed[-1]) else 0))
        waits = [(s.line, s.moves, math.inf) for s in p.pauses if s.event in ("M0", "M1")]
        dwells.extend((line, k, int(row[begun + before - 1]), seconds) for line, before, seconds in (*p.dwells, *waits)
                      if before > 0 and row[begun + before - 1] >= 0)
        begun += len(p)
    return CutSequence(moves, source, run, parts(moves, tools), stretches, of, feed, half, speed, coolant,
                       took, np.concatenate(changed)[known], tuple(dwells), spacing, underside)


def _lengths(moves: Moves, depth: F64, tools: Sequence[ToolBody]) -> tuple[F64, F64]:
    """Ways of the places of cutters in their cuts.

    depth : (m,) float64, mm, of the cut of each move

    Returns two (m,) float64, mm: the longest of those of the tip, of the axis at the height ``depth``, and of the rim
    of a flat end; and that of the axis half way up.
    """
    way, axes = moves.end - moves.start, moves.axes
    tip = np.linalg.norm(way, axis=1)
    if axes is None:
        return tip, tip
    sizes = np.array([(t.flute_length, t.flat_radius) for t in tools]).reshape(-1, 2)[moves.tool]
    swing = axes.swing * np.minimum(depth, sizes[:, 0])[:, None]
    rim = (axes.angle * sizes[:, 1])[:, None] * axes.middle
    ways = [np.linalg.norm(way + more, axis=1) for more in (swing, rim, -rim, 0.5 * swing)]
    return np.maximum.reduce([tip, *ways[:3]]), ways[3]


def _fastest(volume: F64, feed: F64, at: NDArray[np.int64]) -> NDArray[np.int64]:
    """The stretch of each window whose feed counts: the fastest of those that took ``MIN_TAKEN`` of its volume.

    volume, feed : (p,) float64, mm³ and mm/min, of stretches
    at           : (w,) int64, first stretch of each window

    Returns (w,) int64, index: stretches at the feed of this one or faster took the share.
    """
    window = np.repeat(np.arange(len(at)), np.diff(np.r_[at, len(volume)]))
    order = np.lexsort((-feed, window))
    taken = np.cumsum(volume[order])
    before = np.r_[0.0, taken][at]
    enough = taken - before[window] >= MIN_TAKEN * np.add.reduceat(volume, at)[window] - 1e-12
    return order[np.minimum.reduceat(np.where(enough, np.arange(len(volume)), len(volume) - 1), at)]


def loads(cuts: CutSequence, tools: Sequence[ToolBody], words: Mapping[int, CuttingWords],
          tapped: NDArray[np.bool_]) -> tuple[list[Finding], list[ProgramCaution]]:
    """Findings of loads that no cutter bears, and cautions where a program exceeds its tools' words, tool by tool.

    words   : by T number; a tool that is absent is not judged
    tapped  : (m,) bool, moves on which a tap cuts or is in its hole; it is judged by speed and by feed over speed only

    Notes
    -----
    Depth and width of a cut are measured on the stock over ``WINDOW`` of the radius: the depth a is the highest stock
    over the tip that went, the width V / (L a), known to one spacing of the stock. L and the feed are those half way up
    the cut, where the tool swings. Of moves that share a window the fastest feed at which a quarter of V was taken
    counts. The feed per tooth is that of the fastest place in the cut. Force, deflection and stress follow from them
    [Kienzle1952] [Timoshenko1955]. Ways down steeper than 45 degrees have no such force; of a way up, L and the feed
    are the shares square to the tool axis.
    """
    findings: list[Finding] = []
    cautions: list[ProgramCaution] = []
    ways = cuts.run.ways.of_moves(cuts.first)
    for k, tool in enumerate(tools):
        said, tap = words.get(tool.number), tool.named == "tap"
        met = (tapped if tap else cuts.run.cut) & cuts.moves.feed
        rows = np.flatnonzero((cuts.moves.tool == k) & met & (cuts.feed > 0.0))
        if said is None or not len(rows):
            continue
        judge = _Judge(cuts, tool, said, rows)
        if tap:
            found, caution = judge.speeds(np.full(len(cuts.moves), tool.flute_length))
            findings.extend([*judge.threads(), *found])
            cautions.extend(caution)
            continue
        for found, caution in (judge.chips(), judge.speeds(ways.depth), judge.forces(k)):
            findings.extend(found)
            cautions.extend(caution)
        cautions.extend(judge.stated())
        cautions.extend(judge.descents())
        cautions.extend(judge.standing())
    return findings, cautions


Judged = tuple[list[Finding], list[ProgramCaution]]


@dataclass(frozen=True, eq=False)
class _Judge:
    """One tool: its moves in the cut, ``rows`` (r,) int64, index."""

    cuts: CutSequence
    tool: ToolBody
    said: CuttingWords
    rows: NDArray[np.int64]

    def chips(self) -> Judged:
        """Feed per tooth; a chamfer mill that goes straight down drills."""
        rows = self.rows[self.cuts.speed[self.rows] > 0.0]
        drills = np.full(len(rows), self.tool.named == "drill")
        if self.tool.named == "chamfer":
            drills = self._rise(rows) < -math.sqrt(0.5)
        down = self._chips(rows[drills], DRILL_SHARE * self.tool.diameter / self.said.flutes,
                           "a tenth of the diameter in a turn, is more than any drill bears")
        aside = self._chips(rows[~drills], CHIP_SHARE * self.tool.diameter,
                            "a fifth of the diameter, is more than any cutter bears")
        return [*down[0], *aside[0]], [*down[1], *aside[1]]

    def _chips(self, rows: NDArray[np.int64], bound: float, share: str) -> Judged:
        """Feed per tooth of moves against a bound in mm and its words."""
        per_tooth = self.cuts.feed[rows] / (self.cuts.speed[rows] * self.said.flutes)
        wanted = RECOMMENDED_TIMES * self.said.per_tooth

        def text(value: float, i: int) -> str:
            return (f"T{self.tool.number}: the feed per tooth is {value:.3f} mm at F{self.cuts.feed[rows[i]]:.6g} "
                    f"S{self.cuts.speed[rows[i]]:g} with {self.said.flutes} teeth{self._swung(rows[i])}")
        return self._over(rows, per_tooth, bound, wanted, "chip_load", text,
                          f"{bound:.3f} mm, {share}",
                          f"recommended are {self.said.per_tooth:.3f} mm", "feed slower or turn faster",
                          self.said.per_tooth)

    def _swung(self, m: int) -> str:
        """Words for a move on which the tool swings, so that the feed of its flank is not that of the program."""
        axes = self.cuts.moves.axes
        return ", where its edge is fastest as it swings" if axes is not None and axes.angle[m] > 0.0 else ""

    def speeds(self, depth: F64) -> Judged:
        """Cutting speed at the largest diameter in the cut; depth : (m,) mm.

        Where an upright cone or barrel hangs below the part, it cuts as much higher over its tip.
        """
        rows, moves = self.rows[self.cuts.speed[self.rows] > 0.0], self.cuts.moves
        high = depth[rows]
        if (self.tool.taper > 0.0 or self.tool.arcs is not None) and moves.axes is None:
            low = np.minimum(moves.start[rows, 2], moves.end[rows, 2])
            high = high + np.maximum(self.cuts.underside - low, 0.0) * (high > 0.0)
        speed = math.pi * diameters_in_cut(self.tool, high) * self.cuts.speed[rows] / 1000.0
        bound, wanted = SPEED_TIMES * self.said.speed, RECOMMENDED_TIMES * self.said.speed
        kind, advised = "cutter", f"recommended are {self.said.speed:g} m/min"
        if self.tool.named == "tap":
            wanted, bound = (times * self.said.speed for times in TAP_SPEEDS)
            kind, advised = "tap", f"taps go at {0.5 * wanted:.3g} m/min at most by usual tables"

        def text(value: float, i: int) -> str:
            return f"T{self.tool.number}: cuts at {value:.0f} m/min with S{self.cuts.speed[rows[i]]:g}"
        return self._over(rows, speed, bound, wanted, "cutting_speed", text,
                          f"{bound:.0f} m/min is more than any {kind} bears in this material", advised, "turn slower",
                          0.5 * wanted)

    def threads(self) -> Iterator[Finding]:
        """Feed over speed of a tap: its pitch."""
        rows = self.rows[self.cuts.speed[self.rows] > 0.0]
        if not len(rows):
            return
        pitch, size = self.said.pitch, self.tool.diameter
        low, high = FINEST * size, COARSEST * size
        a_turn = self.cuts.feed[rows] / self.cuts.speed[rows]
        if pitch is None and low <= a_turn.min() and a_turn.max() <= high:
            pitch = float(a_turn[0])  # one tap has one pitch
        if pitch is not None:
            low, high = (1.0 - PITCH_ERROR) * pitch, (1.0 + PITCH_ERROR) * pitch
        off = np.maximum(a_turn / high, low / a_turn)
        worst = int(np.argmax(off))
        if off[worst] <= 1.0 + ROUNDING:
            return
        m, most = int(rows[worst]), float(a_turn[worst])
        program, line = self.cuts.place(m)
        x, y, z = (round(float(v), 6) for v in self.cuts.moves.end[m])
        why = f"threads of {size:g} mm have pitches of {low:.3g} to {high:.3g} mm"
        if pitch is not None:
            why = f"its pitch is {pitch:.4g} mm" if self.said.pitch is not None else \
                f"at first it goes {pitch:.4g} mm a turn, and a tap has one pitch"
        yield Finding(FindingKind.LOAD, program, line, None, None, (x, y, z), most, high if most > high else low,
                      f"T{self.tool.number}: the tap goes {most:.3f} mm a turn at F{self.cuts.feed[m]:.6g} "
                      f"S{self.cuts.speed[m]:g}; {why}: the feed is pitch times spindle speed",
                      int((off > 1.0 + ROUNDING).sum()), tip=(x, y, z))

    def forces(self, k: int) -> Judged:
        """Depth and width of cut, deflection of the tip and stress in the tool; k : its place among the tools."""
        cuts, tool, said = self.cuts, self.tool, self.said
        if tool.along_axis_only:
            return self._drilling()
        last, aside, depth, section = self._sections(k)
        _, cautions = self._over(last, section, math.inf, said.section, "depth_of_cut", lambda value, i:
                                 f"T{tool.number}: depth times width of its cut are {value:.1f} mm²", "",
                                 f"recommended are {said.section:.1f} mm²", "cut in layers, or in narrower steps")
        per_tooth = np.divide(cuts.middle[last] * aside, cuts.speed[last] * said.flutes, out=np.full(len(last), np.inf),
                              where=cuts.speed[last] > 0.0)
        # a chip that no tooth can bear is a finding of its own, and no formula holds for it
        turns = per_tooth <= CHIP_SHARE * tool.diameter
        last, depth, section = last[turns], depth[turns], section[turns]
        if said.kc is None or said.mc is None or not len(last):
            return [], cautions
        width = section / depth
        soft = compliance(tool)
        bend = cutting_forces(said.kc, said.mc, per_tooth[turns], depth, width, tool, said.flutes) * soft
        # the stock shows a width to one spacing: a finding holds for the least
        sure = np.maximum(width - cuts.spacing, 1e-9)
        force = cutting_forces(said.kc, said.mc, per_tooth[turns], depth, sure, tool, said.flutes)
        stress, strong = np.array([bending_stress(tool, *pair) for pair in zip(force.tolist(), depth.tolist(),
                                                                               strict=True)]).T

        def cut(i: int) -> str:
            return (f"T{tool.number}: its cut of {depth[i]:.2f} mm depth and {width[i]:.2f} mm width at "
                    f"F{cuts.feed[last[i]]:.6g}")
        findings, _ = self._over(last, stress / strong, 1.0, math.inf, "load", lambda share, i:
                                 f"{cut(i)} bends it with {share * strong[i]:.0f} N/mm²",
                                 "cemented carbide of that diameter breaks", "", "cut in layers or feed slower")
        limit = float(strong[int(np.argmax(stress / strong))])
        findings = [replace(f, depth=f.depth * limit, limit=limit) for f in findings]
        advice = "cut in layers, feed slower, or use a shorter or thicker tool"

        def text(value: float, i: int) -> str:
            return f"{cut(i)} would bend its tip by {value:.3f} mm"
        far, _ = self._over(last, force * soft, BEND_TIMES * said.bend, math.inf, "load", text,
                            f"{BEND_TIMES:g} times the limit of {said.bend:.3f} mm is {BEND_TIMES * said.bend:.3f} mm",
                            "", advice)
        _, bent = self._over(last, bend, math.inf, said.bend, "deflection", text, "", f"limit {said.bend:.3f} mm",
                             advice)
        turning = force * 0.5e-3 * diameters_in_cut(tool, depth)
        power = cutting_powers(said.kc, said.mc, per_tooth[turns], depth, sure, cuts.middle[last] * aside[turns], tool)
        heavy, weak = self._machine(last, turning, power, np.zeros(len(last)), cut)
        over = findings or far
        return [*(over or heavy)], [*cautions, *bent, *weak]

    def _drilling(self) -> Judged:
        """Torque, power and thrust of a drill, and the thrust at which it buckles."""
        cuts, said = self.cuts, self.said
        rows = self.rows[cuts.speed[self.rows] > 0.0]
        if said.kc is None or said.mc is None or not len(rows):
            return [], []
        torque, thrust = np.array([drill_loads(said.kc, said.mc, a_turn, self.tool, said.flutes)
                                   for a_turn in (cuts.feed[rows] / cuts.speed[rows]).tolist()]).T
        def drill(i: int) -> str:
            return f"T{self.tool.number}: the drill at F{cuts.feed[rows[i]]:.6g} S{cuts.speed[rows[i]]:g}"
        findings, cautions = self._machine(rows, torque, torque * cuts.speed[rows] * math.pi / 30e3, thrust, drill)
        bound = buckling(self.tool)
        slim, _ = self._over(rows, thrust, bound, math.inf, "load", lambda value, i: f"{drill(i)} needs {value:.0f} N",
                             f"it buckles at {bound:.0f} N, its tip guided", "", "feed slower, or use a shorter drill")
        return findings or slim, cautions

    def _machine(self, rows: NDArray[np.int64], torque: F64, power: F64, thrust: F64,
                 cut: Callable[[int], str]) -> Judged:
        """What cuts ask of a machine: torque in Nm, power in kW and thrust in N of each row."""
        findings: list[Finding] = []
        stated, cautions = self.said.power, list[ProgramCaution]()
        bound = MAX_POWER if stated is None else min(POWER_TIMES * stated, MAX_POWER)
        why = "more than any machine has" if stated is None else f"max_power_kw of the machine is {stated:g}"
        for value, most, wanted, unit, text in (
                (power, bound, math.inf if stated is None else stated, "kW", why),
                (torque, MAX_TORQUE, math.inf, "Nm", "more than any spindle has"),
                (thrust, MAX_THRUST, math.inf, "N", "more than any machine bears")):
            found, told = self._over(rows, value, most, wanted, "power",
                                     partial(lambda unit, value, i: f"{cut(i)} needs {value:.0f} {unit}", unit), text,
                                     why, "cut in layers, narrower or slower")
            findings.extend(found[:not findings])
            cautions.extend(told)
        return findings, cautions

    def _sections(self, k: int) -> tuple[NDArray[np.int64], F64, F64, F64]:
        """Cuts by windows of way: fastest move, its share square to the axis, depth in mm, depth times width in mm²."""
        cuts, tool = self.cuts, self.tool
        way = cuts.stretches.end - cuts.stretches.start
        if cuts.moves.axes is not None:
            up_half = 0.5 * np.minimum(cuts.run.ways.depth, tool.flute_length) / np.diff(cuts.first)[cuts.of]
            way = way + up_half[:, None] * cuts.moves.axes.swing[cuts.of]
        up = np.tile([0.0, 0.0, 1.0], (len(way), 1)) if cuts.moves.axes is None else cuts.moves.axes.middle[cuts.of]
        whole, rise = np.linalg.norm(way, axis=1), np.einsum("ij,ij->i", way, up)
        length = np.where(rise > 0.0, np.sqrt(np.maximum(whole * whole - rise * rise, 0.0)), whole)
        sideways = (rise >= -math.sqrt(0.5) * whole) & (length > ROUNDING * whole)
        own = np.flatnonzero(cuts.stretches.feed & (cuts.stretches.tool == k) & sideways)
        if not len(own):
            return np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0)
        window = max(WINDOW * tool.radius, SPACINGS * cuts.spacing)
        begun = np.cumsum(length[own]) - length[own]
        new = np.r_[True, (np.diff(own) != 1) | (np.diff(np.floor(begun / window)) != 0.0)]
        at = np.flatnonzero(new)
        volume = np.add.reduceat(cuts.run.ways.volume[own], at)
        depth = np.minimum(np.maximum.reduceat(cuts.run.ways.depth[own], at), tool.flute_length)
        long = np.maximum(np.add.reduceat(length[own], at), SPACINGS * cuts.spacing)
        end = own[_fastest(cuts.run.ways.volume[own], cuts.middle[cuts.of[own]], at)]
        cut = (volume > 0.0) & (depth > ROUNDING)
        wide = np.maximum(diameters_in_cut(tool, depth[cut]), tool.diameter)
        section = np.minimum(volume[cut] / long[cut], wide * depth[cut])
        return cuts.of[end[cut]], (length[end] / whole[end])[cut], depth[cut], section

    def stated(self) -> Iterator[ProgramCaution]:
        """Speed, feed, plunge feed, life and coolant, as the tool states them."""
        cuts, said, rows = self.cuts, self.said, self.rows
        down = np.maximum(-self._rise(rows), 0.0)
        for field, value, limit, unit in (("spindle_rpm", cuts.speed[rows], said.rpm, "1/min"),
                                          ("feed_mm_min", cuts.feed[rows], said.feed, "mm/min"),
                                          ("plunge_feed_mm_min", cuts.feed[rows] * down, said.plunge_feed, "mm/min")):
            if limit is not None:
                over = f"T{self.tool.number}: its {field} is exceeded"
                yield from self._over(rows, value, math.inf, limit, "tool_data",
                                      partial("{0}: {2:.6g} {1}".format, over, unit), "",
                                      f"the tool states {limit:g}", "keep to the figure of the tool, or correct it")[1]
        if said.life is not None:
            cutter, of = np.unique(cuts.cutter[rows], return_inverse=True)
            minutes = np.bincount(of.reshape(-1), cuts.minutes[rows], len(cutter))
            worst = int(np.argmax(minutes))
            mine = rows[of.reshape(-1) == worst]
            if minutes[worst] > said.life * (1.0 + ROUNDING):
                spent = np.cumsum(cuts.minutes[mine])
                m = int(mine[min(int(np.searchsorted(spent, said.life)), len(mine) - 1)])
                yield self._caution("tool_data", m, f"T{self.tool.number}: is in the cut for {minutes[worst]:.3g} min "
                                    f"without a change; its life_min is {said.life:g}", float(minutes[worst]),
                                    said.life, "change the cutter before, or correct its life")
        if said.coolant:
            dry = rows[~cuts.coolant[rows]]
            if len(dry):
                long = float(np.linalg.norm(cuts.moves.end[dry] - cuts.moves.start[dry], axis=1).sum())
                yield self._caution("coolant", int(dry[0]), f"T{self.tool.number}: cuts {long:.0f} mm dry; the tool "
                                    "states coolant", long, 0.0, "turn the coolant on (M8)")

    def descents(self) -> Iterator[ProgramCaution]:
        """Feed of steep ways down in stock, where the tool states no plunge feed and is no drill."""
        cuts, said = self.cuts, self.said
        rows = self.rows[(cuts.speed[self.rows] > 0.0) & (self._rise(self.rows) < -math.sqrt(0.5))]
        if said.plunge_feed is None and not self.tool.cuts_down:
            per_tooth = cuts.feed[rows] / (cuts.speed[rows] * said.flutes)
            yield from self._over(rows, per_tooth, math.inf, said.per_tooth, "plunge_feed", lambda value, i: (
                f"T{self.tool.number}: goes down into stock at F{cuts.feed[rows[i]]:.6g}, {value:.3f} mm a tooth"), "",
                f"recommended are {said.per_tooth:.3f} mm at most, in the cut", "go down slower")[1]

    def standing(self) -> Iterator[ProgramCaution]:
        """Dwells at the end of a cut."""
        cuts, mine = self.cuts, set(self.rows.tolist())
        for line, program, before, seconds in cuts.dwells:
            if before in mine and math.isinf(seconds):
                yield ProgramCaution("dwell", self.tool.number, cuts.source.names[program], line,
                                     f"T{self.tool.number}: stands in its cut until the operator goes on",
                                     float(cuts.speed[before]), 0.0, "lift the tool before the program stops")
                continue
            turns = seconds * cuts.speed[before] / 60.0
            if before in mine and turns > DWELL_TURNS:
                yield ProgramCaution("dwell", self.tool.number, cuts.source.names[program], line,
                                     f"T{self.tool.number}: stands in its cut for {seconds:g} s, {turns:.0f} turns",
                                     float(turns), DWELL_TURNS, "lift the tool before it waits")

    def _rise(self, rows: NDArray[np.int64]) -> F64:
        """Sine of the slope of moves along the tool axis."""
        way = self.cuts.moves.end[rows] - self.cuts.moves.start[rows]
        up = np.array([0.0, 0.0, 1.0]) if self.cuts.moves.axes is None else self.cuts.moves.axes.middle[rows]
        return np.asarray((way * up).sum(axis=1) / np.maximum(np.linalg.norm(way, axis=1), 1e-12))

    def _over(self, rows: NDArray[np.int64], value: F64, bound: float, wanted: float, kind: str,
              text: Callable[[float, int], str], why: str, advice: str, remedy: str,
              limit: float | None = None) -> Judged:
        """A finding for the largest value over the bound, else a caution for one over the wanted value.

        text : gives the sentence of a value and its place in ``rows``; limit : of the caution, ``wanted`` where None
        """
        if not len(rows) or value.max() <= min(bound, wanted) * (1.0 + ROUNDING):
            return [], []
        worst = int(np.flatnonzero(value >= value.max() * (1.0 - ROUNDING))[0])
        m, most = int(rows[worst]), float(value[worst])
        if most <= bound * (1.0 + ROUNDING):
            return [], [self._caution(kind, m, f"{text(most, worst)}; {advice}", most,
                                      wanted if limit is None else limit, remedy)]
        program, line = self.cuts.place(m)
        x, y, z = (round(float(v), 6) for v in self.cuts.moves.end[m])
        over = rows[value > bound * (1.0 + ROUNDING)]
        return [Finding(FindingKind.LOAD, program, line, None, None, (x, y, z), most, bound,
                        f"{text(most, worst)}; {why}: {remedy}", len(over), tip=(x, y, z))], []

    def _caution(self, kind: str, m: int, message: str, measured: float, limit: float, remedy: str) -> ProgramCaution:
        program, line = self.cuts.place(m)
        return ProgramCaution(kind, self.tool.number, program, line, f"{message} (line {line})", measured, limit,
                              remedy)


__all__ = ["CutSequence", "cut_sequence", "loads"]
