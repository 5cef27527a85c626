"""Whether a whole tool stands free of part and fixtures, the thin neck under the end of its flutes included.

Kernels of reach take every body as going on upwards without end, since tools come from above. A slot cutter below an
overhang does not: its neck is free where its flutes would not be. Here the tool stands as it is, up to the top of its
holder or of the spindle.

Points of the surface decide, ``APART`` from each other at most round the cutting part and the neck, and ``FAR_APART``
round shank and holder. A body of radius r that enters a flat wall by t leaves a mark as wide as 2 sqrt(2 r t): 0.2 mm
for 5 um and 1 mm. Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.kernels.surface.standing import first_inside
from verify.model import ProofSetup
from verify.tool_bodies import Bodies
from verify.work.asked_faces import Cutting
from verify.work.own_poses import Poses

CHORDS = 32  # of a round corner
APART, FAR_APART = 0.1, 0.5  # mm between points of the surface
MAX_POINTS = 300_000  # where more are near, they are farther apart
WAY_STEP = 0.1  # mm between places on the way
MAX_STEPS = 10
# the corners of a box by bits, and its sides as triangles
SIDES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
                  [0, 6, 4], [1, 5, 7], [1, 7, 3]])
BOOL = NDArray[np.bool_]


def free_poses(poses: Poses, hidden: BOOL, cutting: Cutting, slack: float) -> BOOL:
    """Poses of tools of a proof at which the whole tool stands free of part and fixtures, and on its way there.

    hidden : (n,) bool, whether something hangs over the place that is touched
    slack : mm by which the cutting part may enter the surface

    Returns (n,) bool.

    A tool that nowhere gets thinner upwards stands in what hangs over the place that it touches, so it is not asked
    there with the axes of the program.
    """
    out = np.zeros(len(poses), np.bool_)
    thinner = np.array([_gets_thinner(t, cutting.setup, slack) for t in cutting.tools], np.bool_)
    asked = ~hidden | poses.turned | thinner[poses.tool]
    if not asked.any():
        return out
    sides = np.concatenate([cutting.tree.mesh.triangles, fixture_sides(cutting.setup)])
    for k in np.unique(poses.tool[asked]):
        rows = np.flatnonzero(asked & (poses.tool == k))
        out[rows] = stands_free(sides, cutting.tools[k], cutting.setup, poses.tips[rows], poses.axes[rows],
                                poses.shift[rows], slack)
    return out


def stands_free(triangles: F64, tool: ToolBody, setup: ProofSetup, tips: F64, axes: F64, shift: F64,
                slack: float) -> BOOL:
    """Whether a tool stands free at poses and on the straight ways there.

    triangles : (t, 3, 3) float64, mm, setup frame, of the part and of ``fixture_sides``
    tips  : (n, 3) float64, mm, setup frame; axes : (n, 3) float64, unit, setup frame, tip to spindle
    shift : (n, 3) float64, mm, setup frame, the ways: they begin at tips - shift
    slack : mm by which the cutting part may enter the surface, for facets and rounding; the stock allowance is kept

    Returns (n,) bool.
    """
    if not len(tips):
        return np.zeros(0, np.bool_)
    frusta = _frusta(tool, setup, setup.stock_allowance - slack)
    head = frusta[frusta[:, 0] < max(tool.flute_length, tool.neck_length)]
    points = np.concatenate([_points_round(triangles, head, tips, axes, shift, APART),
                             _points_round(triangles, frusta, tips, axes, shift, FAR_APART)])
    out, hint = np.ones(len(tips), np.bool_), -1
    for k, (tip, axis, way) in enumerate(zip(tips, axes, shift, strict=True)):
        steps = min(max(round(float(np.linalg.norm(way)) / WAY_STEP), 1), MAX_STEPS)
        for share in np.arange(steps) / steps:
            met = first_inside(points, frusta, tip - share * way, axis, hint)
            if met >= 0:
                out[k], hint = False, met
                break
    return out


def _gets_thinner(tool: ToolBody, setup: ProofSetup, slack: float) -> bool:
    """Whether a body over the flutes, its clearance included, is thinner than these by more than ``slack``, mm."""
    return bool(Bodies.of([tool], setup).rows[:, 2:4].min(initial=np.inf) < tool.widest_radius - slack)


def fixture_sides(setup: ProofSetup) -> F64:
    """Sides of the fixtures as triangles, (t, 3, 3) float64, mm, setup frame."""
    corners = [[[box[k >> i & 1][i] for i in range(3)] for k in range(8)] for box in setup.fixtures]
    return np.array(corners, np.float64).reshape(-1, 8, 3)[:, SIDES].reshape(-1, 3, 3)


def _frusta(tool: ToolBody, setup: ProofSetup, grow: float) -> F64:
    """Rows of the whole tool, (k, 4): lower and upper end over the tip, and the radii there, mm, clearances included.

    grow : mm by which the cutting part is larger, or smaller where it is negative
    """
    outline = [(rho + grow if rho > 0.0 else 0.0, z) for rho, z in tool.cutting_profile(CHORDS)]
    outline = [(max(rho, 0.0), z - grow if z < tool.flute_length else z + grow) for rho, z in outline]
    cutter = [(a[1], b[1], a[0], b[0]) for a, b in pairwise(outline) if b[1] > a[1]]
    return np.array([*cutter, *Bodies.of([tool], setup).rows[:, :4].tolist()])


def _points_round(triangles: F64, frusta: F64, tips: F64, axes: F64, shift: F64, apart: float) -> F64:
    """Points of triangles in the box round frusta at all poses and ways, (n, 3), at most ``apart`` mm from each other.

    The longest side of each triangle is halved until it is as short as that; what lies outside of the box goes first.
    Of more than ``MAX_POINTS`` the distance is doubled.
    """
    wide = float(frusta[:, 2:].max())
    ends = np.stack([tips + z * axes - s * shift for z in (frusta[:, 0].min(), frusta[:, 1].max()) for s in (0.0, 1.0)])
    low, high = ends.min(axis=(0, 1)) - wide, ends.max(axis=(0, 1)) + wide
    found, rest = [np.zeros((0, 3))], triangles
    while len(rest):
        rest = rest[((rest.max(axis=1) >= low) & (rest.min(axis=1) <= high)).all(axis=1)]
        if len(rest) + sum(map(len, found)) > MAX_POINTS:
            apart *= 2.0
        sides = np.linalg.norm(rest - np.roll(rest, -1, axis=1), axis=2)
        done = sides.max(axis=1) <= apart
        found.append(rest[done].reshape(-1, 3))
        rest, first = rest[~done], sides[~done].argmax(axis=1)
        row = np.arange(len(rest))
        a, b, c = (rest[row, (first + k) % 3] for k in range(3))
        middle = 0.5 * (a + b)
        rest = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(found)


__all__ = ["fixture_sides", "free_poses", "stands_free"]
