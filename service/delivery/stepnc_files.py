"""STEP-NC of a proved job: written, read back and compared with the program before it is delivered.

That takes a few times as long as the rest of a report. For long programs another process does it meanwhile
(``stepnc_under_way``).
"""

from __future__ import annotations

import json
import os
import pickle
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from geometry.child_process import run_limited
from geometry.errors import InputError, InternalError, ResourceError
from geometry.part import Part
from geometry.tool_body import ToolBody
from output.stepnc.ap238 import stream_stepnc_aim
from output.stepnc.iso14649 import stream_stepnc_arm
from output.workplan import Workplan
from service.delivery.result_files import Files
from service.stages.access_plan import WrittenProgram
from verify.checks.program_sequence import read_all
from verify.comparison.stepnc_agreement import check_agreement
from verify.model import NcProgram, ProofSetup

Stream = Callable[[Workplan, Callable[[str], object]], None]
FORMS: tuple[tuple[str, str, Stream], ...] = (
    ("stepnc", "stpnc", stream_stepnc_aim), ("stepnc-arm", "arm.stpnc", stream_stepnc_arm))
"""Kind and file ending of both forms, and the function that writes each."""
LONG = 1_000_000  # characters of programs; from there on another process saves more than its start costs
TIME_LIMIT, MEMORY_LIMIT = 7200.0, 8e9  # s, bytes


@contextmanager
def stepnc_under_way(programs: Sequence[WrittenProgram], part: Part, tools: Sequence[ToolBody], setup: ProofSetup,
                     out: Path) -> Iterator[Callable[[], Files]]:
    """Run ``stepnc_files`` in another process meanwhile; yields a function that waits for the files and returns them.

    This process writes short programs itself, once the function is called. It also does so where the other process
    exceeds its memory or time. Files that are never taken are deleted.
    """
    job = (programs, part, tools, setup, out)
    if sum(len(p.text) for p in programs) < LONG or (os.cpu_count() or 1) < 2:
        yield partial(stepnc_files, *job)
        return
    stop, taken = threading.Event(), False

    def wait() -> Files:
        nonlocal taken
        try:
            files = _named(begun)
        except ResourceError:
            files = stepnc_files(*job)
        taken = True
        return files

    try:
        with ThreadPoolExecutor(1) as pool:
            command = [sys.executable, "-m", "service.delivery.stepnc_process"]
            begun = pool.submit(run_limited, command, pickle.dumps(job), time_limit=TIME_LIMIT,
                                memory_limit=MEMORY_LIMIT, name="stepnc", stop=stop)
            try:
                yield wait
            finally:
                stop.set()
    finally:
        if not taken:
            for place in (_beside(out, p.file_name("job", ending)) for p in programs for _, ending, _ in FORMS):
                place.unlink(missing_ok=True)


def _named(begun: Future[bytes]) -> Files:
    """The files that the other process has written."""
    return {name: (kind, "", None, Path(place)) for name, (kind, place) in json.loads(begun.result()).items()}


def _beside(out: Path, name: str) -> Path:
    return out / f"{name}.part"


def stepnc_files(programs: Sequence[WrittenProgram], part: Part, tools: Sequence[ToolBody], setup: ProofSetup,
                 out: Path) -> Files:
    """Both forms of STEP-NC of proved programs, as files beside their final place in a folder.

    programs : each without a finding
    part, tools, setup : of the proof, as ``verify.prove.prove`` takes them

    Raises
    ------
    InternalError
        Code stepnc_differs, stepnc_unreadable: the file that was written does not read back as the program; no file
        stays.
    OutputError
        As the writers.
    """
    files: Files = {}
    try:
        for program in programs:
            (proved,) = read_all([program.given()], part, tools, setup, 0, _silent)
            for kind, ending, stream in FORMS:
                name = program.file_name("job", ending)
                path = _beside(out, name)
                files[name] = kind, "", None, path
                with open(path, "w", encoding="ascii", newline="\n") as file:
                    stream(program.work, file.write)
                given = NcProgram(name, path.read_text(encoding="ascii"), program.turn, program.work.work_offset)
                (read,) = read_all([given], part, tools, setup, 0, _silent)
                if remarks := read.program.remarks:
                    raise InternalError(f"{name} reads back with a remark: {remarks[0].message}",
                                        code="stepnc_unreadable", subjects=(name,), measured=remarks[0].line,
                                        remedy="report this error with part and setup; no file is delivered")
                check_agreement(proved.program, read.program)
    except BaseException as problem:
        for *_, written in files.values():
            with suppress(OSError):
                Path(str(written)).unlink(missing_ok=True)
        if isinstance(problem, InputError):  # a fault of the writer, not of the user
            raise InternalError(f"the STEP-NC file that was written cannot be read back: {problem.message}",
                                code="stepnc_unreadable", subjects=problem.subjects, measured=problem.measured,
                                limit=problem.limit,
                                remedy="report this error with part and setup; no file is delivered") from None
        raise
    return files


def _silent(_share: float) -> None:
    """Drop the progress."""


__all__ = ["FORMS", "stepnc_files", "stepnc_under_way"]
