"""Cutting parts and bodies of tools in fixtures, exact and without points.

A fixture is a box. A cutting part, neck, shank or holder is taken as the convex hull of its outline turned about the
axis, and a piece of a move as the convex hull of the body at both its ends. Two convex bodies A and B are apart where a
direction n has h_A(n) + h_B(-n) < 0, with h the support function of each; otherwise the least of that sum over all n is
the way by which one would have to move to be free of the other: the depth of the contact [Bergen2001].

Points are float64, mm, in the setup frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from verify.kernels.clash import TOUCHING
from verify.kernels.pose import MAX_ANGLE
from verify.kernels.stock import CUTTER, FIXTURE
from verify.kernels.tables import RapidArrays
from verify.model import ProofSetup
from verify.moves import BOW, Moves, cutter_table
from verify.tool_axes import ToolAxes
from verify.tool_bodies import Bodies

CHORDS = 64  # of a round corner: its outline is at most 8e-5 of its radius too small
ANGLES = 4096  # of the table of a support function: at most 8e-8 of the size of the body too small
ROUND = 642  # directions all round, so that one is within 0.1 rad of every direction
NEAR, SHRINK, ROUNDS = 0.15, 0.4, 12  # rad, and share: how closely the best direction is searched
TURNS = 360  # directions square to an axis
SHORT = 1e-9  # mm: a way that has no direction
STEPS = 60  # of GJK
MAX_CONTACTS = 300  # of a body with a box that are listed


@dataclass(frozen=True, eq=False)
class TurnedOutline:
    """A convex body of revolution, tool frame: tip at the origin, axis Z.

    rings  : (k, 2) float64, mm, radius and height of the corners of its outline
    code   : of its events, as in ``verify.kernels.stock``
    clear  : mm, clearance that its events count
    """

    rings: F64
    code: int
    clear: float

    @property
    def radius(self) -> float:
        """Largest radius, mm."""
        return float(self.rings[:, 0].max())

    @property
    def reach(self) -> float:
        """Largest distance from the tip, mm."""
        return float(np.hypot(self.rings[:, 0], self.rings[:, 1]).max())

    def supports(self) -> F64:
        """(ANGLES + 1,) float64, mm: its support function at even angles between a direction and the axis, 0 to pi."""
        angle = np.linspace(0.0, np.pi, ANGLES + 1)[:, None]
        return np.asarray((self.rings[:, 0] * np.sin(angle) + self.rings[:, 1] * np.cos(angle)).max(axis=1))


def fixture_contacts(moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup, bounds: F64,
                     rapids: RapidArrays) -> F64:
    """Contacts of tools with fixtures, one for each body of a tool in a move.

    bounds : (2, 3) float64, mm, setup frame, of the part; a fixture reaches down to its underside, or lower

    Returns (e, 7) float64, mm, rows of events as in ``verify.kernels.stock``, in no order. The depth is the way out of
    the fixture, but no more than the radius of the body. Contacts of up to 0.001 mm do not count. Where the axis turns,
    a body is off by ``BOW``.
    """
    if not len(moves) or not setup.fixtures:
        return np.zeros((0, 7))
    boxes = [_whole(f, bounds) for f in setup.fixtures]
    near = np.flatnonzero(_within_reach(moves, tools, setup, boxes))
    if not len(near):
        return np.zeros((0, 7))
    parted, of = _pieces(moves.only(near), tools, setup)
    axes = parted.axes or ToolAxes.upright(len(parted))
    ends = axes.axis + axes.swing
    out = [np.zeros((0, 7))]
    for k in np.unique(parted.tool).tolist():
        rows = np.flatnonzero(parted.tool == k)
        sweep = _Sweep(parted.start[rows], parted.end[rows], axes.axis[rows], ends[rows])
        for body in _bodies(tools[k], setup):
            for box in boxes:
                hit, depth, at = _into(sweep, body, box)
                move = near[of[rows[hit]]]
                grow = np.where(parted.feed[rows[hit]] | rapids.free[move], 0.0, setup.clearance_rapid)
                clear = body.clear + grow
                out.append(np.column_stack([move, np.full(len(hit), body.code + FIXTURE),
                                            clear + np.minimum(depth, body.radius), clear, at]))
    return _deepest(np.concatenate(out))


@dataclass(frozen=True, eq=False)
class _Sweep:
    """Pieces of moves: tips at both ends and axes there, each (n, 3) float64, mm and unit, setup frame."""

    start: F64
    end: F64
    axis: F64
    last: F64

    def only(self, rows: NDArray[np.int64]) -> _Sweep:
        return _Sweep(self.start[rows], self.end[rows], self.axis[rows], self.last[rows])


def _whole(fixture: object, bounds: F64) -> F64:
    """Lower and upper corner of a fixture that reaches down to the underside of the part, (2, 3) float64, mm."""
    box = np.array(fixture, dtype=np.float64)
    box[0, 2] = min(box[0, 2], float(bounds[0, 2]))
    return box


def _bodies(tool: ToolBody, setup: ProofSetup) -> Iterator[TurnedOutline]:
    """The cutting part of a tool and its necks, shanks and holders, without their clearance."""
    yield TurnedOutline(np.array(tool.cutting_profile(CHORDS), dtype=np.float64), CUTTER, 0.0)
    for z0, z1, r0, r1, clear, part in Bodies.of([tool], setup).rows.tolist():
        yield TurnedOutline(np.array([[r0 - clear, z0], [r1 - clear, z1]]), int(part), clear)


def _within_reach(moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup,
                  boxes: Sequence[F64]) -> NDArray[np.bool_]:
    """(m,) bool: moves whose whole tool comes as near to a fixture as its reach."""
    reach = Bodies.of(tools, setup).reach(cutter_table(tools))[moves.tool][:, None]
    low, high = np.minimum(moves.start, moves.end) - reach, np.maximum(moves.start, moves.end) + reach
    out = np.zeros(len(moves), np.bool_)
    for box in boxes:
        out |= ((low < box[1]) & (high > box[0])).all(axis=1)
    return out


def _pieces(moves: Moves, tools: Sequence[ToolBody], setup: ProofSetup) -> tuple[Moves, NDArray[np.int64]]:
    """Moves in pieces over which the axis turns so little that chords are within ``BOW``, and the move of each."""
    if moves.axes is None:
        return moves, np.arange(len(moves))
    reach = Bodies.of(tools, setup).reach(cutter_table(tools))[moves.tool]
    turn, length = moves.axes.angle, np.linalg.norm(moves.end - moves.start, axis=1)
    count = np.sqrt((turn * turn * reach + 2.0 * turn * length) / (8.0 * BOW))
    return moves.parted(np.maximum(np.ceil(np.maximum(count, turn / MAX_ANGLE)), 1.0).astype(np.int64))


def _into(sweep: _Sweep, body: TurnedOutline, box: F64) -> tuple[NDArray[np.int64], F64, F64]:
    """Which pieces take a body into a box, (h,) int64, index; how deep, (h,) mm, and where, (h, 3) mm.

    The first ``MAX_CONTACTS`` pieces; a direction that sets one piece apart from the box is tried for all that follow.
    """
    table = body.supports()
    hit, depth, at = list[int](), list[float](), list[F64]()
    open_ = np.arange(len(sweep.start))
    for n in _FEW:
        open_ = open_[~_set_apart(sweep.only(open_), table, box, n)]
    while len(open_) and len(hit) < MAX_CONTACTS:
        one = sweep.only(open_[:1])
        n = _between(one, body, box)
        if n is None:
            overlap, out = _least_overlap(one, body, box)
            if overlap > TOUCHING:
                hit.append(int(open_[0]))
                depth.append(overlap)
                at.append(_support_point(one, body, -out))
        open_ = open_[1:]
        if n is not None:
            open_ = open_[~_set_apart(sweep.only(open_), table, box, n)]
    return np.array(hit, np.int64), np.array(depth), np.array(at).reshape(-1, 3)


def _set_apart(sweep: _Sweep, table: F64, box: F64, n: F64) -> NDArray[np.bool_]:
    """(k,) bool: pieces that a direction (3,) sets apart from a box."""
    over = np.maximum(sweep.start @ n + _looked_up(table, sweep.axis @ n),
                      sweep.end @ n + _looked_up(table, sweep.last @ n)) + _box_support(box, -n)
    return np.asarray(over <= TOUCHING)


def _looked_up(table: F64, cosine: F64) -> F64:
    """Values of a support function for directions whose angles to the axis have a cosine."""
    place = np.arccos(np.clip(cosine, -1.0, 1.0)) * (ANGLES / np.pi)
    low = np.minimum(place.astype(np.int64), ANGLES - 1)
    return np.asarray(table[low] + (place - low) * (table[low + 1] - table[low]))


def _box_support(box: F64, n: F64) -> F64:
    """Support function of a box for directions n (..., 3)."""
    return np.asarray(np.maximum(n * box[0], n * box[1]).sum(axis=-1))


def _body_support(one: _Sweep, body: TurnedOutline, n: F64) -> F64:
    """Support function of one piece for directions n (k, 3), (k,) mm."""
    out = np.full(len(n), -np.inf)
    for tip, axis in ((one.start[0], one.axis[0]), (one.end[0], one.last[0])):
        along = n @ axis
        aside = np.sqrt(np.maximum(1.0 - along * along, 0.0))
        own = (aside[:, None] * body.rings[:, 0] + along[:, None] * body.rings[:, 1]).max(axis=1)
        out = np.maximum(out, n @ tip + own)
    return out


def _support_point(one: _Sweep, body: TurnedOutline, n: F64) -> F64:
    """The place of one piece farthest along n, (3,) float64, mm."""
    best, place = -np.inf, one.start[0]
    for tip, axis in ((one.start[0], one.axis[0]), (one.end[0], one.last[0])):
        aside = n - (n @ axis) * axis
        size = float(np.linalg.norm(aside))
        aside = aside / size if size > 1e-12 else np.zeros(3)
        far = size * body.rings[:, 0] + float(n @ axis) * body.rings[:, 1]
        ring = body.rings[int(np.argmax(far))]
        if tip @ n + far.max() > best:
            best, place = float(tip @ n + far.max()), tip + ring[0] * aside + ring[1] * axis
    return np.asarray(place)


def _least_overlap(one: _Sweep, body: TurnedOutline, box: F64) -> tuple[float, F64]:
    """The least of h_A(-n) + h_B(n) that a search finds, mm, and its direction n, (3,): the way of the body out.

    Every direction tells of a way out, so the least is never too small.

    Notes
    -----
    The sum has creases: directions square to an edge of the box, to the way of the tip, and to the axis. A search all
    round the sphere does not follow them, so each is searched by itself, too.
    """
    def over(n: F64) -> F64:
        return np.asarray(_body_support(one, body, -n) + _box_support(box, n))

    least, best = _around_point(over, np.concatenate([_ALL, one.axis, -one.axis, one.last, -one.last]))
    way = one.end - one.start
    for square_to_it in (*np.eye(3), *one.axis, *one.last, *way[np.linalg.norm(way, axis=1) > SHORT]):
        there, n = _around_circle(over, square_to_it / np.linalg.norm(square_to_it))
        if there < least:
            least, best = there, n
    return least, best


def _around_point(over: Callable[[F64], F64], n: F64) -> tuple[float, F64]:
    """The least of a function of directions, and its direction: the best of n (k, 3), and closer round it."""
    found = over(n)
    best, least, wide = n[int(np.argmin(found))], float(found.min()), NEAR
    for _ in range(ROUNDS):
        x, y = _square(best)
        n = best + wide * (_GRID[:, :1] * x + _GRID[:, 1:] * y)
        n = n / np.linalg.norm(n, axis=1)[:, None]
        found = over(n)
        if found.min() < least:
            least, best = float(found.min()), n[int(np.argmin(found))]
        wide *= SHRINK
    return least, best


def _around_circle(over: Callable[[F64], F64], axis: F64) -> tuple[float, F64]:
    """As ``_around_point`` for the directions square to an axis (3,)."""
    x, y = _square(axis)
    angle, wide = np.linspace(0.0, 2.0 * np.pi, TURNS, endpoint=False), 2.0 * np.pi / TURNS
    least, best = np.inf, 0.0
    for _ in range(ROUNDS):
        found = over(np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y)
        if found.min() < least:
            least, best = float(found.min()), float(angle[int(np.argmin(found))])
        angle, wide = best + wide * np.linspace(-1.0, 1.0, 17), 0.125 * wide
    return least, np.asarray(np.cos(best) * x + np.sin(best) * y)


def _square(n: F64) -> tuple[F64, F64]:
    """Two directions square to a direction and to each other, each (3,)."""
    x = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    x = x / np.linalg.norm(x)
    return x, np.cross(n, x)


def _between(one: _Sweep, body: TurnedOutline, box: F64) -> F64 | None:
    """A direction, (3,) unit, that sets one piece apart from a box, by GJK [Gilbert1988]; None where they meet."""
    def support(n: F64) -> F64:
        return np.asarray(_support_point(one, body, n) - np.where(n > 0.0, box[0], box[1]))

    corners = [support(np.array([1.0, 0.0, 0.0]))]
    nearest = corners[0]
    for _ in range(STEPS):
        away = float(np.linalg.norm(nearest))
        if away < 1e-6:
            return None
        new = support(-nearest)
        if float(new @ nearest) > 0.0:
            return np.asarray(-nearest / away)
        corners.append(new)
        nearest, corners = _nearest_of(corners)
    return None


def _nearest_of(corners: list[F64]) -> tuple[F64, list[F64]]:
    """The place of a simplex of up to four corners that is nearest to the origin, and the corners that carry it."""
    best, place, carried = np.inf, corners[0], corners
    for chosen in range(1, 1 << len(corners)):
        some = [c for k, c in enumerate(corners) if chosen >> k & 1]
        edges = np.array([c - some[0] for c in some[1:]]).reshape(-1, 3)
        share = np.linalg.lstsq(edges.T, -some[0], rcond=None)[0] if len(edges) else np.zeros(0)
        weights = np.concatenate([[1.0 - share.sum()], share])
        if (weights < -1e-12).any():
            continue
        at = weights @ np.array(some)
        if float(at @ at) < best - 1e-15:
            best, place, carried = float(at @ at), at, some
    return place, carried


def _deepest(events: F64) -> F64:
    """Of the events of one body in one move the deepest, (e, 7)."""
    order = np.lexsort((-events[:, 2], events[:, 1], events[:, 0]))
    events = events[order]
    first = np.ones(len(events), np.bool_)
    first[1:] = (events[1:, :2] != events[:-1, :2]).any(axis=1)
    return events[first]


def _sphere(count: int) -> F64:
    """Directions that lie evenly all round, (count, 3) float64, unit."""
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    aside = np.sqrt(1.0 - z * z)
    return np.column_stack([aside * np.cos(turn), aside * np.sin(turn), z])


_CUBE = np.array([[x, y, z] for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0) for z in (-1.0, 0.0, 1.0)
                  if x or y or z])
_CUBE = _CUBE[np.argsort(np.abs(_CUBE).sum(axis=1), kind="stable")]
_CUBE = _CUBE / np.linalg.norm(_CUBE, axis=1)[:, None]
_FEW = np.concatenate([_CUBE, _sphere(64)])
_ALL = np.concatenate([_CUBE, _sphere(ROUND)])
_GRID = np.array([[x, y] for x in np.linspace(-1.0, 1.0, 9) for y in np.linspace(-1.0, 1.0, 9)])

__all__ = ["TurnedOutline", "fixture_contacts"]
