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
from numpy.typing import NDArray

from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from toolpath.cutter.cutter import Cutter
from toolpath.drop_cutter import drop_cutter
from toolpath.root_finding import roots

OUTWARDS = 12  # steps along a normal in search of the envelope


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
            Negative where the cutter has been below the point; inf where it does not come. Exact to 1e-9 mm.
        """
        left = np.full(len(points), np.inf)
        up = self.heights(points[:, :2]) - points[:, 2]
        todo = np.flatnonzero(np.isfinite(up))
        points, normals, here = points[todo], normals[todo], up[todo]

        def above(t: F64, k: NDArray[np.int64]) -> F64:
            """Envelope over the points k moved out by t; it falls as t grows, until they are beside the cutter."""
            at = points[k] + t[:, None] * normals[k]
            return np.asarray(self.heights(at[:, :2]) - at[:, 2])

        # an envelope parallel to the surface lies n_z times as far along the normal as it does upright
        far, at_far = 1.02 * here * normals[:, 2], np.zeros(len(todo))
        near, beside = np.zeros(len(todo)), np.full(len(todo), np.inf)
        found, k = here == 0.0, np.flatnonzero(here != 0.0)
        for _ in range(OUTWARDS):
            if not len(k):
                break
            value = above(far[k], k)
            past = np.where(here[k] > 0.0, value <= 0.0, value >= 0.0)
            at_far[k[past]], found[k[past]] = value[past], True
            k, value = k[~past], value[~past]
            lost = value == np.inf
            beside[k[lost]], near[k[~lost]] = far[k[lost]], far[k[~lost]]
            far[k] = np.where(np.isfinite(beside[k]), 0.5 * (near[k] + beside[k]), 1.5 * far[k])
        k = np.flatnonzero(found)
        left[todo[k]] = roots(lambda t, which: above(t, k[which]), np.zeros(len(k)), far[k], here[k], at_far[k], 1e-10)
        return left
