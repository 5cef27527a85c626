"""The depth layers of one tool: the stock above all its zones, removed band by band."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.cutting_mechanics import diameter_in_cut
from geometry.mesh import F64
from toolpath.feeds.feed_scheduling import Pace
from toolpath.five_axis.oriented_motion import THICK
from toolpath.lines import Line
from toolpath.linking.linker import Linker
from toolpath.linking.ways_in import FLUTE_SHARE
from toolpath.passes.contours import dilated
from toolpath.passes.pass_order import nearest_order
from toolpath.plan_checkpoint import (
    LayersSnapshot,
)
from toolpath.plan_settings import CutData, LeftAlone, PlanSettings
from toolpath.planning.zone_finishing import motions_of, step_of, turned
from toolpath.roughing.engagement_limited_clearing import Clearing
from toolpath.roughing.layer_areas import at_or_under, cleared, layer_areas
from toolpath.roughing.layers_over_floors import Columns, Floors, even_between, left_to_floors
from toolpath.roughing.loose_pieces import loose_pieces
from toolpath.roughing.rings_ahead import RingsAhead
from toolpath.roughing.separate_places import Place, SeparatePlaces, nearest_first
from toolpath.roughing.sized_walls import SizedWalls
from toolpath.stock.cut_history import Depths
from toolpath.stock.engagement import SKIN_SHARE, UNBOUNDED
from toolpath.stock.stock_map import SURE_RIM, StockMap
from toolpath.strategies import curvature_matched, depth_layers
from toolpath.strategies.depth_layers import LayerArea, LayerRings
from toolpath.tool_deflection import left_by_layers
from toolpath.workingsteps import Workingstep
from zones.machinable_area import AreaForm
from zones.reach.tip_field import TipField, contact_tips
from zones.zoning.zones import ZoneArea

WALL = 0.9  # part of a unit normal along the access: faces with more are no walls
ISLAND = 0.8  # of a layer: stock between rings that is left to the next one, unless even stock is asked for
LOOSE = 2.0  # of the tolerance of leaving out points: an arc through them finds room (docs/theory/arcs.md)
LOOSE_SHARE = 0.25  # of the allowance, at most, that arcs of the layers leave them by
TILTED_LAYERS = 2.0  # goes in which a tilted end takes the stairs of the layers: more take longer than a layer more
THROUGH = 1e-3  # mm: as near as that to the underside of the blank a tool is through
MAX_HELD = 2**28  # nodes of all layers that are laid out at a time
_NOWHERE = np.zeros((0, 0), np.bool_)
THIN = 2.0  # scallops: thickness on a wall that a finish leaves


class _Layer(NamedTuple):
    """A layer of a band.

    z      : mm, tip height
    place  : LayerArea
    deep   : mm, depth above the layer to which its rims take walls to size; None where it has no rims
    unseen : rims follow every wall, as in ``depth_layers.rim``
    """

    z: float
    place: LayerArea
    deep: float | None
    unseen: bool


class ToolLayers:
    """The stock above all zones of a tool, removed in depth layers, some of them at a time."""

    def __init__(self, zones: Sequence[ZoneArea], field: TipField, cut: CutData, stock: StockMap,
                 settings: PlanSettings, depths: Depths, under: float,
                 snapshot: LayersSnapshot | None = None) -> None:
        self.zones, self.field, self.cut, self.stock = zones, field, cut, stock
        self.settings, self.depths = settings, depths
        lat, tool = field.lattice, field.tool
        self.tips = tips = np.vstack([z.tips for z in zones])
        self.allowance = left_by_layers(cut.step_down, lat.step)
        # rims are no higher than the tool bears, at the stock that layers leave
        self.rim_depth = (cut.finish or cut).bearable(FLUTE_SHARE * tool.flute_length, self.allowance)
        # without a finish, rims take every wall to size layer by layer, while the stock below still supports it
        steep = [z.tips for z in zones if z.form is AreaForm.STEEP and settings.finishing]
        self.walls = np.vstack([np.zeros((0, 3)), *steep])
        self.alone, self.alone_wide = _left_alone(settings.left_alone, field, tips)
        self.bounded = cut.engaged < UNBOUNDED
        # the finish of a floor has the whole front of the cutter in the allowance
        low = min(self.allowance, 0.5 * SKIN_SHARE * tool.radius) if self.bounded else self.allowance
        bottom, step = float(tips[:, 2].min()) + low, cut.step_down
        self.top = top = stock.highest if snapshot is None else snapshot.top
        self.swept, self.above = (top, top) if snapshot is None else (snapshot.swept, snapshot.above)
        self.left: list[tuple[float, LayerArea]] = []
        self.loose = lat.mask(np.zeros((0, 2)))
        if top <= bottom:
            return
        level = np.vstack([np.zeros((0, 3)), *(z.tips for z in zones if z.form is AreaForm.LEVEL)]) + [0.0, 0.0, low]
        floors = Floors.of(level[(level[:, 2] > bottom + 1e-3) & (level[:, 2] < top)], stock, tool.radius,
                           left_to_floors(cut.finish or cut, tool, low, step))
        if snapshot is None:
            ends = even_between(top, bottom, Columns.of(tips, stock, tool.radius, cut), floors)
            heights = self._heights(ends, under)
            found = dict(floors.left_by([top, *heights]))
        else:  # the stock is no longer that by which they were chosen
            heights = snapshot.heights.tolist()
            found = {z: t for z, t in floors.by_height if z in snapshot.floors}
        places = layer_areas(field, tips, heights, step)
        through = float(tips[:, 2].min())
        if snapshot is not None:
            self.loose = snapshot.loose
        elif through <= settings.underside + THROUGH:
            self.loose = loose_pieces(field, stock, heights[-1], places[-1].area)
        if self.loose.any():
            places = [p._replace(area=p.area | self.loose) for p in places]
        deeper = {z: places[next(k for k, h in enumerate(heights) if h < z)] for z in found}
        own = [(z, LayerArea(at_or_under(field, t, z), deeper[z].bare, floor=True)) for z, t in found.items()]
        if self.loose.any() and (snapshot is None or through in snapshot.floors):  # else a skin stays under them
            own.append((through, LayerArea(self.loose, floor=True)))
        layers = sorted([*zip(heights, places, strict=True), *own], key=itemgetter(0), reverse=True)
        self.left = cleared(field, layers, level)

    def _heights(self, ends: Sequence[float], under: float) -> list[float]:
        """Heights of the whole layers, mm, descending: even between ``ends``, and what else asks for one."""
        settings, tool, (top, bottom) = self.settings, self.field.tool, (ends[0], ends[-1])
        heights = [z for a, b in pairwise(ends) for z in depth_layers.layer_heights(a, b, self.cut.step_down)]
        if settings.turning is not None and settings.finishing and curvature_matched.suits(tool):
            spans = [(float(z.tips[:, 2].min()), float(z.tips[:, 2].max())) for z in self.zones
                     if z.form is AreaForm.SHALLOW]
            heights = depth_layers.divided(heights, top, spans, TILTED_LAYERS * THICK * tool.diameter)
        also = [z for z in (plane - under for plane in settings.planes) if bottom < z < top]
        return sorted({*heights, *also}, reverse=True) if also else heights

    def snapshot(self) -> LayersSnapshot:
        """State of the layers."""
        return LayersSnapshot(self.top, self.swept, self.above, np.array([z for z, p in self.left if not p.floor]),
                              np.array([z for z, p in self.left if p.floor]), self.loose)

    def down_to(self, lowest: float, number: int, sized: SizedWalls, settle: Callable[[], None]) -> list[Workingstep]:
        """The layers from ``lowest`` mm up that were not cut before, as one workingstep.

        number : of the first workingstep
        sized  : SizedWalls, which get no rims
        settle : called before each layer

        Where even stock is required the cuts between them follow as another workingstep.
        """
        field, cut, settings = self.field, self.cut, self.settings
        linker = self._linker()
        between: list[float] = []
        with RingsAhead(field, self.allowance, depth_layers.ring_spacing(field.tool)) as ahead:
            while stretch := self._stretch(lowest):
                for one in stretch:
                    if not one.place.floor:
                        between.extend(depth_layers.between(self.above, one.z, cut.step_down))
                        self.above = one.z
                self._cut_stretch(linker, stretch, ahead, sized, settle)
        if not self.left:
            field.forget()
        made = self._step(number, "roughing", linker)
        if not settings.semi_finishing:
            return made
        linker = self._linker()
        for z in between:
            self._walk(linker, z, LayerArea(at_or_under(field, self.tips, z)))
        return made + self._step(number + len(made), "semi_finishing", linker)

    def _stretch(self, lowest: float) -> list[_Layer]:
        """The next layers of a band, with their rims, taken from those left; ``lowest`` as in ``down_to``."""
        lat, settings = self.field.lattice, self.settings
        out: list[_Layer] = []
        for _ in range(max(1, MAX_HELD // (lat.nx * lat.ny))):
            if not self.left or self.left[0][0] < lowest - 1e-9:
                break
            z, place = self.left.pop(0)
            # rims are due where the flutes do not reach up to them from a deeper layer of this band
            unseen = z <= self.swept - self.rim_depth
            last = not any(a >= lowest - 1e-9 and not p.floor for a, p in self.left)
            deep = None
            if not place.floor and (not settings.finishing or unseen or last):
                deep = self.cut.step_down + (self.rim_depth if unseen or settings.finishing else 0.0)
                self.swept = z if unseen else self.swept
            out.append(_Layer(z, place, deep, unseen))
        return out

    def _cut_stretch(self, linker: Linker, stretch: Sequence[_Layer], ahead: RingsAhead, sized: SizedWalls,
                     settle: Callable[[], None]) -> None:
        """Cut layers, in each separate place all of them before the next.

        sized, settle : as in ``down_to``
        """
        field, stock, settings = self.field, self.stock, self.settings
        island = 0.0 if settings.semi_finishing else ISLAND * self.cut.step_down
        # where the engaged angle is bounded, its fronts go through all places of a layer
        places = None if self.bounded or len(stretch) < 2 else SeparatePlaces(field, stock,
                                                                              [(one.z, one.place) for one in stretch])
        laid: dict[int, tuple[list[Line], LayerRings | None]] = {}
        spared: dict[int, NDArray[np.uint8]] = {}  # packed: there are many layers

        def lines_of(k: int, *, shared: bool) -> tuple[list[Line], LayerRings | None]:
            """Lines along strips, and rings, of a layer; shared: several places ask for them."""
            if k not in laid:
                z, place = stretch[k].z, stretch[k].place
                strips = depth_layers.strip_lines(field, z, place.area, self.tips, self.allowance,
                                                  settings.budget.chord)
                rings = ahead.of(z)
                if shared:
                    standing = depth_layers.standing_above(field, stock, z)
                    if rings is None or not np.array_equal(rings.standing, standing):
                        rings = depth_layers.layer_rings(field, z, place, standing, self.allowance,
                                                         depth_layers.ring_spacing(field.tool))
                if k + 1 < len(stretch) and not self.bounded:
                    ahead.begin(stretch[k + 1].z, stretch[k + 1].place, stock)
                if not shared:
                    return strips, rings
                assert rings is not None
                laid[k] = strips, rings._replace(standing=_NOWHERE)  # not looked at, and there are many layers
            return laid[k]

        def spared_of(k: int) -> NDArray[np.bool_]:
            """Where a layer gets no rims, (ny, nx) bool."""
            if k not in spared:
                spared[k] = np.packbits(self._without_rims(stretch[k], sized))
            lat = field.lattice
            return np.unpackbits(spared[k], count=lat.nx * lat.ny).view(np.bool_).reshape(lat.ny, lat.nx)

        def go_down(first: int, place: Place | None) -> None:
            mask = None if place is None else place.mask
            for k in range(first, len(stretch)):
                apart = [] if places is None else places.of(k, place)
                for one in nearest_first(apart, linker.at):
                    go_down(k, one)
                if apart:
                    return
                settle()
                stock.settle()
                strips, rings = lines_of(k, shared=mask is not None)
                mine = depth_layers.parts_within(field.lattice, strips, mask)
                for line in depth_layers.strips_in_stock(mine, stock, field.tool, self.allowance):
                    linker.add(turned(line, settings))
                self._walk(linker, stretch[k].z, stretch[k].place, island, rings, mask)
                if stretch[k].deep is not None:
                    self._cut_rims(linker, stretch[k], spared_of(k), mask)

        go_down(0, None)

    def _without_rims(self, one: _Layer, sized: SizedWalls) -> NDArray[np.bool_]:
        """Where a layer gets no rims because of faces left alone or walls that are finished, (ny, nx) bool."""
        lat = self.field.lattice
        alone = lat.mask(self.alone[np.abs(self.alone[:, 2] - one.z) <= 2.0 * self.cut.step_down, :2])
        at_size = sized.along(lat, one.z + self.field.tool.end_height, one.z + (one.deep or 0.0))
        return np.asarray(dilated(alone, self.alone_wide / lat.step) | at_size)

    def _cut_rims(self, linker: Linker, one: _Layer, spared: NDArray[np.bool_],
                  within: NDArray[np.bool_] | None) -> None:
        """Cut the rims of a layer.

        spared : (ny, nx) bool, where it gets none; within : the same, where they are wanted, None: everywhere
        """
        field, cut, settings, lat, z = self.field, self.cut, self.settings, self.field.lattice, one.z
        assert one.deep is not None
        finished = lat.mask(self.walls[np.abs(self.walls[:, 2] - z) <= 2.0 * cut.step_down, :2])
        area = one.place.area if within is None else one.place.area & within
        rims = depth_layers.rim(field, self.stock, z, area, finished, self.allowance, settings.budget.chord,
                                one.unseen, min(THIN * settings.scallop_height, 0.5 * self.allowance)
                                if settings.finishing else 0.0, spared)
        usual, linker.pace = linker.pace, self._rim_pace(one.deep)
        for line in nearest_order(depth_layers.parts_within(lat, rims, within), linker.at, False):
            linker.add(turned(line, settings))
        linker.pace = usual

    def _rim_pace(self, deepest: float) -> Pace:
        """Feeds along a wall that is taken to size down to a depth, mm: deflecting the tool no more than a finish may.

        Beside a wall stands no more than the allowance, and no higher than the wall or stock within a node of the
        cutter, or ``deepest``. What the lattice hides is no wider than the lattice can hide, and as deep as that. A
        slot too narrow for a ring has only a rim: there the feed is that of layers.
        """
        cut, tool, hides = self.cut, self.field.tool, SURE_RIM * self.field.lattice.step
        fine = cut.finish or cut
        hidden = fine.under(deepest, hides).feed

        def seen(deep: float, angle: float) -> float:
            wide = 0.5 * tool.diameter * (1.0 - math.cos(angle)) + hides
            beside = fine.under(min(deep, deepest), min(wide, self.allowance)).feed
            return min(beside, hidden, cut.feed_under(tool, deep, angle))

        return Pace(min(cut.feed, fine.under(deepest, self.allowance).feed), cut.link_feed, seen, cut.step_down, hidden,
                    SURE_RIM)

    def _thinner(self) -> CutData:
        """The cut of the stock between layers: a slot at most, a part of a layer deep."""
        depth = depth_layers.EVEN * self.cut.step_down
        return self.cut.under(depth, 0.5 * diameter_in_cut(self.field.tool, depth))

    def _linker(self) -> Linker:
        cut, tool = self.cut, self.field.tool
        pace = Pace(cut.feed, cut.link_feed, partial(cut.feed_under, tool), cut.step_down)
        return Linker(self.field, self.stock, motions_of(cut, self.settings), self.depths, self.settings.found, pace,
                      cut.engaged)

    def _walk(self, linker: Linker, z: float, place: LayerArea, island: float = 0.0,
              laid: LayerRings | None = None, within: NDArray[np.bool_] | None = None) -> None:
        """Cut the stock above a height, mm, in an area, down to it; ``island`` mm of it may stay between rings.

        laid, within : as in ``depth_layers.layer``
        """
        settings, side, fine = self.settings, depth_layers.ring_spacing(self.field.tool), 0.1 * self.field.lattice.step
        linker.go.loose = min(LOOSE * fine, LOOSE_SHARE * self.allowance)
        if self.bounded:
            Clearing(linker, z, place.area, self.allowance, side, settings.cut_direction,
                     depth_layers.STOCK_WORTH, fine).walk()
        for lines in depth_layers.layer(self.field, self.stock, z, place, self.allowance, side, island, laid, within):
            for line in nearest_order(lines, linker.at, False):
                linker.add(turned(line, settings), fine)
        linker.go.loose = 0.0

    def _step(self, number: int, operation: str, linker: Linker) -> list[Workingstep]:
        """The passes of a linker as a workingstep; none without passes."""
        if not linker.passes:
            return []
        step_id, tool, ids = f"S{number:02d}", self.field.tool, " ".join(z.id for z in self.zones)
        kind, cut = ("depth_layers", self.cut) if operation == "roughing" else ("between layers", self._thinner())
        return [step_of(step_id, f"{step_id} {kind} {tool.id} {ids}", None, self.zones, operation, "depth_layers", tool,
                        cut, depth_layers.ring_spacing(tool), linker.finish(), self.settings)]


def _left_alone(faces: LeftAlone | None, field: TipField, tips: F64) -> tuple[F64, float]:
    """Tips that touch walls the setup does not let machine, (n, 3) float64, mm, and mm that a mask of them is grown by.

    tips : (k, 3) float64, mm, of the samples to finish

    Not those from which the tool finishes a floor or another wall: there a thin rim would stand in its way.
    """
    if faces is None:
        return np.zeros((0, 3)), 0.0
    walls = np.abs(faces.normals[:, 2]) < WALL
    touching = contact_tips(field.tool, faces.points[walls], faces.normals[walls], field.allowance)
    wide = faces.spacing + 1.5 * field.lattice.step
    near = cKDTree(tips[:, :2]).query(touching[:, :2], distance_upper_bound=wide)[0]
    return touching[~np.isfinite(near)], wide


__all__ = ["ToolLayers"]
