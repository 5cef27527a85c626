"""Progress of a proof: the shares of its stages as one number that never falls."""

from __future__ import annotations

from collections.abc import Callable

Report = Callable[[float], None]


class StageProgress:
    """Stages of a piece of work, each a span of 0 to 1.

    report : called with the share done, 0 to 1; an exception from it ends the work. None: nothing is reported
    """

    def __init__(self, report: Report | None) -> None:
        self._report, self._done = report, 0.0

    def tell(self, share: float) -> None:
        """Report that ``share``, 0 to 1, of the whole is done; the reported share never falls."""
        self._done = min(max(self._done, share), 1.0)
        if self._report is not None:
            self._report(self._done)

    def span(self, low: float, high: float) -> Report:
        """The report function of a stage that runs from ``low`` to ``high`` of the whole; it takes shares 0 to 1."""
        return lambda share: self.tell(low + (high - low) * share)


def silent(_share: float) -> None:
    """Report nothing."""
