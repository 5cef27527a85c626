"""The shell of a tool: places on its outside, compared with stock that is a height over the plan.

Stock stands under its height without a gap, and no tool axis points down. So stock anywhere in a tool is also where the
vertical line there leaves the tool below: on its shell. Places inside need no check.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.kernels.shell import BRANCH, LEAF, ShellArrays
from zones.reach.assembly import Clearances, Disc

BITS = 8  # of each coordinate on the curve along which places are put in boxes
KEPT = 48  # shells: of a tool as it is and a little wider, for stock at its flank and under its end
BODY_STEPS = 2.0  # lattice steps between places of neck, shank and holder; of the cutting part one


@dataclass(frozen=True, eq=False)
class Shell:
    """Places on a tool, in boxes, in boxes of boxes.

    places : (n, 3) float64, mm, frame of the tool: along two directions square to its axis and along it, from the tip
    boxes  : (b, 6) float64, mm, centre and half the sides; those of ``LEAF`` places first, then of ``BRANCH`` of these
    levels : (l + 1,) int64, index where boxes of each level begin, and their count
    """

    places: F64
    boxes: F64
    levels: NDArray[np.int64]

    @property
    def arrays(self) -> ShellArrays:
        """The same for kernels."""
        return ShellArrays(self.places, self.boxes, self.levels)

    @classmethod
    def of(cls, places: F64) -> Shell:
        """Places put in boxes along a curve that fills space [Morton1966].

        places : (n, 3) float64, mm, frame of the tool
        """
        if not len(places):
            return cls(places, np.zeros((0, 6)), np.zeros(2, np.int64))
        low = places.min(axis=0)
        size = max(float((places.max(axis=0) - low).max()), 1e-9)
        cell = ((places - low) * ((1 << BITS) / size)).astype(np.int64).clip(max=(1 << BITS) - 1)
        key = sum(((cell[:, axis] >> bit) & 1) << (3 * bit + axis) for bit in range(BITS) for axis in range(3))
        places = np.ascontiguousarray(places[np.argsort(key, kind="stable")])
        lower, upper, many, boxes = places, places, LEAF, []
        while True:
            begins = np.arange(0, len(lower), many)
            lower, upper = np.minimum.reduceat(lower, begins), np.maximum.reduceat(upper, begins)
            boxes.append(np.hstack([0.5 * (lower + upper), 0.5 * (upper - lower)]))
            if len(lower) <= BRANCH:
                break
            many = BRANCH
        levels = np.concatenate([[0], np.cumsum([len(b) for b in boxes])]).astype(np.int64)
        return cls(places, np.vstack(boxes), levels)


def shells(tool: ToolBody, discs: Sequence[Disc], clear: Clearances, off_flank: float, off_end: float, step: float,
           high: float) -> tuple[Shell, Shell]:
    """Shells of the cutting part made smaller, and of neck, shank and holder with their clearance.

    off_flank, off_end : mm removed from its flank and from its end
    step               : mm of the lattice of the stock
    high               : mm from the tip, up to which stock may stand; the shells reach at least that far
    """
    outer = ((0.5 * tool.neck_diameter + clear.neck, tool.flute_length, tool.neck_length),
             (0.5 * tool.shank_diameter + clear.shank, tool.neck_length, tool.stickout),
             *((d.radius, d.height, math.inf) for d in discs))
    # by powers of two, so that a few serve all passes
    high = step * 2.0 ** math.ceil(math.log2(max(high, step) / step))
    return _shells(tool.radius, tool.corner_radius, tool.flute_length, tool.taper, outer, off_flank, off_end, step,
                   high)


@lru_cache(maxsize=KEPT)
def _shells(radius: float, corner: float, flute: float, taper: float, outer: tuple[tuple[float, float, float], ...],
            off_flank: float, off_end: float, step: float, high: float) -> tuple[Shell, Shell]:
    mill = ToolBody("", 0, 2.0 * radius, corner, flute, 0.0, 0.0, 0.0, 0.0, taper=taper)
    (wide, begins), widest = mill.corner_end, mill.widest_radius
    flank: list[F64] = [np.zeros((0, 3))]
    inner = 0.0
    for h in _heights(min(off_end, flute), min(flute, high), step):
        # the part of the cutter that lies ``off_end`` inside its outline: a rounded end, which passes into the flank
        low = max(corner - h, 0.0)
        if corner > off_end and low > corner - off_end:
            continue
        at = radius - corner + math.sqrt((corner - off_end) ** 2 - low * low) if corner > off_end else radius
        # over the corner the side counts: stock that may stand under the end may not stand beside it
        up = max(h - off_end, 0.0)
        low = max(corner - up, 0.0)
        side = radius - corner + math.sqrt(max(corner * corner - low * low, 0.0)) - off_flank
        if taper > 0.0 and up > begins:
            side = wide + taper * (up - begins) - off_flank
        at = max(min(max(at, side), widest - off_flank), 0.0)
        begin = 0.0 if len(flank) == 1 else min(inner + step, at)
        flank += [_ring(r, h, step) for r in _between(begin, at, step)]
        inner = at
    spacing = BODY_STEPS * step
    bodies: list[F64] = [np.zeros((0, 3))]
    for k, (wide, begin, end) in enumerate(outer):
        over = [(b, e) for j, (w, b, e) in enumerate(outer) if w > wide or (w == wide and j < k)]
        bodies += [_ring(r, begin, spacing) for r in _between(0.0, wide, spacing)]
        bodies += [_ring(wide, h, spacing) for h in _heights(begin, min(end, high), spacing)[1:]
                   if not any(b <= h <= e for b, e in over)]
    return Shell.of(np.vstack(flank)), Shell.of(np.vstack(bodies))


def _heights(begin: float, end: float, spacing: float) -> list[float]:
    """From begin to end, mm, evenly; begin alone where the end is below it."""
    end = max(begin, end)
    return [float(h) for h in np.linspace(begin, end, int(np.ceil((end - begin) / spacing)) + 1)]


def _between(begin: float, end: float, spacing: float) -> list[float]:
    return [float(r) for r in np.linspace(end, begin, int(np.ceil((end - begin) / spacing)) + 1)]


def _ring(radius: float, height: float, spacing: float) -> F64:
    """(k, 3) mm: places on a ring round the axis."""
    count = max(int(np.ceil(2.0 * np.pi * radius / spacing)), 1)
    at = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([radius * np.cos(at), radius * np.sin(at), np.full(count, height)])
