"""Proof of a long program: seconds, memory, and where they go.

Run from the root of the checkout: ``python benchmarks/proof/bench_prove.py [--points N ...] [--axes 3 5]``. A ball of
6 mm is dragged to and fro over a wavy block of 50 x 50 mm, N points, rows four times as far apart as points, tips by
drop_cutter; the program is read, and proved at D samples a mm² along their normals (error under 1e-6 mm, whatever N
is). With ``--axes 5`` the tool leans by 5 to 25 degrees all the while and turns once a row, on a table-table-AC machine
under tool centre point control: the ball touches the same places, so the residuals are the same within 5e-4 mm. Wall
clock and time of the processors, one run a line in a process of its own, compiled kernels, as many threads as ``prove``
takes by itself; where the time goes is by the stages of the proof.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

from geometry.mesh import F64, TriangleMesh  # noqa: E402
from geometry.mesh_queries.bvh import TriangleTree  # noqa: E402
from geometry.part import FaceInfo, Part  # noqa: E402
from geometry.sampling import sample_surface  # noqa: E402
from geometry.tool_body import ToolBody  # noqa: E402
from toolpath.cutter.cutter import Cutter  # noqa: E402
from toolpath.drop_cutter import drop_cutter  # noqa: E402
from verify.kinematics import Kinematics  # noqa: E402
from verify.model import ProofSetup, StockKind  # noqa: E402
from verify.prove import ScoredSamples, prove  # noqa: E402

SIZE = 50.0
CELLS = 200
OVER = 2.0  # mm the rows run over every edge
TOOL = ToolBody("T1", 1, 6.0, 3.0, 12.0, 5.8, 30.0, 6.0, 40.0)
MACHINE = "table-table-AC"
STAGES = {3: {"read": 0.1, "rays": 0.6, "stock": 0.84, "bodies": 1.0},
          5: {"read": 0.1, "rays": 0.6, "stock": 0.88, "bodies": 1.0}}
"""The share of a proof at which each stage ends, by the number of axes."""


def block() -> TriangleMesh:
    """A closed block from z = -8 up to a wavy top, which is face 1."""
    g = np.linspace(0.0, SIZE, CELLS + 1)
    x, y = np.meshgrid(g, g, indexing="ij")
    top = np.stack([x, y, 3.0 * np.sin(x / 5.0) * np.cos(y / 6.0)], -1).reshape(-1, 3)
    n = CELLS + 1
    i = (np.arange(CELLS)[:, None] * n + np.arange(CELLS)).ravel()
    upper = np.concatenate([np.stack([i, i + n, i + n + 1], 1), np.stack([i, i + n + 1, i + 1], 1)])
    rim = np.concatenate([np.arange(CELLS) * n, CELLS * n + np.arange(CELLS), n * n - 1 - np.arange(CELLS) * n,
                          CELLS - np.arange(CELLS)])
    low, k = top[rim] * [1.0, 1.0, 0.0] - [0.0, 0.0, 8.0], len(top)
    j, nxt = np.arange(len(rim)), (np.arange(len(rim)) + 1) % len(rim)
    sides = np.concatenate([np.stack([rim, k + j, k + nxt], 1), np.stack([rim, k + nxt, rim[nxt]], 1)])
    base = np.stack([np.full(len(rim), k + len(rim)), k + nxt, k + j], 1)
    faces = np.concatenate([upper, sides, base])
    ids = np.repeat([1, 2, 3], [len(upper), len(sides), len(base)])
    return TriangleMesh(np.vstack([top, low, [[0.5 * SIZE, 0.5 * SIZE, -8.0]]]), faces, ids.astype(np.int32))


def program(tree: TriangleTree, points: int) -> str:
    """A program of about so many points over the block."""
    x = np.linspace(-OVER, SIZE + OVER, round(2.0 * points**0.5))
    y = np.linspace(-OVER, SIZE + OVER, round(0.5 * points**0.5))
    xy = np.concatenate([np.column_stack([x[::1 - 2 * (k % 2)], np.full(len(x), v)]) for k, v in enumerate(y.tolist())])
    z: F64 = drop_cutter(tree, Cutter.ball(diameter=TOOL.diameter, length=12.0), xy)
    lines = [f"X{a:.4f}Y{b:.4f}Z{c:.4f}" for (a, b), c in zip(xy.tolist(), z.tolist(), strict=True)]
    a, b = xy[0].tolist()
    return "\n".join(["G21 G90 G94 G17 G54 G61", "T1 M6", "S12000 M3", "G43 H1", "G0 Z30", f"G0 X{a:.4f} Y{b:.4f}",
                      "G1 F2000", *lines, "G0 Z30", "M5", "M30", ""])


def leaning(tree: TriangleTree, points: int) -> str:
    """The same with a tool that turns all the way; the centre of the ball goes where it goes in ``program``."""
    rows = [line[1:].replace("Y", " ").replace("Z", " ").split() for line in program(tree, points).splitlines()
            if line.startswith("X")]
    tips = np.array(rows, dtype=np.float64)
    k = np.arange(len(tips)) / round(2.0 * points**0.5)  # rows done
    turn = np.stack([15.0 + 10.0 * np.cos(2.0 * math.pi * k), 360.0 * k], 1)
    away = TOOL.radius * (np.array([0.0, 0.0, 1.0]) - Kinematics(MACHINE).axis(np.radians(turn)))
    lines = [f"X{x:.4f}Y{y:.4f}Z{z:.4f}A{a:.4f}C{c:.4f}"
             for (x, y, z), (a, c) in zip((tips + away).tolist(), turn.tolist(), strict=True)]
    place, lean = lines[0].split("Z")[0], "A" + lines[0].split("A")[1]
    return "\n".join(["G21 G90 G94 G17 G54 G61", "T1 M6", "S12000 M3", "G43.4 H1", "G0 A0 C0", "G0 X0 Y0", "G0 Z30",
                      f"G0 {lean}", f"G0 {place}", "G1 F2000", *lines, "G0 Z30", "M5", "M30", ""])


def run(points: int, density: float, axes: int) -> dict[str, Any]:
    """Figures of one proof in this process."""
    mesh = block()
    kinds = tuple(FaceInfo(f, "plane", float(mesh.areas[mesh.face_ids == f].sum()), False, 0.0, 0.0) for f in (1, 2, 3))
    part = Part(mesh, kinds, (), mesh.volume, mesh.bounds, "mm", 0.001, 0.1, 0.0, (), "0" * 64)
    scored = sample_surface(mesh, density, seed=1, triangles=np.flatnonzero(mesh.face_ids == 1))
    apart = 2.0 * (SIZE + 2.0 * OVER) / points**0.5
    cusp = max(0.01, apart**2 / (2.0 * TOOL.diameter))  # what such rows leave, with room for slopes
    setup = ProofSetup(StockKind.PART_OFFSET, margin=0.3, uncertainty=0.0, scallop_height=cusp, gouge_tolerance=0.01,
                       kinematics=Kinematics(MACHINE) if axes == 5 else None)
    text = (leaning if axes == 5 else program)(TriangleTree(mesh), points)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    zone = np.ones(len(scored), np.int32)
    prove([("warm", "\n".join([*text.split("\n")[:2000], "M30"]))], part, [TOOL], setup,
          ScoredSamples(scored, zone), ["Z1"])
    start, busy, marks = time.perf_counter(), time.process_time(), {}

    def tell(done: float) -> None:
        now = time.perf_counter()
        marks.update({stage: now for stage, end in STAGES[axes].items() if done <= end + 1e-9})

    proof = prove([("long", text)], part, [TOOL], setup, ScoredSamples(scored, zone), ["Z1"], tell)
    seconds, busy = time.perf_counter() - start, time.process_time() - busy
    ends = [start, *(marks[stage] for stage in STAGES[axes])]
    return {"lines": text.count("\n"), "samples": len(scored), "seconds": seconds, "busy": busy,
            "stages": np.diff(ends).tolist(), "spacing": proof.line_spacing, "max": float(proof.residual.max()),
            "least": float(proof.residual.min()), "findings": sum(proof.counts.values()), "before": before / 2**10,
            "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, nargs="+", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--density", type=float, default=100.0, help="samples a mm²")
    parser.add_argument("--axes", type=int, choices=[3, 5], nargs="+", default=[3, 5])
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.one:
        print(json.dumps(run(chosen.one, chosen.density, chosen.axes[0])))
        return
    print(f"{'axes':>4} {'points':>8} {'samples':>8} {'s':>7} {'CPU s':>7} {'read':>6} {'rays':>6} {'stock':>7} "
          f"{'bodies':>6} {'µs a point':>10} {'least left mm':>13} {'most':>8} {'findings':>8} {'stock mm':>8} "
          f"{'MB before':>9} {'MB peak':>8}")
    for axes, points in itertools.product(chosen.axes, chosen.points):
        done = subprocess.run([sys.executable, __file__, "--one", str(points), "--density", str(chosen.density),
                               "--axes", str(axes)], capture_output=True, text=True, check=True)
        r = json.loads(done.stdout)
        read, rays, stock, bodies = r["stages"]
        print(f"{axes:4d} {r['lines']:8d} {r['samples']:8d} {r['seconds']:7.1f} {r['busy']:7.1f} {read:6.1f} "
              f"{rays:6.1f} {stock:7.1f} {bodies:6.1f} {r['seconds'] / r['lines'] * 1e6:10.1f} {r['least']:13.5f} "
              f"{r['max']:8.5f} {r['findings']:8d} {r['spacing']:8.3f} {r['before']:9.0f} {r['peak']:8.0f}", flush=True)


if __name__ == "__main__":
    main()
