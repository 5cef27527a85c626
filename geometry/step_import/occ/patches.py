"""Faces of a kernel solid -> NURBS surfaces over the rectangles of parameters they lie in."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_RectangularTrimmedSurface
from OCP.GeomAbs import GeomAbs_C1
from OCP.GeomAbs import GeomAbs_SurfaceType as Kind
from OCP.GeomConvert import GeomConvert, GeomConvert_ApproxSurface
from OCP.TopAbs import TopAbs_REVERSED

from geometry.mesh import F64
from geometry.setup_frame import SetupFrame
from geometry.step_import.face_surfaces import FaceSurface, no_such_face, patches_to_bytes
from geometry.step_import.occ.loading import load_solid
from geometry.step_import.occ.topology import Shape, faces_of
from geometry.surfaces.nurbs import NurbsSurface

# Angles among the parameters (u, v) of the surfaces that turn a line or an arc about their axis.
ANGULAR = {Kind.GeomAbs_Cylinder: (True, False), Kind.GeomAbs_Cone: (True, False), Kind.GeomAbs_Sphere: (True, True),
           Kind.GeomAbs_Torus: (True, True)}
# Longest arc between two knots (rad): its middle weight is a half.
LONGEST_ARC = 2.0 * np.pi / 3.0
# Other surfaces are approximated by splines: to this tolerance (mm) where this many spans suffice.
NEAR, MAX_SPANS, DEGREE = 1e-6, 400, 9
# Parameters of a patch that is measured, along each side.
LOOKS = 15


def load_patches(path: str | Path, *, placement: SetupFrame | None = None, solid: int | None = None,
                 fuse: bool = False, faces: Iterable[int] | None = None) -> bytes:
    """The work of ``geometry.step_import.face_surfaces.read_patches`` in this process, arguments as there.

    Returns the bytes ``patches_from_bytes`` reads.

    Raises
    ------
    GeometryError
        A face does not exist.
    StepError, PartError
        As ``load_solid``.
    """
    return patches_of(load_solid(path, solid, fuse).body, placement, faces)


def patches_of(body: Shape, placement: SetupFrame | None, faces: Iterable[int] | None) -> bytes:
    """``load_patches`` of a kernel solid, STEP coordinates (mm), that is loaded.

    Raises
    ------
    GeometryError
        A face does not exist.
    """
    shapes = faces_of(body)
    wanted = range(1, len(shapes) + 1) if faces is None else sorted(set(faces))
    for number in wanted:
        if not 1 <= number <= len(shapes):
            raise no_such_face(number, len(shapes))
    matrix = (placement or SetupFrame()).matrix
    return patches_to_bytes(_moved(face_patch(n, shapes[n - 1]), matrix) for n in wanted)


def face_patch(number: int, face: Shape) -> FaceSurface:
    """One kernel face as a patch, STEP coordinates (mm).

    number : int, 1-based
    face   : kernel face
    Returns FacePatch.
    """
    adaptor, whole = BRepAdaptor_Surface(face, False), BRep_Tool.Surface_s(face)
    box = _box(face, whole)
    side = -1 if face.Orientation() == TopAbs_REVERSED else 1
    angular = ANGULAR.get(adaptor.GetType(), (False, False))
    if angular[0]:
        surface = _turned(adaptor, box, side)
    else:
        trimmed = Geom_RectangularTrimmedSurface(whole, box[0, 0], box[1, 0], box[0, 1], box[1, 1])
        if adaptor.GetType() in (Kind.GeomAbs_OffsetSurface, Kind.GeomAbs_OtherSurface):
            spline = GeomConvert_ApproxSurface(trimmed, NEAR, GeomAbs_C1, GeomAbs_C1, DEGREE, DEGREE, MAX_SPANS,
                                               0).Surface()
        else:
            spline = GeomConvert.SurfaceToBSplineSurface_s(trimmed)
        surface = _surface(spline, box[0], side)
    patch = FaceSurface(number, surface, box, angular, 0.0)
    return replace(patch, deviation=_deviation(patch, adaptor))


def _box(face: Shape, whole: Shape) -> F64:
    """Parameters of the face: not beyond the surface, and not more than one period."""
    box = np.ascontiguousarray(np.array(BRepTools.UVBounds_s(face)).reshape(2, 2).T)
    limits = np.array(whole.Bounds()).reshape(2, 2).T
    turns = ((whole.IsUPeriodic, whole.UPeriod), (whole.IsVPeriodic, whole.VPeriod))
    for axis, (periodic, period) in enumerate(turns):
        if periodic():
            box[1, axis] = min(box[1, axis], box[0, axis] + period())
        else:
            box[:, axis] = np.clip(box[:, axis], limits[0, axis], limits[1, axis])
    return box


def _turned(exact: BRepAdaptor_Surface, box: F64, side: int) -> NurbsSurface:
    """Cylinder, cone, sphere or torus: an arc about the axis by a line or an arc in its half plane, homogeneous.

    The kernel's own conversion cannot begin a full turn at any angle; eight bores of a test part were 0.13 mm off.
    """
    kind = exact.GetType()
    if kind == Kind.GeomAbs_Cylinder:
        quadric = exact.Cylinder()
        radius = np.full(2, quadric.Radius())
        knots, line = _line(box[:, 1], radius, box[:, 1])
    elif kind == Kind.GeomAbs_Cone:
        quadric = exact.Cone()
        lean = quadric.SemiAngle()
        knots, line = _line(box[:, 1], quadric.RefRadius() + box[:, 1] * np.sin(lean), box[:, 1] * np.cos(lean))
    else:
        quadric, middle, small = ((exact.Sphere(), 0.0, exact.Sphere().Radius()) if kind == Kind.GeomAbs_Sphere else
                                  (exact.Torus(), exact.Torus().MajorRadius(), exact.Torus().MinorRadius()))
        knots, arc = _arc(*box[:, 1])
        line = np.column_stack([middle * arc[:, 2] + small * arc[:, 0], small * arc[:, 1], arc[:, 2]])
    knots_u, turn = _arc(*box[:, 0])
    about = quadric.Position()
    axes = np.array([way().Coord() for way in (about.XDirection, about.YDirection, about.Direction)])
    weights = np.outer(turn[:, 2], line[:, 2])
    flat = np.stack([np.outer(turn[:, 0], line[:, 0]), np.outer(turn[:, 1], line[:, 0]),
                     np.outer(turn[:, 2], line[:, 1])], axis=-1) / weights[..., None]
    orders = 3, 3 if ANGULAR[kind][1] else 2
    return NurbsSurface(flat @ axes + about.Location().Coord(), knots_u, knots, orders, weights, side)


def _arc(low: float, high: float) -> tuple[F64, F64]:
    """Knots and (n, 3) homogeneous control points (cos, sin, 1 at the knots) of an arc of the unit circle, order 3."""
    count = max(int(np.ceil((high - low) / LONGEST_ARC - 1e-9)), 1)
    at = np.linspace(low, high, 2 * count + 1)
    weight = np.where(np.arange(2 * count + 1) % 2, np.cos((high - low) / (2 * count)), 1.0)
    return (np.concatenate([[low], np.repeat(at[::2], 2), [high]]),
            np.column_stack([np.cos(at), np.sin(at), weight]))


def _line(ends: F64, radius: F64, height: F64) -> tuple[F64, F64]:
    return np.repeat(ends, 2), np.column_stack([radius, height, np.ones(2)])


def _surface(spline: Shape, low: F64, side: int) -> NurbsSurface:
    """Poles, weights and knots of a kernel spline; the knots, which may be off by a period, begin at ``low``."""
    spline.SetUNotPeriodic()
    spline.SetVNotPeriodic()
    n, m = spline.NbUPoles(), spline.NbVPoles()
    rows, columns = range(1, n + 1), range(1, m + 1)
    control = np.array([[spline.Pole(i, j).Coord() for j in columns] for i in rows])
    rational = spline.IsURational() or spline.IsVRational()
    weights = np.array([[spline.Weight(i, j) for j in columns] for i in rows]) if rational else None
    orders = spline.UDegree() + 1, spline.VDegree() + 1
    knots = []
    for axis, sequence in enumerate((spline.UKnotSequence(), spline.VKnotSequence())):
        values = np.array([sequence.Value(i) for i in range(1, sequence.Length() + 1)])
        knots.append(values + (low[axis] - values[orders[axis] - 1]))
    return NurbsSurface(control, knots[0], knots[1], orders, weights, side)


def _deviation(patch: FaceSurface, exact: BRepAdaptor_Surface) -> float:
    ways = [np.linspace(patch.box[0, axis], patch.box[1, axis], LOOKS) for axis in (0, 1)]
    uv = np.stack(np.meshgrid(*ways, indexing="ij"), axis=-1).reshape(-1, 2)
    there = np.array([exact.Value(u, v).Coord() for u, v in uv.tolist()])
    return float(np.linalg.norm(patch.surface.points(patch.parameters(uv)) - there, axis=1).max())


def _moved(patch: FaceSurface, matrix: F64) -> FaceSurface:
    return replace(patch, surface=patch.surface.moved(matrix))
