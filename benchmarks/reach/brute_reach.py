"""What a setup could reach of a part, by brute force: a height map, dilated by every tool, asked point by point.

Run from the root of the checkout: ``python benchmarks/reach/brute_reach.py PART.step SETUP.json [--step MM]``. It is
the peer that the coverage of a job is held against, and shares nothing with the planner but the STEP reader. Normals of
samples are those of the CAD faces at the foot of each sample, asked of the kernel one by one (``kernel_normals``):

1. h(x, y), the highest material over every node of a square grid, by rasterising the triangles.
2. H(c) = max over nodes p of h(p) - f(|p - c|), the lowest tip over node c; f(d) is the height of the cutter's
   bottom at distance d from its axis. Shank and holder, grown by their clearances, do the same on a grid twice as
   coarse whose cells hold the highest h in them.
3. A sample p with normal n is *touched* where the tool's own geometry puts the axis, p + r n + (R - r) n_xy/|n_xy|,
   and the tip, p_z + r (n_z - 1): if on one of the four nodes round that axis, so within one cell of it, the tip may
   go down to that height. Under a flat or bull end a level facet is touched by the whole bottom: there any node
   within R - r of the sample will do. A sharp-cornered end counts only on level facets and on walls so upright that
   steps of 0.1 mm keep the scallop; elsewhere it leaves steps.
4. A sample is *clean* if it is touched, or if all but the allowed scallop can be taken off it: the point
   q = p + (scallop + one cell) n lies under no tool position, that is, min over c of H(c) + f(|q - c|) <= q_z.
5. The area of either, over the area of the faces the access sees less the seat, is a coverage. A program proved to
   the scallop must come to lie between the two: touched areas can all be cut, what is not clean cannot.

Fixtures are obstacles grown by the rapid clearance.

Error: every place is off by at most a cell diagonal, towards reach, so the border between reachable and not lies
within that of the truth and the coverage is high by an amount that falls with the step. ``estimate`` computes it at
two steps and extends the line to a step of nothing; its ``error`` is the difference between the fine and the extended.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402
from numba import njit, prange  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

F64 = NDArray[np.float64]
Rows = NDArray[np.int64]
Normals = Callable[[F64, Rows], F64]
"""Points (n, 3) mm and the (n,) triangles they lie on -> unit normals (n, 3) out of the material."""

SEEN = -0.02  # n_z above: the access direction sees it
LEVEL = 1.0 - 1e-6  # n_z above: level
UPRIGHT_STEP = 0.1  # mm, step down at which a sharp-cornered end must keep the scallop on a wall
HOLDER_SLICES = 12
MAX_WORK = 1.0e10
SAMPLES = 400_000
MAX_DENSITY = 100.0  # samples a mm²
SEED = 7
FOOT = 2.0  # deviations of the mesh: a sample is no farther from the face it lies on, else the foot is another place


@dataclass(frozen=True)
class Grid:
    """A square grid; node (i, j) stands at (x0 + j step, y0 + i step), mm."""

    x0: float
    y0: float
    step: float
    nx: int
    ny: int


@dataclass(frozen=True)
class BruteTool:
    """One tool as brute force sees it, mm: cutter radius and corner, and wider discs (radius, height of the face)."""

    id: str
    radius: float
    corner: float
    discs: tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class Reach:
    """What was found at one step.

    area    : mm², machinable
    touched : (n,) bool, per sample; every sample stands for the same area
    clean   : (n,) bool, touched or within the scallop
    by_tool : share of the machinable area each tool touches, by tool id
    """

    area: float
    touched: NDArray[np.bool_]
    clean: NDArray[np.bool_]
    by_tool: dict[str, float]


@njit(cache=True)
def rasterise(triangles: F64, x0: float, y0: float, step: float, out: F64) -> None:
    """Raise ``out`` (ny, nx) to the highest point of ``triangles`` (m, 3, 3) over every node, mm."""
    ny, nx = out.shape
    for t in range(len(triangles)):
        ax, ay, az = triangles[t, 0]
        bx, by, bz = triangles[t, 1]
        cx, cy, cz = triangles[t, 2]
        twice = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if abs(twice) < 1e-14:
            continue
        j0 = max(int(math.ceil((min(ax, bx, cx) - x0) / step)), 0)
        j1 = min(int(math.floor((max(ax, bx, cx) - x0) / step)), nx - 1)
        i0 = max(int(math.ceil((min(ay, by, cy) - y0) / step)), 0)
        i1 = min(int(math.floor((max(ay, by, cy) - y0) / step)), ny - 1)
        for i in range(i0, i1 + 1):
            y = y0 + i * step
            for j in range(j0, j1 + 1):
                x = x0 + j * step
                u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / twice
                v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / twice
                w = 1.0 - u - v
                if u >= -1e-9 and v >= -1e-9 and w >= -1e-9:
                    out[i, j] = max(out[i, j], u * az + v * bz + w * cz)


@njit(cache=True, parallel=True)
def dilate(height: F64, reach: int, profile: F64) -> F64:
    """(ny, nx): max over nodes within the profile of height less profile; profile (2 reach + 1)², inf outside it."""
    ny, nx = height.shape
    out = np.full((ny, nx), -np.inf)
    for i in prange(ny):
        for di in range(-reach, reach + 1):
            k = i + di
            if k < 0 or k >= ny:
                continue
            for dj in range(-reach, reach + 1):
                lift = profile[di + reach, dj + reach]
                if lift == np.inf:
                    continue
                lo, hi = max(0, -dj), min(nx, nx - dj)
                for j in range(lo, hi):
                    top = height[k, j + dj] - lift
                    if top > out[i, j]:
                        out[i, j] = top
    return out


@njit(cache=True, parallel=True)
def disc_extreme(field: F64, reach: int, half: NDArray[np.int64], sign: float) -> F64:
    """(ny, nx): max (sign 1) or min (sign -1) of field over a disc whose row di is 2 half[di + reach] + 1 nodes wide.

    Each row of the disc is a sliding maximum kept in a queue, so the cost per node is the number of rows.
    """
    ny, nx = field.shape
    out = np.full((ny, nx), -np.inf)
    for i in prange(ny):
        queue = np.empty(nx, np.int64)
        for di in range(-reach, reach + 1):
            k = i + di
            if k < 0 or k >= ny:
                continue
            w = half[di + reach]
            head = tail = 0
            last = 0
            for j in range(nx):
                while last < nx and last <= j + w:
                    while tail > head and sign * field[k, queue[tail - 1]] <= sign * field[k, last]:
                        tail -= 1
                    queue[tail] = last
                    tail += 1
                    last += 1
                while queue[head] < j - w:
                    head += 1
                top = sign * field[k, queue[head]]
                if top > out[i, j]:
                    out[i, j] = top
    return sign * out


@njit(cache=True, parallel=True)
def swept(limit: F64, height: F64, x0: float, y0: float, step: float, radius: float, corner: float,
          points: F64) -> NDArray[np.bool_]:
    """(n,) bool: a tool on some node, its tip at the limit there or above, holds the point of points (n, 3), mm."""
    ny, nx = limit.shape
    out = np.zeros(len(points), np.bool_)
    for k in prange(len(points)):
        x, y, z = points[k]
        j, i = int((x - x0) / step), int((y - y0) / step)
        if min(height[i, j], height[i, j + 1], height[i + 1, j], height[i + 1, j + 1]) > z:
            continue  # under material
        i0, i1 = max(int(math.ceil((y - radius - y0) / step)), 0), min(int((y + radius - y0) / step), ny - 1)
        j0, j1 = max(int(math.ceil((x - radius - x0) / step)), 0), min(int((x + radius - x0) / step), nx - 1)
        for a in range(i0, i1 + 1):
            if out[k]:
                break
            for b in range(j0, j1 + 1):
                room = z - limit[a, b]
                if room < 0.0:
                    continue
                d = math.hypot(x0 + b * step - x, y0 + a * step - y)
                if d > radius:
                    continue
                beyond = max(d - (radius - corner), 0.0)
                if room >= corner - math.sqrt(max(corner * corner - beyond * beyond, 0.0)):
                    out[k] = True
                    break
    return out


def cutter_profile(radius: float, corner: float, step: float) -> tuple[int, F64]:
    """Height of a cutter's bottom over the nodes within its radius; (reach in nodes, square array, mm)."""
    reach = int(radius / step + 1e-9)
    k = step * np.arange(-reach, reach + 1)
    d = np.hypot(k[:, None], k[None, :])
    beyond = np.maximum(d - (radius - corner), 0.0)
    bottom = corner - np.sqrt(np.maximum(corner**2 - beyond**2, 0.0))
    return reach, np.where(d <= radius + 1e-12, bottom, np.inf)


