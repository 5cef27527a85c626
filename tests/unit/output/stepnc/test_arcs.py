"""Arcs in STEP-NC: written as circles with two ends, read back as the G2 and G3 of the program, refused by name."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import ProgramError
from output.arc_fitting import SAG, fitted
from output.stepnc.ap238 import write_stepnc_aim
from output.stepnc.iso14649 import write_stepnc_arm
from output.workplan import Ap238
from tests.arc_plans import HALF, SHAPES, cutting, round_clamped, round_plan
from tests.broken_stepnc import broken
from tests.synthetic_plan import write_linuxcnc
from verify.comparison.stepnc_agreement import check_agreement
from verify.gcode.reader import read_program
from verify.stepnc.part21 import Part21File
from verify.stepnc.reader import ap238, iso14649, read_moves, read_stepnc

FORMS = {"aim": write_stepnc_aim, "first edition": lambda p: write_stepnc_aim(replace(p, ap238=Ap238.INTEGRATED_CNC)),
         "arm": write_stepnc_arm}
both = pytest.mark.parametrize("write", FORMS.values(), ids=FORMS)


def level_arcs(plan):
    return [(t, a) for s in plan.steps for t in s.trajectories for a in t.arcs
            if round(t.points[a.first, 2], 4) == round(t.points[a.last, 2], 4)]


@both
def test_level_arcs_are_circles_and_helices_are_not(write):
    plan = round_plan()
    arcs = level_arcs(plan)
    assert len(arcs) < sum(len(t.arcs) for s in plan.steps for t in s.trajectories)
    text = write(plan)
    assert text.count("=TRIMMED_CURVE(") == text.count("=CIRCLE(") == len(arcs) > 5
    flat = replace(plan, steps=tuple(replace(s, trajectories=tuple(replace(t, arcs=()) for t in s.trajectories))
                                     for s in plan.steps))
    assert len(text) < 0.9 * len(write(flat)) and "TRIMMED" not in write(flat)


@both
def test_what_is_read_is_the_program_chord_by_chord(write):
    flat = fitted(cutting(*(way for name, way in SHAPES.items() if "helix" not in name)), HALF)
    for plan, apart in ((flat, 1e-6), (round_plan(), SAG)):
        read = read_stepnc(write(plan), tools=plan.tools)
        agreement = check_agreement(read_program(write_linuxcnc(plan)), read)
        assert not read.remarks and agreement.tip < apart


@both
def test_on_a_machine_that_turns_they_stay_polylines(write):
    assert "TRIMMED_CURVE" not in write(fitted(round_clamped(), HALF))


def one_ring():
    return fitted(cutting(SHAPES["ring"]), HALF)


@both
@pytest.mark.parametrize(("what", "instead", "message"), [
    (r"(CIRCLE\('',#\d+),[0-9.]+", r"\1,4.9", "a point on the circle expected"),
    (r"(TRIMMED_CURVE\('',#\d+),\(#\d+\)", r"\1,(PARAMETER_VALUE(0.))", "parameters are not read"),
    (r"(TRIMMED_CURVE\(.*),\.CARTESIAN\.", r"\1,.PARAMETER.", "master_representation"),
    (r"(TRIMMED_CURVE\('',)#\d+", r"\g<1>#1", "basis_curve"),
])
def test_an_arc_that_is_none_is_refused_by_its_number(write, what, instead, message):
    text = write(one_ring())
    number = re.search(r"#(\d+)=TRIMMED_CURVE", text)[1]
    with pytest.raises(ProgramError, match=message) as refused:
        read_stepnc(re.sub(what, instead, text, count=1))
    assert f"#{number}" in refused.value.subjects


def test_a_gap_between_segments_is_refused():
    text = write_stepnc_aim(one_ring())
    first, second = re.findall(r"#\d+=COMPOSITE_CURVE_SEGMENT\(\.CONTINUOUS\.,\.T\.,(#\d+)\);", text)[:2]
    with pytest.raises(ProgramError, match="from the end of the segment before"):
        read_stepnc(text.replace(f".T.,{second})", f".T.,{first})"))


@both
def test_the_other_sense_is_the_other_way_round(write):
    text = write(one_ring())
    there, back = (read_moves(t) for t in (text, text.replace(",.T.,.CARTESIAN.", ",.F.,.CARTESIAN.")))
    lengths = [np.linalg.norm(m.end - m.start, axis=1)[~m.rapid].sum() for m in (there, back)]
    assert lengths[1] > lengths[0] + 20.0  # three arcs of a third of a ring became three of two thirds


def test_segments_and_curves_may_be_walked_backwards():
    text = write_stepnc_aim(one_ring())
    number, line = re.search(r"#(\d+)=TRIMMED_CURVE\((.*)\);", text).groups()
    circle, a, b = re.search(r"'',(#\d+),\((#\d+)\),\((#\d+)\)", line).groups()
    sense = "T" if ".T." in line else "F"
    turned = f"'',{circle},({b}),({a}),.{'F' if sense == 'T' else 'T'}.,.CARTESIAN."
    other = text.replace(f"#{number}=TRIMMED_CURVE({line});", f"#{number}=TRIMMED_CURVE({turned});")
    other = other.replace(f",.T.,#{number});", f",.F.,#{number});")
    assert other != text
    one, two = read_moves(text), read_moves(other)
    assert np.abs(one.end - two.end).max() < 1e-9


@pytest.mark.parametrize(("write", "form", "names"), [(write_stepnc_arm, iso14649, False),
                                                      (write_stepnc_aim, ap238, True)], ids=["arm", "aim"])
def test_every_attribute_of_an_arc_broken_is_refused_by_name(write, form, names):
    """The entities arcs bring, one attribute at a time (all others: tests/rejects/test_stepnc_rejects.py)."""
    text = write(one_ring())
    good = read_moves(text)
    new = {"TRIMMED_CURVE", "CIRCLE", "COMPOSITE_CURVE", "COMPOSITE_CURVE_SEGMENT"}
    others = frozenset(" ".join(n for n, _ in Part21File(text, "job").records(k))
                       for of in Part21File(text, "job").entities().values() for k in of) - new | {"CARTESIAN_POINT"}
    refused = 0
    for b in broken(text, form.TABLE, names=names, most=1, without=others):
        assert b.entity in new
        try:
            read = read_moves(b.text)
        except ProgramError as error:
            assert f"#{b.number}" in error.subjects, (b, error.message)
            refused += 1
        else:
            assert b.attribute == "name" and np.array_equal(read.end, good.end), (b.entity, b.attribute, b.how)
    assert refused > (20 if write is write_stepnc_arm else 35)
