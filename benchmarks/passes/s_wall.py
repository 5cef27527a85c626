"""An S-shaped thin wall, as five-axis machines are tried on: how evenly the tool axis goes, and what the passes leave.

Run from the root of the checkout: ``python benchmarks/passes/s_wall.py [--cost]``. The wall is 160 mm long, 30 high
and 3 thick, each side ruled between two waves of different height, the upper shifted along: it leans out here and in
there, by up to 11 degrees, and twice stands upright, where A and C of a table have their pole. Both sides are
finished by

- the flank of a bull nose (``toolpath.five_axis.flank_milling``): the ruling of every station looked for alone, or as
  it is planned;
- a ball, its axis 65 degrees off the normal, as the wall has it, or led by ``toolpath.five_axis.axis_smoothing``:
  evenly, under a limit of turning, and past a post that stands 32 mm before the wall. Where the tool is blocked
  passes break off.

Rates are of the rotary axes of a table A/C by millimetre of tip; ``rough`` is the root mean square of how the tool axis
bends, deg/mm², with stations evenly on the tip's way; a reversal is a turn back of a rotary axis by more than 0.05 deg.
What is left and how deep is measured by ``verify.surface.removal`` on the exact surface, 0.5 mm apart.

With ``--cost`` the led passes of the outer side are walked over finer and finer triangles of it instead: seconds by
1,000 locations with the search for axes and all questions of what is in the way, and the exponent of that in triangles.
Run it with NUMBA_NUM_THREADS=1: processor time counts every thread.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402
from scipy.interpolate import make_interp_spline  # noqa: E402

import toolpath.five_axis.flank_milling as flank  # noqa: E402
from geometry.mesh import F64, TriangleMesh  # noqa: E402
from geometry.mesh_queries.bvh import TriangleTree  # noqa: E402
from geometry.parameterization.grid_map import GridMap  # noqa: E402
from geometry.surfaces.nurbs import NurbsSurface  # noqa: E402
from geometry.tool_body import HolderFrustum, ToolBody  # noqa: E402
from output.inverse_kinematics import RotaryMachine  # noqa: E402
from toolpath.five_axis.axis_smoothing import AxisLimits, steered  # noqa: E402
from toolpath.five_axis.oriented_pass import enters, lead_and_tilt, posed  # noqa: E402
from toolpath.passes.forward_step import PassProfile, steps  # noqa: E402
from toolpath.passes.isoparametric_passes import IsoSurface, lay_out  # noqa: E402
from verify.moves import Moves
from verify.surface.removal import residual_on_normals
from verify.tool_axes import ToolAxes  # noqa: E402
from zones.reach.assembly import Clearances

LENGTH, HIGH, THICK, WAVE, LESS, SHIFT = 160.0, 30.0, 3.0, 25.0, 4.0, 7.0  # mm
SCALLOP, CHORD, DEPTH, OFF = 0.02, 0.0025, 0.0025, 0.004  # mm
FEED = 1000.0  # mm/min
FLANK = ToolBody("T1", 1, 16.0, 1.0, 36.0, 15.0, 60.0, 16.0, 60.0)
BALL = ToolBody("T2", 2, 8.0, 4.0, 16.0, 7.6, 40.0, 8.0, 50.0, (HolderFrustum(20.0, 32.0, 40.0),))
AWAY = 32.0  # mm, of the post from the middle of the wall
LEANS, LIMITS = np.radians(65.0), AxisLimits(np.radians(40.0), np.radians(4.0))
WARY = 0.3  # mm kept more at the stations of a led pass, for what lies between them
MACHINE = RotaryMachine("table-table-AC", None, np.radians([[-110.0, 110.0], [-3600.0, 3600.0]]))
EVEN, BACK = 0.5, 0.05  # mm between stations; deg


def side(outwards: float) -> NurbsSurface:
    """A side of the wall, its normal away from the wall; outwards : 1 or -1."""
    x = np.linspace(0.0, LENGTH, 81)
    rows = []
    for wave, shift in ((WAVE, 0.0), (WAVE - LESS, SHIFT)):
        phase, k = 2.0 * np.pi * (x + shift) / LENGTH, 2.0 * np.pi / LENGTH
        y, slope = wave * np.sin(phase), wave * k * np.cos(phase)
        across = np.stack([-slope, np.ones_like(slope)], -1) / np.hypot(slope, 1.0)[:, None]
        rows.append(np.stack([x, y], -1) + 0.5 * THICK * outwards * across)
    spline = make_interp_spline(x / LENGTH, np.stack(rows, axis=1), 3)
    net = np.concatenate([spline.c, np.broadcast_to([[0.0], [HIGH]], (*spline.c.shape[:2], 1))], axis=2)
    made = NurbsSurface(net, spline.t, np.array([0.0, 0.0, 1.0, 1.0]), (4, 2))
    normal = made.points_and_normals(np.array([[0.5, 0.5]]))[1][0]
    return made if normal[1] * outwards > 0.0 else replace(made, side=-1)


def over_square(surface: NurbsSurface) -> IsoSurface:
    """The surface over the unit square, passes along it."""
    at = np.linspace(0.0, 1.0, 9)
    return IsoSurface(surface, GridMap.of(np.stack(np.meshgrid(at, at), axis=-1)))


def measured(surface: NurbsSurface, tool: ToolBody, passes: list[tuple[F64, F64]]) -> tuple[float, float]:
    """The most that passes leave, 2 mm off the ends, and the deepest they cut, mm; passes as tips and axes."""
    u, v = np.meshgrid(np.linspace(0.02, 0.98, 307), (np.arange(59) + 1) / 60.0)
    points, normals = surface.points_and_normals(np.stack([u, v], axis=-1).reshape(-1, 2))
    start, stop = (np.concatenate([t[cut] for t, _ in passes]) for cut in (slice(-1), slice(1, None)))
    first, last = (np.concatenate([a[cut] for _, a in passes]) for cut in (slice(-1), slice(1, None)))
    moves = Moves(start, stop, np.ones(len(start), bool), np.zeros(len(start), np.int32), ToolAxes.between(first, last))
    left, _ = residual_on_normals(points, normals, np.full(len(points), 1.0), moves, [tool], bow=1e-5)
    return float(left.max()), float(-left.min())


def evenness(passes: list[tuple[F64, F64]]) -> list[float]:
    """Fastest A and C, deg/mm, reversals of A and C, and roughness, deg/mm²; the worst, or all, of some passes."""
    fastest, back, bends = np.zeros(2), np.zeros(2, int), []
    for tip, axis in passes:
        gone = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tip, axis=0), axis=1))])
        at = np.linspace(0.0, gone[-1], max(int(gone[-1] / EVEN), 4))
        even = np.stack([np.interp(at, gone, column) for column in axis.T], -1)
        even /= np.linalg.norm(even, axis=1)[:, None]
        turns = np.degrees(MACHINE.follow(even))
        fastest = np.maximum(fastest, np.abs(np.diff(turns, axis=0)).max(axis=0) / at[1])
        back += [reversals(column) for column in turns.T]
        bends.append(np.degrees(np.linalg.norm(np.diff(even, 2, axis=0), axis=1)) / at[1] ** 2)
    return [*fastest.tolist(), *back.tolist(), float(np.sqrt(np.mean(np.concatenate(bends) ** 2)))]


def reversals(angle: F64) -> int:
    """How often an angle (n,) turns back by more than BACK."""
    count, way, top = 0, 0, angle[0]
    for a in angle.tolist():
        if way * (a - top) >= 0.0 and abs(a - top) > (BACK if way == 0 else 0.0):
            way, top = (1 if a > top else -1) if way == 0 else way, a
        elif way * (top - a) > BACK:
            count, way, top = count + 1, -way, a
    return count


def flanked(surface: NurbsSurface, planned: bool) -> list[tuple[F64, F64]]:
    """The flank pass as it is planned, or with the ruling of every station looked for alone."""
    wall, kept = flank.FlankWall(over_square(surface)), (flank.TURNING, flank.EVENED)
    if planned:
        made = flank.bands(wall, FLANK, flank.FlankTolerances(SCALLOP, DEPTH, CHORD))
    else:
        xi = np.linspace(0.0, 1.0, flank.STATIONS)
        try:
            flank.TURNING, flank.EVENED = 0.0, 0.0
            shift = flank._paired(wall, xi, (0.0, 1.0), FLANK.radius, SCALLOP)
        finally:
            flank.TURNING, flank.EVENED = kept
        made = [flank.Band(wall, FLANK, 0.0, 0.0, 1.0, xi, shift, np.zeros(len(xi)))]
    out = []
    for band in made:
        out += [(p.tips, p.axes) for p in band.pieces(lambda tip, _axis: np.zeros(len(tip), bool), CHORD)]
    return out


def by_ball(surface: NurbsSurface, tree: TriangleTree, led: bool, tilt: float) -> tuple[list[tuple[F64, F64]], float]:
    """Passes of a ball with axes as wanted or led, and how much of them is blocked, 0 to 1."""
    iso, field, kept = over_square(surface), lead_and_tilt(0.0, tilt), Clearances()
    free = enters(tree, BALL, kept)
    wary = enters(tree, BALL, replace(kept, neck=kept.neck + WARY, shank=kept.shank + WARY, holder=kept.holder + WARY))
    out: list[tuple[F64, F64]] = []
    before, blocked, whole = None, 0.0, 0.0
    for eta in lay_out(iso, BALL.corner_radius, SCALLOP - CHORD).tolist():
        profile = PassProfile.of(iso.curve(eta), CHORD, BALL.corner_radius)
        ends = steps(profile, BALL.corner_radius, CHORD, SCALLOP)
        before = steered(profile, BALL, field, wary, LIMITS, before, OFF) if led else None
        made = posed(profile, ends, BALL, before or field, free, CHORD, OFF)
        out += made.pieces
        blocked, whole = blocked + sum(b - a for a, b in made.left), whole + profile.length
    return out, blocked / whole


def post(at: float) -> NurbsSurface:
    """The front of a post 8 mm wide and 70 high in the middle of the wall, at y = ``at``."""
    x = 0.5 * LENGTH + np.array([-4.0, 4.0])
    net = np.stack([*np.meshgrid(x, [0.0, 70.0], indexing="ij")], -1)
    flat = np.array([0.0, 0.0, 1.0, 1.0])
    return NurbsSurface(np.insert(net, 1, at, axis=2), flat, flat, (2, 2))


def tree_of(surfaces: list[NurbsSurface], chord: float = 0.003, angle: float = 0.05) -> TriangleTree:
    """Surfaces as triangles."""
    meshes = [s.discretised(chord, angle) for s in surfaces]
    first = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return TriangleTree(TriangleMesh(np.vstack([m.vertices for m in meshes]),
                                     np.vstack([m.faces + n for m, n in zip(meshes, first, strict=False)])))


def row(name: str, surface: NurbsSurface, tool: ToolBody, passes: list[tuple[F64, F64]], seconds: float) -> str:
    """A row of the table."""
    left, deep = measured(surface, tool, passes)
    metres = 1e-3 * sum(float(np.linalg.norm(np.diff(t, axis=0), axis=1).sum()) for t, _ in passes)
    a, c, back_a, back_c, rough = evenness(passes)
    cells = [name, f"{len(passes)}", f"{metres:.3f}", f"{1e3 * metres / FEED:.2f}", f"{left:.4f}", f"{deep:.4f}",
             f"{a:.2f}", f"{c:.2f}", f"{back_a:.0f}", f"{back_c:.0f}", f"{rough:.4f}", f"{seconds:.1f}"]
    return "| " + " | ".join(cells) + " |"


def cost() -> None:
    """Print seconds by 1,000 locations for finer and finer triangles, the lesser of two runs each.

    Seconds of processor time, with those on the clock beside them: the exponent is of the former, which what else runs
    on the machine changes less. Making the triangles, and the hierarchy over them, is timed for itself.
    """
    surface, logs = side(1.0), []
    by_ball(surface, tree_of([surface, post(AWAY)], 0.1, 0.5), True, LEANS)  # so that no kernel is compiled in between
    print("| triangles | making them s | locations | s | s by 1,000 | on the clock |\n|" + "---|" * 6)
    for chord, angle in ((0.004, 0.1), (0.001, 0.03), (0.00025, 0.01)):
        begun = time.perf_counter()
        tree = tree_of([surface, post(AWAY)], chord, angle)
        tree.hulls  # noqa: B018
        made, seconds, clock = time.perf_counter() - begun, [], []
        for _ in range(2):
            begun, used = time.perf_counter(), time.process_time()
            passes, _ = by_ball(surface, tree, True, LEANS)
            seconds.append(time.process_time() - used)
            clock.append(time.perf_counter() - begun)
        count, facets = sum(len(t) for t, _ in passes), len(tree)
        logs.append((facets, min(seconds) / count))
        print(f"| {facets} | {made:.1f} | {count} | {min(seconds):.1f} | {1e3 * min(seconds) / count:.3f} | "
              f"{1e3 * min(clock) / count:.3f} |", flush=True)
    x, y = np.log(np.array(logs)).T
    print(f"exponent {np.polyfit(x, y, 1)[0]:.2f}")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cost", action="store_true")
    if parser.parse_args().cost:
        cost()
        return
    print("| by | passes | m | min | most left | deepest | A deg/mm | C deg/mm | A back | C back | rough | s |\n|"
          + "---|" * 12)
    for outwards, which in ((1.0, "outer"), (-1.0, "inner")):
        surface = side(outwards)
        for planned in (False, True):
            begun = time.perf_counter()
            passes = flanked(surface, planned)
            name = f"{which}, flank, {'as planned' if planned else 'each ruling alone'}"
            print(row(name, surface, FLANK, passes, time.perf_counter() - begun), flush=True)
        tree = tree_of([surface, post(AWAY * outwards)])
        for led in (False, True):
            begun = time.perf_counter()
            passes, blocked = by_ball(surface, tree, led, LEANS * outwards)
            name = f"{which}, ball, {'led' if led else 'as wanted'}, {100.0 * blocked:.1f} % blocked"
            print(row(name, surface, BALL, passes, time.perf_counter() - begun), flush=True)


if __name__ == "__main__":
    main()
