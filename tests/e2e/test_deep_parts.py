"""Openings deeper than the tool is wide: the planner makes nothing that its proof refuses."""

from __future__ import annotations

import pytest

from examples.family.deep import deep_part
from schemas.setup import Setup
from service import pipeline
from service.from_wire import read_setup
from service.stages import plan_prove_loop
from tests.step_files import PARTS, write_step

cq = pytest.importorskip("cadquery")
pytestmark = pytest.mark.slow
CASES = PARTS.parent / "cases" / "parts"


@pytest.fixture
def proofs(monkeypatch):
    """The proofs of a job as they are made."""
    made, prove = [], plan_prove_loop.prove

    def kept(*given, **named):
        made.append(prove(*given, **named))
        return made[-1]

    monkeypatch.setattr(plan_prove_loop, "prove", kept)
    return made


@pytest.mark.parametrize("seed", [14, 15, 20, 28, 35])
def test_a_deep_opening_is_proved_at_the_first_plan(seed, proofs, tmp_path):
    part = deep_part(seed)
    step, _ = part.write(tmp_path)
    report = pipeline.plan(step, Setup.model_validate(part.setup), tmp_path / "job", lambda stage, share: None)
    assert report["state"] == "proved" and [dict(p.counts) for p in proofs] == [{}]
    left_out = part.setup.get("operations", {}).get("exclude_faces", [])
    assert not {f for z in report["zones"] for f in z["faces"]} & set(left_out)


def test_a_crescent_forty_deep_is_proved_at_the_first_plan(proofs, tmp_path):
    """A ramp parted 7 um before a corner was a plunge, and 25 lines of the wall ran again and took nothing off."""
    part = CASES / "crescent_k1_h40.step"
    if not part.exists():
        pytest.skip("the cases (../shared/cases) do not lie beside this checkout")
    report = pipeline.plan(part, read_setup(CASES / "crescent_setup.json"), tmp_path, lambda stage, share: None)
    assert report["state"] == "proved" and [dict(p.counts) for p in proofs] == [{}]
    assert report["reach_coverage"] > 0.99


@pytest.mark.parametrize(("outer", "inner", "height", "floor"), [(14.0, 9.9, 12.0, 4.0), (12.9, 8.7, 14.0, 2.0)])
def test_a_ring_slot_hardly_wider_than_a_slender_tool_is_cut_in_layers(outer, inner, height, floor, proofs, tmp_path):
    """No ring has room in it; what layers left there went at the feed of the finish, and bent the tool by 1.1 mm."""
    block = cq.Workplane().rect(36, 36).extrude(height)
    slot = cq.Workplane(origin=(0, 0, floor)).circle(outer).circle(inner).extrude(height)
    part = write_step(block.cut(slot), tmp_path / "slot.step")
    tool = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flutes": 4, "flute_length_mm": 10, "neck_length_mm": 35,
            "neck_diameter_mm": 3.88, "shank_diameter_mm": 4, "stickout_mm": 46,
            "holder": [{"diameter_mm": 24, "length_mm": 40}]}
    setup = Setup.model_validate({"tools": [tool], "stock": {"kind": "box", "margin_mm": 1}, "material": "AlMgSi1 6082",
                                  "quality": {"scallop_height_mm": 0.05}})
    report = pipeline.plan(part, setup, tmp_path / "job", lambda stage, share: None)
    assert report["state"] == "proved" and [dict(p.counts) for p in proofs] == [{}]
    assert report["reach_coverage"] > 0.999
