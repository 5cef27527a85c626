"""What a proof takes for granted where the setup is silent."""

import json

import pytest

from service.from_wire import parse_setup
from service.setup_assumptions import setup_assumptions
from service.stages.job_inputs import JobInputs

BARE = {"name": "own", "cutting_speed_m_min": 90, "feed_per_tooth": [{"diameter_mm": 8, "feed_per_tooth_mm": 0.05}]}
FORCE = {"specific_cutting_force_n_mm2": 700, "chip_thickness_exponent": 0.25}


@pytest.mark.parametrize(("material", "told"), [("Ti-6Al-4V", False), ("C45", False), (BARE, True),
                                                (BARE | FORCE, False)])
def test_a_material_without_a_cutting_force(material, told):
    text = json.dumps({"tools": [{"id": "T1", "kind": "flat", "diameter_mm": 8}], "material": material})
    assumed = setup_assumptions(JobInputs.of(parse_setup(text)))
    found = [a for a in assumed if a.what == "cutting_force"]
    assert [a.what for a in assumed] == ["travel", "max_rpm", *(["cutting_force"] if told else [])]
    assert not found or ("own" in found[0].effect and "specific_cutting_force_n_mm2" in found[0].remedy)
