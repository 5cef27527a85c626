"""Blank and fixtures of a setup against the part they are meant for, once its place is known.

What the setup alone can say (a margin of 0, an allowance beyond the margin) is found before that, in
``service.convert.check_blank``.
"""

from __future__ import annotations

import numpy as np

from geometry.boxes import point_of_mesh_in_box
from geometry.errors import SetupError
from geometry.part import Part
from schemas.setup import Setup

OVERHANG = 0.01  # mm the part may stand out of its blank or into a fixture: rounding of what people type
FULL = 1e-6  # share of a box that must be free of the part to be called stock


def check_against_part(setup: Setup, part: Part) -> None:
    """Refuse a blank that does not hold the part and a fixture that stands inside it.

    Raises
    ------
    SetupError
        Code 'stock_misses_part', 'no_stock' or 'fixture_in_part'.
    """
    _check_box(setup, part)
    _check_fixtures(setup, part)


def _check_box(setup: Setup, part: Part) -> None:
    stock = setup.stock
    if stock.kind != "box":
        return
    if stock.box_mm is None:
        grown = np.array([-1.0, 1.0])[:, None] * (stock.margin_mm + stock.uncertainty_mm)
        box = part.bounds + grown
        box[0, 2] = part.bounds[0, 2]
    else:
        box = np.array(stock.box_mm, dtype=np.float64)
        _check_contains(box, part)
        box = box + np.array([-1.0, 1.0])[:, None] * stock.uncertainty_mm
    room = float(np.prod(box[1] - box[0]))
    if room - part.volume <= FULL * room:
        raise SetupError("nothing stands on the part that could be cut: the part fills its box blank", code="no_stock",
                         subjects=("stock",), measured=max(room - part.volume, 0.0), limit=0.0,
                         remedy="give a larger stock.box_mm, or a stock.margin_mm above 0")


def _check_contains(box: np.ndarray, part: Part) -> None:
    """Refuse a box that the part stands out of; the sides are named, the worst first."""
    out = np.array([box[0] - part.bounds[0], part.bounds[1] - box[1]])
    if out.max() <= OVERHANG:
        return
    worst = sorted(((float(out[i, k]), f"{'-+'[i]}{'XYZ'[k]}") for i in range(2) for k in range(3)
                    if out[i, k] > OVERHANG), reverse=True)
    sides = ", ".join(f"{overhang:.3f} mm on the {side} side" for overhang, side in worst)
    ranges = ", ".join(f"{'XYZ'[k]} {part.bounds[0, k]:.3f} to {part.bounds[1, k]:.3f}" for k in range(3))
    raise SetupError(f"the part stands out of stock.box_mm by {sides}", code="stock_misses_part",
                     subjects=("stock.box_mm", *(side for _, side in worst)), measured=round(worst[0][0], 6), limit=0.0,
                     remedy=f"in the setup frame the part reaches over {ranges} mm; the box must hold that, or "
                            "placement.origin_mm be another")


def _check_fixtures(setup: Setup, part: Part) -> None:
    for number, fixture in enumerate(setup.fixtures):
        lower, upper = np.array(fixture.box_mm[0], dtype=np.float64), np.array(fixture.box_mm[1], dtype=np.float64)
        shrink = np.minimum(OVERHANG, 0.25 * (upper - lower))
        point = point_of_mesh_in_box(part.mesh, lower + shrink, upper - shrink)
        if point is not None:
            where = f"({', '.join(f'{x:.3f}' for x in point + 0.0)})"
            raise SetupError(f"fixtures[{number}] stands inside the part: the point {where} of the part is in its box",
                             code="fixture_in_part", subjects=(f"fixtures[{number}]", where),
                             measured=[round(float(x), 6) for x in point], limit=fixture.box_mm,
                             remedy="correct box_mm, which is in the setup frame, or placement.origin_mm; a fixture "
                                    "may touch the part, not enter it")
