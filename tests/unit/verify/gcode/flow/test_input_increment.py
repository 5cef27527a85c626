"""Words that are finer than the increment that a control counts in: sums of them, and arcs by R, go elsewhere."""

import pytest

from verify.gcode.dialects import CONTROLS
from verify.gcode.reader import Reader, read_program

HEAD = ("%\nO1000 (MAIN)\nG21 G90 G17\nG54 G0\nT1 M6\nS1000 M3\nG0 G54 G43 H1 Z50.\nX0. Y0.\nG1 Z9. F100.\n")
LOOP = "#3=0\nWHILE[#3LT{}]DO1\n{}\n#3=#3+1\nEND1\nG90\n"


def told(body, dialect="fanuc", **known):
    p = read_program(HEAD + body + "M30\n%\n", dialect=dialect, radii={1: 2.0}, **known)
    return [(r.line, r.message) for r in p.remarks if "least input increment" in r.message]


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
@pytest.mark.parametrize(("body", "line", "away"), [
    ("#1=.0125\n" + LOOP.format(80, "G91 G1 X#1"), 13, "places 0.04 mm"),
    ("#1=.0006\n" + LOOP.format(300, "G91 G1 X#1"), 13, "places 0.12 mm"),
    (LOOP.format(60, "G91 Y.01 Z-[1/80.]"), 12, "places 0.03 mm"),
    ("G91\n" + "X-.0009\n" * 300, 11, "places 0.27 mm"),
    ("G91 X-.0009\nG90\n" * 300, 10, "places 0.27 mm"),
    ("G91\n" + "G2 X.5019 I.251\nG1 X-.5\n" * 20, 11, "places 0.018 mm"),
    ("#1=.0125\n" + LOOP.format(80, "X[#5041+#1]"), 13, "places 0.04 mm"),
    ("X.0004\nG92 X0.\n" * 200 + "G92 X0.\n", 11, "places 0.08 mm"),
    ("G91 M98 P20 L80\nG90\nM30\nO20\nX.0005\nM99\n", 14, "places 0.04 mm"),
    ("G20 F9.\n#1=.00125\n" + LOOP.format(80, "G91 X#1"), 14, "places 0.102 mm"),
    ("G80 G0\n#1=10/3\nG99 G81 X0. Z8. R9.5\n" + LOOP.format(30, "G91 X#1") + "G80\n", 15, "places 0.01 mm"),
    ("G83 X0. Z8. R9.5 Q[.0004]\nG80\n", 10, "an error (a drilling cycle with Q0"),
    ("#1=10.01\nX-#1\nG2 X[#1-.0006] R#1\n", 12, "places 0.0226 mm")])
def test_words_that_add_up_behind_the_increment_are_told(body, line, away, dialect):
    """Manuals: a control rounds the word of a variable to the increment, and drops the digits of a number behind it."""
    if "92 X0" in body and dialect == "haas":
        body = body.replace("G92 X0.\nM30", "M30")
    (found, message), = told(body, dialect)
    assert found == line and f"So it has {away}" in message


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
@pytest.mark.parametrize("body", [
    "#1=.0125\n#3=0\nWHILE[#3LT80]DO1\n#3=#3+1\nX[4.98+#1*#3] Y[SIN[#3]]\nEND1\n",
    "#1=.013\n" + LOOP.format(80, "G91 G1 X#1"), "#1=1/80.\n" + LOOP.format(1, "G91 G1 X#1 Y#1"),
    "#1=7.123456\nX#1\n#2=0\nWHILE[#2LT36]DO1\n#2=#2+1\nG3 X[#1*COS[#2*10]] Y[#1*SIN[#2*10]] R#1\nEND1\n",
    "#1=77.123456\nX#1\nG3 X-#1 R#1\nG3 X#1 I#1\nG2 X#1 I-#1\n",
    "#1=1/7.\nG41 D1 X#1 Y#1\nY[10*#1]\nG3 X[#1-5] Y[10*#1+5] R5.\nG1 X-15.\nG40 X-19. Y-9.\n",
    "G20 F9.\n#1=.0125\n" + LOOP.format(80, "G91 X#1"), "G65 P20 A[1/3.]\nM30\nO20\nG91\nX.5\nG90\nM99\n",
    "G91\n" + "X.010\nX.0130\n" * 200, "G91 X1.0005 Y.0004\nG90\n",
    "G68 X0. Y0. R[360/7.]\nX100. Y100.\nG69\nX0. Y0.\n", "G51 X0. Y0. Z0. I[1+1/3.] J[1+1/3.] K1.\nX30. Y1.\nG50\n"])
