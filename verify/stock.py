"""The stock in process, and everything that must not touch it.

Stock is a field of vertical lines, ``line_spacing`` apart, each solid up to one height. Blank and cuts are
exact on every line (closed forms, no cell is ever rounded up or down), so nothing is flagged that does not
happen; what stands wholly between two lines, thinner than the spacing, is not seen. A flank beside a wall is
left to the normal rays, and necks, shanks and holders beside the part are checked on points of the part
itself, so the spacing only matters for stock that is not part.

- A line is lowered only where the flutes reach its top when the cutter first touches it: what stands higher
  stays and meets the neck.
- A body no wider than the cutting part runs where the cutting part has been; its clearance never reaches
  beyond the cutting radius, and it may overlap by the gouge tolerance.
- In a rapid the whole assembly is grown radially by the rapid clearance, heights are not; a straight lift
  leaves the place it stands in with no clearance asked.
- Plunge: what feed moves steeper than the ramp angle take off a line with the end-cutting region of the tool adds
  up, and is worked off by going sideways, at the slope of the ramp. It is a plunge where more than ``plunge_skin``
  tool diameters are open; so one descent broken by steps aside, lifts or pecks is still one. The region is the
  whole end of a flat, the flat and half the corner of a bull nose, and the inner half radius of a ball (to
  30 degrees of its sphere); so a ball that finishes downhill through a thin skin does not plunge.
"""

from __future__ import annotations

import math
import queue
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64, TriangleMesh
from geometry.toolbody import ToolBody
from verify.kernels.bodies import body_tile
from verify.kernels.heights import raise_offset
from verify.kernels.stock import HOLDER, NECK, SHANK, stock_tile
from verify.model import ProofSetup, StockKind
from verify.removal import CellGrid, Moves, Progress, cutter_table, run_tiles

MAX_LINES = 6_000_000
BLOCK = 32
EVENTS = 4096
Spare = queue.SimpleQueue[NDArray[np.int64]]
NEVER = -1e30
ANOTHER_TOOL = 1e6  # mm
NO_HOLDER = 200.0  # mm by which a shank goes on over its stickout where the setup names no holder


@dataclass(frozen=True, eq=False)
class StockField:
    """Vertical lines: line (i, j) stands at origin + ((i, j) + 0.5) step.

    origin : (2,) float64, mm; height : (nx, ny) float64, mm, top of the stock
    """

    origin: F64
    step: float
    height: F64


@dataclass(frozen=True, eq=False)
class Bodies:
    """Neck, shank and holder rows of all tools; rows first[k]:first[k+1] belong to tool k (see kernels.stock)."""

    rows: F64
    first: NDArray[np.int64]

    @classmethod
    def of(cls, tools: Sequence[ToolBody], setup: ProofSetup) -> Bodies:
        """Rows (z0, z1, r0, r1, clearance, part) with the clearance in the radii."""
        rows: list[tuple[float, ...]] = []
        first = [0]
        for tool in tools:
            for z0, z1, r0, r1, clearance, part in _frusta(tool, setup):
                if z1 <= z0:
                    continue
                if max(r0, r1) <= tool.radius + 1e-6:
                    clearance = min(clearance, max(tool.radius - max(r0, r1), 0.0))
                rows.append((z0, z1, r0 + clearance, r1 + clearance, clearance, part))
            first.append(len(rows))
        return cls(np.array(rows, dtype=np.float64).reshape(-1, 6), np.array(first, dtype=np.int64))

    def reach(self, cutters: F64) -> F64:
        """(k,) float64, mm: how far each assembly reaches from its tip; cutters (k, 3) as ``cutter_table``."""
        out = np.hypot(cutters[:, 0], cutters[:, 2])
        for k in range(len(out)):
            own = self.rows[self.first[k]:self.first[k + 1]]
            out[k] = max(out[k], np.hypot(np.maximum(own[:, 2], own[:, 3]), own[:, 1]).max(initial=0.0))
        return np.asarray(out)


