"""Siemens programs before the Sinumerik interpreter of others: ``pip install nc-gcode-interpreter`` (0.1.9).

Skipped where that is not there. It knows words, cycles by their form and the state they leave, but neither kinematics
nor frames, and no label that stands alone in a line, as a control does.
"""

from dataclasses import replace

import numpy as np
import pytest

from output.arc_fitting import fitted
from output.gcode.dialects import DIALECTS, Switches
from output.gcode.program_writer import write_program
from tests.arc_plans import HALF, round_clamped, round_plan
from tests.synthetic_plan import clamped, plan, tiny
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics

interpreter = pytest.importorskip("nc_gcode_interpreter")

JOBS = {"five steps": plan, "tiny": tiny, "arcs": round_plan, "3+2": lambda: clamped(swings=False),
        "five axes": clamped, "head": lambda: clamped("head-table-BC"),
        "arcs of a clamping": lambda: fitted(round_clamped(), HALF),
        "fresh cutters": lambda: replace(plan(), steps=tuple(replace(s, fresh=k > 1) for k, s in
                                                              enumerate(plan().steps)))}


def read(text):
    """The interpreter's table of states, block by block."""
    out = interpreter.nc_to_dataframe(text)
    return out[0] if isinstance(out, tuple) else out


@pytest.mark.parametrize("job", JOBS.values(), ids=JOBS)
def test_places_are_those_of_the_reader(job):
    work = job()
    text = write_program(work, DIALECTS["siemens"](Switches()))
    c = work.clamping
    p = read_program(text, dialect="siemens", gauge_length=c.gauges if c else {},
                     kinematics=Kinematics(c.machine.kind, c.machine.pivots) if c else None)
    table = read(text)
    places = table.select("X", "Y", "Z").to_numpy().astype(float)
    places = places[~np.isnan(places).any(axis=1)]
    last = np.flatnonzero(np.append(p.line[1:] != p.line[:-1], True))  # of each block
    ends = p.end[last][~np.isnan(p.end[last]).any(axis=1)]
    at = 0
    for place in ends:  # in order; it has more, for the blocks that move nothing
        while at < len(places) and np.abs(places[at] - place).max() > 3e-4:
            at += 1
        assert at < len(places), place
    motion, across = table["gg01_motion"].to_list(), table.select("X", "Y").rows()
    moved = [m for m, a, b in zip(motion[1:], across, across[1:], strict=False) if a != b]
    assert sum(m in ("G2", "G3") for m in moved) == text.count("\nG2 ") + text.count("\nG3 ")


@pytest.mark.parametrize("switches", [Switches(high_speed=True), Switches(swivel="TC1")], ids=["CYCLE832", "CYCLE800"])
def test_cycles_are_taken(switches):
    for job in JOBS.values():
        assert len(read(write_program(job(), DIALECTS["siemens"](switches)))) > 20


def test_a_word_that_is_none_is_refused():
    """Or the tests above show nothing."""
    text = write_program(tiny(), DIALECTS["siemens"](Switches()))
    with pytest.raises(Exception, match="(?i)pars|unknown|error"):
        read(text.replace("G641 ADIS=0.001", "G641 ADIS=="))
