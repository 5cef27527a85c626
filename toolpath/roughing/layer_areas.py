"""Where depth layers remove stock, as areas of the lattice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from toolpath.passes.contours import dilated
from toolpath.strategies.depth_layers import LayerArea
from zones.reach.tip_field import TipField


def at_or_under(field: TipField, tips: F64, z: float) -> NDArray[np.bool_]:
    """(ny, nx) bool: nodes near those tips that lie at a height or lower.

    tips : (n, 3) float64, mm, access frame, of the samples to finish; z : mm
    """
    lat = field.lattice
    mask = lat.mask(tips[tips[:, 2] <= z + 1e-6, :2])
    return dilated(mask, max(0.5 * field.tool.radius / lat.step, 1.5)) if mask.any() else mask


def cleared(field: TipField, layers: Sequence[tuple[float, LayerArea]], level: F64) -> list[tuple[float, LayerArea]]:
    """Heights, mm, descending, and areas of layers, bare also over floors that no later layer comes to.

    What a layer leaves there between its rings the finish of the floor would have to cut, as deep as the layer.

    level : (n, 3) float64, mm, access frame: tips above the samples of floors by what layers leave there
    """
    lat, radius = field.lattice, field.tool.radius
    out: list[tuple[float, LayerArea]] = []
    whole = between = lat.mask(np.zeros((0, 2)))
    for z, place in layers[::-1]:
        last = dilated(at_or_under(field, level, z) & ~(whole | between), radius / lat.step)
        bare = last if place.bare is None else place.bare | last
        out.append((z, place._replace(bare=_same(bare, out[-1][1].bare if out else None))))
        whole, between = (whole, between | place.area) if place.floor else (place.area, lat.mask(np.zeros((0, 2))))
    return out[::-1]


def layer_areas(field: TipField, tips: F64, heights: Sequence[float], step: float) -> list[LayerArea]:
    """For each layer, where stock is removed down to it.

    That is where this tool has something to finish below, and where shank and holder come once the tool is down in
    any deeper layer, since stock there would meet them.

    tips    : (n, 3) float64, mm, access frame, of the samples to finish
    heights : mm, of the layers, descending; step : mm, of the deepest one
    """
    lat = field.lattice
    out: list[LayerArea] = []
    rising = list(heights[::-1])
    for z in rising:
        own, met = at_or_under(field, tips, z), lat.mask(np.zeros((0, 2)))
        for disc in field.discs:
            low = z + step - disc.height
            deeper = [k for k in range(len(out)) if rising[k] <= low]
            reach = at_or_under(field, tips, low) | out[deeper[-1]].area if deeper else at_or_under(field, tips, low)
            if reach.any():
                met = met | dilated(reach, field.disc_radius(disc, 0.0) / lat.step)
        bare = dilated(met, field.tool.radius / lat.step)
        known = out[-1] if out else LayerArea(own)
        out.append(LayerArea(_same(own | met, known.area), _same(bare, known.bare)))
    return out[::-1]


def _same(mask: NDArray[np.bool_], known: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
    """The known mask where both are equal: layers between upright walls share one, and its memory."""
    return known if known is not None and np.array_equal(known, mask) else mask


__all__ = ["at_or_under", "cleared", "layer_areas"]
