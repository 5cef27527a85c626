"""Spindle speed and feed of a tool in a material, and rates of a machine, with every default stated.

docs/theory/feeds.md has the formulas and the source of each figure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from geometry.cutting_mechanics import CHIP_SHARE, compliance, diameter_in_cut, effective_diameter
from geometry.machine_rates import RATES, Rates
from geometry.tool_body import ToolBody
from schemas.machine import Machine
from schemas.materials import MATERIALS, FeedPoint, Material, find_material, has_own_speed
from schemas.setup import Setup
from schemas.tools import Tool
from toolpath.scallop_budget import ScallopBudget
from toolpath.tool_deflection import (
    BENT_SHARE,
    LAYER_LIMIT,
    MIN_FEED,
    THINNEST,
    DeflectionModel,
    left_by_layers,
)
from verify.cutting_words import CuttingWords
from zones.lattice import lattice_step

DEFAULT_MAX_RPM = 18000.0
DEFAULT_MAX_FEED_MM_MIN = 5000.0
PLUNGE_FACTOR = 0.3
STEP_DOWN = {"ball": 0.3, "bull": 0.3, "flat": 0.5, "lens": 0.3, "barrel": 0.3, "drill": 0.5,
             "tap": 0.5, "chamfer": 0.5, "thread_mill": 0.5}
"""Deepest layer by the end of a tool, as a share of its diameter; of a tapered mill that of its end, so that the tip,
its weakest place, bears the layer."""
FINISHING_SPEED, LIGHT = 1.4, 0.1
"""Cutting speed of a finish over that of layers, where the stock before it is no more than ``LIGHT`` of the diameter.
Table of solid end mills [Tungaloy2020], page 1084, middle of the speeds at a width of 0.05 to 0.1 D over that of slots:
carbon steel 1.4, alloy steel 1.5, stainless 1.6, titanium 1.7, aluminium 1.2."""
GRAZING = 0.95
"""Feed of a move in air over that at which its chips would be thicker than the cutter bears."""
MAX_CHIP_THINNING = 1.5
"""Largest increase of the feed per tooth for a thin chip. Where a cutter runs into a rib the chip is not thin."""


@dataclass(frozen=True)
class CuttingData:
    """Cutting data of one tool in one material, in one kind of work.

    spindle_rpm    : 1/min, whole
    feed           : mm/min, cutting
    plunge_feed    : mm/min, moves that descend in or near material; ``PLUNGE_FACTOR`` of the feed
    cutting_speed  : m/min at the largest diameter in cut, after the speed limits
    feed_per_tooth : mm, after the feed limit
    limited_by     : 'material', 'tool', 'machine', 'default' or 'setup', the origin of the speed
    source         : source of the material's figures
    cut_back       : values of the setup for this tool that exceed a limit: field, value, limit
    """

    spindle_rpm: float
    feed: float
    plunge_feed: float
    cutting_speed: float
    feed_per_tooth: float
    limited_by: str
    source: str
    cut_back: tuple[tuple[str, float, float], ...] = ()


def feed_per_tooth(points: list[FeedPoint], diameter: float) -> float:
    """Feed per tooth at a diameter, mm: linear between the points, proportional to the diameter beyond the ends.

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


def chip_thinning(corner_radius: float, depth: float | None, engaged: float = math.pi) -> float:
    """Feed per tooth over the thickness of the thickest chip [Altintas2012], at most ``MAX_CHIP_THINNING``.

    corner_radius, depth : mm; None: any depth, so that the full radius may cut
    engaged              : rad, of the front half of the cutter; in a side cut cos(engaged) = 1 - 2 ae / D

    The factor is 1 / (sin(kappa) sin(engaged)). At the depth the edge of a round corner has the angle kappa to the
    axis,
    with cos(kappa) = 1 - depth / r. From ae >= D / 2 on the chip gets its full thickness.

    >>> chip_thinning(0.0, 1.0), round(chip_thinning(0.0, 1.0, math.radians(60.0)), 4)
    (1.0, 1.1547)
    >>> round(chip_thinning(5.0, 3.0), 4), chip_thinning(5.0, 0.1)
    (1.0911, 1.5)
    """
    axial = 1.0
    if depth is not None and depth < corner_radius:
        axial = math.sqrt(depth * (2.0 * corner_radius - depth)) / corner_radius
    radial = math.sin(engaged) if engaged < 0.5 * math.pi else 1.0
    return 1.0 / max(axial * radial, 1.0 / MAX_CHIP_THINNING)