def _frusta(tool: ToolBody, setup: ProofSetup) -> list[tuple[float, float, float, float, float, int]]:
    neck, shank = 0.5 * tool.neck_diameter, 0.5 * tool.shank_diameter
    top = max(tool.neck_length, tool.flute_length)
    out = [(tool.flute_length, top, neck, neck, tool.neck_clearance(setup.clearance_neck), NECK),
           (top, max(tool.stickout, top), shank, shank, setup.clearance_shank, SHANK)]
    z = tool.stickout
    for part in tool.holder:
        out.append((z, z + part.length, 0.5 * part.diameter, 0.5 * part.diameter_top, setup.clearance_holder, HOLDER))
        z += part.length
    if not tool.holder:
        # nobody said what holds it: at least the tool itself goes on
        out.append((max(z, top), max(z, top) + NO_HOLDER, shank, shank, setup.clearance_shank, SHANK))
    return out


def stock_bounds(bounds: F64, setup: ProofSetup) -> F64:
    """(2, 3) float64, mm: bounding box of the blank round a part with these bounds."""
    grow = setup.margin + setup.uncertainty
    if setup.stock_kind == StockKind.BOX and setup.stock_box is not None:
        return np.asarray(setup.stock_box, dtype=np.float64)
    if setup.stock_kind == StockKind.CYLINDER:
        x, y, z, radius, height = blank_cylinder(bounds, setup)
        return np.array([[x - radius, y - radius, z], [x + radius, y + radius, z + height]])
    lower = bounds[0] - grow
    if setup.stock_kind == StockKind.BOX:
        lower[2] = bounds[0, 2]
    return np.array([lower, bounds[1] + grow])


def blank_cylinder(bounds: F64, setup: ProofSetup) -> tuple[float, float, float, float, float]:
    """x, y, z_bottom, radius, height of a cylinder blank, mm; round the part, bounds (2, 3), without one."""
    if setup.stock_cylinder is not None:
        return setup.stock_cylinder
    grow = setup.margin + setup.uncertainty
    centre = 0.5 * (bounds[0] + bounds[1])
    radius = 0.5 * float(np.hypot(*(bounds[1, :2] - bounds[0, :2]))) + grow
    return float(centre[0]), float(centre[1]), float(bounds[0, 2]), radius, float(bounds[1, 2] - bounds[0, 2]) + grow


