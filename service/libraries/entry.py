"""An entry of a tool library in one form for all formats: identity, numbers, dimensions, holder, speeds and feeds.

Readers fill entries and judge nothing; ``service.libraries.conversion`` makes tools of them. Names of dimensions are
those of ``schemas.tools.Tool``, with two more: ``cone_tip_diameter_mm``, the diameter at which the cone of a tapered
mill would end without its rounding, and ``overall_length_mm``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from geometry.errors import LibraryError
from schemas.tools import Tool

MAX_ENTRIES = 20_000
MAX_SEGMENTS = 50
MM_PER_INCH = 25.4
_NUMBER = re.compile(r"[-+]?(?:\d{1,9}(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d{1,3})?")
_UNIT_WORDS = {"mm": "mm", "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm",
               "metric": "mm", "in": "in", "inch": "in", "inches": "in", "imperial": "in", '"': "in", "english": "in"}


class Unit(StrEnum):
    """Unit of the lengths of a library."""

    MM = "mm"
    INCH = "in"

    def to_mm(self, value: float) -> float:
        """A length in mm, without the noise of the conversion.

        >>> Unit.INCH.to_mm(0.25), Unit.MM.to_mm(6)
        (6.35, 6.0)
        """
        return float(value) if self is Unit.MM else round(value * MM_PER_INCH, 9)

    @staticmethod
    def of(word: Any) -> Unit | None:
        """The unit that a word of a library means; None for any other word.

        >>> Unit.of("Millimeters"), Unit.of("inch"), Unit.of("parsec")
        (<Unit.MM: 'mm'>, <Unit.INCH: 'in'>, None)
        """
        found = _UNIT_WORDS.get(str(word).strip().casefold())
        return None if found is None else Unit(found)


def to_number(raw: Any) -> float:
    """A number of a library; texts may have a decimal comma.

    Raises ValueError for anything else, for nan and for infinity.

    >>> to_number("1,588"), to_number(3), to_number(" .5 ")
    (1.588, 3.0, 0.5)
    """
    if isinstance(raw, bool) or not isinstance(raw, int | float | str):
        raise ValueError(f"{raw!r} is not a number")
    if isinstance(raw, str):
        if not _NUMBER.fullmatch(raw.strip()):
            raise ValueError(f"'{shown(raw)}' is not a number")
        raw = raw.strip().replace(",", ".")
    value = float(raw)
    if not math.isfinite(value):
        raise ValueError(f"{value} is not a number")
    return value


def shown(text: Any, most: int = 60) -> str:
    """A text of a library for a message: one line without control characters, shortened."""
    # a text of a library may have megabytes
    line = " ".join("".join(c if c.isprintable() else " " for c in str(text)[:20 * most]).split())
    return line if len(line) <= most else line[:most - 3] + "..."


@dataclass(frozen=True)
class Segment:
    """A segment of a holder, upwards from its nose; lengths mm."""

    diameter: float
    diameter_top: float
    length: float


@dataclass
class Preset:
    """Speeds and feeds of an entry in a material; material None: any.

    spindle_rpm : 1/min; feed, plunge_feed : mm/min; cutting_speed : m/min; feed_per_tooth : mm
    """

    name: str = ""
    material: str | None = None
    spindle_rpm: float | None = None
    feed: float | None = None
    plunge_feed: float | None = None
    cutting_speed: float | None = None
    feed_per_tooth: float | None = None


@dataclass
class Entry:
    """One entry of a library.

    place       : where it stands in the library, such as "entry 3" or "line 12"
    kind        : 'mill' (its end by the corner radius), 'tapered', or a kind of ``Tool``; "" where it is unknown
    stated_kind : the kind in the words of the library
    library_id  : the library's own id; never a pocket
    t_number, h_number, d_number, pocket : as the library states them
    values      : dimensions and counts by name; lengths mm, angles deg
    notes       : what the reader could not take over
    problem     : why the entry cannot be taken; "" where it can
    tool        : the tool, where the library is one of this program
    """

    place: str
    kind: str = ""
    stated_kind: str = ""
    library_id: str = ""
    description: str = ""
    order_code: str = ""
    t_number: int | None = None
    h_number: int | None = None
    d_number: int | None = None
    pocket: int | None = None
    coolant: str | None = None
    values: dict[str, Any] = field(default_factory=dict)
    holder: list[Segment] = field(default_factory=list)
    presets: list[Preset] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    problem: str = ""
    tool: Tool | None = None

    @property
    def name(self) -> str:
        """Place and id or description, as messages name the entry."""
        words = shown(self.library_id or self.description, 40)
        return f"{self.place} '{words}'" if words else self.place

    def note(self, text: str) -> None:
        """Add a note, once."""
        if text not in self.notes:
            self.notes.append(text)

    def leave_out(self, reason: str) -> None:
        """State why the entry cannot be taken; the first reason stays."""
        self.problem = self.problem or reason

    def length(self, key: str, raw: Any, unit: Unit, *, zero: bool = False) -> None:
        """Set a length, mm; a blank is no statement, and neither is 0 unless ``zero``."""
        self._set(key, raw, zero, unit.to_mm)

    def number(self, key: str, raw: Any, *, zero: bool = False) -> None:
        """Set an angle or another number; a blank is no statement, and neither is 0 unless ``zero``."""
        self._set(key, raw, zero, float)

    def count(self, key: str, raw: Any) -> None:
        """Set a whole number above 0; a blank and 0 are no statement."""
        value = self.read(key, raw)
        if value is None or value == 0:
            return
        if value != int(value) or value < 0:
            self.leave_out(f"{key} {value:g} is not a whole number")
        else:
            self.values[key] = int(value)

    def read(self, key: str, raw: Any) -> float | None:
        """A number of the library; None for a blank. A text that is none is a problem of the entry."""
        if raw is None or (isinstance(raw, str) and not raw.strip()):
            return None
        try:
            return to_number(raw)
        except ValueError as error:
            self.leave_out(f"{key}: {error}")
            return None

    def whole(self, key: str, raw: Any) -> int | None:
        """A T, H or D number or a pocket; None for a blank, and with a note for anything that is no whole number."""
        value = self.read(key, raw)
        if value is None:
            return None
        if value != int(value) or value < 0:
            self.note(f"{key} {value:g} is not a whole number; it is left out")
            return None
        return int(value)

    def segment(self, lower: Any, upper: Any, height: Any, unit: Unit) -> None:
        """Add a holder segment with diameters at its lower and upper end; one without height is none."""
        numbers = [self.read(f"holder segment {len(self.holder) + 1}", raw) for raw in (lower, upper, height)]
        low, top, high = (None if v is None else unit.to_mm(v) for v in numbers)
        if high == 0:
            return
        if low is None or top is None or high is None or min(low, top, high) <= 0:
            self.leave_out(f"holder segment {len(self.holder) + 1} has no diameter or no length")
            return
        self.holder.append(Segment(low, top, high))

    def _set(self, key: str, raw: Any, zero: bool, convert: Callable[[float], float]) -> None:
        value = self.read(key, raw)
        if value is None or (value == 0 and not zero):
            return
        if value < 0:
            self.leave_out(f"{key} {value:g} is below 0")
        else:
            self.values[key] = convert(value)


@dataclass(frozen=True)
class Source:
    """What a reader may know besides the bytes of a library.

    name     : of the file, for messages
    unit     : as the caller states it; None: the library must state it
    encoding : of texts, as the caller states it; None: UTF-8, or as a byte order mark or an XML declaration says
    beside   : bytes of a file that stands beside the library, by its name; None where there is none
    """

    name: str = "library"
    unit: Unit | None = None
    encoding: str | None = None
    beside: Callable[[str], bytes | None] = lambda name: None

    def unit_of(self, entry: Entry, word: Any = None) -> Unit:
        """The unit of an entry: as the library states it, else as the caller does.

        word : what the library states; None or blank: nothing

        Raises
        ------
        LibraryError
            unit_missing: neither states it. unknown_unit: the library states one that is neither mm nor inch.
        """
        if word is None or not str(word).strip():
            if self.unit is not None:
                return self.unit
            raise LibraryError(f"{entry.name} does not state the unit of its lengths: are they mm or inches?",
                               code="unit_missing", subjects=(entry.name,), limit=[u.value for u in Unit],
                               remedy="state the unit: --unit mm or --unit in, over HTTP unit=mm or unit=in")
        found = Unit.of(word)
        if found is None:
            raise LibraryError(f"{entry.name} states the unit '{shown(word)}', which is neither mm nor inch",
                               code="unknown_unit", subjects=(entry.name,), measured=shown(word),
                               limit=[u.value for u in Unit], remedy="correct the unit of this entry")
        if self.unit is not None and self.unit is not found:
            entry.note(f"the library states {found.value}, so the stated unit {self.unit.value} is not used")
        return found


def check_count(count: int) -> None:
    """Refuse a library of too many entries.

    Raises
    ------
    LibraryError
        too_many_entries: more than ``MAX_ENTRIES``.
    """
    if count > MAX_ENTRIES:
        raise LibraryError(f"the library has {count} entries, more than {MAX_ENTRIES}", code="too_many_entries",
                           measured=count, limit=MAX_ENTRIES, remedy="split the library")
