"""Material that a cutter leaves under its swept envelope, for a cutter of any outline.

Over (x, y) a cutter of outline h that follows a path c leaves material up to

    E(x, y) = min over the path of c_z + h(rho),   rho the distance in plan of (x, y) from c,

and -E = max of -c_z - h(rho). That is the tip of the same cutter, dropped over the path turned upside down. So the drop
kernel computes the envelope exactly, for every outline it knows. The scallop at a point of the surface is its distance
along the normal to the envelope. Places are in mm, access frame.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry.kernels.drop import Bull
from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from toolpath.cutter.cutter import Cutter
from toolpath.drop_cutter import drop_cutter
from toolpath.kernels import envelope as kernels

DOT = Bull(0.0, 0.0, 0.0)
"""A cutter without width: its tip is the height of a mesh."""


class Envelope:
    """The lower envelope of a cutter along polylines.

    paths  : sequence of (n, 3) float64, mm, access frame, tips; the cutter goes straight from one to the next
    cutter : Cutter, upright (+z), endless upwards
    """

    def __init__(self, paths: Sequence[F64], cutter: Cutter) -> None:
        paths = [p for p in paths if len(p)]
        count = np.array([len(p) for p in paths], np.int64)
        points = np.vstack([np.zeros((0, 3)), *paths])
        first = np.repeat(np.cumsum(count) - count, np.maximum(count - 1, 1))
        step = np.concatenate([np.arange(max(n - 1, 1)) for n in count]) if paths else np.zeros(0, np.int64)
        last = np.minimum(first + step + 1, np.repeat(np.cumsum(count), np.maximum(count - 1, 1)) - 1)
        moves = np.column_stack([first + step, last, last])
        self.cutter = cutter
        self.tree = TriangleTree(TriangleMesh(points * [1.0, 1.0, -1.0], moves))

    def heights(self, xy: F64) -> F64:
        """Height of the envelope over places in plan.

        xy : (n, 2) float64, mm, access frame

        Returns (n,) float64, mm; +inf where the cutter does not come.
        """
        return -drop_cutter(self.tree, self.cutter, xy)

    def along(self, points: F64, normals: F64) -> F64:
        """Distance from points along their normals to the envelope; to one of the crossings where there are several.

        points  : (n, 3) float64, mm, access frame
        normals : (n, 3) float64, dimensionless, unit, n_z > 0, access frame

        Returns
        -------
        (n,) float64, mm
            Negative where the cutter has been below the point; inf where it does not come. Exact to 1e-9 mm, by the
        Illinois rule [Dowell1971].
        """
        out = np.empty(len(points))
        kernels.along(self.tree.arrays, self.cutter.shape, np.ascontiguousarray(points), np.ascontiguousarray(normals),
                      out)
        return out

    def crests(self, other: Envelope, ground: TriangleTree, points: F64, normals: F64, across: F64, most: float) -> F64:
        """Height of the crest between this envelope and another over the surface beside each point.

        ground  : TriangleTree of the finished surface, mm, access frame
        points  : (n, 3) float64, mm, access frame
        normals : (n, 3) float64, dimensionless, unit, n_z > 0, access frame
        across  : (n, 2) float64, dimensionless, unit, in plan, from this path to the other
        most    : mm, no crest farther than this from its point counts

        Returns (n,) float64, mm along the normal; -inf where no crest is near.

        Notes
        -----
        Across the paths one envelope rises and the other falls; they are equal in one place.
        """
        out = np.empty(len(points))
        kernels.crests(self.tree.arrays, other.tree.arrays, self.cutter.shape, ground.arrays, DOT,
                       *map(np.ascontiguousarray, (points, normals, across)), most, out)
        return out
