"""Inputs and results of a proof as plain values, in mm, rad and s, in the setup frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from geometry.machine_rates import RATES
from geometry.mesh import F64, I32, TriangleMesh
from geometry.part import OtherSolid
from geometry.tool_body import ToolBody
from verify.assumptions import Assumed
from verify.cutting_words import CuttingWords, ProgramCaution
from verify.kinematics import Kinematics

if TYPE_CHECKING:  # sampling is compiled, and the readers of programs need these classes without it
    from geometry.sampling import SurfaceSamples
    from verify.program.program import Program


class StockKind(StrEnum):
    """Shape of the blank."""

    PART_OFFSET = "part_offset"
    BOX = "box"
    CYLINDER = "cylinder"
    STEP = "step"


class FindingKind(StrEnum):
    """Kinds of finding, the gravest first."""

    COLLISION = "collision"
    GOUGE = "gouge"
    ALLOWANCE = "allowance"
    EXCLUDED_FACE = "excluded_face"
    RAPID = "rapid"
    PLUNGE = "plunge"
    LOAD = "load"
    RUBBING = "rubbing"
    ENGAGEMENT = "engagement"
    SUPPORT = "support"
    LIMIT = "limit"
    PROGRAM = "program"
    RESIDUAL = "residual"
    STOCK_LEFT = "stock_left"
    NOTHING_CUT = "nothing_cut"


HARMLESS = frozenset({FindingKind.STOCK_LEFT, FindingKind.NOTHING_CUT})
"""Kinds that say what a program has not done. All others say what harm it does."""


@dataclass(frozen=True, eq=False)
class ProofSetup:
    """Stock, surroundings and tolerances of a proof.

    stock_kind, margin, uncertainty : shape of the blank. part_offset: the part grown by margin + uncertainty. box,
                    cylinder (axis Z): round the part by as much, not below it. step: a mesh grown by the uncertainty.
    stock_box     : (2, 3) float64, mm, corners of a box blank, or None
    stock_cylinder, stock_axis : (x, y, z, radius, height) of a cylinder blank in mm, or None, (x, y, z) the middle of
                    its lower end; unit vector from there to the other end, not downwards
    stock_mesh    : TriangleMesh, closed, normals outwards, mm, of a blank of kind step, or None
    fixtures      : boxes as (2, 3) float64 corners, mm; each stands down to the table
    others        : other solids of the part's file, which the proof takes for absent; boxes in its frame
    clearance_*   : mm, radial. A body nearer than this to part, stock or fixture rubs; in a rapid it is a finding.
    clearance_rapid : mm, in every direction, also to what is below the tool
    clearance_approach : mm, to what is below the tool in a rapid straight down before a cut; not over clearance_rapid
    scallop_height, gouge_tolerance, stock_allowance : mm, the budget -gouge <= residual - allowance <= scallop
    ramp_angle    : rad, steepest descent into stock
    ramp_angles   : rad by T number, for tools that have another one
    cores         : mm by T number, diameter at the end of a tool within which it does not cut; absent: it cuts there
    tap_holes     : mm by T number, diameter of the hole that must stand before a tap; absent: as the pitch tells
    plunge_skin   : share of the tool diameter that a steeper descent may take off (``verify.material.stock_lines``)
    rapid_feed    : mm/min
    acceleration  : mm/s², and jerk, mm/s³, for times
    travel        : (3,) float64, mm, span of the moves of a program that the machine allows in X, Y and Z, or None
    gauge_length  : mm by T number, from the spindle face to the tip; counted in Z against the travel
    gauge_given   : T numbers of the tools whose gauge length the setup states
    change_position : mm, setup frame, Z or X, Y and Z of the spindle face at a tool change, or None
    nose_diameter : mm, of the spindle nose, or None
    dogleg        : whether a rapid moves each axis at its own speed, so that its path is not a straight line; None: by
                    the dialect of the programs
    max_feed      : mm/min of any feed move, or None
    max_rpm       : 1/min by T number; a tool that is absent has no limit
    max_engaged   : rad by T number, largest engaged angle of the front half of a cutter; absent: no limit
    work_offset   : the only one whose coordinates are those of the setup frame
    line_spacing  : mm between the vertical lines of the stock model
    kinematics    : rotary axes of the machine, or None for a machine of three axes
    rotary_limits : (2, 2) float64, rad, smallest and largest angle of the tilting and the turning axis, or None
    rotary_rate   : rad/min, the fastest that either axis turns in a feed move, or None
    table         : mm, Z of the machine table, or None
    table_known   : False: the table height is assumed and checked for tilted tools only
    free_ratio    : largest ratio of free height to thickness where a wall is finished (``verify.surface.wall_support``)
    walls_in_turn : whether a larger ratio is a finding; otherwise the proof reports the figure only
    left_alone    : by number of each face that is not to be machined, the words of the setup that say so
    assumed       : what the setup leaves open and the proof takes for granted
    cutting       : cutting data by T number; a tool that is absent has none, and its loads are not judged
    """

    stock_kind: StockKind | str = StockKind.PART_OFFSET
    margin: float = 1.0
    uncertainty: float = 0.5
    stock_box: F64 | None = None
    stock_cylinder: tuple[float, float, float, float, float] | None = None
    stock_axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    stock_mesh: TriangleMesh | None = None
    fixtures: tuple[F64, ...] = ()
    others: tuple[OtherSolid, ...] = ()
    clearance_neck: float = 0.05
    clearance_shank: float = 0.2
    clearance_holder: float = 1.0
    clearance_rapid: float = 1.0
    clearance_approach: float = 0.0
    scallop_height: float = 0.01
    gouge_tolerance: float = 0.01
    stock_allowance: float = 0.0
    ramp_angle: float = 0.0523598775598
    ramp_angles: Mapping[int, float] = field(default_factory=dict)
    cores: Mapping[int, float] = field(default_factory=dict)
    tap_holes: Mapping[int, float] = field(default_factory=dict)
    plunge_skin: float = 0.1
    rapid_feed: float = 5000.0
    acceleration: float = RATES.acceleration
    jerk: float = RATES.jerk
    travel: F64 | None = None
    gauge_length: Mapping[int, float] = field(default_factory=dict)
    gauge_given: frozenset[int] = frozenset()
    change_position: tuple[float, ...] | None = None
    nose_diameter: float | None = None
    dogleg: bool | None = None
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
    left_alone: Mapping[int, str] = field(default_factory=dict)
    assumed: tuple[Assumed, ...] = ()
    cutting: Mapping[int, CuttingWords] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class NcProgram:
    """One program of a proof.

    name, text  : name and text of the program
    turn        : (3, 3) float64, rotation from the frame of the proof to that of the program; None: the same frame
    work_offset : work offset that is the zero of its frame; None: that of the setup
    dialect     : dialect of its text, one of ``verify.gcode.dialects.DIALECTS``
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
    zone    : (n,) int32, index, 0 where no zone claims the sample, else k for the k-th entry (1-based) of the zone ids
    """

    samples: SurfaceSamples
    zone: I32


class Touch(Protocol):
    """What tools can touch without entering part or fixtures. The proof knows no such limits and is given them."""

    def reaches(self, samples: SurfaceSamples, tools: Sequence[ToolBody], axes: F64, lift: float,
                room: float) -> NDArray[np.bool_]:
        """Samples that some tool touches along some axis and can finish there.

        samples : SurfaceSamples, frame of the proof
        axes    : (k, 3) float64, unit, tip to spindle, frame of the proof
        lift    : mm, distance from the sample along its normal within which a touch counts, over the allowance
        room    : mm, distance that the whole tool keeps from part and fixtures, over allowance and clearances

        Returns (n,) bool.
        """
        ...

    def edges(self, samples: SurfaceSamples, tools: Sequence[ToolBody], axes: F64, lift: float) -> NDArray[np.bool_]:
        """Samples that the sharp edge of a flat end touches along some axis: it finishes them in steps alone.

        samples : SurfaceSamples, frame of the proof
        axes    : (k, 3) float64, unit, tip to spindle, frame of the proof
        lift    : mm, distance from the sample along its normal within which a touch counts, over the allowance

        Returns (n,) bool.
        """
        ...

    def on_ways(self, samples: SurfaceSamples, tools: Sequence[ToolBody], axes: F64, lift: float,
                stepped: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Samples that a mill touches where its own feed moves take it, as low as part and fixtures let it go.

        samples : SurfaceSamples, frame of the proof
        axes    : (k, 3) float64, unit, tip to spindle, frame of the proof
        lift    : mm, distance from the sample within which a touch counts, over the allowance
        stepped : (n,) bool, whether the sharp edge of a flat end counts on a slope, which it finishes in steps alone

        Returns (n,) bool.
        """
        ...

    def reasons(self, samples: SurfaceSamples, tools: Sequence[ToolBody], axes: F64) -> NDArray[np.object_]:
        """Why no tool touches samples: words of the remainder.

        samples : SurfaceSamples, frame of the proof
        axes    : (k, 3) float64, unit, tip to spindle, frame of the proof

        Returns (n,) object array of str.
        """
        ...


