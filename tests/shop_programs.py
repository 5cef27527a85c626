"""Programs as shops write them: for LinuxCNC, and for other controls with a twin in plain words of LinuxCNC.

Every twin makes the same moves by hand, without the words that its program is about. LinuxCNC's interpreter judges both
kinds. Tools are T1 to T99 of the judge, whose diameter is 6 mm.
"""

MAIN = "G21 G90 G17 G91.1\nF500\nT1 M6 G43 S900 M3\nG0 X0 Y0 Z5\n"
HEAD = "%\nO1000 (PART)\nG21 G90 G17\nG0 G40 G49 G80\nT1 M6\nS900 M3\nG54 G43 H1\nG0 X0. Y0. Z5.\nG1 F500.\n"
TWIN = "%\nG21 G90 G17\nT1 M6\nS900 M3\nG43 H1\nG0 X0 Y0 Z5\nG1 F500\n"

LINUXCNC = {
    "dwell and move in one block": "G4 P.5 G1 X5 Y2\nG4 P1 X9\nG4 P0.1 G0 Z9\nG4 P1 Y0\n",
    "compensated square": "G41 D1 G1 X10\nY20\nX-20\nY-20\nX10\nY0\nG40 X0\n",
    "compensated outside": "G42 D1 G1 X10\nY20\nX-20\nY-20\nX10\nY0\nG40 X0\n",
    "compensated island": "G41 D1\nG1 X-10 Y0\nG2 X10 I10\nG2 X-10 I-10\nG40 G1 X-20\n",
    "compensated bore": "G41 D1\nG1 X5 Y-2\nG3 X15 Y0 R10\nI-15\nG3 X5 Y10 R10\nG40 G1 X0 Y0\n",
    "compensated by diameter": "G42.1 D3\nG1 X10\nX20 Y5\nX30 Y-5\nG40 Y0\n",
    "compensated helix": "G41 D1 G1 X10 Y0\nG3 I-10 Z-4\nG3 I-10 Z-8 P2\nG40 G1 X0\n",
    "compensated in layers": "O1 repeat [3]\nG91 G1 Z-1\nG90 G41 D1 G1 X10 Y0\nG3 I-10\nG40 G1 X0\nO1 endrepeat\n",
    "compensated with heights": "G41 D1 G1 X10 Y0\nX30\nZ1\nY30\nG0 Z4\nX-5\nZ0\nG40 G1 Y0\n",
    "compensated in G18": "G18 G41 D1 G1 Z20 X0\nX30\nG3 Z0 X50 I20\nG40 G1 Z-20\nG17\n",
    "compensation in inches": "G20 G42.1 D0.1\nG1 X1 F20\nY1\nX0\nG40 Y0\nG21\n",
    "compensation and tables": "G10 L1 P1 R2.5\nG41 D1 G1 X20\nY20\nX0\nG40 Y0\n",
    "fanuc calls": "M98 P100 L3\nG1 X0\nM2\nO100\nG91 G1 X3\nX-1 Z-0.5\nG90\nM99\n",
    "fanuc calls in calls": "M98 P100 L2\nG1 X0\nM2\nO100\nG91 G1 X3\nM98 P200 L2\nG90\nM99\nO200\nG91\nG1 Y1\nM99\n",
    "called pockets": "O<pocket> sub\nG0 X#1 Y#2\nG1 Z-#3\nG3 I2\nG0 Z5\nO<pocket> endsub\nO<pocket> call [1] [2] [3]\n"
                      "O<pocket> call [11] [2] [4]\n",
    "calls in comments": "(as M98 P7)\nG1 X1 (then M99)\nX2 ; M98\nM98 P100 (M99)\nM2\nO100\nX3\nM99\n",
    "returned values": "O<twice> sub\nO<twice> endsub [#1*2]\nO<twice> call [4]\nG1 X#<_value>\n",
    "spiral by a loop": "#1=0\nO1 while [#1 LT 36]\nG1 X[#1*COS[#1*20]] Y[#1*SIN[#1*20]]\n#1=[#1+1]\nO1 endwhile\n",
    "nested loops": "O1 repeat [3]\nO2 repeat [2]\nG91 G1 X1 Y1\nO2 endrepeat\nX-1\nG90\nO1 endrepeat\n",
    "branches": "#<deep>=-3\nO1 if [#<deep> LT -2]\nG1 Z#<deep>\nO1 elseif [#<deep> LT 0]\nG1 Z1\nO1 else\nG1 Z2\n"
                "O1 endif\n",
    "drilled": "G98 G81 X5 Y5 Z-3 R2\nX10\nY10\nG80\n", "drilled low": "G99 G81 X5 Y5 Z-3 R2\nX10\nG98 Y10\nG80\n",
    "pecked": "G98 G83 X5 Y5 Z-9 R2 Q2\nX10\nG80\n", "chips broken": "G99 G73 X5 Y5 Z-9 R2 Q2.5\nX10\nG80\n",
    "tapped": "G98 G84 X5 Y5 Z-9 R2\nX10\nG80\n", "tapped low": "G99 G84 X5 Y5 Z-9 R2\nX10\nG80\n",
    "bored": "G98 G85 X5 Y5 Z-9 R2\nG86 X10 Z-9 R2 P0.5\nG89 X15 Z-9 R2 P1\nG80\n",
    "dwelling": "G98 G82 X5 Y5 Z-9 R2 P0.3\nG80\n",
    "rows of holes": "G99 G91 G81 X5 Y5 Z-3 R-2 L4\nG90 G80\n",
    "holes in G18": "G18 G98 G81 X5 Z5 Y-3 R2\nX9\nG80 G17\n",
    "another offset": "G10 L20 P2 X10 Y10\nG55 G1 X5 Y5\nG54 X5 Y5\n",
    "shifted": "G52 X10 Y5\nG1 X5 Y5\nG52 X0 Y0\nX5 Y5\n",
    "shifted by place": "G92 X100 Y100\nG1 X105 Y95\nG92.1\nX0 Y0\n",
    "polar": "G1 @10 ^30\n^60\n@20\nG91 @5 ^30\nG90\n",
    "full circles": "G2 I5\nG3 J-5 Z2\nG3 I4 P3 Z-1\n", "radii": "G2 X10 R8\nG3 X0 R-8\nG2 X5 Y5 R10\n",
    "absolute centres": "G90.1\nG2 X10 Y0 I5 J0\nG91.1\nG3 X0 I-5\n",
    "inverse time": "G93 G1 X10 F2\nY10 F4\nG94 F300\nX0\n",
    "feed by the turn": "G95 F0.2\nG1 X10\nG94 F200\nX0\n", "inches": "G20\nG1 X1 F10\nY0.5\nG21\nX0 Y0 F300\n",
    "saved modes": "M70\nG91 G20\nG1 X0.1 F5\nM72\nG1 X3 F300\n",
    "overrides and outputs": "M49\nM64 P1\nM67 E0 Q2\nG1 X5\nM48\nM65 P1\nM19 R30\nM3\nG1 Y5\n",
    "comments": "(one)\nG1 X1 (two) Y2 ; three\n; four\n\n  G1   X 3\tY 4\n",
    "lower case and blanks": "g1x1y2\n g 1 x 3 . 5\nn50g0z9\n", "numbers of lines": "N10 G1 X1\nN0020 G1 X2\nN5 X3\n",
    "loaded by M61": "M61 Q3\nG43\nG1 X5\n", "two tools": "T2\nG1 X5\nM6\nG43 H2\nM3 S500\nG0 X0 Y0 Z5\nG1 Z-1\n",
    "rounded": "G64 P0.005 Q0\nG1 X1 Y1\nX2 Y0\nG61\nX3\n", "home and back": "G53 G0 Z0\nG0 X5 Y5\nZ5\nG1 Z0\n",
}

