"""Where bodies of a file overlap, and where they only touch.

The kernel splits the bodies at each other and keeps common pieces once. Two bodies overlap where they share a piece of
material. They touch where they share no material, but a face, an edge or a vertex of their pieces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from OCP.BOPAlgo import BOPAlgo_PaveFiller
from OCP.BRep import BRep_Tool
from OCP.BRepAlgoAPI import BRepAlgoAPI_BuilderAlgo
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_ShapeEnum, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedMapOfShape, TopTools_ListOfShape

from geometry.mesh import F64
from geometry.step_import.occ.topology import Shape, sub_shapes

# Bodies nearer than this count as one; well above the kernel's 1e-7, well below any cutting tolerance.
FUSE_TOLERANCE = 1e-4


class Share(IntEnum):
    """The most that two bodies have in common."""

    POINT = 0
    LINE = 1
    FACE = 2
    MATERIAL = 3


LEVELS: tuple[tuple[Share, TopAbs_ShapeEnum], ...] = (
    (Share.MATERIAL, TopAbs_SOLID), (Share.FACE, TopAbs_FACE), (Share.LINE, TopAbs_EDGE), (Share.POINT, TopAbs_VERTEX))


@dataclass(frozen=True, eq=False)
class Meeting:
    """Two bodies that have something in common.

    first, second : index of the bodies, first < second
    share         : the most that they share
    place         : (3,) float64, mm, STEP coordinates, the middle of what they share
    """

    first: int
    second: int
    share: Share
    place: F64


def box_groups(boxes: Sequence[F64]) -> list[list[int]]:
    """Bodies whose boxes overlap in groups: lists of their index, in order of the first.

    boxes : (2, 3) float64 each, mm, STEP coordinates
    """
    left, groups = list(range(len(boxes))), []
    while left:
        group, todo = [left[0]], [left.pop(0)]
        while todo:
            here = boxes[todo.pop()]
            near = [i for i in left if boxes_meet(boxes[i], here)]
            left = [i for i in left if i not in near]
            group += near
            todo += near
        groups.append(sorted(group))
    return groups


def boxes_meet(one: F64, other: F64) -> bool:
    """Whether two boxes overlap or come nearer than ``FUSE_TOLERANCE``.

    one, other : (2, 3) float64, mm, frame of the file, least and greatest corner
    """
    return bool((one[0] <= other[1] + FUSE_TOLERANCE).all() and (other[0] <= one[1] + FUSE_TOLERANCE).all())


def split_bodies(bodies: Sequence[Shape]) -> BOPAlgo_PaveFiller:
    """Where bodies intersect, as the kernel keeps it for all that is made of them. bodies : kernel solids, mm.

    The caller keeps it as long as anything is made with it.
    """
    found = BOPAlgo_PaveFiller()
    given = TopTools_ListOfShape()
    for body in bodies:
        given.Append(body)
    found.SetArguments(given)
    found.SetFuzzyValue(FUSE_TOLERANCE)
    found.SetNonDestructive(True)
    found.Perform()
    return found


def meetings(bodies: Sequence[Shape], split: BOPAlgo_PaveFiller) -> list[Meeting]:
    """The pairs of bodies that overlap or touch, in order; empty where the kernel could not split them.

    bodies : kernel solids, mm
    split  : of ``split_bodies``

    Notes
    -----
    Gaps below 1e-4 mm count as touching. An overlap thinner than that counts as a face in common.
    """
    tool = BRepAlgoAPI_BuilderAlgo(split)
    given = TopTools_ListOfShape()
    for body in bodies:
        given.Append(body)
    tool.SetArguments(given)
    tool.Build()
    if not tool.IsDone():
        return []
    pieces = [_pieces(tool, body) for body in bodies]
    out: dict[tuple[int, int], Meeting] = {}
    for share, kind in LEVELS:
        known = TopTools_IndexedMapOfShape()
        owners: dict[int, list[int]] = {}
        for k, own in enumerate(pieces):
            for number in {known.Add(s) for piece in own for s in sub_shapes(piece, kind)}:
                owners.setdefault(number, []).append(k)
        common: dict[tuple[int, int], list[Shape]] = {}
        for number in sorted(owners):
            users = owners[number]
            for i, first in enumerate(users):
                for second in users[i + 1:]:
                    common.setdefault((first, second), []).append(known.FindKey(number))
        for pair in sorted(common.keys() - out.keys()):
            out[pair] = Meeting(*pair, share, _middle(common[pair], share))
    return [out[pair] for pair in sorted(out)]


def _pieces(tool: BRepAlgoAPI_BuilderAlgo, body: Shape) -> list[Shape]:
    parts = list(tool.Modified(body))
    return parts if parts or tool.IsDeleted(body) else [body]


def _middle(shapes: Sequence[Shape], share: Share) -> F64:
    """Centre of mass of what two bodies share, (3,) float64, mm; the first point where it has no size."""
    if share is Share.POINT:
        return np.array(BRep_Tool.Pnt_s(TopoDS.Vertex_s(shapes[0])).Coord())
    measure = {Share.MATERIAL: BRepGProp.VolumeProperties_s, Share.FACE: BRepGProp.SurfaceProperties_s,
               Share.LINE: BRepGProp.LinearProperties_s}[share]
    total, weight = np.zeros(3), 0.0
    for shape in shapes:
        properties = GProp_GProps()
        measure(shape, properties)
        mass = abs(float(properties.Mass()))
        total, weight = total + mass * np.array(properties.CentreOfMass().Coord()), weight + mass
    return np.asarray(total / weight) if weight > 0.0 else np.zeros(3)
