"""Drilling cycles of a control as rapids and feeds along the tool axis: the envelope of what the tool does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from verify.gcode.dialects.base import BlockError, Machine
from verify.gcode.dialects.stated_places import digits

LEAD = 0.2
"""mm above the last depth at which a peck begins to feed again."""


@dataclass(frozen=True)
class DrilledHole:
    """One hole; heights are mm along the tool axis in the coordinates of the control.

    clear, bottom, back : where the feed begins, the bottom, and where the tool goes afterwards
    pecks   : depths of the pecks, mm, from ``clear`` or the surface downwards; empty for one stroke
    surface : height from which the pecks count
    leads   : mm above the last depth where the feed begins again behind each peck that went out; empty for ``LEAD``
    lift    : mm that a peck retracts, inf for all the way to ``clear``
    outs    : of each peck, whether it retracts to ``clear`` all the same; empty: none
    feed    : F word of the way down, '' to keep the one in force; out: of the way up to ``clear``, None for a rapid
    dwell   : s at the bottom
    first   : F word of the first peck, '' for ``feed``
    """

    clear: float
    bottom: float
    back: float
    pecks: tuple[float, ...] = ()
    surface: float = 0.0
    lift: float = math.inf
    feed: str = ""
    out: str | None = None
    dwell: float = 0.0
    leads: tuple[float, ...] = ()
    outs: tuple[bool, ...] = ()
    first: str = ""


def even_pecks(depth: float, first: float, step: float, least: float, machine: Machine) -> tuple[float, ...]:
    """Depths of pecks, mm, that shrink from one to the next.

    depth : of the hole; first : of the first peck; step : by which each is shorter; least : the shortest

    Raises
    ------
    ProgramError
        More pecks than a block may make.
    """
    if first <= 0 or first >= depth:
        return ()
    shrinks = math.ceil((first - least) / step) if step > 0 and first > least else 0
    shortest = max(first - step * shrinks, least) if step > 0 else first
    if shortest <= 0:
        shortest = min(first, depth)
    machine.log.room(4.0 * (shrinks + depth / shortest + 2))
    out, at, peck = [], 0.0, first
    while at + peck < depth - 1e-9:
        at += peck
        out.append(at)
        peck = max(peck - step, least, 1e-9) if step > 0 else peck
    return tuple(out)


def scaled_pecks(depth: float, first: float, share: float, least: float, machine: Machine) -> tuple[float, ...]:
    """Depths of pecks, mm, of which each is a share of the one before.

    depth : of the hole; first : of the first peck; share : above 0 and below 1; least : the shortest peck, above 0

    Raises
    ------
    ProgramError
        More pecks than a block may make.
    """
    if first <= 0 or first >= depth:
        return ()
    machine.log.room(4.0 * (depth / min(least, first) + 2))
    out, at, peck = [], 0.0, first
    while at + peck < depth - 1e-9:
        at += peck
        out.append(at)
        peck = max(peck * share, min(least, first))
    return tuple(out)


def broken_pecks(depth: float, pecks: tuple[float, ...], step: float,
                 machine: Machine) -> tuple[tuple[float, ...], tuple[bool, ...]]:
    """Pecks with stops between them, to break the chip.

    depth : mm, of the hole; pecks : mm, depths at which the tool goes out; step : mm between stops, from each of them

    Returns the depths of all, mm, and of each whether the tool goes out there.

    Raises
    ------
    ProgramError
        More stops than a block may make.
    """
    machine.log.room(4.0 * (depth / step + len(pecks) + 2))
    stops: list[tuple[float, bool]] = []
    for begin, end in zip((0.0, *pecks), (*pecks, depth), strict=True):
        count = max(math.ceil((end - begin) / step - 1e-9) - 1, 0)
        stops += [(begin + step * (k + 1), False) for k in range(count)] + [(end, True)]
    return tuple(d for d, _ in stops[:-1]), tuple(out for _, out in stops[:-1])


def even_leads(count: int, first: float, last: float) -> tuple[float, ...]:
    """Leads of ``count`` pecks, mm, that change evenly from that of the first peck to that of the last one."""
    return tuple(first + (last - first) * k / max(count - 1, 1) for k in range(count))


def hole_blocks(hole: DrilledHole, here: Sequence[float], axis: int, unit: float, relative: bool) -> list[str]:
    """Blocks of a hole at the place where the tool stands.

    here : (3,) mm, in the coordinates of the control; axis : 0, 1 or 2, the tool axis
    unit : mm for one unit of the program; relative : whether coordinates are incremental

    Raises
    ------
    BlockError
        A depth above the place where its feed begins; a place that is not stated.
    """
    across = [v for k, v in enumerate(here) if k != axis]
    if any(math.isnan(v) for v in across):
        raise BlockError("a drilling cycle at a place that the program has not stated")
    if hole.bottom > hole.clear + 1e-9:
        raise BlockError(f"a drilling cycle whose depth, {hole.bottom:g} mm, is above the place where its feed begins, "
                         f"{hole.clear:g} mm")
    out: list[str] = []
    at = here[axis]
    if relative and math.isnan(at):
        raise BlockError("a drilling cycle in incremental coordinates at a height that the program has not stated")

    def go(word: str, height: float, feed: str = "") -> None:
        nonlocal at
        out.append(f"{word} {'XYZ'[axis]}{digits((height - at if relative else height) / unit)} {feed}".strip())
        at = height

    go("G0", hole.clear)
    gone, feed = 0, hole.first or hole.feed
    for n, depth in enumerate(hole.pecks):
        height = max(hole.surface - depth, hole.bottom)
        if height >= hole.clear:
            continue
        go("G1", height, feed)
        feed = hole.feed
        lift = math.inf if hole.outs and hole.outs[n] else hole.lift
        go("G0", min(height + lift, hole.clear))
        if math.isinf(lift):
            go("G0", min(height + (hole.leads[gone] if hole.leads else LEAD), hole.clear))
            gone += 1
    go("G1", hole.bottom, feed)
    if hole.dwell > 0:
        out.append(f"G4 P{digits(hole.dwell)}")
    if hole.out is not None:
        go("G1", hole.clear, hole.out)
    go("G0", hole.back)
    return out


__all__ = ["DrilledHole", "broken_pecks", "even_leads", "even_pecks", "hole_blocks", "scaled_pecks"]
