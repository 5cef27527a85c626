"""Faces finished by a tilted flat or bull-nose end whose nose has their curvature, as motions.

A face is laid out (``toolpath.five_axis.matched_passes``) as a whole, or in the pieces with the shorter way
(``toolpath.five_axis.surface_partition``). Each pass is cut where it serves the target. Where the tool would meet an
obstacle with the axis it needs there, or the machine cannot take that axis, the pass breaks off, and other passes take
the rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation
from scipy.spatial import cKDTree

from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.five_axis.matched_passes import MatchedPasses, MatchedStrip, MatchTolerances
from toolpath.five_axis.oriented_motion import LOOK, TURN_S, Runs, Surroundings, in_turn
from toolpath.five_axis.oriented_piece import MIN_PIECE, Piece
from toolpath.five_axis.surface_partition import parted
from toolpath.passes.isoparametric_passes import IsoSurface, Laid
from toolpath.passes.pass_family import FinishTarget
from toolpath.passes.trimmed_faces import Faces
from toolpath.plan_settings import CutData, PlanSettings
from toolpath.poses import places_along

NAME = "curvature_matched"
MIN_TILT = math.radians(1.0)  # an end then cuts in front and is clear of the surface behind
ALONG, UP = 65, 33  # places of a face that are compared with the target
TRIED = 9  # places each way at which the tool is tried before passes are laid out
MIN_FREE = 0.25  # share of the wanted places
OFFS = (0.0, 0.25, 0.5)  # shares of the distance that a pass may stand off
MIN_AREA = 4.0  # of the squared radius
MAX_LOOK = 0.5  # mm, of the tip and of the nose of the holder, between poses that are checked for obstacles


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Places of a face over the unit square, evenly each way: eta (UP,) of the rows, and which places are wanted."""

    eta: F64
    wanted: NDArray[np.bool_]

    @classmethod
    def of(cls, iso: IsoSurface, near: cKDTree, spacing: float) -> _Lattice:
        at = np.linspace(0.0, 1.0, UP)
        xi, eta = np.meshgrid(np.linspace(0.0, 1.0, ALONG), at)
        place, normal = (a.reshape(UP, ALONG, 3) for a in iso.contact(xi.ravel(), eta.ravel()))
        if not (np.isfinite(place).all() and np.isfinite(normal).all()):
            raise GeometryError("it has a place without a normal", code="bad_pass",
                                remedy="machine it by another strategy")
        size = max(float(np.linalg.norm(np.diff(place, axis=k), axis=2).mean()) for k in (0, 1))
        far = near.query(place.reshape(-1, 3))[0].reshape(UP, ALONG)
        return cls(at, far <= spacing + size)

    def serves(self, s: MatchedStrip) -> NDArray[np.bool_]:
        """(ALONG,) bool, evenly along the unit square: whether a strip cuts something wanted there."""
        xi = np.linspace(0.0, 1.0, ALONG)
        low, high = np.interp(xi, s.xi, s.low), np.interp(xi, s.xi, s.high)
        room = 0.5 / (UP - 1)
        own = (self.eta[:, None] >= low - room) & (self.eta[:, None] <= high + room)
        return np.asarray((own & self.wanted).any(axis=0))


def suits(tool: ToolBody) -> bool:
    """Whether a tool has an end that can be matched: a nose circle of some radius under an upright side."""
    return tool.radius > tool.corner_radius + 1e-9 and tool.taper == 0.0 and tool.arcs is None


def matched(faces: Sequence[Faces], target: FinishTarget, tool: ToolBody, cut: CutData, settings: PlanSettings,
            around: Surroundings, allowance: float, max_seconds: float) -> Runs:
    """The passes of a matched end over the target.

    faces       : of the zone, exact
    target      : FinishTarget
    around      : Surroundings
    allowance   : mm, to leave on the part
    max_seconds : s, time of the usual passes; slower passes are not laid out
    """
    chord = settings.budget.rounding
    tolerances = MatchTolerances(settings.budget.laid, chord, MIN_TILT, chord)
    ends = _Ends(tool, tolerances, around, allowance, settings.lift, cKDTree(target.points), target.spacing)
    found: list[tuple[str, Piece]] = []
    refused: list[str] = []
    for face in faces:
        if face.area < MIN_AREA * tool.radius**2:
            continue
        try:
            for laid in face.over_square:
                made = ends.pieces(laid, cut.feed, max_seconds)
                if isinstance(made, str):
                    refused.append(f"{face.name}: {made}")
                else:
                    found += [(face.name, piece) for piece in made]
        except GeometryError as refusal:
            refused.append(f"{face.name}: {refusal.message}")
    runs = in_turn(found, tool, cut, settings, around)
    return replace(runs, refused=tuple(dict.fromkeys([*refused, *runs.refused])))


