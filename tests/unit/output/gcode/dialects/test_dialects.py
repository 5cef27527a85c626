"""All five dialects: written, read back by the witness, and held against the plan and against one another."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import OutputError, ProgramError, VerificationError
from output.arc_fitting import fitted
from output.gcode.dialects import DIALECTS, Switches
from output.gcode.program_writer import write_program
from output.inverse_kinematics import RotaryMachine, program_limits
from tests.arc_plans import HALF, round_clamped, round_plan
from tests.golden_file import assert_golden
from tests.synthetic_plan import clamped, long_plan, plan, tiny, write_linuxcnc
from toolpath.workingsteps import TrajectoryKind
from verify.comparison.program_equivalence import difference
from verify.gcode.dialects import DIALECTS as READ
from verify.gcode.dialects import dialect_of
from verify.gcode.reader import read_program
from verify.kinematics import Kinematics

OTHERS = ("fanuc", "haas", "siemens", "heidenhain")
SHOPS = {"plain": Switches(), "fast": Switches(high_speed=True, haas_tcp="G43.4"),
         "planes": Switches(planes=True, swivel="TC1")}
TURNED = clamped("table-table-BC", swings=False)


def faster(work):
    """Each step at a speed of its own."""
    return replace(work, steps=tuple(replace(s, spindle_rpm=9000.0 + 500 * k) for k, s in enumerate(work.steps)))


JOBS = {
    "five steps": plan(), "tiny": tiny(), "further zero": replace(tiny(), work_offset="G59.2"),
    "restart": replace(plan(), restart=True), "3+2": TURNED, "five axes": clamped(),
    "head": clamped("head-table-BC"), "restart on five axes": replace(clamped(), restart=True),
    "speeds": faster(plan()), "speeds on five axes": faster(clamped()),
    "speeds and restart": faster(replace(plan(), restart=True)),
    "speeds and restart on five axes": faster(replace(clamped(), restart=True)),
    "arcs": round_plan(), "arcs of a clamping": fitted(round_clamped(), HALF),
    "arcs and restart": replace(round_plan(), restart=True),
    "dry": replace(plan(), restart=True, coolant=False),
    "fresh cutters": replace(plan(), steps=tuple(replace(s, fresh=k > 1) for k, s in enumerate(plan().steps))),
}


def write(work, dialect, switches=SHOPS["plain"]):
    return write_program(work, DIALECTS[dialect](switches))


def read(work, text, dialect):
    machine = work.clamping and Kinematics(work.clamping.machine.kind, work.clamping.machine.pivots)
    return read_program(text, name=dialect, dialect=dialect, work_offset=work.work_offset, kinematics=machine or None,
                        tools={t.number for t in work.tools}, gauge_length=work.clamping.gauges if machine else {})


def planned(work):
    """Feed moves of a plan in order: tips (n, 3) and (n, 3), feeds, tools, speeds, axes at both ends."""
    rows = []
    for s in work.steps:
        turn = np.eye(3) if work.clamping is None else work.clamping.frames[s.access].rotation
        for t in s.trajectories:
            if t.motion is TrajectoryKind.RAPID:
                continue
            axes = np.tile([0.0, 0.0, 1.0], (len(t.points), 1)) if t.axes is None else t.axes
            p, a, n = t.points @ turn, axes @ turn, len(t.points) - 1
            rows.append(np.hstack([p[:-1], p[1:], np.tile([t.feed, s.tool.number, s.spindle_rpm], (n, 1)), a[:-1],
                                   a[1:]]))
    return np.vstack(rows)


def test_every_dialect_written_is_read():
    assert set(DIALECTS) == set(READ)


@pytest.mark.parametrize("shop", SHOPS)
@pytest.mark.parametrize("job", JOBS)
def test_all_say_the_same(job, shop):
    work = JOBS[job]
    first = read(work, write_linuxcnc(work), "linuxcnc")
    assert not first.remarks
    for dialect in OTHERS:
        other = read(work, write(work, dialect, SHOPS[shop]), dialect)
        assert difference(first, other) == "", dialect


@pytest.mark.parametrize("dialect", READ)
@pytest.mark.parametrize("job", ["five steps", "restart", "3+2", "five axes"])
def test_what_is_read_is_the_plan(job, dialect):
    """Every planned move is there, in order: tips within 1 um, axes within 1e-6 of a grid of 1e-4 deg, F, T and S."""
    work = JOBS[job]
    p = read(work, write(work, dialect), dialect)
    cuts = np.flatnonzero(~np.isnan(p.feed))
    wanted, at = planned(work), 0
    up = np.array([0.0, 0.0, 1.0])
    for row in wanted:  # a swinging pass is written in more blocks than the plan has: each planned end is met in turn
        if np.abs(row[3:6] - row[:3]).max() < 1.5e-4:
            continue
        while at < len(cuts) and np.linalg.norm(p.end[cuts[at]] - row[3:6]) > 1e-3:
            at += 1
        assert at < len(cuts), row
        k = cuts[at]
        axis = up if p.poses is None else p.poses.end_axis[k]
        assert np.linalg.norm(axis - row[12:15]) < 1e-6 + 2 * np.radians(0.5e-4)
        assert p.feed[k] == row[6] and p.tool[k] == row[7] and p.speed[k] == row[8] and p.coolant[k] == work.coolant
        at += 1


@pytest.mark.parametrize("dialect", OTHERS)
def test_golden(dialect):
    assert_golden(f"tiny.{dialect}.{DIALECTS[dialect].ending}", write(replace(tiny(), restart=True), dialect))


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("job", JOBS)
def test_lines_are_short_ascii_and_name_the_steps(job, dialect):
    work, control = JOBS[job], DIALECTS[dialect]
    text = write(work, dialect)
    assert text.isascii() and text.endswith("\n")
    room = 8 if dialect == "heidenhain" else 0  # for the number of the block
    assert max(map(len, text.splitlines())) <= control.line + room
    plain = re.sub(r"[^A-Z0-9.]", "", text.upper())
    for s in work.steps:
        assert f"{s.id}{s.zone or 'SEVERALZONES'}{s.operation}".upper() in plain
    assert work.part_sha256.upper() in plain and work.setup_sha256.upper() in plain


MUTATIONS = {
    "fanuc": [("X2.4565", "X2.4576"), ("F240.", "F241."), ("S12000 M3", "S11000 M3"), ("M3\nM8", "M3"),
              ("M3\nM8", "M3 M8"), ("T1 M6", "T2 M6"), ("G0 X2. Y0.", "G1 X2. Y0. F600."),
              ("A-3.2939", "A-3.2949"), ("G43.4", "G43"), ("G90\nG49", "G49")],
    "haas": [("X2.4565", "X2.4576"), ("G234", "G43"), ("E0.001", "E0.002"), ("G154 P2", "G154 P3"), ("M8", "M9"),
             ("M3\nM8", "M3 M8")],
    "siemens": [("X2.4565", "X2.4576"), ("TRAORI", "TRAFOOF"), ("ADIS=0.001", "ADIS=0.002"), ("G505", "G506"),
                ("T1 M6\nD1", "T1 M6\nD0"), ("G1 Z8 F240", "G0 Z8"),
                ("ORIMKS ORIAXES\nG54 D1\n", "ORIMKS ORIAXES\nD1\n"), ("C-5.9036", "C-5.9046"), ("M8", "")],
    "heidenhain": [("X+2.4565", "X+2.4576"), ("M128", "M129"), ("32.1 T0.001", "32.1 T0.002"), ("Q339=+1", "Q339=+2"),
                   ("F240", "FMAX"), ("L Z+9 R0 FMAX", "L Z+9 R0 F600"), ("S12000", "S12001"), (" M8", " M9")],
}


@pytest.mark.parametrize(("dialect", "change"), [(d, c) for d, cs in MUTATIONS.items() for c in cs],
                         ids=lambda v: v if isinstance(v, str) else f"{v[0]} to {v[1]}")
def test_planted_differences_are_found(dialect, change):
    """One word of a program changed, wherever it stands first, and the comparison says so."""
    for job in (clamped(), replace(clamped(), work_offset="G58"), replace(clamped(), work_offset="G59.2")):
        text = write(job, dialect)
        if change[0] in text:
            break
    assert change[0] in text
    first = read(job, write_linuxcnc(job), "linuxcnc")
    assert difference(first, read(job, text, dialect)) == ""
    head, tools, body = re.split("(lengths in mm from the tip)", text, flags=re.IGNORECASE)
    wrong = head + tools + body.replace(*change, 1)
    try:
        assert difference(first, read(job, wrong, dialect)) != ""
    except ProgramError:
        pass  # refused outright: found as well


@pytest.mark.parametrize("job", ["five steps", "fresh cutters", "restart", "five axes"])
def test_any_of_two_may_be_the_one_that_is_proved(job):
    work = JOBS[job]
    read_all = {d: read(work, write(work, d), d) for d in DIALECTS}
    assert {d for d, p in read_all.items() if p.unbounded} == {"fanuc"}
    for first in DIALECTS:
        for second in DIALECTS:
            assert difference(read_all[first], read_all[second]) == "", (first, second)


LEFT_OUT = ("G21", "G54", "G91 G28 Z0.", "G49", "M5", "M9", "M0", "M8", "G90", "T7 M6")


@pytest.mark.parametrize("line", LEFT_OUT)
@pytest.mark.parametrize("job", ["fresh cutters", "five axes", "speeds on five axes"])
def test_a_line_left_out_of_a_fanuc_program_is_found(job, line):
    """Each of them wherever it stands, one at a time, whichever program it is held against."""
    work = JOBS[job]
    lines = write(work, "fanuc").splitlines(keepends=True)
    firsts = [read(work, write(work, d), d) for d in ("linuxcnc", "siemens", "heidenhain")]
    for k in [k for k, text in enumerate(lines) if text.strip() == line]:
        try:
            other = read(work, "".join([*lines[:k], *lines[k + 1:]]), "fanuc")
        except ProgramError:
            continue
        assert all(difference(first, other) for first in firsts), k + 1


@pytest.mark.parametrize(("dialect", "line"), [
    ("siemens", "SUPA G0 Z0 D0"), ("siemens", "G641 ADIS=0.001 ADISPOS=0.001"), ("siemens", "M5"), ("siemens", "M0"),
    ("heidenhain", "L Z+0 R0 FMAX M91"), ("heidenhain", "CYCL DEF 32.1 T0.001"), ("heidenhain", "M0"),
    ("haas", "G187 P3 E0.001"), ("haas", "G91 G28 Z0."), ("linuxcnc", "T0 M6"), ("linuxcnc", "M0"), ("linuxcnc", "M9")])
def test_a_line_left_out_of_the_others_is_found(dialect, line):
    work = JOBS["fresh cutters"]
    lines = write(work, dialect).splitlines(keepends=True)
    first = read(work, write(work, "linuxcnc" if dialect != "linuxcnc" else "haas"),
                 "linuxcnc" if dialect != "linuxcnc" else "haas")
    places = [k for k, text in enumerate(lines) if re.sub(r"^[0-9]+ ", "", text.strip()) == line]
    assert places
    for k in places:
        try:
            other = read(work, "".join([*lines[:k], *lines[k + 1:]]), dialect)
        except ProgramError:
            continue
        assert difference(first, other), k + 1


def test_a_move_left_out_or_put_in_is_found():
    work = tiny()
    text = write_linuxcnc(work)
    first = read(work, text, "linuxcnc")
    for wrong in (text.replace("Y2.5\n", ""), text.replace("Y2.5\n", "Y2.5\nX3.\n"), text.replace("M5\n", "Y9.\nM5\n"),
                  text.replace("M5\n", "G4 P1\nM5\n")):
        assert difference(first, read(work, wrong, "linuxcnc")) != ""


@pytest.mark.parametrize(("dialect", "line", "said"), [
    ("fanuc", "G0 X10", "without a decimal point"), ("fanuc", "G234 H1", "unknown word"),
    ("fanuc", "M428", "of LinuxCNC) is not followed"), ("fanuc", "G54.1 P40", "a setup can name"),
    ("fanuc", "X1.; Y2.", "ends the block"),
    ("haas", "G1 X1. F100", "without a decimal point"), ("haas", "G54.1 P1", "unknown word"),
    ("haas", "S900 M3 M8", "one M word in a block"),
    ("siemens", "G70", "F in the basic unit"),
    ("siemens", "X=IC(5)", "has not stated"), ("siemens", "CYCLE800(0)", "15 arguments"),
    ("siemens", "CYCLE1801(0)", "cycle or function"),
    ("siemens", "G641", "without ADIS"), ("siemens", "D2", "first cutting edge"),
    ("heidenhain", "L IX+5", "has not stated"),
    ("heidenhain", "PLANE SPATIAL SPA+10 SPB+0 SPC+0 STAY", "no rotary axes"),
    ("heidenhain", "L X+5 F100 M140", "without MB"),
    ("heidenhain", "CP PA+30 DR+", "has stated"), ("heidenhain", "CP IPA+30 Z+1 DR+", "has stated"),
    ("heidenhain", "TOOL CALL 1 X S500", "tool axis"),
])
def test_what_is_not_known_is_refused_with_its_line(dialect, line, said):
    with pytest.raises(ProgramError, match=re.escape(said)) as refused:
        read_program(f"G17\n{line}\nM30\n" if dialect != "heidenhain" else f"0 BEGIN PGM A MM\n1 {line}\n2 M30\n",
                     dialect=dialect)
    assert "line 2" in refused.value.message


def test_other_programs_of_these_controls_are_read():
    """As shops write them: numbers, comments, words run together."""
    fanuc = read_program("%\nO0001(PART)\nN10G21G17G90G94G40G49G80\nN20G91G28Z0\nN30G90G54\nN40T1M6\nN50S5000M3\n"
                         "N60G0X0.Y0.\nN70G43Z50.H1M8\nN80G1Z-1.F300\nN90G2X10.Y0.I5.J0.\nG04P500\nG0Z50.\nM30\n%\n",
                         dialect="fanuc")
    assert fanuc.dwell == 0.5 and not fanuc.remarks and fanuc.end[-1].tolist() == [10.0, 0.0, 50.0]
    siemens = read_program("%_N_PART_MPF\n;$PATH=/_N_WKS_DIR\nN10 G17 G90 G710 G94 G54\nN20 T=\"1\"\nN30 M6 D1\n"
                           "N40 S5000 M3\nMSG(\"wall 3, first side\")\nG641 ADIS=0.005\n"
                           "N50 G0 X=0 Y=0\nN60 Z50 M8\nN70 G1 Z-1 F300\n"
                           "N80 G3 X10 Y0 CR=5\nN90 G0 Z50\nSUPA G0 Z0 D0\nM30\n", dialect="siemens")
    assert not siemens.remarks and siemens.end[-1].tolist() == [10.0, 0.0, 50.0]
    assert siemens.blend == siemens.leaves == 0.005
    plain = read_program('BEGIN PGM T INCH\nBLK FORM 0.1 Z X+0 Y+0 Z-1\nTOOL CALL 1 Z S5000 F300 ; ball\n'
                         "CYCL DEF 247 DATUM SETTING ~\n  Q339=+1 ;DATUM NUMBER\n* - cut\n"
                         "CYCL DEF 32.0 TOLERANZ\nCYCL DEF 32.1\n"
                         "L X+0 Y+0 R0 FMAX M13\nL Z+1 FMAX\nL Z-0.1 F10\nL X+1\n"
                         "CR X+2 Y+0 R+9 DR- F40\nL X+1 F10\nL Z+2 FMAX M5\nEND PGM T INCH\n",
                         dialect="heidenhain")
    assert not plain.remarks and plain.end[-1].tolist() == pytest.approx([25.4, 0.0, 50.8])
    assert plain.feed[2] == pytest.approx(25.4) == plain.feed[-2] and plain.feed[5] == pytest.approx(101.6)
    assert "cycle 32 is off" in plain.notes[0]


def test_two_m_words_in_a_block_of_a_fanuc_are_remarked_on():
    """Parameter 3404#7 says what becomes of them. Spindle and coolant in one block are usual, and are assumed."""
    told = read_program("G21 G17 G90 G94 G54\nT1 M6\nS900 M3\nG0 G43 Z9. H1\nM5 M30\n", dialect="fanuc").remarks
    assert [r.line for r in told] == [5] and "M5 and M30 in one block" in told[0].message
    both = read_program("G21 G17 G90 G94 G54\nT1 M6\nS900 M3 M8\nG0 G43 Z9. H1\nM9 M5\nM30\n", dialect="fanuc")
    (taken,) = both.open
    assert not both.remarks and taken.what == "coolant" and taken.value == "M3 and M8 in one block both count"
    assert both.coolant.all() and (both.speed == 900).all()


