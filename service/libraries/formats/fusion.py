"""Fusion: a JSON document with the list ``data``, or a ``.tools`` file, which is a zip of such documents.

DC of a tapered mill is the diameter of the tip of its cone, and TA the angle of one side to the axis; TA of a chamfer
mill is half of the angle of its cone. SIG is the whole angle of a point. LB is the length that stands out of the
holder. Holder segments run from the cutter to the spindle; every tool and every holder states its own unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from geometry.errors import LibraryError
from schemas.tools import SEGMENT_KINDS
from service.libraries.containers import Archive, is_zip, json_bytes, json_of, zipped
from service.libraries.entry import Entry, Preset, Source, Unit, check_count, shown
from service.libraries.formats.kind_words import AUTODESK, SEGMENTS, TO_AUTODESK

LENGTHS = {"RE": "corner_radius_mm", "tip-diameter": "tip_diameter_mm", "LCF": "flute_length_mm",
           "SFDM": "shank_diameter_mm", "LB": "stickout_mm", "OAL": "overall_length_mm",
           "shoulder-length": "neck_length_mm", "shoulder-diameter": "neck_diameter_mm", "TP": "pitch_mm",
           "assemblyGaugeLength": "gauge_length_mm"}
ZERO = ("RE", "tip-diameter")
_FEEDS = {"v_f": "feed", "v_f_plunge": "plunge_feed"}


def read(data: bytes, source: Source) -> list[Entry]:
    """Entries of a Fusion library.

    Raises
    ------
    LibraryError
        not_a_fusion_library: there is no list ``data``; or as the containers and ``Source.unit_of``.
    """
    documents = [data]
    if is_zip(data):
        archive = Archive(data)
        documents = [archive.read(n) for n in archive.names if n.casefold().endswith(".json")]
    out: list[Entry] = []
    for document in documents:
        value = json_of(document, source.encoding)
        items = value.get("data") if isinstance(value, dict) else None
        if not isinstance(items, list):
            raise LibraryError("the library has no list 'data'", code="not_a_fusion_library",
                               remedy="export the library from Fusion as .tools or .json")
        check_count(len(out) + len(items))
        out += [_entry(item, len(out) + k, source) for k, item in enumerate(items, start=1)]
    return out


def _entry(item: Any, place: int, source: Source) -> Entry:
    entry = Entry(f"entry {place}")
    if not isinstance(item, dict):
        entry.leave_out("it is not an object")
        return entry
    entry.library_id, entry.description = _text(item, "guid"), _text(item, "description")
    entry.order_code, entry.stated_kind = _text(item, "product-id"), _text(item, "type")
    entry.kind = AUTODESK.get(entry.stated_kind.casefold(), "")
    if not entry.kind:
        entry.leave_out(f"kind '{shown(entry.stated_kind)}' is not available")
        return entry
    if entry.stated_kind.casefold() == "face mill":
        entry.values["center_cutting"] = False
    unit, geometry = source.unit_of(entry, item.get("unit")), _object(item, "geometry")
    tapered = entry.kind == "tapered"
    entry.length("cone_tip_diameter_mm" if tapered else "diameter_mm", geometry.get("DC"), unit)
    for key, name in LENGTHS.items():
        entry.length(name, geometry.get(key), unit, zero=key in ZERO)
    entry.count("flutes", geometry.get("NOF"))
    if entry.kind in SEGMENT_KINDS:
        _segment(entry, geometry, unit)
        if entry.stated_kind.casefold() not in SEGMENTS:
            return entry
    autodesk_angles(entry, geometry.get("TA"), geometry.get("SIG"))
    if geometry.get("HAND") is False:
        entry.leave_out("it turns counterclockwise, which is not available")
    shoulder(entry)
    numbers = _object(item, "post-process")
    entry.t_number = entry.whole("T number", numbers.get("number"))
    entry.h_number = entry.whole("H number", numbers.get("length-offset"))
    entry.d_number = entry.whole("D number", numbers.get("diameter-offset"))
    _shaft(entry, _object(item, "shaft").get("segments"), unit)
    holder = _object(item, "holder")
    segments = holder.get("segments")
    if isinstance(segments, list) and segments:
        own = source.unit_of(entry, holder["unit"]) if holder.get("unit") else unit
        for s in segments:
            low, top, high = ((s.get(k) if isinstance(s, dict) else None)
                              for k in ("lower-diameter", "upper-diameter", "height"))
            entry.segment(low, top, high, own)
    presets = _object(item, "start-values").get("presets")
    for preset in presets if isinstance(presets, list) else []:
        if isinstance(preset, dict):
            _preset(entry, preset, unit)
    return entry


def _segment(entry: Entry, geometry: dict[str, Any], unit: Unit) -> None:
    """Set the radii of a circle segment mill: the large arc of a lens is its lower radius, that of an oval its profile.

    A barrel or taper of Fusion has an upper radius over the large arc, which tools of a setup have not.
    """
    if entry.stated_kind.casefold() not in SEGMENTS:
        entry.leave_out(f"kind '{shown(entry.stated_kind)}' has an upper radius, which is not available")
        return
    corner, profile = SEGMENTS[entry.stated_kind.casefold()]
    entry.length("corner_radius_mm", geometry.get(corner), unit, zero=True)
    entry.length("profile_radius_mm", geometry.get(profile), unit)


def autodesk_angles(entry: Entry, taper: Any, point: Any) -> None:
    """Set the angles of an entry of Fusion or HSMWorks.

    taper : deg, of one side to the axis; point : deg, whole angle of the point
    """
    if entry.kind == "chamfer":
        half = entry.read("TA", taper)
        if half:
            entry.number("point_angle_deg", 2.0 * half)
        else:
            entry.number("point_angle_deg", point)
        if "point_angle_deg" not in entry.values:
            entry.leave_out("the library states no angle of its cone")
    elif entry.kind == "drill":
        entry.number("point_angle_deg", point)
        if "point_angle_deg" not in entry.values:
            entry.note("the angle of the point is not stated; 118 deg is taken")
        entry.values.pop("tip_diameter_mm", None)
    elif entry.kind in ("tapered", "mill"):
        entry.number("taper_angle_deg", taper)
    if entry.kind not in ("chamfer", "drill"):
        entry.values.pop("tip_diameter_mm", None)
    if entry.kind not in ("tap", "thread_mill"):
        entry.values.pop("pitch_mm", None)


def shoulder(entry: Entry) -> None:
    """State the neck of an entry whose library draws the body up to the shoulder at the cutting diameter."""
    v = entry.values
    if entry.kind not in ("tapered", "chamfer") and v.get("neck_length_mm", 0.0) > v.get("flute_length_mm", 0.0):
        v.setdefault("neck_diameter_mm", v.get("diameter_mm"))


def _shaft(entry: Entry, segments: Any, unit: Unit) -> None:
    """Take the widest diameter of a shaft profile for the whole shank, from the end of the flutes on."""
    widths = [entry.read("shaft segment", s.get(k)) for s in segments or () if isinstance(s, dict)
              for k in ("lower-diameter", "upper-diameter")] if isinstance(segments, list) else []
    if not widths:
        return
    widest = max([unit.to_mm(w) for w in widths if w] + [entry.values.get("shank_diameter_mm", 0.0)])
    entry.values["shank_diameter_mm"] = widest
    for key in ("neck_length_mm", "neck_diameter_mm"):
        entry.values.pop(key, None)
    entry.note(f"the profile of the shaft is left out; a shank of {widest:g} mm, its widest diameter, begins at the "
               "end of the flutes")


def _preset(entry: Entry, item: dict[str, Any], unit: Unit) -> None:
    material = _object(item, "material")
    words = str(material.get("query") or "").strip()
    category = str(material.get("category") or "").strip()
    if not words and category.casefold() not in ("", "all"):
        words = category
    feeds = {n: None if v is None else unit.to_mm(v)
             for k, n in _FEEDS.items() for v in [entry.read(k, item.get(k))]}
    speed, tooth = entry.read("v_c", item.get("v_c")), entry.read("f_z", item.get("f_z"))
    # cutting speeds are m/min in libraries in mm, and feet a minute in libraries in inches
    speed = None if speed is None else speed if unit is Unit.MM else 0.3048 * speed
    entry.presets.append(Preset(str(item.get("name") or ""), words or None, entry.read("n", item.get("n")),
                                cutting_speed=speed, feed_per_tooth=None if tooth is None else unit.to_mm(tooth),
                                **feeds))
    if item.get("f_n") and feeds["feed"] is None and tooth is None:
        entry.note(f"the feed per revolution of '{shown(item.get('name') or '', 40)}' is left out")
    if entry.coolant is None and isinstance(item.get("tool-coolant"), str):
        entry.coolant = item["tool-coolant"]


def _object(item: dict[str, Any], key: str) -> dict[str, Any]:
    value = item.get(key)
    return value if isinstance(value, dict) else {}


def _text(item: dict[str, Any], key: str) -> str:
    value = item.get(key)
    return value.strip() if isinstance(value, str) else ""


def write(entries: Sequence[Entry]) -> bytes:
    """A Fusion library as JSON."""
    return json_bytes({"data": [_item(e) for e in entries], "version": 36})


def write_tools(entries: Sequence[Entry]) -> bytes:
    """A Fusion library as a ``.tools`` file."""
    return zipped({"tools.json": write(entries)})


def _item(entry: Entry) -> dict[str, Any]:
    v = entry.values
    geometry: dict[str, Any] = {"DC": v.get("cone_tip_diameter_mm", v["diameter_mm"]), "HAND": True, "CSP": False}
    geometry |= {k: v[n] for k, n in LENGTHS.items() if n in v}
    if entry.kind == "lens":
        geometry["lower-radius"] = v["profile_radius_mm"]
    if "flutes" in v:
        geometry["NOF"] = v["flutes"]
    if v.get("taper_angle_deg"):
        geometry["TA"] = v["taper_angle_deg"]
    if v.get("point_angle_deg"):
        geometry |= {"TA": 0.5 * v["point_angle_deg"]} if entry.kind == "chamfer" else {"SIG": v["point_angle_deg"]}
    item: dict[str, Any] = {
        "BMC": "unspecified", "GRADE": "generic", "description": entry.description, "geometry": geometry,
        "guid": entry.library_id, "product-id": entry.order_code, "product-link": "",
        "type": TO_AUTODESK[entry.kind], "unit": "millimeters", "vendor": ""}
    number = entry.t_number or 0
    item["post-process"] = {"break-control": False, "comment": "", "diameter-offset": number, "length-offset": number,
                            "live": True, "manual-tool-change": False, "number": number, "turret": 0}
    if entry.holder:
        item["holder"] = {"description": "", "guid": f"{entry.library_id}-holder", "type": "holder",
                          "unit": "millimeters", "segments": [
                              {"height": s.length, "lower-diameter": s.diameter, "upper-diameter": s.diameter_top}
                              for s in entry.holder]}
    item["start-values"] = {"presets": [_preset_item(p, entry.coolant) for p in entry.presets]}
    return item


def _preset_item(preset: Preset, coolant: str | None) -> dict[str, Any]:
    material = {"category": "all", "query": preset.material or "", "use-hardness": False}
    item: dict[str, Any] = {"name": preset.name or preset.material or "all materials", "material": material,
                            "tool-coolant": {"flood": "flood", "off": "disabled"}.get(coolant or "", "")}
    found = {"n": preset.spindle_rpm, "v_f": preset.feed, "v_f_plunge": preset.plunge_feed}
    return item | {k: x for k, x in found.items() if x is not None}


__all__ = ["LENGTHS", "autodesk_angles", "read", "shoulder", "write", "write_tools"]
