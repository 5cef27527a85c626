"""Stock that programs leave where their own tools could have cut it, but no tool has room; depths in closed form."""

import json
import math

import pytest

from service.from_wire import parse_setup
from service.stages.job_part import read_job_part
from service.verification.program_first import read_first
from service.verification.program_proof import proved_program
from tests.step_files import write_step

CUTTER = {"id": "T1", "number": 1, "kind": "flat", "diameter_mm": 8, "flute_length_mm": 1, "neck_diameter_mm": 3,
          "neck_length_mm": 20, "shank_diameter_mm": 8, "stickout_mm": 30}
BLOCK = {"tools": [CUTTER], "stock": {"kind": "box", "box_mm": [[0, 0, 0], [16, 12, 6]], "uncertainty_mm": 0.0}}
LEAN = math.radians(20.0)
MILL = {"id": "T1", "number": 1, "kind": "flat", "diameter_mm": 4, "flute_length_mm": 8, "stickout_mm": 40,
        "gauge_length_mm": 80}


def proof(folder, shape, setup, lines, stock=None):
    wanted = parse_setup(json.dumps(setup))
    job = read_job_part(write_step(shape, folder / "part.step"), wanted, lambda _stage, _share: None, stock)
    return proved_program(job, read_first(wanted, "\n".join(lines) + "\n", ending=".ngc"), lambda _s: None).report


def side_groove(folder, high, deep, levels, to=24.0):
    """A groove 2 deep and ``high`` high in the side y = 0, cut ``deep`` deep as far as X ``to``.

    By a cutter 1 mm high at some levels.
    """
    cq = pytest.importorskip("cadquery")
    shape = cq.Workplane().box(16, 12, 6, centered=False)
    shape = shape.cut(cq.Workplane().box(16, 2, high, centered=False).translate((0, 0, 3)))
    lines = ["G21 G17 G90 G94 G40 G49 G80 G64 P0.001", "G54", "T1 M6", "S3000 M3", "G0 X-8 Y-6", "G43 H1 Z30", "G0 Z8"]
    for z in levels:
        lines += ["G0 X-8 Y-6", f"G0 Z{z}", f"G1 Y{deep - 4.0} F300", f"G1 X{to}", "G1 Y-6", "G0 Z8"]
    return proof(folder, shape, BLOCK, [*lines, "G0 Z30", "M5", "G53 G0 Z0", "M2"])


def heights(report):
    """The largest height of stock that is left on each face, mm."""
    found = [f for f in report["findings"] if f["kind"] == "stock_left"]
    return {face: max(f["depth"] for f in found if f["face"] == face) for face in {f["face"] for f in found}}


@pytest.mark.parametrize(("high", "levels"), [(1.0, (3.0,)), (1.4, (3.0, 3.4))])
def test_a_groove_cut_to_its_depth_is_proved(tmp_path, high, levels):
    report = side_groove(tmp_path, high, 2.0, levels)
    assert report["state"] == "proved" and report["coverage"] > 0.99


@pytest.mark.parametrize(("high", "levels"), [(1.0, (3.0,)), (1.4, (3.0, 3.4))])
def test_a_groove_cut_to_half_its_depth_leaves_the_other_half(tmp_path, high, levels):
    report = side_groove(tmp_path, high, 1.0, levels)
    assert report["state"] == "clean" and len(heights(report)) >= 2
    assert all(depth == pytest.approx(1.0, rel=0.01) for depth in heights(report).values())


@pytest.mark.parametrize("to", [4.0, 11.0])
def test_a_groove_cut_along_a_part_of_its_length_leaves_the_rest(tmp_path, to):
    report = side_groove(tmp_path, 1.0, 2.0, (3.0,), to)
    assert report["state"] == "clean" and max(heights(report).values()) == pytest.approx(2.0, abs=0.01)


def test_a_ceiling_that_is_left_too_low_is_told(tmp_path):
    report = side_groove(tmp_path, 1.4, 2.0, (3.0, 3.2))
    assert report["state"] == "clean"
    assert heights(report) and all(depth == pytest.approx(0.2, abs=0.002) for depth in heights(report).values())


@pytest.mark.parametrize(("lean", "state", "stock"),
                         [(20.0, "proved", 0.2), (19.3, "clean", 0.2), (15.0, "clean", 1.0)])
