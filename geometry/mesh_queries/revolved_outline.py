"""Outlines of bodies of revolution: lines and arcs from the tip outwards and upwards.

The half section of a tool is a chain of lines and arcs. In a drop only the lowest point at each radius can touch: the
*lower outline*. Where it bends upwards all the way, the tool is one convex body. Where it bends down (a step to the
shank, a cone that ends in a wider collar), another body begins. That body has a flat bottom from the axis to there,
which adds nothing to the tool. So any tool is a stack of convex bodies, and its tip is the highest tip of any of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from geometry.arc_pair import ArcPair
from geometry.errors import SetupError
from geometry.kernels.outline import Stack
from geometry.mesh import F64

BOWLS = 256  # paraboloids below an outline, evenly spread over the radius
STEEPEST = 5.0  # largest slope of a paraboloid at its radius: at the rim the outline may be upright
SAMPLES = 4096  # places at which the paraboloids are kept below the outline
MIN_GROWTH = 1e-9  # mm, least growth of a radius that counts as wider
CHORD = 1e-3  # mm, largest distance of a chord from its hollow arc


@dataclass(frozen=True)
class OutlineLine:
    """A straight piece to (rho, z), mm."""

    rho: float
    z: float


@dataclass(frozen=True)
class OutlineArc:
    """A piece of a circle to (rho, z) round ``centre`` (rho, z), mm; bulging outwards unless ``hollow``."""

    rho: float
    z: float
    centre: tuple[float, float]
    hollow: bool = False


@dataclass(frozen=True, eq=False)
class Outline:
    """Half section of a tool from its tip, which is at (0, 0) or on the level z = 0.

    pieces : OutlineLine and OutlineArc in order, each from the end of the one before, the first from (0, 0). z never
             falls; rho may fall, and a drop does not meet what lies above a wider place. After the last piece the tool
             goes on upwards as a cylinder.

    Raises
    ------
    SetupError
        A coordinate is not finite or negative, z falls, or an end does not lie on its circle; the subjects name the
        piece.
    """

    pieces: tuple[OutlineLine | OutlineArc, ...]

    def __post_init__(self) -> None:
        at = (0.0, 0.0)
        for k, p in enumerate(self.pieces):
            numbers = (p.rho, p.z, *(p.centre if isinstance(p, OutlineArc) else ()))
            if not all(map(math.isfinite, numbers)) or p.rho < 0.0:
                raise _wrong(k, f"has the end ({p.rho}, {p.z}) mm", "finite, rho >= 0")
            if p.z < at[1] - MIN_GROWTH:
                raise _wrong(k, f"falls from z = {at[1]} to {p.z} mm", "z never falls")
            if isinstance(p, OutlineArc):
                a, b = math.dist(at, p.centre), math.dist((p.rho, p.z), p.centre)
                if abs(a - b) > 1e-6 * max(a, b) or a <= 0.0:
                    raise _wrong(k, f"begins {a} mm and ends {b} mm from its centre", "one radius")
            at = (p.rho, p.z)
        if not self.radius > 0.0:
            raise SetupError("the outline of a tool has no width", code="bad_cutter", subjects=("outline",),
                             measured=self.radius, limit=0.0, remedy="give it a piece with rho > 0")

    @classmethod
    @lru_cache(maxsize=64)
    def bull(cls, radius: float, corner_radius: float) -> Outline:
        """A ball (corner_radius = radius), a flat end (0) or a bull nose, mm; the same object for the same radii."""
        flat = (OutlineLine(radius - corner_radius, 0.0),) if radius > corner_radius else ()
        arc = (OutlineArc(radius, corner_radius, (radius - corner_radius, corner_radius)),) if corner_radius else ()
        return cls((*flat, *arc))

    @classmethod
    @lru_cache(maxsize=64)
    def tapered(cls, radius: float, corner_radius: float, taper: float, widest: float) -> Outline:
        """A tapered mill: an end as of ``bull``, and a side that leans outwards up to a radius ``widest``, mm.

        taper : tangent of the angle between side and axis, above 0
        """
        long = math.hypot(1.0, taper)
        at = radius - corner_radius * (1.0 - 1.0 / long)
        high = corner_radius * (1.0 - taper / long)
        pieces: list[OutlineLine | OutlineArc] = []
        if radius > corner_radius:
            pieces.append(OutlineLine(radius - corner_radius, 0.0))
        if corner_radius > 0.0:
            pieces.append(OutlineArc(at, high, (radius - corner_radius, corner_radius)))
        if widest > at:
            pieces.append(OutlineLine(widest, high + (widest - at) / taper))
        return cls(tuple(pieces))

    @classmethod
    @lru_cache(maxsize=64)
    def two_arcs(cls, arcs: ArcPair) -> Outline:
        """A circle segment mill."""
        pieces: list[OutlineLine | OutlineArc] = [OutlineLine(arcs.flat, 0.0)] if arcs.flat > 0.0 else []
        pieces.append(OutlineArc(arcs.join, arcs.join_up, (arcs.flat, arcs.low)))
        if arcs.bow > 0.0:
            pieces.append(OutlineArc(arcs.wide, arcs.high, (arcs.out, arcs.up)))
        return cls(tuple(pieces))

    @property
    def radius(self) -> float:
        """Largest radius, mm."""
        return max((p.rho for p in self._cut), default=0.0)

    @cached_property
    def _cut(self) -> list[OutlineLine | OutlineArc]:
        """Pieces with hollow arcs as chords outside of them, arcs cut where they are widest."""
        out: list[OutlineLine | OutlineArc] = []
        at = (0.0, 0.0)
        for p in self.pieces:
            if isinstance(p, OutlineArc):
                c, a = p.centre, math.dist(at, p.centre)
                if p.hollow:
                    out += _chords(at, p)
                elif p.z > c[1] + MIN_GROWTH:  # the arc goes on above its widest place, where a drop does not meet it
                    out.append(OutlineArc(c[0] + a, c[1], c))
                else:
                    out.append(p)
            else:
                out.append(p)
            at = (p.rho, p.z)
        return out

    @cached_property
    def stack(self) -> Stack:
        """The convex bodies as arrays for the kernels."""
        bodies: list[tuple[float, list[F64]]] = []
        rho, z, steepest = 0.0, 0.0, 0.0
        widest = 0.0
        rows: list[F64] = []
        offset = 0.0
        for p in self._cut:
            if p.rho > widest + MIN_GROWTH:
                begin = (rho, z) if rho >= widest - MIN_GROWTH else _where(rho, z, p, widest)
                row = _row(begin, p)
                if rows and row[4] < steepest - 1e-9:
                    bodies.append((offset, rows))
                    rows = []
                if not rows:
                    offset = begin[1]
                    if begin[0] > 0.0:
                        rows.append(np.array([0.0, begin[0], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
                row[[2, 3]] -= offset
                row[7] -= offset if row[8] > 0.0 else 0.0
                rows.append(row)
                widest, steepest = p.rho, float(row[5])
            elif p.z > z + MIN_GROWTH and rho >= widest - MIN_GROWTH:
                steepest = 1.0  # an upright stretch: a wider place above it belongs to another body
            rho, z = p.rho, p.z
        bodies.append((offset, rows))
        tables = [np.array(r) for _, r in bodies]
        first = np.concatenate([[0], np.cumsum([len(t) for t in tables])]).astype(np.int64)
        return Stack(np.concatenate(tables), first, np.stack([_bowls(t) for t in tables]),
                     np.array([o for o, _ in bodies]))


def _wrong(k: int, fault: str, limit: str) -> SetupError:
    return SetupError(f"piece {k + 1} of the outline {fault}", code="bad_cutter", subjects=(f"piece {k + 1}",),
                      limit=limit, remedy="give the half section from the tip upwards in mm")


def _row(begin: tuple[float, float], p: OutlineLine | OutlineArc) -> F64:
    """One piece from ``begin`` on as a row for the kernels, z as it stands."""
    if isinstance(p, OutlineArc):
        (c, level), a = p.centre, math.dist(begin, p.centre)
        sines = [min(max((rho - c) / a, 0.0), 1.0) for rho in (begin[0], p.rho)]
        return np.array([begin[0], p.rho, begin[1], p.z, *sines, c, level, a])
    rise, run = p.z - begin[1], p.rho - begin[0]
    sine = rise / math.hypot(rise, run)
    return np.array([begin[0], p.rho, begin[1], p.z, sine, sine, 0.0, 0.0, 0.0])


def _where(rho: float, z: float, p: OutlineLine | OutlineArc, widest: float) -> tuple[float, float]:
    """Where a piece from (rho, z) passes a radius."""
    if isinstance(p, OutlineArc):
        (c, level), a = p.centre, math.dist((rho, z), p.centre)
        return widest, level - math.sqrt(max(a * a - (widest - c) ** 2, 0.0))
    return widest, z + (p.z - z) * (widest - rho) / (p.rho - rho)


def _chords(at: tuple[float, float], p: OutlineArc) -> list[OutlineLine | OutlineArc]:
    """A hollow arc as chords, which lie in the tool's air: the tool becomes larger by at most CHORD."""
    (c, level), a = p.centre, math.dist(at, p.centre)
    begin, end = (math.atan2(z - level, rho - c) for rho, z in (at, (p.rho, p.z)))
    turn = math.remainder(end - begin, 2 * math.pi)
    n = max(1, math.ceil(abs(turn) / (2 * math.acos(max(1.0 - CHORD / a, 0.0)))))
    angles = begin + turn * np.arange(1, n) / n
    inner = [OutlineLine(c + a * math.cos(t), level + a * math.sin(t)) for t in angles.tolist()]
    return [*inner, OutlineLine(p.rho, p.z)]


