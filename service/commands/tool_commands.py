"""``zonemill tools``: import and export of tool libraries. Heavy imports are inside, as in ``service.cli``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.commands.arguments import error_reporting
from service.commands.library_files import check_one_origin, library_bytes, library_source, write_result

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

        library = import_library(library_bytes(file), library_source(file, unit, encoding), format_name)
        _tell(library)
        if dry_run:
            write_result(json_bytes(import_report(library, dry_run=True).model_dump(mode="json")), out)
            return
        if data is not None:
            _store(data).put_all(OWNER, "tools", {t.id: t.model_dump(mode="json") for t in library.tools})
        write_result(setup_tools.write(library.tools), out)


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
    """
    with error_reporting(as_json):
        from service.console import say
        from service.libraries.exchange import export_library, import_library

        check_one_origin(file, data)
        if file is not None:
            library = import_library(library_bytes(file), library_source(file, unit, None))
            _tell(library)
            tools = library.tools
        else:
            tools = _stored(data)
        written = export_library(tools, format_name)
        for name, reason in written.left_out.items():
            say(f"tool {name} is left out: {reason}")
        for name, fields in written.losses.items():
            say(f"tool {name}: {written.format.title} has no place for {', '.join(fields)}")
        write_result(written.data, out)


def library_of(data: Path | None) -> Library | None:
    """The stored tools, machines and materials of a data folder, for a setup; None without a folder."""
    return None if data is None else _store(data).view(OWNER)


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
