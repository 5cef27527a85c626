"""Jobs with circle segment mills: a lens on floors and slopes, a barrel on leaning walls, and what they gain."""

import math

import pytest

from schemas.setup import Setup
from service.pipeline import plan
from tests.step_files import write_step

cq = pytest.importorskip("cadquery")

LENS = {"id": "T2", "kind": "lens", "diameter_mm": 4.0, "profile_radius_mm": 12.0, "corner_radius_mm": 0.5,
        "flute_length_mm": 8, "stickout_mm": 25}
BARREL = {"id": "T2", "kind": "barrel", "diameter_mm": 4.0, "profile_radius_mm": 30.0, "corner_radius_mm": 0.5,
          "taper_angle_deg": 10.0, "flute_length_mm": 9, "stickout_mm": 25}
BALL = {"id": "T2", "kind": "ball", "diameter_mm": 4.0, "flute_length_mm": 8, "stickout_mm": 25}
FLAT = {"id": "T1", "kind": "flat", "diameter_mm": 4.0, "flute_length_mm": 8, "stickout_mm": 25}


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    """A block with a slope of 4 degrees on top, and a step whose wall leans 15 degrees."""
    lean, fall = 4.0 * math.tan(math.radians(15.0)), 8.0 * math.tan(math.radians(4.0))
    solid = cq.Workplane("XZ").polyline([(0, 0), (20, 0), (20, 4), (13 + lean, 4), (13, 8), (8, 8), (0, 8 - fall)])
    return write_step(solid.close().extrude(-10), tmp_path_factory.mktemp("step") / "slopes.step")


def job(part, folder, *tools):
    setup = Setup.model_validate({"tools": tools, "stock": {"kind": "box", "margin_mm": 0.0, "uncertainty_mm": 0.0},
                                  "quality": {"scallop_height_mm": 0.01}})
    return plan(part, setup, folder, lambda *_: None)


@pytest.fixture(scope="module")
def jobs(part, tmp_path_factory):
    folder = tmp_path_factory.mktemp("jobs")
    return {name: job(part, folder / name, FLAT, second) for name, second in
            {"ball": BALL, "lens": LENS, "barrel": BARREL}.items()}


def test_all_are_proved(jobs):
    done = {name: (r["state"], r["finding_counts"]) for name, r in jobs.items()}
    assert done == dict.fromkeys(jobs, ("proved", {}))
    assert all(r["coverage"] > 0.94 for r in jobs.values())  # the corner under the wall is sharp


def test_passes_lie_apart_by_the_radius_at_the_contact(jobs):
    """On a plane s = sqrt(8 h r): on the slope the passes of the lens lie sqrt(12 / 2) times as far apart."""
    step = {name: max(z["side_step_mm"] for z in r["zones"] if z["form"] == "shallow" and z["tool"] == "T2")
            for name, r in jobs.items()}
    assert step["lens"] / step["ball"] == pytest.approx(math.sqrt(12.0 / 2.0), rel=0.03)
    assert step["lens"] == pytest.approx(2.0 * math.sqrt(2.0 * 12.0 * 0.008 - 0.008**2), rel=0.03)


def test_a_barrel_takes_a_leaning_wall_in_fewer_levels(jobs):
    """Its large arc touches the wall: 30 mm instead of 2, so the levels lie up to a layer apart."""
    ball, barrel = (sum(z["passes"] for z in jobs[name]["zones"] if z["form"] == "steep" and z["tool"] == "T2")
                    for name in ("ball", "barrel"))
    assert 0 < barrel < 0.4 * ball