def test_a_zero_is_stated_after_every_change_of_the_transformation():
    """Of a Siemens: without it a move is refused, past all frames it is not."""
    text = write(clamped(), "siemens")
    ends = re.findall(r"TRAFOOF\n(.*)\n", text)
    assert len(ends) > 1 and set(ends) == {"G54", "G54 D1"}
    head = "G710 G17 G90 G94 G54\nT1 M6\nD1\nS900 M3\nG0 Z9\n"
    for word in ("TRAORI", "TRAFOOF", "TRAORI(1)"):
        for move in ("X1", "G0 X1 Y1", "G1 Z8 F90", "X=3", "A0"):
            with pytest.raises(ProgramError, match="without a work offset"):
                read_program(f"{head}{word}\n{move}\nM30\n", dialect="siemens",
                             kinematics=Kinematics("table-table-AC"))
        read_program(f"{head}{word}\nSUPA G0 Z0 D0\nG505\nX1\nM30\n", dialect="siemens",
                     kinematics=Kinematics("table-table-AC"))


def test_a_tool_is_called_and_machine_zero_sought_with_m128_off():
    """A change of speed too: the spindle goes up between two such steps."""
    work = JOBS["speeds on five axes"]
    for shop in SHOPS.values():
        text = write(work, "heidenhain", shop)
        kept = re.findall(r"\bM128\b.*?\bM129\b", text.split("from the tip:")[1], flags=re.DOTALL)
        assert len(kept) == len(work.steps)
        assert not any("TOOL CALL" in k or "M91" in k or " S9" in k for k in kept)
    for line, said in (("TOOL CALL S900", "TOOL CALL while M128"), ("TOOL CALL 2 Z S900", "TOOL CALL while M128"),
                       ("L Z+0 R0 FMAX M91", "M91 while M128")):
        with pytest.raises(ProgramError, match=said):
            read_program(f"BEGIN PGM A MM\nTOOL CALL 1 Z S900\nM3\nM128\n{line}\nM30\n", dialect="heidenhain",
                         kinematics=Kinematics("table-table-AC"))


