"""Cutter locations from contacts on a surface, and their repair against the whole part.

Notation
    P, n    : contact and unit normal out of the material; u the tool axis, tip to spindle
    R, r, a : radius and corner radius of the tool, a = R - r
    tip     : P + r n + a f - r u, f the unit way of n across the axis (a = 0 for a ball): the circle of corner centres
              touches the offset of the surface at r, and f points from there to the axis
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.toolbody import ToolBody
from toolpath.follow import STEEPEST, Limit
from toolpath.forward import Profile
from toolpath.levels import thinned, true_runs

FLAT = 1e-6  # of a normal across the axis: what is less is a level place, which a flat end touches anywhere
LOOK, FINE = 0.25, 0.02  # mm between looks at what stands in the way, and where something does
OFFS = (0.25, 0.5, 1.0)  # of the way a tip may stand off
ROUNDS = 6  # a move under the limit is halved so often, and then left out
FREE = 1e-4  # mm, by which the part may stand over a tip and count as the surface itself


def tips(contact: F64, normal: F64, tool: ToolBody, axis: F64 | None = None) -> F64:
    """Tips of a tool that touches places of a surface (3.34 of papers/000, for a ball, a bull nose and a flat).

    contact, normal : (n, 3) float64, mm and unit
    axis            : (n, 3) or (3,) float64, unit; +Z where None

    Returns (n, 3) float64, mm; nan where a bull nose or a flat stands on a level place, which does not say where.
    """
    u = np.broadcast_to(np.array([0.0, 0.0, 1.0]) if axis is None else np.asarray(axis, np.float64), contact.shape)
    r, a = min(tool.corner_radius, tool.radius), tool.radius - min(tool.corner_radius, tool.radius)
    out = contact + r * normal - r * u
    if a > 1e-12:
        across = normal - (normal * u).sum(axis=1)[:, None] * u
        size = np.linalg.norm(across, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            out = out + a * np.where(size > FLAT, 1.0 / size, np.nan)[:, None] * across
    return np.asarray(out)


def lifted(profile: Profile, ends: F64, tool: ToolBody, limit: Limit, tolerance: float,
           off: float = 0.0, most: float | None = None) -> tuple[list[F64], bool]:
    """The tips of a pass, upright, moved off the surface or raised where the part stands over them.

    profile   : Profile of the pass; ends (n,) float64, mm, the ways at which it is located
    limit     : lowest tip heights over places in plan (``toolpath.follow``)
    tolerance : mm, of the raised way
    off       : mm, up to which a tip may stand off along the normal first: facets of a wall may stand over its surface,
                and beside a wall the limit is its top
    most      : mm, up to which a tip is raised, the radius of the tool where None; 0 on walls, where a raised tip cuts
                nothing that the pass is there for

    Returns
    -------
    Pieces (k, 3) float64, mm, and whether the part stood in the way anywhere: then the way follows the limit there, and
    what it leaves at those contacts is for others. Where the limit is higher than ``most``, or jumps, the pass is
    broken.
    """
    looks = np.linspace(0.0, profile.length, int(np.ceil(profile.length / min(LOOK, 0.25 * tool.radius))) + 1)
    way = np.unique(np.concatenate([ends, profile.ways, looks]))
    made, high = _against(profile, way, tool, limit, off)
    over = _ended(high > made[:, 2] + FREE)
    if not over.any():
        return [made[np.isin(way, ends)]], False
    more = [np.linspace(a, b, int(np.ceil((b - a) / FINE)) + 1)
            for a, b, both in zip(way[:-1], way[1:], over[:-1] & over[1:], strict=True) if both]
    # what is not raised keeps its own places
    way = np.unique(np.concatenate([way[np.isin(way, ends) | over], *more]))
    made, rise = _raised(profile, way, tool, limit, off)
    for _ in range(ROUNDS):
        under = _under(made, rise, limit, 0.5 * tolerance)
        if not under.any():
            break
        between = 0.5 * (way[1:] + way[:-1])[under]
        tip, up = _raised(profile, between, tool, limit, off)
        order = np.argsort(np.concatenate([way, between]), kind="stable")
        way, rise = np.concatenate([way, between])[order], np.concatenate([rise, up])[order]
        made = np.concatenate([made, tip])[order]
    whole = (rise <= (tool.radius if most is None else most)) & np.isfinite(rise)
    steep = np.abs(np.diff(rise)) > STEEPEST * np.diff(way)  # the pass itself may be as steep as it is
    runs = true_runs(whole[1:] & whole[:-1] & ~steep & ~_under(made, rise, limit, 0.5 * tolerance))
    return [thinned(made[i:j + 1], 0.5 * tolerance) for i, j in runs], True


def _raised(profile: Profile, way: F64, tool: ToolBody, limit: Limit, off: float) -> tuple[F64, F64]:
    """Tips (n, 3) at ways (n,), raised to the limit, and by how much (n,); mm."""
    made, high = _against(profile, way, tool, limit, off)
    rise = np.where(high > made[:, 2] + FREE, high - made[:, 2], 0.0)
    return made + rise[:, None] * np.array([0.0, 0.0, 1.0]), rise


def _under(made: F64, rise: F64, limit: Limit, tolerance: float) -> NDArray[np.bool_]:
    """(n - 1,) bool: moves beside a raised place whose middle is under the limit by more than the tolerance."""
    middle = 0.5 * (made[1:] + made[:-1])
    look = (rise[1:] > 0.0) | (rise[:-1] > 0.0)
    out = np.zeros(len(middle), np.bool_)
    out[look] = limit(np.ascontiguousarray(middle[look, :2])) > middle[look, 2] + tolerance
    return out


def _against(profile: Profile, way: F64, tool: ToolBody, limit: Limit, off: float) -> tuple[F64, F64]:
    """Tips (n, 3) at ways (n,), off the surface where that frees them, and what the part allows there (n,); mm."""
    contact, normal = contacts(profile, way)
    made = tips(contact, normal, tool)
    high = limit(np.ascontiguousarray(made[:, :2]))
    for share in OFFS if off > 0.0 else ():
        k = np.flatnonzero(high > made[:, 2] + FREE)
        if not len(k):
            break
        away = tips(contact[k] + share * off * normal[k], normal[k], tool)
        there = limit(np.ascontiguousarray(away[:, :2]))
        free = there <= away[:, 2] + FREE
        made[k[free]], high[k[free]] = away[free], there[free]
    return made, high


def contacts(profile: Profile, way: F64) -> tuple[F64, F64]:
    """Contacts (n, 3) mm and unit normals (n, 3) of a pass at ways (n,) mm."""
    contact = profile.centres(way, 0.0)
    normal = profile.centres(way, 1.0) - contact
    return contact, normal


def _ended(over: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Runs with the place before and after each: raised ways begin and end on the pass."""
    out = over.copy()
    out[1:] |= over[:-1]
    out[:-1] |= over[1:]
    return out
