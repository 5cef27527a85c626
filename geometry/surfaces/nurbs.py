"""NURBS surfaces: points, derivatives, normals, curvatures, and their iso-parametric facets.

Notation ([Jain2016], equations 3.6 and 3.7, where n and m are one less)
    P_ij, h_ij   control points (n, m, 3) and weights (n, m)
    k, l         orders in u and v, degree plus one
    t            knots, n + k and m + l of them; u runs from t[k - 1] to t[n]
    E F G        first fundamental form, L M N second, by the unit normal
Weights are kept in homogeneous coordinates; a derivative is the spline of one order less over the differences of the
control points. Where knots make a derivative jump, it is the one from the right. Theory: docs/theory/surfaces.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from geometry.array_checks import finite_points
from geometry.errors import GeometryError
from geometry.kernels.nurbs import heights_along, search_feet, surface_values
from geometry.mesh import F64, I32, TriangleMesh

# Parameters may lie outside the knots by this share of their range, because of rounding.
SLACK = 1e-9
# A place has a normal where neither tangent is shorter than this share of the size of the net by the range of the
# parameter, and the angle between them is not less than this (rad). Poles of spheres and tips of cones have none.
SINGULAR = 1e-9
MAX_FACETS = 20_000_000


@dataclass(frozen=True, eq=False)
class SurfaceDerivatives:
    """A surface and its derivatives at parameters, in the frame of the control points.

    point     : (p, 3) float64, mm
    u, v      : (p, 3) float64, first derivatives
    uu, uv, vv: (p, 3) float64, second derivatives
    """

    point: F64
    u: F64
    v: F64
    uu: F64
    uv: F64
    vv: F64


@dataclass(frozen=True, eq=False)
class NurbsSurface:
    """A rational or plain B-spline surface over a rectangle of parameters, in the frame of its control points.

    control : (n, m, 3) float64, mm; first index along u
    knots_u : (n + k,) float64, not decreasing, no inner knot more than k - 1 times
    knots_v : (m + l,) float64, likewise
    orders  : (k, l), degrees plus one, at least 2
    weights : (n, m) float64, dimensionless, > 0; None for a plain B-spline
    side    : 1 where the normal, which points out of the material, lies along S_u x S_v, -1 where it lies against it

    Raises GeometryError (``bad_surface``) for another shape, an order below 2 or above the number of points, a number
    that is not finite, a weight that is not positive, or knots that decrease, repeat too often or have a wrong count.
    """

    control: F64
    knots_u: F64
    knots_v: F64
    orders: tuple[int, int] = (4, 4)
    weights: F64 | None = None
    side: int = 1

    def __post_init__(self) -> None:
        control = _checked_net(self.control)
        object.__setattr__(self, "control", control)
        object.__setattr__(self, "orders", _checked_orders(self.orders, control.shape[:2]))
        for axis, name in enumerate(("knots_u", "knots_v")):
            knots = _checked_knots(getattr(self, name), name, control.shape[axis], self.orders[axis])
            object.__setattr__(self, name, knots)
        if self.weights is not None:
            object.__setattr__(self, "weights", _checked_weights(self.weights, control.shape[:2]))
        if self.side not in (1, -1):
            raise _wrong("side is 1 or -1", "side", self.side, [1, -1], "turn the sign, not its size")

    @classmethod
    def from_control_points(cls, points: ArrayLike, order: int | tuple[int, int] = 4, *,
                            weights: ArrayLike | None = None, side: int = 1) -> NurbsSurface:
        """The open uniform surface of [Jain2016, equations 3.6 and 3.7]: integer knots, u from 0 to n - k + 1.

        points  : (n, m, 3) float64, mm, any frame
        order   : k, or (k, l) where they differ
        weights : (n, m) float64, dimensionless
        side    : as for the class

        Returns NurbsSurface; 5 by 5 points at order 4 have u and v from 0 to 2.
        Raises GeometryError (``bad_surface``).
        """
        control = _checked_net(points)
        orders = _checked_orders((order, order) if isinstance(order, int) else order, control.shape[:2])
        given = None if weights is None else np.asarray(weights, dtype=np.float64)
        return cls(control, open_uniform_knots(control.shape[0], orders[0]),
                   open_uniform_knots(control.shape[1], orders[1]), orders, given, side)

    @property
    def domain(self) -> F64:
        """(2, 2) float64, dimensionless, parameters: the least (u, v) and the greatest."""
        (k, l), (n, m) = self.orders, self.control.shape[:2]  # noqa: E741
        return np.array([[self.knots_u[k - 1], self.knots_v[l - 1]], [self.knots_u[n], self.knots_v[m]]])

    def points(self, uv: ArrayLike) -> F64:
        """Points of the surface [Jain2016, equation 3.6].

        uv : (p, 2) float64, dimensionless, parameters
        Returns (p, 3) float64, mm.
        Raises GeometryError (``bad_array``; ``outside_domain`` for parameters outside the domain).
        """
        at = self._inside(uv)
        return _divided(self._value(at, 0, 0))

    def derivatives(self, uv: ArrayLike) -> SurfaceDerivatives:
        """Points with first and second derivatives [Piegl1997].

        uv : (p, 2) float64, dimensionless, parameters
        Returns SurfaceDerivatives, mm by units of the parameters.
        Raises GeometryError as ``points``.
        """
        at = self._inside(uv)
        ways = [self._value(at, i, j) for i, j in _WAYS]
        if self.weights is None:
            return SurfaceDerivatives(*ways)
        a, au, av, auu, auv, avv = (way[:, :3] for way in ways)
        w, wu, wv, wuu, wuv, wvv = (way[:, 3:] for way in ways)
        s = a / w
        su, sv = (au - wu * s) / w, (av - wv * s) / w
        return SurfaceDerivatives(s, su, sv, (auu - 2.0 * wu * su - wuu * s) / w,
                                  (auv - wu * sv - wv * su - wuv * s) / w, (avv - 2.0 * wv * sv - wvv * s) / w)

    def normals(self, uv: ArrayLike) -> F64:
        """Unit normals out of the material, ``side`` times S_u x S_v [DoCarmo1976]; errors are those of ``points``.

        uv : (p, 2) float64, dimensionless, parameters

        Returns (p, 3) float64, dimensionless, frame of the surface; NaN at singular points (poles, tips).
        """
        return self._normal(self.derivatives(uv))

    def points_and_normals(self, uv: ArrayLike) -> tuple[F64, F64]:
        """Points of the surface with their normals.

        uv : (p, 2) float64, dimensionless, parameters
        Returns points, (p, 3) float64, mm, and unit normals out of the material, (p, 3) float64, dimensionless, NaN at
        singular points; both in the frame of the control points.
        Raises GeometryError as ``points``.
        """
        at = self._inside(uv)
        a, au, av = (self._value(at, i, j) for i, j in _WAYS[:3])
        if self.weights is None:
            return a, self._across(au, av)
        s = _divided(a)
        return s, self._across(*((way[:, :3] - way[:, 3:] * s) / a[:, 3:] for way in (au, av)))

    def forms(self, uv: ArrayLike) -> tuple[F64, F64]:
        """First and second fundamental form [DoCarmo1976]; errors are those of ``points``.

        uv : (p, 2) float64, dimensionless, parameters

        Returns E, F, G, (p, 3) float64, mm², and L, M, N, (p, 3) float64, mm, both by units of the parameters; the
        second NaN at singular points. L is the part of S_uu along the normal, so it is negative where the material is
        convex along u.
        """
        d = self.derivatives(uv)
        normal = self._normal(d)
        return _dots((d.u, d.u), (d.u, d.v), (d.v, d.v)), _dots((d.uu, normal), (d.uv, normal), (d.vv, normal))

    def heights_along(self, points: F64, start: F64, beyond: float = 0.1) -> tuple[F64, F64]:
        """Heights of chains of points over the surface; the search for each foot starts at the previous foot.

        points : (m, t, 3) float64, mm, frame of the control points, neighbours close together
        start  : (m, 2) float64, dimensionless, parameters near the foot of the first point of each chain
        beyond : share of the domain by which feet may lie outside it, where the surface goes on smoothly

        Returns (m, t) float64, mm along the normal of the foot, negative inside the material, and the parameters of
        the feet, (m, t, 2) float64, dimensionless. Both are right where the points are nearer than the least radius
        of curvature.
        """
        low, high = self.domain
        room = beyond * (high - low)
        uv, height = np.empty((*points.shape[:2], 2)), np.empty(points.shape[:2])
        heights_along(tuple(self._nets[way][0] for way in _WAYS[:3]), self.knots_u, self.knots_v, *self.orders,
                      self.side, low - room, high + room, np.ascontiguousarray(points, np.float64),
                      np.ascontiguousarray(start, np.float64), uv, height)
        return height, uv

    def feet(self, points: F64, start: F64) -> tuple[F64, F64, F64]:
        """Nearest points within the domain, each in the valley of its start, by Newton's method [Piegl1997].

        points : (p, 3) float64, mm, frame of the control points
        start  : (p, 2) float64, dimensionless, parameters inside the domain

        Returns the parameters (p, 2), dimensionless, the points (p, 3), mm, and their distances (p,), mm, all float64.
        ``geometry.surfaces.foot_points`` finds starts.
        """
        low, high = self.domain
        nets, knots_u, knots_v, orders = zip(*(self._nets[way] for way in _WAYS), strict=True)
        uv, foot, left = np.array(start, np.float64), np.empty((len(points), 3)), np.empty(len(points))
        search_feet(tuple(np.ascontiguousarray(net) for net in nets), knots_u, knots_v, np.array(orders, np.int64), low,
                    high, np.ascontiguousarray(points, np.float64), uv, foot, left)
        return uv, foot, np.sqrt(left)

    def curvature(self, uv: ArrayLike) -> F64:
        """Principal curvatures [DoCarmo1976]; errors are those of ``points``.

        uv : (p, 2) float64, dimensionless, parameters

        Returns (p, 2) float64, 1/mm, least and greatest, positive where the material is convex (a ball has 1/R, 1/R);
        NaN at singular points.
        """
        first, second = self.forms(uv)
        e, f, g = first.T
        l, m, n = -second.T  # noqa: E741
        with np.errstate(invalid="ignore", divide="ignore"):
            area = e * g - f * f
            mean = (e * n - 2.0 * f * m + g * l) / (2.0 * area)
            spread = np.sqrt(np.maximum(mean * mean - (l * n - m * m) / area, 0.0))
        return np.column_stack([mean - spread, mean + spread])

    def moved(self, matrix: ArrayLike) -> NurbsSurface:
        """The surface moved by a rigid matrix.

        matrix : (4, 4) float64, rotation and shift (mm) to another frame; not a mirror
        Returns NurbsSurface with the same parameters and side.
        Raises GeometryError (``not_rigid``).
        """
        m = np.asarray(matrix, dtype=np.float64)
        if m.shape != (4, 4) or not np.isfinite(m).all():
            raise GeometryError(f"a motion is a finite matrix of shape (4, 4), got {m.shape}", code="not_rigid",
                                subjects=("matrix",), measured=list(m.shape), limit=[4, 4],
                                remedy="use SetupFrame.matrix")
        turn = m[:3, :3]
        off = float(np.abs(turn @ turn.T - np.eye(3)).max())
        if off > 1e-9 or np.linalg.det(turn) < 0.0:
            raise GeometryError(f"the matrix scales, shears or mirrors (off by {off:.3g})", code="not_rigid",
                                subjects=("matrix",), measured=off, limit=1e-9, remedy="use a rotation and a shift")
        return replace(self, control=self.control @ turn.T + m[:3, 3])

    def extended(self, share: float) -> NurbsSurface:
        """The surface extended beyond its four borders by a share of its domain, with the polynomial of each border.

        Returns NurbsSurface with the same parameters inside and new ones outside.
        Raises GeometryError (``bad_surface``): a weight does not stay positive in the extension.
        """
        from scipy.interpolate import BSpline  # it takes a quarter of a second to import, and few processes come here

        net = self._nets[0, 0][0]
        knots = []
        for axis, (t, order) in enumerate(zip((self.knots_u, self.knots_v), self.orders, strict=True)):
            room = share * (self.domain[1, axis] - self.domain[0, axis])
            wide = np.array(t, np.float64)
            wide[:order], wide[-order:] = t[order - 1] - room, t[-order] + room
            at = np.array([wide[i + 1:i + order].mean() for i in range(net.shape[axis])])  # one in reach of each point
            at = np.clip(at, wide[order - 1], wide[-order])
            values = BSpline(t, np.moveaxis(net, axis, 0), order - 1)(at)
            basis = BSpline.design_matrix(at, wide, order - 1).toarray()
            net = np.moveaxis(np.linalg.solve(basis, values.reshape(len(at), -1)).reshape(values.shape), 0, axis)
            knots.append(wide)
        if self.weights is None:
            return replace(self, control=net, knots_u=knots[0], knots_v=knots[1])
        return replace(self, control=net[..., :3] / net[..., 3:], weights=net[..., 3], knots_u=knots[0],
                       knots_v=knots[1])

    def discretised(self, du: float, dv: float) -> TriangleMesh:
        """Two facets to every cell of an even grid over the parameters, from border to border.

        du, dv : float, greatest steps of the parameters; they are shortened to divide the domain evenly

        Returns
        -------
        TriangleMesh
            Outward by ``side``, cut along the diagonal from the least to the greatest parameters, with the normals of
            the surface at its corners. Facets that collapse to a line (at a pole) are left out.

        Raises
        ------
        GeometryError
            ``bad_step``: a step is not positive, or there would be more than 20 million facets.
        """
        counts = self.grid_counts(du, dv)
        low, high = self.domain
        u, v = (np.linspace(low[axis], high[axis], counts[axis] + 1) for axis in (0, 1))
        uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        derivatives = self.derivatives(uv)
        faces = _cells(*counts)
        faces = np.ascontiguousarray(faces if self.side > 0 else faces[:, ::-1])
        corner = derivatives.point[faces]
        whole = (corner != np.roll(corner, 1, axis=1)).any(axis=2).all(axis=1)
        normals = self._normal(derivatives)[faces[whole]]
        return TriangleMesh(derivatives.point, faces[whole], corner_normals=normals)

    def grid_counts(self, du: float, dv: float) -> tuple[int, int]:
        """Count of the cells along u and v in ``discretised``.

        Raises
        ------
        GeometryError
            ``bad_step``: a step is not positive, or there would be more than 20 million facets.
        """
        size = self.domain[1] - self.domain[0]
        for name, step in (("du", du), ("dv", dv)):
            if not (np.isfinite(step) and step > 0.0):
                raise GeometryError(f"{name} is {step}; a step must be positive", code="bad_step", subjects=(name,),
                                    measured=step, limit=0.0, remedy="give positive steps")
        counts = np.maximum(np.ceil(size / (du, dv) - SLACK), 1.0)
        if 2.0 * counts.prod() > MAX_FACETS:
            raise GeometryError(f"steps of {du:g} and {dv:g} make {2.0 * counts.prod():.3g} facets", code="bad_step",
                                subjects=("du", "dv"), measured=2.0 * counts.prod(), limit=MAX_FACETS,
                                remedy="take longer steps")
        return int(counts[0]), int(counts[1])

    def _normal(self, d: SurfaceDerivatives) -> F64:
        return self._across(d.u, d.v)

    def _across(self, u: F64, v: F64) -> F64:
        """Unit normals from both first derivatives, (p, 3)."""
        across = np.cross(u, v)
        size = np.linalg.norm(across, axis=1)
        along = [np.linalg.norm(way, axis=1) for way in (u, v)]
        least = SINGULAR * self._size / (self.domain[1] - self.domain[0])
        good = (along[0] > least[0]) & (along[1] > least[1]) & (size > SINGULAR * along[0] * along[1])
        out: F64 = np.full(across.shape, np.nan)
        out[good] = self.side * across[good] / size[good, None]
        return out

    @cached_property
    def _size(self) -> float:
        return float(np.ptp(self.control.reshape(-1, 3), axis=0).max())

    @cached_property
    def _nets(self) -> dict[tuple[int, int], tuple[F64, F64, F64, tuple[int, int]]]:
        """By number of derivatives in u and v: control points, homogeneous with weights, knots and orders of it."""
        w = self.weights
        plain = self.control if w is None else np.concatenate([self.control * w[..., None], w[..., None]], axis=2)
        nets = {(0, 0): (plain, self.knots_u, self.knots_v, self.orders)}
        for i, j in _WAYS[1:]:
            axis = 0 if i else 1
            net, *knots, orders = nets[(i - 1, j) if i else (i, j - 1)]
            net, knots[axis], order = _differentiated(net, knots[axis], orders[axis], axis)
            nets[i, j] = net, knots[0], knots[1], (order, orders[1]) if i else (orders[0], order)
        return nets

    def _value(self, uv: F64, i: int, j: int) -> F64:
        """A derivative at parameters (p, 2): (p, 3), or (p, 4) homogeneous where the surface has weights."""
        net, knots_u, knots_v, orders = self._nets[i, j]
        out = np.empty((len(uv), net.shape[2]))
        surface_values(net, knots_u, knots_v, orders[0], orders[1], uv, out)
        return out

    def _inside(self, uv: ArrayLike) -> F64:
        at = finite_points(uv, 2, "uv")
        low, high = self.domain
        beyond = np.maximum(low - at, at - high).max(axis=1, initial=-np.inf) > SLACK * (high - low).max()
        if beyond.any():
            row = int(np.flatnonzero(beyond)[0])
            raise GeometryError(f"uv[{row}] = ({at[row, 0]:g}, {at[row, 1]:g}) lies outside the domain",
                                code="outside_domain", subjects=(f"uv[{row}]",), measured=at[row].tolist(),
                                limit=self.domain.tolist(), remedy="clip the parameters to NurbsSurface.domain")
        return np.clip(at, low, high)


def open_uniform_knots(count: int, order: int) -> F64:
    """Knots of [Jain2016, equation 3.7]: ``order`` zeros, whole numbers, and ``order`` times count - order + 1.

    count : control points, at least ``order``
    order : degree plus one
    Returns (count + order,) float64, dimensionless.
    """
    return np.clip(np.arange(count + order) - order + 1.0, 0.0, count - order + 1.0)


# Derivatives in u and v; each comes after the one it is derived from.
_WAYS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


def _divided(values: F64) -> F64:
    return values if values.shape[1] == 3 else values[:, :3] / values[:, 3:]


def _dots(*pairs: tuple[F64, F64]) -> F64:
    return np.column_stack([np.einsum("pi,pi->p", a, b) for a, b in pairs])


def _differentiated(net: F64, knots: F64, order: int, axis: int) -> tuple[F64, F64, int]:
    if order == 1:
        return np.zeros_like(net), knots, 1
    gap = knots[order:-1] - knots[1:-order]
    rate = (order - 1) / np.where(gap > 0.0, gap, np.inf)
    shape = (-1, 1, 1) if axis == 0 else (1, -1, 1)
    return np.diff(net, axis=axis) * rate.reshape(shape), knots[1:-1], order - 1


def _cells(nu: int, nv: int) -> I32:
    """Two triangles to every cell of (nu, nv), counter-clockwise in the plane of the parameters."""
    low = (np.arange(nu)[:, None] * (nv + 1) + np.arange(nv)).reshape(-1, 1)
    corners = low + np.array([0, nv + 1, nv + 2, 1])
    return corners[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.int32)


def _wrong(message: str, subject: str, measured: object, limit: object, remedy: str) -> GeometryError:
    return GeometryError(message, code="bad_surface", subjects=(subject,), measured=measured, limit=limit,
                         remedy=remedy)


def _numbers(values: ArrayLike, name: str) -> F64:
    try:
        return np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise _wrong(f"{name} is not a regular array of numbers: {error}", name, None, None,
                     "give every row as many entries") from error


def _checked_net(values: ArrayLike) -> F64:
    net = _numbers(values, "control")
    if net.ndim != 3 or net.shape[2] != 3:
        raise _wrong(f"control points have shape (n, m, 3), got {net.shape}", "control", list(net.shape), ["n", "m", 3],
                     "give rows of (x, y, z)")
    bad = np.argwhere(~np.isfinite(net))
    if len(bad):
        i, j, c = bad[0].tolist()
        raise _wrong(f"control point in row {i}, column {j} has {'xyz'[c]} = {net[i, j, c]}", f"control[{i}, {j}]",
                     str(net[i, j, c]), "finite", "give finite coordinates")
    return net


def _checked_orders(orders: tuple[int, int], shape: tuple[int, ...]) -> tuple[int, int]:
    for name, order, count in zip("uv", orders, shape, strict=True):
        if order < 2 or count < order:
            raise _wrong(f"order {order} in {name} (at least 2) needs as many control points, there are {count}",
                         f"orders.{name}", count, max(order, 2), "lower the order or add control points")
    return int(orders[0]), int(orders[1])


def _checked_weights(values: ArrayLike, shape: tuple[int, ...]) -> F64:
    weights = _numbers(values, "weights")
    if weights.shape != shape:
        raise _wrong(f"weights have the shape of the control points {shape}, got {weights.shape}", "weights",
                     list(weights.shape), list(shape), "give one weight to every control point")
    bad = np.argwhere(~(np.isfinite(weights) & (weights > 0.0)))
    if len(bad):
        i, j = bad[0].tolist()
        raise _wrong(f"the weight in row {i}, column {j} is {weights[i, j]:g}", f"weights[{i}, {j}]",
                     float(weights[i, j]), 0.0, "give a positive weight, or none at all")
    return weights


def _checked_knots(values: ArrayLike, name: str, count: int, order: int) -> F64:
    knots = _numbers(values, name)
    if knots.shape != (count + order,):
        raise _wrong(f"{count} control points of order {order} take {count + order} {name}, got {knots.shape}", name,
                     list(knots.shape), [count + order], "knots are as many as control points plus the order")
    if not np.isfinite(knots).all():
        at = int(np.flatnonzero(~np.isfinite(knots))[0])
        raise _wrong(f"{name}[{at}] is {knots[at]}", f"{name}[{at}]", str(knots[at]), "finite", "give finite knots")
    if (np.diff(knots) < 0.0).any():
        at = int(np.flatnonzero(np.diff(knots) < 0.0)[0]) + 1
        raise _wrong(f"{name}[{at}] = {knots[at]:g} is less than the knot before it, {knots[at - 1]:g}",
                     f"{name}[{at}]", float(knots[at]), float(knots[at - 1]), "sort the knots")
    low, high = knots[order - 1], knots[count]
    if not low < high:
        raise _wrong(f"{name} leave no range of parameters: from {low:g} to {high:g}", name, float(high - low), 0.0,
                     "spread the inner knots")
    inner, times = np.unique(knots[(knots > low) & (knots < high)], return_counts=True)
    if (times >= order).any():
        at_knot = float(inner[times >= order][0])
        raise _wrong(f"{name} holds {at_knot:g} {int(times.max())} times, which tears a surface of order {order}", name,
                     int(times.max()), order - 1, "split the surface there")
    return knots
