"""Support of thin walls: whether the proof requires it, and the depth bands in which the plan goes down."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from service.stages.cautions import MAX_HEIGHT_RATIO, walls_to_cut
from service.stages.job_part import JobPart
from service.stages.preparation import Prepared
from toolpath.counterexamples import HighWall
from toolpath.planning.depth_bands import largest_corner, planes
from verify.surface.slender_walls import thin_walls
from zones.features.wall_slenderness import slender_walls
from zones.model import Wall
from zones.reach.access_view import View

FREE_RATIO = MAX_HEIGHT_RATIO
"""Free height of a wall where it is finished, over its thickness, dimensionless: lower walls need no support."""
PLANNED_RATIO = 8.0
"""The same in a plan. The difference covers the layer under a band and the error of the measured wall."""


def in_turn(job: JobPart, *, foreign: bool = False) -> bool:
    """Whether a wall that is finished without support is a finding, so that the plan goes down in bands.

    In a plan only where everything is cut along one axis: with several accesses no plan knows what the others leave.

    foreign : whether one program of any origin is proved, which is all that cuts
    """
    one_way = foreign or (len(job.accesses) == 1 and job.inputs.rotary is None)
    return job.inputs.operations.walls_in_turn and one_way


def band_planes(ready: Prepared, view: View, unheld: Sequence[HighWall] = ()) -> tuple[float, ...]:
    """Lower ends of the depth bands, mm, descending, access frame. All tools finish a band before any goes below it.

    Bands are for walls whose profile exceeds ``FREE_RATIO``. They begin at the highest place that no foot, connection
    or bend holds nearby, by the measure of the proof (``verify.surface.slender_walls``), and end at the support of the
    lowest such place. The proof finds single places beyond that. See ``toolpath.planning.depth_bands``.

    unheld : walls that a proof found without support, whether the decomposition has them as walls or not
    """
    if not in_turn(ready):
        return ()
    slender = {s.wall: s.thickness for s in slender_walls(view.part, view.tree, walls_to_cut(ready), FREE_RATIO)}
    high = [] if not slender else _free(view, [w for w in ready.decomposition.walls if w.id in slender], slender)
    return planes([*high, *unheld], largest_corner(ready.zones), PLANNED_RATIO)


def _free(view: View, walls: Sequence[Wall], thickness: Mapping[str, float]) -> list[HighWall]:
    """Heights between which no part of the finished part holds a wall nearby.

    thickness : mm, by id of the wall
    """
    faces = view.samples.face
    places = thin_walls(view.tree, view.samples, FREE_RATIO)
    out = []
    for wall in walls:
        mine = places.free & np.isin(faces[places.row], wall.sides)
        if mine.any():
            z = places.points[mine, 2]
            # what holds the wall below its lowest free place is as far down as a wall may be free
            top, bottom = float(z.max()) + places.spacing, float((z - places.limit[mine]).min()) - places.spacing
            out.append(HighWall(min(top, wall.z_top), max(bottom, wall.z_bottom), thickness[wall.id]))
    return out


__all__ = ["FREE_RATIO", "band_planes", "in_turn"]
