"""Whether reach is right: every sample of a part asked of ``zones.reach.tip_field`` and of a dense cloud of points.

Run from the root of the checkout: ``python benchmarks/reach/brute_samples.py [RECIPE:SEED ...] [--json FILE]``, or with
``PART.step:SETUP.json`` for a name. Without names 30 parts of the family are taken. Reach is asked with the normals the
planner gives its samples; the brute force has its own, those of the CAD faces at the foot of each sample, and shares
nothing with the planner but the reader of STEP files. So a normal of the planner that keeps a tool out counts as wrong:

1. The surface becomes a *cloud*: on every triangle rows along its longest edge, ``SPACING`` apart along a row and 0.7
   of that between rows, and points ``SPACING`` apart along sharp edges. No point of the mesh is farther than
   hypot(0.5, 0.7) ``SPACING`` from the cloud. Of points over each other within ``THIN`` the highest is kept.
2. The tool is a *solid of revolution*: cutting part, shank with clearance, holder frusta with clearance, each going on
   upwards, for the tool comes down from there. A tip is *admissible* if no point of the cloud is inside the solid by
   more than ``DEPTH`` along the axis.
3. A sample p with normal n is *reached* if some contact is admissible: the profile's own normal n at p + lift n, that
   tip lowered along the flank on steep places, and on level ones under a flat end any of 161 places under the flat.

A point of the cloud inside is a point of the part inside; but the part can be inside by the spacing where no point of
the cloud is. So the same is asked of the solid shrunk and grown by the *band*, the reach of the cloud plus the lift.
What ``touchable`` says is *wrong* beyond the band where both contradict it; *wrong level* are those of them on level
places under a flat end. A union of tools is wrong where what it says differs from the solids, those tools taken at
their word that are right within their band.

``touchable`` is asked without its sideways play. Shank and holder are looked up on a grid there and said to be kept
up to 0.57 mm (a frustum: one slice more) farther away than asked and a scallop height higher: against a grown solid
they are grown by that too. What play and look-up cost is measured apart, against the solid as it is; so is what would
be gained if contacts whose normal leans from n, but whose profile still passes p within the lift, were tried.

A grown solid stands farther from the wall it touches by as much as it is grown, so on its own wall it sees no better
than the solid itself: where facets of a steep wall ripple by thousandths of a millimetre, some samples count as wrong
that reach is right about. That was at most 0.03 % of area on the parts tried.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402
from numba import njit, prange  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

from benchmarks.reach.brute_reach import kernel_normals, machinable, scattered  # noqa: E402

F64 = NDArray[np.float64]
BOOL = NDArray[np.bool_]

SPACING = 0.04  # mm, of the cloud
ROW = 0.7  # between rows, in spacings
THIN = 0.01  # mm in plan: of points nearer together the highest is kept
SHARP = math.radians(3.0)  # an edge between facets that turn more than this gets points of its own
SAMPLES = 100_000
DEPTH = 2e-5  # mm along the axis: reach itself stands 1e-5 above the contact
FINE, BLOCK = 0.2, 8  # mm, cells of the cloud in plan; fine cells along a coarse one
FEW = 1000  # queries below this are not worth waking a second thread for
SEEN, LEVEL, STEEP = -0.02, 1.0 - 1e-6, 0.5  # of n_z
UNDER_FLAT = [(q, 2 * math.pi * k / 32) for q in (0.25, 0.5, 0.75, 0.9, 1.0) for k in range(32)]
FLANK = (0.25, 0.5, 0.75, 1.0)
LEANS = [(q, 2 * math.pi * k / 12) for q in (0.5, 0.97) for k in range(12)]
LEAN_EVERY = 10  # of the samples, one is asked for leaning contacts
LOOKED_UP_WIDER = 0.4 * math.sqrt(2.0)  # mm, what reach may grow shank and holder by
SLICES = 6  # of a frustum, in reach
DEFAULT = (*(f"random:{k}" for k in range(1, 15)), "demo:0", "demo:5", *(f"narrow:{k}" for k in (1, 2, 3)),
           *(f"leaning_pair:{k}" for k in (2, 3, 4)), *(f"three_walls:{k}" for k in (3, 4)),
           *(f"wavy:{k}" for k in (5, 6, 7)), *(f"impeller:{k}" for k in (4, 5, 6)))


@dataclass(frozen=True)
class Solid:
    """A tool as a solid of revolution, mm, heights from the tip.

    radius, corner : of the cutting part
    flute          : its length
    bodies         : (k, 4) radius below, radius above, height of the lower end, length over which one becomes the other
    """

    radius: float
    corner: float
    flute: float
    bodies: F64

    def grown(self, by: float, wider: float = 0.0, slices: int = 0, higher: float = 0.0) -> Solid:
        """All round by ``by`` (shrunk where negative), shank and holder by twice that and ``wider`` more.

        slices : if not 0, frusta become as wide at each height as the slice of so many that it lies in
        """
        bodies = self.bodies.copy()
        if slices:
            bodies[:, 2] -= np.where(bodies[:, 1] > bodies[:, 0], bodies[:, 3] / slices, 0.0)
        bodies[:, :2] = np.maximum(bodies[:, :2] + 2 * by + wider, 0.0)
        bodies[:, 2] -= by + higher
        return Solid(self.radius + by, max(self.corner + by, 0.0) if self.corner > 0 else 0.0, self.flute, bodies)


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points of a surface by cells in plan, the highest of each cell first.

    points : (n, 3) float64, mm; start : (cells + 1,) int64; top, coarse : highest z of fine and coarse cells
    """

    points: F64
    start: NDArray[np.int64]
    top: F64
    coarse: F64
    x0: float
    y0: float


