"""Where compiled kernels are kept: a folder of its own for every state of the kernel sources.

Numba asks of a compiled function only whether the file it stands in has changed, not the files it takes other kernels
from. Left at that, an update can leave old machine code inlined in a new kernel. So numba's folder is named here by a
digest of all kernel sources together, and a change to any of them compiles all of them anew.

Every ``kernels`` package imports this before its first kernel, for numba reads the folder when a function is decorated.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
import time
from pathlib import Path

from numba import config

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("geometry", "zones", "toolpath", "verify")
# compiled functions that stand outside the packages of kernels
BESIDE = ("service/pictures/rasterizer.py", "examples/casting.py", "examples/reach.py")
DAY_S = 86400.0

_DIGEST = re.compile(r"[0-9a-f]{16}")


def kernel_sources(root: Path = ROOT) -> list[Path]:
    """Every source file whose functions numba compiles, by name; ``root`` is the folder that holds the packages."""
    files = [p for name in PACKAGES for p in (root / name / "kernels").glob("*.py")]
    return sorted(files + [p for p in (root / name for name in BESIDE) if p.is_file()])


def sources_digest(root: Path = ROOT) -> str:
    """First 16 hex digits of a SHA-256 over names and contents of the kernel sources."""
    digest = hashlib.sha256()
    for path in kernel_sources(root):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(root).as_posix()} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()[:16]


def bases(given: str, root: Path = ROOT) -> list[Path]:
    """Folders the one of this state may be made in, best first: numba's own order of places.

    given : NUMBA_CACHE_DIR as numba read it, "" where it is not set
    """
    found = [Path(given)] if given else []
    found.append(root / "geometry" / "kernels" / "__pycache__" / "numba")
    return [*found, Path(os.path.expanduser("~"), ".cache", "zonemill", "numba")]


def _usable(folder: Path) -> bool:
    """Whether files can be written there, by numba's own test; a folder that can is marked as used now."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        os.utime(folder)
    except OSError:
        return False
    return True


def key_cache(root: Path = ROOT) -> Path | None:
    """Point numba at the folder of this state of the sources; None, and numba left alone, where none can be written.

    Processes may do so at the same time. What keyed numba already for this state is found in place.
    """
    digest, given = sources_digest(root), str(config.CACHE_DIR)
    if Path(given).name == digest:
        return Path(given)
    folder = next((base / digest for base in bases(given, root) if _usable(base / digest)), None)
    if folder is not None:
        config.CACHE_DIR = str(folder)
    return folder


def remove_stale(folder: Path, age_s: float = DAY_S) -> list[Path]:
    """Remove the folders of other states beside ``folder`` that nobody has begun to use for ``age_s`` seconds.

    Returns those removed. Whatever is not named like a digest stays; a process that still runs on a removed folder
    compiles again and is not wrong.
    """
    removed = []
    for other in sorted(folder.parent.iterdir()):
        if other == folder or not _DIGEST.fullmatch(other.name) or other.is_symlink() or not other.is_dir():
            continue
        try:
            idle_s = time.time() - other.stat().st_mtime
        except FileNotFoundError:  # somebody else removes at the same time
            continue
        if idle_s > age_s:
            shutil.rmtree(other, ignore_errors=True)
            removed.append(other)
    return removed


FOLDER = key_cache()
