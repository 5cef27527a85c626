"""SETUP.json: everything about a job except the part. Lengths are always mm; unknown fields are refused.

Only ``tools`` is required. ``canonical_json`` and ``setup_sha256`` use the setup with all defaults filled in, so a
missing field and its default value are the same job.
"""

from __future__ import annotations

import hashlib
import json
import math
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from schemas.base import Count, FaceId, Number, Shelf, Triple, WireModel
from schemas.machine import Machine
from schemas.materials import MATERIALS, Material, MaterialField
from schemas.tools import VERIFIED_KINDS, HolderSegment, Tool, numbered

AXIS_TOLERANCE = 1e-6
SHORTEST_AXIS = 1e-6
SAME_DIRECTION = 1.0 - 1e-6  # cosine of the angle between two accesses
Box = Annotated[list[Triple], Field(min_length=2, max_length=2, description="Lower and upper corner, mm.")]


class PartChoice(WireModel):
    """The body of the STEP file to machine."""

    solid: Annotated[Count | None, Field(
        ge=1, description="Number of the solid, from 1. Required if the file has several separate solids; null: the "
                          "only one. Bodies of one product that overlap count as one solid. A product that an assembly "
                          "places is read at its place.")] = None
    fuse: Annotated[bool, Field(
        description="true: the products of the file are one part, and bodies that overlap or share a face are "
                    "united. false: products that an assembly places are separate solids, and so is a body that only "
                    "touches another.")] = False
    others: Annotated[Literal["fixtures", "absent"] | None, Field(
        description="The other solids of the file, where solid names one of several. fixtures: boxes that hold "
                    "each, along the axes of the setup frame, are fixtures. absent: they are not on the machine. null: "
                    "absent, and proof.assumed lists those that a tool enters.")] = None


class Placement(WireModel):
    """The setup frame in STEP coordinates; its origin is program zero."""

    origin_mm: Annotated[Triple, Field(description="Origin of the setup frame, mm; within 1e6 of 0.")] = [0.0, 0.0, 0.0]
    z_axis: Annotated[Triple, Field(description="Z of the setup frame; any length from "
                                                "1e-6, components within 1e6.")] = [0.0, 0.0, 1.0]
    x_axis: Annotated[Triple, Field(description="X of the setup frame, perpendicular to Z; "
                                                "length as for z_axis.")] = [1.0, 0.0, 0.0]

    @model_validator(mode="after")
    def _check(self) -> Placement:
        lengths = math.hypot(*self.z_axis), math.hypot(*self.x_axis)
        for name, length in zip(("z_axis", "x_axis"), lengths, strict=True):
            if length < SHORTEST_AXIS:
                raise ValueError(f"placement.{name} has length {length:g}, almost zero length; give a direction such "
                                 "as [0, 0, 1]")
        cosine = sum(a * b for a, b in zip(self.z_axis, self.x_axis, strict=True)) / (lengths[0] * lengths[1])
        if abs(cosine) > AXIS_TOLERANCE:
            raise ValueError(f"placement.z_axis and x_axis must be at right angles; their angle is "
                             f"{math.degrees(math.acos(max(-1.0, min(1.0, cosine)))):.4f} degrees")
        return self


class Access(WireModel):
    """A direction from which the part is machined, in the setup frame."""

    id: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9]{0,15}$", description="Id of the access.")] = "A1"
    direction: Annotated[Triple, Field(
        description="Tool axis, from tool tip to spindle; any length above zero. On a 3-axis machine each access has "
                    "its own program in its own frame. Z of this frame is this direction; its X is the X axis of the "
                    "setup frame, projected perpendicular to Z. On a 5-axis machine one program in the setup frame "
                    "serves all accesses.")] = [0.0, 0.0, 1.0]
    work_offset: Annotated[str, Field(pattern=r"^G5(4|5|6|7|8|9(\.[123])?)$", description="Work offset, G54 to G59, "
                                      "G59.1 to G59.3.")] = "G54"

    @model_validator(mode="after")
    def _check(self) -> Access:
        length = math.hypot(*self.direction)
        if length < SHORTEST_AXIS:
            raise ValueError(f"access {self.id}: direction {self.direction} has length {length:g}, almost zero length; "
                             "give a direction such as [0, 0, 1]")
        return self


class Cylinder(WireModel):
    """A cylinder along Z of the setup frame."""

    x: Annotated[Number, Field(ge=-1e6, le=1e6, description="Position of its axis, mm.")] = 0.0
    y: Annotated[Number, Field(ge=-1e6, le=1e6, description="Position of its axis, mm.")] = 0.0
    bottom: Annotated[Number, Field(ge=-1e6, le=1e6, description="Height of its lower end, mm.")]
    diameter: Annotated[Number, Field(gt=0, le=1e6, description="Diameter, mm.")]
    height: Annotated[Number, Field(gt=0, le=1e6, description="Height, mm.")]


