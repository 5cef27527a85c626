"""Re-parameterisation that cannot fold: a triangulated region laid into the unit square.

The border goes onto the sides of the square by its length. Every inner place becomes a mean of its neighbours with
positive weights; then no triangle turns over, because the square is convex [Tutte1963, Floater1997]. Mean value weights
make the map nearly harmonic on the surface of the triangles [Floater2003]. Where the surface is stretched against the
square, the weights towards stretched places are lowered and the map is solved again, as long as it becomes more even
[Yoshizawa2004]. The weights stay positive, so nothing folds, and bulges inwards do not crowd.
"""

from __future__ import annotations

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay, cKDTree

from geometry.errors import GeometryError
from geometry.mesh import F64, TriangleMesh
from geometry.mesh_queries.bvh import TriangleTree
from geometry.mesh_queries.nearest import nearest
from geometry.parameterization.quad_grid import even

MAX_ROUNDS = 20
ROUNDS = 12  # rounds that put places on edges between two places of the border
MIN_TURN = 1e-12  # of the mean area in the square: a smaller triangle counts as flat


def embedded(vertices: F64, faces: np.ndarray, sides: tuple[np.ndarray, ...]) -> F64:
    """Places in the unit square of the vertices of a region [Tutte1963, Floater1997, Floater2003, Yoshizawa2004].

    vertices : (k, 2) or (k, 3) float64, mm, of a plane region or of a piece of surface, without holes; any frame
    faces    : (m, 3) int64, index, counterclockwise
    sides    : (s,) int64, index of the vertices along bottom, right, top and left, each beginning where the one
               before ends

    Returns
    -------
    (k, 2) float64, dimensionless, xi and eta in the unit square; every triangle lies counterclockwise

    Raises
    ------
    GeometryError
        Code 'flat_triangle': an edge joins two places of one side through the region, so that the part it cuts off has
        no area. The triangulation needs a place between them.
    """
    place = np.full((len(vertices), 2), np.nan)
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    for k, side in enumerate(sides):
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(vertices[side], axis=0), axis=1))])
        place[side] = corner[k] + (way / way[-1])[:, None] * (corner[(k + 1) % 4] - corner[k])
    start, end, weight = _mean_values(vertices, faces)
    held = ~np.isnan(place[:, 0])
    best, least = place, np.inf
    for _ in range(MAX_ROUNDS):
        laid = _solved(place, held, start, end, weight)
        stretch, total = _stretch(vertices, faces, laid)
        if not total < least:
            break
        best, least = laid, total
        weight = weight / stretch[end]
    flat = _turn(best, faces)
    flat = np.where(np.isfinite(flat), flat, -np.inf)
    if flat.min() <= MIN_TURN * np.abs(flat).mean():
        worst = int(flat.argmin())
        at = vertices[faces[worst]].mean(axis=0)
        raise GeometryError("a triangle of the region is laid flat on a side of the square", code="flat_triangle",
                            subjects=(f"triangle {worst}", f"({', '.join(f'{x:.3f}' for x in at)})"),
                            measured=float(flat.min()), limit=0.0,
                            remedy="split the edges that join two places of one side")
    return best


def triangulated(sides: tuple[F64, ...], spacing: float) -> tuple[F64, np.ndarray, tuple[np.ndarray, ...]]:
    """A plane region as triangles that ``embedded`` takes.

    sides   : bottom, right, top and left, (k, 2) float64, mm, in one plane, each beginning where the one before ends
    spacing : mm, approximate distance between places

    Returns
    -------
    Places (k, 2) float64, mm, in the plane of the region, triangles (t, 3) int32, index, counterclockwise, and the
    places along each side. No edge joins two places of the border through the region: it gets a place half way.
    """
    border: list[F64] = []
    rows = []
    for side in sides:
        length = np.linalg.norm(np.diff(side, axis=0), axis=1).sum()
        line = even(side, max(3, int(np.ceil(length / spacing)) + 1))
        rows.append(np.arange(len(border), len(border) + len(line)))
        border += list(line[:-1])
    count, edge = len(border), np.array(border)
    region = shapely.Polygon(edge)
    low, high = edge.min(axis=0), edge.max(axis=0)
    x, y = np.meshgrid(np.arange(low[0], high[0], spacing), np.arange(low[1], high[1], 0.866 * spacing))
    x[1::2] += 0.5 * spacing
    lattice = np.column_stack([x.ravel(), y.ravel()])
    places = np.vstack([edge, lattice[shapely.contains_xy(region.buffer(-0.5 * spacing), *lattice.T)]])
    for _ in range(ROUNDS):
        faces = Delaunay(places).simplices
        middle = places[faces].mean(axis=1)
        faces = faces[shapely.contains_xy(region, *middle.T)]
        edges, shared = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0,
                                  return_counts=True)
        chords = edges[(edges < count).all(axis=1) & (shared == 2)]
        middle = places[chords].mean(axis=1)
        # a place that exists already was the corner of a triangle without area
        middle = middle[cKDTree(places).query(middle)[0] > 1e-6 * spacing]
        if not len(middle):
            break
        places = np.vstack([places, middle])
    a, b, c = (places[faces[:, k]] for k in range(3))
    over = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    faces[over] = faces[over][:, ::-1]
    return places, faces, tuple(r % count for r in rows)


