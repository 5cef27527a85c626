"""One pass of all moves over a block of stock lines: lower, and look for what must not touch.

Notation as in ``heights``. A body row is (z0, z1, r0, r1, clearance, part): heights over the tip, radii that
already hold the clearance, ``part`` 1 neck, 2 shank, 3 holder. An event row is
(move, code, depth, clearance, x, y, z); depth counts from the grown body, so depth > clearance is contact.
Blocks are independent, and within one every line sees the moves in order.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.kernels.cutter_sizes import arcs_touch, corner_end, sizes_of
from geometry.kernels.cutter_sizes import end_radius as end_of
from verify.kernels.engaged import LEAST_DEPTH, WINDOW, EngagedArrays, sector_bits
from verify.kernels.frustum import Frustum, clear_of, contact
from verify.kernels.heights import INF, _cells, bottom, edge_radius, entered, lowest, lowest_within
from verify.kernels.profile import carried
from verify.kernels.tables import F64, I64, Bool, ContactLimits, MoveArrays, RapidArrays, ToolArrays

CUTTER, NECK, SHANK, HOLDER, PLUNGE, STUB, FIXTURE = 0, 1, 2, 3, 4, 5, 8
STUB_TOP, STUB_LOW, STUB_DUG, STUB_PAID, STUB_X0, STUB_X1, STUB_Y0, STUB_Y1 = 0, 1, 2, 3, 4, 5, 6, 7
REFRESH = 64
ARM = 0.05  # mm by which a line that stands over the flutes must reach into them
UNITS = 1e9  # whole numbers of 1e-9 mm³ and 1e-9 mm: sums do not depend on the order of the blocks
EDGE = 1e-9  # share of the squared radius by which a line on the edge of a cutter is within it
RIM, RIM_SHARE = 5e-3, 0.02  # mm, and share of the radius: stock so near the edge says nothing of the depth of a cut
ROUNDING = 1e-3  # mm, of coordinates and chords: no nearer than a clearance


class LineArrays(NamedTuple):
    """Vertical lines of stock, setup frame: line (i, j) stands at origin + ((i, j) + 0.5) step.

    height : (nx, ny) float64, mm, top of the stock
    origin : (2,) float64, mm
    step   : float, mm between lines
    bottom : float, mm, underside of the stock: what an end takes off a line below it is not dug
    """

    height: F64
    origin: F64
    step: float
    bottom: float


class DescentArrays(NamedTuple):
    """What the moves before each move allow it to dig.

    steep  : (m,) bool, feed moves steeper than a ramp
    earned : (m,) float64, mm, depth that ramps could have taken before
    way    : (m,) float64, mm, sideways way of feed moves before; far off after a rapid or another tool
    skin   : (k,) float64, mm, depth that the end of each tool may dig
    hollow : (k, 4) float64, rows as ``HollowEnd``
    """

    steep: Bool
    earned: F64
    way: F64
    skin: F64
    hollow: F64


class HollowEnd(NamedTuple):
    """The end of a tool that does not cut to its centre.

    core  : float, mm, radius within which it does not cut; 0: it cuts to its centre
    left  : float, mm, height of the stub that it may stand over after ramps
    skin  : float, mm, height that it may press straight down
    slope : float, dimensionless, of a ramp
    """

    core: float
    left: float
    skin: float
    slope: float


class LineHistory(NamedTuple):
    """What the moves so far did to each line of a block, changed in place.

    since : (nx, ny) float64, mm, depth that ramps could have taken until the line was last dug
    dug   : (nx, ny) float64, mm, depth that ends of tools have dug and no ramp has paid for
    come  : (nx, ny) float64, mm, height of the line before the cutter began to lower it
    begun : (nx, ny) float64, mm, sideways way of the feed moves then
    whole : (nx, ny) float64, mm, depth that ends of tools have dug, whatever ramps could have paid for
    stub  : (nx, ny, 8) float64, mm, of the stub that ends without a cutting centre leave; no size where all tools cut
            to their centre. Its top; the lowest place of a core on it; how deep cores went since the ring round one
            lowered it; how much of that ramps pay for; least and most x and y of the tips meanwhile
    """

    since: F64
    dug: F64
    come: F64
    begun: F64
    whole: F64
    stub: F64


class CutEnd(NamedTuple):
    """The end of a tool that cuts straight down: radius in mm, and depth in mm that it may dig."""

    radius: float
    skin: float


class CutTotals(NamedTuple):
    """What a pass adds up, changed in place.

    taken : (p, 2) int64, 1e-9 mm³ that each part of a move takes (parts as in ``EngagedArrays``), and 1e-9 mm: its
            deepest cut along the tool axis, of lines further in than ``RIM``
    open  : (1,) uint8, set where some line would be dug deeper than the skin if nothing paid for it
    """

    taken: I64
    open: NDArray[np.uint8]


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _top(height, i0, i1, j0, j1):
    most = -INF
    for i in range(i0, i1):
        for j in range(j0, j1):
            most = max(most, height[i, j])
    return most


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _note(events, count, m, best):
    """Append the events of one move; of a full table the worse half stays. Returns how many were noted in all.

    The last row of the table tells how many before it hold events.
    """
    room = len(events) - 1
    used = int(events[room, 0])
    for code in range(len(best)):
        if best[code, 0] > 0.0:
            if used == room:
                used = room // 2
                worse, keys = np.zeros(room, np.bool_), np.empty(room)
                for row in range(room):
                    keys[row] = events[row, 3] - events[row, 2]
                by_depth = np.argsort(keys)
                for row in range(used):
                    worse[by_depth[row]] = True
                kept = 0
                for row in range(room):
                    if worse[row]:
                        for k in range(events.shape[1]):
                            events[kept, k] = events[row, k]
                        kept += 1
            events[used, 0], events[used, 1] = m, code
            for k in range(5):
                events[used, 2 + k] = best[code, k]
            used += 1
            count += 1
            best[code, 0] = 0.0
    events[room, 0] = used
    return count


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def known_depth(best, code, clearance):
    """What a depth that counts from a body grown by ``clearance`` must exceed to be graver than the one noted.

    Graver is deeper in the bare body, or nearer to it: bodies of one code may have different clearances.
    """
    return max(best[code, 0] - best[code, 1] + clearance, 0.0) if best[code, 0] > 0.0 else 0.0


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def known_gap(best, code, clearance, room):
    """How near to the bare body, mm, a place must come to be graver than the one noted.

    Without one, it is what is asked: the clearance aside or the room in every direction, whichever is more. 0 where one
    is in the body.
    """
    return max(room - known_depth(best, code, room), clearance - known_depth(best, code, clearance), 0.0)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _worse(best, code, depth, clearance, x, y, z):
    if depth > known_depth(best, code, clearance):
        best[code, 0], best[code, 1], best[code, 2], best[code, 3], best[code, 4] = depth, clearance, x, y, z


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _lower(lines, box, a, d, cutter, end, descents, m, history, engaged, totals, best):
    """Lower the lines under feed move m.

    end        : CutEnd
    totals     : CutTotals, of the parts of this move
    engaged    : (parts,) int64, sectors of the cutter that met stock, added to, by even parts of the move

    Returns whether any stock went, and whether the flutes were under stock.
    """
    height, origin, step, bottom = lines
    steep, earned, gone_on = descents.steep[m], descents.earned[m], descents.way[m]
    since, dug, come, begun, whole, _stub = history
    taken, count, cell = totals.taken, len(engaged), step * step * UNITS
    i0, i1, j0, j1 = box
    radius, corner, length, own = cutter.radius, cutter.corner, cutter.length, end_of(cutter)
    cut, under = False, False
    a0, a1 = _cells(min(a[0], a[0] + d[0]) - radius, max(a[0], a[0] + d[0]) + radius, origin[0], step, i0, i1)
    b0, b1 = _cells(min(a[1], a[1] + d[1]) - radius, max(a[1], a[1] + d[1]) + radius, origin[1], step, j0, j1)
    floor = min(a[2], a[2] + d[2])
    flat, plan2 = radius - corner, d[0] * d[0] + d[1] * d[1]
    rim = min(RIM, RIM_SHARE * radius)
    inner, side, leans = radius - rim, radius, cutter.taper > 0.0 or cutter.up > 0.0
    if cutter.taper > 0.0:
        side = corner_end(cutter)[0]
    elif cutter.bow > cutter.round:
        side = arcs_touch(cutter)[0]
    along = 1.0 / plan2 if plan2 > 0.0 else 0.0
    plan = math.sqrt(plan2)
    for i in range(a0, a1 + 1):
        x = origin[0] + (i + 0.5) * step
        for j in range(b0, b1 + 1):
            over = height[i, j] - floor
            if over <= 0.0:
                continue
            y = origin[1] + (j + 0.5) * step
            # a cutter is no lower over a line than its lowest tip would be from as near as it comes in plan
            wx, wy = x - a[0], y - a[1]
            s = min(max((wx * d[0] + wy * d[1]) * along, 0.0), 1.0)
            wx, wy = wx - s * d[0], wy - s * d[1]
            reach = radius
            if cutter.cone > 0.0:
                reach = edge_radius(over, cutter)
            elif over < corner:
                reach = flat + math.sqrt(over * (2.0 * corner - over))
            near = wx * wx + wy * wy
            if near > reach * reach + EDGE * radius * radius:
                continue
            # a line on the very edge is lowered whatever rounding says, or the next pass would find it standing; a side
            # that leans meets it where it is as wide as its top is high, and not before
            touch = reach if leans else radius
            low, s = lowest_within(x, y, a[0], a[1], a[2], d[0], d[1], d[2], touch * (1.0 + 0.5 * EDGE), cutter)
            gone = height[i, j] - low
            if gone <= 1e-9:
                continue
            if height[i, j] > a[2] + s * d[2] + length + 1e-9:
                under = under or near < (radius - ARM) * abs(radius - ARM)
                continue
            height[i, j] = low
            if gone > 1e-6:
                cut = True
                k = min(int(s * count), count - 1)
                taken[k, 0] += max(round((low + gone - max(low, bottom)) * cell), 1)
                # what a leaning side takes off is its slope times that in width
                if near < inner * inner and (near < side * side or gone * cutter.taper > rim or (
                        cutter.bow > cutter.round
                        and edge_radius(low + gone - a[2] - s * d[2], cutter) - math.sqrt(near) > rim)):
                    taken[k, 1] = max(taken[k, 1], round((low + gone - max(a[2] + s * d[2], bottom)) * UNITS))
            if plan > 0.0:
                # a round end lowers a line bit by bit: what counts is all it takes off the line on its way over it
                way = gone_on + s * plan
                if way - begun[i - i0, j - j0] > WINDOW * own:
                    begun[i - i0, j - j0], come[i - i0, j - j0] = way, low + gone
                tip = a[2] + s * d[2]
                if min(come[i - i0, j - j0] - low, low + gone - tip) > LEAST_DEPTH * own:
                    engaged[min(int(s * len(engaged)), len(engaged) - 1)] |= sector_bits(
                        x - a[0], y - a[1], d[0], d[1], plan, come[i - i0, j - j0] - tip, cutter, step, 0.0)
            if not steep:
                continue
            # what the flank took before the end came over the line was not dug
            under_end, _ = lowest_within(x, y, a[0], a[1], a[2], d[0], d[1], d[2], end.radius, cutter)
            over = low + gone - max(under_end, bottom)
            gone = min(gone, over)
            if gone > 0.0:
                paid = earned - since[i - i0, j - j0]
                since[i - i0, j - j0] = earned
                dug[i - i0, j - j0] = max(dug[i - i0, j - j0] - paid, 0.0) + gone
                if dug[i - i0, j - j0] > end.skin:
                    _worse(best, PLUNGE, dug[i - i0, j - j0], 0.0, x, y, low)
                whole[i - i0, j - j0] += gone
                if whole[i - i0, j - j0] > end.skin:
                    totals.open[0] = 1
    return cut, under


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _lower_stub(row, top):
    """The ring round the core lowers a stub to ``top``: what the core had pressed above is gone."""
    if top < row[STUB_TOP]:
        row[STUB_TOP] = top
        row[STUB_DUG] = min(row[STUB_DUG], max(top - row[STUB_LOW], 0.0))
        row[STUB_PAID] = min(row[STUB_PAID], row[STUB_DUG])
        if row[STUB_DUG] <= 0.0:
            row[STUB_LOW] = INF


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _press(row, low, begin, end, a, d, slope):
    """The core goes over a stub down to ``low`` between two parts ``begin`` and ``end`` of a move.

    slope : of a ramp

    Returns the height pressed, and how much of it no ramp over the same ground could have left.
    """
    top = row[STUB_TOP]
    over = min(row[STUB_LOW], top)
    gone = min(over - low, -d[2])
    if gone > 0.0:
        begin = max(begin, end - (over - low) / -d[2])  # before, the core was over the stub
        aside = math.sqrt(d[0] * d[0] + d[1] * d[1])
        if row[STUB_DUG] <= 0.0:
            row[STUB_X0], row[STUB_Y0] = INF, INF
            row[STUB_X1], row[STUB_Y1] = -INF, -INF
        row[STUB_DUG] += gone
        row[STUB_PAID] += gone * min(1.0, aside * slope / -d[2])
        for s in (begin, end):
            row[STUB_X0], row[STUB_X1] = min(row[STUB_X0], a[0] + s * d[0]), max(row[STUB_X1], a[0] + s * d[0])
            row[STUB_Y0], row[STUB_Y1] = min(row[STUB_Y0], a[1] + s * d[1]), max(row[STUB_Y1], a[1] + s * d[1])
    row[STUB_LOW] = min(over, low)
    if row[STUB_DUG] <= 0.0:
        return top - low, 0.0
    wide, deep = row[STUB_X1] - row[STUB_X0], row[STUB_Y1] - row[STUB_Y0]
    ground = math.sqrt(wide * wide + deep * deep)
    return top - low, row[STUB_DUG] - min(row[STUB_PAID], 2.0 * ground * slope)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _over_stub(x, y, row, a, d, cutter, core, slope, stock_bottom):
    """What an end without a cutting centre does to the stub on a line on a move, as ``_press``.

    row : (8,) float64, of the line, changed in place

    The ring round the core lowers the line in front of the core and behind it. What stands under the core is pressed.
    """
    radius = cutter.radius
    wx, wy = x - a[0], y - a[1]
    plan2 = d[0] * d[0] + d[1] * d[1]
    if plan2 < 1e-18:
        rho = math.sqrt(wx * wx + wy * wy)
        low = min(a[2], a[2] + d[2]) + bottom(rho, cutter)
        if rho < core:
            return _press(row, max(low, stock_bottom), 0.0, 1.0, a, d, slope)
        if rho <= radius:
            _lower_stub(row, low)
        return 0.0, 0.0
    s0 = (wx * d[0] + wy * d[1]) / plan2
    miss2 = max(wx * wx + wy * wy - s0 * s0 * plan2, 0.0)
    if miss2 >= core * core:
        _lower_stub(row, lowest(x, y, a[0], a[1], a[2], d[0], d[1], d[2], cutter, 0.0)[0])
        return 0.0, 0.0
    plan = math.sqrt(plan2)
    wide, narrow = math.sqrt(radius * radius - miss2) / plan, math.sqrt(core * core - miss2) / plan
    s1, s2, s3, s4 = max(s0 - wide, 0.0), s0 - narrow, s0 + narrow, min(s0 + wide, 1.0)
    if s1 > 1.0 or s4 < 0.0:
        return 0.0, 0.0
    rim = bottom(core, cutter)
    pressed, sheer = 0.0, 0.0
    if s2 > s1:
        far = math.sqrt(miss2 + (s1 - s0) * (s1 - s0) * plan2)
        near = min(s2, 1.0)
        there = rim if s2 <= 1.0 else bottom(math.sqrt(miss2 + (1.0 - s0) * (1.0 - s0) * plan2), cutter)
        _lower_stub(row, min(a[2] + s1 * d[2] + bottom(far, cutter), a[2] + near * d[2] + there))
    if s2 < 1.0 and s3 > 0.0:
        low = lowest_within(x, y, a[0], a[1], a[2], d[0], d[1], d[2], core, cutter)[0]
        pressed, sheer = _press(row, max(low, stock_bottom), max(s2, 0.0), min(s3, 1.0), a, d, slope)
    if s3 < s4:
        far = math.sqrt(miss2 + (s4 - s0) * (s4 - s0) * plan2)
        near = max(s3, 0.0)
        there = rim if s3 >= 0.0 else bottom(math.sqrt(miss2 + s0 * s0 * plan2), cutter)
        _lower_stub(row, min(a[2] + s4 * d[2] + bottom(far, cutter), a[2] + near * d[2] + there))
    return pressed, sheer


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _leave_stubs(lines, box, a, d, cutter, hollow: HollowEnd, stub, best):
    """Lower the stubs under a feed move, and find those that the core of its tool may not press.

    stub : (nx, ny, 8) float64, of the lines of the box, changed in place
    """
    _height, origin, step, stock_bottom = lines
    i0, i1, j0, j1 = box
    radius = cutter.radius
    a0, a1 = _cells(min(a[0], a[0] + d[0]) - radius, max(a[0], a[0] + d[0]) + radius, origin[0], step, i0, i1)
    b0, b1 = _cells(min(a[1], a[1] + d[1]) - radius, max(a[1], a[1] + d[1]) + radius, origin[1], step, j0, j1)
    floor = min(a[2], a[2] + d[2])
    over_flutes = max(a[2], a[2] + d[2]) + cutter.length + 1e-9
    for i in range(a0, a1 + 1):
        x = origin[0] + (i + 0.5) * step
        for j in range(b0, b1 + 1):
            row = stub[i - i0, j - j0]
            if row[STUB_TOP] <= floor or row[STUB_TOP] > over_flutes:
                continue
            y = origin[1] + (j + 0.5) * step
            pressed, sheer = _over_stub(x, y, row, a, d, cutter, hollow.core, hollow.slope, stock_bottom)
            if pressed > hollow.left or sheer > hollow.skin:
                _worse(best, STUB, pressed, 0.0, x, y, floor)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _meet_body(lines, box, a, d, body, grow, room, slack, best):
    """Find the lines that one body, grown further by ``grow``, takes in by more than ``slack``, or is within ``room``
    of."""
    height, origin, step, _bottom = lines
    z0, z1, r0, r1 = body[0], body[1], body[2] + grow, body[3] + grow
    bare = Frustum(z0, z1, body[2] - body[4], body[3] - body[4])
    wide = max(max(r0, r1), max(bare.r0, bare.r1) + room)
    i0, i1, j0, j1 = box
    a0, a1 = _cells(min(a[0], a[0] + d[0]) - wide, max(a[0], a[0] + d[0]) + wide, origin[0], step, i0, i1)
    b0, b1 = _cells(min(a[1], a[1] + d[1]) - wide, max(a[1], a[1] + d[1]) + wide, origin[1], step, j0, j1)
    under = min(a[2], a[2] + d[2]) + z0 - room
    code = int(body[5])
    for i in range(a0, a1 + 1):
        x = origin[0] + (i + 0.5) * step
        for j in range(b0, b1 + 1):
            y = origin[1] + (j + 0.5) * step
            top = height[i, j]
            if top <= under:
                continue
            depth = contact(x - a[0], y - a[1], top - a[2], d[0], d[1], d[2], Frustum(z0, z1, r0, r1), body[4] + grow,
                            slack, known_depth(best, code, body[4] + grow), True)
            if depth > 0.0:
                _worse(best, code, depth, body[4] + grow, x, y, top)
            if room > 0.0 and known_depth(best, code, room) < room:
                gap = clear_of(x - a[0], y - a[1], top - a[2], d[0], d[1], d[2], bare, True)
                if gap < room - ROUNDING:
                    _worse(best, code, room - gap, room, x, y, top)


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _rapid_cutter(lines, box, a, d, cutter, grow, room, best):
    """Find the lines that the cutting part, grown radially, enters in a rapid, or is within ``room`` of.

    Returns whether they stand over the flutes.
    """
    height, origin, step, _bottom = lines
    radius, length = cutter.radius, cutter.length
    under, above = False, max(a[2], a[2] + d[2]) + length + ARM
    wide = radius + max(grow, room)
    i0, i1, j0, j1 = box
    a0, a1 = _cells(min(a[0], a[0] + d[0]) - wide, max(a[0], a[0] + d[0]) + wide, origin[0], step, i0, i1)
    b0, b1 = _cells(min(a[1], a[1] + d[1]) - wide, max(a[1], a[1] + d[1]) + wide, origin[1], step, j0, j1)
    floor = min(a[2], a[2] + d[2])
    for i in range(a0, a1 + 1):
        x = origin[0] + (i + 0.5) * step
        for j in range(b0, b1 + 1):
            top = height[i, j]
            if top <= floor - room:
                continue
            y = origin[1] + (j + 0.5) * step
            if room > 0.0 and known_depth(best, CUTTER, room) < room:
                # no line under the flutes is nearer than its top; beside the flutes the way aside counts
                gap = carried(x - a[0], y - a[1], top - a[2], d[0], d[1], d[2], cutter)
                if gap < room - ROUNDING:
                    _worse(best, CUTTER, room - max(gap, 0.0), room, x, y, top)
            if top <= floor:
                continue
            low, _ = lowest(x, y, a[0], a[1], a[2], d[0], d[1], d[2], cutter, grow)
            if top <= low + 1e-3:
                continue
            bare = entered(x - a[0], y - a[1], top - a[2], d[0], d[1], d[2], cutter)
            depth = grow + bare
            if bare <= 1e-3:
                # how wide the tool must be to touch: the gap to what stands here
                free, hits = 0.0, grow
                for _ in range(20):
                    wider = 0.5 * (free + hits)
                    if top > lowest(x, y, a[0], a[1], a[2], d[0], d[1], d[2], cutter, wider)[0] + 1e-3:
                        hits = wider
                    else:
                        free = wider
                depth = grow - hits
            _worse(best, CUTTER, depth, grow, x, y, min(top, low))
            under = under or top > above
    return under


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def stock_tile(box, lines: LineArrays, moves: MoveArrays, rapids: RapidArrays, descents: DescentArrays,
               tools: ToolArrays, limits: ContactLimits, cut, under, engaged: EngagedArrays, totals: CutTotals, events):
    """Work all moves through the lines i0..i1-1, j0..j1-1 of a box (i0, i1, j0, j1), in place.

    cut   : (m,) uint8, set where stock went
    under : (m,) uint8, set where the flutes were under stock, of which lines of one height cannot tell

    Returns the number of events found, which may exceed the table.
    """
    i0, i1, j0, j1 = box
    height, origin, step, _bottom = lines
    starts, ends, feeds, tool = moves
    cutters, ends_radius, _reach, bodies, body_first = tools
    free, rooms = rapids
    skins, parts, sectors = descents.skin, engaged.first, engaged.sectors
    stub = np.zeros((0, 0, 8))
    if descents.hollow[:, 0].max() > 0.0:
        stub = np.zeros((i1 - i0, j1 - j0, 8))
        stub[:, :, STUB_TOP], stub[:, :, STUB_LOW] = height[i0:i1, j0:j1], INF
    history = LineHistory(np.zeros((i1 - i0, j1 - j0)), np.zeros((i1 - i0, j1 - j0)), np.zeros((i1 - i0, j1 - j0)),
                          np.full((i1 - i0, j1 - j0), -INF), np.zeros((i1 - i0, j1 - j0)), stub)
    best = np.zeros((16, 5))
    top, stubs = _top(height, i0, i1, j0, j1), len(stub) > 0
    x0, x1 = origin[0] + i0 * step, origin[0] + i1 * step
    y0, y1 = origin[1] + j0 * step, origin[1] + j1 * step
    count, lowered = 0, 0
    for m in range(len(starts)):
        a = (starts[m, 0], starts[m, 1], starts[m, 2])
        if min(a[2], ends[m, 2]) - rooms[m] >= top:
            continue
        d = (ends[m, 0] - a[0], ends[m, 1] - a[1], ends[m, 2] - a[2])
        k = tool[m]
        grow = 0.0 if feeds[m] or free[m] else limits.rapid
        wide = cutters[k, 0]
        for b in range(body_first[k], body_first[k + 1]):
            wide = max(wide, bodies[b, 2], bodies[b, 3])
        wide += max(grow, rooms[m])
        if min(a[0], ends[m, 0]) - wide > x1 or max(a[0], ends[m, 0]) + wide < x0 \
                or min(a[1], ends[m, 1]) - wide > y1 or max(a[1], ends[m, 1]) + wide < y0:
            continue
        cutter = sizes_of(cutters, k)
        if feeds[m]:
            went, below = _lower(lines, box, a, d, cutter, CutEnd(ends_radius[k], skins[k]), descents, m, history,
                                 sectors[parts[m]:parts[m + 1]],
                                 CutTotals(totals.taken[parts[m]:parts[m + 1]], totals.open), best)
            if stubs:
                hollow = HollowEnd(descents.hollow[k, 0], descents.hollow[k, 1], descents.hollow[k, 2],
                                   descents.hollow[k, 3])
                _leave_stubs(lines, box, a, d, cutter, hollow, history.stub, best)
            if below:
                under[m] = 1
            if went:
                cut[m] = 1
                lowered += 1
                if lowered % REFRESH == 0 and not stubs:
                    top = _top(height, i0, i1, j0, j1)
        else:
            if _rapid_cutter(lines, box, a, d, cutter, grow, rooms[m], best):
                under[m] = 1
        for b in range(body_first[k], body_first[k + 1]):
            if min(a[2], ends[m, 2]) + bodies[b, 0] - rooms[m] < top:
                # a body no wider than the cutting part runs where the flutes have been
                loose = limits.beside if max(bodies[b, 2], bodies[b, 3]) <= cutter.radius + 1e-9 else 1e-3
                extra = grow - min(grow, bodies[b, 4]) if not free[m] else -bodies[b, 4]
                _meet_body(lines, box, a, d, bodies[b], extra if not feeds[m] else 0.0, rooms[m], loose, best)
        count = _note(events, count, m, best)
    return count