def disc_rows(radius: float, step: float) -> tuple[int, NDArray[np.int64]]:
    """Rows of a disc on a grid: reach in nodes and half width of every row."""
    reach = int(radius / step + 1e-9)
    k = step * np.arange(-reach, reach + 1)
    return reach, np.floor(np.sqrt(np.maximum(radius**2 - k**2, 0.0)) / step + 1e-9).astype(np.int64)


def pooled(height: F64, by: int) -> F64:
    """Highest value in every block of ``by`` x ``by`` nodes; the last block may be smaller."""
    ny, nx = height.shape
    full = np.full((-(-ny // by) * by, -(-nx // by) * by), -np.inf)
    full[:ny, :nx] = height
    return np.asarray(full.reshape(full.shape[0] // by, by, full.shape[1] // by, by).max(axis=(1, 3)))


def tip_limit(height: F64, tool: BruteTool, step: float) -> F64:
    """H (ny, nx) mm: lowest tip of the whole assembly over every node."""
    reach, profile = cutter_profile(tool.radius, tool.corner, step)
    if tool.corner > 0:
        limit = dilate(height, reach, profile)
    else:
        limit = disc_extreme(height, *disc_rows(tool.radius, step), 1.0)
    coarse = pooled(height, 2)
    top, deepest = float(height.max()), float(limit[np.isfinite(limit)].min())
    for radius, above in tool.discs:
        if top - above > deepest:
            block = disc_extreme(coarse, *disc_rows(radius, 2 * step), 1.0) - above
            limit = np.maximum(limit, np.repeat(np.repeat(block, 2, 0), 2, 1)[: len(limit), : limit.shape[1]])
    return limit


def able(tool: BruteTool, normals: F64, scallop: float) -> NDArray[np.bool_]:
    """(n,) bool: the end leaves no steps on facets with these normals (n, 3); see the head of this file, 3."""
    upright = np.abs(normals[:, 2]) <= 0.5 * scallop / UPRIGHT_STEP
    return np.full(len(normals), tool.corner > 0) | upright | (normals[:, 2] > LEVEL)


def reaches(tool: BruteTool, limit: F64, grid: Grid, points: F64, normals: F64, scallop: float) -> NDArray[np.bool_]:
    """(n,) bool: the tool touches samples with points (n, 3) mm and normals (n, 3)."""
    r, flat = tool.corner, tool.radius - tool.corner
    level = normals[:, 2] > LEVEL
    across = np.linalg.norm(normals[:, :2], axis=1)
    side = np.where(across > 1e-3, 1.0 / np.maximum(across, 1e-12), 0.0)[:, None] * normals[:, :2]
    axis = points[:, :2] + r * normals[:, :2] + flat * side
    tip = points[:, 2] + r * (normals[:, 2] - 1.0)
    allowed = tip + 0.5 * grid.step + 1e-6
    found = np.zeros(len(points), np.bool_)
    j = np.floor((axis[:, 0] - grid.x0) / grid.step).astype(np.int64)
    i = np.floor((axis[:, 1] - grid.y0) / grid.step).astype(np.int64)
    for di in (0, 1):
        for dj in (0, 1):
            found |= limit[i + di, j + dj] <= allowed
    found &= able(tool, normals, scallop)
    if flat > 0:
        lowest = disc_extreme(limit, *disc_rows(flat, grid.step), -1.0)
        j = np.rint((points[level, 0] - grid.x0) / grid.step).astype(np.int64)
        i = np.rint((points[level, 1] - grid.y0) / grid.step).astype(np.int64)
        found[level] = lowest[i, j] <= points[level, 2] + 0.5 * grid.step
    return np.asarray(found & (normals[:, 2] > SEEN))


def tools_of(setup: dict[str, Any]) -> list[BruteTool]:
    """The tools of a setup with all defaults filled in."""
    clear, out = setup["clearance_mm"], []
    for t in setup["tools"]:
        radius = 0.5 * t["diameter_mm"]
        discs = []
        if t["shank_diameter_mm"] > t["diameter_mm"]:
            discs.append((0.5 * t["shank_diameter_mm"] + clear["shank"], t["neck_length_mm"]))
        z = t["stickout_mm"]
        for s in t["holder"]:
            low, high = s["diameter_mm"], s["diameter_top_mm"]
            n = 1 if low == high else HOLDER_SLICES
            for k in range(n):
                wide = low + (high - low) * (k + 0.5) / n
                discs.append((0.5 * wide + clear["holder"], z + s["length_mm"] * k / n))
            z += s["length_mm"]
        out.append(BruteTool(t["id"], radius, t["corner_radius_mm"], tuple(discs)))
    return out


def machinable(mesh: Any, wanted: set[int] | None = None, excluded: set[int] | None = None) -> Rows:
    """Indices of the triangles of the faces the access sees; a face that only looks down is the seat or hidden."""
    seen = np.unique(mesh.face_ids[mesh.normals[:, 2] > SEEN])
    faces = set(seen.tolist()) if wanted is None else wanted
    return np.flatnonzero(np.isin(mesh.face_ids, sorted(faces - (excluded or set()))))


def scattered(mesh: Any, triangles: Rows, count: int) -> tuple[F64, Rows]:
    """Random points of equal area on some triangles: (n, 3) mm and the (n,) triangles they lie on."""
    rng = np.random.default_rng(SEED)
    share = np.cumsum(mesh.areas[triangles])
    pick = triangles[np.minimum(np.searchsorted(share, (np.arange(count) + rng.random(count)) * share[-1] / count),
                                len(triangles) - 1)]
    a, b = rng.random((2, count, 1))
    fold = a + b > 1
    a, b = np.where(fold, 1 - a, a), np.where(fold, 1 - b, b)
    t = mesh.triangles[pick]
    return t[:, 0] + a * (t[:, 1] - t[:, 0]) + b * (t[:, 2] - t[:, 0]), pick


def kernel_normals(part: Any, path: Path, setup: Any) -> Normals:
    """Normals of the CAD faces at the foot of every point, from the STEP file, not from the nodes of the mesh.

    Where the kernel has no normal, or its foot is another place, the facet's is taken. 20 to 130 µs a point.
    """
    from benchmarks.reach.exact_faces import ExactFaces
    from geometry.setup_frame import SetupFrame

    p = setup.placement
    placement = SetupFrame(origin=tuple(p.origin_mm), z_axis=tuple(p.z_axis), x_axis=tuple(p.x_axis))
    faces = ExactFaces(path, placement=placement, solid=setup.part.solid)
    near = FOOT * max(part.deviation, part.chord)

    def of(points: F64, triangles: Rows) -> F64:
        out = part.mesh.normals[triangles].copy()
        numbers = part.mesh.face_ids[triangles]
        for number in np.unique(numbers).tolist():
            rows = np.flatnonzero(numbers == number)
            found = faces.evaluate(number, points[rows])
            good = (found.distance <= near) & np.isfinite(found.normals).all(axis=1)
            out[rows[good]] = found.normals[good]
        return out
    return of


@dataclass(frozen=True, eq=False)
class Drawn:
    """The samples of both steps: points (n, 3) mm, unit normals (n, 3), and the machinable area, mm²."""

    points: F64
    normals: F64
    area: float


def drawn(mesh: Any, setup: dict[str, Any], normals: Normals | None = None) -> Drawn:
    """Samples of the machinable area; without ``normals`` those of the facets, right for a body of planes only."""
    ops = setup["operations"]
    numbers = [None if v is None else {int(f[1:]) for f in v} for v in (ops["faces"], ops["exclude_faces"])]
    chosen = machinable(mesh, numbers[0], numbers[1])
    area = float(mesh.areas[chosen].sum())
    points, triangles = scattered(mesh, chosen, int(min(SAMPLES, MAX_DENSITY * area) + 1))
    return Drawn(points, mesh.normals[triangles] if normals is None else normals(points, triangles), area)


def brute_reach(mesh: Any, setup: dict[str, Any], step: float, samples: Drawn) -> Reach:
    """Coverage a setup could have on a mesh in the setup frame.

    mesh    : TriangleMesh with face ids, mm
    setup   : the setup as plain data, defaults filled in
    step    : mm, of the grid
    samples : ``drawn`` of both
    """
    points, normals = samples.points, samples.normals
    tools = tools_of(setup)
    lo, hi = mesh.bounds[0, :2], mesh.bounds[1, :2]
    margin = max(2 * t.radius for t in tools) + 4 * step
    nx, ny = (np.ceil((hi - lo + 2 * margin) / step).astype(int) + 1).tolist()
    # walls that lie on nodes would leave it to rounding which side of them a node is
    grid = Grid(float(lo[0] - margin - 0.382 * step), float(lo[1] - margin - 0.618 * step), step, nx + 1, ny + 1)
    height = np.full((grid.ny, grid.nx), -np.inf)
    rasterise(mesh.triangles, grid.x0, grid.y0, step, height)
    _fixtures(height, grid, setup)
    scallop = setup["quality"]["scallop_height_mm"]
    near = points + (scallop + step) * normals
    touched, clean, by_tool = np.zeros(len(points), np.bool_), np.zeros(len(points), np.bool_), {}
    for t in tools:
        limit = tip_limit(height, t, step)
        found = reaches(t, limit, grid, points, normals, scallop)
        by_tool[t.id] = float(found.mean())
        touched |= found
        left = np.flatnonzero(~(clean | touched) & able(t, normals, scallop))
        if len(left):
            clean[left] = swept(limit, height, grid.x0, grid.y0, step, t.radius, t.corner, near[left])
    return Reach(samples.area, touched, clean | touched, by_tool)


def _fixtures(height: F64, grid: Grid, setup: dict[str, Any]) -> None:
    grow = setup["clearance_mm"]["rapid"]
    x = grid.x0 + grid.step * np.arange(grid.nx)
    y = grid.y0 + grid.step * np.arange(grid.ny)
    for fixture in setup["fixtures"]:
        lo, hi = np.array(fixture["box_mm"][0]) - grow, np.array(fixture["box_mm"][1]) + grow
        inside = np.ix_((y >= lo[1]) & (y <= hi[1]), (x >= lo[0]) & (x <= hi[0]))
        height[inside] = np.maximum(height[inside], hi[2])


def default_step(mesh: Any, tools: list[BruteTool]) -> float:
    """0.05 mm, or what keeps the dilation by the widest round tool at ``MAX_WORK`` sums."""
    widest = max((t.radius for t in tools if t.corner > 0), default=1.0)
    size = mesh.bounds[1, :2] - mesh.bounds[0, :2] + 4.0 * widest
    return max(0.05, (float(size[0] * size[1]) * math.pi * widest**2 / MAX_WORK) ** 0.25)


def estimate(mesh: Any, setup: dict[str, Any], step: float | None = None,
             normals: Normals | None = None) -> dict[str, Any]:
    """Both coverages at ``step`` and at twice that, and the line through both extended to a step of nothing.

    mesh, setup, step : as in ``brute_reach``; normals : as in ``drawn``
    """
    step, samples = step or default_step(mesh, tools_of(setup)), drawn(mesh, setup, normals)
    coarse, fine = brute_reach(mesh, setup, 2 * step, samples), brute_reach(mesh, setup, step, samples)
    out: dict[str, Any] = {"step_mm": round(step, 4), "machinable_area_mm2": round(fine.area, 3)}
    for name in ("touched", "clean"):
        at, twice = float(getattr(fine, name).mean()), float(getattr(coarse, name).mean())
        out[name] = {"coverage": round(2 * at - twice, 5), "area_mm2": round((2 * at - twice) * fine.area, 3),
                     "error": round(abs(twice - at), 5), "at_step": round(at, 5), "at_twice_step": round(twice, 5)}
    return out | {"touched_by_tool": {k: round(v, 5) for k, v in fine.by_tool.items()}}


def reach_of_files(part_path: Path, setup_path: Path, step: float | None = None) -> dict[str, Any]:
    """``estimate`` of a STEP file and a SETUP.json.

    Raises
    ------
    CamError
        Either file is wrong.
    """
    from service.from_wire import read_setup
    from service.part_reading import load

    setup = read_setup(setup_path)
    part = load(part_path, setup)
    return estimate(part.mesh, setup.model_dump(mode="json"), step, kernel_normals(part, part_path, setup))


def main() -> None:
    """Print the figure."""
    parser = argparse.ArgumentParser(description="coverage a setup could have on a part, by brute force")
    parser.add_argument("part", type=Path)
    parser.add_argument("setup", type=Path)
    parser.add_argument("--step", type=float, default=None, help="mm of the grid; default: see default_step")
    args = parser.parse_args()
    print(json.dumps(reach_of_files(args.part, args.setup, args.step), indent=1))


if __name__ == "__main__":
    main()
