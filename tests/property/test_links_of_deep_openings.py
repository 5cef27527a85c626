"""Ways down, rings and walls of deep openings, judged by the proof's stock: no plunge, no run that cuts nothing.

Openings are drawn at random: crescents and bent slots right through, with tips that the tool does not reach. So are the
layers, and flutes that may end below the top. The linker cuts rings layer by layer, and the walls as a finish does.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.geometry import LineString, Point, Polygon, box

from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from output.program_grid import PER_MM, to_grid
from tests.hand_parts import RAMP, ball, field_of, tool
from toolpath.feeds.feed_scheduling import Pace
from toolpath.lines import Line
from toolpath.linking.linker import Linker
from toolpath.linking.rapid_travel import Motions
from toolpath.stock.cut_history import Depths
from toolpath.stock.stock_map import StockMap
from toolpath.workingsteps import TrajectoryKind
from verify.checks.repeated_passes import WINDOW, repeats
from verify.findings import Source
from verify.material.stock_lines import blank, run_stock
from verify.model import ProofSetup, StockKind
from verify.moves import Moves

DEEP, DIAMETER = 10.0, 4.0
DIP = 1.5e-4  # mm, of the levels of a wall, as ``toolpath.strategies.waterline`` has it for a flat end


def prism(plan, high):
    """A plate with an opening, as an open mesh of upper side and walls, from 0 up."""
    cells = shapely.constrained_delaunay_triangles(plan).geoms
    top = [np.column_stack([np.array(t.exterior.coords)[:3], np.full(3, high)]) for t in cells]
    out = [t if np.cross(t[1] - t[0], t[2] - t[0])[2] > 0.0 else t[::-1] for t in top]
    for ring in (plan.exterior, *plan.interiors):
        way = np.array(ring.coords)
        for (ax, ay), (bx, by) in zip(way[:-1], way[1:], strict=True):
            out.append(np.array([[ax, ay, 0.0], [bx, by, 0.0], [bx, by, high]]))
            out.append(np.array([[ax, ay, 0.0], [bx, by, high], [ax, ay, high]]))
    count = len(out)
    return TriangleMesh(np.vstack(out), np.arange(3 * count, dtype=np.int32).reshape(-1, 3), np.zeros(count, np.int32))


def opening(rng):
    """A crescent with sharp tips, or a slot along an arc, a little to twice wider than the tool."""
    wide = DIAMETER * float(rng.choice([1.1, 1.3, 1.7]))
    if rng.random() < 0.6:
        outer, inner = 8.0, 5.2
        moon = Point(0.0, 0.0).buffer(outer, 40).difference(Point(wide - outer + inner, 0.0).buffer(inner, 40))
        return moon.intersection(box(-20.0, -20.0, 20.0, float(rng.uniform(-2.0, 0.0))))
    turn = np.linspace(0.0, float(rng.uniform(1.5, 3.0)), 40)
    return LineString(np.column_stack([6.0 * np.cos(turn), 6.0 * np.sin(turn)])).buffer(0.5 * wide, 24)


def rings(plan, off, z):
    """The rings ``off`` mm from the border of an opening, in climb order."""
    inner = plan.buffer(-off, 24)
    pieces = [inner] if isinstance(inner, Polygon) else list(inner.geoms)
    for piece in pieces:
        if piece.length > 1.0:
            way = np.array(piece.exterior.coords)
            if LineString(way).is_ring and shapely.LinearRing(way).is_ccw:
                way = way[::-1]
            yield Line(np.ascontiguousarray(np.column_stack([way, np.full(len(way), z)])), True)


def judged(made, mesh, body, block):
    """Moves of a program, the events of the proof's stock along them, and what runs again without a cut."""
    starts, ends, feed, before = [], [], [], np.zeros((0, 3))
    for t in made:
        points = np.vstack([before, to_grid(t.points) / PER_MM])
        starts.append(points[:-1])
        ends.append(points[1:])
        feed.append(np.full(len(points) - 1, t.motion is not TrajectoryKind.RAPID))
        before = points[-1:]
    start, end, fed = np.vstack(starts), np.vstack(ends), np.concatenate(feed)
    real = (start != end).any(axis=1)
    none = np.zeros(int(real.sum()), np.int32)
    moves = Moves(start[real], end[real], fed[real], none)
    setup = ProofSetup(stock_kind=StockKind.BOX, stock_box=block, ramp_angle=RAMP)
    run = run_stock(blank(mesh, 0.07, setup), moves, [body], setup)
    lines = np.arange(1, len(moves) + 1, dtype=np.int32)
    return moves, run, repeats(moves, run.cut, Source(("p",), none, lines, none))[0]


@pytest.mark.parametrize("seed", [5, 9, 14])
def test_a_deep_opening_is_cut_without_a_plunge_and_without_a_run_that_cuts_nothing(seed):
    rng = np.random.default_rng(seed)
    kind = (tool(DIAMETER, 0.0, neck=16.0), tool(DIAMETER, 0.8, neck=16.0), ball(DIAMETER, neck=16.0))[seed % 3]
    body = replace(kind, flute_length=float(rng.choice([5.0, 7.5, 10.0, 12.5])), neck_diameter=3.6)
    hole = opening(rng)
    mesh = prism(box(*(np.array(hole.bounds) + [-6, -6, 6, 6])).difference(hole), DEEP)
    top = DEEP + float(rng.uniform(0.5, 1.5))
    block = np.array([[*mesh.bounds[0][:2], 0.0], [*mesh.bounds[1][:2], top]])
    stock = StockMap.box(TriangleTree(mesh), block[0], block[1], 0.15)
    step, depths = float(rng.uniform(0.6, 0.9)), Depths(stock.lattice)
    motions = Motions(800, 200, 3000, 10000, top + 4.0, top + 2.0, RAMP, step, 0.001)
    link = Linker(field_of(mesh, body), stock, motions, depths,
                  pace=Pace(300, 3000, lambda d, a: 300.0 + 500.0 / (1.0 + d * a), step))
    for z in [*np.arange(top - step, 0.3, -step).tolist(), 0.3]:
        for off in (1.2, 0.3):
            for line in rings(hole, body.radius + off, z):
                link.add(line)
    wall = Linker(link.field, stock, motions, depths, walls=True)
    levels = np.linspace(DEEP, 0.0, int(rng.choice([4, 5, 10])) + 1)
    for z in [*levels.tolist(), *(0.5 * (levels[1:] + levels[:-1])).tolist()]:
        for line in rings(hole, body.radius + 1e-3, z - (DIP if body.corner_radius == 0.0 else 0.0)):
            wall.add(line)
    moves, run, again = judged([*link.finish(), *wall.finish()], mesh, body, block)
    assert not again, [f.message for f in again]
    assert len(run.events) == 0, run.events[:5]
    down, aside = moves.start[:, 2] - moves.end[:, 2], np.hypot(*(moves.end - moves.start)[:, :2].T)
    assert not (moves.feed & (aside > 0.0) & (down > aside * math.tan(RAMP) + 1e-9)).any()
    assert len(moves) > 20 * WINDOW and wall.passes > 5
