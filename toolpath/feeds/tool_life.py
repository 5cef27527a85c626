"""Time that tools are in cut, and steps split where the life of a cutter ends.

A feed move counts as in cut unless it is a link as fast as those in air. So the count is never less than the time that
the proof finds in stock. Times are those of ``geometry.move_timing``, with acceleration. A cutter is changed between
two passes, where the tool is up at the clearance plane along Z, or between two steps.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from toolpath.workingsteps import Trajectory, TrajectoryKind, Workingstep, trajectory_seconds

AT_PLANE = 1e-9  # mm
AS_FAST = 1.0 + 1e-9


def minutes_in_cut(step: Workingstep) -> NDArray[np.float64]:
    """Upper bound of the time that each trajectory of a step is in cut, (k,) float64, min."""
    links = [t.feed for t in step.trajectories if t.motion not in (TrajectoryKind.RAPID, TrajectoryKind.CUT)]
    air = max(links, default=0.0) / AS_FAST
    distinct = air > step.feed  # else links in air and in stock have the same feed
    cuts = np.array([t.motion is TrajectoryKind.CUT
                     or t.motion is not TrajectoryKind.RAPID and not (distinct and t.feed >= air)
                     for t in step.trajectories])
    return np.asarray(np.where(cuts, trajectory_seconds(step.trajectories, step.rates), 0.0) / 60.0)


def worn(steps: Iterable[Workingstep]) -> dict[str, float]:
    """Minutes in cut of the cutter in each tool after some steps, by tool id."""
    out: dict[str, float] = {}
    for s in steps:
        out[s.tool.id] = (0.0 if s.fresh else out.get(s.tool.id, 0.0)) + float(minutes_in_cut(s).sum())
    return out


def with_fresh_cutters(steps: Sequence[Workingstep], lives: Mapping[str, float], clearance: float,
                       used: Mapping[str, float] | None = None) -> list[Workingstep]:
    """Steps that change to a fresh cutter before the life of the last one ends.

    lives     : min in cut, by tool id; other tools last forever
    clearance : mm, height at which rapids across are free
    used      : min, time in cut that the cutters have already

    Returns the steps. A step that needs a change within it comes in parts named S07, S07b, S07c and so on. A run that
    is longer than a whole life gets a cutter of its own.
    """
    spent, out = dict(used or {}), []
    for step in steps:
        life = lives.get(step.tool.id)
        if life is None:
            out.append(step)
            continue
        minutes, parts = minutes_in_cut(step), [0]
        fresh, so_far = False, spent.get(step.tool.id, 0.0)
        for first, end in _runs(step, clearance):
            run = float(minutes[first:end].sum())
            if so_far + run > life and so_far > 0.0:
                so_far = 0.0
                if first == 0:
                    fresh = True
                else:
                    parts.append(first)
            so_far += run
        spent[step.tool.id] = so_far
        out += _parted(step, parts, fresh, clearance)
    return out


def _runs(step: Workingstep, clearance: float) -> list[tuple[int, int]]:
    """Trajectories from one place where the tool is up to the next, as first and end; only those with a cut."""
    at = [0, *(k for k in range(1, len(step.trajectories)) if _is_up(step.trajectories, k, clearance)),
          len(step.trajectories)]
    cut = [any(t.motion is TrajectoryKind.CUT for t in step.trajectories[a:b])
           for a, b in zip(at[:-1], at[1:], strict=True)]
    ends = [b for b, c in zip(at[1:], cut, strict=True) if c]
    starts = [0, *ends[:-1]]
    return list(zip(starts, [*starts[1:], len(step.trajectories)], strict=True))


def _is_up(trajectories: Sequence[Trajectory], k: int, clearance: float) -> bool:
    """Whether the tool stands upright at the clearance plane before trajectory k."""
    before, after = trajectories[k - 1], trajectories[k]
    return before.axes is None and after.axes is None and float(after.points[0, 2]) >= clearance - AT_PLANE


def _parted(step: Workingstep, parts: Sequence[int], fresh: bool, clearance: float) -> list[Workingstep]:
    """The parts of a step that begin at some of its trajectories; all but the first with a fresh cutter."""
    out = []
    for n, (first, end) in enumerate(zip(parts, [*parts[1:], len(step.trajectories)], strict=True)):
        mine = step.trajectories[first:end]
        if n:
            while len(mine) > 1 and _is_across(mine[0], clearance):  # from where the cutter before has ended
                mine = mine[1:]
        name = step.id + _letters(n)
        new = fresh or n > 0
        words = name + step.name.removeprefix(step.id) if step.name.startswith(step.id) else step.name
        out.append(replace(step, id=name, name=f"{words} fresh cutter" if new else words, trajectories=mine, fresh=new))
    return out


def _is_across(trajectory: Trajectory, clearance: float) -> bool:
    """Whether a trajectory is a rapid at the clearance plane."""
    return trajectory.motion is TrajectoryKind.RAPID and bool((trajectory.points[:, 2] >= clearance - AT_PLANE).all())


def _letters(n: int) -> str:
    """'' for 0, then b to z, and bb, bc and so on."""
    out = ""
    while n > 0:
        n, k = divmod(n - 1, 25)
        out = chr(ord("b") + k) + out
    return out


__all__ = ["minutes_in_cut", "with_fresh_cutters", "worn"]
