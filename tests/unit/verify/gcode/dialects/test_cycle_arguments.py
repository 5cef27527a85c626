"""Every argument of every cycle is used, moves nothing, or is refused: none is dropped."""

import pytest

from geometry.errors import ProgramError
from tests.program_pairs import read
from verify.gcode.block_words import CYCLES as G_CYCLES
from verify.gcode.dialects.cycle_arguments import Role
from verify.gcode.dialects.heidenhain import heidenhain_arguments
from verify.gcode.dialects.heidenhain.heidenhain_cycles import DRILLS
from verify.gcode.dialects.siemens import siemens_arguments
from verify.gcode.reader import read_program


def outcome(lines, dialect):
    """All that a program does: moves, feeds, dwells, speeds, coolant, taps, and what is said of it."""
    try:
        p = lines() if callable(lines) else read(lines, dialect)
    except ProgramError as refused:
        return f"refused: {refused}; {refused.remedy}"
    return (p.start.round(6).tolist(), p.end.round(6).tolist(), p.kind.tolist(), [str(f) for f in p.feed.round(3)],
            p.speed.tolist(), p.coolant.tolist(), p.dwell, sorted(p.speeds.items()), sorted(p.taps.items()), p.senses,
            [(r.line, r.message) for r in p.remarks], p.notes)


def told(out, *words):
    """Whether a program is refused with these words."""
    return isinstance(out, str) and all(w in out for w in words)


# Siemens: a call with each argument, and for each argument that is used a value that does something else

HOLE = {"RTP": 5, "RFP": 0, "SDIS": 2, "DP": -8, "DPR": None}
MODES = {"_GMODE": 0, "_DMODE": 1, "_AMODE": 0}
TABLE = {"_PITM": '""', "_PTAB": '"ISO_METRIC"', "_PTABA": '"M8"'}
CALLS = {
    "CYCLE81": {**HOLE, "DTB": 0, **MODES},
    "CYCLE82": {**HOLE, "DTB": 0, **MODES, "_VARI": 0, "S_ZA": 0, "S_FA": 0, "S_ZD": None, "S_FD": 0},
    "CYCLE83": {**HOLE, "FDEP": -3, "FDPR": None, "_DAM": 1, "DTB": 0, "DTS": 0, "FRF": 1, "VARI": 1, "_AXN": 3,
                "_MDEP": 0.5, "_VRT": 0, "_DTD": 0, "_DIS1": 0, **MODES},
    "CYCLE84": {**HOLE, "DTB": 0, "SDAC": 3, "MPIT": None, "PIT": 1.25, "POSS": 0, "SST": 400, "SST1": 400, "_AXN": 3,
                "_PITA": 1, "_TECHNO": 0, "_VARI": 0, "_DAM": 0, "_VRT": 0, **TABLE, **MODES},
    "CYCLE840": {**HOLE, "DTB": 0, "SDR": 4, "SDAC": 3, "ENC": 11, "MPIT": None, "PIT": 1.25, "_AXN": 3, "_PITA": 1,
                 "_TECHNO": 0, **TABLE, **MODES},
    "CYCLE85": {**HOLE, "DTB": 0, "FFR": 100, "RFF": 400, **MODES},
    "CYCLE86": {**HOLE, "DTB": 0, "SDIR": 3, "RPA": 0, "RPO": 0, "RPAP": 0, "POSS": 0, **MODES},
    "CYCLE87": {**HOLE, "SDIR": 3}, "CYCLE88": {**HOLE, "DTB": 0, "SDIR": 3}, "CYCLE89": {**HOLE, "DTB": 0},
    "HOLES1": {"SPCA": 5, "SPCO": 3, "STA1": 20, "FDIS": 4, "DBH": 6, "NUM": 2, "_VARI": 0, "_UMODE": 0, "_HIDE": None,
               "_NSP": None, "_DMODE": 1},
    "HOLES2": {"CPA": 5, "CPO": 3, "RAD": 9, "STA1": 20, "INDA": 50, "NUM": 3, "_VARI": 0, "_UMODE": 0, "_HIDE": None,
               "_NSP": None, "_DMODE": 1},
}
OTHER = {
    "RTP": 6, "RFP": 1, "SDIS": 1, "DP": -9, "DPR": 7, "DTB": 2, "_GMODE": 10, "_DMODE": 2, "_AMODE": 1, "FDEP": -4,
    "FDPR": 2, "_DAM": 0.25, "FRF": 0.5, "VARI": 0, "_AXN": 1, "_MDEP": 1.5, "_VRT": 0.5, "_DTD": 1, "_DIS1": 0.5,
    "SDAC": 5, "MPIT": 6, "PIT": 1.5, "SST": 500, "SST1": 1900, "_PITA": 3, "SDR": 3, "ENC": 1, "FFR": 150, "RFF": 300,
    "SDIR": 4, "RPA": 1, "RPO": 1, "SPCA": 6, "SPCO": 4, "STA1": 30, "FDIS": 5, "DBH": 7, "NUM": 4, "CPA": 6, "CPO": 4,
    "RAD": 8, "INDA": 60, "_VARI": 1000, "_HIDE": '"01"'}
