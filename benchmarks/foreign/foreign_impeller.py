"""LinuxCNC's five-axis impeller cut from a plain cylinder: seconds, findings, three of them by hand, a picture.

Run from the root of the checkout: ``python benchmarks/foreign/foreign_impeller.py [--out DIR] [--picture FILE.png]``.
The part is a hub of revolution just under what the cutter covers (``foreign_twin.envelope``), written as STEP and
read back. The program says itself that a lathe cuts the outer cone before it; here nobody has, so its rapids go
through what the lathe would have taken. It is run with a ball of 3 mm whose flutes are longer than it is deep
anywhere, and with one as they are sold: 9 mm of flutes, a neck to 20 mm, a shank of 6 mm and a holder at 36 mm. The
same lines as the twin's are asked for, and of the deepest three collisions how far the body stands over the place
named. ``zonemill verify`` proves the same from the command line.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import cadquery as cq  # noqa: E402
import numpy as np  # noqa: E402
from PIL import Image  # noqa: E402

from benchmarks.faults.fault_case import tool_axis  # noqa: E402
from benchmarks.foreign.foreign_cases import CASES, MARGIN, Foreign, Paths, covered, paths, samples_root  # noqa: E402
from benchmarks.foreign.foreign_programs import GEOMETRIC, compare, lines_of, prove_case, run_twin  # noqa: E402
from benchmarks.foreign.foreign_twin import SPACING  # noqa: E402
from geometry.mesh import F64, TriangleMesh  # noqa: E402
from geometry.step_import.reader import read_part  # noqa: E402
from geometry.stl import write_stl  # noqa: E402
from service.pictures.camera import Camera  # noqa: E402
from service.pictures.scene import lit  # noqa: E402
from verify.material.machined_part import machined_stock  # noqa: E402
from verify.model import Finding, FindingKind, Proof  # noqa: E402

LONG = next(c for c in CASES if c.name.startswith("impeller"))
SOLD = replace(LONG, name="impeller, tool as sold", flutes=9.0, neck=11.0, shank=6.0, sticking=16.0)
RIM, RING = 45.5, 1.0  # mm: radius of the hub, and between the corners of its profile
DIP = 0.08  # mm, a round of 1.5 mm on a slope of 55 degrees goes down by as much between nodes 0.35 mm apart
VIEWS = ((-60.0, 32.0), (-60.0, 78.0))  # deg
PAINT = np.array([[0.78, 0.80, 0.84], [0.78, 0.80, 0.84]], np.float32)


def hub_profile(case: Foreign, moves: Paths) -> F64:
    """(n, 2) float64, mm: radius and height of the hub, straight between, MARGIN and DIP under the cutter."""
    low, origin, step = covered(case, moves, case.grown)
    x, y = (origin[c] + step * np.arange(n) for c, n in enumerate(low.shape))
    r = np.hypot(x[:, None], y[None, :]).ravel()
    z = np.minimum(low.ravel(), case.box[1, 2])[r <= RIM] - MARGIN - DIP
    r = r[r <= RIM]
    knots = np.append(np.arange(0.0, RIM, RING), RIM)
    place = np.clip(np.searchsorted(knots, r, side="right") - 1, 0, len(knots) - 2)
    share = (r - knots[place]) / (knots[place + 1] - knots[place])
    height = np.full(len(knots), case.box[1, 2] - MARGIN)
    for _ in range(200):
        over = height[place] * (1.0 - share) + height[place + 1] * share - z
        if over.max() <= 1e-6:
            break
        np.subtract.at(height, place[[over.argmax()]], over.max())
        np.subtract.at(height, place[[over.argmax()]] + 1, over.max())
    return np.column_stack([knots, height])


def write_hub(profile: F64, bottom: float, path: Path) -> None:
    """STEP of the solid of revolution about Z under a profile (n, 2), mm, down to ``bottom`` mm."""
    corners = [(0.0, bottom), (float(profile[-1, 0]), bottom), *map(tuple, profile[::-1].tolist())]
    solid = cq.Workplane("XZ").polyline(corners).close().revolve(360.0, (0, 0, 0), (0, 1, 0))
    cq.exporters.export(solid, str(path))


def setup_file(case: Foreign) -> dict[str, object]:
    """The setup of ``zonemill verify``, with the cylinder as blank."""
    t, (x, y, bottom, radius, height) = case.tool, case.blank
    tool = {"id": t.id, "number": 1, "kind": "ball", "diameter_mm": t.diameter, "flutes": 2,
            "flute_length_mm": t.flute_length, "neck_diameter_mm": t.neck_diameter, "neck_length_mm": t.neck_length,
            "shank_diameter_mm": t.shank_diameter, "stickout_mm": t.stickout,
            "holder": [{"diameter_mm": h.diameter, "diameter_top_mm": h.diameter_top, "length_mm": h.length}
                       for h in t.holder]}
    return {"access": [{"id": "A1", "direction": [0, 0, 1], "work_offset": "G54"}], "tools": [tool],
            "machine": {"kind": "5-axis", "kinematics": "table-table-AC", "iso_axes": [], "tcp": True,
                        "dialects": ["linuxcnc"]},
            "stock": {"kind": "cylinder", "margin_mm": 0.0, "uncertainty_mm": 0.0,
                      "cylinder_mm": {"x": x, "y": y, "bottom": bottom, "diameter": 2.0 * radius, "height": height}},
            "quality": {"scallop_height_mm": 0.05, "chordal_tolerance_mm": 0.005, "gouge_tolerance_mm": 0.01},
            "material": "AlMgSi1 6082"}


def stands_over(found: Finding, case: Foreign, moves: Paths) -> tuple[float, float]:
    """Of a collision: how far aside neck, shank or holder reach over its place on its lines, and how near any cutter
    came to that place before, mm; both by poses ``SPACING`` apart."""
    first, last = lines_of(found)
    place = np.array(found.point)
    deepest, nearest = -np.inf, np.inf
    for m in np.flatnonzero(moves.line <= last).tolist():
        way = math.dist(moves.start[m], moves.end[m])
        if np.linalg.norm(0.5 * (moves.start[m] + moves.end[m]) - place) > way + case.bodies[:, 1].max() + 30.0:
            continue
        turn = np.abs(moves.turns[m, 1] - moves.turns[m, 0]).sum()
        s = np.linspace(0.0, 1.0, max(2, math.ceil((way + turn * case.flutes) / SPACING) + 1))[:, None]
        w = place - (moves.start[m] + s * (moves.end[m] - moves.start[m]))
        up = (w * tool_axis(moves.turns[m, 0] + s * (moves.turns[m, 1] - moves.turns[m, 0]))).sum(axis=1)
        aside = np.sqrt(np.maximum((w * w).sum(axis=1) - up * up, 0.0))
        if moves.feed[m] and moves.line[m] < first:
            radius = case.cutter[0]
            out = np.maximum(up - case.flutes, 0.0)
            nearest = min(nearest, float((np.hypot(aside, np.minimum(up - radius, 0.0) + out) - radius).min()))
        elif moves.line[m] >= first:
            for z0, z1, r0, r1, _ in case.bodies:
                wide = r0 + np.clip((up - z0) / (z1 - z0), 0.0, 1.0) * (r1 - r0)
                deepest = max(deepest, float(np.where((up >= z0) & (up <= z1), wide - aside, -np.inf).max()))
    return deepest, nearest


def picture(mesh: TriangleMesh, path: Path) -> None:
    """Two views of a mesh beside each other, mm, as PNG."""
    views = []
    for azimuth, elevation in VIEWS:
        camera = Camera.fit(mesh.vertices, (1120, 960), azimuth=math.radians(azimuth),
                            elevation=math.radians(elevation))
        views.append(lit(mesh, PAINT, camera).halved())
    Image.fromarray(np.concatenate(views, axis=1)).quantize(64).save(path, optimize=True)


def told(case: Foreign, proof: Proof, seconds: float, moves: Paths, heights: F64, grid: tuple[F64, float]) -> None:
    """Print what one proof found and how it lies to the twin; heights (nx, ny) mm of the hub on the grid."""
    twin = run_twin(case, moves, heights, grid)
    alone, missed = compare(proof, twin)
    kinds = {str(k): proof.counts[k] for k in GEOMETRIC if proof.counts.get(k)}
    print(f"{case.name}: {len(moves.start)} moves, {seconds:.1f} s, findings {kinds or 'none'}, gouge "
          f"{1e3 * proof.gouge_max:.2f} µm; twin: gap {1e3 * twin.gap:.1f} µm, lines "
          f"{ {str(k): len(v) for k, v in twin.lines.items() if v} }, alone {len(alone)}, missed "
          f"{ {str(k): v[:6] for k, v in missed.items()} or 0}", flush=True)
    for f in alone[:5]:
        print(f"  alone: line {f.line} {f.kind}: {f.message}")
    worst = [f for f in proof.findings if f.kind == FindingKind.COLLISION][:3]
    for f in worst:
        deep, near = stands_over(f, case, moves)
        print(f"  line {f.line} at {f.point}: {f.message}; by hand {deep:.3f} mm, cutter before it {near:.3f} mm away")
    for kind in GEOMETRIC:
        for f in [f for f in proof.findings if f.kind == kind][:2]:
            print(f"  line {f.line} {kind}: {f.message}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Make hub and setup, prove with both tools, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/impeller"))
    parser.add_argument("--picture", type=Path, default=None)
    parser.add_argument("--no-command", action="store_true", help="leave the run of the command line out")
    chosen = parser.parse_args(arguments)
    root = samples_root()
    if root is None:
        parser.error("LinuxCNC's samples are not installed: install linuxcnc-uspace, or its documentation")
    chosen.out.mkdir(parents=True, exist_ok=True)
    text = LONG.text(root)
    _, moves = paths(LONG, text)
    profile = hub_profile(LONG, moves)
    write_hub(profile, LONG.box[0, 2], chosen.out / "hub.step")
    part = read_part(chosen.out / "hub.step")
    _, origin, step = covered(LONG, replace(moves, feed=np.zeros_like(moves.feed)), 0.0)
    counts = np.round((LONG.box[1] - LONG.box[0])[:2] / step).astype(int) + 1
    r = np.hypot((origin[0] + step * np.arange(counts[0]))[:, None], origin[1] + step * np.arange(counts[1]))
    heights = np.where(r <= RIM, np.interp(r, *profile.T), LONG.box[0, 2])
    for case in (LONG, SOLD):
        began = time.perf_counter()
        proof = prove_case(case, text, part)
        told(case, proof, time.perf_counter() - began, moves, heights, (origin, step))
    began = time.perf_counter()
    field = machined_stock([("impeller", text)], part, [LONG.tool], LONG.setup, 0.25, spindle_tool=1)
    mesh = field.surface()
    write_stl(mesh, chosen.out / "machined.stl")
    print(f"machined.stl: {len(mesh.faces)} facets {field.step:.3f} mm apart, {field.volume:.0f} mm³ left, "
          f"{time.perf_counter() - began:.1f} s")
    picture(mesh, chosen.picture or chosen.out / "machined.png")
    if not chosen.no_command:
        (chosen.out / "setup.json").write_text(json.dumps(setup_file(SOLD), indent=1) + "\n")
        command = [str(Path(sys.executable).with_name("zonemill")), "verify", str(chosen.out / "hub.step"), "--setup",
                   str(chosen.out / "setup.json"), "--program", str(root / LONG.file), "--spindle-tool", "1", "--out",
                   str(chosen.out / "verified")]
        began = time.perf_counter()
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        print(f"zonemill verify ended with {done.returncode} after {time.perf_counter() - began:.1f} s\n{done.stderr}")


if __name__ == "__main__":
    main()