def cut_diameter(tool: Tool, depth: float) -> float:
    """Largest diameter of a tool in a layer of a depth, mm: that of the corner, or of the side above it.

    >>> cone = Tool(id="T1", kind="tapered_flat", diameter_mm=2.0, taper_angle_deg=45.0, flute_length_mm=6.0)
    >>> round(cut_diameter(cone, 1.5), 6)
    5.0
    """
    if tool.arcs is not None:
        return 2.0 * tool.arcs.width(depth)
    if tool.taper_angle_deg > 0.0 and depth > tool.corner_height:
        return tool.side_mm(depth)
    return effective_diameter(tool.diameter_mm, tool.corner_radius_mm, depth)


def cutting_data(material: Material, tool: Tool, machine: Machine, depth: float | None = None, *,
                 light: bool = False) -> CuttingData:
    """Spindle speed and feed of a tool in a material on a machine.

    depth : mm, of layers in roughing; None: finishing, where a wall may touch the whole cutter
    light : little stock stands before it, so that it may go at ``FINISHING_SPEED`` times the speed of the material; not
            at a speed of the setup

    Notes
    -----
    The speed is n = 1000 vc / (pi d) at the largest diameter in cut, the feed n z fz [Tabellenbuch2022]. Chip thinning
    is
    applied to layers where the setup bounds the engagement, or where only the corner cuts. Values of the setup for the
    tool
    replace these. Limits of tool and machine apply to both. Where the machine states none and the tool has no value of
    its
    own, the limits are ``DEFAULT_MAX_RPM`` and ``DEFAULT_MAX_FEED_MM_MIN``. No feed is below the least feed.
    """
    # a finish cuts a thin skin a little over the end, so a cone does not count
    wide = tool.diameter_mm if depth is None else cut_diameter(tool, depth)
    cut_back: list[tuple[str, float, float]] = []

    def given(field: str, value: float, *limits: float | None) -> float:
        limit = min([x for x in limits if x is not None], default=math.inf)
        if value > limit:
            cut_back.append((field, value, limit))
        return min(value, limit)

    if tool.spindle_rpm is not None:
        limited_by, rpm = "setup", given("spindle_rpm", tool.spindle_rpm, tool.max_rpm, machine.max_rpm)
    else:
        speed = material.cutting_speed_m_min * (FINISHING_SPEED if light and has_own_speed(material) else 1.0)
        limits = [("material", 1000.0 * speed / (math.pi * wide))]
        if tool.max_rpm is not None:
            limits.append(("tool", tool.max_rpm))
        limits.append(("default", DEFAULT_MAX_RPM) if machine.max_rpm is None else ("machine", machine.max_rpm))
        limited_by, rpm = min(limits, key=lambda pair: pair[1])
    rpm = max(1.0, math.floor(rpm))
    if tool.feed_mm_min is not None:
        feed = given("feed_mm_min", tool.feed_mm_min, machine.max_feed_mm_min)
    else:
        # a finishing pass may engage the whole front in a thin skin, so its chip is as thick as in a slot
        limit = None if depth is None else tool.max_engagement_deg
        engaged = math.radians(180.0 if limit is None else limit)
        per_tooth = feed_per_tooth(material.feed_per_tooth, tool.diameter_mm) * chip_thinning(
            tool.corner_radius_mm, depth, engaged)
        feed = min(max(per_tooth * tool.flutes * rpm, MIN_FEED),
                   machine.max_feed_mm_min or DEFAULT_MAX_FEED_MM_MIN)
    plunge = max(PLUNGE_FACTOR * feed, MIN_FEED)
    if tool.plunge_feed_mm_min is not None:
        plunge = given("plunge_feed_mm_min", tool.plunge_feed_mm_min, machine.max_feed_mm_min)
    return CuttingData(rpm, feed, plunge, rpm * math.pi * wide / 1000.0, feed / (tool.flutes * rpm), limited_by,
                       material.source, tuple(cut_back))


def lightly_finished(setup: Setup, tool: Tool, body: ToolBody) -> bool:
    """Whether layers go before the finish of a tool and leave it little stock; see ``FINISHING_SPEED``."""
    left = left_by_layers(STEP_DOWN[tool.end] * tool.diameter_mm, lattice_step(body))
    return setup.operations.roughing and left <= LIGHT * tool.diameter_mm


