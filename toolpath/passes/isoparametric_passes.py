"""Passes of a ball along the lines of a re-parameterised surface [Sarkar2015, section 3], corrected by its errata.

Notation
    xi, eta   : the unit square; a pass is a line of one eta, xi along it
    C         : S(u(xi, eta), v(xi, eta)), the contact; n its normal, out of the material
    k         : normal curvature across the pass, positive where the part is concave
    r, h, g   : radius of the ball, allowed residual, side step as an arc on the surface

The side step, equations 3.7 to 3.11, in one closed form that is level at k = 0: with R = 1 / |k|

    1 - cos phi = (2 r h - h²) / (2 (R + h) (R + r)) convex, (R - h) (R - r) concave;   g = 2 R phi
    g = (4 / |k|) asin(|k| sqrt((2 r h - h²) / (4 (1 - h k) (1 - r k))))

It holds across straight neighbours that are alike throughout. The true distance of two passes is bracketed by what the
ball leaves between them.

Arrays are float64. Places are in mm, normals dimensionless unit vectors, in the access frame; xi and eta are
dimensionless.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline

from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.parameterization.grid_map import GridMap
from geometry.parameterization.joined_faces import Joined
from geometry.surfaces.nurbs import NurbsSurface
from toolpath.kernels.beside import left_beside
from toolpath.passes.forward_step import Curve

LEVEL = 1e-9  # 1/mm: a surface with less curvature is level
TIGHT = 0.999  # of the curvature of the ball: it does not fit a more concave surface
ALONG = 65  # places along a pass at which its distance to the next is measured
MAX_LINES = 513
FEET = 8  # steps of Newton from a place of the square to parameters near it
CENTRES = 513  # of the ball along a pass
ROWS = np.array([0.12, 0.24, 0.36, 0.44, 0.5, 0.56, 0.64, 0.76, 0.88])  # between two passes
FULL, AIM, TRIALS = 0.97, 0.985, 8
NODES = 49  # each way, through which several faces are splined
APART = 1e-3  # of the unit square, between places that give a curvature
STEEP = 0.5  # least level part of a normal of a surface that a flank cuts


def side_step(curvature: F64, radius: float, scallop: float) -> F64:
    """Largest arc across two neighbouring passes of a ball that keeps a scallop [Sarkar2015, eq. 3.7 to 3.11]
    [Lin1996].

    curvature : (n,) float64, 1/mm, across the pass, positive concave
    radius    : mm, of the ball
    scallop   : mm, along the normal

    Returns (n,) float64, mm; nan where the surface is too hollow for the ball. Where the ball fits so closely that
    nothing as high as the scallop can stay, it is the whole circle round the ball.
    """
    k = np.asarray(curvature, dtype=np.float64)
    size = np.maximum(np.abs(k), LEVEL)
    room = (1.0 - scallop * k) * (1.0 - radius * k)
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = size * np.sqrt((2.0 * radius * scallop - scallop**2) / (4.0 * room))
    arc = 4.0 / size * np.arcsin(np.minimum(sine, 1.0))
    return np.where(k < 1.0 / radius, np.where(np.isnan(sine), 2.0 * np.pi / size, arc), np.nan)


@dataclass(frozen=True, eq=False)
class IsoSurface:
    """A surface over the unit square; ``turned``: xi is the grid's eta."""

    surface: NurbsSurface
    grid: GridMap
    turned: bool = False

    def contact(self, xi: F64, eta: F64) -> tuple[F64, F64]:
        """Places, mm, and unit normals, both (p, 3) float64, access frame.

        xi, eta : (p,) float64, dimensionless
        """
        return self.surface.points_and_normals(self._inside(self._uv(xi, eta)))

    def curve(self, eta: float, low: float = 0.0, high: float = 1.0) -> Curve:
        """The pass at eta from one xi to another, in the form of ``toolpath.passes.forward_step``."""
        return lambda t: self.contact(low + (high - low) * t, np.full(len(t), eta))

    def across(self, xi: F64, eta: F64) -> tuple[F64, F64]:
        """Width and curvature of the surface across a pass [DoCarmo1976].

        xi, eta : (p,) float64, dimensionless

        Returns
        -------
        width : (p,) float64, mm per 1 of eta, square to the pass on the surface
        curvature : (p,) float64, 1/mm, across the pass, positive concave

        Notes
        -----
        The direction square to (u', v') is (-(F u' + G v'), E u' + F v').
        """
        uv = self._inside(self._uv(xi, eta))
        along, over = self.tangents(xi, eta)
        first, second = self.surface.forms(uv)
        e, f, g = first.T
        u, v = -(f * along[:, 0] + g * along[:, 1]), e * along[:, 0] + f * along[:, 1]
        size = e * u * u + 2.0 * f * u * v + g * v * v
        curvature = (second[:, 0] * u * u + 2.0 * second[:, 1] * u * v + second[:, 2] * v * v) / size
        inner = e * u * over[:, 0] + f * (u * over[:, 1] + v * over[:, 0]) + g * v * over[:, 1]
        return np.abs(inner) / np.sqrt(size), curvature

    def tangents(self, xi: F64, eta: F64) -> tuple[F64, F64]:
        """Derivatives of (u, v) along xi and along eta, both (p, 2) float64, dimensionless, parameters of the surface.

        xi, eta : (p,) float64, dimensionless
        """
        return self.grid.tangents(eta, xi)[::-1] if self.turned else self.grid.tangents(xi, eta)

    def parameters(self, xi: F64, eta: F64) -> F64:
        """Parameters of the surface, (p, 2) float64, dimensionless; beyond its border the square continues straight.

        xi, eta : (p,) float64, dimensionless
        """
        return self._inside(self._uv(xi, eta))

    def square(self, uv: F64, xi: F64, eta: F64) -> tuple[F64, F64]:
        """Place over the unit square, or beyond it, of parameters of the surface, both (p,) float64, dimensionless.

        uv      : (p, 2) float64, dimensionless, parameters of the surface
        xi, eta : (p,) float64, dimensionless, where Newton's iteration begins
        """
        for _ in range(FEET):
            off = uv - self._uv(xi, eta)
            (a, b), (c, d) = (way.T for way in self.tangents(np.clip(xi, 0.0, 1.0), np.clip(eta, 0.0, 1.0)))
            area = a * d - b * c
            xi, eta = xi + (d * off[:, 0] - c * off[:, 1]) / area, eta + (a * off[:, 1] - b * off[:, 0]) / area
        return xi, eta

    def _uv(self, xi: F64, eta: F64) -> F64:
        a, b = np.clip(xi, 0.0, 1.0), np.clip(eta, 0.0, 1.0)
        uv = self.grid(b, a) if self.turned else self.grid(a, b)
        if not ((a != xi) | (b != eta)).any():
            return uv
        along, across = self.tangents(a, b)
        return uv + (xi - a)[:, None] * along + (eta - b)[:, None] * across

    def _inside(self, uv: F64) -> F64:
        return np.clip(uv, *self.surface.domain)


