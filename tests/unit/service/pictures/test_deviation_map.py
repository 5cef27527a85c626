"""The deviation map: classes by the budget, and colours where they must be seen."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from geometry.sampling import sample_surface
from service.pictures.camera import Camera
from service.pictures.deviation_map import COLOURS, GREEN, PALE, SIZE, UNCUT, Mark, Measured, draw_deviation
from tests.pocket_case import block

PART = block()
SAMPLES = sample_surface(PART.mesh, 40.0, seed=3, triangles=np.flatnonzero(PART.mesh.face_ids >= 6))


def measured(excess, reached=True):
    """The same excess, mm, everywhere: on the top (face 6), pocket walls (7 to 10) and floor (11)."""
    n = len(SAMPLES)
    return Measured(SAMPLES, np.full(n, float(excess)), np.full(n, reached), 0.02, 0.01)


def drawn(tmp_path, what, marks=(), name="map.png"):
    draw_deviation(PART, what, marks, tmp_path / name, "block", {"coverage": "12 %"})
    image = np.asarray(Image.open(tmp_path / name)).astype(float) / 255.0
    assert image.shape == (SIZE[1], SIZE[0], 3)
    return image[60:820]


def pixels(picture, colour):
    """How many pixels have that colour, lit or in shade."""
    length = np.linalg.norm(picture, axis=-1)
    unit = picture / np.maximum(length[..., None], 1e-9)
    return int(((unit @ (np.array(colour) / np.linalg.norm(colour)) > 0.9995) & (length > 0.2)).sum())


@pytest.mark.parametrize(("excess", "expected"), [
    (-0.2, 0), (-0.05, 1), (-0.011, 2), (-0.01, GREEN), (0.0, GREEN), (0.02, GREEN), (0.021, 4), (0.1, 5), (0.9, 6)])
def test_classes_follow_the_budget(excess, expected):
    assert set(measured(excess).classes.tolist()) == {expected}


def test_uncut_is_what_no_cut_reached_and_stands_too_high():
    assert set(measured(0.5, reached=False).classes.tolist()) == {UNCUT}
    assert set(measured(0.01, reached=False).classes.tolist()) == {GREEN}


@pytest.mark.parametrize("kind", [0, 1, *(pytest.param(k, marks=pytest.mark.slow) for k in range(2, 8))])
def test_every_class_is_seen_in_its_colour_and_no_other(tmp_path, kind):
    what = measured([-0.2, -0.05, -0.02, 0.0, 0.03, 0.1, 0.5, 0.5][kind], reached=kind != UNCUT)
    picture = drawn(tmp_path, what)
    assert pixels(picture, COLOURS[kind]) > 50_000
    assert all(pixels(picture, COLOURS[k]) < 1_000 for k in range(UNCUT) if k != kind)
    assert pixels(picture, PALE) > 20_000  # the outside of the block is not judged


def test_a_gouge_of_one_sample_is_seen(tmp_path):
    excess = np.zeros(len(SAMPLES))
    excess[np.argmin(np.linalg.norm(SAMPLES.points - [0, 0, -5], axis=1))] = -0.5
    picture = drawn(tmp_path, replace(measured(0.0), excess=excess))
    red = (picture[..., 0] > 0.35) & (picture[..., 1] < 0.2) & (picture[..., 2] < 0.3)
    assert 2 < red.sum() < 400


def test_both_views_show_the_wall_that_is_wrong(tmp_path):
    """One wall of the pocket: the views are chosen so that it is seen."""
    for face in (7, 8, 9, 10):
        excess = np.where(SAMPLES.face == face, 0.5, 0.0)
        picture = drawn(tmp_path, replace(measured(0.0), excess=excess), name=f"{face}.png")
        assert pixels(picture, COLOURS[6]) > 2_000


@pytest.mark.slow
def test_words_of_two_marks_do_not_lie_over_one_another(tmp_path):
    plain = drawn(tmp_path, measured(0.0))
    marks = [Mark(np.array([[x, 0.0, -5.0]]), "0.1 mm too deep, F11, line 7", COLOURS[1]) for x in (0.0, 5.0)]
    one, two = (drawn(tmp_path, measured(0.0), marks[:k], f"{k}.png") for k in (1, 2))
    first, both = ((np.abs(p - plain).max(axis=-1) > 0.2) for p in (one, two))
    assert first.sum() > 1000 and both.sum() > 1.9 * first.sum()
    same = [Mark(np.array([[0.0, 0.0, -5.0]]), "again", COLOURS[1])]
    np.testing.assert_array_equal(drawn(tmp_path, measured(0.0), marks[:1] + same, "s.png"), one)


def test_same_bytes_twice(tmp_path):
    mark = Mark(np.array([[0.0, 0, -20]]), "behind the part", COLOURS[5])
    for name in ("a.png", "b.png"):
        drawn(tmp_path, measured(-0.05), [mark], name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_pixels_lead_back_to_places():
    points = np.random.default_rng(2).uniform(-30, 40, (50, 3))
    camera = Camera.fit(points, (640, 480), azimuth=0.4, elevation=0.7)
    np.testing.assert_allclose(camera.places(camera.screen(points)), points, atol=1e-9)
