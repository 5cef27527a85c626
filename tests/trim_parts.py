"""Single surfaces meshed by hand, with their parameters, and measures of trimmed faces."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.spatial import cKDTree

from geometry.mesh import TriangleMesh
from geometry.part import FaceInfo, Part
from geometry.trimming.facet_sheet import sheet_of
from geometry.trimming.trim import FacePatch


def surface(point, us, vs, wrapped: bool = False, turned: bool = False) -> Part:
    """One face (u, v) -> point over a grid; ``wrapped`` joins last and first u in space, ``turned`` looks inside."""
    u, v = np.meshgrid(us, vs, indexing="ij")
    uv = np.stack([u, v], -1).reshape(-1, 2)
    vertices = np.stack(np.broadcast_arrays(*point(uv[:, 0], uv[:, 1])), -1).astype(float)
    n, m = len(us), len(vs)
    cell = (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).ravel()
    faces = np.concatenate([np.stack([cell, cell + m, cell + m + 1], 1), np.stack([cell, cell + m + 1, cell + 1], 1)])
    faces = faces[:, ::-1] if turned else faces
    corner_uv = uv[faces]
    if wrapped:
        faces = np.where(faces >= (n - 1) * m, faces - (n - 1) * m, faces)
    mesh = TriangleMesh(vertices, faces, np.ones(len(faces), np.int32))
    info = FaceInfo(1, "other", float(mesh.areas.sum()), False, 0.0, 0.0)
    return Part(mesh, (info,), (), 0.0, mesh.bounds, "mm", 0.01, 0.2, 0.0, (), "0" * 64, corner_uv)


def plane(size: float = 10.0, n: int = 4) -> Part:
    """A square from the origin, u = x, v = y."""
    return surface(lambda u, v: (u, v, 0 * u), np.linspace(0, size, n + 1), np.linspace(0, size, n + 1))


def tube(radius: float = 5.0, height: float = 20.0, n: int = 90, turned: bool = False) -> Part:
    """A cylinder round z with one row of long facets, as a CAD kernel meshes it; u the angle, v = z."""
    angle = np.linspace(0, 2 * np.pi, n + 1)
    return surface(lambda u, v: (radius * np.cos(u), radius * np.sin(u), v), angle, [0.0, height], True, turned)


def wave(n: int = 60) -> Part:
    """A wavy wall y(x), 20 long, 6 high; u not proportional to length."""
    return surface(lambda u, v: (20 * u * u, 2 * np.sin(5 * u) + u, v), np.linspace(0, 1, n + 1), [0.0, 2.5, 6.0])


def saddle(n: int = 24) -> Part:
    """z = x y / 8 over a square of 8 mm."""
    grid = np.linspace(-4, 4, n + 1)
    return surface(lambda u, v: (u, v, u * v / 8), grid, grid)


def voronoi(part: Part, count: int, seed: int):
    """A label: the nearest of random points in the box of the part."""
    low, high = part.bounds
    tree = cKDTree(np.random.default_rng(seed).uniform(low, high, (count, 3)))
    return lambda points, normals, face: tree.query(points)[1]


def shoelace(loop) -> float:
    """Signed area of a closed polygon (k, 2)."""
    q = np.roll(loop, -1, axis=0)
    return 0.5 * float((loop[:, 0] * q[:, 1] - loop[:, 1] * q[:, 0]).sum())


def by_face(found: dict[int, tuple[FacePatch, ...]]) -> dict[int, list[tuple[int, FacePatch]]]:
    """(label, patch) of each face."""
    out: dict[int, list[tuple[int, FacePatch]]] = {}
    for label, patches in found.items():
        for patch in patches:
            out.setdefault(patch.face, []).append((label, patch))
    return out


def assert_partition(part: Part, found: dict[int, tuple[FacePatch, ...]]) -> None:
    """The patches of every face fill it once: area on the mesh, area in (u, v), no two polygons overlap."""
    sheet = sheet_of(part, None)
    owner = sheet.face[sheet.corners[:, 0]]
    for face, pieces in by_face(found).items():
        rows = owner == face
        area, plain = sheet.areas()[rows].sum(), sheet.uv_areas()[rows].sum()
        assert abs(sum(p.area for _, p in pieces) - area) <= 1e-9 * area
        assert abs(sum(shoelace(x) for _, p in pieces for x in p.loops) - plain) <= 1e-9 * abs(plain)
        polygons = np.array([shapely.Polygon(p.loops[0], p.loops[1:]) for _, p in pieces], dtype=object)
        assert shapely.is_valid(polygons).all()
        assert abs(shapely.area(shapely.union_all(polygons)) - abs(plain)) <= 1e-9 * abs(plain)


def wrong_points(part: Part, found: dict[int, tuple[FacePatch, ...]], label, count: int) -> np.ndarray:
    """Of random points of the mesh those whose label is not the patch they lie in: distance (mm) to its loops."""
    sheet = sheet_of(part, None)
    rng = np.random.default_rng(5)
    areas = sheet.areas()
    facet = rng.choice(len(areas), count, p=areas / areas.sum())
    rows = np.einsum("ij,ijk->ik", rng.dirichlet([1, 1, 1], count), sheet.nodes[sheet.corners[facet]])
    face = sheet.face[sheet.corners[facet, 0]]
    true = label(rows[:, :3], rows[:, 5:] / np.linalg.norm(rows[:, 5:], axis=1)[:, None], face)
    got = np.full(count, -(10**6))
    for number, pieces in by_face(found).items():
        mine = np.flatnonzero(face == number)
        for name, patch in pieces:
            inside = shapely.contains_xy(shapely.Polygon(patch.loops[0], patch.loops[1:]), rows[mine, 3:5])
            got[mine[inside]] = name
    lines = [x for pieces in by_face(found).values() for _, p in pieces for x in p.loops_xyz]
    start = np.concatenate(lines)
    side = np.concatenate([np.roll(x, -1, axis=0) - x for x in lines])
    return np.array([_distance(p, start, side) for p in rows[got != true, :3]])


def _distance(point, start, side) -> float:
    along = np.einsum("ij,ij->i", point - start, side) / np.maximum(np.einsum("ij,ij->i", side, side), 1e-300)
    return float(np.linalg.norm(start + np.clip(along, 0, 1)[:, None] * side - point, axis=1).min())
