"""A trimmed region of the parameters of a surface as pieces, each a smooth map of the unit square.

1. Holes are filled. Passes run over them, and the walk along the passes leaves out stretches without surface.
2. Where the border turns inwards sharply (an L, a slit), the region is cut straight across to the nearest border. No
   known grid is free of folds at such a corner (docs/theory/isoparametric.md).
3. Each piece gets its four corners (``geometry.parameterization.region_corners``) and the first of these grids that
   does not fold: fronts from two sides; fronts blended with Laplace's grid by a quarter, a half, three quarters;
   Laplace's grid; the triangulated piece laid into the square. Where all fold, the turn is measured over more of the
   border, and the piece is cut where that turns inwards.

Each piece keeps notes of filled holes, cuts and rejected grids.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import shapely
from scipy.spatial import QhullError
from shapely.ops import split

from geometry.errors import GeometryError
from geometry.mesh import F64
from geometry.parameterization.grid_map import GridMap
from geometry.parameterization.laplace_grid import laplace
from geometry.parameterization.moving_fronts import interpolated
from geometry.parameterization.planar_embedding import embedded, grid_of, triangulated
from geometry.parameterization.quad_grid import Quad, evenness
from geometry.parameterization.region_corners import Corners, find_corners

INWARDS = np.radians(50.0)  # a border that turns inwards by more is cut there
NEAR = (0.002, 0.01, 0.03)  # of the border, to each side: such a turn is measured over it, the wider ones if needed
MAX_CUTS = 24
BLENDS = (0.25, 0.5, 0.75)
MIN_PIECE = 1e-4  # of the region: smaller pieces are dropped
TAIL = 0.03  # of the region: a smaller piece that folds may be left out
THIN = (0.004, 0.008)  # of the border: half the largest width of a tail


class Method(StrEnum):
    """Method that maps a piece to the unit square."""

    FRONTS = "fronts"
    BLEND = "blend"
    LAPLACE = "laplace"
    EMBEDDED = "embedded"


@dataclass(frozen=True, eq=False)
class Squared:
    """A piece of a region over the unit square.

    map      : GridMap to (u, v)
    method   : Method
    evenness : ratio of largest to smallest area of a cell, and of the distance of neighbouring lines, dimensionless
    corners  : (4, 2) float64, parameters (u, v), dimensionless, counterclockwise from xi = eta = 0
    notes    : filled holes, cuts and rejected grids, with figures
    """

    map: GridMap
    method: Method
    evenness: tuple[float, float]
    corners: F64
    notes: tuple[str, ...]


def squared(loops: tuple[F64, ...], scale: tuple[float, float], shape: tuple[int, int] = (31, 41),
            only: Method | None = None) -> list[Squared]:
    """The pieces of a region, each mapped to the unit square, by the grids of [Sarkar2015] where they do not fold.

    loops : closed borders (k, 2) float64, parameters (u, v), dimensionless; first place not repeated, the outer border
            first, in either direction
    scale : mm by 1 of u and of v, so that lengths in the plane are about those on the surface
    shape : places of a grid along eta and along xi
    only  : one method, for comparisons

    Returns
    -------
    list of Squared
        Xi runs along the longer sides. Pieces and thin tails below 3 % of the area that fold with every method are
        left out, and the notes of the others name their area.

    Raises
    ------
    GeometryError
        Code 'no_square': a piece folds with every method. Code 'bad_border': a border crosses itself or has no area.
    """
    by = np.asarray(scale, dtype=np.float64)
    notes = [f"{len(loops) - 1} holes filled"] if len(loops) > 1 else []
    outer = shapely.Polygon(np.asarray(loops[0]) * by)
    if not outer.is_valid or outer.area <= 0.0:
        raise GeometryError("a border crosses itself or has no area", code="bad_border",
                            measured=float(outer.area), limit=0.0, remedy="trim the face again")
    out: list[Squared] = []
    left = 0.0
    todo = [(piece, 0) for piece in _cut(outer, NEAR[0])]
    while todo:
        piece, k = todo.pop(0)
        try:
            out.append(_laid(piece, by, shape, only, tuple(notes)))
        except GeometryError as refusal:
            if refusal.code != "no_square":
                raise
            if piece.area < TAIL * outer.area:
                left += piece.area
                continue
            parts, k = _smaller(piece, k)
            if not parts:
                raise
            left += piece.area - sum(part.area for part in parts)
            todo[:0] = [(part, k) for part in parts]
    if left > MIN_PIECE * outer.area:
        tails = f"thin tails of {left:.3g} mm² are left out, because they fold with every method"
        out = [replace(piece, notes=(tails, *piece.notes)) for piece in out]
    if len(out) > 1:
        cut = f"cut into {len(out)} pieces where the border turns inwards by more than 50 degrees"
        out = [replace(piece, notes=(cut, *piece.notes)) for piece in out]
    return out


def _smaller(piece: shapely.Polygon, k: int) -> tuple[list[shapely.Polygon], int]:
    """A folding piece without its thin tails, or cut by a turn over more of its border than NEAR[k], and the new k.

    The list is empty where the piece has neither.
    """
    for thin in THIN:
        wide = thin * piece.length
        body = piece.buffer(-wide, join_style="mitre").buffer(wide, join_style="mitre", mitre_limit=10.0)
        bodies = [p for p in getattr(body, "geoms", [body]) if p.area > TAIL * piece.area]
        if bodies and 1e-6 < 1.0 - sum(p.area for p in bodies) / piece.area < TAIL:
            return bodies, k
    for more in range(k + 1, len(NEAR)):
        parts = _cut(piece, NEAR[more])
        if len(parts) > 1:
            return parts, more
    return [], k


def _ring(piece: shapely.Polygon) -> F64:
    """(n, 2) border, mm, counterclockwise, no two equal places."""
    ring = shapely.get_coordinates(shapely.geometry.polygon.orient(piece).exterior)[:-1]
    apart = np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1)
    return np.asarray(ring[apart > 1e-9 * piece.length])


def _even_ring(piece: shapely.Polygon, spacing: float) -> F64:
    """The border with places no farther apart than ``spacing`` mm, its own places included."""
    ring = _ring(piece)
    edge = np.roll(ring, -1, axis=0) - ring
    count = np.ceil(np.linalg.norm(edge, axis=1) / spacing).astype(np.int64)
    first = np.repeat(np.arange(len(ring)), count)
    share = (np.arange(len(first)) - (np.cumsum(count) - count)[first]) / count[first]
    return np.asarray(ring[first] + share[:, None] * edge[first])


def _cut(region: shapely.Polygon, near: float) -> list[shapely.Polygon]:
    """The region in pieces without a sharp turn inwards; at most 24 cuts."""
    done: list[shapely.Polygon] = []
    todo = [region]
    while todo:
        piece = todo.pop()
        cut = _chord(piece, near) if len(done) + len(todo) < MAX_CUTS else None
        parts = [p for p in split(piece, cut).geoms if p.area > MIN_PIECE * region.area] if cut is not None else []
        if len(parts) < 2:
            done.append(piece)
        else:
            todo.extend(parts)
    return done


def _chord(piece: shapely.Polygon, near: float) -> shapely.LineString | None:
    """The shortest straight cut from the sharpest inward turn: along either side produced, or between them."""
    ring = _even_ring(piece, 0.25 * near * piece.length)
    way = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
    at = np.concatenate([[0.0], np.cumsum(way)])
    long = np.concatenate([at[:-1] - at[-1], at, at[1:] + at[-1]])
    tour = np.vstack([ring, ring, ring, ring[:1]])

    def place(s: F64) -> F64:
        return np.column_stack([np.interp(s, long, tour[:, c]) for c in (0, 1)])

    back, ahead = ring - place(at[:-1] - near * at[-1]), place(at[:-1] + near * at[-1]) - ring
    turn = np.arctan2(back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0], (back * ahead).sum(axis=1))
    turn = np.where(turn > np.pi - 1e-6, -np.pi, turn)  # the tip of a slit
    k = int(turn.argmin())
    if turn[k] > -INWARDS:
        return None
    one, two = back[k] / np.linalg.norm(back[k]), -ahead[k] / np.linalg.norm(ahead[k])
    best = None
    for heading in (one, two, one + two):
        length = np.linalg.norm(heading)
        if length < 1e-6:
            continue
        heading = heading / length
        start = ring[k]
        beam = shapely.LineString([start + 1e-6 * at[-1] * heading, start + 2.0 * at[-1] * heading])
        inside = shapely.intersection(beam, piece)
        first = next((g for g in (inside.geoms if hasattr(inside, "geoms") else [inside])
                      if g.length > 0 and shapely.Point(start).distance(g) < 1e-5 * at[-1]), None)
        if first is not None and (best is None or first.length < best[0]):
            end = start + (first.length + 2e-6 * at[-1]) * heading
            best = (first.length, shapely.LineString([start - 1e-6 * at[-1] * heading, end]))
    return None if best is None else best[1]


def _laid(piece: shapely.Polygon, scale: F64, shape: tuple[int, int], only: Method | None,
          notes: tuple[str, ...]) -> Squared:
    """One piece over the unit square, by the first grid that does not fold."""
    m, n = shape
    ring = _even_ring(piece, piece.length / 400.0)
    corners = _along_the_longer(find_corners(ring), ring)
    sides = corners.sides(ring)
    quad = Quad.of(sides, n, m)
    tried: list[str] = []
    for method, blend in ((Method.FRONTS, 0.0), *((Method.BLEND, w) for w in BLENDS), (Method.LAPLACE, 1.0),
                          (Method.EMBEDDED, 0.0)):
        if only is not None and method is not only:
            continue
        try:
            grid = _grid(method, blend, quad, piece, sides, shape)
            mapped = GridMap.of(grid / scale)
        except (GeometryError, QhullError) as refusal:  # QhullError where places of a sliver lie on one line
            tried.append(f"{method}{f' {blend:g}' if method is Method.BLEND else ''}: {refusal}")
            continue
        return Squared(mapped, method, evenness(grid), grid[[0, 0, -1, -1], [0, -1, -1, 0]] / scale,
                       (*notes, *tried))
    middle = (shapely.get_coordinates(piece.representative_point())[0] / scale).round(4).tolist()
    raise GeometryError(f"a piece of a region around uv {middle} folds with every method",
                        code="no_square", subjects=(f"uv {middle}",), measured=tried, limit=0,
                        remedy="machine it by another strategy")


def _along_the_longer(corners: Corners, ring: F64) -> Corners:
    """The corners in an order that makes bottom and top the longer sides."""
    length = [float(np.linalg.norm(np.diff(s, axis=0), axis=1).sum()) for s in corners.sides(ring)]
    if length[0] + length[2] >= length[1] + length[3]:
        return corners
    return Corners(np.roll(corners.at, -1), np.roll(corners.turn, -1), corners.sharp, corners.cost)


def _grid(method: Method, blend: float, quad: Quad, piece: shapely.Polygon, sides: tuple[F64, F64, F64, F64],
          shape: tuple[int, int]) -> F64:
    """A grid (m, n, 2), mm, of a piece."""
    if method is Method.EMBEDDED:
        places, faces, rows = triangulated(sides, float(np.sqrt(piece.area)) / 60.0)
        return grid_of(places, faces, embedded(places, faces, rows), shape[1], shape[0])
    if method is Method.LAPLACE:
        return laplace(quad)[0]
    fronts = interpolated(quad)
    return fronts if not blend else (1.0 - blend) * fronts + blend * laplace(quad)[0]
