"""Programs whose paths are drawn by hand: words of five axes, and tasks of the kind that manuals work through.

The places follow from the meaning that the manual gives each word, by rotation matrices and elementary geometry; no
code of the reader takes part.
"""

import math
from dataclasses import dataclass

import numpy as np

from tests.drawn_paths import arc, feed, lines, rapid

FANUC = "%\nO1\nG21 G90 G17\nG0 G40 G49 G80\nT1 M6\nS900 M3\nG54 G43 H1\nG0 X0. Y0. Z50.\nG1 F500.\n"
TILTED = "%\nO1\nG21 G90 G17\nG0 G40 G49 G80\nT1 M6\nS900 M3\nG54 {on}\nG0 X0. Y0. Z50. A0. C0.\n"
SIEMENS = "G710 G17 G90 G94 G54\nT1 M6\nD1\nS900 M3 F500\n"
HEIDENHAIN = "BEGIN PGM A MM\nTOOL CALL 1 Z S900 F500\nM3\n"
ENDS = {"fanuc": "M30\n%\n", "haas": "M30\n%\n", "siemens": "M30\n", "heidenhain": "END PGM A MM\n",
        "linuxcnc": "M2\n"}


@dataclass(frozen=True)
class Drawn:
    """A program with its path; the kind of kinematics, None for three axes."""

    dialect: str
    text: str
    path: list
    kinematics: str | None = None


def _x(deg):
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def _y(deg):
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _z(deg):
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def _on(plane, shift, places):
    """Places of a tilted plane in the setup frame."""
    return [tuple(plane @ np.array(p, dtype=float) + np.array(shift, dtype=float)) for p in places]


def _plane(plane, shift=(0, 0, 0)):
    """The path that every tilted program here has: a rapid to (10, 20, 30), feeds down, along and across."""
    first, down, along, across = _on(plane, shift, [(10, 20, 30), (10, 20, -2), (25, 20, -2), (25, 35, -2)])
    axis = tuple(plane[:, 2])
    return [rapid(*first, axis=axis), feed(*down, axis=axis), feed(*along, axis=axis), feed(*across, axis=axis)]


def _table_ac(a, c):
    """Tool axis of a table that turns by A about X and on it by C about Z: the part turns, so the axis turns back."""
    return tuple(_z(-c) @ _x(-a) @ np.array([0.0, 0.0, 1.0]))


def _head_bc(b, c):
    return tuple(_z(c) @ _y(b) @ np.array([0.0, 0.0, 1.0]))


