"""Bounding volume hierarchy over triangles: build, and the arrays every traversal reads.

Notation
    k nodes, m triangles. Node 0 is the root; the two children of an inner node are adjacent
    (``child``, ``child + 1``), so the sibling of node i > 0 is ``((i - 1) ^ 1) + 1``.
    A leaf holds the triangles ``first .. first + size - 1`` in leaf order; ``order`` maps leaf order
    to the triangle numbers of the mesh.
    column row: x_lo, x_hi, y_lo, y_hi, z_max, a, b, c, sin, 1/cos with z <= a x + b y + c for every point of the
    node, and sine and reciprocal cosine of the slope angle of that plane.
    facet row: unit normal turned upwards (nx, ny, nz >= 0), orientation seen from above (+1/-1), quality.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.options import KERNEL

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

LEAF_SIZE = 3
BINS = 16
# Traversals keep one bit a level in a 64-bit trail. From this depth on the builder halves by count,
# which adds at most 31 levels for 2**31 triangles.
DEPTH_OF_MEDIAN = 30
STACK = 72
UNEVEN = 0.6  # of the mean second moment of corners: above it they show the longest direction of a node

# Facets by quality: the plane is unusable (no area, or vertical) / usable with care / well conditioned.
EDGES_ONLY, CAREFUL, SOUND = 0.0, 1.0, 2.0


class TreeArrays(NamedTuple):
    """The hierarchy as plain arrays; njit functions take it as one argument.

    lower, upper : (k, 3) float64, mm    bounding boxes
    column       : (k, 10) float64       box in plan, top z, and a plane above everything in the node
    child        : (k,) int32            first of two adjacent children, -1 in a leaf
    parent       : (k,) int32            -1 at the root
    first, size  : (k,) int32            range of a leaf in leaf order, size 0 in inner nodes
    order        : (m,) int32            triangle of the mesh at each place of the leaf order
    corners      : (m, 3, 3) float64, mm corner points in leaf order
    facets       : (m, 5) float64        upward unit normal, orientation from above, quality; leaf order
    """

    lower: F64
    upper: F64
    column: F64
    child: I32
    parent: I32
    first: I32
    size: I32
    order: I32
    corners: F64
    facets: F64


@njit(**KERNEL)
def _half_area(lo: F64, hi: F64) -> float:
    dx, dy, dz = hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]
    if dx < 0.0:
        return 0.0
    return dx * dy + dy * dz + dz * dx


@njit(**KERNEL)
def _boxes(triangles: F64, lower: F64, upper: F64) -> None:
    for i in range(triangles.shape[0]):
        for j in range(3):
            lower[i, j] = min(triangles[i, 0, j], triangles[i, 1, j], triangles[i, 2, j])
            upper[i, j] = max(triangles[i, 0, j], triangles[i, 1, j], triangles[i, 2, j])


@njit(**KERNEL)
def _best_split(lower, upper, order, start, stop, clo, chi, bin_lo, bin_hi, bin_n, right):
    """Axis and number of bins on the left of the cheapest plane (surface area heuristic), axis -1: none."""
    best_axis, best_bin, best_cost = -1, 0, np.inf
    for axis in range(3):
        extent = chi[axis] - clo[axis]
        if not extent > 0.0:
            continue
        for b in range(BINS):
            for j in range(3):
                bin_lo[b, j], bin_hi[b, j] = np.inf, -np.inf
            bin_n[b] = 0
        scale = BINS / extent
        for i in range(start, stop):
            t = order[i]
            b = min(int((0.5 * (lower[t, axis] + upper[t, axis]) - clo[axis]) * scale), BINS - 1)
            bin_n[b] += 1
            for j in range(3):
                bin_lo[b, j] = min(bin_lo[b, j], lower[t, j])
                bin_hi[b, j] = max(bin_hi[b, j], upper[t, j])
        lo, hi = np.empty(3), np.empty(3)
        for j in range(3):
            lo[j], hi[j] = np.inf, -np.inf
        n = 0
        for b in range(BINS - 1, 0, -1):
            n += bin_n[b]
            for j in range(3):
                lo[j] = min(lo[j], bin_lo[b, j])
                hi[j] = max(hi[j], bin_hi[b, j])
            right[b] = n * _half_area(lo, hi)
        for j in range(3):
            lo[j], hi[j] = np.inf, -np.inf
        n = 0
        for b in range(BINS - 1):
            n += bin_n[b]
            for j in range(3):
                lo[j] = min(lo[j], bin_lo[b, j])
                hi[j] = max(hi[j], bin_hi[b, j])
            if 0 < n < stop - start:
                cost = n * _half_area(lo, hi) + right[b + 1]
                if cost < best_cost:
                    best_axis, best_bin, best_cost = axis, b + 1, cost
    return best_axis, best_bin


@njit(**KERNEL)
def _partition(lower, upper, order, start, stop, axis, left_bins, clo, scale):
    """Reorder so that the triangles of the first ``left_bins`` bins come first; the first of the others."""
    i, j = start, stop - 1
    while i <= j:
        t = order[i]
        b = min(int((0.5 * (lower[t, axis] + upper[t, axis]) - clo) * scale), BINS - 1)
        if b < left_bins:
            i += 1
        else:
            order[i], order[j] = order[j], t
            j -= 1
    return i


@njit(**KERNEL)
def _halve(lower, upper, order, start, stop, axis):
    """Sort the triangles start..stop-1 along an axis by the middles of their boxes; equal ones keep their order."""
    count = stop - start
    rows, merged = np.empty(count, np.int32), np.empty(count, np.int32)
    for i in range(count):
        rows[i] = order[start + i]
    width = 1
    while width < count:
        for low in range(0, count, 2 * width):
            middle, high = min(low + width, count), min(low + 2 * width, count)
            i, j = low, middle
            for k in range(low, high):
                left = j >= high
                if not left and i < middle:
                    t, u = rows[i], rows[j]
                    left = lower[t, axis] + upper[t, axis] <= lower[u, axis] + upper[u, axis]
                if left:
                    merged[k] = rows[i]
                    i += 1
                else:
                    merged[k] = rows[j]
                    j += 1
        rows, merged = merged, rows
        width *= 2
    for i in range(count):
        order[start + i] = rows[i]


@njit(**KERNEL)
def build_nodes(triangles: F64, leaf_size: int):
    """Boxes, topology and leaf order of the hierarchy [MacDonald1990, Wald2007].

    triangles : (m, 3, 3) float64, mm, corner points in the frame of the mesh, m > 0
    leaf_size : largest number of triangles in a leaf

    Returns
    -------
    lower, upper  : (2 m - 1, 3) float64, mm, frame of the mesh, boxes of the nodes
    child, parent : (2 m - 1,) int32, index; first, count : (2 m - 1,) int32, index and count, as ``TreeArrays``
    order         : (m,) int32, index, triangle at each place of the leaf order
    nodes         : int, how many rows of the tables hold nodes
    """
    m = triangles.shape[0]
    lower, upper = np.empty((m, 3)), np.empty((m, 3))
    _boxes(triangles, lower, upper)
    k_max = 2 * m - 1
    node_lo, node_hi = np.empty((k_max, 3)), np.empty((k_max, 3))
    child, parent = np.empty(k_max, np.int32), np.empty(k_max, np.int32)
    first, count = np.empty(k_max, np.int32), np.empty(k_max, np.int32)
    for i in range(k_max):
        child[i], parent[i], first[i], count[i] = -1, -1, 0, 0
    order = np.empty(m, np.int32)
    for i in range(m):
        order[i] = i
    bin_lo, bin_hi = np.empty((BINS, 3)), np.empty((BINS, 3))
    bin_n, right = np.empty(BINS, np.int64), np.empty(BINS)
    clo, chi = np.empty(3), np.empty(3)
    stack = np.empty((STACK, 4), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0, 0, m, 0
    top, k = 1, 1
    while top > 0:
        top -= 1
        node, start, stop, depth = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
        for j in range(3):
            node_lo[node, j], node_hi[node, j] = np.inf, -np.inf
            clo[j], chi[j] = np.inf, -np.inf
        for i in range(start, stop):
            t = order[i]
            for j in range(3):
                node_lo[node, j] = min(node_lo[node, j], lower[t, j])
                node_hi[node, j] = max(node_hi[node, j], upper[t, j])
                mid = 0.5 * (lower[t, j] + upper[t, j])
                clo[j] = min(clo[j], mid)
                chi[j] = max(chi[j], mid)
        if stop - start <= leaf_size:
            first[node], count[node] = start, stop - start
            continue
        middle = (start + stop) // 2
        if depth < DEPTH_OF_MEDIAN:
            axis, left = _best_split(lower, upper, order, start, stop, clo, chi, bin_lo, bin_hi, bin_n, right)
            if axis >= 0:
                scale = BINS / (chi[axis] - clo[axis])
                middle = _partition(lower, upper, order, start, stop, axis, left, clo[axis], scale)
        else:
            axis = 0
            for j in range(1, 3):
                if chi[j] - clo[j] > chi[axis] - clo[axis]:
                    axis = j
            _halve(lower, upper, order, start, stop, axis)
        child[node] = k
        parent[k] = node
        parent[k + 1] = node
        stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = k + 1, middle, stop, depth + 1
        stack[top + 1, 0], stack[top + 1, 1], stack[top + 1, 2], stack[top + 1, 3] = k, start, middle, depth + 1
        top += 2
        k += 2
    return node_lo, node_hi, child, parent, first, count, order, k


@njit(**KERNEL)
def facet_row(p, q, r):
    """Upward unit normal, orientation and quality of a triangle."""
    ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    vx, vy, vz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    wx, wy, wz = r[0] - q[0], r[1] - q[1], r[2] - q[2]
    longest = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz)
    side = 1.0 if nz >= 0.0 else -1.0
    # length / longest is height over longest edge: the normal's error is about 1e-16 over that.
    if length <= 1e-11 * longest or abs(nz) <= 1e-9 * length:
        return 0.0, 0.0, 0.0, side, EDGES_ONLY
    quality = SOUND if length > 1e-5 * longest and abs(nz) > 1e-3 * length else CAREFUL
    return side * nx / length, side * ny / length, abs(nz) / length, side, quality


@njit(**KERNEL)
def facet_rows(corners: F64):
    """(m, 5) float64, dimensionless, ``facet_row`` of each triangle.

    corners : (m, 3, 3) float64, mm, frame of the mesh
    """
    m = corners.shape[0]
    out = np.empty((m, 5))
    for i in range(m):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4] = facet_row(corners[i, 0], corners[i, 1], corners[i, 2])
    return out


@njit(**KERNEL)
def column_rows(node_lo, node_hi, child, parent, first, count, corners):
    """(k, 10) plan box, top z and covering plane of each node; the plane has the mean slope of the node."""
    k = node_lo.shape[0]
    normal = np.zeros((k, 3))
    out = np.zeros((k, 10))
    for i in range(k - 1, -1, -1):
        for t in range(first[i], first[i] + count[i]):
            p, q, r = corners[t, 0], corners[t, 1], corners[t, 2]
            ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
            vx, vy, vz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
            nz = ux * vy - uy * vx
            side = 1.0 if nz >= 0.0 else -1.0
            normal[i, 0] += side * (uy * vz - uz * vy)
            normal[i, 1] += side * (uz * vx - ux * vz)
            normal[i, 2] += side * nz
        if parent[i] >= 0:
            for j in range(3):
                normal[parent[i], j] += normal[i, j]
        out[i, 0], out[i, 1] = node_lo[i, 0], node_hi[i, 0]
        out[i, 2], out[i, 3] = node_lo[i, 1], node_hi[i, 1]
        out[i, 4] = node_hi[i, 2]
        n = normal[i]
        if n[2] > 0.05 * math.sqrt(n[0] * n[0] + n[1] * n[1]):
            length = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
            out[i, 5], out[i, 6] = -n[0] / n[2], -n[1] / n[2]
            out[i, 8], out[i, 9] = math.sqrt(n[0] * n[0] + n[1] * n[1]) / length, length / n[2]
        out[i, 7] = -np.inf
        out[i, 9] = max(out[i, 9], 1.0)
    for leaf in range(k):
        for t in range(first[leaf], first[leaf] + count[leaf]):
            i = leaf
            while i >= 0:
                for j in range(3):
                    c = corners[t, j, 2] - out[i, 5] * corners[t, j, 0] - out[i, 6] * corners[t, j, 1]
                    if c > out[i, 7]:
                        out[i, 7] = c
                i = parent[i]
    return out


@njit(**KERNEL)
def _unit(x, y, z):
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@njit(**KERNEL)
def _plate_axes(normal, total, moment, lo, hi):
    """Three perpendicular unit vectors n, a and b: n the mean normal of a node, a its longest direction across n.

    normal (3,) sum of areas times normals; total (4,) and moment (6,) sums over its corners of x, y, z and 1, and of
    xx, yy, zz, yz, zx, xy; lo and hi (3,) its upright box. Where corners spread evenly across n, a is the longest side
    of the upright box, so that the box of a plate is no wider than the plate.
    """
    nx, ny, nz = _unit(normal[0], normal[1], normal[2])
    if not abs(nx * nx + ny * ny + nz * nz - 1.0) < 1e-9:  # no area, or the square overflows
        nx, ny, nz = 0.0, 0.0, 1.0
    if abs(nx) <= min(abs(ny), abs(nz)):
        ex, ey, ez = _unit(0.0, -nz, ny)
    elif abs(ny) <= abs(nz):
        ex, ey, ez = _unit(nz, 0.0, -nx)
    else:
        ex, ey, ez = _unit(-ny, nx, 0.0)
    gx, gy, gz = ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex
    x, y, z = total[0] / total[3], total[1] / total[3], total[2] / total[3]
    xx, yy, zz = moment[0] / total[3] - x * x, moment[1] / total[3] - y * y, moment[2] / total[3] - z * z
    yz, zx, xy = moment[3] / total[3] - y * z, moment[4] / total[3] - z * x, moment[5] / total[3] - x * y
    ee = ex * (xx * ex + xy * ey + zx * ez) + ey * (xy * ex + yy * ey + yz * ez) + ez * (zx * ex + yz * ey + zz * ez)
    eg = gx * (xx * ex + xy * ey + zx * ez) + gy * (xy * ex + yy * ey + yz * ez) + gz * (zx * ex + yz * ey + zz * ez)
    gg = gx * (xx * gx + xy * gy + zx * gz) + gy * (xy * gx + yy * gy + yz * gz) + gz * (zx * gx + yz * gy + zz * gz)
    ax, ay, az = ex, ey, ez
    if math.sqrt((0.5 * (ee - gg)) ** 2 + eg * eg) > UNEVEN * 0.5 * (ee + gg):
        turn = 0.5 * math.atan2(2.0 * eg, ee - gg)
        c, s = math.cos(turn), math.sin(turn)
        ax, ay, az = c * ex + s * gx, c * ey + s * gy, c * ez + s * gz
    else:
        u, v = (hi[0] - lo[0]) * (1.0 - nx * nx), (hi[1] - lo[1]) * (1.0 - ny * ny)
        w = (hi[2] - lo[2]) * (1.0 - nz * nz)
        if u > 0.0 and u >= max(v, w):
            ax, ay, az = _unit(1.0 - nx * nx, -nx * ny, -nx * nz)
        elif v > 0.0 and v >= w:
            ax, ay, az = _unit(-ny * nx, 1.0 - ny * ny, -ny * nz)
        elif w > 0.0:
            ax, ay, az = _unit(-nz * nx, -nz * ny, 1.0 - nz * nz)
        if not abs(nx * ax + ny * ay + nz * az) < 1e-12:
            ax, ay, az = ex, ey, ez
    return nx, ny, nz, ax, ay, az, ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax


@njit(**KERNEL)
def hull_rows(node_lo, node_hi, parent, first, count, corners):
    """(k, 16) oriented box of each node: its middle, unit vectors n, a and b, half sides along them, half diagonal.

    n is the mean normal of the node's triangles, a the direction of their largest spread across n; mm.
    """
    k = node_lo.shape[0]
    normal, total, moment = np.zeros((k, 3)), np.zeros((k, 4)), np.zeros((k, 6))
    low, high = np.full((k, 3), np.inf), np.full((k, 3), -np.inf)
    out = np.zeros((k, 16))
    mx, my, mz = 0.5 * (node_lo[0, 0] + node_hi[0, 0]), 0.5 * (node_lo[0, 1] + node_hi[0, 1]), 0.5 * (
        node_lo[0, 2] + node_hi[0, 2])  # moments are taken about it, so that they do not cancel
    for i in range(k - 1, -1, -1):
        for t in range(first[i], first[i] + count[i]):
            p, q, r = corners[t, 0], corners[t, 1], corners[t, 2]
            ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
            vx, vy, vz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
            normal[i, 0] += uy * vz - uz * vy
            normal[i, 1] += uz * vx - ux * vz
            normal[i, 2] += ux * vy - uy * vx
            for c in range(3):
                x, y, z = corners[t, c, 0] - mx, corners[t, c, 1] - my, corners[t, c, 2] - mz
                total[i, 0] += x
                total[i, 1] += y
                total[i, 2] += z
                total[i, 3] += 1.0
                moment[i, 0] += x * x
                moment[i, 1] += y * y
                moment[i, 2] += z * z
                moment[i, 3] += y * z
                moment[i, 4] += z * x
                moment[i, 5] += x * y
        if i > 0:
            above = parent[i]
            for j in range(3):
                normal[above, j] += normal[i, j]
            for j in range(4):
                total[above, j] += total[i, j]
            for j in range(6):
                moment[above, j] += moment[i, j]
        (out[i, 3], out[i, 4], out[i, 5], out[i, 6], out[i, 7], out[i, 8], out[i, 9], out[i, 10],
         out[i, 11]) = _plate_axes(normal[i], total[i], moment[i], node_lo[i], node_hi[i])
        for j in range(3):
            out[i, j] = 0.5 * (node_lo[i, j] + node_hi[i, j])
    for leaf in range(k):
        for t in range(first[leaf], first[leaf] + count[leaf]):
            for c in range(3):
                i = leaf
                while i >= 0:
                    x, y, z = corners[t, c, 0] - out[i, 0], corners[t, c, 1] - out[i, 1], corners[t, c, 2] - out[i, 2]
                    for j in range(3):
                        at = out[i, 3 + 3 * j] * x + out[i, 4 + 3 * j] * y + out[i, 5 + 3 * j] * z
                        low[i, j], high[i, j] = min(low[i, j], at), max(high[i, j], at)
                    i = parent[i]
    for i in range(k):
        square = 0.0
        for j in range(3):
            half, middle = 0.5 * (high[i, j] - low[i, j]), 0.5 * (high[i, j] + low[i, j])
            out[i, 12 + j] = half
            square += half * half
            for c in range(3):
                out[i, c] += middle * out[i, 3 + 3 * j + c]
        out[i, 15] = math.sqrt(square)
    return out
