"""Files by content: uploads as blobs, results as folders, all written as a temporary file, fsync, rename.

data/blobs/ab/abcdef....bin     an upload, named by the SHA-256 of its bytes
data/artifacts/ab/abcdef.../    a result, named by the hash of code version, kind and inputs
data/kept/ab/abcdef.../         checkpoints for that result, until it exists
data/tmp/                       files being written; worthless after a crash
"""

from __future__ import annotations

import hashlib
import math
import os
import shutil
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from service.files import make_folder, make_private, sync_folder, sync_tree
from service.version import code_version


def artifact_key(kind: str, part_sha256: str, setup_sha256: str, program_sha256: str | None = None,
                 spindle_tool: int = 0, stock_sha256: str | None = None) -> str:
    """Name of a result: equal code, kind, part, setup, program, spindle tool and blank give the same key."""
    text = "\n".join((code_version(), kind, part_sha256, setup_sha256, program_sha256 or "", str(spindle_tool),
                      stock_sha256 or ""))
    return hashlib.sha256(text.encode()).hexdigest()


def key_of(row: Mapping[Any, Any]) -> str:
    """Name of the result of a job, from its row."""
    return artifact_key(row["kind"], row["part_sha256"], row["setup_sha256"], row["program_sha256"],
                        row["spindle_tool"], row["stock_sha256"])


def _drop(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


class Artifacts:
    """Blobs and results in one data folder."""

    def __init__(self, root: Path) -> None:
        self.root = root.resolve()
        self.tmp = self.root / "tmp"
        make_private(self.root)
        self.tmp.mkdir(exist_ok=True)

    def blob(self, sha256: str) -> Path:
        """Path of the blob with that hash."""
        return self.root / "blobs" / sha256[:2] / f"{sha256}.bin"

    def missing(self, row: Mapping[Any, Any]) -> list[str]:
        """Hashes of the uploads of a job that do not exist."""
        named = (row["part_sha256"], row["stock_sha256"], row["program_sha256"])
        return [sha for sha in named if sha and not self.blob(sha).is_file()]

    def put_blob(self, chunks: Iterable[bytes], check: Callable[[Path], object] | None = None) -> tuple[str, int]:
        """Store bytes; returns their SHA-256 and their number. An existing blob stays unchanged.

        check : called with the temporary file; it raises where the file must not be stored
        """
        digest, size = hashlib.sha256(), 0
        temporary = self.tmp / f"blob-{uuid.uuid4().hex}"
        try:
            with temporary.open("wb") as out:
                for chunk in chunks:
                    digest.update(chunk)
                    size += len(chunk)
                    out.write(chunk)
                out.flush()
                os.fsync(out.fileno())
            if check is not None:
                check(temporary)
            target = self.blob(digest.hexdigest())
            make_folder(target.parent)
            os.replace(temporary, target)
            sync_folder(target.parent)
        finally:
            temporary.unlink(missing_ok=True)
        return digest.hexdigest(), size

    def result(self, key: str) -> Path:
        """Path of the result with that key."""
        return self.root / "artifacts" / key[:2] / key

    def workspace(self) -> Path:
        """A new empty folder into which a result is written."""
        folder = self.tmp / f"result-{uuid.uuid4().hex}"
        folder.mkdir()
        return folder

    def commit(self, workspace: Path, key: str) -> None:
        """Turn a workspace into the result of ``key``; where that exists already, the workspace is deleted."""
        sync_tree(workspace)
        target = self.result(key)
        make_folder(target.parent)
        try:
            os.rename(workspace, target)
        except OSError:
            if not target.is_dir():
                raise
            shutil.rmtree(workspace, ignore_errors=True)  # another job with the same content was faster
        sync_folder(target.parent)

    def take(self, key: str) -> bool:
        """Whether the result exists. If so, it counts as used now, and is not removed for a while."""
        try:
            os.utime(self.result(key))
        except FileNotFoundError:
            return False
        return True

    def kept(self, key: str) -> Path:
        """Folder of the checkpoints for the result of that key (``service.checkpoint_store``)."""
        return self.root / "kept" / key[:2] / key

    def drop_kept(self, key: str) -> None:
        """Delete the checkpoints for the result of that key."""
        trash = self.tmp / f"trash-{uuid.uuid4().hex}"
        try:
            os.rename(self.kept(key), trash)
        except FileNotFoundError:
            return
        _drop(trash)

    def all_kept(self) -> Iterator[Path]:
        """Every folder of checkpoints; its name is the key of the result."""
        yield from self.root.glob("kept/*/*")

    def stored(self) -> Iterator[Path]:
        """Every upload and every result; the stem of the name is its hash."""
        yield from self.root.glob("blobs/*/*.bin")
        yield from self.root.glob("artifacts/*/*")

    def remove(self, path: Path, before: float) -> bool:
        """Remove an upload, a result or checkpoints that were last used before a time (s).

        Returns False when it was used after all. It is moved away first and checked again, so that no other user finds
        half
        of it.
        """
        trash = self.tmp / f"trash-{uuid.uuid4().hex}"
        try:
            if path.stat().st_mtime >= before:
                return False
            os.rename(path, trash)
        except FileNotFoundError:
            return False  # another service was faster
        if trash.stat().st_mtime >= before and not path.exists():
            os.rename(trash, path)
            return False
        _drop(trash)
        return True

    def sweep(self, before: float = math.inf) -> int:
        """Delete files that a crash left half written before a time (s); without a time, for the sole owner only."""
        count = 0
        for path in self.tmp.iterdir():
            try:
                old = path.stat().st_mtime < before
            except FileNotFoundError:
                continue
            if old:
                _drop(path)
                count += 1
        return count