def test_programs_of_one_job_have_numbers_of_their_own():
    work = replace(tiny(), number=1203, number_words="access A3 part 4, which is said in many more words than fit")
    for dialect in ("fanuc", "haas"):
        lines = write(work, dialect).splitlines()
        assert lines[:2] == ["%", "O1203 (ACCESS A3 PART 4, WHICH IS SAID IN MANY)"]
        assert not read(work, "\n".join(lines) + "\n", dialect).remarks


def test_programs_of_one_job_have_names_of_their_own():
    """On a Heidenhain, which takes 24 characters of them."""
    named = replace(tiny(), name="4711 blisk of the second stage part 2 of 4")
    begun = [write(replace(named, number=n), "heidenhain").splitlines() for n in (1000, 1001, 1100)]
    assert [lines[0] for lines in begun] == ["0 BEGIN PGM 4711_blisk_of_the_second MM",
                                             "0 BEGIN PGM 1001_4711_blisk_of_the_s MM",
                                             "0 BEGIN PGM 1100_4711_blisk_of_the_s MM"]
    assert all(lines[-1].split("END PGM ")[1] == lines[0].split("BEGIN PGM ")[1] for lines in begun)


def test_fast_contouring_is_off_before_a_step_is_begun():
    text = write(JOBS["restart"], "fanuc", SHOPS["fast"])
    assert len(re.findall(r"^N\d+\nG05\.1 Q0\nG21\n", text, flags=re.MULTILINE)) == len(JOBS["restart"].steps)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_program_without_coolant_says_so_where_it_may_be_started(dialect):
    """A run that was broken off, or the operator, may have left it on."""
    text = write(JOBS["dry"], dialect)
    assert not re.search(r"\bM8\b", text) and re.search(r"\bM8\b", write(JOBS["restart"], dialect))
    assert len(re.findall(r"\bM9\b", text)) == len(re.findall(r"\bM9\b", write(JOBS["restart"], dialect))) + 5


