"""Passes that follow the borders of trimmed faces [Sarkar2015], kept off the whole part.

A face is laid over the unit square as a whole. So neighbouring zones continue each other's passes, and the border of
the reachable area, which is known to the spacing of samples only, bends no pass. Each zone cuts the passes that serve
it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.lines import Line, true_runs
from toolpath.passes.cutter_locations import lifted
from toolpath.passes.forward_step import PassProfile, steps
from toolpath.passes.isoparametric_passes import Flank, Laid
from toolpath.passes.pass_family import FinishTarget
from toolpath.passes.trimmed_faces import Faces
from zones.reach.tip_field import TipField

NAME = "isoparametric"
MIN_AREA = 1.0  # r²: passes of later rounds finish smaller faces
ALONG = 129  # places along a pass that are compared with the target
OVERRUN = 0.3  # radii of the corner that a pass runs past the last place it serves


@dataclass(frozen=True, eq=False)
class Stretch:
    """A piece of a pass at ``eta`` from xi ``low`` to ``high``; ``turned``: cut from the greater xi to the smaller."""

    iso: Laid
    eta: float
    low: float
    high: float
    turned: bool

    def stepped(self, radius: float, scallop: float, chord: float) -> tuple[PassProfile, F64]:
        """Its profile and the distances along it at which a ball is located, (n,) float64, mm.

        radius, scallop, chord : mm

        Raises
        ------
        GeometryError
            As ``PassProfile.of`` and ``steps``.
        """
        profile = PassProfile.of(self.iso.curve(self.eta, self.low, self.high), chord, radius)
        return profile, steps(profile, radius, chord, scallop)


@dataclass(frozen=True, eq=False)
class FacePasses:
    """Passes over trimmed faces.

    groups    : stretches of each piece of a face, pass after pass; on a wall each pass is one, from the highest down
    steep     : on a wall, where a pass ends at an obstacle; elsewhere it goes over it
    way       : mm, length of all passes
    side_step : mm between neighbouring passes, median
    refused   : reasons why faces have none
    """

    groups: tuple[tuple[Stretch, ...], ...]
    steep: bool
    way: float
    side_step: float
    refused: tuple[str, ...]


def course(faces: Sequence[Faces], target: FinishTarget, field: TipField, scallop: float, chord: float,
           flank: Flank | None) -> FacePasses:
    """The passes of faces as far as they serve the target [Sarkar2015].

    target  : FinishTarget; passes go where its points are
    field   : TipField of the tool
    scallop : mm, residual between passes without the chordal error
    chord   : mm, chordal tolerance of a pass
    flank   : of the tool, on a wall, where passes run along the more level sides with the stock on their right; None
              elsewhere, where they run back and forth along the longer sides
    """
    radius = field.tool.corner_radius + field.allowance
    near = cKDTree(target.points)
    groups: list[tuple[Stretch, ...]] = []
    levels: list[tuple[float, tuple[Stretch, ...]]] = []
    apart: list[float] = []
    refused: list[str] = []
    way = 0.0
    todo = list(faces)
    while todo:
        face = todo.pop(0)
        if face.area < MIN_AREA * radius**2:
            continue
        try:
            passes = face.passes(radius, max(scallop - chord, 0.5 * scallop), flank)
        except GeometryError as refusal:
            refused.append(f"{face.name}: {refusal.message}")
            todo[:0] = face.alone
            continue
        for iso, etas in passes:
            own, step, length = _served(iso, etas, near, target.spacing, radius, flank is not None)
            if not own:
                continue
            if flank is None:
                groups.append(tuple(s for _, mine in own for s in mine))
            levels += own
            apart.append(step)
            way += length
    if flank is not None:  # from the top down, so that no pass has to remove the stock above it
        groups = [mine for _, mine in sorted(levels, key=lambda level: -level[0])]
    return FacePasses(tuple(groups), flank is not None, way, float(np.median(apart)) if apart else 0.0, tuple(refused))


def _served(iso: Laid, etas: F64, near: cKDTree, spacing: float, radius: float,
            steep: bool) -> tuple[list[tuple[float, tuple[Stretch, ...]]], float, float]:
    """The stretches of all passes that come near places, with the height (mm) of each pass, mm between passes, and mm
    the tool goes."""
    xi = np.linspace(0.0, 1.0, ALONG)
    along, across = np.meshgrid(xi, etas)
    place, normal = (v.reshape(len(etas), ALONG, 3) for v in iso.contact(along.ravel(), across.ravel()))
    step = float(np.median(np.linalg.norm(np.diff(place, axis=0), axis=2))) if len(etas) > 1 else spacing
    size = np.linalg.norm(np.diff(place, axis=1), axis=2)
    wanted = near.query(place.reshape(-1, 3))[0].reshape(len(etas), ALONG) <= np.maximum(
        step + 0.5 * spacing, np.median(size))
    out: list[tuple[float, tuple[Stretch, ...]]] = []
    total = 0.0
    for k, eta in enumerate(etas.tolist()):
        at = np.concatenate([[0.0], np.cumsum(size[k])])
        turned = _against(place[k], normal[k]) if steep else bool(k % 2)
        mine: list[Stretch] = []
        moved = np.linalg.norm(np.diff(place[k] + radius * normal[k], axis=0), axis=1)
        gone = np.concatenate([[0.0], np.cumsum(moved)])
        for low, high in _spans(at, wanted[k], OVERRUN * radius):
            a, b = np.interp([low, high], at, xi).tolist()
            mine.append(Stretch(iso, eta, a, b, turned))
            total += float(np.diff(np.interp([low, high], at, gone))[0])
        if mine:
            height = float(place[k, wanted[k], 2].mean())
            out.append((height, tuple(reversed(mine) if turned else mine)))
    return out, step, total


def _spans(at: F64, wanted: NDArray[np.bool_], overrun: float) -> list[tuple[float, float]]:
    """From where to where along ways (n,) mm something is wanted, ``overrun`` mm more at both ends, joined."""
    out: list[tuple[float, float]] = []
    for i, j in true_runs(wanted):
        low, high = max(at[max(i - 1, 0)] - overrun, 0.0), min(at[min(j, len(at) - 1)] + overrun, at[-1])
        if out and low <= out[-1][1]:
            low = out.pop()[0]
        if high > low:
            out.append((float(low), float(high)))
    return out


def laid(planned: FacePasses, field: TipField, scallop: float, chord: float,
         lift: float) -> tuple[list[list[Line]], tuple[str, ...]]:
    """The lines of passes, group by group, kept above the whole part, and the reasons why stretches have none.

    scallop, chord : mm, as for ``course``
    lift           : mm, that a tip may stand off the surface along its normal
    """
    tool, spare = field.tool, field.allowance
    grown = replace(tool, diameter=tool.diameter + 2.0 * spare, corner_radius=tool.corner_radius + spare)
    out, refused, max_rise = [], [], 0.0 if planned.steep else None

    def limit(xy: F64) -> F64:
        return field.tips_along(xy) - spare

    for group in planned.groups:
        lines: list[Line] = []
        for s in group:
            try:
                profile, ends = s.stepped(grown.corner_radius, scallop, chord)
            except GeometryError as refusal:  # passes of later rounds fill the gap
                refused.append(refusal.message)
                continue
            made = [Line(p + [0.0, 0.0, spare], False)
                    for p in lifted(profile, ends, grown, limit, chord, lift, max_rise)[0]
                    if len(p) > 1]
            lines += [line.reversed() for line in reversed(made)] if s.turned else made
        out.append(lines)
    return out, tuple(dict.fromkeys(refused))


def suits(tool: ToolBody) -> bool:
    """Whether a tool can take such passes: one round corner forms the cusps between them."""
    return tool.corner_radius > 0.0 and tool.arcs is None


def _against(place: F64, normal: F64) -> bool:
    """Whether a pass along a wall, contacts and normals (n, 3), has its free side on the right, not the material."""
    way = np.diff(place[:, :2], axis=0)
    free = 0.5 * (normal[1:, :2] + normal[:-1, :2])
    return float((way[:, 0] * free[:, 1] - way[:, 1] * free[:, 0]).sum()) < 0.0
