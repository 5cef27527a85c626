"""A flat or bull-nose end on a surface: how high its nose stands over it, its least tilt, and the width it cuts.

Notation (with that of ``toolpath.five_axis.curvature_matching``)
    t, s     : direction of the feed and the direction to its left, n x t, both on the surface
    l        : tangent of the nose circle, cos(turn) s + sin(turn) t;  f = sin(turn) s - cos(turn) t
    axis     : cos(eta) n - sin(eta) f: tilted forward by eta, and aside where ``turn`` is not 0
    t, angle : place on the nose circle, 0 at the contact, half a turn at the heel

Every place of the nose draws a trace of its own, and a sharp end sweeps the set of these traces. So the height of the
nose over the surface at one instant gives the residual beside the pass. For a bull nose that is the circle of corner
centres over the surface offset by r. Nothing here is second order: heights are those over the true surface.

Arrays are float64. Places are in mm, directions and axes dimensionless unit vectors, in the access frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.surfaces.nurbs import NurbsSurface
from geometry.tool_body import ToolBody
from toolpath.five_axis.curvature_matching import clear_tilt, nose_radii

ANGLES = 65  # places on each half of the nose
TRIED = 33  # the same in the search for a tilt: between two of them the nose may be a third deeper than at them
BISECTIONS = 10  # of a tilt: to a 1000th of its range
TOUCH = 1e-7  # mm: rounding of a place that touches
ROOM = np.radians(3.0)  # the search for a tilt ends so far beyond the clear tilt of a quadric
MAX_ROOM = np.radians(40.0)


@dataclass(frozen=True, eq=False)
class PassContacts:
    """Contacts of a pass.

    uv     : (m, 2) float64, parameters of the surface
    point  : (m, 3) float64, mm, access frame
    normal : (m, 3) float64, unit, n
    way    : (m, 3) float64, unit, t
    left   : (m, 3) float64, unit, s
    """

    uv: F64
    point: F64
    normal: F64
    way: F64
    left: F64

    def every(self, step: int) -> PassContacts:
        """Every ``step``-th of them."""
        return PassContacts(*(a[::step] for a in (self.uv, self.point, self.normal, self.way, self.left)))

    @classmethod
    def on(cls, surface: NurbsSurface, uv: F64, along: F64) -> PassContacts:
        """Contacts at parameters of a surface.

        uv    : (m, 2) float64, dimensionless, parameters of the surface
        along : (m, 2) float64, dimensionless, direction of the feed in the parameters, of any length
        """
        d, normal = surface.derivatives(uv), surface.normals(uv)
        way = d.u * along[:, :1] + d.v * along[:, 1:]
        way = way / np.linalg.norm(way, axis=1)[:, None]
        return cls(uv, d.point, normal, way, np.cross(normal, way))


@dataclass(frozen=True, eq=False)
class Nose:
    """The nose of a tool over a surface.

    tool   : ToolBody, a flat or a bull nose
    domain : (2, 2) float64, least and greatest parameters; what stands under the nose beyond them does not count
    """

    surface: NurbsSurface
    tool: ToolBody
    domain: F64

    def axes(self, at: PassContacts, tilt: F64, turn: F64) -> F64:
        """Tool axes, (m, 3) float64, unit, access frame.

        tilt, turn : (m,) float64, rad
        """
        behind = np.sin(turn)[:, None] * at.left - np.cos(turn)[:, None] * at.way
        return np.asarray(np.cos(tilt)[:, None] * at.normal - np.sin(tilt)[:, None] * behind)

    def heights(self, at: PassContacts, tilt: F64, turn: F64, angles: int = ANGLES) -> tuple[F64, F64]:
        """Height of the nose over the surface, (2, m, angles) float64, mm, and its foot points, (2, m, angles, 2),
        parameters.

        The first index is the left and the right half, the last one runs from the contact to the heel.

        tilt, turn : (m,) float64, rad
        """
        big, r = nose_radii(self.tool)
        side, ahead = np.cos(turn)[:, None], np.sin(turn)[:, None]
        tangent, behind = side * at.left + ahead * at.way, ahead * at.left - side * at.way
        inward = np.cos(tilt)[:, None] * behind + np.sin(tilt)[:, None] * at.normal
        a = np.linspace(0.0, np.pi, angles)[None, :, None]
        centre = (at.point + r * at.normal + big * inward)[:, None]
        near = centre - big * np.cos(a) * inward[:, None]
        off = big * np.sin(a) * tangent[:, None]
        high, feet = self.surface.heights_along(np.concatenate([near + off, near - off]), np.tile(at.uv, (2, 1)))
        shape = (2, len(at.uv), angles)
        return high.reshape(shape) - r, feet.reshape(*shape, 2)

    def least_tilt(self, at: PassContacts, turn: F64, depth: float, min_tilt: float) -> F64:
        """Least tilts at which no place of the nose is deeper than ``depth`` mm in the surface, (m,) float64, rad.

        turn     : (m,) float64, rad
        min_tilt : rad, where the search begins

        nan where no tilt is small enough. Only foot points within the domain count.
        """
        k_1 = np.maximum(-self.surface.curvature(np.clip(at.uv, *self.surface.domain))[:, 0], 0.0)
        clear = np.maximum(np.nan_to_num(clear_tilt(k_1, self.tool), nan=np.pi / 2 - MAX_ROOM), min_tilt)
        low, high = np.full(len(at.uv), min_tilt), clear + ROOM
        bad = self._enters(at, high, turn, depth)
        if bad.any():
            high = np.where(bad, clear + MAX_ROOM, high)
            bad = self._enters(at, high, turn, depth)
        high = np.where(self._enters(at, low, turn, depth), high, low)
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            enters = self._enters(at, middle, turn, depth)
            low, high = np.where(enters, middle, low), np.where(enters, high, middle)
        return np.where(bad, np.nan, high)

    def _enters(self, at: PassContacts, tilt: F64, turn: F64, depth: float) -> NDArray[np.bool_]:
        high, feet = self.heights(at, tilt, turn, TRIED)
        known = ((feet >= self.domain[0]) & (feet <= self.domain[1])).all(axis=3) | ~np.isfinite(high)
        return np.asarray((known & ~(high >= -depth - TOUCH)).any(axis=(0, 2)))


def strip_edges(high: F64, feet: F64, height: float) -> F64:
    """Places where the nose begins to stand higher than a height, going from the contact.

    Where it does not on its front half, the place where it is widest.

    high, feet : (2, m, angles) and (2, m, angles, 2) float64, mm and parameters, as ``Nose.heights`` gives them
    height     : mm

    Returns (2, m, 2) float64, dimensionless, parameters of the surface.
    """
    high, feet = high[:, :, :high.shape[2] // 2 + 1], feet[:, :, :high.shape[2] // 2 + 1]  # widest a quarter round
    over = high > height
    k = np.where(over.any(axis=2), over.argmax(axis=2), high.shape[2] - 1).clip(1)
    i, j = np.indices(k.shape)
    a, b = high[i, j, k - 1], high[i, j, k]
    # heights grow with the second power of the way aside at least: their roots, from the lowest place on, lie no higher
    # than a straight line between two places, and on it where contact is of the first order
    deepest = np.minimum(np.fmin.reduce(high, axis=2), 0.0)
    p, q, at = (np.sqrt(np.maximum(v - deepest, 0.0)) for v in (a, b, height))
    share = np.clip((at - p) / np.where(q > p, q - p, 1.0), 0.0, 1.0)[..., None]
    return np.asarray(feet[i, j, k - 1] + share * (feet[i, j, k] - feet[i, j, k - 1]))
