"""Programs of the kind that the manuals of both controls work through, against positions from arithmetic."""

import math

import numpy as np
import pytest

from tests.program_pairs import read
from verify.gcode.reader import read_program

HOLE = "TOOL CALL 1 Z S1000 F200\nM3\nL Z+250 R0 FMAX"


def places(p, kind=None):
    """Ends of the moves, mm, of one kind where it is given."""
    return p.end if kind is None else p.end[p.kind == kind]


def bottoms(p):
    """Places in the plane where feeds go straight down, in order."""
    down = (p.kind == 1) & (p.end[:, 2] < p.start[:, 2]) & (p.start[:, :2] == p.end[:, :2]).all(axis=1)
    return p.end[down]


def test_a_part_shifted_three_times_by_siemens():
    """TRANS before each call of the same subprogram."""
    p = read("G0 X0 Y0 Z2\nTRANS X10 Y10\nL10\nTRANS X50 Y10\nL10\nTRANS X10 Y50\nL10\nTRANS\nG0 Z50\nM30\n"
             "PROC L10\nG0 X0 Y0\nG1 Z-5\nX20\nY20\nX0\nY0\nG0 Z2\nRET", "siemens")
    corners = np.array([[20, 0], [20, 20], [0, 20], [0, 0]])
    cuts = p.end[(p.kind == 1) & (p.end[:, 2] == -5) & (p.start[:, 2] == -5)]
    assert np.allclose(cuts[:, :2], np.vstack([corners + s for s in ([10, 10], [50, 10], [10, 50])]))


def test_a_part_turned_by_siemens():
    """A shift, a rotation on top of it, and another of each."""
    p = read("TRANS X20 Y10\nL10\nTRANS X55 Y35\nAROT RPL=45\nL10\nTRANS X20 Y40\nAROT RPL=60\nL10\nM30\n"
             "PROC L10\nG1 X10 Y0\nX10 Y5\nRET", "siemens")
    wanted = []
    for x, y, angle in ((20, 10, 0), (55, 35, 45), (20, 40, 60)):
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        wanted += [[x + 10 * c, y + 10 * s], [x + 10 * c - 5 * s, y + 10 * s + 5 * c]]
    assert np.allclose(p.end[p.kind == 1][:, :2], wanted)


