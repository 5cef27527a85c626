"""Write the list of kernels that ``zonemill warm`` compiles on all cores: plan the small part with an empty cache.

    make kernels, or python .ci/kernel_signatures.py [FILE]

It takes minutes, for all is compiled in one process. ``test_kernel_compiling.py`` tells when it is due.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))


class Compiled:
    """Listens to numba: every dispatcher and argument types compiled, callees first, with seconds of its own."""

    def __init__(self) -> None:
        self.rows: list[tuple[Any, tuple[Any, ...], float]] = []
        self._open: list[list[float]] = []

    def on_start(self, _event: Any) -> None:
        self._open.append([time.process_time(), 0.0])

    def on_end(self, event: Any) -> None:
        begun, inner = self._open.pop()
        took = time.process_time() - begun
        kernel = event.data["dispatcher"]
        own = not kernel.py_func.__module__.startswith("numba.")  # what is numba's own counts for its caller
        if self._open:
            self._open[-1][1] += took if own else inner
        self.rows.append((kernel, tuple(event.data["args"]), took - inner if own else 0.0))


def entries(rows: list[tuple[Any, tuple[Any, ...], float]]) -> list[dict[str, Any]]:
    """What the list holds of rows of ``Compiled``: kernels that a module has by name, with the places they call."""
    from service.commands.kernel_compiling import text_of

    libraries = {id(d.overloads[a].library): k for k, (d, a, _) in enumerate(rows) if a in d.overloads}
    places: dict[int, int] = {}
    listed: list[dict[str, Any]] = []
    for k, (kernel, arguments, seconds) in enumerate(rows):
        module = kernel.py_func.__module__
        names = [n for n, value in vars(import_module(module)).items() if value is kernel]
        try:
            texts = [text_of(t) for t in arguments]
        except ValueError:
            continue
        if not names or module.split(".")[0] == "numba" or arguments not in kernel.overloads:
            continue
        linked = {libraries[i] for i in _linked(kernel.overloads[arguments].library) if i in libraries}
        calls = sorted(places[c] for c in linked if c in places and c != k)
        places[k] = len(listed)
        listed.append({"kernel": f"{module}.{names[0]}", "arguments": texts, "seconds": round(seconds, 2),
                       "calls": calls})
    return listed


def _linked(library: Any) -> set[int]:
    """Identities of all libraries whose code ends up in this one."""
    seen: set[int] = set()
    ahead = list(library._linking_libraries)
    while ahead:
        at = ahead.pop()
        if id(at) not in seen:
            seen.add(id(at))
            ahead += getattr(at, "_linking_libraries", ())
    return seen


def main() -> None:
    with tempfile.TemporaryDirectory() as cache:
        os.environ["NUMBA_CACHE_DIR"] = cache
        from numba.core import event  # numba reads the variable here

        # the child that reads the part gets a cache of its own: what it compiled this process would load, and not list
        os.environ["NUMBA_CACHE_DIR"] = str(Path(cache, "child"))

        from examples.demo import write_small
        from service.commands.kernel_compiling import LIST
        from service.from_wire import read_setup
        from service.pipeline import plan

        class Listener(Compiled, event.Listener):  # type: ignore[misc]
            pass

        compiled = Listener()
        event.register("numba:compile", compiled)
        step, setup = write_small(cache)
        report = plan(step, read_setup(setup), Path(cache, "out"),
                      lambda stage, share: print(f"{100 * share:3.0f} %  {stage}", file=sys.stderr))
        assert report["state"] == "proved", report["findings"]
        listed = entries(compiled.rows)
        path = Path(sys.argv[1]) if len(sys.argv) > 1 else LIST
        path.write_text("[\n" + ",\n".join(json.dumps(e) for e in listed) + "\n]\n", "utf-8")
        print(f"{len(listed)} of {len(compiled.rows)} kernels, {sum(e['seconds'] for e in listed):.0f} s of "
              f"{sum(r[2] for r in compiled.rows):.0f} s of CPU time: {path}")


if __name__ == "__main__":
    main()
