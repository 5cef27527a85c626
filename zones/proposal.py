"""The smallest change of the tool set that empties the remainder, as one list of tools.

Every cutter of a fixed grid, and every cutter at hand, is asked which samples it touches if nothing but the cutting
part counts, and how long its neck and stickout must be there. That gives candidates of catalogue lengths, each with
the samples it takes, and the list is a minimum set cover, solved exactly. Theory: docs/theory/tools.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_matrix, hstack, identity

from geometry.bvh import TriangleTree
from geometry.errors import InternalError
from geometry.mesh import F64
from geometry.part import Part
from geometry.sampling import SurfaceSamples
from geometry.toolbody import HolderSegment, ToolBody
from zones.catalogue import BULL_CORNER, DIAMETERS, MOST_SLENDER, Lengths, nearest, sold
from zones.fixtures import covered, in_sight, over_the_part
from zones.reach import Clearances, TipField, lattice_step, touchable
from zones.zoning import LEAST_ZONE_MM2

ASKED_AT_MOST = 2000
SEED = 11
LEAST_MM2 = LEAST_ZONE_MM2  # a tool that gains less is not proposed: zones would not use it either
LEVELS = 8  # neck lengths tried for one cutter
# weights of the ties, in tools: total slenderness, then a cutter that is not at hand, then thickness
PER_SLENDER, PER_NEW, PER_STOUT = 1e-2, 1e-3, 1e-4

Able = Callable[[ToolBody, F64], NDArray[np.bool_]]


@dataclass(frozen=True)
class ProposedTool:
    """A tool to add, lengths mm from the tip.

    instead_of : id of the tool at hand that has the same cutter and a shorter neck or stickout, '' where none has
    holder_of  : id of the tool at hand whose shank and holder it was measured with
    area_mm2   : of the remainder, what it takes that those before it in the list do not
    """

    kind: str
    diameter_mm: float
    corner_radius_mm: float
    flute_length_mm: float
    neck_diameter_mm: float
    neck_length_mm: float
    shank_diameter_mm: float
    stickout_mm: float
    area_mm2: float
    instead_of: str
    holder_of: str

    def body(self, id: str, number: int, holder: tuple[HolderSegment, ...]) -> ToolBody:
        """The tool as a ToolBody in a given holder."""
        return ToolBody(id, number, self.diameter_mm, self.corner_radius_mm, self.flute_length_mm,
                        self.neck_diameter_mm, self.neck_length_mm, self.shank_diameter_mm, self.stickout_mm, holder)


@dataclass(frozen=True)
class Proposal:
    """What to add, and what it does.

    tools       : stoutest first
    emptied_mm2 : of the remainder
    stays_mm2   : by reason: 'undercut', 'pass' (a tool at hand touches it), 'slender' (only a neck longer than the
                  limit in diameters does), 'sharp corner' (no round tool), 'too little' (not worth a tool), 'fixture'
                  (one stands above it, or keeps the tools at hand from it that touch it on the bare part)
    rows        : per tool, the samples it takes; asked : the samples that were asked; why : (n,) of each of these the
                  reason, 'taken' where a tool does
    """

    tools: tuple[ProposedTool, ...]
    emptied_mm2: float
    stays_mm2: dict[str, float]
    rows: tuple[NDArray[np.int64], ...] = field(default=(), compare=False, repr=False)
    asked: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64), compare=False, repr=False)
    why: NDArray[np.object_] = field(default_factory=lambda: np.zeros(0, object), compare=False, repr=False)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A tool with the samples it would take; need (k, 2): neck length and stickout each of them asks for, mm."""

    body: ToolBody
    at_hand: str
    like: str
    rows: NDArray[np.int64]
    need: F64

    @property
    def slenderness(self) -> float:
        return self.body.neck_length / self.body.diameter