@dataclass(frozen=True, eq=False)
class _Ends:
    """Common data of the passes of a zone.

    tolerances    : MatchTolerances
    lift          : mm, that a pass may stand off where facets of the part are in its way
    near, spacing : tree of the target's points and mm between these
    """

    tool: ToolBody
    tolerances: MatchTolerances
    around: Surroundings
    allowance: float
    lift: float
    near: cKDTree
    spacing: float

    @cached_property
    def grown(self) -> ToolBody:
        """The tool with the allowance all round: with its tip lower by that along the axis it is where this one is."""
        a = self.allowance
        return replace(self.tool, diameter=self.tool.diameter + 2.0 * a, corner_radius=self.tool.corner_radius + a)

    def blocked(self, tip: F64, axis: F64) -> NDArray[np.bool_]:
        """(n,) bool: whether the tool cannot be where the grown one has its tip (n, 3), mm."""
        return self.around.blocked(tip + self.allowance * axis, axis, self.tool)

    def pieces(self, laid: Laid, feed: float, max_seconds: float) -> list[Piece] | str:
        """The pieces of the passes of a face, from one border to the other, or the reason why there are none."""
        if not isinstance(laid, IsoSurface):
            return "the face has common passes with others"
        parts = parted(laid, self.grown, self.tolerances, round_way=TURN_S * feed / 60.0)
        found = [(part, _Lattice.of(part.iso, self.near, self.spacing)) for part in parts]
        found = [(part, lattice) for part, lattice in found if lattice.wanted.any()]
        if not all(math.isfinite(part.way) for part, _ in found):
            return "the end of the tool does not fit the face everywhere"
        seconds = 60.0 / feed * sum(part.way * float(lattice.wanted.mean()) for part, lattice in found)
        if seconds >= max_seconds:
            return f"curvature-matched passes would take {seconds:.0f} s, the usual passes {max_seconds:.0f} s"
        out: list[Piece] = []
        for part, lattice in found:
            if not self._free(lattice, part.iso):
                continue
            over = MatchedPasses.over(part.iso, self.grown, self.tolerances)
            for s in over.lay_out():
                served = lattice.serves(s)
                if served.any():
                    out += self._walked(over, s, served)
        return out or "the tool is almost nowhere free with its end on the face"

    def _free(self, lattice: _Lattice, iso: IsoSurface) -> bool:
        """Whether the tool can stand on its end in enough of the wanted places."""
        rows, columns = (np.linspace(0, n - 1, TRIED).astype(int) for n in (UP, ALONG))
        plan, free, none = MatchedPasses(iso, self.grown, self.tolerances, 0.0), 0, np.zeros(TRIED)
        for i in rows.tolist():
            at = plan.contacts(np.linspace(0.0, 1.0, TRIED), float(lattice.eta[i]))
            tilt = plan.nose.least_tilt(at, none, self.tolerances.depth, self.tolerances.least_tilt)
            tip, axis = plan.stands(at, np.nan_to_num(tilt), none)
            good = ~np.isnan(tilt) & lattice.wanted[i, columns]
            free += int((~self.blocked(tip[good], axis[good])).sum())
        return free >= max(MIN_FREE * float(lattice.wanted[np.ix_(rows, columns)].sum()), 1.0)

    def _walked(self, over: MatchedPasses, s: MatchedStrip, served: NDArray[np.bool_]) -> list[Piece]:
        """The pieces of one pass that serve the target and where the tool is free."""
        xi = over.ways(s)
        tip, axis, normal = over.poses(s, xi)
        own = np.arange(len(xi), dtype=np.float64)
        places = places_along(tip, axis, self.tool.stickout, min(LOOK * self.tool.radius, MAX_LOOK))
        whole, met = self._off(Piece(tip, axis, normal, self.tool.radius, on_end=True), places)
        here = np.clip(np.interp(places, own, xi), 0.0, 1.0)
        wanted = binary_dilation(served)[np.rint(here * (ALONG - 1)).astype(np.int64)]
        good = wanted & ~met
        return [part.raised(self.allowance)
                for part in whole.parts(good, places, MIN_PIECE * self.tool.radius)]

    def _off(self, piece: Piece, places: F64) -> tuple[Piece, NDArray[np.bool_]]:
        """A pass as near to the surface as is free, and (m,) bool where no distance frees it.

        Facets of a hollow lie over its surface, and a matched nose is close to it far to both sides.
        """
        farthest = piece.raised(self.lift).at(places)
        least = self.blocked(farthest.tips, farthest.axes)
        for share in OFFS:
            tried = piece.raised(share * self.lift)
            dense = tried.at(places)
            if not self.blocked(dense.tips[~least], dense.axes[~least]).any():
                return tried, least
        return piece.raised(self.lift), least
