"""From which directions a tool gets at a place: the approach of samples, and the cone of a zone.

An axis may be used for a sample if the tool, stood on it along that axis by the contact of ``zones.reach.tip_field``, enters
nothing. Cutting part, shank and holder go on without end along the axis: the tool comes in along it, and the machine
stands behind. Theory: docs/theory/approach.md.
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
CHUNK_PAIRS = 400_000  # pairs of sample and direction asked in one go
CANDIDATES = 4000  # axes tried for a cone before the best is refined
ROUNDING = 1e-9  # rad


@dataclass(frozen=True, eq=False)
class Cone:
    """A circular cone of tool axes.

    axis       : (3,) float64, unit, from the tip to the spindle
    half_angle : rad; wrong by ``resolution`` at most, up or down
    share      : of the area, the least that any tried direction inside the cone reaches
    resolution : rad, no direction of the set is farther than this from a tried one
    """

    axis: F64
    half_angle: float
    share: float
    resolution: float


def directions_over_hemisphere(count: int, *, whole: bool = False) -> F64:
    """Unit vectors spread evenly over the upper half of the sphere, or over all of it.

    count : int, > 0, how many; the first is +Z
    whole : the other half as well; the last is then near -Z

    Returns
    -------
    (count, 3) float64
        A spiral by the golden angle in rings of equal area, the same every time.
    """
    k = np.arange(1, count)
    z = 1.0 - (k + 0.5) * (2.0 if whole else 1.0) / count
    rho, turn = np.sqrt(np.maximum(1.0 - z * z, 0.0)), GOLDEN_ANGLE * k
    rest = np.stack([rho * np.cos(turn), rho * np.sin(turn), z], axis=-1)
    return np.vstack([[[0.0, 0.0, 1.0]], rest])


def assembly(tool: ToolBody, clear: Clearances, allowance: float) -> F64:
    """Cutting part, shank and holder as ``geometry.mesh_queries.tilted_collision`` wants them.

    Returns (k, 3) float64, mm: radius, corner radius, height above the tip, all grown by the allowance. Bodies that
    stand in the shadow of one as wide below them are left out.
    """
    rows = [(tool.radius + allowance, max(tool.corner_radius + allowance, 0.0), -allowance)]
    for d in sorted(discs_of(tool, clear), key=lambda d: (d.height, -d.radius)):
        if d.radius + allowance > rows[-1][0]:
            rows.append((d.radius + allowance, 0.0, d.height - allowance))
    return np.array(rows)


def approach(tree: TriangleTree, tool: ToolBody, clear: Clearances, points: ArrayLike, normals: ArrayLike,
             directions: ArrayLike, lift: float, allowance: float = 0.0,
             tips: ArrayLike | None = None) -> NDArray[np.bool_]:
    """Which tool axes bring the cutting part to which samples without entering anything.

    tree       : TriangleTree of part and fixtures
    tool       : ToolBody
    clear      : Clearances
    points     : (n, 3) float64, mm, on the surface
    normals    : (n, 3) float64, unit, out of the material
    directions : (d, 3) float64, tool axes from the tip to the spindle
    lift       : mm, distance along the normal within which a touch counts
    allowance  : mm, material to leave on the part: the assembly is grown by it all round
    tips       : (n, 3) float64, mm, of ``zones.reach.tip_field.touchable``: where the tool touches each sample along the first
                 direction; they are tried as well

    Returns
    -------
    (n, d) bool
        Exact for mesh and assembly (holder frusta as the slices that enclose them) but for 1e-5 mm along the axis.

    Notes
    -----
    Contact as in ``zones.reach.tip_field.contact_tips``, in the frame of the axis: the highest tip that touches. Lower ones touch
    with the flank, but what blocks the highest blocks them too. No sideways play is asked for. Under a flat end a
    sample whose normal is the axis is tried from 17 positions. Reach also aims it at free places near by, on the
    lattice of the upright tool; that is why its tips are taken over.
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
    """(n, d) bool of ``approach`` for as many pairs as are worked on at once."""
    sample, frame = np.nonzero(n @ frames[:, 2].T > SEEN)
    turn = frames[frame]
    points, normals = np.einsum("qij,qj->qi", turn, p[sample]), np.einsum("qij,qj->qi", turn, n[sample])
    tips = contact_tips(tool, points, normals, lift)
    tips[:, 2] += LEVEL_TOLERANCE
    free = ~blocked_along(tree, frames, frame, tips, bodies)
    flat = tool.radius - tool.corner_radius
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
    """How far a direction can be from the nearest of a set, rad.

    directions : (d, 3) float64, any length; all with z >= 0: the upper half of the sphere counts, else all of it

    Notes
    -----
    The widest empty cap: its rim runs through the corners of a facet of the convex hull, whose distance from the centre
    is its cosine. The upper half is closed by its mirror image. Too few directions for a hull: half or all of the turn.
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
    """Largest circular cone of axes by each of which nearly all of a zone is reached.

    reachable  : (n, d) bool, as of ``approach``
    area       : (n,) float64, mm², of each sample
    directions : (d, 3) float64; where none points down, what points down counts as not reaching
    share      : of the area, what an axis has to reach to count
    holds_first : the largest of the cones that hold the first direction; that one alone where it has no room round it

    Returns
    -------
    Cone, or None where no direction reaches as much, with ``holds_first`` where the first does not.

    Notes
    -----
    The nearest direction that was tried and fails is at an angle b from the axis. A true obstacle at least two
    resolutions wide is then between b and b - 2 resolutions away; the middle is given. One that is thinner can lie
    between the directions and be missed, so a path inside the cone is still checked. Of equal cones the one nearest
    to +Z is taken.
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


def _widest(unit: F64, good: NDArray[np.bool_], spacing: float, held: F64 | None) -> tuple[F64, float]:
    """Axis and half angle of the widest cone: the best of evenly spread axes, then steps that halve.

    held : (3,) an axis it has to hold, or None
    """
    bad, upper = unit[~good], _upper(unit)
    if not len(bad) and not upper:
        return np.array([0.0, 0.0, 1.0]), math.pi

    def room(axes: F64) -> F64:
        out = free(axes)
        return out if held is None else np.where(np.arccos(np.clip(axes @ held, -1.0, 1.0)) <= out, out, -math.inf)

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
    if width <= 0.0:  # no room round any: the axis to hold, or the direction that is farthest from failing ones
        best, width = (held, 0.0) if held is not None else _first(unit[good], free(unit[good]))
    return best, max(width, 0.0)


def _first(axes: F64, width: F64) -> tuple[F64, float]:
    """The widest; of equals the one nearest to +Z."""
    most = np.flatnonzero(width >= width.max() - ROUNDING)
    k = int(most[np.argmax(axes[most, 2])])
    return axes[k], float(width[k])
