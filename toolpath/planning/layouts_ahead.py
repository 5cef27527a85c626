"""Layouts of zones computed by other threads while the plan works its way through the stock.

The kernels release the interpreter. A layout depends on nothing that the plan changes, so the plan has the same bytes
with any number of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

import numba

from toolpath.planning.zone_layout import ZoneLayout

T = TypeVar("T")


@contextmanager
def computed_ahead(layouts: Sequence[ZoneLayout]) -> Iterator[Callable[[], None]]:
    """Compute layouts in their order while the body runs: the usual strategies first, then passes along borders.

    There is a thread less for it than numba may use, none where that is one: a layout is then computed when it is
    asked for. What is not begun when the body ends is left. A failure is met by whoever asks for the layout.

    Yields a function for the body to call now and then: once all layouts are computed, it gives the body the threads
    of numba back. Until then the body has one, since two threads must not enter numba's threading layer at once.
    """
    threads = numba.get_num_threads()
    if threads == 1 or not layouts:
        yield lambda: None
        return
    pool = ThreadPoolExecutor(threads - 1, "layout", initializer=numba.set_num_threads, initargs=(1,))
    try:
        begun = [pool.submit(layout.compute_usual) for layout in layouts]
        begun += [pool.submit(layout.compute_along_borders) for layout in layouts]
        numba.set_num_threads(1)

        def settle() -> None:
            if all(one.done() for one in begun):
                numba.set_num_threads(threads)

        yield settle
    finally:
        numba.set_num_threads(threads)
        pool.shutdown(cancel_futures=True)


def side_by_side(makes: Sequence[Callable[[], T]]) -> list[T]:
    """The results of calls that share nothing they change, each in a thread of its own where numba may use several."""
    if len(makes) < 2 or numba.config.NUMBA_NUM_THREADS == 1:
        return [make() for make in makes]
    with ThreadPoolExecutor(len(makes), "candidate", initializer=numba.set_num_threads, initargs=(1,)) as pool:
        return [made.result() for made in [pool.submit(make) for make in makes]]
