"""Programs with circle segment mills: a groove of their own shape, a wall by closed forms, and planted faults."""

import json
import math

import numpy as np
import pytest

from service.from_wire import parse_setup, tool_body
from tests.e2e.test_tapered import found, proof_of_tools

DEEP, TOP = 5.0, 1.0  # mm: depth of the groove, and how far its profile goes on above the plate
LENS = {"id": "T1", "kind": "lens", "diameter_mm": 6.0, "profile_radius_mm": 12.0, "corner_radius_mm": 0.8,
        "flute_length_mm": 8, "stickout_mm": 25}
SHARP = {**LENS, "corner_radius_mm": 0.0}
OVAL = {"id": "T1", "kind": "barrel", "diameter_mm": 5.0, "profile_radius_mm": 8.0, "corner_radius_mm": 0.8,
        "flute_length_mm": 8, "stickout_mm": 25}
CONE = {**OVAL, "taper_angle_deg": 15.0, "profile_radius_mm": 14.0, "tip_diameter_mm": 1.0}
TOOLS = {"lens": LENS, "sharp lens": SHARP, "oval barrel": OVAL, "taper barrel": CONE}


def body(fields):
    return tool_body(parse_setup(json.dumps({"tools": [fields]})).tools[0])


def program(*more, last=-DEEP, y=0.0, step=0.4):
    """The groove in passes from air to air, then ``more`` lines; ``last``, ``y``: of the last pass."""
    lines = ["%", "G21 G90 G17 G94 G40 G49 G54 G61", "T1 M6", "S8000 M3", "G0 X-14 Y0", "G43 H1 Z20", "G0 Z1"]
    for k in range(1, round(DEEP / step) + 1):
        lines += ["G0 X-14 Y0", f"G0 Z{-step * k:.3f}", "G1 X14 F300", "G0 Z1"]
    lines += [f"G0 X-14 Y{y}", f"G0 Z{last}", "G1 X14 F300", "G0 Z20", *more, "M5", "M30", "%"]
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module", params=TOOLS)
def groove(request, tmp_path_factory):
    """A plate with a groove along X that is the profile of a mill: its name, its proofs."""
    import cadquery as cq

    arcs = body(TOOLS[request.param]).arcs
    block = cq.Workplane("XY").box(20, 16, 8, centered=(True, True, False)).translate((0, 0, -8))

    def at(sine, side=1.0):
        rho, high = arcs.at_sine(sine)
        return side * rho, high - DEEP

    mid, end = 0.5 * (arcs.join_sine + arcs.end_sine), arcs.end_sine
    line = cq.Workplane("YZ").moveTo(-arcs.wide, TOP).lineTo(-arcs.wide, arcs.high - DEEP)
    line = line.threePointArc(at(mid, -1.0), at(arcs.join_sine, -1.0)) if arcs.bow > 0.0 else line
    line = line.threePointArc((0.0, -DEEP), at(arcs.join_sine)) if arcs.flat == 0.0 else line.threePointArc(
        at(0.5 * arcs.join_sine, -1.0), (-arcs.flat, -DEEP)).lineTo(arcs.flat, -DEEP).threePointArc(
        at(0.5 * arcs.join_sine), at(arcs.join_sine))
    line = line.threePointArc(at(mid), at(end)) if arcs.bow > 0.0 else line
    cut = line.lineTo(arcs.wide, TOP).close().extrude(40.0, both=True)
    return TOOLS[request.param], proof_of_tools(block.cut(cut), tmp_path_factory.mktemp("groove"), "groove",
                                                TOOLS[request.param])


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    """A plate with a step along X: floor at -5, and an upright wall at Y 1."""
    import cadquery as cq

    block = cq.Workplane("XY").box(20, 16, 8, centered=(True, True, False)).translate((0, 0, -8))
    step = cq.Workplane("XY").box(40, 20, 10, centered=(True, False, False)).translate((0, -19, -DEEP))
    made = {}

    def prove(name):
        if name not in made:
            made[name] = proof_of_tools(block.cut(step), tmp_path_factory.mktemp("wall"), "wall", TOOLS[name])
        return made[name]

    return prove


