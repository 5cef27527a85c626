"""The verifier's own reader of STEP Part 21 text: instances, each with its line [ISO10303-21].

Comments may stand wherever blanks may, statements may span lines, strings hold doubled quotes and the directives
``\\X\\``, ``\\X2\\``, ``\\X4\\``, ``\\S\\``. The reader parses an instance when it is needed, and reads points of three
coordinates, of which paths have millions, all at once. An error of the grammar names its line, an error of an instance
its number and name: ``#123 POLYLINE, points: ...``.

Files are untrusted, so every expression must fail in one pass: repetitions are possessive, and a match does not restart
inside a run of its own letters.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.errors import ProgramError
from geometry.mesh import F64, I32

SHOWN = 60  # characters of the text that an error quotes
DEEPEST = 20  # nested lists
LONGEST = 128  # letters of a name; the longest of the schemas have about 60
_CHUNK = 65_536
_PIECE = 1 << 20
# Only single characters repeat possessively: Python up to 3.11.4 keeps what a group took before it failed half way.
_FLAGS = re.DOTALL | re.ASCII  # blanks are those of ASCII: numpy reads lists of references and knows no others
_NUMBER = r"[-+]?[0-9]++\.[0-9]*+(?>(?:E[-+]?[0-9]++)?)"
_BLANKS = r"(?>(?:\s++|/\*.*?\*/)*)"
_WORD = rf"[A-Z][A-Z0-9_]{{0,{LONGEST - 1}}}+(?![A-Z0-9_])"
_SKIP = re.compile(_BLANKS, _FLAGS)
_BODY = r"(?>(?:[^';/]++|'[^']*+'|/\*.*?\*/|/(?!\*))*)"
_INSTANCE = re.compile(
    rf"{_BLANKS}\#([0-9]{{1,18}}+)\s*+=\s*+(?:CARTESIAN_POINT\s*+\(\s*+'[^'\\]*+'\s*+,\s*+\(\s*+({_NUMBER})\s*+,\s*+"
    rf"({_NUMBER})\s*+,\s*+({_NUMBER})\s*+\)\s*+\)\s*+;|((?>([A-Z][A-Z0-9_]*+)?){_BODY};))", _FLAGS)
_STATEMENT = re.compile(rf"({_BODY});", _FLAGS)
_ASIDE = re.compile(r"'[^']*+'|/\*.*?\*/", _FLAGS)
_ENDING = re.compile(rf"ENDSEC\s*+;{_BLANKS}(END-ISO-10303-21\s*+;)?", _FLAGS)
_TOKEN = re.compile(
    rf"{_BLANKS}(?:(?P<ref>\#[0-9]{{1,18}}+(?![0-9]))|(?P<real>{_NUMBER})|(?P<whole>[-+]?[0-9]{{1,18}}+(?![0-9]))"
    rf"|'(?P<text>(?>(?:[^']++|'')*))'|\.(?P<word>{_WORD})\.|(?P<name>!?{_WORD})|(?P<sign>[(),$*])"
    r"|\"(?P<bits>[0-9A-F]++)\")", _FLAGS)
_FLAT = rf"(?:'[^'\\,()\n\r]*+'|\#[0-9]{{1,18}}+|{_NUMBER}|[$*]|\.{_WORD}\.)"
_FLAT_LIST = rf"\((?>(?:{_FLAT}(?>(?:,{_FLAT})*))?)\)"
_SIMPLE = re.compile(rf"({_WORD})\(((?:{_FLAT}|{_FLAT_LIST})(?>(?:,(?:{_FLAT}|{_FLAT_LIST}))*))\);", _FLAGS)
_PLAIN = re.compile(r"\(([^()]*+)\)|([^,()]++)", _FLAGS)  # a list, or a value outside of one
_NAME = re.compile(r"[A-Z][A-Z0-9_]*+")
_BRACKETS = re.compile(rf"'[^']*+'|/\*.*?\*/|(?<![A-Z0-9_])({_NAME.pattern})|([()])", _FLAGS)
_OPENING = re.compile(rf"{_BLANKS}\(?+{_BLANKS}({_WORD})", _FLAGS)
_POLYLINE = re.compile(r"POLYLINE\s*+\(\s*+'[^'\\]*+'\s*+,\s*+\(((?>(?:\s*+\#[0-9]{1,18}+\s*+,)+)\s*+\#[0-9]{1,18}+"
                       r"\s*+)\)\s*+\)\s*+;", _FLAGS)
_DIRECTIVE = re.compile(r"\\X2\\((?>(?:[0-9A-F]{4})*))\\X0\\|\\X4\\((?>(?:[0-9A-F]{8})*))\\X0\\|\\X\\([0-9A-F]{2})"
                        r"|\\S\\([ -~])|\\P[A-I]\\|(\\\\)", _FLAGS)


class Ref(int):
    """The number of an instance that a value refers to."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f"#{int(self)}"


