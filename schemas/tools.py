"""Tools of a setup; every length in mm from the tip upwards."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, field_serializer, model_validator

from geometry.arc_pair import ArcPair
from schemas.base import Count, Number, WireModel
from schemas.materials import same_material

ToolKind = Literal["ball", "flat", "bull", "tapered_ball", "tapered_bull", "tapered_flat", "lens", "barrel", "drill",
                   "tap", "chamfer", "thread_mill"]
TAPERED_KINDS = ("tapered_ball", "tapered_bull", "tapered_flat")
SEGMENT_KINDS = ("lens", "barrel")
"""Circle segment mills: a large arc is part of their outline."""
BUILT_KINDS = ("ball", "flat", "bull", *TAPERED_KINDS, *SEGMENT_KINDS)
VERIFIED_KINDS = ("drill", "tap", "chamfer", "thread_mill")
"""Kinds that programs to be verified use, and that jobs do not plan."""
THREADING_KINDS = ("tap", "thread_mill")
POINT_ANGLES = {"drill": 118.0, "chamfer": 90.0}
"""Default of ``point_angle_deg``, deg."""
LENGTH_EPSILON = 1e-9
MAX_TAPER = 45.0
"""Largest ``taper_angle_deg``, deg; a wider cone is a chamfer mill."""
MAX_PROFILE_RADIUS = 5000.0
"""Largest ``profile_radius_mm``, mm; a flatter end is a flat end mill."""
MIN_SEGMENT_DIAMETER = 1.5
"""Least ``diameter_mm`` of a lens or barrel, mm: the proof looks closer at finer ends of other kinds only."""
CUTTING_FIELDS = ("spindle_rpm", "feed_mm_min", "plunge_feed_mm_min")
"""Speeds and feeds that a tool states for all materials, or in ``cutting_data`` for each."""
CORE_SHARE = 0.3
"""Default of ``core_diameter_mm`` as a share of the diameter."""

MAX_LENGTH = 2000.0
"""Greatest length and diameter, mm."""

Length = Annotated[Number, Field(ge=1e-3, le=MAX_LENGTH)]
Line = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f]*$")]
"""Text without line ends and control characters."""


class HolderSegment(WireModel):
    """A conical or cylindrical segment of the holder; segments stack upwards from the holder nose."""

    diameter_mm: Annotated[Length, Field(description="Diameter at the lower end, mm.")]
    diameter_top_mm: Annotated[Length | None, Field(description="Diameter at the upper end, mm; "
                                                                "default: diameter_mm.")] = None
    length_mm: Annotated[Length, Field(description="Height of the segment, mm.")]

    @model_validator(mode="after")
    def _derive(self) -> HolderSegment:
        if self.diameter_top_mm is None:
            self.diameter_top_mm = self.diameter_mm
        return self


class ToolCuttingData(WireModel):
    """Speeds and feeds of a tool in one material."""

    material: Annotated[Line | None, Field(
        min_length=1, max_length=100, description="Name of the material, as in material of the setup; a known other "
                                                  "name of a built-in material counts too. null: any material that "
                                                  "has no entry of its own.")] = None
    spindle_rpm: Annotated[Number | None, Field(
        ge=1, le=1e6, description="Spindle speed, 1/min. null: computed from the material.")] = None
    feed_mm_min: Annotated[Number | None, Field(
        ge=0.1, le=1e6, description="Cutting feed, mm/min. null: computed.")] = None
    plunge_feed_mm_min: Annotated[Number | None, Field(
        ge=0.1, le=1e6, description="Downward feed into stock, mm/min. null: computed.")] = None


class Tool(WireModel):
    """One tool assembly: cutter, neck, shank and holder."""

    model_config = {"json_schema_extra": {"examples": [{
        "id": "T1", "number": 1, "kind": "ball", "diameter_mm": 3, "flutes": 2, "flute_length_mm": 9,
        "neck_diameter_mm": 2.8, "neck_length_mm": 20, "shank_diameter_mm": 6, "stickout_mm": 45,
        "holder": [{"diameter_mm": 20, "diameter_top_mm": 20, "length_mm": 30}]}]}}

    id: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$", description="Id of the tool.",
                             examples=["T1"])]
    number: Annotated[Count | None, Field(
        ge=1, le=99999, description="Tool number in programs, in T and H words. Default: the digits of the id if they "
                                    "are unique, otherwise the position in the list.")] = None
    kind: Annotated[ToolKind, Field(description="Shape of the cutting part. Kinds drill, tap, chamfer and thread_mill "
                                                "are for programs to be verified; jobs do not plan them. A lens ends "
                                                "in an arc round a point of its axis, a barrel has a large arc above "
                                                "the corner or ball at its tip.")]
    diameter_mm: Annotated[Length, Field(ge=0.01, description="Diameter of the cutting part, mm, from 0.01. Of a tap "
                                                              "or thread mill the outer diameter of its teeth. Of a "
                                                              "tapered mill the diameter of the end: of its ball, or "
                                                              "of the flat with the corner radius on both sides. Of "
                                                              "a lens or barrel the largest diameter.")]
    point_angle_deg: Annotated[Number | None, Field(
        ge=10, le=180, description="Whole angle of the cone at the end, deg. Default: 118 for a drill, 90 for a "
                                   "chamfer mill. null for a tap means no lead. null for all other kinds.")] = None
    tip_diameter_mm: Annotated[Number | None, Field(
        ge=0, le=2000, description="Diameter of the flat at the tip of the cone, mm. Default: 0, a point. The lead of "
                                   "a tap needs it. Of a barrel the diameter of the flat inside its corner; default: "
                                   "0, a ball at the tip.")] = None
    pitch_mm: Annotated[Number | None, Field(
        ge=0.01, le=100, description="Pitch of the thread that a tap or thread mill cuts, mm. Feed over spindle speed "
                                     "of a tap, and the helices of a thread mill, must be within 2 % of it. null: only "
                                     "pitches that no thread has are findings. null for all other kinds.")] = None
    corner_radius_mm: Annotated[Number, Field(
        ge=0, description="Corner radius, mm. Above 0 for a bull nose, 0 for a flat end mill. For a ball, 0 means half "
                          "the diameter. Of a lens the radius between its arc and its side, 0 for a sharp rim. Of a "
                          "barrel the radius at its tip, above 0.")] = 0.0
    taper_angle_deg: Annotated[Number, Field(
        ge=0, lt=90, description="Angle between the side of a tapered mill and its axis, deg: half the whole angle of "
                                 "the cone, at most 45. The cone touches ball or corner without an edge and ends with "
                                 "the flutes. Of a barrel the angle between the axis and its large arc where that "
                                 "reaches diameter_mm: 0 for an oval or tangential barrel, above 0 for a taper barrel. "
                                 "0 for all other kinds.")] = 0.0
    profile_radius_mm: Annotated[Number | None, Field(
        gt=0, le=MAX_PROFILE_RADIUS, description="Radius of the large arc of a lens or barrel, mm. null for all other "
                                                 "kinds.")] = None
    flutes: Annotated[Count, Field(ge=1, le=50, description="Number of teeth.")] = 2
    flute_length_mm: Annotated[Length | None, Field(
        description="Tip to the end of the cutting part, mm. Default: 3 x diameter_mm, but not more than "
                    "neck_length_mm and stickout_mm where they are given.")] = None
    center_cutting: Annotated[bool, Field(description="true: the end of the tool cuts to the centre.")] = True
    core_diameter_mm: Annotated[Number | None, Field(
        gt=0, le=2000, description="With center_cutting false: diameter at the end of the tool within which it does "
                                   "not cut, mm. null: 0.3 of diameter_mm. Such a tool goes straight down into no "
                                   "stock, and on no helix that is narrower than its core. Of a tap: the hole that "
                                   "must be there before it, mm; null: as diameter and pitch tell.")] = None
    ramp_angle_deg: Annotated[Number | None, Field(
        gt=0, le=90, description="Steepest angle at which the tool may go down into stock, deg. Plans use at most 3. "
                                 "null: 3; in a verified program 10 for a tool that cuts to its centre, in a material "
                                 "whose specific_cutting_force_n_mm2 is at most 900.")] = None
    neck_diameter_mm: Annotated[Length | None, Field(
        description="Diameter of the relieved part, mm. Default: diameter_mm, of a tapered mill its widest "
                    "diameter.")] = None
    neck_length_mm: Annotated[Length | None, Field(
        description="Tip to shank, mm. Default: flute_length_mm, which means no neck.")] = None
    shank_diameter_mm: Annotated[Length | None, Field(
        description="Diameter of the shank, mm. Default: diameter_mm, of a tapered mill its widest diameter.")] = None
    stickout_mm: Annotated[Length | None, Field(
        description="Tip to holder nose, mm. Required with a holder. Default without one: the greater of "
                    "neck_length_mm and 10 x diameter_mm.")] = None
    _flutes_given: bool = PrivateAttr(default=False)
    _gauge_given: bool = PrivateAttr(default=False)
    gauge_length_mm: Annotated[Length | None, Field(
        description="Tip to spindle face, mm. Used for the length offset, the travel in Z and the kinematics only. "
                    "Default: stickout_mm plus the lengths of the holder.")] = None
    description: Annotated[Line, Field(max_length=400, description="Your own words for the tool.")] = ""
    order_code: Annotated[Line, Field(max_length=200, description="Order number of the cutter.")] = ""
    library_id: Annotated[Line, Field(
        max_length=200, description="Id of the entry in the tool library that the tool was imported from. An export "
                                    "writes it back.")] = ""
    cutting_data: Annotated[list[ToolCuttingData], Field(
        max_length=200, description="Speeds and feeds by material. Those of the material of the setup are used, or "
                                    "else those without a material, where spindle_rpm, feed_mm_min or "
                                    "plunge_feed_mm_min of the tool is null.")] = []
    max_rpm: Annotated[Number | None, Field(
        ge=1, le=1e6, description="Highest spindle speed of the tool, 1/min; null: no limit.")] = None
    max_engagement_deg: Annotated[Number | None, Field(
        ge=30, le=180, description="Largest engaged angle, deg: how much of the front half of the cutter may be in "
                                   "stock. 180 is a slot. Stock no deeper than a twentieth of the cutter radius does "
                                   "not count. At least 30, since the proof resolves the angle to about 11 degrees. "
                                   "null: no limit.")] = None
    life_min: Annotated[Number | None, Field(
        gt=0, le=1e6, description="Tool life, in minutes of cutting. The program stops for a fresh cutter between two "
                                  "passes before this time is used up. null: tool life is not counted.")] = None
    spindle_rpm: Annotated[Number | None, Field(
        ge=1, le=1e6, description="Spindle speed of all workingsteps of the tool, 1/min, at most max_rpm and "
                                  "machine.max_rpm. null: computed from the material.")] = None
    feed_mm_min: Annotated[Number | None, Field(
        ge=0.1, le=1e6, description="Cutting feed of all workingsteps of the tool, mm/min, at most "
                                    "machine.max_feed_mm_min. null: computed from material, flutes and speed.")] = None
    plunge_feed_mm_min: Annotated[Number | None, Field(
        ge=0.1, le=1e6, description="Downward feed into stock, mm/min: the feed of a plunge, and the downward part of "
                                    "the feed on ramps and helices. At most machine.max_feed_mm_min. null: 0.3 of the "
                                    "cutting feed.")] = None
    coolant: Annotated[Literal["flood", "off"] | None, Field(
        description="Whether the tool is to be cooled. Plans turn the coolant on as machine.coolant says, for all "
                    "tools; a tool that states otherwise gets a warning. null: it is not stated.")] = None
    holder: Annotated[list[HolderSegment], Field(
        max_length=50, description="Segments of the holder, upwards from its nose; empty: no holder is checked.")] = []

    @model_validator(mode="after")
    def _check(self) -> Tool:
        self._check_kind()
        self._derive()
        self._check_lengths()
        return self

    def _check_kind(self) -> None:
        radius = self.diameter_mm / 2
        if self.kind not in BUILT_KINDS + VERIFIED_KINDS:
            raise ValueError(f"tool {self.id}: kind '{self.kind}' is not available yet; "
                             f"use one of {', '.join(BUILT_KINDS + VERIFIED_KINDS)}")
        self._check_cone()
        if self.pitch_mm is not None and self.kind not in THREADING_KINDS:
            raise ValueError(f"tool {self.id}: pitch_mm belongs to kinds tap and thread_mill")
        self._check_segment()
        self._check_taper()
        if self.corner_radius_mm > radius + LENGTH_EPSILON:
            raise ValueError(f"tool {self.id}: corner_radius_mm {self.corner_radius_mm:g} is larger than half the "
                             f"diameter, {radius:g}; give at most that")
        if self.kind in VERIFIED_KINDS and self.corner_radius_mm != 0:
            raise ValueError(f"tool {self.id}: a tool of kind {self.kind} has corner_radius_mm 0")
        tapered, end = self.kind.rpartition("_")[::2]
        other = f"{tapered}_" if tapered else ""
        if end == "flat" and self.corner_radius_mm != 0:
            raise ValueError(f"tool {self.id}: a flat end mill has corner_radius_mm 0, not "
                             f"{self.corner_radius_mm:g}; use kind {other}bull")
        if end == "bull" and self.corner_radius_mm == 0:
            raise ValueError(f"tool {self.id}: a bull nose needs a corner_radius_mm above 0; use kind {other}flat")
        if end == "ball":
            if self.corner_radius_mm not in (0, radius) and abs(self.corner_radius_mm - radius) > LENGTH_EPSILON:
                raise ValueError(f"tool {self.id}: the corner_radius_mm of a ball is half its diameter, {radius:g}, "
                                 f"not {self.corner_radius_mm:g}; call it {other}bull")
            self.corner_radius_mm = radius

    def _check_segment(self) -> None:
        """Whether the arcs of a lens or a barrel touch each other and the side."""
        if self.kind not in SEGMENT_KINDS:
            if self.profile_radius_mm is not None:
                raise ValueError(f"tool {self.id}: profile_radius_mm belongs to kinds lens and barrel; leave it at "
                                 f"null for kind {self.kind}")
            return
        radius, large, corner = self.diameter_mm / 2, self.profile_radius_mm, self.corner_radius_mm
        if self.diameter_mm < MIN_SEGMENT_DIAMETER:
            raise ValueError(f"tool {self.id}: diameter_mm {self.diameter_mm:g} of a {self.kind} must be at least "
                             f"{MIN_SEGMENT_DIAMETER:g}; use kind ball or bull")
        if large is None:
            raise ValueError(f"tool {self.id}: a {self.kind} needs profile_radius_mm, the radius of its large arc")
        if corner >= radius:
            raise ValueError(f"tool {self.id}: corner_radius_mm {corner:g} of a {self.kind} must be less than half the "
                             f"diameter, {radius:g}; reduce it, or use kind ball")
        if self.kind == "lens":
            if large <= radius:
                raise ValueError(f"tool {self.id}: profile_radius_mm {large:g} of a lens must be more than half the "
                                 f"diameter, {radius:g}; increase it, or use kind ball or bull")
            return
        if not 0 <= self.taper_angle_deg <= MAX_TAPER:
            raise ValueError(f"tool {self.id}: taper_angle_deg {self.taper_angle_deg:g} of a barrel must be at most "
                             f"{MAX_TAPER:g}; it is the angle between the axis and the upper end of the large arc")
        if corner <= 0:
            raise ValueError(f"tool {self.id}: a barrel needs a corner_radius_mm above 0, the radius at its tip; use "
                             "kind lens for an arc that begins at the axis")
        flat, cosine = 0.5 * (self.tip_diameter_mm or 0.0), math.cos(math.radians(self.taper_angle_deg))
        if radius - flat <= corner * cosine:
            raise ValueError(f"tool {self.id}: the tip of a barrel with tip_diameter_mm {2 * flat:g} and "
                             f"corner_radius_mm {corner:g} is {2 * (flat + corner * cosine):g} wide, which must be "
                             f"less than diameter_mm {self.diameter_mm:g}; reduce them, or increase diameter_mm")
        if large <= max((radius - flat) / cosine, corner):
            raise ValueError(f"tool {self.id}: profile_radius_mm {large:g} of a barrel must be more than "
                             f"{max((radius - flat) / cosine, corner):g}, or its large arc does not touch the tip; "
                             "increase it, or increase tip_diameter_mm")

    def _check_taper(self) -> None:
        if self.kind == "barrel":
            return
        if self.kind in TAPERED_KINDS:
            if not 0 < self.taper_angle_deg <= MAX_TAPER:
                raise ValueError(f"tool {self.id}: taper_angle_deg {self.taper_angle_deg:g} of a tapered mill must be "
                                 f"above 0 and at most {MAX_TAPER:g}; it is the angle between side and axis. Use kind "
                                 f"{self.kind.removeprefix('tapered_')} for 0, kind chamfer for more")
        elif self.taper_angle_deg != 0:
            own = f"tapered_{self.kind}"
            raise ValueError(f"tool {self.id}: taper_angle_deg {self.taper_angle_deg:g} belongs to kinds "
                             f"{', '.join((*TAPERED_KINDS, 'barrel'))}, and is 0 for kind {self.kind}; "
                             f"{f'use kind {own}, or ' if own in TAPERED_KINDS else ''}leave it out")

    def _check_cone(self) -> None:
        if self.point_angle_deg is None:
            self.point_angle_deg = POINT_ANGLES.get(self.kind)
        if self.point_angle_deg is None:
            if self.tip_diameter_mm is not None and self.kind != "barrel":
                raise ValueError(f"tool {self.id}: tip_diameter_mm belongs to a barrel, or to a cone, which needs "
                                 "point_angle_deg")
            return
        if self.kind not in ("drill", "tap", "chamfer"):
            raise ValueError(f"tool {self.id}: point_angle_deg belongs to kinds drill, tap and chamfer")
        if self.kind == "tap" and self.tip_diameter_mm is None:
            raise ValueError(f"tool {self.id}: the lead of a tap needs tip_diameter_mm, its diameter at the tip")
        if self.kind == "drill" and self.tip_diameter_mm:
            raise ValueError(f"tool {self.id}: a drill has a point, so tip_diameter_mm is 0; use kind chamfer")
        if self.kind == "chamfer" and self.point_angle_deg > 175:
            raise ValueError(f"tool {self.id}: a chamfer mill of {self.point_angle_deg:g} deg has no cone; "
                             "use kind flat")
        if self.tip_diameter_mm is None:
            self.tip_diameter_mm = 0.0
        if self.tip_diameter_mm >= self.diameter_mm:
            raise ValueError(f"tool {self.id}: tip_diameter_mm {self.tip_diameter_mm:g} is not below diameter_mm "
                             f"{self.diameter_mm:g}, so there is no cone")

    @property
    def end(self) -> str:
        """Shape of the end, which tables by kind use: the kind without 'tapered_'."""
        return self.kind.removeprefix("tapered_")

    @property
    def cone_height(self) -> float:
        """Height of the cone over the tip, mm; 0 for an end without a cone."""
        if self.point_angle_deg is None or self.point_angle_deg >= 180.0:
            return 0.0
        wide = 0.5 * (self.diameter_mm - (self.tip_diameter_mm or 0.0))
        return wide / math.tan(math.radians(0.5 * self.point_angle_deg))

    @property
    def arcs(self) -> ArcPair | None:
        """The two arcs of a lens or a barrel; None for other kinds."""
        radius, large = 0.5 * self.diameter_mm, self.profile_radius_mm or 0.0
        if self.kind == "lens":
            return ArcPair.lens(radius, large, self.corner_radius_mm)
        if self.kind == "barrel":
            return ArcPair.barrel(radius, large, self.corner_radius_mm, math.tan(math.radians(self.taper_angle_deg)),
                                  0.5 * (self.tip_diameter_mm or 0.0))
        return None

    @property
    def end_height(self) -> float:
        """Height over the tip at which a cone, or the arcs of a lens or barrel, end, mm; 0 without them."""
        return self.cone_height if self.arcs is None else self.arcs.high

    @property
    def corner_height(self) -> float:
        """Height over the tip at which a round corner ends and the side begins, mm; 0 without one."""
        return self.corner_radius_mm * (1.0 - math.sin(math.radians(self.taper_angle_deg)))

    def side_mm(self, height: float) -> float:
        """Diameter of the side at a height over the tip, mm, from the end of the corner on."""
        if self.arcs is not None:
            return self.diameter_mm
        half = math.radians(self.taper_angle_deg)
        side = max(height - self.corner_height, 0.0) * math.tan(half)
        return self.diameter_mm + 2.0 * (side - self.corner_radius_mm * (1.0 - math.cos(half)))

    @property
    def widest_mm(self) -> float:
        """Largest diameter of the cutting part, mm: of a tapered mill at the end of the flutes."""
        return self.side_mm(_given(self.flute_length_mm))

    def _derive(self) -> None:
        self._flutes_given = self.flute_length_mm is not None
        if self.flute_length_mm is None:
            bounds = [v for v in (self.neck_length_mm, self.stickout_mm) if v is not None]
            usual = self.cone_height if self.kind == "chamfer" else max(3 * self.diameter_mm, self.end_height)
            self.flute_length_mm = min([usual, *bounds])
        if self.neck_length_mm is None:
            if self.neck_diameter_mm is not None and self.neck_diameter_mm < self.widest_mm:
                raise ValueError(f"tool {self.id}: neck_diameter_mm is given without neck_length_mm (tip to shank)")
            self.neck_length_mm = self.flute_length_mm
        if self.neck_diameter_mm is None:
            self.neck_diameter_mm = self.widest_mm
        if self.shank_diameter_mm is None:
            self.shank_diameter_mm = self.widest_mm
        if self.stickout_mm is None:
            if self.holder:
                raise ValueError(f"tool {self.id}: a tool with a holder needs stickout_mm (tip to holder nose)")
            self.stickout_mm = max(self.neck_length_mm, 10 * self.diameter_mm)
        self._gauge_given = self.gauge_length_mm is not None
        if self.gauge_length_mm is None:
            self.gauge_length_mm = self.stickout_mm + sum(s.length_mm for s in self.holder)

    @field_serializer("gauge_length_mm")
    def _stated_gauge(self, value: float | None) -> float | None:
        """The gauge length as it was stated; None where it was computed, so that a setup reads back as it was given."""
        return value if self._gauge_given else None

    @field_serializer("flute_length_mm")
    def _stated_flutes(self, value: float | None) -> float | None:
        """The length of the flutes; None for a drill that does not state it, as a proof tells the two apart."""
        return value if self._flutes_given or self.kind != "drill" else None

    @property
    def core_mm(self) -> float:
        """Diameter at the end within which the tool does not cut, mm; 0 where it cuts to its centre."""
        if self.center_cutting:
            return 0.0
        return CORE_SHARE * self.diameter_mm if self.core_diameter_mm is None else self.core_diameter_mm

    @property
    def flutes_given(self) -> bool:
        """Whether the setup gives the length of the flutes; otherwise it is the default."""
        return self._flutes_given

    @property
    def gauge_given(self) -> bool:
        """Whether the setup gives the gauge length; otherwise it is the default."""
        return self._gauge_given

    def in_material(self, name: str) -> Tool:
        """The tool with its speeds and feeds in a material, where it does not state them for all materials.

        name : of the material of the setup

        >>> tool = Tool(id="T1", kind="flat", diameter_mm=6,
        ...             cutting_data=[{"material": "ti6al4v", "spindle_rpm": 3000}])
        >>> tool.in_material("Ti-6Al-4V").spindle_rpm, tool.in_material("C45").spindle_rpm
        (3000.0, None)
        """
        own = [d for d in self.cutting_data if d.material is not None and same_material(d.material, name)]
        usual = [d for d in self.cutting_data if d.material is None]
        for data in (own or usual)[:1]:
            stated = {f: getattr(data, f) for f in CUTTING_FIELDS if getattr(self, f) is None}
            return self.model_copy(update=stated)
        return self

    def _check_lengths(self) -> None:
        chain = [(n, _given(getattr(self, n)))
                 for n in ("flute_length_mm", "neck_length_mm", "stickout_mm", "gauge_length_mm")]
        for (low, a), (high, b) in pairwise(chain):
            if a > b + LENGTH_EPSILON:
                raise ValueError(f"tool {self.id}: {low} {a:g} is longer than {high} {b:g}; from the tip upwards it "
                                 "must hold that flute_length_mm <= neck_length_mm <= stickout_mm <= gauge_length_mm")
        if self.widest_mm > MAX_LENGTH:
            raise ValueError(f"tool {self.id}: its cone is {self.widest_mm:g} wide at the end of the flutes, more than "
                             f"{MAX_LENGTH:g}; reduce taper_angle_deg or flute_length_mm")
        if _given(self.neck_diameter_mm) > self.widest_mm + LENGTH_EPSILON:
            widest = "diameter_mm" if self.kind not in TAPERED_KINDS else "the end of the cone,"
            raise ValueError(f"tool {self.id}: neck_diameter_mm {self.neck_diameter_mm:g} is larger than {widest} "
                             f"{self.widest_mm:g}; a neck is relieved, so give at most that")
        if self.core_diameter_mm is not None and self.kind == "tap":
            if self.core_diameter_mm > self.diameter_mm:
                raise ValueError(f"tool {self.id}: core_diameter_mm {self.core_diameter_mm:g} of a tap is at most its "
                                 f"diameter_mm {self.diameter_mm:g}")
        elif self.core_diameter_mm is not None and (self.center_cutting or self.core_diameter_mm >= self.diameter_mm):
            raise ValueError(f"tool {self.id}: core_diameter_mm belongs to a tap, or to a tool with center_cutting "
                             f"false, and is less than diameter_mm {self.diameter_mm:g}")
        tapered = self.kind in TAPERED_KINDS
        if tapered and _given(self.flute_length_mm) < 2.0 * self.corner_radius_mm - LENGTH_EPSILON:
            raise ValueError(f"tool {self.id}: flute_length_mm {self.flute_length_mm:g} is less than twice the corner "
                             f"radius, {2.0 * self.corner_radius_mm:g}, so there is next to no cone; give at least "
                             "that, or use a kind without taper")
        if not tapered and _given(self.flute_length_mm) < self.corner_radius_mm - LENGTH_EPSILON:
            raise ValueError(f"tool {self.id}: flute_length_mm {self.flute_length_mm:g} is shorter than the corner "
                             f"radius {self.corner_radius_mm:g}, so the rounded end would not cut")
        if self.arcs is not None and _given(self.flute_length_mm) < self.end_height - LENGTH_EPSILON:
            raise ValueError(f"tool {self.id}: flute_length_mm {self.flute_length_mm:g} is shorter than the arcs of "
                             f"the {self.kind}, which end {self.end_height:.4g} over the tip; give at least that, or "
                             "reduce profile_radius_mm")
        if self.arcs is None and _given(self.flute_length_mm) < self.cone_height - LENGTH_EPSILON:
            raise ValueError(f"tool {self.id}: flute_length_mm {self.flute_length_mm:g} is shorter than the cone at "
                             f"its end, {self.cone_height:g} high; flute_length_mm counts from the tip of the cone")


def _given(value: float | None) -> float:
    """A length that ``_derive`` has filled in."""
    assert value is not None
    return value


def default_numbers(tools: list[Tool]) -> dict[str, int]:
    """Tool numbers by id: as given, else the digits of the id where they are unique, else the position in the list.

    Raises
    ------
    ValueError
        Two tools have the same number or the same id.
    """
    ids = [t.id for t in tools]
    if doubled := sorted(i for i, count in Counter(ids).items() if count > 1):
        raise ValueError(f"tool ids must be unique; {', '.join(doubled)} occurs more than once")
    digits = ["".join(c for c in t.id if c.isdigit()) for t in tools]
    often = Counter(digits)
    numbers: dict[str, int] = {}
    for place, (tool, own) in enumerate(zip(tools, digits, strict=True), start=1):
        usable = own != "" and often[own] == 1 and 1 <= int(own) <= 99999
        numbers[tool.id] = tool.number if tool.number is not None else int(own) if usable else place
    taken: dict[int, str] = {}
    for tool_id, number in numbers.items():
        if number in taken:
            raise ValueError(f"tools {taken[number]} and {tool_id} both have number {number}; give each tool its own "
                             "number")
        taken[number] = tool_id
    return numbers


def numbered(tools: list[Tool]) -> list[Tool]:
    """The tools with ``number`` filled in; see ``default_numbers``."""
    numbers = default_numbers(tools)
    return [t.model_copy(update={"number": numbers[t.id]}) for t in tools]


__all__: list[Any] = ["BUILT_KINDS", "CUTTING_FIELDS", "TAPERED_KINDS", "SEGMENT_KINDS", "VERIFIED_KINDS",
                      "HolderSegment", "Tool",
                      "ToolCuttingData", "ToolKind", "default_numbers", "numbered"]