def test_a_flank_that_leans_too_little_leaves_a_wedge(tmp_path, lean, state, stock):
    """A wall leans 20 degrees over its foot and has some stock; the flank touches its upper edge."""
    cq = pytest.importorskip("cadquery")

    def wall(more):
        top = 6.0 - 4.0 * math.tan(LEAN) - more
        outline = [(0, 0), (10, 0), (10, 6), (top, 6), (6.0 - more, 2), (0, 2)]
        return cq.Workplane("YZ").polyline(outline).close().extrude(8)

    blank = write_step(wall(stock / math.cos(LEAN)), tmp_path / "blank.step")
    a = math.radians(lean)
    z = 2.0 + 2.0 * math.sin(a) + 0.005
    y = 6.0 - 4.0 * math.tan(LEAN) - (2.0 - (6.0 - z) * math.sin(a)) / math.cos(a)
    setup = {"tools": [MILL], "stock": {"kind": "step", "step_file": str(blank), "uncertainty_mm": 0.0},
             "machine": {"kind": "5-axis", "kinematics": "table-table-AC", "dialects": ["linuxcnc"], "iso_axes": []}}
    lines = ["G21 G90 G17 G94 G40 G49 G54 G61", "G53 G0 Z0", "G0 A0 C0", "T1 M6", "S8000 M3", "G0 X-6 Y-6",
             "G43 H1 Z60", "M428", f"G0 A-{lean} C0", f"G0 X-6 Y-8 Z{z:.4f}", f"G0 Y{y:.5f}", "G1 X14 F150",
             "G1 Y-8 F400", "G0 Z60", "G0 A0 C0", "M429", "G53 G0 Z0", "M5", "M30"]
    report = proof(tmp_path, wall(0.0), setup, lines, blank)
    assert report["state"] == state, report["findings"][:3]
    if state == "clean":
        lowest = 4.0 * math.tan(LEAN - a) / math.cos(LEAN)  # at the foot; the end of the tool stays a little above
        assert all(0.5 * lowest < depth < lowest + 0.003 for depth in heights(report).values()) and heights(report)


@pytest.mark.parametrize(("lean", "state"), [(20.0, "proved"), (17.0, "clean")])
def test_a_flank_on_a_drafted_wall_leaves_a_wedge_too(tmp_path, lean, state):
    """The wall leans back by 20 degrees with 0.3 mm of stock on it; the flank touches its foot."""
    cq = pytest.importorskip("cadquery")

    def wall(more):
        more = more / math.cos(LEAN)
        outline = [(0, 0), (12, 0), (12, 6), (6.0 + 4.0 * math.tan(LEAN) - more, 6), (6.0 - more, 2), (0, 2)]
        return cq.Workplane("YZ").polyline(outline).close().extrude(8)

    blank, a = write_step(wall(0.3), tmp_path / "blank.step"), math.radians(lean)
    z = 2.0 + 2.0 * math.sin(a) + 0.005
    y = 6.0 - (2.0 + (2.0 - z) * math.sin(a)) / math.cos(a)
    setup = {"tools": [dict(MILL, flute_length_mm=10)],
             "stock": {"kind": "step", "step_file": str(blank), "uncertainty_mm": 0.0},
             "machine": {"kind": "5-axis", "kinematics": "table-table-AC", "dialects": ["linuxcnc"], "iso_axes": []}}
    lines = ["G21 G90 G17 G94 G40 G49 G54 G61", "G53 G0 Z0", "G0 A0 C0", "T1 M6", "S8000 M3", "G0 X-6 Y-6",
             "G43 H1 Z60", "M428", f"G0 A{lean} C0", f"G0 X-6 Y-8 Z{z:.4f}", f"G0 Y{y:.5f}", "G1 X14 F150",
             "G0 Y-8", "G0 Z60", "G0 A0 C0", "M429", "G53 G0 Z0", "M5", "M30"]
    report = proof(tmp_path, wall(0.0), setup, lines, blank)
    assert report["state"] == state, report["findings"][:2]
    if state == "clean":
        assert max(heights(report).values()) == pytest.approx(4.0 / math.cos(LEAN) * math.sin(LEAN - a), rel=0.1)


KEYWAY = {"tools": [{"id": "T1", "number": 1, "kind": "flat", "diameter_mm": 4, "flute_length_mm": 8,
                     "stickout_mm": 25}],
          "stock": {"kind": "box", "box_mm": [[0, 0, 0], [16, 12, 6]], "uncertainty_mm": 0.0}}


@pytest.mark.parametrize(("to", "state"), [(13.0, "proved"), (8.0, "clean")])
def test_a_keyway_as_wide_as_its_mill_is_asked_to_its_end(tmp_path, to, state):
    """14 x 4, 3 deep, from X3 to X13; a mill of 4 mm ramps down to Z3 between X3 and X ``to``."""
    cq = pytest.importorskip("cadquery")
    shape = cq.Workplane().box(16, 12, 6, centered=False)
    shape = shape.cut(cq.Workplane().center(8, 6).slot2D(14, 4).extrude(6).translate((0, 0, 3)))
    lines = ["G21 G17 G90 G94 G40 G49 G80 G64 P0.001", "G54", "T1 M6", "S6000 M3", "G0 X3 Y6", "G43 H1 Z30", "G0 Z6.5",
             "G1 Z6 F200"]
    for k in range(1, 21):
        lines += [f"G1 X{to if k % 2 else 3.0} Z{6.0 - 0.15 * k:.4f} F200"]
    lines += [f"G1 X{to}", "G1 X3", "G0 Z30", "M5", "G53 G0 Z0", "M2"]
    report = proof(tmp_path, shape, KEYWAY, lines)
    assert report["state"] == state, report["findings"][:2]
    if state == "clean":
        assert max(heights(report).values()) == pytest.approx(3.0, abs=0.02)


