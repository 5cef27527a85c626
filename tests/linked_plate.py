"""A plate under a block of stock, a linker over it, and lines to link."""

from __future__ import annotations

import numpy as np

from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import RAMP, ball, box_mesh, field_of, joined
from toolpath.counterexamples import NONE
from toolpath.lines import Line
from toolpath.linking.linker import Linker
from toolpath.linking.rapid_travel import Motions
from toolpath.stock.cut_history import Depths
from toolpath.stock.stock_map import StockMap
from toolpath.workingsteps import TrajectoryKind

TOP = 4.0


def stand(stock, beyond, height, before=np.inf):
    """Let stock stand to a height between two places along X."""
    x = stock.lattice.x0 + stock.lattice.step * np.arange(stock.lattice.nx)
    top = np.where((x > beyond) & (x < before), height, stock.top)
    stock.become(StockMap(stock.lattice, top, top.copy(), stock.part))


def linker(body=None, top=TOP, post=False, step_down=1.0, found=NONE):
    """A plate 30 x 30 with its top at 0, stock up to ``top``, a post in the middle if asked for."""
    mesh = box_mesh([0, 0, -2], [30, 30, 0])
    if post:
        mesh = joined(mesh, box_mesh([13, 13, 0], [17, 17, 3]))
    field = field_of(mesh, body or ball(4.0))
    stock = StockMap.box(TriangleTree(mesh), np.array([0.0, 0, -2]), np.array([30.0, 30, top]), 0.15)
    return Linker(field, stock, Motions(800, 200, 3000, 10000, 8.0, 6.0, RAMP, step_down, 0.001), Depths(stock.lattice),
                  found)


def straight(x0, x1, y, z):
    return Line(np.array([[x0, y, z], [x1, y, z]], float), False)


def loop(r, z, centre=(15.0, 15.0), n=90):
    a = np.linspace(0, 2 * np.pi, n + 1)
    return Line(np.column_stack([centre[0] + r * np.cos(a), centre[1] + r * np.sin(a), np.full(n + 1, z)]), True)


def steepest_cut(link):
    """Steepest descent of the cutting moves, rad."""
    worst = 0.0
    for t in link.trajectories:
        if t.motion is TrajectoryKind.CUT:
            d = np.diff(t.points, axis=0)
            worst = max(worst, float(np.arctan2(-d[:, 2], np.hypot(d[:, 0], d[:, 1])).max()))
    return worst


def motions(link):
    return [t.motion for t in link.trajectories]
