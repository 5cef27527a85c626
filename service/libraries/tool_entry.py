"""A tool of a setup as an entry of a library, for writing."""

from __future__ import annotations

from schemas.tools import TAPERED_KINDS, Tool
from service.libraries.cone import cone_tip_diameter
from service.libraries.entry import Entry, Preset, Segment

VALUES = ("diameter_mm", "corner_radius_mm", "profile_radius_mm", "taper_angle_deg", "point_angle_deg",
          "tip_diameter_mm", "pitch_mm", "flutes", "flute_length_mm", "neck_diameter_mm", "neck_length_mm",
          "shank_diameter_mm", "stickout_mm", "gauge_length_mm", "center_cutting", "core_diameter_mm", "ramp_angle_deg",
          "max_rpm", "max_engagement_deg", "life_min", "spindle_rpm", "feed_mm_min", "plunge_feed_mm_min")
"""Fields of a tool that are values of an entry."""


def tool_entry(tool: Tool, place: str) -> Entry:
    """The entry of a tool; its own id stands for that of a library where it has none.

    place : where it stands, for messages
    """
    stated = tool.model_dump(mode="json")
    values = {k: stated[k] for k in VALUES if stated[k] is not None}
    if tool.taper_angle_deg == 0.0:
        values.pop("taper_angle_deg", None)
    elif tool.kind in TAPERED_KINDS:
        values["cone_tip_diameter_mm"] = cone_tip_diameter(tool.diameter_mm, tool.corner_radius_mm,
                                                           tool.taper_angle_deg)
    if values.get("neck_diameter_mm") == tool.widest_mm and values.get("neck_length_mm") == tool.flute_length_mm:
        # the defaults of a tool without a neck
        del values["neck_diameter_mm"], values["neck_length_mm"]
    if tool.center_cutting:
        values.pop("center_cutting")
    return Entry(place, tool.kind, tool.kind, tool.library_id or tool.id, tool.description, tool.order_code,
                 tool.number, coolant=tool.coolant, values=values,
                 holder=[Segment(s.diameter_mm, s.diameter_top_mm or s.diameter_mm, s.length_mm)
                         for s in tool.holder],
                 presets=[Preset(d.material or "", d.material, d.spindle_rpm, d.feed_mm_min, d.plunge_feed_mm_min)
                          for d in tool.cutting_data])
