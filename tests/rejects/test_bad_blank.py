"""Blanks and fixtures that contradict the part are refused before anything is planned."""

from copy import copy
from types import SimpleNamespace

import numpy as np
import pytest

from geometry.errors import CamError, SetupError
from geometry.mesh import TriangleMesh
from geometry.part import OtherSolid
from service.errors import problem_document
from service.from_wire import parse_setup
from service.stages.blank_checks import check_against_part
from service.stages.blank_model import blank_of
from service.stages.job_inputs import JobInputs
from tests.unit.geometry.mesh_queries.test_box_overlap import block

TOOLS = [{"id": "T1", "kind": "ball", "diameter_mm": 3}]
PART = SimpleNamespace(mesh=block([-10, -5, 0], [10, 5, 8]), bounds=np.array([[-10.0, -5, 0], [10, 5, 8]]),
                       volume=20.0 * 10 * 8, others=())


def checked(setup, part):
    check_against_part(setup, part, blank_of(setup, part))


def refused(code, **fields):
    with pytest.raises(SetupError) as caught:
        checked(parse_setup({"tools": TOOLS, **fields}), PART)
    found = caught.value
    assert found.code == code, found.message
    assert found.remedy and found.subjects
    document = problem_document(found)
    assert document["status"] == 422 and document["type"] == f"urn:zonemill:problem:bad-setup:{code}"
    return found


def accepted(**fields):
    checked(parse_setup({"tools": TOOLS, **fields}), PART)


@pytest.mark.parametrize(("corner", "axis", "side"), [
    (0, 0, "-X"), (0, 1, "-Y"), (0, 2, "-Z"), (1, 0, "+X"), (1, 1, "+Y"), (1, 2, "+Z")])
def test_a_box_the_part_stands_out_of(corner, axis, side):
    box = [[-12.0, -7.0, -1.0], [12.0, 7.0, 9.0]]
    box[corner][axis] = float(PART.bounds[corner][axis]) + (0.02 if corner == 0 else -0.02)
    found = refused("stock_misses_part", stock={"kind": "box", "box_mm": box})
    assert found.subjects == ("stock.box_mm", side) and side in found.message
    assert found.measured == pytest.approx(0.02) and found.limit == 0
    box[corner][axis] += -0.015 if corner == 0 else 0.015
    accepted(stock={"kind": "box", "box_mm": box})


def test_a_box_somewhere_else_names_every_side_the_worst_first():
    found = refused("stock_misses_part", stock={"kind": "box", "box_mm": [[100, 0, 0], [150, 50, 20]]})
    assert found.subjects == ("stock.box_mm", "-X", "-Y") and found.measured == 110
    assert "-10.000 to 10.000" in found.remedy


def test_uncertainty_does_not_make_a_box_hold_the_part():
    refused("stock_misses_part", stock={"kind": "box", "box_mm": [[-9, -5, 0], [10, 5, 9]], "uncertainty_mm": 5})


def test_no_stock():
    refused("no_stock", stock={"margin_mm": 0, "uncertainty_mm": 0})
    accepted(stock={"margin_mm": 0, "uncertainty_mm": 0.1})
    box = {"kind": "box", "margin_mm": 0, "uncertainty_mm": 0}
    refused("no_stock", stock=box)
    refused("no_stock", stock={**box, "box_mm": PART.bounds.tolist()})
    accepted(stock={**box, "uncertainty_mm": 0.5, "box_mm": PART.bounds.tolist()})


def test_a_box_at_finished_size_round_a_part_with_pockets_is_stock():
    pocketed = SimpleNamespace(mesh=PART.mesh, bounds=PART.bounds, volume=0.9 * PART.volume, others=())
    checked(parse_setup({"tools": TOOLS, "stock": {"kind": "box", "margin_mm": 0, "uncertainty_mm": 0}}), pocketed)


