"""Walls finished by the flank of a tool tilted as they are (``toolpath.five_axis.flank_milling``), as motions.

Where a pass would meet an obstacle, or the machine cannot take it, the usual passes finish the wall.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from geometry.errors import GeometryError
from geometry.tool_body import ToolBody
from toolpath.five_axis.flank_milling import ALONG, UP, FlankTolerances, FlankWall, bands
from toolpath.five_axis.oriented_motion import UP_Z, Runs, Surroundings, in_turn
from toolpath.five_axis.oriented_piece import Piece
from toolpath.passes.pass_family import FinishTarget
from toolpath.passes.trimmed_faces import Faces, leveller
from toolpath.plan_settings import CutData, PlanSettings

NAME = "flank"
MIN_SERVED = 0.5  # least share of a wall's lattice in the target
BORDER = 0.02  # share of the target at either border of a band: a few places beyond do not move the border
MIN_LEAN = math.radians(0.5)  # the flank of an upright tool cuts a wall that is less inclined


def flanked(faces: Sequence[Faces], target: FinishTarget, tool: ToolBody, cut: CutData, settings: PlanSettings,
            around: Surroundings, allowance: float) -> Runs:
    """The flank passes over the target.

    faces     : of the zone, exact
    target    : FinishTarget
    around    : Surroundings
    allowance : mm, to leave on the part
    """
    chord = settings.budget.rounding
    wanted = FlankTolerances(settings.scallop_height, chord, chord)
    near = cKDTree(target.points)
    found: list[tuple[str, Piece]] = []
    refused: list[str] = []
    for face in faces:
        try:
            for iso in face.over_square:
                wall = FlankWall(leveller(iso))
                pieces = _pieces(wall, near, target.spacing, tool, wanted, around, allowance)
                if isinstance(pieces, str):
                    refused.append(f"{face.name}: {pieces}")
                    continue
                found += [(face.name, piece) for piece in pieces]
        except GeometryError as refusal:
            refused.append(f"{face.name}: {refusal.message}")
    found.sort(key=lambda one: -one[1].top)  # the neck follows where a flank has been before
    forward = settings.cut_direction.climbs
    made = in_turn([(name, p if forward else p.reversed()) for name, p in found], tool, cut, settings, around)
    return replace(made, refused=tuple(dict.fromkeys([*refused, *made.refused])))


def _pieces(wall: FlankWall, near: cKDTree, spacing: float, tool: ToolBody, wanted: FlankTolerances,
            around: Surroundings, allowance: float) -> list[Piece] | str:
    """The pieces of a wall's passes, from the highest band down, or the reason why there are none."""
    place, normal, eta = wall.lattice(ALONG, UP)
    size = max(wall.length / ALONG, wall.height / UP)
    served = near.query(place.reshape(-1, 3))[0].reshape(UP, ALONG) <= spacing + size
    if served.mean() < MIN_SERVED * np.ptp(eta):
        return f"the zone holds {100.0 * served.mean():.0f} % of the wall, too little for passes along all of it"
    if np.abs(normal[served][:, 2]).max() < math.sin(MIN_LEAN):
        return "the wall is upright, so an upright tool finishes it"
    rows = np.repeat(eta, served.sum(axis=1))
    low, high = (float(np.quantile(rows, q)) for q in (BORDER, 1.0 - BORDER))
    low, high = 0.0 if low < 2.0 / UP else low, 1.0 if high > 1.0 - 2.0 / UP else high
    out: list[Piece] = []
    made = bands(wall, tool, wanted, low, high, allowance)
    if min(float((b.poses(UP)[1] @ UP_Z).min()) for b in made) > math.cos(MIN_LEAN):
        return "the wall is upright, so an upright tool finishes it"
    for band in made:
        mine = served[(eta >= band.low - 1e-9) & (eta <= band.high + 1e-9)].mean(axis=0) > 0.5
        pieces = band.pieces(lambda tip, axis: around.blocked(tip, axis, tool), wanted.chord, mine)
        out += [p.reversed() if _against(p) else p for p in pieces]
    return out or "the tool is nowhere free along the wall"


def _against(piece: Piece) -> bool:
    """Whether the wall is on the left of the way, seen from the spindle: on its right a right-hand cutter climbs."""
    way = np.diff(piece.tips, axis=0)
    left = np.cross(0.5 * (piece.axes[1:] + piece.axes[:-1]), way)
    return float((left * 0.5 * (piece.away[1:] + piece.away[:-1])).sum()) < 0.0