WITH = {("CYCLE83", "_VRT"): {"VARI": 0}, ("CYCLE86", "_GMODE"): {"RPA": 1}}
"""What else a call needs for an argument to do something."""
ARGUMENTS = [(name, a) for name, known in siemens_arguments.CYCLES.items() for a in known]


def siemens(name, **changed):
    """What a call does with some values changed."""
    values = ["" if v is None else str(v) for v in {**CALLS[name], **changed}.values()]
    call = f"{name}({','.join(values)})"
    if name in siemens_arguments.PATTERNS:
        call = f"MCALL CYCLE81(5,0,2,-8)\n{call}\nMCALL"
    return outcome(f"{call}\nG1 X9 F100", "siemens")


def test_the_calls_have_all_arguments_in_their_order():
    assert {k: list(v) for k, v in CALLS.items()} == {
        k: [a.name for a in known] for k, known in siemens_arguments.CYCLES.items()}


@pytest.mark.parametrize(("name", "argument"), ARGUMENTS, ids=[f"{n} {a.name}" for n, a in ARGUMENTS])
def test_siemens(name, argument):
    more, key = WITH.get((name, argument.name), {}), argument.name
    usual = siemens(name, **more)
    assert not told(usual, "refused")
    if argument.role is Role.USED:
        assert siemens(name, **more, **{key: OTHER[key]}) != usual
    elif argument.role is Role.HARMLESS:
        assert siemens(name, **{key: '"X"' if argument.text else 1}) == usual
    else:
        assert argument.what and told(siemens(name, **{key: 7}), name, f"{key}=7", f"write {key}=0")
        assert siemens(name, **{key: 0}) == siemens(name, **{key: None}) == usual
    if argument.unsigned:
        assert told(siemens(name, **{key: -1}), f"{key}=-1", "no value below 0", f"write {key}=1")


@pytest.mark.parametrize("name", siemens_arguments.CYCLES)
def test_siemens_takes_no_argument_behind_the_last_one(name):
    usual = siemens(name)
    assert siemens(name, further=None) == siemens(name, further=0) == usual
    assert told(siemens(name, further=3), f"{name} with 3.0 as argument {len(CALLS[name]) + 1}")


# Heidenhain

GIVEN = {"Q200": 2, "Q201": -8, "Q203": 0, "Q204": 10, "Q202": 3, "Q206": 100, "Q211": 0, "Q210": 0, "Q395": 0,
         "Q208": 500, "Q214": 0, "Q336": 0, "Q357": 0, "Q205": 0.5, "Q212": 1, "Q213": 1, "Q256": 0.2, "Q257": 0,
         "Q258": 0.2, "Q259": 0.2, "Q373": 0, "Q379": 0, "Q253": 700, "Q239": 1, "Q334": 2, "Q335": 18, "Q351": 1,
         "Q342": 0, "Q370": 0, "Q403": 1, "Q343": 0, "Q344": 0, "Q401": 100, "Q426": 3, "Q427": 1000, "Q428": 1000,
         "Q429": 8, "Q430": 9, "Q435": 0}
DIFFERENT = {"Q200": 3, "Q201": -7, "Q203": 1, "Q204": 20, "Q202": 2, "Q206": 150, "Q211": 1, "Q208": 300, "Q214": 1,
             "Q205": 1.5, "Q212": 0.5, "Q213": 2, "Q256": 0.5, "Q257": 2, "Q258": 0.5, "Q259": 0.6, "Q239": 1.5,
             "Q334": 1, "Q335": 19, "Q351": -1, "Q403": 3, "Q401": 50, "Q426": 5, "Q427": 50, "Q428": 30, "Q429": 0,
             "Q430": 0, "Q435": 5}
NEEDS = {(241, "Q401"): {"Q435": 5}, (241, "Q435"): {"Q401": 50}, (205, "Q256"): {"Q257": 1}}
PARAMETERS = [(n, a) for n, known in heidenhain_arguments.CYCLES.items() for a in known]


def heidenhain(number, **changed):
    """What a cycle does with some values changed."""
    values = {a.name: GIVEN[a.name] for a in heidenhain_arguments.CYCLES[number]} | changed
    words = " ".join(f"{k}={v:+g}" for k, v in values.items())
    return outcome(f"CYCL DEF {number} X {words}\nCYCL CALL\nL X+30 F100", "heidenhain")


def test_the_cycles_that_drill_have_their_parameters():
    assert set(heidenhain_arguments.CYCLES) == DRILLS


