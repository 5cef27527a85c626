"""Siemens 840D: names as well as letters, = before a value, ';' before a comment, cycles with arguments.

Only the length of the first cutting edge, D1, is known; a new tool has it at once (machine data 20270). The reader
refuses by name computed values (R parameters, DEF, IF, GOTO, subprograms) and programmed frames. TRAORI and TRAFOOF may
switch the work offset off (G500): a move after one of them is refused until the program states a work offset again,
unless it suppresses all frames (SUPA, G53). Of swivelled planes the reader knows CYCLE800 with direction 0 while TRAORI
is on, which moves no axis: X, Y, Z count in the setup frame turned about its X, then the new Y and new Z (mode 57).
"""

from __future__ import annotations

import math
import re

from geometry.mesh import F64
from verify.gcode.dialects.base import NUMBER, ZEROS, BlockError, DialectReader, zero_word
from verify.gcode.dialects.tilted_planes import placed, turn

_NUM = r"[+-]?(?:[0-9]{1,8}(?:\.[0-9]*)?|\.[0-9]+)"
_PLAIN = re.compile(rf"(?:N[0-9]+ ?)?(?:G[01] ?)?(?:[XYZABC]{_NUM} ?)*(?:F{_NUM} ?)?\r?")
_TOKEN = re.compile(rf"""\s*(?:(?P<call>[A-Z_][A-Z_0-9]*)\s*\((?P<args>[^()]*)\)
    |(?P<name>[A-Z_][A-Z_0-9]*)\s*=\s*(?P<value>"[^"]*"|[^\s;"]+)
    |(?P<letter>[A-Z])(?P<digits>{NUMBER})(?![A-Z_0-9.])
    |(?P<word>[A-Z_][A-Z_0-9]*))""", re.VERBOSE)
_PLACE = re.compile(rf"([XYZ])({_NUM}|NAN)")
_LABEL = re.compile(r"(?:N[0-9]+\s+)?[A-Z_]{2}[A-Z_0-9]*:")
SMALL = 0.01
"""deg, deviation of a tool axis that needs no note: 0.01 mm at 57 mm above the tip."""
_MARKS = re.compile(r"^\s*(?:N[0-9]+\s+)?[^;(\n]*\b(?:TRAORI|TRAFOOF|CYCLE8[0-9]{2}\s*\(|SUPA|G710|G700|G641|G642|G645"
                    r"|COMPCAD|COMPOF|FFWON|ORIAXES|ORIMKS|ORIWKS)\b|^%_N_|^;\$PATH", re.MULTILINE)
_SAME = frozenset({0, 1, 2, 3, 17, 18, 19, 40, 53, 54, 55, 56, 57, 90, 91, 93, 94, 95})
_UNITS = {700: 20, 710: 21, 71: 21}
_LOSING = frozenset({"G20", "G21", "M6"})
"""Words of the reader that change the meaning of coordinates or make the place unknown."""
_PLANELESS = frozenset({"G2", "G3", "G53", "G91", "G93", "M6", "M428", "M429", *ZEROS})
"""Words that are refused in a plane of CYCLE800."""
_IDLE = frozenset({"ORIMKS", "ORIAXES", "FFWON", "FFWOF", "SOFT", "BRISK", "COMPOF", "DIAMOF", "CFTCP"})
_UNBOUNDED = frozenset({64, 642, 643, 644, 645})
_M = frozenset({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 30})


def is_siemens(text: str) -> bool:
    """Whether a text has words that only Siemens has."""
    return bool(_MARKS.search(text.upper()))


