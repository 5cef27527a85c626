"""``zonemill warm``: compile the kernels on all cores, and plan and prove a small part with them."""

from __future__ import annotations

import contextlib
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from geometry.errors import InternalError
from service.console import say

if TYPE_CHECKING:
    from verify.model import Proof

Progress = Callable[[str, float], None]

SAY_EVERY_S = 4.0
SHOW_EVERY_S = 0.25


class Countdown:
    """Tells on stderr how far a command is: on a terminal in one line, rewritten, else in a line every four seconds."""

    def __init__(self) -> None:
        self._begun, self._said, self._last = time.monotonic(), -SAY_EVERY_S, ("", "")
        self._live = sys.stderr.isatty()

    def compiling(self, done: int, of: int, left_s: float) -> None:
        """Tell how many kernels are compiled, of how many."""
        self._say(f"kernels compiled: {done} of {of}", f", about {left_s:.0f} s left" if done < of else "", done == of)

    def planning(self, stage: str, share: float) -> None:
        """Tell which stage the small part is in, and the share of its job that is done."""
        self._say(f"small part: {stage}", f", {100.0 * share:.0f} %", False)

    def say(self, text: str) -> None:
        """Tell what begins."""
        self._say(text, "", True)

    @contextlib.contextmanager
    def ticking(self) -> Iterator[None]:
        """Say the last again, with its new time, where nothing else is said."""
        ended = threading.Event()

        def tick() -> None:
            while not ended.wait(1.0):
                self._say(*self._last, False)

        ticker = threading.Thread(target=tick, daemon=True)
        ticker.start()
        try:
            yield
        finally:
            ended.set()
            ticker.join()

    def close(self) -> None:
        """End the line."""
        if self._live:
            say("")

    def _say(self, text: str, more: str, now: bool) -> None:
        at, self._last = time.monotonic(), (text, more)
        if at - self._said < (SHOW_EVERY_S if self._live else SAY_EVERY_S) and not now:
            return
        self._said = at
        line = f"{at - self._begun:5.0f} s  {text}{more}"
        if self._live:
            print("\r\x1b[K" + line + ("\n" if now else ""), end="", file=sys.stderr, flush=True)
        else:
            say(line)


def run_warm() -> None:
    """Compile every kernel that a usual job needs, and see that a small part is planned and proved with them.

    The small part is not delivered: its pictures, sheet and STEP-NC need no more kernels and take a third of the time.
    What other versions of the kernels left compiled is removed a week after its last use.

    Raises
    ------
    InternalError
        The small part was not proved: this machine must not plan others.
    """
    shown = Countdown()
    shown.say("compiling kernels on all cores, about a minute the first time")
    from geometry.kernel_cache.cache import remove_stale
    from service.commands.kernel_compiling import compile_listed

    remove_stale()
    compile_listed(shown.compiling)
    shown.say("planning and proving a small part, a few seconds")
    with shown.ticking():
        proof = prove_small(shown.planning)
    shown.close()
    if proof.findings:
        raise InternalError("the small part that is known to be proved was not", code="not_as_installed",
                            subjects=tuple(f.message for f in proof.findings[:5]),
                            measured="unproved", limit="proved",
                            remedy="install again; please report it if it stays")


def prove_small(progress: Progress) -> Proof:
    """The proof of the small part, planned in a folder that is removed afterwards.

    progress : takes the stage and the share of the job that is done
    """
    from examples.demo import write_small
    from service.from_wire import read_setup
    from service.pipeline import prove_plan

    with tempfile.TemporaryDirectory(prefix="zonemill-warm-") as folder:
        step, setup = write_small(folder)
        return prove_plan(step, read_setup(setup), progress)
