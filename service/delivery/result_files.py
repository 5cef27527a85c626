"""The files of a job: their names, and how each is written whole or not at all."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from geometry.errors import InputError
from schemas.machine import DIALECT_ENDINGS

Files = dict[str, tuple[str, str, str | None, bytes | Path]]
"""By name: kind, dialect, access, content. A large content is a file beside its final place, which is moved there."""


def deliver(out: Path, report: dict[str, Any], files: Files) -> None:
    """List the files in the report, under ``files``, and write them into a folder, the report last."""
    report["files"] = listed(files)
    for name, (*_, data) in files.items():
        if isinstance(data, Path):
            _move_whole(data, out / name)
        else:
            write_whole(out / name, data)
    write_whole(out / "report.json", json_bytes(report))


def listed(files: Files) -> list[dict[str, Any]]:
    """The entries of the files in a report, by name."""
    return [{"name": name, "kind": kind, "access": access, "dialect": dialect or None, "sha256": _digest(data)}
            for name, (kind, dialect, access, data) in sorted(files.items())]


def json_bytes(data: dict[str, Any]) -> bytes:
    """Plain data as the files hold it."""
    return (json.dumps(data, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n").encode()


def write_whole(path: Path, data: bytes) -> None:
    """Write a file whole or not at all."""
    partial = path.with_name(path.name + ".part")
    with open(partial, "wb") as f:
        f.write(data)
        f.flush()
        os.fsync(f.fileno())
    os.replace(partial, path)


def _move_whole(there: Path, path: Path) -> None:
    with open(there, "rb") as f:
        os.fsync(f.fileno())
    os.replace(there, path)


def _digest(data: bytes | Path) -> str:
    if isinstance(data, bytes):
        return hashlib.sha256(data).hexdigest()
    with open(data, "rb") as f:
        return hashlib.file_digest(f, "sha256").hexdigest()


PROGRAMS = tuple(f"{d}.{e}" for d, e in DIALECT_ENDINGS.items())
RESULT_FILES = (*(f"program.{p}" for p in PROGRAMS), "job.stpnc", "job.arm.stpnc", "report.json", "zones.json",
                "preview.png", "deviation.png", "sheet.html", "sheet.pdf", "view.bin", "machined.stl")
ACCESS_FILES = (*(f"program.*.{p}" for p in PROGRAMS), "job.*.stpnc", "machined.*.stl")  # of further accesses
VERIFICATION_FILES = ("report.json", "deviation.png", "view.bin", "machined.stl")
PLAN_MARKS = (*(f"program{k}.{p}" for p in PROGRAMS for k in ("", ".*")), "job.stpnc", "job.*.stpnc", "zones.json")


def clear_results(folder: Path) -> None:
    """Delete the files of an earlier job from a folder, so that no old program lies beside a new report.

    Raises
    ------
    InputError
        One of them cannot be deleted.
    """
    _clear(folder, (*RESULT_FILES, *ACCESS_FILES))


def clear_verification(folder: Path) -> None:
    """Delete the files of an earlier verification from a folder.

    Raises
    ------
    InputError
        One of them cannot be deleted. Code 'out_holds_a_job': the folder holds the files of a plan, perhaps the program
        to be proved, and the report of a plan must stay beside its programs.
    """
    plan = sorted({p.name for pattern in PLAN_MARKS for p in folder.glob(pattern)})
    if plan:
        raise InputError(f"the folder {folder} holds the files of a planned job", code="out_holds_a_job",
                         subjects=tuple(plan), remedy="give the verification a folder of its own")
    _clear(folder, VERIFICATION_FILES)


def _clear(folder: Path, patterns: Iterable[str]) -> None:
    """Delete the files that match, and what a crash left half written of them."""
    wanted = [p for pattern in patterns for p in (pattern, f"{pattern}.part")]
    for path in sorted({p for pattern in wanted for p in folder.glob(pattern)}):
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise InputError(f"{path} of an earlier job cannot be deleted: {error.strerror}",
                             code="out_not_writable", remedy="give another --out") from None
