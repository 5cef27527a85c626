"""Places between the outermost samples of an area and the border up to which the tool touches it.

Samples end up to a spacing inside the border of what a tool reaches. Passes that keep their tolerance at the samples
may leave more beyond them, since the scallop grows with the square of the distance from a pass. So an area gets places
of its own there, which passes have to serve as well. A fine lattice round the outermost samples finds where the tool
touches, and the border of that is kept. Places are in mm, access frame.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.mesh import F64
from geometry.mesh_queries.drop import drop_contacts
from toolpath.passes.pass_family import I64, FinishTarget
from zones.reach.tip_field import TipField, touchable

NEAR = 2.5  # spacings: neighbours of a sample are so near, about twenty of them
OPEN = np.radians(135.0)  # a sample with no neighbour over this angle is at the border
FAR = 1.5  # spacings: how far out the border is searched
SERVED = 0.4  # spacings: places nearer to a sample than this are left to it
OWN = 0.1  # mm per mm a place may be off the plane through its sample and still be of the same surface
FINEST, COARSEST = 0.125, 0.25  # spacings: nodes of the lattice are so far apart
THIN = 0.5  # spacings between the places kept, about


def beyond(field: TipField, target: FinishTarget, lift: float, apart: float = 0.0,
           faces: Collection[int] | None = None) -> FinishTarget:
    """Places farther out than the outermost samples, up to where the tool as a whole no longer touches the surface.

    field  : TipField of the tool
    target : FinishTarget, n_z > 0
    lift   : mm, distance along the normal within which a touch counts
    apart  : mm, required precision of the border; between FINEST and COARSEST of the spacing is taken
    faces  : B-rep faces of the area, on which alone places lie; all where None

    Returns
    -------
    FinishTarget
        About ``THIN`` spacings apart; empty where the area ends at an edge or a wall.
    """
    none = target.subset(np.zeros(0, np.int64))
    if not len(target.points):
        return none
    s = target.spacing
    step = min(max(apart, FINEST * s), COARSEST * s)
    rim = target.points[_rim(target.points, NEAR * s), :2]
    if not len(rim):
        return none
    node = _nodes(rim, step, FAR * s + 2.0 * step)  # two more, so that every node up to FAR has its neighbours
    distance, nearest = cKDTree(target.points[:, :2]).query(node * step)
    free = np.flatnonzero((distance > SERVED * s) & (distance <= FAR * s))
    xy, near, normals = (node * step)[free], target.points[nearest[free]], target.normals[nearest[free]]
    ground = drop_contacts(field.tree, xy, 0.0, 0.0)
    level = near[:, 2] - ((xy - near[:, :2]) * normals[:, :2]).sum(axis=1) / normals[:, 2]
    own = np.abs(ground.z - level) <= OWN * distance[free]
    if faces is not None:
        own &= np.isin(field.tree.mesh.face_ids[ground.triangle], list(faces))
    k = np.flatnonzero(own)
    places, normals = np.column_stack([xy, ground.z])[k], normals[k]
    _, whole, tips = touchable(field, places, normals, lift)
    inside = distance <= SERVED * s
    inside[free[k[whole]]] = True
    kept = np.flatnonzero(whole & ~_surrounded(node, inside)[free[k]])
    kept = kept[cKDTree(rim).query(places[kept, :2])[0] <= FAR * s]
    _, first = np.unique(np.floor(places[kept, :2] / (THIN * s)).astype(np.int64), axis=0, return_index=True)
    kept = kept[np.sort(first)]
    return FinishTarget(places[kept], normals[kept], tips[kept], s)


def _rim(points: F64, near: float) -> I64:
    """Samples at the border of an area in plan: with no other within ``near`` mm over an angle of ``OPEN``."""
    pairs = cKDTree(points).query_pairs(near, output_type="ndarray").astype(np.int64).reshape(-1, 2)
    a, b = np.vstack([pairs, pairs[:, ::-1]]).T
    away = points[b, :2] - points[a, :2]
    apart = np.hypot(*away.T) > 1e-6 * near
    a, angle = a[apart], np.arctan2(away[apart, 1], away[apart, 0])
    alone = np.setdiff1d(np.arange(len(points)), a)
    if not len(a):
        return alone
    order = np.lexsort((angle, a))
    a, angle = a[order], angle[order]
    last = np.concatenate([np.diff(a) != 0, [True]])
    first = np.flatnonzero(np.concatenate([[True], last[:-1]]))
    after = np.concatenate([angle[1:], [0.0]])
    after[last] = angle[first] + 2.0 * np.pi
    return np.union1d(a[after - angle > OPEN], alone)


def _nodes(xy: F64, step: float, far: float) -> I64:
    """Nodes (m, 2) of the lattice of multiples of ``step`` within ``far`` mm of places (n, 2), each once."""
    n = int(np.ceil(far / step))
    disc = np.stack(np.meshgrid(np.arange(-n, n + 1), np.arange(-n, n + 1), indexing="ij"), -1).reshape(-1, 2)
    disc = disc[np.hypot(*disc.T) * step <= far]
    cells = np.unique(np.round(xy / step).astype(np.int64), axis=0)
    return np.unique((cells[:, None, :] + disc).reshape(-1, 2), axis=0)


def _surrounded(node: I64, inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(n,) bool: of nodes (n, 2), in order, those whose eight neighbours are all ``inside``."""
    low, wide = node.min(axis=0) - 1, int(np.ptp(node[:, 1])) + 3
    key = (node[:, 0] - low[0]) * wide + node[:, 1] - low[1]
    known = key[inside]
    out = np.ones(len(node), np.bool_)
    for i, j in ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)):
        out &= np.isin(key + i * wide + j, known, assume_unique=True)
    return out
