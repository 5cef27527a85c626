"""Thin walls that are to keep their support: whether a job is held to it, and the bands its plan goes down by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from service.stages.cautions import MOST_RATIO, walls_to_cut
from service.stages.preparation import Prepared
from toolpath.counterexamples import HighWall
from toolpath.planning.depth_bands import largest_corner, planes
from verify.surface.slender_walls import thin_walls
from zones.features.wall_slenderness import slender_walls
from zones.model import Wall
from zones.reach.access_view import View

FREE_RATIO = MOST_RATIO
"""Times its thickness that a wall may be free for where it is finished: what is not told of when it stands alone."""
PLANNED_RATIO = 8.0
"""The same in a plan: the layer under a band and how well a wall is measured take the rest."""


def in_turn(ready: Prepared) -> bool:
    """Whether a wall that is cut without support is a finding, and the plan goes down by bands for it.

    Only where all is cut along one axis: what several accesses leave each other no plan knows.
    """
    one_way = len(ready.views) == 1 and ready.inputs.rotary is None
    return ready.inputs.operations.walls_in_turn and one_way


def band_planes(ready: Prepared, view: View, unheld: Sequence[HighWall] = ()) -> tuple[float, ...]:
    """Heights, mm, descending, that all tools of a job finish down to before any goes below (``toolpath.planning.depth_bands``).

    They are for walls over ``FREE_RATIO`` by their profile, from the highest place that neither foot nor connection nor
    bend holds near by, as the proof asks it (``verify.surface.slender_walls``), down to what holds the lowest; what has single places
    over it the proof finds.

    unheld : walls that a proof found without support, known as walls or not
    """
    if not in_turn(ready):
        return ()
    slender = {s.wall: s.thickness for s in slender_walls(view.part, view.tree, walls_to_cut(ready), FREE_RATIO)}
    high = [] if not slender else _free(view, [w for w in ready.decomposition.walls if w.id in slender], slender)
    return planes([*high, *unheld], largest_corner(ready.zones), PLANNED_RATIO)


def _free(view: View, walls: Sequence[Wall], thickness: Mapping[str, float]) -> list[HighWall]:
    """Heights between which nothing of the finished part holds walls near by; thickness : mm, by id."""
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
