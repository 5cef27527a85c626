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
13 ; Lowest Z of the tip 3.75
14 ; Path mode cycle 32 T0.001: the control may leave the written path by that much, in mm
15 ; Machine zero of Z is taken to be the top of its travel
16 ; Tools, all lengths in mm from the tip:
17 ; T1: ball D3, corner R1.5, flute length 9, neck D2.8 to 20, shank D6, stickout 45
18 ; Taken for granted by the proof, check it on the machine:
19 ; travel: long enough. Else a move may run into the end of an axis. Remedy: state
20 ; machine.travel_mm
21 CYCL DEF 32.0 TOLERANCE
22 CYCL DEF 32.1 T0.001
23 CYCL DEF 247 DATUM SETTING ~
    Q339=+1 ;DATUM NUMBER
24 ; T1: ball D3, corner R1.5, flute length 9, neck D2.8 to 20, shank D6, stickout 45
25 TOOL CALL 1 Z S12000
26 ; S01 Z3 finishing waterline T1: F12 F13; Z 10 down to 4
27 M3
28 M8
29 L Z+25 R0 FMAX
30 L X+15 Y+8 R0 FMAX
31 L Z+5 R0 FMAX
32 L Z+4 R0 F240
33 CC X+9.9999 Y+8
34 C X+9.854 Y+12.9979 DR+ R0 F600
35 CC X+9.7955 Y+14.997
36 CP IPA-91.6762 Z+3.75 DR-
37 L Z+4.75
38 L Z+25 R0 FMAX
39 M5
40 M9
41 L Z+0 R0 FMAX M91
42 M30
43 END PGM demo MM
