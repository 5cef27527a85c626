"""DIN 4000: property lists of tools as XML (``Tool-Data``) or CSV, in mm as the standard sets.

NSM names the list, BLD the figure in it. Lists 80 (taps), 81 (drills) and 82 (solid mills) are read. An edition of the
XML writes a decimal comma, another a decimal point.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement

from geometry.errors import LibraryError
from service.libraries.containers import text_of, xml_bytes, xml_of
from service.libraries.entry import Entry, Source, Unit, check_count, shown

KINDS = {("82", "1"): "mill", ("82", "2"): "mill", ("82", "6"): "ball", ("81", "1"): "drill",
         **{("80", str(b)): "tap" for b in range(1, 5)}}
NAMES = {("82", "3"): "angle mill", ("82", "4"): "dovetail mill", ("82", "5"): "T-slot mill",
         ("82", "7"): "die mill, whose cone has no property that is read", ("82", "8"): "concave radius mill",
         ("82", "9"): "burr", ("82", "10"): "thread mill, whose profile has no property that is read",
         ("82", "11"): "gouge", ("82", "12"): "drill thread mill", ("81", "6"): "spot drill",
         ("81", "7"): "centre drill"}
LENGTHS = {"82": {"A1": "diameter_mm", "G1": "corner_radius_mm", "B2": "flute_length_mm", "A5": "neck_diameter_mm",
                  "B3": "neck_length_mm", "B5": "overall_length_mm", "C3": "shank_diameter_mm"},
           "81": {"A11": "diameter_mm", "B4": "flute_length_mm", "B5": "overall_length_mm", "C3": "shank_diameter_mm"},
           "80": {"A21": "diameter_mm", "A3": "pitch_mm", "B2": "flute_length_mm", "B5": "overall_length_mm",
                  "C3": "shank_diameter_mm"}}
TEETH = {"82": "F21", "81": "D1", "80": "D1"}
_FIGURES = {"flat": ("82", "1"), "bull": ("82", "1"), "ball": ("82", "6"), "drill": ("81", "1"), "tap": ("80", "2")}
WRITTEN = tuple(_FIGURES)


def read(data: bytes, source: Source) -> list[Entry]:
    """Entries of a DIN 4000 document, in XML or CSV.

    Raises
    ------
    LibraryError
        As the containers.
    """
    if data.lstrip(b"\xef\xbb\xbf \t\r\n").startswith((b"<", b"\xff\xfe", b"\xfe\xff")):
        tools = list(xml_of(data, source.encoding).iter("Tool"))
        check_count(len(tools))
        return [_entry(_properties(t), f"entry {k}", _own_id(t)) for k, t in enumerate(tools, start=1)]
    text = text_of(data, source.encoding)
    try:
        rows = list(csv.reader(io.StringIO(text), delimiter=";", strict=True))
    except csv.Error as error:
        raise LibraryError(f"the table breaks off: {error}", code="library_cut_off",
                           remedy="export the library once more, and send the whole file") from None
    head, out = [c.strip() for c in rows[0]], []
    check_count(len(rows))
    for number, row in enumerate(rows[1:], start=2):
        if not any(c.strip() for c in row):
            continue
        entry = _entry(dict(zip(head, row, strict=False)), f"row {number}", "")
        if len([h for h in head if h]) > len(row):
            entry.leave_out(f"the row has {len(row)} of {len(head)} cells; the table is cut off there")
        out.append(entry)
    return out


def _properties(tool: Element) -> dict[str, str]:
    found: dict[str, str] = {}
    for data in (*tool.iter("Category-Data"), *tool.iter("Property-Data")):
        name, value = (data.findtext("PropertyName") or "").strip(), (data.findtext("Value") or "").strip()
        if name:
            found.setdefault(name, value)
    return found


def _own_id(tool: Element) -> str:
    return next((t.strip() for n in ("PrimaryId", "ID21002") for t in [tool.findtext(f"Main-Data/{n}") or ""]
                 if t.strip()), "")


def _entry(found: Mapping[str, str], place: str, own_id: str) -> Entry:
    entry = Entry(place, library_id=own_id or found.get("J21", "").strip(), order_code=found.get("J21", "").strip(),
                  description=(found.get("J23") or found.get("J22") or "").strip())
    sheet, figure = found.get("NSM", "").strip(), found.get("BLD", "").strip()
    number = sheet.upper().replace(" ", "").removeprefix("DIN4000-")
    entry.stated_kind = f"{sheet} figure {figure}"
    entry.kind = KINDS.get((number, figure), "")
    if not entry.kind:
        named = NAMES.get((number, figure))
        entry.leave_out(f"{shown(entry.stated_kind)} is a {named}" if named else
                        f"{shown(entry.stated_kind)} is not read" if sheet else "it names no property list (NSM)")
        return entry
    for key, name in LENGTHS[number].items():
        entry.length(name, found.get(key), Unit.MM, zero=name == "corner_radius_mm")
    if number == "80" and "diameter_mm" not in entry.values:
        for key in ("A1", "A11"):
            if found.get(key, "").strip(" ,.0123456789") == "":
                entry.length("diameter_mm", found.get(key), Unit.MM)
    entry.count("flutes", found.get(TEETH[number]))
    if number == "81":
        entry.number("point_angle_deg", found.get("E1"))
    if found.get("F3", "").strip().upper().startswith("L") or found.get("F1", "").strip().upper().startswith("L"):
        entry.leave_out("it cuts to the left, which is not available")
    return entry


def write(entries: Sequence[Entry]) -> bytes:
    """A DIN 4000 document in XML."""
    root = Element("Tool-Data")
    for entry in entries:
        number, figure = _FIGURES[entry.kind]
        tool = SubElement(root, "Tool")
        main = SubElement(tool, "Main-Data")
        SubElement(main, "PrimaryId").text = entry.library_id
        category = SubElement(tool, "Category")
        for level, (name, value) in enumerate((("NSM", f"DIN4000-{number}"), ("BLD", figure)), start=1):
            _pair(category, "Category-Data", name, value, level)
        properties = SubElement(tool, "Properties")
        values = {"J21": entry.order_code, "J23": entry.description}
        values |= {k: str(entry.values[n]) for k, n in LENGTHS[number].items() if n in entry.values}
        if "flutes" in entry.values:
            values[TEETH[number]] = str(entry.values["flutes"])
        if "point_angle_deg" in entry.values and number == "81":
            values["E1"] = str(entry.values["point_angle_deg"])
        for name, value in values.items():
            if value:
                _pair(properties, "Property-Data", name, value)
    return xml_bytes(root)


def _pair(parent: Element, tag: str, name: str, value: str, level: int | None = None) -> None:
    item = SubElement(parent, tag)
    if level is not None:
        SubElement(item, "Source").text = "DIN"
        SubElement(item, "Level").text = str(level)
    SubElement(item, "PropertyName", {"source": "din_mk"}).text = name
    SubElement(item, "Value").text = value


__all__ = ["KINDS", "LENGTHS", "WRITTEN", "read", "write"]
