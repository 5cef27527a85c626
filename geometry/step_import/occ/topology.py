"""Shared look-ups on kernel shapes, in the frame of the shape."""

from __future__ import annotations

from typing import Any

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_ShapeEnum, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedMapOfShape

from geometry.mesh import F64

# The kernel's Python binding carries no types; ``Any`` stands for its handles here.
Shape = Any


def sub_shapes(shape: Shape, kind: TopAbs_ShapeEnum) -> list[Shape]:
    """Distinct sub-shapes of one kind, in the order the kernel's explorer meets them (order of the file)."""
    found = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, found)
    return [found.FindKey(i + 1) for i in range(found.Extent())]


def faces_of(shape: Shape) -> list[Shape]:
    """Faces in order; index 0 is face F1."""
    return [TopoDS.Face_s(f) for f in sub_shapes(shape, TopAbs_FACE)]


def solids_of(shape: Shape) -> list[Shape]:
    """Solids in order."""
    return [TopoDS.Solid_s(s) for s in sub_shapes(shape, TopAbs_SOLID)]


def shells_of(shape: Shape) -> list[Shape]:
    """Shells in order."""
    return [TopoDS.Shell_s(s) for s in sub_shapes(shape, TopAbs_SHELL)]


def edges_of(shape: Shape) -> list[Shape]:
    """Edges in order, each once whatever its orientation."""
    return [TopoDS.Edge_s(e) for e in sub_shapes(shape, TopAbs_EDGE)]


def box_of(shape: Shape) -> F64:
    """(2, 3) float64, mm, frame of the shape: a box that holds it; free-form faces may leave some room in it."""
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    return _corners(box)


def _corners(box: Bnd_Box) -> F64:
    if box.IsVoid():
        return np.zeros((2, 3))
    x0, y0, z0, x1, y1, z1 = box.Get()
    return np.array([[x0, y0, z0], [x1, y1, z1]])


def quick_box(shape: Shape) -> F64:
    """(2, 3) float64, mm, frame of the shape: a box from poles and knots, never too small, often too large."""
    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, False)
    return _corners(box)


def volume_of(shape: Shape) -> float:
    """Enclosed volume, mm³, by a fast fixed rule; negative when the shape is inside out."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    return float(properties.Mass())


def exact_volume(shape: Shape) -> float:
    """Enclosed volume, mm³, integrated until its estimated relative error is below 1e-5.

    The fixed rule of ``volume_of`` is faster; its error on a spline wall of known volume is 0.04 %.
    """
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, 1e-5, True)
    return float(properties.Mass())


def area_of(shape: Shape) -> float:
    """Surface area, mm², integrated until its estimated relative error is below 1e-4."""
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(shape, properties, 1e-4)
    return float(properties.Mass())


def length_of(shape: Shape) -> float:
    """Length of all edges, mm."""
    properties = GProp_GProps()
    BRepGProp.LinearProperties_s(shape, properties)
    return float(properties.Mass())
