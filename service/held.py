"""Thin walls that are to keep their support: whether a job is held to it, and the bands its plan goes down by."""

from __future__ import annotations

from collections.abc import Sequence

from service.cautions import MOST_RATIO, walls_to_cut
from service.convert import rotary_machine
from service.prepare import Prepared
from toolpath.bands import HighWall, largest_corner, planes
from zones.thinness import slender_walls
from zones.view import View

FREE_RATIO = MOST_RATIO
"""Times its thickness that a wall may be free for where it is finished: what is not told of when it stands alone."""
PLANNED_RATIO = 8.0
"""The same in a plan: the layer under a band and how well a wall is measured take the rest."""


def in_turn(ready: Prepared) -> bool:
    """Whether a wall that is cut without support is a finding, and the plan goes down by bands for it.

    Only where all is cut along one axis: what several accesses leave each other no plan knows.
    """
    one_way = len(ready.views) == 1 and rotary_machine(ready.setup.machine) is None
    return ready.setup.operations.walls_in_turn and one_way


def band_planes(ready: Prepared, view: View, unheld: Sequence[HighWall] = ()) -> tuple[float, ...]:
    """Heights, mm, descending, that all tools of a job finish down to before any goes below (``toolpath.bands``).

    They are for walls over ``FREE_RATIO`` by their profile; what has single places over it the proof finds.

    unheld : walls that a proof found without support, known as walls or not
    """
    if not in_turn(ready):
        return ()
    span = {w.id: (w.z_top, w.z_bottom) for w in ready.decomposition.walls}
    high = [HighWall(*span[s.wall], s.thickness)
            for s in slender_walls(view.part, view.tree, walls_to_cut(ready), FREE_RATIO)]
    return planes([*high, *unheld], largest_corner(ready.zones), PLANNED_RATIO)


__all__ = ["FREE_RATIO", "band_planes", "in_turn"]
