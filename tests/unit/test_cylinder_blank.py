"""Cylinder blanks: what the proof is given of them, and what is refused."""

import numpy as np
import pytest

from geometry.errors import SetupError
from service.blank import check_against_part, stock_cylinder
from service.convert import check_plannable, parse_setup
from tests.pocket_case import block

TOOL = {"id": "T1", "kind": "flat", "diameter_mm": 4, "flutes": 2, "flute_length_mm": 8, "neck_diameter_mm": 3.8,
        "neck_length_mm": 20, "shank_diameter_mm": 6, "stickout_mm": 30}
UP = np.eye(3)


def setup(**stock):
    return parse_setup({"tools": [TOOL], "stock": {"kind": "cylinder", **stock}})


def test_a_given_cylinder_grows_by_its_uncertainty():
    given = setup(uncertainty_mm=0.5, cylinder_mm={"x": 1, "y": -2, "bottom": -10, "diameter": 60, "height": 12})
    assert stock_cylinder(given, block(), UP) == (1, -2, -10.5, 30.5, 13)
    check_against_part(given, block())
    over = np.diag([1.0, -1.0, -1.0])
    assert stock_cylinder(given, block(), over) == (1, 2, -2.5, 30.5, 13)


def test_without_numbers_it_stands_round_the_part():
    """40 x 30 x 10 mm under Z0: 25 mm from the middle to a corner."""
    assert stock_cylinder(setup(margin_mm=1, uncertainty_mm=0), block(), UP) == (0, 0, -10, 26, 11)
    assert stock_cylinder(parse_setup({"tools": [TOOL]}), block(), UP) is None


@pytest.mark.parametrize("wrong, side, out", [({"diameter": 48}, "side", 1.0), ({"height": 9.5}, "top", 0.5),
                                              ({"bottom": -9.8}, "underside", 0.2)])
def test_a_part_that_stands_out_of_it_is_refused(wrong, side, out):
    given = setup(cylinder_mm={"bottom": -10, "diameter": 60, "height": 12, **wrong})
    with pytest.raises(SetupError, match=f"by {out:.3f} mm on its {side}") as caught:
        check_against_part(given, block())
    assert caught.value.code == "stock_misses_part" and caught.value.measured == pytest.approx(out)


def test_a_lying_cylinder_and_a_plan_from_one_are_refused():
    given = setup()
    with pytest.raises(SetupError) as caught:
        stock_cylinder(given, block(), np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]))
    assert caught.value.code == "cylinder_across_access"
    with pytest.raises(SetupError) as caught:
        check_plannable(given)
    assert caught.value.code == "cylinder_not_planned" and "verify" in caught.value.remedy
