"""What an attempt at a job keeps for the next one, as files by name in a folder of the job's content.

    data/kept/ab/abcdef.../NAME    digest of the rest, then the rest; written beside, flushed, renamed

A file that is torn, or is of other content than its name says, is thrown away and counts as never written. Keeping is
a help, never a duty: where there is no room the job goes on without.
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
    """What is kept of a job; nothing where there is no folder.

    folder : made when the first file is written
    tell   : called with what has been taken over so far, each time something is: how many, by kind
    """

    def __init__(self, folder: Path | None = None, tell: Callable[[Mapping[str, int]], None] | None = None) -> None:
        self.folder, self.tell = folder, tell
        self.taken: Counter[str] = Counter()

    def __bool__(self) -> bool:
        return self.folder is not None

    def get(self, kind: str, name: str) -> memoryview | None:
        """What was put under a name; None where it is not there or not whole."""
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
        """Keep bytes under a name; False where that could not be done."""
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
        except OSError:  # no room, or somebody cleared the folder away
            try:
                written.unlink(missing_ok=True)
            except OSError:
                pass  # it goes with the folder
            return False
        return True

    def drop(self, kind: str, name: str) -> None:
        """Throw away what is kept under a name."""
        if self.folder is not None:
            try:
                (self.folder / f"{kind}-{name}").unlink(missing_ok=True)
            except OSError:
                pass  # it is refused again the next time

    def took(self, kind: str, count: int = 1) -> None:
        """Count what was taken over, and tell."""
        self.taken[kind] += count
        if self.tell is not None:
            self.tell(dict(self.taken))


__all__ = ["Kept"]
