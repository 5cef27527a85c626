"""Parts of one profile along Y, meshed by hand: rows of Z, each filled from one side up to its own width."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry.mesh import TriangleMesh
from tests.hand_parts import terraces


def profile(levels: Sequence[float], widths, length: float, *, shift: float | None = None,
            ends: Sequence[float] | None = None) -> TriangleMesh:
    """Row k fills Z from ``levels[k]`` to ``levels[k + 1]``, and X from 0 to ``widths[k]``, mm.

    length : mm, Y goes from 0 to it
    shift  : mm, X of the flush side, from which rows are filled down; None: from X 0 up
    ends   : Y of the borders where the profile changes; ``widths`` then has a row for each part between two of them
    """
    rows = np.atleast_2d(np.asarray(widths, dtype=np.float64))
    along = [0.0, length] if ends is None else list(ends)
    mesh = terraces(levels, along, rows)
    x, y, z = mesh.vertices.T
    if shift is not None:  # (X, Y, Z) of the blocks become (Z, Y, shift - X)
        return TriangleMesh(np.column_stack([shift - z, y, x]), mesh.faces, mesh.face_ids)
    return TriangleMesh(np.column_stack([z, y, x]), mesh.faces[:, ::-1], mesh.face_ids)
