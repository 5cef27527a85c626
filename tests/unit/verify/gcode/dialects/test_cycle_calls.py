"""Calls of cycles whose arguments choose the depth, the plane, the feed, or how the spindle turns."""

import numpy as np
import pytest

from geometry.errors import ProgramError
from tests.program_pairs import read
from verify.gcode.reader import read_program

TAPS = {"CYCLE84": "0,3,,1.25,0,400,400,3,1,0,0,0,0,,,,0,1", "CYCLE840": "0,4,3,11,,1.25,3,1,0,,,,0,1"}
MODES = {"CYCLE81": "0,0,1", "CYCLE82": "0,0,1", "CYCLE83": "-3,,1,0,0,1,1,3,0,0,0,0,0,1", "CYCLE85": "0,99,99,0,1",
         "CYCLE86": "0,3,0,0,0,0,0,1", **TAPS}
"""Arguments between DPR and _AMODE; the last one is _DMODE."""


def lowest(lines, dialect="siemens"):
    return float(np.nanmin(read(lines, dialect).end[:, 2]))


def refused(lines, dialect="siemens"):
    """What is said of a program that is refused, and what to write."""
    with pytest.raises(ProgramError) as told:
        read(lines, dialect)
    return f"{told.value}; {told.value.remedy}"


@pytest.mark.parametrize("name", MODES)
@pytest.mark.parametrize(("mode", "depth"), [("", -6), (0, -6), (1, -6), (2, -8), (11, -6), (12, -8)])
def test_the_mode_says_which_depth_counts(name, mode, depth):
    """Programming cycles externally, _AMODE: units 1 takes DPR, 2 DP; 0 takes DPR where both are given."""
    assert lowest(f"{name}(5,0,2,-8,6,{MODES[name]},{mode})") == depth
    for kind, given, missing in ((1, "-8,", "DPR"), (2, ",6", "DP")):
        assert f"_AMODE={kind} takes its depth from {missing}" in refused(f"{name}(5,0,2,{given},{MODES[name]},{kind})")


@pytest.mark.parametrize(("mode", "first"), [(0, -2), (10000, -2), (20000, -3)])
def test_the_mode_says_which_first_depth_counts(mode, first):
    p = read(f"CYCLE83(5,0,2,-8,,-3,2,0,0,0,1,1,3,0,0,0,0,0,1,{mode})", "siemens")
    assert p.end[p.kind == 1][0, 2] == first
    assert "_AMODE=10000 takes its depth from FDPR" in refused(
        "CYCLE83(5,0,2,-8,,-3,,0,0,0,1,1,3,0,0,0,0,0,1,10000)")


@pytest.mark.parametrize("name", MODES)
@pytest.mark.parametrize(("plane", "digit", "followed"), [(17, 0, True), (17, 1, True), (17, 2, False), (17, 3, False),
                                                          (18, 2, True), (18, 1, False), (19, 3, True), (17, 4, False)])
def test_a_cycle_in_another_plane_is_refused(name, plane, digit, followed):
    call = f"G{plane}\n{name}(5,0,2,-8,,{MODES[name][:-1]}{digit})"
    if followed:
        axis = {17: 2, 18: 1, 19: 0}[plane]
        assert read(call, "siemens").end[:, axis].min() == -8
    else:
        assert f"_DMODE={digit}" in refused(call)


@pytest.mark.parametrize("row", ["HOLES1(8,6,0,0,0,1,0,0,,,{})", "HOLES2(8,6,1,0,0,1,0,0,,,{})"])
def test_a_row_of_holes_in_another_plane_is_refused(row):
    body = f"MCALL CYCLE81(14,10,2,4)\n{row}\nMCALL"
    assert "_DMODE=2 works in G18 while G17 is in force" in refused(body.format(2))
    assert len(read(body.format(1), "siemens"))


@pytest.mark.parametrize(("turn", "back", "right"), [
    ("M3", 4, True), ("M3", 0, True), ("M3", 3, False), ("M4", 3, True), ("M4", 4, False), ("M3", 5, False)])