@pytest.mark.parametrize(("number", "argument"), PARAMETERS, ids=[f"{n} {a.name}" for n, a in PARAMETERS])
def test_heidenhain(number, argument):
    key, usual = argument.name, heidenhain(number)
    assert not told(usual, "refused")
    if argument.role is Role.USED:
        more = NEEDS.get((number, key), {})
        assert heidenhain(number, **more, **{key: DIFFERENT[key]}) != heidenhain(number, **more)
    elif argument.role is Role.HARMLESS:
        assert heidenhain(number, **{key: 1}) == usual
    else:
        assert argument.what and told(heidenhain(number, **{key: 1}), f"cycle {number} with {key}=1", f"write {key}=0")
    if argument.unsigned:
        assert told(heidenhain(number, **{key: -1}), f"{key}=-1", "no value below 0", f"write {key}=1")


@pytest.mark.parametrize("number", heidenhain_arguments.CYCLES)
def test_heidenhain_takes_no_other_parameter(number):
    assert heidenhain(number, Q999=0) == heidenhain(number)
    assert told(heidenhain(number, Q999=1), "Q999=1", "does not know")


def test_only_feeds_are_auto_or_max():
    text = "CYCL DEF 200 X Q200=+2 Q201=-8 Q203=+0 Q204=+10 Q206=AUTO Q202={} Q211=+0\nCYCL CALL"
    assert not told(outcome(text.format("+3"), "heidenhain"), "refused")
    assert told(outcome(text.format("MAX"), "heidenhain"), "Q202", "no feed")


# G words: letters that a cycle takes beside X, Y, Z, R, F, S, T, and those of them that move nothing

TAKEN = {"linuxcnc": {73: "QPKL", 74: "PQKL", 81: "KL", 82: "PKL", 83: "QPKL", 84: "PQKL", 85: "KL", 86: "PKL",
                      89: "PKL"},
         "fanuc": {73: "QPKL", 74: "PQKL", 76: "PQIJKL", 81: "KL", 82: "PKL", 83: "QPKL", 84: "PQKL", 85: "KL",
                   86: "PKL", 89: "PKL"},
         "haas": {73: "QPLIJK", 74: "PQLJ", 76: "PQIJL", 81: "L", 82: "PL", 83: "QPLIJK", 84: "PQLJ", 85: "L",
                  86: "PL", 89: "PL"}}
MOVES_NOTHING = {(74, "Q"): "chip breaks of a tap", (84, "Q"): "chip breaks of a tap",
                 **{(76, c): "a note says that the shift is left out" for c in "QIJ"}}
WORDS = {"P": "P500", "Q": "Q2.", "L": "L3", "K": "K3", "I": "I3.", "J": "J2."}
"""What is written of a letter, for those that take another number than 2."""
BLOCKS = [(d, g, c) for d, known in TAKEN.items() for g in known for c in "DEHIJKLPQUVW"]


def of_g(dialect, cycle, words):
    """What a cycle of G words does."""
    body = f"G99 G{cycle} X5. Y0. Z-8. R2. F300. {words}\nG91 X3.\nG90 G80\nG0 Z50."
    if dialect == "linuxcnc":
        return outcome(body.replace("G91 X3.", "X8."), dialect)
    text = f"%\nO1\nG21 G17 G90 G94 G40 G54\nT1 M6\nS1000 M3\nG0 X0. Y0.\nG43 H1 Z50.\n{body}\nM30\n%\n"
    return outcome(lambda: read_program(text, dialect=dialect, tools=[1]), dialect)


def test_the_table_has_the_cycles_of_all_controls():
    assert {g for known in TAKEN.values() for g in known} == G_CYCLES
    assert set(TAKEN["fanuc"]) == set(TAKEN["haas"]) == G_CYCLES and set(TAKEN["linuxcnc"]) == G_CYCLES - {76}


@pytest.mark.parametrize(("dialect", "cycle", "letter"), BLOCKS)
def test_a_letter_of_a_cycle_does_something_or_is_told(dialect, cycle, letter):
    words = {letter: WORDS.get(letter, f"{letter}2.")}
    given = {"Q": "Q3."} if cycle in (73, 83) else {}
    if dialect == "haas" and given and letter in "IJK":  # two kinds of pecks
        given, words = {"I": "I4.", "J": "J1.", "K": "K0.5"}, {letter: f"{letter}3."}
    usual, changed = (of_g(dialect, cycle, " ".join(w.values())) for w in (given, given | words))
    if letter not in TAKEN[dialect][cycle]:
        assert isinstance(changed, str) or any(f"uses {letter}" in m or f", {letter}" in m for _, m in changed[-2])
    elif (cycle, letter) in MOVES_NOTHING:
        assert changed == usual
    else:
        assert changed != usual and not any("uses" in m for _, m in changed[-2])
