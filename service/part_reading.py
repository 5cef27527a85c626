"""The part of a job, read by another process while this one imports what plans it.

So this module imports little.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

from geometry.part import Part
from geometry.step_import.reader import read_part
from schemas.setup import Setup
from service.from_wire import mesh_chord, placement_of


def load(path: Path, setup: Setup, stop: Event | None = None) -> Part:
    """The part of a STEP file in the setup frame; once ``stop`` is set, the reading ends with an error."""
    return read_part(path, placement=placement_of(setup), solid=setup.part.solid, fuse=setup.part.fuse,
                     chord=mesh_chord(setup.quality), stop=stop)


class PartReading:
    """The reading of a part, begun at once. A context: what still runs at its end is stopped.

    path, setup : as ``load`` takes them
    """

    def __init__(self, path: Path, setup: Setup) -> None:
        self._stop = Event()
        self._pool = ThreadPoolExecutor(1, "read")
        self._part = self._pool.submit(load, path, setup, self._stop)

    def __enter__(self) -> PartReading:
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._pool.shutdown()

    def part(self) -> Part:
        """The part, once it is read; raises what ``load`` raises."""
        return self._part.result()


__all__ = ["PartReading", "load"]