def test_arcs_in_plain_language():
    """Half a circle round CC, back by the longer and by the shorter arc of a radius, and all the way round."""
    head = "BEGIN PGM A MM\nTOOL CALL 1 Z S900\nM3\nL X+0 Y+0 FMAX\nL Z+5 FMAX\nL Z-1 F90\n"
    p = read_program(head + "CC X+5 Y+0\nC X+10 Y+0 DR+ F200\nCR X+10 Y+6 R-5 DR+\nCR X+10 Y+0 R+5 DR-\n"
                     "CC X+10 Y+3\nC X+10 Y+0 DR-\nL Z+5 FMAX\nM30\n", dialect="heidenhain")
    def of(line):
        return p.end[p.line == line]

    assert of(8)[:, 1].min() == pytest.approx(-5.0, abs=2e-3) and (p.feed[p.line == 8] == 200.0).all()
    assert of(9)[:, 0].max() == pytest.approx(10.0 + 4.0 + 5.0, abs=2e-3)
    assert of(10)[:, 0].max() == pytest.approx(11.0, abs=0.05) or of(10)[:, 0].min() == pytest.approx(9.0, abs=0.05)
    assert of(12)[-1].tolist() == [10.0, 0.0, -1.0] and of(12)[:, 1].max() == pytest.approx(6.0, abs=2e-3)
    for wrong, said in (("C X+1 Y+1 DR+", "has stated"), ("CR X+1 DR+", "without a radius"),
                        ("CC X+0 Y+0\nC X+1 Y+1 R+2 DR+", "with a radius"), ("CT X+0 Y+0", "Z only")):
        with pytest.raises(ProgramError, match=said):
            read_program(head + f"{wrong}\nM30\n", dialect="heidenhain")


