"""What programs leave open, and what the proof takes them to mean: the path of rapids, the path mode.

Arrays are float64, mm, frame of the program.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.assumptions import Assumed, AssumedKind
from verify.checks.clear_height import top_of_all
from verify.checks.machine_limits import joints_of, low_places
from verify.checks.program_sequence import FramedProgram
from verify.gcode.dialects import LINUXCNC, OWN_SPEED_RAPIDS
from verify.model import Finding, FindingKind, ProofSetup
from verify.program.move_kinds import FEED
from verify.program.program import Program

HALF_A_TURN = 180.0 + 1e-6  # deg, rounding included
STILL = 1e-9  # mm or rad: less is rounding
FREE_PATH = Assumed(AssumedKind.PATH_MODE, "the written path",
                    "parameters of the control decide how far it rounds corners; the error bound leaves that out",
                    "state an exact stop (G61, G60) or a tolerance (G187 E, G641 ADIS, CYCLE832, cycle 32) before the "
                    "first feed move")
"""That no word of a program bounds how far the control leaves its path."""


def rapids_decided(read: Sequence[FramedProgram], setup: ProofSetup) -> tuple[list[FramedProgram], ProofSetup]:
    """Programs and setup with the path of rapids by dialect, where the setup does not state one.

    Tool centre point control needs straight rapids (on Fanuc parameter 1401#1 LRP 1), so programs that turn rotary axes
    count as run on a control that is set so. A word of the program (RTLIOF of Siemens) counts before the setup.
    """
    told = any(r.program.own_speed for r in read)
    if setup.dogleg is not None and (setup.dogleg or not told):
        return list(read), setup
    own = told or any(r.program.dialect in OWN_SPEED_RAPIDS and r.program.poses is None for r in read)
    return [replace(r, setup=replace(r.setup, dogleg=own)) for r in read], replace(setup, dogleg=own)


def program_assumptions(read: Sequence[FramedProgram], tools: Sequence[ToolBody], setup: ProofSetup,
                        stated: bool) -> Iterator[Assumed]:
    """What the programs of a proof leave open.

    setup  : with the path of rapids decided
    stated : whether the setup states that path
    """
    if not stated and any(_several_axes(r, tools).any() for r in read):
        if setup.dogleg:
            yield Assumed(AssumedKind.RAPID_PATH, "dogleg", "none: a straight path lies in the box of the axes, which "
                          "the proof has kept clear", "state machine.rapid_motion")
        else:
            yield Assumed(AssumedKind.RAPID_PATH, "linear", "where each axis moves at its own speed, a rapid of "
                          "several axes takes another path", "state machine.rapid_motion")
    for r in read:
        yield from r.program.open
        yield from long_turns(r.program, r.setup)
    if any(r.program.unbounded for r in read):
        yield FREE_PATH


def untold_axes(read: Sequence[FramedProgram], known: NDArray[np.bool_],
                cut: NDArray[np.bool_]) -> tuple[list[Finding], list[Assumed]]:
    """Rotary axes whose angle a program does not state before its first cut.

    known : (n,) bool, which moves of the programs the proof counts; cut : (m,) bool, which of these remove stock

    Where the program leaves such an axis off 0, the next run begins there: a finding. Else 0 is taken for granted.
    """
    found, taken, cuts = [], [], np.zeros(len(known), np.bool_)
    cuts[np.flatnonzero(known)[cut]] = True
    begun = 0
    for p in (r.program for r in read):
        own = cuts[begun:begun + len(p)]
        begun += len(p)
        untold = [s for s in p.starts if own.any() and s.moves > int(np.argmax(own))]
        if not untold:
            continue
        letters = ", ".join(s.letter for s in untold)
        left = [f"{s.letter}{s.end:g}" for s in untold if abs(math.remainder(s.end, 360.0)) > STILL]
        if left:
            found.append(Finding(FindingKind.PROGRAM, p.name, int(p.line[-1]), None, None, None, 0.0, 0.0, (
                f"the program does not state {letters} before its first cut and ends at {', '.join(left)}: the next "
                "run begins there; turn the axes before the first cut")))
        taken.append(Assumed(AssumedKind.ROTARY_START, ", ".join(f"{s.letter}0" for s in untold),
                             "where an axis stands elsewhere, the program cuts a part that is turned",
                             "turn the rotary axes before the first cut"))
    return found, taken


def long_turns(p: Program, setup: ProofSetup) -> Iterator[Assumed]:
    """Absolute words that turn an axis by over half a turn, on controls that may count it from 0 to 360 deg.

    Words that state the way themselves (increments, DC, ACP, ACN) leave nothing open.
    """
    if p.poses is None or setup.kinematics is None or p.dialect == LINUXCNC or not len(p):
        return
    first = np.flatnonzero(np.r_[True, p.line[1:] != p.line[:-1]])
    last = np.r_[first[1:], len(p)] - 1
    turned = np.degrees(p.poses.end_turn[last] - p.poses.start_turn[first])
    rows, axes = np.nonzero((np.abs(turned) > HALF_A_TURN) & ~np.isin(p.line[first], sorted(p.ways_told))[:, None])
    if len(rows):
        way, letter = float(turned[rows[0], axes[0]]), setup.kinematics.letters[axes[0]]
        more = f" (and {len(rows) - 1} more such blocks)" if len(rows) > 1 else ""
        yield Assumed(AssumedKind.ROTARY_WAY, f"{p.name}, line {p.line[first[rows[0]]]} turns {letter} by {way:g} "
                      f"deg{more}", f"a machine that counts the axis from 0 to 360 deg may turn it by "
                      f"{math.remainder(way, 360.0):g}, or by the sign of its word, through part or fixture",
                      "turn by 180 deg at most in a block, or state the way (DC, ACP, ACN, increments)")


def _several_axes(r: FramedProgram, tools: Sequence[ToolBody]) -> NDArray[np.bool_]:
    """(m,) rapids of a program that move several axes at once and are not above everything."""
    p = r.program
    start, end = joints_of(p, r.setup) or (p.start, p.end)
    several: F64 = (np.abs(end - start) > STILL).sum(axis=1)
    if p.poses is not None:
        several = several + (np.abs(p.poses.end_turn - p.poses.start_turn) > STILL).sum(axis=1)
    clear = top_of_all(r.bounds, r.setup) + r.setup.clearance_rapid - 1e-6
    return np.asarray((p.kind != FEED) & (several > 1) & (low_places(p, tools, r.setup) < clear))


__all__ = ["FREE_PATH", "long_turns", "program_assumptions", "rapids_decided", "untold_axes"]
