"""STEP-NC read by the proof's own readers: plans come back, odd texts are understood, two readings that differ are told
apart, and a file is simulated like the program of the same job."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import InternalError, ProgramError
from output.stepnc.ap238 import stream_stepnc_aim, write_stepnc_aim
from output.stepnc.iso14649 import stream_stepnc_arm, write_stepnc_arm
from output.stepnc.part21 import quoted
from output.workplan import Ap238, StockBox
from tests.pocket_case import OTHER, SETUP, TOOL, ZONES, block, program, scored, text
from tests.synthetic_plan import BALL, clamped, full, line, long_plan, plan, shaped, step, tiny, write_linuxcnc
from toolpath.workingsteps import Trajectory, TrajectoryKind
from verify.checks.machine_limits import way_findings
from verify.comparison.stepnc_agreement import check_agreement
from verify.gcode.reader import read_program
from verify.kinematics import KINDS, Kinematics
from verify.model import FindingKind, NcProgram, ProofSetup
from verify.prove import prove
from verify.stepnc.part21 import EnumItem, Part21File, Ref, Typed, decoded, is_exchange_file
from verify.stepnc.reader import is_stepnc, read_moves, read_stepnc

FORMS = {"aim": write_stepnc_aim, "arm": write_stepnc_arm}
both = pytest.mark.parametrize("write", FORMS.values(), ids=FORMS)
JOBS = {"tiny": tiny, "three axes": plan, "all there is": full, "long": lambda: long_plan(20_000, 40),
        "with shapes": shaped, "restart points": lambda: plan(restart=True),
        "turning, all": lambda: shaped(job=clamped()), "turning, restart": lambda: replace(
            clamped(), restart=True)}
TURNING = {f"{kind} {'tip' if tcp else 'joints'}": (kind, tcp) for kind in KINDS for tcp in (True, False)}


def machine_of(job):
    return None if job.clamping is None else Kinematics(job.clamping.machine.kind, job.clamping.machine.pivots)


def nc_of(job):
    gauges = {} if job.clamping is None else job.clamping.gauges
    return read_program(write_linuxcnc(job), name="ngc", kinematics=machine_of(job), gauge_length=gauges)


@both
@pytest.mark.parametrize("job", JOBS.values(), ids=JOBS)
def test_both_forms_do_what_the_program_does(write, job):
    wanted = job()
    read = read_stepnc(write(wanted), tools=wanted.tools, kinematics=machine_of(wanted))
    assert not read.remarks
    agreement = check_agreement(nc_of(wanted), read)
    assert agreement.moves > 5 and agreement.tip < 1e-6 and agreement.axis < 1e-8


@both
@pytest.mark.parametrize("machine", TURNING.values(), ids=TURNING)
def test_both_forms_do_what_the_program_of_every_machine_does(write, machine):
    wanted = clamped(*machine)
    agreement = check_agreement(nc_of(wanted), read_stepnc(write(wanted), tools=wanted.tools,
                                                           kinematics=machine_of(wanted)))
    assert agreement.tip < 3e-4 and agreement.axis < 1e-8  # joints are rounded, and with them the tips


@both
def test_planned_points_feeds_and_tools_come_back(write):
    wanted = plan()
    m = read_moves(write(wanted))
    for s in wanted.steps:
        mine = np.array([c.number for c in m.cutters])[m.cutter] == s.tool.number
        ends = m.end[mine]
        for t in s.trajectories:
            far = np.abs(ends[:, None] - t.points[None]).max(axis=2).min(axis=0)
            assert far[1:].max() < 0.51e-4
            if t.motion is not TrajectoryKind.RAPID:
                assert np.isclose(m.feed[mine], t.feed, rtol=1e-9).any()
    assert [c.kind for c in m.cutters] == ["bull", "flat", "ball"] and set(m.speed[~m.rapid].tolist()) == {12000.0}
    assert [c.assembly_length for c in m.cutters] == [80.0, 70.0, 75.0] and m.coolant[~m.rapid].all()
    assert (m.end_axis == [0.0, 0.0, 1.0]).all() and m.arrival.sum() == 4


@both
def test_that_there_is_no_coolant_comes_back(write):
    dry = replace(plan(), coolant=False)
    assert not read_moves(write(dry)).coolant.any()
    check_agreement(nc_of(dry), read_stepnc(write(dry), tools=dry.tools))
    with pytest.raises(InternalError, match="coolant"):
        check_agreement(nc_of(plan()), read_stepnc(write(dry), tools=dry.tools))


@both
def test_a_fresh_cutter_stops_the_program_at_the_clearance_plane(write):
    job = full()
    read = read_stepnc(write(job), tools=job.tools)
    stop = next(s for s in read.stops if s.event == "program stop")
    assert stop.tip[2] == job.clearance_plane and stop.tool == 1
    assert "Fresh cutter in T1" in write(job)


@pytest.mark.parametrize(("was", "is_now", "name"), [
    ("TRAJECTORY(.T.,.TRAJ", "TRAJECTORY(.F.,.TRAJ", "its_priority"),
    ("$,.F.,.F.,.F.,$)", "$,.T.,.F.,.F.,$)", "synchronize_"),
    ("$,.F.,.F.,.F.,$)", "$,.F.,.F.,.F.,#12)", "its_adaptive_control"),
    ("(),.F.,$,$,()", "('X'),.F.,$,$,()", "axis_clamping"), ("(),.F.,$,$,()", "(),.F.,$,$,(#4)", "other_functions"),
    ("(),.F.,$,$,()", "(),.F.,#4,$,()", "oriented_spindle_stop")])
def test_what_lets_a_control_do_otherwise_is_refused(was, is_now, name):
    """A suggested path, a feed that the control changes, held axes and a spindle that stands."""
    text = write_stepnc_arm(tiny())
    assert was in text
    with pytest.raises(ProgramError, match=name):
        read_stepnc(text.replace(was, is_now), tools=tiny().tools)


def test_a_path_that_is_only_suggested_is_refused_in_ap238_too():
    with pytest.raises(ProgramError, match="'suggested'"):
        read_stepnc(write_stepnc_aim(tiny()).replace("'required'", "'suggested'"), tools=tiny().tools)


@pytest.mark.parametrize(("size", "allowed"), [(0.0005, True), (0.5, False)])
def test_a_deviation_that_the_file_allows_is_counted_or_found(size, allowed):
    text = write_stepnc_aim(tiny())
    path = re.search(r"#(\d+)=MACHINING_TOOLPATH\('S01 cut", text) or re.search(r"#(\d+)=MACHINING_TOOLPATH\(", text)
    context = re.search(r"#(\d+)=\(GEOMETRIC_REPRESENTATION_CONTEXT|#(\d+)=\(GLOBAL_UNIT", text)
    assert path is not None and context is not None
    more = (f"#900001=MEASURE_REPRESENTATION_ITEM('',LENGTH_MEASURE({size}),#6);\n"
            f"#900002=REPRESENTATION('',(#900001),#{context[1] or context[2]});\n"
            f"#900003=ACTION_PROPERTY('path maximum deviation','',#{path[1]});\n"
            "#900004=ACTION_PROPERTY_REPRESENTATION('','',#900003,#900002);\n")
    read = read_stepnc(text.replace("ENDSEC;\nEND-ISO", more + "ENDSEC;\nEND-ISO"), tools=tiny().tools)
    assert (read.blend == size and not read.remarks) if allowed else "leave the way" in read.remarks[0].message


@both
def test_lengths_of_the_file_are_held_against_those_that_the_setup_states(write):
    text, tools = write(tiny()), tiny().tools
    assert not read_stepnc(text, tools=tools, lengths={1: 75.4}).remarks
    assert not read_stepnc(text.replace("(75.", "(50."), tools=tools).remarks  # not stated
    assert "75 mm in the file" in read_stepnc(text, tools=tools, lengths={1: 50.0}).remarks[0].message


def test_the_offset_of_a_cutting_edge_is_a_length_too():
    text = write_stepnc_arm(tiny()).replace("CUTTING_COMPONENT(75.", "CUTTING_COMPONENT(50.")
    (remark,) = read_stepnc(text, tools=tiny().tools, lengths={1: 75.0}).remarks
    assert "tool offset 50 mm in the file and gauge length 75 mm" in remark.message


@pytest.mark.parametrize("stream", [stream_stepnc_aim, stream_stepnc_arm])
def test_pieces_are_small_and_make_the_file(stream):
    pieces: list[str] = []
    stream(long_plan(60_000), pieces.append)
    whole = "".join(pieces)
    assert whole.startswith("ISO-10303-21;") and whole.endswith("END-ISO-10303-21;\n")
    assert max(map(len, pieces)) < 0.2 * len(whole)


@both
def test_what_differs_is_found(write):
    """Each plan is the first but for one thing; its STEP-NC must not pass for that of the first program."""
    good = plan(step(1, BALL, "waterline"))
    cut = good.steps[0].trajectories[2]
    moved = cut.points.copy()
    moved[3, 2] += 0.0012
    thinner = Trajectory(cut.motion, np.delete(cut.points, 3, axis=0), cut.feed)

    def with_cut(t):
        ways = [*good.steps[0].trajectories]
        ways[2] = t
        return plan(replace(good.steps[0], trajectories=tuple(ways)))

    others = {
        "place": with_cut(Trajectory(cut.motion, moved, cut.feed)),
        "feed": with_cut(replace(cut, feed=cut.feed + 0.1)),
        "point": with_cut(thinner),
        "speed": plan(replace(good.steps[0], spindle_rpm=11999.0)),
        "tool": plan(replace(good.steps[0], tool=replace(BALL, number=2))),
        "end": plan(replace(good.steps[0], trajectories=good.steps[0].trajectories[:3])),
        "more": plan(good.steps[0], replace(step(2, BALL, "planar_floor"), trajectories=(
            line(TrajectoryKind.CUT, (0, 0, 5), (1, 0, 5), feed=600.0),))),
        "plane": replace(good, clearance_plane=26.0),
    }
    proved = nc_of(good)
    check_agreement(proved, read_stepnc(write(good)))
    for what, job in others.items():
        with pytest.raises(InternalError) as found:
            check_agreement(proved, read_stepnc(write(job)))
        assert found.value.code == "stepnc_differs", what


def test_a_line_with_other_points_is_the_same_line():
    """Points left out of a straight pass are no difference; out of a bent one they are."""
    ways = [line(TrajectoryKind.CUT, (0, 0, 5), (4, 0, 5), (10, 0, 5), feed=600.0)]
    bent = [line(TrajectoryKind.CUT, (0, 0, 5), (4, 0.002, 5), (10, 0, 5), feed=600.0)]
    short = [line(TrajectoryKind.CUT, (0, 0, 5), (10, 0, 5), feed=600.0)]
    jobs = [plan(step(1, BALL, "planar_floor", trajectories=tuple(w))) for w in (ways, bent, short)]
    read = [read_stepnc(write_stepnc_aim(j)) for j in jobs]
    check_agreement(nc_of(jobs[2]), read[0])
    check_agreement(nc_of(jobs[0]), read[2])
    with pytest.raises(InternalError):
        check_agreement(nc_of(jobs[2]), read[1])


def test_values_of_all_kinds_and_complex_instances():
    head = ("ISO-10303-21;\nHEADER;FILE_DESCRIPTION((''),'2;1');FILE_NAME('','',(''),(''),'','','');"
            "FILE_SCHEMA(('X'));ENDSEC;\nDATA;\n")
    body = ("/* comment; with 'quotes' and #7=A(); */ #1 = A ( 1.5 , -2.E-3,\n +3 , 'it''s; /* no comment */' , "
            ".T. , $ , * ,\n"
            "#12,(#1,()),LENGTH_MEASURE(4.),\"0AF\") /* ; */ ;#2=(B(1.)\nC('x') /* y */ D());\n"
            "#3=CARTESIAN_POINT('',(1.,2.,3.)); #4=CARTESIAN_POINT('\\X2\\00E9\\X0\\',(1.,2.,3.));\n"
            "#5=CARTESIAN_POINT('',(1.,\n2.,/* two */3.));\n")
    file = Part21File(head + body + "ENDSEC;\nEND-ISO-10303-21;\n", "odd")
    ((name, values),) = file.records(1)
    assert name == "A" and values[:6] == [1.5, -0.002, 3, "it's; /* no comment */", EnumItem("T"), None]
    assert repr(values[6]) == "*" and values[7:] == [Ref(12), [Ref(1), []], Typed("LENGTH_MEASURE", 4.0),
                                                     Typed("BINARY", "0AF")]
    assert file.records(2) == [("B", [1.0]), ("C", ["x"]), ("D", [])] and file.names(2) == ("B", "C", "D")
    assert file.of("C") == [2] and file.line(2) == 6 and file.has(4) and not file.has(9)
    assert file.points(np.array([3]))[0].tolist() == [1.0, 2.0, 3.0]
    assert file.records(5)[0][1] == ["", [1.0, 2.0, 3.0]] and file.records(4)[0][1][0] == "é"


def test_statements_read_at_once_say_what_they_say_word_by_word():
    """Lists, blanks and strings that need thought are read word by word, all else in one go; both are the same."""
    words = ["'a b'", "''", "'it''s'", "'a,b'", "'(1)'", "'\\X\\E9'", "'a\nb'", "#12", "$", "*", "1.", "-2.5E-3", "7",
             ".T.", "(#1,#2)", "()", "L(2.)", " #3", "'/* x */'", "\"0AF\""]
    rng = np.random.default_rng(5)
    rows = [[words[k] for k in rng.integers(0, len(words), n)] for n in rng.integers(1, 7, 400)]
    bodies = [f"N{k}({','.join(row)})" for k, row in enumerate(rows)]
    head = ("ISO-10303-21;HEADER;FILE_DESCRIPTION((''),'2;1');FILE_NAME('','',(''),(''),'','','');"
            "FILE_SCHEMA(('X'));ENDSEC;DATA;")

    def file(bodies):
        text = "".join(f"#{k + 1}={body};" for k, body in enumerate(bodies))
        return Part21File(head + text + "ENDSEC;END-ISO-10303-21;", "file")

    at_once, by_word = file(bodies), file([body + " " for body in bodies])  # a blank before the semicolon
    for k in range(1, len(bodies) + 1):
        assert at_once.records(k) == by_word.records(k), bodies[k - 1]
        assert [type(v) for v in at_once.records(k)[0][1]] == [type(v) for v in by_word.records(k)[0][1]]


@pytest.mark.parametrize("text", ["it's \\ ok", "é漢x", "😀 100 %", "a\tb", "''", "\\X2\\", "é\\X0\\X2\\", "é\\é😀漢"])
def test_strings_come_back(text):
    assert decoded(quoted(text)[1:-1]) == text


@pytest.mark.parametrize(("given", "meant"), [("\\X\\E9", "é"), ("\\S\\i", "é"), ("\\PA\\a", "a"), ("a\nb", "ab")])
def test_other_directives_of_strings(given, meant):
    assert decoded(given) == meant


@both
def test_a_text_set_otherwise_is_the_same_job(write):
    """Comments, blanks, statements over lines or all in one, instances in another order: nothing of it counts."""
    wanted = plan(step(1, BALL, "waterline"), step(2, BALL, "zigzag", x=11.0))
    plain = write(wanted)
    head, data = plain.split("DATA;\n")
    rows = data.removesuffix("ENDSEC;\nEND-ISO-10303-21;\n").replace(",\n", ",").splitlines()
    end = "ENDSEC;\nEND-ISO-10303-21;\n"
    texts = [
        "\ufeff/* made elsewhere */\n" + head + "DATA;\n" + "\n".join(reversed(rows)) + "\n" + end,
        head + "DATA;\n" + "\n/* ' ; */\n".join(r.replace(",", ",\r\n  ").replace("=", " =\n ", 1) for r in rows) + end,
        head.replace("\n", "") + "DATA;" + "".join(rows) + end.replace("\n", ""),
    ]
    good = read_moves(plain)
    for other in texts:
        got = read_moves(other)
        for what in ("start", "end", "end_axis", "rapid", "feed", "speed", "cutter"):
            assert np.array_equal(getattr(got, what), getattr(good, what), equal_nan=True)


def test_what_is_step_nc_is_known_by_its_header():
    assert is_stepnc(write_stepnc_aim(tiny())) and is_exchange_file("  /* x */\nISO-10303-21;\nHEADER;")
    assert not is_stepnc("%\nG21 (ISO-10303-21;)\nM30\n%\n") and not is_stepnc("")


def test_units_of_the_file_are_heeded():
    """The same job in metres and seconds: mm and minutes come out."""
    wanted = plan(step(1, BALL, "waterline"))
    text_ = write_stepnc_aim(wanted)
    seconds = text_.replace("TIME_MEASURE(60.)", "TIME_MEASURE(1.)")
    assert np.nanmax(read_moves(seconds).feed) == pytest.approx(60.0 * np.nanmax(read_moves(text_).feed))
    micro = text_.replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT(.MICRO.,.METRE.)")
    assert np.allclose(1000.0 * read_moves(micro).end, read_moves(text_).end)


def test_where_workpiece_and_feature_stand_is_heeded():
    """Paths are in the system of their feature, in the workpiece, as the setup places it."""
    text_ = write_stepnc_arm(tiny())
    there = "AXIS2_PLACEMENT_3D('setup origin',#3,#4,#5)"
    turned = text_.replace(there, "AXIS2_PLACEMENT_3D('setup origin',#9001,#9002,#9003)").replace(
        "ENDSEC;\nEND-", "#9001=CARTESIAN_POINT('',(1.,2.,3.));\n#9002=DIRECTION('',(0.,0.,1.));\n"
                         "#9003=DIRECTION('',(0.,1.,0.));\nENDSEC;\nEND-")
    a, b = read_moves(text_), read_moves(turned)
    keep = ~(a.arrival | np.roll(a.arrival, -1))
    assert np.allclose(b.end[keep], np.column_stack([-a.end[keep, 1], a.end[keep, 0], a.end[keep, 2]]) + [1, 2, 3])


def _second_setup(text_: str, height: float, workpiece: float = 0.0) -> str:
    """A file whose last workingstep has a setup of its own, its origin and its workpiece at heights, mm."""
    steps, rest = re.findall(r"(?m)^#\d+=WORKPLAN\('setup[^']*',\(([^)]*)\),(#\d+,#\d+,\$)\);", text_)[0]
    channel, setup = rest.split(",")[:2]
    secplane = re.findall(rf"(?m)^{setup}=SETUP\('[^']*',#\d+,(#\d+),", text_)[0]
    piece = re.findall(r"=WORKPIECE_SETUP\((#\d+),", text_)[0]
    first, last = steps.rsplit(",", 1)
    own = (f"#9001=CARTESIAN_POINT('',(0.,0.,{height:.4f}));\n#9002=AXIS2_PLACEMENT_3D('',#9001,$,$);\n"
           f"#9003=CARTESIAN_POINT('',(0.,0.,{workpiece:.4f}));\n#9004=AXIS2_PLACEMENT_3D('',#9003,$,$);\n"
           f"#9005=WORKPIECE_SETUP({piece},#9004,$,$,());\n#9006=SETUP('second',#9002,{secplane},(#9005));\n"
           f"#9007=WORKPLAN('second',({last}),{channel},#9006,$);\nENDSEC;\nEND-")
    return text_.replace(f"({steps})", f"({first},#9007)").replace(
        "ENDSEC;\nEND-", own)


def test_a_second_setup_shifts_paths_by_where_it_stands():
    """Positions of a workpiece in two setups are those of the machine: setup by setup, workpiece in its setup."""
    text_ = write_stepnc_arm(plan())
    a, lower, same = (read_moves(t) for t in (text_, _second_setup(text_, -0.05), _second_setup(text_, -0.05, 0.05)))
    assert np.allclose(lower.end[:20], a.end[:20])
    assert np.allclose(lower.end[-5:-1], a.end[-5:-1] + [0.0, 0.0, -0.05])
    assert np.allclose(same.end, a.end)


def test_a_setup_that_stands_nowhere_or_tilted_is_refused():
    text_ = _second_setup(write_stepnc_arm(plan()), 0.0)
    with pytest.raises(ProgramError, match="every setup of a file states its origin"):
        read_moves(text_.replace("#9006=SETUP('second',#9002,", "#9006=SETUP('second',$,"))
    whole = write_stepnc_arm(tiny())
    tilted = re.sub(r"(?m)^(#\d+=SETUP\('[^']*',)#\d+", r"\g<1>#9002", whole).replace(
        "ENDSEC;\nEND-", "#9001=DIRECTION('',(0.,0.1,0.995));\n#9003=CARTESIAN_POINT('',(0.,0.,0.));\n"
                         "#9002=AXIS2_PLACEMENT_3D('',#9003,#9001,$);\nENDSEC;\nEND-")
    with pytest.raises(ProgramError, match="its_origin of the setup is tilted"):
        read_moves(tilted)


@pytest.mark.parametrize("entity", ["CONCURRENT", "BRANCH"])
def test_workingsteps_beside_the_sequence_are_refused(entity):
    """A control would run them too, or instead."""
    text_ = write_stepnc_aim(tiny())
    beside = re.sub(r"=MACHINING_PROCESS_SEQUENCE_RELATIONSHIP\(", f"=MACHINING_PROCESS_{entity}_RELATIONSHIP(", text_,
                    count=1)
    with pytest.raises(ProgramError, match=f"MACHINING_PROCESS_{entity}_RELATIONSHIP is not read"):
        read_moves(beside)


def test_a_tool_is_known_by_its_number_or_its_size():
    text_ = write_stepnc_arm(tiny())
    nameless = text_.replace("MILLING_CUTTING_TOOL('T1: ball", "MILLING_CUTTING_TOOL('BALL_3MM: ball")
    read = read_stepnc(nameless, tools=[BALL, OTHER])
    assert set(read.tool.tolist()) == {1} and any("its size matches" in n for n in read.notes)
    with pytest.raises(ProgramError, match="matches no tool of the setup"):
        read_stepnc(nameless, tools=[OTHER])
    other = read_stepnc(text_, tools=[replace(BALL, diameter=4.0, corner_radius=2.0)])
    assert any("diameter 3 mm in the file and 4 mm" in r.message for r in other.remarks)


def test_a_tool_that_leans_on_a_machine_that_cannot_is_remarked():
    job = clamped()
    assert any("no rotary axes" in r.message for r in read_stepnc(write_stepnc_arm(job), tools=job.tools).remarks)


def pocket(lines):
    """The pocket's program as a workplan of one step."""
    p = read_program(text(lines), tools={1})
    begin = int(np.flatnonzero(~np.isnan(p.feed))[0]) - 1
    ways: list[Trajectory] = []
    for k in range(begin, len(p)):
        rapid = bool(np.isnan(p.feed[k]))
        if np.abs(p.end[k] - p.start[k]).max() > 0.0:
            ways.append(Trajectory(TrajectoryKind.RAPID if rapid else TrajectoryKind.CUT,
                                   np.array([p.start[k], p.end[k]]),
                                   0.0 if rapid else float(p.feed[k])))
    made = replace(step(1, TOOL, "depth_layers", trajectories=tuple(ways)), spindle_rpm=8000.0, feed=400.0)
    return plan(made, tools=(TOOL,), clearance_plane=20.0,
                stock=StockBox(np.array([-20.5, -15.5, -10.0]), np.array([20.5, 15.5, 0.5])))


