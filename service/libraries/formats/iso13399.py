"""ISO 13399 and GTC: a Part 21 file of CUTTING_TOOL_SCHEMA_ARM for each tool, or a zip file of such files.

NUMERICAL_VALUE and STRING_VALUE instances hold the properties by the symbols of ISO 13399. The file of an item names
its kind in its descriptions.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from geometry.errors import LibraryError, ProgramError
from output.stepnc.part21 import quoted
from service.libraries.containers import Archive, is_zip, text_of, zipped
from service.libraries.entry import Entry, Source, check_count, shown
from service.libraries.formats.kind_words import kind_of_words
from verify.stepnc.part21 import Part21File, Ref

SCHEMA = "CUTTING_TOOL_SCHEMA_ARM"
LENGTHS = {"DC": "diameter_mm", "RE": "corner_radius_mm", "APMX": "flute_length_mm", "APMXS": "flute_length_mm",
           "DCONMS": "shank_diameter_mm", "DMM": "shank_diameter_mm", "DN": "neck_diameter_mm",
           "LN": "neck_length_mm", "LU": "neck_length_mm", "OAL": "overall_length_mm", "TP": "pitch_mm",
           "LPR": "stickout_mm"}
"""The first of two symbols with one meaning is written; the last that a file states is read."""
TEETH = ("ZEFF", "NOF", "PCEDC", "CEDC")
_NAMES = {"flat": "END MILL", "ball": "BALL NOSE END MILL", "bull": "TORUS END MILL", "drill": "DRILL", "tap": "TAP",
          "thread_mill": "THREAD MILL"}
KINDS = tuple(_NAMES)
_ENTRY_FILE = re.compile(r"\.(p21|stp|step|spf)$", re.IGNORECASE)


def read(data: bytes, source: Source) -> list[Entry]:
    """Entries of a file or of the files in a zip file.

    Raises
    ------
    LibraryError
        library_cut_off, library_not_part21: the subject is the file. several_items: one file holds several tools, so
        that the properties cannot be told apart. Or as the containers and ``Source.unit_of``.
    """
    if not is_zip(data):
        return [_entry(data, source.name, 1, source)]
    archive = Archive(data)
    names = [n for n in archive.names if _ENTRY_FILE.search(n)]
    check_count(len(names))
    tools = [(n, archive.read(n)) for n in names]
    # packages also hold models of the tools, which are STEP files of another schema
    tools = [(n, d) for n, d in tools if SCHEMA.encode() in d[:4000].upper()]
    return [_entry(d, n, k, source) for k, (n, d) in enumerate(tools, start=1)]


def _entry(data: bytes, name: str, place: int, source: Source) -> Entry:
    entry = Entry(f"entry {place}")
    try:
        file = Part21File(text_of(data, source.encoding or "utf-8"), shown(name))
        items = [file.records(n)[0][1] for n in file.of("ITEM")]
        numbers = [file.records(n)[0][1] for n in file.of("NUMERICAL_VALUE")]
        strings = [file.records(n)[0][1] for n in file.of("STRING_VALUE")]
        units = {n: file.records(n)[0][1] for n in file.of("UNIT")}
        texts = {n: file.records(n)[0][1] for n in file.of("STRING_WITH_LANGUAGE")}
        words = {n: file.records(n)[0][1] for n in file.of("MULTI_LANGUAGE_STRING")}
    except ProgramError as error:
        cut = b"END-ISO-10303-21" not in data[-200:]
        raise LibraryError(error.message, code="library_cut_off" if cut else "library_not_part21",
                           subjects=(shown(name), *error.subjects), measured=error.measured,
                           remedy="export the tool once more, and send the whole file") from None
    if len(items) != 1:
        raise LibraryError(f"{shown(name)} holds {len(items)} items; one file holds one tool", code="several_items",
                           subjects=(shown(name),), measured=len(items), limit=1,
                           remedy="export one file for each tool, and send them in a zip file")

    def said(ref: Any) -> str:
        values = words.get(int(ref)) if isinstance(ref, Ref) else None
        refs = [r for v in values or [] for r in (v if isinstance(v, list) else [v])]
        found = [str(texts[int(r)][0]) for r in refs if isinstance(r, Ref) and int(r) in texts]
        return found[0] if found else ""

    item = items[0]
    entry.library_id = next((str(v) for v in item if isinstance(v, str)), "")
    spoken = [s for s in (said(v) for v in item) if s]
    entry.description = spoken[0] if spoken else ""
    entry.order_code = entry.library_id
    entry.stated_kind = next((s for s in spoken if kind_of_words(s)), entry.description)
    entry.kind = kind_of_words(entry.stated_kind)
    for values in numbers:
        if len(values) >= 4:
            _value(entry, str(values[0]), values[2], values[3], units, source)
    for values in strings:
        if len(values) >= 2 and values[0] in ("HAND",) and str(values[-1]).upper().startswith("L"):
            entry.leave_out("it turns counterclockwise, which is not available")
    _finish(entry)
    return entry


def _value(entry: Entry, symbol: str, unit: Any, raw: Any, units: dict[int, list[Any]], source: Source) -> None:
    if symbol in TEETH:
        entry.count("flutes", raw)
    elif symbol == "SIG":
        entry.number("point_angle_deg", raw)
    elif symbol in ("BHTA", "TAPANG"):
        entry.number("taper_angle_deg", raw)
    elif symbol in LENGTHS:
        word = units.get(int(unit), [""])[0] if isinstance(unit, Ref) else None
        entry.length(LENGTHS[symbol], raw, source.unit_of(entry, word), zero=symbol == "RE")


def _finish(entry: Entry) -> None:
    if not entry.kind:
        entry.leave_out(f"its descriptions name no kind that is available: '{shown(entry.stated_kind)}'")
        return
    entry.note(f"kind {'of the end mill' if entry.kind == 'mill' else entry.kind} is read from the description "
               f"'{shown(entry.stated_kind)}'")
    if entry.kind == "chamfer":
        entry.leave_out("the file states no angle of the cone that is read")
    if entry.kind != "drill":
        entry.values.pop("point_angle_deg", None)
    if entry.kind not in ("tap", "thread_mill"):
        entry.values.pop("pitch_mm", None)


def write(entries: Sequence[Entry]) -> bytes:
    """One Part 21 file for one tool, a zip file of them for several."""
    files: dict[str, bytes] = {}
    for k, entry in enumerate(entries, start=1):
        name = re.sub(r"[^A-Za-z0-9_-]+", "-", entry.library_id) or "tool"
        name = name if f"{name}.p21" not in files else f"{name}-{k}"
        files[f"{name}.p21"] = _file(entry)
    return next(iter(files.values())) if len(files) == 1 else zipped(files)


def _file(entry: Entry) -> bytes:
    v = entry.values
    spoken = kind_of_words(entry.description)
    means = spoken == entry.kind or (spoken == "mill" and entry.kind in ("flat", "ball", "bull"))
    named = entry.description if means else f"{_NAMES[entry.kind]} {entry.description}".strip()
    lines = ["ISO-10303-21;", "HEADER;", "FILE_DESCRIPTION(('tool'),'2;1');",
             f"FILE_NAME({quoted(entry.library_id)},'1970-01-01T00:00:00',(''),(''),'zonemill','zonemill','');",
             f"FILE_SCHEMA(('{SCHEMA}'));", "ENDSEC;", "DATA;", "#1=LANGUAGE($,'eng');",
             f"#2=STRING_WITH_LANGUAGE({quoted(named)},#1);", "#3=MULTI_LANGUAGE_STRING((),#2);",
             f"#4=ITEM(#3,{quoted(entry.library_id)},$);", "#5=UNIT('mm');", "#6=UNIT('deg');"]
    number = 6
    seen: set[str] = set()
    values: list[tuple[str, Any, str]] = []
    for symbol, name in LENGTHS.items():
        if name in v and name not in seen:
            values.append((symbol, v[name], "#5"))
            seen.add(name)
    if "point_angle_deg" in v:
        values.append(("SIG", v["point_angle_deg"], "#6"))
    if "flutes" in v:
        values.append(("ZEFF", v["flutes"], "$"))
    for symbol, value, unit in values:
        number += 1
        lines.append(f"#{number}=NUMERICAL_VALUE('{symbol}',$,{unit},'{value}');")
    return "\n".join([*lines, "ENDSEC;", "END-ISO-10303-21;", ""]).encode()


__all__ = ["KINDS", "LENGTHS", "SCHEMA", "read", "write"]
