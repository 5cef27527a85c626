"""Files of several products and bodies: what is one part, what is refused, and where a product of an assembly lies."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from geometry.errors import PartError
from geometry.part import Part
from geometry.setup_frame import SetupFrame
from geometry.step_import.occ.loading import load_part
from geometry.step_import.reader import read_part
from tests.step_files import PARTS, write_step

cq = pytest.importorskip("cadquery")

CASE = PARTS.parent / "cases" / "parts" / "asm_plate_and_bolt.step"
PLACES = re.compile(r"\((-?[\d.]+), (-?[\d.]+), (-?[\d.]+)\)")


def box(x, y, z, at=(0, 0, 0)):
    return cq.Solid.makeBox(x, y, z, cq.Vector(*at))


def assembly(path: Path, **placed) -> Path:
    """Write an assembly: name = (solid, cq.Location)."""
    top = cq.Assembly(name="top")
    for name, (solid, where) in placed.items():
        top.add(solid, name=name, loc=where)
    top.export(str(path), "STEP")
    return path


def plate_and_bolt(path: Path) -> Path:
    plate = cq.Workplane().box(40, 30, 10, centered=(True, True, False)).faces(">Z").workplane().hole(8.0).val()
    bolt = cq.Workplane().circle(4.0).extrude(16.0).val()
    return assembly(path, plate=(plate, cq.Location()), bolt=(bolt, cq.Location(cq.Vector(0, 0, -3))))


def refused(path: Path, **choice) -> PartError:
    with pytest.raises(PartError) as caught:
        load_part(path, **choice)
    return caught.value


def test_products_of_an_assembly_are_separate_and_named(tmp_path):
    found = refused(plate_and_bolt(tmp_path / "asm.step"))
    assert found.code == "several_solids" and found.subjects == ("solid 1", "solid 2") and found.measured == 2
    assert "of 2 products" in found.message
    assert "solid 1 (plate" in found.message and "solid 2 (bolt" in found.message
    assert "solid 2 only touches solid 1 on a face at (" in found.message
    assert "part.solid: N" in found.remedy and "part.fuse: true" in found.remedy


@pytest.mark.parametrize("written", ["Pl\u00e4tte".encode(), b"Pl\xe4tte", b"Pl\\X2\\00E4\\X0\\tte"])
def test_names_are_read_as_they_were_written(tmp_path, written):
    path = plate_and_bolt(tmp_path / "asm.step")
    path.write_bytes(path.read_bytes().replace(b"'plate'", b"'" + written + b"'"))
    assert "solid 1 (Pl\u00e4tte" in refused(path).message


@pytest.mark.skipif(not CASE.is_file(), reason="the collection of cases (../shared/cases) is not here")
def test_the_bolt_in_a_plate_of_the_cases_is_refused_chosen_and_fused():
    found = refused(CASE)
    assert found.code == "several_solids" and found.subjects == ("solid 1", "solid 2") and found.measured == 2
    assert "solid 1 (plate" in found.message and "solid 2 (bolt" in found.message
    plate, bolt, both = load_part(CASE, solid=1), load_part(CASE, solid=2), load_part(CASE, fuse=True)
    assert plate.bounds[1] - plate.bounds[0] == pytest.approx([40, 30, 10], abs=1e-3)
    assert bolt.bounds[1] - bolt.bounds[0] == pytest.approx([13, 13, 15], abs=1e-3)
    assert both.volume == pytest.approx(plate.volume + bolt.volume, rel=1e-3)
    assert refused(CASE, solid=3).code == "no_such_solid"


def test_each_product_can_be_chosen(tmp_path):
    path = plate_and_bolt(tmp_path / "asm.step")
    plate, bolt = load_part(path, solid=1), load_part(path, solid=2)
    assert plate.volume == pytest.approx(40 * 30 * 10 - np.pi * 16 * 10, rel=1e-6)
    assert bolt.volume == pytest.approx(np.pi * 16 * 16, rel=1e-6)
    assert bolt.bounds[:, 2] == pytest.approx([-3, 13])
    assert [len(p.warnings) for p in (plate, bolt)] == [1, 1] and "solid 2 of 2 is the part" in bolt.warnings[0]
    assert refused(path, solid=3).code == "no_such_solid"


def test_the_solids_that_are_not_the_part_have_boxes_in_the_setup_frame(tmp_path):
    path = plate_and_bolt(tmp_path / "asm.step")
    part = load_part(path, solid=1, placement=SetupFrame((0, 0, 3), (1, 0, 0), (0, 1, 0)))
    (other,) = Part.from_bytes(part.to_bytes()).others
    assert str(other) == "solid 2 (bolt)" and other.number == 2
    assert other.bounds == pytest.approx(np.array([[-4, -6, -4], [4, 10, 4]]), abs=1e-6)
    assert str(load_part(path, solid=2).others[0]).startswith("solid 1 (plate")
    assert not load_part(path, fuse=True).others


def test_fuse_makes_one_part_of_all_products(tmp_path):
    path = plate_and_bolt(tmp_path / "asm.step")
    part = read_part(path, fuse=True)
    assert part.volume == pytest.approx(40 * 30 * 10 + np.pi * 16 * 6, rel=1e-6)
    assert [w for w in part.warnings if "2 solids (plate" in w and "fused into 1" in w]


def test_a_product_is_read_where_its_assembly_places_it(tmp_path):
    """A part turned by 90 degrees about Z, in a group that is itself turned about X and moved."""
    inner = cq.Assembly(name="group")
    inner.add(box(3, 2, 1), name="bar", loc=cq.Location(cq.Vector(5, 0, 0), cq.Vector(0, 0, 1), 90))
    top = cq.Assembly(name="top")
    top.add(inner, loc=cq.Location(cq.Vector(0, 0, 20), cq.Vector(1, 0, 0), 90))
    top.add(box(7, 7, 7, (-40, 0, 0)), name="block")
    top.export(str(tmp_path / "asm.step"), "STEP")
    parts = {round(p.volume): p for p in (load_part(tmp_path / "asm.step", solid=k) for k in (1, 2))}
    # (x, y, z) -> turned about Z: (5 - y, x, z) -> turned about X: (5 - y, -z, x) -> moved up by 20
    assert parts[6].bounds == pytest.approx(np.array([[3, -1, 20], [5, 0, 23]]))
    assert parts[343].bounds == pytest.approx(np.array([[-40, 0, 0], [-33, 7, 7]]))


def test_a_product_placed_twice_is_two_solids(tmp_path):
    pin = box(2, 2, 5)
    path = assembly(tmp_path / "asm.step", one=(pin, cq.Location()), two=(pin, cq.Location(cq.Vector(10, 0, 0))))
    assert refused(path).measured == 2
    assert load_part(path, solid=2).bounds[:, 0] == pytest.approx([10, 12])


def test_an_assembly_of_one_product_is_a_part(tmp_path):
    path = assembly(tmp_path / "asm.step", only=(box(4, 5, 6), cq.Location(cq.Vector(1, 2, 3))))
    part = load_part(path)
    assert part.bounds == pytest.approx(np.array([[1, 2, 3], [5, 7, 9]])) and not part.warnings


def test_overlapping_products_are_not_fused_in_silence(tmp_path):
    path = assembly(tmp_path / "asm.step", a=(box(10, 10, 10), cq.Location()),
                    b=(box(10, 4, 4), cq.Location(cq.Vector(5, 3, 3))))
    assert "solid 2 overlaps solid 1 at (7.5, 5, 5)" in refused(path).message
    assert load_part(path, solid=1).volume == pytest.approx(1000)
    assert load_part(path, fuse=True).volume == pytest.approx(1000 + 5 * 16)


@pytest.mark.parametrize("in_an_assembly", [False, True])
@pytest.mark.parametrize(("at", "size", "words", "place"), [
    ((10, 0, 0), (10, 10, 10), "on a face", (10, 5, 5)),
    ((10, 10, 2), (5, 5, 4), "along an edge", (10, 10, 4)),
    ((10, 10, 10), (5, 5, 5), "the point", (10, 10, 10)),
])
def test_a_body_that_only_touches_is_refused_with_both_numbers_and_the_place(tmp_path, in_an_assembly, at, size, words,
                                                                             place):
    two = cq.Compound.makeCompound([box(10, 10, 10), box(*size, at)])
    path = write_step(two, tmp_path / "two.step", assembly=in_an_assembly)
    found = refused(path)
    line = next(row for row in found.message.splitlines() if "only touches" in row)
    assert line.startswith("solid 2 only touches solid 1") and words in line
    assert [float(x) for x in PLACES.search(line).groups()] == pytest.approx(place, abs=1e-3)
    if words == "on a face":
        part = load_part(path, fuse=True)
        assert part.volume == pytest.approx(2000) and len(part.faces) == 6
    else:
        assert "only touches" in refused(path, fuse=True).message
        assert "part.fuse" not in refused(path, fuse=True).remedy


def test_places_are_told_to_a_micrometre(tmp_path):
    plate = cq.Workplane("XY").box(30, 20, 12, centered=(True, True, False)).val()
    lug = cq.Workplane("XY", origin=(0, 0, 12)).rect(10, 10).extrude(5).faces(">Z").workplane().hole(3.3).val()
    found = refused(write_step(cq.Compound.makeCompound([plate, lug]), tmp_path / "two.step")).message
    assert "only touches solid 1 on a face at (" in found and not re.search(r"\de[-+]|-0[,)]", found)


def test_one_product_of_overlapping_bodies_is_one_part_and_a_touching_one_is_not(tmp_path):
    hub = box(20, 20, 10)
    blades = [box(4, 2, 30, (8, 3 * k, 5)) for k in range(5)]
    part = load_part(write_step(cq.Compound.makeCompound([hub, *blades]), tmp_path / "rotor.step"))
    assert part.volume == pytest.approx(4000 + 5 * 8 * 25)
    on_top = box(5, 5, 5, (0, 0, 10))
    found = refused(write_step(cq.Compound.makeCompound([hub, *blades, on_top]), tmp_path / "more.step"))
    assert found.measured == 2 and "solid 2 only touches solid 1 on a face at (2.5, 2.5, 10)" in found.message


def test_a_group_of_bodies_beside_those_of_its_product_is_no_part_of_its_own():
    """One product holds the other: its bodies and those it places are one part where they overlap."""
    from geometry.step_import.occ.solid.healing import one_solid
    from geometry.step_import.occ.solid.products import Product

    hub, blade = box(20, 20, 10).wrapped, box(4, 2, 30, (8, 5, 5)).wrapped
    notes = []
    placed = [Product("group", blade, (0, 1)), Product("root", hub, (0,))]
    assert cq.Solid(one_solid(placed, None, notes)[0]).Volume() == pytest.approx(4000 + 8 * 25)
    assert notes == ["2 solids (group, root) that touch or overlap were fused into 1"]
    with pytest.raises(PartError, match="solid 2 overlaps solid 1"):
        one_solid([Product("blade", blade, (0, 1)), Product("hub", hub, (0, 2))], None, [])
