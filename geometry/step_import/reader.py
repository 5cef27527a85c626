"""Reads a STEP file into a ``Part``.

    part = read_part("wheel.step", placement=Placement(z_axis=(0, 1, 0), x_axis=(1, 0, 0)))

The CAD kernel runs in a child process (``geometry.step_import.reader_process``). So a file that crashes the kernel,
blocks it or takes too much memory ends as a typed error here. Importing this module does not import the kernel.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Callable
from typing import Any

from geometry.child_process import run_limited
from geometry.errors import PartError, ResourceError, SetupError
from geometry.part import Part
from geometry.setup_frame import SetupFrame

READER_MODULE = "geometry.step_import.reader_process"


def read_part(path: str | os.PathLike[str], *, placement: SetupFrame | None = None, solid: int | None = None,
              fuse: bool = False, chord: float = 0.002, angle: float = 0.2, time_limit: float = 120.0,
              memory_limit: float = 6e9, stop: threading.Event | None = None) -> Part:
    """Read one solid from a STEP file [ISO10303-21], heal it where that is safe, and mesh it.

    path         : STEP file in clear text; mm, cm, m, inch ... are converted to mm
    placement    : Placement, the setup frame in STEP coordinates (mm); the file's own frame when None
    solid        : int, 1-based number of one of several separate solids; None when there is one
    fuse         : bool, the products of an assembly are one part: their bodies are united
    chord        : float, mm, requested limit of the distance between mesh and exact surface
    angle        : float, rad, requested limit of the turn of the normal between neighbouring mesh points
    time_limit   : float, s of wall time
    memory_limit : float, bytes of resident memory
    stop         : once set, the reading ends as if its time were over

    Returns Part in the setup frame; ``part.deviation`` is the distance measured against the exact surface.
    Raises StepError (``no_file``, ``empty_file``, ``not_step``, ``truncated_step``, ``dangling_reference``,
    ``bad_number``, ``file_too_large``, ``unreadable_step``, ``no_solid``), PartError (``open_shell``,
    ``several_solids``, ``no_such_solid``, ``inconsistent_faces``, ``part_too_small``, ``part_too_large``,
    ``mesh_failed``, ``kernel_failed``),
    SetupError (``bad_placement``, ``bad_tolerance``). A part that exceeds the limits of the reader
    or crashes it is PartError (``reader_timeout``, ``reader_memory``, ``reader_crashed``), since a retry fails as well.
    A reader killed from outside is ResourceError (``reader_crashed``).
    """
    request = _request(path, placement, solid, fuse, chord, angle)
    return Part.from_bytes(ask_reader(request, time_limit, memory_limit, stop))


def read_part_and_faces(path: str | os.PathLike[str], then: Callable[[Part], None], *, flat: bool,
                        placement: SetupFrame | None = None, solid: int | None = None, fuse: bool = False,
                        chord: float = 0.002, angle: float = 0.2, time_limit: float = 120.0,
                        memory_limit: float = 6e9, stop: threading.Event | None = None) -> bytes:
    """Read one solid as ``read_part`` does, hand it over, and read its exact faces while the CAD kernel has the file.

    then : called, by this thread, with the part; it has nothing to do with the faces
    flat : plane faces too

    Returns what ``geometry.step_import.face_surfaces.patches_from_bytes`` reads. Raises as ``read_part``, also where
    the part has been handed over.
    """
    request = _request(path, placement, solid, fuse, chord, angle) | {"wanted": "both", "flat": flat}
    return ask_reader(request, time_limit, memory_limit, stop, lambda data: then(Part.from_bytes(data)))


def _request(path: str | os.PathLike[str], placement: SetupFrame | None, solid: int | None, fuse: bool, chord: float,
             angle: float) -> dict[str, Any]:
    check_tolerances(chord, angle)
    return {"path": os.path.abspath(path), "solid": solid, "fuse": fuse, "chord": chord, "angle": angle,
            "placement": placement.as_dict() if placement else None}


def ask_reader(request: dict[str, Any], time_limit: float, memory_limit: float, stop: threading.Event | None = None,
               early: Callable[[bytes], None] | None = None) -> bytes:
    """Answer of ``geometry.step_import.reader_process``; limits in s and bytes, ``stop`` as in ``read_part``.

    early : as in ``geometry.child_process.run_limited``

    Raises
    ------
    PartError
        The reader crashed, or ran past a limit.
    ResourceError
        Another process killed the reader.
    CamError
        The errors of ``read_part``.
    """
    command = [sys.executable, "-m", READER_MODULE]
    try:
        return run_limited(command, json.dumps(request).encode(), time_limit=time_limit, memory_limit=memory_limit,
                           stop=stop, early=early)
    except ResourceError as error:
        raise _by_the_part(error) from None


def _by_the_part(error: ResourceError) -> ResourceError | PartError:
    """The error of the part where its file ended the reader; the same error where another process killed the reader."""
    if error.measured == "SIGKILL":
        return error
    remedy = error.remedy
    if error.code in ("reader_timeout", "reader_memory"):
        remedy = ("send the part alone, without small details such as threads and lettering; larger values of "
                  "quality.scallop_height_mm and gouge_tolerance_mm give a coarser mesh")
    return PartError(error.message, code=error.code, subjects=error.subjects, measured=error.measured,
                     limit=error.limit, remedy=remedy)


def check_tolerances(chord: float, angle: float) -> None:
    """Refuse mesh tolerances that no mesh can meet.

    chord : float, mm; angle : float, rad
    Raises SetupError (``bad_tolerance``).
    """
    for name, value, low, high in (("chord", chord, 1e-5, 10.0), ("angle", angle, 0.01, 1.5)):
        if not low <= value <= high:
            raise SetupError(f"mesh {name} {value:g} is outside {low:g} to {high:g}", code="bad_tolerance",
                             subjects=(name,), measured=value, limit=[low, high],
                             remedy="0.002 mm and 0.2 rad suit most parts")
