"""Files of tool libraries on the command line: read with what stands beside them, and written."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from service.libraries.entry import Source


def library_source(file: Path, unit: str | None, encoding: str | None) -> Source:
    """What the command line states about a library.

    unit : mm or in, for lengths without one; encoding : of texts; None: not stated

    Raises
    ------
    LibraryError
        unknown_unit: the unit is neither.
    """
    from geometry.errors import LibraryError
    from service.libraries.entry import Source, Unit, shown

    stated = None if unit is None else Unit.of(unit)
    if unit is not None and stated is None:
        raise LibraryError(f"the unit '{shown(unit)}' is neither mm nor in", code="unknown_unit", measured=shown(unit),
                           limit=[u.value for u in Unit], remedy="state --unit mm or --unit in")

    def beside(name: str) -> bytes | None:
        # a FreeCAD library stands in Library/, its bits in Bit/ or in the same folder
        for folder in (file.parent, file.parent / "Bit", file.absolute().parent.parent / "Bit"):
            if (folder / name).is_file():
                return library_bytes(folder / name)
        return None

    return Source(file.name, stated, encoding, beside)


def library_bytes(file: Path) -> bytes:
    """Bytes of a library, at most one more than may be read.

    Raises
    ------
    LibraryError
        library_unreadable: the file cannot be read.
    """
    from geometry.errors import LibraryError
    from service.libraries.containers import MAX_LIBRARY_BYTES

    try:
        with file.open("rb") as opened:
            return opened.read(MAX_LIBRARY_BYTES + 1)
    except OSError as error:
        raise LibraryError(f"the library {file.name} cannot be read: {error.strerror}", code="library_unreadable",
                           remedy="check the path and the permissions") from None


def check_one_origin(file: Path | None, data: Path | None) -> None:
    """Refuse an export without tools, or with tools from two places.

    Raises
    ------
    InputError
        no_tools_named: neither a file nor a data folder is given, or both are.
    """
    from geometry.errors import InputError

    if (file is None) == (data is None):
        raise InputError("give either FILE or --data", code="no_tools_named",
                         remedy="zonemill tools export SETUP.json --format fusion -o tools.json")


def write_result(data: bytes, out: Path | None) -> None:
    """Write bytes to a file, or to stdout where there is none.

    Raises
    ------
    InputError
        out_not_writable: the file cannot be written.
    """
    from geometry.errors import InputError

    if out is None:
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
        return
    try:
        out.write_bytes(data)
    except OSError as error:
        raise InputError(f"{out} cannot be written: {error.strerror}", code="out_not_writable",
                         remedy="give another --out") from None
