"""Jobs with tapered mills: walls that lean more than the cone are cut, upright ones are told and left to others."""

import pytest

from schemas.setup import Setup
from service.pipeline import plan
from tests.step_files import write_step

cq = pytest.importorskip("cadquery")

BALL = {"id": "T2", "kind": "tapered_ball", "diameter_mm": 1.0, "taper_angle_deg": 5.0, "flute_length_mm": 8,
        "shank_diameter_mm": 4, "stickout_mm": 25}
FLAT = {"id": "T1", "kind": "flat", "diameter_mm": 4.0, "flute_length_mm": 8, "stickout_mm": 25}
SLENDER = {"id": "T3", "kind": "ball", "diameter_mm": 1.0, "flute_length_mm": 2, "neck_diameter_mm": 0.9,
           "neck_length_mm": 5, "shank_diameter_mm": 4, "stickout_mm": 25}
DEEP = 3.0


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    """A block with a groove whose walls lean 15 degrees and, beside it, one whose walls are upright."""
    lean = DEEP * 0.26794919
    groove = cq.Workplane("XZ").polyline([(3 - 0.8, 5 - DEEP), (3 + 0.8, 5 - DEEP), (3 + 0.8 + lean, 5),
                                          (3 - 0.8 - lean, 5)]).close().extrude(-8)
    slot = cq.Workplane().box(1.6, 8, DEEP, centered=False).translate((7, 0, 5 - DEEP))
    return write_step(cq.Workplane().box(11, 8, 5, centered=False).cut(groove).cut(slot),
                      tmp_path_factory.mktemp("step") / "grooves.step")


def job(part, folder, *tools):
    setup = Setup.model_validate({"tools": tools, "stock": {"kind": "box", "margin_mm": 0.0, "uncertainty_mm": 0.0},
                                  "quality": {"scallop_height_mm": 0.02}})
    return plan(part, setup, folder, lambda *_: None)


@pytest.fixture(scope="module")
def jobs(part, tmp_path_factory):
    folder = tmp_path_factory.mktemp("jobs")
    return {name: job(part, folder / name, *tools) for name, tools in
            {"cone": (FLAT, BALL), "slender": (FLAT, SLENDER), "both": (FLAT, BALL, SLENDER)}.items()}


def test_all_are_proved(jobs):
    assert {name: (r["state"], r["finding_counts"]) for name, r in jobs.items()} == dict.fromkeys(
        jobs, ("proved", {}))


def test_a_cone_cuts_walls_that_lean_more_and_no_upright_ones(jobs):
    alone, slender = jobs["cone"], jobs["slender"]
    cut = [z for z in alone["zones"] if z["tool"] == "T2"]
    assert cut and alone["coverage"] < slender["coverage"]
    # both walls of the slot stay, but for the rim that the side of the cone touches
    left = sum(entry["area_mm2"] for entry in alone["remainder"])
    assert 0.8 * 2 * 8 * DEEP < left < 1.2 * (2 * 8 * DEEP + 2 * 8 * 1.6)


def test_one_tool_more_covers_no_less_and_takes_less_time(jobs):
    both, slender = jobs["both"], jobs["slender"]
    assert both["coverage"] >= slender["coverage"] - 1e-3
    assert {z["tool"] for z in both["zones"]} == {"T1", "T2", "T3"}
    took = {name: r["time"]["in_cut_s"] + r["time"]["in_air_s"] for name, r in jobs.items()}
    assert took["cone"] < took["slender"]
