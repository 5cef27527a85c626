"""Passes of a flat or bull-nose end, tilted until its nose matches the surface [Li1995].

Each pass is a line of one eta. Its tool tilts forward by the least tilt with which no place of the nose enters the true
surface (``toolpath.five_axis.tilted_end``), turned aside where that cuts a wider strip. The edges of its strip lie
where the nose begins to stand higher than the scallop. Strips are not as wide to the left as to the right, and the
strip of the next pass is not known in advance. So both are solved together: the next pass lies as far away as lets the
edge of its strip reach the edge of the last one everywhere. The edges of a strip lag behind the contact. A pass runs on
by that much over its end, on the continued surface.

Arrays are float64. Places are in mm, normals and axes dimensionless unit vectors, in the access frame; xi and eta are
dimensionless, tilt and turn in rad.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.five_axis.tilted_end import Nose, PassContacts, strip_edges
from toolpath.passes.cutter_locations import tips
from toolpath.passes.isoparametric_passes import IsoSurface

STATIONS = 33  # along a pass from border to border; as close beyond
SPARSE = 2  # turns are searched at every second station
FIRST_STEP, MIN_STEP = 0.05, 1e-4  # of the unit square, between passes
MAX_PASSES = 400
SOLVED = 5e-3  # share of the step between passes to which the edges of neighbours meet
TRIALS = 14
TURNS = np.radians(np.arange(-20.0, 21.0, 5.0))
TURN_COST = 0.5  # radii of strip width for each rad of turning from one station to the next
EVEN = np.array([1.0, 2.0, 3.0, 2.0, 1.0]) / 9.0  # weights of the mean of neighbouring turns
MAX_RUN_OUT = 0.2  # of the unit square
SPARE_RUN_OUT = 1.15  # factor on the lag of the edges of a strip
MARGIN = 0.02  # share of the domain by which the surface extends beyond the run-out
FINEST = 12  # halvings of the way between two stations


@dataclass(frozen=True)
class MatchTolerances:
    """Tolerances of matched passes, mm and rad.

    scallop    : residual that may stay between passes
    depth      : how deep the nose may be in the surface
    least_tilt : smallest tilt at which the end cuts
    chord      : error that straight moves between locations may add
    """

    scallop: float
    depth: float
    least_tilt: float
    chord: float


@dataclass(frozen=True, eq=False)
class MatchedStrip:
    """A pass and the strip that it cuts.

    eta        : its place across
    xi         : (m,) float64, its stations, the first and last of them beyond the border
    tilt, turn : (m,) float64, rad
    low, high  : (m,) float64, eta at the edges of the strip, at the stations
    ends       : xi between which the contact runs, so that the nose cuts from border to border between both edges
    """

    eta: float
    xi: F64
    tilt: F64
    turn: F64
    low: F64
    high: F64
    ends: tuple[float, float]

    def leans(self, xi: F64) -> tuple[F64, F64]:
        """Tilts and turns, both (k,) float64, rad, at places between the stations.

        xi : (k,) float64, dimensionless
        """
        return PchipInterpolator(self.xi, self.tilt)(xi), PchipInterpolator(self.xi, self.turn)(xi)


@dataclass(frozen=True, eq=False)
class MatchedPasses:
    """Passes of an end over a surface.

    iso     : the surface over the unit square, passes along xi
    tool    : ToolBody, a flat or a bull nose
    run_out : share of the unit square by which a pass runs over its ends
    """

    iso: IsoSurface
    tool: ToolBody
    wanted: MatchTolerances
    run_out: float

    @classmethod
    def over(cls, iso: IsoSurface, tool: ToolBody, wanted: MatchTolerances) -> MatchedPasses:
        """Passes over a surface, which is continued beyond its border for them.

        Raises
        ------
        GeometryError
            Code 'bad_surface': the surface cannot be continued that far (``NurbsSurface.extended``); as ``strip``.
        """
        xi = np.linspace(0.0, 1.0, STATIONS)
        length = min(float(np.linalg.norm(np.diff(iso.contact(xi, np.full(STATIONS, eta))[0], axis=0), axis=1).sum())
                     for eta in (0.0, 0.5, 1.0))
        run_out = min(longest_lag(tool) / length, MAX_RUN_OUT)
        first = cls(replace(iso, surface=iso.surface.extended(run_out + MARGIN)), tool, wanted, run_out)
        farthest = min(SPARE_RUN_OUT * max(first.lag(eta) for eta in (0.0, 0.5, 1.0)), MAX_RUN_OUT)
        if farthest <= run_out:
            return first
        return cls(replace(iso, surface=iso.surface.extended(farthest + MARGIN)), tool, wanted, farthest)

    def lag(self, eta: float) -> float:
        """Largest distance in xi by which the edges of a strip at eta lie behind the contact, turned as in the plan.

        Raises
        ------
        GeometryError
            As ``strip``.
        """
        turn = self.widest_turns(eta)
        s = self.strip(eta, turn)
        at = self.contacts(s.xi, eta)
        edges = strip_edges(*self.nose.heights(at, s.tilt, turn), self.wanted.scallop)
        return max(float(np.abs(self.iso.square(e, s.xi, np.full(len(s.xi), eta))[0] - s.xi).max()) for e in edges)

    @property
    def nose(self) -> Nose:
        """The nose of the tool over the part of the surface that passes use."""
        low, high = self.iso.surface.domain
        room = MARGIN / (1.0 + 2.0 * (self.run_out + MARGIN)) * (high - low)
        return Nose(self.iso.surface, self.tool, np.stack([low + room, high - room]))

    @property
    def stations(self) -> F64:
        """Stations of a pass, xi (m,) float64, dimensionless."""
        count = math.ceil((STATIONS - 1) * (1.0 + 2.0 * self.run_out)) + 1
        return np.linspace(-self.run_out, 1.0 + self.run_out, count)

    @property
    def counted(self) -> NDArray[np.bool_]:
        """Whether stations count, (m,) bool: the borders lie between these; cuts beyond them do not matter."""
        beyond = np.abs(self.stations - 0.5) - 0.5
        return np.asarray(beyond < np.ptp(self.stations) / (len(self.stations) - 1))

    def contacts(self, xi: F64, eta: float) -> PassContacts:
        """Contacts of the pass at eta.

        xi : (k,) float64, dimensionless
        """
        level = np.full(len(xi), eta)
        along = self.iso.tangents(np.clip(xi, 0.0, 1.0), np.clip(level, 0.0, 1.0))[0]
        return PassContacts.on(self.iso.surface, self.iso.parameters(xi, level), along)

    def strip(self, eta: float, turn: F64) -> MatchedStrip:
        """The pass at eta.

        turn : (m,) float64, rad, of the tilt at the stations, from the feed to its left

        Raises
        ------
        GeometryError
            Code 'bad_pass': at some station no tilt keeps the nose out of the surface.
        """
        xi, wanted = self.stations, self.wanted
        at = self.contacts(xi, eta)
        tilt = self.nose.least_tilt(at, turn, wanted.depth, wanted.least_tilt)
        bad = np.flatnonzero(np.isnan(tilt))
        if len(bad):
            where = ", ".join(f"{v:.3f}" for v in at.point[bad[0]])
            raise GeometryError(f"{self.tool.id}: no tilt keeps the end of the tool out of the surface at ({where})",
                                code="bad_pass", subjects=(self.tool.id, f"({where})"),
                                remedy="take a smaller tool or a ball")
        tilt = _evened(tilt)
        # between the contact and an edge a turned nose reaches ahead of both
        ahead = xi + self.tool.radius * (1.0 - np.cos(turn)) / np.linalg.norm(np.gradient(at.point, xi, axis=0), axis=1)
        sides, ends = [], [0.0, 1.0]
        for half in strip_edges(*self.nose.heights(at, tilt, turn), wanted.scallop):
            x, e = self.iso.square(half, xi, np.full(len(xi), eta))
            order = np.argsort(x, kind="stable")
            sides.append(np.interp(xi, x[order], e[order]))
            ends[0] = min(ends[0], float(xi[np.maximum(x, ahead) <= 0.0].max(initial=xi[0])))
            ends[1] = max(ends[1], float(xi[x >= 1.0].min(initial=xi[-1])))
        sides = sides if sides[0].sum() > sides[1].sum() else sides[::-1]
        return MatchedStrip(eta, xi, tilt, turn, np.minimum(sides[1], eta), np.maximum(sides[0], eta),
                     (ends[0], ends[1]))

    def lay_out(self) -> list[MatchedStrip]:
        """Passes from one border to the other, as few as the scallop allows.

        Raises
        ------
        GeometryError
            Code 'bad_pass': more than MAX_PASSES are needed; as ``strip``.
        """
        out: list[MatchedStrip] = []
        edge, step = np.zeros(len(self.stations)), FIRST_STEP
        while edge[self.counted].min() < 1.0 and (not out or out[-1].eta < 1.0):
            if len(out) == MAX_PASSES:
                raise GeometryError(f"{self.tool.id}: {MAX_PASSES} passes of its end cover only {out[-1].eta:.2f} of "
                                    "the surface", code="bad_pass", subjects=(self.tool.id,), measured=out[-1].eta,
                                    limit=1.0, remedy="take a ball, or allow a higher scallop")
            begin = out[-1].eta if out else 0.0
            out.append(self._next(edge, begin, step))
            edge, step = out[-1].high, max(out[-1].eta - begin, MIN_STEP)
        return out

    def widest_turns(self, eta: float) -> F64:
        """Turns of the tilt at the stations of a pass, (m,) float64, rad, that make the narrower side of its strip
        widest.

        Notes
        -----
        The nose may match best with its tangent off the direction square to the feed: where the principal directions
        lie aside, or where the curvature grows to one side. Dynamic programming over a few turns at each station takes
        the widest chain, less a cost of turning.
        """
        at = self.contacts(self.stations, eta).every(SPARSE)
        count = len(at.uv)
        widths = np.empty((len(TURNS), count))
        for k, angle in enumerate(TURNS):
            turn = np.full(count, angle)
            tilt = self.nose.least_tilt(at, turn, self.wanted.depth, self.wanted.least_tilt)
            edges = strip_edges(*self.nose.heights(at, np.nan_to_num(tilt), turn), self.wanted.scallop)
            left, right = (((self.iso.surface.points(np.clip(e, *self.iso.surface.domain)) - at.point) * at.left).sum(1)
                           for e in edges)
            widths[k] = np.where(np.isnan(tilt), 0.0, 2.0 * np.minimum(left, -right))
        cost = TURN_COST * self.tool.radius * np.abs(TURNS[:, None] - TURNS)
        best, back = widths[:, 0], np.zeros((count, len(TURNS)), np.int64)
        for m in range(1, count):
            through = best[None, :] - cost
            back[m] = through.argmax(axis=1)
            best = widths[:, m] + through.max(axis=1)
        out = [int(best.argmax())]
        for m in range(count - 1, 0, -1):
            out.append(int(back[m, out[-1]]))
        turns = np.interp(self.stations, self.stations[::SPARSE], TURNS[out[::-1]])
        return np.convolve(np.pad(turns, len(EVEN) // 2, mode="edge"), EVEN, "valid")

    def _next(self, edge: F64, begin: float, step: float) -> MatchedStrip:
        """The farthest pass beyond ``begin`` whose strip still reaches ``edge`` all along, to SOLVED of the step."""
        def miss(s: MatchedStrip) -> float:
            return float(np.where((edge < 1.0) & self.counted, s.low - edge, -np.inf).max())

        turn = self.widest_turns(min(begin + step, 1.0))
        kept = self.strip(min(begin + MIN_STEP, 1.0), turn)
        under, over = miss(kept), None
        if under > 0.0:  # a strip narrower than the least step: other passes take the rest beside it
            return kept
        upper = trial = min(begin + step, 1.0)
        for _ in range(TRIALS):
            tried = self.strip(trial, turn)
            off = miss(tried)
            if off <= 0.0:
                kept, under = tried, off
                if trial >= 1.0 or off > -SOLVED * step:
                    break
            else:
                upper, over = trial, off
            if over is None:
                trial = min(trial + max(-0.5 * off, 0.1 * step), 1.0)
            else:
                trial = kept.eta + (upper - kept.eta) * float(np.clip(under / (under - over), 0.05, 0.95))
        return kept

    def stands(self, at: PassContacts, tilt: F64, turn: F64) -> tuple[F64, F64]:
        """Tips, mm, and unit axes at contacts, both (k, 3) float64, access frame.

        tilt, turn : (k,) float64, rad
        """
        axis = self.nose.axes(at, tilt, turn)
        return tips(at.point, at.normal, self.tool, axis), axis

    def poses(self, s: MatchedStrip, xi: F64) -> tuple[F64, F64, F64]:
        """Tips, mm, unit axes and unit normals of a pass, each (k, 3) float64, access frame.

        xi : (k,) float64, dimensionless
        """
        at = self.contacts(xi, s.eta)
        return *self.stands(at, *s.leans(xi)), at.normal

    def located(self, s: MatchedStrip) -> tuple[F64, F64]:
        """Tips, mm, and unit axes of a pass at its ``ways``, both (k, 3) float64, access frame.

        Raises
        ------
        GeometryError
            As ``ways``.
        """
        return self.poses(s, self.ways(s))[:2]

    def ways(self, s: MatchedStrip) -> F64:
        """Places xi (k,) float64, dimensionless, close enough that moves between them add no more than the chord.

        Raises
        ------
        GeometryError
            Code 'bad_pass': steps of a 4096th of a station still add more than the chord.

        Notes
        -----
        A move takes the tip straight and turns the axis on the great circle. Half way, the error of the contact along
        the normal is compared with the chord: the error of the tip, and that of the axis times the radius.
        """
        xi = np.unique(np.clip(s.xi, *s.ends))
        for _ in range(FINEST):
            tip, axis, _ = self.poses(s, xi)
            middle = 0.5 * (xi[1:] + xi[:-1])
            half = axis[1:] + axis[:-1]
            half /= np.linalg.norm(half, axis=1)[:, None]
            true_tip, true_axis, normal = self.poses(s, middle)
            off = 0.5 * (tip[1:] + tip[:-1]) - true_tip
            moved = np.abs((off * normal).sum(axis=1)) + self.tool.radius * np.linalg.norm(half - true_axis, axis=1)
            far = moved > self.wanted.chord
            if not far.any():
                return xi
            xi = np.sort(np.concatenate([xi, middle[far]]))
        raise GeometryError(f"{self.tool.id}: the pass at {s.eta:.4f} turns too fast for a chord of "
                            f"{self.wanted.chord:g} mm", code="bad_pass", subjects=(self.tool.id,),
                            measured=float(moved.max()), limit=self.wanted.chord, remedy="allow a longer chord")


def longest_lag(tool: ToolBody) -> float:
    """Distance, mm, of the edges of a strip as wide as the radius behind the contact, at the largest turn.

    They lie 30 degrees round the nose, 1 - cos(30°) of the radius behind and half the radius aside.
    """
    return tool.radius * (1.0 - math.sqrt(0.75) + 0.5 * math.sin(TURNS[-1]))


def _evened(tilt: F64) -> F64:
    """Tilts that change evenly, none less than it was."""
    out = tilt
    for _ in range(2):
        mean = np.convolve(np.concatenate([out[:1], out, out[-1:]]), [0.25, 0.5, 0.25], "valid")
        out = np.maximum(mean, tilt)
    return out
