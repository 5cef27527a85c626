"""Depth layers: at each level, lines round obstacles, only where stock is left. Places are tips in mm, access frame."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.lines import Line, pieces_where
from toolpath.passes.contours import contour_pieces, contours, dilated, rings, wall_distance
from toolpath.stock.stock_map import SURE_RIM, StockMap
from zones.lattice import Lattice
from zones.reach.tip_field import LEVEL_TOLERANCE, TipField

ROUND_CORNERS = 3.5  # lattice steps, beyond three allowances: ways round the ends of finished walls have no rim
FLAT_SPACING, ROUND_SPACING = 1.3, 0.8  # of the radius of the flat bottom, and of that of the corner, between rings
ROUND_CUSP = 0.08  # of the radius, height of the cusp between rings of a round end
APART = 2.0  # lattice steps that nodes of one strip are apart, at most half
STOCK_WORTH = 0.05  # mm of stock above the cutter that makes a place worth a pass
EVEN = 0.25  # of the deepest layer, how uneven stock may stay along the axis where it is evened out


def ring_spacing(tool: ToolBody) -> float:
    """Distance between the rings of a layer, mm.

    A flat end leaves nothing between rings less than two radii apart on straight ways. Round a corner of the angle
    theta rings s apart leave an island where s > 2 R sin(theta / 2), so 1.3 R leaves none from 81 degrees on. Between
    rings of a ball the cusp s^2 / (8 r) stays for the next layer, at most 0.3 D deep: 0.8 r keeps it to 0.08 r. Rings
    of a circle segment mill keep it to 0.08 R.
    """
    if tool.arcs is not None:
        return min(FLAT_SPACING * tool.radius, 2.0 * tool.arcs.width(ROUND_CUSP * tool.radius))
    return FLAT_SPACING * (tool.radius - tool.corner_radius) + ROUND_SPACING * tool.corner_radius


def layer_heights(top: float, bottom: float, step: float) -> list[float]:
    """Levels below the top of the stock, mm, evenly no more than ``step`` mm apart, the last one at ``bottom``;
    descending.

    >>> layer_heights(3.0, 0.0, 2.0)
    [1.5, 0.0]
    """
    count = max(1, math.ceil((top - bottom) / step - 1e-9))
    return [top - k * (top - bottom) / count for k in range(1, count)] + [bottom]


def divided(heights: Sequence[float], top: float, spans: Sequence[tuple[float, float]], step: float) -> list[float]:
    """Levels with more of them, evenly, where a layer is deeper than ``step`` and goes through a span; descending.

    heights : mm, of the layers, descending; top : mm, of the stock
    spans   : lowest and highest tip, mm, of areas on which layers leave no higher stairs than ``step``

    >>> divided([2.0, 0.0], 4.0, [(2.5, 3.0)], 1.5)
    [3.0, 2.0, 0.0]
    """
    out: list[float] = []
    for upper, lower in zip([top, *heights], heights, strict=False):
        met = any(low < upper and lower < high for low, high in spans)
        out += layer_heights(upper, lower, step) if met else [lower]
    return out


def between(upper: float, lower: float, step: float) -> list[float]:
    """Heights between two layers, mm, descending, no farther apart than ``EVEN`` of the deepest layer ``step``.

    On an inclined face a layer leaves a stair: over the height h below the layer above, h tan(lean) of stock beside it,
    h sin(lean) along the normal. Cuts between leave no more than that of the height between them.

    >>> between(0.0, -2.0, 2.0)
    [-0.5, -1.0, -1.5]
    >>> between(0.0, -0.5, 2.0)
    []
    """
    count = int(np.ceil((upper - lower) / (EVEN * step) - 1e-9))
    return [upper - k * (upper - lower) / count for k in range(1, count)]


class LayerArea(NamedTuple):
    """Where a layer removes stock.

    area : (ny, nx) bool on the lattice, where this tool has something to finish below, or shank or holder come
    bare : (ny, nx) bool on the lattice, places of the tip within a radius of where no island may stay: shank or holder
           come there in a deeper layer, or no later layer comes to that floor; None: nowhere
    floor : whether it is a layer above a floor, between those of the whole depth
    """

    area: NDArray[np.bool_]
    bare: NDArray[np.bool_] | None = None
    floor: bool = False


class LayerRings(NamedTuple):
    """The rings of a layer, before any of them is cut.

    standing : (ny, nx) bool on the lattice, nodes over which stock stands above the layer
    rings    : lists of lines, those farthest from the walls first
    between  : the same, half a step off
    """

    standing: NDArray[np.bool_]
    rings: Sequence[Sequence[Line]]
    between: Sequence[Sequence[Line]]


def standing_above(field: TipField, stock: StockMap, z: float) -> NDArray[np.bool_]:
    """(ny, nx) bool on the lattice: nodes over which a layer at tip height z, mm, finds stock."""
    return stock.above(z + STOCK_WORTH, field.lattice)


def active_nodes(field: TipField, place: LayerArea, standing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(ny, nx) bool on the lattice: nodes where a layer may have rings.

    standing     : (ny, nx) bool on the lattice, nodes over which the layer finds stock
    field, place : as in ``layer``
    """
    wide = field.tool.radius / field.lattice.step
    return dilated(place.area, wide) & dilated(standing, 2.0 * wide)