UP = (0.0, 0.0, 1.0)
LEAN = (0.3, -0.4, 0.87)
VECTOR = [rapid(0, 0, 9, axis=UP), feed(20, 10, 5, axis=LEAN), feed(0, 10, 5, axis=(0, 1, 1))]
S_PLANE = "G0 X10 Y20\nZ30\nG1 Z-2\nX25\nY35\n"
H_PLANE = "L X+10 Y+20 FMAX\nL Z+30 FMAX\nL Z-2 F500\nL X+25\nL Y+35\n"
F_PLANE = "G0 X10. Y20.\nZ30.\nG1 Z-2. F500.\nX25.\nY35.\n"
FIVE = {
    "vectors with ORIWKS": Drawn("siemens", SIEMENS + "G0 Z50\nTRAORI\nG54\nORIWKS\nG0 X0 Y0 Z9\nG1 X20 Y10 Z5 A3=0.3 "
                                 "B3=-0.4 C3=0.87\nX0 A3=0 B3=1 C3=1\n", VECTOR, "table-table-AC"),
    "vectors with ORIMKS": Drawn("siemens", SIEMENS + "G0 Z50\nTRAORI\nG54\nORIMKS\nG0 X0 Y0 Z9\nG1 X20 Y10 Z5 A3=0.3 "
                                 "B3=-0.4 C3=0.87\nX0 A3=0 B3=1 C3=1\n", VECTOR, "head-head-BC"),
    "angles with TRAORI": Drawn("siemens", SIEMENS + "G0 Z50\nTRAORI\nG54\nG0 X0 Y0 Z9 A0 C0\nG1 X20 A20 C40\n",
                                [rapid(0, 0, 9), feed(20, 0, 9, axis=_table_ac(20, 40))], "table-table-AC"),
    "swivel": Drawn("siemens", SIEMENS + 'CYCLE800(1,"TC1",200000,57,5,6,7,20,30,0,0,0,0,-1,0,1)\n' + S_PLANE,
                    _plane(_x(20) @ _y(30), (5, 6, 7)), "table-table-AC"),
    "swivel with a head": Drawn("siemens", SIEMENS + 'CYCLE800(1,"TC1",200000,57,5,6,7,0,30,40,0,0,0,-1,0,1)\n'
                                + S_PLANE, _plane(_y(30) @ _z(40), (5, 6, 7)), "head-head-BC"),
    "vectors with G43.5": Drawn("fanuc", TILTED.format(on="G43.5 H1") + "G1 X20. Y10. Z5. I0.3 J-0.4 K0.87 F500.\n"
                                "X0. I0. J1. K1.\n", [rapid(0, 0, 50), *VECTOR[1:]], "table-table-AC"),
    "angles with G43.4": Drawn("fanuc", TILTED.format(on="G43.4 H1") + "G1 X20. Y10. Z5. A-25. C50. F500.\n",
                               [rapid(0, 0, 50), feed(20, 10, 5, axis=_table_ac(-25, 50))], "table-table-AC"),
    "plane of G68.2 and G53.1": Drawn("fanuc", TILTED.format(on="") + "G68.2 X5. Y6. Z7. I30. J20. K-10.\nG53.1\n"
                                      "G43 H1\n" + F_PLANE, _plane(_z(30) @ _x(20) @ _z(-10), (5, 6, 7)),
                                      "table-table-AC"),
    "angles with G234": Drawn("haas", TILTED.format(on="G234 H1").replace("A0.", "B0.") + "G1 X20. Y10. Z5. B30. C-15. "
                              "F500.\n", [rapid(0, 0, 50), feed(20, 10, 5, axis=tuple(_z(15) @ _y(-30) @ UP))],
                              "table-table-BC"),
    "M128 with a feed": Drawn("heidenhain", HEIDENHAIN + "L A+0 C+0 F500\nM128 F1000\nL X+0 Y+0 Z+9 FMAX\nL X+20 Y+10 "
                              "Z+5 A+20 C-30 F300\n", [rapid(0, 0, 9), feed(20, 10, 5, axis=_table_ac(20, -30))],
                              "table-table-AC"),
    "TCPM by positions": Drawn("heidenhain", HEIDENHAIN + "L B+0 C+0 F500\nFUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS\n"
                               "L X+0 Y+0 Z+9 FMAX\nL X+20 Y+10 Z+5 B+20 C+35 F300\n",
                               [rapid(0, 0, 9), feed(20, 10, 5, axis=_head_bc(20, 35))], "head-head-BC"),
    "TCPM by spatial angles": Drawn("heidenhain", HEIDENHAIN + "FUNCTION TCPM F TCP AXIS SPAT PATHCTRL VECTOR\n"
                                    "L X+0 Y+0 Z+9 FMAX\nL X+20 Y+10 Z+5 A+20 B+30 C+40 F300\n",
                                    [rapid(0, 0, 9), feed(20, 10, 5, axis=tuple((_z(40) @ _y(30) @ _x(20))[:, 2]))],
                                    "table-table-AC"),
    "vectors of LN": Drawn("heidenhain", HEIDENHAIN + "M128\nLN X+0 Y+0 Z+9 TX+0 TY+0 TZ+1 FMAX\nLN X+20 Y+10 Z+5 NX+0 "
                           "NY+0 NZ+1 TX+0.3 TY-0.4 TZ+0.87 F300\nLN X+0 Y+10 Z+5 NX+0 NY+0 NZ+1 TX+0 TY+1 TZ+1\n",
                           VECTOR, "table-table-BC"),
    "PLANE SPATIAL": Drawn("heidenhain", HEIDENHAIN + "TRANS DATUM AXIS X+5 Y+6\nPLANE SPATIAL SPA+20 SPB+30 SPC+40 "
                           "TURN MB MAX FMAX\n" + H_PLANE, _plane(_z(40) @ _y(30) @ _x(20), (5, 6, 0)),
                           "table-table-AC"),
    "PLANE EULER": Drawn("heidenhain", HEIDENHAIN + "L Z+0 FMAX M91\nPLANE EULER EULPR+30 EULNU+20 EULROT+50 TURN "
                         "FMAX\n" + H_PLANE, _plane(_z(30) @ _x(20) @ _z(50)), "table-table-BC"),
    "PLANE VECTOR": Drawn("heidenhain", HEIDENHAIN + "L Z+0 FMAX M91\nPLANE VECTOR BX+1 BY+0 BZ+0 NX+0 NY-0.6 NZ+0.8 "
                          "TURN FMAX\n" + H_PLANE, _plane(np.array([[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])),
                          "table-table-AC"),
    "PLANE RELATIV": Drawn("heidenhain", HEIDENHAIN + "L Z+0 FMAX M91\nPLANE SPATIAL SPA+0 SPB+20 SPC+0 STAY\n"
                           "PLANE RELATIV SPB+15 TURN FMAX\n" + H_PLANE, _plane(_y(35)), "head-head-BC"),
}

_H = math.sqrt(0.5)
_T = np.radians(9.0 * np.arange(41))
_ELLIPSE = (np.array([50.0, 40.0, 0.0]) + np.column_stack([50 * np.cos(_T), 30 * np.sin(_T), np.zeros(41)])
            @ _z(30).T)
THREE = {
    "helix of several turns": Drawn("siemens", SIEMENS + "G0 X10 Y0 Z0\nG3 X0 Y10 Z-9 I-10 J0 TURN=2\n",
                                    [rapid(10, 0, 0), arc((0, 0), 810, 0, 10, -9)]),
    "thread by CP": Drawn("heidenhain", HEIDENHAIN + "L X+40 Y+30 Z-10.5 FMAX\nCC X+30 Y+30\nCP IPA-3240 IZ+13.5 DR-\n",
                          [rapid(40, 30, -10.5), arc((30, 30), -3240, 40, 30, 3.0)]),
    "parts shifted three times": Drawn(
        "siemens", SIEMENS + "G0 X0 Y0 Z-5\nTRANS X10 Y10\nL10\nTRANS X50 Y10\nL10\nTRANS X10 Y50\nL10\nTRANS\nM30\n"
        "PROC L10\nG1 X0 Y0\nX20\nY20\nX0\nY0\nRET\n",
        [rapid(0, 0, -5), *lines(*((x + u, y + v, -5) for x, y in ((10, 10), (50, 10), (10, 50))
                                   for u, v in ((0, 0), (20, 0), (20, 20), (0, 20), (0, 0))))]),
    "parts shifted and turned": Drawn(
        "siemens", SIEMENS + "G0 X0 Y0 Z-5\nTRANS X20 Y10\nL10\nTRANS X55 Y35\nAROT RPL=45\nL10\nTRANS X20 Y40\nAROT "
        "RPL=60\nL10\nM30\nPROC L10\nG1 X10 Y0\nX10 Y5\nRET\n",
        [rapid(0, 0, -5), *(feed(*p) for x, y, a in ((20, 10, 0), (55, 35, 45), (20, 40, 60))
                            for p in _on(_z(a), (x, y, -5), [(10, 0, 0), (10, 5, 0)]))]),
    "mirrored and scaled part": Drawn(
        "siemens", SIEMENS + "G0 X0 Y0 Z-5\nMIRROR X0\nASCALE X0.5 Y0.5\nG1 X20 Y10\nG2 X40 Y10 I10 J0\nSCALE\nMIRROR\n"
        "G1 X0 Y0\n", [rapid(0, 0, -5), feed(-10, 5, -5), arc((-15, 5), 180, -20, 5, -5), feed(0, 0, -5)]),
    "places by AC and IC": Drawn(
        "siemens", SIEMENS + "G0 X0 Y0 Z0\nG91 G1 X10 Y=AC(5)\nX=IC(5) Y2\nG90 X=IC(-3) Y1\nG2 X20 Y9 I=AC(20) "
        "J=AC(1)\n",
        [rapid(0, 0, 0), *lines((10, 5, 0), (15, 7, 0), (12, 1, 0)), arc((20, 1), -90, 20, 9, 0)]),
    "fixed cycles in a row": Drawn(
        "fanuc", FANUC + "G99 G81 X10. Y10. Z-5. R2.\nG91 X10. K3\nG90 G80\n",
        [rapid(0, 0, 50), rapid(10, 10, 50), rapid(10, 10, 2), *(p for x in (10, 20, 30, 40) for p in (
            [rapid(x, 10, 2)] if x > 10 else []) + [feed(x, 10, -5), rapid(x, 10, 2)])]),
    "a macro for a circle of holes": Drawn(
        "fanuc", FANUC + "G65 P9100 X20. Y10. R10. A0. B60. H6.\nM30\nO9100\n#30=0\nWHILE[#30LT#11]DO1\n"
        "G1 X[#24+#18*COS[#1+#30*#2]] Y[#25+#18*SIN[#1+#30*#2]]\n#30=#30+1\nEND1\nM99\n",
        [rapid(0, 0, 50), *lines(*((20 + 10 * math.cos(math.radians(60 * k)), 10 + 10 * math.sin(math.radians(60 * k)),
                                    50) for k in range(6)))]),
    "a square outside with its corners": Drawn(
        "haas", FANUC.replace("Z50.", "Z-2.") + "G41 D1 X-20. Y-20.\nY20.\nX20.\nY-20.\nX-30.\nG40 X-40. Y-40.\n",
        [rapid(0, 0, -2), *lines((-25, -20, -2), (-25, 25, -2), (25, 25, -2), (25, -25, -2), (-30, -25, -2),
                                 (-40, -40, -2))]),
    "a circle by G41 and G3": Drawn(
        "fanuc", FANUC.replace("Z50.", "Z-2.") + "G41 D1 X20. Y0.\nG3 X20. Y0. I-20.\nG40 G1 X0. Y0.\n",
        [rapid(0, 0, -2), feed(15, 0, -2), arc((0, 0), 360, 15, 0, -2), feed(0, 0, -2)]),
    "a datum by G10": Drawn(
        "fanuc", "%\nO1\nG21 G90 G17\nG10 L2 P1 X-100. Y-50. Z-200.\nG10 L2 P2 X-70. Y-50. Z-190.\nT1 M6\nS900 M3\n"
        "G54 G43 H1\nG0 X0. Y0. Z50.\nG55\nG1 X5. Y5. Z0. F500.\n", [rapid(0, 0, 50), feed(35, 5, 10)]),
    "a chamfer, right of the contour": Drawn(
        "heidenhain", HEIDENHAIN + "L X-20 Y-20 Z-5 FMAX\nL X+5 Y+5 RR F300\nL X+95\nCHF 10\nL Y+95\nL X-20 R0\n",
        [rapid(-20, -20, -5), feed(5, 0, -5), feed(85, 0, -5), arc((85, 5), 45, 85 + 5 * _H, 5 - 5 * _H, -5),
         feed(95 + 5 * _H, 15 - 5 * _H, -5), arc((95, 15), 45, 100, 15, -5), feed(100, 95, -5), feed(-20, 95, -5)]),
    "an ellipse by Q parameters": Drawn(
        "heidenhain", HEIDENHAIN + "L X+50 Y+40 Z+0 FMAX\nCYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X+50\nCYCL DEF 7.2 "
        "Y+40\nCYCL DEF 10.0 ROTATION\nCYCL DEF 10.1 ROT+30\nFN 0: Q36 = +0\nFN 0: Q37 = +0\nLBL 1\n"
        "Q21 = 50 * COS Q36\nQ22 = 30 * SIN Q36\nL X+Q21 Y+Q22 F350\nFN 1: Q36 = +Q36 + +9\nFN 1: Q37 = +Q37 + +1\n"
        "FN 12: IF +Q37 LT +41 GOTO LBL 1\n", [rapid(50, 40, 0), *lines(*map(tuple, _ELLIPSE))]),
    "calls of a group of holes": Drawn(
        "heidenhain", HEIDENHAIN + "CYCL DEF 240 CENTERING Q200=2 Q343=0 Q201=-2 Q206=50 Q211=0 Q203=0 Q204=5\n"
        "L X+15 Y+10 Z+5 FMAX\nCALL LBL 1\nL X+45 Y+60 FMAX\nCALL LBL 1\nM30\nLBL 1\nCYCL CALL\nL IX+20 FMAX M99\n"
        "LBL 0\n", [rapid(15, 10, 5), *(p for n, (x, y) in enumerate(((15, 10), (35, 10), (45, 60), (65, 60)))
                                        for p in ([rapid(x, y, 5)] if n else []) + [rapid(x, y, 2), feed(x, y, -2),
                                                                                    rapid(x, y, 5)])]),
    "a bolt circle by LinuxCNC": Drawn(
        "linuxcnc", "G21 G90 G17 G94\nT1 M6 G43\nS900 M3 F200\nG0 X0 Y0 Z5\nO1 sub\nO2 repeat [#4]\nG1 "
        "X[#1+#3*COS[#5]] Y[#2+#3*SIN[#5]]\n#5=[#5+90]\nO2 endrepeat\nO1 endsub\nO1 call [10] [20] [8] [4] [45]\n",
        [rapid(0, 0, 5), *lines(*((10 + 8 * math.cos(math.radians(45 + 90 * k)),
                                   20 + 8 * math.sin(math.radians(45 + 90 * k)), 5) for k in range(4)))]),
}
PROGRAMS = FIVE | THREE


def text_of(program):
    """The whole text, with the end of its control."""
    return program.text + ENDS[program.dialect]
