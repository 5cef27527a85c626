0 BEGIN PGM demo MM
1 BLK FORM 0.1 Z X+0 Y+0 Z+0
2 BLK FORM 0.2 X+30 Y+20 Z+15
3 ; Program demo, zonemill 0.1.0, Heidenhain TNC, 3 axes
4 ; Part sha256 abababababababab, setup sha256 cdcdcdcdcdcdcdcd
5 ; Label order: 4711
6 ; Material Ti-6Al-4V
7 ; Units mm and mm/min. Work offset preset 1. Program zero is the origin of the setup frame
8 ; XYZ is the tool tip: set every tool length in the tool table, TOOL CALL counts the length of the
9 ; tool table
10 ; Stock box X 0 to 30, Y 0 to 20, Z 0 to 15
11 ; Clearance plane Z 25: above it rapids in XY are free
12 ; Lowest Z of the tip 3.75
13 ; Path mode cycle 32 T0.001: the control may leave the written path by that much, in mm
14 ; Machine zero of Z is taken to be the top of its travel
15 ; Tools, all lengths in mm from the tip:
16 ; T1: ball D3, corner R1.5, flute length 9, neck D2.8 to 20, shank D6, stickout 45
17 CYCL DEF 32.0 TOLERANCE
18 CYCL DEF 32.1 T0.001
19 CYCL DEF 247 DATUM SETTING ~
    Q339=+1 ;DATUM NUMBER
20 ; T1: ball D3, corner R1.5, flute length 9, neck D2.8 to 20, shank D6, stickout 45
21 TOOL CALL 1 Z S12000
22 ; S01 Z3 finishing zlevel T1: F12 F13; Z 10 down to 4
23 M3
24 M8
25 L Z+25 R0 FMAX
26 L X+15 Y+8 R0 FMAX
27 L Z+5 R0 FMAX
28 L Z+4 R0 F240
29 CC X+9.9999 Y+8
30 C X+9.854 Y+12.9979 DR+ R0 F600
31 CC X+9.7955 Y+14.997
32 CP IPA-91.6762 Z+3.75 DR-
33 L Z+4.75
34 L Z+25 R0 FMAX
35 M5
36 M9
37 L Z+0 R0 FMAX M91
38 M30
39 END PGM demo MM
