"""The part seen along one access direction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.part import Part
from geometry.sampling import SurfaceSamples
from zones.plan_view.regions import Labels, RegionLocator
from zones.reach.tip_field import TipField

ALONG_X = 0.999999  # |d·x| above: the access looks along X, so its x axis comes from Y


def access_rotation(direction: ArrayLike) -> F64:
    """Rotation into the frame of an access direction.

    direction : (3,) float64, dimensionless, tool tip to spindle, in the setup frame; any length but zero
    Returns (3, 3) float64, dimensionless. Its rows are the axes of the access frame in the setup frame: z is the
    direction, x the component of the setup's X square to it (of its Y where the direction runs along X). The origin
    does not move.

    >>> access_rotation([0, 0, -1]).tolist()
    [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
    """
    z = np.asarray(direction, dtype=np.float64)
    z = z / np.linalg.norm(z)
    x = np.array([0.0, 1.0, 0.0] if abs(z[0]) > ALONG_X else [1.0, 0.0, 0.0])
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(z, x), z]) + 0.0


def turned(part: Part, rotation: F64) -> Part:
    """The part in another frame with the same origin: points p (mm) become ``rotation @ p``.

    rotation : (3, 3) float64, dimensionless, its rows the axes of the new frame
    """
    if np.array_equal(rotation, np.eye(3)):
        return part
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    mesh = part.mesh.transformed(matrix)
    edges = tuple(replace(e, points=np.asarray(e.points @ rotation.T)) for e in part.edges)
    return replace(part, mesh=mesh, edges=edges, bounds=mesh.bounds)


def turned_samples(samples: SurfaceSamples, rotation: F64) -> SurfaceSamples:
    """The samples (mm) in another frame with the same origin.

    rotation : (3, 3) float64, dimensionless, its rows the axes of the new frame
    """
    if np.array_equal(rotation, np.eye(3)):
        return samples
    return replace(samples, points=np.ascontiguousarray(samples.points @ rotation.T),
                   normals=np.ascontiguousarray(samples.normals @ rotation.T))


@dataclass(frozen=True, eq=False)
class View:
    """One access direction with its part, samples, regions and tip fields; mm, access frame (+Z to the spindle).

    id       : 'A1'
    rotation : (3, 3) float64, setup frame -> access frame
    part     : Part; obstacles : TriangleTree of part and fixtures; tree : of the part alone
    samples  : SurfaceSamples of the machinable area, the same rows in every view
    labels   : their regions
    fields   : TipField by tool id
    locator  : RegionLocator for other points
    first    : (3, 3) float64, rotation of the first view, whose channels the locator uses
    """

    id: str
    rotation: F64
    part: Part
    tree: TriangleTree
    obstacles: TriangleTree
    samples: SurfaceSamples
    labels: Labels
    fields: Mapping[str, TipField]
    locator: RegionLocator
    first: F64

    def label(self, samples: SurfaceSamples) -> Labels:
        """Regions of other samples, given in this frame."""
        turn = self.rotation @ self.first.T  # turns rows of points into the setup frame and then into the first
        there = None if self.is_first else (np.asarray(samples.points @ turn), np.asarray(samples.normals @ turn))
        return self.locator.of(samples.points, samples.normals, samples.face, there)

    @property
    def direction(self) -> F64:
        """(3,) float64, dimensionless, the tool axis in the setup frame."""
        return np.asarray(self.rotation[2])

    @property
    def is_first(self) -> bool:
        """Whether this is the first access, whose frame is that of the decomposition."""
        return bool(np.array_equal(self.rotation, self.first))

    def into(self, vectors: F64) -> F64:
        """Points or directions of the setup frame in the access frame.

        vectors : (n, 3) float64, mm or dimensionless, setup frame

        Returns (n, 3) float64, mm or dimensionless, access frame.
        """
        return np.asarray(vectors @ self.rotation.T)

    def back(self, vectors: F64) -> F64:
        """Points or directions of the access frame in the setup frame.

        vectors : (n, 3) float64, mm or dimensionless, access frame

        Returns (n, 3) float64, mm or dimensionless, setup frame.
        """
        return np.asarray(vectors @ self.rotation)
