"""Trimmed faces on surfaces whose pieces are known by formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.kernels.trim import thin
from geometry.trimming.facet_sheet import refined, sheet_of, sides_of
from geometry.trimming.label_cuts import split
from geometry.trimming.trim import trim_faces
from tests.trim_parts import assert_partition, plane, saddle, shoelace, surface, tube, wave

TOLERANCE = 1e-3


def above(height):
    return lambda points, normals, face: (points[:, 2] > height).astype(int)


@pytest.mark.parametrize("pitch", [0.11, 0.4, 3.0])
@pytest.mark.parametrize("make", [plane, tube, wave, saddle])
def test_division_keeps_area_neighbours_and_pitch(make, pitch):
    part = make()
    sheet = sheet_of(part, None)
    fine = refined(sheet, pitch)
    assert fine.areas().sum() == pytest.approx(part.mesh.areas.sum(), rel=1e-12)
    assert (fine.uv_areas() > 0).all() and fine.areas().min() > 0
    low, high, sides = sides_of(fine.corners)
    uses = np.bincount(sides.ravel())
    assert uses.max() == 2
    border = fine.nodes[low[uses == 1], :3], fine.nodes[high[uses == 1], :3]
    length = np.linalg.norm(border[1] - border[0], axis=1)
    assert length.max() <= pitch * (1 + 1e-12)
    whole = sheet_of(part, None)
    a, b, s = sides_of(whole.corners)
    rim = np.bincount(s.ravel()) == 1
    around = np.linalg.norm(whole.nodes[a[rim], :3] - whole.nodes[b[rim], :3], axis=1).sum()
    assert length.sum() == pytest.approx(around, rel=1e-12)
    every = np.linalg.norm(fine.nodes[low, :3] - fine.nodes[high, :3], axis=1)
    assert every.max() <= 2.3 * pitch


@pytest.mark.parametrize("turned", [False, True])
def test_half_space_cuts_a_tube_into_two_rings(turned):
    part = tube(turned=turned)
    found = trim_faces(part, None, above(7.3), 0.5, TOLERANCE)
    assert_partition(part, found)
    assert list(found) == [0, 1]
    for label, (z0, z1) in ((0, (0.0, 7.3)), (1, (7.3, 20.0))):
        (patch,) = found[label]
        around = 90 * 2 * 5 * np.sin(np.pi / 90)
        assert patch.area == pytest.approx(around * (z1 - z0), abs=around * TOLERANCE)
        assert patch.forward is not turned and not patch.whole
        # one simple polygon that runs along the seam twice, on the left of which the ring lies seen from outside
        (loop,), (xyz,) = patch.loops, patch.loops_xyz
        assert shoelace(loop) * (-1 if turned else 1) == pytest.approx(2 * np.pi * (z1 - z0), abs=2 * np.pi * TOLERANCE)
        away = np.minimum(np.abs(xyz[:, 2] - z0), np.abs(xyz[:, 2] - z1))
        assert away.max() <= TOLERANCE
        assert np.ptp(loop[:, 0]) == pytest.approx(2 * np.pi)


def test_a_piece_over_the_seam_is_two_patches():
    part = tube()
    found = trim_faces(part, None, lambda p, n, f: (p[:, 0] > 0).astype(int), 0.5)
    assert_partition(part, found)
    assert [len(found[k]) for k in (0, 1)] == [1, 2]
    assert found[1][0].area == pytest.approx(found[1][1].area, rel=1e-3)


def test_sphere_patch_and_its_cap():
    """The band -0.6 < v < 0.9 of a ball of 4 mm, cut at z = 2: zone areas 2 pi R h."""
    radius, u, v = 4.0, np.linspace(0, 2 * np.pi, 181), np.linspace(-0.6, 0.9, 41)
    part = surface(lambda u, v: (radius * np.cos(v) * np.cos(u), radius * np.cos(v) * np.sin(u), radius * np.sin(v)),
                   u, v, wrapped=True)
    found = trim_faces(part, None, above(2.0), 0.25, TOLERANCE)
    assert_partition(part, found)
    exact = 2 * np.pi * radius * (radius * np.sin(0.9) - 2.0)
    assert found[1][0].area == pytest.approx(exact, rel=1e-3)
    (loop,), (xyz,) = found[1][0].loops, found[1][0].loops_xyz
    low = xyz[(loop[:, 0] > 1e-9) & (loop[:, 0] < 2 * np.pi - 1e-9), 2]
    assert low.min() == pytest.approx(2.0, abs=TOLERANCE)
    assert (np.minimum(np.abs(low - 2.0), np.abs(low - radius * np.sin(0.9))) <= TOLERANCE).all()


def test_half_space_cuts_a_free_form_wall():
    part = wave()
    found = trim_faces(part, None, above(4.1), 0.4, TOLERANCE)
    assert_partition(part, found)
    bottom = part.mesh.vertices[np.abs(part.mesh.vertices[:, 2]) < 1e-9]
    length = np.linalg.norm(np.diff(bottom, axis=0), axis=1).sum()
    assert found[1][0].area == pytest.approx(length * 1.9, abs=length * TOLERANCE)
    z = found[1][0].loops_xyz[0][:, 2]
    assert (np.minimum(np.abs(z - 4.1), np.abs(z - 6.0)) <= TOLERANCE).all()


def test_island_and_its_hole():
    disc = np.pi * 1.2**2
    found = trim_faces(plane(), None, lambda p, n, f: (np.hypot(p[:, 0] - 4.3, p[:, 1] - 5.1) < 1.2).astype(int), 0.5)
    assert_partition(plane(), found)
    (rest,), (island,) = found[0], found[1]
    assert len(island.loops) == 1 and len(rest.loops) == 2
    assert island.area == pytest.approx(disc, abs=2 * np.pi * 1.2 * TOLERANCE)
    assert shoelace(rest.loops[0]) == pytest.approx(100.0) and shoelace(rest.loops[1]) == pytest.approx(-disc, rel=2e-3)
    ring = {tuple(x) for x in rest.loops[1]}
    assert ring == {tuple(x) for x in island.loops[0]}
    away = np.hypot(island.loops[0][:, 0] - 4.3, island.loops[0][:, 1] - 5.1) - 1.2
    assert np.abs(away).max() <= TOLERANCE


def test_an_island_between_the_corners_of_facets_is_found():
    """A disc no node of the refined sheet hits, as wide as the pitch; the middle of a facet does."""
    part = plane(3.0, 1)
    sheet = refined(sheet_of(part, None), 1.0)
    middle = sheet.nodes[sheet.corners[4], :2].mean(axis=0)
    found = trim_faces(part, None, lambda p, n, f: (np.hypot(*(p[:, :2] - middle).T) < 0.3).astype(int), 1.0)
    assert len(found[1]) == 1
    assert found[1][0].area == pytest.approx(np.pi * 0.09, rel=0.1)


def test_three_labels_meet_in_a_corner():
    meet = np.array([4.37, 5.21])

    def label(points, normals, face):
        return (np.arctan2(*(points[:, :2] - meet).T) % (2 * np.pi) // (2 * np.pi / 3)).astype(int)

    found = trim_faces(plane(), None, label, 0.5, TOLERANCE)
    assert_partition(plane(), found)
    corners = [min(p.loops[0].tolist(), key=lambda x: np.hypot(*(x - meet))) for (p,) in found.values()]
    assert len(corners) == 3 and max(np.hypot(*(c - meet)) for c in corners) <= 5 * TOLERANCE


def test_a_strip_as_narrow_as_the_pitch_stays_one_strip():
    """Sides that run from below the strip to above it are split where they meet it."""
    found = trim_faces(plane(), None, lambda p, n, f: np.digitize(p[:, 1] + 0.01 * p[:, 0], [4.0, 4.45]), 0.5)
    assert_partition(plane(), found)
    assert [len(p) for p in found.values()] == [1, 1, 1]
    assert found[1][0].area == pytest.approx(4.5, abs=2 * 10 * TOLERANCE)


def test_faces_without_a_border_are_whole_and_keep_the_nodes_of_the_mesh():
    found = trim_faces(plane(), None, above(5.0), 0.5)
    (patch,) = found[0]
    assert patch.whole and patch.area == pytest.approx(100.0) and len(patch.loops[0]) == 16


def test_noise_along_the_rim_leaves_no_slivers():
    part = tube()
    found = trim_faces(part, None, lambda p, n, f: (p[:, 2] + 1e-9 * np.sin(1e5 * p[:, 0]) > 20.0).astype(int), 0.5)
    assert_partition(part, found)
    assert list(found) == [0] and found[0][0].whole


def test_the_label_sees_unit_normals_out_of_the_material():
    seen = []

    def label(points, normals, face):
        seen.append((points, normals, face))
        return np.zeros(len(points), int)

    trim_faces(tube(n=90), None, label, 1.0)
    trim_faces(tube(n=90, turned=True), None, label, 1.0)
    for (points, normals, face), sign in ((seen[0], 1.0), (seen[-1], -1.0)):
        radial = points[:, :2] / np.linalg.norm(points[:, :2], axis=1)[:, None]
        assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
        assert (np.einsum("ij,ij->i", radial, normals[:, :2]) * sign).min() > np.cos(np.pi / 90)
        assert face.dtype == np.int32 and (face == 1).all()


def test_what_cannot_be_trimmed_is_refused():
    with pytest.raises(GeometryError) as error:
        trim_faces(replace(plane(), uv=None), None, above(1), 0.5)
    assert error.value.code == "no_parameters"
    with pytest.raises(GeometryError) as error:
        trim_faces(plane(), [1, 7], above(1), 0.5)
    assert error.value.code == "no_such_face" and error.value.subjects == ("F7",)
    for pitch, tolerance in ((0.0, 1e-3), (0.5, 0.0)):
        with pytest.raises(ValueError, match="positive"):
            trim_faces(plane(), None, above(1), pitch, tolerance)
    with pytest.raises(ValueError, match="one label a point"):
        trim_faces(plane(), None, lambda p, n, f: np.zeros(3, int), 0.5)
    assert trim_faces(plane(), [], above(1), 0.5) == {}


@pytest.mark.parametrize(("marked", "facets"), [((), 1), ((1,), 2), ((0, 2), 3), ((0, 1, 2), 4)])
def test_split_facets_cover_the_facet(marked, facets):
    points = np.array([[0, 0], [2, 0], [0, 2], [1, 0], [1, 1], [0, 1]], float)
    middle = np.full(3, -1)
    middle[list(marked)] = 3 + np.array(marked, int)
    out = split(np.array([[0, 1, 2]]), np.array([[0, 1, 2]]), middle)
    areas = [shoelace(points[f]) for f in out]
    assert len(out) == facets and min(areas) > 0 and sum(areas) == pytest.approx(2.0)


def naive_thin(points, tolerance):
    """Douglas-Peucker by its definition: keep the worst point and start again on both sides."""
    a, b = points[0], points[-1]
    span = b[:3] - a[:3]
    worst, at = tolerance, None
    for i in range(1, len(points) - 1):
        s = np.clip((points[i, :3] - a[:3]) @ span / (span @ span), 0, 1) if span @ span else 0.0
        gap = points[i] - (a + s * (b - a))
        miss = max(np.linalg.norm(gap[:3]), np.linalg.norm(gap[3:]))
        if miss > worst:
            worst, at = miss, i
    if at is None:
        return [0, len(points) - 1]
    left, right = naive_thin(points[:at + 1], tolerance), naive_thin(points[at:], tolerance)
    return left + [at + i for i in right[1:]]


@pytest.mark.parametrize("seed", range(5))
def test_thinning_is_that_of_its_slow_twin(seed):
    points = np.cumsum(np.random.default_rng(seed).normal(size=(200, 5)), axis=0)
    keep = np.zeros(200, bool)
    thin(points, 1.5, keep)
    assert np.flatnonzero(keep).tolist() == naive_thin(points, 1.5)
