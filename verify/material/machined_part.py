"""The machined part as a field of distances, from program texts: its surface, its volume and its history.

Fields are in mm, in the setup frame.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.mesh import F64
from geometry.part import Part
from geometry.tool_body import ToolBody
from verify.blank.blank import stock_bounds
from verify.checks.program_sequence import FramedProgram, Given, check_numbers, moves_of, read_all
from verify.material.material import machined
from verify.material.stock_field import DistanceField, run_field, stock_field
from verify.model import ProofSetup, StockKind
from verify.moves import BOW
from verify.program.arc_chords import CHORD
from verify.program.move_times import minutes_of
from verify.progress import StageProgress

MIN_STEP = 0.002
MAX_STEP = 5.0
READ = 0.1  # share of the work done when the programs are read
LEVELS = 127  # steps of a distance as a whole number, from 0 to the band


@dataclass(frozen=True, eq=False)
class StockInTime:
    """A field of stock from the blank to the end, in whole numbers of a 127th of the band.

    origin, step : of ``DistanceField``, mm
    first  : (nx, ny, nz) int8, count of 127ths of the band, the blank; above zero where stock stands
    part   : (nx, ny, nz) int8, count, the part on the same nodes
    ended  : (k,) float64, s from the start of the job, end of each stretch
    begins : (k + 1,) int64, index, where the changes of each stretch begin
    node, value : (n,) int64, index, and int8, count: nodes of ``first.ravel()`` that a stretch lowers, and their new
             values
    """

    origin: F64
    step: float
    first: NDArray[np.int8]
    part: NDArray[np.int8]
    ended: F64
    begins: NDArray[np.int64]
    node: NDArray[np.int64]
    value: NDArray[np.int8]

    def after(self, stretches: int) -> DistanceField:
        """The stock after a number of stretches, 0 for the blank."""
        values = self.first.ravel().copy()
        upto = self.begins[stretches]
        values[self.node[:upto]] = self.value[:upto]  # the last of several counts
        return DistanceField(self.origin, self.step, values.reshape(self.first.shape) * np.float32(self.step / LEVELS))


def stock_in_time(read: Sequence[FramedProgram], part: Part, tools: Sequence[ToolBody], setup: ProofSetup, *,
                  stretches: int, nodes: int, threads: int | None = None) -> StockInTime:
    """The stock from the blank on, stretch by stretch of the programs, for display.

    read      : the programs, as ``verify.checks.program_sequence.read_all`` reads them
    part, tools, setup : as ``read_all`` took them
    stretches : largest number of stretches; each has the same sum of its shares of time and of moves
    nodes     : approximate number of nodes of the grid
    threads   : as ``machined_stock``

    Raises
    ------
    VerificationError
        As ``verify.prove.prove``.

    Notes
    -----
    The last field is that of ``machined_stock`` with the same step, but for whole numbers, half a 127th of a step.
    """
    threads = threads or min(2, os.cpu_count() or 1)
    box = stock_bounds(part.mesh.bounds, setup)
    step = float(np.cbrt(np.prod(box[1] - box[0]) / nodes))
    for _ in range(4):
        step = float(np.cbrt(np.prod(box[1] - box[0] + 4.5 * step) / nodes))
    field = stock_field(part.mesh, setup, step, threads=threads)
    alone = replace(setup, stock_kind=StockKind.PART_OFFSET, margin=0.0, uncertainty=0.0)
    solid = stock_field(part.mesh, alone, step, box=box, threads=threads)
    moves, _ = moves_of(read, tools)
    number = np.concatenate([np.zeros(0, np.int32), *(r.program.tool for r in read)])
    took = np.concatenate([np.zeros(0), *(60.0 * minutes_of(r.program, r.setup) for r in read)])
    clock = np.cumsum(took)[np.isin(number, [t.number for t in tools])]
    ends = _stretches(clock, stretches)
    levels = first = _levels(field)
    node, value = [np.zeros(0, np.int64)], [np.zeros(0, np.int8)]
    for a, b in pairwise([0, *ends]):
        chosen = moves.feed.copy()
        chosen[:a] = chosen[b:] = False
        run_field(field, moves.only(chosen), tools, setup, bare=True, threads=threads)
        before, levels = levels, _levels(field)
        node.append(np.flatnonzero(levels != before))
        value.append(levels.ravel()[node[-1]])
    return StockInTime(field.origin, field.step, first, _levels(solid), clock[np.array(ends, np.int64) - 1],
                       np.cumsum([len(x) for x in node]), np.concatenate(node), np.concatenate(value))


def _levels(field: DistanceField) -> NDArray[np.int8]:
    return np.rint(field.values * (LEVELS / field.band)).astype(np.int8)


def _stretches(clock: F64, wanted: int) -> list[int]:
    """Ends of at most ``wanted`` stretches of moves; ``clock``, (m,) float64, s, is the end time of each move."""
    count = len(clock)
    if not count:
        return []
    done = 0.5 * clock / max(float(clock[-1]), 1e-9) + 0.5 * np.arange(1, count + 1) / count
    ends = np.searchsorted(done, np.arange(1, wanted) / wanted)
    return sorted({*(int(e) for e in ends if e > 0), count})


def machined_stock(programs: Sequence[Given], part: Part, tools: Sequence[ToolBody], setup: ProofSetup,
                   step: float, *, box: F64 | None = None, spindle_tool: int = 0, threads: int | None = None,
                   progress: Callable[[float], None] | None = None) -> DistanceField:
    """The stock after all programs have run, one after the other, on one blank.

    programs, part, tools, setup, spindle_tool : as ``verify.prove.prove`` takes them, mm, setup frame
    step     : mm between nodes, 0.002 to 5; wider where that needs over 24 million nodes (see ``DistanceField.step``)
    box      : (2, 3) float64, mm, setup frame, a window: only the stock in it; all of the stock where None
    threads  : 2 where None, at most the cores; the result has the same bytes for any number
    progress : called with 0..1, never less than before; an exception from it ends the work at once

    Returns
    -------
    DistanceField
        ``surface()`` is closed, along the borders of the window too.

    Raises
    ------
    InputError
        ``bad_mesh_step``; ``bad_mesh_box``: corners that are not finite, without extent, or off the stock.
    ProgramError, VerificationError
        As ``verify.prove.prove``.

    Notes
    -----
    Only feed moves cut. They remove the volume that the cutting part sweeps, even where another part of the tool would
    collide: a program that is not proved is shown as if it could run. The errors are those of ``surface_error``.
    """
    check_step(step)
    check_numbers(tools)
    if box is not None:
        box = _window(box, stock_bounds(part.mesh.bounds, setup))
    stages = StageProgress(progress)
    moves, _ = moves_of(read_all(programs, part, tools, setup, spindle_tool, stages.span(0.0, READ)), tools)
    field = machined(part.mesh, moves, tools, setup, step, box=box,
                     threads=threads or min(2, os.cpu_count() or 1), progress=stages.span(READ, 1.0))
    return field if box is None else clipped(field, box)


def surface_error(step: float, turning: bool = True) -> float:
    """Largest distance of a vertex of ``DistanceField.surface`` from the true surface, mm.

    step : mm between nodes; turning : whether tools turn while they move, which is simulated in pieces

    A vertex lies in a cell of the grid that holds a piece of the true surface, so within the diagonal of that cell
    [Gibson1998]. It is much nearer on smooth surfaces (docs/theory/proof.md). Features thinner than a cell may be
    missing.
    """
    return math.sqrt(3.0) * step + CHORD + (BOW if turning else 0.0)


def check_step(step: float) -> None:
    """Refuse a distance of nodes, mm, outside 0.002 to 5.

    Raises
    ------
    InputError
        Code bad_mesh_step.
    """
    if not MIN_STEP <= step <= MAX_STEP:
        raise InputError(f"the nodes of the machined part are {step:g} mm apart", code="bad_mesh_step", measured=step,
                         limit=[MIN_STEP, MAX_STEP], remedy=f"give {MIN_STEP:g} to {MAX_STEP:g} mm")


def clipped(field: DistanceField, box: F64) -> DistanceField:
    """The field without the stock outside a window.

    box : (2, 3) float64, mm, setup frame
    """
    x, y, z = (np.minimum(at - box[0, c], box[1, c] - at) for c, n in enumerate(field.values.shape)
               for at in (field.origin[c] + field.step * np.arange(n),))
    values = np.minimum(field.values, x.astype(np.float32)[:, None, None])
    np.minimum(values, y.astype(np.float32)[None, :, None], out=values)
    np.minimum(values, z.astype(np.float32)[None, None, :], out=values)
    return DistanceField(field.origin, field.step, np.maximum(values, np.float32(-field.step)))


def _window(box: F64, stock: F64) -> F64:
    """The window clipped to the stock and one mm round it, which leaves all stock in it."""
    box = np.asarray(box, dtype=np.float64)
    if box.shape != (2, 3) or not np.isfinite(box).all() or (box[0] >= box[1]).any():
        raise InputError("the window of the machined part is not a box", code="bad_mesh_box", measured=box.tolist(),
                         remedy="give x0,y0,z0,x1,y1,z1 in mm, the lower corner first")
    out = np.array([np.maximum(box[0], stock[0] - 1.0), np.minimum(box[1], stock[1] + 1.0)])
    if (out[0] >= out[1]).any():
        raise InputError("the window of the machined part does not meet the stock", code="bad_mesh_box",
                         measured=box.tolist(), limit=np.round(stock, 4).tolist(),
                         remedy="give a box that meets the stock; its corners are the limit")
    return out
