"""Fillets where a connection meets walls are part of it: cells, footprints and reasons are those of a plain bar."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import shapely

from geometry.part import Part
from geometry.sampling import sample_surface
from tests.decomposition_shapes import SHAPES, Shape, rounded, to_part
from tests.hand_parts import ball, field_of, view_of
from zones.features.connection_faces import connection_faces, connection_of
from zones.features.decomposition import decompose
from zones.model import Decomposition
from zones.plan_view.channel_plan import footprints
from zones.reach.access_view import View
from zones.remainder.remainder import explain

pytest.importorskip("cadquery")

RADIUS = 0.8


def filleted() -> Shape:
    """The square bar, its edges at both walls rounded: it is 3 x 3 and spans y from -8 to 0."""
    plain = SHAPES["square bar"][0]()
    for y in (-8.0, 0.0):
        plain = rounded(plain, (9.9, y - 0.01, 8.9), (13.1, y + 0.01, 12.1), RADIUS)
    return plain


@cache
def measured(fillets: bool) -> tuple[Part, Decomposition, View, dict[str, float], dict[str, float]]:
    """The part and what stays of it after a ball end: areas by region, and by reason of what faces no sky."""
    part = to_part(filleted() if fillets else SHAPES["square bar"][0]())
    d = decompose(part)
    samples = sample_surface(part.mesh, 30.0, seed=4)
    samples = samples.subset(samples.points[:, 2] > 3.99)
    view = view_of(part, samples, {"T1": field_of(part.mesh, ball(2.0))}, d)
    cells = {n: float(samples.area[view.labels.names == n].sum()) for n in set(view.labels.names.tolist())}
    below = samples.points[:, 2] < 9.0
    rest = explain(samples.subset(below), view.labels.subset(below), [view], d, 0.002)
    why: dict[str, float] = {}
    for item in rest:
        why[item.reason] = why.get(item.reason, 0.0) + item.area
    return part, d, view, cells, why


def test_the_fillets_of_a_bar_are_its_faces():
    part, d, *_ = measured(True)
    fillets = {f for f, r in d.face_role.items() if r == "fillet"}
    own = connection_faces(part, d)
    assert len(fillets) >= 8 and set(own["C1"]) == fillets | set(d.connections[0].faces)
    assert set(connection_of(part, d)) == set(own["C1"])
    plain, e, *_ = measured(False)
    assert connection_faces(plain, e) == {"C1": e.connections[0].faces}


def test_the_footprint_ends_at_the_walls():
    (part, d, *_), (plain, e, *_) = measured(True), measured(False)
    with_fillets, without = footprints(part, d)[0].shape, footprints(plain, e)[0].shape
    assert without.difference(with_fillets.buffer(0.01)).area < 0.01
    # two fillets at either wall: a square less a quarter of a disc each
    grown = 4 * RADIUS**2 * (1 - np.pi / 4)
    assert with_fillets.area - without.area == pytest.approx(grown, abs=0.05)
    assert with_fillets.bounds[1::2] == pytest.approx((-8.0, 0.0), abs=1e-3)
    assert isinstance(with_fillets, shapely.Polygon)


def test_cells_are_those_of_the_plain_bar():
    cells, plain = measured(True)[3], measured(False)[3]
    assert set(cells) == set(plain) >= {"H1 over C1", "H1 under C1", "floor under C1", "C1"}
    # a fillet takes a strip of its radius from wall and bar on every side of it, and covers as much more of the rest
    strip = 2 * (4 * 3.0 * RADIUS + 4 * RADIUS**2) + 2 * RADIUS * 13
    for name in cells:
        assert cells[name] == pytest.approx(plain[name], abs=strip), name


def test_reasons_are_those_of_the_plain_bar():
    why, plain = measured(True)[4], measured(False)[4]
    behind = "undercut behind connection C1"
    assert why[behind] == pytest.approx(plain[behind], abs=2 * (4 * 3.0 * RADIUS + 4 * RADIUS**2))
    assert why[behind] > 50.0 and set(why) == set(plain) and "undercut" in why
    # plain undercut is the underside of the bar alone, and what of its fillets looks down
    assert why["undercut"] <= plain["undercut"] + 8 * 3.0 * RADIUS