def layer_rings(field: TipField, z: float, place: LayerArea, standing: NDArray[np.bool_], allowance: float,
                side_step: float) -> LayerRings:
    """The rings of one layer; they depend on nothing else, so another thread may compute them.

    standing : (ny, nx) bool on the lattice, nodes over which the layer finds stock
    field, z, place, allowance, side_step : as in ``layer``
    """
    active = active_nodes(field, place, standing)
    inwards, between = (list(rings(field, z, active, (first,), side_step))
                        for first in (allowance, allowance + 0.5 * side_step))
    return LayerRings(standing, inwards, between)


def layer(field: TipField, stock: StockMap, z: float, place: LayerArea, allowance: float,
          side_step: float, island: float = 0.0, laid: LayerRings | None = None,
          within: NDArray[np.bool_] | None = None) -> Iterator[list[Line]]:
    """Lines of one layer, ring by ring from the outside of the stock to ``allowance`` from the walls.

    field     : TipField
    stock     : StockMap as it stands; lines appear only where the cutter would meet stock
    z         : mm, tip height of the layer
    place     : LayerArea
    allowance : mm left beside walls
    side_step : mm between rings
    island    : mm, stock between the rings up to which it is left to the next layer, where ``place`` is not bare
    laid      : the rings of this layer for the stock as it was before; used where that still stands
    within    : (ny, nx) bool on the lattice, where lines are wanted, and ``laid`` is used in any case: what was cut
                elsewhere since takes no stock from there; None: everywhere

    Yields
    ------
    list of Line
        The rings farthest from the walls first, so that the cutter comes from air where there is any.
    """
    lat, tool = field.lattice, field.tool
    standing = standing_above(field, stock, z)
    if laid is None or within is None and not np.array_equal(laid.standing, standing):
        laid = layer_rings(field, z, place, standing, allowance, side_step)
    if within is not None:
        laid = LayerRings(laid.standing, *([parts_within(lat, lines, within) for lines in lists]
                                           for lists in (laid.rings, laid.between)))
    beyond = min((SURE_RIM + 0.8) * stock.lattice.step + lat.step, 0.6 * tool.radius)
    walled = bool((field.height > z + LEVEL_TOLERANCE).any())
    worth = _Worth(lat, place.bare, max(STOCK_WORTH, island))
    yield from filter(None, _outwards(stock, tool, laid.rings, beyond, worth) if walled else
                      (_in_stock(stock, tool, lines, _Worth(lat), beyond) for lines in laid.rings))
    # Where rings turn sharply, islands stay between them; rings half a step off take these.
    for lines in laid.between:
        yield from filter(None, [_in_stock(stock, tool, lines, worth, beyond)])


def parts_within(lattice: Lattice, lines: Sequence[Line], within: NDArray[np.bool_] | None) -> list[Line]:
    """The parts of lines whose nearest nodes are in a mask; whole lines where all of them are, or it is None.

    within : (ny, nx) bool on the lattice
    """
    if within is None or not lines:
        return list(lines)
    begins = np.cumsum([0, *(len(line.points) for line in lines[:-1])])
    there = within[lattice.cells(np.vstack([line.points[:, :2] for line in lines]))]
    some, whole = np.logical_or.reduceat(there, begins), np.logical_and.reduceat(there, begins)
    out: list[Line] = []
    for k in np.flatnonzero(some).tolist():
        line, first = lines[k], begins[k]
        out.extend([line] if whole[k] else
                   pieces_where(line, there[first:first + len(line.points)], 0.0, 0.0))
    return out


@dataclass(frozen=True)
class _Worth:
    """Stock above the cutter that makes a place worth a pass, mm: ``STOCK_WORTH`` on a mask, else ``island``."""

    lattice: Lattice
    bare: NDArray[np.bool_] | None = None
    island: float = STOCK_WORTH

    def at(self, points: F64) -> F64 | float:
        """(n,) float64, mm, at tips (n, 3), mm, access frame."""
        if self.bare is None:
            return self.island
        return np.where(self.bare[self.lattice.cells(points[:, :2])], STOCK_WORTH, self.island)


def _outwards(stock: StockMap, tool: ToolBody, lists: Sequence[Sequence[Line]], beyond: float,
              worth: _Worth) -> list[list[Line]]:
    """The parts of rings that are needed, in the same order, the farthest from the walls first.

    They are chosen from the walls outwards: a ring is needed where those nearer to the walls, which come anyway, leave
    stock. ``stock`` is unchanged.
    """
    ways = [line.points[:, :2] for lines in lists for line in lines]
    if not ways:
        return []
    places = np.vstack(ways)
    kept: list[list[Line]] = []
    with stock.undone(np.array([places.min(axis=0) - tool.radius, places.max(axis=0) + tool.radius])):
        for lines in reversed(lists):
            kept.append(_in_stock(stock, tool, lines, worth if kept else _Worth(worth.lattice), beyond))
            for part in kept[-1]:
                stock.cut(part.points, tool)
    return kept[::-1]


