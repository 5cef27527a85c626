"""Whether the edges of a solid lie on their faces and end at their vertices, as the file states it.

A damaged number in a file (the radius of a cylinder, a coordinate) leaves a body whose topology is closed, but whose
faces no longer meet. The kernel reads it without a word: it widens the tolerance of the edge to whatever the gap is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import TopoDS

from geometry.errors import PartError
from geometry.mesh import F64
from geometry.step_import.occ.deviation import distance_near, elementary_distances
from geometry.step_import.occ.topology import Shape, box_of, faces_of

SAMPLES = 9  # places on each edge, its ends included
# A gap counts where it exceeds this and ten times the uncertainty that the file states.
TOLD_ABOVE = 0.01
# Gaps of files that shops plan: up to 0.06 mm. Beyond this (mm, or a share of the diagonal of a small part), or ten
# times the uncertainty of the file, the body is not the one that its topology says.
REFUSED_ABOVE, REFUSED_SHARE = 0.1, 0.01
UNCERTAINTIES = 10.0
SHOWN = 10


@dataclass(frozen=True)
class Gap:
    """A place where an edge is off. face : number, from 1; size : mm; point : mm, STEP coordinates; what : in words."""

    face: int
    size: float
    point: tuple[float, float, float]
    what: str


def check_edges(solid: Shape, uncertainty: float, warnings: list[str]) -> None:
    """Refuse a solid whose edges lie far off their faces or vertices, and warn where they lie somewhat off.

    solid       : kernel solid, mm, before any repair
    uncertainty : mm, that the file states; 0 where it states none
    warnings    : a sentence is appended where edges are off by less than is refused

    Raises PartError (``inconsistent_faces``).
    Notes   Each edge is measured at nine places. An error inside of a face, which moves no edge, cannot be seen.
    """
    told = max(TOLD_ABOVE, UNCERTAINTIES * uncertainty)
    gaps = sorted(_gaps(solid, told), key=lambda g: -g.size)
    if not gaps:
        return
    worst = gaps[0]
    low, high = box_of(solid)
    limit = max(told, min(REFUSED_ABOVE, REFUSED_SHARE * float(np.linalg.norm(high - low))))
    faces = tuple(dict.fromkeys(f"F{g.face}" for g in gaps if worst.size <= limit or g.size > limit))
    place = "(" + ", ".join(f"{round(x, 3) + 0.0:.6g}" for x in worst.point) + ")"
    others = f" ({len(faces)} faces are concerned)" if len(faces) > 1 else ""
    text = f"{worst.what} F{worst.face} by {worst.size:.4g} mm at {place} in STEP coordinates{others}"
    if worst.size > limit:
        raise PartError(f"the faces of the part do not meet: {text}", code="inconsistent_faces", subjects=faces[:SHOWN],
                        measured=worst.size, limit=limit,
                        remedy="a number in the file is damaged, or the CAD system exported other faces than it shows: "
                               "check these faces there and export the part again")
    warnings.append(f"the faces of the part do not meet exactly: {text}; the CAD kernel closes the gap")


def _gaps(solid: Shape, above: float) -> Iterator[Gap]:
    """Places where edges are farther off a face or a vertex than ``above`` mm, the largest of each use of an edge."""
    for number, face in enumerate(faces_of(solid), 1):
        surface = BRepAdaptor_Surface(face, True)
        explorer = TopExp_Explorer(face, TopAbs_EDGE)
        while explorer.More():
            edge = TopoDS.Edge_s(explorer.Current())
            explorer.Next()
            if BRep_Tool.Degenerated_s(edge):
                continue
            curve = BRepAdaptor_Curve(edge)
            values = np.linspace(curve.FirstParameter(), curve.LastParameter(), SAMPLES)
            points = np.array([curve.Value(t).Coord() for t in values.tolist()])
            off = _off_surface(face, surface, edge, values, points, above)
            yield from _largest(number, off, points, "an edge lies off", above)
            ends = [v for v in (TopExp.FirstVertex_s(edge), TopExp.LastVertex_s(edge)) if not v.IsNull()]
            if len(ends) == 2:
                corners = np.array([BRep_Tool.Pnt_s(v).Coord() for v in ends])
                apart = np.linalg.norm(corners - points[[0, -1]], axis=1)
                yield from _largest(number, apart, corners, "an edge ends off its corner on", above)


def _largest(number: int, off: F64, points: F64, what: str, above: float) -> Iterator[Gap]:
    k = int(np.argmax(off))
    if off[k] > above:
        x, y, z = points[k].tolist()
        yield Gap(number, float(off[k]), (x, y, z), what)


def _off_surface(face: Shape, surface: BRepAdaptor_Surface, edge: Shape, values: F64, points: F64,
                 above: float) -> F64:
    """Distances of places on an edge, (n, 3) mm, from the surface of a face, (n,) mm.

    values : (n,) float64, dimensionless, parameters of the places; above : mm, shorter distances are bounds
    """
    exact = elementary_distances(surface, points)
    if exact is not None:
        return exact
    curve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
    if curve is None:
        return np.zeros(len(points))
    out = np.zeros(len(points))
    for row, value in enumerate(values.tolist()):
        u, v = curve.Value(value).Coord()
        out[row] = np.linalg.norm(points[row] - surface.Value(u, v).Coord())
        if out[row] > above:
            out[row] = distance_near(surface, points[row].tolist(), np.array([u, v]))
    return out
