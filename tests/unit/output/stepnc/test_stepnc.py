"""Both STEP-NC writers, read back with plain regular expressions."""

import re
import time

import numpy as np
import pytest

from geometry.errors import OutputError
from output.program_grid import grid_path
from output.stepnc.ap238 import write_stepnc_aim
from output.stepnc.common import pass_plane_normal
from output.stepnc.iso14649 import write_stepnc_arm
from output.stepnc.part21 import quoted, real, time_stamp
from output.workplan import Ap238, StockBox
from tests.golden_file import assert_golden
from tests.synthetic_plan import BALL, clamped, full, line, long_plan, plan, shaped, step, tiny
from tests.time_limits import in_time
from toolpath.workingsteps import Trajectory, TrajectoryKind

WRITERS = {"tiny.arm.stpnc": write_stepnc_arm, "tiny.stpnc": write_stepnc_aim}
both = pytest.mark.parametrize("write", WRITERS.values(), ids=["arm", "aim"])


def instances(text):
    return {int(n): body for n, body in re.findall(r"^#(\d+)=(.*?);$", text, re.MULTILINE | re.DOTALL)}


def polyline(data, body):
    points = [data[int(n)] for n in re.findall(r"#(\d+)", body.split(",", 1)[1])]
    return np.array([[float(v) for v in re.search(r"\(([-\d.,]+)\)\)", p).group(1).split(",")] for p in points])


@pytest.mark.parametrize("name", WRITERS)
def test_golden(name):
    assert_golden(name, WRITERS[name](tiny()))


@both
def test_same_bytes_twice_and_epoch(write, monkeypatch):
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    text = write(plan())
    assert text == write(plan())
    assert "'1970-01-01T00:00:00'" in text
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    assert "'2023-11-14T22:13:20'" in write(plan())
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(OutputError):
        write(plan())


@both
def test_text_is_what_strict_readers_take(write):
    text = write(plan())
    assert text.isascii()
    bare = re.sub(r"'(?:[^']|'')*'", "''", text)
    assert not re.search(r"\d[eE][-+]?\d", bare)
    assert not re.search(r"-0\.0*[,)]", bare)
    assert "nan" not in bare.lower()


@both
def test_every_reference_is_defined_once(write):
    text = write(plan())
    numbers = [int(n) for n in re.findall(r"^#(\d+)=", text, re.MULTILINE)]
    assert sorted(numbers) == list(range(1, len(numbers) + 1))
    bare = re.sub(r"'(?:[^']|'')*'", "''", text)
    assert {int(n) for n in re.findall(r"#(\d+)", bare)} <= set(numbers)


@both
def test_labels_hashes_and_material_are_carried(write):
    text = write(plan())
    assert "M\\X2\\00FC\\X0\\ller''s \"4711\" (rush) \\\\ 20 %" in text
    assert "\\X2\\2192\\X0\\" in text and "\\X4\\0001F600\\X0\\" in text
    assert "ab" * 32 in text and "cd" * 32 in text and "Ti-6Al-4V" in text


@both
def test_names_carry_zone_and_faces(write):
    names = re.findall(r"MACHINING_WORKINGSTEP\('([^']*)'", write(plan()))
    assert names[2] == "S03 Z3 waterline T1 F12 F13"
    assert [n.split()[0] for n in names] == ["S01", "S02", "S03", "S04", "S05"]


@both
def test_paths_read_back_and_join(write):
    job = plan()
    data = instances(write(job))
    lines = {n: polyline(data, b) for n, b in data.items() if b.startswith("POLYLINE('',")}
    wanted = [p * 1e-4 for s in job.steps for _, p in grid_path(s) if len(p) > 1]
    found = iter(lines[n] for n in sorted(lines))
    for points in wanted:
        assert any(len(points) == len(got) and np.abs(points - got).max() < 1e-9 for got in found)


