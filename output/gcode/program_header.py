"""The header of a program: what the machinist has to know and to set before it runs, as comments."""

from __future__ import annotations

import itertools

import numpy as np

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from output.gcode.dialects.base import Dialect
from output.header_text import decimal, tool_name
from output.workplan import Clamping, Workplan

GRANTED = "Taken for granted by the proof, check it on the machine:"
MIN_DEPTH_BELOW_STOCK = 0.01  # mm below the stock; less is not mentioned


def header_lines(plan: Workplan, d: Dialect, zero: str, tolerance: str) -> list[str]:
    """The comments before the first block.

    plan      : lengths in mm
    d         : dialect of the control
    zero      : word of the work offset
    tolerance : mm, path tolerance
    """
    low, high = plan.stock.lower, plan.stock.upper
    box = ", ".join(f"{a} {decimal(low[i], 3)} to {decimal(high[i], 3)}" for i, a in enumerate("XYZ"))
    restart = ["Every step can be started at its label: tool, length, zero, speed and coolant stand there",
               "Start at a label only when all steps before it have been cut: no way was proved through their stock"]
    texts = [
        f"Program {plan.name}, zonemill {plan.version}, {d.title}, {_axes_words(plan)}",
        f"Part sha256 {plan.part_sha256}",
        f"Setup sha256 {plan.setup_sha256}",
        *plan.figures,
        *(f"Label {key}: {value}" for key, value in sorted(plan.labels.items())),
        f"Material {plan.material}",
        f"Units mm and mm/min. Work offset {zero}. Program zero is the origin of the setup frame",
        f"XYZ is the tool tip{_only_at_zero(plan)}: set every tool length in the tool table, {d.length_words}",
        f"Stock box {box}",
        *_heights(plan, d),
        *(restart if plan.restart else ()),
        d.path(tolerance),
        *d.needs,
        *(d.needs_restart if plan.restart and plan.clamping is None else ()),
        *(d.needs_jumps if plan.restart and _keeps_tools(plan) else ()),
        "Tools, all lengths in mm from the tip:",
        *(tool_name(t) for t in _tools_in_use(plan)),
        *([GRANTED, *plan.assumed] if plan.assumed else ()),
        *plan.comments,
    ]
    return [line for text in texts for line in d.comment(text)]


def _keeps_tools(plan: Workplan) -> bool:
    """Whether a step goes on with the tool of the step before."""
    return any(a.tool == b.tool and not b.fresh for a, b in itertools.pairwise(plan.steps))


def _axes_words(plan: Workplan) -> str:
    return "3 axes" if plan.clamping is None else f"5 axes {plan.clamping.machine.kind}"


def _only_at_zero(plan: Workplan) -> str:
    return "" if plan.clamping is None or plan.clamping.machine.tcp else " at zero of the rotary axes only"


def _heights(plan: Workplan, d: Dialect) -> list[str]:
    """Header lines: where rapids are free, how deep the tip goes, and the clamping of a machine with rotary axes."""
    c = plan.clamping
    if c is None:
        return [f"Clearance plane Z {decimal(plan.clearance_plane, 3)}: above it rapids in XY are free", _lowest(plan)]
    x, y, z = c.centre.tolist()
    ball = f"({decimal(x, 3)}, {decimal(y, 3)}, {decimal(z, 3)}), radius {decimal(c.radius, 3)}"
    out = [f"Part, stock and fixtures lie in the ball round {ball}: the tool turns outside it", _lowest(plan),
           *(f"Access {name}, tool axis " + " ".join(decimal(v, 6) for v in f.rotation[2].tolist()) + ": "
             + " ".join(f"{letter}{decimal(float(np.degrees(v)), 4)}" for letter, v in
                        zip(c.machine.letters, c.machine.words(c.machine.follow(f.rotation[2:], np.zeros(2))[0]),
                            strict=True))
             + ", or tilted the other way with C half a turn on; and whole turns of C" for name, f in c.frames.items()),
           *_table_axes(c)]
    if c.machine.tcp:
        return [*out, d.tcp_words]
    pivots = "; ".join(" ".join(decimal(v, 4) for v in p) for p in c.machine.pivots or ())
    long = ", ".join(f"T{n} {decimal(g, 4)}" for n, g in sorted(c.gauges.items()))
    head = f" and gauge lengths {long}" if c.machine.tilts_head else ""
    return [*out, "XYZ are linear joints where rotary axes stand off 0",
            f"Made only for pivots {pivots} mm{head}"]


def _table_axes(c: Clamping) -> list[str]:
    """Header line: which way a positive angle turns the table. A reader of the program may rely on its words."""
    letters = {"table-table": c.machine.letters, "head-table": "C"}.get(c.machine.kind[:-3], "")
    words = [f"{letter} {'right-handed' if sense > 0 else 'ISO 841'}"
             for letter, sense in zip(c.machine.letters, c.machine.sense, strict=True) if letter in letters]
    return [f"Table axes: {', '.join(words)}"] if words else []


def lowest_tip(plan: Workplan) -> float:
    """mm: the lowest Z of the tip in the frame of the program, rotary axes at 0."""
    return min(float((t.points @ _into_setup(plan, s.access))[:, 2].min()) for s in plan.steps for t in s.trajectories)


def _lowest(plan: Workplan) -> str:
    """Header line: how deep the tip goes, for a part that is set on a table."""
    lowest = lowest_tip(plan)
    below = float(plan.stock.lower[2]) - lowest
    words = f", {decimal(below, 3)} below the stock box: nothing may stand there"
    more = words if below > MIN_DEPTH_BELOW_STOCK else ""
    return f"Lowest Z of the tip {decimal(lowest, 3)}{more}"


def _into_setup(plan: Workplan, access: str) -> F64:
    """(3, 3): points (n, 3) in the frame of an access, times this matrix, are in the setup frame."""
    return np.eye(3) if plan.clamping is None else plan.clamping.frames[access].rotation


def _tools_in_use(plan: Workplan) -> list[ToolBody]:
    return sorted({s.tool.number: s.tool for s in plan.steps}.values(), key=lambda t: t.number)


__all__ = ["GRANTED", "header_lines", "lowest_tip"]
