"""Cutter locations of a pass with a tool axis of its own at every place.

Notation
    P, n, t : contact, unit normal out of the material, unit direction along the pass
    u       : tool axis, tip to spindle;  C : centre of the ball or of the corner beside the contact

Between two locations the control moves the tip straight and turns the axis on the great circle, by theta. The centre
of a ball r then leaves the straight line between its ends by r (1 - cos(theta / 2)) at most, since the tip lags by r
times the distance of the arc of axes from its chord. Locations are added until that is a tenth of the chordal
tolerance, so a pass keeps the tolerance of ``toolpath.passes.forward_step``. Where a field of axes jumps, the pass
ends.

Arrays are float64. Places are in mm, normals, directions and axes dimensionless unit vectors, in the access frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.tilted_collision import axis_frames, blocked_along
from geometry.tool_body import ToolBody
from toolpath.lines import true_runs
from toolpath.passes.cutter_locations import LOOK, OFFS, chorded, contacts, sides, tips
from toolpath.passes.forward_step import PassProfile
from toolpath.poses import Axes, Blocked, angles_between
from toolpath.scallop_budget import SWING_SHARE, TIPS_SHARE
from zones.reach.approach_cones import assembly
from zones.reach.assembly import Clearances
from zones.reach.tip_field import LEVEL_TOLERANCE

ROUNDS = 16  # of halving stretches between which the axis turns too much
MAX_PARTS = 1000  # parts of one step
FADES = 0.2  # level part of a normal: with less of it the tool tilts less


@dataclass(frozen=True, eq=False)
class Posed:
    """Cutter locations of a pass.

    pieces : tips, mm, and unit axes, both (k, 3) float64, of each piece that is free
    left   : from where to where along the pass, mm, the tool cannot go, or the field of axes jumps
    """

    pieces: tuple[tuple[F64, F64], ...]
    left: tuple[tuple[float, float], ...]

    def reversed(self) -> Posed:
        """The pass in the other direction; ``left`` keeps its order."""
        return Posed(tuple((tip[::-1], axis[::-1]) for tip, axis in reversed(self.pieces)), self.left)


def leaned(angle: float) -> Axes:
    """Field of axes: Z, tilted by an angle, rad, to the side that a wall faces.

    The tilt shrinks where the surface is within 11.5 degrees of level, to 0 on level places. So the field does not jump
    over a crest.
    """
    def axes(_contact: F64, normal: F64, _way: F64) -> F64:
        size = np.linalg.norm(normal[:, :2], axis=1)
        side = normal[:, :2] / np.maximum(size, 1e-12)[:, None]
        lean = angle * np.minimum(size / FADES, 1.0)
        return np.column_stack([np.sin(lean)[:, None] * side, np.cos(lean)])

    return axes


def lead_and_tilt(lead: float, tilt: float) -> Axes:
    """Field of axes: the normal, tilted forward along the pass by ``lead`` and then to its right by ``tilt``, both
    rad."""
    def axes(_contact: F64, normal: F64, way: F64) -> F64:
        right = np.cross(way, normal)
        ahead = np.cos(lead) * normal + np.sin(lead) * way
        return np.asarray(np.cos(tilt) * ahead + np.sin(tilt) * right)

    return axes


def enters(tree: TriangleTree, tool: ToolBody, clear: Clearances, allowance: float = 0.0) -> Blocked:
    """Whether a tool enters a part.

    tree      : TriangleTree of part and fixtures
    allowance : mm, to leave on them
    """
    bodies = assembly(tool, clear, allowance)

    def blocked(tip: F64, axis: F64) -> NDArray[np.bool_]:
        frames = axis_frames(axis)
        own = np.einsum("kij,kj->ki", frames, tip) + [0.0, 0.0, LEVEL_TOLERANCE]
        return blocked_along(tree, frames, np.arange(len(tip)), own, bodies)

    return blocked


def posed(profile: PassProfile, ends: F64, tool: ToolBody, axes: Axes, blocked: Blocked, tolerance: float,
          off: float = 0.0) -> Posed:
    """The locations of a pass, as far as the tool is free.

    profile   : PassProfile of the pass
    ends      : (n,) float64, mm, distances along the pass of its locations
    tool      : ToolBody, a ball or a bull nose
    axes      : field of tool axes
    blocked   : whether the tool enters something; it is called at least every quarter radius, 0.25 mm at most, of the
                way of tip and far end
    tolerance : mm, chordal, of the pass
    off       : mm, distance along the normal that a tip may stand off where that frees it (facets of the part)

    Raises
    ------
    GeometryError
        Code 'bad_axis': the field gives no axis somewhere.
    """
    room = 2.0 * float(np.arccos(max(1.0 - SWING_SHARE * tolerance / tool.radius, -1.0)))
    looks = np.linspace(0.0, profile.length, int(np.ceil(profile.length / min(LOOK, 0.25 * tool.radius))) + 1)
    ends = _turned_through(profile, np.unique(np.concatenate([ends, looks])), axes, room, ends)
    if tool.radius > tool.corner_radius:
        ends = chorded(ends, lambda w: _located(profile, w, tool, axes)[2], TIPS_SHARE * tolerance)
    high = tool.stickout + sum(h.length for h in tool.holder)
    swing = min(room, min(LOOK, 0.25 * tool.radius) / high)  # of the far end of the tool between two checks
    way = _turned_through(profile, np.unique(np.concatenate([ends, looks])), axes, swing)
    normal, axis, tip = _located(profile, way, tool, axes)
    met = blocked(tip, axis)
    for share in OFFS if off > 0.0 else ():
        k = np.flatnonzero(met)
        if not len(k):
            break
        away = tip[k] + share * off * normal[k]
        free = ~blocked(away, axis[k])
        tip[k[free]], met[k[free]] = away[free], False
    jumps = angles_between(axis) > swing
    pieces, left = [], []
    kept = np.isin(way, ends)
    stop = [k + 1 for k in np.flatnonzero(jumps).tolist()]
    for a, b in zip([0, *stop], [*stop, len(way)], strict=True):
        for i, j in true_runs(~met[a:b]):
            rows = np.arange(a + i, a + j)
            rows = rows[kept[rows] | (rows == a + i) | (rows == a + j - 1)]
            if len(rows) > 1:
                pieces.append((tip[rows], axis[rows]))
    for i, j in true_runs(met[1:] | met[:-1] | jumps):
        left.append((float(way[i]), float(way[j])))
    return Posed(tuple(pieces), tuple(left))


def _located(profile: PassProfile, way: F64, tool: ToolBody, axes: Axes) -> tuple[F64, F64, F64]:
    """Normals, tool axes and tips (k, 3) at ways (k,) mm."""
    contact, normal, axis = wanted_axes(profile, way, axes)
    side = sides(profile, way, axis) if tool.radius > tool.corner_radius else None
    return normal, axis, tips(contact, normal, tool, axis, side)


def wanted_axes(profile: PassProfile, way: F64, axes: Axes) -> tuple[F64, F64, F64]:
    """Contacts, mm, unit normals and unit axes of a field along a pass, each (k, 3) float64, access frame.

    way : (k,) float64, mm, distances along the pass

    Raises
    ------
    GeometryError
        Code 'bad_axis': the field gives no axis somewhere.
    """
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
                            measured=None, limit="finite", remedy="give an axis of nonzero length everywhere")
    return contact, normal, axis


def _turned_through(profile: PassProfile, looks: F64, axes: Axes, room: float, first: F64 | None = None) -> F64:
    """Distances along a pass, with more between them, until neighbouring axes turn by ``room`` rad at most or jump.

    looks : (n,) mm, close together: over a long step the axis may turn back and forth
    first : (k,) mm, to begin with; ``looks`` where None
    """
    out = looks
    if first is not None:
        turned = np.concatenate([[0.0], np.cumsum(angles_between(wanted_axes(profile, looks, axes)[2]))])
        parts = np.clip(np.ceil(np.diff(np.interp(first, looks, turned)) / room), 1, MAX_PARTS).astype(np.int64)
        climb = turned + 1e-12 * looks  # so that it can be turned round where the axis stands
        low, high = (np.interp(e, looks, climb) for e in (first[:-1], first[1:]))
        inner = [np.interp(a + (b - a) * np.arange(n) / n, climb, looks)
                 for a, b, n in zip(low, high, parts, strict=True)]
        out = np.unique(np.concatenate([first, *inner]))
    for _ in range(ROUNDS):  # between the looks the axis may turn more
        over = angles_between(wanted_axes(profile, out, axes)[2]) > room
        if not over.any():
            break
        out = np.unique(np.concatenate([out, 0.5 * (out[1:] + out[:-1])[over]]))
    return out
