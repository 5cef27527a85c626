"""What a proof is asked and what it answers: plain values, mm, rad, s, setup frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

from geometry.mesh import F64, I32, TriangleMesh
from geometry.sampling import SurfaceSamples
from verify.kinematics import Kinematics


class StockKind(StrEnum):
    """Shape of the blank."""

    PART_OFFSET = "part_offset"
    BOX = "box"
    CYLINDER = "cylinder"
    STEP = "step"


class FindingKind(StrEnum):
    """What a proof can find, gravest first."""

    COLLISION = "collision"
    GOUGE = "gouge"
    RAPID = "rapid"
    PLUNGE = "plunge"
    RUBBING = "rubbing"
    ENGAGEMENT = "engagement"
    SUPPORT = "support"
    LIMIT = "limit"
    PROGRAM = "program"
    RESIDUAL = "residual"


@dataclass(frozen=True, eq=False)
class ProofSetup:
    """Stock, surroundings and tolerances of a proof.

    stock_kind, margin, uncertainty : the part grown by margin + uncertainty, or a box or cylinder (axis Z)
                    round it by as much (not below the part), or a mesh grown by the uncertainty alone
    stock_box     : (2, 3) float64 corners of a box blank, or None
    stock_cylinder, stock_axis : (x, y, z, radius, height) of a cylinder blank, or None, (x, y, z) the middle of its
                    lower end; unit vector from there to the other end, not downwards
    stock_mesh    : TriangleMesh, closed, normals outwards, mm, of a blank of kind step, or None
    fixtures      : boxes as (2, 3) float64 corners; each stands down to the table
    clearance_*   : radial; the part, its stock and fixtures nearer than this are rubbing, in a rapid a finding
    scallop_height, gouge_tolerance, stock_allowance : the budget -gouge <= residual - allowance <= scallop
    ramp_angle    : rad, steepest descent into stock
    plunge_skin   : share of the tool diameter that a steeper descent may take off (see ``verify.material.stock_lines``)
    rapid_feed    : mm/min
    acceleration  : mm/s², for times
    travel        : (3,) float64 mm, what the moves of a program may span in X, Y and Z, or None
    gauge_length  : mm by T number, from the spindle face to the tip; counted in Z against the travel
    dogleg        : whether a rapid moves each axis at its own speed, so that its way is not a straight line
    max_feed      : mm/min of any feed move, or None
    max_rpm       : 1/min by T number; a tool left out is not limited
    max_engaged   : rad by T number, most of the front half of a cutter that may be in stock; left out: not limited
    work_offset   : the only one whose coordinates are those of the setup frame
    line_spacing  : mm between the vertical lines of the stock model
    kinematics    : rotary axes of the machine, or None on one of three axes
    rotary_limits : (2, 2) float64, rad, least and greatest angle of the tilting and the turning axis, or None
    rotary_rate   : rad/min, the fastest either turns in a feed move, or None
    table         : mm, Z of what the part stands on, or None; table_known : somebody said so, else it is held against
                    tools that lean only
    free_ratio    : how many times as high as thick a wall may be free where it is finished (``verify.surface.wall_support``)
    walls_in_turn : whether more than that is a finding; else it is a figure alone
    """

    stock_kind: StockKind | str = StockKind.PART_OFFSET
    margin: float = 1.0
    uncertainty: float = 0.5
    stock_box: F64 | None = None
    stock_cylinder: tuple[float, float, float, float, float] | None = None
    stock_axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    stock_mesh: TriangleMesh | None = None
    fixtures: tuple[F64, ...] = ()
    clearance_neck: float = 0.05
    clearance_shank: float = 0.2
    clearance_holder: float = 1.0
    clearance_rapid: float = 1.0
    scallop_height: float = 0.01
    gouge_tolerance: float = 0.01
    stock_allowance: float = 0.0
    ramp_angle: float = 0.0523598775598
    plunge_skin: float = 0.1
    rapid_feed: float = 5000.0
    acceleration: float = 1000.0
    travel: F64 | None = None
    gauge_length: Mapping[int, float] = field(default_factory=dict)
    dogleg: bool = False
    work_offset: str = "G54"
    max_feed: float | None = None
    max_rpm: Mapping[int, float] = field(default_factory=dict)
    max_engaged: Mapping[int, float] = field(default_factory=dict)
    line_spacing: float = 0.15
    kinematics: Kinematics | None = None
    rotary_limits: F64 | None = None
    rotary_rate: float | None = None
    table: float | None = None
    table_known: bool = False
    free_ratio: float = 10.0
    walls_in_turn: bool = True


@dataclass(frozen=True, eq=False)
class NcProgram:
    """One program of a proof.

    name, text  : of the program
    turn        : (3, 3) float64, from the frame of the proof to that of the program (another side up); None: the same
    work_offset : the one that is the zero of its frame; None: that of the setup
    dialect     : whose words its text has (``verify.gcode.dialects``)
    """

    name: str
    text: str
    turn: F64 | None = None
    work_offset: str | None = None
    dialect: str = "linuxcnc"


@dataclass(frozen=True, eq=False)
class ScoredSamples:
    """The samples that coverage is counted on.

    samples : SurfaceSamples
    zone    : (n,) int32, 0 where no zone claims the sample, else k for the k-th entry (1-based) of the zone ids
    """

    samples: SurfaceSamples
    zone: I32


@dataclass(frozen=True)
class Finding:
    """One thing found, with everything near it of the same kind folded in.

    line  : 1-based line of the program, 0 where no line is to blame (material that stayed)
    zone, face : ids, or None
    point : mm, where it is worst
    depth : mm, how bad; limit : what would have been allowed
    near  : nothing touches, and the depth is how near it comes
    count : places folded in; area : mm² of samples folded in, 0 where none
    tip   : mm, where the tip of the tool was, or None where no move is to blame or it is at the point itself
    """

    kind: FindingKind
    program: str
    line: int
    zone: str | None
    face: str | None
    point: tuple[float, float, float] | None
    depth: float
    limit: float
    message: str
    count: int = 1
    area: float = 0.0
    near: bool = False
    tip: tuple[float, float, float] | None = None

    def as_dict(self) -> dict[str, Any]:
        return {**asdict(self), "kind": str(self.kind), "point": list(self.point) if self.point else None,
                "tip": list(self.tip) if self.tip else None}


@dataclass(frozen=True)
class Engagement:
    """How much of the front half of a cutter is in stock, rad: at most, and on 99 % of its way in stock at most."""

    most: float
    p99: float


@dataclass(frozen=True)
class Spent:
    """Where the time of programs goes: s in all, s of moves that take stock, s of rapids.

    retracts : times a rapid follows on a feed move; tool_changes : within programs
    """

    seconds: float
    in_cut: float
    rapid: float
    retracts: int
    tool_changes: int


@dataclass(frozen=True)
class Support:
    """How far thin walls were free where they were finished.

    walls  : sheets of the part that are somewhere more than ``limit`` times as high as thick
    places : pairs of opposite places of them that were judged
    most   : the most a wall was free for at one, in times its thickness; limit : what is allowed
    over   : places at which it was more; found : and that is a finding
    at     : mm, the place where it was most; None where there is none
    """

    walls: int
    places: int
    most: float
    limit: float
    over: int
    found: bool = False
    at: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class ZoneProof:
    """The proof of one zone: scallops of its claimed samples in mm, areas in mm², coverage 0..1."""

    scallop_p50: float
    scallop_p99: float
    scallop_max: float
    gouge: float
    claimed_area: float
    proved_area: float
    coverage: float


@dataclass(frozen=True)
class FaceProof:
    """The proof of the scored samples of one face.

    number : of the face (``F12`` is 12); area : mm² of its samples
    left_p50, left_p99, left_max : mm of stock over the allowance, cut deeper counts 0; not above ``Proof.reach``
    gouge  : mm, deepest cut into the part at a sample
    uncut  : mm² that no feed move ever reached and that stand higher than the budget allows
    proved_area : mm² within the budget; coverage : its share, 0..1
    """

    number: int
    area: float
    left_p50: float
    left_p99: float
    left_max: float
    gouge: float
    uncut: float
    proved_area: float
    coverage: float


@dataclass(frozen=True, eq=False)
class Proof:
    """The answer.

    findings : gravest first, at most 200, the 20 gravest of each kind among them; counts : all there are of each kind
    residual : (n,) float64, mm left on the normal of each scored sample, negative = gouged; not above ``reach``
    line     : (n,) int32 of the move that left it, 0 where none; program : (n,) int32 its program, -1 where none
    proved   : (n,) bool, inside the budget
    zones    : by zone id; faces : by face number, of every face with scored samples
    spent    : where the time goes, feeds, rapids and dwells; cutting_length : mm of feed moves that took stock
    minutes  : minutes in cut by tool number; engaged : how much of each cutter was in stock, by tool number
    error_bound : mm, largest error of a residual against the mesh the samples lie on
    support  : how far thin walls were free where they were cut
    """

    findings: tuple[Finding, ...]
    counts: Mapping[str, int]
    residual: F64
    line: I32
    program: I32
    proved: Any
    zones: Mapping[str, ZoneProof]
    faces: Mapping[int, FaceProof]
    gouge_max: float
    spent: Spent
    cutting_length: float
    minutes: Mapping[int, float]
    engaged: Mapping[int, Engagement]
    error_bound: float
    reach: float
    line_spacing: float
    notes: tuple[str, ...] = field(default=())
    support: Support = Support(0, 0, 0.0, 0.0, 0)

    @property
    def clean(self) -> bool:
        """Whether nothing was found."""
        return not self.counts

    def as_dict(self) -> dict[str, Any]:
        """Plain data for a report; lengths in mm, time in s and minutes."""
        return {
            "findings": [f.as_dict() for f in self.findings], "finding_counts": dict(self.counts),
            "zones": {k: asdict(v) for k, v in self.zones.items()},
            "faces": {f"F{k}": asdict(v) for k, v in self.faces.items()}, "gouge_max_mm": self.gouge_max,
            "machining_time_s": self.spent.seconds, "spent": asdict(self.spent),
            "cutting_length_mm": self.cutting_length,
            "tools": {str(k): v for k, v in self.minutes.items()},
            "engaged_rad": {str(k): asdict(v) for k, v in self.engaged.items()}, "error_bound_mm": self.error_bound,
            "reach_mm": self.reach, "line_spacing_mm": self.line_spacing, "notes": list(self.notes),
            "support": asdict(self.support),
        }
