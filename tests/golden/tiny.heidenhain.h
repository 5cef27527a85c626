0 BEGIN PGM demo MM
1 BLK FORM 0.1 Z X+0 Y+0 Z+0
2 BLK FORM 0.2 X+30 Y+20 Z+15
3 ; Program demo, zonemill 0.1.0, Heidenhain TNC, 3 axes
4 ; Part sha256 abababababababababababababababababababababababababababababababab
5 ; Setup sha256 cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd
6 ; Label order: 4711
7 ; Material Ti-6Al-4V
8 ; Units mm and mm/min. Work offset preset 1. Program zero is the origin of the setup frame
9 ; XYZ is the tool tip: set every tool length in the tool table, TOOL CALL counts the length of the
10 ; tool table
11 ; Stock box X 0 to 30, Y 0 to 20, Z 0 to 15
12 ; Clearance plane Z 25: above it rapids in XY are free
13 ; Lowest Z of the tip 4.5
14 ; Every step can be started at its label: tool, length, zero, speed and coolant stand there
15 ; Start at a label only when all steps before it have been cut: no way was proved through their
16 ; stock
17 ; Path mode cycle 32 T0.001: the control may leave the written path by that much, in mm
18 ; Machine zero of Z is taken to be the top of its travel
19 ; Tools, all lengths in mm from the tip:
20 ; T1: ball D3, corner R1.5, flute length 9, neck D2.8 to 20, shank D6, stickout 45
21 ; Taken for granted by the proof, check it on the machine:
22 ; travel: long enough. Else a move may run into the end of an axis. Remedy: state
23 ; machine.travel_mm
24 LBL "S01"
25 CYCL DEF 32.0 TOLERANCE
26 CYCL DEF 32.1 T0.001
27 CYCL DEF 247 DATUM SETTING ~
    Q339=+1 ;DATUM NUMBER
28 L Z+0 R0 FMAX M91
29 ; T1: ball D3, corner R1.5, flute length 9, neck D2.8 to 20, shank D6, stickout 45
30 TOOL CALL 1 Z S12000
31 ; S01 Z3 finishing waterline T1: F12 F13; Z 10 down to 4
32 M3
33 M8
34 L Z+25 R0 FMAX
35 L X+0 Y+0 R0 FMAX
36 L Z+6 R0 FMAX
37 L Z+5 R0 F200
38 L X+10 R0 F600
39 L Y+2.5
40 L X+0 Z+4.5
41 L Z+6
42 L Z+25 R0 FMAX
43 M5
44 M9
45 L Z+0 R0 FMAX M91
46 M30
47 END PGM demo MM
