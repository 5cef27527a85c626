"""Side steps and passes over re-parameterised surfaces: against constructions, and against what is truly left."""

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.parameterization.grid_map import GridMap
from geometry.parameterization.laplace_grid import laplace
from geometry.parameterization.moving_fronts import interpolated
from geometry.parameterization.quad_grid import Quad
from geometry.surfaces.nurbs import NurbsSurface
from tests.hand_parts import tool
from tests.square_regions import region
from toolpath.cutter.cutter import Cutter
from toolpath.cutter.swept_envelope import Envelope
from toolpath.kernels.beside import left_beside
from toolpath.passes.cutter_locations import lifted, tips
from toolpath.passes.forward_step import PassProfile, steps
from toolpath.passes.isoparametric_passes import Flank, IsoSurface, lay_out, side_step
from verify.moves import Moves
from verify.surface.removal import residual_on_normals

RADIUS, SCALLOP = 5.0, 0.5


def hills(height: float = 12.0) -> NurbsSurface:
    """About 280 mm by 300 mm, hollows and hills with radii down to 200 mm / height * 5."""
    x, y = np.meshgrid(np.linspace(-40, 240, 7), np.linspace(-40, 260, 7), indexing="ij")
    z = height * np.sin(x / 70) * np.cos(y / 60) + 0.0008 * (x - 100) ** 2
    return NurbsSurface.from_control_points(np.stack([x, y, z], -1), 4)


def iso_of(name: str, method, surface: NurbsSurface) -> IsoSurface:
    sides = region(**{"I": {"bump": 0.0, "notch": 0.05}, "II": {"bump": 0.2, "notch": -0.17}}[name], size=200.0)
    grid = method(Quad.of(sides, 41, 31))
    low, high = surface.domain
    return IsoSurface(surface, GridMap.of(low + (grid + 20.0) / [240.0, 250.0] * (high - low)))


@pytest.mark.parametrize("curvature, arc", [
    (-1 / 20, 3.8524), (1 / 20, 5.1008), (1 / 8, 7.418), (1 / 6, 11.598), (0.0, 2 * np.sqrt(2 * 5 * 0.5 - 0.25))])
def test_side_steps_are_those_of_the_derivation(curvature, arc):
    assert side_step(np.array([curvature]), RADIUS, SCALLOP)[0] == pytest.approx(arc, rel=2e-4)


@pytest.mark.parametrize("curvature", np.linspace(-0.5, 0.17, 23))
@pytest.mark.parametrize("scallop", [0.5, 0.01])
def test_two_balls_a_side_step_apart_leave_the_scallop(curvature, scallop):
    """On a circle of the curvature, where two balls meet."""
    arc = side_step(np.array([curvature]), RADIUS, scallop)[0]
    if abs(curvature) < 1e-6:
        meet = RADIUS - np.sqrt(RADIUS**2 - arc**2 / 4)
    else:
        big = -1 / curvature  # of the part, positive convex: the ball is outside
        half = arc / (2 * big)
        centre = (big + RADIUS) * np.array([np.sin(half), np.cos(half)])
        meet = centre[1] - np.sqrt(RADIUS**2 - centre[0] ** 2) - big
    assert meet == pytest.approx(scallop, rel=1e-6)


def test_a_ball_that_does_not_fit_has_no_side_step():
    arc = side_step(np.array([0.21, 0.2, 0.195]), RADIUS, SCALLOP)
    assert np.isnan(arc[:2]).all() and arc[2] == pytest.approx(2 * np.pi / 0.195)


def cylinder() -> NurbsSurface:
    """A quarter of radius 20 about x, convex, facing z: v along x."""
    c = np.sqrt(0.5)
    arc = 20.0 * np.array([[-c, c], [0.0, 1 / c], [c, c]])
    net = np.array([[[x, y, z] for x in (0.0, 50.0)] for y, z in arc])
    return NurbsSurface(net, np.array([0, 0, 0, 1, 1, 1.0]), np.array([0, 0, 1, 1.0]), (3, 2),
                        np.repeat([[1.0], [c], [1.0]], 2, axis=1), side=-1)


@pytest.mark.parametrize("lean", [0.0, 0.3])
def test_the_way_across_a_pass_is_square_to_it_on_the_surface(lean):
    """Passes along the axis of a cylinder, the other lines of the grid leaning: across is round the cylinder."""
    surface = cylinder()
    at = np.linspace(0.0, 1.0, 9)
    xi, eta = np.meshgrid(at, at)
    grid = np.stack([0.2 + 0.6 * eta, 0.9 - 0.5 * xi - lean * eta], axis=-1)
    iso = IsoSurface(surface, GridMap.of(grid))
    width, curvature = iso.across(np.array([0.1, 0.5]), np.array([0.3, 0.6]))
    assert curvature == pytest.approx([-1 / 20, -1 / 20])
    high, low = (surface.points(np.array([[0.2 + 0.6 * e, 0.5]])) for e in (0.3 + 1e-5, 0.3))
    assert width[0] == pytest.approx(np.linalg.norm(high - low) / 1e-5, rel=1e-4)