def _in_stock(stock: StockMap, tool: ToolBody, lines: Sequence[Line], worth: _Worth, beyond: float) -> list[Line]:
    """The parts of lines with more stock over the cutter than ``worth`` says, ``beyond`` mm more at both ends."""
    return [part for line in lines
            for part in pieces_where(line, stock.overlap(line.points, tool, lower_bound=0.0) > worth.at(line.points),
                                     beyond, 3.0 * tool.radius)]


def rim(field: TipField, stock: StockMap, z: float, area: NDArray[np.bool_], finished: NDArray[np.bool_],
        allowance: float, tolerance: float, unseen: bool, thin: float = 0.0,
        alone: NDArray[np.bool_] | None = None) -> list[Line]:
    """Lines that remove the allowance from walls which no finishing pass of this tool will follow at this height.

    Without them an undercut wall, or one that this tool does not finish, keeps a thin rim. The rim stands higher than
    the flutes of a later, deeper pass and rubs on its neck.

    area      : (ny, nx) bool on the lattice, where this tool has something to finish below
    finished  : (ny, nx) bool on the lattice, where the finish of a wall at this height puts the tool
    z, allowance, tolerance : mm, as in ``layer``; ``tolerance`` of the lines against the true boundary
    unseen    : follow every wall, finished here or not, also where the stock map, coarser than a thin rim, shows none;
                done once a flute length on the way down
    thin      : mm, residual of a finish on the wall: on a steep wall that is high over the cutter and no rim
    alone     : (ny, nx) bool on the lattice, where the tool would touch walls that are not to be machined; None: none
    """
    lat, tool = field.lattice, field.tool
    skip = dilated(finished, 3.0 * allowance / lat.step + ROUND_CORNERS) & ~_slots(field, z, allowance)
    if unseen:
        skip = np.zeros_like(skip)
    if alone is not None:
        skip = skip | alone
    out: list[Line] = []
    for line in contours(field, z, dilated(area, tool.radius / lat.step) & ~skip, tolerance):
        off = SURE_RIM if unseen else -thin / stock.lattice.step
        seen = stock.overlap(line.points, tool, off, lower_bound=0.0) > STOCK_WORTH
        wanted = seen & ~skip[lat.cells(line.points[:, :2])]
        out.extend(pieces_where(line, wanted, 0.5 * tool.radius, 2.0 * tool.radius))
    return out


def strip_lines(field: TipField, z: float, area: NDArray[np.bool_], tips: F64, allowance: float,
                tolerance: float) -> list[Line]:
    """Lines of a layer along strips too narrow for a ring, whatever stands there.

    area : (ny, nx) bool on the lattice, where this tool has something to finish below
    tips : (n, 3) float64, mm, of samples to finish, access frame: those below show strips that nodes do not meet
    z, allowance, tolerance : mm, as in ``rim``
    """
    lat, tool = field.lattice, field.tool
    free = (field.height <= z + LEVEL_TOLERANCE) & dilated(area, tool.radius / lat.step)
    # a ring less than a step from the middle of its strip falls to pieces, and so do the nodes of a narrow strip
    narrow = _beside_no_ring(field, z, allowance + lat.step, free | lat.mask(tips[tips[:, 2] <= z, :2]))
    mine = dilated(narrow, APART)
    return contour_pieces(field, z, mine, mine, 0.5 * tool.radius, 2.0 * tool.radius, tolerance)


def strips_in_stock(lines: Sequence[Line], stock: StockMap, tool: ToolBody, allowance: float) -> Iterator[Line]:
    """The parts of lines of ``strip_lines`` where more stands than rims are made for.

    Stock is left to the rims, and to the second wall of a strip, where it is no thicker than twice the allowance, mm.

    Yields
    ------
    Line
        Where stock stands when it is asked for.
    """
    for line in lines:
        seen = stock.overlap(line.points, tool, -2.0 * allowance / stock.lattice.step - SURE_RIM, lower_bound=0.0)
        yield from pieces_where(line, seen > STOCK_WORTH, 0.5 * tool.radius, 2.0 * tool.radius)


def _slots(field: TipField, z: float, allowance: float) -> NDArray[np.bool_]:
    """(ny, nx) bool: free places in strips too narrow for a ring; their walls are all there is to follow."""
    return _beside_no_ring(field, z, allowance, field.height <= z + LEVEL_TOLERANCE)


def _beside_no_ring(field: TipField, z: float, allowance: float, places: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(ny, nx) bool: those of some places that no ring comes beside which goes ``allowance`` mm from the walls."""
    blocked = field.nearest_blocked(z)
    if blocked is None:
        return np.zeros_like(places)
    lat = field.lattice
    off, reach = blocked[0], allowance / lat.step + 1.0
    sure = off >= allowance + lat.step
    # exact distances are asked for only where those of the nodes leave a doubt, which is nowhere on most parts
    left = places & ~dilated(sure, reach)
    if not left.any():
        return left
    walls = wall_distance(field, z, ~sure & (off >= allowance) & dilated(left, reach))
    return left if walls is None else left & ~dilated(sure | (walls >= allowance), reach)
