"""Small parts meshed by hand, tools, and plans of them: what the tests of reach and tool paths stand on.

No CAD import: every mesh is vertices and triangles written out, so its true dimensions are known exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.part import FaceInfo, Part
from geometry.sampling import SurfaceSamples, sample_borders, sample_surface
from geometry.tool_body import HolderFrustum, ToolBody
from toolpath.passes.pass_family import FinishTarget
from toolpath.passes.trimmed_faces import TrimmedFace
from toolpath.plan_settings import CutData, Pattern, PlanSettings
from toolpath.planning.job_plan import Plan, plan_job
from toolpath.stock.stock_map import StockMap
from toolpath.workingsteps import CutDirection, TrajectoryKind
from zones.lattice import lattice_step
from zones.machinable_area import machinable_faces
from zones.model import Decomposition
from zones.plan_view.channel_plan import ChannelPlan
from zones.plan_view.regions import Labels, RegionLocator
from zones.reach.access_view import View
from zones.reach.assembly import Clearances
from zones.reach.tip_field import TipField
from zones.zoning.zones import ZoneArea, build_zones

RAMP = math.radians(3.0)


def terraces(xs, ys, heights, base: float = 0.0) -> TriangleMesh:
    """Upright blocks: cell (i, j) between ys[i:i+2] and xs[j:j+2] is filled from ``base`` to heights[i][j], mm.

    One face id per plane and side; 1 is the bottom. Cells no higher than ``base`` are empty.
    """
    h = np.maximum(np.asarray(heights, float), base)
    ids: dict[tuple, int] = {("z", base, -1): 1}
    quads: list[np.ndarray] = []
    face: list[int] = []

    def add(key, corners):
        ids.setdefault(key, len(ids) + 1)
        quads.append(np.asarray(corners, float))
        face.append(ids[key])

    grown = np.pad(h, 1, constant_values=base)
    for i in range(h.shape[0]):
        for j in range(h.shape[1]):
            z, (x0, x1), (y0, y1) = h[i, j], xs[j:j + 2], ys[i:i + 2]
            if z <= base:
                continue
            add(("z", z, 1), [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)])
            add(("z", base, -1), [(x0, y0, base), (x0, y1, base), (x1, y1, base), (x1, y0, base)])
            lo = grown[i + 1, j]
            if lo < z:
                add(("x", x0, -1), [(x0, y0, lo), (x0, y0, z), (x0, y1, z), (x0, y1, lo)])
            lo = grown[i + 1, j + 2]
            if lo < z:
                add(("x", x1, 1), [(x1, y0, lo), (x1, y1, lo), (x1, y1, z), (x1, y0, z)])
            lo = grown[i, j + 1]
            if lo < z:
                add(("y", y0, -1), [(x0, y0, lo), (x1, y0, lo), (x1, y0, z), (x0, y0, z)])
            lo = grown[i + 2, j + 1]
            if lo < z:
                add(("y", y1, 1), [(x0, y1, lo), (x0, y1, z), (x1, y1, z), (x1, y1, lo)])
    start = 4 * np.arange(len(quads))[:, None]
    faces = np.concatenate([start + [0, 1, 2], start + [0, 2, 3]])
    return TriangleMesh(np.concatenate(quads), faces, np.tile(np.array(face, np.int32), 2))


def walls() -> TriangleMesh:
    """Two walls 2 mm thick and 7 high, 8 apart, on a plate 22 x 14 x 3."""
    return terraces([0, 5, 7, 15, 17, 22], [0, 2, 12, 14], [[3] * 5, [3, 10, 3, 10, 3], [3] * 5])


def low_walls() -> TriangleMesh:
    """Two walls 1.5 mm thick and 4 high, 5 apart, on a plate 14 x 8.5 x 2: quick to plan."""
    return terraces([0, 3, 4.5, 9.5, 11, 14], [0, 1.5, 7, 8.5], [[2] * 5, [2, 6, 2, 6, 2], [2] * 5])


def corner() -> TriangleMesh:
    """An L of two walls 4 mm high that meet at (6, 6), on a plate 14 x 14 x 2."""
    return terraces([0, 4, 6, 14], [0, 4, 6, 14], [[2, 2, 2], [2, 6, 6], [2, 6, 2]])


def slope_field(height, size: float = 12.0, n: int = 60, base: float = -3.0) -> TriangleMesh:
    """A block with the top z = height(x, y) over the square from -size/2 to size/2; face 2 is the top."""
    g = np.linspace(-size / 2, size / 2, n + 1)
    x, y = np.meshgrid(g, g)
    top = np.stack([x, y, height(x, y)], -1).reshape(-1, 3)
    cell = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    tri = [np.stack([cell, cell + 1, cell + n + 2], 1), np.stack([cell, cell + n + 2, cell + n + 1], 1)]
    rim = np.concatenate([np.arange(n), n + (n + 1) * np.arange(n), (n + 1) ** 2 - 1 - np.arange(n),
                          (n + 1) * np.arange(n, 0, -1)])
    low = top[rim].copy()
    low[:, 2] = base
    m, k = len(rim), np.arange(len(rim))
    nxt, below = (k + 1) % m, len(top)
    sides = [np.stack([rim, below + k, below + nxt], 1), np.stack([rim, below + nxt, rim[nxt]], 1)]
    centre = len(top) + m
    floor = np.stack([np.full(m, centre), below + nxt, below + k], 1)
    faces = np.concatenate([*tri, *sides, floor])
    ids = np.concatenate([np.full(2 * n * n, 2), np.full(2 * m, 3), np.full(m, 1)]).astype(np.int32)
    return TriangleMesh(np.vstack([top, low, [[0.0, 0.0, base]]]), faces, ids)


def dome(radius: float = 15.0, size: float = 12.0, n: int = 60) -> TriangleMesh:
    """A spherical dome of the given radius with its summit at the origin."""
    return slope_field(lambda x, y: np.sqrt(radius**2 - x**2 - y**2) - radius, size, n)


def bent_strip(radius: float, chord: float, *, hollow: bool = True, upright: bool = True, length: float = 3.0,
               span: float = math.pi / 2, seed: int = 0) -> TriangleMesh:
    """A strip of a cylinder round the axis through the origin, with the exact normals at its corners; face 1.

    hollow  : the material is outside, else inside
    upright : axis along z, strip from z = 0 up and symmetric to x; else axis along x and the strip below (hollow) or
              above it (not), symmetric to z
    chord   : mm, no facet is farther off; the facets are of uneven width
    """
    rng = np.random.default_rng(seed)
    widest = 2.0 * math.acos(1.0 - chord / radius)
    share = np.cumsum(np.concatenate([[0.0], rng.uniform(0.5, 1.0, max(2, math.ceil(1.4 * span / widest)))]))
    angle = span * (share / share[-1] - 0.5)
    assert np.diff(angle).max() <= widest
    way = np.stack([np.cos(angle), np.sin(angle)], 1)
    n, out = len(angle), np.zeros((2, len(angle), 3))
    normal = out.copy()
    if upright:
        out[..., :2], out[1, :, 2] = radius * way, length
        normal[..., :2] = -way if hollow else way
    else:
        down = np.stack([way[:, 1], -way[:, 0] if hollow else way[:, 0]], 1)
        out[..., 1:], out[1, :, 0] = radius * down, length
        normal[..., 1:] = -down if hollow else down
    k = np.arange(n - 1)
    faces = np.concatenate([np.stack([k, k + 1, n + k + 1], 1), np.stack([k, n + k + 1, n + k], 1)])
    corners = normal.reshape(-1, 3)[faces]
    mesh = TriangleMesh(out.reshape(-1, 3), faces, np.ones(len(faces), np.int32), corners)
    against = np.einsum("ij,ij->i", mesh.normals, corners.mean(axis=1)) < 0
    faces[against] = faces[against][:, ::-1]
    return TriangleMesh(mesh.vertices, faces, mesh.face_ids, normal.reshape(-1, 3)[faces])


def ball(diameter: float = 4.0, id: str = "T1", **changes) -> ToolBody:
    """A ball-end tool with a thin neck and a shank that reaches nothing, unless told otherwise."""
    return tool(diameter, diameter / 2, id, **changes)


def tool(diameter: float, corner_radius: float, id: str = "T1", *, neck: float = 60.0, shank: float | None = None,
         stickout: float = 80.0, holder: tuple[HolderFrustum, ...] = ()) -> ToolBody:
    """A tool assembly, mm."""
    shank = diameter if shank is None else shank
    return ToolBody(id, 1, diameter, corner_radius, 2.0 * diameter, 0.95 * diameter, neck, shank, stickout, holder)


def as_part(mesh: TriangleMesh) -> Part:
    """The mesh as a Part without edges."""
    faces = tuple(FaceInfo(int(f), "plane", float(mesh.areas[mesh.face_ids == f].sum()), False, 0.0, 0.0)
                  for f in range(1, int(mesh.face_ids.max()) + 1))
    return Part(mesh, faces, (), mesh.volume, mesh.bounds, "mm", 0.001, 0.1, 0.0, (), "0" * 64)


def prism(profile, fans, wide: float) -> Part:
    """A closed ring in X and Z along Y from -wide to wide; faces 1.. along it, then the two ends.

    fans : triangles of the ring's points that fill it
    """
    n = len(profile)
    v = [(x, y, z) for y in (-wide, wide) for x, z in profile]
    faces, ids = [], []
    for k in range(n):
        a, b = k, (k + 1) % n
        faces += [(a, b + n, b), (a, a + n, b + n)]
        ids += [k + 1] * 2
    for q in fans:
        faces += [q, (q[0] + n, q[2] + n, q[1] + n)]
        ids += [n + 1, n + 2]
    mesh = TriangleMesh(np.array(v, float), np.array(faces, np.int32), np.array(ids, np.int32))
    assert mesh.volume > 0
    return as_part(mesh)


def box_mesh(lower, upper) -> TriangleMesh:
    """A closed box, face id 0."""
    m = terraces([lower[0], upper[0]], [lower[1], upper[1]], [[upper[2]]], lower[2])
    return TriangleMesh(m.vertices, m.faces)


def joined(*meshes: TriangleMesh) -> TriangleMesh:
    """All triangles of several meshes."""
    start = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return TriangleMesh(np.concatenate([m.vertices for m in meshes]),
                        np.concatenate([m.faces + s for m, s in zip(meshes, start[:-1], strict=True)]),
                        np.concatenate([m.face_ids for m in meshes]))


def field_of(mesh: TriangleMesh | TriangleTree, body: ToolBody, allowance: float = 0.0,
             clear: Clearances | None = None, margin: float = 4.0) -> TipField:
    """The tip limit of a tool over a mesh."""
    tree = mesh if isinstance(mesh, TriangleTree) else TriangleTree(mesh)
    return TipField(tree, body, clear or Clearances(), tree.mesh.bounds, body.radius + margin, lattice_step(body),
                    allowance)


def samples_of(mesh: TriangleMesh, density: float, faces: set[int] | None = None) -> SurfaceSamples:
    """Even samples of the faces asked for and samples without area along their borders."""
    tri = np.flatnonzero(np.isin(mesh.face_ids, sorted(faces)) if faces else np.ones(len(mesh.faces), bool))
    even, edge = sample_surface(mesh, density, seed=1, triangles=tri), sample_borders(mesh, 0.4, 0.004, tri)
    return SurfaceSamples(*(np.concatenate([getattr(even, f), getattr(edge, f)])
                            for f in ("points", "normals", "area", "face", "triangle")))


def blocks(seed):
    """Upright blocks of random widths and heights; the gaps between are as wide as the tools, or less."""
    rng = np.random.default_rng(seed)
    xs, ys = (np.concatenate([[0.0], np.cumsum(rng.uniform(0.8, 4.5, 5))]) for _ in range(2))
    return terraces(xs, ys, rng.choice([1.0, 1.0, 2.5, 5.0, 8.0], (5, 5)))


HOLDER = (HolderFrustum(8, 14, 5), HolderFrustum(14, 14, 20))
SHORT_TOOLS = {
    "ball": ball(2.0, neck=2.5, shank=3.4, stickout=5.0, holder=HOLDER),
    "flat": tool(2.0, 0.0, neck=2.5, shank=3.4, stickout=5.0, holder=HOLDER),
    "bull": tool(2.4, 0.4, neck=2.5, shank=3.4, stickout=5.0, holder=HOLDER),
}
"""Tools whose shank and holder soon meet what stands round them."""


def view_of(part: Part, samples: SurfaceSamples, fields: dict[str, TipField],
            decomposition: Decomposition | None = None,
            labels: Labels | None = None, obstacles: TriangleTree | None = None) -> View:
    """The part from +Z; regions by the plan view unless ``labels`` are given."""
    d = decomposition or Decomposition((), (), ())
    tree = TriangleTree(part.mesh)
    locator = RegionLocator(part, d, ChannelPlan.of(part, d))
    named = labels or locator.of(samples.points, samples.normals, samples.face)
    return View("A1", np.eye(3), part, tree, obstacles or tree, samples, named, fields, locator, np.eye(3))


@dataclass(frozen=True, eq=False)
class Case:
    """A planned part and all that went into the plan."""

    part: Part
    tree: TriangleTree
    samples: SurfaceSamples
    view: View
    fields: dict[str, TipField]
    zones: list[ZoneArea]
    settings: PlanSettings
    stock_before: StockMap
    plan: Plan

    def moves(self, *motions: TrajectoryKind) -> list[tuple[ToolBody, F64]]:
        """The tool and the points of every trajectory of these motions, all but rapids where none is named."""
        wanted = motions or tuple(m for m in TrajectoryKind if m is not TrajectoryKind.RAPID)
        return [(s.tool, t.points) for s in self.plan.steps for t in s.trajectories if t.motion in wanted]


def plan_part(mesh: TriangleMesh, tools: list[ToolBody], *, scallop: float = 0.02, chord: float = 0.004,
              allowance: float = 0.0, cut_direction: CutDirection = CutDirection.CLIMB, roughing: bool = True,
              near_net: bool = True, faces: set[int] | None = None, fixtures: tuple = (), density: float = 30.0,
              step_down: float = 0.3, spare: float = 1.0, trimmed: tuple[TrimmedFace, ...] = (),
              pattern: Pattern = Pattern.AUTO) -> Case:
    """Zones and plan of a part; ``step_down`` in tool diameters, ``fixtures`` as (lower, upper) boxes.

    ``spare`` is what a block of stock stands wider than the part, mm; ``trimmed`` are its exact faces, if any.
    """
    part = as_part(mesh)
    tree = TriangleTree(mesh)
    obstacles = TriangleTree(joined(mesh, *(box_mesh(*f) for f in fixtures))) if fixtures else tree
    nothing = Decomposition((), (), ())
    everything = samples_of(mesh, density, None)
    samples = everything.subset(np.isin(everything.face, sorted(
        machinable_faces(everything, nothing.seat, faces, {1}))))
    fields = {t.id: TipField(obstacles, t, Clearances(), mesh.bounds, t.radius + max(4.0, spare + t.radius),
                             lattice_step(t), allowance, scallop) for t in tools}
    view = view_of(part, samples, fields, obstacles=obstacles)
    lift = max(0.1 * scallop, 0.002)
    zones = list(build_zones([view], nothing, scallop, lift).zones)
    lo, hi = mesh.bounds[0] - [spare, spare, 1.0], mesh.bounds[1] + [spare, spare, 1.0]
    stock = StockMap.around(tree, mesh.bounds, 1.0, 0.12) if near_net else StockMap.box(tree, lo, hi, 0.12)
    before = StockMap(stock.lattice, stock.top.copy())
    floor = math.ceil(max(stock.highest, *(f[1][2] for f in fixtures), *(mesh.bounds[:, 2]))) + 1.0
    settings = PlanSettings(scallop, chord, allowance, lift, floor + 1.0, floor, RAMP, roughing, True,
                            cut_direction, pattern)
    cut = {t.id: CutData(10_000, 800, 200, 3000, step_down * t.diameter) for t in tools}
    checks = [FinishTarget(samples.points[z.samples], samples.normals[z.samples], z.tips, density ** -0.5)
              for z in zones]
    plan = plan_job(zones, checks, fields, cut, stock, settings,
                    trimmed={z.id: [f for f in trimmed if f.face in z.faces] for z in zones})
    return Case(part, tree, samples, view, fields, zones, settings, before, plan)


SURFACES = {
    "dome": lambda: dome(),
    "valley": lambda: slope_field(lambda x, y: 0.08 * x * x - 0.03 * y * y),
    "ripples": lambda: slope_field(lambda x, y: 0.3 * np.sin(2.0 * x) * np.cos(y)),
    "walls": walls,
}