@pytest.mark.parametrize(("share", "state"), [(1.0, "proved"), (0.5, "clean")])
def test_a_half_round_ring_as_wide_as_its_ball_is_asked_all_round(tmp_path, share, state):
    """A ring groove of 4 mm with a half round of 1 mm, by a ball of 2 mm that sinks 1 mm on its way."""
    cq = pytest.importorskip("cadquery")
    ring = cq.Workplane("XZ").center(4, 6).circle(1.0).revolve(360, (-4, 0), (-4, 1))
    shape = cq.Workplane().box(12, 12, 6, centered=(True, True, False)).cut(ring)
    mill = {"id": "T1", "number": 1, "kind": "ball", "diameter_mm": 2, "flute_length_mm": 6, "stickout_mm": 20}
    setup = {"tools": [mill],
             "stock": {"kind": "box", "box_mm": [[-6, -6, 0], [6, 6, 6]], "uncertainty_mm": 0.0}}
    lines = ["G21 G17 G90 G94 G40 G49 G80 G64 P0.001", "G54", "T1 M6", "S8000 M3", "G0 X4 Y0", "G43 H1 Z30", "G0 Z6.5",
             "G1 Z6 F80"]
    turn = 2.0 * math.pi * share
    x, y = 4.0 * math.cos(turn), 4.0 * math.sin(turn)
    for k in range(1, 11):
        there = (x, y, "G3") if k % 2 or share == 1.0 else (4.0, 0.0, "G2")
        i, j = (-4.0, 0.0) if k % 2 or share == 1.0 else (-x, -y)
        lines += [f"{there[2]} X{there[0]:.5f} Y{there[1]:.5f} Z{6.0 - 0.1 * k:.4f} I{i:.5f} J{j:.5f} F80"]
    lines += [f"G3 X{x:.5f} Y{y:.5f} I-4 J0", "G0 Z30", "M5", "G53 G0 Z0", "M2"]
    report = proof(tmp_path, shape, setup, lines)
    assert report["state"] == state, report["findings"][:2]
    if state == "clean":
        assert max(heights(report).values()) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(("short", "state"), [(0.0, "proved"), (0.2, "clean"), (0.4, "clean")])
def test_a_mill_that_stops_before_it_touches_both_walls_of_a_notch(tmp_path, short, state):
    """Two upright walls meet at 60 degrees: a crescent of that thickness stays on the floor at the end of the way."""
    cq = pytest.importorskip("cadquery")
    tangent, sine = math.tan(math.radians(30.0)), math.sin(math.radians(30.0))
    notch = cq.Workplane("XY", origin=(0, 0, 3)).polyline([(-1, 8 - 17 * tangent), (16, 8), (-1, 8 + 17 * tangent)])
    shape = cq.Workplane().box(20, 16, 6, centered=False).cut(notch.close().extrude(4))
    setup = {"tools": [MILL], "stock": {"kind": "box", "box_mm": [[0, 0, 0], [20, 16, 6]], "uncertainty_mm": 0.0}}
    end = 16.0 - 2.0 / sine - short

    def aside(x, more):
        return max((16.0 - x) * tangent - 2.0 / math.cos(math.radians(30.0)) - more, 0.0)
    lines = ["G21 G17 G90 G94 G40 G49 G80 G64 P0.001", "G54", "T1 M6", "S3000 M3", "G0 X-8 Y8", "G43 H1 Z30", "G0 Z9"]
    for z in (5.2, 4.4, 3.6, 3.0):
        for more in (9.0, 7.5, 6.0, 4.5, 3.0, 1.5, 0.0):
            last = min(end, 16.0 - (2.0 / math.cos(math.radians(30.0)) + more) / tangent)
            way = aside(last, more)
            lines += ["G0 Z9", f"G0 X-5 Y{8.0 - aside(-5.0, more):.4f}", f"G0 Z{z}",
                      f"G1 X{last:.4f} Y{8.0 - way:.4f} F300", f"G1 Y{8.0 + way:.4f}",
                      f"G1 X-5 Y{8.0 + aside(-5.0, more):.4f}"]
    report = proof(tmp_path, shape, setup, [*lines, "G0 Z30", "M5", "G53 G0 Z0", "M2"])
    assert report["state"] == state, report["findings"][:3]
    if short:
        floor = max(f["depth"] for f in report["findings"] if f["kind"] == "stock_left" and f["point"][2] < 3.01)
        assert 0.6 * short < floor < 1.15 * short