@njit(cache=True)
def _fill(tri: F64, spacing: float, row: float, out: F64) -> int:
    """Points on triangles (m, 3, 3) in rows along the longest edge; only counted where out has no room."""
    n = 0
    for t in range(len(tri)):
        best, k = -1.0, 0
        for e in range(3):
            d = tri[t, (e + 1) % 3] - tri[t, e]
            length = math.sqrt(d[0] ** 2 + d[1] ** 2 + d[2] ** 2)
            if length > best:
                best, k = length, e
        a, b, c = tri[t, k], tri[t, (k + 1) % 3], tri[t, (k + 2) % 3]
        if best <= 0.0:
            continue
        u = (b - a) / best
        w = c - a
        along = w[0] * u[0] + w[1] * u[1] + w[2] * u[2]
        height = math.sqrt(max(w[0] ** 2 + w[1] ** 2 + w[2] ** 2 - along * along, 0.0))
        rows = max(int(math.ceil(height / row)), 1)
        for i in range(rows + 1):
            s = i / rows
            p, q = a + s * (c - a), b + s * (c - b)
            steps = int(math.ceil(best * (1.0 - s) / spacing))
            for j in range(steps + 1):
                if n < len(out):
                    f = j / steps if steps else 0.0
                    out[n] = p + f * (q - p)
                n += 1
    return n


def sharp_edges(mesh: Any) -> F64:
    """Ends (k, 2, 3) mm of edges that belong to one facet only or turn by more than ``SHARP``."""
    f = mesh.faces
    ends = np.sort(np.stack([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]], axis=1).reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(f)), 3)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ends, owner = ends[order], owner[order]
    same = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1))
    turn = (mesh.normals[owner[same]] * mesh.normals[owner[same + 1]]).sum(axis=1)
    smooth = same[turn > math.cos(SHARP)]
    keep = np.ones(len(ends), bool)
    keep[smooth] = keep[smooth + 1] = False
    return np.asarray(mesh.vertices[np.unique(ends[keep], axis=0)])


def highest_of(points: F64) -> F64:
    """Of points (n, 3) mm the highest in every square of ``THIN`` in plan: a tool from above meets it first."""
    at = np.floor((points[:, :2] - points[:, :2].min(axis=0)) / THIN).astype(np.int64)
    square = at[:, 0] * (int(at[:, 1].max()) + 1) + at[:, 1]
    order = np.lexsort((-points[:, 2], square))
    first = np.ones(len(order), bool)
    first[1:] = square[order[1:]] != square[order[:-1]]
    return points[order[first]]


