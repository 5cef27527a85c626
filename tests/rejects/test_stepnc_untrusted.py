"""STEP-NC made to hurt: sizes no machine has, files mutated anywhere.

What comes back is a reading or an error of the reader's own.
"""

from __future__ import annotations

import re

import numpy as np
import pytest

from geometry.errors import ProgramError
from output.stepnc.ap238 import write_stepnc_aim
from output.stepnc.iso14649 import write_stepnc_arm
from tests.synthetic_plan import clamped, tiny
from verify.kinematics import Kinematics
from verify.stepnc.reader import read_stepnc
from verify.stepnc.tool_motion import MotionRecorder

WRITERS = {"arm": write_stepnc_arm, "aim": write_stepnc_aim}
NUMBERS = ("0", "-1", "1", "0.", "-1.", "1.E308", "-1.E308", "1.E-308", "1.E999", "1.E-999", "NAN", ".NAN.", "INF",
           "999999999999999999", "0.5", "3.", "1.E12", "$", "*", "()", "''")


def refusal(text):
    with pytest.raises(ProgramError) as refused:
        read_stepnc(text)
    return refused.value


@pytest.mark.parametrize(("what", "instead"), [
    ("TIME_MEASURE(60.)", "TIME_MEASURE(0.)"), ("TIME_MEASURE(60.)", "TIME_MEASURE(-60.)"),
    ("TIME_MEASURE(60.)", "TIME_MEASURE(1.E308)"), ("TIME_MEASURE(60.)", "TIME_MEASURE(1.E15)"),
    ("TIME_MEASURE(60.)", "TIME_MEASURE(1.E-13)"),
    ("DERIVED_UNIT_ELEMENT(#18,-1.)", "DERIVED_UNIT_ELEMENT(#18,-4.)"),
    ("DERIVED_UNIT_ELEMENT(#18,-1.)", "DERIVED_UNIT_ELEMENT(#18,1.E308)"),
])
def test_a_unit_of_no_size_is_refused_by_name(what, instead):
    text = write_stepnc_aim(tiny())
    assert what in text
    error = refusal(text.replace(what, instead))
    assert error.subjects[0].startswith("#") and ("size of the unit" in error.message or "exponent" in error.message)


def test_a_large_measure_with_an_exponent_is_refused():
    text = write_stepnc_aim(tiny()).replace("TIME_MEASURE(60.)", "TIME_MEASURE(1.E308)")
    assert "size of the unit" in refusal(text.replace("DERIVED_UNIT_ELEMENT(#18,-1.)",
                                                      "DERIVED_UNIT_ELEMENT(#18,2.)")).message


@pytest.mark.parametrize("value", ["1.E-9", "1.E-300", "1.E308", "1.E15"])
@pytest.mark.parametrize("form", WRITERS)
def test_a_feed_of_no_size_is_refused(form, value):
    number = {"aim": r"(?<='feed speed',NUMERIC_MEASURE\()[0-9.]+", "arm": r"(?<=MILLING_TECHNOLOGY\()[-0-9.E]+"}[form]
    other, count = re.subn(number, value, WRITERS[form](tiny()))
    assert count
    error = refusal(other)
    assert "feedrate" in error.message and error.subjects[0].startswith("#")


@pytest.mark.parametrize(("words", "named"), [
    (r"\1$\2,5.,", "feedrate_per_tooth"), (r"\g<1>0.01\2,$,", "cutspeed")])
def test_a_rate_that_is_stated_twice_is_refused(words, named):
    text, count = re.subn(r"(MILLING_TECHNOLOGY\([^,]+,\.TCP\.,)\$(,[^,]+),\$,", words, WRITERS["arm"](tiny()))
    assert count and f"{named}: $ expected" in refusal(text).message


@pytest.mark.parametrize(("what", "instead", "entity"), [
    ("(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.))", "SI_UNIT()", "SI_UNIT"),
    ("CONTEXT_DEPENDENT_UNIT(#17,'revolution')", "(NAMED_UNIT(*) CONTEXT_DEPENDENT_UNIT())", "CONTEXT_DEPENDENT_UNIT"),
])
def test_an_entity_in_the_other_form_is_refused(what, instead, entity):
    text = write_stepnc_aim(tiny())
    assert what in text
    assert f"has {entity} " in refusal(text.replace(what, instead)).message


def test_a_workpiece_that_is_placed_in_its_setup_is_refused():
    """Its paths would be read in the wrong place."""
    text = write_stepnc_aim(tiny())
    setup = re.search(r"#(\d+)=MACHINING_SETUP_WORKPIECE_RELATIONSHIP", text)[1]
    placed = (f"#9001=PROPERTY_DEFINITION('workpiece orientation','',#{setup});\n"
              "#9002=REPRESENTATION('',(#13),#9);\n#9003=PROPERTY_DEFINITION_REPRESENTATION(#9001,#9002);\n")
    error = refusal(text.replace("ENDSEC;\nEND-", placed + "ENDSEC;\nEND-"))
    assert error.subjects[:2] == ("#9001", f"#{setup}") and "in its setup" in error.message


def test_a_direction_of_no_size_and_a_dwell_before_now_are_refused():
    text = write_stepnc_arm(tiny())
    assert "direction_ratios" in refusal(text.replace("(0.,0.,1.)", "(0.,0.,1.E308)")).message
    other = re.sub(r"=CUTTER_LOCATION_TRAJECTORY\([^;]*;", "=FEEDSTOP(.T.,.CONTACT.,$,$,$,-1.);", text, count=1)
    assert "dwell" in refusal(other).message


def test_an_axis_that_turns_over_in_one_move_is_refused():
    course = MotionRecorder("job", 9)
    with pytest.raises(ProgramError, match="line 8: .*half a turn"):
        course.follow(np.zeros((2, 3)), np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]), rapid=False, feed=1.0, speed=1.0,
                      lines=np.array([7.0, 8.0]))


def mutated(text, rng):
    """A text with one to three places changed: bytes, numbers, pieces taken out or set in elsewhere."""
    for _ in range(int(rng.integers(1, 4))):
        at = int(rng.integers(len(text)))
        way = int(rng.integers(5))
        if way == 0:
            text = text[:at] + chr(ord(text[at]) ^ (1 << int(rng.integers(8)))) + text[at + 1:]
        elif way <= 2:
            spots = number_spots(text)
            low, high = spots[int(rng.integers(len(spots)))]
            text = text[:low] + NUMBERS[int(rng.integers(len(NUMBERS)))] + text[high:]
        else:
            length = int(rng.integers(1, 30))
            piece = text[at:at + length]
            to = int(rng.integers(len(text)))
            text = text[:at] + text[at + length:] if way == 3 else text[:to] + piece + text[to:]
    return text


def number_spots(text):
    return [m.span() for m in re.finditer(r"(?<![A-Z0-9_])#?-?[0-9]+(?:\.[0-9]*(?:E-?[0-9]+)?)?", text)]


@pytest.mark.parametrize("job", [tiny, clamped], ids=["small", "turning"])
@pytest.mark.parametrize("form", WRITERS)
def test_a_mutated_file_is_read_or_refused_by_an_error_of_ours(form, job):
    rng, text = np.random.default_rng(17), WRITERS[form](job())
    for _ in range(300 if job is tiny else 40):
        other = mutated(text, rng)
        try:
            with np.errstate(over="raise", divide="raise", invalid="raise"):
                read_stepnc(other, kinematics=Kinematics("table-table-AC", None))
        except ProgramError as error:
            assert error.message
