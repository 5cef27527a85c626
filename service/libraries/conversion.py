"""Entries of libraries as tools of a setup: taken, taken with notes, or left out with the reason.

Nothing is filled in without a note. A tool is never made slimmer than the library states: where the library leaves the
shape above the flutes open, the shank begins at their end.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from schemas.libraries import Verdict
from schemas.tools import BUILT_KINDS, MAX_TAPER, SEGMENT_KINDS, VERIFIED_KINDS, Tool, ToolCuttingData
from service.libraries.cone import end_diameter
from service.libraries.entry import Entry, Preset, check_count, shown

TAKEN: Verdict = "taken"
NOTED: Verdict = "noted"
LEFT_OUT: Verdict = "left_out"
MAX_ROUNDING = 0.005
"""Mm: how far rounded figures of a library may be apart and mean one value."""
MAX_NUMBER = 99_999
MAX_ID = 32
_FIT = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")
_UNFIT = re.compile(r"[^A-Za-z0-9_-]+")
_COPIED = ("point_angle_deg", "tip_diameter_mm", "pitch_mm", "flutes", "center_cutting", "core_diameter_mm",
           "ramp_angle_deg", "max_rpm", "max_engagement_deg", "life_min", "spindle_rpm", "feed_mm_min",
           "plunge_feed_mm_min", "gauge_length_mm")


@dataclass(frozen=True)
class Converted:
    """What became of an entry. tool : None where it is left out; reason : why, else empty."""

    entry: Entry
    verdict: Verdict
    tool: Tool | None
    notes: tuple[str, ...] = ()
    reason: str = ""


def converted(entries: Sequence[Entry]) -> list[Converted]:
    """The entries as tools, in their order.

    Raises
    ------
    LibraryError
        too_many_entries: there are more than ``MAX_ENTRIES``.
    """
    check_count(len(entries))
    used: dict[str, Entry] = {}
    numbers: Counter[int | None] = Counter(e.t_number for e in entries if e.t_number and not e.problem)
    out = []
    for entry in entries:
        tool_id = entry.tool.id if entry.tool is not None else tool_id_of(entry)
        if tool_id in used and not entry.problem:
            entry.leave_out(f"its id {entry.library_id or tool_id} is also that of {used[tool_id].name}; "
                            "each entry needs its own")
        out.append(_converted(entry, tool_id, numbers))
        if out[-1].tool is not None:
            used[tool_id] = entry
    return out


def tool_id_of(entry: Entry) -> str:
    """Id of the tool of an entry: the library's own where its letters allow, else one made from it.

    The same entry gets the same id at each import.

    >>> tool_id_of(Entry("entry 1", library_id="EM-6")), tool_id_of(Entry("entry 1", library_id="6767731"))
    ('EM-6', 'L6767731')
    """
    own = entry.library_id.strip()
    if _FIT.fullmatch(own):
        return own
    if not own:
        content = (entry.stated_kind, entry.description, entry.order_code, sorted(entry.values.items()))
        return "L-" + hashlib.sha256(repr(content).encode()).hexdigest()[:12]
    plain = "L" + _UNFIT.sub("-", own).strip("-")
    if _FIT.fullmatch(plain) and plain[1:] == own:
        return plain
    # different ids may become one by what is cut away, so that the digest of the whole one tells them apart
    return plain[:MAX_ID - 9] + "-" + hashlib.sha256(own.encode()).hexdigest()[:8]


def _converted(entry: Entry, tool_id: str, numbers: Counter[int | None]) -> Converted:
    if entry.tool is not None and not entry.problem:
        return Converted(entry, TAKEN, entry.tool)
    fields = {} if entry.problem else _shape(entry)
    if not entry.problem:
        _lengths(entry, fields)
    if entry.problem:
        return Converted(entry, LEFT_OUT, None, tuple(entry.notes), entry.problem)
    if not entry.library_id:
        entry.note(f"the library states no id; {tool_id} is made from the content of the entry")
    fields |= {k: entry.values[k] for k in _COPIED if k in entry.values}
    own = "" if entry.library_id == tool_id else shown(entry.library_id, 200)
    fields |= {"id": tool_id, "number": _number(entry, numbers), "library_id": own,
               "description": shown(entry.description, 400), "order_code": shown(entry.order_code, 200),
               "coolant": _coolant(entry), "cutting_data": _cutting_data(entry, fields),
               "holder": [{"diameter_mm": s.diameter, "diameter_top_mm": s.diameter_top, "length_mm": s.length}
                          for s in entry.holder]}
    try:
        tool = Tool.model_validate(fields)
    except ValidationError as error:
        problem = error.errors(include_url=False, include_context=False, include_input=False)[0]
        at = ".".join(str(p) for p in problem["loc"])
        words = problem["msg"].removeprefix("Value error, ").removeprefix(f"tool {tool_id}: ")
        return Converted(entry, LEFT_OUT, None, tuple(entry.notes), f"{at}: {words}" if at else words)
    return Converted(entry, NOTED if entry.notes else TAKEN, tool, tuple(entry.notes))


def _shape(entry: Entry) -> dict[str, Any]:
    """Kind, diameter, corner radius and taper."""
    v, kind = entry.values, entry.kind
    if kind not in ("mill", "tapered", *BUILT_KINDS, *VERIFIED_KINDS):
        words = f"kind '{shown(entry.stated_kind or kind)}' is not available" if entry.stated_kind or kind else \
            "the library does not state what kind of tool it is"
        entry.leave_out(words)
        return {}
    radius, taper = v.get("corner_radius_mm"), v.get("taper_angle_deg", 0.0)
    if kind in SEGMENT_KINDS:
        return _segment(entry)
    if kind == "tapered" or kind.startswith("tapered_"):
        return _tapered(entry, radius or 0.0, taper)
    if taper and kind in ("mill", "ball", "flat", "bull"):
        entry.leave_out(f"its side leans by {taper:g} deg, which kind '{shown(entry.stated_kind or kind)}' does not "
                        "describe")
    diameter = v.get("diameter_mm")
    if diameter is None:
        entry.leave_out("the library states no diameter")
        return {}
    if kind in VERIFIED_KINDS:
        if radius:
            entry.note(f"corner_radius_mm {radius:g} is left out; kind {kind} has none")
        return {"kind": kind, "diameter_mm": diameter}
    return {"diameter_mm": diameter, **_rounded(entry, kind, diameter, radius)}


def _segment(entry: Entry) -> dict[str, Any]:
    """Kind and radii of a circle segment mill."""
    v, kind = entry.values, entry.kind
    for name in ("diameter_mm", "profile_radius_mm", *(("corner_radius_mm",) if kind == "barrel" else ())):
        if not v.get(name):
            entry.leave_out(f"a {kind} needs {name}, which the library does not state")
            return {}
    out = {"kind": kind, "diameter_mm": v["diameter_mm"], "profile_radius_mm": v["profile_radius_mm"],
           "corner_radius_mm": v.get("corner_radius_mm", 0.0)}
    return out | ({"taper_angle_deg": v.get("taper_angle_deg", 0.0)} if kind == "barrel" else {})


def _rounded(entry: Entry, kind: str, diameter: float, radius: float | None) -> dict[str, Any]:
    """Kind and corner radius of a mill with an upright side."""
    half = 0.5 * diameter
    if kind == "ball":
        if radius and abs(radius - half) > MAX_ROUNDING:
            entry.leave_out(f"a ball of diameter {diameter:g} has the radius {half:g}, not {radius:g}")
        return {"kind": "ball", "corner_radius_mm": half}
    if kind == "bull" and not radius:
        entry.leave_out("a bull nose needs its corner radius, which the library does not state")
        return {}
    if kind == "mill" and radius is None:
        entry.note("the library states no corner radius; kind flat is taken")
    if not radius:
        return {"kind": "flat", "corner_radius_mm": 0.0}
    if abs(radius - half) <= 1e-9:
        if kind != "mill":
            entry.note(f"the corner radius is half the diameter; kind ball is taken instead of {kind}")
        return {"kind": "ball", "corner_radius_mm": half}
    if kind == "flat":
        entry.note(f"the library states kind '{shown(entry.stated_kind)}' and a corner radius of {radius:g} mm; kind "
                   "bull is taken")
    return {"kind": "bull", "corner_radius_mm": radius}


def _tapered(entry: Entry, radius: float, taper: float) -> dict[str, Any]:
    """Kind, diameter, corner radius and taper of a tapered mill; see ``service.libraries.cone``."""
    if not 0.0 < taper <= MAX_TAPER:
        entry.leave_out(f"a tapered mill needs the angle of its side, above 0 and at most {MAX_TAPER:g} deg; the "
                        f"library states {taper:g}")
        return {}
    diameter, tip = entry.values.get("diameter_mm"), entry.values.get("cone_tip_diameter_mm")
    if diameter is None and tip is not None:
        diameter = round(end_diameter(tip, radius, taper), 9)
    if diameter is None and entry.kind == "tapered_ball" and radius:
        diameter = 2.0 * radius
    if diameter is None:
        entry.leave_out("the library states no diameter")
        return {}
    if entry.kind == "tapered_ball" and not radius:
        radius = 0.5 * diameter
    off = diameter - 2.0 * radius
    if radius and abs(off) <= MAX_ROUNDING:
        if abs(off) > 1e-6:
            entry.note(f"the diameters of cone and ball differ by {abs(off):.4f} mm; the ball of radius {radius:g} mm "
                       "is taken")
        return {"kind": "tapered_ball", "diameter_mm": 2.0 * radius, "corner_radius_mm": radius,
                "taper_angle_deg": taper}
    return {"kind": "tapered_bull" if radius else "tapered_flat", "diameter_mm": diameter,
            "corner_radius_mm": radius, "taper_angle_deg": taper}


def _lengths(entry: Entry, fields: dict[str, Any]) -> None:
    """Lengths and diameters from the flutes upwards, each default with a note."""
    v = entry.values
    if v.get("stickout_mm") is None and entry.holder:
        entry.leave_out("it has a holder, and the library does not state how far the tool stands out of it")
        return
    if v.get("flutes") is None:
        entry.note("flutes is not stated; 2 teeth are taken")
    flutes = _flutes(entry, fields)
    widest = _widest(fields, flutes)
    shank = v.get("shank_diameter_mm")
    if shank is None:
        entry.note(f"shank_diameter_mm is not stated; {widest:g} is taken, the widest diameter of the cutting part")
        shank = widest
    neck, neck_diameter, shank = _neck(entry, flutes, widest, shank)
    stickout = _stickout(entry, fields["diameter_mm"], max(neck or 0.0, flutes or 0.0))
    if neck is not None and neck > stickout:
        entry.note(f"the neck is {neck:g} mm long, and {stickout:g} mm of the tool stand out of the holder; the neck "
                   "ends there")
        neck = stickout
    found = {"flute_length_mm": flutes, "neck_length_mm": neck, "neck_diameter_mm": neck_diameter,
             "shank_diameter_mm": shank, "stickout_mm": stickout}
    fields |= {k: x for k, x in found.items() if x is not None}


def _flutes(entry: Entry, fields: dict[str, Any]) -> float | None:
    """Length of the flutes, mm; None for a drill that does not state it, since a proof tells the two apart."""
    v, kind = entry.values, fields["kind"]
    stated: float | None = v.get("flute_length_mm")
    if stated is not None or kind == "drill":
        return stated
    bounds = [v[k] for k in ("neck_length_mm", "stickout_mm", "overall_length_mm") if k in v]
    usual = max(0.0 if kind == "chamfer" else 3.0 * fields["diameter_mm"], _least(entry, fields))
    taken = round(min([usual, *bounds]), 9)
    entry.note(f"flute_length_mm is not stated; {taken:g} is taken, "
               + ("the height of the cone" if kind == "chamfer" else "3 x diameter_mm or less"))
    return taken


def _neck(entry: Entry, flutes: float | None, widest: float,
          shank: float) -> tuple[float | None, float | None, float]:
    """Length and diameter of the neck, None for no neck, and diameter of the shank, mm."""
    v = entry.values
    neck, diameter = v.get("neck_length_mm"), v.get("neck_diameter_mm")
    if flutes is not None and neck is not None and neck < flutes:
        entry.note(f"the neck ends at {neck:g} mm, below the end of the flutes at {flutes:g} mm; there is no neck")
        return None, None, shank
    if diameter is not None and diameter > widest + 1e-9:
        entry.note(f"the neck of {diameter:g} mm is wider than the cutting part; a shank of at least that diameter "
                   "begins at the end of the flutes")
        return None, None, max(shank, diameter)
    if neck is None:
        if diameter is not None and diameter < widest:
            entry.note(f"the neck of {diameter:g} mm is left out, since its length is not stated")
        return None, None, shank
    if diameter is None and (flutes is None or neck > flutes):
        if shank > widest + 1e-9:
            entry.note(f"the diameter of the neck up to {neck:g} mm is not stated; the shank of {shank:g} mm begins "
                       "at the end of the flutes")
        return None, None, shank
    return neck, diameter, shank


def _stickout(entry: Entry, diameter: float, start: float) -> float:
    """What stands out of the holder, mm; start : mm, where the shank begins."""
    v = entry.values
    stated = v.get("stickout_mm")
    if stated is None:
        stated = round(max(start, min(10.0 * diameter, v.get("overall_length_mm", math.inf))), 9)
        entry.note(f"stickout_mm is not stated; {stated:g} is taken")
    gauge = v.get("gauge_length_mm")
    if gauge is not None and gauge < stated:
        entry.note(f"gauge_length_mm {gauge:g} is less than the stickout {stated:g}; it is left out")
        del v["gauge_length_mm"]
    return float(stated)


def _least(entry: Entry, fields: dict[str, Any]) -> float:
    """Height of the cone or corner at the end, mm, which the flutes must cover."""
    point = entry.values.get("point_angle_deg")
    if fields["kind"] not in ("chamfer", "tap") or not point:
        return float(fields.get("corner_radius_mm", 0.0))
    wide = 0.5 * (fields["diameter_mm"] - entry.values.get("tip_diameter_mm", 0.0))
    return float(wide / math.tan(math.radians(0.5 * min(point, 179.0))))


def _widest(fields: dict[str, Any], flutes: float | None) -> float:
    """Widest diameter of the cutting part, mm; see ``Tool.widest_mm``."""
    if fields["kind"] in SEGMENT_KINDS:
        return float(fields["diameter_mm"])
    half = math.radians(fields.get("taper_angle_deg", 0.0))
    corner = fields.get("corner_radius_mm", 0.0)
    side = max((flutes or 0.0) - corner * (1.0 - math.sin(half)), 0.0) * math.tan(half)
    return round(float(fields["diameter_mm"] + 2.0 * (side - corner * (1.0 - math.cos(half)))), 9)


def _number(entry: Entry, numbers: Counter[int | None]) -> int | None:
    """T number of the tool; H and D numbers that differ are noted, since programs of a plan use one number."""
    number = entry.t_number
    if number == 0:
        entry.note("T number 0 means no number; the setup numbers the tool")
        return None
    if number is not None and number > MAX_NUMBER:
        entry.note(f"T number {number} is above {MAX_NUMBER}; the setup numbers the tool")
        return None
    for letter, other in (("H", entry.h_number), ("D", entry.d_number)):
        if number and other and other != number:
            entry.note(f"the library states {letter} {other} for T {number}; programs use {number} for both")
    if number is not None and numbers[number] > 1:
        entry.note(f"{numbers[number]} entries have T number {number}; a setup needs each number once")
    return number


def _coolant(entry: Entry) -> str | None:
    words = {"flood": "flood", "off": "off", "disabled": "off", "none": "off"}
    if entry.coolant is None or not entry.coolant.strip():
        return None
    found = words.get(entry.coolant.strip().casefold())
    if found is None:
        entry.note(f"coolant '{shown(entry.coolant)}' is left out; a tool has flood or off")
    return found


def _cutting_data(entry: Entry, fields: dict[str, Any]) -> list[ToolCuttingData]:
    """Speeds and feeds by material, the first of each material."""
    out: list[ToolCuttingData] = []
    for preset in entry.presets:
        material = shown(preset.material, 100) if preset.material else None
        what = f"speeds and feeds '{shown(preset.name or material or 'without a name', 40)}'"
        values = _speeds(entry, preset, fields["diameter_mm"], what)
        if not values:
            continue
        if any(d.material == material for d in out):
            entry.note(f"{what} are left out; the entry has others for {material or 'any material'} before them")
            continue
        try:
            out.append(ToolCuttingData(material=material, **values))
        except ValidationError as error:
            entry.note(f"{what} are left out: {error.errors(include_url=False)[0]['msg']}")
    return out


def _speeds(entry: Entry, preset: Preset, diameter: float, what: str) -> dict[str, float]:
    """Speed and feeds of a preset: as stated, else n = 1000 vc / (pi d) and vf = n z fz [Tabellenbuch2022]."""
    rpm, feed = preset.spindle_rpm or None, preset.feed or None
    if rpm is None and preset.cutting_speed:
        rpm = round(1000.0 * preset.cutting_speed / (math.pi * diameter), 3)
        entry.note(f"{what}: {rpm:g} 1/min from {preset.cutting_speed:g} m/min at diameter_mm")
    if feed is None and preset.feed_per_tooth and rpm:
        teeth = entry.values.get("flutes")
        if teeth is None:
            entry.note(f"{what}: the feed per tooth is left out, since the number of teeth is not stated")
        else:
            feed = round(rpm * teeth * preset.feed_per_tooth, 3)
            entry.note(f"{what}: {feed:g} mm/min from {preset.feed_per_tooth:g} mm per tooth")
    found = {"spindle_rpm": rpm, "feed_mm_min": feed, "plunge_feed_mm_min": preset.plunge_feed or None}
    return {k: x for k, x in found.items() if x is not None}
