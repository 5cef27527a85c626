"""Words of Fanuc and Haas that are finer than the least input increment: sums of them go elsewhere on the control."""

import pytest

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


def test_other_controls_keep_all_digits():
    text = "G21 G90 G17\nT1 M6\nS1000 M3\nG43 G0 X0 Y0 Z9\nG64 P0.001\nG91\n" + "G1 X-.0009 F100\n" * 300 + "G90\nM2\n"
    assert not any("increment" in r.message and "least" in r.message for r in read_program(text).remarks)
