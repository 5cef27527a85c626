"""Drop of any outline: against the kernel for bull noses, a search triangle by triangle, and opencamlib."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

from geometry.errors import SetupError
from geometry.kernels.outline import Stack
from geometry.mesh import TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import FEW, drop_tips
from geometry.mesh_queries.outline_drop import drop_turned, turned_contacts
from geometry.mesh_queries.revolved_outline import CHORD, Outline, OutlineArc, OutlineLine, heights
from geometry.tool_body import HolderFrustum, ToolBody
from tests.oracle.drop_shapes import CUTTERS, SHAPES, smooth
from toolpath.cutter.cutter import Cutter
from toolpath.drop_cutter import drop_cutter

TOOL = ToolBody("T1", 1, 2.0, 1.0, 3.0, 1.8, 8.0, 4.0, 12.0,
                (HolderFrustum(7.0, 9.0, 4.0), HolderFrustum(12.0, 12.0, 3.0)))
TURNED = {
    "tapered": Cutter.tapered(diameter=6.0, tip_diameter=1.0, angle_deg=5.0, length=20.0),
    "steep cone": Cutter.tapered(diameter=8.0, tip_diameter=2.0, angle_deg=60.0, length=20.0),
    "barrel": Cutter.barrel(diameter=8.0, tip_diameter=2.0, side_radius=40.0, length=20.0),
    "drill": Cutter.turned(Outline((OutlineLine(3.0, 1.8),)), length=20.0),
    "chamfered": Cutter.turned(
        Outline((OutlineLine(1.0, 0.0), OutlineLine(2.5, 1.0), OutlineArc(3.0, 1.5, (2.5, 1.5)))), length=9.0),
    "assembly": Cutter.assembly(TOOL),
}


def bull(radius: float, corner: float) -> Outline:
    flat = (OutlineLine(radius - corner, 0.0),) if radius > corner else ()
    return Outline((*flat, *((OutlineArc(radius, corner, (radius - corner, corner)),) if corner else ())))


def points_over(mesh, n, seed=0):
    lo, hi = mesh.bounds[:, :2]
    return lo - 1.0 + np.random.default_rng(seed).random((n, 2)) * (hi - lo + 2.0)


def lift(stack: Stack, p: np.ndarray, x: float, y: float) -> np.ndarray:
    """(n,) what points ask for, by the heights of the outlines alone."""
    rho = np.hypot(p[..., 0] - x, p[..., 1] - y)
    best = np.full(rho.shape, -np.inf)
    for k, up in enumerate(stack.offset):
        rows = stack.rows[stack.first[k]:stack.first[k + 1]]
        f = np.where(rho < rows[-1, 1], p[..., 2] - heights(rows, np.minimum(rho, rows[-1, 1])) - up, -np.inf)
        best = np.maximum(best, f)
    return best


def searched(mesh: TriangleMesh, stack: Stack, x: float, y: float) -> float:
    """Tip by a grid over every triangle that shrinks round its best point."""
    g = np.linspace(0.0, 1.0, 13)
    a, b = (w.ravel() for w in np.meshgrid(g, g, indexing="ij"))
    t = mesh.triangles
    middle, size = np.tile([0.5, 0.5], (len(t), 1)), np.ones(len(t))
    best = np.full(len(t), -np.inf)
    for _ in range(30):
        u = np.clip(middle[:, :1] + (a - 0.5) * size[:, None], 0.0, 1.0)
        v = np.clip(middle[:, 1:] + (b - 0.5) * size[:, None], 0.0, 1.0)
        v = np.minimum(v, 1.0 - u)
        p = t[:, None, 0] + u[..., None] * (t[:, 1] - t[:, 0])[:, None] + v[..., None] * (t[:, 2] - t[:, 0])[:, None]
        f = lift(stack, p, x, y)
        k = f.argmax(axis=1)
        row = np.arange(len(t))
        better = f[row, k] >= best
        best = np.maximum(best, f[row, k])
        middle[better] = np.stack([u[row, k], v[row, k]], axis=1)[better]
        size *= 0.6
    return float(best.max())


@pytest.mark.parametrize("cutter", CUTTERS)
@pytest.mark.parametrize("shape", SHAPES)
def test_a_bull_nose_as_outline_has_the_tips_of_its_kernel(shape, cutter):
    mesh, (radius, corner) = SHAPES[shape](), CUTTERS[cutter]
    if radius <= 0.0:
        pytest.skip("an outline has a width")
    tree, xy = TriangleTree(mesh), points_over(mesh, 300)
    np.testing.assert_allclose(drop_turned(tree, xy, bull(radius, corner)), drop_tips(tree, xy, radius, corner),
                               rtol=0, atol=1e-9)


@pytest.mark.parametrize("cutter", TURNED)
@pytest.mark.parametrize("shape", SHAPES)
def test_tip_is_the_searched_one(shape, cutter):
    mesh, made = SHAPES[shape](), TURNED[cutter]
    xy = points_over(mesh, 10, seed=1)
    tip = drop_cutter(mesh, made, xy)
    found = np.array([searched(mesh, made.outline.stack, x, y) for x, y in xy])
    assert np.isfinite(tip).sum() > 5
    assert (tip >= found - 1e-9).all()  # never below what some point of the mesh asks for
    both = np.isfinite(found)
    # the search loses the last of a maximum that lies in a corner between triangle and rim
    assert np.quantile(tip[both] - found[both], 0.9) < 1e-4 and np.max(tip[both] - found[both]) < 0.05


@pytest.mark.parametrize("cutter", TURNED)
@pytest.mark.parametrize("shape", SHAPES)
def test_contacts_lie_on_triangle_and_outline(shape, cutter):
    mesh, outline = SHAPES[shape](), TURNED[cutter].outline
    tree, xy = TriangleTree(mesh), points_over(mesh, 200, seed=2)
    got = turned_contacts(tree, xy, outline)
    np.testing.assert_array_equal(got.z, drop_turned(tree, xy, outline))
    hit = got.triangle >= 0
    np.testing.assert_array_equal(hit, np.isfinite(got.z))
    corners = mesh.triangles[got.triangle[hit]]
    assert (got.point[hit] >= corners.min(1) - 1e-9).all() and (got.point[hit] <= corners.max(1) + 1e-9).all()
    for (x, y), p, z in zip(xy[hit], got.point[hit], got.z[hit], strict=True):
        inner = p + 1e-9 * np.array([x - p[0], y - p[1], 0.0])  # at the rim a point counts from just inside
        assert lift(outline.stack, inner[None], x, y)[0] == pytest.approx(z, abs=1e-4)


def test_an_assembly_is_the_highest_of_its_parts():
    mesh = SHAPES["walls"]()
    tree, xy = TriangleTree(mesh), points_over(mesh, 400, seed=3)
    parts = [drop_tips(tree, xy, 1.0, 1.0), drop_tips(tree, xy, 2.0, 0.0) - 8.0, drop_tips(tree, xy, 6.0, 0.0) - 16.0]
    cone = Outline((OutlineLine(3.5, 0.0), OutlineLine(4.5, 4.0)))
    parts.append(drop_turned(tree, xy, cone) - 12.0)
    np.testing.assert_allclose(drop_turned(tree, xy, TURNED["assembly"].outline), np.max(parts, axis=0), rtol=0,
                               atol=1e-10)
    assert len({int(k) for k in np.argmax(parts, axis=0)}) > 1


def test_a_hollow_arc_is_larger_by_less_than_its_chords():
    mesh = SHAPES["soup"]()
    tree, xy = TriangleTree(mesh), points_over(mesh, 200, seed=4)
    hollow = Outline((OutlineLine(1.0, 0.0), OutlineLine(1.0, 2.0), OutlineArc(3.0, 4.0, (3.0, 2.0), hollow=True),
                      OutlineLine(4.0, 4.0)))
    tip = drop_turned(tree, xy, hollow)
    inner = (OutlineLine(1.0, 0.0), OutlineLine(1.0, 2.0))
    angles = np.linspace(0.0, math.pi / 2, 300)[1:]
    fine = Outline((*inner, *(OutlineLine(3.0 - 2.0 * math.cos(t), 2.0 + 2.0 * math.sin(t)) for t in angles.tolist()),
                    OutlineLine(4.0, 4.0)))
    exact = drop_turned(tree, xy, fine)
    assert (tip >= exact - 1e-5).all()
    # chords stand out by CHORD across; where the arc is steep that is more along z, by at most the root of 2 r CHORD
    met = np.isfinite(tip)
    assert (tip[met] - exact[met]).max() < math.sqrt(2 * 2.0 * CHORD) + CHORD


@pytest.mark.parametrize("shape", SHAPES)
def test_tapered_against_opencamlib(shape):
    ocl = pytest.importorskip("opencamlib", reason="the peer is not installed")
    mesh = SHAPES[shape]()
    xy = points_over(mesh, 500, seed=5)
    surface = ocl.STLSurf()
    for t in mesh.triangles.tolist():
        surface.addTriangle(ocl.Triangle(*(ocl.Point(*p) for p in t)))
    batch = ocl.BatchDropCutter()
    batch.setSTL(surface)
    cutter = ocl.BallConeCutter(1.0, 6.0, math.radians(5.0))  # the batch does not keep it alive
    batch.setCutter(cutter)
    for x, y in xy.tolist():
        batch.appendPoint(ocl.CLPoint(x, y, -1000.0))
    batch.run()
    theirs = np.array([p.z for p in batch.getCLPoints()])
    made = TURNED["tapered"]
    ours = np.maximum(drop_cutter(mesh, made, xy), -1000.0)
    assert (ours >= theirs - 1e-6).all()
    # the peer misses contacts of the cone with edges: there a point of the mesh stands inside its cutter
    lower = np.flatnonzero(theirs < ours - 1e-6)
    assert len(lower) < 0.5 * len(xy)
    for k in lower[np.argsort(theirs[lower] - ours[lower])][:5]:
        found = searched(mesh, made.outline.stack, *xy[k])
        assert theirs[k] + 0.9 * (ours[k] - theirs[k]) < found <= ours[k] + 1e-9


@pytest.mark.parametrize("cutter", TURNED)
def test_paraboloids_lie_below_the_outline(cutter):
    stack = TURNED[cutter].outline.stack
    for k in range(len(stack.offset)):
        rows, bowls = stack.rows[stack.first[k]:stack.first[k + 1]], stack.bowls[k]
        rho = np.unique(np.concatenate([np.linspace(0.0, rows[-1, 1], 20_001), rows[:, 1]]))
        h = heights(rows, rho)
        room = h - bowls[:, 1:2] - 0.5 * bowls[:, :1] * rho**2
        assert room.min() > -1e-12 and room.min(axis=1).max() < 1e-3  # below, and hardly lower
        least = bowls[0, 3]
        for bend in (least, 3.0 * least) if np.isfinite(least) else ():
            low = h[-1] - 0.5 * bend * rho[-1] ** 2 - bowls[1, 3]
            assert (h - low - 0.5 * bend * rho**2).min() > -1e-12


def test_the_same_bytes_on_one_thread_and_two():
    mesh = smooth()
    tree, xy = TriangleTree(mesh), points_over(mesh, FEW + 1000, seed=6)
    threads, out = numba.get_num_threads(), []
    try:
        for n in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
            numba.set_num_threads(n)
            out.append(drop_turned(tree, xy, TURNED["assembly"].outline).tobytes())
    finally:
        numba.set_num_threads(threads)
    assert out[0] == out[1]


def test_outlines_that_are_none():
    for pieces, word in (((OutlineLine(2.0, 1.0), OutlineLine(3.0, 0.5)), "falls"), ((OutlineLine(-1.0, 0.0),), "end"),
                         ((OutlineArc(2.0, 1.0, (0.0, 1.0)),), "centre"), ((OutlineLine(math.nan, 0.0),), "end"),
                         ((), "width")):
        with pytest.raises(SetupError, match=word) as caught:
            Outline(pieces)
        assert caught.value.code == "bad_cutter"
    for call in (lambda: Cutter.tapered(diameter=2, tip_diameter=3, angle_deg=5, length=9),
                 lambda: Cutter.tapered(diameter=4, tip_diameter=3, angle_deg=90, length=9),
                 lambda: Cutter.barrel(diameter=8, tip_diameter=2, side_radius=3, length=9)):
        with pytest.raises(SetupError):
            call()
