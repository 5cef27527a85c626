"""Trimmed regions laid into the unit square: any number of corners, notches, slits and holes; never a fold."""

import numpy as np
import pytest
import shapely

from geometry.errors import GeometryError
from geometry.parameterization.quad_grid import folds
from geometry.parameterization.square_patches import Method, squared
from tests.square_regions import region

T = np.linspace(0.0, 2.0 * np.pi, 181)[:-1]
L = np.array([(0, 0), (20, 0), (20, 8), (8, 8), (8, 20), (0, 20)], float)
SLIT = np.array([(0, 0), (20, 0), (20, 10), (10.2, 10), (10, 3), (9.8, 10), (0, 10)], float)
SHAPES = {
    "rectangle": [(0, 0), (30, 0), (30, 10), (0, 10)],
    "triangle": [(0, 0), (20, 0), (10, 9)],
    "pentagon": [(0, 0), (20, 0), (20, 10), (10, 12.0), (0, 10)],
    "octagon": [(10 * np.cos(t), 10 * np.sin(t)) for t in np.arange(8) * np.pi / 4],
    "disc": list(zip(10 * np.cos(T), 10 * np.sin(T), strict=True)),
    "L": L, "slit": SLIT, "clockwise": L[::-1],
    "U": [(0, 0), (30, 0), (30, 20), (20, 20), (20, 6), (10, 6), (10, 20), (0, 20)],
    "severe": np.vstack([s[:-1] for s in region(bump=0.35, notch=-0.28, step=0.12, size=40.0)]),
}


def lattice(piece, count=60):
    x, y = np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count))
    return piece.map(x.ravel(), y.ravel()).reshape(count, count, 2)


@pytest.mark.parametrize("name", SHAPES)
def test_pieces_cover_a_region_and_do_not_fold(name):
    border = np.asarray(SHAPES[name], float)
    pieces = squared((border,), (1.0, 1.0))
    whole = shapely.Polygon(border)
    covered = []
    for piece in pieces:
        grid = lattice(piece)
        assert folds(grid) <= 4 if name in ("disc", "triangle") else folds(grid) == 0  # corners on a straight border
        covered.append(shapely.Polygon(np.vstack([grid[0], grid[1:, -1], grid[-1, -2::-1], grid[-2:0:-1, 0]])))
    union = shapely.union_all(covered)
    assert sum(c.area for c in covered) == pytest.approx(whole.area, rel=0.01)
    assert shapely.symmetric_difference(union, whole).area < 0.012 * whole.area


@pytest.mark.parametrize("name, count", [("rectangle", 1), ("L", 2), ("slit", 2), ("U", 3), ("disc", 1)])
def test_regions_are_cut_where_they_turn_in_and_nowhere_else(name, count):
    pieces = squared((np.asarray(SHAPES[name], float),), (1.0, 1.0))
    assert len(pieces) == count
    assert all(("cut into" in " ".join(p.notes)) == (count > 1) for p in pieces)


def test_holes_are_filled_and_said():
    hole = np.array([(12.0, 4.0), (12.0, 6.0), (14.0, 6.0), (14.0, 4.0)])
    (piece,) = squared((np.asarray(SHAPES["rectangle"], float), hole), (1.0, 1.0))
    assert piece.notes == ("1 holes filled",)


def test_passes_run_along_the_longer_sides_of_the_surface_not_of_its_parameters():
    """A unit square of parameters over 10 mm by 40 mm."""
    (piece,) = squared((np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float),), (10.0, 40.0))
    a, b = piece.map(np.array([0.0, 1.0]), np.array([0.5, 0.5]))
    assert abs(b[1] - a[1]) == pytest.approx(1.0) and b[0] == pytest.approx(a[0])


def test_a_method_can_be_asked_for():
    border = np.vstack([s[:-1] for s in region(bump=0.2, notch=-0.17, size=40.0)])
    for method in (Method.FRONTS, Method.LAPLACE, Method.EMBEDDED):
        (piece,) = squared((border,), (1.0, 1.0), only=method)
        assert piece.method is method


def test_a_border_that_crosses_itself_is_refused():
    with pytest.raises(GeometryError) as refusal:
        squared((np.array([(0, 0), (10, 10), (10, 0), (0, 10)], float),), (1.0, 1.0))
    assert refusal.value.code == "bad_border"


@pytest.mark.parametrize("wide", [0.02, 0.05, 0.1])
def test_a_thin_tail_is_left_out_and_said(wide):
    """A pear, round above, its sides meeting in a needle 3 mm long in which every grid folds."""
    t = np.linspace(-0.15 * np.pi, 1.15 * np.pi, 60)
    pear = np.vstack([np.column_stack([10.0 * np.cos(t), 20.0 + 10.0 * np.sin(t)]),
                      [[-0.9, 2.0], [-wide, 0.0], [0.0, -3.0], [wide, 0.0], [0.9, 2.0]]])
    (piece,) = squared((pear,), (1.0, 1.0))
    assert "thin tails of" in piece.notes[0]
    covered = shapely.Polygon(np.vstack([q for q in sides_of(piece)])).buffer(0)
    whole = shapely.Polygon(pear)
    assert 0.97 * whole.area < covered.area <= whole.area * (1.0 + 1e-3)
    assert shapely.difference(whole, covered.buffer(0.02)).bounds[3] < 2.5  # nothing but the tail is gone


def sides_of(piece, count=400):
    """The border of a piece, counterclockwise."""
    t, zero, one = np.linspace(0, 1, count), np.zeros(count), np.ones(count)
    return piece.map(t, zero), piece.map(one, t), piece.map(t[::-1], one), piece.map(zero, t[::-1])