def test_whose_program_a_text_is():
    for dialect, control in DIALECTS.items():
        text = write(tiny(), dialect)
        assert dialect_of(text, control.ending, [dialect]) == dialect
    assert dialect_of(write(tiny(), "heidenhain")) == "heidenhain"
    assert dialect_of(write(tiny(), "siemens")) == "siemens"
    assert dialect_of("G21\nM30\n", "NC", ["linuxcnc", "haas"]) == "haas"
    assert dialect_of("G21\nM30\n", "", ["siemens", "fanuc"]) == "fanuc"
    assert dialect_of("G21\nM30\n", "tap") == "linuxcnc"
    for ending in ("", "nc", "txt"):  # the machine runs nothing else
        assert dialect_of("G17 G90 G54\nT1 D1\nM30\n", ending, ["siemens"]) == "siemens"
        assert dialect_of("L X+5 F100\n", ending, ["heidenhain"]) == "heidenhain"
    assert dialect_of("G21\nM30\n", "nc", ["linuxcnc", "siemens"]) == "linuxcnc"
    assert dialect_of("G21\nM30\n", "ngc", ["siemens"]) == "linuxcnc"
    with pytest.raises(VerificationError) as unknown:
        read_program("M30\n", dialect="fagor")
    assert unknown.value.code == "unknown_dialect"


@pytest.mark.parametrize("dialect", ["linuxcnc", "fanuc", "haas", "siemens"])
def test_inverse_time_is_a_feed_like_any_other(dialect):
    """F1500 of a block of 0.4 mm at 600 mm/min is a whole number, which a Haas takes for thousandths."""
    control = DIALECTS[dialect](SHOPS["plain"])
    lines = control.timed(["X1.5 C2.5", "X1.6 C2.7"], [1500.0, 1234.5])
    point = "." if dialect in ("fanuc", "haas") else ""
    assert lines == ["G93", f"G1 X1.5 C2.5 F1500{point}", "G1 X1.6 C2.7 F1234.5", "G94"]


@pytest.mark.parametrize("tcp", [True, False])
@pytest.mark.parametrize("kind", ["table-table-AC", "table-table-BC"])
def test_tables_that_count_the_other_way(kind, tcp):
    """ISO 841: the words change their sign, and tips, tool axes, feeds and times are the same."""
    work = clamped(kind, tcp)
    machine = work.clamping.machine
    other = replace(work, clamping=replace(work.clamping, machine=replace(machine, sense=(-1, -1))))
    text = write_linuxcnc(other)
    def turned(m):
        return m[1] + ("" if m[2] or float(m[3]) == 0 else "-") + m[3]

    code, usual = (t.split("M3 M8", 1)[1] for t in (text, write_linuxcnc(work)))
    assert code == re.sub(rf"\b([{kind[-2]}C])(-?)(\d+\.\d*)", turned, usual)
    iso = read_program(text, kinematics=Kinematics(kind, machine.pivots, (-1, -1)), gauge_length=work.clamping.gauges)
    usual = read(work, write_linuxcnc(work), "linuxcnc")
    assert np.abs(iso.end - usual.end).max() < 1e-9 and np.array_equal(iso.line, usual.line)
    assert np.abs(iso.poses.end_axis - usual.poses.end_axis).max() < 1e-12
    assert np.array_equal(iso.poses.end_turn, -usual.poses.end_turn)
    assert np.allclose(iso.minutes, usual.minutes, equal_nan=True)


def test_the_sense_of_iso_841():
    """A table that says A30 C90 holds the part so that the tool stands as if it were turned by A, and then by C."""
    a, c = np.radians([30.0, 90.0])
    got = Kinematics("table-table-AC", None, (-1, -1)).axis(np.array([[a, c]]))[0]
    tilted = np.array([0.0, -np.sin(a), np.cos(a)])
    assert np.allclose(got, [-np.sin(c) * tilted[1], np.cos(c) * tilted[1], tilted[2]], atol=1e-12)
    same = RotaryMachine("table-table-AC", None, None, True, (-1, -1))
    assert np.allclose(same.axes(same.words(np.array([[a, c]])))[0], got, atol=1e-12)
    assert program_limits(np.array([[-30.0, 110.0], [-360.0, 360.0]]), (-1, 1)).tolist() == [[-110, 30], [-360, 360]]


def test_rotary_axes_of_a_heidenhain_go_the_shorter_way():
    """Its words go on over 360 deg, its axes need not: M126 in every program that turns, and again at every label."""
    assert "M126" not in write(plan(), "heidenhain")
    for work in (clamped(), replace(clamped(), restart=True)):
        text = write(work, "heidenhain")
        assert text.count("M126") == text.count("CYCL DEF 32.2") >= 1
        assert text.index("M126") < text.index("A+0")
        assert difference(read(work, write_linuxcnc(work), "linuxcnc"), read(work, text, "heidenhain")) == ""


