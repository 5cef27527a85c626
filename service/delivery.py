"""The files of a job: what they are, and written so that each is there whole or not at all."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

Files = dict[str, tuple[str, str, str | None, bytes | Path]]
"""By name: kind, dialect, access, content; a large one as a file beside its place, which is moved there."""


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
    """Write a file so that it is there whole or not at all."""
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