def _bowls(table: F64) -> F64:
    """(BOWLS + 1, 4) paraboloids below an outline, as ``geometry.kernels.outline`` reads them.

    Each leans at its radius as the outline does, up to STEEPEST. h is convex, so between two places of a fine division
    it lies above the chord before them, produced; less k/2 rho^2 that is lowest at one of the two places, and the least
    of all bounds c from below.
    """
    radius = float(table[-1, 1])
    rho = np.union1d(np.linspace(0.0, radius, SAMPLES + 1), table[:, 1])
    h, step = heights(table, rho), np.diff(rho)
    chord = np.diff(h) / step
    ahead = np.concatenate([[0.0], h[1:-1] + chord[:-1] * step[1:]])  # at each next place, on the chord before
    at = np.linspace(0.0, radius, BOWLS + 1)
    at[0] = 0.25 * at[1]
    k = np.clip(np.searchsorted(rho, at) - 1, 0, len(step) - 1)
    bend = np.maximum(np.minimum(chord[k], STEEPEST) / at, 1e-6 / radius)
    half = 0.5 * bend[:, None]
    low = np.minimum((h - half * rho**2).min(axis=1), (ahead - half * rho[1:] ** 2).min(axis=1))
    rim = np.full(BOWLS + 1, np.inf)
    if table[-1, 5] < 1.0:  # from the steepest chord to the rim on, taken over rho^2; the places leave out a little
        rim[0] = (2.0 * (h[-1] - h[:-1]) / (radius**2 - rho[:-1] ** 2)).max() * (1.0 + 1e-6)
        rim[1] = 1e-6 * radius
    return np.column_stack([bend, low, np.full(BOWLS + 1, BOWLS / radius), rim])


def heights(table: F64, rho: F64) -> F64:
    """Height h of the outline of one body at radii, mm.

    table : (k, 9) float64, mm, rows of the body for the kernels, in the plane of the half section
    rho   : float64 of any shape such as (n,), mm, radii within those of the body

    Returns (n,) float64, mm, or the other shape of rho.
    """
    k = np.minimum(np.searchsorted(table[:, 1], rho), len(table) - 1)
    s = table[k]
    t = np.clip(rho, s[..., 0], s[..., 1])
    arc = s[..., 8] > 0.0
    bow = s[..., 7] - np.sqrt(np.maximum(s[..., 8] ** 2 - (t - s[..., 6]) ** 2, 0.0))
    return np.where(arc, bow, s[..., 2] + (t - s[..., 0]) * (s[..., 3] - s[..., 2]) / (s[..., 1] - s[..., 0]))
