"""Solids of the fault table that are known exactly: how deep a place lies in them, their meshes, where they end.

Every solid answers ``depth``: (n, 3) places in mm, setup frame, to (n,) mm, the distance to the nearest place outside,
exact and positive inside; outside it is negative and grows with the distance. Profiles are closed chains of segments
and arcs with the material on the left; a solid is one pulled along Y, one turned about Z, a block with a pocket, or a
frustum of planes on a plate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from geometry.mesh import F64, TriangleMesh

SAGITTA = 5e-4  # mm, what facets leave a curved surface by


class Solid(Protocol):
    """What the twin asks of a part."""

    def depth(self, points: F64) -> F64:
        """(n,) mm under the surface of (n, 3) places, mm; negative outside."""
        ...

    def settled(self, points: F64, normals: F64) -> tuple[F64, F64]:
        """Places (n, 3), mm, near the surface moved onto it, with its unit normals (n, 3)."""
        ...


@dataclass(frozen=True)
class Piece:
    """A segment, or an arc where ``centre`` is given, from p to q; ``face`` is the number of what it makes.

    A positive ``radius`` turns left (material inside the circle), a negative one right.
    """

    p: tuple[float, float]
    q: tuple[float, float]
    face: int
    centre: tuple[float, float] | None = None
    radius: float = 0.0

    def points(self) -> F64:
        """(k, 2) mm, along the piece, its last end left out, within ``SAGITTA``."""
        if self.centre is None:
            return np.array([self.p])
        a, sweep = self._sweep()
        n = max(1, math.ceil(abs(sweep) / math.sqrt(8.0 * SAGITTA / abs(self.radius))))
        angle = a + sweep * np.arange(n) / n
        return np.asarray(self.centre) + abs(self.radius) * np.column_stack([np.cos(angle), np.sin(angle)])

    def _sweep(self) -> tuple[float, float]:
        assert self.centre is not None
        a = math.atan2(self.p[1] - self.centre[1], self.p[0] - self.centre[0])
        b = math.atan2(self.q[1] - self.centre[1], self.q[0] - self.centre[0])
        return a, (b - a) % math.tau if self.radius > 0 else -((a - b) % math.tau)

    def foot(self, at: F64) -> tuple[F64, F64, F64]:
        """Nearest places (n, 2), mm, unit normals (n, 2) there, and whether the foot is an inner one (n,) bool."""
        if self.centre is None:
            p, d = np.asarray(self.p), np.subtract(self.q, self.p)
            t = (at - p) @ d / (d @ d)
            normal = np.array([d[1], -d[0]]) / math.hypot(*d)
            return p + np.clip(t, 0, 1)[:, None] * d, np.tile(normal, (len(at), 1)), (t > 0) & (t < 1)
        w = at - np.asarray(self.centre)
        far = np.maximum(np.hypot(w[:, 0], w[:, 1]), 1e-12)[:, None]
        a, sweep = self._sweep()
        along = ((np.arctan2(w[:, 1], w[:, 0]) - a) * np.sign(sweep)) % math.tau
        within = along < abs(sweep)
        ends = np.where((np.linalg.norm(at - self.p, axis=1) < np.linalg.norm(at - self.q, axis=1))[:, None],
                        self.p, self.q)
        foot = np.where(within[:, None], self.centre + abs(self.radius) * w / far, ends)
        out = (foot - np.asarray(self.centre)) / self.radius
        return foot, out, within


@dataclass(frozen=True)
class Profile:
    """A chain of pieces, material on the left; an open one begins and ends on the axis of turning."""

    pieces: tuple[Piece, ...]

    def foot(self, at: F64) -> tuple[F64, F64, F64]:
        """Depth (n,) mm of places (n, 2), the nearest places (n, 2) of the chain, and unit normals (n, 2) there."""
        best, foot, normal = np.full(len(at), np.inf), np.zeros_like(at), np.zeros_like(at)
        summed = np.zeros_like(at)
        for piece in self.pieces:
            near, out, _ = piece.foot(at)
            gap = np.linalg.norm(at - near, axis=1)
            tied, nearer = np.abs(gap - best) < 1e-9, gap < best - 1e-9
            # at a corner both pieces are as near: the sum of their normals tells the side
            summed[tied] += out[tied]
            summed[nearer] = out[nearer]
            best[nearer], foot[nearer], normal[nearer] = gap[nearer], near[nearer], out[nearer]
        inside = np.einsum("ij,ij->i", foot - at, summed) > 0
        return np.where(inside, best, -best), foot, normal

    def line(self) -> tuple[F64, list[int]]:
        """Points (k, 2) mm of the chain with its last end, and the face of each of the k - 1 stretches."""
        parts = [p.points() for p in self.pieces]
        faces = [p.face for p, q in zip(self.pieces, parts, strict=True) for _ in q]
        return np.vstack([*parts, self.pieces[-1].q]), faces


def chain(*points: tuple[float, float, int]) -> tuple[Piece, ...]:
    """Segments through (x, y) mm; the face is that of the stretch that begins there, the last point ends the chain."""
    return tuple(Piece(a[:2], b[:2], a[2]) for a, b in zip(points[:-1], points[1:], strict=True))


@dataclass(frozen=True)
class Pulled:
    """A profile in x and z pulled along Y from -half to half; its ends are faces 90 and 91."""

    profile: Profile
    half: float

    def depth(self, points: F64) -> F64:
        """As the module says; points (n, 3), mm."""
        return np.minimum(self.profile.foot(points[:, [0, 2]])[0], self.half - np.abs(points[:, 1]))

    def settled(self, points: F64, normals: F64) -> tuple[F64, F64]:
        """As ``Solid.settled``: (n, 3) mm and (n, 3) unit; the flat ends stay."""
        _, foot, out = self.profile.foot(points[:, [0, 2]])
        on, n = points.copy(), normals.copy()
        side = np.abs(normals[:, 1]) < 0.5
        on[side, 0], on[side, 2] = foot[side, 0], foot[side, 1]
        n[side] = np.column_stack([out[:, 0], np.zeros(len(out)), out[:, 1]])[side]
        return on, n

    def mesh(self) -> TriangleMesh:
        """Closed mesh; the chain begins with its bottom, one level stretch from left to right, face 1."""
        line, faces = self.profile.line()
        low = float(line[:, 1].min())
        build = Builder()
        ends = np.array([-self.half, self.half])
        for a, b, name in zip(line[1:-1], line[2:], faces[1:], strict=True):
            build.quad(*(np.array([p[0], y, p[1]]) for y, p in ((ends[0], b), (ends[0], a), (ends[1], a),
                                                                (ends[1], b))), face=name)
        for a, b in zip(line[1:-1], line[2:], strict=True):
            if a[0] - b[0] < 1e-9:
                continue
            heights = [[z for x, z in line.tolist() if abs(x - p[0]) < 1e-9 and low < z < p[1] - 1e-9] for p in (a, b)]
            edge = [(a[0], low), *((a[0], z) for z in sorted(heights[0])), tuple(a), tuple(b),
                    *((b[0], z) for z in sorted(heights[1], reverse=True)), (b[0], low)]
            for k, y in enumerate(ends.tolist()):
                c = [np.array([x, y, z]) for x, z in edge]
                build.fan(c if k == 0 else c[::-1], face=90 + k)
            build.quad(*(np.array([x, y, low]) for x, y in ((b[0], ends[0]), (b[0], ends[1]), (a[0], ends[1]),
                                                           (a[0], ends[0]))), face=1)
        return build.mesh()


@dataclass(frozen=True)
class Turned:
    """A profile in the distance from Z and the height, turned about Z; the chain is open on the axis."""

    profile: Profile

    def depth(self, points: F64) -> F64:
        """As the module says; points (n, 3), mm."""
        return self.profile.foot(np.column_stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]]))[0]

    def settled(self, points: F64, normals: F64) -> tuple[F64, F64]:
        """As ``Solid.settled``: (n, 3) mm and (n, 3) unit."""
        rho = np.maximum(np.hypot(points[:, 0], points[:, 1]), 1e-9)
        _, foot, out = self.profile.foot(np.column_stack([rho, points[:, 2]]))
        way = points[:, :2] / rho[:, None]
        return (np.column_stack([way * foot[:, :1], foot[:, 1]]), np.column_stack([way * out[:, :1], out[:, 1]]))

    def mesh(self) -> TriangleMesh:
        """Closed mesh."""
        line, faces = self.profile.line()
        widest = float(line[:, 0].max())
        n = math.ceil(math.pi / math.sqrt(2.0 * SAGITTA / widest))
        angle = math.tau * np.arange(n) / n
        way = np.column_stack([np.cos(angle), np.sin(angle)])
        rings = [np.column_stack([way * rho, np.full(n, z)]) for rho, z in line.tolist()]
        return ring_mesh(rings, faces)


@dataclass(frozen=True)
class Pocket:
    """A block -half to half, bottom to 0, with a pocket of rounded corners: face 6 top, 7 walls, 8 floor."""

    half: tuple[float, float]
    bottom: float
    hole: tuple[float, float]
    radius: float
    floor: float

    def depth(self, points: F64) -> F64:
        """As the module says; points (n, 3), mm."""
        aside = -self.inset(points[:, :2])
        under = self.floor - points[:, 2]
        void = np.where((aside > 0) & (under > 0), np.hypot(aside, under), np.maximum(aside, under))
        box = np.minimum(np.asarray(self.half) - np.abs(points[:, :2]), np.inf).min(axis=1)
        return np.minimum(np.minimum(box, void), np.minimum(-points[:, 2], points[:, 2] - self.bottom))

    def inset(self, xy: F64) -> F64:
        """How far inside the outline of the pocket, mm; negative outside."""
        q = np.abs(xy) - (np.asarray(self.hole) - self.radius)
        out = np.hypot(*np.maximum(q, 0.0).T) + np.minimum(q.max(axis=1), 0.0)
        return np.asarray(self.radius - out)

    def settled(self, points: F64, normals: F64) -> tuple[F64, F64]:
        """As ``Solid.settled``: (n, 3) mm and (n, 3) unit; only the round corners move."""
        on, n = points.copy(), normals.copy()
        corner = np.asarray(self.hole) - self.radius
        q = np.abs(points[:, :2]) - corner
        bent = (q > 0).all(axis=1) & (np.abs(normals[:, 2]) < 0.5) & (self.inset(points[:, :2]) > -0.01)
        way = q[bent] / np.linalg.norm(q[bent], axis=1)[:, None] * np.sign(points[bent, :2])
        on[bent, :2] = np.sign(points[bent, :2]) * corner + self.radius * way
        n[bent] = np.column_stack([-way, np.zeros(len(way))])
        return on, n

    def mesh(self) -> TriangleMesh:
        """Closed mesh; faces 1 bottom, 2 sides."""
        n = math.ceil(0.5 * math.pi / math.sqrt(8.0 * SAGITTA / self.radius))
        turn = 0.5 * math.pi * np.arange(n + 1) / n
        corners = [(np.array([sx, sy]) * (np.asarray(self.hole) - self.radius)
                    + self.radius * np.column_stack([np.cos(turn + a), np.sin(turn + a)]))
                   for sx, sy, a in ((1, 1, 0.0), (-1, 1, math.pi / 2), (-1, -1, math.pi), (1, -1, 1.5 * math.pi))]
        inner = np.vstack(corners)
        # the outer ring has its four corners where the arcs of the inner one begin to face them
        outer = np.vstack([np.tile([sx, sy], (n + 1, 1)) * np.asarray(self.half)
                           for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))])
        at = [(outer * 0.0, self.bottom), (outer, self.bottom), (outer, 0.0), (inner, 0.0), (inner, self.floor),
              (inner * 0.0, self.floor)]
        return ring_mesh([np.column_stack([xy, np.full(len(xy), z)]) for xy, z in at], [1, 2, 6, 7, 8])


@dataclass(frozen=True)
class House:
    """Tilted planes on a plate: what is under z = 0 or behind all planes and under the ridge, within the plate's disc.

    planes : (k, 4) float64, unit normals and distances mm from the origin
    ridge  : mm, height of the flat top; ``bottom``, ``reach`` : mm, underside and radius of the plate
    """

    planes: F64 = field(repr=False)
    ridge: float
    bottom: float
    reach: float

    def depth(self, points: F64) -> F64:
        """As the module says; points (n, 3), mm."""
        out = np.minimum(self.reach - np.hypot(points[:, 0], points[:, 1]), points[:, 2] - self.bottom)
        out = np.minimum(out, self.ridge - points[:, 2])
        under = -points[:, 2]
        for plane in self.planes:
            # what is outside here is the wedge above the plate and before the plane
            behind, cosine = plane[3] - points @ plane[:3], plane[2]
            edge = np.sqrt((behind**2 + under**2 - 2.0 * behind * under * cosine) / (1.0 - cosine**2))
            to_plane, to_plate = behind * cosine >= under, under * cosine >= behind
            way = np.where(to_plane & (behind > 0), behind, np.where(to_plate & (under > 0), under, edge))
            out = np.minimum(out, np.where((behind <= 0) & (under <= 0), np.maximum(behind, under), way))
        return np.asarray(out)

    def settled(self, points: F64, normals: F64) -> tuple[F64, F64]:
        """As ``Solid.settled``: facets are exact, so (n, 3) mm and (n, 3) unit come back as they are."""
        return points, normals

    def corners(self, z: float) -> F64:
        """(k, 2) mm, corners of the cut at height z, in the order of the planes: corner i is on planes i and i + 1."""
        flat = self.planes[:, :2]
        left = self.planes[:, 3] - self.planes[:, 2] * z
        pairs = [(i, (i + 1) % len(flat)) for i in range(len(flat))]
        return np.array([np.linalg.solve(flat[[i, j]], left[[i, j]]) for i, j in pairs])

    def mesh(self) -> TriangleMesh:
        """Closed mesh; faces 1 bottom, 2 rim, 3 plate, 4 ridge, 10 and on the planes."""
        k, per = len(self.planes), 90
        low, high = self.corners(0.0), self.corners(self.ridge)
        share = (np.arange(per) / per)[:, None]

        def ring(c: F64) -> F64:
            return np.vstack([c[i - 1] + share * (c[i] - c[i - 1]) for i in range(k)])

        base, top = ring(low), ring(high)
        round_ = self.reach * base / np.linalg.norm(base, axis=1)[:, None]
        at = [(base * 0.0, self.bottom), (round_, self.bottom), (round_, 0.0), (base, 0.0), (top, self.ridge),
              (base * 0.0, self.ridge)]
        rings = [np.column_stack([xy, np.full(len(xy), z)]) for xy, z in at]
        mesh = ring_mesh(rings, [1, 2, 3, 10, 4])
        side = mesh.face_ids == 10
        centre = mesh.triangles[side].mean(axis=1)
        ids = mesh.face_ids.copy()
        ids[side] = 10 + np.argmin(np.abs(centre @ self.planes[:, :3].T - self.planes[:, 3]), axis=1)
        return TriangleMesh(mesh.vertices, mesh.faces, ids)


class Builder:
    """Collects quads into a mesh; facets without area are left out, and it is turned outside out."""

    def __init__(self) -> None:
        self._triangles: list[F64] = []
        self._faces: list[int] = []

    def quad(self, a: F64, b: F64, c: F64, d: F64, face: int) -> None:
        """Add two facets; corners (3,) mm."""
        for t in (np.array([a, b, c]), np.array([a, c, d])):
            if np.linalg.norm(np.cross(t[1] - t[0], t[2] - t[0])) > 1e-10:
                self._triangles.append(t)
                self._faces.append(face)

    def fan(self, corners: list[F64], face: int) -> None:
        """Add a convex polygon, corners (3,) mm in order, as facets round its middle."""
        middle = np.mean(corners, axis=0)
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            self.quad(middle, a, b, b, face)

    def mesh(self) -> TriangleMesh:
        """The mesh, corners at one place made one."""
        corners = np.array(self._triangles).reshape(-1, 3)
        vertices, row = np.unique(np.round(corners, 9), axis=0, return_inverse=True)
        mesh = TriangleMesh(vertices, row.reshape(-1, 3), np.array(self._faces, np.int32))
        return mesh if mesh.volume > 0 else TriangleMesh(vertices, mesh.faces[:, ::-1], mesh.face_ids)


def ring_mesh(rings: list[F64], faces: list[int]) -> TriangleMesh:
    """A closed mesh of bands between rings (n, 3) mm of as many points; the first and last are one point each."""
    build = Builder()
    for a, b, face in zip(rings[:-1], rings[1:], faces, strict=True):
        for i in range(len(a)):
            build.quad(a[i - 1], a[i], b[i], b[i - 1], face=face)
    return build.mesh()


def box_mesh(low: F64, high: F64) -> TriangleMesh:
    """A closed box between corners (3,) mm, face 1."""
    flat = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    mid = np.tile(flat.mean(axis=0), (4, 1))
    at = [(mid, low[2]), (flat, low[2]), (flat, high[2]), (mid, high[2])]
    return ring_mesh([np.column_stack([xy, np.full(4, z)]) for xy, z in at], [1, 1, 1])
