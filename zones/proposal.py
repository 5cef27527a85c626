"""The smallest change of the tool set that empties the remainder, as one list of tools.

Every cutter of a fixed grid, and every cutter at hand, is asked which samples it touches if nothing but the cutting
part counts, and how long its neck and stickout must be there. That gives candidates of catalogue lengths, each with
the samples it takes, and the list is a minimum set cover, solved exactly. Theory: docs/theory/tools.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_matrix, hstack, identity

from geometry.bvh import TriangleTree
from geometry.drop import drop_grid, drop_tips
from geometry.errors import InternalError
from geometry.mesh import F64
from geometry.part import Part
from geometry.rays import first_hits
from geometry.sampling import SurfaceSamples
from geometry.toolbody import HolderSegment, ToolBody
from zones.reach import LEVEL_TOLERANCE, LOOKUP_STEP, Clearances, Lattice, TipField, discs_of, lattice_step, touchable
from zones.remainder import DIAMETERS

ASKED_AT_MOST = 2000
SEED = 11
SEEN = -0.02  # n_z below: out of sight
BULL_CORNER = 0.2  # corner radius of the bull noses tried, in diameters
FLUTES = 3.0  # flute length in diameters, where the neck is as long
RELIEF = 0.05  # how much thinner than the cutter a neck is, in diameters
MOST_SLENDER = 20.0  # neck length in diameters; no thinner tool is proposed
LEAST_MM2 = 1.0  # a tool that gains less is not proposed
LEVELS = 8  # neck lengths tried for one cutter
LEAST_NECK = 1.0  # mm
NOSE_STEP = 0.8  # mm, grid of the heights that holders have to clear
PER_SLENDER, PER_STOUT = 1e-2, 1e-4  # weights of the ties, in tools: total slenderness, then thickness

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
                  limit in diameters does), 'sharp corner' (no round tool), 'too little' (not worth a tool)
    """

    tools: tuple[ProposedTool, ...]
    emptied_mm2: float
    stays_mm2: dict[str, float]
    rows: tuple[NDArray[np.int64], ...] = field(default=(), compare=False, repr=False)


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
            clear: Clearances, able: Able, *, slenderness: float = MOST_SLENDER,
            least_mm2: float = LEAST_MM2) -> Proposal:
    """Fewest tools that take what no tool at hand does.

    samples     : SurfaceSamples of the remainder, mm, access frame
    fields      : TipField by id of the tools at hand, at least one
    tree        : TriangleTree of part and fixtures, access frame
    part        : Part, for its bounds
    lift        : mm, distance along the normal within which a touch counts
    clear       : Clearances
    able        : (tool, (n, 3) normals) -> (n,) bool, whether a strategy exists for them
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
    why = _known(few, fields, tree, lift, able)
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
    stays = {str(r): float(area[why == r].sum()) for r in sorted(set(why.tolist()) - {"taken"})}
    return Proposal(tuple(tools), float(area[why == "taken"].sum()), stays, tuple(rows))


def _known(few: SurfaceSamples, fields: Mapping[str, TipField], tree: TriangleTree, lift: float,
           able: Able) -> NDArray[np.object_]:
    """Reason of the samples no new tool is asked for: out of sight or covered, or touched by a tool at hand."""
    why = np.full(len(few), "", dtype=object)
    up = np.tile(np.array([0.0, 0.0, 1.0]), (len(few), 1))
    _, above = first_hits(tree, few.points + 0.02 * few.normals, up, 1e-4, 1e6)
    why[(few.normals[:, 2] <= SEEN) | (np.asarray(above) >= 0)] = "undercut"
    for key in sorted(fields):
        open_to = np.flatnonzero(why == "")
        normals = few.normals[open_to]
        takes = touchable(fields[key], few.points[open_to], normals, lift)[1]
        why[open_to[takes & able(fields[key].tool, normals)]] = "pass"
    return why


def catalogue(lengths: F64) -> F64:
    """Lengths tools are sold in, none less than asked of (k,) float64, mm: steps of 1 up to 20, of 5 above."""
    step = np.where(lengths <= 20.0, 1.0, 5.0)
    return np.asarray(step * np.ceil(lengths / step - 1e-9))


class _Shop:
    """All tools that could be bought for some samples."""

    def __init__(self, tree: TriangleTree, part: Part, fields: Mapping[str, TipField], lift: float, clear: Clearances,
                 able: Able, slenderness: float) -> None:
        self.tree, self.part, self.fields, self.lift, self.clear = tree, part, fields, lift, clear
        self.able, self.slenderness = able, slenderness
        some = fields[min(fields)]
        self.allowance, self.cusp = some.allowance, some.cusp
        widest = max(max(DIAMETERS), *(f.tool.diameter for f in fields.values()))
        self.lattice = Lattice.over(part.bounds, 0.5 * widest + 2 * NOSE_STEP, NOSE_STEP)
        self._heights: dict[float, F64] = {}

    def cutters(self) -> list[tuple[ToolBody, str, str]]:
        """Tools to ask, stout to thin, with the id of the one at hand that has this cutter and of its holder."""
        tools = [self.fields[k].tool for k in sorted(self.fields)]
        out = [(t, t.id, t.id) for t in tools]
        have = {(t.diameter, t.corner_radius) for t in tools}
        for d in DIAMETERS:
            like = min(tools, key=lambda t: (abs(math.log(t.diameter / d)), t.id))
            for corner in (d / 2, 0.0, round(BULL_CORNER * d, 6)):
                if (d, corner) not in have:
                    out.append((replace(like, diameter=d, corner_radius=corner, flute_length=FLUTES * d,
                                        neck_diameter=(1.0 - RELIEF) * d, shank_diameter=max(like.shank_diameter, d)),
                                "", like.id))
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
            need = self.lengths(body, tips[fits], floor)
            short = need[:, 0] <= self.slenderness * body.diameter + 1e-9
            why[rows[~short & (why[rows] != "tool")]] = "slender"
            why[rows[short]] = "tool"
            out.extend(_levels(body, at_hand, like, rows[short], need[short]))
        return out, why

    def lengths(self, body: ToolBody, tips: F64, floor: tuple[float, float]) -> F64:
        """Neck length and stickout (k, 2) a tool needs at tips (k, 3), in catalogue steps but no less than floor, mm.

        A shank shows at least as long as it is thick. Surroundings are looked at one cell of the shank and holder
        grid wider than asked for, so that the tool also passes that grid wherever its nodes lie.
        """
        spare = LOOKUP_STEP * math.sqrt(2.0)
        lift = self.allowance + self.cusp + 2 * LEVEL_TOLERANCE - tips[:, 2]
        wide = 0.5 * body.shank_diameter + self.clear.shank + self.allowance + spare
        neck = drop_tips(self.tree, tips[:, :2], wide, 0.0) + lift
        nose = np.full(len(tips), -np.inf)
        cells = self.lattice.cells(tips[:, :2])
        for d in discs_of(body, self.clear):
            if d.name == "holder":
                height = self._height(d.radius + self.allowance + spare + NOSE_STEP / math.sqrt(2.0))
                nose = np.maximum(nose, height[cells] + lift - (d.height - body.stickout))
        neck = np.maximum(catalogue(np.maximum(neck, LEAST_NECK)), floor[0])
        return np.column_stack([neck, np.maximum(catalogue(np.maximum(nose, neck + body.shank_diameter)), floor[1])])

    def _height(self, radius: float) -> F64:
        """What stands highest within a radius of the nodes of the holder grid, mm."""
        if radius not in self._heights:
            g = self.lattice
            self._heights[radius] = drop_grid(self.tree, g.x0, g.y0, g.step, g.nx, g.ny, radius, 0.0)
        return self._heights[radius]


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
    price = 1.0 + PER_SLENDER * slender / MOST_SLENDER - PER_STOUT * diameters / max(DIAMETERS)
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
