"""Part 21 text made to hurt: long runs of a letter, names without end, blanks and directives that are none."""

from __future__ import annotations

import time

import pytest

from geometry.errors import ProgramError
from verify.stepnc.part21 import Part21File, decoded, is_exchange_file

RUN, SOON = 200_000, 2.0  # letters, s
BEGIN = "ISO-10303-21;\nHEADER;FILE_SCHEMA(('X'));ENDSEC;\nDATA;\n"
END = "ENDSEC;\nEND-ISO-10303-21;\n"
RUNS = ("'", "''", "'x'", '"', "0", "1.", "1.,", "E", "A", "A ", "A(", "A1", "_", ".", ".T.", " ", "\n", "(", ")", "/",
        "*", "/*", "*/", "/**/", "$", ",", ";", "#", "#1,", "=", "\\", "\\S\\a", "\\X2\\", "-", "!", "\u00a0")
PLACES = {
    "header": "ISO-10303-21;\nHEADER;{};ENDSEC;\nDATA;\n" + END,
    "string of the header": "ISO-10303-21;\nHEADER;A('{}');ENDSEC;\nDATA;\n" + END,
    "between instances": BEGIN + "{}" + END,
    "number": BEGIN + "#{}=A();\n" + END,
    "instance": BEGIN + "#1={};\n" + END,
    "complex instance": BEGIN + "#1=({});\n" + END,
    "record": BEGIN + "#1=(A(1.) B({}));\n" + END,
    "string": BEGIN + "#1=(A('{}'));\n" + END,
    "enumeration": BEGIN + "#1=A(.{}.);\n" + END,
    "point": BEGIN + "#1=CARTESIAN_POINT('',(1.,1.,1{}.));\n" + END,
    "polyline": BEGIN + "#1=POLYLINE('',(#1,{},#1));\n" + END,
    "never closed": BEGIN + "#1=(A({}",
    "ending": BEGIN + "ENDSEC;{}",
}


def read_all(text):
    """Everything of a text, as a form of which all instances are looked at would have it."""
    is_exchange_file(text)
    file = Part21File(text, "job")
    for number in sorted({n for of in file.entities().values() for n in of}):
        file.plain_polyline(number)
        file.records(number)


@pytest.mark.parametrize("place", PLACES)
def test_a_long_run_is_read_or_refused_soon(place):
    slow = []
    for run in RUNS:
        text = PLACES[place].format(run * (RUN // len(run)))
        begin = time.process_time()
        try:
            read_all(text)
        except ProgramError as error:
            assert len(error.message) < 1000
        if time.process_time() - begin > SOON:
            slow.append(run)
    assert not slow


@pytest.mark.parametrize("form", ["(A{}(1.))", "A{}(1.)", "(B() A{}())", "B(A{}(1.))", "(A{})"])
def test_a_name_has_a_longest(form):
    text = BEGIN + "#7=" + form + ";\n" + END
    for letters in (1, 127):
        if form != "(A{})":  # which lacks its brackets
            read_all(text.format("A" * letters))
    for letters in (128, 300, 100_000):
        with pytest.raises(ProgramError, match=rf"#7.* a name of {letters + 1} letters") as refused:
            read_all(text.format("A" * letters))
        assert "#7" in refused.value.subjects


def test_a_comment_between_name_and_bracket_hides_no_record():
    file = Part21File(BEGIN + "#1=(A /* x */ (1.) B/**/());\n" + END, "job")
    assert file.of("A") == [1] and file.of("B") == [1]


def test_a_directive_shifts_ascii_only():
    assert decoded("\\S\\i") == "é"
    for letter in ("\U0010ffff", "é", "\x7f"):
        assert decoded(f"\\S\\{letter}") == f"\\S\\{letter}"


def test_a_blank_that_is_not_ascii_is_none():
    with pytest.raises(ProgramError, match="#2"):
        read_all(BEGIN + "#1=CARTESIAN_POINT('',(1.,2.,3.));\n#2=POLYLINE('',(#1,\u00a0#1));\n" + END)


def test_two_records_in_the_header_are_refused_or_read():
    Part21File(BEGIN.replace("FILE_SCHEMA(('X'))", "(A('') FILE_SCHEMA(('X')))") + END, "job")