@pytest.mark.parametrize("encoder", [0, 1, 11, 20])
def test_a_tap_in_a_chuck_has_to_turn_back(turn, back, right, encoder):
    """PGZ 11.02, p. 2-86: SDR is the direction of rotation for the retraction."""
    call = f"{turn} F1250\nCYCLE840(14,10,2,4,,0,{back},3,{encoder},,1.25)"
    if right:
        assert len(read(call, "siemens"))
    else:
        assert f"SDR={back} does not turn the spindle back" in (said := refused(call))
        assert f"write SDR={4 if turn == 'M3' else 3}" in said


@pytest.mark.parametrize(("feed", "agrees"), [(1250, True), (1000, False), (1260, True), (9000, False)])
def test_the_feed_and_the_pitch_of_a_tap_in_a_chuck_agree(feed, agrees):
    """With ENC=1 the control feeds with F, with ENC=11 it computes the feed."""
    call = f"F{feed}\nCYCLE840(14,10,2,4,,0,4,3,{{}},,1.25)"
    if agrees:
        assert len(read(call.format(1), "siemens"))
    else:
        assert "its pitch is 1.25 mm" in refused(call.format(1))
    p = read(call.format(11), "siemens")
    assert set(p.feed[p.kind == 1]) == {1250}


@pytest.mark.parametrize("line", ["CYCLE840(14,10,2,4,,0,4,3,1)", "CYCLE84(14,10,2,4,,0,3,,1.25,0,400,400)", "G63 Z4",
                                  "G331 Z4 K1 S500"])
def test_a_tap_under_an_override_of_the_program_is_refused(line):
    """G63 fixes the override at 100 %."""
    assert "under OVR=50" in refused(f"F1280\nOVR=50\n{line}")
    assert len(read(f"F1280\nOVR=50\nG1 X1\nOVR=100\n{line}", "siemens"))


def test_a_size_and_another_pitch_are_refused():
    assert "the pitch 1.25 mm (PIT) for a thread M6, which has 1 mm" in refused(
        "CYCLE84(5,0,2,-10,,0,3,6,1.25,0,400,400)")
    assert len(read("CYCLE84(5,0,2,-10,,0,3,6,1,0,400,400)", "siemens"))


@pytest.mark.parametrize(("words", "named"), [
    ("111,3,30,2,9000", "_VARI=111"), ("0,3,0,0,0", "S_ZA=3"), ("0,0,30,0,0", "S_FA=30"), ("0,0,0,2,0", "S_ZD=2"),
    (",,,,9000", "S_FD=9000")])
def test_drilling_with_other_feeds_at_its_ends_is_refused(words, named):
    assert f"{named} (" in refused(f"CYCLE82(14,10,2,4,,0,0,1,111112,{words})")
    assert lowest("CYCLE82(14,10,2,4,,0,0,1,111112,0,0,0,0,0)") == lowest("CYCLE82(14,10,2,4,,0,0,1,12,,,,)") == 4


def ends(call):
    """Heights at which pecks of a Siemens cycle end."""
    p = read(call, "siemens")
    return p.end[p.kind == 1][:, 2].round(6).tolist()


def test_pecks_shrink_by_an_amount_a_factor_or_percent():
    call = "CYCLE83(5,0,2,-20,,-8,,{},0,0,1,1,3,{},0,0,0,0,1,{})"
    assert ends(call.format(2, 1, 2)) == [-8, -14, -18, -20]
    halves = [-8, -12, -14, -15, -16, -17, -18, -19, -20]
    assert ends(call.format(-0.5, 1, 2)) == ends(call.format(50, 1, 200002)) == halves
    assert "_DAM=-2" in refused(call.format(-2, 1, 2)) and "_DAM=-1" in refused(call.format(-1, 1, 200002))


