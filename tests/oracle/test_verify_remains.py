"""Distance of the surface that is gone to what is left: closed forms, and a dense cloud of what is left."""

import math
import time

import numpy as np
import pytest

from geometry.kernels.nearest import nearest_row
from geometry.mesh_queries.bvh import TriangleTree
from tests.hand_parts import ball, blocks, prism, terraces, tool
from verify.kernels.surface import remains
from verify.kernels.surface.remains import CLOSE, SHARE
from verify.moves import Moves
from verify.surface.remains import Rays, Remains, depths_both_ways
from verify.tool_axes import ToolAxes

FLAT = tool(8.0, 0.0)
FAR = 0.6


def path(*tips, axes=None):
    """Feed moves of tool 0 through tips."""
    at = np.array(tips, float)
    n = len(at) - 1
    return Moves(at[:-1].copy(), at[1:].copy(), np.ones(n, bool), np.zeros(n, np.int32), axes)


def agrees(found, true):
    return true - 1e-9 <= found <= true * (1.0 + SHARE) + CLOSE


@pytest.mark.parametrize("wide", [0.02, 0.1, 0.5, 1.0])
def test_a_rib_that_is_gone_is_as_deep_as_it_was_high(wide):
    mesh = terraces([0, 20, 20 + wide, 40 + wide], [0, 30], [[0.0, 4.0, 0.0]], -5.0)
    left = Remains(TriangleTree(mesh), path((20, -10, 0), (20, 40, 0)), [FLAT])
    top = np.array([[20 + 0.3 * wide, 15.0, 4.0], [20, 15.0, 2.5]])
    assert left.gone(top, 0.5 * wide).all()
    found = left.depths(top, np.full(2, 6.0))
    assert agrees(found[0], 4.0)
    assert 2.5 <= found[1] <= found[0]  # of a cell, the farthest is exact


@pytest.mark.parametrize("short", [0.05, 0.7])
@pytest.mark.parametrize("degrees", [3.6, 30.0])
def test_an_edge_is_as_deep_as_it_was_shortened(degrees, short):
    back, half = 12.0, math.radians(0.5 * degrees)
    y = back * math.tan(half)
    part = prism([(0.0, 0.0), (back, -y), (back, y)], [(0, 1, 2)], 6.0)
    # the side of the flat stands at x = short and takes the edge away; the edge runs along Y at x = 0, z = 0
    left = Remains(TriangleTree(part.mesh), path((short - 4.0, -20, -8.0), (short - 4.0, 20, -8.0)), [FLAT])
    edge = np.array([[0.0, 1.0, 0.0]])
    assert agrees(left.depths(edge, np.full(1, 3.0 * short))[0], short)


def test_a_floor_that_is_drilled_through_is_gone_as_far_as_the_rim():
    mesh = terraces([0, 40], [0, 40], [[0.05]], 0.0)
    left = Remains(TriangleTree(mesh), path((20, 20, 5), (20, 20, -1)), [FLAT])
    places = np.array([[20, 20, 0.05], [21.5, 20, 0.05], [25, 20, 0.05]])
    assert left.gone(places, 0.03).tolist() == [True, True, False]
    found = left.distances(places, np.full(3, 6.0))
    assert agrees(found[0], 4.0) and agrees(found[1], 2.5) and found[2] <= CLOSE


def test_a_finished_face_is_not_gone_and_no_search_is_lost_on_it():
    # the flat cuts exactly along the floor and the side of the rib
    mesh = terraces([0, 20, 21, 40], [0, 30], [[0.0, 4.0, 0.0]], -5.0)
    left = Remains(TriangleTree(mesh), path((16, -10, 0), (16, 40, 0), (25, 40, 0), (25, -10, 0)), [FLAT])
    x, z = np.meshgrid(np.linspace(20, 21, 9), np.linspace(0.1, 4, 9))
    assert not left.gone(np.column_stack([x.ravel(), np.full(81, 15.0), z.ravel()]), 0.01).any()


def test_a_wrong_side_that_runs_flush_with_the_face_costs_no_search():
    # from within the rib, the side of the flat stands in the face and its end in the underside of the rib
    mesh = terraces([0, 8.5], [0, 30], [[4.0]], 0.0)
    left = Remains(TriangleTree(mesh), path((4, -10, 0), (4, 40, 0)), [FLAT])
    x, y, z = (g.ravel() for g in np.meshgrid([0.0], np.linspace(1, 29, 20), np.linspace(0.0, 4.0, 9)))
    places = np.column_stack([x, y, z])
    assert left.gone(places[:1], 0.01).all()  # the compiled search is there
    began = time.process_time()
    assert left.gone(places, 0.01).all()
    assert agrees(left.depths(places, np.full(len(places), 9.0)).max(), 8.0)
    assert time.process_time() - began < 3.0  # minutes, where cubes are parted all over the face


