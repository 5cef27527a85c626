"""Programs with tapered mills: a groove and a wall by closed forms, a clean program, and planted faults."""

import json
import math
from dataclasses import replace
from functools import lru_cache

import pytest

from geometry.errors import SetupError
from schemas.report import Verification
from service.from_wire import parse_setup
from service.stages.job_inputs import JobInputs
from service.stages.job_part import read_job_part
from service.verification.program_first import read_first
from service.verification.program_proof import proved_program
from tests.step_files import write_step

LEAN, TIP, DEEP = 5.0, 1.0, 5.0  # deg of the side, mm radius of the ball, mm depth of the groove
TAN, SIN, COS = (f(math.radians(LEAN)) for f in (math.tan, math.sin, math.cos))
WIDE, HIGH = TIP * COS, TIP * (1.0 - SIN)  # where ball and side touch
BALL = {"id": "T1", "kind": "tapered_ball", "diameter_mm": 2.0 * TIP, "taper_angle_deg": LEAN, "flute_length_mm": 8,
        "stickout_mm": 25}
SETUP = {"stock": {"kind": "box", "box_mm": [[-10, -8, -8], [10, 8, 0]], "uncertainty_mm": 0},
         "machine": {"kind": "3-axis", "dialects": ["linuxcnc"]}, "quality": {"scallop_height_mm": 0.01}}


def side(height, lean=TAN, wide=WIDE, high=HIGH):
    """Radius of the side so high over the tip."""
    return wide + lean * (height - high)


def program(*more, last=-DEEP, y=0.0, step=0.5):
    """The groove in passes from air to air, then ``more`` lines; ``last``, ``y``: of the last pass."""
    lines = ["%", "G21 G90 G17 G94 G40 G49 G54 G61", "T1 M6", "S8000 M3", "G0 X-14 Y0", "G43 H1 Z20", "G0 Z1"]
    for k in range(1, round(DEEP / step) + 1):
        lines += ["G0 X-14 Y0", f"G0 Z{-step * k}", "G1 X14 F300", "G0 Z1"]
    lines += [f"G0 X-14 Y{y}", f"G0 Z{last}", "G1 X14 F300", "G0 Z20", *more, "M5", "M30", "%"]
    return "\n".join(lines) + "\n"


def along_wall(away=0.0):
    """Passes beside the wall at Y 1, half a millimetre off it but for the last, whose end is ``away`` from it."""
    lines = ["%", "G21 G90 G17 G94 G40 G49 G54 G61", "T1 M6", "S8000 M3", "G0 X-14 Y0", "G43 H1 Z20"]
    for k in range(1, 11):
        lines += [f"G0 X-14 Y{1.0 - TIP - 0.5}", f"G0 Z{-0.5 * k}", "G1 X14 F300", "G0 Z20"]
    lines += [f"G0 X-14 Y{1.0 - TIP - away:.6f}", "G0 Z-5", "G1 X14 F300", "G0 Z20", "M5", "M30", "%"]
    return "\n".join(lines) + "\n"


def proof_of(part, folder, name):
    """``proof_of_tools`` with the tapered ball."""
    return proof_of_tools(part, folder, name, BALL)


def proof_of_tools(part, folder, name, mill):
    """Verify a text, and a mill with other fields, against a part -> the report. The part is read once."""
    job = read_job_part(write_step(part, folder / f"{name}.step"), parse_setup(json.dumps({**SETUP, "tools": [mill]})),
                        lambda _stage, _share: None)

    @lru_cache
    def proved(text, tool):
        setup = parse_setup(json.dumps({**SETUP, "tools": [{**mill, **json.loads(tool)}]}))
        mine = replace(job, inputs=JobInputs.of(setup))
        made = proved_program(mine, read_first(setup, text, ending=".ngc"), lambda _share: None).report
        Verification.model_validate(made)
        return made

    return lambda text, **tool: proved(text, json.dumps(tool))


