"""What programs leave open, and what the proof takes them to mean: the path of rapids, the path mode.

Arrays are float64, mm, frame of the program.
"""

from __future__ import annotations

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
from verify.gcode.dialects import OWN_SPEED_RAPIDS
from verify.model import ProofSetup
from verify.program.move_kinds import FEED

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
    if any(r.program.unbounded for r in read):
        yield FREE_PATH


def _several_axes(r: FramedProgram, tools: Sequence[ToolBody]) -> NDArray[np.bool_]:
    """(m,) rapids of a program that move several axes at once and are not above everything."""
    p = r.program
    start, end = joints_of(p, r.setup) or (p.start, p.end)
    several: F64 = (np.abs(end - start) > STILL).sum(axis=1)
    if p.poses is not None:
        several = several + (np.abs(p.poses.end_turn - p.poses.start_turn) > STILL).sum(axis=1)
    clear = top_of_all(r.bounds, r.setup) + r.setup.clearance_rapid - 1e-6
    return np.asarray((p.kind != FEED) & (several > 1) & (low_places(p, tools, r.setup) < clear))


__all__ = ["FREE_PATH", "program_assumptions", "rapids_decided"]