def left_standing(iso: IsoSurface, chord: float) -> np.ndarray:
    """What is left at a fine lattice of places away from the borders, under polylines of tips, mm."""
    paths = []
    for eta in lay_out(iso, RADIUS, SCALLOP).tolist():
        profile = PassProfile.of(iso.curve(eta), chord, RADIUS)
        paths.append(profile.centres(steps(profile, RADIUS, chord, SCALLOP), RADIUS) - [0.0, 0.0, RADIUS])
    xi, eta = np.meshgrid(np.linspace(0.02, 0.98, 120), np.linspace(0.005, 0.995, 301))
    return Envelope(paths, Cutter.ball(diameter=2 * RADIUS, length=20.0)).along(*iso.contact(xi.ravel(), eta.ravel()))


@pytest.mark.parametrize("name, method", [("I", interpolated), ("II", interpolated),
                                          ("II", lambda quad: laplace(quad)[0])])
def test_passes_leave_the_scallop_and_little_less(name, method):
    left = left_standing(iso_of(name, method, hills()), 0.005)
    assert left.max() <= SCALLOP + 0.005
    assert left.max() >= 0.93 * SCALLOP
    assert left.min() >= -0.0051


def test_a_grid_that_folds_is_refused():
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 8), np.linspace(0, 1, 8)), axis=-1)
    grid[3, 3] += [0.2, 0.0]
    with pytest.raises(GeometryError) as refusal:
        GridMap.of(grid)
    assert refusal.value.code == "folded"


def wall(lean: float, bend: float) -> IsoSurface:
    """30 mm long and 12 mm high, leaning by degrees, bent along by 1/mm; passes level, the outside at less y."""
    x, z = np.meshgrid([-15.0, 0.0, 15.0], [0.0, 6.0, 12.0], indexing="ij")
    y = np.tan(np.radians(lean)) * z + 0.5 * bend * np.array([225.0, -225.0, 225.0])[:, None]
    knots = np.array([0.0, 0, 0, 1, 1, 1])
    surface = NurbsSurface(np.stack([x, y, z], -1), knots, knots, (3, 3))
    at = np.linspace(0.0, 1.0, 5)
    return IsoSurface(surface, GridMap.of(np.dstack(np.meshgrid(at, at))))


@pytest.mark.parametrize("corner", [3.0, 0.8])
@pytest.mark.parametrize(("lean", "bend"), [(0.4, 0.0), (0.4, 0.03), (0.4, -0.03), (2.0, 0.02)])
def test_beside_walls_the_flank_of_an_upright_tool_counts(lean, bend, corner):
    """Fewer passes than the corner alone would need, and still no more left than the scallop, by the verifier."""
    iso, scallop, body = wall(lean, bend), 0.01, tool(6.0, corner_radius=corner)
    etas = lay_out(iso, corner, scallop, Flank(3.0, 2.0))
    assert np.diff(etas).max() * 12.0 <= 2.0 + 1e-9 + np.sqrt(8.0 * corner * scallop)
    places = np.stack(np.meshgrid(np.linspace(0.02, 0.98, 40), np.linspace(0.0, 1.0, 400)), -1).reshape(-1, 2)
    points, normals = iso.surface.points_and_normals(places)
    lines = [tips(*iso.contact(np.linspace(0.0, 1.0, 400), np.full(400, eta)), body) for eta in etas]
    start, end = np.vstack([q[:-1] for q in lines]), np.vstack([q[1:] for q in lines])
    moves = Moves(start, end, np.ones(len(start), bool), np.zeros(len(start), np.int32))
    left = residual_on_normals(points, normals, np.full(len(points), 10.0), moves, [body])[0]
    assert left.max() <= 1.02 * scallop and left.min() > -1e-3
    alone = lay_out(iso, corner, scallop)
    assert len(etas) <= len(alone)
    if lean < 1.0:
        assert len(etas) < 0.5 * len(alone) and left.max() > 0.6 * scallop