def test_the_first_peck_has_its_own_feed():
    call = "F100\nCYCLE83(5,0,2,-9,,-3,,0,0,0,{},0,3,0,0,0,0,0,1,{})"
    for factor, mode, feed in ((0.5, 0, 50), (50, 12, 50), (1, 12, 100), (0, 0, 100), (100, 12, 100)):
        p = read(call.format(factor, mode), "siemens")
        assert p.feed[p.kind == 1].tolist() == [feed, 100, 100]
    assert "FRF=3: the factor" in refused(call.format(3, 0))


@pytest.mark.parametrize(("time", "mode", "seconds"), [
    (3, 2, 3), (-3, 2, 0.18), (3, 12, 3), (3, 22, 0.18), (-3, 22, 0.18)])
def test_a_dwell_counts_in_seconds_or_turns(time, mode, seconds):
    assert read(f"CYCLE82(5,0,2,-9,,{time},0,1,{mode})", "siemens").dwell == pytest.approx(seconds)


@pytest.mark.parametrize(("call", "named"), [
    ("CYCLE81(5,0,2,-9,,0,0,1,102)", "_AMODE=102"), ("CYCLE81(5,0,2,-9,,0,0,1,3)", "_AMODE=3"),
    ("CYCLE81(5,0,2,-9,,0,0,1,1.5)", "_AMODE=1.5"), ("CYCLE81(5,0,-2,-9)", "SDIS=-2"),
    ('CYCLE84(5,0,2,-10,,0,3,,1.25,0,400,400,3,1,0,0,0,0,"","","",0,1,2002)', "_AMODE=2002"),
    ("CYCLE86(5,0,2,-10,,0,3,0,0,-1,0)", "RPAP=-1"), ("CYCLE83(5,0,2,-9,,-3,,0,0,0,1,2)", "VARI=2"),
    ("CYCLE840(5,0,2,-9,,0,4,3,7,,1)", "ENC=7"), ("CYCLE84(5,0,2,-10,,0,3,,1,0,400,400,3,5)", "_PITA=5")])
def test_a_mode_that_is_not_known_is_refused(call, named):
    assert named in refused(call)


def test_the_mode_of_cycle832_on_a_machine_with_rotary_axes():
    """Modes of older controls have six digits, and one of them switches TRAORI."""
    call = "CYCLE832(0.01,112103)\nG1 X9"
    with pytest.raises(ProgramError, match="the mode 112103, which may switch TRAORI"):
        read(call, "siemens", "table-table-AC")
    assert not read(call, "siemens").unbounded
    assert "with 4 arguments" in refused("CYCLE832(0.01,1,1,5)")


# Heidenhain

LIP = "CYCL DEF 241 X Q200=2 Q201=-6 Q206=300 Q211=0 Q203=10 Q204=4 Q379=0 Q253=600 Q208=600 {}\nCYCL CALL\n{}L X+9 F99"


@pytest.mark.parametrize(("words", "again", "speed", "stands"), [
    ("Q426=3 Q427=1000 Q428=1000", "", 1000, False), ("Q426=3 Q427=50 Q428=3000", "", 3000, True),
    ("Q426=5 Q427=50 Q428=1000", "", 1000, True), ("Q426=4 Q427=1000 Q428=1000", "", 1000, True),
    ("Q426=3 Q427=50 Q428=30", "M3\n", 30, False), ("", "", 1000, False), ("Q428=2000", "", 2000, True)])
def test_cycle_241_drills_at_its_own_speed(words, again, speed, stands):
    """TNC 640, cycle 241: Q428 is the speed of drilling, Q427 in and out, and Q426 how it turns there."""
    p = read(LIP.format(words, again), "heidenhain")
    bottom = (p.end[:, 2] == 4) & (p.kind == 1)
    assert bottom.any() and set(p.speed[bottom]) == {speed}
    assert any("spindle standing" in r.message for r in p.remarks) == stands
    cut = (p.end[:, 0] == 9) & (p.kind == 1)
    assert set(p.speed[cut]) == ({0.0} if stands else {50.0} if again else {1000.0})


def test_the_speeds_of_cycle_241_count_against_the_limits():
    for q427, q428 in ((90000, 1000), (50, 90000)):
        assert read(LIP.format(f"Q426=3 Q427={q427} Q428={q428}", ""), "heidenhain").speeds[1][0] == 90000


