"""Flat places between coarse samples: the proof against its dense twin, with planted faults.

The twin measures samples 0.05 mm apart. A place that the proof calls settled must have nothing left anywhere in it, and
a place it calls harmless must have no gouge.
"""

from __future__ import annotations

import numpy as np
import pytest

from geometry.sampling import SurfaceSamples
from geometry.tool_body import ToolBody
from verify.model import ProofSetup
from verify.moves import Moves
from verify.surface.between_samples import close_points
from verify.surface.removal import residual_on_normals
from verify.surface.sample_scores import proved_samples

SETUP = ProofSetup(stock_kind="part_offset", margin=1.0, uncertainty=0.5, scallop_height=0.01, gouge_tolerance=0.01)
STEP, TWIN = 0.5, 0.05


TOOLS = {kind: ToolBody("T1", 1, 6.0, corner, 12.0, 6.0, 12.0, 6.0, 30.0)
         for kind, corner in (("flat", 0.0), ("bull", 1.0), ("ball", 3.0))}


def face(normal, apart: float, coarse: bool) -> SurfaceSamples:
    """A square of 16 mm round the origin, square to a normal."""
    n = np.asarray(normal, float)
    u = np.array([0.0, 0, 1]) if abs(n[2]) < 0.5 else np.array([1.0, 0, 0])
    v = np.cross(n, u)
    a = np.arange(-8.0 + apart / 2, 8.0, apart)
    a, b = (x.reshape(-1, 1) for x in np.meshgrid(a, a, indexing="ij"))
    points = a * u + b * v
    count = len(points)
    return SurfaceSamples(points, np.broadcast_to(n, points.shape).copy(), np.full(count, apart**2),
                          np.ones(count, np.int32), np.zeros(count, np.int32),
                          np.full(count, apart * np.sqrt(0.5)) if coarse else None)


def moves(*ways) -> Moves:
    start, end = (np.array([w[k] for w in ways], float) for k in (0, 1))
    count = len(ways)
    return Moves(start, end, np.ones(count, np.bool_), np.zeros(count, np.int32))


def floor_passes(rng, level=0.0, apart=4.8):
    """Passes along X over a level plane, with ends and places at random."""
    return [((-13 + rng.uniform(), y, level), (13 - rng.uniform(), y, level))
            for y in np.arange(-11.0 + rng.uniform(), 11.5, apart)]


def wall_passes(rng, apart=2.0):
    """Layers along a wall with normal -X: a tool of radius 3 runs at x = -3."""
    return [((-3.0, -13 + rng.uniform(), z), (-3.0, 13 - rng.uniform(), z))
            for z in np.arange(8.0, -9.0 - rng.uniform(), -apart)]


CASES = {
    "floor, flat": ((0, 0, 1), "flat", floor_passes, None),
    "floor, bull": ((0, 0, 1), "bull", lambda r: floor_passes(r, apart=3.4), None),
    "floor, one pass too far": ((0, 0, 1), "flat", floor_passes, "shifted"),
    "floor, no pass in the middle": ((0, 0, 1), "flat", floor_passes, "missing"),
    "floor, a pass 0.02 mm high": ((0, 0, 1), "flat", floor_passes, "high"),
    "floor, a dip of the ball": ((0, 0, 1), "ball", lambda r: floor_passes(r, apart=0.45), "dip"),
    "floor, a move that dives": ((0, 0, 1), "flat", floor_passes, "dive"),
    "wall, flat": ((-1, 0, 0), "flat", wall_passes, None),
    "wall, a move into it": ((-1, 0, 0), "flat", wall_passes, "into"),
    "wall, off by 0.03 for a stretch": ((-1, 0, 0), "flat", lambda r: wall_passes(r, apart=15.0), "off"),
}


