"""The corpus of programs as shops write them, each with its judge, and the comparison with what the reader makes of it.

Judges: LinuxCNC's interpreter for programs of LinuxCNC and for twins, which have the moves of a program of another
control in plain words; paths drawn by hand; and for programs that must be refused, the word that is not followed.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from geometry.errors import ProgramError
from tests import heidenhain_pairs, siemens_pairs
from tests.drawn_paths import NEAR, departure
from tests.drawn_programs import PROGRAMS, text_of
from tests.linuxcnc_samples import has_gaps, programs
from tests.program_pairs import HEIDENHAIN, NAMES, RADII, SIEMENS, kinematics
from tests.program_pairs import LINUXCNC as PLAIN
from tests.refused_programs import REFUSED
from tests.rs274 import ABSENT, DIAMETER, RS274, difference, judge
from tests.shop_programs import LINUXCNC, PAIRS, linuxcnc, pair
from verify.gcode.program_text import decoded
from verify.gcode.reader import read_program

OF_JUDGE = dict.fromkeys(range(1, 100), DIAMETER / 2)
GAPS = ("two tools", "home and back")
ROUND = NEAR - 4e-4
"""mm off an arc, besides four times the last digit that LinuxCNC's interpreter prints in mm: 1 µm together."""
WORDS = {
    "G41, G42, RL, RR": r"\bG4[12](?:\.1)?\b|\bR[LR]\b", "M98, M99, M97": r"\bM9[789]\b", "G65": r"\bG65\b",
    "O-words": r"^\s*O\S+ *(?:SUB|CALL|WHILE|REPEAT|IF)\b", "L NAME P": r"^(?:N\d+ )?(?:L\d+|WAY|POCKET_ROUGH|TWICE)\b",
    "CALL LBL, REP": r"\bCALL LBL\b", "PROC, RET, M17": r"\bPROC\b", "EXTCALL, CALL PGM": r"\bEXTCALL\b|\bCALL PGM\b",
    "# variables": r"#", "R variables": r"\bR\d+ *=|=R\d", "Q variables": r"\bQ[LR]?\d+ *= *[+\d(SQ]|FN \d",
    "FN 0 to 13": r"\bFN \d", "jumps and loops": r"\b(?:GOTO[FBC]?|WHILE|FOR|REPEATB?|LOOP|CASE|IF)\b",
    "G10": r"\bG10\b",
    "tool by name": r'\bT="|TOOL CALL "', "preselected tool": r"^T\d+\n(?!M0?6)", "TRANS, ATRANS": r"\bA?TRANS [XYZ]",
    "ROT, AROT, cycle 10, G68": r"\bA?ROT (?:[XYZ]|RPL)|CYCL DEF 10\.|\bG68\b",
    "MIRROR, cycle 8, G51.1, G101": r"\bA?MIRROR [XYZ]|CYCL DEF 8\.|\bG51\.1|\bG101\b",
    "SCALE, cycle 11, G51": r"\bA?SCALE [XYZ]|CYCL DEF 11\.|\bG51\b", "datum shift, G52, G92": r"\bG52\b|\bG92\b|DATUM",
    "AC( ), IC( )": r"\b(?:AC|IC)\(", "turns over 360 deg": r"\bTURN=|\bIPA[+-]\d{4}|\bG[23]\b.*\bP[2-9]",
    "RND, CHF, CHR": r"\b(?:RND|RNDM|CHF|CHR)\b", "APPR, DEP": r"\b(?:APPR|DEP)\b",
    "canned cycles: LinuxCNC, Fanuc, Haas": r"\bG(?:73|74|76|8[1-9])\b",
    "canned cycles: Siemens": r"\bCYCLE8[1-9]|HOLES|G331",
    "canned cycles: Heidenhain": r"CYCL DEF (?:2\d\d|1\.)", "A3= B3= C3=, ORIWKS, ORIMKS": r"\bA3=|\bORI[WM]KS\b",
    "G43.4, G43.5, G234": r"\bG43\.[45]|\bG234\b", "G68.2, G53.1": r"\bG68\.2", "FUNCTION TCPM": r"FUNCTION TCPM",
    "M128": r"\bM128\b", "PLANE": r"^PLANE", "CYCLE800": r"\bCYCLE800", "LN": r"^LN\b",
    "speed and smoothing": r"\bG8\b|\bG187\b|\bCOMP(?:CAD|ON)\b|\bCYCLE832|\bG64|\bSOFT\b|\bFFWON\b|\bM120\b",
    "M140": r"\bM140\b", "functions of the machine": r"\bM(?:88|89|1\d\d|2\d\d)\b",
    "comments": r"\(|;|^\* -|\bMSG", "line numbers": r"^\s*N?\d+ ", "% and file ends": r"^%|\x1a|\r",
    "encodings": r"[^\x00-\x7f]",
    "pockets, threads, splines, probing": r"POCKET|SLOT|CYCLE97|SPLINE|\bG33\b|CYCL DEF 2[56]\d|FPOL|\bG150|\bG38|"
                                          r"\bG5\b|G12",
}
"""Words of the table, and how a program shows them."""
SHOPS = {
    "Windows file": ("fanuc", "%\r\nO1 (TEIL F\u00dcR M\u00dcLLER)\r\nN10 G21 G90 G17 G54\r\nN20 T1 M6\r\nN30 S900 "
                     "M3\r\nN40 G43 H1\r\nN50 G0 X0. Y0. Z5. (\u00d8 6)\r\nN60 G1 Z-1. F200.\r\nN70 M88\r\nN80 X5.\r\n"
                     "N90 M30\r\n%\r\n\x1a", "cp1252", "G0 X0 Y0 Z5\nG1 Z-1 F200\nX5\n"),
    "tape with a leader": ("fanuc", "PART 12 / REV A\n\n%12\nO1\nG21 G90 G17 G54\nT1 M6 ; END MILL 6\nS900 M3\nG43 "
                           "H1\nG0 X0. Y0. Z5.\n; next one\nG1 Z-1. F200.\nX5.\nM30\n%\n", "ascii",
                           "G0 X0 Y0 Z5\nG1 Z-1 F200\nX5\n"),
    "smooth Siemens": ("siemens", "%_N_A_MPF\n;$PATH=/_N_WKS_DIR\nN10 G710 G17 G90 G94 G54 ; \u00d6l\nN20 "
                       "T=\"MILL_D10\"\nN30 M6\nN35 S900 M3\nN40 CYCLE832(0.005,1,0.005)\nN50 COMPCAD\nN60 SOFT\n"
                       "N70 FFWON\nN80 M77\nN90 G0 X0 Y0 Z5\nN100 G1 Z-1 F200\nN110 X5\nN120 COMPOF\nN130 M30\n",
                       "utf-16", "G0 X0 Y0 Z5\nG1 Z-1 F200\nX5\n"),
    "names of Heidenhain": ("heidenhain", "0 BEGIN PGM A MM\n1 ; GR\u00d6SSE\n2 TOOL CALL \"drill 8\" Z S900 F200\n3 "
                            "TOOL DEF 3\n4 M3\n5 L X+0 Y+0 Z+5 FMAX\n6 L Z-1 M211\n7 L X+5 M140 MB MAX\n8 END PGM A "
                            "MM\n", "utf-8", "G0 X0 Y0 Z5\nG1 Z-1 F200\nG0 G53 Z0\nG1 X5\n"),
    "smooth Haas": ("haas", "%\nO1\nG21 G90 G17\nT1\nM6\nT2\nS900 M3\nG54 G43 H1\nG187 P3 E0.005\nG0 X0. Y0. Z5.\nM88\n"
                    "G1 Z-1. F200.\nX5.\nM16\nG43 H2\nS500 M3\nG0 X1. Y1. Z5.\nM30\n%\n", "ascii",
                    "G0 X0 Y0 Z5\nG1 Z-1 F200\nX5\nT2 M6\nG0 X1 Y1 Z5\n"),
    "smooth Fanuc": ("fanuc", "%\nO1\nN1 G21 G90 G17\nN2 T1 M6\nN3 S900 M3\nN4 G54 G43 H1\nN5 G5.1 Q1\nN6 G8 P1\nN7 G0 "
                     "X0. Y0. Z5.\nN8 M210\nN9 G1 Z-1. F200.\nN10 X5.\nN11 G8 P0\nN12 G5.1 Q0\nN13 M30\n%\n", "ascii",
                     "G0 X0 Y0 Z5\nG1 Z-1 F200\nX5\n"),
}
"""Files as they leave a post: control, text, encoding, and the moves."""


