"""Do zones hang on what must not matter? Turned, shifted, scaled, inch, faces in strips, faces in another order.

    python -m benchmarks.reach.invariance --seeds 0:50 [--recipe mixed] [--jobs 2] [--limit 400] [--zones]

Each part is read once as it is and once for every variant (turned, scaled and shuffled ones as arrays, inch and strips
through STEP files), decomposed, and compared after its walls have been matched by place: walls, walls of every
connection, channels with gaps (1 %), profile types, areas of all regions (1 % of the part). With ``--zones`` the
suggested setup is zoned too, as it is and turned: areas by kind of region, form and tool, of 5 mm² or more in one of
the two (3 % or 2 mm²).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

CHORD = 0.004
GAP, AREA, ZONE_AREA, ZONE_LEAST = 0.01, 0.01, 0.03, 5.0
ANGLE, SHIFT, SCALE = 0.7, (37.0, -12.5, 8.0), 2.5
VARIANTS = ("turned", "scaled", "shuffled", "inch", "strips")


@dataclass
class Found:
    """What was found on a variant: places of walls and connections, and everything named by their ids."""

    walls: dict[str, np.ndarray]
    connections: dict[str, tuple[np.ndarray, tuple[str, ...]]]
    channels: dict[tuple[str, str], float]
    profiles: dict[tuple[str, tuple[float, float]], str]
    regions: dict[str, float]
    area: float


def look(part: Any) -> Found:
    """Decompose a part and label its surface."""
    from geometry.sampling import sample_surface
    from zones.features.decomposition import decompose
    from zones.plan_view.channel_plan import ChannelPlan
    from zones.plan_view.profile_types import classify
    from zones.plan_view.regions import RegionLocator

    d = decompose(part)
    plan = ChannelPlan.of(part, d)
    size = float(np.linalg.norm(part.bounds[1] - part.bounds[0]))
    s = sample_surface(part.mesh, 60_000 / float(part.mesh.areas.sum()), seed=5)
    labels = RegionLocator(part, d, plan).of(s.points, s.normals, s.face)
    regions: dict[str, float] = {}
    for code, r in enumerate(labels.regions):
        regions[r.name] = regions.get(r.name, 0.0) + float(s.area[labels.code == code].sum())

    def middle(faces: tuple[int, ...]) -> np.ndarray:
        own = np.isin(part.mesh.face_ids, faces)
        w = part.mesh.areas[own]
        return np.asarray((part.mesh.triangles[own].mean(axis=1) * w[:, None]).sum(axis=0) / w.sum())

    profiles = {}
    for c in plan.curves:
        kind = classify(c.points, c.closed).type
        profiles[(c.wall, tuple((np.asarray(c.points).mean(axis=0) / size).tolist()))] = str(kind or "straight")
    return Found({w.id: middle(w.faces) for w in d.walls}, {c.id: (middle(c.faces), c.walls) for c in d.connections},
                 {h.walls: h.gap_min for h in d.channels}, profiles, regions, float(s.area.sum()))


def differences(base: Found, other: Found, move: Any, scale: float) -> list[str]:
    """What differs between a part and its variant; ``move`` takes places of the base to the variant."""
    out = []
    if (len(base.walls), len(base.connections), len(base.channels)) != (
            len(other.walls), len(other.connections), len(other.channels)):
        return [f"{len(other.walls)} walls, {len(other.connections)} connections, {len(other.channels)} channels "
                f"instead of {len(base.walls)}, {len(base.connections)}, {len(base.channels)}"]
    name = {**_matched(base.walls, other.walls, move),
            **_matched({k: v[0] for k, v in base.connections.items()},
                       {k: v[0] for k, v in other.connections.items()}, move)}
    for c, (_, walls) in base.connections.items():
        if sorted(name[w] for w in walls) != sorted(other.connections[name[c]][1]):
            out.append(f"{c} joins other walls")
    pairs = {tuple(sorted(k)): g for k, g in other.channels.items()}
    for walls, gap in base.channels.items():
        there = pairs.get(tuple(sorted(name[w] for w in walls)))
        if there is None:
            out.append(f"no channel between {walls}")
        elif abs(there / scale - gap) > GAP * gap:
            out.append(f"gap of {walls}: {there / scale:.4f} instead of {gap:.4f}")
    kinds = {w: sorted(k for (v, _), k in base.profiles.items() if v == w) for w in base.walls}
    for w, mine in kinds.items():
        theirs = sorted(k for (v, _), k in other.profiles.items() if v == name[w])
        if mine != theirs:
            out.append(f"profiles of {w}: {theirs} instead of {mine}")
    mine, theirs = _by_kind(base.regions), _by_kind(other.regions)
    for kind in sorted({*mine, *theirs}):
        off = theirs.get(kind, 0.0) / scale**2 - mine.get(kind, 0.0)
        if abs(off) > AREA * base.area:
            out.append(f"{off:+.1f} mm² of {kind}")
    return out


def _matched(base: dict[str, np.ndarray], other: dict[str, np.ndarray], move: Any) -> dict[str, str]:
    from scipy.optimize import linear_sum_assignment

    a, b = list(base), list(other)
    if not a:
        return {}
    cost = np.array([[float(np.linalg.norm(move(base[i]) - other[j])) for j in b] for i in a])
    rows, columns = linear_sum_assignment(cost)
    return {a[i]: b[j] for i, j in zip(rows, columns, strict=True)}


def _by_kind(regions: dict[str, float]) -> dict[str, float]:
    """Areas by the words of the region without numbers: 'H over C', 'W', 'floor'."""
    out: dict[str, float] = {}
    for name, area in regions.items():
        kind = " ".join(w[0] if w[0] in "HWC" else w.split(".")[0] for w in name.split())
        out[kind] = out.get(kind, 0.0) + area
    return out


def turned(part: Any, angle: float, shift: tuple[float, float, float], scale: float = 1.0) -> tuple[Any, Any]:
    """The part turned about Z, moved and scaled, and the map of its points."""
    c, s = np.cos(angle), np.sin(angle)
    r = scale * np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def move(p: np.ndarray) -> np.ndarray:
        return np.asarray(p @ r.T + np.array(shift))

    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = r, shift
    mesh = part.mesh.transformed(matrix)
    faces = tuple(replace(f, area=f.area * scale**2, curvature_min=f.curvature_min / scale,
                          curvature_max=f.curvature_max / scale, radius=f.radius and f.radius * scale)
                  for f in part.faces)
    edges = tuple(replace(e, points=move(e.points), length=e.length * scale) for e in part.edges)
    return replace(part, mesh=mesh, bounds=mesh.bounds, faces=faces, edges=edges, volume=part.volume * scale**3), move


def shuffled(part: Any, seed: int) -> Any:
    """Faces, edges and triangles in another order."""
    from geometry.mesh import TriangleMesh
    from geometry.part import EdgeInfo

    rng = np.random.default_rng(seed)
    new = {old: k for k, old in enumerate((rng.permutation(len(part.faces)) + 1).tolist(), 1)}
    faces = tuple(sorted((replace(f, number=new[f.number]) for f in part.faces), key=lambda f: f.number))
    edges = [EdgeInfo((new[e.faces[1]], new[e.faces[0]]), e.kind, e.length, e.angle, e.points[::-1])
             for e in part.edges]
    order = rng.permutation(len(part.mesh.faces))
    ids = np.array([new[i] for i in part.mesh.face_ids.tolist()], np.int32)
    uv = None if part.uv is None else part.uv[order]
    corners = part.mesh.corner_normals
    mesh = TriangleMesh(part.mesh.vertices, part.mesh.faces[order], ids[order],
                        None if corners is None else corners[order])
    return replace(part, faces=faces, edges=tuple(edges[i] for i in rng.permutation(len(edges))), mesh=mesh, uv=uv)


def inch_file(step: Path) -> Path:
    """The same part written in inches."""
    import cadquery as cq
    from OCP.Interface import Interface_Static

    path = step.with_suffix(".inch.step")
    if not path.exists():
        shape = cq.importers.importStep(str(step))
        Interface_Static.SetCVal_s("write.step.unit", "INCH")
        try:
            cq.exporters.export(shape, str(path))
        finally:
            Interface_Static.SetCVal_s("write.step.unit", "MM")
    return path


def strips_file(seed: int, recipe: str, step: Path) -> Path | None:
    """The part with every side of its free walls cut into five faces; None where no wall can be."""
    from examples.family.recipes import build_solid, make_part, step_bytes

    path = step.with_suffix(".strips.step")
    if not path.exists():
        layout = make_part(seed, recipe).layout
        walls = [replace(w, strips=5) if hasattr(w, "strips") and not w.merged else w for w in layout.walls]
        if all(a is b for a, b in zip(walls, layout.walls, strict=True)):
            return None
        path.write_bytes(step_bytes(build_solid(replace(layout, walls=walls)), path.stem))
    return path


def zone_table(step: Path, setup: dict[str, Any]) -> dict[tuple[str, str, str], float]:
    """Area by kind of region, form and tool of the zones of a setup, mm²."""
    from service.from_wire import parse_setup
    from service.stages.preparation import prepare

    ready = prepare(step, parse_setup(json.dumps(setup)), lambda _stage, _share: None)
    out: dict[tuple[str, str, str], float] = {}
    for z in ready.zones:
        area = float(ready.samples.area[z.samples].sum())
        kind = " ".join(w[0] if w[0] in "HWC" else w.split(".")[0] for w in z.region.split())
        key = (kind, str(z.form), z.tool.id)
        out[key] = out.get(key, 0.0) + area
    return out


def judge(recipe: str, seed: int, out: Path, with_zones: bool) -> dict[str, Any]:
    """All variants of one part."""
    from benchmarks.reach.family_score import made_part
    from geometry.step_import.reader import read_part

    begin = time.perf_counter()
    step, _, _ = made_part(recipe, seed, out / "cache")
    base_part = read_part(step, chord=CHORD)
    base = look(base_part)
    result: dict[str, Any] = {"part": f"{recipe}:{seed}"}

    def same(p: np.ndarray) -> np.ndarray:
        return p

    part, move = turned(base_part, ANGLE, SHIFT)
    result["turned"] = differences(base, look(part), move, 1.0)
    part, move = turned(base_part, 0.0, (0.0, 0.0, 0.0), SCALE)
    result["scaled"] = differences(base, look(part), move, SCALE)
    result["shuffled"] = differences(base, look(shuffled(base_part, seed)), same, 1.0)
    result["inch"] = differences(base, look(read_part(inch_file(step), chord=CHORD)), same, 1.0)
    cut = strips_file(seed, recipe, step)
    result["strips"] = [] if cut is None else differences(base, look(read_part(cut, chord=CHORD)), same, 1.0)
    if with_zones:
        result["zones"] = _zones_turned(step)
    result["seconds"] = round(time.perf_counter() - begin, 1)
    return result


def _zones_turned(step: Path) -> list[str]:
    setup = json.loads(step.with_suffix(".setup.json").read_text())
    mine = zone_table(step, setup)
    x = [float(np.cos(ANGLE)), float(-np.sin(ANGLE)), 0.0]
    theirs = zone_table(step, {**setup, "placement": {"origin_mm": [5.0, -3.0, 0.0], "x_axis": x}})
    return [f"{key}: {theirs.get(key, 0.0):.1f} instead of {mine.get(key, 0.0):.1f} mm²"
            for key in sorted({*mine, *theirs}) if max(theirs.get(key, 0.0), mine.get(key, 0.0)) >= ZONE_LEAST
            if abs(theirs.get(key, 0.0) - mine.get(key, 0.0)) > max(2.0, ZONE_AREA * mine.get(key, 0.0))]


def main() -> None:
    """Ask every part in a child and print a table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--seeds", default="0:50")
    options.add_argument("--recipe", default="mixed")
    options.add_argument("--jobs", type=int, default=2)
    options.add_argument("--limit", type=float, default=400.0)
    options.add_argument("--zones", action="store_true")
    options.add_argument("--out", type=Path, default=Path("out/invariance"))
    options.add_argument("--one", type=int)
    given = options.parse_args()
    if given.one is not None:
        print(json.dumps(judge(given.recipe, given.one, given.out, given.zones)))
        return
    low, high = (int(v) for v in given.seeds.split(":"))

    def ask(seed: int) -> dict[str, Any]:
        command = [sys.executable, "-m", "benchmarks.reach.invariance", "--one", str(seed), "--recipe", given.recipe,
        "--out",
                   str(given.out), *(["--zones"] if given.zones else [])]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=given.limit, check=False)
        except subprocess.TimeoutExpired:
            return {"part": f"{given.recipe}:{seed}", "failed": f"no answer in {given.limit:g} s"}
        if done.returncode:
            return {"part": f"{given.recipe}:{seed}", "failed": done.stderr.strip().splitlines()[-1][:200]}
        return dict(json.loads(done.stdout.splitlines()[-1]))

    right = dict.fromkeys((*VARIANTS, "zones"), 0)
    asked = 0
    with ThreadPoolExecutor(given.jobs) as pool:
        for found in pool.map(ask, range(low, high)):
            if "failed" in found:
                print(found["part"], "failed:", found["failed"], flush=True)
                continue
            asked += 1
            wrong = {k: found[k] for k in right if found.get(k)}
            for k in right:
                right[k] += k in found and not found[k]
            print(found["part"], f"{found['seconds']} s", wrong or "same", flush=True)
    print(f"{asked} of {high - low} parts answered; the same: " + ", ".join(f"{k} {n}" for k, n in right.items()))


if __name__ == "__main__":
    main()
