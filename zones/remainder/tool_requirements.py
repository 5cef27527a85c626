"""The tool that reaches samples where no tool at hand does, in sizes on sale, checked on the samples.

It holds for one access direction, with part and fixtures as obstacles. Theory: docs/theory/zones.md, remainder.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.mesh_queries.drop import drop_tips
from geometry.mesh_queries.rays import first_hits
from geometry.sampling import SurfaceSamples
from geometry.tool_body import ToolBody
from zones.lattice import lattice_step
from zones.reach.access_reach import able
from zones.reach.access_view import View
from zones.reach.assembly import Clearances
from zones.reach.tip_field import LEVEL_TOLERANCE, TipField, touchable
from zones.remainder.obstructions import over_the_part
from zones.remainder.reasons import Reason
from zones.remainder.tool_catalogue import DIAMETERS, MAX_SLENDERNESS, Lengths, catalogue, nearest, sold

ALL_BUT = 0.98  # of the samples: share that a named tool is long enough for; the rest may need a neck twice as long
DOES = 0.5  # of the area of an entry: least share that its named tool takes
GAP = 1.5  # times the thinnest cutter: material nearer ahead makes the place a gap


@dataclass(frozen=True)
class CuttingPart:
    """A cutting part, mm, of a tool at hand (``at_hand``, id ``like``), or new in the holder of tool ``like``."""

    diameter: float
    corner: float
    like: str
    at_hand: bool

    def sold_on(self, neck: F64) -> NDArray[np.bool_]:
        """(k,) bool: such a cutter is sold on necks of these lengths. neck : (k,) float64, mm."""
        return np.asarray(neck <= MAX_SLENDERNESS * self.diameter + 1e-9)


@dataclass(frozen=True, eq=False)
class CutterNeeds:
    """For n samples: Reason (object, '' where unknown), stoutest CuttingPart (object, None), neck in diameters (n,)."""

    reason: NDArray[np.object_]
    cutter: NDArray[np.object_]
    slenderness: F64


class ToolRequirement:
    """Tools that the remainder of one view needs. Points are float64 in the access frame of the view.

    view  : View with the tools at hand
    lift  : mm, distance along the normal within which a touch counts
    clear : Clearances
    """

    def __init__(self, view: View, lift: float, clear: Clearances) -> None:
        self.view, self.lift, self.clear = view, lift, clear
        self.tools = {t: f.tool for t, f in sorted(view.fields.items())}
        self.clamped = view.obstacles is not view.tree
        some = next(iter(view.fields.values()))
        self.allowance, self.cusp = some.allowance, some.cusp
        widest = max(DIAMETERS[0], *(t.diameter for t in self.tools.values()))
        self.lengths = Lengths(view.obstacles, view.part.bounds, clear, self.allowance, self.cusp, widest)

    @cached_property
    def unclamped(self) -> dict[str, TipField]:
        """Tip limits of the tools at hand without the fixtures."""
        return over_the_part(self.view.fields, self.view.tree, self.view.part.bounds, self.clear)

    def touched_by(self, samples: SurfaceSamples, fields: Mapping[str, TipField]) -> NDArray[np.object_]:
        """(n,) object, str: id of the stoutest whole tool that touches and can finish each sample, '' where none."""
        out = np.full(len(samples), "", dtype=object)
        for t in sorted(fields, key=lambda t: (-fields[t].tool.diameter, t)):
            left = np.flatnonzero(out == "")
            normals = samples.normals[left]
            got = touchable(fields[t], samples.points[left], normals, self.lift)[1]
            out[left[got & able(fields[t].tool, normals, self.cusp)]] = t
        return out

    def body(self, cutter: CuttingPart) -> ToolBody:
        """The tool with the lengths of its companion at hand."""
        like = self.tools[cutter.like]
        return like if cutter.at_hand else sold(like, cutter.diameter, cutter.corner)

    def need(self, cutter: CuttingPart, tips: F64) -> F64:
        """Neck length and stickout that the tool needs.

        tips : (k, 3) float64, mm, access frame, tips at which its cutting part fits

        Returns (k, 2) float64, mm, along the axis of the tool frame.

        A tool at hand keeps at least its own lengths, so that its replacement loses nothing. The flutes of a tool to
        buy cover its whole corner.
        """
        if not len(tips):
            return np.zeros((0, 2))
        body = self.body(cutter)
        own = float(catalogue(np.array(body.corner_radius)))
        return self.lengths.at(body, tips, (body.neck_length, body.stickout) if cutter.at_hand else (own, own))

    def touches(self, cutter: CuttingPart, samples: SurfaceSamples) -> tuple[NDArray[np.int64], F64]:
        """Samples that the cutting part alone touches and can finish, with tips.

        Returns samples, (k,) int64, index, and tips, (k, 3) float64, mm, access frame.
        """
        body = self.body(cutter)
        rows = np.flatnonzero(able(body, samples.normals, self.cusp))
        bare = replace(body, shank_diameter=2.0 * body.widest_radius, holder=())
        field = TipField(self.view.obstacles, bare, self.clear, self.view.part.bounds, body.widest_radius,
                         lattice_step(body), self.allowance, self.cusp)
        _, fits, tips = touchable(field, samples.points[rows], samples.normals[rows], self.lift)
        return rows[fits], tips[fits]

    def wants(self, samples: SurfaceSamples) -> CutterNeeds:
        """Needs of n samples that no tool at hand touches: a cutter at hand on a longer neck, or a thinner cutter."""
        n = len(samples)
        out = CutterNeeds(np.full(n, "", dtype=object), np.full(n, None, dtype=object), np.full(n, np.inf))
        for tid, field in self.view.fields.items():
            rows, tips = self._ask(CuttingPart(field.tool.diameter, field.tool.corner_radius, tid, True), samples,
                                   np.arange(n), out)
            out.reason[rows] = _stopped_by(field, tips)
        ahead = np.asarray(first_hits(self.view.obstacles, samples.points, samples.normals, 1e-3, 1e6)[0])
        thinnest = min(self.tools.values(), key=lambda t: t.diameter)
        reason = np.where(ahead < thinnest.diameter * GAP, Reason.GAP, Reason.CORNER).astype(object)
        for d in (thinnest.diameter, *(d for d in DIAMETERS if d < thinnest.diameter and 0.5 * d > self.cusp)):
            for corner in (d / 2, 0.0):
                left = np.flatnonzero(out.reason == "")
                if not len(left):
                    return out
                like = nearest(list(self.tools.values()), d).id
                rows, _ = self._ask(CuttingPart(d, corner, like, False), samples, left, out)
                out.reason[rows] = reason[rows]
        return out

    def _ask(self, cutter: CuttingPart, samples: SurfaceSamples, rows: NDArray[np.int64],
             out: CutterNeeds) -> tuple[NDArray[np.int64], F64]:
        """Note the cutter for those of ``rows`` that it reaches with a stouter neck than the noted one.

        Returns these (k,) and its tips there (k, 3), mm.
        """
        of, tips = self.touches(cutter, samples.subset(rows))
        slender = self.need(cutter, tips)[:, 0] / cutter.diameter
        better = slender < out.slenderness[rows[of]]
        mine = rows[of[better]]
        out.cutter[mine], out.slenderness[mine] = cutter, slender[better]
        return mine, tips[better]

    def named(self, cutter: CuttingPart, samples: SurfaceSamples) -> dict[str, object]:
        """The tool to buy for samples; {} where it reaches less than half of the area.

        Neck and stickout suffice for nearly all of the samples it touches, or for all where that area is too small.
        """
        rows, tips = self.touches(cutter, samples)
        need = self.need(cutter, tips)
        short = cutter.sold_on(need[:, 0])
        if not short.any():
            return {}
        body, whole = self.body(cutter), max(float(samples.area.sum()), 1e-300)
        for part in (ALL_BUT, 1.0):  # the longest necks only where the samples that need them are half of the area
            neck, stickout = (float(v) for v in np.quantile(need[short], part, axis=0, method="higher"))
            does = rows[short & (need[:, 0] <= neck) & (need[:, 1] <= stickout)]
            share = float(samples.area[does].sum()) / whole
            if share >= DOES:
                cone = {"taper_angle_deg": round(body.taper_deg, 6)} if body.taper_deg > 0.0 else {}
                cone |= {"profile_radius_mm": body.profile_radius} if body.form else {}
                cone |= {"tip_diameter_mm": body.tip_diameter} if body.form and body.tip_diameter > 0.0 else {}
                return {"kind": body.kind, "diameter_mm": body.diameter, **cone,
                        "corner_radius_mm": round(body.corner_radius, 6), "neck_length_mm": neck,
                        "shank_diameter_mm": body.shank_diameter, "stickout_mm": stickout, "like": cutter.like,
                        "share": round(share, 3)}
        return {}


def _stopped_by(field: TipField, tips: F64) -> NDArray[np.object_]:
    """Reason.SHANK or Reason.HOLDER, the body of a tool at hand that lacks more clearance at tips (k, 3), mm.

    The search covers a cell diagonal around, as the look-up does.
    """
    short = {name: np.full(len(tips), -np.inf) for name in ("shank", "holder")}
    for d in field.discs:
        limit = field.disc_limit(d, drop_tips(field.tree, tips[:, :2], field.disc_radius(d, 1.0), 0.0))
        short[d.name] = np.maximum(short[d.name], limit - tips[:, 2] + 2 * LEVEL_TOLERANCE)
    return np.where(short["holder"] >= short["shank"], Reason.HOLDER, Reason.SHANK).astype(object)
