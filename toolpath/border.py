"""Places between the outermost samples of an area and the border up to which the tool touches it.

Samples stand up to a spacing inside the border of what a tool reaches, and passes that keep their promise at the
samples may leave more beyond them: beside a pass the scallop grows with the square of the distance. So an area is
given places of its own out there, which passes have to serve as well.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.drop import drop_tips
from geometry.mesh import F64
from toolpath.family import Target
from zones.reach import TipField, touchable

NEAR = 2.5  # spacings: neighbours of a sample are so near, about twenty of them
OPEN = np.radians(135.0)  # a sample with no neighbour over this angle is at the border
SHARES = (1.5, 1.0, 0.5, 0.25)  # spacings, how far out a place is looked for
OWN = 0.1  # mm per mm a place may be off the plane through its sample and still be of the same surface


def beyond(field: TipField, target: Target, lift: float) -> Target:
    """Places farther out than the outermost samples, as far as the tool as a whole still touches the same surface.

    field  : TipField of the tool
    target : Target, n_z > 0
    lift   : mm, distance along the normal within which a touch counts

    Returns
    -------
    Target
        No place where the area ends at an edge or a wall.
    """
    rim, way = _outwards(target.points, NEAR * target.spacing)
    out = target.subset(np.zeros(0, np.int64))
    for share in SHARES:
        if not len(rim):
            break
        far = share * target.spacing
        points, normals = target.points[rim], target.normals[rim]
        xy = points[:, :2] + far * way
        height = drop_tips(field.tree, xy, 0.0, 0.0)
        level = points[:, 2] - far * (normals[:, :2] * way).sum(axis=1) / normals[:, 2]
        own = np.flatnonzero(np.abs(height - level) <= OWN * far)
        places = np.column_stack([xy, height])[own]
        _, whole, tips = touchable(field, places, normals[own], lift)
        out = out.joined(Target(places[whole], normals[own][whole], tips[whole], target.spacing))
        left = np.ones(len(rim), np.bool_)
        left[own[whole]] = False
        rim, way = rim[left], way[left]
    return out


def _outwards(points: F64, near: float) -> tuple[NDArray[np.int64], F64]:
    """Samples (k,) at the border of an area in plan, and (k, 2) unit, the middle of what is open beside each."""
    pairs = cKDTree(points).query_pairs(near, output_type="ndarray").astype(np.int64)
    a, b = np.vstack([pairs, pairs[:, ::-1]]).T
    away = points[b, :2] - points[a, :2]
    angle = np.arctan2(away[:, 1], away[:, 0])
    order = np.lexsort((angle, a))
    a, angle = a[order], angle[order]
    if not len(a):
        return np.zeros(0, np.int64), np.zeros((0, 2))
    last = np.concatenate([np.diff(a) != 0, [True]])
    first = np.flatnonzero(np.concatenate([[True], last[:-1]]))
    after = np.concatenate([angle[1:], [0.0]])
    after[last] = angle[first] + 2.0 * np.pi
    gap = after - angle
    widest = np.lexsort((gap, a))[last]
    widest = widest[gap[widest] > OPEN]
    middle = angle[widest] + 0.5 * gap[widest]
    return a[widest], np.column_stack([np.cos(middle), np.sin(middle)])
