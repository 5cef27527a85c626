"""The picture of the clamping: what must be seen on it, and shapes of blanks."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from geometry.part import FaceInfo, Part
from service.pictures.annotation import AXES
from service.pictures.clamping_picture import (
    COMING,
    FIXTURE,
    HEADER,
    SIZE,
    Clamped,
    bar_mesh,
    box_mesh,
    clamp_picture,
    corners_of,
)


def block(low: tuple[float, ...], high: tuple[float, ...]) -> np.ndarray:
    return corners_of(np.array([low, high]))


@pytest.fixture(scope="module")
def held() -> Clamped:
    mesh = box_mesh(block((0, 0, 0), (40, 20, 10)))
    faces = tuple(FaceInfo(n, "plane", 1.0, False, 0.0, 0.0) for n in range(1, 7))
    part = Part(mesh, faces, (), mesh.volume, mesh.bounds, "mm", 0.01, 0.2, 0.0, (), "0" * 64)
    return Clamped(part, box_mesh(block((-1, -1, 0), (41, 21, 12))), False, (block((-25, 0, 0), (-5, 20, 6)),), "G55",
                   (("A1", np.array([0.0, 0.0, 1.0])),))


def pixels(held: Clamped) -> np.ndarray:
    with Image.open(io.BytesIO(clamp_picture(held, "as it is"))) as picture:
        return np.asarray(picture, dtype=np.int64)


def count(picture: np.ndarray, colour: tuple[float, float, float], tolerance: int = 3) -> int:
    return int((np.abs(picture - 255.0 * np.array(colour)).max(axis=-1) <= tolerance).sum())


def hue(picture: np.ndarray, colour: tuple[float, float, float]) -> int:
    p = picture.astype(float)
    unit = p / np.maximum(np.linalg.norm(p, axis=-1, keepdims=True), 1.0)
    return int((unit @ (np.array(colour) / np.linalg.norm(colour)) > 0.995).sum())


def test_part_fixture_axes_and_tool_axis_are_seen(held):
    picture = pixels(held)[HEADER:SIZE[1] - 70]
    assert picture.shape[1] == SIZE[0]
    left, right = picture[:, :SIZE[0] // 2], picture[:, SIZE[0] // 2:]
    for half in (left, right):
        assert hue(half, FIXTURE) > 5000
        assert all(count(half, colour) > 100 for _, colour in AXES[:2])
    assert count(left, AXES[2][1]) > 100 and count(right, AXES[2][1]) == 0
    assert count(left, COMING) > 300 and count(right, COMING) == 0
    bare = pixels(replace(held, fixtures=()))[HEADER:SIZE[1] - 70]
    assert hue(bare, FIXTURE) == 0


def test_a_zero_that_is_far_off_is_told_of_instead(held):
    away = np.array([900.0, 0.0, 0.0])
    mesh = replace(held.part.mesh, vertices=held.part.mesh.vertices + away)
    far = replace(held, part=replace(held.part, mesh=mesh), fixtures=(),
                  blank=replace(held.blank, vertices=held.blank.vertices + away))
    picture = pixels(far)[HEADER:SIZE[1] - 70]
    assert count(picture, AXES[0][1]) == 0 and count(picture, COMING) > 300


def test_the_same_bytes_twice(held):
    assert clamp_picture(held, "as it is") == clamp_picture(held, "as it is")


@pytest.mark.parametrize("high", [(0.0, 0.0, 9.0), (3.0, -4.0, 5.0), (7.0, 0.0, 0.0)])
def test_a_bar_is_a_closed_prism(high):
    mesh = bar_mesh(np.zeros(3), np.array(high), 4.0)
    length, sides = float(np.linalg.norm(high)), 64
    assert mesh.volume == pytest.approx(0.5 * sides * 16.0 * np.sin(2.0 * np.pi / sides) * length)
    edges = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}
