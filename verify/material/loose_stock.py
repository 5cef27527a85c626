"""Pieces of stock that the programs cut off from the rest: a slug in a through pocket, a part out of its frame.

The stock that stands after all moves is parted into pieces that hang together. A piece that no fixture touches lies
loose: the flutes may catch it. Where fixtures touched the blank and touch nothing in the end, every piece does; without
such fixtures the largest counts as held. Shops hold pieces by tape, vacuum or glue, of which no setup tells, so a loose
piece is an assumption and no finding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from geometry.mesh import F64, TriangleMesh
from geometry.tool_body import ToolBody
from verify.assumptions import Assumed, AssumedKind
from verify.blank.blank import stock_bounds
from verify.findings import Source
from verify.material.stock_field import DistanceField
from verify.material.stock_lines import StockLines
from verify.model import ProofSetup
from verify.moves import Moves

SKIN = 0.01  # mm: lines no higher over the underside of the stock hold nothing
VOLUME, WIDTH = 5.0, 1.0  # mm³ and mm: smaller or thinner pieces are chips
TOUCH = 0.05  # mm: a fixture so near holds a piece
BESIDE = 0.5  # mm: a piece so near to a cut was cut off by it
LISTED = 4
SLAB = 8
Slices = tuple[slice, ...]


@dataclass(frozen=True, eq=False)
class LoosePiece:
    """A piece of stock that nothing of the setup holds.

    volume : mm³
    middle : (3,) float64, mm, setup frame, of the box round it
    part   : whether the part is in it
    joined : mm, what is thinner may join it to the rest unseen
    border : (n, 2) float64, mm, setup frame, lines at its border; none where tools lean
    foot   : mm, underside of the stock
    let_go : whether fixtures touched the blank, and now touch no piece
    """

    volume: float
    middle: F64
    part: bool
    joined: float
    border: F64
    foot: float
    let_go: bool


@dataclass(frozen=True, eq=False)
class _Lattice:
    """The stock after all moves by places of a lattice, of two or three axes.

    label  : int32, number of the piece of each place, 0 for none
    first  : (2,) or (3,) float64, mm, setup frame, the place of index 0
    step   : mm
    volume : (n + 1,) float64, mm³, of the pieces by number
    """

    label: NDArray[np.int32]
    first: F64
    step: float
    volume: F64

    def mask(self, n: int, at: Slices) -> NDArray[np.bool_]:
        """Where piece ``n`` stands in a box of indices, bool."""
        return np.asarray(self.label[at] == n)

    def wide(self, n: int, at: Slices) -> bool:
        """Whether a square or cube of ``WIDTH`` has room in piece ``n``."""
        side, (rows, *across) = int(WIDTH / self.step + 1e-9) + 1, at
        for first in range(rows.start, rows.stop, SLAB * side):  # a large piece has room in one of its first slabs
            slab = slice(first, min(first + (SLAB + 1) * side, rows.stop))
            here = self.mask(n, (slab, *across)).astype(np.uint8)
            if ndimage.minimum_filter(here, side, mode="constant").any():
                return True
        return False

    def holds_most(self, places: F64) -> int:
        """Number of the piece in which most of the places, (k, 2) or (k, 3) mm, lie."""
        index = np.rint((places - self.first) / self.step).astype(np.int64)
        index = np.clip(index, 0, np.array(self.label.shape) - 1)
        counts = np.bincount(self.label[tuple(index.T)], minlength=2)
        return 1 + int(np.argmax(counts[1:]))

    def touches(self, n: int, at: Slices, box: F64) -> bool:
        """Whether piece ``n`` is beside or in a fixture, (2, 2) or (2, 3) mm."""
        reach = 0.5 * self.step + TOUCH
        low = np.ceil((box[0] - reach - self.first) / self.step).astype(np.int64)
        high = np.floor((box[1] + reach - self.first) / self.step).astype(np.int64) + 1
        near = tuple(slice(max(a.start, int(i)), min(a.stop, int(j))) for a, i, j in zip(at, low, high, strict=True))
        return all(s.start < s.stop for s in near) and bool(self.mask(n, near).any())


def loose_lines(lines: StockLines, mesh: TriangleMesh, setup: ProofSetup) -> list[LoosePiece]:
    """Loose pieces of a stock of vertical lines after all moves, the part first, then the largest.

    mesh : of the part, mm, setup frame
    """
    over = np.maximum(lines.height - lines.bottom, 0.0)
    label, count = ndimage.label(over > SKIN)
    touched = _touched(mesh, setup)
    if count < 2 and not touched:
        return []
    volume = np.bincount(label.ravel(), over.ravel(), count + 1).astype(np.float64) * lines.step**2
    stock = _Lattice(label, lines.origin + 0.5 * lines.step, lines.step, volume)
    own = stock.holds_most(mesh.triangles.mean(axis=1)[:, :2])

    def tall(n: int, at: Slices) -> float:
        return float(over[at][stock.mask(n, at)].max())

    def is_thick(n: int, at: Slices) -> bool:
        return tall(n, at) >= WIDTH and stock.wide(n, at)

    def is_held(n: int, at: Slices, box: F64) -> bool:
        stands = box[1, 2] >= lines.bottom - TOUCH and box[0, 2] <= lines.bottom + tall(n, at) + TOUCH
        return bool(stands) and stock.touches(n, at, box[:, :2])

    def piece(n: int, at: Slices, let_go: bool) -> LoosePiece:
        here = stock.mask(n, at)
        rim = np.argwhere(here & ~ndimage.binary_erosion(here)) + [s.start for s in at]
        border = stock.first + rim * stock.step
        x, y = 0.5 * (border.min(axis=0) + border.max(axis=0))
        return LoosePiece(float(volume[n]), np.array([x, y, lines.bottom + 0.5 * tall(n, at)]), n == own, SKIN, border,
                          lines.bottom, let_go)

    return [piece(*p) for p in _loose(stock, own, is_thick, is_held, setup, touched)]


def loose_nodes(field: DistanceField, mesh: TriangleMesh, setup: ProofSetup) -> list[LoosePiece]:
    """Loose pieces of a stock of distances after all moves, as ``loose_lines``."""
    label, count = ndimage.label(field.values > 0.0)
    touched = _touched(mesh, setup)
    if count < 2 and not touched:
        return []
    volume = np.bincount(label.ravel(), minlength=count + 1).astype(np.float64) * field.step**3
    stock = _Lattice(label, field.origin, field.step, volume)
    own = stock.holds_most(mesh.triangles.mean(axis=1))

    def piece(n: int, at: Slices, let_go: bool) -> LoosePiece:
        middle = field.origin + 0.5 * field.step * np.array([s.start + s.stop - 1 for s in at])
        return LoosePiece(float(stock.volume[n]), middle, n == own, field.step, np.zeros((0, 2)), 0.0,
                          let_go)

    return [piece(*p) for p in _loose(stock, own, stock.wide, stock.touches, setup, touched)]


def _loose(stock: _Lattice, own: int, is_thick: Callable[[int, Slices], bool],
           is_held: Callable[[int, Slices, F64], bool], setup: ProofSetup,
           touched: bool) -> list[tuple[int, Slices, bool]]:
    """Numbers of the loose pieces with the indices of the boxes round them, the part ``own`` first.

    touched : whether fixtures touched the blank

    Returns with each whether they let go of it and of all others.
    """
    large = [n for n in np.flatnonzero(stock.volume >= VOLUME).tolist() if n > 0]
    if len(large) < 2 and not touched:
        return []
    boxes = ndimage.find_objects(stock.label)
    pieces = sorted(((n, boxes[n - 1]) for n in large), key=lambda p: -stock.volume[p[0]])
    held = {n for n, at in pieces if any(is_held(n, at, np.asarray(box)) for box in setup.fixtures)}
    thick = [(n, at) for n, at in pieces if is_thick(n, at)]
    free = [p for p in thick if p[0] not in held] if held or touched else thick[1:]  # the largest is held
    return sorted(((n, at, not held and touched) for n, at in free), key=lambda p: p[0] != own)


def _touched(mesh: TriangleMesh, setup: ProofSetup) -> bool:
    """Whether a fixture is beside the box round the blank, or in it."""
    low, high = stock_bounds(mesh.bounds, setup)
    return any(bool(((box[0] <= high + TOUCH) & (box[1] >= low - TOUCH)).all()) for box in map(np.asarray,
                                                                                               setup.fixtures))


def loose_assumptions(pieces: Sequence[LoosePiece], moves: Moves, cut: NDArray[np.bool_], source: Source,
                      tools: Sequence[ToolBody]) -> Iterator[Assumed]:
    """The loose pieces that a proof takes for held.

    moves, cut : in the frame of the proof, mm, and (m,) bool, those that remove stock
    """
    for k, p in enumerate(pieces[:LISTED]):
        x, y, z = p.middle.tolist()
        line = _cut_off(p, moves, cut, tools)
        by = f", cut off by line {source.line[line]} of {source.names[source.program[line]]}" if line >= 0 else ""
        more = f" (and {len(pieces) - LISTED} more)" if k == LISTED - 1 and len(pieces) > LISTED else ""
        what = "the part, in a piece" if p.part else "a piece"
        why = "no fixture touches any more" if p.let_go else \
            f"nothing thicker than {p.joined:.2g} mm joins to the rest of the stock{by}"
        yield Assumed(AssumedKind.LOOSE_STOCK, f"held: {what} of {p.volume:.0f} mm³ at X{x:.1f} Y{y:.1f} Z{z:.1f} that "
                      f"{why}{more}",
                      "it lies loose, and the tool catches it and breaks or throws it",
                      "hold it (fixtures, tape, vacuum), leave tabs, or mill it away")


def _cut_off(piece: LoosePiece, moves: Moves, cut: NDArray[np.bool_], tools: Sequence[ToolBody]) -> int:
    """The last move that cut through the stock beside a piece; -1 for none."""
    if not len(piece.border):
        return -1
    low, high = np.minimum(moves.start, moves.end), np.maximum(moves.start, moves.end)
    radius = np.array([t.widest_radius for t in tools])[moves.tool] + BESIDE
    room = radius[:, None]
    near = cut & (low[:, 2] <= piece.foot + SKIN) \
        & (low[:, :2] - room <= piece.border.max(axis=0)).all(axis=1) \
        & (high[:, :2] + room >= piece.border.min(axis=0)).all(axis=1)
    for m in np.flatnonzero(near)[::-1].tolist():
        a, d = moves.start[m, :2], moves.end[m, :2] - moves.start[m, :2]
        w = piece.border - a
        s = np.clip(w @ d / max(float(d @ d), 1e-18), 0.0, 1.0)
        if np.hypot(*(w - s[:, None] * d).T).min() <= radius[m]:
            return m
    return -1


__all__ = ["LoosePiece", "loose_assumptions", "loose_lines", "loose_nodes"]
