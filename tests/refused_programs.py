"""Programs with one word that moves or cuts and is not followed: control, lines, the word as its refusal names it."""

REFUSED = {
    "EXTCALL": ("siemens", 'EXTCALL "PART"', "EXTCALL"),
    "a pocket of Siemens": ("siemens", "POCKET4(5,0,1,-9,20,0,0,5)", "POCKET4"),
    "slots": ("siemens", "SLOT1(5,0,1,-9)", "SLOT1"), "a thread of Siemens": ("siemens", "CYCLE97(1)", "CYCLE97"),
    "a spline of Siemens": ("siemens", "BSPLINE X1 Y1", "BSPLINE"), "a thread by G33": ("siemens", "G33 Z1 K1", "G33"),
    "another program": ("heidenhain", "CALL PGM TNC:\\A.H", "CALL PGM"),
    "a pocket of Heidenhain": ("heidenhain", "CYCL DEF 251 Q200=2\nCYCL CALL", "cycle 251"),
    "a milled thread": ("heidenhain", "CYCL DEF 262 Q200=2\nCYCL CALL", "cycle 262"),
    "a free contour": ("heidenhain", "FPOL X+0 Y+0", "FPOL"),
    "a smooth approach": ("heidenhain", "APPR LCT X+1 Y+1 R5 RL", "LCT"),
    "a missing subprogram": ("fanuc", "M98 P2000", "M98"), "a modal macro": ("fanuc", "G66 P9", "G66"),
    "polar interpolation": ("fanuc", "G12.1", "G12.1"), "a pocket of Haas": ("haas", "G150 P1 D1 Z-1. Q1. R1. F9.",
                                                                              "G150"),
    "probing": ("linuxcnc", "G38.2 Z-5", "G38.2"), "a spline of LinuxCNC": ("linuxcnc", "G5 X1 Y1 I1 J1 P1 Q1", "G5"),
}
