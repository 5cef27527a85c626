"""Rays from a side that meet the border of another one, found backwards from the border."""

from __future__ import annotations

import numpy as np
import pytest

from geometry.part import Part
from tests.decomposition_shapes import box, plate, to_part
from zones.features.channels import _Field
from zones.features.decomposition import decompose
from zones.features.face_graph import FaceGraph

pytest.importorskip("cadquery")

RADIUS = 4.0


def ring_and_wall(away: float) -> Part:
    """A ring of radius 4 about Z, 13 high, and a lower straight wall whose near side is at y = away."""
    import cadquery as cq

    ring = cq.Workplane().circle(RADIUS).circle(3.2).extrude(13).translate((0, 0, 3.5))
    return to_part(plate().union(ring).union(box(6, 1, 9, -3, away, 3.5)))


@pytest.mark.parametrize("away", [6.0, 12.0, 20.0])
def test_rays_from_a_side_that_bulges_meet_a_border_however_far_away(away: float) -> None:
    part = ring_and_wall(away)
    d, graph = decompose(part), FaceGraph(part)
    ring, straight = sorted(range(2), key=lambda k: part.mesh.triangles[
        np.isin(part.mesh.face_ids, d.walls[k].faces)].mean(axis=(0, 1))[1])
    field = _Field(graph, [np.array(w.sides) - 1 for w in d.walls], np.zeros(graph.n, bool))
    border = field.walls[straight].border
    at = border.places()
    q = border.points(at, 0.0)
    length, start, foot = field.to_border(ring, straight, 40.0)(q, border.triangle[at.piece])
    front = (np.abs(q[:, 1] - away) < 1e-6) & (q[:, 2] > 4.5)
    got = front & np.isfinite(length)
    assert front.sum() > 100 and got.sum() > 0.98 * front.sum()  # a ray along the edge of a facet may be lost
    assert length[got] == pytest.approx(np.hypot(q[got, 0], q[got, 1]) - RADIUS, rel=1e-3)
    assert np.linalg.norm(foot - q, axis=1)[got].max() < 0.01
    assert np.hypot(start[got, 0], start[got, 1]) == pytest.approx(RADIUS, abs=0.01)