@pytest.mark.parametrize("allowance", [5.0, 1.5])
def test_an_allowance_beyond_the_stock(allowance):
    found = refused("allowance_beyond_stock", quality={"stock_allowance_mm": allowance})
    assert (found.measured, found.limit) == (allowance, 1.5)
    assert f"{allowance:g}" in found.message and "1.5 mm" in found.message
    accepted(quality={"stock_allowance_mm": 1.4})
    accepted(quality={"stock_allowance_mm": 1.5}, stock={"kind": "box"})
    refused("allowance_beyond_stock", quality={"stock_allowance_mm": 1.6}, stock={"kind": "box"})
    accepted(quality={"stock_allowance_mm": allowance}, stock={"margin_mm": 5})


SIDES = {"-X": (0, 0), "-Y": (0, 1), "+X": (1, 0), "+Y": (1, 1), "+Z": (1, 2)}


def holding(side, room):
    """A box that stands 3 mm off the part, flush under it, and ``room`` mm off it on one side; it is as it says."""
    corner, axis = SIDES[side]
    box = [[-13.0, -8.0, 0.0], [13.0, 8.0, 11.0]]
    box[corner][axis] = float(PART.bounds[corner][axis]) + (room if corner else -room)
    return {"kind": "box", "box_mm": box, "uncertainty_mm": 0}


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("room", [0.0, 0.9])
def test_a_box_that_does_not_hold_the_allowance(side, room):
    found = refused("allowance_beyond_stock", stock=holding(side, room), quality={"stock_allowance_mm": 1.0})
    assert found.subjects == ("quality.stock_allowance_mm", "stock.box_mm", side) and side in found.message
    assert found.measured == {side: pytest.approx(room)} and found.limit == 1.0
    accepted(stock=holding(side, room))
    accepted(stock=holding(side, 1.0), quality={"stock_allowance_mm": 1.0})
    accepted(stock=holding(side, room) | {"uncertainty_mm": 1.0}, quality={"stock_allowance_mm": 1.0})


def test_every_side_that_holds_too_little_is_named_the_worst_first_and_the_underside_never():
    box = {"kind": "box", "box_mm": [[-10.5, -5.0, 0.0], [11.0, 6.0, 8.25]], "uncertainty_mm": 0}
    found = refused("allowance_beyond_stock", stock=box, quality={"stock_allowance_mm": 1.0})
    assert found.measured == {"-Y": 0.0, "+Z": 0.25, "-X": 0.5} and list(found.measured) == ["-Y", "+Z", "-X"]
    accepted(stock=holding("+Z", 2.0), quality={"stock_allowance_mm": 2.0})  # flush at the seat


def test_only_what_is_to_be_machined_leaves_an_allowance():
    ids = np.repeat(np.arange(1, 7), 2).astype(np.int32)  # bottom, top, -Y, +Y, -X, +X as in block()
    part = SimpleNamespace(mesh=TriangleMesh(PART.mesh.vertices, PART.mesh.faces, ids), bounds=PART.bounds,
                           volume=PART.volume, others=())

    def check(side, **operations):
        checked(parse_setup({"tools": TOOLS, "stock": holding(side, 0.0), "operations": operations,
                             "quality": {"stock_allowance_mm": 1.0}}), part)

    check("+Z", faces=["F3", "F4"])
    check("+Z", exclude_faces=["F2"])
    check("-X", faces=["F2"])
    for side, operations in (("+Z", {}), ("+Z", {"faces": ["F2"]}), ("+Z", {"exclude_faces": ["F3"]}),
                             ("-X", {"faces": ["F5"]})):
        with pytest.raises(SetupError, match="on the"):
            check(side, **operations)


