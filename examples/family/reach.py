"""Area that the tools of a setup can touch on a part, by a dense height field, independent of the planner.

The part becomes the height of its mesh over a grid. Each tool assembly (cutting part, neck, shank, holder) is a stack
of
discs and one rounded end. Its lowest free tip over every node is the height field dilated by that profile. A sample of
the machinable area is touched when the tool, placed against it along its normal, has its tip there or above. All of
this
is done at a step and at twice that step. The share is extrapolated to a step of zero, and the difference is its error
bound.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

import geometry.kernel_cache.cache  # noqa: F401  names the folders of compiled kernels
from examples.family.splines import F64

STEP, CHORD = 0.12, 0.01
SAMPLES = 40_000
SEEN = -0.02
LEVEL = 0.9999
CLEARANCE = {"shank": 0.2, "holder": 1.0}
"""mm, radial; the defaults of the setup schema."""


def reach_of(step_file: Path, setup: dict[str, Any], step: float = STEP) -> dict[str, Any]:
    """Share of the machinable area that some tool of a setup can touch from +Z.

    step_file : Path of the part
    setup     : plain data, access from +Z, no fixtures
    step      : mm of the grid

    Returns plain data: ``share`` of the machinable area, ``error`` of that share, ``machinable_area`` in mm²,
    ``by_tool`` with the share of each tool alone, ``step`` in mm.
    Machinable is every face with a place that looks up or sideways (normal z above -0.02).
    """
    from geometry.step_import.reader import read_part

    mesh = read_part(step_file, chord=CHORD).mesh
    seen = np.isin(mesh.face_ids, np.unique(mesh.face_ids[mesh.normals[:, 2] > SEEN]))
    rows = np.flatnonzero(seen)
    points, normals = _spread(mesh.triangles[rows], mesh.areas[rows], mesh.normals[rows])
    fine, coarse = (_touched(mesh.triangles, points, normals, setup["tools"], h) for h in (step, 2 * step))
    some = [float(np.any(list(t.values()), axis=0).mean()) for t in (fine, coarse)]
    share = min(max(2 * some[0] - some[1], 0.0), 1.0)
    error = abs(some[0] - some[1]) + math.sqrt(share * (1 - share) / SAMPLES)
    area = round(float(mesh.areas[rows].sum()), 2)
    return {"share": round(share, 4), "error": round(error, 4), "machinable_area": area,
            "by_tool": {k: round(float(v.mean()), 4) for k, v in fine.items()}, "step": step}


def _spread(triangles: F64, areas: F64, normals: F64) -> tuple[F64, F64]:
    """Points of equal area on triangles and the facet normals there, (SAMPLES, 3) each, mm."""
    rng = np.random.default_rng(17)
    total = np.cumsum(areas)
    at = (np.arange(SAMPLES) + rng.random(SAMPLES)) * total[-1] / SAMPLES
    pick = np.minimum(np.searchsorted(total, at), len(areas) - 1)
    a, b = rng.random((2, SAMPLES, 1))
    a, b = np.where(a + b > 1, 1 - a, a), np.where(a + b > 1, 1 - b, b)
    t = triangles[pick]
    return t[:, 0] + a * (t[:, 1] - t[:, 0]) + b * (t[:, 2] - t[:, 0]), normals[pick]


def _touched(
    triangles: F64, points: F64, normals: F64, tools: list[dict[str, Any]], step: float
) -> dict[str, np.ndarray]:
    low, high = triangles.reshape(-1, 3).min(axis=0)[:2], triangles.reshape(-1, 3).max(axis=0)[:2]
    margin = max(t["diameter_mm"] for t in tools) + 4 * step
    # offset by an odd share of the step, or walls along the axes would lie on the nodes
    x0, y0 = low - margin - np.array([0.382, 0.618]) * step
    nx, ny = (np.ceil((high - low + 2 * margin) / step).astype(int) + 2).tolist()
    height = np.full((ny, nx), -np.inf)
    _raise_to(triangles, float(x0), float(y0), step, height)
    out = {}
    for tool in tools:
        limit = _lowest_tip(height, tool, step)
        out[tool["id"]] = _touches(limit, float(x0), float(y0), step, points, normals, tool)
    return out


def _lowest_tip(height: F64, tool: dict[str, Any], step: float) -> F64:
    """Lowest tip of the whole assembly over every node, mm, like ``height``."""
    radius = 0.5 * tool["diameter_mm"]
    limit = _dilated(height, radius, radius if tool["kind"] == "ball" else tool["corner_radius_mm"], step)
    discs = [(0.5 * tool["shank_diameter_mm"] + CLEARANCE["shank"], tool["neck_length_mm"])]
    z = tool["stickout_mm"]
    for segment in tool["holder"]:
        wide = max(segment["diameter_mm"], segment["diameter_top_mm"])
        discs.append((0.5 * wide + CLEARANCE["holder"], z))
        z += segment["length_mm"]
    for reach, above in discs:
        if height.max() - above > limit[np.isfinite(limit)].min():
            limit = np.maximum(limit, _dilated(height, reach, 0.0, step) - above)
    return limit


def _touches(
    limit: F64, x0: float, y0: float, step: float, points: F64, normals: F64, tool: dict[str, Any]
) -> np.ndarray:
    """(n,) bool: the end or the flank of the tool touches points (n, 3) with normals (n, 3), mm."""
    radius = 0.5 * tool["diameter_mm"]
    corner = radius if tool["kind"] == "ball" else tool["corner_radius_mm"]
    across = np.hypot(normals[:, 0], normals[:, 1])
    side = normals[:, :2] * np.where(across > 1e-3, 1.0 / np.maximum(across, 1e-12), 0.0)[:, None]
    axis = points[:, :2] + corner * normals[:, :2] + (radius - corner) * side
    allowed = points[:, 2] + corner * (normals[:, 2] - 1.0) + 0.5 * step
    j, i = (np.floor((axis[:, k] - o) / step).astype(int) for k, o in ((0, x0), (1, y0)))
    found = np.zeros(len(points), bool)
    for a in (0, 1):
        for b in (0, 1):
            found |= limit[i + a, j + b] <= allowed
    level = normals[:, 2] > LEVEL
    if radius > corner and level.any():
        lowest = -_dilated(-limit, radius - corner, 0.0, step)
        j, i = (np.rint((points[level, k] - o) / step).astype(int) for k, o in ((0, x0), (1, y0)))
        found[level] = lowest[i, j] <= points[level, 2] + 0.5 * step
    return np.asarray(found & (normals[:, 2] > SEEN))


@njit(cache=True, nogil=True)
def _raise_to(triangles: F64, x0: float, y0: float, step: float, out: F64) -> None:
    """Raise ``out`` (ny, nx), mm, to the highest point of triangles (m, 3, 3) over every node."""
    ny, nx = out.shape
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(twice) < 1e-14:
            continue
        j0 = max(int(math.ceil((min(a[0], b[0], c[0]) - x0) / step)), 0)
        j1 = min(int(math.floor((max(a[0], b[0], c[0]) - x0) / step)), nx - 1)
        i0 = max(int(math.ceil((min(a[1], b[1], c[1]) - y0) / step)), 0)
        i1 = min(int(math.floor((max(a[1], b[1], c[1]) - y0) / step)), ny - 1)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                x, y = x0 + j * step, y0 + i * step
                u = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / twice
                v = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / twice
                if u >= -1e-9 and v >= -1e-9 and u + v <= 1.0 + 2e-9:
                    out[i, j] = max(out[i, j], u * a[2] + v * b[2] + (1.0 - u - v) * c[2])


@njit(cache=True, nogil=True)
def _dilated(height: F64, radius: float, corner: float, step: float) -> F64:
    """(ny, nx) mm: highest node within ``radius`` less the height of a rounded end (``corner``) over it."""
    ny, nx = height.shape
    reach = int(radius / step + 1e-9)
    out = np.full((ny, nx), -np.inf)
    for di in range(-reach, reach + 1):
        for dj in range(-reach, reach + 1):
            d = math.hypot(di, dj) * step
            if d > radius:
                continue
            beyond = max(d - (radius - corner), 0.0)
            lift = corner - math.sqrt(max(corner * corner - beyond * beyond, 0.0))
            for i in range(max(0, -di), min(ny, ny - di)):
                for j in range(max(0, -dj), min(nx, nx - dj)):
                    top = height[i + di, j + dj] - lift
                    if top > out[i, j]:
                        out[i, j] = top
    return out


__all__ = ["reach_of"]
