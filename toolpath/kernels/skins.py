"""Do neck, shank and holder of a leaning tool come as near to samples as what may stand on them is thick."""

from __future__ import annotations

import numpy as np
from numba import njit

from geometry.kernels.options import KERNEL


@njit(**KERNEL)
def near(tips, axes, points, rooms, bodies, out):
    """Set out[k] where a body at pose k is nearer to some point than its room.

    tips, axes    : (n, 3) float64, mm and unit, tip to spindle
    points, rooms : (m, 3) and (m,) float64, mm
    bodies        : (b, 3) float64, mm: radius, and from where to where above the tip
    out           : (n,) bool; what is set already is not asked
    """
    if not len(points) or not len(bodies):
        return
    lowest, widest = bodies[:, 1].min() - rooms.max(), bodies[:, 0].max() + rooms.max()
    for k in range(len(tips)):
        t, a = tips[k], axes[k]
        for i in range(len(points)):
            if out[k]:
                break
            x, y, z = points[i, 0] - t[0], points[i, 1] - t[1], points[i, 2] - t[2]
            h = x * a[0] + y * a[1] + z * a[2]
            if h < lowest:
                continue
            across = x * x + y * y + z * z - h * h
            if across >= widest * widest:
                continue
            rho = np.sqrt(max(across, 0.0))
            for b in range(len(bodies)):
                aside = max(rho - bodies[b, 0], 0.0)
                along = max(bodies[b, 1] - h, h - bodies[b, 2], 0.0)
                if aside * aside + along * along < rooms[i] * rooms[i]:
                    out[k] = True
                    break
