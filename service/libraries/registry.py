"""The formats by name: reader, writer, what a written file carries, and how to tell one from its content."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

from geometry.errors import LibraryError
from schemas.tools import BUILT_KINDS, SEGMENT_KINDS, VERIFIED_KINDS
from service.libraries.containers import Archive, is_zip, json_of, text_of, xml_of
from service.libraries.entry import Entry, Source, shown
from service.libraries.formats import (
    camotics,
    din4000,
    freecad,
    fusion,
    hsmlib,
    iso13399,
    linuxcnc,
    named_parameters,
    setup_tools,
    table,
)
from service.libraries.tool_entry import VALUES

SHAPE = frozenset({"diameter_mm", "corner_radius_mm", "flutes", "flute_length_mm", "shank_diameter_mm"})
NECK = frozenset({"neck_diameter_mm", "neck_length_mm"})
SPEEDS = "cutting_data"
ONE_SPEED = "cutting_data of one material"
ALL_KINDS = frozenset((*BUILT_KINDS, *VERIFIED_KINDS))
SIMPLE_KINDS = ALL_KINDS - {*SEGMENT_KINDS}
AUTODESK_VALUES = SHAPE | NECK | {"taper_angle_deg", "point_angle_deg", "tip_diameter_mm", "pitch_mm", "stickout_mm",
                                  "gauge_length_mm"}
MAX_LINES_SEEN = 200
MAX_LINE = 10_000
"""Characters of a line by which a tool table is known."""


@dataclass(frozen=True)
class Format:
    """One format of libraries.

    endings : of file names, the first is that of written files
    write   : entries to bytes; None: it is read only
    kinds   : kinds of tools that it carries
    carried : fields of a tool that it carries, besides its kind
    media   : media type of a written file
    """

    name: str
    title: str
    endings: tuple[str, ...]
    read: Callable[[bytes, Source], list[Entry]]
    write: Callable[[Sequence[Entry]], bytes] | None = None
    kinds: frozenset[str] = ALL_KINDS
    carried: frozenset[str] = frozenset(VALUES)
    media: str = "application/octet-stream"


NAMED = frozenset({"description", "library_id"})
FUSION_VALUES = AUTODESK_VALUES | NAMED | {"profile_radius_mm", "number", "order_code", "coolant", "holder", SPEEDS}
_ALL = frozenset(VALUES) | NAMED | {"number", "order_code", "coolant", "holder", SPEEDS}
_XML = "application/xml"
FORMATS: dict[str, Format] = {f.name: f for f in (
    Format("zonemill", "tools of a setup", (".json",), setup_tools.read, None, ALL_KINDS, _ALL, "application/json"),
    Format("fusion", "Autodesk Fusion", (".json", ".tools"), fusion.read, fusion.write,
           SIMPLE_KINDS | {"lens"},
           FUSION_VALUES, "application/json"),
    Format("fusion-tools", "Autodesk Fusion, zipped", (".tools",), fusion.read, fusion.write_tools,
           SIMPLE_KINDS | {"lens"},
           FUSION_VALUES, "application/zip"),
    Format("hsmlib", "HSMWorks", (".hsmlib", ".xml"), hsmlib.read, hsmlib.write, SIMPLE_KINDS,
           AUTODESK_VALUES | {"number", "order_code", "coolant", "holder", ONE_SPEED} | NAMED, _XML),
    Format("freecad", "FreeCAD", (".zip", ".fctl", ".fctb"), freecad.read, freecad.write, frozenset(freecad.TO_SHAPE),
           SHAPE | NECK | {"taper_angle_deg", "point_angle_deg", "tip_diameter_mm", "pitch_mm", "number"} | NAMED,
           "application/zip"),
    Format("linuxcnc", "LinuxCNC tool table", (".tbl",), linuxcnc.read, linuxcnc.write, ALL_KINDS,
           frozenset(linuxcnc.REMARKED) | {"diameter_mm", "number"} | NAMED, "text/plain; charset=utf-8"),
    Format("iso13399", "ISO 13399, GTC", (".p21", ".zip"), iso13399.read, iso13399.write, frozenset(iso13399.KINDS),
           SHAPE | NECK | {"point_angle_deg", "pitch_mm", "stickout_mm"} | NAMED),
    Format("din4000", "DIN 4000", (".xml", ".csv"), din4000.read, din4000.write, frozenset(din4000.WRITTEN),
           SHAPE | NECK | {"point_angle_deg", "pitch_mm", "order_code"} | NAMED, _XML),
    Format("hypermill", "hyperMILL", (".xml", ".omtdx"), named_parameters.read_hypermill,
           named_parameters.write_hypermill, frozenset(named_parameters.HYPERMILL_TYPES),
           SHAPE | NECK | {"point_angle_deg", "pitch_mm", "order_code", SPEEDS} | NAMED, _XML),
    Format("solidcam", "SolidCAM", (".xml",), named_parameters.read_solidcam, named_parameters.write_solidcam,
           frozenset(named_parameters.SOLIDCAM_TYPES),
           SHAPE | NECK | {"point_angle_deg", "pitch_mm", "order_code", "stickout_mm", "number", ONE_SPEED,
                           "library_id"}, _XML),
    Format("camotics", "CAMotics", (".json",), camotics.read),
    Format("csv", "CSV table", (".csv",), table.read_csv, table.write_csv, ALL_KINDS, _ALL,
           "text/csv; charset=utf-8"),
    Format("xlsx", "XLSX workbook", (".xlsx",), table.read_xlsx, table.write_xlsx, ALL_KINDS, _ALL,
           "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"),
)}
READ = tuple(n for n in FORMATS if n != "fusion-tools")
"""Names of the formats that can be read; a zipped Fusion library is read as ``fusion``."""
WRITTEN = tuple(n for n, f in FORMATS.items() if f.write is not None or n == "zonemill")


def format_of(data: bytes, source: Source, wanted: str | None = None) -> Format:
    """The format of a library: as the caller states it, else the only one that its content fits.

    Raises
    ------
    LibraryError
        unknown_format: no format fits, or the stated one does not exist. ambiguous_format: several fit. Or as the
        containers, where the content cannot be read at all.
    """
    if wanted is not None:
        if wanted not in FORMATS:
            raise LibraryError(f"there is no format '{shown(wanted)}'", code="unknown_format", measured=shown(wanted),
                               limit=list(READ), remedy="state one of these formats, or leave it out")
        return FORMATS[wanted]
    found = fitting(data, source)
    if len(found) == 1:
        return FORMATS[found[0]]
    if found:
        raise LibraryError(f"the library may be {' or '.join(found)}", code="ambiguous_format", measured=found,
                           limit=list(READ), remedy=f"state the format: --format {found[0]} or --format {found[1]}, "
                           f"over HTTP format={found[0]} or format={found[1]}")
    raise LibraryError(f"{shown(source.name)} is no library of a known format", code="unknown_format",
                       measured=shown(data[:60].decode("latin-1")), limit=list(READ),
                       remedy="send a library in one of these formats; docs/libraries.md describes them")


def fitting(data: bytes, source: Source) -> list[str]:
    """Names of the formats that the content fits.

    Raises
    ------
    LibraryError
        The content begins as JSON, XML or zip and cannot be read as such.
    """
    if is_zip(data):
        return _zip_formats(Archive(data).names, data)
    start = data.lstrip(b"\xef\xbb\xbf \t\r\n")[:200]
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        start = text_of(data).lstrip().encode()[:200]
    if start.startswith((b"{", b"[")):
        return _json_formats(json_of(data, source.encoding))
    if start.startswith(b"<"):
        return _xml_formats(xml_of(data, source.encoding).tag)
    if re.match(rb"(?:/\*.*?\*/\s*)*ISO-10303-21", start, re.DOTALL):
        return ["iso13399"] if iso13399.SCHEMA.encode() in data[:10_000].upper() else []
    return _text_formats(text_of(data, source.encoding))


def _zip_formats(names: list[str], data: bytes) -> list[str]:
    endings = {PurePosixPath(n).suffix.casefold() for n in names}
    found = []
    if "[Content_Types].xml" in names and any(n.startswith("xl/") for n in names):
        return ["xlsx"]
    if ".json" in endings:
        found.append("fusion")
    if endings & {".fctl", ".fctb"}:
        found.append("freecad")
    if ".p21" in endings or endings & {".stp", ".step", ".spf"}:
        found.append("iso13399")
    return found


def _json_formats(value: Any) -> list[str]:
    found = []
    if isinstance(value, dict):
        if isinstance(value.get("data"), list):
            found.append("fusion")
        rows = value.get("tools")
        if "parameter" in value or (isinstance(rows, list) and any(isinstance(r, dict) and "path" in r for r in rows)):
            found.append("freecad")
        if value and all(k.isdigit() and isinstance(v, dict) and "shape" in v for k, v in value.items()):
            found.append("camotics")
    items = setup_tools.items_of(value)
    if items and "freecad" not in found and any(isinstance(i, dict) and "kind" in i for i in items):
        found.append("zonemill")
    return found


def _xml_formats(root: Any) -> list[str]:
    roots = {"Tool-Data": "din4000", "omtdx": "hypermill", "Results": "solidcam",
             **{r: "hsmlib" for r in hsmlib.ROOTS}}
    return [roots[root]] if root in roots else []


def _text_formats(text: str) -> list[str]:
    lines = [s for s in text.splitlines()[:MAX_LINES_SEEN] if s.strip() and not s.lstrip().startswith(";")]
    found = []
    heads = [re.split(r"[;,\t]", s) for s in lines[:table.MAX_HEAD_ROWS]]
    if lines and linuxcnc.LINE.match(lines[0][:MAX_LINE]):
        found.append("linuxcnc")
    if heads and {"NSM", "BLD"} <= {c.strip() for c in heads[0]}:
        found.append("din4000")
    elif any(table.is_head([c.strip().strip('"') for c in h]) for h in heads):
        found.append("csv")
    return found