class Stock(WireModel):
    """The blank from which the job starts."""

    kind: Annotated[Literal["part_offset", "box", "cylinder", "step"], Field(
        description="part_offset: the part, enlarged by margin_mm. box: see box_mm. cylinder: see cylinder_mm. step: "
                    "the solid of a STEP file, see step_file.")] = "part_offset"
    margin_mm: Annotated[Number, Field(ge=0, le=1000, description="Distance between part and blank, mm.")] = 1.0
    uncertainty_mm: Annotated[Number, Field(
        ge=0, le=100, description="How much larger the real blank may be than the nominal one, mm.")] = 0.5
    box_mm: Annotated[Box | None, Field(
        description="Corners of a box blank in the setup frame, mm; null: the bounding box of the part, enlarged by "
                    "margin_mm.")] = None
    cylinder_mm: Annotated[Cylinder | None, Field(
        description="A cylinder blank along Z of the setup frame, mm. null: around the bounding box of the part, "
                    "enlarged by margin_mm at the side and on top.")] = None
    step_file: Annotated[str | None, Field(
        min_length=1, max_length=1000, pattern=r"^[^\x00-\x1f\x7f]*$",
        description="STEP file of a blank with kind step: one closed solid in the coordinates of the part's file. "
                    "Command line: a path, relative to the folder of the setup. HTTP: the request sends the file as "
                    "form field 'stock', and this name is ignored. The content hash of a job contains the bytes of the "
                    "file, not its name.")] = None

    @model_validator(mode="after")
    def _check(self) -> Stock:
        if self.step_file is not None and self.kind != "step":
            raise ValueError("stock.step_file belongs to stock.kind 'step'")
        if self.cylinder_mm is not None and self.kind != "cylinder":
            raise ValueError("stock.cylinder_mm belongs to stock.kind 'cylinder'")
        if self.box_mm is not None:
            if self.kind != "box":
                raise ValueError("stock.box_mm belongs to stock.kind 'box'")
            _check_box(self.box_mm, "stock.box_mm")
        return self


class Fixture(WireModel):
    """A box that no tool and no holder may touch."""

    box_mm: Annotated[Box, Field(description="Lower and upper corner in the setup frame, mm.")]

    @model_validator(mode="after")
    def _check(self) -> Fixture:
        _check_box(self.box_mm, "a fixture's box_mm")
        return self


class Clearance(WireModel):
    """Smallest allowed radial distances to part, stock and fixtures, mm."""

    neck: Annotated[Number, Field(ge=0, le=100, description="Of the neck, mm.")] = 0.05
    shank: Annotated[Number, Field(ge=0, le=100, description="Of the shank, mm.")] = 0.2
    holder: Annotated[Number, Field(ge=0, le=100, description="Of the holder, mm.")] = 1.0
    rapid: Annotated[Number, Field(ge=0, le=100, description="Of the whole tool during a rapid, mm, aside and to what "
                                                             "is below it.")] = 1.0
    approach: Annotated[Number, Field(
        ge=0, le=100, description="Of the whole tool to what is below it, in a rapid straight down before a cut, mm. "
                                  "0: the tool may touch, and not enter. Where it is larger than rapid, rapid holds. "
                                  "A rapid straight up needs no clearance.")] = 0.0


class Quality(WireModel):
    """Requirements on the finished surface."""

    scallop_height_mm: Annotated[Number, Field(
        ge=1e-4, description="Largest scallop height between passes, along the normal, mm; from 0.0001.")] = 0.01
    chordal_tolerance_mm: Annotated[Number, Field(
        ge=1e-4, le=1, description="Largest distance from path to surface along a pass, mm; from 0.0001.")] = 0.002
    gouge_tolerance_mm: Annotated[Number, Field(
        ge=1e-3, le=1, description="Deepest cut into the part that is not a finding, mm. At least 0.001, since the "
                                   "mesh of the part must be finer.")] = 0.01
    stock_allowance_mm: Annotated[Number, Field(
        ge=0, le=50, description="Material left on the part on purpose, mm.")] = 0.0
    coverage_min: Annotated[Number, Field(
        ge=0, le=1, description="Smallest coverage of a proved job: proved area divided by machinable area.")] = 0.0


