"""docs/how-to-add-a-dialect.md as somebody new would follow it: a sixth control, which says things its own way."""

from __future__ import annotations

import re

import pytest

from output.gcode.dialects.base import Dialect, Switches
from output.gcode.program_writer import write_program
from tests.arc_plans import round_plan
from tests.synthetic_plan import clamped, plan, write_linuxcnc
from verify.comparison.program_equivalence import difference
from verify.gcode.dialects import CONTROLS
from verify.gcode.dialects import __name__ as home
from verify.gcode.dialects.base import BlockError, DialectReader
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics


class Sixth(Dialect):
    """Comments after !, tool and length in one word, the tip kept by TIP ON, the end called FIN."""

    name, title, ending, line = "sixth", "Sixth", "six", 80

    def comment(self, text):
        return [f"! {c[1:-1]}" for c in super().comment(text)]

    def opening(self, name, low, high):
        return []

    def closing(self, name):
        return ["FIN"]

    def take(self, number, speed):
        return [f"TOOL {number}"]

    def tcp_on(self, number, zero):
        return ["TIP ON"]

    def tcp_off(self):
        return ["TIP OFF"]


class SixthReader(DialectReader):
    """The same words backwards."""

    WORDS = {"FIN": ["M30"], "TIP ON": ["M428"], "TIP OFF": ["M429"]}

    def blocks(self, raw):
        text = raw.split("!")[0].strip()
        if tool := re.fullmatch(r"TOOL ([0-9]+)", text):
            return [f"T{tool[1]} M6", f"G43 H{tool[1]}"]
        if text.startswith("TOOL"):
            raise BlockError(f"cannot read '{text}'")
        return self.WORDS.get(text, [text] if text else [])


@pytest.mark.parametrize("work", [plan(), clamped(), round_plan()], ids=["three axes", "five axes", "arcs"])
def test_a_sixth_control_is_written_read_and_held_against_the_first(work, monkeypatch):
    monkeypatch.setitem(CONTROLS, "sixth", SixthReader)
    monkeypatch.setattr(f"{home}.DIALECTS", ("linuxcnc", *CONTROLS))
    monkeypatch.setattr("verify.gcode.reader.DIALECTS", ("linuxcnc", *CONTROLS))
    machine = Kinematics(work.clamping.machine.kind, work.clamping.machine.pivots) if work.clamping else None
    first = read_program(write_linuxcnc(work), kinematics=machine)
    text = write_program(work, Sixth(Switches()))
    assert difference(first, read_program(text, kinematics=machine, dialect="sixth")) == ""
    wrong = text.replace("TOOL 1\n", "TOOL 2\n")
    assert "the tool" in difference(first, read_program(wrong, kinematics=machine, dialect="sixth"))