@dataclass(frozen=True)
class Program:
    """A program of the corpus: its origin and name, control, text, and what the judge says: a plain twin, a path drawn
    by hand, or the word that is refused; ``gaps`` as in ``tests.rs274.difference``."""

    origin: str
    name: str
    dialect: str
    text: str
    twin: str | None = None
    drawn: object = None
    refused: str = ""
    gaps: bool = False
    radii: dict | None = None


@dataclass(frozen=True)
class Row:
    """A program with its words and outcome: 'equal', 'refused', 'wrong' or 'skipped', and why."""

    program: Program
    words: tuple
    outcome: str
    why: str


def corpus(samples=True):
    """All programs; ``samples``: with those of LinuxCNC that are installed."""
    out = [Program("ours", n, "linuxcnc", linuxcnc(n), twin=linuxcnc(n), gaps=n in GAPS, radii=OF_JUDGE)
           for n in LINUXCNC]
    for name in PAIRS:
        dialect, text, twin = pair(name)
        out.append(Program("ours", name, dialect, text, twin=twin, radii=OF_JUDGE))
    for dialect, head, end, pairs in (("siemens", SIEMENS, "M30", siemens_pairs.PAIRS),
                                      ("heidenhain", HEIDENHAIN, "END PGM A MM", heidenhain_pairs.PAIRS)):
        for name, (text, plain) in pairs.items():
            if plain:
                out.append(Program("ours", name, dialect, "\n".join([*head, text, end, ""]), twin=_plain(plain),
                                   gaps="G53" in plain or "M6" in plain))
    for name, (dialect, text, encoding, moves) in SHOPS.items():
        out.append(Program("files", name, dialect, decoded(text.encode(encoding)),
                           twin="G21 G90 G17\nT1 M6\nG43\nS900 M3\n" + moves + "M2\n", gaps=True))
    for name, drawn in PROGRAMS.items():
        out.append(Program("manuals", name, drawn.dialect, text_of(drawn), drawn=drawn))
    heads = {"siemens": SIEMENS, "heidenhain": HEIDENHAIN}
    for name, (dialect, text, word) in REFUSED.items():
        head = heads.get(dialect, ("G21 G90 G17 G54", "T1 M6", "G43 H1", "S900 M3 F100.", "G0 X0. Y0. Z5."))
        end = "END PGM A MM" if dialect == "heidenhain" else "M30"
        out.append(Program("refused", name, dialect, "\n".join([*head, text, end, ""]), refused=word))
    if samples:
        out += [Program("nc_files", name, "linuxcnc", text, twin=text, gaps=has_gaps(text), radii=OF_JUDGE)
                for name, text in programs()]
    return out