def test_arm_units_signs_and_tool_bodies():
    text = write_stepnc_arm(plan())
    assert "MILLING_TECHNOLOGY(0.01,.TCP.,$,-200.,$,.F.,.F.,.F.,$)" in text  # 600 mm/min, 12000 rev/min
    assert "MILLING_TECHNOLOGY(0.004,.TCP.,$,-200.," in text  # the approach
    assert "MILLING_TOOL_DIMENSION(3.,$,$,9.,1.5,1.5,0.)" in text
    assert "MILLING_TOOL_DIMENSION(8.,$,$,20.,1.,1.,3.)" in text
    assert "MILLING_TOOL_DIMENSION(6.,$,$,18.,0.,0.,3.)" in text
    assert text.count("=BALL_ENDMILL") == 1 and text.count("=BULLNOSE_ENDMILL") == 2
    assert text.count("=MILLING_CUTTING_TOOL") == 3
    assert text.count("PLANE_CL_STRATEGY(.ZIGZAG.") == 1


def test_passes_along_the_borders_of_faces_are_told_by_parameters():
    """One pass alone goes forward; each against the one before it is to and fro."""
    along = np.array([[0.0, 0, 5], [10, 0, 5]])
    one_way, both_ways = ([Trajectory(TrajectoryKind.CUT, p, 600.0) for p in ways] for ways in
                          ([along, along + [0.0, 1, 0]], [along, along[::-1] + [0.0, 1, 0]]))
    for cuts, mode in ((one_way, "FORWARD"), (both_ways, "ZIGZAG")):
        link = Trajectory(TrajectoryKind.CONNECT, np.array([cuts[0].points[-1], cuts[1].points[0]]), 600.0)
        job = plan(step(1, BALL, "isoparametric", trajectories=(cuts[0], link, cuts[1])))
        text = write_stepnc_arm(job)
        assert text.count(f"UV_STRATEGY(.{mode}.,.CLIMB.,") == 1 and "PLANE_CL_STRATEGY" not in text


def test_arm_workplan_starts_with_a_rapid_and_ids_are_unique():
    text = write_stepnc_arm(plan())
    data = instances(text)
    elements = re.search(r"WORKPLAN\('main workplan',\(([^)]*)\)", text).group(1).split(",")
    kinds = [data[int(e[1:])].split("(")[0] for e in elements]
    assert kinds == ["RAPID_MOVEMENT", "WORKPLAN"]
    inside = re.search(r"WORKPLAN\('setup G54',\(([^)]*)\)", text).group(1).split(",")
    kinds = [data[int(e.strip()[1:])].split("(")[0] for e in inside]
    assert kinds.count("MACHINING_WORKINGSTEP") == 5 and kinds.count("RAPID_MOVEMENT") == 4
    ids = re.findall(r"(?:RAPID_MOVEMENT|MACHINING_WORKINGSTEP|WORKPLAN)\('((?:[^']|'')*)'", text)
    assert len(ids) == len(set(ids))


def test_arm_outline_is_closed():
    data = instances(write_stepnc_arm(plan()))
    outlines = [b for b in data.values() if b.startswith("POLYLINE('outline")]
    assert len(outlines) == 5
    for body in outlines:
        points = re.findall(r"#(\d+)", body)
        assert points[0] == points[-1] and len(points) == 5


def test_steps_with_one_tool_that_do_not_join_are_linked_over_the_clearance_plane():
    a = step(1, BALL, "planar_floor", trajectories=(line(TrajectoryKind.CUT, (0, 0, 1), (5, 0, 1), feed=100),))
    b = step(2, BALL, "planar_floor", trajectories=(line(TrajectoryKind.CUT, (9, 3, 2), (5, 0, 2), feed=100),))
    wanted = np.array([[5, 0, 1], [5, 0, 25], [9, 3, 25], [9, 3, 2]], dtype=float)
    for write in WRITERS.values():
        data = instances(write(plan(a, b)))
        lines = [polyline(data, body) for body in data.values() if body.startswith("POLYLINE('',")]
        assert any(x.shape == wanted.shape and (x == wanted).all() for x in lines)


