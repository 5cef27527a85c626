"""Tables of tools, one a row: CSV and XLSX. The heads of the columns name the fields.

A head may state the unit of its lengths, as in ``diameter_mm`` or ``Diameter [in]``; otherwise a column ``unit`` does,
or the caller. A cell of the holder holds segments "diameter:diameter at the top:length", divided by blanks. One of the
cutting data holds "material|spindle_rpm|feed_mm_min|plunge_feed_mm_min", divided by semicolons.
"""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections.abc import Sequence
from typing import Any
from zipfile import BadZipFile, ZipFile

from defusedxml.common import DefusedXmlException
from openpyxl import Workbook, load_workbook
from openpyxl.utils.exceptions import InvalidFileException

from geometry.errors import LibraryError
from service.libraries.containers import Archive, text_of, zipped
from service.libraries.entry import Entry, Preset, Source, Unit, check_count, shown, to_number
from service.libraries.formats.kind_words import AUTODESK, kind_of_words

MAX_COLUMNS = 200
MAX_HEAD = 200
"""Characters of the head of a column."""
MAX_HEAD_ROWS = 20
"""Rows that may stand before the heads."""
LENGTHS = {
    "diameter_mm": "diameter dia d dc durchmesser ø cuttingdiameter",
    "cone_tip_diameter_mm": "conetipdiameter",
    "corner_radius_mm": "cornerradius cr re eckenradius radius eckradius",
    "profile_radius_mm": "profileradius prfrad",
    "flute_length_mm": "flutelength lcf apmx cuttinglength cutlength schneidenlänge schneidenlaenge",
    "neck_diameter_mm": "neckdiameter dn halsdurchmesser shoulderdiameter",
    "neck_length_mm": "necklength ln halslänge shoulderlength",
    "shank_diameter_mm": "shankdiameter shaftdiameter sfdm dconms dmm schaftdurchmesser",
    "stickout_mm": "stickout lb bodylength auskraglänge ausspannlänge lpr outofholder",
    "overall_length_mm": "overalllength oal gesamtlänge gesamtlaenge totallength length",
    "gauge_length_mm": "gaugelength assemblygaugelength",
    "tip_diameter_mm": "tipdiameter", "pitch_mm": "pitch threadpitch tp steigung",
    "core_diameter_mm": "corediameter"}
NUMBERS = {"taper_angle_deg": "taperangle ta", "point_angle_deg": "pointangle tipangle sig spitzenwinkel",
           "ramp_angle_deg": "rampangle", "max_rpm": "maxrpm", "max_engagement_deg": "maxengagement",
           "life_min": "lifemin life", "spindle_rpm": "spindlerpm rpm spindlespeed drehzahl",
           "feed_mm_min": "feedmmmin", "plunge_feed_mm_min": "plungefeedmmmin"}
FEEDS = {"feed_mm_min": "feed vf feedrate cuttingfeedrate feedcutting vorschub",
         "plunge_feed_mm_min": "plungefeed plungefeedrate feedplunge"}
TEXTS = {"library_id": "id libraryid guid uuid", "description": "description name bezeichnung beschreibung comment",
         "order_code": "ordercode productid partnumber artikelnummer bestellnummer edp ordernumber articlenumber",
         "kind": "kind type typ werkzeugtyp shape", "coolant": "coolant", "holder": "holder",
         "cutting_data": "cuttingdata", "material": "material workpiecematerial werkstoff",
         "center_cutting": "centercutting", "unit": "unit units einheit",
         "number": "number t tno tnumber nr werkzeugnummer", "h_number": "hnumber h lengthoffset",
         "d_number": "dnumber diameteroffset", "pocket": "pocket p platz", "flutes": "flutes teeth z zeff nof zähne "
         "numberofflutes zaehne schneiden"}
_HEADS = {word: name for group in (LENGTHS, NUMBERS, FEEDS, TEXTS) for name, words in group.items()
          for word in words.split()}