def band_of(lift: float) -> float:
    """How far from the cloud the surface can be in the way, and the lift, mm."""
    return math.hypot(0.5, ROW) * SPACING + math.sqrt(2.0) * THIN + lift


def cloud_of(mesh: Any, spacing: float = SPACING) -> Cloud:
    """Cloud of a TriangleMesh, mm."""
    tri = mesh.triangles
    out = np.empty((_fill(tri, spacing, ROW * spacing, np.empty((0, 3))), 3))
    _fill(tri, spacing, ROW * spacing, out)
    ends = sharp_edges(mesh)
    steps = np.maximum(np.ceil(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / spacing), 1).astype(int)
    row = np.repeat(np.arange(len(ends)), steps)
    f = (np.arange(len(row)) - np.repeat(np.cumsum(steps) - steps, steps) + 0.5) / steps[row]
    points = np.vstack([out, ends[row, 0] + f[:, None] * (ends[row, 1] - ends[row, 0])])
    points = highest_of(points)
    x0, y0 = points[:, :2].min(axis=0) - 1e-6
    nx, ny = ((np.ceil(((points[:, :2].max(axis=0) + 1e-6) - (x0, y0)) / (FINE * BLOCK))).astype(int) * BLOCK).tolist()
    cell = ((points[:, 1] - y0) / FINE).astype(np.int64) * nx + ((points[:, 0] - x0) / FINE).astype(np.int64)
    order = np.lexsort((-points[:, 2], cell))
    points, cell = np.ascontiguousarray(points[order]), cell[order]
    start = np.searchsorted(cell, np.arange(nx * ny + 1))
    filled = start[1:] > start[:-1]
    top = np.full(nx * ny, -np.inf)
    top[filled] = points[start[:-1][filled], 2]
    top = top.reshape(ny, nx)
    coarse = top.reshape(ny // BLOCK, BLOCK, nx // BLOCK, BLOCK).max(axis=(1, 3))
    return Cloud(points, start, top, np.ascontiguousarray(coarse), float(x0), float(y0))


@njit(cache=True, inline="always")
def _bottom(rho: float, radius: float, corner: float, bodies: F64) -> float:
    """Lowest height above the tip at which the solid is at the distance rho from its axis; inf beyond it."""
    low = np.inf
    if rho < radius:
        t = rho - (radius - corner)
        low = 0.0 if t <= 0.0 else corner - math.sqrt(max((corner - t) * (corner + t), 0.0))
    for k in range(len(bodies)):
        if rho < bodies[k, 0]:
            low = min(low, bodies[k, 2])
        elif rho < bodies[k, 1]:
            low = min(low, bodies[k, 2] + bodies[k, 3] * (rho - bodies[k, 0]) / (bodies[k, 1] - bodies[k, 0]))
    return low


@njit(cache=True)
def _near(x: float, y: float, x0: float, y0: float, side: float) -> float:
    """Distance of (x, y) from the square of that side with its lower corner at (x0, y0)."""
    u = max(max(x0 - x, x - x0 - side), 0.0)
    v = max(max(y0 - y, y - y0 - side), 0.0)
    return math.sqrt(u * u + v * v)


class SolidArrays(NamedTuple):
    """A solid of revolution for the kernels, mm, with the greatest radius of any of its bodies."""

    radius: float
    corner: float
    bodies: F64
    widest: float


class CloudArrays(NamedTuple):
    """A cloud for the kernels: its points by cell, the highest of each cell and of each block of cells, mm."""

    points: F64
    start: NDArray[np.int64]
    top: F64
    coarse: F64
    x0: float
    y0: float


@njit(cache=True)
def _entered(x, y, z, turned, grid, depth):
    """Whether a point of the cloud is inside the solid with its tip at (x, y, z)."""
    radius, corner, bodies, widest = turned
    points, start, top, coarse, x0, y0 = grid
    side = FINE * BLOCK
    ny, nx = coarse.shape
    z = z + depth
    for i in range(max(int((y - widest - y0) / side), 0), min(int((y + widest - y0) / side), ny - 1) + 1):
        for j in range(max(int((x - widest - x0) / side), 0), min(int((x + widest - x0) / side), nx - 1) + 1):
            if coarse[i, j] <= z:
                continue
            near = _near(x, y, x0 + j * side, y0 + i * side, side)
            if coarse[i, j] - z <= _bottom(near, radius, corner, bodies):
                continue
            for a in range(i * BLOCK, (i + 1) * BLOCK):
                for b in range(j * BLOCK, (j + 1) * BLOCK):
                    if top[a, b] <= z:
                        continue
                    least = _bottom(_near(x, y, x0 + b * FINE, y0 + a * FINE, FINE), radius, corner, bodies)
                    cell = a * top.shape[1] + b
                    for k in range(start[cell], start[cell + 1]):
                        above = points[k, 2] - z
                        if above <= least:
                            break
                        rho = math.sqrt((points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2)
                        if above > _bottom(rho, radius, corner, bodies):
                            return True
    return False


def _free(tips, turned, grid, depth, out):
    for i in prange(len(tips)):
        out[i] = not _entered(tips[i, 0], tips[i, 1], tips[i, 2], turned, grid, depth)


_free_few = njit(cache=True)(_free)
_free_many = njit(cache=True, parallel=True)(_free)


def admissible(cloud: Cloud, solid: Solid, tips: F64) -> BOOL:
    """(n,) bool: nothing of the cloud is inside the solid with its tip at tips (n, 3) mm."""
    out = np.empty(len(tips), np.bool_)
    widest = max(solid.radius, float(solid.bodies[:, :2].max(initial=0.0)))
    ask = _free_many if len(tips) > FEW else _free_few
    grid = CloudArrays(cloud.points, cloud.start, cloud.top, cloud.coarse, cloud.x0, cloud.y0)
    ask(np.ascontiguousarray(tips), SolidArrays(solid.radius, solid.corner, solid.bodies, widest), grid, DEPTH, out)
    return out


def contact(solid: Solid, at: F64, normals: F64) -> F64:
    """Tip (n, 3) mm at which the profile touches points ``at`` (n, 3) with the normals (n, 3) there."""
    flat = solid.radius - solid.corner
    across = np.hypot(normals[:, 0], normals[:, 1])
    out = at + solid.corner * normals - [0.0, 0.0, solid.corner]
    lean = across > 1e-3
    out[lean, :2] += flat * normals[lean, :2] / across[lean, None]
    return np.asarray(out)


def reached(cloud: Cloud, solid: Solid, points: F64, normals: F64, lift: float) -> BOOL:
    """(n,) bool: some contact of the list in the head of this file is admissible; points (n, 3) mm."""
    at = points + lift * normals
    tips = contact(solid, at, normals)
    found = admissible(cloud, solid, tips)
    steep = np.abs(normals[:, 2]) < STEEP
    for part in FLANK:
        rows = np.flatnonzero(steep & ~found)
        found[rows] = admissible(cloud, solid, tips[rows] - [0.0, 0.0, part * (solid.flute - solid.corner)])
    flat = solid.radius - solid.corner
    level = normals[:, 2] > LEVEL
    for q, angle in UNDER_FLAT if flat > 0 else ():
        rows = np.flatnonzero(level & ~found)
        if not len(rows):
            break
        aside = [q * flat * math.cos(angle), q * flat * math.sin(angle), 0.0]
        found[rows] = admissible(cloud, solid, at[rows] + aside)
    return found & (normals[:, 2] > SEEN)


def leaning(cloud: Cloud, solid: Solid, points: F64, normals: F64, lift: float) -> BOOL:
    """(n,) bool: reached by a contact whose normal leans from (n, 3) normals, the profile still within the lift, mm."""
    found = np.zeros(len(points), bool)
    if solid.corner <= 0:
        return found
    most = math.acos(max(1.0 - lift / solid.corner, -1.0))
    side = np.cross(normals, np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    side /= np.linalg.norm(side, axis=1)[:, None]
    other = np.cross(normals, side)
    for q, angle in LEANS:
        rows = np.flatnonzero(~found & (normals[:, 2] > SEEN))
        t = q * most
        way = math.cos(angle) * side[rows] + math.sin(angle) * other[rows]
        m = math.cos(t) * normals[rows] + math.sin(t) * way
        found[rows] = admissible(cloud, solid, contact(solid, points[rows] + lift * normals[rows], m))
    return found


def solid_of(tool: Any, clear: Any) -> Solid:
    """The assembly of a ToolBody with the clearances of shank and holder."""
    rows = []
    if tool.shank_diameter > tool.diameter:
        wide = 0.5 * tool.shank_diameter + clear.shank
        rows.append((wide, wide, tool.neck_length, 1.0))
    z = tool.stickout
    for s in tool.holder:
        rows.append((0.5 * s.diameter + clear.holder, 0.5 * s.diameter_top + clear.holder, z, s.length))
        z += s.length
    return Solid(tool.radius, tool.corner_radius, tool.flute_length, np.array(rows).reshape(-1, 4))


def compare(cloud: Cloud, solid: Solid, said: dict[str, BOOL], points: F64, normals: F64, lift: float,
            cusp: float) -> dict[str, BOOL]:
    """Where ``zones.reach.tip_field`` and the cloud differ for one tool.

    said : (n,) bool of touchable: 'cutter' and 'tool' without play, 'played' the tool with it

    Returns
    -------
    dict of (n,) bool
        'reached' by the solid, 'differs', 'wrong', 'wrong level', the first three also for the cutting part alone
        ('cutter ...'), 'play' and 'lookup' (what each costs), 'lean' (what leaning contacts would add; of every tenth).
    """
    alone = Solid(solid.radius, solid.corner, solid.flute, solid.bodies[:0])
    band = band_of(lift)
    out: dict[str, BOOL] = {}
    for name, key, body, wider in (("cutter ", "cutter", alone, 0.0), ("", "tool", solid, LOOKED_UP_WIDER)):
        yes = reached(cloud, body, points, normals, lift)
        out[name + "reached"], out[name + "differs"] = yes, yes != said[key]
        wrong = np.zeros(len(points), bool)
        rows = np.flatnonzero(out[name + "differs"])
        thin = reached(cloud, body.grown(-band), points[rows], normals[rows], lift)
        thick = reached(cloud, body.grown(band, wider, SLICES if wider else 0, cusp), points[rows], normals[rows], lift)
        wrong[rows] = (thin != said[key][rows]) & (thick != said[key][rows])
        out[name + "wrong"] = wrong
    out["wrong level"] = out["wrong"] & (normals[:, 2] > LEVEL) & (solid.radius > solid.corner)
    out["play"] = said["tool"] & ~said["played"]
    out["lookup"] = out["reached"] & said["cutter"] & ~said["tool"]
    few = np.arange(0, len(points), LEAN_EVERY)
    rows = np.flatnonzero(~out["reached"][few])
    out["lean"] = np.zeros(len(few), bool)
    out["lean"][rows] = leaning(cloud, solid, points[few[rows]], normals[few[rows]], lift)
    return out


def planned_normals(mesh: Any, points: F64, triangles: NDArray[np.int64]) -> F64:
    """Normals (n, 3) the planner would give points (n, 3) mm on (n,) triangles."""
    from geometry.sampling import SurfaceSamples, with_surface_normals

    here = SurfaceSamples(points, mesh.normals[triangles], np.ones(len(points)), mesh.face_ids[triangles], triangles)
    return with_surface_normals(here, mesh).normals


def said_by_reach(tree: Any, part: Any, tool: Any, clear: Any, points: F64, normals: F64, lift: float,
                  allowance: float, cusp: float) -> dict[str, BOOL]:
    """What ``zones.reach.tip_field.touchable`` says of samples (n, 3) mm, with and without its play."""
    from zones.lattice import lattice_step
    from zones.reach import tip_field

    field = tip_field.TipField(tree, tool, clear, part.bounds, tool.radius + 4.0, lattice_step(tool), allowance, cusp)
    played = tip_field.touchable(field, points, normals, lift)[1]
    by_cutter, by_tool, _ = tip_field.touchable(field, points, normals, lift, play=0.0)
    return {"cutter": by_cutter, "tool": by_tool, "played": played}


COLUMNS = ("reached", "cutter differs", "cutter wrong", "differs", "wrong", "wrong level", "play", "lookup",
           "lean")


def examine(path: Path, setup_path: Path, count: int = SAMPLES) -> dict[str, Any]:
    """Figures of one part: by tool and for the union of the tools, shares of the machinable area."""
    from geometry.mesh_queries.bvh import TriangleTree
    from service.from_wire import read_setup, tool_bodies
    from service.part_reading import load
    from service.stages.job_inputs import JobInputs

    setup = read_setup(setup_path)
    part = load(path, setup)
    quality = setup.quality
    lift = max(0.1 * quality.scallop_height_mm, 1.5 * part.chord)
    points, triangles = scattered(part.mesh, machinable(part.mesh), count)
    normals = kernel_normals(part, path, setup)(points, triangles)
    planned = planned_normals(part.mesh, points, triangles)
    tree, cloud, clear = TriangleTree(part.mesh), cloud_of(part.mesh), JobInputs.of(setup).clearances
    out: dict[str, Any] = {"lift_mm": lift, "band_mm": band_of(lift),
                           "cloud": len(cloud.points), "tools": {}, "places": []}
    union = {k: np.zeros(len(points), bool) for k in ("said", "played", "yes", "fair")}
    for tool in tool_bodies(setup):
        said = said_by_reach(tree, part, tool, clear, points, planned, lift, 0.0, quality.scallop_height_mm)
        solid = solid_of(tool, clear)
        found = compare(cloud, solid, said, points, normals, lift, quality.scallop_height_mm)
        out["tools"][tool.id] = {k: float(found[k].mean()) for k in COLUMNS}
        for k in np.flatnonzero(found["wrong"] | found["cutter wrong"])[:200]:
            out["places"].append({"tool": tool.id, "at": points[k].round(3).tolist(), "n": normals[k].round(4).tolist(),
                                  "said": bool(said["tool"][k]), "said_cutter": bool(said["cutter"][k])})
        union["said"] |= said["tool"]
        union["played"] |= said["played"]
        union["yes"] |= found["reached"]
        union["fair"] |= np.where(found["differs"] & ~found["wrong"], said["tool"], found["reached"])
    out["union"] = {"reached": float(union["yes"].mean()), "differs": float((union["said"] != union["yes"]).mean()),
                    "wrong": float((union["said"] != union["fair"]).mean()),
                    "play": float((union["said"] & ~union["played"]).mean())}
    return out


def row_of(name: str, found: dict[str, Any], seconds: float) -> str:
    """One line of the table: the worst tool in each column, then the union; percent of the machinable area."""
    worst = [100 * max(t[k] for t in found["tools"].values()) for k in COLUMNS[1:]]
    whole = [100 * found["union"][k] for k in ("reached", "differs", "wrong", "play")]
    return f"| {name} | " + " | ".join(f"{v:.3f}" for v in (*worst, *whole)) + f" | {seconds:.0f} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="reach against a dense cloud of points")
    parser.add_argument("parts", nargs="*", default=list(DEFAULT))
    parser.add_argument("--samples", type=int, default=SAMPLES)
    parser.add_argument("--json", type=Path, default=None, help="where to write all figures")
    args = parser.parse_args()
    from examples.family.recipes import make_part

    head = [f"{c} (worst tool)" for c in COLUMNS[1:]] + [f"union {c}" for c in ("reached", "differs", "wrong", "play")]
    print("| part | " + " | ".join(head) + " | s |\n|" + "---|" * (len(head) + 2), flush=True)
    every = {}
    for name in args.parts:
        first, second = name.split(":")
        began = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            made = not second.endswith(".json")
            step, setup = make_part(int(second), first).write(folder)[::2] if made else (Path(first), Path(second))
            every[name] = examine(step, setup, args.samples)
        print(row_of(name, every[name], time.perf_counter() - began), flush=True)
        if args.json is not None:
            args.json.write_text(json.dumps(every, indent=1))


if __name__ == "__main__":
    main()
