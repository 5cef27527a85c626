"""The blank and the part as heights over a coarse grid, so that a page can cut the one away as its time goes.

Good enough to look at, and for nothing else: the page lowers the heights by the shape of the tool along its way, on
nodes a fifth of a mm apart or more, so what stands under something is not seen. Offered where a program has one
tool axis throughout.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from geometry.bvh import TriangleTree
from geometry.heights import height_grid
from geometry.mesh import F64
from service.prepare import Prepared
from service.sides import Look
from service.viewfile import Chunk, Column
from verify.model import NcProgram
from zones.view import View, turned

NODES, LEAST_STEP = 30_000, 0.2  # most nodes; mm
UNIT, NONE = 0.01, 0  # mm of a height over the lowest one; stored where nothing stands, others are one more
LOW = -1e9  # mm, where nothing stands


def stock_chunks(ready: Prepared, look: Look, programs: Sequence[NcProgram],
                 axes: Sequence[F64 | None]) -> tuple[list[Chunk], list[int | None]]:
    """Grids of the accesses that have programs, and for each program which is its own.

    look : the frame of the proof; axes : of each program, (3,) unit, setup frame, the axis it keeps, or None
    """
    chunks: list[Chunk] = []
    known: dict[str, int] = {}
    of: list[int | None] = []
    for program, axis in zip(programs, axes, strict=True):
        rotation = look.rotation if program.turn is None else program.turn @ look.rotation
        view = next((v for v in ready.views if np.allclose(v.rotation, rotation, atol=1e-9)), None)
        if view is None or axis is None or not np.allclose(view.rotation[2], axis, atol=1e-6):
            of.append(None)
            continue
        if view.id not in known:
            known[view.id] = len(chunks)
            chunks.append(_chunk(ready, view))
        of.append(known[view.id])
    return chunks, of


def _chunk(ready: Prepared, view: View) -> Chunk:
    low, high = ready.blank.corners(view.rotation) + [[-ready.blank.beyond], [ready.blank.beyond]]
    step = max(LEAST_STEP, float(np.sqrt(np.prod(high[:2] - low[:2]) / NODES)))
    nx, ny = (int(n) for n in np.ceil((high[:2] - low[:2]) / step) + 3)
    x0, y0 = (low[:2] - step).tolist()
    part = height_grid(view.tree, x0, y0, step, nx, ny)
    blank = np.maximum(_blank(ready, view, part, x0, y0, step), part)
    foot = float(low[2])
    about = {"access": view.id, "lod": 1, "rotation": [round(v, 9) for v in view.rotation.ravel().tolist()],
             "x0_mm": round(x0, 6), "y0_mm": round(y0, 6), "step_mm": round(step, 6), "nx": nx, "ny": ny,
             "foot_mm": round(foot, 6), "unit_mm": UNIT}
    return Chunk("stock", about, {"blank": _column(blank, foot), "part": _column(part, foot)})


def _column(heights: F64, foot: float) -> Column:
    over = np.where(heights > LOW / 2, 1.0 + np.rint(np.maximum(heights - foot, 0.0) / UNIT), NONE)
    return Column(over.ravel(), 4, "steps")


def _blank(ready: Prepared, view: View, part: F64, x0: float, y0: float, step: float) -> F64:
    """(ny, nx) float64, mm: top of the largest blank there may be; ``LOW`` where there is none."""
    blank, (ny, nx) = ready.blank, part.shape
    x, y = np.meshgrid(x0 + step * np.arange(nx), y0 + step * np.arange(ny))
    low, high = blank.corners(view.rotation) + [[-blank.beyond], [blank.beyond]]
    if blank.solid is not None:
        tree = TriangleTree(turned(blank.solid, view.rotation).mesh)
        return _grown(height_grid(tree, x0, y0, step, nx, ny), blank.beyond, step)
    if blank.bar is not None and abs(view.rotation[2, 2]) > 1.0 - 1e-9:
        middle = blank.bar.ends(view.rotation)[0]
        inside = np.hypot(x - middle[0], y - middle[1]) <= blank.bar.radius + blank.beyond
    elif blank.stands_alone:
        inside = (x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1])
    else:
        return _grown(part, blank.margin + blank.uncertainty, step)
    return np.where(inside, high[2], LOW)


def _grown(heights: F64, by: float, step: float) -> F64:
    """The envelope of balls of a radius, mm, on heights over a grid."""
    reach = int(np.ceil(by / step))
    at = step * np.arange(-reach, reach + 1)
    square = by * by - at[:, None] ** 2 - at[None, :] ** 2
    known = np.where(np.isfinite(heights), heights, LOW)
    ball = np.sqrt(np.maximum(square, 0.0))
    return np.asarray(ndimage.grey_dilation(known, footprint=square >= 0.0, structure=ball))


__all__ = ["stock_chunks"]
