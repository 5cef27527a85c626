"""Regions laid into the unit square: no triangle turns over, whatever the region, and what bulges in crowds less."""

import numpy as np
import pytest

from geometry.errors import GeometryError
from geometry.parameterization.laplace_grid import laplace
from geometry.parameterization.planar_embedding import embedded, grid_of, triangulated
from geometry.parameterization.quad_grid import Quad, areas, evenness, folds
from tests.square_regions import region

SHAPES = {"A": (0.0, 0.05), "M": (0.2, -0.17), "B": (0.35, -0.28, 0.12), "slit": (0.75, 0.0)}


def rectangle(width, height):
    t = np.linspace(0.0, 1.0, 5)[:, None]
    x, y = np.array([width, 0.0]), np.array([0.0, height])
    return t * x, x + t * y, x + y - t * x, y - t * y


RAGGED = [(21.15, 2.07), (20.83, 1.8), (20.06, 1.96), (19.73, 1.83), (19.23, 2.07), (19.13, 1.99), (18.66, 1.92),
          (17.58, 1.78), (17.43, 2.0), (17.7, 2.51), (17.57, 2.89), (17.72, 3.49), (17.53, 3.97), (17.92, 4.41),
          (17.62, 4.75), (17.7, 4.89), (17.46, 5.5), (17.69, 5.66), (17.49, 5.97), (17.61, 6.75), (17.81, 6.86)]


def test_a_ragged_border_ends():
    """Between two of its places an edge kept asking for a middle that was there already, without end."""
    ring = np.array(RAGGED)
    even_ring = np.vstack([np.linspace(a, b, 21)[:-1] for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)])
    sides = [np.take(even_ring, np.arange(a, b + 1), axis=0, mode="wrap") for a, b in
             ((0, 140), (140, 160), (160, 400), (400, 420))]
    places, faces, _ = triangulated(tuple(sides), 0.05)
    assert (turns(places, faces) > -1e-12).all() and faces.max() < len(places)


def turns(laid, faces):
    a, b, c = (laid[faces[:, k]] for k in range(3))
    return (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("spacing", [0.06, 0.025])
def test_no_triangle_turns_over(name, spacing):
    places, faces, sides = triangulated(region(*SHAPES[name]), spacing)
    laid = embedded(places, faces, sides)
    assert turns(laid, faces).min() > 0.0 and turns(laid, faces).sum() == pytest.approx(2.0, rel=1e-9)
    assert laid.min() == 0.0 and laid.max() == 1.0


def test_it_is_evener_than_laplace_and_fills_the_region():
    for name in "AM":
        sides = region(*SHAPES[name])
        places, faces, rows = triangulated(sides, 0.025)
        grid = grid_of(places, faces, embedded(places, faces, rows), 41, 31)
        harmonic, _ = laplace(Quad.of(sides, 41, 31))
        assert folds(grid) == 0 and evenness(grid)[0] < evenness(harmonic)[0]
        assert areas(grid).sum() == pytest.approx(areas(harmonic).sum(), rel=2e-3)


def test_a_square_stays_as_it_is():
    places, faces, rows = triangulated(rectangle(1.0, 1.0), 0.1)
    np.testing.assert_allclose(embedded(places, faces, rows), places, atol=1e-12)


def test_a_piece_of_surface_is_measured_on_the_surface():
    """Half a cylinder seen from above crowds at its edges; laid out from its places in space it is even in arc."""
    flat, faces, rows = triangulated(rectangle(np.pi, 2.0), 0.1)
    space = np.column_stack([np.cos(flat[:, 0]), flat[:, 1], np.sin(flat[:, 0])])
    np.testing.assert_allclose(embedded(space, faces, rows), flat / [np.pi, 2.0], atol=2e-3)
    grid = grid_of(space, faces, embedded(space, faces, rows), 21, 11)
    step = np.linalg.norm(np.diff(grid, axis=1), axis=2)
    assert step.max() / step.min() < 1.02


def test_motion_and_size_change_nothing():
    places, faces, rows = triangulated(region(*SHAPES["M"]), 0.05)
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    np.testing.assert_allclose(embedded(90.0 * places @ turn.T + [3.0, -7.0], faces, rows),
                               embedded(places, faces, rows), atol=1e-9)


def test_a_triangle_on_one_side_is_refused():
    """Two triangles of a square whose bottom has a place in the middle that only the lower one has."""
    places = np.array([[0.0, 0.0], [0.5, -0.2], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]])
    sides = (np.array([0, 1, 2]), np.array([2, 3]), np.array([3, 4]), np.array([4, 0]))
    with pytest.raises(GeometryError) as caught:
        embedded(places, faces, sides)
    assert caught.value.code == "flat_triangle" and caught.value.subjects[0] == "triangle 0"
