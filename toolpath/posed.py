"""Cutter locations of a pass with a tool axis of its own at every place.

Notation
    P, n, t : contact, unit normal out of the material, unit way along the pass
    u       : tool axis, tip to spindle;  C : centre of the ball or of the corner beside the contact

Between two locations the control takes the tip straight and turns the axis on the great circle, by theta. The centre of
a ball r then leaves the straight way between its ends by r (1 - cos(theta / 2)) at most, for the tip lags by r times
what the arc of axes is off its chord. Locations are put in until that is a tenth of the chordal tolerance, so a pass
keeps what ``toolpath.forward`` gave it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.bvh import TriangleTree
from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.tilted import axis_frames, blocked_along
from geometry.toolbody import ToolBody
from toolpath.forward import Profile
from toolpath.levels import true_runs
from toolpath.locations import LOOK, OFFS, contacts, tips
from zones.approach import assembly
from zones.reach import LEVEL_TOLERANCE, Clearances

SWING_SHARE = 0.1  # of the chordal tolerance: what turning between two locations may add
ROUNDS = 10
MOST_PARTS = 1000  # a step is divided into at most so many
UPRIGHT = 1e-9  # of a normal across Z: what is less does not say to which side to lean

Axes = Callable[[F64, F64, F64], F64]
"""Tool axes (k, 3), unit, at contacts (k, 3) mm with normals and ways along the pass (k, 3), both unit."""

Blocked = Callable[[F64, F64], NDArray[np.bool_]]
"""(k,) bool: whether the tool enters something, with its tip at (k, 3) mm and axes (k, 3)."""


@dataclass(frozen=True, eq=False)
class Posed:
    """A pass as the tool can walk it.

    pieces : tips (k, 3) float64 mm and axes (k, 3) float64, unit, of each piece that is free
    left   : from where to where along the pass (mm) the tool cannot go
    """

    pieces: tuple[tuple[F64, F64], ...]
    left: tuple[tuple[float, float], ...]

    def reversed(self) -> Posed:
        """The pass walked the other way; ``left`` stays as it is."""
        return Posed(tuple((tip[::-1], axis[::-1]) for tip, axis in reversed(self.pieces)), self.left)


def leaned(angle: float) -> Axes:
    """Z, leaned by an angle (rad) to the side a wall looks to; not where the surface lies level."""
    def axes(_contact: F64, normal: F64, _way: F64) -> F64:
        size = np.linalg.norm(normal[:, :2], axis=1)
        side = normal[:, :2] / np.maximum(size, UPRIGHT)[:, None]
        lean = np.where(size > UPRIGHT, angle, 0.0)
        return np.column_stack([np.sin(lean)[:, None] * side, np.cos(lean)])

    return axes


def lead_and_tilt(lead: float, tilt: float) -> Axes:
    """The normal, leaned forwards along the pass by ``lead`` and then to its right by ``tilt`` (rad)."""
    def axes(_contact: F64, normal: F64, way: F64) -> F64:
        right = np.cross(way, normal)
        ahead = np.cos(lead) * normal + np.sin(lead) * way
        return np.asarray(np.cos(tilt) * ahead + np.sin(tilt) * right)

    return axes


def enters(tree: TriangleTree, tool: ToolBody, clear: Clearances, allowance: float = 0.0) -> Blocked:
    """Whether a tool enters a part; tree : of part and fixtures; allowance : mm to leave on them."""
    bodies = assembly(tool, clear, allowance)

    def blocked(tip: F64, axis: F64) -> NDArray[np.bool_]:
        frames = axis_frames(axis)
        own = np.einsum("kij,kj->ki", frames, tip) + [0.0, 0.0, LEVEL_TOLERANCE]
        return blocked_along(tree, frames, np.arange(len(tip)), own, bodies)

    return blocked


def posed(profile: Profile, ends: F64, tool: ToolBody, axes: Axes, blocked: Blocked, tolerance: float,
          off: float = 0.0) -> Posed:
    """The locations of a pass, as far as the tool is free.

    profile   : Profile of the pass; ends (n,) float64, mm, the ways at which it is located
    tool      : ToolBody, a ball or a bull nose
    axes      : the field of tool axes
    blocked   : whether the tool enters something; asked every quarter of a radius, 0.25 mm at most
    tolerance : mm, chordal, of the pass
    off       : mm, up to which a tip may stand off along the normal where that frees it (facets of the part)

    Raises
    ------
    GeometryError
        Code 'bad_axis': the field gives none somewhere.
    """
    looks = np.linspace(0.0, profile.length, int(np.ceil(profile.length / min(LOOK, 0.25 * tool.radius))) + 1)
    ways = _swung(profile, ends, looks, tool, axes, SWING_SHARE * tolerance)
    way = np.unique(np.concatenate([ways, looks]))
    contact, normal, axis = _axes(profile, way, axes)
    tip = tips(contact, normal, tool, axis)
    met = blocked(tip, axis)
    for share in OFFS if off > 0.0 else ():
        k = np.flatnonzero(met)
        if not len(k):
            break
        away = tips(contact[k] + share * off * normal[k], normal[k], tool, axis[k])
        free = ~blocked(away, axis[k])
        tip[k[free]], met[k[free]] = away[free], False
    pieces = []
    kept = np.isin(way, ways)
    for i, j in true_runs(~met):
        rows = np.arange(i, j)
        rows = rows[kept[rows] | (rows == i) | (rows == j - 1)]
        if len(rows) > 1:
            pieces.append((tip[rows], axis[rows]))
    return Posed(tuple(pieces), tuple((float(way[max(i - 1, 0)]), float(way[min(j, len(way) - 1)]))
                                      for i, j in true_runs(met)))


def _axes(profile: Profile, way: F64, axes: Axes) -> tuple[F64, F64, F64]:
    """Contacts, normals and tool axes (k, 3) at ways (k,) mm."""
    contact, normal = contacts(profile, way)
    step = 1e-3 * profile.width
    ahead = contacts(profile, np.minimum(way + step, profile.length))[0]
    along = ahead - contacts(profile, np.maximum(way - step, 0.0))[0]
    axis = axes(contact, normal, along / np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None])
    with np.errstate(invalid="ignore", divide="ignore"):
        axis = axis / np.linalg.norm(axis, axis=1)[:, None]
    bad = np.flatnonzero(~np.isfinite(axis).all(axis=1))
    if len(bad):
        at = ", ".join(f"{x:.3f}" for x in contact[bad[0]])
        raise GeometryError(f"there is no tool axis at ({at})", code="bad_axis", subjects=(f"({at})",),
                            measured=None, limit="finite", remedy="give an axis of any length but zero everywhere")
    return contact, normal, axis


def _swung(profile: Profile, ends: F64, looks: F64, tool: ToolBody, axes: Axes, most: float) -> F64:
    """Ways with others between them wherever turning from one to the next moves the centre by over ``most`` mm.

    looks : (n,) mm, ways close together, at which the axis is asked: over a long step it may turn to and fro
    """
    way = np.unique(np.concatenate([ends, looks]))
    axis = _axes(profile, way, axes)[2]
    turn = np.arccos(np.clip((axis[1:] * axis[:-1]).sum(axis=1), -1.0, 1.0))
    turned = np.concatenate([[0.0], np.cumsum(turn)])
    room = 2.0 * np.arccos(max(1.0 - most / tool.radius, -1.0))
    at = np.interp(ends, way, turned)
    parts = np.clip(np.ceil(np.diff(at) / room), 1, MOST_PARTS).astype(np.int64)
    climb = turned + 1e-12 * way  # so that it can be turned round where the axis stands
    low, high = (np.interp(e, way, climb) for e in (ends[:-1], ends[1:]))
    inner = [np.interp(a + (b - a) * np.arange(n) / n, climb, way) for a, b, n in zip(low, high, parts, strict=True)]
    out = np.unique(np.concatenate([ends, *inner]))
    for _ in range(ROUNDS):  # between looks it may turn more than they say
        axis = _axes(profile, out, axes)[2]
        over = np.arccos(np.clip((axis[1:] * axis[:-1]).sum(axis=1), -1.0, 1.0)) > room
        if not over.any():
            break
        out = np.unique(np.concatenate([out, 0.5 * (out[1:] + out[:-1])[over]]))
    return out