@pytest.mark.parametrize("on", ["M126\nL C+350 R0 FMAX", "L C+350 R0 FMAX M126"])
def test_with_m126_a_way_of_more_than_half_a_turn_is_not_known(on):
    def told(lines):
        return read_program(f"BEGIN PGM A MM\nTOOL CALL 1 Z S900\nM3\n{on}\nM128\nL X+0 Y+0 Z+50 R0 FMAX\n{lines}\n"
                            "M129\nM30\nEND PGM A MM\n", dialect="heidenhain",
                            kinematics=Kinematics("table-table-AC"))

    p = told("L C+400 F500\nL C+225\nL C+45 X+5")
    assert np.degrees(p.poses.end_turn[-1]) == pytest.approx([0.0, 45.0])
    with pytest.raises(ProgramError, match="with M126 C turns by -340 deg or by 20,"):
        told("L X+1 C+10 F500")
    assert np.degrees(told("M127\nL X+1 C+10 F500").poses.end_turn[-1]) == pytest.approx([0.0, 10.0])


@pytest.mark.parametrize("kind", ["table-table-AC", "head-head-BC"])
def test_planes_hold_the_steps_of_a_fixed_axis(kind):
    work = clamped(kind)
    text = write(work, "heidenhain", SHOPS["planes"])
    assert text.count("PLANE SPATIAL") == text.count("PLANE RESET STAY") - 1 == 3  # S05 turns, S01 is upright
    inside = text.split("PLANE SPATIAL")[1].split("PLANE RESET")[0]
    assert not re.search(r" [AC][+-]", inside) and len(inside.splitlines()) > 10
    planar, same = read(work, text, "heidenhain"), read(work, write(work, "heidenhain"), "heidenhain")
    assert difference(same, planar) == "" and difference(read(work, write_linuxcnc(work), "linuxcnc"), planar) == ""
    far = np.linalg.norm(planar.end - same.end, axis=1)
    assert 0.0 < far.max() < 2.5e-4
    for wrong in (("SPA+", "SPA-"), ("SPB+", "SPB-"), ("SPA-", "SPA+"), ("SPC+0", "SPC+0.01")):
        if wrong[0] in text:
            assert difference(same, read(work, text.replace(*wrong, 1), "heidenhain")) != ""
    with pytest.raises(ProgramError, match="M91 in a tilted plane"):
        read(work, text.replace("PLANE RESET STAY", "M8"), "heidenhain")
    with pytest.raises(ProgramError, match="place that the program has not stated"):
        read_program("BEGIN PGM A MM\nM128\nPLANE SPATIAL SPA+9 SPB+9 SPC+0 STAY\nL X+1 F9\nM30\n",
                     dialect="heidenhain", kinematics=Kinematics("table-table-AC"))


@pytest.mark.parametrize("kind", ["table-table-AC", "table-table-BC", "head-head-BC"])
def test_planes_of_cycle800_hold_the_steps_of_a_fixed_axis(kind):
    work = clamped(kind)
    text = write(work, "siemens", SHOPS["planes"])
    assert text.count("CYCLE800(0,\"TC1\",0,57,") == 3 and text.count("CYCLE800()") == 4  # S05 turns, S01 is upright
    inside = text.split("CYCLE800(0,")[1].split("CYCLE800()")[0]
    assert not re.search(r" [ABC][+-]?[0-9]", inside) and len(inside.splitlines()) > 10
    planar, same = read(work, text, "siemens"), read(work, write(work, "siemens"), "siemens")
    assert difference(same, planar) == "" and difference(read(work, write_linuxcnc(work), "linuxcnc"), planar) == ""
    far = np.linalg.norm(planar.end - same.end, axis=1)
    assert 0.0 < far.max() < 2.5e-4
    for wrong in (("57,0,0,0,18.", "57,0,0,0,-18."), (",27.", ",28."), ("-74.3839,0", "-74.3839,0.01"),
                  (",18.4349,27.", ",27.7913,18.")):
        assert wrong[0] in text and difference(same, read(work, text.replace(*wrong, 1), "siemens")) != ""
    assert "CYCLE800 with direction 0" in text and "CYCLE800" not in write(work, "siemens")


def test_a_plane_of_cycle800_is_square_to_the_tool():
    """X, then the new Y: Z of the plane is the tool axis, as an independent formula has it."""
    control = DIALECTS["siemens"](SHOPS["planes"])
    for axis in ((0.5, -0.3, 0.9), (-0.8, 0.2, 0.1), (0.0, 0.7, -0.2), (0.0, -1.0, 0.0)):
        axis = np.array(axis) / np.linalg.norm(axis)
        a, b = control.plane_angles(axis)
        frame = control.plane_axes(a, b)
        assert np.allclose(frame[:, 2], axis) and np.allclose(frame.T @ frame, np.eye(3))
        assert np.allclose(frame[:, 0] @ [0.0, np.cos(a), np.sin(a)], 0.0)  # X lies across the Y that X has turned


PLANE = 'CYCLE800(0,"T",0,57,0,0,0,10,20,0,0,0,0,0,0)'


