"""The candidates for the finish of a zone: each strategy is cut on copies, and one sort key chooses among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolpath.workingsteps import Workingstep

if TYPE_CHECKING:
    from toolpath.planning.zone_finishing import Finish

UPRIGHT = 10  # parts in which the upright share of the way of a zone with a requested tilt is compared


@dataclass(frozen=True)
class Candidate:
    """A strategy of a zone as it was cut.

    finish     : the copy of the zone's finish that cut it
    steps      : its workingsteps; none where no pass can be cut
    seconds    : s, machining time
    left       : count of samples above the scallop
    upright_mm : mm that the tool cuts upright although a tilt was requested; 0 where none was
    upright    : the same in tenths of the longest, ``UPRIGHT`` + 1 for an upright strategy
    """

    finish: Finish
    steps: list[Workingstep]
    seconds: float
    left: int
    upright_mm: float
    upright: int

    @property
    def key(self) -> tuple[bool, int, int, float]:
        """The least is chosen: something is cut, fewest samples left, least upright, fastest."""
        return not self.steps, self.left, self.upright, self.seconds

    @property
    def strategy(self) -> str:
        """Name of the strategy it begins with."""
        return self.finish.begun_with or self.finish.strategy.name

    def rejected_for(self, best: Candidate) -> dict[str, object]:
        """Why ``best`` was chosen instead, as the report has it."""
        why: tuple[str, float, float]
        if not self.steps:
            why = "no pass can be cut", 0, 0
        elif self.left > best.left:
            why = "more samples are left above the scallop", self.left, best.left
        elif self.upright > UPRIGHT >= best.upright:
            why = "tool axis stayed upright although a tilt was requested, s", self.seconds, best.seconds
        elif self.upright > best.upright:
            why = "more of the way is upright although a tilt was requested, mm", self.upright_mm, best.upright_mm
        else:
            why = "takes longer at equal scallop, s", self.seconds, best.seconds
        reason, value, limit = why
        return {"strategy": self.strategy, "reason": reason, "value": _shown(value), "limit": _shown(limit)}


def _shown(value: float) -> float:
    return value if isinstance(value, int) else round(value, 1)


def compared(finishes: Sequence[Finish], steps: Sequence[list[Workingstep]], seconds: Sequence[float],
             left: Sequence[int], upright_mm: Sequence[float] | None) -> list[Candidate]:
    """The candidates of a zone, in the order they were tried.

    upright_mm : mm that each cuts upright; None where no tilt was requested
    """
    if upright_mm is None:
        return [Candidate(f, s, t, k, 0.0, 0) for f, s, t, k in zip(finishes, steps, seconds, left, strict=True)]
    longest = max(*upright_mm, 1e-9)
    tenths = [round(UPRIGHT * way / longest) if f.begun_with else UPRIGHT + 1
              for f, way in zip(finishes, upright_mm, strict=True)]
    return [Candidate(*one) for one in zip(finishes, steps, seconds, left, upright_mm, tenths, strict=True)]
