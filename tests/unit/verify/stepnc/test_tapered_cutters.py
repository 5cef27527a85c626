"""Tapered mills in STEP-NC: what is written comes back as the tool of the setup, and what is changed is seen."""

import math
from dataclasses import replace

import pytest

from geometry.errors import ProgramError
from output.stepnc.ap238 import write_stepnc_aim
from output.stepnc.iso14649 import write_stepnc_arm
from output.workplan import Ap238
from tests.synthetic_plan import TAPERED, tapered, write_linuxcnc
from verify.comparison.stepnc_agreement import check_agreement
from verify.gcode.reader import read_program
from verify.stepnc.reader import read_moves, read_stepnc


def write_first_edition(job):
    return write_stepnc_aim(replace(job, ap238=Ap238.INTEGRATED_CNC))


FORMS = {"aim": write_stepnc_aim, "arm": write_stepnc_arm, "first edition": write_first_edition}
every = pytest.mark.parametrize("write", FORMS.values(), ids=FORMS)
kinds = pytest.mark.parametrize("kind", TAPERED)


def with_angle(text, value):
    """The text with another angle wherever it has that of the side."""
    return text.replace("ANGLE_MEASURE(3.)", f"ANGLE_MEASURE({value})").replace(
        ".F.,$,3.)", f".F.,$,{value})").replace(",$,3.,12.", f",$,{value},12.")


def messages(text, *tools):
    return [r.message for r in read_stepnc(text, tools=tools).remarks]


@every
@kinds
def test_every_kind_comes_back_as_it_is_in_the_setup(write, kind):
    job, body = tapered(kind), TAPERED[kind]
    (cutter,) = read_moves(write(job)).cutters
    assert cutter.kind == kind and cutter.taper == pytest.approx(3.0)
    assert (cutter.diameter, cutter.corner_radius, cutter.flute_length) == pytest.approx(
        (body.diameter, body.corner_radius, 12.0), abs=1e-6)
    read = read_stepnc(write(job), tools=job.tools)
    assert not read.remarks
    check_agreement(read_program(write_linuxcnc(job), tools={1}), read)


@every
@kinds
def test_a_tool_of_the_setup_with_another_taper_is_a_difference(write, kind):
    text, body = write(tapered(kind)), TAPERED[kind]
    other = replace(body, taper=math.tan(math.radians(4.0)))
    assert any("taper 3 deg in the file and 4 deg in the setup" in m for m in messages(text, other))
    assert any("taper 3 deg in the file and 0 deg in the setup" in m for m in messages(text, replace(body, taper=0.0)))
    (found,) = messages(text, replace(body, flute_length=11.0))
    assert "flute length 12 mm in the file and 11 mm in the setup" in found


@every
@kinds
def test_a_file_with_another_taper_is_a_difference(write, kind):
    """Only the angle is changed: a side with a corner no longer touches it, which is said as well."""
    body, text = TAPERED[kind], write(tapered(kind))
    changed = with_angle(text, "4.")
    assert changed != text
    found = messages(changed, body)
    assert any("taper 4 deg in the file and 3 deg in the setup" in m for m in found)
    assert any("does not touch its corner" in m for m in found) == (body.corner_radius > 0.0)


@every
def test_a_tool_without_a_number_is_found_by_its_taper(write):
    """Two tools of equal ends: the one with the taper of the file is meant."""
    body = TAPERED["tapered_ball"]
    text = write(tapered()).replace("MACHINING_TOOL('1'", "MACHINING_TOOL('cutter'").replace(
        "CUTTING_TOOL('T1: ", "CUTTING_TOOL('cutter ")
    other = replace(body, id="T2", number=2, taper=math.tan(math.radians(5.0)))
    read = read_stepnc(text, tools=[other, body])
    assert set(read.tool.tolist()) == {1} and not read.remarks and any("matches T1" in n for n in read.notes)


def test_the_profile_is_written_as_the_standard_has_it():
    """AP238 has the seven sizes of APT, ISO 14649 an entity; their diameter is at the foot of the side."""
    foot = 2 * 0.5 * (1 - math.sin(math.radians(3))) / math.cos(math.radians(3))
    aim, arm, old = (write(tapered()) for write in FORMS.values())
    assert f"LENGTH_MEASURE({foot:.6f})" in aim and f"MILLING_TOOL_DIMENSION({foot:.6f},$,3.,12.,0.5,0.5,0.)" in arm
    assert "'user defined milling tool'" in aim and "'tool description','tapered ball D1 3 deg; " in aim
    assert "'corner radius center horizontal'" in aim and "'edge center horizontal'" in old
    assert "T1: tapered ball D1 3 deg, corner R0.5" in write_linuxcnc(tapered())
    assert "TAPERED_ENDMILL(" in arm and "T1: tapered ball D1 3 deg, corner R0.5, flute length 12 to D2.2068" in arm


@pytest.mark.parametrize(("write", "was", "is_now", "words"), [
    (write_stepnc_arm, ".F.,$,3.)", ".F.,$,5.)", "taper_angle: 3 expected, the tool_circumference_angle"),
    (write_stepnc_arm, ",3.", ",85.", "taper_angle, deg: 0 to 80 expected, not 85"),
    (write_stepnc_arm, ",$,3.,12.", ",10.,3.,12.", "tool_tip_half_angle: . or 0. expected"),
    (write_stepnc_arm, "=TAPERED_ENDMILL(#75,$,.RIGHT.,.F.,$,3.)", "=BALL_ENDMILL(#75,$,.RIGHT.,.F.,$)",
     "only the side of a TAPERED_ENDMILL may lean"),
    (write_stepnc_aim, "ANGLE_MEASURE(3.)", "ANGLE_MEASURE(88.)", "'taper angle', deg: 0 to 80 expected, not 88"),
    (write_stepnc_aim, "'taper angle'", "'tip outer angle'", "pointed ends are not read"),
    (write_stepnc_aim, "MEASURE(0.5),#6) REPRESENTATION_ITEM('corner radius center vertical')",
     "MEASURE(0.7),#6) REPRESENTATION_ITEM('corner radius center vertical')", "0.5 mm expected as 'corner radius cent"),
    (write_stepnc_aim, "'user defined milling tool'", "'ballnose endmill'", "'corner radius'")])
def test_a_profile_that_the_reader_does_not_know_is_refused(write, was, is_now, words):
    text = write(tapered())
    assert was in text
    with pytest.raises(ProgramError, match=words.replace("(", r"\(")):
        read_stepnc(text.replace(was, is_now), tools=[TAPERED["tapered_ball"]])


@pytest.mark.parametrize("write", [write_stepnc_arm, write_stepnc_aim], ids=["arm", "aim"])
def test_a_tapered_mill_without_its_angle_is_a_straight_one(write):
    """ISO 14649 has the angle as optional; in AP238 every size of such a tool is."""
    text = write(tapered("tapered_flat"))
    (cutter,) = read_moves(with_angle(text, "$" if write is write_stepnc_arm else "0.")).cutters
    assert (cutter.kind, cutter.taper, cutter.diameter) == ("flat", 0.0, 2.0)