@dataclass(frozen=True, eq=False)
class Asked:
    """The work that a program has to do.

    faces : numbers of the faces that must be within tolerance; None: the faces that the program works on
    touch : Touch, what the tools of the program can touch
    facet : mm, largest distance of the facets of the part from its exact surface
    whole : the only program of the proof, read on through an end before its last lines; None where nothing follows
    hidden : numbers of faces that no axis sees; those that the program works on get samples and are judged
    sample : samples of mesh triangles, (k,) int64, index, frame of the proof; None where no face is hidden
    """

    faces: frozenset[int] | None
    touch: Touch
    facet: float = 0.0
    whole: Program | None = None
    hidden: frozenset[int] = frozenset()
    sample: Callable[[NDArray[np.int64]], SurfaceSamples] | None = None


@dataclass(frozen=True, eq=False)
class WorkDone:
    """What became of the work that a program has to do.

    samples : SurfaceSamples, n of them, that the proof has measured: those that were given, with close ones in each
              place of a coarse one that is not settled whole
    faces   : numbers of the faces that must be within tolerance, ascending
    reason  : (n,) object array of str, why a sample stays that is neither within tolerance nor a finding; '' elsewhere
    """

    samples: SurfaceSamples
    faces: tuple[int, ...]
    reason: NDArray[np.object_]