class SiemensReader(DialectReader):
    """840D sl, 828D and ONE."""

    home_from, gives_up_length = 1, True

    def __init__(self) -> None:
        super().__init__()
        self.unbounded = True
        self.tool = self.selected = 0
        self.loose = ""
        self.lost = ""  # the word after which the program has not stated a work offset
        self.tcp = self.relative = False
        self.plane: F64 | None = None  # columns are its axes in the setup frame
        self.at = [math.nan] * 3  # setup frame, while a plane is on
        self.trail: list[str] = []  # blocks with coordinates since the last plane

    def blocks(self, raw: str) -> list[str]:
        """A plain straight move unchanged; every other line word by word.

        Raises
        ------
        BlockError
            The line cannot be read, or could be read in two ways.
        """
        if not self.lost and _PLAIN.fullmatch(raw):
            if self.plane is not None:
                return [self._in_plane(raw.split())]
            self.trail.append(raw)
            return [raw]
        if raw.startswith("%_N_"):
            return []
        text = raw.split(";", 1)[0].upper().strip()
        if label := _LABEL.match(text):
            text = text[label.end():].strip()
        if not text:
            return []
        if text.startswith(("/", "%")):
            raise BlockError(f"cannot read '{text[:40]}'")
        return self._words(text)

    def _words(self, text: str) -> list[str]:
        out: list[str] = []
        values: dict[str, float] = {}
        codes: list[int] = []
        after: list[str] = []
        at = 0
        while at < len(text):
            m = _TOKEN.match(text, at)
            if m is None:
                raise BlockError(f"cannot read '{text[at:at + 40].strip()}'")
            at = m.end()
            while at < len(text) and text[at] == " ":
                at += 1
            if m["call"]:
                out += self._call(m["call"], m["args"])
            elif m["name"]:
                self._value(m["name"], m["value"], values, out)
            elif m["letter"]:
                self._letter(m["letter"], m["digits"], codes, out, after)
            else:
                out += self._name(m["word"])
        if any(54 <= n <= 57 or 505 <= n <= 599 for n in codes):
            self.lost = ""
        if self.lost and "G53" not in out and any(w[0] in "XYZABC" for w in out):
            raise BlockError(f"a move after {self.lost} without a work offset: it may be off (G500)",
                             "state the work offset (G54 to G57, G505 and up) before the move")
        out += self._path(codes, values)
        self._follow(out)
        if self.plane is not None and any(w[0] in "XYZ" for w in out):
            out = [self._in_plane(out)]
        if 4 in codes:
            out = [f"G4 P{w[1:]}" for w in out if w[0] == "F"]
            if not out:
                raise BlockError("G4 without F (seconds)")
        return [" ".join(out), *after] if out or after else []

    def _follow(self, out: list[str]) -> None:
        """Record the place of the tool and the blocks that a plane depends on."""
        if self.plane is not None:
            barred = [w for w in out if w in _PLANELESS or w[0] in "IJK"]
            if barred:
                raise BlockError(f"{barred[0]} in a plane of CYCLE800", "end the plane with CYCLE800() before")
            return
        if self.relative or not _LOSING.isdisjoint(out):
            self.trail.append("XNAN YNAN ZNAN")
        if "G91" in out or "G90" in out:
            self.relative = "G91" in out
        if not self.relative:
            self.trail.append(" ".join(f"{w[0]}NAN" if "G53" in out else w for w in out if w[0] in "XYZ"))

    def _in_plane(self, words: list[str]) -> str:
        """The block with X, Y, Z in the setup frame."""
        named = {w[0]: w[1:] for w in words if w[0] in "XYZ"}
        if not named or self.plane is None:
            return " ".join(words)
        self.at = placed(self.plane, self.at, named)
        rest = [w for w in words if w[0] not in "XYZ"]
        places = [f"{k}{v:.9f}" for k, v in zip("XYZ", self.at, strict=True)]
        head = [w for w in rest if w[0] in "NG"]
        return " ".join([*head, *places, *(w for w in rest if w[0] not in "NG")])

    def _swivel(self, parts: list[str]) -> None:
        """CYCLE800: turn the coordinates, or turn them back."""
        if parts == [""]:
            if self.plane is not None:
                self.trail = [" ".join(k + f"{v:.12f}" for k, v in zip("XYZ", self.at, strict=True))]
            self.plane = None
            return
        call = f"CYCLE800({','.join(parts)})"[:60]
        numbers = [parts[0], *parts[2:15]]
        if not 15 <= len(parts) <= 16 or not all(re.fullmatch(NUMBER, p) for p in numbers) or parts[15:] not in (
                [], [""], ["0"]):
            raise BlockError(f"{call} needs its 15 arguments as plain numbers, the second a name")
        given = [float(n) for n in numbers]
        if given[12] != 0.0 or not self.tcp:
            raise BlockError(f"{call} needs direction 0, which moves no axis, and TRAORI on")
        if given[:3] not in ([0.0, 0.0, 57.0], [0.0, 200000.0, 57.0]) or any(given[3:6]) or any(given[9:12]):
            raise BlockError(f"{call} needs a new plane without retract (0), axis by axis about X, Y, Z (57), without "
                             "shifts")
        if self.relative or self.plane is not None:
            raise BlockError(f"{call} in incremental coordinates, or within the plane of another CYCLE800")
        a, b, c = (math.radians(v) for v in given[6:9])
        self.at, self.plane = self._here(), turn(0, a) @ turn(1, b) @ turn(2, c)

    def _here(self) -> list[float]:
        """Place of the tool after the blocks so far, nan where they do not state it."""
        found: dict[str, float] = {}
        for block in reversed(self.trail):
            for letter, value in _PLACE.findall(block):
                found.setdefault(letter, float(value))
            if len(found) == 3:
                break
        return [found.get(k, math.nan) for k in "XYZ"]

    def _path(self, codes: list[int], values: dict[str, float]) -> list[str]:
        """Words that bound the rounding of corners."""
        if 641 in codes:
            if "ADIS" not in values:
                raise BlockError("G641 without ADIS in its block: the rounding of corners is unknown")
            self.bound(True)
            return [f"G64 P{max(values['ADIS'], values.get('ADISPOS', 0.0)):.6f}"]
        if "ADIS" in values or "ADISPOS" in values:
            raise BlockError("ADIS without G641 in its block")
        return ["G64"] if not _UNBOUNDED.isdisjoint(codes) else []

    def _letter(self, letter: str, digits: str, codes: list[int], out: list[str], after: list[str]) -> None:
        number = float(digits)
        if letter in "XYZABCIJKFS":
            out.append(letter + digits)
            return
        if letter not in "GMTDN" or number != int(number) or number < 0:
            raise BlockError(f"unknown word {letter}{digits}")
        n = int(number)
        if letter == "G":
            codes.append(n)
            out += self._code(n)
        elif letter == "T":
            self.selected = n
            out.append(f"T{n}")
        elif letter == "D":
            if n > 1:
                raise BlockError(f"D{n}: only the length of the first cutting edge (D1) is known")
            out.append(f"G43 H{self.tool}" if n else "G49")
        elif letter == "M":
            if n not in _M:
                raise BlockError(f"unknown word M{n}")
            out.append(f"M{n}")
            if n == 6:
                self.tool = self.selected
                after.append(f"G43 H{self.tool}")

    def _code(self, n: int) -> list[str]:
        if n in _SAME:
            return [f"G{n}"]
        if n == 70:
            raise BlockError("G70 counts coordinates in inches, and F in the basic unit of the machine",
                             "write G700, which counts F in inches too")
        if n in _UNITS:
            return [f"G{_UNITS[n]}"]
        if 505 <= n <= 599:
            return [zero_word(n - 500, f"G{n}")]
        if n == 60:
            self.bound(True)
            return ["G61"]
        if n == 4 or n == 641 or n in _UNBOUNDED:
            return []
        if n == 500:
            raise BlockError("G500 switches the work offset off: program zero is then unknown")
        raise BlockError(f"unknown word G{n}")

    def _value(self, name: str, text: str, values: dict[str, float], out: list[str]) -> None:
        if name == "T":
            digits = text.strip('"').removeprefix("T")
            if not digits.isdigit():
                raise BlockError(f"T={text}: name the tool by its number, such as T=\"1\"")
            self.selected = int(digits)
            out.append(f"T{self.selected}")
            return
        if not re.fullmatch(NUMBER, text):
            raise BlockError(f"{name}={text} is not a plain number")
        number = float(text)
        if name in ("X", "Y", "Z", "A", "B", "C", "I", "J", "K", "F", "S"):
            out.append(f"{name}{text}")
        elif name == "CR":
            out.append(f"R{text}")
        elif name == "TURN":
            out.append(f"P{int(number) + 1}")
        elif name in ("ADIS", "ADISPOS"):
            values[name] = number
        else:
            raise BlockError(f"unknown word {name}={text}")

    def _name(self, word: str) -> list[str]:
        if word in _IDLE:
            return []
        known = {"SUPA": "G53", "TRAORI": "M428", "TRAFOOF": "M429"}.get(word)
        if known is None:
            raise BlockError(f"unknown word {word[:40]}")
        if word == "TRAORI" and self.loose:
            self.notes.append(self.loose)
        if known != "G53":
            self.lost, self.tcp = word, word == "TRAORI"
        return [known]

    def _oriented(self, parts: list[str]) -> None:
        """Keep a note for the first turning tool axis where CYCLE832 allows it more than a small deviation."""
        stated = len(parts) > 2 and re.fullmatch("1[0-9]", parts[1]) and re.fullmatch(NUMBER, parts[2])
        self.loose = ""
        if stated and float(parts[2]) <= SMALL:
            return
        amount = f"of {parts[2]} deg" if stated else "that setting data decide"
        self.loose = f"CYCLE832 allows the tool axis a deviation {amount}: the error bound does not include it"

    def _call(self, name: str, arguments: str) -> list[str]:
        parts = [p.strip() for p in arguments.split(",")]
        if name == "TRAORI" and parts in ([""], ["1"]):
            return self._name("TRAORI")
        if name == "CYCLE800":
            self._swivel(parts)
            return []
        if name == "MSG":  # a line on the screen
            return []
        if name == "CYCLE832":
            if parts == [""] or parts[1:2] in (["0"], ["_OFF"]):
                self.notes.append("CYCLE832 is off: machine data decide how far the control rounds corners; the error "
                                  "bound does not include it")
                self.bound(False)
                return []
            if not re.fullmatch(NUMBER, parts[0]):
                raise BlockError(f"CYCLE832({arguments}): its tolerance is not a plain number")
            self._oriented(parts)
            self.bound(True)
            return [f"G64 P{float(parts[0]):.6f}"]
        raise BlockError(f"{name[:40]}( ): unknown cycle or function")
