r"""STEP Part 21 text: entity numbers, strings, reals, and many points at once.

It uses only the plain subset that every known reader accepts: reals with a decimal point, without exponent and without
minus zero; non-ASCII as ``\X2\``; mandatory aggregates as ``()``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Sequence
from datetime import UTC, datetime

from geometry.errors import InternalError, OutputError
from geometry.mesh import F64
from output.gcode.proof_header import AWAITED, LINES
from output.program_grid import I64, PER_MM

Write = Callable[[str], object]
_LINES_A_PIECE = 4096
_REFS_A_LINE = 12
_TEXT_LIMIT = 256  # characters of a string in FILE_DESCRIPTION and FILE_NAME, ISO 10303-21 section 8.2
_RUNS = re.compile(r"['\\]|[^ -~\U00010000-\U0010ffff]+|[\U00010000-\U0010ffff]")


def with_proof(head: str, figures: Sequence[str]) -> str:
    """The first lines of a file with the figures of a proof in place of the reserved lines of its description.

    head    : with the whole FILE_DESCRIPTION, written from a plan whose ``figures`` are
              ``output.gcode.proof_header.AWAITED``
    figures : as many lines

    Raises
    ------
    InternalError
        no_room: the reserved lines are missing, or their number is another.
    """
    reserved = ",".join(quoted(line) for line in AWAITED)
    if len(figures) != LINES or head.count(reserved) != 1:
        raise InternalError("the figures of the proof do not fit into the header of STEP-NC", code="no_room",
                            measured=[len(figures), head.count(reserved)], limit=[LINES, 1])
    return head.replace(reserved, ",".join(quoted(line[:_TEXT_LIMIT]) for line in figures))


class Part21Writer:
    """A file being written, one instance after the other; every ``add`` returns the number of its instance.

    write : receives the text in pieces, in order, so that the whole file is never in memory
    description, name, schema, system : text of the header
    """

    def __init__(self, write: Write, *, description: Sequence[str], name: str, schema: Sequence[str],
                 system: str) -> None:
        limited = ",".join(quoted(d[:_TEXT_LIMIT]) for d in description)
        self._write = write
        self._count = 0
        self._lines = [
            "ISO-10303-21;", "HEADER;", f"FILE_DESCRIPTION(({limited}),'2;1');",
            f"FILE_NAME({quoted(name)},'{time_stamp()}',(''),(''),{quoted(system)},{quoted(system)},'');",
            f"FILE_SCHEMA(({','.join(quoted(s) for s in schema)}));", "ENDSEC;", "DATA;",
        ]

    def add(self, record: str) -> int:
        """Add ``NAME(...)`` or a complex ``(A() B())`` and return its number."""
        self._count += 1
        self.fill(self._count, record)
        return self._count

    def reserve(self) -> int:
        """A number for an instance that ``fill`` writes later."""
        self._count += 1
        return self._count

    def fill(self, number: int, record: str) -> None:
        """Write the instance of a reserved number."""
        self._lines.append(f"#{number}={record};")
        if len(self._lines) >= _LINES_A_PIECE:
            self._flush()

    def points(self, points: I64) -> int:
        """Add CARTESIAN_POINTs; returns the number of the first, the others follow it.

        points : (n, 3) int64, setup frame, grid steps of 0.0001 mm
        """
        first = self._count + 1
        for low in range(0, len(points), _LINES_A_PIECE):
            rows = (points[low:low + _LINES_A_PIECE] / PER_MM + 0.0).tolist()
            self._lines += [
                "#%d=CARTESIAN_POINT('',(%.4f,%.4f,%.4f));" % (i, x, y, z)  # noqa: UP031  twice as fast as format here
                for i, (x, y, z) in enumerate(rows, start=self._count + 1)
            ]
            self._count += len(rows)
            self._flush()
        return first

    def vectors(self, vectors: F64) -> list[int]:
        """Add CARTESIAN_POINTs for unit vectors and return their numbers; a repeated vector is written once.

        vectors : (n, 3) float64, setup frame, dimensionless unit vectors
        """
        out: list[int] = []
        before = ""
        for row in (vectors + 0.0).tolist():
            words = reals(row, 9)
            if words != before:
                number, before = self.add(f"CARTESIAN_POINT('',{words})"), words
            out.append(number)
        return out

    def close(self) -> None:
        """Write the rest and the end of the file."""
        self._lines += ["ENDSEC;", "END-ISO-10303-21;"]
        self._flush()

    def _flush(self) -> None:
        self._write("\n".join(self._lines) + "\n")
        self._lines.clear()


def quoted(text: str) -> str:
    r"""A Part 21 string [ISO10303-21]: quotes and backslashes doubled, other characters as \X2\ or \X4\."""
    if text.isascii() and text.isprintable():
        return "'" + text.replace("\\", "\\\\").replace("'", "''") + "'"
    return "'" + _RUNS.sub(_spelt, text) + "'"


def _spelt(run: re.Match[str]) -> str:
    """A doubled character, or the codes of characters: those of two bytes in one group, others singly."""
    letters = run.group()
    if letters in ("'", "\\"):
        return 2 * letters
    if len(letters) == 1 and ord(letters) >= 0x10000:
        return f"\\X4\\{ord(letters):08X}\\X0\\"
    return "\\X2\\" + "".join(f"{ord(c):04X}" for c in letters) + "\\X0\\"


def real(value: float, digits: int = 4) -> str:
    """A Part 21 real [ISO10303-21] with at most ``digits`` decimals: '12.5', '0.', never '-0.', never an exponent.

    Raises
    ------
    OutputError
        bad_number: the value is not finite.
    """
    if not abs(value) < 1.0e12:
        raise OutputError("a number is not finite", code="bad_number", measured=repr(value))
    text = f"{value:.{digits}f}".rstrip("0")
    return "0." if text in ("-0.", "0.") else text


def reals(values: Iterable[float], digits: int = 4) -> str:
    """'(1.,2.,3.)'."""
    return "(" + ",".join(real(v, digits) for v in values) + ")"


def refs(numbers: Iterable[int]) -> str:
    """'(#4,#5)', with line breaks where it is long."""
    words = [f"#{n}" for n in numbers]
    rows = [",".join(words[i:i + _REFS_A_LINE]) for i in range(0, len(words), _REFS_A_LINE)]
    return "(" + ",\n".join(rows) + ")"


def time_stamp() -> str:
    """1970-01-01T00:00:00, or the time in SOURCE_DATE_EPOCH (s), so that equal input gives equal bytes.

    Raises
    ------
    OutputError
        bad_epoch: SOURCE_DATE_EPOCH is not a number of seconds.
    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "0").strip() or "0"
    if not epoch.isdigit():
        raise OutputError("SOURCE_DATE_EPOCH is not a number of seconds", code="bad_epoch", subjects=(epoch,))
    return datetime.fromtimestamp(int(epoch), tz=UTC).strftime("%Y-%m-%dT%H:%M:%S")