@pytest.mark.parametrize(("words", "named"), [
    ("Q428=0", "Q428=0"), ("Q426=2", "Q426=2"), ("Q429=5", "Q429=5"), ("Q430=4", "Q430=4"),
    ("Q435=3 Q401=50", "Q401=50 and Q435=3")])
def test_values_of_cycle_241_that_are_refused(words, named):
    assert named in refused(LIP.format(words, ""), "heidenhain")


def test_the_feed_of_tool_call_does_not_go_with_another_speed():
    given = LIP.replace("Q206=300", "Q206=AUTO")
    assert "Q206 as AUTO and Q428=3000" in refused(given.format("Q428=3000", ""), "heidenhain")
    assert len(read(given.format("Q428=1000", ""), "heidenhain"))


def test_cycle_241_switches_the_coolant():
    p = read(LIP.format("Q429=8 Q430=9", ""), "heidenhain")
    bottom = (p.end[:, 2] == 4) & (p.kind == 1)
    assert p.coolant[bottom].all() and not p.coolant[-1]


@pytest.mark.parametrize(("cycle", "named"), [
    ("200 X Q200=-2 Q201=-6 Q206=300 Q202=2 Q210=0 Q203=10 Q204=4 Q211=0", "Q200=-2"),
    ("200 X Q200=2 Q201=-6 Q206=300 Q202=-2 Q210=0 Q203=10 Q204=4 Q211=0", "Q202=-2"),
    ("205 X Q200=2 Q201=-6 Q206=300 Q202=2 Q203=10 Q204=4 Q212=0 Q205=0 Q258=-1 Q259=-1 Q257=0 Q256=.2", "Q258=-1"),
    ("240 X Q200=2 Q343=1 Q201=-6 Q344=-4 Q206=300 Q211=0 Q203=10 Q204=4", "Q343=1"),
    ("208 X Q200=2 Q201=-6 Q206=300 Q334=1 Q203=10 Q204=4 Q335=18 Q342=0 Q351=1 Q370=1", "Q370=1")])
def test_values_that_the_control_does_not_take(cycle, named):
    assert named in refused(f"CYCL DEF {cycle}\nCYCL CALL", "heidenhain")


def test_a_value_that_the_program_changes_behind_the_definition():
    given = "CYCL DEF 200 X Q200=2 Q201=-6 Q206=300 Q202=2 Q203=10 Q204=4\nQ200=-2\nCYCL CALL"
    assert "Q200=-2" in refused(given, "heidenhain")


def test_old_pecking_with_the_sign_of_its_depth():
    """All distances of cycle 1 have the sign of its depth."""
    text = ("L Z+2 FMAX\nCYCL DEF 1.0 PECKING\nCYCL DEF 1.1 SET UP {0}2\nCYCL DEF 1.2 DEPTH -6\n"
            "CYCL DEF 1.3 PECKG {0}4\nCYCL DEF 1.4 DWELL 0\nCYCL DEF 1.5 F80\nCYCL CALL")
    below, above = (read(text.format(sign), "heidenhain") for sign in ("-", "+"))
    assert below.end.tolist() == above.end.tolist() and -4 in below.end[:, 2]


# G words

@pytest.mark.parametrize(("dialect", "cycle", "word"), [
    ("haas", "G81", "J2"), ("haas", "G85", "J2"), ("haas", "G81", "K3"), ("haas", "G84", "K3")])
def test_a_letter_that_the_cycle_does_not_take_is_told(dialect, cycle, word):
    head = "G21 G17 G90 G94 G54\nT1 M6\nS1000 M3\nG0 X0. Y0.\nG43 H1 Z50.\n"
    p = read_program(f"%\n{head}G99 {cycle} X5. Y0. Z-8. R2. F300. {word}\nG80\nG0 Z50.\nM30\n%\n", dialect=dialect)
    assert f"no code of this block uses {word}" in [r.message for r in p.remarks]
