"""Outward normals of the exact faces at the corners of a mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_REVERSED

from geometry.mesh import F64, I32
from geometry.step_import.occ.topology import Shape

# Derivatives shorter than this (mm, the confusion distance of the kernel) or more parallel than this give no normal.
SHORTEST, PARALLEL = 1e-7, 1e-6
# At a singular point (pole, tip of a cone) the normal is taken this share of the way to the other corners.
ASIDE = 1e-2


def corner_normals(shapes: list[Shape], ids: I32, uv: F64) -> F64:
    """Normals of the surfaces at the corners of triangles [DoCarmo1976].

    shapes : kernel faces in order
    ids    : (m,) int32, index, 1-based, of the face of every triangle
    uv     : (m, 3, 2) float64, rad, mm or dimensionless, surface parameters of the corners

    Returns (m, 3, 3) float64, dimensionless, out of the material, in the frame of the shapes. At a singular point every
    triangle has its own normal, that of the surface just beside the point; NaN where that does not exist either.
    """
    out = np.full((len(ids), 3, 3), np.nan)
    order = np.argsort(ids, kind="stable")
    cuts = np.searchsorted(ids[order], np.arange(1, len(shapes) + 2))
    for k, shape in enumerate(shapes):
        rows = order[cuts[k]:cuts[k + 1]]
        if not len(rows):
            continue
        surface, corners = BRepAdaptor_Surface(shape, False), uv[rows]
        own, place = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
        normals, still = _across(surface, own)
        found = normals[place.reshape(-1)].reshape(-1, 3, 3)
        row, corner = np.nonzero(np.isnan(found[:, :, 0]))
        if len(row):
            here = corners[row, corner]
            way = 0.5 * (corners[row].sum(axis=1) - here) - here
            # along a collapsed side the parameter of the node has no meaning; that of the other corners is taken
            share = np.where(still[place.reshape(-1)].reshape(-1, 3, 2)[row, corner], 1.0, ASIDE)
            found[row, corner] = _across(surface, here + share * way)[0]
        out[rows] = -found if shape.Orientation() == TopAbs_REVERSED else found
    return out


def _across(surface: BRepAdaptor_Surface, uv: F64) -> tuple[F64, NDArray[np.bool_]]:
    """Unit vectors (n, 3) along u x v at parameters (n, 2), NaN where singular, and vanishing derivatives, (n, 2)."""
    ways = np.empty((len(uv), 2, 3))
    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    for row, (u, v) in enumerate(uv.tolist()):
        surface.D1(u, v, point, along_u, along_v)
        ways[row] = along_u.Coord(), along_v.Coord()
    length = np.linalg.norm(ways, axis=2)
    still = length < SHORTEST
    out = np.cross(ways[:, 0], ways[:, 1])
    size = np.linalg.norm(out, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        out /= size[:, None]
    out[still.any(axis=1) | (size < PARALLEL * length.prod(axis=1))] = np.nan
    return out, still
