"""Checkpoints of an attempt at a job for the next attempt, as files in a folder of the content of the job.

    data/kept/ab/abcdef.../NAME    digest of the rest, then the rest; written as temporary file, flushed, renamed

A file that is damaged, or whose content does not match its name, is deleted and counts as missing. Checkpoints only
save time: where the disk is full the job continues without them.
"""

from __future__ import annotations

import hashlib
import os
import uuid
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

from service.files import sync_folder

DIGEST = 32  # bytes of a SHA-256


class Kept:
    """Checkpoints of a job; none where there is no folder.

    folder : made when the first file is written
    tell   : called after each use with the number of checkpoints used so far, by kind
    """

    def __init__(self, folder: Path | None = None, tell: Callable[[Mapping[str, int]], None] | None = None) -> None:
        self.folder, self.tell = folder, tell
        self.taken: Counter[str] = Counter()

    def __bool__(self) -> bool:
        return self.folder is not None

    def get(self, kind: str, name: str) -> memoryview | None:
        """The bytes under a name; None where they are missing or damaged."""
        if self.folder is None:
            return None
        path = self.folder / f"{kind}-{name}"
        try:
            data = memoryview(path.read_bytes())
        except OSError:
            return None
        if hashlib.sha256(data[DIGEST:]).digest() != data[:DIGEST]:
            self.drop(kind, name)
            return None
        return data[DIGEST:]

    def put(self, kind: str, name: str, data: bytes | bytearray) -> bool:
        """Store bytes under a name; False where that failed."""
        if self.folder is None:
            return False
        target = self.folder / f"{kind}-{name}"
        written = self.folder / f"{target.name}.{uuid.uuid4().hex}.part"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with written.open("wb") as out:
                out.write(hashlib.sha256(data).digest())
                out.write(data)
                out.flush()
                os.fsync(out.fileno())
            os.replace(written, target)
            sync_folder(self.folder)
        except OSError:  # the disk is full, or the folder was removed
            try:
                written.unlink(missing_ok=True)
            except OSError:
                pass  # it is deleted with the folder
            return False
        return True

    def drop(self, kind: str, name: str) -> None:
        """Delete the bytes under a name."""
        if self.folder is not None:
            try:
                (self.folder / f"{kind}-{name}").unlink(missing_ok=True)
            except OSError:
                pass  # it is refused again at the next read

    def took(self, kind: str, count: int = 1) -> None:
        """Count used checkpoints, and report the totals."""
        self.taken[kind] += count
        if self.tell is not None:
            self.tell(dict(self.taken))


__all__ = ["Kept"]