@pytest.mark.parametrize(("lines", "said"), [
    ([PLANE], "TRAORI on"),
    (["TRAORI", "G54", 'CYCLE800(0,"T",0,57,0,0,0,10,20,0,0,0,0,-1,0)'], "direction 0"),
    (["TRAORI", "G54", 'CYCLE800(1,"T",0,57,0,0,0,10,20,0,0,0,0,0,0)'], "without retract"),
    (["TRAORI", "G54", 'CYCLE800(0,"T",1,57,0,0,0,10,20,0,0,0,0,0,0)'], "new plane"),
    (["TRAORI", "G54", 'CYCLE800(0,"T",0,39,0,0,0,10,20,0,0,0,0,0,0)'], "axis by axis"),
    (["TRAORI", "G54", 'CYCLE800(0,"T",0,57,0,0,0,R1,20,0,0,0,0,0,0)'], "R1 has no value"),
    (["TRAORI", "G54", PLANE, "G1 X1 F9"], "has not stated"),
    (["TRAORI", "G54", "G0 X1 Y1 Z50", PLANE, "TRAFOOF"], "M429 in a plane"),
    (["TRAORI", "G54", "G91", PLANE], "in incremental"),
])
def test_other_planes_of_cycle800_are_refused(lines, said):
    head = ["G710 G17 G90 G94 G54", "T1 M6", "D1", "S900 M3"]
    with pytest.raises(ProgramError, match=re.escape(said)):
        read_program("\n".join([*head, *lines, "CYCLE800()", "M30", ""]), dialect="siemens",
                     kinematics=Kinematics("table-table-AC"))


@pytest.mark.parametrize("shop", SHOPS)
def test_how_far_an_axis_may_leave_its_way_is_small_or_told(shop):
    """0.0011 deg: 0.001 mm at 50 mm above the tip."""
    work = clamped()
    for dialect, told in (("siemens", "CYCLE832(0.001,11,0.0011)"), ("heidenhain", "HSC-MODE:0 TA0.0011")):
        text = write(work, dialect, SHOPS[shop])
        assert (told in text) == (dialect == "heidenhain" or shop == "fast")
        assert read(work, text, dialect).notes == ()
        for loose in (text.replace("11,0.0011", "1,1"), text.replace("0.0011", "0.5")):
            assert loose == text or "error bound does not include" in read(work, loose, dialect).notes[0]


def test_a_move_of_next_to_nothing_stays_a_move_in_a_plane():
    work = clamped(swings=False)
    tips = np.array([5.0, 3.0, 4.0]) + 1.1e-4 * np.arange(40)[:, None] * [0.6, 0.7, -0.4]
    cut = replace(work.steps[1].trajectories[2], points=tips)
    step = replace(work.steps[1], trajectories=(cut,))
    work = replace(work, steps=(step,))
    planar = read(work, write(work, "heidenhain", SHOPS["planes"]), "heidenhain")
    assert difference(read(work, write_linuxcnc(work), "linuxcnc"), planar) == ""


def test_programs_of_joints():
    work = clamped(tcp=False)
    first = read(work, write_linuxcnc(work), "linuxcnc")
    for dialect in ("fanuc", "haas", "siemens"):
        text = write(work, dialect)
        assert "G93" in text and difference(first, read(work, text, dialect)) == ""
    with pytest.raises(OutputError) as refused:
        write(work, "heidenhain")
    assert refused.value.code == "no_inverse_time" and "M128" in refused.value.remedy
    still = clamped(tcp=False, swings=False)
    assert difference(read(still, write_linuxcnc(still), "linuxcnc"),
                      read(still, write(still, "heidenhain"), "heidenhain")) == ""


def test_a_whole_number_of_inverse_time_has_its_point():
    """F60 is 0.06 on some machines; Haas programs that say it are refused."""
    for dialect, word in (("linuxcnc", "F60"), ("fanuc", "F60."), ("haas", "F60."), ("siemens", "F60")):
        assert DIALECTS[dialect](SHOPS["plain"]).timed(["X1. A2."], [60.0]) == ["G93", f"G1 X1. A2. {word}", "G94"]


LABELS = {"siemens": r"^STEP_S\d+:$", "heidenhain": r'^\d+ LBL "S\d+"$'}
HOME = {"linuxcnc": "G53 G0 Z0.", "fanuc": "G91 G28 Z0.", "haas": "G91 G28 Z0.", "siemens": "SUPA G0 Z0 D0",
        "heidenhain": "L Z+0 R0 FMAX M91"}


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("job", ["restart", "restart on five axes"])
def test_behind_every_label_the_spindle_goes_to_machine_zero(job, dialect):
    """Wherever it stands: before a tool is changed or turns, and the header says what that takes for granted."""
    text = write(JOBS[job], dialect)
    head, *parts = re.split(LABELS.get(dialect, r"^N\d+00$"), text, flags=re.MULTILINE)
    assert len(parts) == len(JOBS[job].steps)
    for part in parts:
        before, *behind = re.split(r"^(?:\d+ )?(?: *T\d+ M6|TOOL CALL.*)$", part, flags=re.MULTILINE)
        assert HOME[dialect] in before and behind
    assert "machine zero of z" in " ".join(head.lower().split()) or "up to machine zero" in head


def test_a_shift_of_zero_is_no_longer_there_at_a_label():
    """LinuxCNC keeps one of G92 or G52 through M30 and being switched off."""
    work = JOBS["restart"]
    text = write(work, "linuxcnc")
    whole = read(work, text, "linuxcnc")
    for k in [m.start() for m in re.finditer(r"^N\d+$", text, flags=re.MULTILINE)]:
        part = read(work, "%\nG21\nG52 X5. Y5. Z-5.\n" + text[k:], "linuxcnc")
        assert not part.remarks and np.array_equal(part.end, whole.end[-len(part):])


