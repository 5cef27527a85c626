"""FreeCAD: a tool bit (``.fctb``), a library of numbers and bits (``.fctl``), or a zip file of both.

Dimensions carry their unit, as in "6.0000 mm". TaperAngle and CuttingEdgeAngle are whole angles of a cone. A library
holds the T numbers and names the bits, which stand in other files; the id of an entry is that of its bit.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import PurePosixPath
from typing import Any

from geometry.errors import LibraryError
from service.libraries.containers import Archive, is_zip, json_bytes, json_of, zipped
from service.libraries.entry import Entry, Source, check_count, shown

SHAPES = {"endmill": "flat", "ballend": "ball", "ballnose": "ball", "bullnose": "bull", "torus": "bull",
          "drill": "drill", "chamfer": "chamfer", "vbit": "chamfer", "v-bit": "chamfer", "tap": "tap",
          "threadmill": "thread_mill", "thread-mill": "thread_mill", "taperedballnose": "tapered_ball"}
TO_SHAPE = {"flat": ("endmill", "Endmill"), "ball": ("ballend", "Ballend"), "bull": ("bullnose", "Bullnose"),
            "drill": ("drill", "Drill"), "chamfer": ("v-bit", "VBit"), "tap": ("tap", "Tap"),
            "thread_mill": ("thread-mill", "ThreadMill"), "tapered_ball": ("taperedballnose", "TaperedBallNose")}
LENGTHS = {"Diameter": "diameter_mm", "CornerRadius": "corner_radius_mm", "CuttingEdgeHeight": "flute_length_mm",
           "Length": "overall_length_mm", "ShankDiameter": "shank_diameter_mm", "NeckDiameter": "neck_diameter_mm",
           "NeckLength": "neck_length_mm", "TipDiameter": "tip_diameter_mm", "Pitch": "pitch_mm"}
ZERO = ("CornerRadius", "TipDiameter")
_QUANTITY = re.compile(r"\s*([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*(mm|in|inch|\"|deg|°|)\s*")
_OF_KIND = {"corner_radius_mm": ("bull",), "tip_diameter_mm": ("chamfer",), "pitch_mm": ("tap", "thread_mill")}


def read(data: bytes, source: Source) -> list[Entry]:
    """Entries of a tool bit, of a library with the bits beside it, or of a zip file of both.

    Raises
    ------
    LibraryError
        As the containers and ``Source.unit_of``.
    """
    if not is_zip(data):
        value = json_of(data, source.encoding)
        if isinstance(value, dict) and "parameter" in value:
            return [_bit(value, Entry("entry 1"), source, PurePosixPath(source.name).stem)]
        return _library(value, source, source.beside)
    archive = Archive(data)
    by_name = {PurePosixPath(n).name: n for n in archive.names}

    def beside(name: str) -> bytes | None:
        return archive.read(by_name[name]) if name in by_name else None

    tables = [n for n in archive.names if n.casefold().endswith(".fctl")]
    if tables:
        out: list[Entry] = []
        for name in tables:
            out += _library(json_of(archive.read(name), source.encoding), source, beside)
        return out
    bits = [n for n in archive.names if n.casefold().endswith(".fctb")]
    check_count(len(bits))
    return [_bit(json_of(archive.read(n), source.encoding), Entry(f"entry {k}"), source, PurePosixPath(n).stem)
            for k, n in enumerate(bits, start=1)]


def _library(value: Any, source: Source, beside: Callable[[str], bytes | None]) -> list[Entry]:
    items = value.get("tools") if isinstance(value, dict) else None
    if not isinstance(items, list):
        raise LibraryError("the library has no list 'tools'", code="not_a_freecad_library",
                           remedy="send the .fctl file of a FreeCAD library, or its .fctb files")
    check_count(len(items))
    out = []
    for k, item in enumerate(items, start=1):
        entry = Entry(f"entry {k}")
        out.append(entry)
        path = item.get("path") if isinstance(item, dict) else None
        if not isinstance(path, str):
            entry.leave_out("it names no tool bit")
            continue
        # a library may be from another system, and must not lead out of its folder: only the name counts
        name = PurePosixPath(path.replace("\\", "/")).name
        entry.library_id = name.removesuffix(".fctb")
        found = beside(name)
        if found is None:
            entry.leave_out(f"its tool bit {shown(name)} is not beside the library; send a zip file with both")
            continue
        number = entry.whole("T number", item.get("nr"))
        _bit(json_of(found, source.encoding), entry, source, name.removesuffix(".fctb"))
        entry.t_number = number
    return out


def _bit(value: Any, entry: Entry, source: Source, stem: str) -> Entry:
    if not isinstance(value, dict):
        entry.leave_out("its tool bit is not an object")
        return entry
    entry.library_id = str(value.get("id") or stem)
    entry.description = str(value.get("name") or "")
    shape = str(value.get("shape-type") or PurePosixPath(str(value.get("shape") or "")).stem)
    entry.stated_kind = shape
    entry.kind = SHAPES.get(shape.casefold().replace(" ", ""), "")
    if not entry.kind:
        entry.leave_out(f"shape '{shown(shape)}' is not available")
        return entry
    found = {**_object(value, "attribute"), **_object(value, "parameter")}
    for key, name in LENGTHS.items():
        kinds = _OF_KIND.get(name)
        if kinds is None or entry.kind in kinds:
            _quantity(entry, name, found.get(key), source, zero=key in ZERO)
    if entry.kind == "tapered_ball":
        _quantity(entry, "taper_angle_deg", found.get("TaperAngle"), source, share=0.5)
    elif entry.kind == "chamfer":
        _quantity(entry, "point_angle_deg", found.get("CuttingEdgeAngle"), source)
        if "point_angle_deg" not in entry.values:
            entry.leave_out("the bit states no CuttingEdgeAngle")
    elif entry.kind == "drill":
        _quantity(entry, "point_angle_deg", found.get("TipAngle"), source)
    entry.count("flutes", found.get("Flutes"))
    _chip_loads(entry, found, source)
    return entry


def _quantity(entry: Entry, name: str, raw: Any, source: Source, *, zero: bool = False, share: float = 1.0) -> None:
    """Set a dimension with its unit; a length without one needs the unit of the caller."""
    if raw is None or raw == "":
        return
    match = _QUANTITY.fullmatch(str(raw))
    if match is None:
        entry.leave_out(f"{name}: '{shown(raw)}' is not a number with a unit")
        return
    value, word = match.group(1), match.group(2)
    if name.endswith("_deg"):
        angle = entry.read(name, value)
        if angle:
            entry.number(name, angle * share)
    else:
        entry.length(name, value, source.unit_of(entry, word), zero=zero)


def _chip_loads(entry: Entry, found: dict[str, Any], source: Source) -> None:
    raw = found.get("Chipload")
    match = _QUANTITY.fullmatch(str(raw)) if raw not in (None, "") else None
    if match and entry.read("Chipload", match.group(1)):
        entry.note("the chip load of the bit is left out, since it states no spindle speed")


def _object(item: dict[str, Any], key: str) -> dict[str, Any]:
    value = item.get(key)
    return value if isinstance(value, dict) else {}


def write(entries: Sequence[Entry]) -> bytes:
    """A zip file with ``Library/tools.fctl`` and one bit for each entry."""
    files: dict[str, bytes] = {}
    rows = []
    for k, entry in enumerate(entries, start=1):
        name = re.sub(r"[^A-Za-z0-9_-]+", "-", entry.library_id) or f"tool-{k}"
        name = name if f"Bit/{name}.fctb" not in files else f"{name}-{k}"
        rows.append({"nr": entry.t_number or k, "path": f"{name}.fctb"})
        files[f"Bit/{name}.fctb"] = json_bytes(_item(entry))
    table = json_bytes({"label": "tools", "tools": rows, "version": 1})
    return zipped({"Library/tools.fctl": table, **files})


def _item(entry: Entry) -> dict[str, Any]:
    v, (file, kind) = entry.values, TO_SHAPE[entry.kind]
    parameter: dict[str, Any] = {k: f"{v[n]!r} mm" for k, n in LENGTHS.items() if n in v}
    if entry.kind == "tapered_ball":
        parameter["TaperAngle"] = f"{2.0 * v['taper_angle_deg']!r} °"
    if "point_angle_deg" in v:
        parameter["CuttingEdgeAngle" if entry.kind == "chamfer" else "TipAngle"] = f"{v['point_angle_deg']!r} °"
    if "flutes" in v:
        parameter["Flutes"] = v["flutes"]
    return {"version": 2, "id": entry.library_id, "name": entry.description or entry.library_id,
            "shape": f"{file}.fcstd", "shape-type": kind, "parameter": parameter, "attribute": {}}


__all__ = ["LENGTHS", "SHAPES", "TO_SHAPE", "read", "write"]
