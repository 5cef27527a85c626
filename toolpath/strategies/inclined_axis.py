"""Passes along faces with a ball or bull nose tilted off their normal, steered round obstacles, as motions.

The wanted axis has a lead along the pass and a tilt aside of it, off the normal, so that the centre of the nose does
not rub. Where the tool would meet an obstacle with it, or the machine cannot take it, the nearest free axes are taken.
They turn evenly along each pass and from one to the next (``toolpath.five_axis.axis_smoothing``). Where no axis is free
the pass breaks off, and other passes take the rest. Where the ends of neighbours are close, with no obstacle between,
the tool stays down and cuts them back and forth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.five_axis.axis_smoothing import AxisLimits, Steered, steered
from toolpath.five_axis.oriented_motion import LOOK, Runs, Surroundings, in_turn, layers_over
from toolpath.five_axis.oriented_pass import lead_and_tilt, posed
from toolpath.five_axis.oriented_piece import MIN_PIECE, Piece
from toolpath.passes.pass_family import FinishTarget
from toolpath.passes.trimmed_faces import Faces
from toolpath.plan_settings import CutData, PlanSettings, ToolLean
from toolpath.poses import Axes, Blocked, places_along
from toolpath.strategies.isoparametric import Stretch, course
from zones.machinable_area import AreaForm
from zones.reach.tip_field import TipField

NAME = "inclined_axis"
LIMITS = AxisLimits(math.radians(45.0), math.radians(4.0))
WARY = 0.3  # mm of additional clearance of neck, shank and holder at stations, for places between and stock of layers
JOINED = math.radians(15.0)  # largest turn of the axis from the end of a pass to the beginning of the next
APART, ACROSS = 2.0, 0.5  # distances between passes, and radii, over which the tool stays down
LAYER = 0.6  # layer height as a share of the depth that an end may take; cusps and stock lattice take the rest
DIVIDED = 8.0  # radii: a longer pass that cannot be cut as a whole is cut in halves
MAX_LOOK = 0.5  # mm, of the tip, between poses of a way across that are checked against part and stock
TRIED = 12  # stretches of a group on which both sides of a tilt are tried


@dataclass(frozen=True, eq=False)
class _Nose:
    """The nose of a tool on faces, and its obstacles.

    grown     : the tool with the allowance all round; its tip is lower by that along the axis
    wary      : whether the tool enters something, with more room than it needs
    chord     : mm, of its locations
    """

    tool: ToolBody
    grown: ToolBody
    around: Surroundings
    wary: Blocked
    allowance: float
    lift: float
    scallop: float
    chord: float

    def blocked(self, tips: F64, axes: F64) -> NDArray[np.bool_]:
        """(n,) bool: whether the tool is blocked where the grown one has its tip (n, 3), mm."""
        return self.around.blocked(tips + self.allowance * axes, axes, self.tool)

    def close(self, tips: F64, axes: F64) -> NDArray[np.bool_]:
        """(n,) bool: the same, with more room round neck, shank and holder."""
        out = self.blocked(tips, axes)
        free = np.flatnonzero(~out)
        out[free] = self.wary(tips[free] + self.allowance * axes[free], axes[free])
        return out

    def tilted(self, s: Stretch, wanted: Axes, before: Steered | None) -> tuple[list[Piece], Steered]:
        """The free pieces of a stretch, in order of machining, and the axes of all of it.

        Raises
        ------
        GeometryError
            As ``Stretch.stepped``, ``steered`` and ``posed``.
        """
        profile, ends = s.stepped(self.grown.corner_radius, self.scallop, self.chord)
        axes = steered(profile, self.grown, wanted, self.close, LIMITS, before, self.lift)
        found = posed(profile, ends, self.grown, axes, self.blocked, self.chord, self.lift)
        if s.turned:
            found = found.reversed()
        made = [Piece(tips, axis, axis, self.tool.radius, on_end=True).raised(self.allowance)
                for tips, axis in found.pieces]
        return [piece for piece in made if piece.length >= MIN_PIECE * self.tool.radius], axes

    def free(self, s: Stretch, wanted: Axes) -> float:
        """Length of a stretch, mm, that is free with the wanted axes.

        Raises
        ------
        GeometryError
            As ``Stretch.stepped`` and ``posed``.
        """
        profile, ends = s.stepped(self.grown.corner_radius, self.scallop, self.chord)
        found = posed(profile, ends, self.grown, wanted, self.close, self.chord, self.lift)
        return profile.length - sum(b - a for a, b in found.left)


def requested_lean(leaned: ToolLean | None, form: AreaForm, tool: ToolBody) -> ToolLean | None:
    """Requested tilt of a tool on a zone of a form; None on level zones and for sharp-cornered tools."""
    if leaned is None or form is AreaForm.LEVEL or tool.tip_curvature <= 0.0:
        return None
    if form is not AreaForm.STEEP:
        return leaned if leaned.lead > 0.0 or leaned.tilt > 0.0 else None
    return None if leaned.walls is None else replace(leaned, lead=0.0, tilt=leaned.walls)


def inclined_passes(faces: Sequence[Faces], target: FinishTarget, field: TipField, cut: CutData,
                    settings: PlanSettings, around: Surroundings, wary: Blocked, leaned: ToolLean) -> Runs:
    """The passes of a tilted nose over the target.

    faces  : of the zone, exact
    target : FinishTarget
    field  : TipField of the tool
    around : Surroundings
    wary   : whether the tool enters part or fixtures, with ``WARY`` mm more round neck, shank and holder
    leaned : requested tilt off the normal
    """
    tool, spare = field.tool, field.allowance
    grown = replace(tool, diameter=tool.diameter + 2.0 * spare, corner_radius=tool.corner_radius + spare)
    nose = _Nose(tool, grown, around, wary, spare, settings.lift, settings.budget.laid,
                 settings.budget.chord)
    planned = course(faces, target, field, nose.scallop, nose.chord, None)
    refused = list(planned.refused)
    passes: list[list[Piece]] = []
    for group in planned.groups:
        passes.append([])
        side = _freer(group, nose, leaned, refused)  # the side depends on the direction of the face's parameters
        before: dict[bool, Steered] = {}  # with a lead the axes of passes back and forth are not near each other
        for s in group:
            way = s.turned and leaned.lead > 0.0
            try:
                made, before[way] = nose.tilted(s, _wanted(s, leaned, side), before.get(way))
            except GeometryError as refusal:
                refused.append(refusal.message)
                continue
            passes[-1] += made
    if planned.groups and not any(passes):
        refused.append("the tool is almost nowhere free")
    found = _layered(passes, nose, max(APART * planned.side_step, ACROSS * tool.radius))
    runs = in_turn([(NAME, piece) for piece in found], tool, cut, settings, around, DIVIDED * tool.radius)
    return replace(runs, refused=tuple(dict.fromkeys([*refused, *runs.refused])))


def _wanted(s: Stretch, leaned: ToolLean, side: float) -> Axes:
    """The wanted axes along a stretch: the lead follows the direction of the cut, the tilt keeps to one side."""
    return lead_and_tilt(-leaned.lead if s.turned else leaned.lead, side * leaned.tilt)


def _freer(group: Sequence[Stretch], nose: _Nose, leaned: ToolLean, refused: list[str]) -> float:
    """Side, 1 or -1, on which a tilt leaves more of the passes free; ``refused`` gets the failed stretches."""
    if leaned.tilt == 0.0:
        return 1.0
    free = np.zeros(2)
    for s in group[::math.ceil(len(group) / TRIED)]:
        for k, side in enumerate((1.0, -1.0)):
            try:
                free[k] += nose.free(s, _wanted(s, leaned, side))
            except GeometryError as refusal:
                refused.append(refusal.message)
    return 1.0 if free[0] >= free[1] else -1.0


def _layered(passes: Sequence[Sequence[Piece]], nose: _Nose, apart: float) -> list[Piece]:
    """The passes of groups, each group preceded by raised copies, layer by layer, where too much stands over it.

    A layer covers the whole of a group before the next one, since stock beside a pass also blocks its nose.
    """
    out: list[Piece] = []
    for group in passes:
        layers = [layer for piece in group for layer in layers_over(piece, nose.tool, nose.around, LAYER,
                                                                                widened=True)]
        for k in sorted({k for k, _ in layers}, reverse=True):
            out += _to_and_fro([piece for at, piece in layers if at == k], nose, apart)
    return out


def _to_and_fro(pieces: Sequence[Piece], nose: _Nose, apart: float) -> list[Piece]:
    """Pieces joined where the tool can stay down from the end of one to the beginning of the next.

    apart : mm, largest distance from one to the next
    """
    tool, out = nose.tool, list[Piece]()
    look = min(LOOK * tool.radius, MAX_LOOK)
    for piece in pieces:
        if out:
            tips, axes, away = (np.stack([getattr(out[-1], a)[-1], getattr(piece, a)[0]])
                                for a in ("tips", "axes", "away"))
            across = Piece(tips, axes, away, piece.reach, on_end=True)
            if across.length <= apart and axes[0] @ axes[1] >= math.cos(JOINED):
                dense = across.at(places_along(tips, axes, tool.stickout, look))
                if not nose.around.blocked(dense.tips, dense.axes, tool).any():
                    tips, axes, away = (np.concatenate([getattr(p, a) for p in (out[-1], piece)])
                                        for a in ("tips", "axes", "away"))
                    out[-1] = Piece(tips, axes, away, piece.reach, on_end=True)
                    continue
        out.append(piece)
    return out
