"""Iso-parametric passes on trimmed surfaces: analogues of a published table, chords on exact surfaces, random trims.

Run from the root of the checkout: ``python benchmarks/passes/bench_isoparametric.py [--cases] [--chords] [--trims N]
[--demo] [--wheel FOLDER [--lean DEGREES]]``; without a flag all but the last. What is left is judged by
``verify.surface.removal``, which shares no code with the passes. Seconds are wall clock of one run, compiled kernels:
laying into the square, passes and steps.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402
import shapely  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

from benchmarks.passes.arc_rule import arc_rule  # noqa: E402
from benchmarks.passes.bench_scallop import ball, random_surface  # noqa: E402
from benchmarks.passes.faceting import facet_deviation, steps_for_chord  # noqa: E402
from examples.family.recipes import make_part  # noqa: E402
from geometry.errors import GeometryError  # noqa: E402
from geometry.mesh import F64  # noqa: E402
from geometry.mesh_queries.bvh import TriangleTree  # noqa: E402
from geometry.parameterization.square_patches import Method, Squared, squared  # noqa: E402
from geometry.sampling import sample_surface, with_surface_normals  # noqa: E402
from geometry.step_import.face_surfaces import read_patches  # noqa: E402
from geometry.surfaces.foot_points import foot_points  # noqa: E402
from geometry.surfaces.nurbs import NurbsSurface  # noqa: E402
from geometry.trimming.trim import trim_faces  # noqa: E402
from service.from_wire import parse_setup, placement_of, tool_bodies  # noqa: E402
from service.stages.job_inputs import JobInputs  # noqa: E402
from service.stages.preparation import prepare  # noqa: E402
from toolpath.cutter.cutter import Cutter  # noqa: E402
from toolpath.drop_cutter import drop_cutter  # noqa: E402
from toolpath.five_axis.oriented_pass import enters, leaned, posed  # noqa: E402
from toolpath.passes.cutter_locations import FREE, lifted, tips  # noqa: E402
from toolpath.passes.forward_step import PassProfile, steps  # noqa: E402
from toolpath.passes.isoparametric_passes import Flank, IsoSurface, lay_out  # noqa: E402
from toolpath.passes.pass_family import Dragged, FinishTarget, Promise, Swath  # noqa: E402
from toolpath.passes.side_step import lay_out as parallel  # noqa: E402
from toolpath.passes.trimmed_faces import TrimmedFace
from verify.moves import Moves
from verify.surface.removal import residual_on_normals
from verify.tool_axes import ToolAxes  # noqa: E402

RADIUS, SCALLOP = 5.0, 0.5
SIZE = 200.0  # mm
PLACES = 1000  # of the exact pass in each step
PAPER = {("I", Method.LAPLACE): (9329, 566), ("I", Method.FRONTS): (9234, 412),
         ("II", Method.LAPLACE): (9532, 617), ("II", Method.FRONTS): (9379, 461)}


@dataclass(frozen=True, eq=False)
class Trim:
    """A surface and the border of a region of its parameters; scale, mm by 1 of u and v."""

    surface: NurbsSurface
    loops: tuple[F64, ...]
    scale: tuple[float, float]


def hills() -> NurbsSurface:
    """Hollows and hills, about 270 mm by 290 mm."""
    x, y = np.meshgrid(np.linspace(-40, 240, 7), np.linspace(-40, 260, 7), indexing="ij")
    z = 12.0 * np.sin(x / 70) * np.cos(y / 60) + 0.0008 * (x - 100) ** 2
    return NurbsSurface.from_control_points(np.stack([x, y, z], -1), 4)


def case(name: str) -> Trim:
    """I: four smooth sides that swing the same way. II: a bump into it from below, a notch in its top."""
    t = np.linspace(0.0, 1.0, 401)

    def hill(at: float, wide: float) -> F64:
        h = np.exp(-(((t - at) / wide) ** 2))
        return np.asarray(h - h[0] * (1 - t) - h[-1] * t)

    swing = 0.06 * np.sin(np.pi * t)
    if name == "I":
        bottom, top = swing, 1.0 + swing
        right, left = 1.0 + swing, swing
    else:
        bottom, top = 0.2 * hill(0.5, 0.12), 1.0 - 0.17 * hill(0.35, 0.1)
        right, left = 1.0 + swing, -swing
    sides = [np.column_stack([t, bottom]), np.column_stack([right, t]), np.column_stack([t, top])[::-1],
             np.column_stack([left, t])[::-1]]
    surface = hills()
    low, high = surface.domain
    border = SIZE * np.vstack([s[:-1] for s in sides])
    return Trim(surface, (low + (border + 30.0) / 260.0 * (high - low),), (260.0 / (high - low)[0],) * 2)


def passes_of(piece: Squared, surface: NurbsSurface, radius: float, scallop: float, chord: float,
              kept: float) -> tuple[list[F64], float]:
    """Tips (n, 3) of each pass over a piece, mm, and their length in all; kept : mm of scallop to lay out for."""
    iso, out, way = IsoSurface(surface, piece.map), [], 0.0
    for eta in lay_out(iso, radius, kept).tolist():
        profile = PassProfile.of(iso.curve(eta), chord, radius)
        out.append(profile.centres(steps(profile, radius, chord, scallop), radius) - [0.0, 0.0, radius])
        way += profile.length
    return out, way


def left_by(lines: list[F64], points: F64, normals: F64, radius: float) -> F64:
    """(n,) mm left on normals after passes, by the verifier."""
    start, end = np.vstack([q[:-1] for q in lines]), np.vstack([q[1:] for q in lines])
    moves = Moves(start, end, np.ones(len(start), np.bool_), np.zeros(len(start), np.int32))
    return residual_on_normals(points, normals, np.full(len(points), 10.0), moves, [ball(radius)])[0]


def places(trim: Trim, spacing: float) -> tuple[F64, F64]:
    """Points and normals (n, 3) of the region on a lattice of parameters about ``spacing`` mm apart, holes left out."""
    region = shapely.Polygon(trim.loops[0], [q for q in trim.loops[1:]])
    low, high = trim.loops[0].min(axis=0), trim.loops[0].max(axis=0)
    count = np.ceil((high - low) * trim.scale / spacing).astype(int) + 1
    uv = np.stack(np.meshgrid(*(np.linspace(a, b, c) for a, b, c in zip(low, high, count, strict=True))), -1)
    uv = uv.reshape(-1, 2)
    uv = uv[shapely.contains_xy(region, *uv.T)]
    return trim.surface.points_and_normals(uv)


def plane_parallel(trim: Trim) -> tuple[int, float, float]:
    """Passes in planes along x: how many, their length in mm, and seconds."""
    spacing = 0.1 * np.sqrt(8.0 * RADIUS * SCALLOP)
    points, normals = places(trim, spacing)
    large = steps_for_chord(trim.surface, 0.05)
    facet_deviation(trim.surface, trim.surface.discretised(*large))
    tree = TriangleTree(trim.surface.discretised(large[0] / 3.0, large[1] / 3.0))
    cutter = Cutter.ball(diameter=2.0 * RADIUS, length=20.0)
    target = FinishTarget(points, normals, points + RADIUS * normals - [0.0, 0.0, RADIUS], spacing)
    begin = time.perf_counter()
    made = parallel(Swath(Dragged(cutter, lambda xy: drop_cutter(tree, cutter, xy), tree), target,
                          Promise(SCALLOP, SCALLOP, 0.3 * RADIUS, 10.0), 0.0), subdivide=False)
    way = sum(float(np.linalg.norm(np.diff(q, axis=0), axis=1).sum()) for p in made for q in p.lines)
    return len(made), way, time.perf_counter() - begin


def cases() -> None:
    """The table of the paper on analogues of its two cases."""
    print(f"ball of {RADIUS} mm, scallop and chord {SCALLOP} mm; left at chord 0.005 mm, borders included")
    print(f"{'case':5} {'method':15} {'passes':>6} {'length mm':>10} {'points':>7} {'s':>6} {'area':>6} {'space':>6} "
          f"{'max left':>9} {'gouge':>7}   paper: mm, s")
    for name in ("I", "II"):
        trim = case(name)
        points, normals = places(trim, 0.7)
        for method in (Method.LAPLACE, Method.FRONTS, Method.EMBEDDED):
            begin = time.perf_counter()
            (piece,) = squared(trim.loops, trim.scale, only=method)
            lines, way = passes_of(piece, trim.surface, RADIUS, SCALLOP, SCALLOP, SCALLOP)
            seconds = time.perf_counter() - begin
            fine, _ = passes_of(piece, trim.surface, RADIUS, SCALLOP, 0.005, SCALLOP - 0.005)
            left = left_by(fine, points, normals, RADIUS)
            paper = PAPER.get((name, method))
            print(f"{name:5} {method:15} {len(lines):6d} {way:10.0f} {sum(len(q) for q in lines):7d} {seconds:6.2f} "
                  f"{piece.evenness[0]:6.2f} {piece.evenness[1]:6.2f} {left.max():9.4f} {max(-left.min(), 0):7.4f}   "
                  f"{f'{paper[0]}, {paper[1]}' if paper else '-'}", flush=True)
        count, way, seconds = plane_parallel(trim)
        print(f"{name:5} {'plane-parallel':15} {count:6d} {way:10.0f} {'':7} {seconds:6.2f}", flush=True)


def exact_errors(iso: IsoSurface, eta: float, t: F64, radius: float) -> F64:
    """(n - 1,) mm: the greatest |dev| of each step between parameters (n,) at 1000 places of the exact surface."""
    curve, out = iso.curve(eta), []
    for a, b in zip(t[:-1].tolist(), t[1:].tolist(), strict=True):
        p, n = curve(np.linspace(a, b, PLACES))
        c, d = p[0] + radius * n[0], p[-1] + radius * n[-1] - p[0] - radius * n[0]
        s = np.clip((p - c) @ d / (d @ d), 0.0, 1.0)
        out.append(float(np.abs(np.linalg.norm(p - c - s[:, None] * d, axis=1) - radius).max()))
    return np.array(out)


def chords() -> None:
    """Chordal errors on the exact surface: ours and the circular-arc rule's."""
    print(f"\nchordal error over the tolerance, {PLACES} places a step, end steps and those of 40 mm aside")
    print(f"{'case':5} {'e':>6} {'rule':5} {'steps':>6} {'bends':>6} {'most':>8} {'mean':>8} {'over 1.001':>10}")
    for case_name in ("I", "II"):
        trim = case(case_name)
        (piece,) = squared(trim.loops, trim.scale)
        iso = IsoSurface(trim.surface, piece.map)
        for tolerance in (0.5, 0.05, 0.005):
            for name in ("ours", "arc"):
                off: list[F64] = []
                total = bends = 0
                for eta in np.linspace(0.0, 1.0, 12).tolist():
                    profile = PassProfile.of(iso.curve(eta), tolerance, RADIUS)
                    ends = steps(profile, RADIUS, tolerance) if name == "ours" else arc_rule(profile, RADIUS, tolerance)
                    whole = np.diff(ends) < 39.99
                    whole[-1] = False
                    off.append((exact_errors(iso, eta, profile.parameters(ends), RADIUS) / tolerance)[whole])
                    total += len(ends) - 1
                    bends += inflections(profile)
                every = np.concatenate(off)
                print(f"{case_name:5} {tolerance:6} {name:5} {total:6d} {bends:6d} {every.max():8.4f} "
                      f"{every.mean():8.4f} {(every > 1.001).sum():10d}", flush=True)