def test_drilling_and_a_circle_of_holes_of_siemens():
    p = read("G0 X40 Y120 Z110\nCYCLE81(110,100,2,35)\nY30\nCYCLE81(110,102,,35)\nX90\nCYCLE81(110,100,2,,65)",
             "siemens")
    assert np.allclose(bottoms(p), [[40, 120, 35], [40, 30, 35], [90, 30, 35]])
    assert np.allclose(p.start[p.kind == 1][:, 2], [102, 102, 102])
    p = read("MCALL CYCLE82(30,0,2,,30,0)\nHOLES2(70,60,42,33,0,4)\nMCALL", "siemens")
    angles = np.radians(33 + 90 * np.arange(4))
    assert np.allclose(bottoms(p), np.column_stack([70 + 42 * np.cos(angles), 60 + 42 * np.sin(angles),
                                                    np.full(4, -30)]))
    p = read("MCALL CYCLE83(105,102,2,22,0,62,,20,0,0,1,1)\nHOLES1(30,20,0,10,20,5)\nMCALL", "siemens")
    last = bottoms(p)
    assert np.allclose(last[last[:, 2] == 22][:, :2], [[40 + 20 * k, 20] for k in range(5)])
    first = last[:len(last) // 5, 2]
    assert np.allclose(first, [62, 42, 22])  # pecks of 40, then shorter by 20, not below 20


def test_a_contour_with_chamfers_of_heidenhain():
    """Approach and departure along the contour, radius compensation on the left, two chamfers."""
    p = read("L Z+250 R0 FMAX\nL X-10 Y-10 R0 FMAX\nL Z-5 R0 F1000 M3\nAPPR LT X+5 Y+5 LEN10 RL F300\nL Y+95\nL "
             "X+95\nCHF 10\n"
             "L Y+5\nCHF 20\nL X+5\nDEP LT LEN10 F1000\nL Z+250 R0 FMAX M2", "heidenhain")
    contour = np.array([[5, 5], [5, 95], [85, 95], [95, 85], [95, 25], [75, 5], [-5, 5]], dtype=float)
    cut = (p.line >= 9) & (p.line <= 16) & (p.kind == 1) & (p.end[:, 2] == -5)
    away = [_distance(q, contour) for q in p.end[cut][2:, :2]]
    assert np.allclose(away, 5.0, atol=1e-6) and len(away) > 30
    assert np.allclose(p.end[cut][:2, :2], [[0, -5], [0, 5]]) and np.allclose(p.end[cut][-1, :2], [-5, 0])
    assert (p.feed[p.line == 10] == 300).all()


def test_an_ellipse_of_heidenhain():
    """Q parameters, a subprogram, a shift, a rotation and a loop by FN 12."""
    text = ("Q1 = 50\nQ2 = 40\nFN 0: Q3 = +50\nFN 0: Q4 = +30\nFN 0: Q5 = +0\nFN 0: Q6 = +360\nFN 0: Q7 = +40\nFN 0: "
            "Q8 = +30\n"
            "FN 0: Q9 = +5\nFN 0: Q10 = +100\nFN 0: Q11 = +350\nFN 0: Q12 = +2\nCALL LBL 10\nL Z+100 R0 FMAX M2\nLBL "
            "10\n"
            "CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X+Q1\nCYCL DEF 7.2 Y+Q2\nCYCL DEF 10.0 ROTATION\nCYCL DEF 10.1 "
            "ROT+Q8\n"
            "Q35 = (Q6 - Q5) / Q7\nQ36 = Q5\nQ37 = 0\nQ21 = Q3 * COS Q36\nQ22 = Q4 * SIN Q36\nL X+Q21 Y+Q22 R0 FMAX "
            "M3\n"
            "L Z+Q12 R0 FMAX\nL Z-Q9 R0 FQ10\nLBL 1\nQ36 = Q36 + Q35\nQ37 = Q37 + 1\nQ21 = Q3 * COS Q36\nQ22 = Q4 * "
            "SIN Q36\n"
            "L X+Q21 Y+Q22 R0 FQ11\nFN 12: IF +Q37 LT +Q7 GOTO LBL 1\nCYCL DEF 10.0 ROTATION\nCYCL DEF 10.1 ROT+0\n"
            "CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X+0\nCYCL DEF 7.2 Y+0\nL Z+Q12 R0 FMAX\nLBL 0")
    p = read(text, "heidenhain")
    t = np.radians(9.0 * np.arange(1, 41))
    u, v = 50 * np.cos(t), 30 * np.sin(t)
    c, s = math.cos(math.radians(30)), math.sin(math.radians(30))
    cut = (p.kind == 1) & (p.feed == 350)
    assert np.allclose(p.end[cut], np.column_stack([50 + c * u - s * v, 40 + s * u + c * v, np.full(40, -5.0)]),
                       atol=1e-9)
    assert p.end[-1, 2] == 100.0


def test_groups_of_holes_of_heidenhain():
    """A cycle, a subprogram with incremental moves and M99, called at three places."""
    p = read("CYCL DEF 200 DRILLING Q200=2 Q201=-10 Q206=250 Q202=10 Q210=0 Q203=0 Q204=10 Q211=0\n"
             "L X+15 Y+10 R0 FMAX M3\nCALL LBL 1\nL X+45 Y+60 R0 FMAX\nCALL LBL 1\nL X+75 Y+10 R0 FMAX\nCALL LBL 1\n"
             "L Z+250 R0 FMAX M2\nLBL 1\nCYCL CALL\nL IX+20 R0 FMAX M99\nL IY+20 R0 FMAX M99\nL IX-20 R0 FMAX M99\nLBL "
             "0",
             "heidenhain")
    group = np.array([[0, 0], [20, 0], [20, 20], [0, 20]])
    wanted = np.vstack([group + s for s in ([15, 10], [45, 60], [75, 10])])
    assert np.allclose(bottoms(p)[:, :2], wanted) and (bottoms(p)[:, 2] == -10).all()


def test_a_datum_shift_with_rotations_of_heidenhain():
    """The same contour eight times, each turned by 45 deg more: IROT and a repeat of a part of the program."""
    p = read("CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X+65\nCYCL DEF 7.2 Y+65\nCALL LBL 1\nLBL 10\nCYCL DEF 10.0 "
             "ROTATION\n"
             "CYCL DEF 10.1 IROT+45\nCALL LBL 1\nCALL LBL 10 REP 6/6\nCYCL DEF 10.0 ROTATION\nCYCL DEF 10.1 ROT+0\n"
             "TRANS DATUM RESET\nL Z+250 R0 FMAX M2\nLBL 1\nL X+0 Y+0 R0 FMAX\nL X+30 Y+0 F500\nL IY+15\nLBL 0",
             "heidenhain")
    cuts = p.end[p.kind == 1][:, :2] - 65.0
    angle = np.radians(45 * np.arange(8))
    assert np.allclose(cuts[::2], 30 * np.column_stack([np.cos(angle), np.sin(angle)]), atol=1e-9)
    assert np.allclose(np.hypot(*cuts[1::2].T), math.hypot(30, 15)) and len(cuts) == 16


def test_a_helix_of_a_thread_of_heidenhain():
    """Turns of CP beyond 360 deg: pitch times turns."""
    p = read("L Z-10.5 F100\nL X+40 Y+30\nCC X+30 Y+30\nCP IPA-3240 IZ+13.5 DR- F200", "heidenhain")
    arc = p.line == 9
    way = np.unwrap(np.arctan2(p.end[arc, 1] - 30, p.end[arc, 0] - 30))
    assert way[-1] == pytest.approx(-9 * math.tau) and p.end[-1, 2] == pytest.approx(3.0)
    assert np.allclose(p.end[arc, 2] + 10.5, -way / math.tau * 1.5)


def _distance(point, contour):
    """Distance of a point from a polyline."""
    best = math.inf
    for a, b in zip(contour[:-1], contour[1:], strict=True):
        t = np.clip((point - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        best = min(best, float(np.linalg.norm(point - a - t * (b - a))))
    return best


def test_text_of_another_program_is_not_read_as_this_one():
    """The same words in quotes or comments start nothing."""
    p = read_program('G710 G17 G90 G94 G54\nT1 M6\nS1 M3 F9\nG0 X0 Y0 Z9 ; GOTOF END; L10\nMSG("IF R1==1 GOTOF X; '
                     'L99")\n'
                     "G1 X1\nM30\n", dialect="siemens")
    assert p.end[-1].tolist() == [1.0, 0.0, 9.0]