class EnumItem(str):
    """An enumeration item, without its dots."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f".{self!s}."


@dataclass(frozen=True)
class Typed:
    """A value with the name of its type before it."""

    name: str
    value: object


class Derived:
    """Placeholder ``*`` of a value that follows from others."""

    def __repr__(self) -> str:
        return "*"


DERIVED = Derived()
Value = object
"""float, int, str, EnumItem, Ref, Typed, DERIVED, None for ``$``, or a list of these."""
Record = tuple[str, list[Value]]


class Part21File:
    """An exchange file; coordinates are in the unit and frame of the file.

    name    : of the file, for errors
    header  : values of the header by entity name
    schemas : of FILE_SCHEMA, in capitals, without the object identifiers in braces

    Raises ProgramError where the text is no exchange file, is incomplete, or numbers an instance twice.
    """

    def __init__(self, text: str, name: str) -> None:
        self.name, self._text = name, text
        self._records: dict[int, list[Record]] = {}
        self._names: dict[int, tuple[str, ...]] = {}
        self._spans: dict[int, tuple[int, int]] = {}
        self._named: dict[str, list[int]] = {}
        self._point_ids = self._point_at = np.zeros(0, np.int64)
        self._breaks = _newlines(text)
        begin = self._frame()
        self._scan(begin)
        self.lines = len(self._breaks) + (0 if text.endswith("\n") else 1)

    def of(self, entity: str) -> list[int]:
        """Numbers of the instances of an entity, in file order, complex ones with such a record included."""
        return self._named.get(entity, [])

    def entities(self) -> Mapping[str, Sequence[int]]:
        """Numbers of all instances but plain points, by the names of their records."""
        return self._named

    def has(self, number: int) -> bool:
        """Whether the file has an instance of a number."""
        return number in self._spans or self._point(number) >= 0

    def names(self, number: int) -> tuple[str, ...]:
        """The entity names of an instance: one, or those of the records of a complex one."""
        if number not in self._names:
            if number not in self._spans and self._point(number) >= 0:
                return ("CARTESIAN_POINT",)
            self._names[number] = tuple(name for name, _ in self.records(number))
        return self._names[number]

    def records(self, number: int) -> list[Record]:
        """Names and values of an instance. Raises ProgramError where it breaks the grammar or does not exist."""
        if number not in self._records:
            if number not in self._spans:
                row = self._point(number)
                if row >= 0:
                    return [("CARTESIAN_POINT", ["", self._points[row].tolist()])]
                raise self.error(number, "is not in the file")
            self._records[number] = self._parse(number)
        return self._records[number]

    def line(self, number: int) -> int:
        """1-based line in which an instance begins."""
        span = self._spans.get(number)
        if span is not None:
            return int(self._breaks.searchsorted(span[0])) + 1
        return int(self.lines_of(np.array([number], np.int64))[0])

    def lines_of(self, numbers: NDArray[np.int64]) -> I32:
        """Lines in which instances begin.

        numbers : (n,) int64, index, numbers of instances

        Returns (n,) int32, index, 1-based lines; 0 where there is no such instance.
        """
        row = self.rows(numbers)
        if (row >= 0).all():
            return self._point_lines[row]
        at = np.where(row >= 0, self._point_at[row], -1) if len(self._point_at) else np.full(len(numbers), -1)
        for k in np.flatnonzero(row < 0).tolist():
            span = self._spans.get(int(numbers[k]))
            at[k] = -1 if span is None else span[0]
        return np.where(at < 0, 0, np.searchsorted(self._breaks, at) + 1).astype(np.int32)

    @cached_property
    def _point_lines(self) -> I32:
        """(n,) int32, index: lines of the plain points, from 1."""
        return (np.searchsorted(self._breaks, self._point_at) + 1).astype(np.int32)

    def of_rows(self, rows: NDArray[np.int64]) -> tuple[F64, I32]:
        """Coordinates and lines of plain points.

        rows : (n,) int64, index, as ``rows`` gives them, none of them -1

        Returns (n, 3) float64, mm or the unit of the file, its frame, and (n,) int32, index, 1-based lines.
        """
        return self._points[rows], self._point_lines[rows]

    def points(self, numbers: NDArray[np.int64]) -> F64:
        """Coordinates of points.

        numbers : (n,) int64, index, numbers of instances

        Returns (n, 3) float64, mm or the unit of the file, its frame; nan where an instance is not a plain point of
        three coordinates.
        """
        row = self.rows(numbers)
        out = np.full((len(numbers), 3), np.nan)
        out[row >= 0] = self._points[row[row >= 0]]
        return out

    def coordinates(self, number: int) -> list[float] | None:
        """Coordinates of a plain point, mm or the unit of the file, its frame; None where it is not a plain point."""
        row = self._point(number)
        return None if row < 0 else self._points[row].tolist()

    def plain_polyline(self, number: int) -> NDArray[np.int64] | None:
        """(n,) int64, index: numbers of the points of a POLYLINE; None where it is not a plain list of references."""
        span = self._spans.get(number)
        found = None if span is None else _POLYLINE.match(self._text, span[1])
        return None if found is None else np.fromstring(found.group(1).replace("#", ""), np.int64, sep=",")

    def error(self, number: int, problem: str, also: int | None = None) -> ProgramError:
        """The error that names an instance, and where given a second one that it concerns."""
        span = self._spans.get(number)
        entity = ""
        if self._point(number) >= 0:
            entity = " CARTESIAN_POINT"
        elif span is not None:
            words = _OPENING.match(self._text[span[1]:span[1] + 2 * LONGEST])
            entity = f" {words.group(1)}" if words else ""
        line = (f"line {self.line(number)}",) if self.has(number) and self._breaks.size else ()
        subjects = (f"#{number}", *((f"#{also}",) if also is not None else ()), *line)
        return ProgramError(f"{self.name}, #{number}{entity}{'' if problem.startswith(',') else ' '}{problem}",
                            subjects=subjects, remedy="correct the named instance")

    def _broken(self, at: int, problem: str) -> ProgramError:
        line = self._text.count("\n", 0, at) + 1
        return ProgramError(f"{self.name}, line {line}: {problem}", subjects=(f"line {line}",),
                            measured=self._text[at:at + SHOWN], remedy="send the whole STEP-NC file as it was written")

    def _point(self, number: int) -> int:
        k = int(self._point_ids.searchsorted(number))
        return k if k < len(self._point_ids) and self._point_ids[k] == number else -1

    def rows(self, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of plain points, those with three numbers.

        numbers : (n,) int64, index, numbers of instances

        Returns (n,) int64, index; -1 where an instance is not a plain point.
        """
        if not len(self._point_ids):
            return np.full(len(numbers), -1, np.int64)
        k = np.minimum(np.searchsorted(self._point_ids, numbers), len(self._point_ids) - 1)
        return np.where(self._point_ids[k] == numbers, k, -1).astype(np.int64)

    def _frame(self) -> int:
        """Read the header; returns where the instances begin."""
        self.header: dict[str, list[Value]] = {}
        at = 0
        sections: list[str] = []
        while True:
            at = _SKIP.match(self._text, at).end()  # type: ignore[union-attr]
            found = _STATEMENT.match(self._text, at)
            if found is None:
                raise self._broken(at, "the text ends before the data section")
            words = " ".join(_ASIDE.sub(" ", found.group(1)).split())
            if not sections and words != "ISO-10303-21":
                raise self._broken(at, "a STEP file must begin with ISO-10303-21;")
            if words.startswith("DATA"):
                break
            if "(" in words:
                self.header.update(self._values(found.group(1), at))
            sections.append(words)
            at = found.end()
        self.schemas = tuple(str(s).split("{")[0].strip().upper() for s in self._schema_list())
        return found.end()

    def _schema_list(self) -> list[Value]:
        given = self.header.get("FILE_SCHEMA", [[]])
        return given[0] if given and isinstance(given[0], list) else []

    def _scan(self, at: int) -> None:
        """Find all instances up to the end of the section, and read the coordinates of points."""
        text, match = self._text, _INSTANCE.match
        numbers: list[int] = []
        words: list[str] = []
        places: list[int] = []
        chunks: list[tuple[NDArray[np.int64], F64, NDArray[np.int64]]] = []

        def pack() -> None:
            chunks.append((np.array(numbers, np.int64), np.array(words, dtype=object).astype(np.float64).reshape(-1, 3),
                           np.array(places, np.int64)))
            for gathered in (numbers, words, places):
                gathered.clear()

        while (found := match(text, at)) is not None:
            body = found.group(5)
            number = int(found.group(1))
            if body is None:
                numbers.append(number)
                words += found.group(2, 3, 4)
                places.append(found.start(1))
                if len(numbers) >= _CHUNK:
                    pack()
            else:
                if number in self._spans:
                    raise self._broken(found.start(1), f"#{number} appears twice")
                self._spans[number] = found.start(1), found.start(5)
                names = [found.group(6)] if found.group(6) else _entity_names(body)
                for name in names:
                    if len(name) > LONGEST:
                        raise self.error(number, _too_long(name))
                    self._named.setdefault(name, []).append(number)
                if names:  # known without the values, of which there may be many
                    self._names[number] = tuple(names)
            at = found.end()
        pack()
        self._points = np.concatenate([c[1] for c in chunks])
        ids, places_ = (np.concatenate([c[k] for c in chunks]) for k in (0, 2))
        order = np.argsort(ids, kind="stable")
        self._point_ids, self._point_at, self._points = ids[order], places_[order], self._points[order]
        twice = self._point_ids[1:][self._point_ids[1:] == self._point_ids[:-1]].tolist()
        other = np.fromiter(self._spans, np.int64, len(self._spans))
        twice += other[np.isin(other, self._point_ids)].tolist()
        if twice:
            raise self._broken(self._spans.get(twice[0], (0, 0))[0], f"#{twice[0]} appears twice")
        self._end(at)

    def _end(self, at: int) -> None:
        at = _SKIP.match(self._text, at).end()  # type: ignore[union-attr]
        tail = _ENDING.match(self._text, at)
        if tail is None:
            raise self._broken(at, "an instance, #number=NAME(...);, or the end of the section is expected")
        if tail.group(1) is None:
            raise self._broken(tail.end(), "END-ISO-10303-21; is expected: the text is incomplete, or has another "
                                           "section, which is not read")

    def _parse(self, number: int) -> list[Record]:
        span = self._spans[number]
        simple = _SIMPLE.match(self._text, span[1])
        if simple is not None:  # most are: no blanks, no lists in lists, strings without directives
            return [(simple.group(1), _plain_values(simple.group(2)))]
        found = _STATEMENT.match(self._text, span[1])
        if found is None:
            raise self.error(number, "is incomplete")
        return self._values(found.group(1), span[1], number)

    def _values(self, text: str, at: int, number: int | None = None) -> list[Record]:
        """The records of a statement."""
        try:
            return _Tokens(text).records()
        except _Grammar as problem:
            if number is not None:
                raise self.error(number, str(problem)) from None
            raise self._broken(at, str(problem)) from None


