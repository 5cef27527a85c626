"""Programs with words of Heidenhain controls, each with the same moves in plain G0, G1, G2 and G3."""

import math

R = math.sqrt(0.5)
PAIRS = {
    # words
    "any order": ("L Y+5 X+10 F100 R0 M8\nL M9 FMAX Z+20\nL F300\nL IX+5 IY-1",
                  "G1 X10 Y5 F100 M8\nG0 Z20 M9\nG1 X15 Y4 F300"),
    "comments": ("; text\n* - part one\n12 L X+1 ; to the wall\nBLK FORM 0.1 Z X+0 Y+0 Z-9\nTOOL DEF 3\nSTOP",
                 "G1 X1\nM0"),
    "blanks of all kinds": ("BLK FORM 0.1 Z X-20 Y-20 Z-18\nBLK FORM 0.2 X+40 Y+35 Z+0\nBLK FORM CYLINDER Z R50 L100\n"
                            "BLK FORM ROTATION Z DIM_R LBL 1\nL X+1", "G1 X1"),
    "no tilt": ("M129\nFUNCTION RESET TCPM\nCYCL DEF 19.0 WORKING PLANE\nCYCL DEF 19.1 A+0 B+0 C+0 F9999 ABST50\n"
                "CYCL DEF 19.0 WORKING PLANE\nCYCL DEF 19.1\nL X+5 M129", "G1 X5"),
    "commas": ("L X+10,5 Y-3,25 F100", "G1 X10.5 Y-3.25 F100"),
    # arcs
    "round a centre": ("L X+10 Y+0\nCC X+15 Y+0\nC X+15 Y+5 DR-\nC IX+5 IY-5 DR- F99", "G1 X10 Y0\nG2 X15 Y5 I5 J0\n"
                                                                                        "G2 X20 Y0 I0 J-5 F99"),
    "centre from here": ("L X+10 Y+0\nCC IX+5 IY+0\nC X+15 Y+5 DR-\nL X+30\nCC\nL X+35 Y+5\nC X+30 Y+10 DR+",
                         "G1 X10 Y0\nG2 X15 Y5 I5 J0\nG1 X30\nX35\nG3 X30 Y10 I-5 J0"),
    "by a radius": ("CR X+10 Y+10 R+10 DR+\nCR X+0 Y+0 R-10 DR+\nCR X+10 Y+10 R+10 DR-\nCR X+20 Y+0 R-10 DR-",
                    "G3 X10 Y10 I0 J10\nG3 X0 Y0 I-10 J0\nG2 X10 Y10 I10 J0\nG2 X20 Y0 I10 J0"),
    "tangent": ("L X+10 Y+0\nCT X+20 Y+10\nL Y+20\nCT X+10 Y+30",
                "G1 X10 Y0\nG3 X20 Y10 I0 J10\nG1 Y20\nG3 X10 Y30 I-10 J0"),
    "polar": ("CC X+30 Y+20\nLP PR+10 PA+30\nLP IPA+60\nLP IPR-5\nCP PA+0 DR-\nCTP PR+5 PA-90",
              f"G1 X{30 + 10 * math.cos(math.pi / 6):.9f} Y25\nX30 Y30\nY25\nG2 X35 Y20 I0 J-5\nG2 X30 Y15 I-5 J0"),
    "half a turn": ("L X+10 Y+0 Z+0\nCC X+0 Y+0\nCP IPA+180 IZ-3 DR+", "G1 X10 Y0 Z0\nG3 X-10 Y0 Z-3 I-10 J0"),
    # corners
    "chamfer": ("L X+20 Y+0\nCHF 5\nL Y+20", "G1 X15 Y0\nX20 Y5\nY20"),
    "chamfer with a feed": ("L X+20 Y+0 F300\nCHF 5 F50\nL Y+20\nL X+0", "G1 X15 Y0 F300\nX20 Y5 F50\nY20 F300\nX0"),
    "rounding": ("L X+20 Y+0\nRND R5\nL Y+20\nRND R5 F20\nL X+40",
                 "G1 X15 Y0\nG3 X20 Y5 I0 J5\nG1 Y15\nG2 X25 Y20 I5 J0 F20\n"
                                                                    "G1 X40 F200"),
    "rounding of a tangent": ("L X+10 Y+0\nRND R2\nL X+20", "G1 X10 Y0\nX20"),
    # compensation
    "left of the path": ("L X+20 Y+0 RL\nL X+20 Y+30\nL X-20\nL X-30 Y+50 R0", "G1 X15 Y0\nY25\nX-20\nX-30 Y50"),
    "right, wider": ("TOOL CALL 1 Z S1000 F200 DR-1\nM3\nL Z+50 FMAX\nL X+20 Y+0 RR\nL Y+30\nL X+60\nL Y+50 R0 F200",
                     "M6\nM3\nG0 Z50\nG1 X24 Y0\nY26\nX60\nY50"),
    # approaches
    "approach along the contour": ("L X+40 Y+10 Z+5 FMAX\nAPPR LT X+20 Y+20 Z-10 LEN15 R0 F100\nL X+10 Y+30",
                                   f"G0 X40 Y10 Z5\nX{20 + 15 * R:.9f} Y{20 - 15 * R:.9f}\nZ-10\nG1 X20 Y20 F100\nX10 "
                                   f"Y30"),
    "approach by an arc": ("L X+40 Y-20 Z+0 FMAX\nAPPR CT X+20 Y+0 CCA180 R+10 R0 F100\nL X+20 Y+30\nDEP CT CCA90 R+10",
                           "G0 X40 Y-20 Z0\nX0 Y0\nG3 X20 Y0 I10 J0 F100\nG1 Y30\nG3 X10 Y40 I-10 J0"),
    "departure along the contour": ("L X+40 Y+0\nDEP LT LEN12.5 F50", "G1 X40 Y0\nX52.5 F50"),
    "compensated approach": ("L X+0 Y-40 FMAX\nAPPR LT X+20 Y+0 LEN15 RL F100\nL X+20 Y+30\nL X-20\nDEP LN LEN+10 F300",
                             "G0 X0 Y-40\nX15 Y-15\nG1 X15 Y0 F100\nY25\nX-20\nX-20 Y15 F300"),
    "approach across the contour": ("L X+0 Y-40 FMAX\nAPPR LN X+20 Y+0 LEN15 RL F100\nL X+20 Y+30\nDEP LT LEN10",
                                    "G0 X0 Y-40\nX0 Y0\nG1 X15 Y0 F100\nY30\nY40"),
    # parameters
    "assignments": ("FN 0: Q1 = +10\nFN 1: Q2 = +Q1 + -3\nFN 2: Q3 = +Q1 - +Q2\nFN 3: Q4 = +Q3 * +2\nFN 4: Q5 = +Q1 "
                    "DIV +4\n"
                    "L X+Q1 Y-Q2 Z+Q5\nL IX-Q3 FQ4", "G1 X10 Y-7 Z2.5\nX7 F6"),
    "formulas": ("Q1 = 3 + 2 * SIN 30 - -1\nQL2 = SQRT ( Q1 * Q1 - 9 )\nQR3 = ( 2 ^ 3 ) / 4 + ABS -1\nL X+Q1 Y+QL2 "
                 "Z+QR3",
                 "G1 X5 Y4 Z3"),
    "roots and angles": ("FN 5: Q1 = SQRT +16\nFN 6: Q2 = SIN +30\nFN 7: Q3 = COS +60\nFN 8: Q4 = +3 LEN +4\n"
                         "FN 13: Q5 = +5 ANG -5\nL X+Q1 Y+Q2 Z+Q4\nL X+Q3 Y+Q5", "G1 X4 Y0.5 Z5\nX0.5 Y135"),
    # flow
    "subprogram": ("FN 0: Q1 = +1\nCALL LBL 5\nCALL LBL \"way\"\nL X+9\nM30\nLBL 5\nL X+Q1\nCALL LBL \"way\"\nLBL 0\n"
                   "LBL \"way\"\nL IY+2\nLBL 0", "G1 X1\nY2\nY4\nX9"),
    "repeats": ("LBL 1\nL IX+2\nLBL 2\nL IY+1\nCALL LBL 2 REP 2\nCALL LBL 1 REP 1/1",
                "G1 X2\nY1\nY2\nY3\nX4\nY4\nY5\nY6"),
    "jumps": ("FN 0: Q1 = +0\nLBL 1\nQ1 = Q1 + 1\nL X+Q1\nFN 12: IF +Q1 LT +3 GOTO LBL 1\nFN 9: IF +Q1 EQU +3 GOTO LBL "
              "\"END\"\n"
              "L X+99\nLBL \"END\"\nL Y+1", "G1 X1\nX2\nX3\nY1"),
    # coordinates
    "datum shift": ("CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X+20\nCYCL DEF 7.2 IY+5\nL X+1 Y+1\nTRANS DATUM AXIS "
                    "X-1\nL X+0\n"
                    "TRANS DATUM RESET\nL X+0 Y+0", "G1 X21 Y6\nX-1\nX0 Y0"),
    "rotation": ("CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X+30\nCYCL DEF 10.0 ROTATION\nCYCL DEF 10.1 ROT+90\nL X+10 "
                 "Y+0\n"
                 "CC X+0 Y+0\nC X+0 Y+10 DR+\nCYCL DEF 10.0 ROTATION\nCYCL DEF 10.1 ROT+0\nL X+0 Y+0",
                 "G1 X30 Y10\nG3 X20 Y0 I0 J-10\nG1 X30"),
    "mirror": ("CYCL DEF 8.0 MIRROR IMAGE\nCYCL DEF 8.1 X\nL X+10 Y+5\nCC X+15 Y+5\nC X+20 Y+5 DR-\nCYCL DEF 8.0\nCYCL "
               "DEF 8.1\n"
               "L X+0", "G1 X-10 Y5\nG3 X-20 Y5 I-5 J0\nG1 X0"),
    "scale": ("CYCL DEF 11.0 SCALING\nCYCL DEF 11.1 SCL 2\nL X+10 Y+5 Z+10", "G1 X20 Y10 Z20"),
    "a selected preset ends a shift": ("TRANS DATUM AXIS X+5\nPRESET SELECT #1\nL X+1", "G1 X1"),
    "preset ends a shift": ("TRANS DATUM AXIS X+5\nCYCL DEF 247 DATUM SETTING ~\n  Q339=+1 ;NUMBER\nL X+1", "G1 X1"),
    "longer tool": ("TOOL CALL 1 Z S1000 F200 DL+0.5\nM3\nL X+0 Y+0 Z+50 FMAX\nL Z+0\nTOOL CALL 1 Z DL+0\nM3\nL Z+5 "
                    "FMAX",
                    "M6\nM3\nG0 X0 Y0 Z50.5\nG1 Z0.5\nM6\nM3\nG0 Z5"),
    # cycles
    "drill": ("CYCL DEF 200 DRILLING ~\n Q200=+2 ;SET-UP CLEARANCE ~\n Q201=-10 ;DEPTH ~\n Q206=+150 ~\n Q202=+4 ~\n "
              "Q210=+0 ~\n"
              " Q203=+0 ~\n Q204=+20 ~\n Q211=+0.5\nL X+5 Y+5 FMAX M99\nL X+9",
              "G0 X5 Y5\nZ2\nG1 Z-4 F150\nG0 Z2\nZ-3.8\nG1 Z-8\nG0 Z2\nZ-7.8\nG1 Z-10\nG4 F0.5\nG0 Z20\nG1 X9 F200"),
    "ream": ("CYCL DEF 201 REIBEN Q200=2 Q201=-5 Q206=100 Q211=0 Q208=300 Q203=+1 Q204=10\nCYCL CALL M8\nL X+5 Y+5 "
             "FMAX\n"
             "CYCL CALL", "G0 Z3\nG1 Z-4 F100\nZ3 F300\nG0 Z11\nX5 Y5\nZ3\nG1 Z-4 F100\nZ3 F300\nG0 Z11"),
    "modal call": ("CYCL DEF 240 CENTERING Q200=2 Q343=0 Q201=-2 Q344=0 Q206=50 Q211=0 Q203=0 Q204=5\nL X+1 Y+1 FMAX "
                   "M89\n"
                   "L X+2 FMAX M99\nL X+3", "G0 X1 Y1\nZ2\nG1 Z-2 F50\nG0 Z5\nX2\nZ2\nG1 Z-2\nG0 Z5\nG1 X3 F200"),
    "call at a place": ("CYCL DEF 240 CENTERING Q200=2 Q343=0 Q201=-2 Q206=50 Q211=0 Q203=0 Q204=5\n"
                        "CYCL CALL POS X+4 Y+3 Z+1 FMAX", "G0 X4 Y3\nZ3\nG1 Z-1 F50\nG0 Z6"),
    "rigid tap": ("CYCL DEF 207 TAP Q200=2 Q201=-8 Q239=+1.5 Q203=0 Q204=5\nCYCL CALL",
                  "G0 Z2\nG1 Z-8 F1500\nZ2\nG0 Z5"),
    "tap with a chuck": ("CYCL DEF 206 TAP Q200=2 Q201=-8 Q206=750 Q211=0 Q203=0 Q204=5\nCYCL CALL",
                         "G0 Z2\nG1 Z-8 F750\nZ2\nG0 Z5"),
    "bore": ("CYCL DEF 202 BORING Q200=2 Q201=-8 Q206=80 Q211=0 Q208=0 Q203=0 Q204=5 Q214=1 Q336=0\nCYCL CALL",
             "G0 Z2\nG1 Z-8 F80\nZ2\nG0 Z5"),
    "chip breaking": ("CYCL DEF 203 UNIVERSAL DRILLING Q200=2 Q201=-10 Q206=90 Q202=4 Q210=0 Q203=0 Q204=5 Q212=1 "
                      "Q213=9 Q205=2"
                      " Q211=0 Q208=0 Q256=0.5\nCYCL CALL", "G0 Z2\nG1 Z-4 F90\nG0 Z-3.5\nG1 Z-7\nG0 Z-6.5\nG1 Z-9\nG0 "
                                                            "Z-8.5\n"
                                                            "G1 Z-10\nG0 Z5"),
    "old pecking": ("L Z+2 FMAX\nCYCL DEF 1.0 PECKING\nCYCL DEF 1.1 SET UP 2\nCYCL DEF 1.2 DEPTH -6\nCYCL DEF 1.3 "
                    "PECKG 4\n"
                    "CYCL DEF 1.4 DWELL 0\nCYCL DEF 1.5 F80\nCYCL CALL",
                    "G0 Z2\nG1 Z-4 F80\nG0 Z2\nZ-3.8\nG1 Z-6\nG0 Z2"),
    "bore milling": ("CYCL DEF 208 BORE MILLING Q200=2 Q201=-4 Q206=70 Q334=3 Q203=0 Q204=5 Q335=18 Q342=0 "
                     "Q351=+1\nCYCL CALL",
                     None),
    "dwell": ("CYCL DEF 9.0 DWELL\nCYCL DEF 9.1 DWELL 1.5\nL X+1", "G4 F1.5\nG1 X1"),
    # retracts
    "retract": ("L X+5 Y+5 Z+0\nL M140 MB 20 F99\nL X+6 F200", "G1 X5 Y5 Z0\nZ20 F99\nX6 F200"),
    "retract to the end of the travel": ("L X+5 Z+0\nM140 MB MAX\nL X+6 FMAX\nL Z+9 FMAX",
                                         "G1 X5 Z0\nG0 G53 Z0\nX6\nZ9"),
    "retract, then a move": ("L X+5 Y+5 Z+0\nL X+8 IY+1 F125 M140 MB 20 F750\nL X+9 Y+9 FMAX M140 MB MAX\nL Z+9 FMAX",
                             "G1 X5 Y5 Z0\nZ20 F750\nX8 Y6 F125\nG0 G53 Z0\nX9 Y9\nZ9"),
    "machine place": ("L X+5\nL Z+0 R0 FMAX M91\nL Z-1 F999 M91\nL X+7 Y+7 FMAX\nL Z+9 FMAX",
                      "G1 X5\nG0 G53 Z0\nX7 Y7\nZ9"),
    "feeds of TOOL CALL": ("L X+5 FAUTO\nL X+6 F50\nL X+7 FAUTO", "G1 X5 F200\nX6 F50\nX7 F200"),
    "idle words": ("M118 X1 Y1\nL X+1 M120 LA5\nM103 F0.5\nM107\nL X+2 M98\nFUNCTION MODE MILL\nM6\n"
                   "M3",
                   "G1 X1\nX2"),
}
