"""Single touches at places that no pass has finished although the tool reaches them."""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64
from toolpath.lines import Line
from toolpath.passes.contours import moves_free
from zones.reach.tip_field import LEVEL_TOLERANCE, TipField

MAX_PLACES = 400  # a zone with more is not just missing a few spots
APART = 0.1  # mm, places nearer than this are one
SHORT = 0.02  # mm, length of a touch


def touches(field: TipField, tips: F64) -> list[Line]:
    """Short level moves that end on tips which touch the residual.

    field : TipField
    tips  : (n, 3) float64, mm, access frame, admissible

    Returns
    -------
    list of Line
        One for every place, at most ``MAX_PLACES``; a place with no free direction is left out.
    """
    out: list[Line] = []
    _, first = np.unique(np.round(tips / APART).astype(np.int64), axis=0, return_index=True)
    around = np.array([[np.cos(a), np.sin(a), 0.0] for a in np.arange(12) * np.pi / 6]) * SHORT
    for tip in tips[np.sort(first)[:MAX_PLACES]]:
        starts = tip + around
        at = starts + np.array([0.0, 0.0, LEVEL_TOLERANCE])
        free = np.flatnonzero(~(field.blocked_by_cutter(at) | field.blocked_by_body(at)))
        for k in free:
            line = np.vstack([starts[k], tip])
            if moves_free(field, line).all():
                out.append(Line(line, False))
                break
    return out
