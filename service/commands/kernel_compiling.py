"""Compile the kernels in as many processes as there are cores, before the first job needs them.

A job compiles in one process, kernel by kernel, as it comes to them. ``kernel_signatures.json`` lists what the small
part of ``zonemill warm`` makes it compile: each kernel with the types of its arguments, the seconds it took, and the
kernels it calls. Here every kernel waits for those it calls, takes their machine code from the cache and adds its own.

The list saves time and no more. A kernel that is missing from it is compiled by the job that calls it; an entry that no
longer fits the sources is passed over. ``make kernels`` writes the list.
"""

from __future__ import annotations

import gc
import heapq
import json
import multiprocessing
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from time import monotonic
from typing import Any

from numba import types
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError

from geometry.child_process import collect_rarely

LIST = Path(__file__).with_name("kernel_signatures.json")
MAX_PROCESSES = 8
"""More would wait for the longest chain of kernels that call one another."""

SECONDS_OF_SILENCE = 2.0

SCALARS = {str(t): t for t in (types.boolean, types.int8, types.uint8, types.int32, types.uint32, types.int64,
                               types.uint64, types.float32, types.float64, types.none)}

STALE = (ImportError, AttributeError, TypeError, ValueError, KeyError, NumbaError)
"""What an entry raises that does not fit the sources."""

Report = Callable[[int, int, float], None]
"""Takes how many kernels are compiled, of how many, and the seconds left."""


@dataclass(frozen=True)
class Listed:
    """A kernel for one choice of argument types.

    kernel    : module and name of the kernel in it
    arguments : texts of the types, see ``text_of``
    seconds   : CPU time it took to compile, without what it calls
    calls     : places in the list of all that ends up in it
    """

    kernel: str
    arguments: tuple[Any, ...]
    seconds: float
    calls: tuple[int, ...]


def read_list(path: Path = LIST) -> list[Listed]:
    """The list as it is in the package; callees stand before callers."""
    return [Listed(e["kernel"], tuple(e["arguments"]), e["seconds"], tuple(e["calls"]))
            for e in json.loads(path.read_text("utf-8"))]


def text_of(kind: Any) -> Any:
    """A numba type in JSON: "float64", "float64 2 C" for an array, a list for a tuple, {class: fields} for a named one.

    Raises
    ------
    ValueError
        A type of another kind.
    """
    if isinstance(kind, types.Array) and kind.aligned and str(kind.dtype) in SCALARS:
        return f"{kind.dtype} {kind.ndim} {kind.layout}" + ("" if kind.mutable else " readonly")
    if isinstance(kind, types.BaseNamedTuple):
        name = f"{kind.instance_class.__module__}.{kind.instance_class.__qualname__}"
        return {name: [text_of(t) for t in kind]}
    if isinstance(kind, types.BaseTuple):
        return [text_of(t) for t in kind]
    if str(kind) in SCALARS:
        return str(kind)
    raise ValueError(f"no text for the type {kind}")


def type_of(text: Any) -> Any:
    """The numba type of a text of ``text_of``.

    Raises
    ------
    ImportError, AttributeError, KeyError, ValueError
        There is no such type, or no such class any more.
    """
    if isinstance(text, list):
        return types.BaseTuple.from_types([type_of(t) for t in text])
    if isinstance(text, dict):
        (name, fields), = text.items()
        module, _, own = name.rpartition(".")
        named = getattr(import_module(module), own)
        if len(fields) != len(named._fields):
            raise ValueError(f"{name} has other fields now")
        return types.BaseTuple.from_types([type_of(t) for t in fields], named)
    name, *rest = text.split()
    if not rest:
        return SCALARS[name]
    dims, layout, *readonly = rest
    return types.Array(SCALARS[name], int(dims), layout, readonly=bool(readonly))


def kernel_of(listed: Listed) -> tuple[Any, tuple[Any, ...]]:
    """The compiled function of an entry, and the types of its arguments.

    Raises
    ------
    ImportError, AttributeError, KeyError, TypeError, ValueError
        The entry does not fit the sources.
    """
    module, _, name = listed.kernel.rpartition(".")
    kernel = getattr(import_module(module), name)
    if not isinstance(kernel, Dispatcher):
        raise TypeError(f"{listed.kernel} is no kernel")
    return kernel, tuple(type_of(t) for t in listed.arguments)