def inflections(profile: PassProfile) -> int:
    """How often the curvature of a pass along the normal changes its sign."""
    bend = (np.diff(profile.contact, 2, axis=0) * profile.normal[1:-1]).sum(axis=1)[::8]
    return int((np.sign(bend[1:]) != np.sign(bend[:-1])).sum())


def random_trim(seed: int) -> Trim:
    """A random surface of 24 mm with a random region of 3 to 8 corners; every third has a hole."""
    rng = np.random.default_rng(seed)
    surface = random_surface(seed)
    low, high = surface.domain
    n = 3 + seed % 6
    turn = np.sort((np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n * 2.0 * np.pi)
    reach = rng.uniform(0.22, 0.46, n)
    corners = 0.5 + reach[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    border = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        t = np.linspace(0.0, 1.0, 41)[:-1, None]
        away = np.array([b[1] - a[1], a[0] - b[0]]) * rng.uniform(-0.12, 0.12)
        border.append(a + t * (b - a) + np.sin(np.pi * t) * away)
    loops = [np.vstack(border)]
    if seed % 3 == 0:
        t = np.linspace(0.0, 2.0 * np.pi, 41)[:-1]
        loops.append(0.5 + 0.06 * np.column_stack([np.cos(t), -np.sin(t)]))
    uv = low + loops[0] * (high - low)
    d = surface.derivatives(uv)
    return Trim(surface, tuple(low + q * (high - low) for q in loops),
                (float(np.linalg.norm(d.u, axis=1).mean()), float(np.linalg.norm(d.v, axis=1).mean())))


def trims(count: int) -> None:
    """Random trims: a ball that fits, scallop 0.01 mm, chord 0.002 mm."""
    scallop, chord = 0.01, 0.002
    print(f"\nrandom trims: ball that fits everywhere, 3 mm at most; scallop {scallop}, chord {chord} mm")
    print(f"{'seed':>4} {'corners':>7} {'hole':>4} {'pieces':>6} {'methods':24} {'R':>5} {'passes':>6} {'max left':>9} "
          f"{'gouge':>8} {'s':>6}")
    worst, deep, failed = 0.0, 0.0, 0
    for seed in range(count):
        trim = random_trim(seed)
        points, normals = places(trim, 0.06)
        tight = -float(trim.surface.curvature(trim.loops[0])[:, 0].min())
        uv = np.stack(np.meshgrid(*(np.linspace(a, b, 80) for a, b in zip(*trim.surface.domain, strict=True))), -1)
        tight = max(tight, -float(np.nanmin(trim.surface.curvature(uv.reshape(-1, 2))[:, 0])), 1e-3)
        radius = min(3.0, 0.9 / tight)
        begin = time.perf_counter()
        try:
            pieces = squared(trim.loops, trim.scale)
        except GeometryError as refusal:
            failed += 1
            print(f"{seed:4d} {3 + seed % 6:7d} failed: {refusal}")
            continue
        lines = [q for piece in pieces
                 for q in passes_of(piece, trim.surface, radius, scallop, chord, scallop - chord)[0]]
        seconds = time.perf_counter() - begin
        left = left_by(lines, points, normals, radius)
        worst, deep = max(worst, float(left.max())), max(deep, float(-left.min()))
        print(f"{seed:4d} {3 + seed % 6:7d} {len(trim.loops) - 1:4d} {len(pieces):6d} "
              f"{' '.join(p.method for p in pieces):24} {radius:5.2f} {len(lines):6d} {left.max():9.5f} "
              f"{max(-left.min(), 0):8.5f} {seconds:6.2f}", flush=True)
    print(f"most left {worst:.5f}, deepest gouge {deep:.5f} mm, {failed} failed of {count}")


def entered(lines: list[F64], points: F64, radius: float, rows: NDArray[np.int64]) -> float:
    """The deepest that any of some places (rows of points) lies in a ball along passes, mm; 0 for none.

    That is how far the ball would have to step aside: along the normal of a place beside a sharp edge it is far more.
    """
    start, end = np.vstack([q[:-1] for q in lines]), np.vstack([q[1:] for q in lines])
    start, d, deep = start + [0.0, 0.0, radius], end - start, 0.0
    for p in points[rows]:
        s = np.clip(((p - start) * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-300), 0.0, 1.0)
        deep = max(deep, radius - float(np.linalg.norm(p - start - s[:, None] * d, axis=1).min()))
    return deep


def faces(step: Path, given: dict, radius: float, scallop: float, chord: float, title: str) -> None:
    """Every face of every wall of a part by an upright ball, its own passes against the whole part."""
    setup = parse_setup(json.dumps(given))
    ready = prepare(step, setup, lambda _stage, _share: None)
    part = ready.views[0].part
    numbers = sorted({f for w in ready.decomposition.walls for f in w.faces})
    patches = read_patches(step, numbers, placement=placement_of(setup), solid=setup.part.solid)
    trimmed = trim_faces(part, numbers, lambda p, _n, _f: np.zeros(len(p), np.int64), 1e3)[0]
    tree, tool, off = TriangleTree(part.mesh), ball(radius), max(0.1 * scallop, 1.5 * part.chord)
    cutter, flank = Cutter.of(tool), Flank(radius, radius)

    def limit(xy: F64) -> F64:
        return drop_cutter(tree, cutter, xy)

    print(f"\n{title}: {len(numbers)} wall faces, ball of {radius} mm upright, scallop {scallop}, chord {chord} mm; "
          f"tips may stand off by {off:.4f} mm")
    print(f"{'face':>5} {'pieces':>6} {'methods':16} {'passes':>6} {'lines':>6} {'mm':>7} {'touched':>7} {'p99':>8} "
          f"{'max left':>9} {'over h':>7} {'gouge':>8} {'s':>6}")
    everywhere = sample_surface(part.mesh, 30.0, seed=3)
    for patch in trimmed:
        exact, own = patches[patch.face], part.mesh.face_ids == patch.face
        face = TrimmedFace(patch.face, exact.surface, tuple(exact.parameters(q) for q in patch.loops), patch.area)
        begin = time.perf_counter()
        try:
            lines, way, count = [], 0.0, 0
            for iso, etas in face.passes(radius, scallop - chord - off, flank):
                for eta in etas.tolist():
                    profile = PassProfile.of(iso.curve(eta), chord, radius)
                    line, _ = lifted(profile, steps(profile, radius, chord, scallop), tool, limit, chord, off)
                    lines += line
                    way, count = way + profile.length, count + 1
        except GeometryError as refusal:
            print(f"F{patch.face:<4} failed: {refusal}")
            continue
        seconds = time.perf_counter() - begin
        s = with_surface_normals(sample_surface(part.mesh, 400.0, seed=2, triangles=np.flatnonzero(own)), part.mesh)
        tip = tips(s.points, s.normals, tool)
        touched = limit(np.ascontiguousarray(tip[:, :2])) <= tip[:, 2] + 0.002
        for share in (0.5, 1.0):  # as the planner counts reach
            away = tips(s.points + share * off * s.normals, s.normals, tool)
            touched |= limit(np.ascontiguousarray(away[:, :2])) <= away[:, 2] + FREE
        if not touched.any():
            print(f"F{patch.face:<4} {patch.area:.3g} mm2, no sample of which the tool touches")
            continue
        left = left_by(lines, s.points[touched], s.normals[touched], radius)
        rest = left_by(lines, everywhere.points, everywhere.normals, radius)
        deep = max(entered(lines, s.points[touched], radius, np.argsort(left)[:40]),
                   entered(lines, everywhere.points, radius, np.argsort(rest)[:40]))
        print(f"F{patch.face:<4} {len(face.pieces):6d} {' '.join(p.method for p in face.pieces):16} {count:6d} "
              f"{len(lines):6d} {way:7.0f} {touched.mean():7.3f} {np.quantile(left, 0.99):8.4f} {left.max():9.4f} "
              f"{(left > scallop).mean():7.4f} {deep:8.4f} {seconds:6.1f}", flush=True)


def demo_faces() -> None:
    """The walls of the demo part."""
    made = make_part(0, "demo")
    with tempfile.TemporaryDirectory() as folder:
        step, *_ = made.write(folder)
        faces(Path(step), made.setup, 0.5, 0.01, 0.002, "demo part")


def wheel_faces(parts: Path) -> None:
    """The blades of the compressor wheel."""
    given = json.loads((Path(__file__).resolve().parents[2] / "examples/setups/kj66_compressor_wheel.json").read_text())
    faces(parts / "imp_kj66_compressor_wheel.step", given, 1.0, 0.05, 0.005, "compressor wheel")


def leaning_faces(parts: Path, lean: float) -> None:
    """The large faces of the blades by a ball of 2 mm that leans to the side they look to, free of the wheel."""
    root = Path(__file__).resolve().parents[2]
    setup = parse_setup((root / "examples/setups/kj66_compressor_wheel.json").read_text())
    step, scallop, chord = parts / "imp_kj66_compressor_wheel.step", 0.05, 0.004
    ready = prepare(step, setup, lambda _stage, _share: None)
    part, body = ready.views[0].part, tool_bodies(setup)[3]
    large = {f.number for f in part.faces if f.surface == "bspline" and f.area > 500.0}
    numbers = sorted({f for w in ready.decomposition.walls for f in w.faces} & large)
    patches = read_patches(step, numbers, placement=placement_of(setup), solid=setup.part.solid)
    trimmed = trim_faces(part, numbers, lambda p, _n, _f: np.zeros(len(p), np.int64), 1e3)[0]
    tree, off = TriangleTree(part.mesh), max(0.1 * scallop, 1.5 * part.chord)
    blocked = enters(tree, body, JobInputs.of(setup).clearances)
    print(f"\nblades of the wheel: ball of {body.radius} mm that leans, scallop {scallop}, chord {chord} mm")
    print(f"{'face':>5} {'lean':>5} {'passes':>6} {'mm':>7} {'walked':>7} {'p99':>8} {'most':>8} {'over h':>7} "
          f"{'gouge':>8} {'s':>6}")
    for patch in trimmed:
        exact = patches[patch.face]
        face = TrimmedFace(patch.face, exact.surface, tuple(exact.parameters(q) for q in patch.loops), patch.area)
        s = with_surface_normals(sample_surface(part.mesh, 60.0, seed=2, triangles=np.flatnonzero(
            part.mesh.face_ids == patch.face)), part.mesh)
        foot = foot_points(exact.surface, s.points, exact.parameters(part.uv[s.triangle].mean(axis=1)))
        points, normals = exact.surface.points_and_normals(foot.uv)
        for angle in (0.0, lean):
            begin, pieces, way, out, count = time.perf_counter(), [], 0.0, 0.0, 0
            for iso, etas in face.passes(body.radius, scallop - chord - off, None):
                for eta in etas.tolist():
                    profile = PassProfile.of(iso.curve(eta), chord, body.radius)
                    made = posed(profile, steps(profile, body.radius, chord, scallop), body, leaned(np.radians(angle)),
                                 blocked, chord, off)
                    pieces += made.pieces
                    way, out, count = way + profile.length, out + sum(b - a for a, b in made.left), count + 1
            seconds = time.perf_counter() - begin
            if not pieces:
                print(f"F{patch.face:<4} {angle:5.0f} {count:6d} {way:7.0f} {0.0:7.3f}")
                continue
            start, end, a, b = (np.vstack([piece[c][k] for piece in pieces]) for c in (0, 1)
                                for k in (slice(None, -1), slice(1, None)))
            moves = Moves(start, end, np.ones(len(start), np.bool_), np.zeros(len(start), np.int32),
                          ToolAxes.between(a, b))
            left = residual_on_normals(points, normals, np.full(len(points), 10.0), moves, [body])[0]
            axis = leaned(np.radians(angle))(points, normals, normals)
            free = ~blocked(tips(points + off * normals, normals, body, axis), axis)
            print(f"F{patch.face:<4} {angle:5.0f} {count:6d} {way:7.0f} {1.0 - out / way:7.3f} "
                  f"{np.quantile(left[free], 0.99):8.4f} {left[free].max():8.4f} "
                  f"{(left[free] > scallop).mean():7.4f} {max(-left.min(), 0.0):8.4f} "
                  f"{seconds:6.1f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", action="store_true")
    parser.add_argument("--chords", action="store_true")
    parser.add_argument("--trims", type=int, default=0)
    parser.add_argument("--demo", action="store_true")
    parser.add_argument("--wheel", type=Path, help="folder of the parts by others")
    parser.add_argument("--lean", type=float, help="degrees, with --wheel: the blades by a leaning ball instead")
    args = parser.parse_args()
    every = not (args.cases or args.chords or args.trims or args.demo or args.wheel)
    if args.cases or every:
        cases()
    if args.chords or every:
        chords()
    if args.trims or every:
        trims(args.trims or 50)
    if args.demo or every:
        demo_faces()
    if args.wheel and args.lean:
        leaning_faces(args.wheel, args.lean)
    elif args.wheel:
        wheel_faces(args.wheel)


if __name__ == "__main__":
    main()
