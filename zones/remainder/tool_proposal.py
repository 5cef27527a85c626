"""The smallest change of the tool set that empties the remainder, as one list of tools.

For every cutter of a fixed grid and every cutter at hand, two things are computed: the samples that its cutting part
alone touches, and the lengths of neck and stickout it needs there. This gives candidates of catalogue lengths, each
with the samples it takes. The list is a minimum set cover, solved exactly. Theory: docs/theory/tools.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_matrix, hstack, identity

from geometry.errors import InternalError
from geometry.mesh import F64
from geometry.sampling import SurfaceSamples
from geometry.tool_body import HolderFrustum, ToolBody
from zones.remainder.obstructions import covered, in_sight
from zones.remainder.reasons import ProposalVerdict, Reason
from zones.remainder.tool_catalogue import BULL_CORNER, DIAMETERS, MAX_SLENDERNESS, nearest
from zones.remainder.tool_requirements import CuttingPart, ToolRequirement
from zones.zoning.zones import LEAST_ZONE_MM2

MAX_SAMPLES = 2000
SEED = 11
LEVELS = 8  # neck lengths to try for one cutter
# weights that decide ties, in tools: total slenderness, then a cutter that is not at hand, then thickness
PER_SLENDER, PER_NEW, PER_STOUT = 1e-2, 1e-3, 1e-4


@dataclass(frozen=True)
class ToolToAdd:
    """A tool to add, lengths mm from the tip.

    instead_of : id of the tool at hand with the same cutter and a shorter neck or stickout, '' where there is none
    holder_of  : id of the tool at hand whose shank and holder were used
    taper_angle_deg : deg, between side and axis; 0 for an upright side
    """

    kind: str
    diameter_mm: float
    corner_radius_mm: float
    flute_length_mm: float
    neck_diameter_mm: float
    neck_length_mm: float
    shank_diameter_mm: float
    stickout_mm: float
    instead_of: str
    holder_of: str
    taper_angle_deg: float = 0.0

    def body(self, id: str, number: int, holder: tuple[HolderFrustum, ...]) -> ToolBody:
        """The tool as a ToolBody in a given holder."""
        return ToolBody(id, number, self.diameter_mm, self.corner_radius_mm, self.flute_length_mm,
                        self.neck_diameter_mm, self.neck_length_mm, self.shank_diameter_mm, self.stickout_mm, holder,
                        taper=math.tan(math.radians(self.taper_angle_deg)))


@dataclass(frozen=True, eq=False)
class ToolProposal:
    """The tools to add, and the verdict on each examined sample.

    tools : stoutest first
    rows  : (n,) int64, index of the samples that were examined
    why   : (n,) object, of each of these: TAKEN, SLENDER or TOO_LITTLE of ``ProposalVerdict``, or a ``Reason``:
            UNDERCUT, PASS (a tool at hand touches it), SHARP_CORNER (no round tool) or FIXTURE (a fixture lies above
            it, or blocks the tools at hand that touch it on the bare part)
    """

    tools: tuple[ToolToAdd, ...]
    rows: NDArray[np.int64]
    why: NDArray[np.object_]


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A tool with the samples it takes; need (k, 2): neck length and stickout that each of them needs, mm."""

    cutter: CuttingPart
    body: ToolBody
    rows: NDArray[np.int64]
    need: F64

    @property
    def slenderness(self) -> float:
        return self.body.neck_length / self.body.diameter


def propose(samples: SurfaceSamples, requirement: ToolRequirement) -> ToolProposal:
    """Fewest tools that take the samples that no tool at hand takes.

    samples     : SurfaceSamples of the remainder, mm, access frame
    requirement : ToolRequirement of the access

    Raises
    ------
    InternalError
        The choice among the tools has no solution.

    Notes
    -----
    Of more than 2000 samples, 2000 are drawn with a fixed seed and represent the rest.
    """
    n = len(samples)
    if not n:
        return ToolProposal((), np.zeros(0, np.int64), np.zeros(0, object))
    rng = np.random.default_rng(SEED)
    rows = np.sort(rng.choice(n, MAX_SAMPLES, replace=False)) if n > MAX_SAMPLES else np.arange(n)
    few = samples.subset(rows)
    area = few.area * (float(samples.area.sum()) / max(float(few.area.sum()), 1e-300))
    why = _known(few, requirement)
    left = np.flatnonzero(why == "")
    candidates, why[left] = _candidates(few.subset(left), requirement)
    tools = []
    for c in sorted(_fewest(candidates, np.where(why[left] == ProposalVerdict.TOOL, area[left], 0.0)),
                    key=lambda c: (-c.body.diameter, c.body.neck_length)):
        mine = why[left[c.rows]] == ProposalVerdict.TOOL
        if mine.any():
            why[left[c.rows[mine]]] = ProposalVerdict.TAKEN
            tools.append(_named(c, c.need[mine]))
    why[why == ProposalVerdict.TOOL] = ProposalVerdict.TOO_LITTLE
    if requirement.clamped:
        rest = np.flatnonzero(np.isin(why, (ProposalVerdict.SLENDER, Reason.SHARP_CORNER)))
        why[rest[requirement.touched_by(few.subset(rest), requirement.unclamped) != ""]] = Reason.FIXTURE
    return ToolProposal(tuple(tools), rows, why)


