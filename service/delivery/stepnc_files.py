"""STEP-NC of a proved job: written, read back and compared with the program before it is delivered.

That takes about as long as a proof. For long programs another process does it during the proof (``StepncUnderWay``).
"""

from __future__ import annotations

import json
import os
import pickle
import shutil
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from pathlib import Path

from geometry.child_process import run_limited
from geometry.errors import InputError, InternalError, ResourceError
from geometry.part import Part
from geometry.tool_body import ToolBody
from output.stepnc.ap238 import stream_stepnc_aim
from output.stepnc.iso14649 import stream_stepnc_arm
from output.stepnc.part21 import with_proof
from output.workplan import Workplan
from service.delivery.result_files import Files
from service.delivery.written_program import WrittenProgram
from verify.checks.program_sequence import read_all
from verify.comparison.stepnc_agreement import check_agreement
from verify.model import NcProgram, ProofSetup

Stream = Callable[[Workplan, Callable[[str], object]], None]
FORMS: tuple[tuple[str, str, Stream], ...] = (
    ("stepnc", "stpnc", stream_stepnc_aim), ("stepnc-arm", "arm.stpnc", stream_stepnc_arm))
"""Kind and file ending of both forms, and the function that writes each."""
LONG = 400_000  # characters of programs; from there on another process saves more than its start costs
LESS_LONG, SOON = 100_000, 3.0  # characters from which on one that waits saves time; s of planning that make one wait
TIME_LIMIT, MEMORY_LIMIT = 7200.0, 8e9  # s, bytes


class StepncUnderWay:
    """STEP-NC of long programs, written by another process while they are proved.

    A context: what is still running at its end is stopped, and files that were not taken are deleted. The other process
    writes the header without the figures of the proof, which are filled in when the files are taken. Short programs
    are written by this process when their files are asked for. So are those that the other process cannot write for
    want of memory or time. A job whose planning takes long starts the other process before there are programs: it then
    waits for them with everything imported, and takes shorter ones too.

    out : folder of the files, each beside its final place
    """

    def __init__(self, out: Path) -> None:
        self.out = out
        self._pool = ThreadPoolExecutor(1)
        self._lock = threading.Lock()
        self._timer: threading.Timer | None = None
        self._stop = threading.Event()
        self._request: Future[bytes] | None = None  # what the other process waits for
        self._begun: Future[bytes] | None = None
        self._texts: list[str] = []
        self._places: list[Path] = []

    def __enter__(self) -> StepncUnderWay:
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._drop()
        self._pool.shutdown()

    def expect(self) -> None:
        """Planning begins: start the other process where that takes longer than ``SOON`` s."""
        if (os.cpu_count() or 1) >= 2:
            self._timer = threading.Timer(SOON, self._start_early)
            self._timer.daemon = True
            self._timer.start()

    def begin(self, programs: Sequence[WrittenProgram], part: Part, tools: Sequence[ToolBody],
              setup: ProofSetup) -> None:
        """Begin with programs before their proof; what was begun before is dropped.

        part, tools, setup : of the proof, as ``verify.prove.prove`` takes them
        """
        with self._lock:
            waits = self._request is not None and not self._request.done()
            length = sum(len(p.text) for p in programs)
            if length < (LESS_LONG if waits else LONG) or (os.cpu_count() or 1) < 2:
                self._drop()
                return
            if not waits:
                self._drop()
            request = self._request or self._start()
            self._cancel_timer()
            self._texts = [p.text for p in programs]
            self._places = [_beside(self.out, p.file_name("job", ending)) for p in programs for _, ending, _ in FORMS]
            request.set_result(pickle.dumps((programs, part, tools, setup, self.out)))

    def _start_early(self) -> None:
        with self._lock:
            if self._timer is not None:
                self._start()

    def _start(self) -> Future[bytes]:
        """Start the other process; returns the request that it waits for."""
        request = Future[bytes]()
        self._stop, self._request = threading.Event(), request
        command = [sys.executable, "-m", "service.delivery.stepnc_process"]
        self._begun = self._pool.submit(run_limited, command, request, time_limit=TIME_LIMIT,
                                        memory_limit=MEMORY_LIMIT, name="stepnc", stop=self._stop)
        return request

    def _cancel_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = None

    def files(self, proved: Sequence[WrittenProgram], delivered: Sequence[WrittenProgram], part: Part,
              tools: Sequence[ToolBody], setup: ProofSetup) -> Files:
        """Both forms of STEP-NC of programs without a finding, as files beside their final place.

        proved    : the programs as the proof took them; begun or not
        delivered : the same with the figures of the proof

        Raises
        ------
        InternalError, OutputError
            As ``stepnc_files``.
        """
        if self._begun is None or [p.text for p in proved] != self._texts:
            with self._lock:
                self._drop()
            return stepnc_files(delivered, part, tools, setup, self.out)
        try:
            files = _named(self._begun)
        except ResourceError:
            with self._lock:
                self._drop()
            return stepnc_files(delivered, part, tools, setup, self.out)
        for program in delivered:
            for _, ending, _ in FORMS:
                _fill(_beside(self.out, program.file_name("job", ending)), program.work.figures)
        self._begun, self._places = None, []
        return files

    def _drop(self) -> None:
        self._cancel_timer()
        self._stop.set()
        if self._begun is not None:
            wait([self._begun])
        for place in self._places:
            place.unlink(missing_ok=True)
        self._begun, self._request, self._places, self._texts = None, None, [], []


def _fill(path: Path, figures: Sequence[str]) -> None:
    """Put the figures of the proof into the reserved lines of a file's header; the rest stays as it is."""
    whole = _beside(path.parent, path.name)
    with open(path, encoding="ascii", newline="\n") as old, open(whole, "w", encoding="ascii", newline="\n") as new:
        new.write(with_proof(old.readline() + old.readline() + old.readline(), figures))
        shutil.copyfileobj(old, new)
    os.replace(whole, path)


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


__all__ = ["FORMS", "StepncUnderWay", "stepnc_files"]
