"""A full disk is not a bug: nothing is accepted or started while the disk is full, and waiting jobs stay."""

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
    """Whether an error, or its cause, is a full disk."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in _FULL:
            return True
        error = error.__cause__
    return False


def storage_full() -> ResourceError:
    """Error of a job that found the disk full."""
    return ResourceError("the disk of the data folder is full", code=STORAGE_FULL,
                         remedy="free disk space or set ZONEMILL_RETENTION_DAYS, then post the job again")


def check_free(folder: Path, least_mb: int) -> None:
    """Refuse while the disk of a folder has less than ``least_mb`` MB free.

    Raises
    ------
    UnavailableError
        Code 'storage_full'.
    """
    free = shutil.disk_usage(folder).free / 1e6
    if free < least_mb:
        raise UnavailableError(f"the disk of the data folder has only {free:.0f} MB free", code=STORAGE_FULL,
                               measured=round(free), limit=least_mb, retry_after_s=60,
                               remedy="free disk space, or lower ZONEMILL_MIN_FREE_MB")


def check_writable(folder: Path) -> None:
    """Write a few bytes to the disk, flush them and delete them; OSError where that fails."""
    path = folder / f"probe-{uuid.uuid4().hex}"
    try:
        with path.open("wb") as out:
            out.write(b"ready")
            out.flush()
            os.fsync(out.fileno())
    finally:
        path.unlink(missing_ok=True)
