"""Materials by their usual names: figures of their own, or those of their group, which the report names."""

from collections import defaultdict

import pytest

from schemas import material_groups
from schemas.material_groups import BUILT_IN, GROUPS, MEMBERS, MILLING, WORST, key
from schemas.materials import MATERIALS, OF_GROUP, find_material, has_own_speed, known_material, same_material
from service.cutting_data import cutting_data
from service.from_wire import parse_setup
from tests.unit.schemas.test_setup import setup


@pytest.mark.parametrize("names, group", [
    (("42CrMo4", "1.7225", "AISI 4140", "4140", "SCM440", "42CrMo4+QT", "EN 1.7225", "en19"), 8),
    (("X153CrMoV12", "1.2379", "D2", "aisi d2", "SKD11", "W.Nr. 1.2379"), 10),
    (("X6CrNiMoTi17-12-2", "1.4571", "316Ti", "X6 CrNiMoTi 17 12 2", "UNS S31635"), 14),
    (("AlMg1SiCu", "EN AW-6061", "6061-T6", "6061 T651", "A6061", "3.3211"), 22),
    (("AlCu4Mg1", "2024-T351", "EN AW 2024", "3.1355"), 22),
    (("NiCr22Mo9Nb", "Inconel 625", "2.4856", "IN625", "N06625"), 33),
    (("Ti Grade 2", "3.7035", "Titanium Grade 2", "R50400"), 36),
    (("EN-GJL-250", "GG25", "0.6025", "5.1301"), 16),
    (("EN-GJS-400-15", "GGG-40", "60-40-18"), 17),
    (("S355J2", "1.0577", "St52-3"), 1)])
def test_one_material_has_many_names(names, group):
    found = [find_material(n) for n in names]
    assert {m.name for m in found} == {names[0]}
    assert {m.group for m in found} == {f"VDI 3323 no. {group}, ISO {GROUPS[group].iso}: {GROUPS[group].what}"}
    assert found[0].specific_cutting_force_n_mm2 == round(MILLING * GROUPS[group].force)
    assert all(same_material(names[0], n) for n in names)


@pytest.mark.parametrize("name, own", [
    ("3.7165", "Ti-6Al-4V"), ("Ti Grade 5", "Ti-6Al-4V"), ("Ti-6Al-4V ELI", "Ti-6Al-4V"),
    ("EN AW-7075-T6", "AlZnMgCu1.5 7075"), ("6082 T6", "AlMgSi1 6082"), ("X2CrNiMo17-12-2", "316L"),
    ("DIN 1.4301", "1.4301"), ("Ck45", "C45"), ("UNS N07718", "Inconel 718")])
def test_materials_with_figures_of_their_own_keep_them(name, own):
    assert find_material(name) is MATERIALS[own]
    assert MATERIALS[own].group is None


@pytest.mark.parametrize("name, group", [
    ("H13 52 HRC", 38), ("1.2379 60HRC", 39), ("100Cr6 58 HRC", 39), ("steel 50 HRC", 38), ("42CrMo4 32 HRC", 9),
    ("1.2344 40 HRC", 11), ("C45 55 HRC", 38), ("ISO P", 11), ("n", 22), ("VDI 36", 36), ("Stainless steel", 14),
    ("Messing", 27)])
def test_a_hardness_a_letter_or_a_kind_stands_for_a_group(name, group):
    assert find_material(name).group.startswith(f"VDI 3323 no. {group},")


@pytest.mark.parametrize("name, similar", [
    ("1.4572", "1.4571"), ("42CrMo5", "42CrMo4"), ("Inconell 625", "Inconel 625"), ("unobtainium", "Ti-6Al-4V"),
    ("6082 60 HRC", "Ti-6Al-4V"), ("VDI 29", "C45"), ("", "C45"), ("12 HRC 60 HRC", "C45"), ("60 HRC C45", "C45")])
def test_an_unknown_name_is_refused_with_similar_ones(name, similar):
    assert known_material(name) is None
    with pytest.raises(ValueError, match="unknown material") as refused:
        find_material(name)
    assert similar in str(refused.value) and "ISO P" in str(refused.value)


def test_a_name_means_one_material():
    rows = defaultdict(set)
    for row in (*material_groups._rows(material_groups._BUILT_IN), *material_groups._MEMBER_ROWS):
        for name in row:
            rows[key(name)].add(row[0])
    assert [k for k, first in rows.items() if len(first) > 1] == []
    assert not BUILT_IN.keys() & MEMBERS.keys()
    assert set(BUILT_IN.values()) == set(MATERIALS)


def test_every_name_reads_back_and_has_whole_figures():
    for first, number in MEMBERS.values():
        m = find_material(first)
        assert m.name == first and m.source == OF_GROUP and has_own_speed(m)
        assert m.group.startswith(f"VDI 3323 no. {number},")


def test_a_letter_has_the_largest_force_of_its_groups():
    assert {k: GROUPS[n].force for k, n in WORST.items()} == {
        k: max(g.force for g in GROUPS.values() if g.iso == k) for k in "PMKNSH"}


def test_a_job_cuts_with_the_figures_of_the_group():
    found = parse_setup(setup(material="AISI D2"))
    data = cutting_data(found.material, found.tools[0], found.machine)
    assert data.spindle_rpm == 7427 and data.limited_by == "material"  # 70 m/min on 3 mm
    assert data.feed == pytest.approx(7427 * 2 * 0.0055 * 3)
    assert "X153CrMoV12" == found.material.name