@pytest.mark.parametrize("corner", [3.0, 0.8])
@pytest.mark.parametrize("lean", [1.0, 12.0, 40.0])
def test_what_is_left_beside_a_pass_is_that_of_balls_and_cylinders_set_down_all_along_it(lean, corner):
    iso, flank, rng = wall(lean, 0.03), Flank(3.0, 2.0), np.random.default_rng(4)
    xi = np.linspace(0.0, 1.0, 513)
    point, normal = iso.contact(xi, 0.4 + 0.1 * np.sin(3.0 * xi))
    centres = point + corner * normal
    level = normal * [1.0, 1.0, 0.0]
    axes = centres + (3.0 - corner) * level / np.linalg.norm(level, axis=1)[:, None]
    at = np.sort(rng.uniform(0.0, 1.0, (9, 65)), axis=1)
    p, n = iso.contact(at.ravel(), rng.uniform(0.0, 1.0, at.size))
    found = np.empty(at.shape)
    left_beside(p.reshape(9, 65, 3), n.reshape(9, 65, 3), centres, axes, corner, flank.radius, flank.height, 0.5, found)
    share = np.linspace(0.0, 1.0, 4)[:-1, None, None]
    c, a = ((q[:-1] + share * (q[1:] - q[:-1])).reshape(-1, 3) for q in (centres, axes))
    twin = np.full(len(p), 1.01 * corner)
    for k in range(len(p)):
        w = c - p[k]
        along = w @ n[k]
        deep = corner**2 - (w * w).sum(axis=1) + along**2
        twin[k] = min(twin[k], (along - np.sqrt(np.maximum(deep, 0.0)))[deep >= 0.0].min(initial=np.inf))
        w, size = (a - p[k])[:, :2], np.hypot(*n[k, :2])
        along = w @ n[k, :2]
        deep = along**2 - size**2 * ((w * w).sum(axis=1) - flank.radius**2)
        t = (along - np.sqrt(np.maximum(deep, 0.0))) / size**2
        up = p[k, 2] + t * n[k, 2] - c[:, 2]
        good = (deep >= 0.0) & (up >= 0.0) & (up <= flank.height) & (size > 0.5)
        twin[k] = min(twin[k], t[good].min(initial=np.inf))
    off, near = (found.ravel() - twin), twin < 0.1
    assert near.sum() > 20 and np.quantile(np.abs(off[near]), 0.95) < 1e-4
    assert off[near].min() > -1e-4  # the twin's own places are 0.02 mm apart; more than is true may be told, not less
    assert off.min() > -0.004  # grazed, far from the pass


def post(radius: float) -> IsoSurface:
    """A quarter of an upright post, 10 mm high; passes level."""
    c = np.sqrt(0.5)
    net = np.array([[[radius * x, radius * y, z] for z in (0.0, 10.0)] for x, y in ((1, 0), (1, 1), (0, 1))])
    knots, line = np.array([0.0, 0, 0, 1, 1, 1]), np.array([0.0, 0, 1, 1])
    weights = np.repeat(np.array([[1.0], [c], [1.0]]), 2, axis=1)
    surface = NurbsSurface(net, knots, line, (3, 2), weights)
    out = surface.points_and_normals(np.array([[0.5, 0.5]]))
    surface = surface if out[0][0, :2] @ out[1][0, :2] > 0.0 else NurbsSurface(net, knots, line, (3, 2), weights, -1)
    at = np.linspace(0.0, 1.0, 5)
    return IsoSurface(surface, GridMap.of(np.dstack(np.meshgrid(at, at))))


@pytest.mark.parametrize(("radius", "diameter", "corner", "chord"), [
    (2.0, 10.0, 0.5, 0.02), (1.0, 20.0, 0.5, 0.005), (2.0, 10.0, 0.5, 0.005), (5.0, 20.0, 1.0, 0.005)])
def test_a_bull_nose_round_a_post_keeps_the_chordal_tolerance(radius, diameter, corner, chord):
    """Its flank goes on a way of greater radius than the corner's ball, whose steps would be too long for it."""
    iso, body = post(radius), tool(diameter, corner_radius=corner)
    lines = []
    for eta in lay_out(iso, corner, 0.02, Flank(0.5 * diameter, 3.0)).tolist():
        profile = PassProfile.of(iso.curve(eta), chord, corner)
        lines += lifted(profile, steps(profile, corner, chord, 0.02), body, lambda xy: np.full(len(xy), -np.inf),
                        chord)[0]
    start, end = np.vstack([q[:-1] for q in lines]), np.vstack([q[1:] for q in lines])
    u, v = np.meshgrid(np.linspace(0.02, 0.98, 1400), np.linspace(0.05, 0.95, 30))
    points, normals = iso.surface.points_and_normals(np.column_stack([u.ravel(), v.ravel()]))
    left = residual_on_normals(points, normals, np.full(len(points), 10.0), Moves(
        start, end, np.ones(len(start), bool), np.zeros(len(start), np.int32)), [body])[0]
    assert left.min() > -chord and left.max() <= 0.02 + chord
