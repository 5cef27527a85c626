"""The part of a job, read by another process while this one imports what plans it.

So this module imports little.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

from geometry.errors import CamError
from geometry.part import Part
from geometry.step_import.reader import read_part, read_part_and_faces
from schemas.setup import Setup
from service.from_wire import mesh_chord, placement_of

if TYPE_CHECKING:
    from geometry.step_import.face_surfaces import FaceSurface


def load(path: Path, setup: Setup, stop: Event | None = None) -> Part:
    """The part of a STEP file in the setup frame; once ``stop`` is set, the reading ends with an error."""
    return read_part(path, placement=placement_of(setup), solid=setup.part.solid, fuse=setup.part.fuse,
                     chord=mesh_chord(setup.quality), stop=stop)


class PartReading:
    """The reading of a part, begun at once. A context: what still runs at its end is stopped.

    path, setup : as ``load`` takes them
    planned     : passes will be planned on the part, which may need its exact faces: the same process reads these
                  behind the part, where it has the file and the CAD kernel loaded
    """

    def __init__(self, path: Path, setup: Setup, *, planned: bool = False) -> None:
        self._path, self._setup, self._stop = path, setup, Event()
        self._pool = ThreadPoolExecutor(1, "read")
        self._faces: Future[bytes] | None = None
        self._part = Future[Part]()
        if planned and setup.operations.finishing:
            self._faces = self._pool.submit(self._read_both)
        else:
            self._part = self._pool.submit(load, path, setup, self._stop)

    def _read_both(self) -> bytes:
        setup = self._setup
        try:
            return read_part_and_faces(self._path, self._part.set_result, flat=setup.machine.kind != "3-axis",
                                       placement=placement_of(setup), solid=setup.part.solid, fuse=setup.part.fuse,
                                       chord=mesh_chord(setup.quality), stop=self._stop)
        except BaseException as problem:
            if not self._part.done():
                self._part.set_exception(problem)
            raise

    def __enter__(self) -> PartReading:
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._pool.shutdown()

    def part(self) -> Part:
        """The part, once it is read; raises what ``load`` raises."""
        return self._part.result()

    def faces(self) -> dict[int, FaceSurface] | None:
        """The exact faces by number, planes only where tools may tilt; None where they were not read, or could not be.

        Whoever needs them then reads them alone, and meets the error.
        """
        if self._faces is None:
            return None
        from geometry.step_import.face_surfaces import patches_from_bytes

        try:
            return patches_from_bytes(self._faces.result())
        except CamError:
            return None


__all__ = ["PartReading", "load"]
