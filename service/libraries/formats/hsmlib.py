"""HSMWorks, Inventor CAM: an XML document of ``tool`` elements in a ``tool-library`` or ``tool-table``, often UTF-16.

``taper-angle`` of a drill is the whole angle of its point, of other tools that of one side to the axis. A holder is a
profile: each ``section`` gives the diameter that is reached after its length; a length of 0 is a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from service.libraries.containers import xml_bytes, xml_of
from service.libraries.entry import Entry, Preset, Source, Unit, check_count, shown
from service.libraries.formats.fusion import autodesk_angles, shoulder
from service.libraries.formats.kind_words import AUTODESK, TO_AUTODESK

NAMESPACE = "http://www.hsmworks.com/xml/2004/cnc/tool-library"
ROOTS = ("tool-library", "tool-table")
LENGTHS = {"corner-radius": "corner_radius_mm", "tip-diameter": "tip_diameter_mm", "flute-length": "flute_length_mm",
           "shaft-diameter": "shank_diameter_mm", "body-length": "stickout_mm", "overall-length": "overall_length_mm",
           "shoulder-length": "neck_length_mm", "shoulder-diameter": "neck_diameter_mm", "thread-pitch": "pitch_mm",
           "assembly-gauge-length": "gauge_length_mm"}
ZERO = ("corner-radius", "tip-diameter")


def read(data: bytes, source: Source) -> list[Entry]:
    """Entries of an HSMWorks library.

    Raises
    ------
    LibraryError
        As the containers and ``Source.unit_of``.
    """
    tools = list(xml_of(data, source.encoding).iter("tool"))
    check_count(len(tools))
    return [_entry(t, k, source) for k, t in enumerate(tools, start=1)]


def _entry(tool: Element, place: int, source: Source) -> Entry:
    entry = Entry(f"entry {place}", library_id=tool.get("guid", ""), stated_kind=tool.get("type", ""),
                  description=_text(tool, "description"), order_code=_text(tool, "product-id"))
    entry.kind = AUTODESK.get(entry.stated_kind.casefold(), "")
    if not entry.kind:
        entry.leave_out(f"kind '{shown(entry.stated_kind)}' is not available")
        return entry
    if entry.stated_kind.casefold() == "face mill":
        entry.values["center_cutting"] = False
    unit, body, numbers = source.unit_of(entry, tool.get("unit")), _part(tool, "body"), _part(tool, "nc")
    tapered = entry.kind == "tapered"
    entry.length("cone_tip_diameter_mm" if tapered else "diameter_mm", body.get("diameter"), unit)
    for key, name in LENGTHS.items():
        entry.length(name, body.get(key), unit, zero=key in ZERO)
    entry.count("flutes", body.get("number-of-flutes"))
    taper = body.get("taper-angle")
    autodesk_angles(entry, taper, taper if entry.kind == "drill" else body.get("tip-angle"))
    shoulder(entry)
    entry.t_number = entry.whole("T number", numbers.get("number"))
    entry.h_number = entry.whole("H number", numbers.get("length-offset"))
    entry.d_number = entry.whole("D number", numbers.get("diameter-offset"))
    coolant = _part(tool, "coolant").get("mode")
    entry.coolant = coolant or None
    _holder(entry, _part(tool, "holder"), unit)
    _speeds(entry, tool, unit)
    return entry


def _holder(entry: Entry, holder: Element, unit: Unit) -> None:
    reached: str | None = None
    for section in holder.findall("section"):
        diameter, length = section.get("diameter"), section.get("length")
        if entry.read("holder section", length):
            entry.segment(reached or diameter, diameter, length, unit)
        reached = diameter


def _speeds(entry: Entry, tool: Element, unit: Unit) -> None:
    motion = _part(tool, "motion")
    if motion.get("clockwise", "yes") in ("no", "false", "0"):
        entry.leave_out("it turns counterclockwise, which is not available")
    per_minute = motion.get("feed-mode", "per-minute") == "per-minute"
    if motion.attrib and not per_minute:
        entry.note("feeds per revolution are left out")
    rpm = entry.read("spindle-rpm", motion.get("spindle-rpm"))
    feed, plunge = (_feed(entry, motion.get(k), unit) if per_minute else None
                    for k in ("cutting-feedrate", "plunge-feedrate"))
    if rpm or feed:
        entry.presets.append(Preset("motion", None, rpm, feed, plunge))
    for item in tool.iter("preset"):
        values = {p.get("key"): p.get("value") for p in item.findall("parameter")}
        preset = Preset(item.get("name", ""), None, entry.read("tool_spindleSpeed", values.get("tool_spindleSpeed")))
        feeds = values.get("tool_feedCutting"), values.get("tool_feedPlunge")
        if unit is Unit.INCH and any(feeds):
            # some programs write these in inches, others in mm: a factor of 25 in the feed
            entry.note(f"the feeds of '{shown(preset.name)}' are left out, since their unit is not stated")
        else:
            preset.feed, preset.plunge_feed = (_feed(entry, f, unit) for f in feeds)
        if not any(p.spindle_rpm == preset.spindle_rpm and p.feed == preset.feed for p in entry.presets):
            entry.presets.append(preset)


def _feed(entry: Entry, raw: Any, unit: Unit) -> float | None:
    value = entry.read("feed", raw)
    return None if value is None else unit.to_mm(value)


def _part(tool: Element, name: str) -> Element:
    found = tool.find(name)
    return Element(name) if found is None else found


def _text(tool: Element, name: str) -> str:
    return (tool.findtext(name) or "").strip()


def write(entries: Sequence[Entry]) -> bytes:
    """An HSMWorks library in UTF-8."""
    root = Element("tool-library", {"xmlns": NAMESPACE, "version": "14"})
    for entry in entries:
        v = entry.values
        tool = SubElement(root, "tool", {"guid": entry.library_id, "type": TO_AUTODESK[entry.kind],
                                         "unit": "millimeters", "version": "1.5"})
        SubElement(tool, "description").text = entry.description
        SubElement(tool, "product-id").text = entry.order_code
        number = str(entry.t_number or 0)
        SubElement(tool, "nc", {"number": number, "length-offset": number, "diameter-offset": number})
        if entry.coolant:
            SubElement(tool, "coolant", {"mode": {"flood": "flood", "off": "disabled"}[entry.coolant]})
        body = {"diameter": v.get("cone_tip_diameter_mm", v["diameter_mm"]),
                **{k: v[n] for k, n in LENGTHS.items() if n in v}}
        if "flutes" in v:
            body["number-of-flutes"] = v["flutes"]
        if v.get("taper_angle_deg"):
            body["taper-angle"] = v["taper_angle_deg"]
        if v.get("point_angle_deg"):
            body |= {"taper-angle": v["point_angle_deg"] * (0.5 if entry.kind == "chamfer" else 1.0)} \
                if entry.kind in ("chamfer", "drill") else {"tip-angle": v["point_angle_deg"]}
        SubElement(tool, "body", {k: str(x) for k, x in body.items()})
        _write_holder(tool, entry)
        for p in entry.presets[:1]:
            found = {"spindle-rpm": p.spindle_rpm, "cutting-feedrate": p.feed, "plunge-feedrate": p.plunge_feed}
            SubElement(tool, "motion", {"clockwise": "yes", "feed-mode": "per-minute",
                                        **{k: str(x) for k, x in found.items() if x is not None}})
    return xml_bytes(root)


def _write_holder(tool: Element, entry: Entry) -> None:
    if not entry.holder:
        return
    holder, reached = SubElement(tool, "holder"), 0.0
    for s in entry.holder:
        if s.diameter != reached:
            SubElement(holder, "section", {"diameter": str(s.diameter), "length": "0"})
        SubElement(holder, "section", {"diameter": str(s.diameter_top), "length": str(s.length)})
        reached = s.diameter_top


__all__ = ["LENGTHS", "ROOTS", "read", "write"]
