"""Values computed by another thread while this one does other work, as far as they are not asked for before."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, TypeVar

import numba

T = TypeVar("T")


class ComputedAhead(Generic[T]):
    """Values by name, computed in their order by one thread from ``begin`` on. A context; at its end the rest is left.

    Where numba may use one thread, and before ``begin``, a value is computed when it is asked for. So is one that the
    other thread has not begun. The thread has one thread of numba, so that it keeps out of numba's threading layer.

    calls : by name, what computes each value; it changes nothing that others read
    """

    def __init__(self, calls: Mapping[str, Callable[[], T]]) -> None:
        self._calls = calls
        self._begun: dict[str, Future[T]] = {}
        self._pool: ThreadPoolExecutor | None = None

    def __enter__(self) -> ComputedAhead[T]:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def begin(self) -> None:
        """Let the other thread begin; a second call changes nothing."""
        if self._pool is None and numba.get_num_threads() > 1:
            self._pool = ThreadPoolExecutor(1, "ahead", initializer=numba.set_num_threads, initargs=(1,))
            self._begun = {name: self._pool.submit(call) for name, call in self._calls.items()}

    def value(self, name: str) -> T:
        """The value of a name; what its call raises."""
        begun = self._begun.get(name)
        return self._calls[name]() if begun is None or begun.cancel() else begun.result()


__all__ = ["ComputedAhead"]