def test_aim_tools_list_their_operations_and_stock_is_a_block_in_class_two():
    assert "SHAPE_REPRESENTATION('stock" not in write_stepnc_aim(plan())  # class 1 has no shape
    text = write_stepnc_aim(plan(ap238=Ap238.CC2))
    data = instances(text)
    tools = dict(re.findall(r"MACHINING_TOOL\('(\d+)','([^']*)'", text))
    assert tools == {"7": "bullnose endmill", "2": "endmill", "1": "ballnose endmill"}
    users = re.search(r"MACHINING_TOOL\('7','bullnose endmill',\(([^)]*)\)", text).group(1).split(",")
    assert [data[int(u[1:])].split("'")[1] for u in users] == ["S01 roughing depth_layers", "S05 roughing depth_layers"]
    assert "NUMERIC_MEASURE(-12000.)" in text and "NUMERIC_MEASURE(600.)" in text
    assert "BLOCK_SHAPE_REPRESENTATION" in text and "'rawpiece'" in text


def elements(data, text, name):
    """Entities and ids of the elements of a workplan."""
    inside = re.search(rf"WORKPLAN\('{re.escape(name)}',\(([^)]*)\)", text).group(1)
    return [re.match(r"(\w+)\('([^']*)'", data[int(n)]).groups() for n in re.findall(r"#(\d+)", inside)]


def test_workplans_are_nested_by_setup_and_tool_axis():
    text = write_stepnc_arm(clamped())
    data = instances(text)
    assert elements(data, text, "main workplan")[1] == ("WORKPLAN", "setup G54")
    assert elements(data, text, "setup G54") == [
        ("WORKPLAN", f"access {a}") for a in ("A1", "I1", "I2", "I1 again 2")]
    steps = [name for entity, name in elements(data, text, "access I1") if entity == "MACHINING_WORKINGSTEP"]
    assert [s.split()[0] for s in steps] == ["S02", "S03"]
    channel = re.search(r"#(\d+)=CHANNEL", text).group(1)
    assert len(re.findall(rf"WORKPLAN\([^;]*,#{channel},", text)) == 6
    assert write_stepnc_aim(clamped()).count("=MACHINING_WORKPLAN(") == 1  # class 1 allows one


def test_a_fresh_cutter_is_a_message_and_a_stop_before_the_step():
    arm, aim = write_stepnc_arm(full()), write_stepnc_aim(full())
    kinds = [entity for entity, _ in elements(instances(arm), arm, "setup G54")]
    at = kinds.index("DISPLAY_MESSAGE")
    assert kinds[at:at + 3] == ["DISPLAY_MESSAGE", "PROGRAM_STOP", "RAPID_MOVEMENT"]
    assert "DISPLAY_MESSAGE('fresh cutter for S04','Fresh cutter in T1: change it and set its length')" in arm
    assert aim.index("'display message'") < aim.index("'program stop'") < aim.index("MACHINING_WORKINGSTEP('S04")


def test_faces_of_passes_that_follow_them_are_surfaces_and_others_outlines():
    job = full()
    text = write_stepnc_arm(job)
    assert text.count("=REGION_SURFACE_LIST('S03 region Z3 F12 F13'") == 1 and text.count("=REGION_PROJECTION(") == 4
    assert "B_SPLINE_SURFACE_WITH_KNOTS" in text and "RATIONAL_B_SPLINE_SURFACE(((1.,0.9,0.9,1.)" in text
    assert "=BEZIER_SURFACE('F12',2,3," in text
    some = full(surfaces={12: job.surfaces[12]})
    assert "REGION_SURFACE_LIST" not in write_stepnc_arm(some)  # a feature of one of two faces would be too small


