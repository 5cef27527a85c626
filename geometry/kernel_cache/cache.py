"""Cache of compiled kernels: one folder for every state of a module and of all it depends on.

Numba checks for a compiled function only whether its own file has changed, not the files of other kernels it uses. So
an update can leave old machine code inlined in a new kernel. Here the name of a module's folder holds the digest of
``geometry.kernel_cache.sources``: an edit recompiles all that depends on it, and nothing else. An edit of a docstring
recompiles nothing. The digest contains no path and no time, so that every checkout with the same sources uses the same
machine code.

Every ``kernels`` package imports this before its first kernel, since numba finds the folder when it decorates a
function. The processor and its features are part of numba's own key: several machines may share a folder.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from numba import config, types
from numba.core import caching
from numba.core.dispatcher import Dispatcher

from geometry.kernel_cache.sources import ROOT, Sources

WEEK_S = 7 * 86400.0

_FOLDER = re.compile(r"(?:[\w.]+-)?[0-9a-f]{16}")  # one digest of all kernels names the folders of earlier releases


def bases(given: str, root: Path = ROOT) -> list[Path]:
    """Possible parents of the folders of modules, best first.

    given : NUMBA_CACHE_DIR as numba read it, "" where it is not set

    The second is shared by all checkouts of a user. The last is in the tree, for users without a home.
    """
    found = [Path(given)] if given else []
    found.append(Path(os.path.expanduser("~"), ".cache", "zonemill", "numba"))
    return [*found, root / "geometry" / "kernels" / "__pycache__" / "numba"]


@cache
def writable_base(given: str) -> Path | None:
    """The first of ``bases`` with write access, by numba's own test; None where there is none."""
    for base in bases(given):
        with contextlib.suppress(OSError):
            base.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=base).close()
            return base
    return None


@cache
def sources() -> Sources:
    """The sources of this checkout as this process found them."""
    return Sources()


@cache
def module_folder(name: str, running_as: str, given: str) -> Path | None:
    """Folder of a module's compiled functions, created and marked as used now; None without write access.

    running_as : ``__main__`` or the module's name; machine code finds its module by it, so the folders differ
    """
    base = writable_base(given)
    if base is None:
        return None
    label = name if running_as == name else f"{name}.{running_as}"
    folder = base / f"{label}-{sources().digest(name)}"
    folder.mkdir(exist_ok=True)
    os.utime(folder)
    return folder


class KernelLocator(caching._CacheLocator):  # type: ignore[misc]
    """Tells numba where the machine code of a function of the project is stored, and when it is out of date."""

    def __init__(self, py_func: Any, py_file: str, folder: Path, line: int) -> None:
        self._py_file = py_file
        self._folder = folder
        self._line = line

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> KernelLocator | None:
        """Locator of a function; None for a function outside the project, which numba stores in its own way.

        Raises
        ------
        ModuleNotFoundError
            The function's module depends on a module of the project that has no file.
        """
        name = sources().name_of(Path(py_file))
        if name is None:
            return None
        folder = module_folder(name, py_func.__module__, str(config.CACHE_DIR))
        line = sources().line_of_code(name, py_func.__code__.co_firstlineno)
        return cls(py_func, py_file, folder, line) if folder is not None else None

    def get_cache_path(self) -> str:
        """The module's folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """The digest in the folder's name."""
        return self._folder.name

    def get_disambiguator(self) -> str:
        """Line of the function without the docstrings before it: one module may hold two functions of one name."""
        return str(self._line)


class LockedIndex(caching.IndexDataCacheFile):  # type: ignore[misc]
    """Numba's index of the machine code of one function, written by one process at a time.

    Two processes that compile a function for different arguments would otherwise give both files the same number, and
    the index of one could lead to the machine code of the other.
    """

    def save(self, key: Any, data: Any) -> None:
        """Add an entry."""
        with locked(Path(self._cache_path, "lock")):
            super().save(key, data)


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold a lock file, where the system has such locks."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    with open(path, "ab") as file:
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def remove_stale(given: str | None = None, age_s: float = WEEK_S) -> list[Path]:
    """Remove folders of other states of the modules that no process has started to use within ``age_s`` seconds.

    given : NUMBA_CACHE_DIR; None takes numba's

    Returns those removed. Whatever is not named like a folder of a module stays; a process that still runs on a removed
    folder compiles again and is not wrong.
    """
    ours = {sources().digest(name) for name in sources().compiled()}
    removed = []
    for base in bases(str(config.CACHE_DIR) if given is None else given):
        for other in sorted(base.iterdir()) if base.is_dir() else []:
            if other.name[-16:] in ours or not _FOLDER.fullmatch(other.name):
                continue
            if other.is_symlink() or not other.is_dir():
                continue
            try:
                idle_s = time.time() - other.stat().st_mtime
            except FileNotFoundError:  # another process removes at the same time
                continue
            if idle_s > age_s:
                shutil.rmtree(other, ignore_errors=True)
                removed.append(other)
    return removed


def compile_constants_as_values() -> None:
    """Let a kernel that another one calls with a constant be compiled for the constant's type, not for its value.

    Numba compiles such a kernel once for every constant, from source to machine code, though the value makes no
    difference before LLVM inlines the call. LLVM knows the constant all the same.
    """
    template = Dispatcher.get_call_template

    def of_values(self: Any, args: Any, kws: Any) -> Any:
        if sources().name_of(Path(self.py_func.__code__.co_filename)) is not None:
            args = tuple(types.unliteral(a) for a in args)
            kws = {name: types.unliteral(a) for name, a in kws.items()}
        return template(self, args, kws)

    setattr(Dispatcher, template.__name__, of_values)


def install() -> None:
    """Put our locator before numba's, our index in place of numba's, and constants beside values."""
    caching.CacheImpl._locator_classes.insert(0, KernelLocator)
    chosen = str(getattr(config, "CACHE_LOCATOR_CLASSES", ""))  # a list of the user's own would go before it
    if chosen:
        config.CACHE_LOCATOR_CLASSES = f"{__name__}.{KernelLocator.__name__},{chosen}"
    caching.IndexDataCacheFile = LockedIndex
    compile_constants_as_values()


install()