def _newlines(text: str) -> NDArray[np.int64]:
    """(n,) int64: ends of the lines of a text, found piece by piece to save memory."""
    found = [low + np.flatnonzero(np.frombuffer(text[low:low + _PIECE].encode("ascii", "replace"), np.uint8) == 10)
             for low in range(0, len(text), _PIECE)]
    return np.concatenate([np.zeros(0, np.int64), *found])


def _entity_names(body: str) -> list[str]:
    """Names of the records of an instance."""
    at = _SKIP.match(body).end()  # type: ignore[union-attr]
    if body[at:at + 1] != "(":
        found = _NAME.match(body, at)
        return [found.group()] if found else []
    out, depth = [], 0
    for m in _BRACKETS.finditer(body):
        if m.group(1) and depth == 1:
            out.append(m.group(1))
        elif m.group(2):
            depth += 1 if m.group(2) == "(" else -1
    return out


def _plain_values(text: str) -> list[Value]:
    """The values of a simple statement."""
    if "(" not in text:
        return [Ref(word[1:]) if word[0] == "#" else _plain(word) for word in text.split(",")]
    return [[_plain(word) for word in inner.split(",") if word] if word == "" else _plain(word)
            for inner, word in _PLAIN.findall(text)]


def _plain(word: str) -> Value:
    """The value of a word of a simple statement."""
    first = word[0]
    if first == "#":
        return Ref(word[1:])
    if first == "'":
        return word[1:-1]
    if first == "$":
        return None
    if first == ".":
        return EnumItem(word[1:-1])
    return DERIVED if first == "*" else float(word)