def test_a_skin_that_stands_before_the_face_is_left():
    mesh = terraces([0, 8.5], [0, 30], [[4.0]], 0.0)
    left = Remains(TriangleTree(mesh), path((4.001, -10, 0), (4.001, 40, 0)), [FLAT])
    place = np.array([[0.0, 15.0, 2.0]])
    assert left.distances(place, np.full(1, 8.0))[0] <= CLOSE
    assert not left.gone(place, 0.01).any()


def test_where_nothing_is_left_the_bound_is_told():
    mesh = terraces([0, 2], [0, 2], [[1.0]], 0.0)
    left = Remains(TriangleTree(mesh), path((1, 1, -1), (1, 1.001, -1)), [FLAT])
    assert left.depths(np.array([[1.0, 1.0, 1.0]]), np.full(1, 3.0))[0] == 3.0


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 3))])
def test_distances_are_those_of_a_dense_cloud(seed):
    rng = np.random.default_rng(seed)
    mesh, body = blocks(seed), [ball(3.0), tool(4.0, 0.0), tool(4.0, 1.0), ball(2.0)][seed]
    low, high = mesh.bounds
    tips = rng.uniform(low, high + [0, 0, 2.0], (7, 3))
    axes = None
    if seed >= 2:  # axes that lean and turn
        lean = rng.normal([0, 0, 3.0], 1.0, (7, 3))
        lean /= np.linalg.norm(lean, axis=1)[:, None]
        axes = ToolAxes.between(lean[:-1].copy(), lean[1:].copy())
    moves = path(*tips, axes=axes)
    left = Remains(TriangleTree(mesh), moves, [body])
    at = rng.integers(0, len(mesh.faces), 8)
    w = rng.dirichlet([1, 1, 1], 8)
    places = np.einsum("ij,ijk->ik", w, mesh.triangles[at])
    found = left.distances(places, np.full(8, FAR))
    step = 0.06
    grid = np.stack(np.meshgrid(*(np.arange(-FAR, FAR + 1e-9, step),) * 3, indexing="ij"), -1).reshape(-1, 3)
    grid = grid[np.einsum("ij,ij->i", grid, grid) <= FAR**2]
    away = np.linalg.norm(grid, axis=1)
    order = np.argsort(away)
    for place, value in zip(places, found, strict=True):
        cloud = place + grid[order]
        stands = of_part(mesh, cloud) & ~swept(moves, body, place, cloud)
        true = away[order][np.argmax(stands)] if stands.any() else np.inf
        if np.isinf(value):
            assert true > FAR - 2.0 * step
        else:  # a place of the cloud is no farther from what is left than its step allows
            assert value <= true * (1.0 + SHARE) + CLOSE and value >= true - 2.0 * step


def plain_distance(place, within, tree, normals, rows, tool, cutters):
    """The search of the kernel through all sweeps for every cube."""
    best, cubes, root3 = np.inf, [(*place, within)], math.sqrt(3.0)
    every, away, stack = np.arange(len(rows)), np.empty(len(rows)), np.empty(128, np.int64)
    while cubes:
        x, y, z, half = cubes.pop()
        gap = remains._cube_gap(*place, x, y, z, half)
        if gap > (within if best > within else best - max(CLOSE, SHARE * best)):
            continue
        rho = root3 * half
        least = remains._swept(x, y, z, -np.inf, rows, tool, cutters, every, away)
        if least <= -rho:
            continue
        d2, _ = nearest_row(tree.lower, tree.upper, tree.child, tree.first, tree.size, tree.corners, x, y, z, np.inf,
                            stack)
        off, inside = math.sqrt(d2), remains._inside(tree, normals, x, y, z)
        if not inside and off >= rho:
            continue
        if inside and least > 0.0:
            way = math.sqrt((place[0] - x) ** 2 + (place[1] - y) ** 2 + (place[2] - z) ** 2)
            best = min(best, max(way - min(least, off), 0.0))
            if best <= 0.0:
                return best
            if min(least, off) >= rho:
                continue
        if 2.0 * half <= max(remains.LEAST_SIDE, remains.FILM * gap):
            continue
        q, signs = 0.5 * half, [1.0 if p > c else -1.0 for p, c in zip(place, (x, y, z), strict=True)]
        for i in range(7, -1, -1):
            cubes.append(tuple(c + q * (-s if i >> k & 1 else s)
                               for k, (c, s) in enumerate(zip((x, y, z), signs, strict=True))) + (q,))
    return best if best <= within else np.inf


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_short_lists_of_sweeps_change_no_bit(seed):
    rng = np.random.default_rng(seed)
    mesh, body = blocks(seed), [ball(3.0), tool(4.0, 0.0), tool(4.0, 1.0), ball(2.0)][seed]
    low, high = mesh.bounds
    tips = np.cumsum(rng.normal(0.0, 0.4, (120, 3)), axis=0)
    tips = low + (high - low) * (0.5 + 0.45 * np.sin(tips))
    axes = None
    if seed >= 2:
        lean = rng.normal([0, 0, 5.0], 1.0, (120, 3))
        lean /= np.linalg.norm(lean, axis=1)[:, None]
        axes = ToolAxes.between(lean[:-1].copy(), lean[1:].copy())
    left = Remains(TriangleTree(mesh), path(*tips, axes=axes), [body])
    w, at = rng.dirichlet([1, 1, 1], 6), rng.integers(0, len(mesh.faces), 6)
    places = np.einsum("ij,ijk->ik", w, mesh.triangles[at])
    found, counts = left.distances(places, np.full(6, 2.0)), []
    for place, value in zip(places.tolist(), found.tolist(), strict=True):
        rows, k = remains.fill_pieces(left.feeds, len(left.feeds), left.moves.arrays, left.axes, left.cutters,
                                      left.reach, *place, 2.0 * math.sqrt(3.0))
        counts.append(len(k))
        assert value == plain_distance(place, 2.0, left.tree.arrays, mesh.normals, rows, k, left.cutters)
    assert max(counts) > 4 * remains.FEW