PAIRS = {
    "fanuc call": ("fanuc", "M98 P2000 L2\nM30\nO2000\nG91 X3.\nY1.\nG90\nM99\n", "X3\nY1\nX6\nY2\n"),
    "fanuc count": ("fanuc", "M98 P0032000\nM30\nO2000\nG91 X3.\nG90\nM99\n", "X3\nX6\nX9\n"),
    "fanuc nested": ("fanuc", "M98 P1\nM30\nO1\nX1.\nM98 P2\nX3.\nM99\nO2\nX2. Y1.\nM99\n", "X1\nX2 Y1\nX3\n"),
    "fanuc label": ("fanuc", "GOTO 30\nX9.\nN30 X2.\nM30\n", "X2\n"),
    "fanuc loop": ("fanuc", "#1=1\nWHILE[#1LE4]DO1\nX[#1*2] Y[SQRT[#1]]\n#1=#1+1\nEND1\nM30\n",
                   "#1=1\nO1 while [#1 LE 4]\nX[#1*2] Y[SQRT[#1]]\n#1=[#1+1]\nO1 endwhile\n"),
    "fanuc loops in loops": ("fanuc", "#1=0\nWHILE[#1LT3]DO1\n#2=0\nWHILE[#2LT2]DO2\nX#1 Y#2\n#2=#2+1\nEND2\n"
                                      "#1=#1+1\nEND1\nM30\n", "Y1\nX1 Y0\nY1\nX2 Y0\nY1\n"),
    "fanuc jump": ("fanuc", "#100=3.\nN1 X#100\n#100=#100-1.\nIF[#100GT0]GOTO1\nM30\n", "X3\nX2\nX1\n"),
    "fanuc macro": ("fanuc", "G65 P9 X4. Y2. R3. K3.\nM30\nO9\n#30=0\nWHILE[#30LT#6]DO1\n"
                             "X[#24+#18*COS[#30*120]] Y[#25+#18*SIN[#30*120]]\n#30=#30+1\nEND1\nM99\n",
                    "X7 Y2\nX[4-1.5] Y[2+3*SIN[60]]\nX[4-1.5] Y[2-3*SIN[60]]\n"),
    "fanuc two values": ("fanuc", "#1=POW[2.,3.]\n#2=ATAN[1.,1.]\nX[#1+POW[4.,0.5]] Y[ATAN[1.]/[-1.]] Z[#2/9.]\nM30\n",
                         "X10 Y135 Z5\n"),
    "fanuc modes kept": ("fanuc", "#1=#4003\n#2=#4001\n#3=#4109\nG91\nG0 X3. Y#4120\nX1.\nG#1 G#2 F[#3/2.]\nX5.\nM30\n",
                         "G0 X3 Y1\nX4\nG1 F250 X5\n"),
    "fanuc helix": ("fanuc", "#5=0\nN1 #5=#5-0.5\nG3 I3. Z#5\nIF[#5GT-2.]GOTO1\nG1\nM30\n",
                    "G3 I3 Z-0.5\nI3 Z-1\nI3 Z-1.5\nI3 Z-2\nG1\n"),
    "fanuc cycle": ("fanuc", "G98 G81 X5. Y5. Z-3. R2.\nX9.\nG80\nG1 X0.\nM30\n",
                    "G98 G81 X5 Y5 Z-3 R2\nX9\nG80\nG1 X0\n"),
    "fanuc peck": ("fanuc", "G99 G83 X5. Y5. Z-9. R2. Q2500\nX9.\nG80\nM30\n", "G99 G83 X5 Y5 Z-9 R2 Q2.5\nX9\nG80\n"),
    "fanuc chips": ("fanuc", "G99 G73 X5. Y5. Z-9. R2. Q2.5\nG80\nM30\n", "G99 G73 X5 Y5 Z-9 R2 Q2.5\nG80\n"),
    "fanuc tap": ("fanuc", "M29 S500\nG99 G84 X5. Y5. Z-9. R2.\nX9.\nG80\nM30\n", "G99 G84 X5 Y5 Z-9 R2\nX9\nG80\n"),
    "fanuc left tap": ("fanuc", "G98 G74 X5. Y5. Z-9. R2.\nG80\nM30\n", "G0 X5 Y5\nZ2\nG1 Z-9\nZ2\nG0 Z5\n"),
    "fanuc bore": ("fanuc", "G98 G76 X5. Y5. Z-9. R2. Q0.2 P200\nG80\nM30\n", "G98 G86 X5 Y5 Z-9 R2 P0.2\nG80\n"),
    "fanuc ream": ("fanuc", "G98 G85 X5. Y5. Z-9. R2.\nX8.\nG80\nM30\n", "G98 G85 X5 Y5 Z-9 R2\nX8\nG80\n"),
    "fanuc row": ("fanuc", "G99 G81 X0. Y0. Z-3. R2. K0\nG91 X5. K3\nG90 G80\nM30\n",
                  "G99 G81 X5 Y0 Z-3 R2\nX10\nX15\nG80\n"),
    "fanuc row at once": ("fanuc", "G91 G99 G81 X5. Y0. Z-5. R-3. K3\nG90 G80\nM30\n",
                          "G99 G81 X5 Y0 Z-3 R2\nX10\nX15\nG80\n"),
    "fanuc after cycles": ("fanuc", "G98 G81 X5. Y5. Z-3. R2.\nG80\nX0. Y0.\nG0 Z9.\nG83 X1. Z-3. R2. Q2.\nG82 X2. "
                                    "P100\nG80 Z20.\nX4.\nM30\n",
                           "G98 G81 X5 Y5 Z-3 R2\nG80\nG1 X0 Y0\nG0 Z9\nG98 G83 X1 Z-3 R2 Q2\nG82 X2 Z-3 R2 P0.1\nG80\n"
                           "G0 Z20\nX4\n"),
    "fanuc rotation": ("fanuc", "G68 X10. Y0. R90.\nX20. Y0.\nX20. Y10.\nG3 X10. Y20. R10.\nG69\nG1 X0. Y0.\nM30\n",
                       "X10 Y10\nX0 Y10\nG3 X-10 Y0 R10\nG1 X0 Y0\n"),
    "fanuc rotated holes": ("fanuc", "G68 X0. Y0. R90.\nG98 G81 X5. Y0. Z-3. R2.\nX9.\nG80\nG69\nM30\n",
                            "G98 G81 X0 Y5 Z-3 R2\nY9\nG80\n"),
    "fanuc mirror": ("fanuc", "G51.1 X0.\nX5. Y3.\nG2 X10. Y8. R5.\nG1\nG50.1 X0.\nX0. Y0.\nM30\n",
                     "X-5 Y3\nG3 X-10 Y8 R5\nG1 X0 Y0\n"),
    "fanuc scale": ("fanuc", "G51 X0. Y0. Z0. P0.5\nX10. Y4. Z2.\nG2 X14. R4.\nG1\nG50\nX0. Y0.\nM30\n",
                    "X5 Y2 Z1\nG2 X7 R2\nG1 X0 Y0\n"),
    "fanuc shift": ("fanuc", "G52 X10. Y5.\nX5. Y5.\nG52 X0. Y0.\nX5. Y5.\nM30\n", "X15 Y10\nX5 Y5\n"),
    "fanuc polar": ("fanuc", "G16\nX10. Y30.\nX10. Y60.\nG15\nX0. Y0.\nM30\n", "@10 ^30\n@10 ^60\nX0 Y0\n"),
    "fanuc inside": ("fanuc", "G41 D1 X10.\nY20.\nX-20.\nY-20.\nX10.\nY0.\nG40 X0.\nM30\n",
                     "X7 Y0\nY17\nX-17\nY-17\nX7\nY0\nX0\n"),
    "fanuc outside": ("fanuc", "G42 D1 X10.\nY20.\nX-20.\nY-20.\nX10.\nY0.\nG40 X0.\nM30\n",
                      "X13 Y0\nY23\nX-23\nY-23\nX13\nY0\nX0\n"),
    "fanuc register": ("fanuc", "G10 L12 P5 R2.\nG41 D5 X10.\nY20.\nX-20.\nG40 Y0.\nM30\n",
                       "X8 Y0\nY18\nX-20\nY0\n"),
    "fanuc circle": ("fanuc", "G41 D1 X10. Y0.\nG3 I-10.\nG40 G1 X0.\nM30\n", "X7 Y0\nG3 I-7\nG1 X0\n"),
    "fanuc second offset": ("fanuc", "G55\nX1. Y1.\nG54\nX1.\nM30\n", "X31 Y1\nX1\n"),
    "fanuc wear": ("fanuc", "G10 L11 P1 R0.25\nG43 H1\nZ1.\nM30\n", "Z1.25\n"),
    "fanuc ends": ("fanuc", "X1.\nM98 P7\nM99\nO7\nX2.\nM99\n", "X1\nX2\n"),
    "haas after a cycle": ("haas", "G0 Z9.\nG99 G84 X5. Y5. Z-3. R2. J2\nG80\nZ20.\nX0.\nM30\n",
                           "G0 Z9\nG99 G84 X5 Y5 Z-3 R2\nG80\nG0 Z20\nX0\n"),
    "haas without a look ahead": ("haas", "G103 P1\n#100=3.\nX#100\nG103\nY1.\nM30\n", "X3\nY1\n"),
    "haas local": ("haas", "M97 P100 L2\nM30\nN100 G91 X1. Y2.\nG90\nM99\n", "X1 Y2\nX2 Y4\n"),
    "haas peck": ("haas", "G98 G83 X5. Y5. Z-9. R2. Q2.5\nX9. L1\nG80\nM30\n", "G98 G83 X5 Y5 Z-9 R2 Q2.5\nX9\nG80\n"),
    "haas first": ("haas", "G99 G81 X5. Z-9. R2. L0\nX9.\nX12.\nG80\nM30\n", "G99 G81 X9 Z-9 R2\nX12\nG80\n"),
    "haas mirror": ("haas", "G101 X0.\nX5. Y3.\nG100 X0.\nX0. Y0.\nM30\n", "X-5 Y3\nX0 Y0\n"),
    "haas rotation": ("haas", "G68 X0. Y0. R30.\nX10. Y0.\nG69\nX0. Y0.\nM30\n", "@10 ^30\nX0 Y0\n"),
    "haas macro": ("haas", "#100=2.\nIF[#100EQ2.]THEN#101=[#100*3]\nX#101 Y-#100\nM30\n", "X6 Y-2\n"),
    "haas smooth": ("haas", "G187 P3\nX5.\nG187\nM88\nY5.\nM89\nM30\n", "X5\nY5\n"),
    "haas outside": ("haas", "G42 D1 X10.\nY20.\nX-20.\nG40 Y0.\nM30\n", "X13 Y0\nY23\nX-20\nY0\n"),
    "haas call": ("haas", "M98 P02000 L2\nM30\nO02000\nG91 X3.\nG90\nM99\n", "X3\nX6\n"),
}
BESIDE = "G10 L2 P1 X-100. Y0. Z0.\nG10 L2 P2 X-70. Y0. Z0.\n"
"""Put before the pair of the second offset, which lies 30 mm from the first one."""


def pair(name):
    """Dialect, program and twin of a pair."""
    dialect, text, twin = PAIRS[name]
    head = HEAD.replace("G0 G40", BESIDE + "G0 G40") if "offset" in name else HEAD
    return dialect, head + text + "%\n", TWIN + twin + "M2\n%\n"


def linuxcnc(name):
    """A program for LinuxCNC."""
    return MAIN + LINUXCNC[name] + ("" if "M2" in LINUXCNC[name] else "M2\n")
