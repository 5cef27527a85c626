"""Obstacles above samples, and the reach of the tools over the part alone, without fixtures. Access frame."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.rays import first_hits
from geometry.sampling import SurfaceSamples
from zones.lattice import lattice_step
from zones.machinable_area import SEEN
from zones.reach.assembly import Clearances
from zones.reach.tip_field import DiscHeights, TipField

SKIN = 0.02  # mm off the surface where a ray upward starts
AIR = 4.0  # mm beside the part, beyond the cutter's radius


def above(samples: SurfaceSamples, tree: TriangleTree) -> NDArray[np.int64]:
    """(n,) int64, index: the lowest triangle of the tree above each sample, -1 where none is; access frame."""
    hit = first_hits(tree, samples.points + SKIN * samples.normals, (0.0, 0.0, 1.0), 1e-4, 1e6)[1]
    return hit.astype(np.int64)


def covered(samples: SurfaceSamples, tree: TriangleTree) -> NDArray[np.bool_]:
    """(n,) bool: a triangle of the tree lies above the sample; access frame."""
    return above(samples, tree) >= 0


def in_sight(samples: SurfaceSamples, tree: TriangleTree) -> NDArray[np.bool_]:
    """(n,) bool: the sample faces the access, and no triangle of the tree lies above it; access frame."""
    return np.asarray((samples.normals[:, 2] > SEEN) & ~covered(samples, tree))


def over_the_part(fields: Mapping[str, TipField], bare: TriangleTree, bounds: F64,
                  clear: Clearances) -> dict[str, TipField]:
    """Tip limits of the same tools without the fixtures.

    bare   : TriangleTree of the part alone, access frame
    bounds : (2, 3) float64, mm, of the part, access frame
    """
    standing = DiscHeights(bare)
    return {t: TipField(bare, f.tool, clear, bounds, f.tool.widest_radius + AIR, lattice_step(f.tool), f.allowance,
                        f.cusp, standing)
            for t, f in fields.items()}