def planted(ways, fault, rng):
    k = len(ways) // 2
    (sx, sy, sz), (ex, ey, ez) = ways[k]
    if fault == "shifted":
        by = 1.5 + rng.uniform() * 0.3
        return [*ways[:k], ((sx, sy + by, sz), (ex, ey + by, ez)), *ways[k + 1:]]
    if fault == "missing":
        return [*ways[:k], *ways[k + 1:]]
    if fault == "high":
        return [*ways[:k], ((sx, sy, 0.02), (ex, ey, 0.02)), *ways[k + 1:]]
    x, y = rng.uniform(-5, 5, 2)
    if fault == "dip":
        return [*ways, ((x, y, 0.5), (x, y, -0.013)), ((x, y, -0.013), (x, y, 0.5))]
    if fault == "dive":
        return [*ways, ((x, y, 0.0), (x + 0.3, y + 0.1, -0.02))]
    if fault == "into":
        return [*ways, ((-3.0, y, x), (-2.97, y + 0.2, x))]
    if fault == "off":
        return [((-3.03, a[1], a[2]), (-3.03, b[1], b[2])) for a, b in ways]
    return ways


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_the_dense_twin_finds_is_found(name, seed):
    normal, kind, lay, fault = CASES[name]
    rng = np.random.default_rng(seed)
    program, cutters = moves(*planted(lay(rng), fault, rng)), [TOOLS[kind]]
    samples, twin = face(normal, STEP, True), face(normal, TWIN, False)
    left, _ = residual_on_normals(samples.points, samples.normals, np.full(len(samples), 1.5), program, cutters)
    close = close_points(samples, np.full(len(samples), 1.5), left, program, cutters, SETUP)
    dense, _ = residual_on_normals(twin.points, twin.normals, np.full(len(twin), 1.5), program, cutters)
    cell = np.zeros(len(twin), np.int64)
    side = round(16.0 / STEP)
    u, v = (twin.points[:, 2], twin.points @ np.cross(normal, [0, 0, 1])) if abs(normal[2]) < 0.5 else (
        twin.points[:, 0], twin.points @ np.cross(normal, [1, 0, 0]))
    cell = np.floor((u + 8) / STEP).astype(int) * side + np.floor((v + 8) / STEP).astype(int)
    split = np.zeros(len(samples), np.bool_)
    split[close.row] = True
    good = proved_samples(left, SETUP)
    # 1: a place that is settled has no fault anywhere
    settled = good & ~split
    assert proved_samples(dense, SETUP)[settled[cell]].all()
    # 2: faults that the twin sees in places whose sample is good are seen by close points there, as large within 0.1 mm
    found, _ = residual_on_normals(close.points, close.normals, np.full(len(close.row), 1.5), program, cutters)
    for sign in (1.0, -1.0):
        bad = sign * dense > 0.0125
        wide = np.bincount(cell[bad], minlength=len(samples)) * TWIN**2 > 0.02  # more than two points' area
        seen = np.zeros(len(samples), np.bool_)
        seen[close.row[sign * found > 0.01]] = True
        missed = wide & good & ~seen
        assert not missed.any()
    # 3: the area of what is proved agrees
    share, true = samples.area[good].sum() / 256.0, proved_samples(dense, SETUP).mean()
    assert abs(share - true) < 0.04


def test_plain_passes_leave_little_to_split():
    """Rings 0.8 of the flat diameter apart overlap by more than a place is wide."""
    rng = np.random.default_rng(5)
    for normal, kind, lay, fault in (CASES["floor, flat"], CASES["wall, flat"]):
        assert fault is None
        program, samples = moves(*lay(rng)), face(normal, STEP, True)
        left, _ = residual_on_normals(samples.points, samples.normals, np.full(len(samples), 1.5), program,
                                      [TOOLS[kind]])
        close = close_points(samples, np.full(len(samples), 1.5), left, program, [TOOLS[kind]], SETUP)
        assert proved_samples(left, SETUP).all()
        assert len(np.unique(close.row)) < 0.04 * len(samples)


def test_samples_that_cover_nothing_have_no_close_points():
    samples = face((0, 0, 1), STEP, False)
    none = close_points(samples, np.ones(len(samples)), np.ones(len(samples)), moves(((0, 0, 0), (1, 0, 0))),
                        [TOOLS["flat"]], SETUP)
    assert len(none.row) == 0
