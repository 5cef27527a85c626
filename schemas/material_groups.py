"""Groups of workpiece materials with their cutting data, and the materials that belong to them.

The groups are those of VDI 3323, which cutting tool makers use to sort materials. A material that has no figures of its
own gets those of its group. docs/theory/feeds.md names the source of each column.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import NamedTuple, TypeVar

T = TypeVar("T")


class MaterialGroup(NamedTuple):
    """A group of VDI 3323.

    iso      : letter of ISO 513: P, M, K, N, S or H
    what     : the materials in words
    force    : kc1.1, N/mm2, of a tool that turns one way only; milling takes ``MILLING`` times as much
    exponent : mc
    speed    : m/min, slots with solid carbide, coated, with coolant
    feeds    : mm per tooth over the diameter: that of small tools, and that of 20 mm
    """

    iso: str
    what: str
    force: float
    exponent: float
    speed: float
    feeds: tuple[float, float]


MILLING = 1.2  # of the specific cutting force, as for the built-in materials

GROUPS: dict[int, MaterialGroup] = {
    1: MaterialGroup("P", "unalloyed steel below 0.25 % carbon", 1350.0, 0.21, 130.0, (0.0075, 0.005)),
    2: MaterialGroup("P", "unalloyed steel below 0.55 % carbon, annealed", 1500.0, 0.22, 130.0, (0.0075, 0.005)),
    3: MaterialGroup("P", "unalloyed steel below 0.55 % carbon, quenched and tempered", 1675.0, 0.24, 130.0,
                     (0.0065, 0.004)),
    4: MaterialGroup("P", "unalloyed steel from 0.55 % carbon, annealed", 1700.0, 0.24, 130.0, (0.0055, 0.003)),
    5: MaterialGroup("P", "unalloyed steel from 0.55 % carbon, quenched and tempered", 1900.0, 0.24, 130.0,
                     (0.0065, 0.004)),
    6: MaterialGroup("P", "low-alloy steel, annealed", 1775.0, 0.24, 70.0, (0.0055, 0.003)),
    7: MaterialGroup("P", "low-alloy steel, quenched and tempered to 930 N/mm2", 1675.0, 0.24, 70.0, (0.0055, 0.003)),
    8: MaterialGroup("P", "low-alloy steel, quenched and tempered to 1000 N/mm2", 1725.0, 0.24, 70.0, (0.0055, 0.003)),
    9: MaterialGroup("P", "low-alloy steel, quenched and tempered to 1200 N/mm2", 1800.0, 0.24, 70.0, (0.0055, 0.003)),
    10: MaterialGroup("P", "high-alloy steel and tool steel, annealed", 2450.0, 0.23, 70.0, (0.0055, 0.003)),
    11: MaterialGroup("P", "high-alloy steel and tool steel, quenched and tempered", 2500.0, 0.23, 70.0,
                      (0.0045, 0.002)),
    12: MaterialGroup("P", "ferritic or martensitic stainless steel", 1875.0, 0.21, 60.0, (0.0045, 0.002)),
    13: MaterialGroup("P", "martensitic stainless steel, hardened", 1875.0, 0.21, 60.0, (0.0045, 0.002)),
    14: MaterialGroup("M", "austenitic or duplex stainless steel", 2150.0, 0.20, 60.0, (0.0045, 0.002)),
    15: MaterialGroup("K", "grey cast iron, ferritic or pearlitic", 1150.0, 0.20, 80.0, (0.0075, 0.005)),
    16: MaterialGroup("K", "grey cast iron, pearlitic", 1350.0, 0.28, 80.0, (0.0075, 0.005)),
    17: MaterialGroup("K", "nodular cast iron, ferritic", 1225.0, 0.25, 80.0, (0.0075, 0.005)),
    18: MaterialGroup("K", "nodular cast iron, pearlitic", 1350.0, 0.28, 80.0, (0.0065, 0.004)),
    19: MaterialGroup("K", "malleable cast iron, ferritic", 1225.0, 0.25, 80.0, (0.0075, 0.005)),
    20: MaterialGroup("K", "malleable cast iron, pearlitic", 1420.0, 0.30, 80.0, (0.0065, 0.004)),
    21: MaterialGroup("N", "wrought aluminium alloy, not hardenable", 700.0, 0.25, 250.0, (0.010, 0.0075)),
    22: MaterialGroup("N", "wrought aluminium alloy, hardenable", 800.0, 0.25, 250.0, (0.010, 0.0075)),
    23: MaterialGroup("N", "cast aluminium alloy up to 12 % silicon, not hardenable", 700.0, 0.25, 250.0,
                      (0.010, 0.0075)),
    24: MaterialGroup("N", "cast aluminium alloy up to 12 % silicon, hardenable", 700.0, 0.25, 250.0, (0.010, 0.0075)),
    25: MaterialGroup("N", "cast aluminium alloy above 12 % silicon", 750.0, 0.25, 100.0, (0.0075, 0.005)),
    26: MaterialGroup("N", "copper alloy with more than 1 % lead", 700.0, 0.27, 90.0, (0.0075, 0.005)),
    27: MaterialGroup("N", "brass and bronze", 700.0, 0.27, 90.0, (0.0075, 0.005)),
    28: MaterialGroup("N", "copper", 700.0, 0.27, 90.0, (0.0075, 0.005)),
    31: MaterialGroup("S", "heat-resistant alloy of iron, annealed", 2600.0, 0.24, 20.0, (0.003, 0.002)),
    32: MaterialGroup("S", "heat-resistant alloy of iron, aged", 3100.0, 0.24, 20.0, (0.003, 0.002)),
    33: MaterialGroup("S", "heat-resistant alloy of nickel or cobalt, annealed", 3300.0, 0.24, 20.0, (0.003, 0.002)),
    34: MaterialGroup("S", "heat-resistant alloy of nickel or cobalt, aged", 3300.0, 0.24, 20.0, (0.003, 0.002)),
    35: MaterialGroup("S", "heat-resistant alloy of nickel or cobalt, cast", 3300.0, 0.24, 20.0, (0.003, 0.002)),
    36: MaterialGroup("S", "pure titanium", 1160.0, 0.24, 60.0, (0.006, 0.004)),
    37: MaterialGroup("S", "titanium alloy, alpha and beta", 1420.0, 0.23, 60.0, (0.006, 0.004)),
    38: MaterialGroup("H", "hardened steel, 45 to 57 HRC", 4600.0, 0.25, 20.0, (0.0025, 0.0025)),
    39: MaterialGroup("H", "hardened steel, from 58 HRC", 4700.0, 0.25, 20.0, (0.0025, 0.0025)),
    40: MaterialGroup("H", "chilled cast iron", 4600.0, 0.28, 20.0, (0.0025, 0.0025)),
    41: MaterialGroup("H", "hardened cast iron", 4500.0, 0.28, 20.0, (0.0025, 0.0025)),
}
"""Groups by their number in VDI 3323. 29 and 30, plastics and hard rubber, are missing."""

WORST = {"P": 11, "M": 14, "K": 20, "N": 22, "S": 34, "H": 39}
"""For a letter of ISO 513 alone: the number of its group with the largest force."""

# Number of the group, then names of one material: EN or DIN name first, material number, AISI or UNS, trade names.
_NAMES = """
1 S235JR; 1.0038; St37-2; St37; 1.0037; A283C; A36
1 S275JR; 1.0044; St44-2
1 S355J2; 1.0577; S355JR; 1.0045; St52-3; St52; 1.0570; A572; A572 Gr50
1 C15; 1.0401; C15E; 1.1141; Ck15; 1015; S15C
1 C10; 1.0301; C10E; 1.1121; Ck10; 1010
1 C22; 1.0402; C22E; 1.1151; Ck22; 1020; 1018; S20C
1 11SMnPb30; 1.0718; 9SMnPb28; 12L14; 12L13
1 11SMn30; 1.0715; 9SMn28; 1213; 1215
1 P265GH; 1.0425
1 DC01; 1.0330; 1008
2 C35; 1.0501; C35E; 1.1181; Ck35; 1035; S35C
2 C40; 1.0511; C40E; 1.1186; 1040; EN8; 080M40
2 C50; 1.0540; C50E; 1.1206; 1050; S50C
2 35S20; 1.0726; 1140
2 E295; 1.0050; St50-2
4 C55; 1.0535; C55E; 1.1203; Ck55; 1055; S55C
4 C60; 1.0601; C60E; 1.1221; Ck60; 1060
4 C75; 1.0605; C75S; 1.1248; Ck75; 1075
4 E335; 1.0060; St60-2
6 16MnCr5; 1.7131; 16MnCrS5; 1.7139; 5115
6 20MnCr5; 1.7147; 20MnCrS5; 1.7149; 5120
6 17CrNi6-6; 1.5918; 15CrNi6; 1.5919
6 18CrNiMo7-6; 1.6587; 17CrNiMo6
6 20NiCrMo2-2; 1.6523; 8620; SNCM220
6 14NiCr14; 1.5752; 3310; 9310
6 100Cr6; 1.3505; 52100; SUJ2
6 41Cr4; 1.7035; 5140; SCr440
6 13CrMo4-5; 1.7335
6 10CrMo9-10; 1.7380
6 16Mo3; 1.5415
6 90MnCrV8; 1.2842; O2
6 100MnCrW4; 1.2510; 95MnWCr5; O1
6 60WCrV8; 1.2550; S1
7 25CrMo4; 1.7218; 4130; SCM430
7 51CrV4; 1.8159; 50CrV4; 6150
7 46Cr2; 1.7006
8 42CrMo4; 1.7225; 42CrMoS4; 1.7227; 4140; 4142; SCM440; EN19; 708M40
8 34CrMo4; 1.7220; 4135; 4137; SCM435
8 34CrNiMo6; 1.6582; 4340; EN24; 817M40
8 30CrNiMo8; 1.6580
8 36CrNiMo4; 1.6511; 9840
8 31CrMoV9; 1.8519
8 34CrAlNi7-10; 1.8550; 34CrAlNi7
8 40CrMnMo7; 1.2311; 40CrMnMoS8-6; 1.2312; P20
8 40CrMnNiMo8-6-4; 1.2738; P20+Ni
9 300M; 1.6928; 41SiNiCrMoV7-6
10 X153CrMoV12; 1.2379; X155CrVMo12-1; D2; SKD11
10 X210Cr12; 1.2080; D3; SKD1
10 X210CrW12; 1.2436; D6
10 X100CrMoV5; 1.2363; A2; SKD12
10 X37CrMoV5-1; 1.2343; H11; SKD6
10 X40CrMoV5-1; 1.2344; H13; SKD61
10 X38CrMoV5-3; 1.2367
10 55NiCrMoV7; 1.2714; 1.2713; L6; SKT4
10 45NiCrMo16; 1.2767; 6F7
10 HS6-5-2C; 1.3343; HS6-5-2; S6-5-2; M2; SKH51
10 HS6-5-2-5; 1.3243; M35; SKH55
10 HS2-9-1-8; 1.3247; M42
10 X120Mn12; 1.3401; Hadfield steel
11 X3NiCoMoTi18-9-5; 1.2709; 1.6358; X2NiCoMo18-9-5; maraging 300; MS1
12 X6Cr17; 1.4016; 430; SUS430; S43000
12 X2CrNi12; 1.4003
12 X12Cr13; 1.4006; 410; SUS410; S41000
12 X12CrS13; 1.4005; 416; S41600
12 X20Cr13; 1.4021; 420; SUS420J1; S42000
12 X30Cr13; 1.4028; 420B; SUS420J2
12 X46Cr13; 1.4034; 420C
12 X14CrMoS17; 1.4104; 430F; SUS430F; S43020
12 X6CrMoS17; 1.4105
12 X40Cr14; 1.2083; 420ESR; Stavax
12 X33CrS16; 1.2085
12 X38CrMo16; 1.2316; 422; S42200
13 X17CrNi16-2; 1.4057; 431; SUS431; S43100
13 X39CrMo17-1; 1.4122
13 X90CrMoV18; 1.4112; 440B; SUS440B; S44003
13 X105CrMo17; 1.4125; 440C; SUS440C; S44004
13 X3CrNiMo13-4; 1.4313; 415; S41500; CA6NM
13 X5CrNiCuNb16-4; 1.4542; 1.4548; 17-4PH; 17-4; 630; SUS630; S17400
13 X5CrNiCu15-5; 1.4545; 15-5PH; 15-5; S15500
13 X3CrNiMoAl13-8-2; 1.4534; 13-8PH; PH13-8Mo; S13800
13 X7CrNiAl17-7; 1.4568; 17-7PH; 631; S17700
14 X8CrNiS18-9; 1.4305; X10CrNiS18-9; 303; SUS303; S30300
14 X2CrNi18-9; 1.4307; 304L; SUS304L; S30403
14 X2CrNi19-11; 1.4306
14 X10CrNi18-8; 1.4310; 301; 302; SUS301
14 X5CrNiMo17-12-2; 1.4401; 316; SUS316; S31600; V4A
14 X3CrNiMo17-13-3; 1.4436
14 X2CrNiMo18-14-3; 1.4435
14 X2CrNiMo18-15-3; 1.4441; 316LVM
14 X6CrNiTi18-10; 1.4541; 321; SUS321; S32100
14 X6CrNiNb18-10; 1.4550; 347; SUS347; S34700
14 X6CrNiMoTi17-12-2; 1.4571; 316Ti; SUS316Ti; S31635
14 X2CrNiMoN17-13-5; 1.4439
14 X1NiCrMoCu25-20-5; 1.4539; 904L; N08904
14 X1NiCrMoCuN25-20-7; 1.4529; N08926
14 X2CrNiMoN22-5-3; 1.4462; 2205; 318LN; S31803; S32205; SUS329J3L
14 X2CrNiMoN25-7-4; 1.4410; 2507; S32750
14 X2CrNiMoCuWN25-7-4; 1.4501; S32760; Zeron 100
14 X15CrNiSi20-12; 1.4828; 309
14 X15CrNiSi25-21; 1.4841; 314; 310
14 X8CrNi25-21; 1.4845; 310S; SUS310S
15 EN-GJL-150; 5.1200; 0.6015; GG15; GJL150
15 EN-GJL-200; 5.1300; 0.6020; GG20; GJL200; FC200
16 EN-GJL-250; 5.1301; 0.6025; GG25; GJL250; FC250
16 EN-GJL-300; 5.1302; 0.6030; GG30; GJL300; FC300
16 EN-GJL-350; 5.1303; 0.6035; GG35; GJL350
17 EN-GJS-400-15; 5.3106; 0.7040; GGG40; GJS400-15; GJS400; FCD400; 60-40-18
17 EN-GJS-400-18; 5.3105; 0.7043; GGG40.3; GJS400-18
18 EN-GJS-500-7; 5.3200; 0.7050; GGG50; GJS500-7; GJS500; FCD500; 65-45-12
18 EN-GJS-600-3; 5.3201; 0.7060; GGG60; GJS600-3; GJS600; FCD600; 80-55-06
18 EN-GJS-700-2; 5.3300; 0.7070; GGG70; GJS700-2; GJS700; FCD700; 100-70-03
19 EN-GJMB-350-10; 5.4101; 0.8135; GTS35
20 EN-GJMB-650-2; 5.4301; 0.8165; GTS65
21 AlMg4.5Mn0.7; EN AW-5083; 5083; 3.3547; A95083
21 AlMg3; EN AW-5754; 5754; 3.3535; A95754
21 AlMg2.5; EN AW-5052; 5052; 3.3523; A95052
21 Al99.5; EN AW-1050A; 1050A; 3.0255
21 AlMn1Cu; EN AW-3003; 3003; 3.0517
22 AlMg1SiCu; EN AW-6061; 6061; 3.3211; A96061
22 AlMgSi; EN AW-6060; 6060; AlMgSi0.5; 3.3206
22 AlMg0.7Si; EN AW-6063; 6063; A96063
22 AlMgSiPb; EN AW-6012; 6012; 3.0615
22 AlCu4PbMgMn; EN AW-2007; 2007; AlCuMgPb; 3.1645
22 AlCu6BiPb; EN AW-2011; 2011; 3.1655
22 AlCu4SiMg; EN AW-2014; 2014; 3.1255; A92014
22 AlCu4MgSi; EN AW-2017A; 2017A; 2017; AlCuMg1; 3.1325
22 AlCu4Mg1; EN AW-2024; 2024; AlCuMg2; 3.1355; A92024
22 AlCu2Mg1.5Ni; EN AW-2618A; 2618A; 2618; 3.1924
22 AlCu6Mn; EN AW-2219; 2219; A92219
22 AlZn4.5Mg1; EN AW-7020; 7020; 3.4335
22 AlZn5Mg3Cu; EN AW-7022; 7022; 3.4345; Certal
22 AlZn6CuMgZr; EN AW-7050; 7050; 3.4144; A97050
23 AlSi12; EN AC-44200; EN AC-44100; G-AlSi12; A413
23 AlSi9Cu3; EN AC-46000; EN AC-46200; GD-AlSi9Cu3; A380; ADC12; ADC10
24 AlSi10Mg; AlSi10Mg(Fe); EN AC-43000; EN AC-43400; G-AlSi10Mg; A360
24 AlSi7Mg0.3; EN AC-42100; AlSi7Mg; EN AC-42000; A356; A357; AlSi7Mg0.6; EN AC-42200
25 AlSi17Cu4Mg; EN AC-48100; A390
26 CuZn39Pb3; CW614N; 2.0401; Ms58; C38500
26 CuZn36Pb3; CW603N; 2.0375; C36000
26 CuZn39Pb2; CW612N; 2.0380; C37700
27 CuZn37; CW508L; 2.0321; Ms63; C27200
27 CuZn30; CW505L; 2.0265; C26000
27 CuSn8; CW453K; 2.1030; C52100
27 CuSn12; CC483K; 2.1052
27 CuSn7ZnPb; CC493K; 2.1090; RG7; C93200
28 Cu-ETP; CW004A; 2.0065; 2.0060; E-Cu58; E-Cu57; C11000
28 Cu-OF; CW008A; 2.0040; C10200
28 CuCr1Zr; CW106C; 2.1293; C18150
31 X10NiCrAlTi32-21; 1.4876; Incoloy 800; Alloy 800; N08800
31 FeNi36; 1.3912; Invar 36; Invar; K93600
31 X8NiCrAlTi32-21; 1.4959; Incoloy 800HT; N08811
32 X6NiCrTiMoVB25-15-2; 1.4980; A286; S66286
33 NiCr15Fe; 2.4816; Inconel 600; Alloy 600; N06600
33 NiCr22Mo9Nb; 2.4856; Inconel 625; Alloy 625; IN625; N06625
33 NiMo16Cr15W; 2.4819; Hastelloy C-276; C276; N10276
33 NiCr21Mo14W; 2.4602; Hastelloy C-22; N06022
33 NiCr22Fe18Mo; 2.4665; Hastelloy X; N06002
33 NiCu30Fe; 2.4360; Monel 400; N04400
33 NiCr21Mo; 2.4858; Incoloy 825; Alloy 825; N08825
33 CoCr20W15Ni; 2.4964; Haynes 25; L-605; R30605
34 NiCr15Fe7TiAl; 2.4669; Inconel X-750; N07750
34 NiCr19Co14Mo4Ti; 2.4654; Waspaloy; N07001
34 NiCr20TiAl; 2.4952; 2.4631; Nimonic 80A; N07080
34 NiCr18CoTi; 2.4632; Nimonic 90; N07090
34 NiCo20Cr20MoTi; 2.4650; Nimonic 263; C-263; N07263
34 NiCr19CoMo; 2.4973; Rene 41; N07041
34 NiCu30Al; 2.4375; Monel K-500; N05500
34 Haynes 282; N07208
34 Udimet 720
34 CoCr28Mo6; F1537; F75; R31537
35 NiCr13Al6MoNb; 2.4670; 2.4671; Inconel 713; Inconel 713C; Inconel 713LC; N07713
35 MAR-M 247
35 Stellite 6; R30006
36 Ti Grade 1; Titanium Grade 1; Ti Gr.1; 3.7025; Ti99.8; R50250
36 Ti Grade 2; Titanium Grade 2; Ti Gr.2; 3.7035; Ti99.7; R50400
36 Ti Grade 3; Titanium Grade 3; Ti Gr.3; 3.7055; R50550
36 Ti Grade 4; Titanium Grade 4; Ti Gr.4; 3.7065; R50700
37 Ti-6Al-7Nb; F1295; R56700
37 Ti-6Al-2Sn-4Zr-2Mo; 3.7145; Ti6242; R54620
37 Ti-6Al-2Sn-4Zr-6Mo; Ti6246; R56260
37 Ti-5Al-2.5Sn; 3.7115; Ti Grade 6; R54520
37 Ti-3Al-2.5V; 3.7195; Ti Grade 9; R56320
37 Ti-10V-2Fe-3Al; Ti1023; R56410
37 Ti-5Al-5Mo-5V-3Cr; Ti5553
37 Ti-15V-3Cr-3Sn-3Al; Ti-15-3; R58153
11 Steel; Stahl; Acier
14 Stainless steel; Edelstahl; Inox
18 Cast iron; Gusseisen
22 Aluminium; Aluminum; Alu
27 Brass; Messing; Bronze
28 Copper; Kupfer
34 Nickel alloy; Superalloy
37 Titanium; Titan; Titanium alloy
"""

# Further names of the built-in materials.
_BUILT_IN = """
Ti-6Al-4V; Ti64; 3.7165; 3.7164; Ti Grade 5; Ti Gr.5; Grade 5; Titanium Grade 5; R56400
Ti-6Al-4V; Ti-6Al-4V ELI; Ti Grade 23; Titanium Grade 23; Ti Gr.23; Grade 23; R56401
Inconel 718; 2.4668; NiCr19Fe19Nb5Mo3; IN718; Alloy 718; N07718
AlMgSi1 6082; EN AW-6082; 6082; AlSi1MgMn; AlMgSi1; 3.2315; Al6082; A96082
AlZnMgCu1.5 7075; EN AW-7075; 7075; AlZn5.5MgCu; AlZnMgCu1.5; 3.4365; Al7075; A97075; Fortal
1.4301; X5CrNi18-10; 304; SUS304; S30400; V2A
316L; 1.4404; X2CrNiMo17-12-2; SUS316L; S31603
C45; 1.0503; C45E; 1.1191; Ck45; 1045; S45C
"""

STANDARDS = re.compile(r"^(?:(?:din|en|iso|aisi|sae|uns|astm|jis|werkstoffnr|wnr|w\.nr|werkstoff|material|mat)[.:]*"
                       r"(?=[0-9a-z])|a(?=[1-8]\d{3}))")
"""Name of a standard before the name of a material, or the A of JIS before the digits of an aluminium alloy."""
TEMPER = re.compile(r"(?<=\d{4})(a?)[tho]\d{0,4}$")
"""Temper behind the four digits of a wrought aluminium alloy."""
CONDITION = re.compile(r"\+(?:qt|a|n|ar|at|c|s|sr|p\d*)$")
"""Delivery condition of EN standards behind the name of a steel."""
HARDNESS = re.compile(r"(\d{2}(?:\.\d+)?)hrc$")
"""Hardness behind the name of a steel."""
MIN_HARD = 45.0  # HRC, from which steel counts as hardened
MIN_HARDER = 58.0  # HRC, from which it counts in the group of 60 HRC


def key(name: str) -> str:
    """A name without what does not tell materials apart: case, spaces, hyphens and underscores.

    >>> key("EN AW-6082"), key("X5CrNi18-10")
    ('enaw6082', 'x5crni1810')
    """
    return re.sub(r"[\s\-_]", "", name.casefold())


def _rows(text: str) -> list[list[str]]:
    return [[n.strip() for n in line.split(";")] for line in text.strip().splitlines()]


BUILT_IN: dict[str, str] = {key(n): row[0] for row in _rows(_BUILT_IN) for n in row}
"""Names of the built-in materials by key."""

_NUMBERS = [int(row[0].split(" ", 1)[0]) for row in _rows(_NAMES)]
_MEMBER_ROWS = [[row[0].split(" ", 1)[1], *row[1:]] for row in _rows(_NAMES)]
MEMBERS: dict[str, tuple[str, int]] = {key(n): (row[0], number)
                                       for row, number in zip(_MEMBER_ROWS, _NUMBERS, strict=True) for n in row}
"""First name and number of the group of each further material, by the key of each of its names."""


def spellings(name: str) -> list[str]:
    """Keys under which a material may be known: its name, and that without standard, condition and temper.

    >>> spellings("EN AW-6061-T651")
    ['enaw6061t651', 'enaw6061', 'aw6061t651', 'aw6061']
    >>> spellings("AISI 4140+QT")
    ['aisi4140+qt', 'aisi4140', '4140+qt', '4140']
    """
    out = [key(name)]
    for shorter in (STANDARDS, STANDARDS):
        out += [shorter.sub("", out[-1])]
    return list(dict.fromkeys(short for k in out for short in (k, TEMPER.sub(r"\1", CONDITION.sub("", k)))))


def hardness(name: str) -> tuple[str, float | None]:
    """A name without the Rockwell hardness behind it, and that hardness, HRC; None where it states none.

    >>> hardness("1.2379 60 HRC")
    ('1.2379', 60.0)
    """
    found = HARDNESS.search(key(name))
    if found is None:
        return name, None
    return key(name)[:found.start()], float(found[1])


def group_of(name: str) -> tuple[str, int] | None:
    """First name of a material and the number of its group; None where it is not known.

    Besides names of materials, ``name`` may be a letter of ISO 513 ("ISO M") or the number of a group ("VDI 14"). A
    hardness behind a name ("1.2379 60 HRC") decides over the group of a steel.

    >>> group_of("AISI D2"), group_of("1.2379 60 HRC"), group_of("ISO M"), group_of("unobtainium")
    (('X153CrMoV12', 10), ('1.2379 60 HRC', 39), ('ISO M', 14), None)
    """
    plain, hrc = hardness(name)
    if hrc is not None:
        return _hardened(name, plain, hrc)
    if (found := _first(name, MEMBERS)) is not None:
        return found
    if letter := re.fullmatch(r"(?:iso)?([pmknsh])", key(name)):
        return f"ISO {letter[1].upper()}", WORST[letter[1].upper()]
    if (number := re.fullmatch(r"(?:vdi|vdi3323|group|gruppe)(\d{1,2})", key(name))) and int(number[1]) in GROUPS:
        return f"VDI {int(number[1])}", int(number[1])
    return None


def _hardened(name: str, plain: str, hrc: float) -> tuple[str, int] | None:
    """As ``group_of`` for ``plain`` with a hardness behind it, HRC; None where it is no steel."""
    number = 2 if built_in_name(plain) == "C45" else (_first(plain, MEMBERS) or ("", 0))[1]
    if number == 0 or GROUPS[number].iso != "P":
        return None
    if hrc >= MIN_HARD:
        number = 39 if hrc >= MIN_HARDER else 38
    else:
        number = 11 if number >= 10 else 9
    return " ".join(name.split()), number


def _first(name: str, known: Mapping[str, T]) -> T | None:
    return next((known[k] for k in spellings(name) if k in known), None)


def built_in_name(name: str) -> str | None:
    """The name of the built-in material that a name means; None where it means none.

    >>> built_in_name("EN AW-6082-T6"), built_in_name("X5CrNi18-10"), built_in_name("4140")
    ('AlMgSi1 6082', '1.4301', None)
    """
    return _first(name, BUILT_IN)


def similar(name: str) -> list[str]:
    """Up to five names of materials that look like a name."""
    names = [n for row in (*_rows(_BUILT_IN), *_MEMBER_ROWS) for n in row]
    by_key = {key(n): n for n in names}
    return [by_key[k] for k in get_close_matches(spellings(name)[-1], by_key, 5, 0.7)]


__all__ = ["GROUPS", "MILLING", "MaterialGroup", "built_in_name", "group_of", "hardness", "key", "similar", "spellings"]
