"""What a proof takes for granted about the bodies and places that neither setup nor programs state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from geometry.part import Part
from geometry.tool_body import ToolBody
from verify.assumptions import Assumed, AssumedKind
from verify.checks.clear_height import top_of_all
from verify.checks.empty_spindle import EMPTY, SMALLEST_NOSE
from verify.checks.other_solids import other_assumptions
from verify.checks.program_sequence import FramedProgram
from verify.findings import Source
from verify.material.free_width import LARGEST, free_holder_width
from verify.model import ProofSetup
from verify.moves import Moves
from verify.tool_bodies import nose_placed

BELOW = 0.01  # mm: tips less far below the part are not named
NOSE_FIELD = "state machine.nose_diameter_mm"


def body_assumptions(read: Sequence[FramedProgram], part: Part, moves: Moves, source: Source,
                     tools: Sequence[ToolBody], setup: ProofSetup, threads: int) -> list[Assumed]:
    """The assumptions of a proof that depend on its programs.

    part, moves : in the frame of the proof, mm; ``tools`` are those that ``moves`` refers to
    """
    return [*length_assumptions(read, setup), *_holders(part, moves, source, tools, setup, threads),
            *_above_holders(part, moves, tools, setup), *_table(read), *_changes(read),
            *other_assumptions(moves, source, tools, setup)]


def length_assumptions(read: Sequence[FramedProgram], setup: ProofSetup) -> Iterator[Assumed]:
    """The gauge lengths that tips of a tilted head depend on and the setup does not state."""
    used = sorted({t for r in read for t in r.program.by_joints} - setup.gauge_given)
    if used:
        value = ", ".join(f"T{t} {setup.gauge_length.get(t, 0.0):g} mm" for t in used)
        yield Assumed(AssumedKind.GAUGE_LENGTH, value,
                      "the head tilts without tool centre point control, so another length puts the tip elsewhere",
                      f"state gauge_length_mm of {', '.join(f'T{t}' for t in used)}")


def _holders(part: Part, moves: Moves, source: Source, tools: Sequence[ToolBody], setup: ProofSetup,
             threads: int) -> Iterator[Assumed]:
    bare = [k for k in np.unique(moves.tool).tolist() if tools[k].number != EMPTY and not tools[k].holder]
    if not bare:
        return
    upright = moves.axes is None
    top = top_of_all(part.mesh.bounds, setup)
    low = {k: float(np.minimum(moves.start[:, 2], moves.end[:, 2])[moves.tool == k].min()) + tools[k].stickout
           for k in bare}
    deep = upright and min(low.values()) < top
    free = free_holder_width(part.mesh, moves, tools, setup, threads) if deep else {}
    for k in bare:
        t = tools[k]
        value, effect = "none: the shank goes on", "a holder may enter part, stock or fixtures"
        if upright and low[k] >= top:
            value += f"; what is {t.stickout:g} mm over the tip stays above part, stock and fixtures"
        elif k in free:
            wide, m = free[k]
            line = f" (line {source.line[m]})" if m >= 0 else ""
            value += (f"; {wide:.1f} mm of diameter are free {t.stickout:g} mm over the tip and above{line}"
                      if wide < 2.0 * LARGEST else f"; {2.0 * LARGEST:g} mm of diameter are free above it")
            effect = "a wider holder enters part, stock or fixtures"
        yield Assumed(AssumedKind.HOLDER, f"T{t.number} {value}", effect, f"state holder of {t.id}")


def _above_holders(part: Part, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup) -> Iterator[Assumed]:
    if setup.nose_diameter is not None:
        for k in np.unique(moves.tool).tolist():
            if tools[k].number != EMPTY and not nose_placed(tools[k], setup):
                yield Assumed(AssumedKind.ABOVE_HOLDER, f"T{tools[k].number} the nose is nowhere: neither a holder nor "
                              "a gauge length says how high it stands", "the spindle may enter part, stock or fixtures",
                              f"state gauge_length_mm of {tools[k].id}")
        return
    used = [k for k in np.unique(moves.tool).tolist() if tools[k].holder]
    if used:
        value = "nothing"
        if moves.axes is None:
            ends = {k: float(np.minimum(moves.start[:, 2], moves.end[:, 2])[moves.tool == k].min()) + tools[k].stickout
                    + sum(h.length for h in tools[k].holder) for k in used}
            k = min(ends, key=lambda k: ends[k])
            over = ends[k] - top_of_all(part.mesh.bounds, setup)
            value += (f"; the holder of T{tools[k].number} ends {abs(over):.1f} mm "
                      f"{'above' if over >= 0 else 'below'} the top of part, stock and fixtures")
        yield Assumed(AssumedKind.ABOVE_HOLDER, value, "the spindle may enter part, stock or fixtures", NOSE_FIELD)
    if any(tools[k].number == EMPTY for k in np.unique(moves.tool).tolist()):
        yield Assumed(AssumedKind.ABOVE_HOLDER, f"the nose of the empty spindle is {SMALLEST_NOSE:g} mm wide",
                      "a wider nose may enter part, stock or fixtures", NOSE_FIELD)


def _table(read: Sequence[FramedProgram]) -> Iterator[Assumed]:
    unsaid = [r for r in read if not r.setup.table_known]
    if not unsaid:
        return
    deepest = [(float(r.bounds[0, 2] - r.program.end[m, 2]), r.program.name, int(r.program.line[m]))
               for r in unsaid if len(r.program) for m in [int(np.nanargmin(r.program.end[:, 2]))]]
    value = "below everything" if all(r.setup.table is None for r in unsaid) else \
        "at the bottom of the blank, for tilted tools only"
    depth, name, line = max(deepest, default=(0.0, "", 0))
    if depth > BELOW:
        value += f"; deepest under the part {depth:.3f} mm ({name}, line {line})"
    yield Assumed(AssumedKind.TABLE, value, "a tool may run into the table", "state machine.table_z_mm")


def _changes(read: Sequence[FramedProgram]) -> Iterator[Assumed]:
    lines = [f"{r.program.name}, line {line}" for r in read for line in r.program.unplaced]
    if lines:
        more = f" and {len(lines) - 1} more" if len(lines) > 1 else ""
        yield Assumed(AssumedKind.CHANGE_POSITION, f"above everything ({lines[0]}{more})",
                      "a longer tool may enter part, stock or fixtures where the spindle stands lower",
                      "state machine.change_position, or send Z home before the tool change")


__all__ = ["body_assumptions", "length_assumptions"]
