"""Re-parameterisation by Laplace's equation [Sarkar2015, equations 2.1 to 2.5].

xi and eta are harmonic in the plane of the region. Inverted, the places obey

    a r_xixi - 2 b r_xieta + c r_etaeta = 0,   a = |r_eta|²,  b = r_xi . r_eta,  c = |r_xi|²

Each round fixes the coefficients and solves one sparse system for both coordinates. The rounds end when no place moves.
The continuous map onto the square is one to one. The discrete map folds at re-entrant corners (see ``folds``).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from geometry.mesh import F64
from geometry.parameterization.quad_grid import Quad, coons

SETTLED = 1e-9  # of the size of the region
MAX_ROUNDS = 100


def laplace(quad: Quad) -> tuple[F64, int]:
    """The grid of a region by Laplace's equation [Sarkar2015, equations 2.1 to 2.5; Thompson1985].

    The first grid is the Coons patch. Returns the grid, (m, n, 2) float64, mm, in the plane of the region, and the
    number of systems solved. There are at most 100 rounds, even where places still move.
    """
    grid = coons(quad)
    size = float(np.ptp(grid.reshape(-1, 2), axis=0).max())
    moved, count = np.inf, 0
    while moved > SETTLED * size and count < MAX_ROUNDS:
        inner = _solved(grid)
        moved = float(np.abs(inner - grid[1:-1, 1:-1]).max(initial=0.0))
        grid[1:-1, 1:-1] = inner
        count += 1
    return grid, count


def _solved(grid: F64) -> F64:
    """Inner places (m - 2, n - 2, 2), mm, with the coefficients of the given grid."""
    m, n, _ = grid.shape
    x, y = n - 1.0, m - 1.0  # central differences in unit square coordinates
    r_x, r_y = 0.5 * x * (grid[1:-1, 2:] - grid[1:-1, :-2]), 0.5 * y * (grid[2:, 1:-1] - grid[:-2, 1:-1])
    a, b, c = (r_y * r_y).sum(2), (r_x * r_y).sum(2), (r_x * r_x).sum(2)
    number = np.full((m, n), -1)
    number[1:-1, 1:-1] = np.arange((m - 2) * (n - 2)).reshape(m - 2, n - 2)
    j, i = (g.ravel() for g in np.meshgrid(np.arange(1, m - 1), np.arange(1, n - 1), indexing="ij"))
    mixed = (-0.5 * b * x * y).ravel()
    weights = [(0, 1, (a * x * x).ravel()), (0, -1, (a * x * x).ravel()), (1, 0, (c * y * y).ravel()),
               (-1, 0, (c * y * y).ravel()), (1, 1, mixed), (-1, -1, mixed), (1, -1, -mixed), (-1, 1, -mixed),
               (0, 0, (-2.0 * (a * x * x + c * y * y)).ravel())]
    known = np.zeros((len(j), 2))
    rows, columns, values = [], [], []
    for dj, di, w in weights:
        k = number[j + dj, i + di]
        inside = k >= 0
        rows.append(np.flatnonzero(inside))
        columns.append(k[inside])
        values.append(w[inside])
        known[~inside] -= w[~inside, None] * grid[j + dj, i + di][~inside]
    system = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))),
                        shape=(len(j), len(j))).tocsc()
    return np.asarray(spsolve(system, known)).reshape(m - 2, n - 2, 2)
