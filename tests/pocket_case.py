"""A block with a rectangular pocket, a tool, and a program for it that is right: faults are planted into copies."""

from __future__ import annotations

import numpy as np

from geometry.mesh import TriangleMesh
from geometry.part import FaceInfo, Part
from geometry.sampling import sample_surface
from geometry.tool_body import HolderFrustum, ToolBody
from verify.model import ProofSetup, ScoredSamples

TOOL = ToolBody("T1", 1, 4.0, 0.0, 8.0, 3.8, 20.0, 6.0, 30.0, (HolderFrustum(20.0, 30.0, 20.0),))
OTHER = ToolBody("T2", 2, 6.0, 0.0, 8.0, 5.8, 20.0, 6.0, 30.0)
SETUP = ProofSetup(stock_kind="box", margin=0.5, uncertainty=0.0, rapid_feed=5000.0)
DEPTH, LENGTH, WIDTH = -5.0, 20.0, 12.0
ZONES = ("Z1", "Z2")


def _quad(a, b, c, d):
    return [(a, b, c), (a, c, d)]


def block() -> Part:
    """40 x 30 x 10 mm, top at z = 0, pocket 20 x 12 x 5 in the middle; faces 1 bottom, 2-5 outside, 6 top,
    7-10 pocket walls, 11 floor."""
    o = np.array([[-20, -15], [20, -15], [20, 15], [-20, 15]], float)
    i = np.array([[-10, -6], [10, -6], [10, 6], [-10, 6]], float)
    v = np.concatenate([np.column_stack([o, np.full(4, -10.0)]), np.column_stack([o, np.zeros(4)]),
                        np.column_stack([i, np.zeros(4)]), np.column_stack([i, np.full(4, DEPTH)])])
    groups = [(1, _quad(3, 2, 1, 0)), (11, _quad(12, 13, 14, 15))]
    for k in range(4):
        n = (k + 1) % 4
        groups += [(2 + k, _quad(k, n, 4 + n, 4 + k)), (6, _quad(4 + k, 4 + n, 8 + n, 8 + k)),
                   (7 + k, _quad(8 + k, 8 + n, 12 + n, 12 + k))]
    faces = [t for _, ts in groups for t in ts]
    ids = [f for f, ts in groups for _ in ts]
    mesh = TriangleMesh(v, np.array(faces, np.int32), np.array(ids, np.int32))
    infos = tuple(FaceInfo(n, "plane", float(mesh.areas[mesh.face_ids == n].sum()), False, 0.0, 0.0)
                  for n in range(1, 12))
    return Part(mesh, infos, (), mesh.volume, mesh.bounds, "mm", 0.001, 0.1, 0.0, (), "0" * 64)


def scored(part: Part) -> ScoredSamples:
    """Floor is zone 1, pocket walls zone 2; corners that no round tool reaches are claimed by nobody."""
    s = sample_surface(part.mesh, 100.0, seed=5, triangles=np.flatnonzero(part.mesh.face_ids >= 7))
    corner = (np.abs(s.points[:, 0]) > 8) & (np.abs(s.points[:, 1]) > 4)
    zone = np.where(s.face == 11, 1, 2).astype(np.int32)
    zone[corner] = 0
    return ScoredSamples(s, zone)


def program(step: float = 0.5) -> list[str]:
    """Layers entered along a ramp of 2 degrees, rows, then once round the walls."""
    out = ["%", "G21 G90 G17 G94 G40 G49 G54 G61",
           "T1 M6", "S8000 M3", "G0 G43 H1 Z20", "X-7 Y0", "Z1.5", "G1 Z0.5 F300"]
    for z in np.arange(0.5 - step, DEPTH - 1e-9, -step):
        out += [f"(layer {z:.3f})", f"G1 X7 Y0 Z{z:.3f} F400", "X-7"]
        rows = [0.0, 2.0, 4.0, 2.0, 0.0, -2.0, -4.0]
        for k, y in enumerate(rows):
            out += [f"Y{y:.1f}", f"X{8 if k % 2 == 0 else -8}"]
        out += ["G1 X8 Y-4", "X8 Y4", "X-8 Y4", "X-8 Y-4", "X8 Y-4", "X-7 Y-4", "X-7 Y0"]
    return [*out, "G0 Z20", "M5", "M30", "%"]


def text(lines: list[str]) -> str:
    return "\n".join(lines) + "\n"


def line_of(lines: list[str], what: str, nth: int = 0) -> int:
    """1-based number of the nth line that equals ``what`` (negative from the end)."""
    return [k for k, line in enumerate(lines, 1) if line == what][nth]
