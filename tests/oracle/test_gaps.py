"""Gaps of ``zones.features.channels`` and normals of ``zones.features.smooth_surface``.

They are compared with closed forms and dense rays of exact surfaces.

The sides are parametric surfaces written down here; the program sees their nodes only, meshed in full-height triangles
or in a few rows. The twin sends rays from a dense grid along the exact normal, solves for the exact foot with Newton's
method and looks closer round the shortest one.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from geometry.mesh import F64, TriangleMesh
from geometry.part import EdgeKind
from zones.features.channels import Facing, find_facings
from zones.features.face_graph import Link
from zones.features.smooth_surface import SmoothSurface

Surface = Callable[[F64, F64], F64]
"""(n,) u and (n,) v, both 0 to 1, to (n, 3) mm; the outward normal is X_u x X_v times a sign."""

HEIGHT = 12.0


def ruled(foot: Callable[[F64], F64], top: Callable[[F64], F64], length: float = 40.0) -> Surface:
    """A side that is ruled from y = foot(u) at z = 0 to y = top(u) at the top."""
    def at(u: F64, v: F64) -> F64:
        return np.column_stack([length * u, (1 - v) * foot(u) + v * top(u), HEIGHT * v])
    return at


def oval(a: float, b: float, lean: float) -> Surface:
    """The inside of an oval ring; both half axes grow by lean from floor to top."""
    def at(u: F64, v: F64) -> F64:
        t = 2 * np.pi * u
        return np.column_stack([(a + lean * v) * np.cos(t), (b + lean * v) * np.sin(t), HEIGHT * v])
    return at


def derivatives(surface: Surface, u: F64, v: F64) -> tuple[F64, F64]:
    """Central differences, good to 1e-9."""
    h = 1e-5
    return (surface(u + h, v) - surface(u - h, v)) / (2 * h), (surface(u, v + h) - surface(u, v - h)) / (2 * h)


def exact_normal(surface: Surface, sign: float, u: F64, v: F64) -> F64:
    n = sign * np.cross(*derivatives(surface, u, v))
    return np.asarray(n / np.linalg.norm(n, axis=1)[:, None])


def rays(a: tuple[Surface, float], b: tuple[Surface, float], u: F64, v: F64, shift: float) -> F64:
    """Lengths of rays from a at (u, v) to b, inf where they miss it; feet are looked for from (u + shift, v) on."""
    p, n = a[0](u, v), exact_normal(*a, u, v)
    s, w = u + shift, v.copy()
    t = np.linalg.norm(b[0](s, w) - p, axis=1)
    for _ in range(40):
        du, dv = derivatives(b[0], s, w)
        rest = b[0](s, w) - p - n * t[:, None]
        step = np.linalg.solve(np.stack([n, -du, -dv], axis=-1), rest[..., None])[..., 0]
        t, s, w = t + step[:, 0], s + step[:, 1], w + step[:, 2]
    missed = np.linalg.norm(b[0](s, w) - p - n * t[:, None], axis=1) > 1e-7
    outside = (w < -1e-9) | (w > 1 + 1e-9) | ((s < -1e-9) | (s > 1 + 1e-9) if shift == 0.0 else False)
    facing = (exact_normal(*b, s, w) * n).sum(axis=1) < -0.3
    return np.where(missed | outside | ~facing | (t <= 1e-6), np.inf, t)


def dense_gap(a: tuple[Surface, float], b: tuple[Surface, float], shift: float = 0.0) -> float:
    """Shortest ray from a to b."""
    centre, half, best = np.array([0.5, 0.5]), np.array([0.5, 0.5]), np.inf
    for n in (121, 25, 25, 25, 25, 25):
        axes = [np.clip(np.linspace(c - h, c + h, n), 0, 1) for c, h in zip(centre, half, strict=True)]
        u, v = (g.ravel() for g in np.meshgrid(*axes, indexing="ij"))
        t = rays(a, b, u, v, shift)
        k = int(t.argmin())
        if t[k] <= best:
            best, centre = float(t[k]), np.array([u[k], v[k]])
        half = half * (4 / n if n > 25 else 0.25)
    return best


def mesh_of(surfaces: list[tuple[Surface, float]], columns: int, rows: int) -> tuple[TriangleMesh, F64, list[Any]]:
    """Mesh, surface parameters of its corners (bent on purpose) and the links at the borders of every face."""
    vertices, faces, ids, uv, links = [], [], [], [], []
    for k, (surface, sign) in enumerate(surfaces):
        u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1), indexing="ij")
        number = np.arange(u.size).reshape(u.shape)
        a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
        corner = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
        offset = sum(len(x) for x in vertices)
        vertices.append(surface(u.ravel(), v.ravel()))
        uv.append(np.column_stack([u.ravel() + 0.1 * u.ravel() ** 2, 3 * v.ravel()])[corner])
        faces.append((corner if sign > 0 else corner[:, ::-1]) + offset)
        if sign < 0:
            uv[-1] = uv[-1][:, ::-1]
        ids.append(np.full(len(corner), k + 1, np.int32))
        border = np.concatenate([number[:, 0], number[:, -1], number[0], number[-1]]) + offset
        links.append([Link(k, k, EdgeKind.CONVEX, 1.0, border)])
    mesh = TriangleMesh(np.concatenate(vertices), np.concatenate(faces).astype(np.int32), np.concatenate(ids))
    return mesh, np.concatenate(uv), links


def found(surfaces: list[tuple[Surface, float]], sides: list[list[int]], columns: int, rows: int) -> list[Facing]:
    """Channels that the program finds between sides of walls 1 mm thick."""
    mesh, uv, links = mesh_of(surfaces, columns, rows)
    face_of = mesh.face_ids.astype(np.int64) - 1
    graph: Any = SimpleNamespace(
        mesh=mesh, face_of=face_of, n=len(surfaces), at=links, links=[], skin=1e-6 * 50.0,
        face=np.arange(len(surfaces)), back=np.full(len(surfaces), -1), inward=np.ones(len(surfaces)),
        fillet=np.zeros(len(surfaces), bool), sliver=np.zeros(len(surfaces), bool),
        area=np.bincount(face_of, weights=mesh.areas), part=SimpleNamespace(uv=uv, chord=0.02, deviation=0.02))
    return find_facings(graph, [np.array(s) for s in sides], np.zeros(len(surfaces), bool))


def found_gap(surfaces: list[tuple[Surface, float]], sides: list[list[int]], columns: int, rows: int) -> float:
    """Gap of the one channel that the program finds."""
    channels = found(surfaces, sides, columns, rows)
    assert len(channels) == 1
    return channels[0].gap_min


def wave(x: F64) -> F64:
    return 1.2 * np.sin(5 * x)


PAIRS = {
    "parallel": (ruled(wave, wave), ruled(lambda u: wave(u) + 6, lambda u: wave(u) + 6)),
    "leaning apart": (ruled(wave, lambda u: wave(u) - 2), ruled(lambda u: wave(u) + 5, lambda u: wave(u) + 8)),
    "leaning together": (ruled(wave, lambda u: wave(u) + 1.5), ruled(lambda u: wave(u) + 6, lambda u: wave(u) + 4)),
    "leaning the same way": (ruled(wave, lambda u: wave(u) + 3), ruled(lambda u: wave(u) + 5, lambda u: wave(u) + 8)),
    "twisted": (ruled(wave, lambda u: wave(u) + 3 * u - 1), ruled(lambda u: 6 + 0.5 * np.cos(4 * u),
                                                                 lambda u: 7 - 2 * u + wave(u))),
    "narrow": (ruled(wave, lambda u: wave(u) + 0.3 * u), ruled(lambda u: wave(u) + 0.5, lambda u: wave(u) + 0.9)),
}


@pytest.mark.parametrize("rows", [1, 6])
@pytest.mark.parametrize("name", PAIRS)
def test_gap_of_two_ruled_walls_is_that_of_dense_exact_rays(name: str, rows: int) -> None:
    a, b = (PAIRS[name][0], -1.0), (PAIRS[name][1], 1.0)
    true = min(dense_gap(a, b), dense_gap(b, a))
    assert found_gap([a, b], [[0], [1]], 60, rows) == pytest.approx(true, rel=4e-4)


@pytest.mark.parametrize("rows", [1, 5])
@pytest.mark.parametrize(("a", "b", "lean"), [(8.0, 6.7, 0.0), (8.0, 6.7, 0.3), (8.0, 6.7, -0.3), (9.0, 5.0, 1.0)])
def test_gap_of_an_oval_ring_facing_itself(a: float, b: float, lean: float, rows: int) -> None:
    side = (oval(a, b, lean), -1.0)
    true = dense_gap(side, side, 0.5)
    assert found_gap([side], [[0]], 64, rows) == pytest.approx(true, rel=4e-4)


@pytest.mark.parametrize("rows", [1, 5])
@pytest.mark.parametrize("lean", [0.0, 0.4, -0.3])
def test_the_shortest_ray_that_ends_on_a_border(lean: float, rows: int) -> None:
    """From a round side of radius R about c the ray to q is |q - c| - R long; the other wall begins at x = 26."""
    def barrel(u: F64, v: F64) -> F64:
        return np.column_stack([40 * u, np.sqrt(900 - (40 * u - 20) ** 2) - 30, HEIGHT * v])

    def straight(u: F64, v: F64) -> F64:
        return np.column_stack([26 + 14 * u, 2 + 1.4 * u + lean * v, HEIGHT * v])

    edge = 2.0 + min(lean, 0.0)
    true = np.hypot(26 - 20, edge + 30) - 30
    assert found_gap([(barrel, -1.0), (straight, 1.0)], [[0], [1]], 60, rows) == pytest.approx(true, rel=4e-4)


def test_a_notch_in_a_side_is_no_channel() -> None:
    def notched(depth: float, width: float) -> Surface:
        def at(u: F64, v: F64) -> F64:
            return np.column_stack([8 * u, -depth * np.exp(-(8 * u - 4) ** 2 / width ** 2), HEIGHT * v])
        return at

    assert found([(notched(0.6, 0.15), -1.0)], [[0]], 240, 1) == []
    # deeper than the wall is thick it is a slot between two stretches of it
    assert len(found([(notched(3.0, 0.6), -1.0)], [[0]], 240, 1)) == 1


@pytest.mark.parametrize("k", [0.0, 0.05, 0.2])
def test_gap_inside_a_cone_in_closed_form(k: float) -> None:
    """A ray from radius r, tilted by the cone's half angle, meets the far side after 2 r sqrt(1 + k^2) / (1 - k^2)."""
    side = (oval(7.0, 7.0, k * HEIGHT), -1.0)
    if k * 14.0 / (1 - k * k) < HEIGHT:
        assert found_gap([side], [[0]], 48, 1) == pytest.approx(14.0 * np.sqrt(1 + k * k) / (1 - k * k), rel=1e-3)


