"""A job with a thin wall says so in the dry check; where it stands is said in the setup frame."""

from __future__ import annotations

import json

import pytest

from service import pipeline
from service.from_wire import parse_setup
from service.stages.cautions import thin_walls
from service.stages.preparation import prepare
from tests.decomposition_shapes import box, plate

cq = pytest.importorskip("cadquery")

FLAT = {"id": "T1", "number": 1, "kind": "flat", "diameter_mm": 6, "flutes": 4}


@pytest.fixture(scope="module")
def step(tmp_path_factory):
    path = tmp_path_factory.mktemp("thin") / "thin.step"
    cq.exporters.export(plate().union(box(40, 1.0, 15, 0, 0, 3)).union(box(40, 3.0, 15, 0, -12, 3)), str(path))
    return path


def setup(**changes):
    return parse_setup(json.dumps({"tools": [FLAT], **changes}))


def test_the_dry_check_names_the_thin_wall_only(step):
    told = [w for w in pipeline.zones_only(step, setup(), lambda *_: None)["part"]["warnings"] if "thick" in w]
    assert len(told) == 1
    assert told[0].startswith("wall W2 is 1.00 mm thick and 14.00 high near X") and "14.0 to 1" in told[0]


def test_the_place_is_that_of_the_setup_frame(step):
    moved = setup(placement={"origin_mm": [100, 0, 0], "z_axis": [0, 0, 1], "x_axis": [0, 1, 0]})
    ready = prepare(step, moved, lambda *_: None)
    (told,) = thin_walls(ready)
    assert told.kind == "thin_wall" and told.measured == pytest.approx(14.0) and told.limit == 10.0
    assert told.at is not None
    x, y, z = told.at  # of the file: x from 0 to 40, y 0 or 1
    assert 60.0 <= y <= 100.0 and min(abs(x), abs(x - 1.0)) < 1e-6 and 4.0 <= z <= 18.0


def test_walls_nobody_asks_to_cut_are_not_told_of(step):
    ready = prepare(step, setup(), lambda *_: None)
    wall = next(w for w in ready.decomposition.walls if w.thickness < 2.0)
    left_out = setup(operations={"exclude_faces": [f"F{n}" for n in wall.faces]})
    assert thin_walls(prepare(step, left_out, lambda *_: None)) == []
