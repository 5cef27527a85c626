"""Circle segment mills in STEP-NC: the nearest shape of the standard with the profile in words, which is compared."""

from dataclasses import replace

import pytest

from output.stepnc.ap238 import write_stepnc_aim
from output.stepnc.iso14649 import write_stepnc_arm
from output.workplan import Ap238
from tests.synthetic_plan import SEGMENTS, segment, write_linuxcnc
from verify.comparison.stepnc_agreement import check_agreement
from verify.gcode.reader import read_program
from verify.stepnc.reader import read_moves, read_stepnc


def write_first_edition(job):
    return write_stepnc_aim(replace(job, ap238=Ap238.INTEGRATED_CNC))


FORMS = {"aim": write_stepnc_aim, "arm": write_stepnc_arm, "first edition": write_first_edition}
every = pytest.mark.parametrize("write", FORMS.values(), ids=FORMS)
kinds = pytest.mark.parametrize("kind", SEGMENTS)


def messages(text, *tools):
    return [r.message for r in read_stepnc(text, tools=tools).remarks]


@every
@kinds
def test_every_kind_comes_back_as_it_is_in_the_setup(write, kind):
    job, body = segment(kind), SEGMENTS[kind]
    (cutter,) = read_moves(write(job)).cutters
    assert (cutter.diameter, cutter.corner_radius, cutter.flute_length) == pytest.approx(
        (body.diameter, body.corner_radius, 12.0), abs=1e-6)
    assert f"{body.form} D6 profile R{body.profile_radius:g}" in cutter.words
    read = read_stepnc(write(job), tools=job.tools)
    assert not read.remarks
    check_agreement(read_program(write_linuxcnc(job), tools={1}), read)


@every
@kinds
def test_another_profile_in_file_or_setup_is_a_difference(write, kind):
    text, body = write(segment(kind)), SEGMENTS[kind]
    assert any(f"R{body.profile_radius:g}" in m and "R25 " in m
               for m in messages(text, replace(body, profile_radius=25.0)))
    assert any("no profile radius in the setup" in m
               for m in messages(text, replace(body, form="", profile_radius=0.0, profile_taper=0.0)))
    changed = text.replace(f"profile R{body.profile_radius:g}", "profil")
    assert any("no profile radius in the file" in m for m in messages(changed, body))


def test_the_standard_gets_its_nearest_shape():
    aim, arm, old = (write(segment()) for write in FORMS.values())
    assert "'user defined milling tool'" in aim and "'tool description','lens D6 profile R20; its nearest" in aim
    assert "BULLNOSE_ENDMILL(" in arm and "T1: lens D6 profile R20, corner R0.5" in arm
    assert "'bullnose endmill'" in old