@dataclass(frozen=True)
class Finding:
    """One finding; neighbours of the same kind are merged into it.

    line  : 1-based line of the program, 0 where no line causes it (material that stayed)
    zone, face : ids, or None
    point : mm, the worst place
    depth : mm, measured value; limit : allowed value
    near  : True where nothing touches; the depth is then the distance
    count : number of places merged; area : mm² of the samples merged, 0 where there are none
    tip   : mm, tip of the tool at that place, or None where no move causes it or the tip is the point itself
    lines : lines of the program that left the stock, of a finding ``stock_left`` only
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
    lines: tuple[int, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        out = {**asdict(self), "kind": str(self.kind), "point": list(self.point) if self.point else None,
               "tip": list(self.tip) if self.tip else None, "lines": list(self.lines)}
        if self.kind is FindingKind.STOCK_LEFT:
            return {**out, "height": self.depth}
        del out["lines"]
        return out


@dataclass(frozen=True)
class Engagement:
    """Engaged angle of the front half of a cutter, rad: the largest, and the 99th percentile over its path in stock."""

    most: float
    p99: float


@dataclass(frozen=True)
class Spent:
    """Time of the programs: s in all, s of moves that remove stock, s of rapids.

    retracts : number of rapids that follow a feed move; tool_changes : number within programs
    """

    seconds: float
    in_cut: float
    rapid: float
    retracts: int
    tool_changes: int


@dataclass(frozen=True)
class Support:
    """Free height of thin walls where they were finished.

    walls  : number of walls whose height is somewhere more than ``limit`` times their thickness
    places : number of pairs of opposite places that were judged
    most   : largest free height at one of them, as a multiple of the thickness; limit : allowed multiple
    over   : number of places above the limit; found : whether they are a finding
    at     : mm, the place of ``most``; None where there is none
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
    """The proof of one zone: scallops of the samples it claims in mm, areas in mm², coverage 0..1."""

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

    number : face number (``F12`` is 12); area : mm² of its samples
    left_p50, left_p99, left_max : mm of rest material over the allowance, 0 where cut deeper; not above ``Proof.reach``
    gouge  : mm, deepest cut into the part at a sample
    uncut  : mm² that no feed move reaches and where more stands than the budget allows
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
    """The result of a proof.

    findings : the gravest first, at most 200, the 16 gravest of each kind among them; counts : all of each kind
    residual : (n,) float64, mm left on the normal of each scored sample, negative = gouged; not above ``reach``
    line     : (n,) int32, index, line of the move that left it, 0 where none
    program  : (n,) int32, index, its program, -1 where none
    proved   : (n,) bool, inside the budget
    zones    : by zone id; faces : by face number, of every face with scored samples
    spent    : time of feeds, rapids and dwells; cutting_length : mm of feed moves that removed stock
    minutes  : minutes in cut by T number; engaged : engaged angles by T number
    error_bound : mm, largest error of a residual against the mesh the samples lie on
    support  : free height of thin walls where they were cut
    work     : what became of the work that was asked; None where none was
    assumed  : what was taken for granted, of the setup and of the programs
    cautions : where the programs exceed what tools and material recommend
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
    work: WorkDone | None = None
    assumed: tuple[Assumed, ...] = ()
    cautions: tuple[ProgramCaution, ...] = ()

    @property
    def no_findings(self) -> bool:
        """Whether the proof has no finding."""
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
            "assumed": [a.as_dict() for a in self.assumed],
            "support": asdict(self.support),
        }
