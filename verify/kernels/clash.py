"""Bodies of tools that lean or turn against points of the part and of fixtures.

Notation as in ``pose``; body and event rows as in ``stock``; points in chunks of nested balls as in ``turned``. In a
rapid everything is grown radially by the rapid clearance, the cutting part too, and keeps the room of the rapid in
every direction; a straight lift along the tool leaves the place it stands in with no clearance asked.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from geometry.kernels.cutter_sizes import sizes_of
from geometry.kernels.options import KERNEL
from verify.kernels.frustum import Frustum, at_least, clear_of, contact, no_deeper
from verify.kernels.pose import PIECE, fill_piece, near_segment2, pieces, view
from verify.kernels.profile import beside, carried
from verify.kernels.stock import CUTTER, FIXTURE, ROUNDING, _note, _worse, known_depth, known_gap
from verify.kernels.tables import F64, AxisArrays, Bool, ContactLimits, MoveArrays, RapidArrays, ToolArrays

TOUCHING = 1e-3
SEARCHED = 1e-4  # mm, more than searches for the least distance leave
ASIDE = 5e-3  # mm a straight lift may end beside its axis: coordinates of programs have two or three decimals


class PointArrays(NamedTuple):
    """Points of the part and of fixtures in nested balls, in the order of the tree, setup frame.

    points : (n, 3) float64, mm
    fixed  : (n,) bool, points of fixtures: the cutting part must not touch those either
    balls  : four (k, 4) float64, mm, centre and radius of balls of 8, 64, 512 and 4096 points; radius -1: empty
    """

    points: F64
    fixed: Bool
    balls: tuple[F64, F64, F64, F64]


@njit(**KERNEL)
def is_lift(angle, axis, a, b):
    """Whether a move draws the tool straight out along its axis, as far as rounded coordinates can say so."""
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    up = dx * axis[0] + dy * axis[1] + dz * axis[2]
    return angle == 0.0 and up > 0.0 and dx * dx + dy * dy + dz * dz - up * up <= ASIDE * ASIDE + 1e-14 * up * up


@njit(**KERNEL)
def _meets(p, balls, node, z0, z1, wide, clearance, known):
    """Whether a cylinder of radius ``wide`` from z0 to z1 over the tip may take in a point of a ball on piece p, deeper
    than known."""
    rad = balls[node, 3]
    if rad < 0.0:
        return False
    qx, qy, qz, dx, dy, dz = view(p, balls[node, 0], balls[node, 1], balls[node, 2])
    return not no_deeper(qx, qy, qz, dx, dy, dz, z0 - rad, z1 + rad, wide + rad, clearance, known)


@njit(**KERNEL)
def _off(p, balls, node, cutter, bodies, b, gap):
    """Whether no point of a ball comes nearer to body b of a tool on piece p than ``gap``, mm."""
    return keeps_off(p, balls[node, 0], balls[node, 1], balls[node, 2], balls[node, 3], cutter, bodies, b, gap)


@njit(**KERNEL)
def _meet_point(p, x, y, z, cutter, bodies, b, grow, slack, known):
    """Depth of a point in body b of a tool on piece p as an event counts it; b < 0 is the cutting part.

    0 where it is no deeper than ``known`` in a body
    """
    qx, qy, qz, dx, dy, dz = view(p, x, y, z)
    if b >= 0:
        body, clearance = bodies[b], bodies[b, 4] + grow
        return contact(qx, qy, qz, dx, dy, dz, Frustum(body[0], body[1], body[2] + grow, body[3] + grow), clearance,
                       slack, known, False)
    bare = -carried(qx, qy, qz, dx, dy, dz, cutter)
    if bare > slack:
        return grow + bare
    return grow - beside(qx, qy, qz, dx, dy, dz, cutter, 0.0, grow, slack) if known < grow else 0.0


@njit(**KERNEL)
def clear_point(p, x, y, z, cutter, bodies, b):
    """Distance of a point to body b of a tool on piece p, mm; b < 0 is the cutting part; 0 inside."""
    qx, qy, qz, dx, dy, dz = view(p, x, y, z)
    if b < 0:
        return max(carried(qx, qy, qz, dx, dy, dz, cutter), 0.0)
    return clear_of(qx, qy, qz, dx, dy, dz, bare_body(bodies, b), False)


@njit(**KERNEL)
def bare_body(bodies, b):
    """Body b without its clearance."""
    return Frustum(bodies[b, 0], bodies[b, 1], bodies[b, 2] - bodies[b, 4], bodies[b, 3] - bodies[b, 4])


@njit(**KERNEL)
def keeps_off(p, x, y, z, rad, cutter, bodies, b, gap):
    """Whether no place of a ball comes nearer to body b of a tool on piece p than ``gap``, mm."""
    if b >= 0:
        qx, qy, qz, dx, dy, dz = view(p, x, y, z)
        if at_least(qx, qy, qz, dx, dy, dz, bare_body(bodies, b)) - rad >= gap:
            return True
    return clear_point(p, x, y, z, cutter, bodies, b) - rad >= gap


@njit(**KERNEL)
def nearest_known(p, best, code, cutter, bodies, b, clearance, room):
    """How near, mm, a place must come to body b on piece p to be the gravest of code: no farther than the gravest of
    this move, and than the place that was the gravest of an earlier one."""
    out = known_gap(best, code, clearance, room)
    if best[code, 1] >= 0.0:
        out = min(out, clear_point(p, best[code, 2], best[code, 3], best[code, 4], cutter, bodies, b))
    return out + SEARCHED


@njit(**KERNEL)
def _traverse(p, chunk, cloud, held, every, cutter, bodies, b, grow, room, slack, best):
    """One body of a tool on piece p against the points of a chunk; of fixtures alone unless ``every``.

    held : whether the chunk has points of fixtures
    """
    z0, z1, wide, clearance, code = 0.0, cutter.length, cutter.radius + max(grow, room), grow, CUTTER
    if b >= 0:
        z0, z1, wide = bodies[b, 0], bodies[b, 1], max(bodies[b, 2], bodies[b, 3])
        clearance, code = bodies[b, 4] + grow, int(bodies[b, 5])
        wide = max(wide + grow, wide - bodies[b, 4] + room)
    z0, z1 = z0 - room, z1 + room
    of_fixture, known = known_depth(best, code + FIXTURE, clearance), known_depth(best, code, clearance)
    known = of_fixture if not every else min(known, of_fixture) if held else known
    near, near_fixture = -math.inf, -math.inf
    if room > 0.0:
        near = nearest_known(p, best, code, cutter, bodies, b, clearance, room) if every else near
        if held:
            near_fixture = nearest_known(p, best, code + FIXTURE, cutter, bodies, b, clearance, room)
    points, fixed = cloud.points, cloud.fixed
    t0, t1, t2, t3 = cloud.balls
    if not _meets(p, t3, chunk, z0, z1, wide, clearance, known):
        return
    for n2 in range(chunk * 8, chunk * 8 + 8):
        if not _meets(p, t2, n2, z0, z1, wide, clearance, known):
            continue
        if room > 0.0 and _off(p, t2, n2, cutter, bodies, b, max(near, near_fixture)):
            continue
        for n1 in range(n2 * 8, n2 * 8 + 8):
            if not _meets(p, t1, n1, z0, z1, wide, clearance, known):
                continue
            if room > 0.0 and _off(p, t1, n1, cutter, bodies, b, max(near, near_fixture)):
                continue
            for leaf in range(n1 * 8, n1 * 8 + 8):
                if not _meets(p, t0, leaf, z0, z1, wide, clearance, known):
                    continue
                if room > 0.0:
                    near = min(near, known_gap(best, code, clearance, room) + SEARCHED)
                    near_fixture = min(near_fixture, known_gap(best, code + FIXTURE, clearance, room) + SEARCHED)
                    if _off(p, t0, leaf, cutter, bodies, b, max(near, near_fixture)):
                        continue
                for i in range(leaf * 8, min(leaf * 8 + 8, len(points))):
                    if every or fixed[i]:
                        depth = _meet_point(p, points[i, 0], points[i, 1], points[i, 2], cutter, bodies, b, grow,
                                            TOUCHING if fixed[i] else slack,
                                            known_depth(best, code + (FIXTURE if fixed[i] else 0), clearance))
                        into = code + (FIXTURE if fixed[i] else 0)
                        if depth > 0.0:
                            _worse(best, into, depth, clearance, points[i, 0], points[i, 1], points[i, 2])
                        if room > 0.0 and known_depth(best, into, room) < room:
                            gap = clear_point(p, points[i, 0], points[i, 1], points[i, 2], cutter, bodies, b)
                            if gap < room - ROUNDING:
                                _worse(best, into, room - gap, room, points[i, 0], points[i, 1], points[i, 2])


@njit(**KERNEL)
def clash_chunk(chunk, cloud: PointArrays, moves: MoveArrays, axes: AxisArrays, rapids: RapidArrays, tools: ToolArrays,
                limits: ContactLimits, events):
    """Events of all moves with the points of one chunk; returns their number, which may exceed the table."""
    starts, ends, feeds, tool = moves
    axis, about, angle, bow = axes
    cutters, _ends_radius, reach, bodies, body_first = tools
    free, rooms = rapids
    fixed, t3 = cloud.fixed, cloud.balls[3]
    best, piece = np.zeros((16, 5)), np.empty(PIECE)
    best[:, 1] = -1.0  # no place is known yet
    x, y, z, rad = t3[chunk, 0], t3[chunk, 1], t3[chunk, 2], t3[chunk, 3]
    held = False
    for i in range(chunk * 4096, min(chunk * 4096 + 4096, len(fixed))):
        held = held or fixed[i]
    count = 0
    for m in range(len(starts)):
        k, feed = tool[m], feeds[m]
        far = reach[k] + rad + bow + max(limits.rapid, rooms[m])
        if near_segment2(x, y, z, starts[m], ends[m]) > far * far:
            continue
        cutter = sizes_of(cutters, k)
        grow = 0.0 if feed or free[m] else limits.rapid
        length2 = (ends[m, 0] - starts[m, 0]) ** 2 + (ends[m, 1] - starts[m, 1]) ** 2 + (ends[m, 2] - starts[m, 2]) ** 2
        n = pieces(angle[m], math.sqrt(length2), reach[k], bow)
        for part in range(n):
            fill_piece(piece, starts[m], ends[m], axis[m], about[m], angle[m], part, n)
            if held or not feed:
                _traverse(piece, chunk, cloud, held, not feed, cutter, bodies, -1, grow, rooms[m], limits.slack, best)
            for b in range(body_first[k], body_first[k + 1]):
                extra = 0.0 if feed else -bodies[b, 4] if free[m] else grow - min(grow, bodies[b, 4])
                beside = max(bodies[b, 2], bodies[b, 3]) <= cutter.radius + 1e-9
                _traverse(piece, chunk, cloud, held, True, cutter, bodies, b, extra, rooms[m],
                          limits.beside if beside else TOUCHING, best)
        count = _note(events, count, m, best)
    return count