@dataclass(frozen=True, eq=False)
class JoinedSurface:
    """Several faces over the unit square as one; ``turned``: xi is the grid's eta.

    splines : x, y and z (mm) over (eta, xi) of the grid, through places of the faces, near them in between
    """

    faces: Joined
    splines: tuple[RectBivariateSpline, ...]
    turned: bool = False

    @classmethod
    def of(cls, faces: Joined, grid: GridMap) -> JoinedSurface:
        """Faces over a piece of their plane that ``grid`` maps to the unit square."""
        at = np.linspace(0.0, 1.0, NODES)
        xi, eta = np.meshgrid(at, at)
        place = faces.places(grid(xi.ravel(), eta.ravel())).reshape(NODES, NODES, 3)
        return cls(faces, tuple(RectBivariateSpline(at, at, place[:, :, c]) for c in range(3)))

    def contact(self, xi: F64, eta: F64) -> tuple[F64, F64]:
        """As ``IsoSurface.contact``: places, mm, and unit normals, both (p, 3) float64, access frame.

        xi, eta : (p,) float64, dimensionless
        """
        a, b = (xi, eta) if self.turned else (eta, xi)
        return self.faces.feet(np.column_stack([spline.ev(a, b) for spline in self.splines]))

    def curve(self, eta: float, low: float = 0.0, high: float = 1.0) -> Curve:
        """As for ``IsoSurface``."""
        return lambda t: self.contact(low + (high - low) * t, np.full(len(t), eta))

    def across(self, xi: F64, eta: F64) -> tuple[F64, F64]:
        """As ``IsoSurface.across``, from places a little apart: the curvature jumps where faces join.

        xi, eta : (p,) float64, dimensionless

        Returns
        -------
        width : (p,) float64, mm per 1 of eta
        curvature : (p,) float64, 1/mm, positive concave
        """
        def apart(dx: float, dy: float) -> tuple[F64, F64]:
            low = self.contact(np.clip(xi - dx, 0.0, 1.0), np.clip(eta - dy, 0.0, 1.0))
            high = self.contact(np.clip(xi + dx, 0.0, 1.0), np.clip(eta + dy, 0.0, 1.0))
            return high[0] - low[0], high[1] - low[1]

        along, (over, turn) = apart(APART, 0.0)[0], apart(0.0, APART)
        along = along / np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
        span = np.minimum(eta + APART, 1.0) - np.maximum(eta - APART, 0.0)
        square = over - (over * along).sum(axis=1)[:, None] * along
        size = np.linalg.norm(square, axis=1)
        return size / span, -(turn * square).sum(axis=1) / np.maximum(size * size, 1e-300)