def is_stored(kernel: Any, arguments: tuple[Any, ...]) -> bool:
    """Whether the cache has a kernel for these types of arguments.

    Raises
    ------
    AttributeError, TypeError, ValueError, KeyError
        They do not fit the sources.
    """
    kernel.targetctx.refresh()
    return kernel._cache._index_key(arguments, kernel.targetctx.codegen()) in kernel._cache._cache_file._load_index()


def to_compile(kernels: Sequence[Listed]) -> list[int]:
    """Places of those that fit the sources and are not in the cache."""
    found = []
    for place, listed in enumerate(kernels):
        try:
            if not is_stored(*kernel_of(listed)):
                found.append(place)
        except STALE:
            continue
    return found


def compile_listed(report: Report, kernels: Sequence[Listed] | None = None, processes: int | None = None) -> None:
    """Compile what is listed and not in the cache, callees before callers, the longest way to the end first.

    report    : called when a kernel is done, and every two seconds
    processes : as many as this process may use cores, at most ``MAX_PROCESSES``, for None
    """
    kernels = read_list() if kernels is None else kernels
    left = set(to_compile(kernels))
    if not left:
        return
    processes = min(processes or _cores(), MAX_PROCESSES, len(left))
    order = _Order(kernels, left)
    started, of = monotonic(), len(left)
    with ProcessPoolExecutor(processes, multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn"),
                             initializer=_prepare) as pool:
        running: dict[Future[None], int] = {}
        try:
            while left:
                while len(running) < processes and (place := order.pop()) is not None:
                    running[pool.submit(_compile, kernels[place])] = place
                ended, _ = wait(running, SECONDS_OF_SILENCE, FIRST_COMPLETED)
                for future in ended:
                    future.result()
                    place = running.pop(future)
                    left.remove(place)
                    order.done(place)
                report(of - len(left), of, order.seconds_left(monotonic() - started, processes))
        except BrokenProcessPool:  # the job compiles the rest
            return
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


class _Order:
    """Which of the kernels to compile next."""

    def __init__(self, kernels: Sequence[Listed], left: set[int]) -> None:
        self._seconds = {p: kernels[p].seconds for p in left}
        self._total = sum(self._seconds.values())
        self._missing = {p: {c for c in kernels[p].calls if c in left and c < p} for p in left}
        self._way = dict(self._seconds)  # seconds from the start of a kernel to the end of the last that needs it
        for place in sorted(left, reverse=True):
            for callee in self._missing[place]:
                self._way[callee] = max(self._way[callee], self._seconds[callee] + self._way[place])
        self._ready = [(-self._way[p], p) for p in left if not self._missing[p]]
        heapq.heapify(self._ready)

    def pop(self) -> int | None:
        """The next one; None where all that are left wait for one that is under way."""
        return heapq.heappop(self._ready)[1] if self._ready else None

    def done(self, place: int) -> None:
        """Note that one is compiled."""
        del self._seconds[place], self._missing[place]
        for other, missing in self._missing.items():
            if place in missing:
                missing.remove(place)
                if not missing:
                    heapq.heappush(self._ready, (-self._way[other], other))

    def seconds_left(self, elapsed: float, processes: int) -> float:
        """Estimate by the pace so far; the list's own seconds count as much as the first tenth."""
        rest = sum(self._seconds.values())
        ended = self._total - rest
        first = 0.1 * self._total
        return rest * (elapsed + first / processes) / (ended + first)


def _prepare() -> None:
    """In a new process: numba makes garbage by the million, and to look for it takes a tenth of the time."""
    gc.freeze()
    collect_rarely()


def _compile(listed: Listed) -> None:
    try:
        kernel, arguments = kernel_of(listed)
        kernel.compile(arguments)
    except STALE:  # the job says what is wrong, if anything is
        return


def _cores() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not everywhere
        return os.cpu_count() or 1
