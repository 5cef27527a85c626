"""hyperMILL and SolidCAM: XML documents whose tools have ``param`` elements with a name and a value.

hyperMILL: the collar is the relieved part of a tool, ``tipDiameter`` in diameter and ``taperHeight`` in length. The
cone of a tapered tool is left out, since its angle is stated in several ways. SolidCAM: ``outside holder length`` is
what stands out of the holder, ``arbor diameter`` the shank.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

from service.libraries.containers import xml_bytes, xml_of
from service.libraries.entry import Entry, Preset, Source, Unit, check_count, shown


@dataclass(frozen=True)
class Naming:
    """Names of one system.

    kinds : its words for a kind; lengths : its parameters by the name of a dimension; teeth, unit : its parameters
    """

    kinds: Mapping[str, str]
    lengths: Mapping[str, str]
    teeth: str
    unit: str


HYPERMILL = Naming(
    {"endmill": "mill", "ballmill": "ball", "radiusmill": "bull", "drilltool": "drill", "drill": "drill",
     "spotdrill": "drill", "tap": "tap", "threadmill": "thread_mill"},
    {"diameter_mm": "toolDiameter", "corner_radius_mm": "cornerRadius", "flute_length_mm": "cuttingLength",
     "shank_diameter_mm": "toolShaftDiameter", "overall_length_mm": "toolTotalLength", "pitch_mm": "pitch"},
    "cuttingEdges", "lengthOfUnit")
SOLIDCAM = Naming(
    {"endmill": "mill", "ballnosemill": "ball", "bullnosemill": "bull", "drill": "drill", "spotdrill": "drill",
     "tap": "tap", "threadmill": "thread_mill"},
    {"diameter_mm": "diameter", "corner_radius_mm": "corner radius", "flute_length_mm": "cutting edge length",
     "shank_diameter_mm": "arbor diameter", "overall_length_mm": "total length",
     "stickout_mm": "outside holder length", "neck_length_mm": "shoulder length",
     "neck_diameter_mm": "shoulder diameter", "pitch_mm": "pitch"},
    "number of teeth", "unit")
HYPERMILL_TYPES = {"flat": "endMill", "ball": "ballMill", "bull": "radiusMill", "drill": "drillTool", "tap": "tap",
                   "thread_mill": "threadMill"}
SOLIDCAM_TYPES = {"flat": "EndMill", "ball": "BallNoseMill", "bull": "BullNoseMill", "drill": "Drill", "tap": "Tap",
                  "thread_mill": "ThreadMill"}


def read_hypermill(data: bytes, source: Source) -> list[Entry]:
    """Entries of a hyperMILL tool database.

    Raises
    ------
    LibraryError
        As the containers and ``Source.unit_of``.
    """
    root = xml_of(data, source.encoding)
    tools = list(root.iter("tool"))
    numbers = {t.get("refTool") or t.findtext("tool") or "": t for t in root.iter("ncTool")}
    check_count(len(tools))
    out = []
    for k, tool in enumerate(tools, start=1):
        found = _parameters(tool)
        name = tool.get("name", "")
        entry = Entry(f"entry {k}", library_id=tool.get("id") or name, description=name,
                      order_code=found.get("orderingCode", ""), stated_kind=tool.get("type", ""))
        out.append(entry)
        _fill(entry, found, HYPERMILL, source)
        if entry.problem:
            continue
        if found.get("tapered", "0") not in ("0", ""):
            entry.leave_out("it is tapered, and the angle of its side is stated in a way that is not read")
        unit = source.unit_of(entry, found.get("lengthOfUnit"))
        if found.get("collar", "0") not in ("0", ""):
            entry.length("neck_diameter_mm", found.get("tipDiameter"), unit)
            entry.length("neck_length_mm", found.get("taperHeight"), unit)
        if entry.kind == "drill":
            entry.number("point_angle_deg", found.get("tipAngle") or found.get("coneAngle"))
        if name in numbers and name:
            entry.t_number = entry.whole("T number", numbers[name].get("number") or numbers[name].get("nr"))
        for item in tool.iter("tecset"):
            _tecset(entry, _parameters(item), unit)
    return out


def _tecset(entry: Entry, found: Mapping[str, str], unit: Unit) -> None:
    """Speeds and feeds of a set of technology; 0 states none."""
    speed, tooth = (entry.read(k, found.get(k)) for k in ("cuttingSpeed", "feedratePerEdge"))
    rpm = entry.read("spindleSpeed", found.get("spindleSpeed"))
    feed, plunge = (None if not v else unit.to_mm(v) for k in ("feedrate", "zFeedrate")
                    for v in [entry.read(k, found.get(k))])
    if any((speed, tooth, rpm, feed)):
        metres = None if not speed else speed if unit is Unit.MM else 0.3048 * speed
        entry.presets.append(Preset(found.get("purpose", ""), found.get("material") or None, rpm or None, feed, plunge,
                                    metres, None if not tooth else unit.to_mm(tooth)))


def read_solidcam(data: bytes, source: Source) -> list[Entry]:
    """Entries of a SolidCAM tool table.

    Raises
    ------
    LibraryError
        As the containers and ``Source.unit_of``.
    """
    tools = list(xml_of(data, source.encoding).iter("Tool"))
    check_count(len(tools))
    out = []
    for k, tool in enumerate(tools, start=1):
        found = _parameters(tool)
        entry = Entry(f"entry {k}", library_id=tool.get("UserType") or found.get("id", ""),
                      description=tool.get("UserType", ""), order_code=found.get("description", ""),
                      stated_kind=tool.get("SubType", ""))
        out.append(entry)
        _fill(entry, found, SOLIDCAM, source)
        if entry.problem:
            continue
        if entry.read("shoulder angle", found.get("shoulder angle")):
            entry.note("the cone of the shoulder is left out; the shank begins at the end of the flutes")
            entry.values.pop("neck_length_mm", None)
            entry.values.pop("neck_diameter_mm", None)
        if entry.kind == "drill":
            entry.number("point_angle_deg", found.get("angle"))
        entry.t_number = entry.whole("T number", found.get("number"))
        entry.coolant = "flood" if any(p.get("name") == "flood" and p.get("value") == "True"
                                       for p in tool.findall("Coolant/param")) else None
        unit = source.unit_of(entry, found.get(SOLIDCAM.unit) or found.get("units"))
        spin, feed = ({p.get("name"): p.get("value") for p in tool.findall(f"{n}/param")} for n in ("Spin", "Feed"))
        values = entry.read("spin", spin.get("rough")), entry.read("feed", feed.get("xy")), entry.read(
            "feed", feed.get("z"))
        if values[0] or values[1]:
            entry.presets.append(Preset("Spin, Feed", None, values[0] or None, *(
                None if not v else unit.to_mm(v) for v in values[1:])))
    return out


def _parameters(element: Element) -> dict[str, str]:
    return {p.get("name", ""): (p.get("value") or "").strip() for p in element.findall("param")}


def _fill(entry: Entry, found: Mapping[str, str], naming: Naming, source: Source) -> None:
    entry.kind = naming.kinds.get(entry.stated_kind.casefold(), "")
    if not entry.kind:
        entry.leave_out(f"kind '{shown(entry.stated_kind)}' is not available")
        return
    word = found.get(naming.unit) or (found.get("units") if naming is SOLIDCAM else None)
    unit = source.unit_of(entry, word)
    for name, key in naming.lengths.items():
        entry.length(name, found.get(key), unit, zero=name == "corner_radius_mm")
    if entry.kind not in ("tap", "thread_mill"):
        entry.values.pop("pitch_mm", None)
    if entry.kind == "mill" and "corner_radius_mm" not in entry.values:
        # the end mill of both systems has sharp corners; other words stand for a ball and for round corners
        entry.kind = "flat"
    entry.count("flutes", found.get(naming.teeth))


def write_hypermill(entries: Sequence[Entry]) -> bytes:
    """A hyperMILL tool database."""
    root = Element("omtdx", {"version": "25"})
    tools = SubElement(root, "tools")
    for entry in entries:
        tool = SubElement(tools, "tool", {"id": entry.library_id, "name": entry.description or entry.library_id,
                                          "type": HYPERMILL_TYPES[entry.kind]})
        v = entry.values
        _write(tool, "lengthOfUnit", "mm")
        _write(tool, "orderingCode", entry.order_code)
        _write_all(tool, entry, HYPERMILL)
        if "neck_diameter_mm" in v and "neck_length_mm" in v:
            for name, value in (("collar", 1), ("tipDiameter", v["neck_diameter_mm"]),
                                ("taperHeight", v["neck_length_mm"])):
                _write(tool, name, value)
        if "point_angle_deg" in v:
            _write(tool, "tipAngle", v["point_angle_deg"])
        sets = SubElement(tool, "tecsets")
        for p in entry.presets:
            item = SubElement(sets, "tecset", {"type": "milling"})
            for name, value in (("lengthOfUnit", "mm"), ("material", p.material), ("spindleSpeed", p.spindle_rpm),
                                ("feedrate", p.feed), ("zFeedrate", p.plunge_feed)):
                if value is not None:
                    _write(item, name, value)
    return xml_bytes(root)


def write_solidcam(entries: Sequence[Entry]) -> bytes:
    """A SolidCAM tool table."""
    root = Element("Results")
    tools = SubElement(root, "Tools")
    for entry in entries:
        tool = SubElement(tools, "Tool", {"Type": "Milling", "SubType": SOLIDCAM_TYPES[entry.kind],
                                          "UserType": entry.library_id})
        _write_all(tool, entry, SOLIDCAM)
        for name, value in (("unit", "metric"), ("description", entry.order_code), ("number", entry.t_number),
                            ("angle", entry.values.get("point_angle_deg"))):
            if value:
                _write(tool, name, value)
        for p in entry.presets[:1]:
            if p.spindle_rpm:
                _write(SubElement(tool, "Spin"), "rough", p.spindle_rpm)
            feed = SubElement(tool, "Feed")
            for name, value in (("xy", p.feed), ("z", p.plunge_feed)):
                if value:
                    _write(feed, name, value)
    return xml_bytes(root)


def _write_all(tool: Element, entry: Entry, naming: Naming) -> None:
    for name, key in naming.lengths.items():
        if name in entry.values:
            _write(tool, key, entry.values[name])
    if "flutes" in entry.values:
        _write(tool, naming.teeth, entry.values["flutes"])


def _write(parent: Element, name: str, value: object) -> None:
    SubElement(parent, "param", {"name": name, "value": str(value)})


__all__ = ["HYPERMILL", "HYPERMILL_TYPES", "SOLIDCAM", "SOLIDCAM_TYPES", "read_hypermill", "read_solidcam",
           "write_hypermill", "write_solidcam"]