Laid = IsoSurface | JoinedSurface
"""A face, or several as one, over the unit square."""


class _Table:
    """Contacts and normals as splines over the unit square, fine enough for what a scallop is measured with.

    It is evaluated on lattices only, at a twentieth of the cost of the surface. Half way between its places contacts
    err by 1e-3 of the scallop at most and centres of the ball by 1e-2 of it, or the lattice has 513 by 513.
    """

    def __init__(self, iso: Laid, radius: float, scallop: float) -> None:
        count, off = 33, np.inf
        while off > 1e-3 * scallop and count <= MAX_LINES:
            at = np.linspace(0.0, 1.0, count)
            xi, eta = np.meshgrid(at, at)
            point, normal = iso.contact(xi.ravel(), eta.ravel())
            if not (np.isfinite(point).all() and np.isfinite(normal).all()):
                raise GeometryError("a surface has a place without a normal, as at a pole", code="bad_pass",
                                    remedy="machine it by another strategy")
            values = np.column_stack([point, normal]).reshape(count, count, 6)
            self.splines = [RectBivariateSpline(at, at, values[:, :, c]) for c in range(6)]
            between = 0.5 * (at[1::2] + at[:-1:2])
            xi, eta = np.meshgrid(between, between)
            true, lean = iso.contact(xi.ravel(), eta.ravel())
            place, turn = (v.reshape(-1, 3) for v in self(between, between))
            off = float(max(np.abs(place - true).max(), 0.1 * radius * np.abs(turn - lean).max()))
            count = 2 * count - 1

    def __call__(self, xi: F64, eta: F64) -> tuple[F64, F64]:
        """Contacts and unit normals, both (m, n, 3), at all of xi (n,) and eta (m,), which grow."""
        out = np.stack([spline(eta, xi) for spline in self.splines], axis=-1)
        normal = out[..., 3:] / np.linalg.norm(out[..., 3:], axis=-1, keepdims=True)
        return np.ascontiguousarray(out[..., :3]), np.ascontiguousarray(normal)


@dataclass(frozen=True)
class Flank:
    """The side of an upright tool above its corner, which cuts steep surfaces.

    radius : mm, of the tool
    height : mm, how far above the corner's centre it may cut
    """

    radius: float
    height: float