def _plain(body):
    """The twin of Siemens's words for LinuxCNC's interpreter, in which a dwell has P."""
    return "\n".join([*PLAIN, re.sub(r"\bG4 F", "G4 P", body), "M2", ""])


def words_of(text):
    """Words of the table that a text has."""
    return tuple(w for w, shown in WORDS.items() if re.search(shown, text.upper(), re.MULTILINE))


def judged(program, folder):
    """Read a program and compare it; ``folder`` is an empty one for the judge."""
    words = words_of(program.text)
    if program.twin and RS274 is None:
        return Row(program, words, "skipped", ABSENT)
    by = judge(program.twin, folder) if program.twin else None
    if by is not None and (why := _no_judge(program, by)):
        return Row(program, words, "skipped" if program.origin == "nc_files" else "wrong", why)
    try:
        read = read_of(program)
    except ProgramError as error:
        named = program.refused in error.message and error.subjects[0].startswith("line ")
        right = named if program.refused else program.origin == "nc_files"
        return Row(program, words, "refused" if right else "wrong", error.message)
    if program.refused:
        return Row(program, words, "wrong", f"{program.refused} is read")
    if by is not None:
        found = difference(read, by, program.gaps, ROUND)
        return Row(program, words, "wrong" if found else "equal", found)
    try:
        departure(read, program.drawn.path)
    except ValueError as apart:
        return Row(program, words, "wrong", str(apart))
    return Row(program, words, "equal", "")


def _no_judge(program, by):
    """Why the judge says nothing of a program, '' where it does."""
    if by.refused:
        return f"the judge refuses it: {by.refused[:120]}"
    if program.origin == "nc_files" and len(by.moves) < 3:
        return "it has fewer than three moves"
    if program.origin == "nc_files" and re.search(r"(?i)^[^(;]*[ABCUVW]\s*-?[0-9.]", program.text, re.MULTILINE):
        return "it turns rotary axes, which the judge does not follow"
    return ""


def read_of(program):
    """What the reader makes of a program of the corpus."""
    tools = {} if program.radii else {"names": NAMES, "tools": {1, 2, 3}, "gauge_length": {1: 60.0, 2: 60.0, 3: 60.0}}
    kind = program.drawn.kinematics if program.drawn else None
    return read_program(program.text, name=program.name, dialect=program.dialect, kinematics=kinematics(kind),
                        radii=program.radii or RADII, **tools)


def not_followed():
    """Words in the first columns of the tables of refused words in docs/verify.md."""
    text = (Path(__file__).resolve().parents[1] / "docs" / "verify.md").read_text().split("## Words it refuses")[1]
    return {w for line in text.splitlines() if line.startswith("| ") for w in _expanded(line.split("|")[1])}


def _expanded(cell):
    """Words of a cell; 'CYCLE97 to CYCLE99' and '251 to 258' give every one between."""
    for m in re.finditer(r"([A-Z]*)(\d+) to ([A-Z]*)(\d+)", cell):
        yield from (f"{m[1] or 'cycle '}{n}" for n in range(int(m[2]), int(m[4]) + 1))
    kind = ""
    for word in re.split(r",\s*|;\s*|\s+of\s+|\s+and\s+", cell.replace("APPR and DEP with ", "")):
        kind = "cycle " if word.strip().startswith("cycle") else "" if re.match(r"\s*[A-Z]", word) else kind
        yield word.strip()
        if re.fullmatch(r"(?:cycles? )?\d+", word.strip()):
            yield kind + word.split()[-1]


__all__ = ["WORDS", "Program", "Row", "corpus", "judged", "not_followed", "read_of"]
