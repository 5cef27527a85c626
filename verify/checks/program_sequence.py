"""Programs one after the other, each in its own frame: read, started from above, and joined to one list of moves.

Arrays are float64, mm or dimensionless for directions.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.errors import VerificationError
from geometry.mesh import F64
from geometry.part import Part
from geometry.tool_body import ToolBody
from verify.blank.blank import stock_bounds
from verify.checks.clear_height import from_above, lifted, top_of_all
from verify.checks.dogleg_turns import strays
from verify.checks.machine_limits import limit_findings, low_places, notes_on, way_findings
from verify.findings import Source
from verify.model import Finding, NcProgram, ProofSetup, StockKind
from verify.moves import Moves
from verify.program.move_kinds import FEED
from verify.program.program import Program
from verify.program_reading import read_one
from verify.progress import Report, StageProgress
from verify.tool_axes import ToolAxes

SAME = 1e-9  # mm: a move that is no longer moves nothing
Given = NcProgram | tuple[str, str]


@dataclass(frozen=True, eq=False)
class FramedProgram:
    """One program with setup and bounds of the part, all in the frame of the program.

    program : as read
    turn    : (3, 3) float64, rotation from the frame of the proof to that of the program; None: the same frame
    setup   : of the proof; where the frame is turned, boxes round blank and fixtures stand in for them, and the height
              of the table and the place of tool changes are not known unless Z stays
    bounds  : (2, 3) float64, mm, of the part
    """

    program: Program
    turn: F64 | None
    setup: ProofSetup
    bounds: F64

    def findings(self, tools: Sequence[ToolBody]) -> list[Finding]:
        """Findings of machine limits and of moves that cannot be simulated; points are in the frame of the proof."""
        found = [*limit_findings([self.program], self.setup),
                 *way_findings(self.program, self.bounds, tools, self.setup)]
        if self.turn is None:
            return found
        return [f if f.point is None else replace(f, point=tuple((np.array(f.point) @ self.turn).tolist()))
                for f in found]

    def notes(self) -> list[str]:
        """Notes that are not findings."""
        return list(notes_on(self.program, float(self.bounds[0, 2]), self.setup))

    def here(self, vectors: F64) -> F64:
        """Turn places or directions of the program into the frame of the proof.

        vectors : (n, 3) or (n, 3, 3) float64, mm or dimensionless, frame of the program

        Returns (n, 3) or (n, 3, 3) float64, mm or dimensionless, frame of the proof.
        """
        return vectors if self.turn is None else np.asarray(vectors @ self.turn)


def check_numbers(tools: Sequence[ToolBody]) -> None:
    """Refuse two tools of one T number.

    Raises
    ------
    VerificationError
        Code tool_number_twice.
    """
    numbers = [t.number for t in tools]
    if len(set(numbers)) != len(numbers):
        raise VerificationError("two tools share a T number", code="tool_number_twice",
                                subjects=tuple(t.id for t in tools if numbers.count(t.number) > 1),
                                remedy="give every tool its own number")


def read_all(programs: Sequence[Given], part: Part, tools: Sequence[ToolBody], setup: ProofSetup,
             spindle_tool: int, report: Report, known: Sequence[Program] | None = None) -> list[FramedProgram]:
    """Read programs in the order they run; a descent of unknown start height comes from above everything.

    programs, spindle_tool : as ``verify.prove.prove`` takes them; it also names the errors
    report   : called with the share read, 0 to 1
    known    : the same programs, as ``read_each`` reads them; None: they are read here
    """
    given = [p if isinstance(p, NcProgram) else NcProgram(*p) for p in programs]
    read = read_each(given, part, tools, setup, spindle_tool, report) if known is None else known
    framed = []
    for nc, program in zip(given, read, strict=True):
        own, bounds = _own(nc, part, setup)
        top = top_of_all(bounds, own)
        framed.append(FramedProgram(from_above(program, top + setup.clearance_rapid), nc.turn, own, bounds))
    return framed


def read_each(programs: Sequence[NcProgram], part: Part, tools: Sequence[ToolBody], setup: ProofSetup,
              spindle_tool: int, report: Report) -> list[Program]:
    """Read programs, each in its own frame, as ``read_all`` takes them from who has read them before."""
    stages, total, done = StageProgress(report), max(sum(len(p.text) for p in programs), 1), 0
    read = []
    for nc in programs:
        own, _ = _own(nc, part, setup)
        share = stages.span(done / total, (done + len(nc.text)) / total)
        read.append(read_one(
            nc, tools, work_offset=own.work_offset, gouge_tolerance=setup.gouge_tolerance, kinematics=setup.kinematics,
            gauge_length=setup.gauge_length, spindle_tool=spindle_tool, report=share, change=own.change_position,
            gauge_given=setup.gauge_given, max_feed=setup.max_feed))
        done += len(nc.text)
    return read


def _own(nc: NcProgram, part: Part, setup: ProofSetup) -> tuple[ProofSetup, F64]:
    """Setup and bounds of the part, (2, 3) mm, in the frame of one program."""
    offset = nc.work_offset or setup.work_offset
    if nc.turn is None:
        return replace(setup, work_offset=offset), part.mesh.bounds
    there = part.mesh.vertices @ nc.turn.T
    flat = bool(nc.turn[2, 2] > 1.0 - 1e-9)
    own = replace(setup, work_offset=offset, stock_kind=StockKind.BOX, stock_cylinder=None, stock_mesh=None,
                  change_position=setup.change_position and (
                      *[math.nan] * (len(setup.change_position) - 1), setup.change_position[-1] if flat else math.nan),
                  table=setup.table if flat else None, table_known=setup.table_known and flat,
                  stock_box=_box_round(stock_bounds(part.mesh.bounds, setup), nc.turn),
                  fixtures=tuple(_box_round(f, nc.turn) for f in setup.fixtures))
    return own, np.stack([there.min(axis=0), there.max(axis=0)])


def _box_round(box: F64, turn: F64) -> F64:
    """(2, 3) box round a box turned by (3, 3)."""
    corners = np.stack(np.meshgrid(*np.asarray(box, dtype=np.float64).T, indexing="ij"), -1).reshape(-1, 3) @ turn.T
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def moves_of(read: Sequence[FramedProgram], tools: Sequence[ToolBody]) -> tuple[Moves, Source]:
    """Moves of all programs, one after the other. Moves without a tool, and of no length, are left out.

    tools : of the moves; ``Moves.tool`` is the place in this sequence

    A feed move of tool 0, the empty spindle, counts as a rapid: it cuts nothing.
    """
    programs = [r.program for r in read]
    row = {t.number: i for i, t in enumerate(tools)}
    known = counted(read, row)
    number = np.concatenate([np.zeros(0, np.int32), *(p.tool for p in programs)])[known]
    kind = np.concatenate([np.zeros(0, np.int8), *(p.kind for p in programs)])[known]
    line = np.concatenate([np.zeros(0, np.int32), *(p.line for p in programs)])[known]
    start = np.concatenate([np.zeros((0, 3)), *(r.here(r.program.start) for r in read)])[known]
    ends = (lifted(r.program, low_places(r.program, tools, r.setup), r.bounds, r.setup) for r in read)
    end = np.concatenate([np.zeros((0, 3)), *(r.here(e) for r, e in zip(read, ends, strict=True))])[known]
    which = np.repeat(np.arange(len(read), dtype=np.int32), [len(p) for p in programs])[known]
    numbers, place = np.unique(number, return_inverse=True)
    tool = np.array([row[int(n)] for n in numbers], np.int32)[place.reshape(-1)]
    axes = None
    if any(r.turn is not None or r.program.poses is not None for r in read):
        axes = ToolAxes.between(np.concatenate([_axes(r, True) for r in read])[known],
                                np.concatenate([_axes(r, False) for r in read])[known])
    return (Moves(np.ascontiguousarray(start), np.ascontiguousarray(end), (kind == FEED) & (number > 0), tool, axes),
            Source(tuple(p.name for p in programs), which, line, number))


def strays_of(read: Sequence[FramedProgram], tools: Sequence[ToolBody], setup: ProofSetup) -> F64 | None:
    """How far each move of ``moves_of`` may leave its straight way.

    Returns (m,) float64, mm, or None where rapids are straight or no axis turns.
    """
    if not setup.dogleg or all(r.program.poses is None for r in read):
        return None
    out = np.concatenate([strays(r.program, r.bounds, tools, r.setup) for r in read])
    return np.asarray(out[counted(read, [t.number for t in tools])])


def slides_of(read: Sequence[FramedProgram], tools: Sequence[ToolBody], setup: ProofSetup) -> F64 | None:
    """Directions of the linear axes for each move of ``moves_of``.

    Returns (m, 3, 3) float64, dimensionless, rows in the frame of the proof. None where the axes lie along the frame
    throughout, or rapids are straight.
    """
    if not setup.dogleg or all(r.turn is None and r.program.poses is None for r in read):
        return None
    out = []
    for r in read:
        rows = np.tile(np.eye(3), (len(r.program), 1, 1))
        if setup.kinematics is not None and r.program.poses is not None:
            rows = setup.kinematics.slides(r.program.poses.start_turn)
        out.append(r.here(rows))
    return np.concatenate(out)[counted(read, [t.number for t in tools])]


def counted(read: Sequence[FramedProgram], numbers: Collection[int]) -> NDArray[np.bool_]:
    """Which moves of programs the proof counts: those with a tool of these T numbers that have a length or turn.

    A move of no length from a known place, as that of G28 with the place where the tool is, moves nothing.

    Returns (m,) bool.
    """
    out = [np.zeros(0, np.bool_)]
    for p in (r.program for r in read):
        still = np.asarray((np.abs(p.end - p.start) <= SAME).all(axis=1))
        if p.poses is not None:
            still &= (p.poses.start_turn == p.poses.end_turn).all(axis=1)
        still[p.unknown[:, 0]] = False
        still[[row for row, _ in p.lifts]] = False
        out.append(np.isin(p.tool, list(numbers)) & ~still)
    return np.concatenate(out)


def _axes(r: FramedProgram, at_start: bool) -> F64:
    """(m, 3) tool axes of a program at the start or the end of its moves, in the frame of the proof."""
    p = r.program
    if p.poses is None:
        return r.here(np.tile([0.0, 0.0, 1.0], (len(p), 1)))
    return r.here(p.poses.start_axis if at_start else p.poses.end_axis)