def test_blank_assembly_teeth_and_life_are_said():
    arm, aim = write_stepnc_arm(full()), write_stepnc_aim(shaped())
    assert "RIGHT_CIRCULAR_CYLINDER('stock cylinder'," in arm and "BLOCK(" not in arm and ",20.,22.)" in arm
    assert "CYLINDRICAL_SHAPE_REPRESENTATION('stock cylinder'" in aim
    assert "=BALL_ENDMILL(" in arm and re.search(r"=BALL_ENDMILL\(#\d+,2,\.RIGHT\.", arm)
    assert "CUTTING_COMPONENT(75.5,$,$,2700.,$)" in arm and re.search(r"T1: ball[^;]*,75\.5,\$,\$\)", arm)
    assert "LENGTH_MEASURE(75.5)" in aim and "COUNT_MEASURE(4.)" in aim and "TIME_MEASURE(45.)" in aim
    grown = write_stepnc_arm(full(cylinder=None, stock_words="part grown by 1 mm"))
    assert "BLOCK('box round the stock'" in grown and "'stock part grown by 1 mm'" in grown


def test_class_two_has_shapes_strategies_and_instructions_and_class_one_none():
    one, two = write_stepnc_aim(full()), write_stepnc_aim(shaped())
    for words in ("TESSELLATED_SOLID('part'", "'plane normal'", "'milling tolerances'", "'setup instructions'",
                  "TRIANGULATED_FACE('F6'", "'uv'"):
        assert words in two and words not in one
    assert "class 2" in two and "class 1" in one and "scallop 0.01 mm" in one
    assert two.count("=FREEFORM_MILLING_STRATEGY(") == 5 and "'security plane'" in one


def test_zigzag_planes_follow_the_passes():
    t = np.linspace(0.0, 10.0, 5)
    there = np.column_stack([t, 0.5 * t, np.zeros(5)])
    cut = (Trajectory(TrajectoryKind.CUT, there, 100.0), Trajectory(TrajectoryKind.CUT, there[::-1].copy(), 100.0))
    normal = np.array(pass_plane_normal(step(1, BALL, "zigzag", trajectories=cut)))
    assert abs(normal @ (there[1] - there[0])) < 1e-12 and np.linalg.norm(normal) == pytest.approx(1.0)


def test_strings_and_reals():
    assert quoted("it's \\ ok") == "'it''s \\\\ ok'"
    assert quoted("é漢x") == "'\\X2\\00E96F22\\X0\\x'"
    assert quoted("a\nb") == "'a\\X2\\000A\\X0\\b'"
    assert [real(v) for v in (0.0, -0.00001, 12.5, 1e-5, -3.0, 1e7)] == ["0.", "0.", "12.5", "0.", "-3.", "10000000."]
    with pytest.raises(OutputError):
        real(float("nan"))


@both
def test_rejects(write):
    cut = line(TrajectoryKind.CUT, (0, 0, 0), (1, 0, 0), feed=100)
    bad = {
        "slanted_rapid": plan(step(1, BALL, "waterline",
                                   trajectories=(line(TrajectoryKind.RAPID, (0, 0, 0), (1, 0, 1)),))),
        "gap_in_path": plan(step(1, BALL, "waterline", trajectories=(cut, cut))),
        "empty_step": plan(step(1, BALL, "waterline",
                                trajectories=(line(TrajectoryKind.CUT, (0, 0, 0), (0, 0, 0), feed=1),))),
        "bad_stock": plan(stock=StockBox(np.zeros(3), np.array([1.0, 1.0, 0.0]))),
        "id_twice": plan(step(1, BALL, "waterline"), step(1, BALL, "planar_floor")),
    }
    for code, job in bad.items():
        with pytest.raises(OutputError) as e:
            write(job)
        assert e.value.code == code


@both
def test_three_hundred_thousand_points_in_seconds(write):
    big = long_plan(300_000)
    start = time.perf_counter()
    text = write(big)
    assert in_time(time.perf_counter() - start, 20.0)  # 0.9 s when alone on one core
    assert text.count("=CARTESIAN_POINT") > 299_000


def test_time_stamp_default(monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "")
    assert time_stamp() == "1970-01-01T00:00:00"