def test_words_that_do_not_add_up_are_not_told(body, dialect):
    assert told(body, dialect) == []


def test_angles_add_up(five_axis):
    body = "#1=.0125\n" + LOOP.format(80, "G91 G1 C#1")
    assert "angles 0.04 deg away in line 13" in told(body, kinematics=five_axis)[0][1]
    assert told("#3=0\nWHILE[#3LT8]DO1\n#3=#3+1\nG1 X200. C[#3*360/7.]\nEND1\n", kinematics=five_axis) == []


@pytest.fixture
def five_axis():
    from verify.kinematics import Kinematics
    return Kinematics("table-table-AC", ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))


@pytest.mark.parametrize(("body", "times"), [
    ("X1.00005\nG91 G28 Z0.\nG90\n", 1), ("G91\nX.001\nG90\n", 1), ("#1=.125\n" + LOOP.format(8, "G91 X#1"), 1),
    ("#1=1/3.\nX#1\n", 2)])
def test_only_programs_with_finer_words_are_read_twice(body, times, monkeypatch):
    run, scan = [], Reader._scan
    monkeypatch.setattr(Reader, "_scan", lambda *a: run.append(1) or scan(*a))
    assert told(body) == [] and len(run) == times


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
@pytest.mark.parametrize(("body", "line", "away"), [
    ("X4.03 Y2.\nG3 Y6. R2.0004\nG1 X4.\n", 11, "places 0.0396 mm"),
    ("X4.03 Y2.\nG3 Y6. R-2.0004\nG1 X4.\n", 11, "places 0.0414 mm"),
    ("X4.04 Y2.\nG3 Y6. R2.0009\n", 11, "places 0.0601 mm"),
    ("X4.03 Y.0009\nG3 Y4.0005 R2.\n", 11, "places 0.0283 mm"),
    ("G18\nX4.03 Z12.\nG3 Z16. R2.0004\n", 12, "places 0.0396 mm"),
    ("G20 F9.\nX.4 Y.2\nG3 Y.6 R.20004\n", 12, "places 0.102 mm"),
    ("G91\nX4.03 Y2.\nG90 G3 Y6. R2.0004\n", 12, "places 0.0396 mm")])
def test_an_arc_of_half_a_circle_hangs_on_digits_behind_the_increment(body, line, away, dialect):
    """The control drops them: at R2.0004 over 4 mm its centre is 0.04 mm away, in G90 too."""
    (found, message), = told(body, dialect)
    assert found == line and f"So it has {away}" in message


@pytest.mark.parametrize("dialect", ["fanuc", "haas"])
@pytest.mark.parametrize(("body", "times"), [
    ("X4.03 Y2.\nG3 Y6. R2.\n", 1), ("X4.03 Y2.\nG3 Y6. R2.001\n", 1), ("X1.2344\nG3 X5.2344 Y4. R4.0004\n", 1),
    ("X1.2344\nG3 X5.2344 Y4.0004 I.0004 J4.0004\n", 1), ("X4.03 Y2.\nG3 X0.0304 Y2. I-1.9998\n", 1),
    ("X4.03 Y2.\nG3 Y5.9 R2.0004\n", 2),
    ("X7.7991 Y9.1234\nX1.0004 Y1.9234\n", 1), ("G80 G0\nG81 X0. Z8. R9.5004\nG80\n", 1),
    ("G20 F9.\nX.4 Y.2\nG3 Y.6 R.2001\nG21\n", 1)])
def test_arcs_that_the_increment_leaves_in_place_are_not_told(body, times, dialect, monkeypatch):
    run, scan = [], Reader._scan
    monkeypatch.setattr(Reader, "_scan", lambda *a: run.append(1) or scan(*a))
    assert told(body, dialect) == [] and len(run) == times


SIEMENS = "G710 G90 G17 G94 G54\nT1 M6\nS1000 M3\nG0 X0 Y0 Z50\nG1 Z9 F100\n"
ROUND = "R9=0\nWHILE R9<{}\n{}\nR9=R9+1\nENDWHILE\nG90\n"


def rounded(body, **known):
    p = read_program(SIEMENS + body + "M30\n", dialect="siemens", radii={1: 2.0}, **known)
    return [(r.line, r.message) for r in p.remarks if "calculation resolution" in r.message]


