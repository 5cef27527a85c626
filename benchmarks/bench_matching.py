"""Flat ends matched to curvature against balls: on a plane, and on surfaces in the range of papers/001.

Run from the root of the checkout: ``python benchmarks/bench_matching.py [--plane] [--ranges A B C]``; both where
nothing is asked. What passes leave, and how deep they cut, is measured by ``verify.removal`` on the exact surface, 1 mm
apart. The bound is the closed form of a strip at the match, or at the least tilt where there is none, integrated over
the surface: as many passes as if each could be as wide everywhere as it is in the middle of its strip.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np  # noqa: E402
from scipy.interpolate import make_interp_spline  # noqa: E402

from geometry.gridmap import GridMap  # noqa: E402
from geometry.mesh import F64  # noqa: E402
from geometry.nurbs import NurbsSurface  # noqa: E402
from geometry.toolbody import ToolBody  # noqa: E402
from toolpath.isoparametric import IsoSurface  # noqa: E402
from toolpath.isoparametric import lay_out as ball_passes  # noqa: E402
from toolpath.locations import tips  # noqa: E402
from toolpath.matched import Matched, Wanted  # noqa: E402
from toolpath.matching import matching_tilt, strip_width  # noqa: E402
from verify.removal import Moves, residual_on_normals  # noqa: E402
from verify.toolaxes import ToolAxes  # noqa: E402

HALF, SPANS = 130.0, 48  # mm, of the range each way; of the splines through it
SCALLOP, DEPTH, CHORD = 0.005, 0.001, 0.0003  # mm
LEFT_SHARE = 0.95  # of the scallop, given to the strips; what lies between places that are looked at takes the rest
LEAST = {"A": 0.0, "B": 0.0, "C": 0.25}  # degrees


def range_a(x: F64, y: F64) -> F64:
    """A hollow of 150 mm across and 600 mm along."""
    return x * x / 300.0 + y * y / 1200.0


def range_b(x: F64, y: F64) -> F64:
    """The hollow with waves."""
    return range_a(x, y) + 2.0 * np.sin(2.0 * np.pi * x / 260.0) * np.sin(2.0 * np.pi * y / 260.0)


def range_c(x: F64, y: F64) -> F64:
    """The hollow turned over."""
    return -range_a(x, y)


RANGES: dict[str, tuple[Callable[[F64, F64], F64], bool]] = {
    "A": (range_a, True), "B": (range_b, True), "C": (range_c, False)}


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


def measured(surface: NurbsSurface, tool: ToolBody, passes: list[tuple[F64, F64]]) -> tuple[float, float]:
    """The most that passes leave and the deepest they cut, mm; passes as tips and axes."""
    at = (np.arange(260) + 0.5) / 260.0
    points, normals = surface.points_and_normals(np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2))
    start, stop = (np.concatenate([t[cut] for t, _ in passes]) for cut in (slice(-1), slice(1, None)))
    first, last = (np.concatenate([a[cut] for _, a in passes]) for cut in (slice(-1), slice(1, None)))
    moves = Moves(start, stop, np.ones(len(start), bool), np.zeros(len(start), np.int32),
                  ToolAxes.between(first, last))
    left, _ = residual_on_normals(points, normals, np.full(len(points), 2.0), moves, [tool], bow=1e-5)
    return float(left.max()), float(-left.min())


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
            made = Matched.over(iso, tool, Wanted(LEFT_SHARE * SCALLOP, DEPTH, least, CHORD))
            strips = made.lay_out()
            passes = [made.located(s) for s in strips]
            seconds = time.perf_counter() - begin
            most, deep = measured(surface, tool, passes)
            mean, worst = bound(iso, tool, least)
            told = (name, f"{tool.kind} 60, corner {tool.corner_radius:g}", len(strips),
                    f"{mean:.1f}, {worst:.1f}", balls, f"{balls / len(strips):.1f}", f"{most:.5f}", f"{deep:.5f}",
                    f"{seconds:.0f}")
            print(f"| {' | '.join(map(str, told))} |", flush=True)


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
    given = asked.parse_args()
    if given.plane or not given.ranges:
        plane()
    if given.ranges or not given.plane:
        ranges(given.ranges or sorted(RANGES))


if __name__ == "__main__":
    main()