def grid_of(vertices: F64, faces: np.ndarray, laid: F64, n: int, m: int) -> F64:
    """(m, n, d) float64, mm: the places of a region that lie at an even grid of the unit square.

    vertices : (k, d) float64, mm, frame of the region
    faces    : (t, 3) int64, index of the vertices of each triangle, counterclockwise
    laid     : (k, 2) float64, dimensionless, places in the unit square from ``embedded``
    """
    x, y = np.meshgrid(np.linspace(0.0, 1.0, n), np.linspace(0.0, 1.0, m))
    row, share = located(laid, faces, np.column_stack([x.ravel(), y.ravel()]))
    return np.einsum("ij,ijk->ik", share, vertices[faces[row]]).reshape(m, n, -1)


def located(laid: F64, faces: np.ndarray, places: F64) -> tuple[np.ndarray, F64]:
    """Triangle and barycentric coordinates of places among triangles of a plane.

    laid   : (k, 2) float64, mm or dimensionless, corners in the plane
    faces  : (t, 3) int64, index, counterclockwise
    places : (n, 2) float64, mm or dimensionless, in the same plane

    Returns
    -------
    (n,) int64, index of the triangle each place lies in, or the nearest one, and (n, 3) float64, dimensionless, its
    barycentric coordinates
    """
    flat = TriangleMesh(np.column_stack([laid, np.zeros(len(laid))]), faces.astype(np.int32),
                        np.zeros(len(faces), np.int32))
    _, row, _ = nearest(TriangleTree(flat), np.column_stack([places, np.zeros(len(places))]))
    a, b, c = (laid[faces[row, k]] for k in range(3))
    share = np.column_stack([_cross(b - places, c - places), _cross(c - places, a - places),
                             _cross(a - places, b - places)])
    return row, share / _cross(b - a, c - a)[:, None]


def _mean_values(vertices: F64, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, F64]:
    """Directed edges, start and end (e,), and their mean value weights, (e,) 1/mm; both triangles of an edge add."""
    start, end, weight = [], [], []
    for k in range(3):
        i, j, o = faces[:, k], faces[:, (k + 1) % 3], faces[:, (k + 2) % 3]
        u, v = vertices[j] - vertices[i], vertices[o] - vertices[i]
        lu, lv = np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)
        half = np.tan(0.5 * np.arccos(np.clip((u * v).sum(axis=1) / (lu * lv), -1.0, 1.0)))
        start += [i, i]
        end += [j, o]
        weight += [half / lu, half / lv]
    return np.concatenate(start), np.concatenate(end), np.concatenate(weight)


def _solved(place: F64, fixed: np.ndarray, start: np.ndarray, end: np.ndarray, weight: F64) -> F64:
    """Places (k, 2) in which every place that is not ``fixed`` is a mean of its neighbours."""
    number = np.full(len(place), -1)
    number[~fixed] = np.arange((~fixed).sum())
    inner = ~fixed[start]
    i, j, w = number[start[inner]], end[inner], weight[inner]
    count = int((~fixed).sum())
    known = np.zeros((count, 2))
    border = fixed[j]
    np.add.at(known, i[border], w[border, None] * place[j[border]])
    total = np.bincount(i, w, count)
    total[total == 0.0] = 1.0  # a place in no triangle may lie anywhere
    system = coo_matrix((np.concatenate([total, -w[~border]]),
                         (np.concatenate([np.arange(count), i[~border]]),
                          np.concatenate([np.arange(count), number[j[~border]]]))), shape=(count, count)).tocsc()
    out = place.copy()
    try:
        out[~fixed] = splu(system).solve(known)
    except RuntimeError as singular:
        raise GeometryError("some triangles of the region are not connected to its border", code="flat_triangle",
                            subjects=("region",), measured=count, limit=0,
                            remedy="triangulate it as one piece") from singular
    return out


def _stretch(vertices: F64, faces: np.ndarray, laid: F64) -> tuple[F64, float]:
    """Stretch of lengths from the square to the surface: (k,) float64, mm, around each vertex, and the total."""
    p, q = vertices[faces], laid[faces]
    u, v = q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
    turn = np.maximum(_cross(u, v), 1e-100)
    e, f = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    along = (e * v[:, 1:] - f * u[:, 1:]) / turn[:, None]
    across = (f * u[:, :1] - e * v[:, :1]) / turn[:, None]
    square = 0.5 * ((along * along).sum(axis=1) + (across * across).sum(axis=1))
    area = 0.5 * np.sqrt(np.maximum((e * e).sum(axis=1) * (f * f).sum(axis=1) - (e * f).sum(axis=1) ** 2, 0.0))
    count = len(vertices)
    over = sum(np.bincount(faces[:, k], area * square, count) for k in range(3))
    round_it = sum(np.bincount(faces[:, k], area, count) for k in range(3))
    return np.sqrt(over / np.maximum(round_it, 1e-300)), float((area * square).sum())


def _turn(laid: F64, faces: np.ndarray) -> F64:
    """(m,) twice the area of each triangle in the square; negative where it is turned over."""
    a, b, c = (laid[faces[:, k]] for k in range(3))
    return _cross(b - a, c - a)


def _cross(u: F64, v: F64) -> F64:
    return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
