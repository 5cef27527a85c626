"""A full disk, told from a bug: nothing is accepted or started while there is no room, and what waits stays."""

from __future__ import annotations

import errno
import os
import shutil
import uuid
from pathlib import Path

from geometry.errors import ResourceError
from service.errors import UnavailableError

STORAGE_FULL = "storage_full"
_FULL = (errno.ENOSPC, errno.EDQUOT)


def is_full(error: BaseException | None) -> bool:
    """Whether an error, or the one it came from, says that there is no room on a disk."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in _FULL:
            return True
        error = error.__cause__
    return False


def storage_full() -> ResourceError:
    """The error of a job that found the disk full."""
    return ResourceError("there is no room left on the disk of the data folder", code=STORAGE_FULL,
                         remedy="make room or set ZONEMILL_RETENTION_DAYS, then post it again")


def check_free(folder: Path, least_mb: int) -> None:
    """Refuse while the disk of a folder has less than ``least_mb`` MB free.

    Raises
    ------
    UnavailableError
        Code 'storage_full'.
    """
    free = shutil.disk_usage(folder).free / 1e6
    if free < least_mb:
        raise UnavailableError(f"{free:.0f} MB are free on the disk of the data folder", code=STORAGE_FULL,
                               measured=round(free), limit=least_mb, retry_after_s=60,
                               remedy="make room, or lower ZONEMILL_MIN_FREE_MB")


def check_writable(folder: Path) -> None:
    """Write a few bytes to the disk, through to the medium, and take them away again; OSError where that fails."""
    path = folder / f"probe-{uuid.uuid4().hex}"
    try:
        with path.open("wb") as out:
            out.write(b"ready")
            out.flush()
            os.fsync(out.fileno())
    finally:
        path.unlink(missing_ok=True)
