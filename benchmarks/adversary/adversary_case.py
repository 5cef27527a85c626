"""Programs of the adversary as lists of operations, and the text that each control gets for them.

A mechanism adds operations to a right program, or changes some. What it expects names operations, so the line of a
finding is known in every dialect.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, field
from typing import Any

SAFE = 40.0  # mm, over every part
ENDINGS = {"linuxcnc": ".ngc", "fanuc": ".nc", "haas": ".nc", "siemens": ".mpf", "heidenhain": ".h"}
REFUSED = "refused"
"""In place of a kind of finding: the program or the setup gives an error."""


@dataclass(eq=False)
class Op:
    """One operation.

    kind   : 'rapid', 'feed', 'arc', 'tool', 'raw'
    x, y, z, feed : mm and mm/min, None where the line leaves the word out
    centre, clockwise : of an arc in XY, (x, y) mm
    number : T number of a tool change; speed in 1/min, 0 leaves S and M3 out
    text   : of a raw line
    group  : name of the part of the program it belongs to
    """

    kind: str
    x: float | None = None
    y: float | None = None
    z: float | None = None
    feed: float | None = None
    centre: tuple[float, float] = (0.0, 0.0)
    clockwise: bool = False
    number: int = 0
    speed: int = 0
    text: str = ""
    group: str = ""


@dataclass(eq=False)
class Script:
    """A program that grows.

    head : lines that stand in place of the head of the dialect; None takes that
    """

    ops: list[Op] = field(default_factory=list)
    group: str = ""
    head: list[str] | None = None
    foot: list[str] | None = None

    def add(self, op: Op) -> Op:
        """Append an operation."""
        op.group = self.group
        self.ops.append(op)
        return op

    def rapid(self, x: float | None = None, y: float | None = None, z: float | None = None) -> Op:
        """A rapid."""
        return self.add(Op("rapid", x, y, z))

    def feed(self, x: float | None = None, y: float | None = None, z: float | None = None,
             feed: float | None = None) -> Op:
        """A straight feed move."""
        return self.add(Op("feed", x, y, z, feed))

    def arc(self, x: float, y: float, centre: tuple[float, float], clockwise: bool = False,
            z: float | None = None) -> Op:
        """An arc in XY, a helix where z is given."""
        return self.add(Op("arc", x, y, z, None, centre, clockwise))

    def tool(self, number: int, speed: int = 6000) -> Op:
        """Load a tool, turn it on and count its length."""
        return self.add(Op("tool", number=number, speed=speed))

    def raw(self, text: str) -> Op:
        """A line as it is."""
        return self.add(Op("raw", text=text))

    def over(self, x: float, y: float) -> None:
        """Lift, and go over a place at the safe height."""
        self.rapid(z=SAFE)
        self.rapid(x, y)

    def copy(self) -> Script:
        """A program of its own that may be changed."""
        return copy.deepcopy(self)


@dataclass(frozen=True)
class Expected:
    """What a case must give.

    good  : it must be proved
    kinds : any of these kinds of finding; REFUSED where an error is right, too
    lines : any of these, None where no line is to blame
    depth : mm, None where the twin knows none
    word  : that stands in the message
    """

    good: bool
    kinds: tuple[str, ...] = ()
    lines: frozenset[int] | None = None
    depth: float | None = None
    word: str = ""


@dataclass(frozen=True, eq=False)
class Case:
    """A program with what must come of it.

    part  : name of the part; setup : sections of the setup that differ from those of the part
    """

    mechanism: str
    part: str
    setup: dict[str, Any]
    text: str
    dialect: str
    expected: Expected
    what: str = ""

    @property
    def ending(self) -> str:
        """Ending of its file."""
        return ENDINGS[self.dialect]


def number(value: float, dialect: str) -> str:
    """A number as a control wants it, within 0.0001."""
    text = f"{value + 0.0:.4f}".rstrip("0").rstrip(".")
    text = "0" if text == "-0" else text
    if dialect in ("fanuc", "haas") and "." not in text:
        text += "."
    if dialect == "heidenhain" and not text.startswith("-"):
        text = "+" + text
    return text


def written(script: Script, dialect: str = "linuxcnc") -> tuple[str, dict[int, int]]:
    """Text of a program, and the number of the last line of each operation by ``id``."""
    lines = list(script.head) if script.head is not None else _head(dialect)
    at: dict[int, int] = {}
    here: list[float] = [math.nan, math.nan]
    for op in script.ops:
        lines += _lines(op, dialect, here)
        at[id(op)] = len(lines)
        if op.x is not None:
            here[0] = op.x
        if op.y is not None:
            here[1] = op.y
    lines += list(script.foot) if script.foot is not None else _foot(dialect)
    if dialect == "heidenhain":
        lines = [f"{k} {line}" for k, line in enumerate(lines)]
    return "\n".join(lines) + "\n", at


def _head(dialect: str) -> list[str]:
    if dialect == "linuxcnc":
        return ["%", "G21 G17 G90 G94 G40 G49 G80 G64 P0.001 Q0", "G54"]
    if dialect in ("fanuc", "haas"):
        return ["%", "O1000", "G21 G17 G90 G94 G40 G49 G80", "G54"]
    if dialect == "siemens":
        return ["G710 G17 G90 G94 G40", "G641 ADIS=0.001 ADISPOS=0.001", "G54"]
    return ["BEGIN PGM 1 MM", "BLK FORM 0.1 Z X-20 Y-20 Z+0", "BLK FORM 0.2 X+20 Y+20 Z+20"]


def _foot(dialect: str) -> list[str]:
    if dialect == "linuxcnc":
        return ["M5", "G53 G0 Z0", "M2", "%"]
    if dialect in ("fanuc", "haas"):
        return ["M5", "G91 G28 Z0.", "G90", "M30", "%"]
    if dialect == "siemens":
        return ["M5", "SUPA G0 Z0 D0", "M30"]
    return ["M5", "L Z+0 R0 FMAX M91", "M30", "END PGM 1 MM"]


def _lines(op: Op, dialect: str, here: list[float]) -> list[str]:
    if op.kind == "raw":
        return [op.text]
    if op.kind == "tool":
        return _change(op, dialect)
    words = [f"{name}{number(v, dialect)}" for name, v in zip("XYZ", (op.x, op.y, op.z), strict=True) if v is not None]
    if dialect == "heidenhain":
        return _plain_text(op, words)
    if op.kind == "arc":
        words = [f"G{2 if op.clockwise else 3}", *words, f"I{number(op.centre[0] - here[0], dialect)}",
                 f"J{number(op.centre[1] - here[1], dialect)}"]
    else:
        words = ["G0" if op.kind == "rapid" else "G1", *words]
    if op.feed is not None:
        words.append(f"F{number(op.feed, dialect)}")
    return [" ".join(words)]


def _plain_text(op: Op, words: list[str]) -> list[str]:
    tail = " R0 FMAX" if op.kind == "rapid" else "" if op.feed is None else f" R0 F{op.feed:g}"
    if op.kind != "arc":
        return [f"L {' '.join(words)}{tail}"]
    centre = f"CC X{number(op.centre[0], 'heidenhain')} Y{number(op.centre[1], 'heidenhain')}"
    return [centre, f"C {' '.join(words)} DR{'-' if op.clockwise else '+'}{tail}"]


def _change(op: Op, dialect: str) -> list[str]:
    spin = [f"S{op.speed} M3"] if op.speed else []
    if dialect == "linuxcnc":
        return ["M5", "G53 G0 Z0", f"T{op.number} M6", f"G43 H{op.number}", *spin]
    if dialect in ("fanuc", "haas"):
        return ["M5", "G91 G28 Z0.", "G90", f"T{op.number} M6", *spin, f"G0 G43 H{op.number} Z{SAFE:g}."]
    if dialect == "siemens":
        return ["M5", "SUPA G0 Z0 D0", f"T{op.number} M6", "D1", *spin]
    return ["M5", "L Z+0 R0 FMAX M91", f"TOOL CALL {op.number} Z S{op.speed}", "M3"]


def made(mechanism: str, part: str, script: Script, kinds: tuple[str, ...] = (), lines: list[Op] | None = None,
         depth: float | None = None, setup: dict[str, Any] | None = None, dialect: str = "linuxcnc", word: str = "",
         what: str = "") -> Case:
    """The case of a finished program; without kinds it is a good one."""
    text, at = written(script, dialect)
    blamed = None if lines is None else frozenset(at[id(op)] for op in lines)
    return Case(mechanism, part, setup or {}, text, dialect, Expected(not kinds, kinds, blamed, depth, word), what)
