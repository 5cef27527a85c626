"""What tools that lean or turn leave on the normals of samples, and which points their bodies take in.

Notation as in ``pose`` and ``sweep``; samples lie in chunks of nested balls (``verify.material.point_tree``). One
call works all moves in order through one chunk, so chunks can run side by side. Each piece of a move is a translation
in the view of the tool, off by at most ``bow``; a ray turns against the tool while the piece lasts, by half its angle
either way, so a root at t is looked for again from the point it was found at, until that is where the ray is met.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.kernels.cutter_sizes import sizes_of
from geometry.kernels.options import KERNEL
from verify.kernels.pose import PIECE, fill_piece, near_segment2, pieces, turned, view
from verify.kernels.rays import CUT_ONCE, SAME, TOUCH, SampleArrays, gap, new_left
from verify.kernels.tables import AxisArrays, MoveArrays

AGAIN = 6
SETTLED = 1e-7


@njit(**KERNEL)
def _near(p, balls, node, left, margin, cutter):
    """Whether a cutting part on piece p may come within ``left`` of anything in a ball."""
    rad = balls[node, 3]
    if rad < 0.0:
        return False
    qx, qy, qz, dx, dy, dz = view(p, balls[node, 0], balls[node, 1], balls[node, 2])
    return gap(qx, qy, qz, dx, dy, dz, dx * dx + dy * dy, cutter) <= left + rad + margin


@njit(**KERNEL)
def _cut_ray(p, x, y, z, nx, ny, nz, cutter, left):
    """What piece p leaves on the ray from (x, y, z) along n; ``left`` where it takes nothing."""
    qx, qy, qz, dx, dy, dz = view(p, x, y, z)
    ux, uy, uz = turned(p, nx, ny, nz)
    t = new_left(qx, qy, qz, ux, uy, uz, dx, dy, dz, dx * dx + dy * dy, cutter, left)
    if t >= left or p[30] == 0.0:
        return t
    for _ in range(AGAIN):
        qx, qy, qz, dx, dy, dz = view(p, x + t * nx, y + t * ny, z + t * nz)
        step = new_left(qx, qy, qz, ux, uy, uz, dx, dy, dz, dx * dx + dy * dy, cutter, left - t)
        if step >= left - t:
            return left
        t += step
        if abs(step) < SETTLED:
            break
    return t


@njit(**KERNEL)
def _leaves(p, chunk, n1, balls, left0, samples, m, margin, cutter, once):
    """Cut the samples of the 8 leaves of ball n1 of a chunk; returns the most that is left on them, mm."""
    points, normals, residual, mover = samples
    most1 = 0.0
    for n0 in range(n1 * 8, n1 * 8 + 8):
        leaf = chunk * 512 + n0
        if _near(p, balls, leaf, left0[n0], margin, cutter):
            most = 0.0
            for i in range(leaf * 8, min(leaf * 8 + 8, len(points))):
                t = _cut_ray(p, points[i, 0], points[i, 1], points[i, 2], normals[i, 0], normals[i, 1], normals[i, 2],
                             cutter, residual[i])
                if t < residual[i] - SAME:
                    residual[i], mover[i] = CUT_ONCE if once else t, m
                most = max(most, residual[i])
            left0[n0] = most
        most1 = max(most1, left0[n0])
    return most1


@njit(**KERNEL)
def cut_chunk(chunk, balls, samples: SampleArrays, moves: MoveArrays, axes: AxisArrays, cutters, reach, once):
    """Work all feed moves through the samples of one chunk.

    balls   : four (k, 4) float64, mm, balls of 8, 64, 512, 4096 samples
    samples : in the order of the tree
    cutters : (k, 9) float64, mm, rows of ``CutterSizes``
    reach   : (k,) float64, mm, how far the cutting part reaches from the tip
    once    : as in ``rays.cut_tile``
    """
    b0, b1, b2, b3 = balls
    points, residual = samples.points, samples.residual
    starts, ends, feeds, tool = moves
    axis, about, angle, bow = axes
    piece = np.empty(PIECE)
    left0, left1, left2 = np.zeros(512), np.zeros(64), np.zeros(8)
    left3 = 0.0
    for i in range(chunk * 4096, min(chunk * 4096 + 4096, len(points))):
        r, k = residual[i], i - chunk * 4096
        left0[k // 8], left1[k // 64] = max(left0[k // 8], r), max(left1[k // 64], r)
        left2[k // 512], left3 = max(left2[k // 512], r), max(left3, r)
    x, y, z, rad = b3[chunk, 0], b3[chunk, 1], b3[chunk, 2], b3[chunk, 3]
    for m in range(len(starts)):
        if not feeds[m]:
            continue
        k = tool[m]
        far = reach[k] + rad + left3 + bow
        if near_segment2(x, y, z, starts[m], ends[m]) > far * far:
            continue
        cutter = sizes_of(cutters, k)
        length2 = (ends[m, 0] - starts[m, 0]) ** 2 + (ends[m, 1] - starts[m, 1]) ** 2 + (ends[m, 2] - starts[m, 2]) ** 2
        count = pieces(angle[m], math.sqrt(length2), reach[k], bow)
        # a turning ray runs off its chord by half the angle of the piece for every mm of what is left
        margin = TOUCH if angle[m] == 0.0 else TOUCH + bow + 0.5 * angle[m] / count * left3
        for part in range(count):
            fill_piece(piece, starts[m], ends[m], axis[m], about[m], angle[m], part, count)
            if not _near(piece, b3, chunk, left3, margin, cutter):
                continue
            left3 = 0.0
            for n2 in range(8):
                if _near(piece, b2, chunk * 8 + n2, left2[n2], margin, cutter):
                    most2 = 0.0
                    for n1 in range(n2 * 8, n2 * 8 + 8):
                        if _near(piece, b1, chunk * 64 + n1, left1[n1], margin, cutter):
                            left1[n1] = _leaves(piece, chunk, n1, b0, left0, samples, m, margin, cutter,
                                                                once)
                        most2 = max(most2, left1[n1])
                    left2[n2] = most2
                left3 = max(left3, left2[n2])