@both
def test_a_file_is_proved_like_the_program(write):
    part, lines = block(), program()
    own = scored(part)
    plain = prove([("p", text(lines))], part, [TOOL], SETUP, own, ZONES)
    job = pocket(lines)
    proof = prove([NcProgram("job.stpnc", write(job))], part, [TOOL], SETUP, own, ZONES)
    assert proof.counts == plain.counts and np.abs(proof.residual - plain.residual).max() < 1e-4
    deep = replace(job, steps=(replace(job.steps[0], trajectories=tuple(
        replace(t, points=t.points - [0.0, 0.0, 0.1]) for t in job.steps[0].trajectories)),))
    found = prove([NcProgram("job.stpnc", write(deep))], part, [TOOL], SETUP, own, ZONES)
    gouge = next(f for f in found.findings if f.kind == "gouge")
    assert gouge.depth == pytest.approx(0.1, abs=0.01)
    assert write(deep).split("\n")[gouge.line - 1].lstrip("#0123456789").startswith("=CARTESIAN_POINT")


def test_the_first_edition_is_read_too():
    job = replace(plan(), ap238=Ap238.INTEGRATED_CNC)
    check_agreement(nc_of(job), read_stepnc(write_stepnc_aim(job), tools=job.tools))


@both
def test_planes_that_a_control_travels_on_are_kept(write):
    """The security plane of the setup; a retract plane only where it is lower than the path before it ends."""
    wanted = plan()
    planes = read_stepnc(write(wanted), tools=wanted.tools).planes
    assert {(p.what, p.point[2], p.normal) for p in planes} == \
        {("security plane", wanted.clearance_plane, (0.0, 0.0, 1.0))}