@pytest.fixture(scope="module")
def groove(tmp_path_factory):
    """A plate with a groove along X that is the profile of the mill."""
    import cadquery as cq

    block = cq.Workplane("XY").box(20, 16, 8, centered=(True, True, False)).translate((0, 0, -8))
    top = side(DEEP + 1.0)
    profile = cq.Workplane("YZ").moveTo(-top, 1.0).lineTo(-WIDE, HIGH - DEEP).threePointArc((0.0, -DEEP),
                                                                                          (WIDE, HIGH - DEEP))
    cut = profile.lineTo(top, 1.0).close().extrude(40.0, both=True)
    return proof_of(block.cut(cut), tmp_path_factory.mktemp("groove"), "groove")


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    """A plate with a step along X: floor at -5, and an upright wall at Y 1."""
    import cadquery as cq

    block = cq.Workplane("XY").box(20, 16, 8, centered=(True, True, False)).translate((0, 0, -8))
    step = cq.Workplane("XY").box(40, 20, 10, centered=(True, False, False)).translate((0, -19, -DEEP))
    return proof_of(block.cut(step), tmp_path_factory.mktemp("wall"), "wall")


def found(report, kind):
    out = [f for f in report["findings"] if f["kind"] == kind]
    assert out, report["finding_counts"]
    return max(out, key=lambda f: f["depth"])


def test_a_groove_of_the_shape_of_the_mill_has_no_finding(groove):
    report = groove(program())
    assert sum(report["finding_counts"].values()) == 0, [f["message"] for f in report["findings"]]
    assert report["gouge_max_mm"] < 2e-3


def test_a_ball_too_low_gouges_the_bottom(groove):
    told = found(groove(program(last=-DEEP - 0.05)), "gouge")
    assert told["depth"] == pytest.approx(0.05, abs=5e-3) and told["line"] == len(program().splitlines()) - 4


def test_a_pass_beside_the_groove_gouges_its_side(groove):
    """The ball is as much too far aside as the cone: the normal of the wall leans by the taper."""
    told = found(groove(program(y=0.04)), "gouge")
    assert told["depth"] == pytest.approx(0.04 * COS, abs=5e-3)


def test_a_side_that_leans_too_little_leaves_a_wedge(groove):
    """A cone of 2 degrees on a wall of 5: on the normal of the wall, which meets the cone above its foot."""
    report = groove(program(), taper_angle_deg=2.0)
    lean = math.tan(math.radians(2.0))
    wide, high = TIP * math.cos(math.radians(2.0)), TIP * (1.0 - math.sin(math.radians(2.0)))
    left = (side(DEEP) - side(DEEP, lean, wide, high)) / (COS + lean * SIN)
    told = found(report, "stock_left")
    assert left - 0.02 < told["depth"] < left + 1e-3  # the uppermost sample is a little under the edge


def test_a_side_that_leans_too_much_gouges_the_upper_edge(groove):
    report = groove(program(), taper_angle_deg=8.0)
    lean = math.tan(math.radians(8.0))
    wide, high = TIP * math.cos(math.radians(8.0)), TIP * (1.0 - math.sin(math.radians(8.0)))
    at_top = side(DEEP, lean, wide, high) - side(DEEP)
    assert 0.6 * at_top < found(report, "gouge")["depth"] < at_top


def test_the_cone_gouges_an_upright_wall_beside_its_tip(wall):
    """The tip of the ball just touches the wall. The upper edge is the cone's overlap there off what is left."""
    told = found(wall(along_wall()), "gouge")
    over = side(DEEP) - TIP
    assert told["depth"] == pytest.approx(over * COS, abs=5e-3)
    assert told["line"] == len(along_wall().splitlines()) - 4


def test_a_cone_that_just_touches_the_upper_edge_is_no_gouge(wall):
    assert "gouge" not in wall(along_wall(away=side(DEEP) - TIP + 0.001))["finding_counts"]
    told = found(wall(along_wall(away=side(DEEP) - TIP - 0.03)), "gouge")
    assert told["depth"] == pytest.approx(0.03, abs=5e-3)


@pytest.mark.parametrize("kind", ["tapered_bull", "tapered_flat"])
def test_other_ends_gouge_the_wall_with_their_cone_too(wall, kind):
    corner = 0.3 if kind == "tapered_bull" else 0.0
    told = found(wall(along_wall(), kind=kind, corner_radius_mm=corner), "gouge")
    over = side(DEEP, TAN, corner * COS, corner * (1.0 - SIN)) - corner
    assert told["depth"] == pytest.approx(over * COS, abs=5e-3)


