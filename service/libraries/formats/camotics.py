"""CAMotics: a JSON object of tools by their T number, each with unit, shape, diameter and length."""

from __future__ import annotations

import math
from typing import Any

from service.libraries.containers import json_of
from service.libraries.entry import Entry, Source, check_count, shown

SHAPES = {"cylindrical": "flat", "ballnose": "ball", "conical": "chamfer"}


def read(data: bytes, source: Source) -> list[Entry]:
    """Entries of a CAMotics tool table.

    Raises
    ------
    LibraryError
        As the containers and ``Source.unit_of``.
    """
    value = json_of(data, source.encoding)
    check_count(len(value))
    return [_entry(number, item, source) for number, item in value.items()]


def _entry(number: str, item: Any, source: Source) -> Entry:
    entry = Entry(f"tool {shown(number, 20)}", library_id=f"T{shown(number, 20)}")
    if not isinstance(item, dict):
        entry.leave_out("it is not an object")
        return entry
    entry.t_number = entry.whole("T number", number)
    entry.description, entry.stated_kind = str(item.get("description") or ""), str(item.get("shape") or "")
    entry.kind = SHAPES.get(entry.stated_kind.casefold(), "")
    if not entry.kind:
        entry.leave_out(f"shape '{shown(entry.stated_kind)}' is not available")
        return entry
    unit = source.unit_of(entry, item.get("units"))
    entry.length("diameter_mm", item.get("diameter"), unit)
    length = entry.read("length", item.get("length"))
    if length:
        entry.length("flute_length_mm", length, unit)
    if entry.kind == "chamfer":
        # the cone takes the whole length: its half angle has the tangent (D - d) / (2 L)
        entry.length("tip_diameter_mm", item.get("snub_diameter"), unit, zero=True)
        wide = entry.values.get("diameter_mm", 0.0) - entry.values.get("tip_diameter_mm", 0.0)
        if not length or wide <= 0:
            entry.leave_out("a cone needs its length and a diameter above that of its tip")
        else:
            angle = 2.0 * math.atan(0.5 * wide / unit.to_mm(length))
            entry.number("point_angle_deg", round(math.degrees(angle), 9))
    return entry


__all__ = ["SHAPES", "read"]
