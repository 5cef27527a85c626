"""Cylinder blanks: what planner and proof are given of them, against combs of places, and what is refused."""

import numpy as np
import pytest

from geometry.errors import SetupError
from geometry.mesh_queries.bvh import TriangleTree
from service.from_wire import check_plannable, parse_setup
from service.stages.blank_checks import check_against_part
from service.stages.blank_model import blank_of
from tests.hand_parts import box_mesh
from tests.pocket_case import block
from toolpath.stock.stock_map import StockMap
from verify.blank.blank import BlankCylinder, blank_cylinder, stands_over_air, stock_bounds, stock_on_normals
from verify.model import ProofSetup
from zones.reach.access_view import access_rotation

TOOL = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flutes": 2, "flute_length_mm": 8, "neck_diameter_mm": 3.8,
        "neck_length_mm": 20, "shank_diameter_mm": 6, "stickout_mm": 30}
UP = np.eye(3)
DIRECTIONS = [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.6, -0.8, 0.0), (1e-12, 0.0, 1.0),
              (1e-5, 2e-5, 1.0), (1.0, 0.3, 1e-7), *np.random.default_rng(3).normal(size=(9, 3)).tolist()]


def setup(**stock):
    return parse_setup({"tools": [TOOL], "stock": {"kind": "cylinder", **stock}})


def blank(given):
    return blank_of(given, block())


def test_a_given_cylinder_grows_by_its_uncertainty():
    given = setup(uncertainty_mm=0.5, cylinder_mm={"x": 1, "y": -2, "bottom": -10, "diameter": 60, "height": 12})
    assert blank(given).proof_cylinder(UP) == ((1, -2, -10.5, 30.5, 13), (0, 0, 1))
    check_against_part(given, block(), blank(given))
    over = np.diag([1.0, -1.0, -1.0])
    assert blank(given).proof_cylinder(over) == ((1, 2, -2.5, 30.5, 13), (0, 0, 1))
    lying = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
    assert blank(given).proof_cylinder(lying) == ((-2, -10.5, 1, 30.5, 13), (0, 1, 0))
    assert blank(given).corners(lying).tolist() == [[-32, -10, -29], [28, 2, 31]]


def test_without_numbers_it_stands_round_the_part():
    """40 x 30 x 10 mm under Z0: 25 mm from the middle to a corner."""
    given = setup(margin_mm=1, uncertainty_mm=0)
    assert blank(given).proof_cylinder(UP)[0] == (0, 0, -10, 26, 11)
    assert blank(given).seat == -10 and blank(given).proof_box(UP) is None
    plain = blank(parse_setup({"tools": [TOOL]}))
    assert plain.proof_cylinder(UP)[0] is None and not plain.stands_alone


@pytest.mark.parametrize("wrong, side, out", [({"diameter": 48}, "side", 1.0), ({"height": 9.5}, "top", 0.5),
                                              ({"bottom": -9.8}, "underside", 0.2)])
def test_a_part_that_stands_out_of_it_is_refused(wrong, side, out):
    given = setup(cylinder_mm={"bottom": -10, "diameter": 60, "height": 12, **wrong})
    with pytest.raises(SetupError, match=f"by {out:.3f} mm on its {side}") as caught:
        check_against_part(given, block(), blank(given))
    assert caught.value.code == "stock_misses_part" and caught.value.measured == pytest.approx(out)


def test_an_allowance_that_it_does_not_hold_is_refused():
    """The top of the block is at 0, and that of the cylinder at 0.5 with its uncertainty."""
    bar = {"bottom": -10, "diameter": 60, "height": 10.25}

    def check(allowance):
        given = parse_setup({"tools": [TOOL], "quality": {"stock_allowance_mm": allowance},
                             "stock": {"kind": "cylinder", "uncertainty_mm": 0.25, "cylinder_mm": bar}})
        check_against_part(given, block(), blank(given))

    check(0.5)
    with pytest.raises(SetupError) as caught:
        check(0.6)
    assert caught.value.code == "allowance_beyond_stock" and caught.value.measured == pytest.approx(0.5)


def test_plans_start_from_a_cylinder():
    check_plannable(setup())


BAR = (np.array([1.0, -2.0, -3.0]), 4.0, 11.0)  # middle of the lower end in its own frame, radius, height


def standing(direction):
    """Rotation (3, 3) of a bar into a frame, and there the middles of its two ends."""
    rotation = access_rotation(direction)
    return rotation, np.array([BAR[0], BAR[0] + [0.0, 0.0, BAR[2]]]) @ rotation.T


def inside(points, rotation, slack=0.0):
    """Whether points (n, 3) are in the bar: in its own frame it is upright."""
    own = points @ rotation - BAR[0]
    return (np.hypot(own[:, 0], own[:, 1]) <= BAR[1] + slack) & (own[:, 2] >= -slack) & (own[:, 2] <= BAR[2] + slack)


def highest(x, y, rotation, low, high):
    """Highest place of a comb of 1/2000 of the height, on a vertical line, that is in the bar; -inf where none is."""
    z = np.linspace(low, high, 2001)
    there = inside(np.column_stack([np.full_like(z, x), np.full_like(z, y), z]), rotation)
    return z[there].max() if there.any() else -np.inf


