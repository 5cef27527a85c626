"""Sections of walls: each side of a wall as one curve in plan, walked with the void on the left.

    the whole part cut at mid height -> loops -> pieces of this wall that have its other side behind them
    -> stretches -> joined around corners and behind junctions, bridged over interruptions -> sides

A piece is *backed* where the material across it ends on an opposed surface within three thicknesses. Runs of
backed pieces are stretches. Two stretches that follow each other on a loop and face each other through the material
have an end cap between them. Otherwise they are one side that continues (around a corner of a tray, behind a rib).
Where another wall, a connection or an opening interrupts a side, the stretches before and after are bridged when they
lie in line and the chord between them runs through material or past an opening.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.mesh import F64
from geometry.part import Part
from zones.model import Decomposition, Wall
from zones.plan_view.mesh_slices import Slicer
from zones.plan_view.section_bridges import bridge
from zones.plan_view.wall_pieces import FREE, MINE, OTHER, Pieces, turn_between

# Lengths are multiples of the thickness of the wall.
# Least backed share of the last two thicknesses before an end of a stretch.
TAIL, TAIL_SHARE = 2.0, 0.25
# Faces that belong to no wall, such as fillets, are passed up to this length.
AROUND = 6.0
# The path around a fillet is at most this many times its chord.
DETOUR = 1.25
# The end of a side is rounded where it turns to the right by this angle (rad) within the window, over this length.
# A bend of the wall itself does not: its outer side has a radius of a thickness or more, so the window turns by no more
# than its own number. Its inner side turns to the left, however sharply.
CURL_LENGTH, CURL_WINDOW, CURL_TURN = 1.5, 0.25, 0.25
# Behind the end of a slanting cap a side continues unbacked, in line within this angle (rad), up to this length.
GROW_TURN, GROW_LENGTH = 0.1, 3.0
# Least cosine between a chord and the sides it joins.
IN_LINE = 0.8
# Heights to try, as shares of the height of the wall. Another height than the middle counts where more than this share
# is bridged, a side stays in parts, or a ring stays open.
HEIGHTS = (0.5, 0.6, 0.4, 0.7, 0.3)
NODE_ROOM = 0.01  # of the height of a wall: largest shift of a cut to keep clear of the nodes of the mesh
BRIDGED_SHARE = 0.25
# Another height wins where its bridged share of the length is less by this.
GAIN = 0.02
# Curves shorter than this share of the longest, or than two thicknesses, do not count as sides.
SIDE_SHARE, SIDE_LENGTH = 0.25, 2.0

BRIDGE = 0


@dataclass(frozen=True, eq=False)
class SideCurve:
    """One side of a wall, cut at one height.

    wall   : id, for example 'W1'
    z      : mm
    points : (n, 2) float64, mm, in plan, walked with the void on the LEFT: the outward normal is the left normal
    closed : a ring; the last point is not repeated
    face   : (n,) int, number of the B-rep face that the segment from point i to the next one lies on; 0 on a bridge.
             The last entry of an open curve repeats the one before
    """

    wall: str
    z: float
    points: F64
    closed: bool
    face: np.ndarray


def wall_sections(part: Part, decomposition: Decomposition, height: float | None = None) -> tuple[SideCurve, ...]:
    """The sides of every wall at its mid height.

    part          : Part in the setup frame, mm
    decomposition : Decomposition of the part
    height        : mm, height of the cut of all walls; None for the middle of each

    Returns
    -------
    tuple of SideCurve
        By wall, then by centroid. Open walls have two sides, closed ones two rings. End caps and the roundings of ends
        are left out. Without a given height a wall is cut at the middle. It is cut at 0.6, 0.4, 0.7 or 0.3 of its
        height where the middle section leaves a side in parts or a ring open, or bridges over a quarter of the length,
        and another section does not.
        Points are at most the deviation of the mesh off the exact surface, except on bridges over interruptions.
    """
    count = max((f.number for f in part.faces), default=0) + 1
    owner = np.full(count, -1)
    for i, wall in enumerate(decomposition.walls):
        owner[list(wall.faces)] = i
    for c in decomposition.connections:
        owner[list(c.faces)] = -2
    out: list[SideCurve] = []
    slicer = Slicer(part.mesh)
    for i, wall in enumerate(decomposition.walls):
        out += _best_height(slicer, owner, i, wall, height)
    return tuple(out)


def _best_height(slicer: Slicer, owner: np.ndarray, index: int, wall: Wall,
                 height: float | None) -> list[SideCurve]:
    span = wall.z_top - wall.z_bottom
    heights = [wall.z_bottom + s * span for s in HEIGHTS] if height is None else [height]
    best: tuple[float, list[SideCurve]] = (np.inf, [])
    if height is None and span > 0:
        heights = [slicer.clear_of_nodes(z, NODE_ROOM * span) for z in heights]
    for z in heights:
        curves, poor = _Section(slicer, owner, index, wall, z).sides()
        if poor < best[0] - GAIN:
            best = (poor, curves)
        if best[0] <= BRIDGED_SHARE:
            break
    return best[1]


@dataclass(eq=False)
class _Chain:
    """A side in the making: rows of pieces in walking order, bridges marked by -1."""

    rows: list[int]
    closed: bool = False


class _Section(Pieces):
    """One wall cut at one height, and its stretches put together."""

    def sides(self) -> tuple[list[SideCurve], float]:
        """Curves and their penalty, see ``_poor``."""
        if not (self.kind == MINE).any():
            return [], 3.0
        chains = self._joined(self.stretches())
        used = {r for c in chains for r in c.rows}
        chains = self._bridge([self._trimmed(self._grown(c, used)) for c in chains])
        curves, bridged, torn = [], [], []
        # Rings within an open wall are bores, upright holes in its material, not sides.
        bored = any(not c.closed for c in chains)
        for chain in chains:
            curve = None if bored and chain.closed else self._curve(chain)
            if curve is not None:
                curves.append(curve)
                bridged.append(_lengths(curve)[curve.face[:len(_lengths(curve))] == BRIDGE].sum())
                torn.append(self._torn(chain))
        total = [float(_lengths(c).sum()) for c in curves]
        least = max(SIDE_LENGTH * self.thick, SIDE_SHARE * max(total, default=0.0))
        kept = [i for i, t in enumerate(total) if t >= least]
        kept.sort(key=lambda i: tuple(np.round(curves[i].points.mean(axis=0) / (1e-3 * self.thick))))
        share = sum(bridged[i] for i in kept) / max(sum(total[i] for i in kept), 1e-30)
        open_rings = sum(total[i] for i in kept if torn[i])
        return [curves[i] for i in kept], self._poor(total, len(kept), share, open_rings)

    def _poor(self, total: list[float], kept: int, bridged: float, torn: float) -> float:
        """Penalty of a section: 2 or more for a missing side, 1 to 2 for one in parts, else the bridged share.

        total : mm, length of every curve; kept : number of sides; bridged : share of their length
        torn  : mm, length of the sides that are open rings
        """
        if kept < 2:
            return 3.0 - 0.5 * kept
        parts = torn + sum(t for t in sorted(total)[:-2] if t >= SIDE_LENGTH * self.thick)
        return 1.0 + parts / sum(total) if parts else float(bridged)

    def _joined(self, stretches: list[list[int]]) -> list[_Chain]:
        """Stretches that continue around a corner or behind a junction, joined along the loop."""
        after: dict[int, tuple[int, list[int]]] = {}
        for loop in {int(self.loop[s[0]]) for s in stretches}:
            here = [i for i, s in enumerate(stretches) if self.loop[s[0]] == loop]
            rows = np.flatnonzero(self.loop == loop)
            for i, j in zip(here, here[1:] + here[:1], strict=True):
                gap = self._between(rows, stretches[i][-1], stretches[j][0])
                if self._goes_on(stretches[i], gap, stretches[j]):
                    after[i] = (j, gap)
        chains, used = [], set()
        entered = {j for j, _ in after.values()}
        for i in [k for k in range(len(stretches)) if k not in entered] + list(range(len(stretches))):
            if i in used:
                continue
            chain, k = _Chain([]), i
            while k not in used:
                used.add(k)
                chain.rows += stretches[k]
                if k not in after:
                    break
                k, gap = after[k]
                chain.rows += gap
                chain.closed = k == i
            chains.append(chain)
        return chains

    @staticmethod
    def _between(rows: np.ndarray, last: int, first: int) -> list[int]:
        i, n = int(last - rows[0]) + 1, len(rows)
        return [int(rows[(i + k) % n]) for k in range((int(first - rows[0]) - i) % n)]

    def _goes_on(self, one: list[int], gap: list[int], two: list[int]) -> bool:
        if (self.kind[gap] == OTHER).any():
            return False
        if (self.kind[gap] == FREE).any():
            path, chord = float(self.length[gap].sum()), float(np.linalg.norm(self.a[two[0]] - self.b[one[-1]]))
            # Around a fillet, but straight over the stub of a bar that comes out behind the wall.
            if path > AROUND * self.thick or path > DETOUR * chord:
                return False
        tail, head = self._tail(one[::-1]), self._tail(two)
        if one is two and not gap:
            return True
        # The next stretch may lie in the gap too: the back of a thin lip at the end of the wall.
        behind = max(self._share(tail, gap + two), self._share(head, gap + one))
        return behind < TAIL_SHARE

    def _share(self, rows: np.ndarray, others: list[int]) -> float:
        """Share of some pieces with others behind it, by length, since facets crowd where a side bends."""
        return float(self.length[rows] @ np.isin(self.hit[rows], others) / max(self.length[rows].sum(), 1e-30))

    def _tail(self, rows: list[int]) -> np.ndarray:
        reach = np.cumsum(self.length[rows]) - self.length[rows]
        return np.asarray(rows)[reach <= TAIL * self.thick]

    def _grown(self, chain: _Chain, used: set[int]) -> _Chain:
        """The chain with the straight ends that face a slanting cap instead of the other side; extends ``used``."""
        if not chain.closed:
            chain.rows = self._more(chain.rows[0], -1, used)[::-1] + chain.rows + self._more(chain.rows[-1], 1, used)
        return chain

    def _more(self, row: int, step: int, used: set[int]) -> list[int]:
        rows = np.flatnonzero(self.loop == self.loop[row])
        out: list[int] = []
        way = self.way[row]
        while float(self.length[out].sum()) < GROW_LENGTH * self.thick:
            row = int(rows[(row - rows[0] + step) % len(rows)])
            straight = abs(float(turn_between(way[None], self.way[row][None])[0])) < GROW_TURN
            if row in used or self.kind[row] != MINE or self.hit[row] != -1 or not straight:
                break
            out.append(row)
            used.add(row)
        return out

    def _trimmed(self, chain: _Chain) -> _Chain:
        """The chain without the roundings of its ends."""
        if chain.closed:
            return chain
        lead, trail = self._curl(chain.rows, -1), self._curl(chain.rows[::-1], 1)
        return _Chain(chain.rows[lead:len(chain.rows) - trail])

    def _curl(self, rows: list[int], right: int) -> int:
        """Count of the pieces that belong to the rounding of an end, the end first.

        right : sign of a turn to the right of the walk between pieces in the order of ``rows``
        """
        reach = np.cumsum(self.length[rows])
        near = int(np.searchsorted(reach, CURL_LENGTH * self.thick)) + 2
        if near < 3 or near > len(rows):
            return 0
        turn = right * turn_between(self.way[rows[:near - 1]], self.way[rows[1:near]])
        at = reach[:near - 1]
        window = CURL_WINDOW * self.thick
        last = 0
        for k in range(len(turn)):
            inside = (at > at[k] - window) & (at <= at[k])
            if turn[k] > 1e-6 and turn[inside].sum() > CURL_TURN:
                last = k + 1
        return last

    def _bridge(self, chains: list[_Chain]) -> list[_Chain]:
        """Stretches of one side, joined by bridges over interruptions, nearest first."""
        pairs = []
        ways = [(self._heading(c.rows[::-1]), self._heading(c.rows)) for c in chains]
        for i, one in enumerate(chains):
            for j, two in enumerate(chains):
                far = self._in_line(one, two, ways[i][0], ways[j][1])
                if far is not None:
                    pairs.append((far, i, j))
        after: dict[int, int] = {}
        taken: set[int] = set()
        for _, i, j in sorted(pairs):
            if i not in after and j not in taken:
                after[i] = j
                taken.add(j)
        out, used = [], set()
        for i in [k for k in range(len(chains)) if k not in taken] + list(range(len(chains))):
            if i in used:
                continue
            chain, k = _Chain([], chains[i].closed), i
            while k not in used:
                used.add(k)
                chain.rows += chains[k].rows
                if k not in after:
                    break
                chain.rows.append(-1)
                chain.closed, k = after[k] == i, after[k]
            out.append(chain)
        return out

    def _torn(self, chain: _Chain) -> bool:
        """Whether a chain is a ring interrupted in a bend: its ends face each other, but not in line."""
        rows = _Chain([r for r in chain.rows if r >= 0], chain.closed)
        return self._in_line(rows, rows, self._heading(rows.rows[::-1]), self._heading(rows.rows), 0.0) is not None

    def _in_line(self, one: _Chain, two: _Chain, leave: F64, enter: F64, min_cosine: float = IN_LINE) -> float | None:
        """Length of the chord from the end of one chain to the start of another, None where they are not one side.

        leave, enter : (2,) float64, unit, directions of the end of the first and of the start of the second
        min_cosine   : cosine of the angle between the chord and either side that is allowed
        """
        if one.closed or two.closed or not one.rows or not two.rows:
            return None
        p, q = self.b[one.rows[-1]], self.a[two.rows[0]]
        far = float(np.linalg.norm(q - p))
        if far < 1e-9 * self.thick:
            return None
        u = (q - p) / far
        if min(float(leave @ u), float(enter @ u)) < min_cosine:
            return None
        return far if self._filled(p, q) else None

    def _over(self, chain: _Chain, k: int) -> list[F64]:
        """Points of the bridge at place k of a chain: the end before it, and those up to the next start."""
        ends = [j for j, row in enumerate(chain.rows) if row < 0]
        here = ends.index(k)
        one = chain.rows[ends[here - 1] + 1 if here else 0:k]
        two = chain.rows[k + 1:ends[here + 1] if here + 1 < len(ends) else len(chain.rows)]
        two = two or chain.rows[:ends[0]]  # the last bridge of a ring leads to its start
        before = np.vstack([self.a[one[:1]], self.b[one]])
        after = np.vstack([self.a[two], self.b[two[-1:]]])
        return [before[-1], *bridge(before, after, self.thick)]

    def _heading(self, rows: list[int]) -> F64:
        """Mean direction of the pieces nearest to an end, unit."""
        of = np.asarray(rows, np.int64)
        near = of[np.cumsum(self.length[of]) - self.length[of] <= self.thick]
        total = (self.way[near] * self.length[near][:, None]).sum(axis=0)
        return np.asarray(total / max(float(np.linalg.norm(total)), 1e-30))

    def _filled(self, p: F64, q: F64) -> bool:
        """Whether the chord runs through material, or the wall continues above or below it (an opening)."""
        u = (q - p) / np.linalg.norm(q - p)
        inward = np.array([u[1], -u[0]])
        for share in (0.25, 0.5, 0.75):
            at = p + share * (q - p) + 0.3 * self.thick * inward
            if not self.cut.holds(at) and not self._covered(at):
                return False
        return True

    def _covered(self, at: F64) -> bool:
        """Whether faces of the wall lie over or under a point in plan."""
        t = self.mesh.triangles[np.isin(self.mesh.face_ids, self.wall.faces)][:, :, :2]
        near = (t.min(axis=1) <= at).all(axis=1) & (t.max(axis=1) >= at).all(axis=1)
        d = t[near] - at
        cross = np.stack([d[:, k, 0] * d[:, k - 2, 1] - d[:, k, 1] * d[:, k - 2, 0] for k in range(3)])
        return bool(((cross >= 0).all(axis=0) | (cross <= 0).all(axis=0)).any())

    def _curve(self, chain: _Chain) -> SideCurve | None:
        points: list[F64] = []
        face: list[int] = []
        for k, row in enumerate(chain.rows):
            if row < 0:
                over = self._over(chain, k)
                points += over
                face += [BRIDGE] * len(over)
            elif not (self.inner[row] and k > 0 and chain.rows[k - 1] == row - 1):
                points.append(self.a[row])
                face.append(int(self.face[row]))
        if not chain.closed and chain.rows:
            points.append(self.b[chain.rows[-1]])
            face.append(face[-1])
        if len(points) < (3 if chain.closed else 2):
            return None
        p, f = np.array(points), np.array(face)
        if chain.closed:
            first = int(np.lexsort((p[:, 1], p[:, 0]))[0])
            p, f = np.roll(p, -first, axis=0), np.roll(f, -first)
        return SideCurve(self.wall.id, float(self.z), p, chain.closed, f)


def _lengths(curve: SideCurve) -> F64:
    p = np.vstack([curve.points, curve.points[:1]]) if curve.closed else curve.points
    return np.asarray(np.linalg.norm(np.diff(p, axis=0), axis=1))

