"""What a job needs from its setup, converted once.

``JobInputs.of`` is the one place where a setup becomes what the inner packages take: bodies of tools, cutting data,
clearances, frames, rates and limits. Sections of the setup that are plain values already (machine, stock, quality,
operations) are kept as they are. Everything after it takes a ``JobInputs`` and no ``Setup``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.cutting_mechanics import diameter_in_cut
from geometry.machine_rates import Rates
from geometry.mesh import F64
from geometry.part import OtherSolid
from geometry.setup_frame import SetupFrame
from geometry.tool_body import ToolBody
from output.inverse_kinematics import RotaryMachine
from schemas.machine import Machine
from schemas.materials import Material
from schemas.setup import Access, Operations, Quality, Setup, Stock, setup_sha256
from schemas.tools import Tool
from service.cutting_data import (
    bending,
    cutting_data,
    cutting_words,
    layer_depth,
    lightly_finished,
    link_feed,
    rates_of,
)
from service.from_wire import (
    gauge_lengths,
    machine_kinematics,
    material_name,
    mesh_chord,
    placement_of,
    rotary_limits,
    rotary_machine,
    tool_bodies,
)
from toolpath.plan_settings import CutData
from toolpath.scallop_budget import ScallopBudget
from verify.cutting_words import CuttingWords
from verify.kinematics import Kinematics
from zones.reach.assembly import Clearances

ENGAGEMENT_SHARE = 0.15  # of the radius of a tool, between places of the stock: at the edge 32 degrees of it
SLOT_DEG = 180.0  # engaged angle of a slot
RAMP_ANGLE = math.radians(3.0)
STEEP_RAMP, SOFT = math.radians(10.0), 900.0  # in materials whose kc1.1 is no more than that many N/mm²: light metals


@dataclass(frozen=True, eq=False)
class JobInputs:
    """A setup in the terms of planner, writers and proof.

    sha256        : of the setup in canonical form
    labels        : texts of the user by key
    solid         : which solid of the STEP file, from 1; None for the only one
    fuse          : whether the products of the STEP file are one part
    placement     : the setup frame in the coordinates of the STEP file
    accesses      : as in the setup, the first one is that of the decomposition
    tools, bodies : entries and shapes of the tools, in the same order
    cut_table     : speeds, feeds and layer depths by tool id
    gauge_lengths : mm from the spindle face to the tip, by T number
    machine, stock, quality, operations, material : sections of the setup
    clearances    : radial, mm
    fixtures      : (2, 3) float64 each, mm, setup frame, lower and upper corner of a box
    others        : the other solids of the part's file, where the setup does not state what they are
    rates         : what the machine does
    """

    sha256: str
    labels: Mapping[str, str]
    solid: int | None
    fuse: bool
    placement: SetupFrame
    accesses: tuple[Access, ...]
    tools: tuple[Tool, ...]
    bodies: tuple[ToolBody, ...]
    cut_table: Mapping[str, CutData]
    gauge_lengths: Mapping[int, float]
    machine: Machine
    stock: Stock
    fixtures: tuple[F64, ...]
    others: tuple[OtherSolid, ...]
    clearances: Clearances
    quality: Quality
    operations: Operations
    material: Material
    material_name: str
    rates: Rates

    @classmethod
    def of(cls, setup: Setup, others: Sequence[OtherSolid] = ()) -> JobInputs:
        """The inputs of a job from its setup; others : the other solids of the part's file."""
        sha256 = setup_sha256(setup)
        setup = setup.model_copy(update={"tools": [t.in_material(material_name(setup)) for t in setup.tools]})
        c, bodies = setup.clearance_mm, tool_bodies(setup)
        return cls(sha256, setup.labels, setup.part.solid, setup.part.fuse, placement_of(setup),
                   tuple(setup.access), tuple(setup.tools), bodies, _cut_table(setup, bodies),
                   gauge_lengths(setup.tools, bodies), setup.machine, setup.stock,
                   fixtures_of(setup, others), () if setup.part.others else tuple(others),
                   Clearances(c.neck, c.shank, c.holder, c.rapid, c.approach), setup.quality, setup.operations,
                   setup.material, material_name(setup), rates_of(setup))

    @property
    def turns(self) -> bool:
        """Whether the machine has rotary axes, so that all accesses are cut in one clamping by one program."""
        return self.machine.kind == "5-axis"

    @cached_property
    def rotary(self) -> RotaryMachine | None:
        """The rotary axes as the writers take them; None on a machine of three axes.

        Raises
        ------
        SetupError
            As ``service.from_wire.rotary_machine``.
        """
        return rotary_machine(self.machine)

    @cached_property
    def kinematics(self) -> Kinematics | None:
        """The rotary axes as the proof takes them; None on a machine of three axes."""
        return machine_kinematics(self.machine)

    @cached_property
    def rotary_limits(self) -> F64 | None:
        """(2, 2) float64, rad: least and greatest angle of the tilting and the turning axis; None where not limited."""
        return rotary_limits(self.machine)

    @property
    def budget(self) -> ScallopBudget:
        """The shares of the allowed scallop and of the chordal tolerance."""
        return ScallopBudget(self.quality.scallop_height_mm, self.quality.chordal_tolerance_mm)

    @property
    def mesh_chord(self) -> float:
        """Chord of the mesh, mm: its share of the scallop and of the gouge tolerance."""
        return mesh_chord(self.quality)

    @property
    def max_engaged(self) -> dict[int, float]:
        """Rad by T number: the largest engaged angle, of the tools that have a limit of it."""
        return {body.number: math.radians(t.max_engagement_deg)
                for t, body in zip(self.tools, self.bodies, strict=True) if t.max_engagement_deg is not None}

    @property
    def max_rpm(self) -> dict[int, float]:
        """1/min by T number: the largest speed that tool and machine allow, where one of them has a limit."""
        return {body.number: min(limits) for t, body in zip(self.tools, self.bodies, strict=True)
                if (limits := [x for x in (t.max_rpm, self.machine.max_rpm) if x is not None])}

    def ramp_angles(self, *, foreign: bool) -> dict[int, float]:
        """Rad by T number: the steepest angle at which a tool may go down into stock, where it is not ``RAMP_ANGLE``.

        foreign : whether the programs were not planned here; plans go down at ``RAMP_ANGLE`` at most
        """
        soft = (self.material.specific_cutting_force_n_mm2 or math.inf) <= SOFT
        out = {}
        for t, body in zip(self.tools, self.bodies, strict=True):
            usual = STEEP_RAMP if foreign and soft and t.center_cutting else RAMP_ANGLE
            angle = usual if t.ramp_angle_deg is None else math.radians(t.ramp_angle_deg)
            out[body.number] = angle if foreign else min(angle, RAMP_ANGLE)
        return {number: angle for number, angle in out.items() if angle != RAMP_ANGLE}

    @property
    def cutting(self) -> dict[int, CuttingWords]:
        """What tools and material say about cutting, by T number."""
        return {body.number: cutting_words(self.material, t, self.machine.max_power_kw)
                for t, body in zip(self.tools, self.bodies, strict=True)}

    @property
    def cores(self) -> dict[int, float]:
        """Mm by T number: diameter at the end within which a tool does not cut, of tools that do not cut to the centre.

        Taps are left out: what stands before them is judged by the hole that they need.
        """
        return {body.number: t.core_mm for t, body in zip(self.tools, self.bodies, strict=True)
                if not t.center_cutting and t.kind != "tap"}

    @property
    def tap_holes(self) -> dict[int, float]:
        """Mm by T number: the hole that must stand before a tap, where the setup states it."""
        return {body.number: t.core_diameter_mm for t, body in zip(self.tools, self.bodies, strict=True)
                if t.kind == "tap" and t.core_diameter_mm is not None}

    @property
    def tool_lives(self) -> dict[str, float]:
        """Minutes in cut by tool id, of the tools whose life is limited."""
        return {t.id: t.life_min for t in self.tools if t.life_min is not None}

    @property
    def engagement_spacing(self) -> float:
        """Largest spacing of the stock, mm, at which engaged angles can be told apart; inf where none is limited."""
        return min((ENGAGEMENT_SHARE * 0.5 * t.diameter_mm for t in self.tools
                    if (t.max_engagement_deg or SLOT_DEG) < SLOT_DEG), default=math.inf)