def proof_of(direction):
    _, ends = standing(direction)
    low, high = sorted(ends.tolist(), key=lambda e: e[2])
    axis = (np.array(high) - low) / BAR[2]
    return BlankCylinder(np.array(low), axis, BAR[1], BAR[2])


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_planners_bar_is_as_high_as_its_twin_and_no_place_of_a_cell_is_above_its_cover(direction):
    rotation, ends = standing(direction)
    stock = StockMap.cylinder(TriangleTree(box_mesh([0, 0, 0], [1, 1, 1])), BAR[1], ends, 0.4)
    lat, rng = stock.lattice, np.random.default_rng(0)
    low, high = ends[:, 2].min() - BAR[1] - 0.1, ends[:, 2].max() + BAR[1] + 0.1
    comb, seen = (high - low) / 2000, 0
    for iy, ix in zip(rng.integers(0, lat.ny, 160), rng.integers(0, lat.nx, 160), strict=True):
        x, y = lat.x0 + lat.step * ix, lat.y0 + lat.step * iy
        true = highest(x, y, rotation, low, high)
        if true > -np.inf:
            assert 0.0 <= stock.top[iy, ix] - true + 1e-9 <= comb + 2e-9
            seen += 1
        elif stock.top[iy, ix] > -np.inf:  # on the rim, or thinner than the comb
            assert inside(np.array([[x, y, stock.top[iy, ix]]]), rotation, 1e-6).all()
        for dx, dy in rng.uniform(-0.5, 0.5, (6, 2)) * lat.step:
            assert stock.cover[iy, ix] >= highest(x + dx, y + dy, rotation, low, high) - 1e-9
    assert seen > 30
    assert (stock.cover >= stock.top).all() and stock.highest <= high
    edge = np.ones_like(stock.top, bool)
    edge[1:-1, 1:-1] = False
    assert (stock.cover[edge] == -np.inf).all()  # the lattice goes all round


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_the_proofs_bar_is_what_its_twin_says(direction):
    rotation, _ = standing(direction)
    bar, rng = proof_of(direction), np.random.default_rng(1)
    box = bar.bounds
    points = rng.uniform(box[0] - 1.0, box[1] + 1.0, (4000, 3))
    depth, there = bar.depth(*points.T), inside(points, rotation)
    assert ((depth > 0) == there)[np.abs(depth) > 1e-9].all() and there.sum() > 300
    comb = (box[1, 2] - box[0, 2] + 2.0) / 2000
    tops = bar.tops(points[:300, 0], points[:300, 1])
    for (x, y, _), top in zip(points[:300], tops, strict=True):
        true = highest(x, y, rotation, box[0, 2] - 1.0, box[1, 2] + 1.0)
        assert true == -np.inf if top == -np.inf else (top - true <= comb + 1e-9 or true == -np.inf)
        assert top >= true - 1e-9
    ways = rng.normal(size=(int(there.sum()), 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    far = bar.way_out(points[there], ways)
    assert (np.abs(bar.depth(*(points[there] + far[:, None] * ways).T)) < 1e-6).all()
    assert inside(points[there] + 0.999 * far[:, None] * ways, rotation, 1e-9).all()
    # its box is the smallest: places of its surface come to every side of it
    turn = np.linspace(0.0, 2.0 * np.pi, 4001)
    rims = [np.column_stack([BAR[1] * np.cos(turn), BAR[1] * np.sin(turn), np.full_like(turn, z)]) + BAR[0]
            for z in (0.0, BAR[2])]
    rim = np.concatenate(rims) @ rotation.T
    assert np.abs(np.array([rim.min(axis=0), rim.max(axis=0)]) - box).max() < 1e-5


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_planner_and_proof_agree_without_sharing_a_line(direction):
    _, ends = standing(direction)
    stock, bar = StockMap.cylinder(TriangleTree(box_mesh([0, 0, 0], [1, 1, 1])), BAR[1], ends, 0.4), proof_of(direction)
    lat = stock.lattice
    x, y = np.meshgrid(lat.x0 + lat.step * np.arange(lat.nx), lat.y0 + lat.step * np.arange(lat.ny))
    theirs = bar.tops(x, y)
    both = np.isfinite(theirs) & np.isfinite(stock.top)
    assert np.abs(theirs[both] - stock.top[both]).max() < 1e-5 and both.sum() > 100
    one = np.isfinite(theirs) != np.isfinite(stock.top)  # on the rim itself
    at = np.maximum(theirs, stock.top)[one]
    assert (np.abs(bar.depth(x[one], y[one], at)) < 1e-6).all()


def test_a_leaning_cylinder_stands_over_air_and_an_upright_one_does_not():
    bar = {"stock_kind": "cylinder", "stock_cylinder": (0.0, 0.0, 0.0, 4.0, 6.0)}
    upright, leaning = ProofSetup(**bar), ProofSetup(**bar, stock_axis=(0.6, 0.0, 0.8))
    assert not stands_over_air(upright) and stands_over_air(leaning) and stands_over_air(ProofSetup())
    assert blank_cylinder(np.zeros((2, 3)), upright).upright
    assert np.allclose(stock_bounds(np.zeros((2, 3)), leaning), [[-3.2, -4.0, -2.4], [3.6 + 3.2, 4.0, 4.8 + 2.4]])
    centre, ways = np.tile([1.8, 0.0, 2.4], (2, 1)), np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])
    assert stock_on_normals(centre, ways, np.zeros((2, 3)), leaning, 10.0) == pytest.approx([3.0, 4.0])