def test_a_plane_in_the_part_is_a_finding():
    wanted = plan()
    whole = write_stepnc_arm(wanted)
    height = f"{wanted.clearance_plane:g}"
    lower = re.sub(rf"(CARTESIAN_POINT\('',\(0\.,0\.,){height}[.0]*\)\)", r"\g<1>2.))", whole)
    lower = re.sub(rf"(FREEFORM_OPERATION\([^']*'[^']*',){height}[.0]*,", r"\g<1>-50.,", lower)
    program = read_stepnc(lower, tools=wanted.tools)
    bounds = np.array([[-20.0, -20.0, 0.0], [20.0, 20.0, 10.0]])
    setup = ProofSetup(stock_kind="box", margin=0.5, uncertainty=0.0)
    found = [f for f in way_findings(program, bounds, wanted.tools, setup) if "plane" in f.message]
    assert [(f.kind, f.depth, f.limit) for f in found if "security" in f.message] == [(FindingKind.RAPID, 9.5, 11.5)]
    assert {f.depth for f in found if "retract" in f.message} == {61.5}
    assert all(lower.split("\n")[f.line - 1].startswith("#") for f in found)
    ours = read_stepnc(whole, tools=wanted.tools)
    low = np.array([[-20.0, -20.0, 0.0], [20.0, 20.0, wanted.clearance_plane - 2.0]])
    assert not [f for f in way_findings(ours, low, wanted.tools, setup) if "plane" in f.message]