def fixtures_of(setup: Setup, others: Sequence[OtherSolid]) -> tuple[F64, ...]:
    """Fixtures as (2, 3) float64, mm, setup frame: those of the setup, then the other solids that it takes for some."""
    boxes = [np.array(f.box_mm, dtype=np.float64) for f in setup.fixtures]
    return (*boxes, *(box for o in others if setup.part.others == "fixtures" for box in o.held_by))


def _cut_table(setup: Setup, bodies: Sequence[ToolBody]) -> dict[str, CutData]:
    """Speeds, feeds and layer depths by tool id; layers are slots, as far as the engaged angle is not bounded."""
    out = {}
    for tool, body in zip(setup.tools, bodies, strict=True):
        engaged = math.radians(SLOT_DEG if tool.max_engagement_deg is None else tool.max_engagement_deg)
        depth = layer_depth(setup, tool, body, engaged)
        rough = cutting_data(setup.material, tool, setup.machine, depth)
        fine = cutting_data(setup.material, tool, setup.machine, light=lightly_finished(setup, tool, body))
        link = link_feed(setup, tool, min(rough.spindle_rpm, fine.spindle_rpm))
        finish = CutData(fine.spindle_rpm, fine.feed, fine.plunge_feed, link, depth, engaged,
                         bending=bending(setup, tool, body, fine, None))
        layers = CutData(rough.spindle_rpm, rough.feed, rough.plunge_feed, link, depth, engaged, finish,
                         bending(setup, tool, body, rough, depth))
        slot = diameter_in_cut(body, depth)
        out[tool.id] = layers.under(depth, 0.5 * slot * (1.0 - math.cos(engaged)))
    return out


__all__ = ["JobInputs"]
