"""``zonemill tools``: import and export of tool libraries. Heavy imports are inside, as in ``service.cli``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from service.commands.arguments import error_reporting

if TYPE_CHECKING:
    from schemas.tools import Tool
    from service.from_wire import Library
    from service.jobs.library import LibraryStore
    from service.libraries.exchange import ImportedLibrary

app = typer.Typer(no_args_is_help=True, help="Tool libraries of other systems: import, export.")

MAX_LINES = 40
"""Lines of notes and reasons on stderr; the report of a dry run has all of them."""
OWNER = "local"
"""Owner of the entries that the command line stores: the user of a service without keys."""
Data = Annotated[Path | None, typer.Option("--data", metavar="DIR", help="Data folder of the service.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print errors as JSON (problem document) on stdout.")]


@app.command("import")
def import_tools(
        file: Annotated[Path, typer.Argument(metavar="FILE", help="The library.", show_default=False)],
        unit: Annotated[str | None, typer.Option(help="Unit of lengths for which the library states none: mm or "
                                                      "in.")] = None,
        format_name: Annotated[str | None, typer.Option("--format", help="Format of the library; default: by its "
                                                                         "content. docs/libraries.md lists "
                                                                         "them.")] = None,
        encoding: Annotated[str | None, typer.Option(help="Encoding of a library that is text: utf-8, utf-16, "
                                                          "windows-1252 or iso-8859-1; default: UTF-8, or as the file "
                                                          "states.")] = None,
        dry_run: Annotated[bool, typer.Option("--dry-run", help="Store nothing; print what becomes of each "
                                                                "entry.")] = False,
        out: Annotated[Path | None, typer.Option("--out", "-o", metavar="OUT", help="Write the result to this file "
                                                                                    "instead of stdout.")] = None,
        data: Data = None, as_json: AsJson = False) -> None:
    """Print the tools of a library as the list tools of a setup; with --data store them for lib:NAME.

    Notes and reasons go to stderr.
    """
    with error_reporting(as_json):
        from service.libraries.containers import json_bytes
        from service.libraries.exchange import import_library
        from service.libraries.formats import setup_tools
        from service.libraries.import_report import import_report

        library = import_library(_bytes_of(file), _source(file, unit, encoding), format_name)
        _tell(library)
        if dry_run:
            _write(json_bytes(import_report(library, dry_run=True).model_dump(mode="json")), out)
            return
        if data is not None:
            _store(data).put_all(OWNER, "tools", {t.id: t.model_dump(mode="json") for t in library.tools})
        _write(setup_tools.write(library.tools), out)


@app.command("export")
def export_tools(
        file: Annotated[Path | None, typer.Argument(metavar="[FILE]", help="A setup, a list of tools, or a library of "
                                                                           "any format; without it --data "
                                                                           "is needed.", show_default=False)] = None,
        format_name: Annotated[str, typer.Option("--format", help="Format to write: fusion, fusion-tools, hsmlib, "
                                                                  "freecad, linuxcnc, iso13399, din4000, hypermill, "
                                                                  "solidcam, csv, xlsx or zonemill.")] = "csv",
        unit: Annotated[str | None, typer.Option(help="Unit of lengths for which FILE states none: mm or in.")] = None,
        out: Annotated[Path | None, typer.Option("--out", "-o", metavar="OUT", help="Write to this file instead of "
                                                                                    "stdout.")] = None,
        data: Data = None, as_json: AsJson = False) -> None:
    """Write tools as a library of another system, in mm.

    What the format has no place for goes to stderr.

    Raises
    ------
    InputError
        no_tools_named: neither FILE nor --data is given, or both are.
    """
    with error_reporting(as_json):
        from geometry.errors import InputError
        from service.console import say
        from service.libraries.exchange import export_library, import_library

        if (file is None) == (data is None):
            raise InputError("give either FILE or --data", code="no_tools_named",
                             remedy="zonemill tools export SETUP.json --format fusion -o tools.json")
        if file is not None:
            library = import_library(_bytes_of(file), _source(file, unit, None))
            _tell(library)
            tools = library.tools
        else:
            tools = _stored(data)
        written = export_library(tools, format_name)
        for name, reason in written.left_out.items():
            say(f"tool {name} is left out: {reason}")
        for name, fields in written.losses.items():
            say(f"tool {name}: {written.format.title} has no place for {', '.join(fields)}")
        _write(written.data, out)


def library_of(data: Path | None) -> Library | None:
    """The stored tools, machines and materials of a data folder, for a setup; None without a folder."""
    return None if data is None else _store(data).view(OWNER)


def _source(file: Path, unit: str | None, encoding: str | None) -> Any:
    from geometry.errors import LibraryError
    from service.libraries.entry import Source, Unit, shown

    stated = None if unit is None else Unit.of(unit)
    if unit is not None and stated is None:
        raise LibraryError(f"the unit '{shown(unit)}' is neither mm nor in", code="unknown_unit", measured=shown(unit),
                           limit=[u.value for u in Unit], remedy="state --unit mm or --unit in")

    def beside(name: str) -> bytes | None:
        # a FreeCAD library stands in Library/, its bits in Bit/ or in the same folder
        for folder in (file.parent, file.parent / "Bit", file.parent.parent / "Bit"):
            if (folder / name).is_file():
                return (folder / name).read_bytes()
        return None

    return Source(file.name, stated, encoding, beside)


def _bytes_of(file: Path) -> bytes:
    from geometry.errors import LibraryError
    from service.libraries.containers import MAX_LIBRARY_BYTES

    try:
        with file.open("rb") as opened:
            return opened.read(MAX_LIBRARY_BYTES + 1)
    except OSError as error:
        raise LibraryError(f"the library {file.name} cannot be read: {error.strerror}", code="library_unreadable",
                           remedy="check the path and the permissions") from None


def _write(data: bytes, out: Path | None) -> None:
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


def _tell(library: ImportedLibrary) -> None:
    """Counts, reasons and notes to stderr."""
    from service.console import say

    counts = library.counts
    say(f"{library.format.title}: {counts['taken']} taken, {counts['noted']} taken with notes, "
        f"{counts['left_out']} left out")
    lines = [f"  {e.entry.name}: left out: {e.reason}" for e in library.entries if e.reason]
    lines += [f"  {e.entry.name}: {n}" for e in library.entries if not e.reason for n in e.notes]
    for line in lines[:MAX_LINES]:
        say(line)
    if len(lines) > MAX_LINES:
        say(f"  and {len(lines) - MAX_LINES} more; --dry-run prints all")


def _store(data: Path | None) -> LibraryStore:
    """The library in the database of the settings; the database is made where there is none."""
    from service.api.server import settings_with
    from service.jobs.database import connect, migrate
    from service.jobs.library import LibraryStore

    url = settings_with({"data_dir": data}).url
    migrate(url)
    return LibraryStore(connect(url))


def _stored(data: Path | None) -> list[Tool]:
    from schemas.tools import Tool

    return [Tool.model_validate(e.value) for e in _store(data).all(OWNER, "tools")]