def propose(samples: SurfaceSamples, fields: Mapping[str, TipField], tree: TriangleTree, part: Part, lift: float,
            clear: Clearances, able: Able, *, bare: TriangleTree | None = None, slenderness: float = MOST_SLENDER,
            least_mm2: float = LEAST_MM2) -> Proposal:
    """Fewest tools that take what no tool at hand does.

    samples     : SurfaceSamples of the remainder, mm, access frame
    fields      : TipField by id of the tools at hand, at least one
    tree        : TriangleTree of part and fixtures, access frame
    part        : Part, for its bounds
    lift        : mm, distance along the normal within which a touch counts
    clear       : Clearances
    able        : (tool, (n, 3) normals) -> (n,) bool, whether a strategy exists for them
    bare        : TriangleTree of the part alone, None where there are no fixtures
    slenderness : longest neck in diameters
    least_mm2   : a tool that gains less is not proposed

    Returns
    -------
    Proposal
        Areas sum to that of the samples; ``rows`` are the indices into ``samples`` of those asked that each tool takes.

    Notes
    -----
    Of more than 2000 samples 2000 are asked, drawn with a fixed seed, and stand for the rest.
    """
    n = len(samples)
    if not n:
        return Proposal((), 0.0, {})
    rng = np.random.default_rng(SEED)
    asked = np.sort(rng.choice(n, ASKED_AT_MOST, replace=False)) if n > ASKED_AT_MOST else np.arange(n)
    few = samples.subset(asked)
    area = few.area * (float(samples.area.sum()) / max(float(few.area.sum()), 1e-300))
    why = _known(few, fields, tree, tree if bare is None else bare, lift, able)
    left = np.flatnonzero(why == "")
    shop = _Shop(tree, part, fields, lift, clear, able, slenderness)
    candidates, why[left] = shop.candidates(few.points[left], few.normals[left])
    wanted = why[left] == "tool"
    chosen = _fewest(candidates, np.where(wanted, area[left], 0.0), least_mm2)
    tools, rows = [], []
    for c in sorted(chosen, key=lambda c: (-c.body.diameter, c.body.neck_length)):
        mine = why[left[c.rows]] == "tool"
        if not mine.any():
            continue
        taken = left[c.rows[mine]]
        why[taken] = "taken"
        tools.append(_named(c, c.need[mine], float(area[taken].sum())))
        rows.append(asked[taken])
    why[why == "tool"] = "too little"
    if bare is not None:
        rest = np.flatnonzero(np.isin(why, ("slender", "sharp corner")))
        without = over_the_part(fields, bare, part.bounds, clear)
        why[rest[_touched(few.subset(rest), without, lift, able)]] = "fixture"
    stays = {str(r): float(area[why == r].sum()) for r in sorted(set(why.tolist()) - {"taken"})}
    return Proposal(tuple(tools), float(area[why == "taken"].sum()), stays, tuple(rows), asked, why)


def _known(few: SurfaceSamples, fields: Mapping[str, TipField], tree: TriangleTree, bare: TriangleTree, lift: float,
           able: Able) -> NDArray[np.object_]:
    """Reason of the samples no new tool is asked for: out of sight or covered, or touched by a tool at hand."""
    why = np.full(len(few), "", dtype=object)
    if bare is not tree:
        why[covered(few, tree)] = "fixture"
    why[~in_sight(few, bare)] = "undercut"
    open_to = np.flatnonzero(why == "")
    why[open_to[_touched(few.subset(open_to), fields, lift, able)]] = "pass"
    return why


def _touched(samples: SurfaceSamples, fields: Mapping[str, TipField], lift: float, able: Able) -> NDArray[np.bool_]:
    """(n,) bool: some tool touches it and has a strategy for it."""
    got = np.zeros(len(samples), np.bool_)
    for key in sorted(fields):
        left = np.flatnonzero(~got)
        normals = samples.normals[left]
        got[left] = touchable(fields[key], samples.points[left], normals, lift)[1] & able(fields[key].tool, normals)
    return got


