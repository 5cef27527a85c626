"""The admission of a job of the command line: it prints its estimate, waits for other jobs, or is refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from service.console import Progress, say
from service.estimate.estimate import Estimate
from service.estimate.memory_room import MemoryRoom
from service.settings import MemorySettings, settings_of


@contextmanager
def admitted(progress: Progress) -> Iterator[Callable[[Estimate], None]]:
    """What the chain calls with the estimate of the job; other jobs of the machine count it until the end.

    The settings ``ZONEMILL_MEMORY_MB`` and ``ZONEMILL_MEMORY_WAIT_S`` hold here too.
    """
    settings = settings_of(MemorySettings, {})
    room = MemoryRoom(settings.memory_mb, wait_s=settings.memory_wait_s)

    def admit(estimate: Estimate) -> None:
        say(estimate.sentence)
        room.enter(estimate, progress)

    try:
        yield admit
    finally:
        room.leave()


__all__ = ["admitted"]
