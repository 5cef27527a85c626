"""Approach cones: the directions from which a zone can be machined with its tool."""

from __future__ import annotations

import numpy as np

from service.stages.preparation import Prepared
from zones.reach.approach_cones import Cone, approach, directions_over_hemisphere, zone_cone
from zones.zoning.zones import ZoneArea

CONE_SAMPLES = 40  # of a zone that a cone is measured at
CONE_DIRECTIONS = 91  # over the half sphere around the access
CONE_SEED = 3


def cone_of(ready: Prepared, zone: ZoneArea) -> Cone | None:
    """The approach cone of a zone with its tool, in the setup frame; it holds the axis that the zone is cut along.

    None where that axis itself reaches less than 98 % of the sampled area.
    """
    view = ready.view(zone.access)
    rows = np.flatnonzero(view.samples.area[zone.samples] > 0)
    if len(rows) > CONE_SAMPLES:
        rows = np.sort(np.random.default_rng(CONE_SEED).choice(rows, CONE_SAMPLES, replace=False))
    if not len(rows):
        return None
    few = view.samples.subset(zone.samples[rows])
    directions = directions_over_hemisphere(CONE_DIRECTIONS)
    got = approach(view.obstacles, zone.tool, ready.inputs.clearances, few.points, few.normals, directions,
                   ready.lift, ready.inputs.quality.stock_allowance_mm, zone.tips[rows])
    cone = zone_cone(got, few.area, directions, holds_first=True)
    return None if cone is None else Cone(view.back(cone.axis), cone.half_angle, cone.share, cone.resolution)


__all__ = ["cone_of"]