@pytest.mark.parametrize(("body", "line", "away"), [
    ("R1=0.0125\nG91\n" + ROUND.format(80, "G1 X=R1"), 10, "places 0.04 mm"),
    (ROUND.format(300, "X=IC(0.0006)"), 8, "places 0.12 mm"),
    ("R1=0.0006\n" + ROUND.format(300, "X=IC(R1)"), 9, "places 0.12 mm"),
    ("G91\n" + "X-0.0004\n" * 300 + "G90\n", 7, "places 0.12 mm"),
    ("G91\n" + "N1 X0.5004 Y1\nX-0.5\n" * 20 + "G90\n", 7, "places 0.008 mm"),
    ("R1=0.0125\n" + ROUND.format(80, "X=$AA_IW[X]+R1"), 9, "places 0.04 mm"),
    ("R1=0.0125\nG91\n" + ROUND.format(8, "G1 X=R1 Z=AC(9)"), 10, "places 0.004 mm"),
    ("G111 X0 Y0\nG1 AP=0 RP=9\n" + ROUND.format(30, "G1 RP=IC(0.0006) AP=0"), 10, "places 0.012 mm"),
    ("G700 F9\n" + "X=IC(0.00011)\n" * 300, 7, "places 0.0618 mm"),
    ("G1 X4.03 Y2\nG3 Y6 CR=2.0004\nG1 X4\n", 7, "places 0.0396 mm"),
    ("L20 P80\nM30\n%_N_L20_SPF\nG91 X0.0004\nG90\nM17\n", 9, "places 0.032 mm")])
def test_increments_behind_the_resolution_of_siemens_are_told(body, line, away):
    """Basic functions, G2: the product of place and resolution (MD10200, 1000 a mm) is rounded to a whole number."""
    (found, message), = rounded(body)
    assert found == line and f"So it has {away}" in message and "10200" in message


def test_angles_add_up_on_siemens(five_axis):
    body = "R1=0.0125\nG91\n" + ROUND.format(80, "G1 C=R1")
    assert "angles 0.04 deg away in line 10" in rounded(body, kinematics=five_axis)[0][1]
    assert "angles 0.04 deg" in rounded(ROUND.format(80, "G1 C=IC(0.0125)"), kinematics=five_axis)[0][1]
    assert rounded(ROUND.format(8, "G1 X200 C=R9*360/7"), kinematics=five_axis) == []


@pytest.mark.parametrize(("body", "times"), [
    ("R1=0.0125\n" + ROUND.format(80, "X=4.98+R1*R9 Y=SIN(R9)"), 1), ("G91\n" + ROUND.format(80, "G1 X0.013"), 1),
    ("R1=7.123456\nX=R1\n" + ROUND.format(36, "G3 X=R1*COS(R9*10+10) Y=R1*SIN(R9*10+10) CR=R1"), 1),
    ("X1.23456 Y2.34567\nX=AC(3.00004) Y9.99999\nG2 X4.00004 I0.50002 J0\n", 1),
    ("G91\nX0.0004\nX5\nG90\nX0\n", 2), ("R1=0.1\nG91\n" + ROUND.format(80, "G1 X=R1+0.2"), 1),
    ("X1.0004\nR1=$AA_IW[X]\nX5\nX=R1\n", 2), ("ROT RPL=33\nX1.0004 Y2.0004\nX=IC(0.0004)\nROT\nX0 Y0\n", 2),
    ("TRANS X0.0004\nATRANS X0.0004\nX1\nTRANS\nX0\n", 1),
    ("G41 X5.0004 Y5\nY=IC(9.0004)\nG3 X0 Y19 CR=5\nG1 G40 X-9\n", 2),
    ("G91\nX1.5 Y2.123 F99.12345\nG90\n", 1), ("G331 Z=IC(-1) K0.6666 S100\n", 1)])
def test_absolute_places_of_siemens_are_not_told(body, times, monkeypatch):
    run, scan = [], Reader._scan
    monkeypatch.setattr(Reader, "_scan", lambda *a: run.append(1) or scan(*a))
    assert rounded(body) == [] and len(run) == times


def test_other_controls_keep_all_digits():
    text = "G21 G90 G17\nT1 M6\nS1000 M3\nG43 G0 X0 Y0 Z9\nG64 P0.001\nG91\n" + "G1 X-.0009 F100\n" * 300 + "G90\nM2\n"
    assert not any("increment" in r.message and "least" in r.message for r in read_program(text).remarks)
    assert CONTROLS["heidenhain"].increment is None