def test_a_place_where_an_operation_starts_is_refused():
    """A control may go there before the tool path, and nothing says how."""
    whole = write_stepnc_arm(plan())
    point = next(k for k in re.findall(r"#([0-9]+)=CARTESIAN_POINT", whole))
    moved = re.sub(r"(FREEFORM_OPERATION\([^']*'[^']*',[0-9.]*,)\$", rf"\g<1>#{point}", whole, count=1)
    assert moved != whole
    with pytest.raises(ProgramError, match=r"start_point: \$ expected"):
        read_stepnc(moved, tools=plan().tools)


def test_a_way_home_and_its_path_are_followed():
    """A RETURN_HOME is read like a rapid movement: its path at rapid, its plane, then a stop."""
    wanted = plan()
    whole = write_stepnc_arm(wanted)
    ours = read_stepnc(whole, tools=wanted.tools)
    lines = whole.split("\n")
    with_path = [k for k, text in enumerate(lines) if re.search(r"=RAPID_MOVEMENT\('[^']*',#\d+,#\d+,", text)]
    lines[with_path[-1]] = lines[with_path[-1]].replace("RAPID_MOVEMENT(", "RETURN_HOME(")
    home = read_stepnc("\n".join(lines), tools=wanted.tools)
    assert [s.line for s in home.stops if s.event == "return to home"] == [with_path[-1] + 1]
    assert len(home) >= len(ours) and any((home.end == place).all(axis=1).any() for place in ours.end[-3:])


