"""Findings of a proof that the next plan of the same job avoids.

A planner decides by estimates: it knows the stock at the nodes of a lattice, a ramp by the slope of its line, a wall by
its profile. Where an estimate is wrong the proof reports the place. The next plan reacts in this order.

- A place that was cut too deep: the tool goes there in thinner layers, and past it at the feed of the cut.
- A place where that does not help, or where the tool met something besides stock under its end: lines leave it out.
  The material there counts as left.
- A sample with too much material left: the plan aims lower there, and gives it up where that fails again.
- A thin wall without support: all tools go down in lower bands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.tool_body import ToolBody
from toolpath.lines import dense

CARE = 0.5  # share of layer depth and ramp slope that is used near a place in ``dug``
CAREFUL = 1.0  # radii: a line this near a place in ``dug``, in plan, goes there
BARRED = 0.3  # radii: a line this near a place in ``barred`` leaves it out
MIN_BARRED = 0.2  # mm
CROWDED = 0.75  # radii: a line this near a place in ``packed`` is skimmed first
CLOSER = 0.7  # factor on the thickness of a wall, each time it was found without support
STRICTER = 0.5  # factor on the aimed residual where more stayed than the plan had measured
ROW = 2**32  # cells of a row


@dataclass(frozen=True)
class HighWall:
    """A thin wall that needs support while it is finished.

    top, bottom : mm, heights between which it stands, access frame
    thickness   : mm
    """

    top: float
    bottom: float
    thickness: float


@dataclass(frozen=True, eq=False)
class Counterexamples:
    """Findings by tool id and by zone id.

    The first three hold tip places by tool id, (n, 3) float64, mm, in the frame of the plan. ``left`` and ``lost`` hold
    (n,) int64, index into the checks of a zone, by zone id.

    dug    : the descent took more than one layer at once
    barred : the tool must not go there
    packed : too much of the cutter was in stock
    left   : more material stayed than allowed
    lost   : more material stayed a second time; the plan gives these samples up
    unheld : walls that were finished without support, with a smaller thickness where support has to be nearer
    """

    dug: Mapping[str, F64] = field(default_factory=dict)
    barred: Mapping[str, F64] = field(default_factory=dict)
    packed: Mapping[str, F64] = field(default_factory=dict)
    left: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    lost: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    unheld: tuple[HighWall, ...] = ()

    def care(self, tool: ToolBody, points: F64) -> float:
        """Share of layer depth and ramp slope that a line may use; 1 where the proof found nothing near it.

        points : (n, 3) float64, mm, tips in the frame of the plan
        """
        if tool.id not in self.dug:
            return 1.0
        return CARE if _near(self.dug[tool.id], _way(tool, points), CAREFUL * tool.radius, plan=True).any() else 1.0

    def bars(self, tool: ToolBody, points: F64) -> NDArray[np.bool_]:
        """Whether tips lie where the tool must not go, (n,) bool.

        points : (n, 3) float64, mm, tips in the frame of the plan
        """
        return _near(self.barred.get(tool.id), points, max(BARRED * tool.radius, MIN_BARRED))

    def crowds(self, tool: ToolBody, points: F64) -> NDArray[np.bool_]:
        """Whether tips lie where too much of the cutter was in stock, (n,) bool.

        points : (n, 3) float64, mm, tips in the frame of the plan
        """
        return _near(self.packed.get(tool.id), points, CROWDED * tool.radius)

    def aims(self, zone: str, aim: float, count: int) -> F64:
        """Residual that the plan aims at for each sample of a zone: ``aim``, or less where too much stayed.

        zone  : id of the zone
        aim   : mm
        count : number of samples

        Returns (count,) float64, mm; -inf for samples that are given up, so that they always count as left.
        """
        out = np.full(count, aim)
        out[self.left.get(zone, [])] *= STRICTER
        out[self.lost.get(zone, [])] = -np.inf
        return out

    def since(self, before: Counterexamples) -> NewExamples:
        """What these have and earlier ones of the same job had not; all of both where these do not begin with those."""
        tools = {*self.dug, *self.barred, *self.packed, *before.dug, *before.barred, *before.packed}
        tips = {t: np.vstack([_added(now.get(t), old.get(t)) for now, old in (
            (self.dug, before.dug), (self.barred, before.barred), (self.packed, before.packed))]) for t in tools}
        zones = {z for now, old in ((self.left, before.left), (self.lost, before.lost)) for z, rows in now.items()
                 if not np.array_equal(rows, old.get(z, []))}
        return NewExamples({t: places for t, places in tips.items() if len(places)}, frozenset(zones),
                           self.unheld != before.unheld)


NONE = Counterexamples()


@dataclass(frozen=True, eq=False)
class NewExamples:
    """Counterexamples that the last proof of a job added.

    tips   : (n, 3) float64, mm, tip places by tool id, in the frame of the plan
    zones  : ids of zones with samples where more material stayed than allowed
    unheld : whether a wall was finished without support
    """

    tips: Mapping[str, F64]
    zones: frozenset[str]
    unheld: bool


@dataclass(frozen=True, eq=False)
class Asked:
    """Places and zones that counterexamples were asked about.

    sizes : mm, side of the cells in plan by tool id, no less than a counterexample reaches
    cells : (n,) int64, ascending, cells with such places, by tool id
    zones : ids
    """

    sizes: Mapping[str, float]
    cells: Mapping[str, NDArray[np.int64]]
    zones: frozenset[str]

    def meets(self, new: NewExamples) -> bool:
        """Whether new counterexamples may have changed an answer."""
        return bool(self.zones & new.zones) or any(
            self._meets(t, tips) for t, tips in new.tips.items() if t in self.cells)

    def _meets(self, tool: str, tips: F64) -> bool:
        row, column = np.moveaxis(_cells(tips, self.sizes[tool]), -1, 0)
        around = [_key(row + a, column + b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
        return bool(np.isin(np.concatenate(around), self.cells[tool]).any())


class _Questions:
    """Questions since the last ``taken``; several threads may ask at once."""

    def __init__(self) -> None:
        self._asked: list[tuple[ToolBody, F64]] = []
        self._zones: list[str] = []

    def about(self, tool: ToolBody, points: F64) -> None:
        """Note places (n, 3) float64, mm, of the tip of a tool."""
        self._asked.append((tool, points[:, :2]))

    def about_zone(self, zone: str) -> None:
        """Note a zone by its id."""
        self._zones.append(zone)

    def taken(self) -> Asked:
        """All questions since the last call."""
        asked, zones = self._asked, self._zones
        self._asked, self._zones = [], []
        tools = {t.id: t for t, _ in asked}
        sizes = {name: max(t.radius, MIN_BARRED) for name, t in tools.items()}
        cells = {name: np.unique(_key(*_cells(np.vstack([p for t, p in asked if t.id == name]), size).T))
                 for name, size in sizes.items()}
        return Asked(sizes, cells, frozenset(zones))


@dataclass(frozen=True, eq=False)
class WatchedExamples(Counterexamples):
    """Counterexamples that note what they are asked."""

    questions: _Questions = field(default_factory=_Questions)

    @classmethod
    def of(cls, found: Counterexamples) -> WatchedExamples:
        """The same counterexamples, watched."""
        return cls(**{f.name: getattr(found, f.name) for f in fields(Counterexamples)})

    def care(self, tool: ToolBody, points: F64) -> float:
        """As ``Counterexamples.care``; points : (n, 3) float64, mm, tips in the frame of the plan."""
        self.questions.about(tool, _way(tool, points))
        return super().care(tool, points)

    def bars(self, tool: ToolBody, points: F64) -> NDArray[np.bool_]:
        """As ``Counterexamples.bars``, (n,) bool; points : (n, 3) float64, mm, tips in the frame of the plan."""
        self.questions.about(tool, points)
        return super().bars(tool, points)

    def crowds(self, tool: ToolBody, points: F64) -> NDArray[np.bool_]:
        """As ``Counterexamples.crowds``, (n,) bool; points : (n, 3) float64, mm, tips in the frame of the plan."""
        self.questions.about(tool, points)
        return super().crowds(tool, points)

    def aims(self, zone: str, aim: float, count: int) -> F64:
        """As ``Counterexamples.aims``, (count,) float64, mm; aim : mm."""
        self.questions.about_zone(zone)
        return super().aims(zone, aim, count)


def _added(now: F64 | None, old: F64 | None) -> F64:
    """Places that follow on old ones, (n, 3) float64; all of both where the first are others."""
    now, old = (np.zeros((0, 3)) if a is None else a for a in (now, old))
    return now[len(old):] if np.array_equal(now[:len(old)], old) else np.vstack([now, old])


def _way(tool: ToolBody, points: F64) -> F64:
    """Places along a line at which care is asked for."""
    return dense(points, 0.25 * tool.radius) if len(points) > 1 else points


def _cells(points: F64, size: float) -> NDArray[np.int64]:
    """Row and column of the cells of places in plan, (n, 2) int64."""
    return np.floor(points[:, :2] / size).astype(np.int64)


def _key(row: NDArray[np.int64], column: NDArray[np.int64]) -> NDArray[np.int64]:
    """One number for each cell."""
    return row * ROW + column


def _near(places: F64 | None, points: F64, radius: float, plan: bool = False) -> NDArray[np.bool_]:
    out = np.zeros(len(points), np.bool_)
    for place in () if places is None else places:
        off = points - place
        out |= np.linalg.norm(off[:, :2] if plan else off, axis=1) <= radius
    return out


__all__ = ["NONE", "Asked", "Counterexamples", "HighWall", "NewExamples", "WatchedExamples"]
