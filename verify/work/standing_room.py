"""Whether a whole tool stands free of part and fixtures, the thin neck under the end of its flutes included.

Kernels of reach take every body as going on upwards without end, since tools come from above. A slot cutter below an
overhang does not: its neck is free where its flutes would not be. Here the tool stands as it is, up to the top of its
holder or of the spindle.

Points of the surface decide, ``APART`` from each other at most round the cutting part and the neck, and ``FAR_APART``
round shank and holder. A body of radius r that enters a flat wall by t leaves a mark as wide as 2 sqrt(2 r t): 0.2 mm
for 5 um and 1 mm. Coordinates are float64, mm, in the frame of the proof.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.kernels.surface.standing import first_inside, settle
from verify.model import ProofSetup
from verify.tool_bodies import Bodies
from verify.work.asked_faces import Cutting
from verify.work.own_poses import Poses

CHORDS = 32  # of a round corner
APART, FAR_APART = 0.1, 0.5  # mm between points of the surface
MAX_POINTS = 300_000  # where more are near, they are farther apart
WAY_STEP = 0.1  # mm between places on the way
MAX_STEPS = 10
MAX_DEPTH = 0.3  # mm: a tool that enters by more is not moved aside
ROUNDS = 12  # of moving aside
TOUCHES = 1e-3  # mm
SAME_PLACE = 1e-3  # mm
CELL, GUARD = 1.5, 1e-9  # mm: points of one cell are looked at together, in a ball that is larger by rounding
# the corners of a box by bits, and its sides as triangles
SIDES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
                  [0, 6, 4], [1, 5, 7], [1, 7, 3]])
BOOL = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points in groups, so that most of them need no look.

    points : (n, 3) float64, mm, setup frame
    first  : (g + 1,) int64, index of the first point of each group, and n
    balls  : (g, 4) float64, mm: a ball round the points of each group, centre and radius
    """

    points: F64
    first: NDArray[np.int64]
    balls: F64

    @property
    def groups(self) -> tuple[F64, NDArray[np.int64], F64]:
        """All of it, as kernels take it.

        Returns points (n, 3) float64, mm, setup frame, first (g + 1,) int64, index, and balls (g, 4) float64, mm.
        """
        return self.points, self.first, self.balls

    @classmethod
    def of(cls, points: F64) -> Cloud:
        """Points (n, 3), mm, grouped by cells of ``CELL``; of points that are one but for ``SAME_PLACE``, the first."""
        points = points[np.unique(_cells(points, SAME_PLACE), return_index=True)[1]]
        if not len(points):
            return cls(points, np.zeros(1, np.int64), np.zeros((0, 4)))
        cells = _cells(points, CELL)
        order = np.argsort(cells, kind="stable")
        points, cells = points[order], cells[order]
        start = np.flatnonzero(np.diff(cells, prepend=-1))
        low, high = np.minimum.reduceat(points, start), np.maximum.reduceat(points, start)
        balls = np.column_stack([0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1) + GUARD])
        return cls(points, np.append(start, len(points)), balls)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Part and fixtures of a proof, as triangles (t, 3, 3) float64, mm."""

    triangles: F64

    @classmethod
    def of(cls, cutting: Cutting) -> Surroundings:
        """Those of a proof."""
        return cls(np.concatenate([cutting.tree.mesh.triangles, fixture_sides(cutting.setup)]))

    @cached_property
    def far(self) -> Cloud:
        """Points of all of them, ``FAR_APART`` from each other at most."""
        return Cloud.of(_points_in(self.triangles, np.full(3, -np.inf), np.full(3, np.inf), FAR_APART))

    def near(self, frusta: F64, tips: F64, axes: F64, shift: F64, apart: float) -> Cloud:
        """Points in the box round a tool at all poses and ways, ``apart`` mm from each other at most.

        frusta : (k, 4) float64, mm, tool frame: lower and upper end over the tip, and the radii there
        tips, axes, shift : (n, 3) float64, mm and unit, setup frame, as in ``stands_free``
        """
        wide = float(frusta[:, 2:].max())
        heights = frusta[:, 0].min(), frusta[:, 1].max()
        ends = np.stack([tips + z * axes - s * shift for z in heights for s in (0.0, 1.0)])
        return Cloud.of(_points_in(self.triangles, ends.min(axis=(0, 1)) - wide, ends.max(axis=(0, 1)) + wide, apart))


def free_poses(poses: Poses, hidden: BOOL, around: Surroundings, cutting: Cutting, slack: float) -> BOOL:
    """Poses of tools of a proof to which the whole tool comes free of part and fixtures.

    hidden : (n,) bool, whether something hangs over the place that is touched
    slack : mm by which the cutting part may enter the surface

    Returns (n,) bool.

    Where nothing hangs over the place, the tool comes down its axis. Else it comes the straight way; a tool that
    nowhere gets thinner upwards stands in what hangs there, so it is not asked with the axes of the program.
    """
    out, above = np.zeros(len(poses), np.bool_), ~hidden & ~poses.turned
    thinner = np.array([_gets_thinner(t, cutting.setup, slack) for t in cutting.tools], np.bool_)
    below = ~above & (poses.turned | thinner[poses.tool])
    for k in np.unique(poses.tool[above]):
        rows = np.flatnonzero(above & (poses.tool == k))
        out[rows] = stands_free(around, cutting.tools[k], cutting.setup, poses.tips[rows], poses.axes[rows],
                                np.zeros((len(rows), 3)), slack, column=True)
    for k in np.unique(poses.tool[below]):
        rows = np.flatnonzero(below & (poses.tool == k))
        out[rows] = stands_free(around, cutting.tools[k], cutting.setup, poses.tips[rows], poses.axes[rows],
                                poses.shift[rows], slack)
    return out


def stands_free(around: Surroundings, tool: ToolBody, setup: ProofSetup, tips: F64, axes: F64, shift: F64,
                slack: float, column: bool = False) -> BOOL:
    """Whether a tool stands free at poses and on the straight ways there.

    tips  : (n, 3) float64, mm, setup frame; axes : (n, 3) float64, unit, setup frame, tip to spindle
    shift : (n, 3) float64, mm, setup frame, the ways: they begin at tips - shift
    slack : mm by which the cutting part may enter the surface, for facets and rounding; the stock allowance is kept
    column : whether all over the tool must be free as well, so that it comes down its axis

    Returns (n,) bool.
    """
    frusta = _frusta(tool, setup, setup.stock_allowance - slack)
    if column:
        frusta = _column(frusta)
    out = np.ones(len(tips), np.bool_)
    _drop_blocked(out, around.far, frusta, tips, axes, shift)
    rows = np.flatnonzero(out)
    if len(rows):
        head = frusta[frusta[:, 0] < max(tool.flute_length, tool.neck_length)]
        _drop_blocked(out, around.near(head, tips[rows], axes[rows], shift[rows], APART), frusta, tips, axes, shift)
    return out


def moved_aside(poses: Poses, places: F64, normals: F64, around: Surroundings, cutting: Cutting, room: float) -> BOOL:
    """Poses of tools that still touch their places when they are moved aside until part and fixtures are ``room`` away.

    places, normals : (n, 3) float64, mm and unit, setup frame, what the poses touch; of walls, with the room between
    room   : mm

    Returns (n,) bool.

    Notes
    -----
    Where a mill meets walls on two sides, few of its places touch what lies between them. A pose is pushed square to
    its axis away from the deepest point inside it, and back to its place, in turn; the tool comes down its axis there.
    """
    out, grow = np.zeros(len(poses), np.bool_), cutting.setup.stock_allowance + room
    for k in np.unique(poses.tool):
        rows, tool = np.flatnonzero(poses.tool == k), cutting.tools[k]
        frusta = _column(_frusta(tool, cutting.setup, grow))
        frusta[:, :2] += grow + TOUCHES  # it may stand on what lies below its end
        height, up = (np.einsum("ij,ij->i", v, poses.axes[rows]) for v in (places[rows] - poses.tips[rows],
                                                                           normals[rows]))
        outline = np.array(tool.cutting_profile(CHORDS))
        wide = np.interp(height + TOUCHES, outline[:, 1], outline[:, 0]) + TOUCHES
        wide += grow * np.sqrt(np.maximum(1.0 - up**2, 0.0))
        head = frusta[frusta[:, 0] < max(tool.flute_length, tool.neck_length)]
        for fine in (False, True):  # the points far apart rule most of them out
            tips, axes, none = poses.tips[rows].copy(), poses.axes[rows], np.zeros((len(rows), 3))
            groups = (around.near(head, tips, axes, none, APART) if fine else around.far).groups
            kept = np.array([settle(*groups, frusta, tips[n], axes[n], places[row], wide[n], MAX_DEPTH, ROUNDS)
                             for n, row in enumerate(rows.tolist())], np.bool_)
            rows, wide = rows[kept], wide[kept]
            if not len(rows):
                break
        out[rows] = True
    return out


def _column(frusta: F64) -> F64:
    """Frusta of a tool that comes down its axis: no part is thinner than what is below it."""
    widest = np.maximum.accumulate(frusta[:, 2:].reshape(-1)).reshape(-1, 2)
    return np.column_stack([frusta[:, :2], widest])


def _drop_blocked(out: BOOL, cloud: Cloud, frusta: F64, tips: F64, axes: F64, shift: F64) -> None:
    """Set ``out``, (n,), to False where a tool of frusta takes in a point at its pose or on its way there."""
    hint, groups = -1, cloud.groups
    for k in np.flatnonzero(out):
        steps = min(max(round(float(np.linalg.norm(shift[k])) / WAY_STEP), 1), MAX_STEPS)
        for share in np.arange(steps) / steps:
            met = first_inside(*groups, frusta, tips[k] - share * shift[k], axes[k], hint)
            if met >= 0:
                out[k], hint = False, met
                break


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


def _cells(points: F64, size: float) -> NDArray[np.int64]:
    """Number of the cell of each point (n, 3), mm, from 0; cells are larger than ``size`` where 2^20 on a side do not
    hold the points."""
    low = points.min(axis=0, initial=np.inf)
    size = max(size, float((points - low).max(initial=0.0)) / (2**20 - 1))
    x, y, z = np.floor((points - low) / size).astype(np.int64).T
    return np.asarray((x << 40) + (y << 20) + z)


def _points_in(triangles: F64, low: F64, high: F64, apart: float) -> F64:
    """Points of triangles in a box, (n, 3), at most ``apart`` mm from each other.

    The longest side of each triangle is halved until it is as short as that; what lies outside of the box goes first.
    Of more than ``MAX_POINTS`` the distance is doubled.
    """
    found, rest = [np.zeros((0, 3))], triangles
    while len(rest):
        rest = rest[((rest.max(axis=1) >= low) & (rest.min(axis=1) <= high)).all(axis=1)]
        if len(rest) + sum(map(len, found)) > MAX_POINTS:
            apart *= 2.0
        sides = np.linalg.norm(rest - np.roll(rest, -1, axis=1), axis=2)
        done = sides.max(axis=1, initial=0.0) <= apart
        found.append(rest[done].reshape(-1, 3))
        rest, first = rest[~done], sides[~done].argmax(axis=1)
        row = np.arange(len(rest))
        a, b, c = (rest[row, (first + k) % 3] for k in range(3))
        middle = 0.5 * (a + b)
        rest = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(found)


__all__ = ["Cloud", "Surroundings", "fixture_sides", "free_poses", "moved_aside", "stands_free"]