_UNIT = re.compile(r"[\s_]*[(\[]\s*(mm|in|inch|inches|mm/min|in/min|1/min|rpm|deg|°)\s*[)\]]\s*$"
                   r"|_(mm|in|inch|mm_min|in_min|deg)$", re.IGNORECASE)
FORMULA = tuple("=+-@")
"""Letters with which a spreadsheet takes a text for a formula."""
_KINDS = ("ball", "flat", "bull", "tapered_ball", "tapered_bull", "tapered_flat", "lens", "barrel", "drill",
          "tap", "chamfer", "thread_mill")
WRITTEN = ("library_id", "number", "description", "order_code", "kind", *LENGTHS, *NUMBERS, "flutes",
           "center_cutting", "coolant", "holder", "cutting_data")
"""Columns of a written table; ``cone_tip_diameter_mm`` is left out of it."""


def head_of(text: Any) -> tuple[str, Unit | None]:
    """The field that the head of a column names, "" for none, and the unit that it states.

    >>> head_of("Diameter [in]"), head_of("flute_length_mm"), head_of("Price")
    (('diameter_mm', <Unit.INCH: 'in'>), ('flute_length_mm', <Unit.MM: 'mm'>), ('', None))
    """
    words = str(text or "")[:MAX_HEAD].strip()
    stated = _UNIT.search(words)
    unit = (stated.group(1) or stated.group(2)).casefold() if stated else ""
    plain = re.sub(r"\(.*?\)|\[.*?\]", "", words[:stated.start()] if stated else words)
    key = re.sub(r"[^a-zäöüßø]+", "", plain.casefold())
    whole = re.sub(r"[^a-zäöüßø]+", "", words.casefold())
    name = _HEADS.get(key) or _HEADS.get(key.removeprefix("tool")) or _HEADS.get(whole, "")
    found = Unit.INCH if unit.startswith("in") else Unit.MM if unit.startswith("mm") else None
    return name, found


def is_head(row: Sequence[Any]) -> bool:
    """Whether a row names the columns of a table of tools: a diameter and one field more."""
    names = [head_of(c)[0] for c in row[:MAX_COLUMNS]]
    return "diameter_mm" in names and sum(n != "" for n in names) >= 2


def read_csv(data: bytes, source: Source) -> list[Entry]:
    """Entries of a CSV table, divided by commas, semicolons or tabs.

    Raises
    ------
    LibraryError
        library_cut_off: a quoted cell does not end. no_columns: no row names a diameter. Or as ``text_of`` and
        ``Source.unit_of``.
    """
    text = text_of(data, source.encoding)
    lines = [s for s in text.splitlines()[:MAX_HEAD_ROWS] if s.strip()]
    divider = max(";\t,", key=lambda d: max((len(s.split(d)) for s in lines), default=0))
    try:
        rows = [list(r) for r in csv.reader(io.StringIO(text, newline=""), delimiter=divider, strict=True)]
    except csv.Error as error:
        raise LibraryError(f"the table breaks off: {error}", code="library_cut_off",
                           remedy="export the library once more, and send the whole file") from None
    return _entries(rows, source, whole=True)


def read_xlsx(data: bytes, source: Source) -> list[Entry]:
    """Entries of the sheets of an XLSX workbook.

    Raises
    ------
    LibraryError
        library_cut_off, xml_entities, no_columns; or as ``Archive`` and ``Source.unit_of``.
    """
    archive = Archive(data)
    for name in archive.names:
        archive.read(name)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            book = load_workbook(io.BytesIO(data), read_only=True, data_only=True)
            sheets = {s.title: [list(r) for r in s.iter_rows(values_only=True, max_col=MAX_COLUMNS)]
                      for s in book.worksheets}
    except DefusedXmlException as error:
        raise LibraryError(f"the XML of the workbook defines entities: {shown(error)}", code="xml_entities",
                           remedy="save the workbook once more") from None
    except (InvalidFileException, BadZipFile, KeyError, ValueError, TypeError, OSError, SyntaxError) as error:
        raise LibraryError(f"the workbook cannot be read: {shown(error)}", code="library_cut_off",
                           remedy="save the workbook once more, and send the whole file") from None
    tables = {t: rows for t, rows in sheets.items() if any(is_head(r) for r in rows[:MAX_HEAD_ROWS])}
    if not tables:
        return _entries([], source)
    return [e for rows in tables.values() for e in _entries(rows, source)]


