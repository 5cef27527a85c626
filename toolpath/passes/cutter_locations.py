"""Cutter locations from contacts on a surface, and their repair against the whole part.

Notation
    P, n    : contact and unit normal out of the material; u the tool axis, tip to spindle
    R, r, a : radius and corner radius of the tool, a = R - r
    tip     : P + r n + a f - r u, f the unit direction of n across the axis (a = 0 for a ball): the circle of corner
              centres touches the offset of the surface at r, and f points from there to the axis

Arrays are float64. Places are in mm, normals and axes dimensionless unit vectors, in the access frame.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.lines import thinned, true_runs
from toolpath.passes.dragged_path import STEEPEST, Limit
from toolpath.passes.forward_step import PassProfile
from toolpath.scallop_budget import TIPS_SHARE

FLAT = 1e-6  # part of a normal across the axis: with less the place is level, and a flat end touches it anywhere
LOOK, FINE = 0.25, 0.02  # mm between checks for obstacles, and between checks at one
OFFS = (0.25, 0.5, 1.0)  # shares of the distance that a tip may stand off
ROUNDS = 6  # halvings of a move under the limit before it is left out
FREE = 1e-4  # mm by which the part may stand over a tip and count as the surface itself


def tips(contact: F64, normal: F64, tool: ToolBody, axis: F64 | None = None, side: F64 | None = None) -> F64:
    """Tips of a ball, bull nose or flat that touches places of a surface [Sarkar2015, eq. 3.34].

    contact, normal : (n, 3) float64, mm and unit, access frame
    axis            : (n, 3) or (3,) float64, unit, access frame; +Z where None
    side            : (n, 3) float64, unit, access frame, across the axis: from the contact to the axis of a tool on a
                      level place, where the normal does not define it (``sides``)

    Returns (n, 3) float64, mm, access frame; nan where a bull nose or a flat stands on a level place without ``side``.
    """
    u = np.broadcast_to(np.array([0.0, 0.0, 1.0]) if axis is None else np.asarray(axis, np.float64), contact.shape)
    r, a = min(tool.corner_radius, tool.radius), tool.radius - min(tool.corner_radius, tool.radius)
    out = contact + r * normal - r * u
    if a > 1e-12:
        across = normal - (normal * u).sum(axis=1)[:, None] * u
        size = np.linalg.norm(across, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            across = np.where(size > FLAT, 1.0 / size, np.nan)[:, None] * across
        out = out + a * (across if side is None else np.where((size > FLAT)[:, None], across, side))
    return np.asarray(out)


def sides(profile: PassProfile, way: F64, axis: F64 | None = None) -> F64:
    """Directions from the contact to the axis of a bull nose or a flat, at level places of a pass.

    At a level place any point under the flat end may touch. The tool keeps the side of the nearest place of the pass
    that is not level; on a pass that is level throughout it is on the left.

    way  : (n,) float64, mm, distances along the pass
    axis : (n, 3) float64, unit, access frame, at those places; +Z where None

    Returns (n, 3) float64, unit, access frame.
    """
    u = np.broadcast_to(np.array([0.0, 0.0, 1.0]) if axis is None else axis, (len(way), 3))
    contact, normal = contacts(profile, way)
    across = normal - (normal * u).sum(axis=1)[:, None] * u
    known = np.flatnonzero(np.linalg.norm(across, axis=1) > FLAT)
    if axis is None:  # the result must not depend on the other places
        known = np.flatnonzero(np.linalg.norm(profile.normal[:, :2], axis=1) > FLAT)
        across, at = profile.normal * [1.0, 1.0, 0.0], profile.ways
    else:
        at = way
    if len(known):
        out = across[known[nearest_of(at[known], way)]]
        out = out - (out * u).sum(axis=1)[:, None] * u
    else:
        step = 1e-3 * profile.width
        ahead = contacts(profile, np.minimum(way + step, profile.length))[0]
        out = np.cross(u, ahead - contacts(profile, np.maximum(way - step, 0.0))[0])
    size = np.linalg.norm(out, axis=1)
    other = np.cross(u, np.where(np.abs(u[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    other /= np.linalg.norm(other, axis=1)[:, None]
    return np.asarray(np.where(size[:, None] > 1e-12, out / np.maximum(size, 1e-300)[:, None], other))


def nearest_of(ascending: F64, values: F64) -> NDArray[np.int64]:
    """Which of ascending numbers is nearest to each value, (n,) int64, index.

    ascending : (k,) float64, dimensionless or any unit
    values    : (n,) float64, in the same unit
    """
    k = np.clip(np.searchsorted(ascending, values), 1, max(len(ascending) - 1, 1))
    k = np.minimum(k, len(ascending) - 1)
    low = np.maximum(k - 1, 0)
    return np.where(values - ascending[low] <= ascending[k] - values, low, k)


def chorded(ways: F64, at: Callable[[F64], F64], tolerance: float) -> F64:
    """Distances along a pass with more between them, until the places half way and at quarters lie near the chords.

    ways      : (n,) float64, mm
    at        : takes distances along the pass, (n,) float64, mm; gives the places there, (n, 3) float64, mm, access
                frame
    tolerance : mm

    Returns (m,) float64, mm, those of ``ways`` among them.

    A tip that keeps to chords of its path puts the tool no farther than that from its place. A ball does not need it,
    since its steps are measured on its swept volume. The chord crosses jumps, from one side of a level crest to the
    other.
    """
    for _ in range(ROUNDS):
        a, b = at(ways[:-1]), at(ways[1:])
        over = np.zeros(len(ways) - 1, np.bool_)
        for share in (0.25, 0.5, 0.75):
            off = at(ways[:-1] + share * np.diff(ways)) - a - share * (b - a)
            over |= np.linalg.norm(off, axis=1) > tolerance
        if not over.any():
            break
        ways = np.sort(np.concatenate([ways, 0.5 * (ways[1:] + ways[:-1])[over]]))
    return ways


def lifted(profile: PassProfile, ends: F64, tool: ToolBody, limit: Limit, tolerance: float,
           off: float = 0.0, max_rise: float | None = None) -> tuple[list[F64], bool]:
    """The tips of an upright pass, moved off the surface or raised where the part stands over them.

    profile   : PassProfile of the pass
    ends      : (n,) float64, mm, distances along the pass of its locations
    limit     : lowest tip heights over places in plan (``toolpath.passes.dragged_path``)
    tolerance : mm, of the raised path
    off       : mm, distance along the normal that a tip may stand off first: facets of a wall may stand over its
                surface, and beside a wall the limit is its top
    max_rise  : mm, that a tip may be raised, the radius of the tool where None; 0 on walls, where a raised tip cuts
                nothing of its pass

    Returns
    -------
    Pieces (k, 3) float64, mm, access frame, and whether the part stood in the way anywhere. There the path follows the
    limit, and other passes take what it leaves. Where the limit is higher than ``max_rise``, or jumps, the pass breaks.
    """
    if tool.radius > tool.corner_radius:
        ends = chorded(ends, lambda w: _tips(profile, w, tool), TIPS_SHARE * tolerance)
    looks = np.linspace(0.0, profile.length, int(np.ceil(profile.length / min(LOOK, 0.25 * tool.radius))) + 1)
    way = np.unique(np.concatenate([ends, profile.ways, looks]))
    made, high = _against(profile, way, tool, limit, off)
    over = _ended(high > made[:, 2] + FREE)
    if not over.any():
        return [made[np.isin(way, ends)]], False
    # a tip that is not raised keeps its own place
    kept = np.isin(way, ends) | over
    fresh = _between(way, over[:-1] & over[1:])
    tip, up = _raised(*_against(profile, fresh, tool, limit, off))
    made, rise = _raised(made[kept], high[kept])
    way, made, rise = _together(way[kept], made, rise, fresh, tip, up)
    under = _under(made, rise, limit, TIPS_SHARE * tolerance, np.ones(len(way) - 1, np.bool_))
    for _ in range(ROUNDS):
        if not under.any():
            break
        between = 0.5 * (way[1:] + way[:-1])[under]
        tip, up = _raised(*_against(profile, between, tool, limit, off))
        way, made, rise = _together(way, made, rise, between, tip, up)
        # only the halves of the moves that were under have to be looked at
        under = _under(made, rise, limit, TIPS_SHARE * tolerance, np.repeat(under, under + 1))
    whole = (rise <= (tool.radius if max_rise is None else max_rise)) & np.isfinite(rise)
    steep = np.abs(np.diff(rise)) > STEEPEST * np.diff(way)  # the pass itself may be as steep as it is
    runs = true_runs(whole[1:] & whole[:-1] & ~steep & ~under)
    return [thinned(made[i:j + 1], TIPS_SHARE * tolerance) for i, j in runs], True


def _between(way: F64, parted: NDArray[np.bool_]) -> F64:
    """Distances along a pass between those of way (n,) mm, at most FINE apart where a move (n - 1,) is parted."""
    low, run = way[:-1][parted], np.diff(way)[parted]
    count = np.ceil(run / FINE).astype(np.int64)
    k = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return (np.repeat(low, count) + k * np.repeat(run / count, count))[k > 0]


def _raised(made: F64, high: F64) -> tuple[F64, F64]:
    """Tips (n, 3) raised to the limit ``high`` (n,), and by how much (n,); mm."""
    rise = np.where(high > made[:, 2] + FREE, high - made[:, 2], 0.0)
    return made + rise[:, None] * np.array([0.0, 0.0, 1.0]), rise


def _together(way: F64, made: F64, rise: F64, ways: F64, tips: F64, rises: F64) -> tuple[F64, F64, F64]:
    """Places of a pass and others between them, in their order: ways, tips and by how much they are raised, mm."""
    at = np.searchsorted(way, ways)
    return np.insert(way, at, ways), np.insert(made, at, tips, axis=0), np.insert(rise, at, rises)


def _under(made: F64, rise: F64, limit: Limit, tolerance: float, asked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(n - 1,) bool: moves that are asked for, beside a raised place, and in their middle under the limit by more than
    the tolerance."""
    look = asked & ((rise[1:] > 0.0) | (rise[:-1] > 0.0))
    middle = 0.5 * (made[1:][look] + made[:-1][look])
    out = np.zeros(len(look), np.bool_)
    out[look] = limit(np.ascontiguousarray(middle[:, :2])) > middle[:, 2] + tolerance
    return out


