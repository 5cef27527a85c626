"""A surface split into pieces that a matched end covers faster one by one [Li1995].

Passes are lines of one eta, and their narrowest place sets their distance. So one place where the end cuts little costs
the whole pass. A surface is split where that place lies in one part, or where the best feed direction turns. Each piece
is fed along one of its sides, with passes of its own.

Notation
    width  : of the strip, mm, in closed form: ``strip_width`` at the least clear tilt
    reach  : (fine, fine) width / (mm per 1 of eta, square to the feed): how far in eta one pass serves at a place
    passes : integral of 1 / (least reach along the line) over eta, and a half that the last pass cuts beyond the border

A piece costs the length of its lines, and for each line the run-out over its end and the way round to the next. All
pieces over a lattice of the unit square are priced in both feed directions. Of all splits by straight cuts from side
to side the cheapest wins; each cut must gain at least MIN_GAIN. docs/theory/matching.md shows how near that comes to
the real passes. Arrays are float64; xi and eta are parameters of the unit square, dimensionless.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.five_axis.curvature_matching import clear_tilt, mean_direction, strip_width
from toolpath.five_axis.matched_passes import MAX_RUN_OUT, TURNS, MatchTolerances, longest_lag
from toolpath.kernels.parted import price_rows
from toolpath.passes.isoparametric_passes import IsoSurface

CELLS = 16  # each way, between which cuts lie
FINE = 4  # places a cell, each way, at which strips are looked at
MIN_GAIN = 0.05  # share of the way that a cut must gain: less lies within the error of the closed form
LAST = 0.5  # of a pass, which the last one of a piece cuts beyond its border

Rectangle = tuple[int, int, int, int]
"""A piece in cells: least and greatest column (xi), least and greatest row (eta)."""
Priced = tuple[float, tuple[tuple[bool, Rectangle], ...]]
"""What pieces cost together, mm, and each with whether it is fed across."""


@dataclass(frozen=True, eq=False)
class Feed:
    """One feed direction at places of the lattice, rows along eta.

    reach  : (m, m) float64, share of the unit square that one pass serves square to itself
    length : (m, m) float64, mm per 1 of the unit square, along the feed
    """

    reach: F64
    length: F64


@dataclass(frozen=True, eq=False)
class SurfacePiece:
    """A piece of a surface with its feed direction.

    iso       : the piece over the unit square, passes along xi
    low, high : (2,) float64, its corners, xi and eta of the surface it was cut from
    passes    : float, count, expected passes, with a half beyond the border
    way       : float, mm, expected way: lines, run-outs over their ends, and the way round
    spread    : float, dimensionless, 0 where the best feed is the same all over the piece, 1 where it cancels
    """

    iso: IsoSurface
    low: F64
    high: F64
    passes: float
    way: float
    spread: float


def parted(iso: IsoSurface, tool: ToolBody, wanted: MatchTolerances, *, round_way: float | None = None,
           cut: bool = True) -> list[SurfacePiece]:
    """The pieces of a surface, each fed in its shorter direction; one piece where a split does not pay.

    tool      : ToolBody, a flat or a bull nose
    wanted    : MatchTolerances; scallop and least tilt define the strips
    round_way : mm of feed that the way from the end of a pass to the next one is worth; None: the diameter
    cut       : False for the whole surface in one piece, fed in the better direction

    Raises
    ------
    GeometryError
        As ``IsoSurface.across``. A place where the end does not fit has no reach, and pieces with it have no price:
        ``MatchedPasses`` refuses passes over it.
    """
    feeds = (feed_of(iso, tool, wanted), feed_of(turned(iso), tool, wanted))
    feeds = (feeds[0], Feed(feeds[1].reach.T, feeds[1].length.T))
    lag = longest_lag(tool)
    ends = lag + (2.0 * tool.radius if round_way is None else round_way)
    out = []
    angle, weight = best_feeds(iso)
    for across, (a, b, c, d) in cheapest(feeds, ends, lag, cut):
        low, high = np.array([a, c]) / CELLS, np.array([b, d]) / CELLS
        passes, way = price(feeds, across, (a, b, c, d), ends, lag)
        inside = (slice(c * FINE, d * FINE), slice(a * FINE, b * FINE))
        piece = replace(iso, grid=iso.grid.part(*((low[::-1], high[::-1]) if iso.turned else (low, high))))
        out.append(SurfacePiece(turned(piece) if across else piece, low, high, passes, way,
                        mean_direction(angle[inside], weight[inside])[1]))
    return out


def turned(iso: IsoSurface) -> IsoSurface:
    """The same surface with the feed across its former lines."""
    return replace(iso, turned=not iso.turned)


def middles() -> tuple[F64, F64]:
    """Xi and eta of the places looked at, both (p,) float64, dimensionless, from 0 to 1, row by row of eta."""
    at = (np.arange(CELLS * FINE) + 0.5) / (CELLS * FINE)
    xi, eta = np.meshgrid(at, at)
    return xi.ravel(), eta.ravel()


def feed_of(iso: IsoSurface, tool: ToolBody, wanted: MatchTolerances) -> Feed:
    """Reach and length of a surface fed along its xi, in closed form.

    Notes
    -----
    The tangent of the nose lies along the greatest curvature where the allowed turn reaches it; the strip is then
    cos(turn) as wide square to the feed. Beyond, it lies as near as the turn allows, and the curvatures along and
    square to it follow from Euler's theorem [DoCarmo1976]. The twist of the surface under the nose is left out.
    """
    xi, eta = middles()
    uv = iso.parameters(xi, eta)
    along = iso.tangents(xi, eta)[0]
    k_2, k_1 = np.sort(-iso.surface.curvature(uv), axis=1).T
    first, _ = iso.surface.forms(uv)
    across, k_across = iso.across(xi, eta)
    off = np.arccos(np.sqrt(np.clip((k_across - k_2) / np.maximum(k_1 - k_2, 1e-12), 0.0, 1.0)))
    turn = np.minimum(off, TURNS[-1])
    share = np.cos(off - turn) ** 2
    k_l, k_f = share * k_1 + (1.0 - share) * k_2, share * k_2 + (1.0 - share) * k_1
    tilt = np.fmax(clear_tilt(k_1, tool), wanted.least_tilt)
    width = strip_width(tilt, k_l, k_f, tool, wanted.scallop) * np.cos(turn)
    width = np.where(np.isnan(clear_tilt(k_1, tool)), 0.0, width)
    e, f, g = first.T
    length = np.sqrt(e * along[:, 0] ** 2 + 2.0 * f * along[:, 0] * along[:, 1] + g * along[:, 1] ** 2)
    shape = (CELLS * FINE, CELLS * FINE)
    return Feed((width / across).reshape(shape), length.reshape(shape))


def best_feeds(iso: IsoSurface) -> tuple[F64, F64]:
    """Angle of the least curvature, which is the best feed direction, to the lines of a surface, and its weight
    [DoCarmo1976].

    Returns
    -------
    angle  : (m, m) float64, rad from the direction along xi, on the surface
    weight : (m, m) float64, mm: area times the difference of both curvatures; a place curved alike all round has no
             best feed
    """
    xi, eta = middles()
    along, over = iso.tangents(xi, eta)
    first, second = iso.surface.forms(iso.parameters(xi, eta))

    def by(form: F64, a: F64, b: F64) -> F64:
        return (form[:, 0] * a[:, 0] * b[:, 0] + form[:, 1] * (a[:, 0] * b[:, 1] + a[:, 1] * b[:, 0])
                + form[:, 2] * a[:, 1] * b[:, 1])

    one = along / np.sqrt(by(first, along, along))[:, None]
    two = over - by(first, over, one)[:, None] * one
    size = np.sqrt(by(first, two, two))
    two /= size[:, None]
    # the greatest of k cos² + 2 t cos sin + q sin² lies at half the angle of (k - q, 2 t), the least square to it
    differ = by(second, one, one) - by(second, two, two) + 2.0j * by(second, one, two)
    area = size * np.sqrt(by(first, along, along))
    shape = (CELLS * FINE, CELLS * FINE)
    return (0.5 * np.angle(-differ)).reshape(shape), (area * np.abs(differ)).reshape(shape)


def price(feeds: tuple[Feed, Feed], across: bool, piece: Rectangle, ends: float, lag: float) -> tuple[float, float]:
    """Passes and way, mm, of a piece fed along xi, or along eta where ``across``.

    feeds : along xi and along eta, both with rows along eta
    piece : in cells
    ends  : mm, cost of each pass besides its line
    lag   : mm, by which a pass runs over its end

    Infinite where a line is too short for the run-out (``MAX_RUN_OUT``), or has no reach.
    """
    a, b, c, d = (FINE * n for n in piece)
    reach, length = feeds[across].reach, feeds[across].length
    if across:
        reach, length, (a, b, c, d) = reach.T, length.T, (c, d, a, b)
    passes, way, mean, shortest = price_rows(reach, length, a, b, c, d, lag)
    if (b - a < CELLS * FINE and lag > MAX_RUN_OUT * shortest) or not math.isfinite(passes):
        return np.inf, np.inf
    return passes + LAST, way + passes * ends + LAST * (mean + ends)


def cheapest(feeds: tuple[Feed, Feed], ends: float, lag: float, cut: bool = True) -> list[tuple[bool, Rectangle]]:
    """The cheapest split of the square by cuts from side to side: for each piece whether it is fed across, and its
    cells.

    feeds, ends, lag : as for ``price``
    cut              : False where the square stays whole
    """
    @cache
    def best(a: int, b: int, c: int, d: int) -> Priced:
        cost, across = min((price(feeds, way, (a, b, c, d), ends, lag)[1], way) for way in (False, True))
        kept: Priced = cost, ((across, (a, b, c, d)),)
        cuts = [((a, m, c, d), (m, b, c, d)) for m in range(a + 1, b) if cut]
        cuts += [((a, b, c, m), (a, b, m, d)) for m in range(c + 1, d) if cut]
        for one, two in cuts:
            (x, p), (y, q) = best(*one), best(*two)
            if x + y < min((1.0 - MIN_GAIN) * cost, kept[0]):
                kept = x + y, p + q
        return kept

    return list(best(0, CELLS, 0, CELLS)[1])