@pytest.mark.parametrize("rows", [1, 8])
def test_normals_hold_up_to_the_corners_and_improve_with_the_cube_of_the_pitch(rows: int) -> None:
    surface = PAIRS["twisted"][0]
    worst = []
    for columns in (20, 40):
        mesh, uv, _ = mesh_of([(surface, -1.0)], columns, rows)
        smooth = SmoothSurface(mesh, uv, np.arange(len(mesh.faces)), 0.05)
        t = np.repeat(np.arange(len(mesh.faces)), 4)
        share = np.tile(np.vstack([np.eye(3), [[0.3, 0.3, 0.4]]]), (len(mesh.faces), 1))
        points = np.einsum("ij,ijk->ik", share, mesh.triangles[t])
        place, normal = smooth.at(points, t)
        v = place[:, 2] / HEIGHT
        worst.append(float(np.arccos(np.clip((normal * exact_normal(surface, -1.0, place[:, 0] / 40.0, v)).sum(axis=1),
                                             -1, 1)).max()))
        facets = float(np.arccos(np.clip((mesh.normals[t] * exact_normal(surface, -1.0, points[:, 0] / 40.0, v))
                                         .sum(axis=1), -1, 1)).max())
        assert worst[-1] < 0.2 * facets
    assert worst[1] < 2e-3
    assert worst[1] < worst[0] / 4


def test_places_lie_on_the_exact_surface() -> None:
    surface = oval(9.0, 5.0, 1.0)
    mesh, uv, _ = mesh_of([(surface, -1.0)], 64, 1)
    t = np.arange(len(mesh.faces))
    points = mesh.triangles.mean(axis=1)
    place, _ = SmoothSurface(mesh, uv, t, 0.05).at(points, t)

    def off(p: F64) -> float:
        v = p[:, 2] / HEIGHT
        return float(np.abs(np.hypot(p[:, 0] / (9.0 + v), p[:, 1] / (5.0 + v)) - 1).max() * 5.0)

    assert off(place) < 0.1 * off(points)


def test_without_parameters_the_facets_are_taken() -> None:
    mesh, _, _ = mesh_of([PAIRS["parallel"][0:1] + (1.0,)], 8, 1)
    t = np.arange(len(mesh.faces))
    points = mesh.triangles.mean(axis=1)
    place, normal = SmoothSurface(mesh, None, t, 0.05).at(points, t)
    assert np.array_equal(place, points) and np.array_equal(normal, mesh.normals)
