"""Distance between neighbouring passes, bracketed by the material they really leave.

The residual between two passes grows with about the square of their distance. So a few trials bracket the widest step
that keeps the tolerance, each a tip path on the true limit (``toolpath.passes.pass_family`` measures). The greedy order
takes the fewest passes of a family, since two neighbours answer only for what lies between them.

Where one narrow spot would set the step for a whole pass the step may be wider [Jain2016, section 5.2]. The spot then
gets a piece of a pass of its own, if that makes the way shorter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from geometry.mesh import F64
from toolpath.cutter.swept_envelope import Envelope
from toolpath.passes.pass_family import FLOOR, I64, Family, Pass, strip_width

TRIALS = 7
FULL = 0.97  # share of the allowed residual at which a step is wide enough
AIM = 0.985
GROWTH = 1.6  # most a trial is wider than the one before
DEEPEST = 5  # times a narrow spot is halved
SHARES = (0.9, 0.75, 0.5)  # of the strips that a wider step may satisfy


@dataclass(frozen=True, eq=False)
class _Trial:
    """A pass that was tried, with the residual between it and the one before in each strip."""

    step: float
    made: Pass
    envelope: Envelope
    left: F64
    strips: I64

    @property
    def worst(self) -> float:
        return float(self.left.max(initial=0.0))

    def without(self, strips: I64) -> _Trial:
        """The same without those strips."""
        return replace(self, left=np.where(np.isin(self.strips, strips), 0.0, self.left))


def lay_out(family: Family, subdivide: bool = True) -> list[Pass]:
    """The passes of a family, in order across it; pieces for narrow spots follow the two passes they lie between
    [Jain2016].

    subdivide : a narrow spot may get pieces of passes where that makes the way shorter

    Returns
    -------
    list of Pass
        The residual between them keeps the tolerance wherever ``FLOOR`` allows it.
    """
    return list(one_by_one(family, subdivide))


def one_by_one(family: Family, subdivide: bool = True) -> Iterator[Pass]:
    """``lay_out`` pass by pass, each computed when it is asked for."""
    if not len(family.t):
        return
    first, last = float(family.t[0]), float(family.t[-1])
    before: _Trial | None = None
    guess = family.guess
    while True:
        at = first if before is None else before.made.at
        if before is not None:
            rest = family.between(at, math.inf)
            if rest.start == rest.stop or (last - at < 2.0 * guess and _kept(family, rest, before.envelope)):
                return
        base = before.envelope if before is not None else None
        least = 0.0 if before is None else min(FLOOR, last - at)
        nearest = float(family.t[min(family.between(at, math.inf).start, len(family.t) - 1)])
        start = max(guess if before is not None else 0.5 * guess, nearest - at)

        def attempt(step: float, at: float = at, base: Envelope | None = base, guess: float = guess) -> _Trial:
            return _trial(family, at, step, base, guess)

        best = widest(attempt, family.promise.scallop, min(start, last - at), least, last - at)
        if best.worst > family.promise.scallop:  # other passes take the strips that even the closest pass leaves
            lost = best.strips[best.left > family.promise.scallop]

            def without(step: float, attempt: Callable[[float], _Trial] = attempt, lost: I64 = lost) -> _Trial:
                return attempt(step).without(lost)

            best = widest(without, family.promise.scallop, min(start, last - at), least, last - at)
        extra: list[Pass] = []
        if subdivide and base is not None:
            best, extra = _wider(family, attempt, best, at, base, last - at)
        yield best.made
        yield from extra
        if before is not None and best.step > FLOOR:
            guess = best.step
        before = best


def _trial(family: Family, at: float, step: float, before: Envelope | None, window: float) -> _Trial:
    made = family.pass_at(at + step, max(step, window, 2.0 * family.spacing))
    envelope = family.envelope(made)
    here = family.between(-math.inf if before is None else at, at + step)
    left, strips = family.left(here, *([envelope] if before is None else [before, envelope]))
    return _Trial(step, made, envelope, left, strips)


def _kept(family: Family, here: slice, envelope: Envelope) -> bool:
    return float(family.left(here, envelope)[0].max(initial=0.0)) <= family.promise.scallop


def widest(attempt: Callable[[float], _Trial], max_left: float, start: float, min_step: float,
           max_step: float) -> _Trial:
    """The widest step that keeps a tolerance, by bracketing [Jain2016].

    attempt            : the pass at a step, with its residual
    max_left           : mm, largest residual
    start              : mm, the first step tried
    min_step, max_step : mm, limits of the step

    Returns
    -------
    _Trial
        At ``min_step`` where even that exceeds the tolerance.
    """
    good: _Trial | None = None
    bad = math.inf
    x = min(max(start, min_step), max_step)
    for _ in range(TRIALS):
        trial = attempt(x)
        ratio = math.sqrt(AIM * max_left / max(trial.worst, 1e-12))
        if trial.worst <= max_left:
            if good is None or trial.step > good.step:
                good = trial
            if trial.worst >= FULL * max_left or x >= max_step:
                break
            following = min(x * min(ratio, GROWTH) if x > 0.0 else FLOOR, max_step)
            x = following if following < bad else 0.5 * (x + bad)
        else:
            bad = min(bad, x)
            if x <= min_step:
                break
            low = min_step if good is None else good.step
            following = x * max(ratio, 0.25)
            x = following if low < following < bad else 0.5 * (low + bad)
        if good is not None and bad - good.step < 0.015 * bad:
            break
    return good if good is not None else attempt(min_step)


def _wider(family: Family, attempt: Callable[[float], _Trial], best: _Trial, at: float, before: Envelope,
           max_step: float) -> tuple[_Trial, list[Pass]]:
    """A wider step with pieces at its narrow spots, where that shortens the way for each mm; else ``best``."""
    promise = family.promise
    chosen: tuple[_Trial, list[Pass]] = best, []
    cost = (best.made.length + promise.link) / max(best.step, 1e-9)
    if len(best.left) < 4 or best.worst <= 0.0:
        return chosen
    for share in SHARES:
        usual = float(np.quantile(best.left, share, method="lower"))
        step = min(best.step * min(math.sqrt(AIM * promise.scallop / max(usual, 1e-12)), 2.0), max_step)
        if not (best.worst <= promise.scallop and step >= 1.03 * best.step):
            continue
        trial = attempt(step)
        length = trial.made.length + promise.link
        failing = int(np.count_nonzero(trial.left > promise.scallop))
        if (length + failing * strip_width(family.dragged, family.target) + promise.link) / step >= cost:
            continue
        extra, kept = _narrow(family, at, before, at + step, trial.envelope, trial.left, trial.strips, DEEPEST)
        length += sum(p.length + promise.link * len(p.lines) for p in extra)
        if kept and length / step < cost:
            chosen, cost = (trial, extra), length / step
    return chosen


def _narrow(family: Family, a: float, over_a: Envelope, b: float, over_b: Envelope, left: F64, strips: I64,
            deeper: int) -> tuple[list[Pass], bool]:
    """Pieces half way between two passes in the strips with too much left, and between those again.

    Also returns whether all strips keep the tolerance then.
    """
    failing = strips[left > family.promise.scallop]
    if not len(failing):
        return [], True
    if not deeper or b - a < 2.0 * FLOOR:
        return [], False
    here = family.between(a, b)
    only = np.zeros(len(family.t), np.bool_)
    only[here] = np.isin(family.strips[here], failing)
    middle = 0.5 * (a + b)
    made = family.pass_at(middle, b - a, only)
    envelope = family.envelope(made)
    out, kept = [made], True
    for lo, over_lo, hi, over_hi in ((a, over_a, middle, envelope), (middle, envelope, b, over_b)):
        half = family.between(lo, hi)
        mine = np.arange(half.start, half.stop)[only[half]]
        more, good = _narrow(family, lo, over_lo, hi, over_hi, *family.left(mine, over_lo, over_hi), deeper - 1)
        out, kept = [*out, *more], kept and good
    return out, kept
