"""Path curves of both STEP-NC forms: polylines, arcs of circles, and sequences of them.

An arc is read like a G2 or G3 (``verify.program.arc_chords``): as chords that leave it by 0.001 mm at most.
"""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64
from verify.program.arc_chords import ArcError, arc_points
from verify.stepnc.attribute_checks import FLAG, LOGICAL, Checked, Either, Many, Named, OneOf, Real, Table, Text, To

CURVES = ("POLYLINE", "TRIMMED_CURVE", "COMPOSITE_CURVE")
FLAT, JOIN = 1e-3, 1e-6
"""mm: an end of an arc off its circle; a gap between two segments."""
_TRIM = Many(Either((To(("CARTESIAN_POINT",)), Named((("PARAMETER_VALUE", Real()),)))), 1, 2)

CURVE_TABLE: Table = {
    "TRIMMED_CURVE": (
        ("name", Text()), ("basis_curve", To(("CIRCLE",))), ("trim_1", _TRIM), ("trim_2", _TRIM),
        ("sense_agreement", FLAG), ("master_representation", OneOf(("CARTESIAN", "UNSPECIFIED")))),
    "CIRCLE": (("name", Text()), ("position", To(("AXIS2_PLACEMENT_3D",))), ("radius", Real(0.0))),
    "COMPOSITE_CURVE": (("name", Text()), ("segments", Many(To(("COMPOSITE_CURVE_SEGMENT",)), 1)),
                        ("self_intersect", LOGICAL)),
    "COMPOSITE_CURVE_SEGMENT": (
        ("transition", OneOf(("DISCONTINUOUS", "CONTINUOUS", "CONT_SAME_GRADIENT",
                              "CONT_SAME_GRADIENT_SAME_CURVATURE"))),
        ("same_sense", FLAG), ("parent_curve", To(("POLYLINE", "TRIMMED_CURVE")))),
}


def curve_points(data: Checked, number: int, scale: float = 1.0) -> tuple[F64, F64]:
    """Points of a curve and their lines in the file; points of an arc have the line of the arc.

    scale : mm in the unit of the file

    Returns (n, 3) float64, mm, frame of the file, and (n,) float64, index, 1-based lines.
    Raises ProgramError where segments do not join, or an arc has no such points.
    """
    entity = data.get(number, *CURVES)[0]
    if entity == "POLYLINE":
        return data.curve(number, scale)
    if entity == "TRIMMED_CURVE":
        return _arc(data, number, scale)
    points: list[F64] = []
    lines: list[F64] = []
    for segment in data.refs(number, entity, "segments"):
        parent = data.ref(segment, "COMPOSITE_CURVE_SEGMENT", "parent_curve")
        p, at = curve_points(data, parent, scale)
        if data.one(segment, "COMPOSITE_CURVE_SEGMENT", "same_sense") == "F":
            p, at = p[::-1], at[::-1]
        if points:
            gap = float(np.abs(p[0] - points[-1][-1]).max())
            if gap > JOIN:
                raise data.file.error(segment, f", parent_curve: begins {gap:g} mm from the end of the segment before",
                                      number)
            p, at = p[1:], at[1:]
        points.append(p)
        lines.append(at)
    return np.concatenate(points), np.concatenate(lines)


def _arc(data: Checked, number: int, scale: float) -> tuple[F64, F64]:
    entity, file = "TRIMMED_CURVE", data.file
    circle = data.ref(number, entity, "basis_curve")
    place = data.placement(data.ref(circle, "CIRCLE", "position"), scale)
    radius = scale * (data.real(circle, "CIRCLE", "radius") or 0.0)
    ends = []
    for trim in ("trim_1", "trim_2"):
        found = [int(v) for v in data.refs(number, entity, trim)]
        if len(found) != 1:
            raise file.error(number, f", {trim}: one CARTESIAN_POINT expected; parameters are not read")
        ends.append(data.point(found[0], scale))
    local = [(p - place[:3, 3]) @ place[:3, :3] for p in ends]
    for trim, p in zip(("trim_1", "trim_2"), local, strict=True):
        off = max(abs(float(p[2])), abs(float(np.hypot(p[0], p[1])) - radius))
        if not off <= FLAT:
            raise file.error(number, f", {trim}: a point on the circle expected, it is {off:g} mm off", circle)
    clockwise = data.one(number, entity, "sense_agreement") == "F"
    try:
        rows = arc_points(local[0], local[1], np.zeros(2), clockwise, (0, 1, 2))
    except ArcError as problem:
        raise file.error(number, f": {problem}", circle) from None
    there = rows @ place[:3, :3].T + place[:3, 3]
    there[-1] = ends[1]
    line = float(file.line(number))
    return np.vstack([ends[0], there]), np.full(len(there) + 1, line)


__all__ = ["CURVES", "CURVE_TABLE", "curve_points"]