def _entries(rows: list[list[Any]], source: Source, *, whole: bool = False) -> list[Entry]:
    """Entries of the rows; whole : a row with fewer cells than the heads is cut off."""
    at = next((k for k, r in enumerate(rows[:MAX_HEAD_ROWS]) if is_head(r)), None)
    if at is None:
        raise LibraryError("no row of the table names the columns: a diameter and at least one field more",
                           code="no_columns", measured=[shown(c, 30) for c in rows[0][:20]] if rows else [],
                           remedy="give the columns heads such as id, kind, diameter_mm; docs/libraries.md has all")
    heads = [head_of(c) for c in rows[at][:MAX_COLUMNS]]
    strange = [shown(c, 30) for c, (name, _) in zip(rows[at], heads, strict=False) if str(c or "").strip() and not name]
    doubled = sorted({n for n, _ in heads if n and [h for h, _ in heads].count(n) > 1})
    if doubled:
        raise LibraryError(f"two columns of the table mean {', '.join(doubled)}", code="two_columns",
                           subjects=tuple(doubled), remedy="rename or remove one of the two columns")
    check_count(len(rows) - at - 1)
    out = []
    for number, row in enumerate(rows[at + 1:], start=at + 2):
        if all(c is None or str(c).strip() == "" for c in row):
            continue
        entry = Entry(f"row {number}")
        out.append(entry)
        if whole and len(row) < len(heads):
            entry.leave_out(f"the row has {len(row)} of {len(heads)} cells; the table is cut off there")
            continue
        cells = {name: (c, unit) for c, (name, unit) in zip(row, heads, strict=False) if name}
        _fill(entry, cells, source)
        if strange:
            entry.note(f"columns that are not read: {', '.join(strange[:10])}")
    return out


def _fill(entry: Entry, cells: dict[str, tuple[Any, Unit | None]], source: Source) -> None:
    def text(name: str) -> str:
        value = cells.get(name, (None, None))[0]
        if isinstance(value, float) and value.is_integer():
            value = int(value)  # a workbook holds order numbers as numbers
        plain = "" if value is None else str(value).strip()
        return plain[1:] if plain[:1] == "'" and plain[1:2] in FORMULA else plain

    entry.library_id, entry.description, entry.order_code = text("library_id"), text("description"), text("order_code")
    entry.stated_kind, entry.coolant = text("kind"), text("coolant") or None
    _kind(entry)
    word = text("unit")
    for name in LENGTHS:
        raw, stated = cells.get(name, (None, None))
        if raw is not None and str(raw).strip():
            unit = stated or source.unit_of(entry, word)
            entry.length(name, raw, unit, zero=name in ("corner_radius_mm", "tip_diameter_mm"))
    for name in NUMBERS:
        raw, stated = cells.get(name, (None, None))
        if raw is not None and str(raw).strip():
            if name in FEEDS:
                entry.length(name, raw, stated or source.unit_of(entry, word))
            else:
                entry.number(name, raw)
    entry.count("flutes", cells.get("flutes", (None, None))[0])
    entry.t_number, entry.h_number, entry.d_number, entry.pocket = (
        entry.whole(n, cells.get(n, (None, None))[0]) for n in ("number", "h_number", "d_number", "pocket"))
    if text("center_cutting"):
        entry.values["center_cutting"] = text("center_cutting").casefold() in ("true", "yes", "1", "ja")
    for part in text("holder").split():
        low, top, high = (part.split(":") + ["", "", ""])[:3]
        entry.segment(low, top, high, Unit.MM)
    _cutting_data(entry, text("cutting_data"))
    if text("material"):
        speeds = {n: entry.values.pop(n, None) for n in ("spindle_rpm", "feed_mm_min", "plunge_feed_mm_min")}
        if any(speeds.values()):
            entry.presets.append(Preset(text("material"), text("material"), speeds["spindle_rpm"],
                                        speeds["feed_mm_min"], speeds["plunge_feed_mm_min"]))