class Lean(WireModel):
    """Lead and tilt angles of ball and bull-nose tools, measured from the normal of the finished face."""

    lead_deg: Annotated[Number, Field(
        ge=0, le=60, description="Lead: angle forward along the pass, degrees. Above 7.5 degrees the tool retracts "
                                 "before a pass in the opposite direction.")] = 0.0
    tilt_deg: Annotated[Number, Field(
        ge=0, le=60, description="Tilt: angle across the pass, degrees, toward the side on which more of the passes "
                                 "are free of collision.")] = 0.0
    walls_tilt_deg: Annotated[Number | None, Field(
        ge=0, le=89, description="Tilt on walls, degrees, without a lead. null: walls are cut upright or with the "
                                 "flank of the tool.")] = None

    @property
    def asked(self) -> bool:
        """Whether any lead or tilt is set."""
        return self.lead_deg > 0 or self.tilt_deg > 0 or self.walls_tilt_deg is not None


class Operations(WireModel):
    """Which faces to machine, and how."""

    roughing: Annotated[bool, Field(description="Remove the stock in layers first.")] = True
    semi_finishing: Annotated[bool, Field(
        description="After roughing, the same tool also cuts the steps that its layers leave. The stock on inclined "
                    "walls and floors then varies by at most a quarter of the deepest layer.")] = False
    finishing: Annotated[bool, Field(description="Finish the zones.")] = True
    faces: Annotated[list[FaceId] | None, Field(
        description="Faces to machine. null: every face that some access sees. A program that brings another face "
                    "to size is a finding.")] = None
    exclude_faces: Annotated[list[FaceId], Field(
        description="Faces that are not finished and not checked for stock left. A program that brings one to size is "
                    "a finding.")] = []
    cut_direction: Annotated[Literal["climb", "conventional", "either"], Field(
        description="Direction of cut on walls.")] = "climb"
    pattern: Annotated[Literal["auto", "zigzag", "one_way", "spiral"], Field(
        description="Pattern of passes on shallow areas. auto: zigzag or spiral, whichever is shorter.")] = "auto"
    lean: Annotated[Lean, Field(
        description="Lead and tilt of ball and bull-nose tools, so that the tool centre does not rub. On a 5-axis "
                    "machine with machine.simultaneous the tool is tilted by these angles from the normal of faces "
                    "that are not level. Where it would collide, its axis turns evenly to the nearest free axis, up to "
                    "45 degrees away. The tool stays upright on level faces and where no axis is free. Flank milling "
                    "and curvature-matched passes come first where they are faster and the tool is not upright along "
                    "more of the cut. Without angles (the default) tools are tilted for these two strategies "
                    "only.")] = Lean()
    walls_in_turn: Annotated[bool, Field(
        description="true: on a 3-axis machine with one access, both sides of a thin wall are finished in alternating "
                    "bands of depth. A thin wall is more than 10 times as high as thick. It is a finding if more than "
                    "10 times its thickness stands unsupported where it is finished. On a 5-axis machine or with "
                    "several accesses there are no bands, and this is a warning. false: no bands; you support such "
                    "walls by other means, and the report has a warning.")] = True

    @model_validator(mode="after")
    def _check(self) -> Operations:
        if not (self.roughing or self.finishing):
            raise ValueError("operations.roughing and operations.finishing are both false: nothing to do")
        if self.semi_finishing and not self.roughing:
            raise ValueError("operations.semi_finishing needs operations.roughing, which is false")
        if self.faces is not None and not self.faces:
            raise ValueError("operations.faces names no face: name one, or leave the field out for all of them")
        if both := sorted(set(self.faces or ()) & set(self.exclude_faces)):
            raise ValueError(f"faces {', '.join(both)} are in operations.faces and in operations.exclude_faces")
        return self


Labels = Annotated[dict[Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$")],
                        Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]],
                   Field(max_length=32, description="Your own keys and values. They appear in job, report, program "
                                                    "header and STEP-NC.")]


def _describe(schema: dict[str, Any]) -> None:
    """Adds an example, and defaults for generated clients: an object for a union field, which they cannot construct."""
    schema["examples"] = [{
        "tools": [{"id": "T1", "kind": "ball", "diameter_mm": 3, "flute_length_mm": 9, "neck_diameter_mm": 2.8,
                   "neck_length_mm": 20, "shank_diameter_mm": 6, "stickout_mm": 45,
                   "holder": [{"diameter_mm": 20, "length_mm": 30}]}],
        "quality": {"scallop_height_mm": 0.01}, "material": "Ti-6Al-4V", "labels": {"order": "4711"}}]
    schema["properties"]["machine"].pop("default")
    schema["properties"]["material"]["default"] = "Ti-6Al-4V"