def test_comments_have_signs_that_controls_know():
    work = replace(tiny(), labels={"order": "a{b}c\\d|e~f^g`h;i%j(k)l\"m'n: \u00fc \u6f22"})
    for dialect in ("fanuc", "haas"):
        assert """(LABEL ORDER: A[B]C/D/E-F'G'H,IPCTJ[K]L"M'N: UE ?)""" in write(work, dialect).splitlines()


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("job", ["restart", "restart on five axes", "arcs and restart", "speeds and restart"])
def test_a_program_can_be_started_at_every_step(job, dialect):
    """From each label on, after whatever the header states, the moves are those of the whole program from there."""
    work = JOBS[job]
    text = write(work, dialect)
    whole = read(work, text, dialect)
    lines = text.splitlines(keepends=True)
    labels = [k for k, line in enumerate(lines) if re.match(LABELS.get(dialect, r"^N\d+00$"), line.strip())]
    assert len(labels) == len(work.steps)
    head = lines[:1] if dialect != "siemens" else []
    for k in labels:
        part = read(work, "".join([*head, *lines[k:]]), dialect)
        assert not part.remarks
        n = len(part)  # the way home and the way down from there are no moves where X and Y are not known
        assert int((whole.line > k).sum()) - 2 <= n <= int((whole.line > k).sum())
        assert np.array_equal(part.end, whole.end[-n:]) and np.array_equal(part.start[1:], whole.start[-n + 1:])
        assert np.array_equal(part.speed, whole.speed[-n:]) and np.array_equal(part.tool, whole.tool[-n:])


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("job", ["restart", "restart on five axes", "dry", "speeds and restart on five axes",
                                 "speeds on five axes"])
def test_a_tool_in_the_spindle_is_not_called_and_the_spindle_does_not_stop(job, dialect):
    """From the top: a tool change for each change of tool, as many starts and stops of the spindle, one end."""
    work = JOBS[job]
    p = read(work, write(work, dialect), dialect)
    tools = [s.tool.number for s in work.steps]
    turns = [a for a, b in zip(tools, [0, *tools], strict=False) if a != b]
    assert len(turns) < len(tools)
    changes = [e for e in p.pauses if e.event == "tool change" and e.tool]
    assert [e.tool for e in changes] == turns and not any(e.speed for e in changes)
    assert [e.event for e in p.pauses if e not in changes] == ["end of the program"]
    lines = write(work, dialect).splitlines()
    assert sum(re.fullmatch(r"(?:\d+ )?M5", line) is not None for line in lines) == len(turns)
    if dialect == "linuxcnc":  # unlike jumps, its words are indented
        assert sum(re.fullmatch(r"T[0-9]+ M6", line) is not None for line in lines) == len(turns)


@pytest.mark.parametrize("job", ["restart", "restart on five axes"])
def test_linuxcnc_calls_the_tool_only_where_another_is_in_the_spindle(job):
    """Started at a label with its tool in the spindle, or with another one, or none; the spindle stands."""
    work = JOBS[job]
    text = write(work, "linuxcnc")
    whole = read(work, text, "linuxcnc")
    labels = [(int(m[1]) // 100 - 1, m.start()) for m in re.finditer(r"^N(\d+)$", text, flags=re.MULTILINE)]
    kept = [(k, at) for k, at in labels if k and work.steps[k].tool == work.steps[k - 1].tool]
    assert kept
    for k, at in kept:
        number = work.steps[k].tool.number
        for before, calls in ((number, 0), (next(t.number for t in work.tools if t.number != number), 1), (0, 1)):
            first = f"G53 G0 Z0.\nT{before} M6\n" if before else ""
            part = read(work, f"%\nG21\nG53 G0 Z0.\n{first}M5\n" + text[at:], "linuxcnc")
            rest = [e.tool for e in whole.pauses if e.line > text.count("\n", 0, at) and e.event == "tool change"]
            made = [e.tool for e in part.pauses if e.event == "tool change"]
            assert made[bool(before):] == [*[number] * calls, *rest]
            n = len(part)
            assert np.array_equal(part.speed, whole.speed[-n:]) and np.array_equal(part.tool, whole.tool[-n:])
            assert np.array_equal(part.end[1:], whole.end[-n + 1:])
            assert np.array_equal(part.coolant[1:], whole.coolant[-n + 1:])


def test_labels_are_the_numbers_of_the_steps():
    steps = [replace(s, id=name) for s, name in zip(plan().steps, ("S01", "S02", "S02b", "S12", "S120"), strict=True)]
    text = write(replace(plan(), steps=tuple(steps), restart=True), "fanuc")
    assert re.findall(r"^N(\d+)$", text, flags=re.MULTILINE) == [
        "100", "200", "201", "1200", "1299", "12000"]  # N1299 is behind the words for a start at N1200
    part = write(replace(plan(), steps=tuple(steps[2:]), restart=True), "fanuc")
    assert re.findall(r"^N(\d+)$", part, flags=re.MULTILINE) == ["201", "1200", "1299", "12000"]  # as on the sheet
    names = ("S03y", "S03z", "S03bb", "S03bc", "S04")
    late = [replace(s, id=name) for s, name in zip(plan().steps, names, strict=True)]
    text = write(replace(plan(), steps=tuple(late), restart=True), "fanuc")
    assert re.findall(r"^N(\d+)$", text, flags=re.MULTILINE) == [
        "324", "325", "326", "327", "372", "400"]


@pytest.mark.parametrize("dialect", OTHERS)
def test_a_hundred_thousand_points_in_seconds(dialect):
    work = long_plan(50_000)
    p = read(work, write(work, dialect), dialect)
    assert len(p) > 49_000