def test_a_rapid_through_stock(groove):
    lines = program().splitlines()
    lines[7] = "G0 X-14 Y0 Z1"
    lines[9] = "G0 X14"
    told = found(groove("\n".join(lines) + "\n"), "rapid")
    assert told["line"] == 10


def test_a_rapid_whose_cone_alone_meets_stock(groove):
    """Over the groove the ball is free, and the upper end of the cone is not."""
    short = {"flute_length_mm": 4, "neck_length_mm": 8, "neck_diameter_mm": 2, "shank_diameter_mm": 2}
    assert "rapid" not in groove(program(), **short)["finding_counts"]
    told = found(groove(program("G0 X-14 Y0.9", "G0 Z-3.5", "G0 X14", "G0 Z20"), **short), "rapid")
    assert told["line"] == len(program().splitlines())


def test_a_shank_over_short_flutes_meets_the_plate(groove):
    told = found(groove(program(), flute_length_mm=4, shank_diameter_mm=6), "collision")
    assert "shank" in told["message"]


def test_a_holder_meets_the_plate(groove):
    holder = [{"diameter_mm": 12, "length_mm": 20}]
    report = groove(program(), flute_length_mm=4.5, shank_diameter_mm=2.5, stickout_mm=4.8, holder=holder)
    assert "holder" in found(report, "collision")["message"]


@pytest.mark.parametrize("cuts", [True, False])
def test_a_plunge_into_full_stock(groove, cuts):
    lines = program().splitlines()
    at = lines.index("G0 X-14 Y0", 7)
    lines[at:at] = ["G0 X0 Y0 Z1", "G1 Z-3 F100", "G0 Z1"]
    told = found(groove("\n".join(lines) + "\n", center_cutting=cuts), "plunge")
    assert told["line"] == at + 2 and told["depth"] == pytest.approx(3.0, abs=0.3)


def test_too_short_flutes_of_a_bull_are_refused(groove):
    with pytest.raises(SetupError, match="less than twice the corner"):
        groove(program(), kind="tapered_bull", corner_radius_mm=0.8, flute_length_mm=1.5)


def test_a_cone_that_hangs_below_the_part_cuts_as_fast_as_it_is_wide_there(tmp_path):
    """A side of 45 degrees, cut by a cone of 45 degrees 13 to 19 mm over its tip: 4.9 km/min."""
    import cadquery as cq

    part = cq.Workplane("YZ").polyline([(-11, -6), (5, -6), (5, 0), (-5, 0)]).close().extrude(6, both=True)
    mill = {"id": "T1", "kind": "tapered_ball", "diameter_mm": 0.5, "taper_angle_deg": 45.0, "flute_length_mm": 21,
            "stickout_mm": 25}
    setup = parse_setup(json.dumps({"tools": [mill], "stock": {"margin_mm": 0.1, "uncertainty_mm": 0},
                                    "machine": {"kind": "3-axis", "dialects": ["linuxcnc"]}}))
    tip, up = -19.5, math.sqrt(0.5)
    y = -5.0 + (up * (tip + 0.25) - 0.25) / up  # of the middle of the ball, 0.25 mm off the side
    text = "\n".join(["%", "G21 G90 G17 G94 G40 G49 G54 G61", "T1 M6", "S40000 M3", "G0 X-50 Y-60", "G43 H1 Z20",
                      f"G0 Y{y:.5f}", f"G0 Z{tip}", "G1 X50 F100", "G0 Z20", "M5", "M30", "%"]) + "\n"
    job = read_job_part(write_step(part, tmp_path / "side.step"), setup, lambda _stage, _share: None)
    report = proved_program(job, read_first(setup, text, ending=".ngc"), lambda _share: None).report
    wide = 2.0 * (0.25 * up + (19.5 - 0.25 * (1.0 - up)))
    told = [f for f in report["findings"] if f["kind"] == "load"]
    assert told and told[0]["depth"] == pytest.approx(
        math.pi * wide * 40.0, rel=0.03)