class Setup(WireModel):
    """A setup: tools, machine, blank and required quality. Only ``tools`` is required."""

    model_config = {"json_schema_extra": lambda schema: _describe(schema)}

    part: Annotated[PartChoice, Field(description="Which body of the STEP file is the part.")] = PartChoice()
    placement: Annotated[Placement, Field(description="The setup frame in STEP coordinates.")] = Placement()
    access: Annotated[list[Access], Field(min_length=1, max_length=6,
                                          description="Directions from which the part is machined.")] = [Access()]
    tools: Annotated[list[Annotated[Tool, Shelf("tools")]], Field(
        min_length=1, max_length=200, description="Tools, each as an object or 'lib:NAME'.")]
    machine: Annotated[Machine, Shelf("machines"), Field(
        description="The machine, as an object or 'lib:NAME'.")] = Machine()
    stock: Annotated[Stock, Field(description="The blank.")] = Stock()
    fixtures: Annotated[list[Fixture], Field(max_length=200, description="Boxes that nothing may touch.")] = []
    clearance_mm: Annotated[Clearance, Field(description="Radial clearances.")] = Clearance()
    quality: Annotated[Quality, Field(description="Requirements on the surface.")] = Quality()
    operations: Annotated[Operations, Field(description="Which faces to machine, and how.")] = Operations()
    material: Annotated[MaterialField, Field(
        description="Name of a material (EN, DIN, material number, AISI, UNS or trade name) or of a group (ISO P, M, "
                    f"K, N, S or H), 'lib:NAME', or an object. {', '.join(MATERIALS)} have figures of their own; "
                    "other materials get those of their group, and proof.assumed says so.")] = MATERIALS["Ti-6Al-4V"]
    labels: Labels = {}

    @model_validator(mode="after")
    def _check(self) -> Setup:
        self.tools = numbered(self.tools)
        _check_accesses(self.access)
        mills = [t for t in self.tools if t.kind not in VERIFIED_KINDS]
        smallest = min(mills, key=lambda t: t.diameter_mm, default=None)
        if smallest is not None and self.quality.scallop_height_mm >= smallest.diameter_mm / 2:
            raise ValueError(f"quality.scallop_height_mm {self.quality.scallop_height_mm:g} is not below the radius "
                             f"{smallest.diameter_mm / 2:g} of the smallest tool {smallest.id}")
        if self.operations.lean.asked and not (self.machine.kind == "5-axis" and self.machine.simultaneous):
            raise ValueError("operations.lean tilts tools while they cut, which this machine cannot do; "
                             "set machine.kind '5-axis' and machine.simultaneous true, or leave operations.lean out")
        return self


def _check_accesses(access: list[Access]) -> None:
    """Refuse two accesses with one id or one direction."""
    for k, a in enumerate(access):
        for b in access[:k]:
            if a.id == b.id:
                raise ValueError(f"two accesses have the id {a.id}; give each its own")
            cosine = sum(p * q for p, q in zip(a.direction, b.direction, strict=True))
            cosine /= math.hypot(*a.direction) * math.hypot(*b.direction)
            if cosine > SAME_DIRECTION:
                raise ValueError(f"access {a.id} has the same direction as {b.id}; leave one of them out")


def _check_box(box: list[list[float]], name: str) -> None:
    if any(high <= low for low, high in zip(box[0], box[1], strict=True)):
        raise ValueError(f"{name}: the second corner must lie above the first in x, y and z")


def canonical_json(setup: Setup) -> bytes:
    """The setup as canonical JSON: all defaults filled in, keys sorted, no spaces, UTF-8.

    Equal setups give equal bytes, also for 3 and 3.0, since every number field is a float. The file name of a blank is
    left
    out.
    """
    data = setup.model_dump(mode="json", exclude={"stock": {"step_file"}})
    return json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


def setup_sha256(setup: Setup) -> str:
    """SHA-256 of the canonical JSON, hex."""
    return hashlib.sha256(canonical_json(setup)).hexdigest()


def content_hash(part_bytes: bytes, setup: Setup, stock_bytes: bytes | None = None) -> str:
    """Identity of a job: SHA-256 over the hashes of the part's bytes and of the canonical setup, hex.

    The bytes of a blank's file count too. File name, media type and multipart boundary do not.
    """
    text = f"{hashlib.sha256(part_bytes).hexdigest()}:{setup_sha256(setup)}"
    if stock_bytes is not None:
        text += f":stock {hashlib.sha256(stock_bytes).hexdigest()}"
    return hashlib.sha256(text.encode()).hexdigest()


__all__ = [
    "Access", "Clearance", "Fixture", "HolderSegment", "Machine", "Material", "Operations", "PartChoice", "Placement",
    "Quality", "Setup", "Stock", "Tool", "canonical_json", "content_hash", "setup_sha256",
]
