"""Suggested setups: tools that reach most of a family part, but deliberately not all of it."""

from __future__ import annotations

from typing import Any

from examples.family.layout import PartLayout

HOLDER = [
    {"diameter_mm": 14.0, "diameter_top_mm": 20.0, "length_mm": 12.0},
    {"diameter_mm": 24.0, "diameter_top_mm": 24.0, "length_mm": 30.0},
]


def tool(
    number: int, kind: str, diameter: float, reach: float, *, shank: float = 6.0, corner_radius: float = 0.0
) -> dict[str, Any]:
    """One tool of a setup: flutes of three diameters, a relieved neck up to ``reach`` mm, then shank and holder.

    Returns the tool in the form of the setup schema, all lengths mm.
    """
    flute = round(max(3.0 * diameter, 1.5), 3)
    neck_length = max(round(reach, 1), flute + 0.5)
    relief = 0.2 if diameter >= 2.0 else 0.08 * diameter + 0.02
    return {
        "id": f"T{number}", "number": number, "kind": kind, "diameter_mm": diameter, "corner_radius_mm": corner_radius,
        "flutes": 4 if diameter >= 4 else 2, "flute_length_mm": flute,
        "neck_diameter_mm": round(diameter - relief, 3), "neck_length_mm": neck_length,
        "shank_diameter_mm": max(shank, diameter), "stickout_mm": round(neck_length + 16.0, 1), "holder": HOLDER,
    }


def suggest_setup(layout: PartLayout, truth: dict[str, Any]) -> dict[str, Any]:
    """A setup for a part: a flat end mill and a ball for the open areas, then two smaller balls chosen by the gaps.

    layout, truth : of the part; the smallest tool fits the second narrowest channel, not always the narrowest

    Returns plain data in the form of the setup schema.
    """
    deepest = max(w.height for w in layout.walls)
    reach = deepest + 3.0
    least = sorted(c["gap_min"] for c in truth["channels"])
    narrowest = least[0] if least else 6.0
    fine = next((d for d in (2.0, 1.5, 1.0, 0.8) if d <= 0.85 * narrowest), 0.6)
    tools = [tool(1, "flat", 4.0, reach), tool(2, "ball", 3.0, reach)]
    tools.append(tool(3, "ball", 1.5, min(reach, 15.0), shank=4.0))
    if fine < 1.5:
        tools.append(tool(4, "ball", fine, min(reach, 14.0 * fine), shank=4.0))
    return setup_with(tools, scallop=0.02)


def setup_with(tools: list[dict[str, Any]], scallop: float) -> dict[str, Any]:
    """A setup with given tools, cut from +Z, near-net stock, LinuxCNC program, ``scallop`` in mm."""
    return {
        "access": [{"id": "A1", "direction": [0, 0, 1], "work_offset": "G54"}],
        "tools": tools,
        "machine": {"kind": "3-axis", "dialects": ["linuxcnc"]},
        "stock": {"kind": "part_offset", "margin_mm": 1.0, "uncertainty_mm": 0.5},
        "quality": {"scallop_height_mm": scallop, "chordal_tolerance_mm": 0.002, "gouge_tolerance_mm": 0.01},
        "material": "Ti-6Al-4V",
    }
