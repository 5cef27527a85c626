"""What a program of others leaves open about itself: its control, and the sense of the rotary axes."""

import json
import subprocess
import sys
from dataclasses import replace

import pytest

from geometry.errors import SetupError
from output.gcode.dialects import DIALECTS, Switches
from output.gcode.program_writer import write_program
from schemas.machine import DIALECT_ENDINGS
from service.from_wire import parse_setup
from service.verification.program_first import read_first
from service.verification.rotary_sense import sense_in_header
from tests.synthetic_plan import clamped
from verify.assumptions import AssumedKind
from verify.kinematics import Kinematics

HEAD = "G21 G90 G17 G94 G54\nG91 G28 Z0.\nG90\nT1 M6\nS900 M3\nG0 A0 C0\nG43.4 H1\nG0 X0. Y0. Z50.\nG61\n"
AC = Kinematics("table-table-AC")
PLAIN = "G21 G90 G17 G94 G54\nT1 M6\nG43 H1\nG0 X1. Y1. Z9.\nM30\n"


def setup(**machine):
    return parse_setup(json.dumps({"tools": [{"id": "T1", "kind": "ball", "diameter_mm": 6}], "machine": machine}))


def first(body, kinematics="table-table-AC", iso=None, head="", dialect="fanuc"):
    machine = {"kind": "5-axis", "kinematics": kinematics, **({} if iso is None else {"iso_axes": iso})}
    return read_first(setup(**machine), head + HEAD + body + "M30\n", dialect=dialect)


@pytest.mark.parametrize(("body", "axes"), [
    ("G0 A30.\n", ["A"]), ("G0 A30. C90.\n", ["A", "C"]), ("G0 A-20. C180.\n", ["A", "C"])])
def test_the_sense_of_a_table_axis_is_asked_for(body, axes):
    """A30 C90 has the same tool axis where both axes turn the other way, so each axis is asked on its own. On the way
    to C180 the tool leans to the other side."""
    with pytest.raises(SetupError) as caught:
        first(f"{body}G1 X10. F500.\n")
    assert caught.value.code == "rotary_sense_open" and caught.value.subjects == ("machine.iso_axes",)
    assert caught.value.measured == axes and "machine.iso_axes" in caught.value.remedy


def test_a_sense_that_is_stated_or_without_effect_is_not_asked_for():
    """C alone turns the part under an upright tool whose tip the control keeps on the part."""
    assert first("G0 A30.\nG1 X10. F500.\n", iso=[]).kinematics.sense == (1, 1)
    assert first("G0 A30.\nG1 X10. F500.\n", iso=["A"]).kinematics.sense == (-1, 1)
    for read in (first("G0 A0. C0.\nG1 X10. F500.\n"), first("G1 X10. F500.\n"), first("G0 C90.\nG1 X5. F500.\n")):
        assert AssumedKind.ROTARY_SENSE not in {a.what for a in read.assumed}


def test_heads_are_not_asked():
    read = first("G0 A30. C90.\nG1 X10. F500.\n", "head-head-AC")
    assert read.read.poses is not None and {a.what for a in read.assumed} == {AssumedKind.COOLANT}


@pytest.mark.parametrize(("word", "gauge", "asked"), [("G43", None, True), ("G43", 90, False), ("G43.4", None, False)])
def test_a_gauge_length_is_asked_for_where_the_head_tilts_without_a_kept_tip(word, gauge, asked):
    tool = {"id": "T1", "kind": "ball", "diameter_mm": 6, **({} if gauge is None else {"gauge_length_mm": gauge})}
    machine = {"kind": "5-axis", "kinematics": "head-head-AC", "pivots_mm": [[0, 0, 100]]}
    own = parse_setup(json.dumps({"tools": [tool], "machine": machine}))
    text = HEAD.replace("G43.4", word) + "G0 A30.\nG1 X10. F500.\nM30\n"
    if not asked:
        assert read_first(own, text, dialect="fanuc").read.poses is not None
        return
    with pytest.raises(SetupError) as caught:
        read_first(own, text, dialect="fanuc")
    assert caught.value.code == "no_gauge_length" and caught.value.subjects == ("T1",)


