"""Faults planted into a right program: each is found, of the right kind, on the right line, as deep as planted."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import ProgramError
from tests.pocket_case import OTHER, SETUP, TOOL, ZONES, block, line_of, program, scored, text
from verify.model import FindingKind, StockKind
from verify.prove import Proof, prove

PART = block()
SCORED = scored(PART)


def run(lines, tools=(TOOL,), setup=SETUP, threads=2) -> Proof:
    return prove([("pocket.ngc", text(lines))], PART, tools, setup, SCORED, ZONES, threads=threads)


def first(proof, kind):
    found = [f for f in proof.findings if f.kind == kind]
    assert found, (kind, proof.counts)
    return found[0]


def test_a_right_program_has_no_finding():
    proof = run(program())
    assert proof.no_findings and proof.gouge_max < 1e-9
    assert proof.zones["Z1"].coverage == proof.zones["Z2"].coverage == 1.0
    assert proof.spent.seconds == pytest.approx(368.5, abs=5) and proof.minutes.keys() == {1}


@pytest.mark.parametrize("kind", [StockKind.PART_OFFSET, StockKind.CYLINDER])
def test_other_blanks_are_cut_as_well(kind):
    assert run(program(), setup=replace(SETUP, stock_kind=kind, margin=0.5)).no_findings


def test_gouge_of_a_fiftieth():
    lines = program()
    at = line_of(lines, "Y4.0", -1) + 1
    lines[at - 1] += " Z-5.02"
    lines.insert(at, "Z-5")
    found = first(run(lines), FindingKind.GOUGE)
    assert found.line == at and found.face == "F11" and found.depth == pytest.approx(0.02, abs=1e-3)


def test_gouge_of_a_wall():
    lines = program()
    at = line_of(lines, "X8 Y4", -1)
    lines[at - 1] = "X8.03 Y4"
    proof = run(lines)
    found = first(proof, FindingKind.GOUGE)
    assert found.line in (at, at + 1) and found.depth == pytest.approx(0.03, rel=0.1)


def test_gouge_within_the_tolerance_is_none():
    lines = program()
    at = line_of(lines, "X8 Y4", -1)
    lines[at - 1] = "X8.008 Y4"
    assert run(lines).no_findings


def test_missing_retract():
    lines = program()
    at = line_of(lines, "G0 Z20", -1)
    lines[at - 1] = "G0 X18"
    found = first(run(lines), FindingKind.RAPID)
    assert found.line == at


def test_rapid_too_near_to_stock():
    lines = program()
    at = line_of(lines, "G0 Z20", -1)
    lines.insert(at - 1, "G0 Z0.2")
    lines.insert(at, "G0 X-7.5")
    proof = run(lines)
    assert first(proof, FindingKind.RAPID).line == at + 1
    assert "brings" in first(proof, FindingKind.RAPID).message


def test_shank_hit():
    proof = run(program(), tools=(replace(TOOL, flute_length=4.0, neck_length=4.0),))
    found = first(proof, FindingKind.COLLISION)
    assert "shank" in found.message and found.line > line_of(program(), "(layer -4.000)")
    assert found.depth == pytest.approx(1.0, abs=0.01)


def test_holder_hit():
    proof = run(program(), tools=(replace(TOOL, flute_length=4.0, neck_length=4.5, shank_diameter=4.0, stickout=4.8),))
    found = first(proof, FindingKind.COLLISION)
    assert "holder" in found.message and found.line > line_of(program(), "(layer -4.500)")


def test_shank_near_the_wall_is_rubbing():
    tool = replace(TOOL, flute_length=4.0, neck_diameter=4.0, neck_length=4.4, shank_diameter=4.0)
    assert run(program(), tools=(tool,)).no_findings
    part_way = replace(TOOL, flute_length=4.0, neck_length=4.5, shank_diameter=4.0002)
    assert first(run(program(), tools=(part_way,)), FindingKind.RUBBING).depth < SETUP.clearance_shank


def test_clamp_hit():
    clamp = np.array([[-9.0, -15, 0], [-7, -3, 4]])
    found = first(run(program(), setup=replace(SETUP, fixtures=(clamp,))), FindingKind.COLLISION)
    assert "fixture" in found.message
    held = np.array([[-40.0, -15, -10], [-32, 15, 4]])
    assert run(program(), setup=replace(SETUP, fixtures=(held,))).no_findings


def test_feed_plunge():
    lines = program()
    at = line_of(lines, "G1 X7 Y0 Z-2.000 F400")
    lines[at - 1] = "G1 Z-2.0 F400"
    found = first(run(lines), FindingKind.PLUNGE)
    assert found.line == at and found.depth == pytest.approx(0.5, abs=1e-6)


def test_descent_in_air_is_no_plunge():
    lines = program()
    at = line_of(lines, "G0 Z20", -1)
    lines[at - 1:at - 1] = ["G1 Z3", "G1 Z-5"]
    assert run(lines).no_findings


def test_neck_in_stock_that_the_flutes_do_not_reach():
    lines = program(step=0.5)
    tool = replace(TOOL, flute_length=0.4)
    assert "neck" in first(run(lines, tools=(tool,)), FindingKind.COLLISION).message


def test_wrong_length_offset():
    lines = program()
    at = line_of(lines, "G0 G43 H1 Z20")
    lines[at - 1] = "G0 G43 H2 Z20"
    found = first(run(lines, tools=(TOOL, OTHER)), FindingKind.PROGRAM)
    assert found.line == at and "H2" in found.message


def test_no_length_offset():
    lines = program()
    at = line_of(lines, "G0 G43 H1 Z20")
    lines[at - 1] = "G0 Z20"
    assert first(run(lines), FindingKind.PROGRAM).line == at


def test_missing_pass():
    lines = program()
    start = line_of(lines, "Y2.0", -2)
    kept = [line for k, line in enumerate(lines, 1) if k < start or k > line_of(lines, "Y0.0", -1)]
    cut = line_of(kept, "G1 X8 Y-4", -1)
    proof = run([line for k, line in enumerate(kept, 1) if not cut <= k < cut + 5])
    floor = [f for f in proof.findings if f.kind == FindingKind.RESIDUAL and f.zone == "Z1"]
    assert floor and all(f.depth == pytest.approx(0.5, abs=1e-6) for f in floor)
    assert proof.zones["Z1"].coverage < 0.9


def test_inch_for_mm():
    lines = program()
    lines[1] = lines[1].replace("G21", "G20")
    proof = run(lines, setup=replace(SETUP, travel=np.array([100.0, 101.0, 160.0])))
    found = {f.limit: f for f in proof.findings if f.kind == FindingKind.LIMIT}
    assert set(found) == {100.0, 101.0, 160.0}
    assert "in Z" in found[160.0].message and found[160.0].depth == pytest.approx(25.4 * 25.0 - 160.0)
    assert f"to 508.000 (line {line_of(lines, 'X-7 Y0')})" in found[160.0].message
    assert proof.counts["residual"] > 0


@pytest.mark.parametrize("word, axis", [("X-7", "X"), ("Y4.0", "Y"), ("G1 X7 Y0 Z-2.000 F400", "Z")])
def test_a_lost_point_is_named_by_its_line(word, axis):
    lines = program()
    at = line_of(lines, word)
    lines[at - 1] = {"X": "X-7000", "Y": "Y4000", "Z": "G1 X7 Y0 Z-2000 F400"}[axis]
    found = first(run(lines, setup=replace(SETUP, travel=np.array([200.0, 200.0, 200.0]))), FindingKind.LIMIT)
    assert found.line == at and f"in {axis}" in found.message


def test_tool_that_is_not_in_the_table():
    lines = program()
    lines[2] = "T7 M6"
    with pytest.raises(ProgramError, match="T7") as caught:
        run(lines)
    assert "line 3" in caught.value.subjects


def test_wrong_tool_in_the_spindle_is_a_gouge():
    lines = [line.replace("T1", "T2").replace("H1", "H2") for line in program()]
    found = first(run(lines, tools=(TOOL, OTHER)), FindingKind.GOUGE)
    assert found.depth > 0.9


def test_faster_than_the_machine_feeds_or_turns():
    lines = program()
    proof = run(lines, setup=replace(SETUP, max_feed=400.0, max_rpm={1: 8000.0, 9: 10.0}))
    assert not [f for f in proof.findings if f.kind == FindingKind.LIMIT]
    at = line_of(lines, "G1 X7 Y0 Z-5.000 F400")
    lines[at - 1] = lines[at - 1].replace("F400", "F1200")
    spin = line_of(lines, "S8000 M3")
    lines[spin - 1] = lines[spin - 1].replace("S8000", "S8001")
    found = [f for f in run(lines, setup=replace(SETUP, max_feed=400.0, max_rpm={1: 8000.0})).findings
             if f.kind == FindingKind.LIMIT]
    assert [(f.line, f.depth, f.limit) for f in found] == [(at, 800.0, 400.0), (spin, 1.0, 8000.0)]


DRILLS = {
    "at once": ["Z-1.0"],
    "by steps aside": [w for k in range(1, 6) for w in (f"Z{-0.2 * k:.1f}", f"X{-7 + 0.001 * (k % 2)}")],
    "by pecks": [w for k in range(1, 6) for w in (f"Z{-0.2 * k:.1f}", "G0 Z1.5", f"Z{-0.2 * k + 0.1:.1f}", "G1")],
    "up a little between": [w for k in range(1, 6) for w in (f"Z{-0.2 * k:.1f}", f"Z{-0.2 * k + 0.001:.3f}")],
}


@pytest.mark.parametrize("way", DRILLS)
def test_a_plunge_is_one_however_it_is_broken_up(way):
    lines = program()
    at = line_of(lines, "G1 Z0.5 F300")
    found = first(run([*lines[:at], *DRILLS[way], "Z0.5", *lines[at:]]), FindingKind.PLUNGE)
    assert found.depth == pytest.approx(1.5, abs=0.12) and at < found.line <= at + len(DRILLS[way])


def test_slots_between_small_steps_down_are_no_plunge():
    lines = program()
    at = line_of(lines, "G1 Z0.5 F300")
    slots = [w for k in range(1, 8) for w in (f"Z{0.5 - 0.2 * k:.1f}", f"X{7 if k % 2 else -7}")]
    assert "plunge" not in run([*lines[:at], *slots, "Z0.5", "X-7", *lines[at:]]).counts


def test_a_plunge_from_home_or_the_start_is_seen():
    lines = program()
    for way in (["G43 H1", "G0 X-7 Y0", "G1 Z-1.0 F60"], ["G43 H1", "G53 G0 Z0", "G0 X-7 Y0", "G1 Z-1.0 F60"]):
        found = first(run([*lines[:4], *way, "G0 Z1.5", *lines[7:]]), FindingKind.PLUNGE)
        assert found.line == 4 + len(way) and found.depth == pytest.approx(1.5, abs=0.01)
    rapid = ["G43 H1", "G0 X-7 Y0", "Z-1.0"]
    assert first(run([*lines[:4], *rapid, *lines[7:]]), FindingKind.RAPID).line == 7


@pytest.mark.parametrize(("way", "named"), [
    (["G43 H1", "G0 X-7 Y0 Z0.4"], 2), (["G43 H1", "G53 G0 Z0", "G53 G0 X0 Y0", "G0 X-7 Y0 Z0.4"], 4),
    (["G43 H1", "G0 Z0.4", "X-7 Y0"], 2), (["G43 H1", "G1 X-7 Y0 Z0.5 F300"], 2)])
def test_a_way_from_an_unstated_place_into_the_work_is_named(way, named):
    lines = program()
    found = first(run([*lines[:4], *way, "G0 Z1.5", *lines[7:]]), FindingKind.PROGRAM)
    assert found.line == 4 + named
    assert ("before X and Y are stated" if way[1] == "G0 Z0.4" else "cannot be simulated") in found.message
    above = [w.replace("Z0.4", "Z1.5").replace("Z0.5", "Z1.5") for w in way]
    assert run([*lines[:4], *above, *lines[7:]]).no_findings


def test_a_dogleg_takes_the_whole_box_of_its_move():
    """From beside the block steeply up over it: the straight way is clear, the way across first and then up is not."""
    lines = program()
    lines = [*lines[:-4], "G0 Z20", "X-30", "Z-2", "X-12 Z25", *lines[-3:]]
    assert run(lines).no_findings
    proof = run(lines, setup=replace(SETUP, dogleg=True))
    assert {f.line for f in proof.findings} == {line_of(lines, "X-12 Z25")}
    found = first(proof, FindingKind.RAPID)
    # 2.5 mm under the top, and no deeper than half the tool is wide
    assert "cutting part into stock" in found.message and found.depth == pytest.approx(TOOL.radius, abs=0.08)
    assert found.point[0] <= -12 + TOOL.radius and run(program(), setup=replace(SETUP, dogleg=True)).no_findings


def test_a_pass_pasted_twice_is_named():
    lines = program()
    a, b = line_of(lines, "(layer -3.000)"), line_of(lines, "(layer -3.500)")
    twice = [*lines[:b - 1], *lines[a - 1:b - 1], *lines[b - 1:]]
    proof = run(twice)
    found = first(proof, FindingKind.PROGRAM)
    assert proof.counts == {"program": 1} and b < found.line <= b + 3
    assert f"repeat lines {a + found.line - b}" in found.message


def test_a_stop_in_the_stock_is_named():
    lines = program()
    lift = line_of(lines, "G0 Z20")
    low = [line for k, line in enumerate(lines, 1) if k != lift]
    found = first(run(low), FindingKind.PROGRAM)
    assert found.line == line_of(low, "M30") and "end of the program" in found.message
    found = first(run([*lines[:lift - 1], "T2 M6", "G43 H2 S8000 M3", "G0 X0 Y0", *lines[lift - 1:]],
                      tools=(TOOL, OTHER)), FindingKind.PROGRAM)
    assert found.line == lift and "tool change" in found.message


def test_tool_lengths_count_in_the_travel_of_z():
    lines = program()
    end = line_of(lines, "M5")
    two = [*lines[:end - 1], "T2 M6", "S8000 M3", "G0 G43 H2 Z20", *lines[end - 1:]]
    setup = replace(SETUP, travel=np.array([500.0, 500.0, 100.0]), gauge_length={1: 60.0, 2: 100.0})
    assert run(two, tools=(TOOL, OTHER), setup=setup).no_findings
    found = first(run(two, tools=(TOOL, OTHER), setup=replace(setup, gauge_length={1: 60.0, 2: 160.0})),
                  FindingKind.LIMIT)
    assert found.depth == pytest.approx(25.0) and "tool lengths from 60 to 160" in found.message


def test_what_is_taken_for_granted_is_told():
    lines = program()
    lines[1] = "G90 G61"
    proof = run(lines)
    assert proof.no_findings
    assert proof.notes == ("pocket.ngc does not state G21, G17, G94, G54 before its first move; the proof assumes it",)


def test_blending_is_in_the_error_bound():
    lines = program()
    assert run(lines).error_bound == pytest.approx(0.001001)
    lines[1] = lines[1].replace("G61", "G64 P0.001 Q0")
    assert run(lines).error_bound == pytest.approx(0.002001) and run(lines).no_findings


def test_what_goes_below_the_part_is_told():
    assert run(program()).notes == ()
    lines = program()
    at = line_of(lines, "G1 X7 Y0 Z-5.000 F400")
    lines[at - 1] = "G1 X7 Y0 Z-15.000 F400"
    assert f"line {at} goes to Z-15.000, 5.000 mm below the part" in run(lines).notes[0]


def test_program_of_another_zero_meets_nothing():
    lines = [line.replace("Z-", "Z3") if line.startswith("G1 X7") else line for line in program()]
    assert first(run(lines), FindingKind.RESIDUAL).zone in ZONES


def test_threads_do_not_change_a_byte():
    lines = program()
    lines[line_of(lines, "X8 Y4", -1) - 1] = "X8.03 Y4"
    one, two = run(lines, threads=1), run(lines, threads=2)
    assert one.as_dict() == two.as_dict()
    assert one.residual.tobytes() == two.residual.tobytes() and one.line.tobytes() == two.line.tobytes()


def test_a_program_without_zones_is_still_watched():
    nobody = replace(SCORED, zone=np.zeros_like(SCORED.zone))
    lines = program()
    at = line_of(lines, "G0 Z20", -1)
    lines[at - 1] = "G0 X18"
    proof = prove([("foreign.nc", text(lines))], PART, [TOOL], SETUP, nobody, ())
    assert first(proof, FindingKind.RAPID).line == at and "residual" not in proof.counts