def lay_out(iso: Laid, radius: float, scallop: float, flank: Flank | None = None) -> F64:
    """The passes of a surface, as few as the scallop allows [Sarkar2015].

    radius, scallop : mm
    flank           : of an upright tool whose corner has ``radius``; None where only the ball counts

    Returns (k,) float64, dimensionless, eta of the passes from 0 to 1, both borders included.

    Raises
    ------
    GeometryError
        Code 'bad_pass': the normal is not known everywhere.
    """
    out, step = [0.0], None
    table = _Table(iso, radius, scallop)
    before = _Pass(table, 0.0, radius, flank)
    while out[-1] < 1.0:
        guess = _first_guess(iso, out[-1], radius, scallop) if step is None else step
        eta, before = _next(table, before, out[-1], guess, radius, scallop)
        step = eta - out[-1]
        out.append(eta)
    return np.array(out)


def _first_guess(iso: Laid, eta: float, radius: float, scallop: float) -> float:
    xi = np.linspace(0.0, 1.0, ALONG)
    width, curvature = iso.across(xi, np.full(ALONG, eta))
    g = side_step(np.minimum(curvature, TIGHT / radius), radius, scallop)
    return float(np.nanmin(g / np.maximum(width, 1e-300)))


class _Pass:
    """A pass as centres of the corner, close together, to measure the residual beside it."""

    def __init__(self, table: _Table, eta: float, radius: float, flank: Flank | None) -> None:
        point, normal = table(np.linspace(0.0, 1.0, CENTRES), np.array([eta]))
        self.centres, self.radius, self.flank = point[0] + radius * normal[0], radius, flank
        self.axes = self.centres
        if flank is not None:
            level = normal[0] * [1.0, 1.0, 0.0]
            size = np.maximum(np.linalg.norm(level, axis=1), 1e-12)
            self.axes = self.centres + (flank.radius - radius) * level / size[:, None]

    def left(self, points: F64, normals: F64) -> F64:
        """Distance along the normals of places (m, ALONG, 3), mm, to the tool, (m, ALONG); a little over r without it.

        The second index runs along the pass.
        """
        out = np.empty(points.shape[:2])
        wide, high = (0.0, 0.0) if self.flank is None else (self.flank.radius, self.flank.height)
        left_beside(points, normals, self.centres, self.axes, self.radius, wide, high, STEEP, out)
        return out


def _worst(table: _Table, a: _Pass, b: _Pass, low: float, high: float) -> float:
    """Largest residual between two passes, mm."""
    points, normals = table(np.linspace(0.0, 1.0, ALONG), low + ROWS * (high - low))
    one, two = a.left(points, normals), b.left(points, normals)
    # the residual grows with the square of the distance from a pass: between two rows both roots are straight
    p, q = np.sqrt(np.maximum(one, 0.0)), np.sqrt(np.maximum(two, 0.0))
    fall = (p[:-1] <= q[:-1]) & (p[1:] >= q[1:])
    share = (q[:-1] - p[:-1]) / np.maximum((q[:-1] - p[:-1]) - (q[1:] - p[1:]), 1e-300)
    crossing = np.where(fall, p[:-1] + share * (p[1:] - p[:-1]), 0.0) ** 2
    return float(max(np.minimum(one, two).max(), crossing.max()))


def _next(table: _Table, before: _Pass, at: float, guess: float, radius: float,
          scallop: float) -> tuple[float, _Pass]:
    """The next pass: as far as the residual between the two allows, or the border."""
    low, high, step = 0.0, math.inf, min(guess, 1.0 - at)
    kept = None
    for _ in range(TRIALS):
        trial = _Pass(table, at + step, radius, before.flank)
        left = _worst(table, before, trial, at, at + step)
        if left <= scallop:
            low, kept = step, (at + step, trial)
            if left >= FULL * scallop or at + step >= 1.0:
                break
        else:
            high = step
        wanted = step * math.sqrt(AIM * scallop / max(left, 1e-3 * scallop))
        if not low < wanted < high:
            wanted = 0.5 * (low + high) if high < math.inf else 1.5 * step
        step = min(wanted, 1.0 - at)
    if kept is None:  # not even a narrow step keeps it: other passes take the rest
        kept = (at + step, _Pass(table, at + step, radius, before.flank))
    return (1.0 if kept[0] > 1.0 - 1e-9 else kept[0]), kept[1]