def test_our_header_states_the_sense():
    """A program of ours says which way it counts; that the machine counts so too stays an assumption."""
    read = first("G0 A30.\nG1 X10. F500.\n", head="(TABLE AXES: A ISO 841, C RIGHT-HANDED)\n")
    assert read.kinematics.sense == (-1, 1)
    (told,) = [a for a in read.assumed if a.what == AssumedKind.ROTARY_SENSE]
    assert "A ISO 841, C right-handed" in told.value and "iso_axes" in told.remedy
    machine = Kinematics("table-table-BC")
    assert sense_in_header("(Table axes: A right-handed, C right-handed)", machine) is None
    assert sense_in_header("(Table axes: B right-handed)", machine) is None


@pytest.mark.parametrize("dialect", DIALECT_ENDINGS)
@pytest.mark.parametrize("sense", [(1, 1), (-1, 1), (-1, -1)])
def test_the_header_of_every_control_is_understood(dialect, sense):
    job = clamped("table-table-AC")
    turned = replace(job, clamping=replace(job.clamping, machine=replace(job.clamping.machine, sense=sense)))
    assert sense_in_header(write_program(turned, DIALECTS[dialect](Switches())), AC).sense == sense
    heads = write_program(clamped("head-head-AC"), DIALECTS[dialect](Switches()))
    assert sense_in_header(heads, AC) is None and "table axes" not in heads.lower()


@pytest.mark.parametrize(("ending", "dialects", "taken", "others"), [
    (".ngc", None, "linuxcnc", None), (".nc", None, "linuxcnc", "fanuc or haas"), (".nc", ["haas"], "haas", None),
    (".nc", ["fanuc", "haas"], "fanuc", "haas"), (".tap", None, "linuxcnc", "fanuc or haas"),
    ("", ["fanuc"], "fanuc", None),
    (".nc", ["siemens"], "siemens", "fanuc or haas"), ("", ["siemens"], "siemens", None),
    (".txt", ["heidenhain", "siemens"], "heidenhain", "siemens"), (".ngc", ["siemens"], "linuxcnc", None)])
def test_a_dialect_is_not_guessed_in_silence(ending, dialects, taken, others):
    machine = {} if dialects is None else {"dialects": dialects}
    text = {"siemens": "G17 G90 G54 G71\nT1 D1 M6\nG0 X1 Y1 Z9\nM30\n",
            "heidenhain": "TOOL CALL 1 Z S900\nL X+1 Y+1 Z+9 R0 FMAX M30\n"}.get(taken, PLAIN)
    read = read_first(setup(**machine), text, ending=ending)
    assert read.nc.dialect == taken
    told = [a for a in read.assumed if a.what == AssumedKind.DIALECT]
    assert [(a.value, f"for {others}," in a.effect) for a in told] == ([] if others is None else [(taken, True)])
    assert not read_first(setup(**machine), PLAIN, ending=ending, dialect="fanuc").assumed


@pytest.mark.parametrize(("word", "coolant", "told"), [
    ("", "flood", True), ("M8\n", "flood", False), ("M9\n", "flood", False), ("", "off", False)])
def test_coolant_that_nobody_turns_on_is_told(word, coolant, told):
    text = f"G21 G90 G17 G94 G54 G61\nT1 M6\nG43 H1\nS900 M3\n{word}G0 X1 Y1 Z9\nG1 X2 F100\nM2\n"
    read = read_first(setup(coolant=coolant), text, ending=".ngc")
    assert [a.what for a in read.assumed] == ([AssumedKind.COOLANT] if told else [])


def test_marks_and_a_byte_order_mark():
    """A text with marks of its control needs no name; a byte order mark is no character of the program."""
    read = read_first(setup(), "G54 ; zero\nG0 X1 Y1 SUPA\nM30\n".replace(" SUPA", "") + "MSG (\"x\")\n", ending=".nc")
    assert read.nc.dialect == "siemens" and not read.assumed
    assert len(read_first(setup(), "\ufeff" + PLAIN, ending=".nc").read) == 1


def test_a_program_is_read_without_what_takes_long_to_import():
    """A program that cannot be read is refused within two seconds of the start."""
    text = ("import sys, service.verification.program_first; "
            "print([m for m in ('numba', 'scipy', 'trimesh', 'OCP', 'cadquery', 'dask') if m in sys.modules])")
    assert subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True).stdout == "[]\n"
