"""The blank before the first cut: its box, its cylinder, and what of it stands on normals of the part."""

from __future__ import annotations

import numpy as np

from geometry.mesh import F64
from verify.model import ProofSetup, StockKind


def stock_bounds(bounds: F64, setup: ProofSetup) -> F64:
    """(2, 3) float64, mm: bounding box of the blank round a part with these bounds."""
    grow = setup.margin + setup.uncertainty
    if setup.stock_kind == StockKind.BOX and setup.stock_box is not None:
        return np.asarray(setup.stock_box, dtype=np.float64)
    if setup.stock_kind == StockKind.CYLINDER:
        x, y, z, radius, height = blank_cylinder(bounds, setup)
        return np.array([[x - radius, y - radius, z], [x + radius, y + radius, z + height]])
    lower = bounds[0] - grow
    if setup.stock_kind == StockKind.BOX:
        lower[2] = bounds[0, 2]
    return np.array([lower, bounds[1] + grow])


def blank_cylinder(bounds: F64, setup: ProofSetup) -> tuple[float, float, float, float, float]:
    """x, y, z_bottom, radius, height of a cylinder blank, mm; round the part, bounds (2, 3), without one."""
    if setup.stock_cylinder is not None:
        return setup.stock_cylinder
    grow = setup.margin + setup.uncertainty
    centre = 0.5 * (bounds[0] + bounds[1])
    radius = 0.5 * float(np.hypot(*(bounds[1, :2] - bounds[0, :2]))) + grow
    return float(centre[0]), float(centre[1]), float(bounds[0, 2]), radius, float(bounds[1, 2] - bounds[0, 2]) + grow


def stock_on_normals(points: F64, normals: F64, bounds: F64, setup: ProofSetup, reach: float) -> F64:
    """Stock on each outward normal before the first cut, not above ``reach``.

    points, normals : (n, 3) float64, mm and unit; bounds : (2, 3) of the part

    Returns (n,) float64, mm: margin + uncertainty for an offset blank, else the way out of the box or cylinder.
    """
    if setup.stock_kind == StockKind.PART_OFFSET:
        return np.full(len(points), min(setup.margin + setup.uncertainty, reach))
    box = stock_bounds(bounds, setup)
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.where(normals > 0, (box[1] - points) / normals, np.where(normals < 0, (box[0] - points) / normals,
                                                                        np.inf))
    if setup.stock_kind == StockKind.CYLINDER:
        x, y, _, radius, _ = blank_cylinder(bounds, setup)
        w, n = points[:, :2] - (x, y), normals[:, :2]
        a, b, c = (n * n).sum(1), (w * n).sum(1), (w * w).sum(1) - radius**2
        side = np.where(a > 1e-12, (-b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / np.maximum(a, 1e-12), np.inf)
        out = np.column_stack([side, out[:, 2]])
    return np.clip(out.min(axis=1), 0.0, reach)
