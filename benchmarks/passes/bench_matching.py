"""Flat ends matched to curvature against balls: on a plane, on surfaces in the range of papers/001, on a blade.

Run from the root of the checkout: ``python benchmarks/passes/bench_matching.py [--plane] [--ranges A B C] [--split A
B C D] [--blade --public DIR]``; the first two where nothing is asked.

split : the ranges whole, fed the better way, and parted; and D, whose curvatures change places: 600 mm across all over,
        1200 mm along on one half and 150 mm on the other
blade : both sides of a blade of the KJ66 wheel; nothing of the wheel is looked at but that face

What passes leave, and how deep they cut, is measured by ``verify.surface.removal`` on the exact surface, 1 mm apart
(0.15 mm on the blade). The bound is the closed form of a strip at the match, or at the least tilt where there is
none, integrated over the surface: as many passes as if each could be as wide everywhere as it is in the middle of its
strip.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402
import shapely  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from scipy.interpolate import make_interp_spline  # noqa: E402

from geometry.mesh import F64  # noqa: E402
from geometry.parameterization.grid_map import GridMap  # noqa: E402
from geometry.sampling import sample_surface  # noqa: E402
from geometry.step_import.face_surfaces import read_patches  # noqa: E402
from geometry.step_import.reader import read_part  # noqa: E402
from geometry.surfaces.foot_points import foot_points  # noqa: E402
from geometry.surfaces.nurbs import NurbsSurface  # noqa: E402
from geometry.tool_body import ToolBody  # noqa: E402
from geometry.trimming.trim import trim_faces  # noqa: E402
from service.from_wire import parse_setup, placement_of  # noqa: E402
from toolpath.five_axis.curvature_matching import matching_tilt, strip_width  # noqa: E402
from toolpath.five_axis.matched_passes import MatchedPasses, MatchTolerances  # noqa: E402
from toolpath.five_axis.surface_partition import SurfacePiece, parted  # noqa: E402
from toolpath.passes.cutter_locations import tips  # noqa: E402
from toolpath.passes.isoparametric_passes import IsoSurface  # noqa: E402
from toolpath.passes.isoparametric_passes import lay_out as ball_passes  # noqa: E402
from toolpath.passes.trimmed_faces import TrimmedFace  # noqa: E402
from verify.moves import Moves  # noqa: E402
from verify.surface.removal import residual_on_normals  # noqa: E402
from verify.tool_axes import ToolAxes  # noqa: E402

Poses = tuple[F64, F64]
"""A pass: tips (k, 3), mm, and axes (k, 3), unit."""

HALF, SPANS = 130.0, 48  # mm, of the range each way; of the splines through it
SCALLOP, DEPTH, CHORD = 0.005, 0.001, 0.0003  # mm
LEFT_SHARE = 0.95  # of the scallop, given to the strips; what lies between places that are looked at takes the rest
LEAST = {"A": 0.0, "B": 0.0, "C": 0.25, "D": 0.0}  # degrees
WHEEL = "imp_kj66_compressor_wheel.step"
BLADE_TOOL, BLADE_SCALLOP, BLADE_CHORD, BLADE_LEAST = 6.0, 0.01, 0.0005, float(np.radians(0.25))
BALL_PLACES = 513  # of a ball along a pass
BLADE_AREA = 1000.0  # mm², at least, of a side of a blade


def range_a(x: F64, y: F64) -> F64:
    """A hollow of 150 mm across and 600 mm along."""
    return x * x / 300.0 + y * y / 1200.0


def range_b(x: F64, y: F64) -> F64:
    """The hollow with waves."""
    return range_a(x, y) + 2.0 * np.sin(2.0 * np.pi * x / 260.0) * np.sin(2.0 * np.pi * y / 260.0)


def range_c(x: F64, y: F64) -> F64:
    """The hollow turned over."""
    return -range_a(x, y)


def range_d(x: F64, y: F64) -> F64:
    """A hollow of 600 mm across, of 1200 mm along and, from the middle on, of 150 mm."""
    at = np.linspace(-HALF, HALF, 521)
    step = np.clip((at + 20.0) / 40.0, 0.0, 1.0)
    curved = 1.0 / 1200.0 + (1.0 / 150.0 - 1.0 / 1200.0) * step * step * (3.0 - 2.0 * step)
    return np.asarray(x * x / 1200.0 + make_interp_spline(at, curved, 3).antiderivative(2)(y))


RANGES: dict[str, tuple[Callable[[F64, F64], F64], bool]] = {
    "A": (range_a, True), "B": (range_b, True), "C": (range_c, False), "D": (range_d, True)}


def spline_of(height: Callable[[F64, F64], F64]) -> NurbsSurface:
    """z = height(x, y) on the range as a bicubic surface over the unit square, u along x."""
    x = np.linspace(-HALF, HALF, SPANS + 1)
    along = make_interp_spline(x, height(*np.meshgrid(x, x, indexing="ij")), 3, axis=0)
    across = make_interp_spline(x, along.c.T, 3, axis=0)
    at = np.array([along.t[i + 1:i + 4].mean() for i in range(SPANS + 1)])
    net = np.stack([*np.meshgrid(at, at, indexing="ij"), across.c.T], axis=-1)
    knots = (along.t + HALF) / (2.0 * HALF)
    return NurbsSurface(net, knots, knots)


def whole(surface: NurbsSurface, turned: bool) -> IsoSurface:
    """The surface over the unit square; passes along y where ``turned``, else along x."""
    at = np.linspace(0.0, 1.0, 9)
    return IsoSurface(surface, GridMap.of(np.stack(np.meshgrid(at, at), axis=-1)), turned)


def end(diameter: float, corner: float) -> ToolBody:
    """A tool of nothing but its cutting part."""
    return ToolBody("T1", 1, diameter, corner, 60.0, diameter, 60.0, diameter, 60.0)


def bound(iso: IsoSurface, tool: ToolBody, least: float) -> tuple[float, float]:
    """Passes by the closed form: on the mean of lines across, and on the worst of them."""
    at, counts = np.linspace(0.0, 1.0, 201), []
    for x in np.linspace(0.0, 1.0, 41):
        xi = np.full(len(at), x)
        width, _ = iso.across(xi, at)
        k_2, k_1 = np.sort(-iso.surface.curvature(iso.parameters(xi, at)), axis=1).T
        tilt = np.fmax(matching_tilt(k_1, tool), least)
        counts.append(float(np.trapezoid(width / strip_width(tilt, k_1, k_2, tool, SCALLOP), at)))
    return float(np.mean(counts)), max(counts)


def measured(points: F64, normals: F64, tool: ToolBody, passes: list[Poses]) -> tuple[float, float]:
    """The most that passes leave at places (n, 3) and the deepest they cut, mm."""
    start, stop = (np.concatenate([t[cut] for t, _ in passes]) for cut in (slice(-1), slice(1, None)))
    first, last = (np.concatenate([a[cut] for _, a in passes]) for cut in (slice(-1), slice(1, None)))
    moves = Moves(start, stop, np.ones(len(start), bool), np.zeros(len(start), np.int32),
                  ToolAxes.between(first, last))
    left, _ = residual_on_normals(points, normals, np.full(len(points), 2.0), moves, [tool], bow=1e-5)
    return float(left.max()), float(-left.min())


def everywhere(surface: NurbsSurface) -> tuple[F64, F64]:
    """Places and normals 1 mm apart in plan."""
    at = (np.arange(260) + 0.5) / 260.0
    return surface.points_and_normals(np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2))


def metres(passes: list[Poses]) -> float:
    """How far the tip goes along passes."""
    return 1e-3 * float(sum(np.linalg.norm(np.diff(tip, axis=0), axis=1).sum() for tip, _ in passes))


def laid(isos: list[IsoSurface], tool: ToolBody, wanted: MatchTolerances) -> list[Poses]:
    """Passes over pieces of a surface."""
    made = [MatchedPasses.over(iso, tool, wanted) for iso in isos]
    return [m.located(s) for m in made for s in m.lay_out()]


def ranges(names: list[str]) -> None:
    """Passes over the ranges of the paper."""
    print("| range | tool | passes | bound: mean, worst line | ball 30 | fewer | most left mm | deepest mm | s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in names:
        height, turned = RANGES[name]
        surface = spline_of(height)
        iso, least = whole(surface, turned), float(np.radians(LEAST[name]))
        balls = len(ball_passes(iso, 15.0, SCALLOP))
        for tool in (end(60.0, 0.0), end(60.0, 3.0)):
            begin = time.perf_counter()
            passes = laid([iso], tool, MatchTolerances(LEFT_SHARE * SCALLOP, DEPTH, least, CHORD))
            seconds = time.perf_counter() - begin
            most, deep = measured(*everywhere(surface), tool, passes)
            mean, worst = bound(iso, tool, least)
            told = (name, f"{tool.kind} 60, corner {tool.corner_radius:g}", len(passes),
                    f"{mean:.1f}, {worst:.1f}", balls, f"{balls / len(passes):.1f}", f"{most:.5f}", f"{deep:.5f}",
                    f"{seconds:.0f}")
            print(f"| {' | '.join(map(str, told))} |", flush=True)


def split(names: list[str]) -> None:
    """Passes over the ranges whole, fed the better way, and parted; the last column is the way that was foreseen, with
    the ends, and the way round that metres leave out."""
    print("| range | tool | split | pieces: xi, eta, feed | passes | m | most left mm | deepest mm | s | foreseen m |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name in names:
        height, turned = RANGES[name]
        surface = spline_of(height)
        iso = whole(surface, turned)
        wanted = MatchTolerances(LEFT_SHARE * SCALLOP, DEPTH, float(np.radians(LEAST[name])), CHORD)
        for tool in (end(60.0, 0.0), end(60.0, 3.0)):
            one, several = (parted(iso, tool, wanted, cut=cut) for cut in (False, True))
            same = len(several) == 1
            for split_as, parts in (("off", one), ("on", several))[:1 if same else 2]:
                begin = time.perf_counter()
                passes = laid([p.iso for p in parts], tool, wanted)
                seconds = time.perf_counter() - begin
                row(name, f"{tool.kind} 60, corner {tool.corner_radius:g}", "off = on" if same else split_as,
                    described(parts), len(passes), f"{metres(passes):.2f}",
                    *(f"{v:.5f}" for v in measured(*everywhere(surface), tool, passes)), f"{seconds:.0f}",
                    f"{1e-3 * sum(p.way for p in parts):.2f}")


def row(*told: object) -> None:
    """A row of a table."""
    print(f"| {' | '.join(map(str, told))} |", flush=True)


def described(parts: list[SurfacePiece]) -> str:
    """Pieces in words."""
    return "; ".join(f"{p.low[0]:.2f}-{p.high[0]:.2f}, {p.low[1]:.2f}-{p.high[1]:.2f}, "
                     f"{'v' if p.iso.turned else 'u'}" for p in parts)


def ball_poses(iso: IsoSurface, radius: float, scallop: float) -> list[Poses]:
    """Passes of a ball whose axis is the normal, and whose tip the contact."""
    at = np.linspace(0.0, 1.0, BALL_PLACES)
    return [iso.contact(at, np.full(BALL_PLACES, eta)) for eta in ball_passes(iso, radius, scallop).tolist()]


def inside(isos: list[IsoSurface], uv: F64) -> NDArray[np.bool_]:
    """Which parameters (n, 2) lie in any of some pieces."""
    at = np.linspace(0.0, 1.0, 400)
    low, high = np.zeros(400), np.ones(400)
    out = np.zeros(len(uv), bool)
    for iso in isos:
        sides = (at, low), (high, at), (at[::-1], high), (low, at[::-1])
        out |= shapely.contains_xy(shapely.Polygon(np.concatenate([iso.parameters(*side) for side in sides])), *uv.T)
    return out


def blade_faces(folder: Path) -> dict[str, tuple[TrimmedFace, F64]]:
    """Of both sides of a blade the trimmed face, and parameters (n, 2) of places on it, by what the side is."""
    setup = parse_setup((ROOT / "examples/setups/kj66_compressor_wheel.json").read_text())
    part = read_part(folder / WHEEL, placement=placement_of(setup), solid=setup.part.solid, chord=0.02)
    large = [f.number for f in part.faces if f.surface == "bspline" and f.area > BLADE_AREA]
    patches = read_patches(folder / WHEEL, large, placement=placement_of(setup), solid=setup.part.solid)
    sides = {}
    for number in large:
        exact, own = patches[number], part.mesh.face_ids == number
        if 2 in exact.surface.orders:  # ruled, as the sides of blades are and the hub is not
            curved = exact.surface.curvature(exact.parameters(part.uv[own].reshape(-1, 2)))
            sides[number] = float(np.median(curved.sum(axis=1)))
    out = {}
    for told, number in (("hollow side", min(sides, key=lambda n: sides[n])),
                         ("round side", max(sides, key=lambda n: sides[n]))):
        exact = patches[number]
        patch = trim_faces(part, [number], lambda p, _n, _f: np.zeros(len(p), np.int64), 1e3)[0][0]
        face = TrimmedFace(number, exact.surface, tuple(exact.parameters(q) for q in patch.loops), patch.area)
        s = sample_surface(part.mesh, 45.0, seed=2, triangles=np.flatnonzero(part.mesh.face_ids == number))
        foot = foot_points(exact.surface, s.points, exact.parameters(part.uv[s.triangle].mean(axis=1)))
        out[f"F{number}, {told}"] = face, foot.uv
    return out


def blade(folder: Path | None) -> None:
    """Both sides of a blade of the wheel by ends and by a ball as wide, the face alone looked at."""
    if folder is None or not (folder / WHEEL).exists():
        print(f"no blade: {WHEEL} is not in the folder given by --public")
        return
    print("| face | tool | split | pieces: xi, eta, feed | passes | m | most left mm | deepest mm | s |")
    print("|---|---|---|---|---|---|---|---|---|")
    wanted = MatchTolerances(LEFT_SHARE * BLADE_SCALLOP, DEPTH, BLADE_LEAST, BLADE_CHORD)
    for told, (face, uv) in blade_faces(folder).items():
        isos = [IsoSurface(face.surface, piece.map) for piece in face.pieces]
        laid_out = inside(isos, uv)
        print(f"{told}: {face.area:.0f} mm2, {100.0 * laid_out.mean():.2f} % of it laid into squares and looked at")
        points, normals = face.surface.points_and_normals(uv[laid_out])
        radius = BLADE_TOOL / 2.0
        passes = [p for iso in isos for p in ball_poses(iso, radius, LEFT_SHARE * BLADE_SCALLOP)]
        ball = end(BLADE_TOOL, radius)
        row(told, f"ball {BLADE_TOOL:g}", "", len(isos), len(passes), f"{metres(passes):.2f}",
            *(f"{v:.5f}" for v in measured(points, normals, ball, passes)), "")
        for tool in (end(BLADE_TOOL, 0.0), end(BLADE_TOOL, 1.0)):
            one, several = ([p for iso in isos for p in parted(iso, tool, wanted, cut=cut)] for cut in (False, True))
            same = len(one) == len(several)
            for split_as, parts in (("off", one), ("on", several))[:1 if same else 2]:
                begin = time.perf_counter()
                passes = laid([p.iso for p in parts], tool, wanted)
                seconds = time.perf_counter() - begin
                row(told, f"{tool.kind} {BLADE_TOOL:g}, corner {tool.corner_radius:g}",
                    "off = on" if same else split_as, described(parts), len(passes), f"{metres(passes):.2f}",
                    *(f"{v:.5f}" for v in measured(points, normals, tool, passes)), f"{seconds:.0f}")


def plane() -> None:
    """Side steps of a tilted flat of 12 mm against a ball of 12 mm at a cusp of 0.01 mm, both by the verifier."""
    offsets = np.linspace(-2.0, 2.0, 8001)
    way = np.column_stack([np.zeros(2), [-8.0, 8.0], np.zeros(2)])
    up = np.tile([0.0, 0.0, 1.0], (2, 1))
    steps = {}
    for name, tool, tilt in (("ball", end(12.0, 6.0), 0.0), ("5", end(12.0, 0.0), 5.0), ("3", end(12.0, 0.0), 3.0)):
        a = np.radians(tilt)
        axis = np.tile([0.0, np.sin(a), np.cos(a)], (2, 1))
        tip = tips(way, up, tool, axis)
        moves = Moves(tip[:1], tip[1:], np.ones(1, bool), np.zeros(1, np.int32), ToolAxes.between(axis[:1], axis[1:]))
        points = np.column_stack([offsets, 0.0 * offsets, 0.0 * offsets])
        upward = np.tile(up[:1], (len(points), 1))
        left, _ = residual_on_normals(points, upward, np.full(len(points), 1.0), moves, [tool])
        steps[name] = float(np.ptp(offsets[left <= 0.01]))
    for tilt in ("5", "3"):
        print(f"plane, flat 12 at {tilt} degrees: {steps[tilt] / steps['ball']:.3f} times the side step of a ball 12")


def main() -> None:
    """What is asked for on the command line."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--plane", action="store_true")
    asked.add_argument("--ranges", nargs="+", choices=sorted(RANGES))
    asked.add_argument("--split", nargs="*", choices=sorted(RANGES))
    asked.add_argument("--blade", action="store_true")
    asked.add_argument("--public", type=Path, help="folder of the parts by others")
    given = asked.parse_args()
    nothing = not (given.plane or given.ranges or given.blade or given.split is not None)
    if given.plane or nothing:
        plane()
    if given.ranges or nothing:
        ranges(given.ranges or ["A", "B", "C"])
    if given.split is not None:
        split(given.split or sorted(RANGES))
    if given.blade:
        blade(given.public)


if __name__ == "__main__":
    main()
