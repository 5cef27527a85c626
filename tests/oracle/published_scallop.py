"""The scallop of Jain (2016), 3.3.1, and the passes it asks for, 3.3.2. The product measures envelopes instead.

Two balls with centres C1, C2 stand one side step apart, across the feed. I_C is the lower of the two places where the
circle both spheres share meets the vertical plane through C1 and C2; a ray from there along w, in that plane and square
to C1 C2, meets the facets at I_stl. The scallop is the way between the two.
"""

from __future__ import annotations

import numpy as np

from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.drop import drop_tips
from geometry.mesh_queries.rays import first_hits

FEED = 1.0
FIRST_STEP = 1.0  # also the longest the thesis lets a side step be
RESOLUTION = 1e-4


def published_scallop(tree: TriangleTree, x, y: float, step, radius: float):
    """Scallop (n,), mm, between balls at (x, y) and (x, y + step); NaN where the ray meets nothing."""
    first, second = np.column_stack([x, np.full(len(x), y)]), np.column_stack([x, y + step])
    c1, c2 = (np.column_stack([xy, drop_tips(tree, xy, radius, radius) + radius]) for xy in (first, second))
    along = (c2 - c1) / 2.0
    half = np.linalg.norm(along, axis=1)
    u = along / half[:, None]
    v = np.cross(u, [0.0, 0.0, 1.0])
    w = np.cross(u, v / np.linalg.norm(v, axis=1)[:, None])
    with np.errstate(invalid="ignore"):
        shared = np.sqrt(radius**2 - half**2)
    ok = np.isfinite(c1[:, 2] + c2[:, 2] + shared)
    out = np.full(len(x), np.nan)
    reach = first_hits(tree, ((c1 + c2) / 2.0)[ok], w[ok])[0]
    out[ok] = np.where(np.isfinite(reach), reach - shared[ok], np.nan)
    return out


def published_passes(tree: TriangleTree, radius: float, scallop: float, size: float = 50.0, most: int = 400):
    """Places y of the passes from 0 to ``size``: each the least of the side steps along the one before it.

    A side step comes from bisection between 0 and 1 mm. Ends early, after ``most`` passes, where steps stop leading on.
    """
    x = np.arange(0.0, size + FEED / 2, FEED)
    passes = [0.0]
    while passes[-1] < size and len(passes) < most:
        y = passes[-1]
        low, high = np.zeros(len(x)), np.full(len(x), min(FIRST_STEP, size - y))
        whole = ~(published_scallop(tree, x, y, high, radius) > scallop)
        while (high - low).max() > RESOLUTION:
            middle = (low + high) / 2.0
            fits = ~(published_scallop(tree, x, y, middle, radius) > scallop)
            low, high = np.where(fits, middle, low), np.where(fits, high, middle)
        step = float(np.where(whole, min(FIRST_STEP, size - y), low).min())
        passes.append(min(y + max(step, RESOLUTION), size))
    return np.array(passes)