def _known(few: SurfaceSamples, requirement: ToolRequirement) -> NDArray[np.object_]:
    """Reason of the samples that need no new tool: out of sight or covered, or touched by a tool at hand."""
    view = requirement.view
    why = np.full(len(few), "", dtype=object)
    if requirement.clamped:
        why[covered(few, view.obstacles)] = Reason.FIXTURE
    why[~in_sight(few, view.tree)] = Reason.UNDERCUT
    open_to = np.flatnonzero(why == "")
    why[open_to[requirement.touched_by(few.subset(open_to), view.fields) != ""]] = Reason.PASS
    return why


def _cutters(requirement: ToolRequirement) -> list[CuttingPart]:
    """The cutters to try, stout to thin: those at hand and those of the series.

    A tapered mill is not made longer: its cone would be wider at the end. Nor is a circle segment mill.
    """
    tools = list(requirement.tools.values())
    out = [CuttingPart(t.diameter, t.corner_radius, t.id, True) for t in tools if t.taper == 0.0 and t.arcs is None]
    have = {(c.diameter, c.corner) for c in out}
    for d in DIAMETERS:
        if 0.5 * d <= requirement.cusp:  # the cusp would exceed the radius of such a tool, and no setup allows it
            continue
        like = nearest(tools, d).id
        out += [CuttingPart(d, corner, like, False) for corner in (d / 2, 0.0, round(BULL_CORNER * d, 6))
                if (d, corner) not in have]
    return sorted(out, key=lambda c: (-c.diameter, -c.corner, c.like))


def _candidates(samples: SurfaceSamples, requirement: ToolRequirement) -> tuple[list[_Candidate], NDArray[np.object_]]:
    """Every tool that takes some of the samples, and for each sample TOOL, SLENDER or SHARP_CORNER."""
    why = np.full(len(samples), Reason.SHARP_CORNER, dtype=object)
    out: list[_Candidate] = []
    for cutter in _cutters(requirement):
        rows, tips = requirement.touches(cutter, samples)
        need = requirement.need(cutter, tips)
        short = cutter.sold_on(need[:, 0])
        why[rows[~short & (why[rows] != ProposalVerdict.TOOL)]] = ProposalVerdict.SLENDER
        why[rows[short]] = ProposalVerdict.TOOL
        out.extend(_levels(cutter, requirement.body(cutter), rows[short], need[short]))
    return out, why


def _levels(cutter: CuttingPart, body: ToolBody, rows: NDArray[np.int64], need: F64) -> list[_Candidate]:
    """The cutter on necks of several lengths, each with the samples it is long enough for."""
    if not len(rows):
        return []
    steps = np.unique(need[:, 0])
    if len(steps) > LEVELS:
        steps = np.unique(np.quantile(need[:, 0], np.linspace(0.0, 1.0, LEVELS + 1)[1:], method="higher"))
    out = []
    for neck in steps.tolist():
        mine = need[:, 0] <= neck
        long = replace(body, neck_length=neck, stickout=float(need[mine, 1].max()))
        out.append(_Candidate(cutter, long, rows[mine], need[mine]))
    return out


def _fewest(candidates: list[_Candidate], area: F64) -> list[_Candidate]:
    """Candidates that take most with the fewest tools: a set cover in which an open area of a least zone costs a tool.

    A tool that gains less is not proposed, since zones do not use it either. Samples that the same candidates take are
    one row. HiGHS solves the problem exactly (branch and bound).
    """
    if not candidates or not float(area.sum()) > 0.0:
        return []
    cover = np.zeros((len(area), len(candidates)), np.bool_)
    for j, c in enumerate(candidates):
        cover[c.rows, j] = True
    counts = (area > 0.0) & cover.any(axis=1)
    kinds, group = np.unique(cover[counts], axis=0, return_inverse=True)
    worth = np.bincount(group.ravel(), weights=area[counts], minlength=len(kinds)) / LEAST_ZONE_MM2
    gains = worth @ kinds
    useful = np.flatnonzero(gains >= 1.0)
    if not len(useful):
        return []
    kinds = kinds[:, useful]
    diameters = np.array([candidates[j].body.diameter for j in useful])
    slender = np.array([candidates[j].slenderness for j in useful])
    new = np.array([not candidates[j].cutter.at_hand for j in useful])
    price = 1.0 + PER_SLENDER * slender / MAX_SLENDERNESS + PER_NEW * new - PER_STOUT * diameters / max(DIAMETERS)
    rows = hstack([csr_matrix(kinds.astype(np.float64)), identity(len(kinds))], format="csr")
    answer = milp(np.concatenate([price, worth]), constraints=LinearConstraint(rows, lb=1.0),
                  integrality=np.concatenate([np.ones(len(useful)), np.zeros(len(kinds))]),
                  bounds=Bounds(0.0, 1.0), options={"mip_rel_gap": 0.0, "presolve": True})
    if answer.x is None:  # an empty choice is always allowed, so there is a solution
        raise InternalError(f"no set of tools was found: {answer.message}", code="cover_failed")
    return [candidates[useful[j]] for j in np.flatnonzero(answer.x[:len(useful)] > 0.5)]


def _named(c: _Candidate, need: F64) -> ToolToAdd:
    """The candidate with the least lengths that the samples it takes need."""
    t = c.body
    neck, stickout = (float(v) for v in need.max(axis=0))
    return ToolToAdd(t.kind, t.diameter, round(t.corner_radius, 6), round(min(t.flute_length, neck), 6),
                        round(t.neck_diameter, 6), neck, t.shank_diameter, stickout,
                        c.cutter.like if c.cutter.at_hand else "", c.cutter.like, round(t.taper_deg, 6))
