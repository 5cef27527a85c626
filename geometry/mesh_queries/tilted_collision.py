"""Whether a body of revolution enters a mesh along any axis, without turning the mesh or building its tree again.

One walk answers for all bodies of a tool (cutting part, shank, holder). Every body goes on along its axis without end,
as in ``geometry.mesh_queries.drop``: the machine stands there. Theory: docs/theory/approach.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.array_checks import finite_points
from geometry.errors import GeometryError
from geometry.kernels import tilted as kernels
from geometry.mesh import F64
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import one_thread


def axis_frames(axes: ArrayLike) -> F64:
    """A frame for each axis, its z along the axis.

    axes : (d, 3) float64, dimensionless, any length but zero, in the frame of the part

    Returns
    -------
    (d, 3, 3) float64, dimensionless
        Rotations from the frame of the part to that of the axis; ``frames[j] @ p`` turns a point. +Z gives the
        identity, other axes the least turn from there; -Z turns about X.

    Raises
    ------
    GeometryError
        An axis is not finite or zero; the subject names it.
    """
    way = finite_points(axes, 3, "axes")
    length = np.linalg.norm(way, axis=1)
    if len(way) and not length.all():
        row = int(np.flatnonzero(length == 0.0)[0])
        raise GeometryError(f"axes[{row}] is zero", code="bad_array", subjects=(f"axes[{row}]",))
    unit = way / length[:, None]
    flip = np.where(unit[:, 2:] < 0.0, [1.0, -1.0, -1.0], 1.0)  # an axis that points down is turned about X first
    x, y, z = (unit * flip).T
    f = 1.0 / (1.0 + z)
    out = np.empty((len(unit), 3, 3))
    out[:, 0, 0], out[:, 0, 1], out[:, 0, 2] = 1.0 - f * x * x, -f * x * y, -x
    out[:, 1, 0], out[:, 1, 1], out[:, 1, 2] = -f * x * y, 1.0 - f * y * y, -y
    out[:, 2, 0], out[:, 2, 1], out[:, 2, 2] = x, y, z
    out *= flip[:, None, :]
    out += 0.0  # no zero with a sign
    return out


def blocked_along(tree: TriangleTree, frames: ArrayLike, which: ArrayLike, tips: ArrayLike,
                  bodies: ArrayLike) -> NDArray[np.bool_]:
    """Whether a tool enters the mesh, each time along its own axis.

    tree   : TriangleTree in the frame of the part
    frames : (d, 3, 3) float64, dimensionless, rotations from the frame of the part as of ``axis_frames``
    which  : (n,) int64, index of the frame each tip is given in
    tips   : (n, 3) float64, mm, in that frame, whose z is the tool axis
    bodies : (k, 3) float64, mm, frame of the tool: radius, corner radius, height of the body's lower end above the tip

    Returns
    -------
    (n,) bool
        True where some body has to be lifted by more than 1e-9 mm along the axis to be free. That is, to rounding, the
        answer of ``geometry.mesh_queries.drop.blocked_many`` for the turned mesh.

    Raises
    ------
    GeometryError
        An array has another shape or is not finite, a frame does not exist, or radii contradict each other.
    """
    turns = np.ascontiguousarray(frames, dtype=np.float64)
    points, rows = finite_points(tips, 3, "tips"), finite_points(bodies, 3, "bodies")
    frame = np.ascontiguousarray(which, dtype=np.int64)
    if turns.ndim != 3 or turns.shape[1:] != (3, 3) or not np.isfinite(turns).all():
        raise GeometryError("frames must be finite (d, 3, 3) rotations", code="bad_array", subjects=("frames",))
    if frame.shape != (len(points),) or (len(frame) and not (0 <= frame.min() and frame.max() < len(turns))):
        raise GeometryError(f"which must name one of {len(turns)} frames for each of {len(points)} tips",
                            code="bad_array", subjects=("which",))
    if not ((rows[:, 1] >= 0.0) & (rows[:, 1] <= rows[:, 0])).all():
        raise GeometryError("need 0 <= corner radius <= radius for every body", code="bad_cutter",
                            subjects=("bodies",))
    out = np.zeros(len(points), np.bool_)
    if not len(rows) or not len(points) or not len(tree):
        return out
    args: tuple[Any, ...] = (tree.arrays, tree.hulls, turns, frame, points, rows, float(rows[:, 2].min()),
                             float(rows[:, 0].max()))
    if one_thread(len(points)):
        kernels.along_range(*args, 0, len(points), out)  # type: ignore[call-arg]
    else:
        kernels.along_parallel(*args, out)  # type: ignore[call-arg]
    return out