def stock_on_normals(points: F64, normals: F64, bounds: F64, setup: ProofSetup, reach: float) -> F64:
    """Stock on each outward normal before the first cut, not above ``reach``.

    points, normals : (n, 3) float64, mm and unit; bounds : (2, 3) of the part

    Returns (n,) float64, mm: margin + uncertainty for an offset blank, else the way out of the box or cylinder.
    """
    if setup.stock_kind == StockKind.PART_OFFSET:
        return np.full(len(points), min(setup.margin + setup.uncertainty, reach))
    box = stock_bounds(bounds, setup)
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.where(normals > 0, (box[1] - points) / normals, np.where(normals < 0, (box[0] - points) / normals,
                                                                        np.inf))
    if setup.stock_kind == StockKind.CYLINDER:
        x, y, _, radius, _ = blank_cylinder(bounds, setup)
        w, n = points[:, :2] - (x, y), normals[:, :2]
        a, b, c = (n * n).sum(1), (w * n).sum(1), (w * w).sum(1) - radius**2
        side = np.where(a > 1e-12, (-b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / np.maximum(a, 1e-12), np.inf)
        out = np.column_stack([side, out[:, 2]])
    return np.clip(out.min(axis=1), 0.0, reach)


def blank(mesh: TriangleMesh, setup: ProofSetup, *, threads: int = 2, progress: Progress | None = None) -> StockField:
    """The stock before the first cut, never below the part.

    Exact on every line: an offset blank is the union of spheres on the surface, by facets, edges and corners.
    """
    box = stock_bounds(mesh.bounds, setup)
    corners = [box, mesh.bounds]
    lower = np.min([c[0, :2] for c in corners], axis=0)
    extent = np.max([c[1, :2] for c in corners], axis=0) - lower
    step = max(setup.line_spacing, math.sqrt(float(extent.prod()) / MAX_LINES))
    nx, ny = (np.ceil(extent / step).astype(int) + 1).tolist()
    origin = lower - 0.5 * step
    height = np.full((nx, ny), NEVER)
    x, y = origin[0] + (np.arange(nx) + 0.5) * step, origin[1] + (np.arange(ny) + 0.5) * step
    if setup.stock_kind == StockKind.BOX:
        height[np.ix_((x >= box[0, 0]) & (x <= box[1, 0]), (y >= box[0, 1]) & (y <= box[1, 1]))] = box[1, 2]
    elif setup.stock_kind == StockKind.CYLINDER:
        cx, cy, _, radius, _ = blank_cylinder(mesh.bounds, setup)
        height[np.hypot(x[:, None] - cx, y[None, :] - cy) <= radius] = box[1, 2]
    reach = setup.margin + setup.uncertainty if setup.stock_kind == StockKind.PART_OFFSET else 0.0
    _raise(height, origin, step, mesh, reach, threads, progress)
    return StockField(origin, step, height)


def _raise(height: F64, origin: F64, step: float, mesh: TriangleMesh, reach: float, threads: int,
           progress: Progress | None) -> None:
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges = np.unique(edges, axis=0)
    by_height = np.argsort(-mesh.triangles[:, :, 2].max(axis=1), kind="stable")
    faces = np.ascontiguousarray(mesh.faces[by_height])

    def job(i0: int, i1: int) -> Callable[[], object]:
        return lambda: raise_offset(height, i0, i1, origin, step, mesh.vertices, faces, edges, reach)

    cuts = np.linspace(0, len(height), 4 * max(threads, 1) + 1).astype(int)
    run_tiles([job(int(a), int(b)) for a, b in zip(cuts[:-1], cuts[1:], strict=True) if b > a], threads, progress)


def descents(moves: Moves, ramp_angle: float) -> tuple[NDArray[np.bool_], F64]:
    """Feed moves that descend steeper than ``ramp_angle`` (rad), and what ramps could have taken since the beginning.

    Down is along the tool, for one that turns along its axis half way.

    Returns
    -------
    steep : (m,) bool
    earned : (m,) float64, mm: sideways way of all feed moves before that are not steep, times the tangent of the angle;
             without end at a change of the tool
    """
    d, slope = moves.end - moves.start, math.tan(ramp_angle)
    if moves.axes is None:
        rise, aside = d[:, 2], np.hypot(d[:, 0], d[:, 1])
    else:
        up = moves.axes.middle
        rise = np.einsum("ij,ij->i", d, up)
        aside = np.linalg.norm(d - rise[:, None] * up, axis=1)
    steep = np.asarray(moves.feed & (-rise > aside * slope + 1e-9))
    earned = np.cumsum(np.where(moves.feed & ~steep, aside * slope, 0.0))
    changed = np.concatenate([[False], moves.tool[1:] != moves.tool[:-1]]) if len(d) else np.zeros(0, np.bool_)
    return steep, earned + ANOTHER_TOOL * np.cumsum(changed)


@dataclass(frozen=True, eq=False)
class StockPass:
    """What one pass over the stock found.

    events : (e, 7) float64 rows (move, code, depth, clearance, x, y, z) sorted by move; lost : events beyond the table
    cut    : (m,) bool, moves that took stock
    engaged : (m,) int64, sectors of the cutter that met stock (``kernels.engaged``)
    taken  : (m,) float64, mm³ by move, or None where that is not known
    """

    events: F64
    lost: int
    cut: NDArray[np.bool_]
    engaged: NDArray[np.int64]
    taken: F64 | None = None


def end_radii(tools: Sequence[ToolBody]) -> F64:
    """(k,) float64, mm: radius of the region that cuts when the tool goes straight down (see the module)."""
    share = {"flat": lambda t: t.radius, "ball": lambda t: 0.5 * t.radius,
             "bull": lambda t: t.radius - 0.5 * t.corner_radius}
    return np.array([share[t.kind](t) for t in tools])


def run_stock(field: StockField, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup, *, threads: int = 2,
              progress: Progress | None = None) -> StockPass:
    """Run all moves through the stock, in place, and collect what touches.

    Returns StockPass. Raises VerificationError as ``cutter_table``. Same bytes for any number of threads.
    """
    cutters, bodies = cutter_table(tools), Bodies.of(tools, setup)
    (steep, earned), cut = descents(moves, setup.ramp_angle), np.zeros(len(moves), np.uint8)
    skins, free = setup.plunge_skin * 2.0 * cutters[:, 0], free_rapids(moves)
    nx, ny = field.height.shape
    tables, spare = tables_for(threads, (len(moves),))

    def job(i: int, j: int) -> Callable[[], object]:
        def work() -> object:
            events, engaged = event_table(), spare.get()
            n = stock_tile(i, min(i + BLOCK, nx), j, min(j + BLOCK, ny), field.origin, field.step, field.height,
                           moves.start, moves.end, moves.feed, free, steep, earned, moves.tool, cutters,
                           end_radii(tools), skins, bodies.rows, bodies.first, setup.clearance_rapid,
                           setup.gouge_tolerance, cut, engaged, events)
            spare.put(engaged)
            return noted(events), n
        return work

    blocks = [(i, j) for i in range(0, nx, BLOCK) for j in range(0, ny, BLOCK)]
    events, lost = gather(run_tiles([job(*b) for b in blocks], threads, progress))
    return StockPass(events, lost, cut.astype(bool), np.bitwise_or.reduce(tables))


def run_bodies(points: F64, moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup, *, threads: int = 2,
               progress: Progress | None = None) -> tuple[F64, int]:
    """Necks, shanks and holders of all feed moves against (n, 3) float64 points of the part, mm.

    Returns the events (e, 7) sorted by move and the number beyond the table.
    """
    if len(points) == 0 or len(moves) == 0:
        return np.zeros((0, 7)), 0
    grid = CellGrid.build(points)
    pts, bodies = np.ascontiguousarray(points[grid.order]), Bodies.of(tools, setup)
    radii = np.array([t.radius for t in tools])

    def job(tile: tuple[int, int, int, int]) -> Callable[[], object]:
        def work() -> object:
            events = event_table()
            n = body_tile(*tile, grid.origin, grid.size, grid.shape, grid.first, pts, moves.start, moves.end,
                          moves.feed, moves.tool, radii, bodies.rows, bodies.first, setup.gouge_tolerance, events)
            return noted(events), n
        return work

    return gather(run_tiles([job(t) for t in grid.tiles()], threads, progress))


def event_table() -> F64:
    """An empty table of events (e + 1, 7), in mm; the kernels keep in its last row how many it holds."""
    return np.zeros((EVENTS + 1, 7))


def noted(events: F64) -> F64:
    """The rows (e, 7) of a table that hold events, in mm."""
    return events[:int(events[-1, 0])].copy()


def free_rapids(moves: Moves) -> NDArray[np.bool_]:
    """(m,) bool: rapids that no clearance is asked of.

    Those that draw the tool straight out along its axis, and those that put it straight back no deeper than a feed
    move had it, with no move aside since: a peck out of its hole and into it again.
    """
    d = moves.end - moves.start
    up = np.tile([0.0, 0.0, 1.0], (len(d), 1)) if moves.axes is None else moves.axes.axis
    rise = np.einsum("ij,ij->i", d, up)
    aside = np.linalg.norm(d - rise[:, None] * up, axis=1)
    straight = aside <= 1e-6 * np.abs(rise) + 1e-7
    if moves.axes is not None:
        straight &= moves.axes.angle == 0.0
    out = np.asarray(~moves.feed & straight & (rise > 0))
    for m in np.flatnonzero(~moves.feed & straight & (rise < 0)).tolist():
        height, i = 0.0, m - 1  # of the end of move i over the start of move m
        while i >= 0 and straight[i] and moves.tool[i] == moves.tool[m] and not out[m]:
            out[m] = moves.feed[i] and height <= rise[m] + 1e-9
            height -= rise[i]
            i -= 1
    return out


def gather(results: list[object]) -> tuple[F64, int]:
    """Events of all jobs in one table (e, 7), sorted by move, code and the deeper first, and how many were lost.

    results : of every job its events (k, 7), depths and places in mm, and how many it found
    """
    parts = [r for r in results if isinstance(r, tuple)]
    if not parts:
        return np.zeros((0, 7)), 0
    events = np.concatenate([p[0] for p in parts])
    lost = sum(p[1] - len(p[0]) for p in parts)
    order = np.lexsort((events[:, 6], events[:, 5], events[:, 4], -events[:, 2], events[:, 1], events[:, 0]))
    return events[order], int(lost)


def tables_for(threads: int, shape: tuple[int, ...]) -> tuple[list[NDArray[np.int64]], Spare]:
    """A table of int64 zeros for each thread, and all of them in a queue that jobs take one from and put it back.

    Put together by an operation that knows no order, they say the same whichever thread did what.
    """
    tables, spare = [np.zeros(shape, np.int64) for _ in range(max(1, threads))], Spare()
    for table in tables:
        spare.put(table)
    return tables, spare
