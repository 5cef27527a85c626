"""The stock as distances on a grid, cut by tools that may lean or turn, and what else of them meets it.

Notation as in ``pose``; body and event rows as in ``stock``.

Node (i, j, k) at origin + (i, j, k) h holds v: where stock stands, the distance to what is not stock, and where it is
gone minus the depth in the deepest single cut, both cut off at ``band``. A cut takes the least of v and the signed
distance to the swept cutting part. Outside what is cut away that is exact, so the ball of radius v round a node is all
stock: a cut that passes between nodes still lowers those beside it, and nothing is said to stand that is gone. The
place of the surface between nodes is that of linear interpolation: within h²/8 of the greater curvature of a smooth
surface, within h of an edge.

A tile is worked by one call, its bricks of 4 nodes skipped by the ball round them. ``top`` (bricks) is the largest v in
each, kept beside the tile.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.cutter_sizes import end_radius as end_of
from geometry.kernels.cutter_sizes import side_height, sizes_of
from geometry.kernels.options import KERNEL
from verify.kernels.clash import SEARCHED, TOUCHING, bare_body, is_lift, keeps_off, nearest_known
from verify.kernels.engaged import LEAST_DEPTH, EngagedArrays, sector_bits
from verify.kernels.frustum import Frustum, clear_of, contact_of_ball, no_deeper
from verify.kernels.heights import bottom, edge_radius
from verify.kernels.pose import PIECE, fill_piece, near_segment2, pieces, view
from verify.kernels.profile import beside, carried
from verify.kernels.rays import gap, plan_distance
from verify.kernels.stock import CUTTER, ROUNDING, _note, _worse, known_depth, known_gap
from verify.kernels.tables import F64, I64, AxisArrays, ContactLimits, MoveArrays, RapidArrays, ToolArrays

LEAST_CUT = 1e-5
NEAR = 1e-9  # mm, more than rounding of a distance
ON_NODE = 1e-6  # mm: a layer of nodes in the plane of an end counts whole, whatever the rounding of its distances
RISE = 0.02  # mm: a tool that goes up goes no further between two looks at its bodies, where they met what stood before
MAX_LOOKS = 128
VOLUME_UNITS = 1e9
BLOCK = 4  # bricks a side that one look at their ball passes over


class FieldArrays(NamedTuple):
    """Signed distances into the stock, setup frame; node (i, j, k) is at origin + (i, j, k) step.

    values : (nx, ny, nz) float32, mm, above zero where stock stands
    origin : (3,) float64, mm
    step   : float, mm between nodes
    band   : float, mm, limit of the distances
    """

    values: NDArray[np.float32]
    origin: F64
    step: float
    band: float


class FieldSums(NamedTuple):
    """What the moves take, added to.

    taken  : (m, 4) int64; 1e-9 mm³: what each move takes, and what the end of a steep one does; whole numbers, so that
             sums do not depend on the order of tiles; 1 where stock was touched and no share of a cell went; third what
             the end does times the square of the share of its radius it is from the middle; fourth 1e-9 mm² of stock
             right under the end
    parted : (p, 2) int64, as ``verify.kernels.stock.CutTotals.taken``
    """

    taken: NDArray[np.int64]
    parted: NDArray[np.int64]


class TileArrays(NamedTuple):
    """A tile of nodes and its bricks of 4 nodes a side.

    nodes : (6,) int64, index, first and stop node along x, y and z
    tops  : (bx, by, bz) float64, mm, largest distance in each brick, kept beside the tile
    solid : (6,) int64, index, first bricks along x, y and z that hold stock, then the last
    """

    nodes: I64
    tops: F64
    solid: I64


@njit(**KERNEL)
def share(v, h):
    """The part of the cell round a node that is stock, by its distance v from the surface."""
    return min(max(0.5 + v / h, 0.0), 1.0)


@njit(**KERNEL)
def brick_tops(field, i0, i1, j0, j1, k0, k1):
    """Largest v of each brick of a tile, (bx, by, bz) float64."""
    out = np.full(((i1 - i0 + 3) // 4, (j1 - j0 + 3) // 4, (k1 - k0 + 3) // 4), -1e30)
    for i in range(i0, i1):
        for j in range(j0, j1):
            for k in range(k0, k1):
                b = ((i - i0) // 4, (j - j0) // 4, (k - k0) // 4)
                out[b] = max(out[b], field[i, j, k])
    return out


@njit(**KERNEL)
def _bricks(lo, hi, origin, h, first, count):
    """Bricks first.. of a tile side whose nodes may lie in [lo, hi]."""
    a = math.floor(((lo - origin) / h - first) / 4.0)
    b = math.floor(((hi - origin) / h - first) / 4.0)
    return max(0, a), min(count - 1, b)


@njit(**KERNEL)
def _box(p, z0, z1, wide):
    """Box round a cylinder of radius ``wide`` from z0 to z1 over the tip, at both ends of piece p."""
    out = np.empty(6)
    for c in range(3):
        lo, hi = 1e300, -1e300
        for e in range(2):
            u = p[6 + 9 * e + c]
            aside = wide * math.sqrt(max(1.0 - u * u, 0.0))
            for z in (z0, z1):
                lo = min(lo, p[9 * e + c] + z * u - aside)
                hi = max(hi, p[9 * e + c] + z * u + aside)
        out[c], out[3 + c] = lo, hi
    return out


@njit(**KERNEL)
def _cut_brick(stock, tile, brick, p, cutter, steep, end_radius, twist, engaged, parted, totals):
    """Lower the nodes of one brick by piece p.

    totals : added to: volume, volume by the end, 1 where stock was touched, the end's volume times the square of
             how far from the middle of the end it was, as a share of its radius, and the area on which it stands
             then

    engaged : (parts,) int64, sectors of the cutter that met stock, added to, by even parts of the move
    parted  : (parts, 2) int64, 1e-9 mm³ taken, and 1e-9 mm: how high over the tip the stock stood, by these parts

    Returns the new top.
    """
    field, origin, h, band = stock
    i0, j0, k0 = tile[0] + 4 * brick[0], tile[2] + 4 * brick[1], tile[4] + 4 * brick[2]
    radius, length, least = cutter.radius, cutter.length, LEAST_DEPTH * end_of(cutter)
    corner, ball = side_height(cutter), cutter.cone == 0.0 and radius - cutter.corner <= 1e-12
    top = -1e30
    straight = p[30] == 0.0
    mx, my, mz = p[27], p[28], p[29]
    plan2 = mx * mx + my * my
    by = 1.0 / plan2 if plan2 > 0.0 else 0.0
    lowest, highest = min(mz, 0.0), max(mz, 0.0) + length
    for i in range(i0, min(i0 + 4, tile[1])):
        for j in range(j0, min(j0 + 4, tile[3])):
            sx, sy, sz, _, _, _ = view(p, origin[0] + i * h, origin[1] + j * h, origin[2] + k0 * h)
            for k in range(k0, min(k0 + 4, tile[5])):
                v = field[i, j, k]
                if v > -band:
                    if straight:
                        # most nodes lie beside the flutes, under the tip or over the flutes by more than v: no root
                        # and no search is spent on these
                        ahead = h * (k - k0)
                        qx, qy, qz = sx + ahead * p[20], sy + ahead * p[5], sz + ahead * p[8]
                        far = NEAR + (max(v, h) if steep else v - LEAST_CUT)
                        s = min(max((qx * mx + qy * my) * by, 0.0), 1.0)
                        ex, ey = qx - s * mx, qy - s * my
                        wide = max(radius + far, 0.0)
                        if ex * ex + ey * ey > wide * wide or lowest - qz > far or qz - highest > far:
                            top = max(top, v)
                            continue
                    qx, qy, qz, dx, dy, dz = view(p, origin[0] + i * h, origin[1] + j * h, origin[2] + k * h)
                    # the search that all but a ball ask for pays only where the node may be lowered
                    if not ball and gap(qx, qy, qz, dx, dy, dz, dx * dx + dy * dy, cutter) >= v:
                        top = max(top, v)
                        continue
                    d = max(carried(qx, qy, qz, dx, dy, dz, cutter), -band)
                    if steep and -ON_NODE < d <= h - ON_NODE and v > 0.0 and qz - dz <= corner:
                        off = math.sqrt((qx - dx) ** 2 + (qy - dy) ** 2)
                        totals[4] += h * h * min(max(0.5 + (end_radius - off) / h, 0.0), 1.0)
                    if d < v - LEAST_CUT:
                        field[i, j, k] = d
                        gone = (share(v, h) - share(d, h)) * h * h * h
                        on = min(max((qx * dx + qy * dy) / max(dx * dx + dy * dy, 1e-18), 0.0), 1.0)
                        k_part = min(int(on * len(engaged)), len(engaged) - 1)
                        parted[k_part, 0] += round(gone * VOLUME_UNITS)
                        if v > 0.0 >= d:
                            parted[k_part, 1] = max(parted[k_part, 1], round((qz - on * dz + 0.5 * h) * VOLUME_UNITS))
                        if v > 0.0:
                            totals[2] = 1.0
                            plan = math.sqrt(dx * dx + dy * dy)
                            if d <= 0.0 and plan > 0.0:
                                aside = min(abs(dx * qy - dy * qx) / plan, radius)
                                if qz - 0.5 * dz - bottom(aside, cutter) > least:
                                    # where the edge comes to the place
                                    ahead = (qx * dx + qy * dy) / plan
                                    edge = edge_radius(max(qz - 0.5 * dz, 0.0), cutter)
                                    ahead -= math.sqrt(max(edge * edge - aside * aside, 0.0))
                                    k_part = min(max(int(ahead / plan * len(engaged)), 0), len(engaged) - 1)
                                    engaged[k_part] |= sector_bits(qx, qy, dx, dy, plan, qz - 0.5 * dz, cutter, h,
                                                                   twist)
                        totals[0] += gone
                        if steep:
                            off = plan_distance(qx, qy, dx, dy, dx * dx + dy * dy)
                            # a cell on the rim of the end counts by about the part of it that lies inside; where that
                            # is the rim of the cut as well, what went says so already
                            rim = end_radius + max(h - (radius - end_radius), 0.0)
                            own = gone * min(max(0.5 + (rim - off) / h, 0.0), 1.0)
                            totals[1] += own
                            totals[3] += own * min(off / end_radius, 1.0) ** 2
                        v = d
                top = max(top, v)
    return top


@njit(**KERNEL)
def _cut(stock, bricks, p, cutter, steep, end_radius, twist, engaged, parted, totals):
    """Lower the nodes of a tile by a cutting part on piece p."""
    origin, h, band = stock.origin, stock.step, stock.band
    tile, tops = bricks.nodes, bricks.tops
    box = _box(p, 0.0, cutter.length, cutter.radius + band)
    nx, ny, nz = tops.shape
    a0, a1 = _bricks(box[0] - band, box[3] + band, origin[0], h, tile[0], nx)
    b0, b1 = _bricks(box[1] - band, box[4] + band, origin[1], h, tile[2], ny)
    c0, c1 = _bricks(box[2] - band, box[5] + band, origin[2], h, tile[4], nz)
    half = 1.5 * math.sqrt(3.0) * h
    for bi in range(a0, a1 + 1):
        x = origin[0] + (tile[0] + 4 * bi + 1.5) * h
        for bj in range(b0, b1 + 1):
            y = origin[1] + (tile[2] + 4 * bj + 1.5) * h
            for bk in range(c0, c1 + 1):
                top = tops[bi, bj, bk]
                if top <= -band:
                    continue
                qx, qy, qz, dx, dy, dz = view(p, x, y, origin[2] + (tile[4] + 4 * bk + 1.5) * h)
                if gap(qx, qy, qz, dx, dy, dz, dx * dx + dy * dy, cutter) - half >= top:
                    continue
                tops[bi, bj, bk] = _cut_brick(stock, tile, (bi, bj, bk), p, cutter, steep, end_radius, twist, engaged,
                                              parted, totals)


@njit(**KERNEL)
def _known(stock, p, best, code, cutter, bodies, b, clearance, room):
    """As ``nearest_known``, of a place that is still stock."""
    field, origin, h, _band = stock
    if best[code, 1] >= 0.0:
        i, j, k = (round((best[code, 2] - origin[0]) / h), round((best[code, 3] - origin[1]) / h),
                   round((best[code, 4] - origin[2]) / h))
        if field[i, j, k] <= 0.0:
            best[code, 1] = -1.0
    return nearest_known(p, best, code, cutter, bodies, b, clearance, room)


@njit(**KERNEL)
def _meet(stock, bricks, p, bodies, b, cutter, grow, room, slack, best):
    """Find the stock of a tile that body b of a tool, grown by ``grow``, takes in on piece p, or is within ``room`` of.

    b < 0 is the cutting part
    """
    _field, origin, h, band = stock
    tile, tops, solid = bricks
    z0, z1, wide, clearance, code = 0.0, cutter.length, cutter.radius + max(grow, room), grow, CUTTER
    if b >= 0:
        bare = bare_body(bodies, b)
        z0, z1, clearance, code = bare.z0, bare.z1, bodies[b, 4] + grow, int(bodies[b, 5])
        wide = max(bare.r0, bare.r1) + max(clearance, room)
    z0, z1 = z0 - room, z1 + room
    box = _box(p, z0, z1, wide)
    nx, ny, nz = tops.shape
    a0, a1 = _bricks(box[0] - h, box[3] + h, origin[0], h, tile[0], nx)
    b0, b1 = _bricks(box[1] - h, box[4] + h, origin[1], h, tile[2], ny)
    c0, c1 = _bricks(box[2] - h, box[5] + h, origin[2], h, tile[4], nz)
    a0, b0, c0 = max(a0, solid[0]), max(b0, solid[1]), max(c0, solid[2])
    a1, b1, c1 = min(a1, solid[3]), min(b1, solid[4]), min(c1, solid[5])
    half = 1.5 * math.sqrt(3.0) * h
    near = _known(stock, p, best, code, cutter, bodies, b, clearance, room) if room > 0.0 else 0.0
    for block in np.ndindex((a1 - a0 + BLOCK) // BLOCK, (b1 - b0 + BLOCK) // BLOCK, (c1 - c0 + BLOCK) // BLOCK):
        i0, j0, k0 = a0 + BLOCK * block[0], b0 + BLOCK * block[1], c0 + BLOCK * block[2]
        if room > 0.0:
            middle = 0.5 * (4 * BLOCK - 1)
            if keeps_off(p, origin[0] + (tile[0] + 4 * i0 + middle) * h, origin[1] + (tile[2] + 4 * j0 + middle) * h,
                         origin[2] + (tile[4] + 4 * k0 + middle) * h, middle * math.sqrt(3.0) * h + band, cutter,
                         bodies, b, near):
                continue
        for bi in range(i0, min(i0 + BLOCK, a1 + 1)):
            x = origin[0] + (tile[0] + 4 * bi + 1.5) * h
            for bj in range(j0, min(j0 + BLOCK, b1 + 1)):
                y = origin[1] + (tile[2] + 4 * bj + 1.5) * h
                for bk in range(k0, min(k0 + BLOCK, c1 + 1)):
                    top = tops[bi, bj, bk]
                    if top <= 0.0:
                        continue
                    z = origin[2] + (tile[4] + 4 * bk + 1.5) * h
                    qx, qy, qz, dx, dy, dz = view(p, x, y, z)
                    far = half + top
                    # no node here can be deeper than that
                    if no_deeper(qx, qy, qz, dx, dy, dz, z0 - far, z1 + far, wide + far, clearance,
                                 known_depth(best, code, clearance)):
                        continue
                    if room > 0.0:
                        near = min(near, known_gap(best, code, clearance, room) + SEARCHED)
                        if keeps_off(p, x, y, z, far, cutter, bodies, b, near):
                            continue
                    _meet_brick(stock, tile, (bi, bj, bk), p, bodies, b, cutter, grow, room, slack, best)


@njit(**KERNEL)
def _meet_brick(stock, tile, brick, p, bodies, b, cutter, grow, room, slack, best):
    """As ``_meet``, of the nodes of one brick."""
    field, origin, h, _band = stock
    clearance, code = (grow, CUTTER) if b < 0 else (bodies[b, 4] + grow, int(bodies[b, 5]))
    i0, j0, k0 = tile[0] + 4 * brick[0], tile[2] + 4 * brick[1], tile[4] + 4 * brick[2]
    for i in range(i0, min(i0 + 4, tile[1])):
        for j in range(j0, min(j0 + 4, tile[3])):
            for k in range(k0, min(k0 + 4, tile[5])):
                v = field[i, j, k]
                if v <= 0.0:
                    continue
                x, y, z = origin[0] + i * h, origin[1] + j * h, origin[2] + k * h
                qx, qy, qz, dx, dy, dz = view(p, x, y, z)
                if b < 0:
                    gap = carried(qx, qy, qz, dx, dy, dz, cutter) - v
                    depth = grow - gap if gap < -slack else 0.0
                    if depth == 0.0 and known_depth(best, code, grow) < grow:
                        depth = grow - beside(qx, qy, qz, dx, dy, dz, cutter, v, grow, slack)
                else:
                    # the ball of radius v round the node is stock
                    depth = contact_of_ball(qx, qy, qz, dx, dy, dz,
                                            Frustum(bodies[b, 0], bodies[b, 1], bodies[b, 2] + grow,
                                                    bodies[b, 3] + grow),
                                            v, clearance, slack, known_depth(best, code, clearance))
                    gap = math.inf
                    if room > 0.0 and known_depth(best, code, room) < room:
                        gap = clear_of(qx, qy, qz, dx, dy, dz, bare_body(bodies, b), False) - v
                if depth > 0.0:
                    _worse(best, code, depth, clearance, x, y, z)
                if gap < room - ROUNDING:
                    _worse(best, code, room - max(gap, 0.0), room, x, y, z)


@njit(**KERNEL)
def _solid(tops, band, out):
    """Bricks that hold stock, as first and last in each direction, into ``out`` (6,); first > last where none does.

    Returns whether a cut can still lower any node: those below zero count too, as the surface beside them and the
    shares of cells depend on how far below they are.
    """
    nx, ny, nz = tops.shape
    out[0], out[1], out[2], out[3], out[4], out[5] = nx, ny, nz, -1, -1, -1
    changing = False
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                changing = changing or tops[i, j, k] > -band
                if tops[i, j, k] > 0.0:
                    out[0], out[1], out[2] = min(out[0], i), min(out[1], j), min(out[2], k)
                    out[3], out[4], out[5] = max(out[3], i), max(out[4], j), max(out[5], k)
    return changing


@njit(**KERNEL)
def _seen_tile(p, x, y, z, rad):
    """A ball as the tool sees it on piece p: how near its axis, how low and how high over its tip it comes, mm."""
    qx, qy, qz, dx, dy, dz = view(p, x, y, z)
    return (plan_distance(qx, qy, dx, dy, dx * dx + dy * dy) - rad, qz - max(dz, 0.0) - rad, qz - min(dz, 0.0) + rad)


@njit(**KERNEL)
def _beside(seen, z0, z1, wide):
    """Whether a cylinder from z0 to z1 over the tip passes a ball by."""
    return seen[0] > wide or seen[1] > z1 or seen[2] < z0


@njit(**KERNEL)
def _look(stock, bricks, p, tools, k, seen, feed, free, grow, room, limits, best):
    """Find the stock of a tile that neck, shank and holder of tool k take in on piece p."""
    cutters, bodies = tools.cutters, tools.bodies
    cutter = sizes_of(cutters, k)
    for b in range(tools.first[k], tools.first[k + 1]):
        extra = 0.0 if feed else -bodies[b, 4] if free else grow - min(grow, bodies[b, 4])
        if _beside(seen, bodies[b, 0] - room, bodies[b, 1] + room, max(bodies[b, 2], bodies[b, 3]) + max(extra, room)):
            continue
        loose = limits.beside if max(bodies[b, 2], bodies[b, 3]) <= cutter.radius + 1e-9 else TOUCHING
        _meet(stock, bricks, p, bodies, b, cutter, extra, room, loose, best)


@njit(**KERNEL)
def _clear(best):
    for row in range(len(best)):
        for k in range(best.shape[1]):
            best[row, k] = 0.0


@njit(**KERNEL)
def _any_depth(best):
    for row in range(len(best)):
        if best[row, 0] > 0.0:
            return True
    return False


@njit(**KERNEL)
def field_tile(stock: FieldArrays, tile, moves: MoveArrays, axes: AxisArrays, twists, rapids: RapidArrays, steep,
               tools: ToolArrays, limits: ContactLimits, sums: FieldSums, engaged: EngagedArrays, events):
    """Work all moves in order through the nodes of one tile, in place.

    tile   : (6,) int64, index, first and stop node in x, y, z
    twists : (m,) float64, rad, of the X that a tool sees a move in, row w, in the frame of the sectors
    steep  : (m,) bool, feed moves that go down along the tool steeper than a ramp

    Returns the number of events found, which may exceed the table.
    """
    field, origin, h, band = stock
    starts, ends, feeds, tool = moves
    axis, about, angle, bow = axes
    cutters, ends_radius, reach, bodies, _first = tools
    free, rooms = rapids
    parts, sectors = engaged
    tops = brick_tops(field, tile[0], tile[1], tile[2], tile[3], tile[4], tile[5])
    solid = np.zeros(6, np.int64)
    bricks = TileArrays(tile, tops, solid)
    changing = _solid(tops, band, solid)
    best, trial, piece, totals = np.zeros((16, 5)), np.zeros((16, 5)), np.empty(PIECE), np.zeros(5)
    best[:, 1] = -1.0  # no place is known yet
    sx, sy, sz = (tile[1] - tile[0] - 1) * h, (tile[3] - tile[2] - 1) * h, (tile[5] - tile[4] - 1) * h
    cx, cy = origin[0] + tile[0] * h + 0.5 * sx, origin[1] + tile[2] * h + 0.5 * sy
    cz = origin[2] + tile[4] * h + 0.5 * sz
    rad = 0.5 * math.sqrt(sx * sx + sy * sy + sz * sz)
    count, cuts = 0, 0
    for m in range(len(starts)):
        if not changing:
            break
        k, feed = tool[m], feeds[m]
        far = reach[k] + rad + band + bow + max(limits.rapid, rooms[m])
        if near_segment2(cx, cy, cz, starts[m], ends[m]) > far * far:
            continue
        cutter = sizes_of(cutters, k)
        grow = 0.0 if feed or free[m] else limits.rapid
        length2 = (ends[m, 0] - starts[m, 0]) ** 2 + (ends[m, 1] - starts[m, 1]) ** 2 + (ends[m, 2] - starts[m, 2]) ** 2
        n = pieces(angle[m], math.sqrt(length2), reach[k], bow)
        if feed and not is_lift(angle[m], axis[m], starts[m], ends[m]):
            # flutes that come up past a place must not have cut it when the neck was there: where bodies meet what
            # stood before the move, cut and look by turns
            rise = (ends[m, 0] - starts[m, 0]) * axis[m, 0] + (ends[m, 1] - starts[m, 1]) * axis[m, 1] \
                + (ends[m, 2] - starts[m, 2]) * axis[m, 2]
            if rise > RISE:
                _clear(trial)
                for part in range(n):
                    fill_piece(piece, starts[m], ends[m], axis[m], about[m], angle[m], part, n)
                    seen = _seen_tile(piece, cx, cy, cz, rad + band)
                    _look(stock, bricks, piece, tools, k, seen, True, False, 0.0, 0.0, limits, trial)
                if _any_depth(trial):
                    n = max(n, min(math.ceil(math.sqrt(length2) / RISE), MAX_LOOKS))
        for i in range(len(totals)):
            totals[i] = 0.0
        for part in range(n):
            fill_piece(piece, starts[m], ends[m], axis[m], about[m], angle[m], part, n)
            # most of a long tool passes most tiles by: one look at the ball round the tile decides
            seen = _seen_tile(piece, cx, cy, cz, rad + band)
            near = not _beside(seen, -rooms[m], cutter.length + rooms[m], cutter.radius + max(grow, rooms[m]))
            if near and feed:
                _cut(stock, bricks, piece, cutter, steep[m], ends_radius[k], twists[m], sectors[parts[m]:parts[m + 1]],
                     sums.parted[parts[m]:parts[m + 1]], totals)
            elif near:
                _meet(stock, bricks, piece, bodies, -1, cutter, grow, rooms[m], TOUCHING, best)
            _look(stock, bricks, piece, tools, k, seen, feed, free[m], grow, rooms[m], limits, best)
        if totals[0] > 0.0 or totals[2] > 0.0:
            sums.taken[m, 0] += max(round(totals[0] * VOLUME_UNITS), 1)
            sums.taken[m, 1] += round(totals[1] * VOLUME_UNITS)
            sums.taken[m, 2] += round(totals[3] * VOLUME_UNITS)
            sums.taken[m, 3] += round(totals[4] * VOLUME_UNITS)
            cuts += 1
            if cuts % 64 == 0:
                changing = _solid(tops, band, solid)
        count = _note(events, count, m, best)
    return count