def _kind(entry: Entry) -> None:
    words = entry.stated_kind.casefold()
    plain = words.replace(" ", "_")
    if plain in _KINDS:
        entry.kind = plain
    elif words in AUTODESK:
        entry.kind = AUTODESK[words]
    elif words:
        entry.kind = kind_of_words(words)
    elif kind_of_words(entry.description):
        entry.kind = kind_of_words(entry.description)
        entry.note(f"the table states no kind; it is read from the description '{shown(entry.description)}'")


def _cutting_data(entry: Entry, text: str) -> None:
    for part in filter(None, (p.strip() for p in text.split(";"))):
        cells = (part.split("|") + [""] * 4)[:4]
        try:
            rpm, feed, plunge = (to_number(c) if c.strip() else None for c in cells[1:])
        except ValueError as error:
            entry.note(f"speeds and feeds '{shown(part)}' are left out: {error}")
            continue
        entry.presets.append(Preset(cells[0].strip(), cells[0].strip() or None, rpm, feed, plunge))


def rows_of(entries: Sequence[Entry]) -> list[list[Any]]:
    """The rows of a written table, its heads first."""
    columns = [c for c in WRITTEN if c != "cone_tip_diameter_mm"]
    out: list[list[Any]] = [["id" if c == "library_id" else c for c in columns]]
    for e in entries:
        cells = {"library_id": e.library_id, "number": e.t_number, "description": e.description,
                 "order_code": e.order_code, "kind": e.kind, "coolant": e.coolant,
                 "holder": " ".join(f"{s.diameter!r}:{s.diameter_top!r}:{s.length!r}" for s in e.holder),
                 "cutting_data": "; ".join("|".join([_divided(p.material), *("" if x is None else repr(x) for x in (
                     p.spindle_rpm, p.feed, p.plunge_feed))]) for p in e.presets)}
        out.append([cells.get(c, e.values.get(c)) for c in columns])
    return out


def _divided(material: str | None) -> str:
    return re.sub(r"[|;]", "/", material or "")


def write_csv(entries: Sequence[Entry]) -> bytes:
    """A CSV table in UTF-8, divided by commas."""
    out = io.StringIO(newline="")
    writer = csv.writer(out)
    for row in rows_of(entries):
        writer.writerow([_harmless(c) for c in row])
    return out.getvalue().encode()


def write_xlsx(entries: Sequence[Entry]) -> bytes:
    """An XLSX workbook with one sheet."""
    book = Workbook(write_only=True)
    sheet = book.create_sheet("tools")
    for row in rows_of(entries):
        sheet.append([_harmless(c) for c in row])
    out = io.BytesIO()
    book.save(out)
    with ZipFile(out) as archive:
        files = {n: archive.read(n) for n in archive.namelist()}
    # the same tools give the same bytes: the time of writing goes out of the properties and of the zip file
    core = "docProps/core.xml"
    files[core] = re.sub(rb"<dcterms:(created|modified)[^>]*>[^<]*</dcterms:\1>", b"", files[core])
    return zipped(files)


def _harmless(cell: Any) -> Any:
    """A cell that no spreadsheet takes for a formula: text that begins like one gets an apostrophe."""
    return f"'{cell}" if isinstance(cell, str) and cell[:1] in FORMULA else cell


__all__ = ["FEEDS", "LENGTHS", "NUMBERS", "WRITTEN", "head_of", "is_head", "read_csv", "read_xlsx", "rows_of",
           "write_csv", "write_xlsx"]
