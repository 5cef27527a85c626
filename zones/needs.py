"""Which tool would do where none at hand does, in sizes that are sold, and whether it really does.

Asked of one access direction, against part and fixtures together. Theory: docs/theory/zones.md, remainder.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.drop import drop_tips
from geometry.mesh import F64
from geometry.rays import first_hits
from geometry.sampling import SurfaceSamples
from geometry.toolbody import ToolBody
from zones.catalogue import DIAMETERS, MOST_SLENDER, Lengths, nearest, sold
from zones.reach import LEVEL_TOLERANCE, Clearances, TipField, lattice_step, touchable
from zones.sight import able
from zones.view import View

ALL_BUT = 0.98  # of the samples a named tool is long enough for; one more may ask for a neck of twice the length
DOES = 0.5  # of the area of an entry, the least a tool named for it takes
GAP = 1.5  # times the thinnest cutter: what lies nearer ahead makes it a gap


@dataclass(frozen=True)
class Cutter:
    """A cutting part, mm, of a tool at hand (``at_hand``, named by ``like``) or new in the holder of that one."""

    diameter: float
    corner: float
    like: str
    at_hand: bool


@dataclass(frozen=True, eq=False)
class Wants:
    """Of n samples: reason (object, '' where unknown), stoutest Cutter (object, None), its neck in diameters (n,)."""

    reason: NDArray[np.object_]
    cutter: NDArray[np.object_]
    slenderness: F64


Words = Callable[[Cutter, F64, NDArray[np.int64]], NDArray[np.object_]]


class Buyer:
    """Tools for what one view leaves.

    view  : View with the tools at hand
    lift  : mm, distance along the normal within which a touch counts
    clear : Clearances
    """

    def __init__(self, view: View, lift: float, clear: Clearances) -> None:
        self.view, self.lift, self.clear = view, lift, clear
        self.tools = {t: f.tool for t, f in sorted(view.fields.items())}
        some = next(iter(view.fields.values()))
        self.allowance, self.cusp = some.allowance, some.cusp
        widest = max(DIAMETERS[0], *(t.diameter for t in self.tools.values()))
        self.lengths = Lengths(view.obstacles, view.part.bounds, clear, self.allowance, self.cusp, widest)

    def body(self, cutter: Cutter) -> ToolBody:
        """The tool with the lengths of the one it goes with."""
        like = self.tools[cutter.like]
        return like if cutter.at_hand else sold(like, cutter.diameter, cutter.corner)

    def need(self, cutter: Cutter, tips: F64) -> F64:
        """Neck length and stickout (k, 2), mm, the tool has to have at tips (k, 3), mm, where its cutting part fits."""
        body = self.body(cutter)
        return self.lengths.at(body, tips, (body.neck_length, body.stickout) if cutter.at_hand else (0.0, 0.0))

    def touches(self, cutter: Cutter, samples: SurfaceSamples) -> tuple[NDArray[np.bool_], F64]:
        """(n,) bool, whether the cutting part alone touches each and can finish it, and tips (n, 3), mm."""
        body = self.body(cutter)
        bare = replace(body, shank_diameter=body.diameter, neck_diameter=body.diameter, holder=())
        field = TipField(self.view.obstacles, bare, self.clear, self.view.part.bounds, body.radius, lattice_step(body),
                         self.allowance, self.cusp)
        fits, _, tips = touchable(field, samples.points, samples.normals, self.lift)
        return fits & able(body, samples.normals, max(self.cusp, 1e-6)), tips

    def wants(self, samples: SurfaceSamples) -> Wants:
        """What would do for n samples that no tool at hand touches: one of these with more neck, or a thinner one."""
        n = len(samples)
        out = Wants(np.full(n, "", dtype=object), np.full(n, None, dtype=object), np.full(n, np.inf))
        for tid, field in self.view.fields.items():
            cutter = Cutter(field.tool.diameter, field.tool.corner_radius, tid, True)
            self._ask(cutter, samples, np.arange(n), out, self._stopped_by)
        ahead = np.asarray(first_hits(self.view.obstacles, samples.points, samples.normals, 1e-3, 1e6)[0])
        thinnest = min(self.tools.values(), key=lambda t: t.diameter)
        for d in (thinnest.diameter, *(d for d in DIAMETERS if d < thinnest.diameter and 0.5 * d > self.cusp)):
            for corner in (d / 2, 0.0):
                left = np.flatnonzero(out.reason == "")
                if not len(left):
                    return out
                tight = ahead[left] < thinnest.diameter * GAP
                words = np.where(tight, "gap", "corner").astype(object)
                self._ask(Cutter(d, corner, nearest(list(self.tools.values()), d).id, False), samples, left, out,
                          _given(words))
        return out

    def _ask(self, cutter: Cutter, samples: SurfaceSamples, rows: NDArray[np.int64], out: Wants, why: Words) -> None:
        """Note the cutter for those of ``rows`` it would do for with a stouter neck than what is noted."""
        fits, tips = self.touches(cutter, samples.subset(rows))
        of = np.flatnonzero(fits)
        if not len(of):
            return
        slender = self.need(cutter, tips[of])[:, 0] / cutter.diameter
        of, slender = of[slender < out.slenderness[rows[of]]], slender[slender < out.slenderness[rows[of]]]
        out.reason[rows[of]] = why(cutter, tips[of], of)
        out.cutter[rows[of]] = cutter
        out.slenderness[rows[of]] = slender

    def _stopped_by(self, cutter: Cutter, tips: F64, _of: NDArray[np.int64]) -> NDArray[np.object_]:
        """'shank' or 'holder', what a tool at hand is farther from clearing at tips (k, 3), mm.

        Seen from a cell diagonal around, as the look-up sees them.
        """
        field = self.view.fields[cutter.like]
        short = {name: np.full(len(tips), -np.inf) for name in ("shank", "holder")}
        for d in field.discs:
            limit = field.disc_limit(d, drop_tips(field.tree, tips[:, :2], field.disc_radius(d, 1.0), 0.0))
            short[d.name] = np.maximum(short[d.name], limit - tips[:, 2] + 2 * LEVEL_TOLERANCE)
        return np.where(short["holder"] >= short["shank"], "holder", "shank").astype(object)

    def named(self, cutter: Cutter, samples: SurfaceSamples) -> dict[str, object]:
        """The tool to buy for samples, asked whether it does: {} where it does for less than half of the area."""
        fits, tips = self.touches(cutter, samples)
        need = self.need(cutter, tips)
        short = fits & (need[:, 0] <= MOST_SLENDER * cutter.diameter + 1e-9)
        if not short.any():
            return {}
        neck, stickout = (float(v) for v in np.quantile(need[short], ALL_BUT, axis=0, method="higher"))
        does = short & (need[:, 0] <= neck) & (need[:, 1] <= stickout)
        share = float(samples.area[does].sum()) / max(float(samples.area.sum()), 1e-300)
        if share < DOES:
            return {}
        body = self.body(cutter)
        return {"kind": body.kind, "diameter_mm": body.diameter, "corner_radius_mm": round(body.corner_radius, 6),
                "neck_length_mm": neck, "shank_diameter_mm": body.shank_diameter, "stickout_mm": stickout,
                "like": cutter.like, "share": round(share, 3)}


def _given(words: NDArray[np.object_]) -> Words:
    """The reason of each row as it stands in (n,) ``words``."""
    def of_rows(_cutter: Cutter, _tips: F64, of: NDArray[np.int64]) -> NDArray[np.object_]:
        return np.asarray(words[of])

    return of_rows