def _against(profile: PassProfile, way: F64, tool: ToolBody, limit: Limit, off: float) -> tuple[F64, F64]:
    """Tips (n, 3) at ways (n,), off the surface where that frees them, and what the part allows there (n,); mm."""
    contact, normal = contacts(profile, way)
    side = sides(profile, way) if tool.radius > tool.corner_radius else None
    made = tips(contact, normal, tool, None, side)
    high = limit(np.ascontiguousarray(made[:, :2]))
    for share in OFFS if off > 0.0 else ():
        k = np.flatnonzero(high > made[:, 2] + FREE)
        if not len(k):
            break
        away = tips(contact[k] + share * off * normal[k], normal[k], tool, None, None if side is None else side[k])
        there = limit(np.ascontiguousarray(away[:, :2]))
        free = there <= away[:, 2] + FREE
        made[k[free]], high[k[free]] = away[free], there[free]
    return made, high


def _tips(profile: PassProfile, way: F64, tool: ToolBody) -> F64:
    """Tips (n, 3) mm of an upright tool at ways (n,) mm."""
    return tips(*contacts(profile, way), tool, None, sides(profile, way))


def contacts(profile: PassProfile, way: F64) -> tuple[F64, F64]:
    """Contacts, mm, and unit normals of a pass, both (n, 3) float64, access frame.

    way : (n,) float64, mm, distances along the pass
    """
    contact = profile.centres(way, 0.0)
    normal = profile.centres(way, 1.0) - contact
    return contact, normal


def _ended(over: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Runs with the place before and after each: raised ways begin and end on the pass."""
    out = over.copy()
    out[1:] |= over[:-1]
    out[:-1] |= over[1:]
    return out