def _too_long(name: str) -> str:
    return f"has a name of {len(name)} letters, {name[:20]}... ({LONGEST} allowed)"


class _Grammar(Exception):
    """An error of the grammar in one statement."""


class _Tokens:
    """The values of one statement, left to right."""

    def __init__(self, text: str) -> None:
        self._tokens = list(self._split(text))
        self._at = self._depth = 0

    @staticmethod
    def _split(text: str) -> Iterator[tuple[str, str]]:
        at = 0
        while at < len(text):
            found = _TOKEN.match(text, at)
            if found is None:
                rest = _SKIP.match(text, at)
                if rest is not None and rest.end() == len(text):
                    return
                at = len(text) if rest is None else rest.end()
                name = _NAME.match(text, at)
                if name is not None and len(name.group()) > LONGEST:
                    raise _Grammar(_too_long(name.group()))
                raise _Grammar(f"holds {text[at:at + SHOWN].strip()!r}, which is not a value")
            yield str(found.lastgroup), found.group(str(found.lastgroup))
            at = found.end()

    def records(self) -> list[Record]:
        """One record, or those in the brackets of a complex instance."""
        out: list[Record] = []
        if self._peek() == ("sign", "("):
            self._at += 1
            while self._peek() != ("sign", ")"):
                out.append(self._record())
            self._at += 1
        else:
            out.append(self._record())
        if self._at < len(self._tokens) or not out:
            raise _Grammar("has more or less than one record")
        return out

    def _record(self) -> Record:
        kind, name = self._next()
        if kind != "name":
            raise _Grammar(f"has {name!r} where the name of an entity is expected")
        return name, self._list()

    def _list(self) -> list[Value]:
        if self._next() != ("sign", "("):
            raise _Grammar("lacks an opening bracket")
        self._depth += 1
        if self._depth > DEEPEST:
            raise _Grammar(f"has more than {DEEPEST} nested lists")
        out: list[Value] = []
        if self._peek() == ("sign", ")"):
            self._at += 1
            self._depth -= 1
            return out
        while True:
            out.append(self._value())
            sign = self._next()
            if sign == ("sign", ")"):
                self._depth -= 1
                return out
            if sign != ("sign", ","):
                raise _Grammar(f"has {sign[1]!r} where a comma or a closing bracket is expected")

    def _value(self) -> Value:
        kind, word = self._peek()
        if kind == "sign" and word == "(":
            return self._list()
        self._at += 1
        if kind == "ref":
            return Ref(word[1:])
        if kind == "real":
            return float(word)
        if kind == "whole":
            return int(word)
        if kind == "text":
            return decoded(word)
        if kind == "word":
            return EnumItem(word)
        if kind == "bits":
            return Typed("BINARY", word)
        if kind == "name":
            inner = self._list()
            if len(inner) != 1:
                raise _Grammar(f"gives {word} {len(inner)} values; a type has one")
            return Typed(word, inner[0])
        if word == "$":
            return None
        if word == "*":
            return DERIVED
        raise _Grammar(f"has {word!r} where a value is expected")

    def _peek(self) -> tuple[str, str]:
        if self._at >= len(self._tokens):
            raise _Grammar("is incomplete")
        return self._tokens[self._at]

    def _next(self) -> tuple[str, str]:
        token = self._peek()
        self._at += 1
        return token


def decoded(text: str) -> str:
    """The text of a string of the file: doubled quotes made single, directives decoded [ISO10303-21]."""
    text = text.replace("''", "'")
    if "\\" not in text:
        return text.replace("\n", "").replace("\r", "")

    def meant(m: re.Match[str]) -> str:
        wide, wider, byte, shifted, slash = m.groups()
        if wide is not None:
            return bytes.fromhex(wide).decode("utf-16-be", "replace")
        if wider is not None:
            return bytes.fromhex(wider).decode("utf-32-be", "replace")
        if byte is not None:
            return chr(int(byte, 16))
        if shifted is not None:
            return chr(ord(shifted) + 128)
        return "\\" if slash else ""

    return _DIRECTIVE.sub(meant, text.replace("\n", "").replace("\r", ""))


def is_exchange_file(text: str) -> bool:
    """Whether a text begins like a STEP Part 21 file, after comments and blanks [ISO10303-21]."""
    start = _SKIP.match(text.lstrip("\ufeff")[:100_000])
    rest = text.lstrip("\ufeff")[start.end() if start else 0:][:40]
    return re.match(r"ISO-10303-21\s*;", rest) is not None
