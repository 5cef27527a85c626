"""Import and export of a whole library: bytes into tools with a verdict for each entry, and tools into bytes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from geometry.errors import LibraryError
from schemas.tools import Tool, default_numbers
from service.libraries.containers import ENCODINGS, MAX_LIBRARY_BYTES
from service.libraries.conversion import LEFT_OUT, NOTED, TAKEN, Converted, converted
from service.libraries.entry import Entry, Preset, Source, shown
from service.libraries.formats import setup_tools
from service.libraries.registry import FORMATS, ONE_SPEED, SPEEDS, WRITTEN, Format, format_of
from service.libraries.tool_entry import VALUES, tool_entry

_DERIVED = frozenset({"neck_diameter_mm", "neck_length_mm", "flute_length_mm", "shank_diameter_mm", "stickout_mm"})


@dataclass(frozen=True)
class ImportedLibrary:
    """A library as it was read: its format, and what became of each entry, in its order."""

    format: Format
    entries: tuple[Converted, ...]

    @property
    def tools(self) -> list[Tool]:
        """The tools of the entries that were taken, with notes or without."""
        return [e.tool for e in self.entries if e.tool is not None]

    @property
    def counts(self) -> dict[str, int]:
        """How many entries have each verdict."""
        return {v: sum(e.verdict == v for e in self.entries) for v in (TAKEN, NOTED, LEFT_OUT)}


@dataclass(frozen=True)
class WrittenLibrary:
    """A library as it was written.

    losses : by tool id, fields of the tool that the format has no place for
    left_out : by tool id, why the tool is not in the library
    """

    format: Format
    data: bytes
    losses: dict[str, tuple[str, ...]]
    left_out: dict[str, str]


def import_library(data: bytes, source: Source, wanted: str | None = None) -> ImportedLibrary:
    """Read a library.

    wanted : name of its format; None: by its content

    Raises
    ------
    LibraryError
        empty_library, library_too_large, unknown_encoding; or as ``format_of`` and the reader of the format.
    """
    if not data.strip(b"\xef\xbb\xbf \t\r\n\x00"):
        raise LibraryError(f"{shown(source.name)} is empty", code="empty_library", measured=len(data), limit=1,
                           remedy="send the file of a tool library")
    if len(data) > MAX_LIBRARY_BYTES:
        raise LibraryError(f"{shown(source.name)} has {len(data) / 1e6:.0f} MB, more than "
                           f"{MAX_LIBRARY_BYTES / 1e6:g}", code="library_too_large", measured=len(data),
                           limit=MAX_LIBRARY_BYTES, remedy="split the library")
    if source.encoding is not None and source.encoding not in ENCODINGS:
        raise LibraryError(f"the encoding '{shown(source.encoding)}' is not read", code="unknown_encoding",
                           measured=shown(source.encoding), limit=list(ENCODINGS), remedy="state one of these, or "
                           "leave it out")
    kind = format_of(data, source, wanted)
    entries = kind.read(data, source)
    if not entries:
        raise LibraryError(f"{shown(source.name)} has no tools", code="empty_library", measured=0, limit=1,
                           remedy=f"send a library with entries; it was read as {kind.name}")
    return ImportedLibrary(kind, tuple(converted(entries)))


def export_library(tools: Sequence[Tool], name: str) -> WrittenLibrary:
    """Write tools as a library of a format.

    Raises
    ------
    LibraryError
        unknown_format: there is no such format, or it is read only. no_tools: there are no tools, or the format has
        no place for any of their kinds. bad_numbers: two tools have one id or number.
    """
    if name not in WRITTEN:
        raise LibraryError(f"libraries are not written as '{shown(name)}'", code="unknown_format",
                           measured=shown(name), limit=list(WRITTEN), remedy="state one of these formats")
    kind = FORMATS[name]
    if not tools:
        raise LibraryError("there are no tools to write", code="no_tools", measured=0, limit=1,
                           remedy="give at least one tool")
    if kind.write is None:
        return WrittenLibrary(kind, setup_tools.write(tools), {}, {})
    numbers = _numbers(tools) if name == "linuxcnc" else {}
    entries, losses, left_out = [], {}, {}
    for k, tool in enumerate(tools, start=1):
        if tool.kind not in kind.kinds:
            left_out[tool.id] = f"{kind.title} has no kind {tool.kind}"
            continue
        entry = tool_entry(tool, f"tool {k}")
        entry.t_number = numbers.get(tool.id, entry.t_number)
        lost = _cut_down(entry, kind)
        if lost:
            losses[tool.id] = lost
        entries.append(entry)
    if not entries:
        raise LibraryError(f"{kind.title} has no place for the kinds of these tools", code="no_tools",
                           subjects=tuple(left_out)[:20], limit=sorted(kind.kinds), remedy="use another format")
    return WrittenLibrary(kind, kind.write(entries), losses, left_out)


def _numbers(tools: Sequence[Tool]) -> dict[str, int]:
    try:
        return default_numbers(list(tools))
    except ValueError as error:
        raise LibraryError(str(error), code="bad_numbers", remedy="give each tool its own id and number") from None


def _cut_down(entry: Entry, kind: Format) -> tuple[str, ...]:
    """Leave in an entry what the format carries; returns the names of what is lost."""
    lost = [n for n in VALUES if n in entry.values and n not in kind.carried
            and not (n in ("corner_radius_mm", "taper_angle_deg") and not entry.values[n])
            and not (n == "corner_radius_mm" and entry.kind == "ball")]
    for name in lost:
        del entry.values[name]
    if "holder" not in kind.carried and entry.holder:
        lost.append("holder")
        entry.holder = []
    if "coolant" not in kind.carried and entry.coolant:
        lost.append("coolant")
        entry.coolant = None
    for name, value in (("number", entry.t_number), ("order_code", entry.order_code),
                        ("description", entry.description)):
        if value and name not in kind.carried:
            lost.append(name)
    lost += _cut_presets(entry, kind)
    return tuple(lost)


def _cut_presets(entry: Entry, kind: Format) -> list[str]:
    """Leave in an entry the presets that the format carries: all, one without a material, or none."""
    if SPEEDS in kind.carried or not entry.presets:
        return []
    kept: list[Preset] = [p for p in entry.presets if p.material is None][:1] if ONE_SPEED in kind.carried else []
    lost = len(kept) < len(entry.presets)
    entry.presets = kept
    return ["cutting_data"] if lost else []
