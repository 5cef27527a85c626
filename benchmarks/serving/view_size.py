"""How large a job the page bears: bytes, seconds to the first picture, time of a frame, memory.

    python benchmarks/serving/view_size.py [--triangles 300000] [--points 1000000] [--out DIR]

Makes a folder of results with a wavy block of so many facets in 40 zones and a way of so many points in 80 steps, noisy
enough that hardly a point of it can be left out, serves it as ``zonemill view`` does, and opens it in Chromium without
a graphics card (web/tests/measure.mjs). Prints one line of figures; docs/view.md has them.
"""

from __future__ import annotations

import argparse
import json
import socket
import subprocess
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import uvicorn

from geometry.tool_body import HolderFrustum, ToolBody
from service.commands.view_command import folder_app
from service.viewer.view_data import tool_shape
from service.viewer.view_file import Chunk, Column, write_view
from service.viewer.view_mesh import GRID, JUDGED, LEFT_UNIT, Facets, mesh_chunks
from service.viewer.view_paths import AXIS_UNIT, ToolTrack, path_chunks

ROOT = Path(__file__).parents[1]
WIDE = 120.0  # mm
ZONES, STEPS = 40, 80
TOOL = ToolBody("T1", 1, 6.0, 3.0, 18.0, 5.8, 24.0, 6.0, 40.0, (HolderFrustum(20.0, 24.0, 40.0),))


def block(triangles: int) -> Facets:
    """A wavy surface of two triangles a square, in stripes of zones."""
    n = int(np.sqrt(triangles / 2.0))
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(0, WIDE, n + 1), np.linspace(0, WIDE, n + 1), indexing="ij"))
    z = 6.0 * np.sin(x / 7.0) * np.cos(y / 11.0) + 0.05 * np.random.default_rng(1).normal(size=len(x))
    place = np.column_stack([x, y, z])
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    corners = np.concatenate([np.stack([a, a + n + 1, a + n + 2], 1), np.stack([a, a + n + 2, a + 1], 1)])
    slope = np.column_stack([-np.cos(x / 7.0) * np.cos(y / 11.0) * 6 / 7, np.sin(x / 7.0) * np.sin(y / 11.0) * 6 / 11,
                             np.ones(len(x))])
    normal = slope / np.linalg.norm(slope, axis=1)[:, None]
    label = (place[corners].mean(axis=1)[:, 0] / WIDE * ZONES).astype(np.int64)
    return Facets(place, normal, np.ones(len(x), np.int32), 0.01 * np.sin(x), np.full(len(x), JUDGED), corners, label)


def way(points: int) -> ToolTrack:
    """Passes to and fro with a noise of 0.02 mm, a rapid in between every 500 points."""
    rng = np.random.default_rng(2)
    k = np.arange(points + 1)
    across = np.abs((k % 2000) / 1000.0 - 1.0) * WIDE
    place = np.column_stack([across, k / points * WIDE, 8.0 + 2.0 * np.sin(across / 9.0)]) + rng.normal(0, 0.02,
                                                                                                 (points + 1, 3))
    step = np.minimum(k[1:] * STEPS // points, STEPS - 1)
    seconds = np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1)) / 25.0
    steps = tuple({"id": f"S{i + 1:02d}", "zone": f"Z{i // 2 + 1}", "operation": "finishing" if i % 2 else "roughing",
                   "strategy": "zigzag", "program": "program.linuxcnc.ngc"} for i in range(STEPS))
    return ToolTrack(place[:-1], place[1:], np.tile([0.0, 0.0, 1.0], (points, 1)), k[1:] % 500 != 0,
                     np.concatenate([[0.0], seconds[:-1]]), seconds, k[1:], np.ones(points, np.int64),
                     np.zeros(points, np.int64), step, steps, ("program.linuxcnc.ngc",))


def folder(out: Path, triangles: int, points: int) -> dict[str, float]:
    """Write the folder; returns seconds and bytes."""
    facets, moves = block(triangles), way(points)
    began = time.perf_counter()
    low = np.array([-1.0, -1.0, -10.0])
    mesh, finer = mesh_chunks(facets, low)
    path, longer, steps, grid = path_chunks(moves, low, open_=True)
    edges = Chunk("edges", {"lod": 0}, {"place": Column(np.zeros((0, 3)), 4, "steps"), "begins": Column([0], 4)})
    zones = [{"id": f"Z{i + 1}", "tool": "T1", "strategy": "zigzag", "form": "shallow", "profile": None,
              "area_mm2": 300.0, "faces": ["F1"], "coverage": 1.0, "scallop_mm": None, "machining_time_s": 1.0}
             for i in range(ZONES)]
    head = {"version": 1, "made_by": "0", "kind": "plan", "state": "proved", "withheld": False, "labels": {},
            "low_mm": low.tolist(), "mesh_grid_mm": GRID, "path_grid_mm": grid, "left_unit_mm": LEFT_UNIT,
            "axis_unit": AXIS_UNIT, "bounds_mm": [[0, 0, -6], [WIDE, WIDE, 6]],
            "budget_mm": {"scallop": 0.01, "gouge": 0.01}, "labelled": [{"zone": z["id"]} for z in zones],
            "zones": zones, "walls": [], "connections": [], "remainder": [], "tools": [tool_shape(TOOL)],
            "steps": steps, "programs": ["program.linuxcnc.ngc"], "seconds": float(moves.ended[-1]), "findings": [],
            "facts": {"coverage": 1.0, "reach_coverage": 1.0, "machining_time_s": 1.0, "gouge_max_mm": 0.0,
                      "complete": True}, "counts": {"facets": len(facets.corners), "moves": points}}
    data = write_view(head, [*mesh, edges, *path, *finer, *longer])
    took = time.perf_counter() - began
    out.mkdir(parents=True, exist_ok=True)
    (out / "view.bin").write_bytes(data)
    (out / "report.json").write_text(json.dumps({"state": "proved", "files": [], "zones": []}))
    rough = sum(len(c.packed()) for c in (*mesh, *path))
    kept = sum(len(c.columns["kind"].rows()) for c in longer)
    return {"write_s": round(took, 2), "bytes": len(data), "first_picture_bytes": rough, "points_kept": kept,
            "triangles": len(facets.corners)}


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--triangles", type=int, default=300_000)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--out", type=Path, default=None)
    given = parser.parse_args()
    out = given.out or Path(tempfile.mkdtemp(prefix="zonemill-view-"))
    figures = folder(out, given.triangles, given.points)
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    server = uvicorn.Server(uvicorn.Config(folder_app(out), log_level="error", access_log=False))
    threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True).start()
    url = f"http://127.0.0.1:{listener.getsockname()[1]}/v1/jobs/folder/view"
    seen = subprocess.run(["node", str(ROOT / "web" / "tests" / "measure.mjs"), url], capture_output=True, text=True)
    server.should_exit = True
    print(json.dumps(figures | (json.loads(seen.stdout) if seen.returncode == 0 else {"browser": seen.stderr[-400:]})))


if __name__ == "__main__":
    main()
