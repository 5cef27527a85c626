"""Forward steps of a ball on the true profile of a pass [Sarkar2015, section 3.4], by the errata's scheme.

Between two tool locations the ball sweeps a capsule round the way of its centre. The distance of a place of the pass
from that capsule is the chordal error there, overcut of the nose and stock left alike:

    dev(P) = dist(P, segment C1 C2) - r,    C = P + r n

That does not see a pass that bends sideways. By d the capsule leaves the contact only by d² / 2 r, while the ridge to
the next pass, of height h, grows by d sqrt(h / 2 r) for each of the two that does. So sideways deviations count with
twice that where a scallop is given: the ridge grows by the tolerance at most. The greater of the two errors sets the
length of a step. The circular-arc rule applies the curvature at the start of a step to the whole step. So past an
inflection, or where a profile tightens, it leaves more than the tolerance.

Arrays are float64. Places are in mm, normals dimensionless unit vectors, in the access frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from geometry.errors import GeometryError
from geometry.mesh import F64
from toolpath.kernels import forward as kernels

LONGEST = 40.0  # mm
MAX_STEPS = 1_000_000
FIRST = 256  # intervals of a pass at first
SHARE = 2e-4  # of the tolerance: error of the cubics of a profile
MAX_PLACES = 1 << 18
FINEST = 0.02  # mm between places of a profile: a jump that remains is an edge

Curve = Callable[[F64], tuple[F64, F64]]
"""Contacts (n, 3) mm and unit normals out of the material (n, 3) at parameters (n,) in 0 to 1."""


@dataclass(frozen=True, eq=False)
class PassProfile:
    """A pass over the surface by its length.

    at      : (k + 1,) float64, parameters of the pass at even distances along it
    width   : mm between them
    contact : (k + 1, 3) float64, mm, access frame
    normal  : (k + 1, 3) float64, unit
    """

    at: F64
    width: float
    contact: F64
    normal: F64

    @classmethod
    def of(cls, curve: Curve, tolerance: float, radius: float) -> PassProfile:
        """A pass over 0 to 1 with places so close that cubics through them err by 2e-4 of a tolerance.

        tolerance : mm
        radius    : mm, of the ball, whose centres are to be as exact as the contacts

        Raises
        ------
        GeometryError
            Code 'bad_pass': the pass is a point, its normals are not known, or an edge lies across it.

        Notes
        -----
        Where faces join with normals an angle d apart, no places are close enough: the centre jumps along the surface.
        Off the surface the ball errs by r d² / 2 only; with places 0.02 mm apart that may be half the tolerance.
        """
        t = np.linspace(0.0, 1.0, FIRST + 1)
        way = _way(curve(t)[0])
        if not way[-1] > 0.0:
            raise GeometryError("a pass has no length or no places", code="bad_pass", measured=float(way[-1]),
                                limit=0.0, remedy="leave it out")
        count = FIRST // 4
        ways = np.linspace(0.0, way[-1], count + 1)
        even = _even(way, t)
        t = even(ways)
        contact, normal = curve(t)
        while True:
            middle = 0.5 * (ways[1:] + ways[:-1])
            between = even(middle)
            more, lean = curve(between)
            if not (np.isfinite(contact).all() and np.isfinite(normal).all() and np.isfinite(lean).all()):
                raise GeometryError("a pass crosses a place without a normal", code="bad_pass",
                                    remedy="keep passes off poles and tips")
            guess = CubicSpline(ways, np.column_stack([contact, normal]))(middle)
            off, turn = (np.linalg.norm(guess[:, k:k + 3] - true, axis=1) for k, true in ((0, more), (3, lean)))
            ways, t = _merged(ways, middle), _merged(t, between)
            contact, normal = _merged(contact, more), _merged(normal, lean)
            width = float(ways[-1]) / (len(ways) - 1)
            if np.maximum(off, radius * turn).max() <= SHARE * tolerance:
                return cls(t, width, contact, normal)
            if width < FINEST or len(t) > MAX_PLACES:
                off = np.maximum(off, 0.5 * radius * turn * turn)
                if off.max() <= 0.5 * tolerance:
                    return cls(t, width, contact, normal)
                at = ", ".join(f"{x:.3f}" for x in more[int(off.argmax())])
                raise GeometryError(f"a pass crosses a sharp edge at ({at})", code="bad_pass", subjects=(f"({at})",),
                                    measured=float(off.max()), limit=0.5 * tolerance,
                                    remedy="end the pass at the edge")

    @property
    def length(self) -> float:
        """Length, mm."""
        return self.width * (len(self.at) - 1)

    @property
    def ways(self) -> F64:
        """Distances along the pass of its places, (k + 1,) float64, mm."""
        return np.asarray(self.width * np.arange(len(self.at)))

    def pieces(self) -> F64:
        """Contact, mm, and normal as cubics of the distance into each interval, (k, 6, 4) float64."""
        return np.ascontiguousarray(self._spline.c.transpose(1, 2, 0))

    def parameters(self, way: F64) -> F64:
        """Parameters of the pass, (n,) float64, dimensionless.

        way : (n,) float64, mm, distances along the pass
        """
        return np.asarray(np.clip(CubicSpline(self.ways, self.at)(way), self.at[0], self.at[-1]))

    def centres(self, way: F64, radius: float) -> F64:
        """Centres of a ball that touches the pass, (n, 3) float64, mm, access frame.

        way    : (n,) float64, mm, distances along the pass
        radius : mm
        """
        spline = self._spline(way)
        normal = spline[:, 3:] / np.linalg.norm(spline[:, 3:], axis=1)[:, None]
        return np.asarray(spline[:, :3] + radius * normal)

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.ways, np.column_stack([self.contact, self.normal]))


def _way(points: F64) -> F64:
    return np.asarray(np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]))


def _even(way: F64, t: F64) -> Callable[[F64], F64]:
    """Parameters at ways: smooth, so that a smooth pass stays one, and growing."""
    keep = np.concatenate([[True], np.diff(way) > 1e-12 * way[-1]])
    way, t = way[keep], t[keep]
    t[-1] = 1.0
    smooth = CubicSpline(way, t)

    def at(wanted: F64) -> F64:
        out = smooth(wanted)
        if (np.diff(out) <= 0.0).any():
            out = PchipInterpolator(way, t)(wanted)
        return np.clip(out, 0.0, 1.0)

    return at


def _merged(a: F64, b: F64) -> F64:
    """Rows of a with those of b, one fewer, between them."""
    out = np.empty((len(a) + len(b), *a.shape[1:]))
    out[::2], out[1::2] = a, b
    return out


def steps(profile: PassProfile, radius: float, tolerance: float, scallop: float = 0.0, longest: float = LONGEST) -> F64:
    """Distances along a pass at which a ball is located, as far apart as the tolerance allows [Sarkar2015, section
    3.4].

    radius, tolerance, longest : mm; ``longest`` limits a step
    scallop                    : mm, between passes, which may grow by the tolerance; 0 where only the pass itself
                                 counts

    Returns
    -------
    (n,) float64, mm, from 0 to the length of the pass. Each step but the last, and those of the greatest length, has a
    chordal error of 0.9985 to 1 of the tolerance.

    Raises
    ------
    GeometryError
        Code 'too_many_steps': the tolerance needs over a million steps, or steps of no length.
    """
    pieces, aside = profile.pieces(), _aside(radius, scallop)
    room = 1024
    while room <= MAX_STEPS:
        ends = np.empty(room)
        count = int(kernels.forward(pieces, profile.width, profile.length, radius, aside, tolerance, longest,
                                    ends))
        if count > 0:
            return ends[:count].copy()
        if count < -1:
            break
        room *= 8
    raise GeometryError(f"a pass of {profile.length:g} mm needs over {MAX_STEPS} steps", code="too_many_steps",
                        measured=profile.length, limit=MAX_STEPS, remedy="allow a larger chord tolerance")


def _aside(radius: float, scallop: float) -> float:
    return float(np.sqrt(2.0 * scallop / radius))


def errors(profile: PassProfile, ends: F64, radius: float, scallop: float = 0.0) -> F64:
    """Greatest chordal error of each step, (n - 1,) float64, mm [Sarkar2015, section 3.4].

    ends : (n,) float64, mm, distances along the pass of the locations
    """
    pieces, seen, out = profile.pieces(), np.empty(kernels.PLACES + 1), np.empty(6)
    return np.array([kernels.greatest(pieces, profile.width, a, b, radius, _aside(radius, scallop), seen, out)
                     for a, b in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)])