def test_an_allowance_is_measured_along_the_normal():
    # a block turned by 30 degrees: its edges come to 0.9 mm of the box, but there no normal points at it
    turn = np.radians(30.0)
    spin = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
    mesh = TriangleMesh(PART.mesh.vertices @ spin.T, PART.mesh.faces, PART.mesh.face_ids)
    part = SimpleNamespace(mesh=mesh, bounds=mesh.bounds, volume=PART.volume, others=())

    def check(room):
        box = mesh.bounds + np.array([[-room, -room, 0], [room, room, 3.0]])
        checked(parse_setup({"tools": TOOLS, "quality": {"stock_allowance_mm": 1.0}, "stock": {
            "kind": "box", "box_mm": box.tolist(), "uncertainty_mm": 0}}), part)

    check(0.9)  # 0.9 / cos 30 = 1.04
    with pytest.raises(SetupError) as caught:
        check(0.8)
    assert caught.value.measured == {side: pytest.approx(0.8 / np.cos(turn), abs=1e-6) for side in SIDES
                                     if side != "+Z"}


def test_a_fixture_in_the_part():
    clear = {"box_mm": [[-20, -5, 0], [-10.0, 5, 30]]}  # touches
    found = refused("fixture_in_part", fixtures=[clear, {"box_mm": [[-2, -2, 0], [2, 2, 30]]}])
    assert found.subjects[0] == "fixtures[1]" and "fixtures[1]" in found.message
    point = np.array(found.measured)
    assert (abs(point) <= [2, 2, 8.001]).all() and point[2] >= 0
    accepted(fixtures=[clear, {"box_mm": [[-2, -2, 7.995], [2, 2, 30]]}])
    refused("fixture_in_part", fixtures=[{"box_mm": [[0, 0, 4], [0.001, 0.001, 4.001]]}])


def test_the_box_of_another_solid_in_the_part_is_refused_where_it_is_a_fixture():
    part = copy(PART)
    part.others = (OtherSolid(1, "clamp", np.array([[10.0, -5, 0], [30, 5, 8]])),
                   OtherSolid(3, "", np.array([[5.0, -5, 0], [30, 5, 8]])))
    for others in (None, "absent"):
        checked(parse_setup({"tools": TOOLS, "part": {"others": others}}), part)
    with pytest.raises(SetupError) as caught:
        checked(parse_setup({"tools": TOOLS, "part": {"others": "fixtures"}}), part)
    assert caught.value.code == "fixture_in_part" and caught.value.subjects[0] == "the box of solid 3"
    assert "part.others: absent" in caught.value.remedy


@pytest.mark.parametrize(("others", "boxes", "open_"), [(None, 1, 1), ("absent", 1, 0), ("fixtures", 2, 0)])
def test_other_solids_are_fixtures_absent_or_open(others, boxes, open_):
    setup = parse_setup({"tools": TOOLS, "part": {"others": others}, "fixtures": [{"box_mm": [[0, 0, 9], [1, 1, 10]]}]})
    inputs = JobInputs.of(setup, (OtherSolid(1, "clamp", np.array([[10.0, -5, 0], [30, 5, 8]])),))
    assert len(inputs.fixtures) == boxes and len(inputs.others) == open_
    assert boxes == 1 or inputs.fixtures[1].tolist() == [[10, -5, 0], [30, 5, 8]]
    two = np.array([[[10.0, -5, 0], [30, 5, 4]], [[20, -5, 4], [30, 5, 8]]])
    inputs = JobInputs.of(setup, (OtherSolid(1, "clamp", np.array([[10.0, -5, 0], [30, 5, 8]]), two),))
    assert [b.tolist() for b in inputs.fixtures[1:]] == (two.tolist() if boxes == 2 else [])


def test_repeated_names_are_refused():
    text = '{"tools": [], "tools": [{"id": "T1", "kind": "ball", "diameter_mm": 3}]}'
    with pytest.raises(SetupError) as caught:
        parse_setup(text)
    assert caught.value.code == "repeated_key" and caught.value.subjects == ("tools",) and caught.value.remedy
    with pytest.raises(SetupError, match='"id"'):
        parse_setup('{"tools": [{"id": "T1", "id": "T2", "kind": "ball", "diameter_mm": 3}]}')


@pytest.mark.parametrize("text", ["[]", "3", '"x"', "null"])
def test_a_setup_that_is_no_object(text):
    with pytest.raises(CamError) as caught:
        parse_setup(text)
    assert caught.value.message == "the setup must be a JSON object"