@pytest.mark.parametrize("entity", ["SETUP", "RAPID_MOVEMENT", "RETURN_HOME"])
def test_every_security_plane_counts(entity):
    wanted = plan()
    whole = write_stepnc_arm(wanted)
    last = max(int(n) for n in re.findall(r"(?m)^#(\d+)=", whole))
    low = (f"#{last + 1}=CARTESIAN_POINT('',(0.,0.,2.));\n#{last + 2}=AXIS2_PLACEMENT_3D('',#{last + 1},$,$);\n"
           f"#{last + 3}=PLANE('low',#{last + 2});\nENDSEC;\nEND-ISO")
    own = {"SETUP": r"(=SETUP\('[^']*',[^,]*,)#\d+", "RAPID_MOVEMENT": r"(=RAPID_MOVEMENT\('[^']*',)#\d+(?=,#)",
           "RETURN_HOME": r"(=)RAPID_MOVEMENT\('[^']*',#\d+(?=,#)"}[entity]
    word = "RETURN_HOME('home'," if entity == "RETURN_HOME" else ""
    lower = re.sub(own, rf"\g<1>{word}#{last + 3}", whole, count=1).replace("ENDSEC;\nEND-ISO", low)
    planes = {p.point[2] for p in read_stepnc(lower, tools=wanted.tools).planes}
    assert planes == {2.0, wanted.clearance_plane}
