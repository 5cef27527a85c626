"""Tool axes that reach a place: the approach of samples, and the cone of a zone.

A sample may use an axis if the tool, placed on it along that axis by the contact of ``zones.reach.tip_field``, enters
nothing. Cutting part, shank and holder extend without end along the axis, since the tool comes in along it and the
machine stands behind. Theory: docs/theory/approach.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from geometry.array_checks import finite_points
from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.tilted_collision import axis_frames, blocked_along
from geometry.tool_body import ToolBody
from zones.machinable_area import LEVEL, SEEN
from zones.reach.assembly import Clearances, discs_of
from zones.reach.tip_field import EDGE_SLACK, FLAT_RING, LEVEL_TOLERANCE, contact_tips

GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
CHUNK_PAIRS = 400_000  # pairs of sample and direction in one batch
CANDIDATES = 4000  # axes to try for a cone before the best is refined
ROUNDING = 1e-9  # rad
ARC_RINGS = 8  # of bull noses on each arc of a circle segment mill
SIDE_SLICES = 24  # of the leaning side of a tapered mill


@dataclass(frozen=True, eq=False)
class Cone:
    """A circular cone of tool axes.

    axis       : (3,) float64, unit, from the tip to the spindle
    half_angle : rad; its error is at most ``resolution``
    share      : least share of the area that any tried direction inside the cone reaches
    resolution : rad, largest distance of a direction from the nearest tried one
    """

    axis: F64
    half_angle: float
    share: float
    resolution: float


def directions_over_hemisphere(count: int, *, whole: bool = False) -> F64:
    """Unit vectors spread evenly over the upper half of the sphere, or over the whole sphere.

    count : int, > 0, number of vectors; the first is +Z
    whole : the lower half as well; the last vector is then near -Z

    Returns
    -------
    (count, 3) float64, dimensionless
        A spiral by the golden angle in rings of equal area, in any frame with +Z up; the same for every call.
    """
    k = np.arange(1, count)
    z = 1.0 - (k + 0.5) * (2.0 if whole else 1.0) / count
    rho, turn = np.sqrt(np.maximum(1.0 - z * z, 0.0)), GOLDEN_ANGLE * k
    rest = np.stack([rho * np.cos(turn), rho * np.sin(turn), z], axis=-1)
    return np.vstack([[[0.0, 0.0, 1.0]], rest])


def assembly(tool: ToolBody, clear: Clearances, allowance: float) -> F64:
    """Cutting part, shank and holder in the form of ``geometry.mesh_queries.tilted_collision``, tool frame.

    Returns (k, 3) float64, mm, tool frame: radius, corner radius, height above the tip, all grown by the allowance.
    Bodies above one that is as wide are left out.
    """
    rows = [(tool.radius + allowance, max(tool.corner_radius + allowance, 0.0), -allowance)]
    if tool.arcs is not None:  # bull noses within the arcs that touch them, and the side above
        rows = [(ring + ball + allowance, ball + allowance, high - ball - allowance)
                for ring, high, ball in tool.arcs.inner_balls(ARC_RINGS, tool.flute_length)]
        rows.append((tool.radius + allowance, 0.0, tool.end_height - allowance))
    if tool.taper > 0.0:  # the leaning side as slices that enclose it
        (wide, high), rise = tool.corner_end, tool.flute_length - tool.corner_end[1]
        rows += [(wide + tool.taper * rise * (k + 1) / SIDE_SLICES + allowance, 0.0,
                  high + rise * k / SIDE_SLICES - allowance) for k in range(SIDE_SLICES)]
    for d in sorted(discs_of(tool, clear), key=lambda d: (d.height, -d.radius)):
        if d.radius + allowance > rows[-1][0]:
            rows.append((d.radius + allowance, 0.0, d.height - allowance))
    return np.array(rows)


def approach(tree: TriangleTree, tool: ToolBody, clear: Clearances, points: ArrayLike, normals: ArrayLike,
             directions: ArrayLike, lift: float, allowance: float = 0.0,
             tips: ArrayLike | None = None) -> NDArray[np.bool_]:
    """Tool axes along which the cutting part reaches samples without entering anything.

    tree       : TriangleTree of part and fixtures
    tool       : ToolBody
    clear      : Clearances
    points     : (n, 3) float64, mm, on the surface, frame of the tree
    normals    : (n, 3) float64, dimensionless, out of the material, frame of the tree
    directions : (d, 3) float64, dimensionless, tool axes from the tip to the spindle, frame of the tree
    lift       : mm, distance along the normal within which a touch counts
    allowance  : mm, material to leave on the part: the assembly is grown by it on all sides
    tips       : (n, 3) float64, mm, frame of the tree, from ``zones.reach.tip_field.touchable``: tips that touch the
                 samples along the first direction, tried as well

    Returns
    -------
    (n, d) bool
        Exact for mesh and assembly (holder frusta as enclosing slices), except for 1e-5 mm along the axis. Between 8
        places on each arc of a circle segment mill a little less than its body counts, a few hundredths of a mm.

    Notes
    -----
    The contact is that of ``zones.reach.tip_field.contact_tips`` in the frame of the axis: the highest tip that
    touches. Lower tips touch with the flank, but an obstacle of the highest tip blocks them too. No sideways play is
    required. Under a flat end a sample whose normal is the axis is tried from 17 positions. Reach also aims the flat
    end at free places nearby, on the lattice of the upright tool. Its tips therefore count as well.
    """
    p, n = finite_points(points, 3, "points"), finite_points(normals, 3, "normals")
    frames, bodies = axis_frames(directions), assembly(tool, clear, allowance)
    out = np.zeros((len(p), len(frames)), np.bool_)
    step = max(CHUNK_PAIRS // max(len(frames), 1), 1)
    for lo in range(0, len(p), step):
        rows = slice(lo, lo + step)
        out[rows] = _reached(tree, tool, frames, bodies, p[rows], n[rows], lift + allowance)
    if tips is not None and len(frames):
        known = finite_points(tips, 3, "tips") @ frames[0].T + [0.0, 0.0, LEVEL_TOLERANCE]
        todo = np.flatnonzero(~out[:, 0] & (n @ frames[0, 2] > SEEN))
        out[todo, 0] = ~blocked_along(tree, frames, np.zeros(len(todo), np.int64), known[todo], bodies)
    return out


def _reached(tree: TriangleTree, tool: ToolBody, frames: F64, bodies: F64, p: F64, n: F64,
             lift: float) -> NDArray[np.bool_]:
    """(n, d) bool of ``approach`` for one batch of pairs."""
    sample, frame = np.nonzero(n @ frames[:, 2].T > SEEN)
    turn = frames[frame]
    points, normals = np.einsum("qij,qj->qi", turn, p[sample]), np.einsum("qij,qj->qi", turn, n[sample])
    tips = contact_tips(tool, points, normals, lift)
    tips[:, 2] += LEVEL_TOLERANCE
    free = ~blocked_along(tree, frames, frame, tips, bodies)
    flat = tool.flat_radius
    level = normals[:, 2] > LEVEL
    for reach in (0.5 * flat, max(flat - EDGE_SLACK, 0.9 * flat)) if flat > 0 else ():
        for side in FLAT_RING:
            todo = np.flatnonzero(level & ~free)
            trial = tips[todo].copy()
            trial[:, :2] = points[todo, :2] + reach * side
            free[todo] = ~blocked_along(tree, frames, frame[todo], trial, bodies)
    out = np.zeros((len(p), len(frames)), np.bool_)
    out[sample[free], frame[free]] = True
    return out


def resolution_of(directions: ArrayLike) -> float:
    """Largest distance of a direction from the nearest of a set, rad.

    directions : (d, 3) float64, dimensionless, any length and frame; where all have z >= 0, only the upper half of the
                 sphere counts

    Notes
    -----
    It is the radius of the widest empty cap. The rim of the cap runs through the corners of a facet of the convex hull,
    whose distance from the centre is the cosine. The mirror image closes the upper half. Too few directions for a hull
    give half a turn, or a whole one.
    """
    unit = _units(directions)
    upper = _upper(unit)
    try:
        hull = ConvexHull(np.vstack([unit, unit * [1.0, 1.0, -1.0]]) if upper else unit)
    except (QhullError, ValueError):
        return 0.5 * math.pi if upper else math.pi
    return float(np.arccos(np.clip(-hull.equations[:, 3].max(), -1.0, 1.0)))


def zone_cone(reachable: NDArray[np.bool_], area: F64, directions: ArrayLike, share: float = 0.98,
              holds_first: bool = False) -> Cone | None:
    """Largest circular cone of axes, each of which reaches nearly all of a zone.

    reachable  : (n, d) bool, from ``approach``
    area       : (n,) float64, mm², of each sample
    directions : (d, 3) float64, dimensionless, frame of the samples; where none points down, axes that point down do
                  not reach
    share      : least share of the area that an axis must reach
    holds_first : take the largest cone that contains the first direction, or that direction alone where it has no room

    Returns
    -------
    Cone, or None where no direction reaches the share; with ``holds_first``, where the first direction does not.

    Notes
    -----
    The nearest tried direction that fails is at an angle b from the axis. A true obstacle at least two resolutions wide
    is then between b and b - 2 resolutions away; the result is the middle. A thinner obstacle can lie between the
    directions, so a path inside the cone is still checked. Of equal cones the one nearest to +Z wins.
    """
    unit, weight = _units(directions), np.asarray(area, dtype=np.float64)
    got = weight @ np.asarray(reachable, dtype=np.float64) / max(float(weight.sum()), 1e-300)
    good = got >= share - 1e-12
    if not (good[:1] if holds_first else good).any():
        return None
    spacing = resolution_of(unit)
    axis, room = _widest(unit, good, spacing, unit[0] if holds_first else None)
    inside = good & (unit @ axis >= math.cos(min(room + ROUNDING, math.pi)))
    least = float(got[inside].min()) if inside.any() else float(got[good].max())
    return Cone(axis, room, least, spacing)


def _units(directions: ArrayLike) -> F64:
    return axis_frames(directions)[:, 2]


def _upper(unit: F64) -> bool:
    return bool((unit[:, 2] > -ROUNDING).all())


def _widest(unit: F64, good: NDArray[np.bool_], spacing: float, contained: F64 | None) -> tuple[F64, float]:
    """Axis and half angle of the widest cone: the best of evenly spread axes, refined by halving steps.

    contained : (3,) an axis that the cone must contain, or None
    """
    bad, upper = unit[~good], _upper(unit)
    if not len(bad) and not upper:
        return np.array([0.0, 0.0, 1.0]), math.pi

    def room(axes: F64) -> F64:
        out = free(axes)
        if contained is None:
            return out
        return np.where(np.arccos(np.clip(axes @ contained, -1.0, 1.0)) <= out, out, -math.inf)

    def free(axes: F64) -> F64:
        out = np.full(len(axes), math.inf)
        for at in range(0, len(axes), 1000) if len(bad) else ():
            cosine = np.clip((axes[at:at + 1000] @ bad.T).max(axis=1), -1.0, 1.0)
            out[at:at + 1000] = np.arccos(cosine) - spacing
        return np.minimum(out, np.arcsin(np.clip(axes[:, 2], -1.0, 1.0))) if upper else out

    axes = np.vstack([directions_over_hemisphere(CANDIDATES, whole=not upper), unit[good]])
    best, width = _first(axes, room(axes))
    step = spacing
    ring = np.arange(16) * math.pi / 8
    while step > ROUNDING:
        frame = axis_frames(best[None])[0]
        around = np.stack([math.sin(step) * np.cos(ring), math.sin(step) * np.sin(ring),
                           np.full(16, math.cos(step))], axis=-1) @ frame
        candidate, wider = _first(around, room(around))
        if wider > width + ROUNDING:
            best, width = candidate, wider
        else:
            step *= 0.5
    if width <= 0.0:  # no axis has room: take the axis to contain, or the direction farthest from failing ones
        best, width = (contained, 0.0) if contained is not None else _first(unit[good], free(unit[good]))
    return best, max(width, 0.0)


def _first(axes: F64, width: F64) -> tuple[F64, float]:
    """The widest cone; of equal cones the one nearest to +Z."""
    most = np.flatnonzero(width >= width.max() - ROUNDING)
    k = int(most[np.argmax(axes[most, 2])])
    return axes[k], float(width[k])
