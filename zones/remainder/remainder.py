"""The remainder: area that no tool of the setup reaches, with the reason and the tool that reaches it.

For each sample without a zone these checks follow in order:

1. Material of the part above it gives 'undercut', a fixture above it gives 'fixture'.
2. A tool at hand touches it: the area is too small for a zone, or no pass gets there ('pass').
3. A tool at hand touches it without the fixtures ('fixture').
4. A cutter of the setup touches it without shank and holder; the result is the length of the tool it needs.
5. A thinner ball or a sharp-cornered end fits; the result is its largest diameter.

The rest are corners that no rotating tool makes. With several accesses all are checked, and the access with the least
obstruction counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.sampling import SurfaceSamples
from zones.features.connection_faces import connection_of
from zones.machinable_area import SEEN
from zones.model import Decomposition
from zones.plan_view.regions import Labels
from zones.reach.access_view import View
from zones.reach.assembly import Clearances
from zones.reach.tip_field import TipField
from zones.remainder.obstructions import above, covered
from zones.remainder.reasons import Reason
from zones.remainder.tool_catalogue import MAX_SLENDERNESS
from zones.remainder.tool_requirements import DOES, CuttingPart, ToolRequirement
from zones.zoning.zones import LEAST_ZONE_MM2

MAX_SAMPLES = 6000  # samples to check one by one; their areas are scaled so that they represent all
GRAVITY: dict[str, int] = {reason: degree for degree, reason in enumerate(Reason) if reason is not Reason.UNDERCUT}
"""Degree of obstruction of a sample along an access direction; 'undercut', with or without a connection, is worse."""
NO_PASS, TOO_LITTLE = "no pass gets there", "less than a zone is made of"


@dataclass(frozen=True)
class RemainderEntry:
    """Area of one region that remains for one reason, and the one tool that reaches it.

    faces        : face numbers; area : mm²
    reason       : a ``Reason``, or 'undercut behind connection C2'
    would_need   : the tool or other measure that reaches it; empty where none does
    at           : a point of it, mm
    tool_at_hand : id of the tool of the setup that touches it ('pass'), or touches it without the fixtures; else ''
    why_left     : for 'pass', why that tool was not used; else ''
    samples      : the checked samples, frame of the first view; their areas sum to ``area``
    """

    faces: tuple[int, ...]
    area: float
    reason: str
    would_need: dict[str, object]
    at: tuple[float, float, float]
    tool_at_hand: str = ""
    why_left: str = ""
    samples: SurfaceSamples | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, eq=False)
class _Why:
    """Results for n samples.

    Reason, tool at hand and why it was not used (objects, ''), stoutest CuttingPart (object, None) and its neck in
    diameters, and the index of the view (n,) of these results.
    """

    reason: NDArray[np.object_]
    tool: NDArray[np.object_]
    left: NDArray[np.object_]
    cutter: NDArray[np.object_]
    slenderness: NDArray[np.float64]
    view: NDArray[np.int64]

    @classmethod
    def blank(cls, n: int, view: int) -> _Why:
        """Empty results for a view."""
        reason, tool, left = (np.full(n, "", dtype=object) for _ in range(3))
        return cls(reason, tool, left, np.full(n, None, dtype=object), np.full(n, np.inf), np.full(n, view))

    def take(self, other: _Why, rows: NDArray[np.int64]) -> None:
        """Take the results of another for some rows (k,)."""
        for name in ("reason", "tool", "left", "cutter", "slenderness", "view"):
            getattr(self, name)[rows] = getattr(other, name)[rows]

    def key(self, row: int) -> tuple[str, ...]:
        """Key that the samples of one entry share; a ball and a flat end are two tools to buy."""
        c = self.cutter[row]
        kind = "" if c is None else c.like if c.at_hand else "ball" if c.corner > 0 else "flat"
        sold = str(bool(self.slenderness[row] <= MAX_SLENDERNESS))
        return str(self.reason[row]), str(self.tool[row]), str(self.left[row]), kind, sold, str(self.view[row])


def explain(samples: SurfaceSamples, labels: Labels, views: Sequence[View], decomposition: Decomposition, lift: float,
            given_up: NDArray[np.bool_] | None = None, *, clear: Clearances | None = None) -> list[RemainderEntry]:
    """Group the remaining samples by region and reason.

    samples  : SurfaceSamples that no proved pass covers, mm, frame of the first view
    labels   : their regions
    views    : the access directions with the tools at hand
    lift     : mm, distance along the normal within which a touch counts
    given_up : (n,) bool, samples that a tool can touch but no pass of the plan does
    clear    : Clearances of the setup; the defaults where None

    Returns
    -------
    list of RemainderEntry
        Largest area first; areas sum to that of the samples.
    """
    n = len(samples)
    if not n:
        return []
    examined, area = _examined(samples.area)
    few = replace(samples.subset(examined), area=area)
    requirements = [ToolRequirement(v, lift, clear or Clearances()) for v in views]
    why = _of_views(few, requirements, decomposition)
    if given_up is not None:
        lost = given_up[examined]
        why.left[lost & (why.reason == Reason.PASS)] = NO_PASS
        lost &= np.isin(why.reason, (Reason.GAP, Reason.CORNER, Reason.SHARP_CORNER))
        blank = _Why.blank(len(few), 0)
        blank.reason[:], blank.left[:] = Reason.PASS, NO_PASS
        why.take(blank, np.flatnonzero(lost))
    groups: dict[tuple[str, ...], list[int]] = {}
    for row in range(len(few)):
        groups.setdefault((labels.regions[labels.code[examined[row]]].base, *why.key(row)), []).append(row)
    out = [_entry(few, why, rows, need) for members in groups.values()
           for rows, need in _needs(few, why, np.array(members), requirements)]
    return sorted(out, key=lambda r: (-r.area, r.reason, r.faces))


def _examined(area: F64) -> tuple[NDArray[np.int64], F64]:
    """The samples that are looked at, (k,) int64, index, at most ``MAX_SAMPLES``, and the area each stands for, mm².

    area : (n,) float64, mm², of all samples

    Those that stand for more than their share of the area are all looked at: on planes one stands for 25 others, and a
    few more or less of them would change an entry by mm². The rest is drawn, and stands for the area of the rest.
    """
    n = len(area)
    if n <= MAX_SAMPLES:
        return np.arange(n), area
    rng = np.random.default_rng(7)
    large = area > float(area.sum()) / MAX_SAMPLES
    if large.sum() > MAX_SAMPLES // 2:
        large[:] = False
    rest = np.flatnonzero(~large)
    drawn = rng.choice(rest, MAX_SAMPLES - int(large.sum()), replace=False)
    scaled = area.copy()
    scaled[drawn] *= float(area[rest].sum()) / max(float(area[drawn].sum()), 1e-12)
    rows = np.sort(np.concatenate([np.flatnonzero(large), drawn]))
    return rows, scaled[rows]


def _entry(few: SurfaceSamples, why: _Why, rows: NDArray[np.int64], need: dict[str, object]) -> RemainderEntry:
    mine, one = few.subset(rows), rows[0]
    return RemainderEntry(tuple(int(f) for f in np.unique(mine.face)), float(mine.area.sum()), str(why.reason[one]),
    need,
                     tuple(mine.points[len(rows) // 2].tolist()), str(why.tool[one]), str(why.left[one]), mine)


def _needs(few: SurfaceSamples, why: _Why, rows: NDArray[np.int64],
           requirements: Sequence[ToolRequirement]) -> Iterator[tuple[NDArray[np.int64], dict[str, object]]]:
    """Samples of one group by the tool that reaches them, with that tool."""
    reason, tool, at = str(why.reason[rows[0]]), str(why.tool[rows[0]]), int(why.view[rows[0]])
    requirement = requirements[at]
    access: dict[str, object] = {"access": requirement.view.id} if len(requirements) > 1 else {}
    if reason.startswith(Reason.UNDERCUT):
        yield rows, {"kind": "other access"}
    elif reason == Reason.FIXTURE:
        yield rows, {"kind": "other clamping", **access}
    elif why.cutter[rows[0]] is None or tool:
        yield rows, {}
    else:
        turn = requirements[0].view.rotation @ requirement.view.rotation.T
        here = few if at == 0 else replace(few, points=few.points @ turn, normals=few.normals @ turn)
        if why.slenderness[rows[0]] <= MAX_SLENDERNESS:  # the same for all samples of a group
            for mine, need in _bought(few, here, why, rows, requirement):
                yield mine, {**need, **access} if need else {}
        else:
            slender = round(float(why.slenderness[rows].min()), 1)
            yield rows, {"kind": "other process", "slenderness": slender, **access}


def _bought(few: SurfaceSamples, turned: SurfaceSamples, why: _Why, rows: NDArray[np.int64],
            requirement: ToolRequirement) -> Iterator[tuple[NDArray[np.int64], dict[str, object]]]:
    """Samples of one group by the tool to buy, with that tool; ``turned`` in the frame of the requirement.

    Where a tool picked for several samples suffices for less than half of them, each gets its own cutter. The dict is
    empty where that cutter suffices for less than half as well.
    """
    for mine, cutter in _stoutest(few, why, rows):
        need = requirement.named(cutter, turned.subset(mine))
        own = _cutters(why, mine)
        if need or len(own) == 1:
            yield mine, need
            continue
        for cutter in own:
            of = mine[why.cutter[mine] == cutter]
            yield of, requirement.named(cutter, turned.subset(of))


def _cutters(why: _Why, rows: NDArray[np.int64]) -> list[CuttingPart]:
    """The cutters noted for some samples, stout to thin."""
    return sorted(set(why.cutter[rows]), key=lambda c: -c.diameter)


def _stoutest(few: SurfaceSamples, why: _Why,
              rows: NDArray[np.int64]) -> Iterator[tuple[NDArray[np.int64], CuttingPart]]:
    """Samples by cutter: the stoutest that suffices for half of the area, then the same for the rest while it pays.

    Where none suffices for half, the cutter for the largest area counts. A thinner cutter of one kind touches all
    that a thicker one touches, but needs a neck of the same length, on which thin cutters are not sold.
    """
    while len(rows):
        d = np.array([why.cutter[k].diameter for k in rows])
        neck, area = why.slenderness[rows] * d, few.area[rows]
        does = [(c, (d >= c.diameter) & c.sold_on(neck)) for c in _cutters(why, rows)]
        held = np.array([float(area[mine].sum()) for _, mine in does])
        best = int(np.argmax(held >= min(DOES * float(area.sum()), held.max())))
        cutter, mine = does[best]
        if float(area[~mine].sum()) < LEAST_ZONE_MM2 and held[best] >= DOES * float(area.sum()):
            mine[:] = True
        yield rows[mine], cutter
        rows = rows[~mine]


def _of_views(few: SurfaceSamples, requirements: Sequence[ToolRequirement], decomposition: Decomposition) -> _Why:
    """Results for each sample along the view with the least obstruction.

    few : in the frame of the first view
    """
    out, gravity = _Why.blank(len(few), 0), np.full(len(few), np.inf)
    first = requirements[0].view
    for k, requirement in enumerate(requirements):
        turn = first.rotation @ requirement.view.rotation.T
        here = few if k == 0 else replace(few, points=few.points @ turn, normals=few.normals @ turn)
        found = _reasons(here, requirement, decomposition, k)
        how = np.array([GRAVITY.get(str(w), len(GRAVITY)) for w in found.reason])
        out.take(found, np.flatnonzero(how < gravity))
        gravity = np.minimum(gravity, how)
    return out


def _reasons(few: SurfaceSamples, requirement: ToolRequirement, decomposition: Decomposition, place: int) -> _Why:
    view = requirement.view
    part, n = view.part, len(few)
    out = _Why.blank(n, place)
    reason = out.reason
    owner = connection_of(part, decomposition)
    roof = above(few, view.tree)
    for k in np.flatnonzero((few.normals[:, 2] <= SEEN) | (roof >= 0)):
        c = owner.get(int(part.mesh.face_ids[roof[k]])) if roof[k] >= 0 else None
        behind = bool(c) and c != owner.get(int(few.face[k]))
        reason[k] = f"{Reason.UNDERCUT} behind connection {c}" if behind else Reason.UNDERCUT
    if requirement.clamped:
        reason[covered(few, view.obstacles) & (reason == "")] = Reason.FIXTURE
    _at_hand(few, view.fields, requirement, out, Reason.PASS)
    out.left[reason == Reason.PASS] = TOO_LITTLE
    if requirement.clamped and bool((reason == "").any()):  # these limits are dear
        _at_hand(few, requirement.unclamped, requirement, out, Reason.FIXTURE)
    left = np.flatnonzero(reason == "")
    wants = requirement.wants(few.subset(left))
    reason[left], out.cutter[left], out.slenderness[left] = wants.reason, wants.cutter, wants.slenderness
    reason[reason == ""] = Reason.SHARP_CORNER
    return out


def _at_hand(few: SurfaceSamples, fields: Mapping[str, TipField], requirement: ToolRequirement, out: _Why,
             reason: Reason) -> None:
    """Set ``reason`` as the reason of open samples that one of these tools touches, and note the stoutest such tool."""
    left = np.flatnonzero(out.reason == "")
    tool = requirement.touched_by(few.subset(left), fields)
    out.tool[left] = tool
    out.reason[left[tool != ""]] = reason