def of_part(mesh, points):
    """Terraces are closed from the base to the height over each place."""
    out = np.zeros(len(points), bool)
    up = mesh.normals[:, 2] > 0.5
    for t in mesh.triangles[up]:
        lo, hi = t[:, :2].min(axis=0), t[:, :2].max(axis=0)
        out |= ((points[:, :2] >= lo) & (points[:, :2] <= hi)).all(axis=1) & (points[:, 2] <= t[0, 2]) \
            & (points[:, 2] >= mesh.bounds[0][2])
    return out


def swept(moves, body, place, points):
    """Points round a place inside the cutting part at one of the places 0.02 mm apart on its way."""
    out, r = np.zeros(len(points), bool), body.corner_radius
    near = math.hypot(body.radius, body.flute_length) + FAR
    for m in range(len(moves)):
        way = moves.end[m] - moves.start[m]
        for s in np.linspace(0.0, 1.0, int(np.linalg.norm(way) / 0.02) + 2):
            tip = moves.start[m] + s * way
            axis = np.array([0.0, 0.0, 1.0])
            if moves.axes is not None:
                u, w, a = moves.axes.axis[m], moves.axes.about[m], moves.axes.angle[m] * s
                axis = u * math.cos(a) + np.cross(w, u) * math.sin(a)
            if np.linalg.norm(place - tip) > near:
                continue
            q = points - tip
            h = q @ axis
            rho = np.sqrt(np.maximum(np.einsum("ij,ij->i", q, q) - h * h, 0.0))
            low = np.maximum(r - h, 0.0)
            wide = body.radius - r + np.sqrt(np.maximum(r * r - low * low, 0.0))
            out |= (h >= 0.0) & (h <= body.flute_length) & (rho <= wide) & (low <= r)
    return out


def test_a_ray_that_a_shallow_cut_drives_out_of_a_thin_edge_ends_in_nothing_that_is_left():
    back, half, short, tolerance = 12.0, math.radians(7.5), 0.7, 0.25
    y = back * math.tan(half)
    part = prism([(0.0, 0.0), (back, -y), (back, y)], [(0, 1, 2)], 6.0)
    left = Remains(TriangleTree(part.mesh), path((short - 4.0, -20, -8.0), (short - 4.0, 20, -8.0)), [FLAT])
    up = part.mesh.normals[np.abs(part.mesh.normals[:, 1]) < 0.5]  # the two sides of the edge, and the back
    up = up[np.argmin(np.abs(up[:, 0]))] if len(up) else np.array([-math.sin(half), 0.0, math.cos(half)])
    points = np.array([[0.0, 1.0, 0.0], [0.1, 1.0, 0.1 * math.tan(half) * math.copysign(1.0, up[2])]])
    rays = Rays(points, np.array([[-1.0, 0.0, 0.0], up]), np.array([-short, -0.8 * tolerance]))
    assert agrees(depths_both_ways(left, rays, np.array([0]), np.zeros(1, np.bool_), 2, tolerance)[0], short)
