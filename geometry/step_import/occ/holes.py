"""Closes the small holes that the kernel's mesher leaves where it fails on a sliver face."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from geometry.mesh import F64, TriangleMesh

MAX_SIDES = 6
# A hole wider than this many chords is a missing face, not a sliver. It stays open, with a warning.
MAX_WIDTH = 10.0


def fill_slivers(mesh: TriangleMesh, chord: float) -> tuple[TriangleMesh, int]:
    """Close narrow holes of at most six sides with fans of triangles.

    mesh  : TriangleMesh
    chord : float, mm; holes up to ten chords wide (twice area over perimeter) are closed

    Returns the mesh with the new triangles appended, and the number of holes closed; a new triangle carries the face
    number across the longest side of its hole.
    """
    start, end, owner = _open_sides(mesh)
    follow = {int(a): (int(b), int(o)) for a, b, o in zip(end, start, owner, strict=True)}
    extra: list[tuple[int, int, int]] = []
    ids: list[int] = []
    closed = 0
    while follow:
        loop, owners = _loop(follow)
        if not 3 <= len(loop) <= MAX_SIDES:
            continue
        points = mesh.vertices[loop]
        sides = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
        pivot = _best_pivot(points)
        order = loop[pivot:] + loop[:pivot]
        fan = [(order[0], order[i], order[i + 1]) for i in range(1, len(order) - 1)]
        if 2.0 * _area(mesh.vertices[np.array(fan)]) / sides.sum() > MAX_WIDTH * chord:
            continue
        extra += fan
        ids += [owners[int(sides.argmax())]] * len(fan)
        closed += 1
    if not closed:
        return mesh, 0
    faces = np.concatenate([mesh.faces, np.array(extra, np.int32)])
    return TriangleMesh(mesh.vertices, faces, np.concatenate([mesh.face_ids, np.array(ids, np.int32)])), closed


def extend_parameters(mesh: TriangleMesh, uv: F64, project: Callable[[int, F64, F64], F64]) -> F64:
    """Surface parameters for the triangles that ``fill_slivers`` appended.

    mesh    : TriangleMesh with m triangles, mm
    uv      : (k, 3, 2) float64, rad, mm or dimensionless, parameters of the corners of the first k triangles, k <= m
    project : takes a face number, a point (3,) float64, mm, frame of the mesh, and a start (2,) float64, parameters;
              gives the parameters (2,) float64 near the start

    Returns (m, 3, 2) float64, rad, mm or dimensionless, parameters. A corner that lies on the face already copies
    its value there; of several values at a seam it takes the one nearest to that of the first corner. Other corners are
    projected on the face.
    """
    extra: list[F64] = []
    for corners, face in zip(mesh.faces[len(uv):], mesh.face_ids[len(uv):], strict=True):
        rows = np.flatnonzero(mesh.face_ids[:len(uv)] == face)
        known = [uv[rows][mesh.faces[rows] == c] for c in corners]
        start = next(k[0] for k in known if len(k))
        extra.append(np.array([k[np.linalg.norm(k - start, axis=1).argmin()] if len(k)
                               else project(int(face), mesh.vertices[c], start)
                               for c, k in zip(corners, known, strict=True)]))
    return np.concatenate([uv, np.array(extra).reshape(-1, 3, 2)])


def _open_sides(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directed triangle sides without a partner: start, end, face number."""
    f, n = mesh.faces.astype(np.int64), len(mesh.vertices)
    start, end = f.ravel(), f[:, [1, 2, 0]].ravel()
    bare = ~np.isin(end * n + start, start * n + end)
    return start[bare], end[bare], np.repeat(mesh.face_ids, 3)[bare]


def _loop(follow: dict[int, tuple[int, int]]) -> tuple[list[int], list[int]]:
    """Walk around one hole and remove its sides from the table; empty when the walk does not return."""
    first = next(iter(follow))
    loop, owners, here = [], [], first
    while here in follow:
        loop.append(here)
        here, owner = follow.pop(here)
        owners.append(owner)
    return (loop, owners) if here == first else ([], [])


def _best_pivot(points: np.ndarray) -> int:
    """Corner whose fan has the least area: the flattest way to close the hole."""
    def fan_area(k: int) -> float:
        p = np.roll(points, -k, axis=0)
        return _area(np.stack([np.broadcast_to(p[0], p[1:-1].shape), p[1:-1], p[2:]], axis=1))
    return min(range(len(points)), key=fan_area)


def _area(triangles: np.ndarray) -> float:
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return float(0.5 * np.linalg.norm(cross, axis=1).sum())
