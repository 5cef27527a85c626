"""A limit of the engaged angle in the setup: the whole program keeps it; without one the report says what it is."""

import json

import pytest

from schemas.setup import Setup
from service import pipeline
from tests.step_files import write_step

pytestmark = pytest.mark.slow

cq = pytest.importorskip("cadquery")

FLAT = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flute_length_mm": 8, "stickout_mm": 20}
LIMIT = 130.0
RESOLUTION = 11.25  # deg, of the proof


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    """A block with a channel 7 mm wide, open at both ends, and a slot hardly wider than the tool."""
    block = cq.Workplane().box(20, 16, 6, centered=False)
    channel = cq.Workplane().box(20, 7, 3, centered=False).translate((0, 1.5, 3))
    slot = cq.Workplane().box(12, 4.4, 1.5, centered=False).edges("|Z").fillet(2.15).translate((4, 10, 4.5))
    return write_step(block.cut(channel).cut(slot), tmp_path_factory.mktemp("step") / "channel.step")


def planned(part, out, tool):
    setup = {"tools": [tool], "quality": {"scallop_height_mm": 0.02},
             "stock": {"kind": "box", "margin_mm": 1.0, "uncertainty_mm": 0.2}}
    return pipeline.plan(part, Setup.model_validate(setup), out, lambda stage, share: None)


def test_a_limit_of_the_engaged_angle_is_kept_from_the_first_layer_to_the_last_finish(part, tmp_path):
    free = planned(part, tmp_path / "free", FLAT)
    bound = planned(part, tmp_path / "bound", {**FLAT, "max_engagement_deg": LIMIT})
    assert free["state"] == bound["state"] == "proved"
    (without,), (kept,) = free["tools"], bound["tools"]
    assert without["engagement_deg"]["max"] == 180.0  # the slot
    assert kept["engagement_deg"]["p99"] <= kept["engagement_deg"]["max"] <= LIMIT + RESOLUTION
    assert bound["coverage"] == pytest.approx(free["coverage"], abs=0.002)
    assert json.loads((tmp_path / "bound" / "report.json").read_text())["finding_counts"] == {}
