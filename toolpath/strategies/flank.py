"""Walls finished by the flank of a tool that leans as they do (``toolpath.five_axis.flank_milling``), as motions with ways in and out.

Where a pass would meet something, or the machine cannot take it, the wall is left to the usual passes.
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
MIN_SERVED = 0.5  # of a wall's lattice: a wall of which less is wanted is left to others
BORDER = 0.02  # of what is wanted, at either border of a band: a few places beyond it do not move it
MIN_LEAN = math.radians(0.5)  # a wall that leans less is cut as well by the flank of an upright tool


def flanked(faces: Sequence[Faces], target: FinishTarget, tool: ToolBody, cut: CutData, settings: PlanSettings,
            around: Surroundings, allowance: float) -> Runs:
    """The flank passes for what of walls is wanted.

    faces     : of the zone, exact
    target    : Target; walls are wanted where its points are
    around    : Surroundings
    allowance : mm, to leave on the part
    """
    wanted = FlankTolerances(settings.scallop_height, 0.25 * settings.chordal_tolerance, 0.25 * settings.chordal_tolerance)
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
    found.sort(key=lambda one: -one[1].top)  # the neck goes where a flank has been before
    forward = settings.cut_direction.climbs
    made = in_turn([(name, p if forward else p.reversed()) for name, p in found], tool, cut, settings, around)
    return replace(made, refused=tuple(dict.fromkeys([*refused, *made.refused])))


def _pieces(wall: FlankWall, near: cKDTree, spacing: float, tool: ToolBody, wanted: FlankTolerances, around: Surroundings,
            allowance: float) -> list[Piece] | str:
    """The pieces of a wall's passes, from the highest band down, or why there are none, in words."""
    place, normal, eta = wall.lattice(ALONG, UP)
    size = max(wall.length / ALONG, wall.height / UP)
    asked = near.query(place.reshape(-1, 3))[0].reshape(UP, ALONG) <= spacing + size
    if asked.mean() < MIN_SERVED * np.ptp(eta):
        return f"{100.0 * asked.mean():.0f} % of it is wanted, too little for a pass along the whole"
    if np.abs(normal[asked][:, 2]).max() < math.sin(MIN_LEAN):
        return "it is upright, and so would the tool be"
    rows = np.repeat(eta, asked.sum(axis=1))
    low, high = (float(np.quantile(rows, q)) for q in (BORDER, 1.0 - BORDER))
    low, high = 0.0 if low < 2.0 / UP else low, 1.0 if high > 1.0 - 2.0 / UP else high
    out: list[Piece] = []
    made = bands(wall, tool, wanted, low, high, allowance)
    if min(float((b.poses(UP)[1] @ UP_Z).min()) for b in made) > math.cos(MIN_LEAN):
        return "it is upright, and so would the tool be"
    for band in made:
        mine = asked[(eta >= band.low - 1e-9) & (eta <= band.high + 1e-9)].mean(axis=0) > 0.5
        pieces = band.pieces(lambda tip, axis: around.blocked(tip, axis, tool), wanted.chord, mine)
        out += [p.reversed() if _against(p) else p for p in pieces]
    return out or "the tool is nowhere free along it"


def _against(piece: Piece) -> bool:
    """Whether the wall is not on the right of the way, seen from the spindle: there a right-hand cutter climbs."""
    way = np.diff(piece.tips, axis=0)
    left = np.cross(0.5 * (piece.axes[1:] + piece.axes[:-1]), way)
    return float((left * 0.5 * (piece.away[1:] + piece.away[:-1])).sum()) < 0.0
