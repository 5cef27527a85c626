"""Passes of a tool's flank along walls that are ruled, or nearly so.

Notation
    xi, eta : the unit square over the wall; xi along it, more level, eta up
    P, n    : place of the wall and its normal, out of the material
    R, r    : radius of the flank, and of the tool's corner
    A       : P + (R + o) n, a place of the tool axis, o its extra distance from the wall

The axis of a pose goes from A at the lower border of a band, at xi, to A at its upper border, at xi + s. On a
developable wall some s makes both normals alike: there runs a ruling, and the flank lies on the wall all along it. On
any other ruled wall normals turn along a ruling by an angle w. A straight flank misses that wall by about R w² / 8, in
the middle or at the ends; half the height leaves a quarter. So a wall that leaves too much is divided into bands. The
flank extends above its band, so bands help only on walls that bend away from it.

The search for s runs along the whole wall at once. Dynamic programming takes the chain of trial values that misses
least, with a price on turning. It runs three times, each time finer, and the steps of the search are smoothed out. The
swept flank decides what stays and where it enters the wall, not one pose. That is measured, and where the flank is too
deep the tool stands off by as much.

Arrays are float64; places are in mm, normals and axes dimensionless unit vectors, in the access frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.linalg import solveh_banded
from scipy.ndimage import maximum_filter1d
from scipy.spatial import cKDTree

from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.five_axis.oriented_piece import MIN_PIECE, Piece, raised_poses, thinned_poses
from toolpath.lines import true_runs
from toolpath.passes.isoparametric_passes import Laid
from toolpath.poses import Blocked
from toolpath.stock.residual_map import leaning_depths

STATIONS = 65  # along a wall, at which s is searched
ALONG, UP = 257, 33  # places of the wall among which foot points are searched, each way
HEIGHTS = np.linspace(0.0, 1.0, 9)  # shares of a band at which a pose is compared with the wall
SIDEWAYS = np.arange(-8, 9)  # trials at each station, a step apart
FIRST_REACH = 1.0  # heights of a band: how far to the side its upper end is searched
FINER, TIMES = 4.0, 3  # refinement from one search to the next, and number of searches
EVENED = 16.0  # strength of the smoothing of s: waves of 5 stations shrink to 3 %, of 20 to 87 %
# Price, in allowed residuals, of 1 mm that the top of a band moves by turning from station to station, and by
# tilting off the steepest direction
TURNING, LEANING = 0.02, 0.002
LOOKED, ROWS = 193, 25  # places at which the swept flank is measured, along and up
CORRECTIONS = 5
AIMED = 0.5  # share of the allowed depth that a correction leaves
FAR_OFF = 8.0  # allowed residuals: no standing off mends a deeper gouge
MAX_BANDS = 4
LEFT_SHARE = 0.95  # share of a band that must keep the allowed residual
ENDS = 1e-3  # share of the length from which a wall is continued beyond its end
DENSE, MAX_DENSE = 0.25, 0.5  # of the radius, and mm: tip and end of the flutes between poses before they are thinned
FINER_POSES = 4  # trials, each with more poses


@dataclass(frozen=True)
class FlankTolerances:
    """Tolerances of flank passes, mm.

    left  : residual that may stay
    depth : how deep the flank may enter the wall
    chord : error that thinning out may add
    """

    left: float
    depth: float
    chord: float


@dataclass(frozen=True, eq=False)
class FlankWall:
    """A wall over the unit square.

    iso : faces laid over it, passes along xi
    """

    iso: Laid

    @cached_property
    def _upwards(self) -> bool:
        """Whether the wall rises with the eta of ``iso``."""
        ends = self.iso.contact(np.full(2, 0.5), np.array([0.0, 1.0]))[0]
        return bool(ends[1, 2] >= ends[0, 2])

    def contact(self, xi: F64, eta: F64) -> tuple[F64, F64]:
        """Places of the wall and their unit normals, both (n, 3) float64, mm and dimensionless, access frame.

        Beyond its ends (xi < 0 or > 1) a wall continues straight, with the normal of its end.

        xi, eta : (n,) float64, dimensionless
        """
        eta = eta if self._upwards else 1.0 - eta
        inside = np.clip(xi, 0.0, 1.0)
        place, normal = self.iso.contact(inside, eta)
        out = np.flatnonzero(xi != inside)
        if len(out):
            back = np.where(xi[out] < 0.0, ENDS, -ENDS)
            along = (self.iso.contact(inside[out] + back, eta[out])[0] - place[out]) / back[:, None]
            place = place.copy()
            place[out] += (xi - inside)[out, None] * along
        return place, normal

    @cached_property
    def length(self) -> float:
        """Length along the middle, mm."""
        return self._between(np.linspace(0.0, 1.0, STATIONS), np.full(STATIONS, 0.5))

    @cached_property
    def height(self) -> float:
        """Height up the middle, mm."""
        return self._between(np.full(STATIONS, 0.5), np.linspace(0.0, 1.0, STATIONS))

    def lattice(self, along: int, up: int) -> tuple[F64, F64, F64]:
        """Places and unit normals on a lattice, both (up, along, 3) float64, access frame, and the eta (up,) of its
        rows.

        Raises
        ------
        GeometryError
            Code 'bad_pass': the wall has a place without a normal.
        """
        at = np.linspace(0.0, 1.0, up)
        xi, eta = np.meshgrid(np.linspace(0.0, 1.0, along), at)
        place, normal = self.contact(xi.ravel(), eta.ravel())
        if not (np.isfinite(place).all() and np.isfinite(normal).all()):
            raise GeometryError("the wall has a place without a normal", code="bad_pass",
                                remedy="machine it by another strategy")
        return place.reshape(up, along, 3), normal.reshape(up, along, 3), at

    def off(self, points: F64) -> F64:
        """Distance of points near the wall from it, along its normal, (n,) float64, mm.

        points : (n, 3) float64, mm, access frame

        Notes
        -----
        Along the normal at the nearest place of a lattice. The error is at most half the curvature of the wall times
        the square of half the spacing of these places.
        """
        near = self._tree.query(points)[1]
        place, normal = self._feet
        return np.asarray(((points - place[near]) * normal[near]).sum(axis=1))

    @cached_property
    def _feet(self) -> tuple[F64, F64]:
        place, normal, _ = self.lattice(ALONG, UP)
        return place.reshape(-1, 3), normal.reshape(-1, 3)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._feet[0])

    def _between(self, xi: F64, eta: F64) -> float:
        return float(np.linalg.norm(np.diff(self.contact(xi, eta)[0], axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class Band:
    """A pass of the flank over part of the height of a wall.

    allowance  : mm, to leave on the wall
    low, high  : eta of its borders; the flank begins at the lower one
    xi         : (n,) float64, stations along it
    shift      : (n,) float64, s, added to xi at the upper border
    off        : (n,) float64, mm, distance of the axis from the wall beyond R
    left, deep : mm, residual that 95 % of the band keep to, and greatest depth in the wall
    """

    wall: FlankWall
    tool: ToolBody
    allowance: float
    low: float
    high: float
    xi: F64
    shift: F64
    off: F64
    left: float = np.inf
    deep: float = np.inf

    def poses(self, count: int) -> tuple[F64, F64]:
        """Tips, mm, and unit axes, both (count, 3) float64, access frame, evenly from one end of the wall to the
        other."""
        xi = np.linspace(0.0, 1.0, count)
        shift = PchipInterpolator(self.xi, self.shift)(xi)
        stands = self.tool.radius + self.allowance + np.interp(xi, self.xi, self.off)
        begin, end = axis_ends(self.wall, xi, shift, (self.low, self.high), stands)
        axis = end - begin
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        return begin - self.tool.corner_radius * axis, axis

    def pieces(self, blocked: Blocked, chord: float, served: NDArray[np.bool_] | None = None) -> list[Piece]:
        """The parts of the pass where the tool is free.

        Where the end of the tool would hit something, it is raised evenly along its axis, and the material under it
        stays.

        blocked : whether the tool enters something
        chord   : mm, error at tip and upper end of the flank that leaving out poses may add
        served  : (m,) bool, where along the wall the pass is needed, evenly from end to end; None: everywhere
        """
        spacing, high = min(DENSE * self.tool.radius, MAX_DENSE), self.tool.flute_length
        count = int(np.ceil(max(self.wall.length / spacing, 2.0))) + 1
        for _ in range(FINER_POSES):
            tip, axis = self.poses(count)
            gone_by = max(float(np.linalg.norm(np.diff(tip + h * axis, axis=0), axis=1).max()) for h in (0.0, high))
            if gone_by <= spacing:
                break
            count = int(np.ceil(count * min(gone_by / spacing * 1.05, 4.0)))
        xi = np.linspace(0.0, 1.0, len(tip))
        away = self.wall.contact(xi, np.full(len(xi), 0.5 * (self.low + self.high)))[1]
        height = (self.high - self.low) * self.wall.height
        raised, met = raised_poses(tip, axis, blocked, self.tool.radius, height)
        tip = tip + raised[:, None] * axis
        if served is not None:
            met |= ~served[np.rint(xi * (len(served) - 1)).astype(np.int64)]
        gone = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tip, axis=0), axis=1))])
        out = []
        for i, j in true_runs(~met):
            if gone[j - 1] - gone[i] >= MIN_PIECE * self.tool.radius:
                rows = i + thinned_poses(tip[i:j], axis[i:j], height + self.tool.corner_radius, chord)
                out.append(Piece(tip[rows], axis[rows], away[rows], height + self.tool.corner_radius))
        return out


def bands(wall: FlankWall, tool: ToolBody, wanted: FlankTolerances, low: float = 0.0, high: float = 1.0,
          allowance: float = 0.0) -> list[Band]:
    """The passes of the flank over a wall, from the highest down, in as few bands as keep the tolerances.

    low, high : eta between which the wall is finished
    allowance : mm, to leave on it

    Raises
    ------
    GeometryError
        Code 'bad_pass': ``MAX_BANDS`` bands leave too much, or the flutes are too short for the bands.
    """
    room = tool.flute_length - tool.corner_radius
    if room <= 0.0 or wall.length <= 0.0:
        raise GeometryError(f"{tool.id}: the tool has no flank: its flutes are no longer than its corner radius"
                            if room <= 0.0 else "the wall has no length", code="bad_pass", subjects=(tool.id,),
                            measured=room, limit=0.0, remedy="machine it by waterlines")
    least = int(np.ceil((high - low) * wall.height / room))
    miss, xi = np.inf, np.linspace(0.0, 1.0, STATIONS)
    for count in range(max(least, 1), MAX_BANDS + 1):
        borders = np.linspace(low, high, count + 1)
        made: list[Band] = []
        for a, b in zip(borders[:-1], borders[1:], strict=True):
            made.append(_fitted(Band(wall, tool, allowance, float(a), float(b), xi, np.zeros(STATIONS),
                                     np.zeros(STATIONS)), wanted))
            if made[-1].left > wanted.left or made[-1].deep > wanted.depth:
                break
        else:
            return made[::-1]
        miss = max(made[-1].left, made[-1].deep)
    raise GeometryError(f"{tool.id}: its flank misses the wall by {miss:.4f} mm in {MAX_BANDS} bands; allowed is "
                        f"{wanted.left:.4f} mm" if np.isfinite(miss) else
                        f"{tool.id}: a wall {wall.height:.1f} mm high takes more than {MAX_BANDS} bands of its flutes",
                        code="bad_pass", subjects=(tool.id,), measured=miss, limit=wanted.left,
                        remedy="machine it by waterlines")


def axis_ends(wall: FlankWall, xi: F64, shift: F64, borders: tuple[float, float],
              stands: F64 | float) -> tuple[F64, F64]:
    """Places where the tool axis crosses the lower and the upper border of a band, both (n, 3) float64, mm, access
    frame.

    xi, shift : (n,) float64, dimensionless, stations and shift of the upper end
    borders   : eta of the lower and of the upper border
    stands    : mm, distance of the axis from the wall, a float or (n,) float64
    """
    ends = []
    for at, eta in zip((xi, xi + shift), borders, strict=True):
        place, normal = wall.contact(at, np.full(len(at), eta))
        ends.append(place + np.reshape(stands, (-1, 1)) * normal)
    return ends[0], ends[1]


def _fitted(band: Band, wanted: FlankTolerances) -> Band:
    """A band with its shift, standing off as far as its swept flank needs."""
    wall, tool, low, high = band.wall, band.tool, band.low, band.high
    band = replace(band, shift=_paired(wall, band.xi, (low, high), tool.radius, wanted.left))
    place, normal, eta = wall.lattice(LOOKED, ROWS)
    place = (place + band.allowance * normal).reshape(-1, 3)
    own = (eta >= low - 1e-9) & (eta <= high + 1e-9)
    margin = 2.0 * wanted.left + wanted.depth
    of_station = np.rint(np.linspace(0.0, 1.0, LOOKED) * (STATIONS - 1)).astype(np.int64)
    for _ in range(CORRECTIONS):
        depth = leaning_depths(place, *band.poses(4 * STATIONS), tool, margin).reshape(ROWS, LOOKED)
        deep = -depth.min(axis=0)
        band = replace(band, left=float(np.quantile(depth[own], LEFT_SHARE)), deep=max(float(deep.max()), 0.0))
        if band.deep <= wanted.depth or band.deep > FAR_OFF * (wanted.left + wanted.depth):
            break
        more = np.zeros(STATIONS)
        np.maximum.at(more, of_station, deep - AIMED * wanted.depth)
        band = replace(band, off=band.off + maximum_filter1d(np.maximum(more, 0.0), 3, mode="nearest"))
    return band


def _paired(wall: FlankWall, xi: F64, borders: tuple[float, float], radius: float, left: float) -> F64:
    """(n,) shift of xi at the upper border at which the axis misses the wall least.

    Where many miss as little, as on a plane, the steepest is taken.
    """
    height = (borders[1] - borders[0]) * wall.height
    step = FIRST_REACH * height / wall.length / len(SIDEWAYS[SIDEWAYS > 0])
    shift = np.zeros(len(xi))
    beyond = FIRST_REACH * height / wall.length
    steepest = _steepest(wall, xi, borders)
    for _ in range(TIMES):
        trials = np.clip(shift + step * SIDEWAYS[:, None], -xi - beyond, 1.0 - xi + beyond)
        found = [_missed(wall, xi, s, borders, radius) for s in trials]
        miss, axis = np.array([m for m, _ in found]), np.array([a for _, a in found])
        cost = miss / left + LEANING * height * np.linalg.norm(axis - steepest, axis=2)
        best, back = cost[:, 0], np.zeros((len(xi), len(SIDEWAYS)), np.int64)
        for k in range(1, len(xi)):
            turned = np.linalg.norm(axis[:, k, None] - axis[None, :, k - 1], axis=2)
            through = best[None, :] + TURNING * height * turned
            back[k] = through.argmin(axis=1)
            best = cost[:, k] + through.min(axis=1)
        rows = [int(best.argmin())]
        for k in range(len(xi) - 1, 0, -1):
            rows.append(int(back[k, rows[-1]]))
        shift, step = trials[rows[::-1], np.arange(len(xi))], step / FINER
    return np.clip(_evened(shift), -xi - beyond, 1.0 - xi + beyond)


def _steepest(wall: FlankWall, xi: F64, borders: tuple[float, float]) -> F64:
    """(n, 3) unit: the steepest way up the wall, half way between the borders."""
    normal = wall.contact(xi, np.full(len(xi), 0.5 * (borders[0] + borders[1])))[1]
    up = np.array([0.0, 0.0, 1.0]) - normal[:, 2:] * normal
    return np.asarray(up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-12))


def _evened(shift: F64) -> F64:
    """Shift s (n,) without the steps of the search.

    Least sum of the squared change and EVENED times the squared second differences. Near the best s the miss grows with
    the square of the error of s. So moving s by less than a step of the last search costs little; the sweep measures
    it.
    """
    bend = np.diff(np.eye(len(shift)), 2, axis=0)
    whole = np.eye(len(shift)) + EVENED * bend.T @ bend
    bands_of = np.zeros((3, len(shift)))
    for k in range(3):
        bands_of[2 - k, k:] = np.diag(whole, k)
    return np.asarray(solveh_banded(bands_of, shift))


def _missed(wall: FlankWall, xi: F64, shift: F64, borders: tuple[float, float], radius: float) -> tuple[F64, F64]:
    """Miss of each pose, (n,) mm, and its axis, (n, 3), unit.

    The miss is the difference between the farthest and the nearest distance of the axis from the wall.
    """
    begin, end = axis_ends(wall, xi, shift, borders, radius)
    axis = end - begin
    places = begin[:, None] + HEIGHTS[:, None] * axis[:, None]
    miss = np.ptp(wall.off(places.reshape(-1, 3)).reshape(len(xi), -1), axis=1)
    return np.asarray(miss), np.asarray(axis / np.linalg.norm(axis, axis=1, keepdims=True))