def deepest(tool, other):
    """How far the profile of one mill reaches out of that of another, mm."""
    lines = []
    for fields in (tool, other):
        arcs = body(fields).arcs
        rho, high = arcs.at_sines(np.sin(np.linspace(0.0, math.asin(min(arcs.end_sine, 1.0)), 4000)))
        lines.append(np.column_stack([np.append(np.linspace(0.0, arcs.flat, 50), [*rho, *[arcs.wide] * 400]),
                                      np.append(np.zeros(50), [*high, *np.linspace(arcs.high, DEEP, 400)])]))
    a, b = lines
    near = np.hypot(b[:, None, 0] - a[None, :, 0], b[:, None, 1] - a[None, :, 1]).min(axis=1)
    out = b[:, 0] > np.interp(b[:, 1], a[:, 1], a[:, 0])
    return float(near[out].max(initial=0.0))


def test_a_groove_of_the_shape_of_the_mill_has_no_finding(groove):
    report = groove[1](program())
    assert sum(report["finding_counts"].values()) == 0, [f["message"] for f in report["findings"]]
    assert report["gouge_max_mm"] < 2e-3


def test_a_pass_too_low_gouges_the_bottom(groove):
    told = found(groove[1](program(last=-DEEP - 0.05)), "gouge")
    assert told["depth"] == pytest.approx(0.05, abs=5e-3) and told["line"] == len(program().splitlines()) - 4


def test_a_pass_beside_the_groove_gouges_its_side(groove):
    told = found(groove[1](program(y=0.04)), "gouge")
    assert told["depth"] == pytest.approx(0.04, abs=5e-3) and told["line"] == len(program().splitlines()) - 4


def test_another_profile_radius_gouges_or_covers_less(groove):
    fields, proved = groove
    for share in (1.5, 0.8):
        other = {**fields, "profile_radius_mm": share * fields["profile_radius_mm"]}
        report = proved(program(), profile_radius_mm=other["profile_radius_mm"])
        gouge = deepest(fields, other)
        if gouge > 0.015:
            assert found(report, "gouge")["depth"] == pytest.approx(gouge, abs=6e-3)
        else:
            assert "gouge" not in report["finding_counts"] and report["coverage"] < 0.99


@pytest.mark.parametrize("name", TOOLS)
def test_beside_a_wall_the_widest_diameter_counts(wall, name):
    radius = 0.5 * TOOLS[name]["diameter_mm"]

    def along(away):
        lines = ["%", "G21 G90 G17 G94 G40 G49 G54 G61", "T1 M6", "S8000 M3", "G0 X-14 Y0", "G43 H1 Z20"]
        for k in range(1, 14):
            lines += [f"G0 X-14 Y{1.0 - radius - 0.5}", f"G0 Z{-0.4 * k if k < 13 else -5.0:.3f}", "G1 X14 F300",
                      "G0 Z20"]
        lines += [f"G0 X-14 Y{1.0 - radius - away:.6f}", "G0 Z-5", "G1 X14 F300", "G0 Z20", "M5", "M30", "%"]
        return "\n".join(lines) + "\n"

    assert "gouge" not in wall(name)(along(0.001))["finding_counts"]
    told = found(wall(name)(along(-0.03)), "gouge")
    over = body(TOOLS[name]).arcs.width(DEEP) - radius  # the arcs of the oval end a little over the wall
    assert told["depth"] == pytest.approx(0.03 + over, abs=5e-3) and told["line"] == len(along(0.0).splitlines()) - 4


def test_a_floor_keeps_the_scallop_of_the_lens_at_its_closed_form(wall):
    """Passes 2.4 mm apart on the floor: about s^2 / (8 R), exactly R - sqrt(R^2 - s^2 / 4)."""
    lines = ["%", "G21 G90 G17 G94 G40 G49 G54 G61", "T1 M6", "S8000 M3", "G0 X-14 Y-12", "G43 H1 Z20"]
    left = 12.0 - math.sqrt(144.0 - 1.2**2)
    for deep in [0.4 * k for k in range(1, 13)] + [5.0]:
        for k in range(6):
            aside = -12.0 + 2.4 * k if k < 5 else -2.001
            lines += [f"G0 X-14 Y{aside:.4f}", f"G0 Z{-deep:.3f}", "G1 X14 F900", "G0 Z20"]
    report = wall("lens")("\n".join([*lines, "M5", "M30", "%"]) + "\n")
    assert left > 0.05 and "gouge" not in report["finding_counts"]
    told = found(report, "stock_left")
    assert left - 0.02 < told["depth"] < left + 1e-3  # no sample lies just on the crest
