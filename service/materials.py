"""Spindle speed and feed of a tool in a material, and what a machine does, with every default stated."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from geometry.timing import RATES, Rates
from schemas.machine import Machine
from schemas.materials import MATERIALS, FeedPoint, Material, find_material
from schemas.setup import Setup
from schemas.tools import Tool

DEFAULT_MAX_RPM = 18000.0
DEFAULT_MAX_FEED_MM_MIN = 5000.0
PLUNGE_FACTOR = 0.3


@dataclass(frozen=True)
class CuttingData:
    """Cutting data of one tool in one material.

    spindle_rpm    : 1/min, whole
    feed           : mm/min, cutting
    plunge_feed    : mm/min, moves that descend in or near material; ``PLUNGE_FACTOR`` of the feed
    cutting_speed  : m/min at the full diameter, after the speed limits
    feed_per_tooth : mm, after the feed limit
    limited_by     : 'material', 'tool', 'machine' or 'default', what set the speed
    source         : where the material's figures come from
    """

    spindle_rpm: float
    feed: float
    plunge_feed: float
    cutting_speed: float
    feed_per_tooth: float
    limited_by: str
    source: str


def feed_per_tooth(points: list[FeedPoint], diameter: float) -> float:
    """Feed per tooth at a diameter, mm: linear between the points, in proportion to diameter beyond the ends.

    >>> round(feed_per_tooth(MATERIALS["C45"].feed_per_tooth, 3.0), 6)
    0.02
    """
    first, last = points[0], points[-1]
    if diameter <= first.diameter_mm:
        return first.feed_per_tooth_mm * diameter / first.diameter_mm
    for low, high in pairwise(points):
        if diameter <= high.diameter_mm:
            share = (diameter - low.diameter_mm) / (high.diameter_mm - low.diameter_mm)
            return low.feed_per_tooth_mm + share * (high.feed_per_tooth_mm - low.feed_per_tooth_mm)
    return last.feed_per_tooth_mm * diameter / last.diameter_mm


def cutting_data(material: Material, tool: Tool, machine: Machine) -> CuttingData:
    """Spindle speed and feed of a tool in a material on a machine.

    The speed is n = 1000 vc / (pi d), held to the tool's and the machine's limit; a machine that states none
    gets ``DEFAULT_MAX_RPM`` and ``DEFAULT_MAX_FEED_MM_MIN``.
    """
    wanted = 1000.0 * material.cutting_speed_m_min / (math.pi * tool.diameter_mm)
    limits = [("material", wanted)]
    if tool.max_rpm is not None:
        limits.append(("tool", tool.max_rpm))
    limits.append(("default", DEFAULT_MAX_RPM) if machine.max_rpm is None else ("machine", machine.max_rpm))
    limited_by, rpm = min(limits, key=lambda pair: pair[1])
    rpm = max(1.0, math.floor(rpm))
    per_tooth = feed_per_tooth(material.feed_per_tooth, tool.diameter_mm)
    feed = min(per_tooth * tool.flutes * rpm, machine.max_feed_mm_min or DEFAULT_MAX_FEED_MM_MIN)
    return CuttingData(rpm, feed, PLUNGE_FACTOR * feed, rpm * math.pi * tool.diameter_mm / 1000.0,
                       feed / (tool.flutes * rpm), limited_by, material.source)


def rates_of(setup: Setup) -> Rates:
    """What the machine of a setup does; corners are rounded by what programs allow (``output.linuxcnc``)."""
    machine = setup.machine
    return Rates(machine.rapid_mm_min or RATES.rapid, machine.acceleration_mm_s2 or RATES.acceleration,
                 min(RATES.rounding, 0.5 * setup.quality.chordal_tolerance_mm))


__all__ = ["DEFAULT_MAX_FEED_MM_MIN", "DEFAULT_MAX_RPM", "MATERIALS", "PLUNGE_FACTOR", "CuttingData", "cutting_data",
           "feed_per_tooth", "find_material", "rates_of"]