def cutting_words(material: Material, tool: Tool, power: float | None = None) -> CuttingWords:
    """What tool and material say about cutting, for the proof; what the setup states goes into the fields of the tool.

    power : kW of the spindle, as the machine states it; None: it does not

    A layer as deep as ``STEP_DOWN`` allows, in a slot, is the recommended depth times width.
    """
    return CuttingWords(tool.flutes, material.cutting_speed_m_min,
                        feed_per_tooth(material.feed_per_tooth, tool.diameter_mm),
                        STEP_DOWN[tool.end] * tool.diameter_mm**2, LAYER_LIMIT,
                        material.specific_cutting_force_n_mm2, material.chip_thickness_exponent, tool.spindle_rpm,
                        tool.feed_mm_min, tool.plunge_feed_mm_min, tool.life_min,
                        None if tool.coolant is None else tool.coolant == "flood", tool.pitch_mm,
                        power, tool.flutes_given)


def bending(setup: Setup, tool: Tool, body: ToolBody, data: CuttingData, depth: float | None) -> DeflectionModel | None:
    """Load and stiffness for the deflection of a tool; None where the material has no specific cutting force.

    body  : the shape of the tool; data : its speeds in this kind of work
    depth : mm, of layers; None: finishing

    A layer may bend the tool by ``BENT_SHARE`` of the stock it leaves for finishing, at most ``LAYER_LIMIT``. A finish
    that climbs bends it away from the wall, by at most the scallop height. Otherwise it may cut in, by half of the
    gouge tolerance.
    """
    material = setup.material
    if material.specific_cutting_force_n_mm2 is None or material.chip_thickness_exponent is None:
        return None
    climbs = setup.operations.cut_direction == "climb"
    limit = setup.quality.scallop_height_mm if climbs else 0.5 * setup.quality.gouge_tolerance_mm
    if depth is not None:
        limit = min(LAYER_LIMIT, BENT_SHARE * left_by_layers(depth, lattice_step(body)))
    return DeflectionModel(body, compliance(body), material.specific_cutting_force_n_mm2,
                           material.chip_thickness_exponent, limit, tool.flutes, data.spindle_rpm, depth is None,
                           tool.feed_mm_min is not None, tool.plunge_feed_mm_min is not None)


def layer_depth(setup: Setup, tool: Tool, body: ToolBody, engaged: float) -> float:
    """Deepest layer of a tool, mm.

    body    : the shape of the tool
    engaged : rad, largest engaged angle of the front of the cutter

    ``STEP_DOWN`` of the diameter; less where the tool would bend too far even at its least chip
    (``DeflectionModel.bearable``). The limit is that of the thinnest layer, which leaves the least stock.
    """
    depth = STEP_DOWN[tool.end] * tool.diameter_mm
    data = cutting_data(setup.material, tool, setup.machine, depth)
    model = bending(setup, tool, body, data, THINNEST * depth)
    width = 0.5 * diameter_in_cut(body, depth) * (1.0 - math.cos(engaged))
    return depth if model is None else model.bearable(data.feed, depth, width)


def link_feed(setup: Setup, tool: Tool, rpm: float) -> float:
    """Feed of moves in air, mm/min: the highest of the machine, no faster than its rapids.

    rpm : of the spindle, 1/min

    Beside a wall such a move may graze stock that the planner does not see, so it is none that the cutter cannot bear.
    """
    machine, bears = setup.machine, GRAZING * CHIP_SHARE * tool.diameter_mm * tool.flutes * rpm
    return min(machine.max_feed_mm_min or DEFAULT_MAX_FEED_MM_MIN, rates_of(setup).rapid, bears)


def rates_of(setup: Setup) -> Rates:
    """Rates of the machine of a setup; corners are rounded by the tolerance of the programs (``path_tolerance``)."""
    machine, quality = setup.machine, setup.quality
    return Rates(machine.rapid_mm_min or RATES.rapid, machine.acceleration_mm_s2 or RATES.acceleration,
                 min(RATES.rounding, ScallopBudget(quality.scallop_height_mm, quality.chordal_tolerance_mm).program),
                 machine.jerk_mm_s3 or RATES.jerk)


__all__ = ["DEFAULT_MAX_FEED_MM_MIN", "DEFAULT_MAX_RPM", "MATERIALS", "MAX_CHIP_THINNING",
           "PLUNGE_FACTOR", "STEP_DOWN", "CuttingData", "bending", "chip_thinning", "cut_diameter", "cutting_data",
           "cutting_words",
           "feed_per_tooth", "find_material", "layer_depth", "lightly_finished", "link_feed", "rates_of"]