class _Shop:
    """All tools that could be bought for some samples."""

    def __init__(self, tree: TriangleTree, part: Part, fields: Mapping[str, TipField], lift: float, clear: Clearances,
                 able: Able, slenderness: float) -> None:
        self.tree, self.part, self.fields, self.lift, self.clear = tree, part, fields, lift, clear
        self.able, self.slenderness = able, slenderness
        some = fields[min(fields)]
        self.allowance, self.cusp = some.allowance, some.cusp
        widest = max(max(DIAMETERS), *(f.tool.diameter for f in fields.values()))
        self.lengths = Lengths(tree, part.bounds, clear, self.allowance, self.cusp, widest)

    def cutters(self) -> list[tuple[ToolBody, str, str]]:
        """Tools to ask, stout to thin, with the id of the one at hand that has this cutter and of its holder."""
        tools = [self.fields[k].tool for k in sorted(self.fields)]
        out = [(t, t.id, t.id) for t in tools]
        have = {(t.diameter, t.corner_radius) for t in tools}
        for d in DIAMETERS:
            if 0.5 * d <= self.cusp:  # such a tool cannot keep its cusp below its own radius, and no setup takes it
                continue
            like = nearest(tools, d)
            for corner in (d / 2, 0.0, round(BULL_CORNER * d, 6)):
                if (d, corner) not in have:
                    out.append((sold(like, d, corner), "", like.id))
        return sorted(out, key=lambda c: (-c[0].diameter, -c[0].corner_radius, c[1]))

    def candidates(self, points: F64, normals: F64) -> tuple[list[_Candidate], NDArray[np.object_]]:
        """Every tool that takes some of the samples, and of each sample 'tool', 'slender' or 'sharp corner'."""
        why = np.full(len(points), "sharp corner", dtype=object)
        out: list[_Candidate] = []
        for body, at_hand, like in self.cutters():
            ready = np.flatnonzero(self.able(body, normals))
            bare = replace(body, shank_diameter=body.diameter, holder=())
            near = TipField(self.tree, bare, self.clear, self.part.bounds, body.radius, lattice_step(body),
                            self.allowance, self.cusp)
            _, fits, tips = touchable(near, points[ready], normals[ready], self.lift)
            rows = ready[fits]
            if not len(rows):
                continue
            floor = (body.neck_length, body.stickout) if at_hand else (0.0, 0.0)  # instead of it, nothing is lost
            need = self.lengths.at(body, tips[fits], floor)
            short = need[:, 0] <= self.slenderness * body.diameter + 1e-9
            why[rows[~short & (why[rows] != "tool")]] = "slender"
            why[rows[short]] = "tool"
            out.extend(_levels(body, at_hand, like, rows[short], need[short]))
        return out, why


def _levels(body: ToolBody, at_hand: str, like: str, rows: NDArray[np.int64], need: F64) -> list[_Candidate]:
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
        out.append(_Candidate(long, at_hand, like, rows[mine], need[mine]))
    return out


def _fewest(candidates: list[_Candidate], area: F64, least: float) -> list[_Candidate]:
    """Candidates that together take most with fewest tools: a set cover in which leaving ``least`` mm² costs a tool.

    Samples that the same candidates take are one row. Solved exactly by HiGHS (branch and bound).
    """
    if not candidates or not float(area.sum()) > 0.0:
        return []
    cover = np.zeros((len(area), len(candidates)), np.bool_)
    for j, c in enumerate(candidates):
        cover[c.rows, j] = True
    counts = (area > 0.0) & cover.any(axis=1)
    kinds, group = np.unique(cover[counts], axis=0, return_inverse=True)
    worth = np.bincount(group.ravel(), weights=area[counts], minlength=len(kinds)) / least
    gains = worth @ kinds
    useful = np.flatnonzero(gains >= 1.0)
    if not len(useful):
        return []
    kinds = kinds[:, useful]
    diameters = np.array([candidates[j].body.diameter for j in useful])
    slender = np.array([candidates[j].slenderness for j in useful])
    new = np.array([not candidates[j].at_hand for j in useful])
    price = 1.0 + PER_SLENDER * slender / MOST_SLENDER + PER_NEW * new - PER_STOUT * diameters / max(DIAMETERS)
    rows = hstack([csr_matrix(kinds.astype(np.float64)), identity(len(kinds))], format="csr")
    answer = milp(np.concatenate([price, worth]), constraints=LinearConstraint(rows, lb=1.0),
                  integrality=np.concatenate([np.ones(len(useful)), np.zeros(len(kinds))]),
                  bounds=Bounds(0.0, 1.0), options={"mip_rel_gap": 0.0, "presolve": True})
    if answer.x is None:  # leaving everything is always allowed, so there is an answer
        raise InternalError(f"no set of tools was found: {answer.message}", code="cover_failed")
    return [candidates[useful[j]] for j in np.flatnonzero(answer.x[:len(useful)] > 0.5)]


def _named(c: _Candidate, need: F64, gained: float) -> ProposedTool:
    """The candidate, no longer than the samples it takes ask for."""
    t = c.body
    neck, stickout = (float(v) for v in need.max(axis=0))
    return ProposedTool(t.kind, t.diameter, round(t.corner_radius, 6), round(min(t.flute_length, neck), 6),
                        round(t.neck_diameter, 6), neck, t.shank_diameter, stickout, gained, c.at_hand, c.like)
