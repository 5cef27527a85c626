"""Flat places between coarse samples: the proof against its dense twin, with planted faults.

The twin measures samples 0.05 mm apart. A place that the proof calls settled must have nothing left anywhere in it, and
a place it calls harmless must have no gouge.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from geometry.mesh import TriangleMesh
from geometry.sampling import SurfaceSamples, graded_samples
from geometry.tool_body import ToolBody
from service.stages.sample_spacing import MARGIN
from tests.unit.geometry.test_graded_samples import frame_with_hole
from verify.model import ProofSetup
from verify.moves import Moves
from verify.surface.between_samples import ClosePoints, close_points, judged_places, settled_samples
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


BOUNDS = np.array([[-8.0, -8.0, -20.0], [8.0, 8.0, 0.0]])


def between(samples: SurfaceSamples, left, program, cutters) -> ClosePoints:
    """The close points of a plane under 1.5 mm of stock."""
    places = judged_places(samples, left, BOUNDS, program, cutters, SETUP, 1.5)
    return close_points(samples, left, places, SETUP)


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
    close = between(samples, left, program, cutters)
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
        close = between(samples, left, program, [TOOLS[kind]])
        assert proved_samples(left, SETUP).all()
        assert len(np.unique(close.row)) < 0.04 * len(samples)


def test_samples_that_cover_nothing_have_no_close_points():
    samples = face((0, 0, 1), STEP, False)
    way = moves(((0, 0, 0), (1, 0, 0)))
    assert len(between(samples, np.ones(len(samples)), way, [TOOLS["flat"]]).row) == 0
    assert settled_samples(samples, BOUNDS, way, [TOOLS["flat"]], SETUP, 1.5) is samples


@pytest.mark.parametrize("turn", np.linspace(0.0, 1.5, 6))
def test_a_move_along_the_border_of_a_face_is_no_suspect_however_the_lattice_is_turned(turn):
    """Squares of coarse samples stay in the face, so what is cut beyond its border is no gouge."""
    mesh = frame_with_hole()
    samples = graded_samples(mesh, np.arange(len(mesh.faces)), STEP, 5, MARGIN * STEP)
    u = np.cross([0.3, -0.5, 0.8], [0.0, 0.0, 1.0])
    u /= np.linalg.norm(u)
    v = np.cross([0.0, 0.0, 1.0], u)
    flat = (samples.points - [1.0, 2.0, 3.0]) @ np.column_stack([u, v])  # the hole is the square from -3 to 3
    way = np.array([np.cos(turn), np.sin(turn), 0.0]), np.array([-np.sin(turn), np.cos(turn), 0.0])
    turned = replace(samples, points=np.ascontiguousarray(flat @ np.stack(way)))
    ring = np.array([[2, 2], [-2, 2], [-2, -2], [2, -2], [2, 2]]) @ np.stack(way) - [0.0, 0.0, 1.0]
    program = moves(*zip(ring[:-1], ring[1:], strict=True))
    tool = ToolBody("T1", 1, 2.0, 0.0, 12.0, 2.0, 12.0, 2.0, 30.0)
    left = np.zeros(len(turned))
    places = judged_places(turned, left, BOUNDS, program, [tool], SETUP, 1.5)
    assert len(places.row) > 500 and not places.suspect.any() and not len(places.pits)


def lattice(apart=STEP) -> SurfaceSamples:
    """The level square of 16 mm with coarse samples, as jobs and verifications lay them."""
    corners = np.array([[-8.0, -8, 0], [8, -8, 0], [8, 8, 0], [-8, 8, 0]])
    mesh = TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.ones(2, np.int32))
    return graded_samples(mesh, np.arange(2), apart, 5, apart)


@pytest.mark.parametrize("name", [n for n, case in CASES.items() if case[0] == (0, 0, 1)])
def test_heights_and_depths_of_settled_samples_are_those_of_the_dense_twin(name):
    """Every place of 0.05 mm: its nearest sample says what stands there, within 5 µm where the twin is even."""
    _, kind, lay, fault = CASES[name]
    rng = np.random.default_rng(7)
    program, cutters = moves(*planted(lay(rng), fault, rng)), [TOOLS[kind]]
    samples = settled_samples(lattice(), BOUNDS, program, cutters, SETUP, 1.5)
    assert samples.area.sum() == pytest.approx(256.0, rel=1e-9)
    left, _ = residual_on_normals(samples.points, samples.normals, np.full(len(samples), 1.5), program, cutters)
    twin = face((0, 0, 1), TWIN, False)
    dense, _ = residual_on_normals(twin.points, twin.normals, np.full(len(twin), 1.5), program, cutters)
    inside = np.abs(twin.points).max(axis=1) < 7.0
    row = cKDTree(samples.points).query(twin.points)[1]
    coarse = inside & (samples.area[row] > 0.2)
    assert proved_samples(dense, SETUP)[coarse].tolist() == proved_samples(left, SETUP)[row[coarse]].tolist()
    high = coarse & (dense > 0.0101)
    assert np.abs(dense - left[row])[high].max(initial=0.0) <= 0.005 + 1e-6
    assert (dense[coarse] >= -0.4 * SETUP.gouge_tolerance - 1e-6).all()
    assert -left.min() >= -dense.min() - 1e-6, "the deepest gouge is among the samples"
    share, true = samples.area[proved_samples(left, SETUP)].sum() / 256.0, proved_samples(dense, SETUP).mean()
    assert share == pytest.approx(true, abs=0.01)


@pytest.mark.parametrize("radius", [0.06, 0.2, 1.5])
def test_a_pit_is_found_at_its_depth_wherever_it_is(radius):
    """Pits of a thin ball, narrower than close points stand apart: the deepest point of the move is a sample."""
    rng = np.random.default_rng(11)
    ball, flat = ToolBody("T2", 2, 2 * radius, radius, 3.0, 2 * radius, 3.0, 6.0, 30.0), TOOLS["flat"]
    ways = floor_passes(rng)
    for x, y in rng.uniform(-6.0, 6.0, (15, 2)):
        pit = [((x, y, 1.0), (x, y, -0.012)), ((x, y, -0.012), (x, y, 1.0))]
        both = moves(*ways, *pit)
        program = Moves(both.start, both.end, both.feed, np.repeat([0, 1], [len(ways), 2]).astype(np.int32))
        samples = settled_samples(lattice(), BOUNDS, program, [flat, ball], SETUP, 1.5)
        left, _ = residual_on_normals(samples.points, samples.normals, np.full(len(samples), 1.5), program,
                                      [flat, ball])
        assert left.min() == pytest.approx(-0.012, abs=1e-6)


def test_a_cut_into_the_allowance_is_found_at_its_depth():
    setup, rng = replace(SETUP, stock_allowance=0.2), np.random.default_rng(13)
    ball = ToolBody("T2", 2, 0.4, 0.2, 3.0, 0.4, 3.0, 6.0, 30.0)
    ways = floor_passes(rng, 0.2)
    x, y = rng.uniform(-6.0, 6.0, 2)
    both = moves(*ways, ((x, y, 1.0), (x, y, 0.15)))
    program = Moves(both.start, both.end, both.feed, np.repeat([0, 1], [len(ways), 1]).astype(np.int32))
    samples = settled_samples(lattice(), BOUNDS, program, [TOOLS["flat"], ball], setup, 1.5)
    left, _ = residual_on_normals(samples.points, samples.normals, np.full(len(samples), 1.5), program,
                                  [TOOLS["flat"], ball])
    assert left.min() == pytest.approx(0.15, abs=1e-6)


def test_a_plane_that_no_move_touches_keeps_its_coarse_samples():
    coarse = lattice()
    samples = settled_samples(coarse, BOUNDS, moves(((30.0, 0, 0), (40.0, 0, 0))), [TOOLS["flat"]], SETUP, 1.5)
    assert len(samples) == len(coarse) and samples.area.tolist() == coarse.area.tolist()
