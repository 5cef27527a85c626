"""Ways down, rings and walls of deep slots, judged by the proof's stock: no plunge, no contact, no run without a cut.

Slots are drawn at random, hardly wider than the tool or twice as wide, and so are levels and flutes. The linker cuts
rings layer by layer, walls to size, and the walls again as a finish does.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.mesh_queries.bvh import TriangleTree
from output.program_grid import PER_MM, to_grid
from tests.hand_parts import RAMP, ball, box_mesh, field_of, joined, tool
from toolpath.feeds.feed_scheduling import Pace
from toolpath.lines import Line
from toolpath.linking.linker import Linker
from toolpath.linking.rapid_travel import Motions
from toolpath.stock.cut_history import Depths
from toolpath.stock.stock_map import StockMap
from toolpath.workingsteps import TrajectoryKind
from verify.checks.repeated_passes import WINDOW, repeat_findings
from verify.findings import Source
from verify.material.stock_lines import blank, run_stock
from verify.model import ProofSetup, StockKind
from verify.moves import Moves

DEEP, LONG = 10.0, 16.0
DIP = 1.5e-4  # mm, of a wall's levels, as ``toolpath.strategies.waterline`` has it for a flat end


def slotted(wide, long=LONG):
    """A block DEEP mm high on a plate, with a slot through it that begins at X 8."""
    mesh = box_mesh([0, 0, -2], [8.0 + long + 8.0, 24, 0])
    for low, high in (([0, 0], [8, 24]), ([8 + long, 0], [16 + long, 24]), ([8, 0], [8 + long, 12 - 0.5 * wide]),
                      ([8, 12 + 0.5 * wide], [8 + long, 24])):
        mesh = joined(mesh, box_mesh([*low, 0.0], [*high, DEEP]))
    return mesh


def ring(wide, radius, off, z):
    """A ring in the slot, ``off`` mm from its walls, with a corner every 0.3 mm or so, unevenly."""
    half, x0, x1 = max(0.5 * wide - radius - off, 0.0), 8.0 + radius + off, 8.0 + LONG - radius - off
    share = np.linspace(0.0, 1.0, 37) ** 1.2
    there = np.column_stack([x0 + (x1 - x0) * share, np.full(37, 12.0 - half)])
    back = np.column_stack([x1 + (x0 - x1) * share, np.full(37, 12.0 + half)])
    points = np.vstack([there, back[1 if half == 0.0 else 0:], there[:1]])
    points = points[np.r_[True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9]]
    return Line(np.column_stack([points, np.full(len(points), z)]), True)


def judged(link, mesh, body, box):
    """Moves of the program, events of the proof's stock along them, and what runs again without a cut."""
    starts, ends, feed, before = [], [], [], None
    for t in link.finish():
        points = to_grid(t.points) / PER_MM
        points = points if before is None else np.vstack([before, points])
        starts.append(points[:-1])
        ends.append(points[1:])
        feed.append(np.full(len(points) - 1, t.motion is not TrajectoryKind.RAPID))
        before = points[-1:]
    start, end, fed = np.vstack(starts), np.vstack(ends), np.concatenate(feed)
    real = (start != end).any(axis=1)
    none = np.zeros(int(real.sum()), np.int32)
    moves = Moves(start[real], end[real], fed[real], none)
    setup = ProofSetup(stock_kind=StockKind.BOX, stock_box=box, ramp_angle=RAMP)
    run = run_stock(blank(mesh, 0.07, setup), moves, [body], setup)
    lines = np.arange(1, len(moves) + 1, dtype=np.int32)
    return moves, run, repeat_findings(moves, run.cut, Source(("p",), none, lines, none))


@pytest.mark.parametrize("seed", range(8))
def test_a_deep_slot_is_cut_without_a_plunge_and_without_a_run_that_cuts_nothing(seed):
    rng = np.random.default_rng(seed)
    kind = (tool(4.0, 0.0, neck=16.0), tool(4.0, 0.8, neck=16.0), ball(4.0, neck=16.0))[seed % 3]
    body = replace(kind, flute_length=float(rng.choice([5.0, 7.5, 10.0, 12.5])), neck_diameter=3.7)
    wide = 4.0 + float(rng.choice([0.1, 0.25, 0.8, 3.0]))
    mesh, top = slotted(wide), DEEP + float(rng.uniform(0.5, 1.5))
    box = np.array([[0.0, 0.0, -2.0], [16.0 + LONG, 24.0, top]])
    field = field_of(mesh, body)
    stock = StockMap.box(TriangleTree(mesh), *box, 0.15)
    step = float(rng.uniform(0.6, 0.9))
    motions = Motions(800, 200, 3000, 10000, top + 4.0, top + 2.0, RAMP, step, 0.001)
    depths = Depths(stock.lattice)
    link = Linker(field, stock, motions, depths, pace=Pace(300, 3000, lambda d, a: 300.0 + 500.0 / (1.0 + d * a), step))
    floor = 0.0
    for z in np.append(np.arange(top - step, floor + 0.3, -step), floor + 0.3).tolist():
        for off in (0.6, 0.3, 0.0):
            if wide - body.diameter > 2.0 * off:
                assert link.add(ring(wide, body.radius, off, z))
    wall = Linker(field, stock, motions, depths, walls=True)
    wall.go.at, wall.go.trajectories = link.finish()[-1].points[-1], link.go.trajectories
    count = int(rng.choice([4, 5, 10]))
    levels = np.linspace(DEEP, floor, count + 1)
    for z in [*levels, *(0.5 * (levels[1:] + levels[:-1]))]:
        wall.add(ring(wide, body.radius, 0.0, float(z) - (DIP if body.corner_radius == 0.0 else 0.0)))
    moves, run, again = judged(wall, mesh, body, box)
    assert len(run.events) == 0, run.events[:5]
    assert not again, [f.message for f in again]
    down = moves.start[:, 2] - moves.end[:, 2]
    aside = np.hypot(*(moves.end - moves.start)[:, :2].T)
    assert not (moves.feed & (aside > 0.0) & (down > aside * math.tan(RAMP) + 1e-9)).any()
    assert len(moves) > 20 * WINDOW
