"""``zonemill``: plan, zones, verify, serve, view, keys, tools, demo, family, warm, openapi.

Exit codes: 0 proved (zones: done), 2 bad input, 3 not proved (verify: clean or unproved), 1 a bug. Only the result goes
to stdout; logs and progress go to stderr. Heavy imports are inside the commands, so that ``--help`` is quick.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from service.commands import key_commands, tool_commands
from service.commands.arguments import (
    blank_file,
    error_reporting,
    known_dialect,
    make_folder,
    read_program,
    requested_mesh,
)
from service.version import VERSION

if TYPE_CHECKING:
    from schemas.setup import Setup
    from service.console import Progress
    from service.part_reading import PartReading

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False,
                  help="Turns a STEP file and a list of tools into G-code and STEP-NC that a simulator has verified.")
app.add_typer(key_commands.app, name="keys")
app.add_typer(tool_commands.app, name="tools")

Part = Annotated[Path, typer.Argument(metavar="PART.step", help="STEP file of the part.", show_default=False)]
SetupPath = Annotated[Path, typer.Option("--setup", metavar="SETUP.json", help="The setup.", show_default=False)]
MeshBox = Annotated[str | None, typer.Option(metavar="x0,y0,z0,x1,y1,z1", help="Mesh only this window, mm in program "
                                                                               "coordinates; small windows allow steps "
                                                                               "down to 0.002.")]
Data = Annotated[Path | None, typer.Option("--data", metavar="DIR", help="Data folder of the service, for tools, "
                                                                          "machines and materials as lib:NAME in the "
                                                                          "setup.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print errors as JSON (problem document) on stdout.")]


def show_version(wanted: bool) -> None:
    """Print the version and exit, for ``--version``.

    Raises
    ------
    Exit
        Always, where ``wanted``.
    """
    if wanted:
        typer.echo(f"zonemill {VERSION}")
        raise typer.Exit


@app.callback()
def root(version: Annotated[bool, typer.Option("--version", callback=show_version, is_eager=True,
                                               help="Print the version and exit.")] = False) -> None:
    """Options before a command."""


@app.command()
def plan(part: Part, setup: SetupPath,
         out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")],
         mesh_step: Annotated[float | None, typer.Option(help="Also write machined.stl, the part after the program; "
                                                              "the value is the distance of its nodes, mm.")] = None,
         mesh_box: MeshBox = None, data: Data = None, as_json: AsJson = False) -> None:
    """Plan and prove a part; write report, zones, programs and STEP-NC into DIR, and the report to stdout."""

    def run(given: Setup, progress: Progress, blank: Path | None, reading: PartReading) -> tuple[Any, int]:
        from service.commands.admission import admitted
        from service.errors import EXIT_PROVED, EXIT_UNPROVED
        from service.pipeline import plan as plan_job

        with admitted(progress) as admit:
            report = plan_job(part, given, out, progress, requested_mesh(mesh_step, mesh_box), blank_path=blank,
                              reading=reading, admit=admit)
        return report, EXIT_PROVED if report["state"] == "proved" else EXIT_UNPROVED

    with error_reporting(as_json):
        make_folder(out)
    _exit(part, setup, run, as_json, data, planned=True)


@app.command()
def zones(part: Part, setup: SetupPath, data: Data = None, as_json: AsJson = False) -> None:
    """Print zones.json: walls, connections, channels, zones, remainder."""

    def run(given: Setup, progress: Progress, blank: Path | None, reading: PartReading) -> tuple[Any, int]:
        from service.commands.admission import admitted
        from service.pipeline import zones_only

        with admitted(progress) as admit:
            return zones_only(part, given, progress, blank_path=blank, reading=reading, admit=admit), 0

    _exit(part, setup, run, as_json, data)


@app.command()
def verify(part: Part, setup: SetupPath,
           program: Annotated[Path, typer.Option("--program", metavar="FILE", help="NC program, or STEP-NC file (AP238 "
                                                                                   "or ISO 14649).")],
           access: Annotated[str | None, typer.Option(help="Access of the setup to which the program belongs; default: "
                                                           "the first.")] = None,
           dialect: Annotated[str | None, typer.Option(help="Control of the program: linuxcnc, fanuc, haas, siemens or "
                                                            "heidenhain; default: detected from its text, its name and "
                                                            "machine.dialects.")] = None,
           spindle_tool: Annotated[int, typer.Option(min=0, help="T number of the tool in the spindle before the first "
                                                                 "line, with its length offset on; 0: none.")] = 0,
           out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for report, deviation map and "
                                                                                 "mesh; without it no "
                                                                                 "file is written.")] = None,
           mesh_step: Annotated[float, typer.Option(help="Distance of the nodes of machined.stl, mm; "
                                                         "0: no such file.")] = 0.2,
           mesh_box: MeshBox = None, data: Data = None, as_json: AsJson = False) -> None:
    """Prove any program or STEP-NC, also from other CAM systems; print the report to stdout, a summary to stderr.

    Exit code 0: proved. 3: clean (no harm, but work is left undone) or unproved.
    """

    def run(given: Setup, progress: Progress, blank: Path | None, reading: PartReading) -> tuple[Any, int]:
        from service.verification.program_first import read_first

        started, text = time.monotonic(), read_program(program)
        first = read_first(given, text, access=access, spindle_tool=spindle_tool, dialect=known_dialect(dialect),
                           ending=program.suffix)
        # only now what takes seconds to import: a program that cannot be read is refused at once
        from service.commands.admission import admitted
        from service.console import say, verification_summary
        from service.errors import EXIT_PROVED, EXIT_UNPROVED
        from service.pipeline import verify_program

        wish = requested_mesh(mesh_step or None, mesh_box) if out is not None else None
        with admitted(progress) as admit:
            result = verify_program(part, given, text, progress, access, out, wish, spindle_tool, blank,
                                    known_dialect(dialect), program.suffix, first, reading, admit)
        progress.close()
        say(verification_summary(result, time.monotonic() - started))
        return result, EXIT_PROVED if result["state"] == "proved" else EXIT_UNPROVED

    if out is not None:
        with error_reporting(as_json):
            make_folder(out, verification=True)
    _exit(part, setup, run, as_json, data)


@app.command()
def serve(host: Annotated[str | None, typer.Option(help="Address; default: 127.0.0.1.")] = None,
          port: Annotated[int | None, typer.Option(help="Port; default: 8000; 0: any free port.")] = None,
          data: Annotated[Path | None, typer.Option(help="Data folder; default: ./data.")] = None,
          as_json: AsJson = False) -> None:
    """Serve the HTTP interface and run its jobs. ZONEMILL_* variables hold all other settings."""
    from service.api.server import settings_with

    given = {"host": host, "port": port, "data_dir": data}
    with error_reporting(as_json):
        from service.api.server import run_server

        run_server(settings_with(given))


@app.command()
def view(folder: Annotated[Path, typer.Argument(
             metavar="DIR", help="Folder that plan --out or verify --out has written.", show_default=False)],
         port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0: any free port.")] = 0,
         browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
         as_json: AsJson = False) -> None:
    """Show a folder of results in the browser, as the web page of a job, until Ctrl-C. Only this machine can open it.
    """
    with error_reporting(as_json):
        from service.commands.view_command import show_folder

        show_folder(folder, port, open_browser=browser)


@app.command()
def demo(out: Annotated[Path, typer.Option("--out", help="Folder for the files.")] = Path("out"),
         keep: Annotated[bool, typer.Option("--keep", help="Keep serving until Ctrl-C.")] = False,
         as_json: AsJson = False) -> None:
    """Make a sample part, post it to a service of its own, and fetch the resulting files.

    Raises
    ------
    Exit
        With the exit code of the job.
    """
    with error_reporting(as_json):
        from service.commands.demo import run_demo

        code = run_demo(out, keep=keep)
        raise typer.Exit(code)


@app.command()
def family(out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.",
                                             show_default=False)],
           recipe: Annotated[str, typer.Option(help="Recipe of the parts; docs/family.md lists them.")] = "mixed",
           seed: Annotated[int, typer.Option(min=0, help="Seed of the first part; it fixes the part.")] = 0,
           count: Annotated[int, typer.Option(min=1, help="Number of parts, with consecutive seeds.")] = 1,
           walls: Annotated[int | None, typer.Option(help="Number of walls of each part; default: random.")] = None,
           connections: Annotated[int | None, typer.Option(
               help="Number of connections of each part; default: random.")] = None,
           reach: Annotated[bool, typer.Option("--reach", help="Also compute what the setup can reach.")] = False,
           as_json: AsJson = False) -> None:
    """Write random test parts with known features: NAME.step, NAME.truth.json, NAME.setup.json; print the file list."""
    with error_reporting(as_json):
        from service.console import print_json, say

        make_folder(out)
        wanted = {k: v for k, v in (("walls", walls), ("connections", connections)) if v is not None}
        files: list[str] = []
        for number in range(seed, seed + count):
            files += [str(path) for path in write_family_part(recipe, number, out, wanted, reach=reach)]
            say(f"{recipe}-{number} written, {number - seed + 1} of {count}")
        print_json(files)


@app.command()
def warm(as_json: AsJson = False) -> None:
    """Compile the kernels on all cores; otherwise the first job compiles them, on one."""
    with error_reporting(as_json):
        from service.commands.warm import run_warm

        run_warm()


@app.command()
def openapi() -> None:
    """Print openapi.yaml."""
    from service.api.app import create_app
    from service.api.openapi import as_yaml

    sys.stdout.write(as_yaml(create_app().openapi()))


def write_family_part(recipe: str, seed: int, out: Path, wanted: dict[str, int], *, reach: bool) -> tuple[Path, ...]:
    """Write one part of the family; returns its three paths.

    wanted : required numbers of walls and connections, where the recipe lets one choose
    reach  : whether the truth contains the area that the suggested setup can reach

    Raises
    ------
    InputError
        unknown_recipe: there is no such recipe; not_of_this_recipe: it has fixed numbers; impossible_layout: no random
        part satisfied the rules of the family; generator_not_installed: cadquery is not installed.
    """
    import inspect

    from examples.family.layout import LayoutError
    from examples.family.recipes import RECIPES, make_part
    from geometry.errors import InputError

    if recipe not in RECIPES:
        raise InputError(f"unknown recipe {recipe!r}", code="unknown_recipe", measured=recipe,
                         limit=sorted(RECIPES), remedy="use one of the listed recipes")
    takes = inspect.signature(RECIPES[recipe]).parameters
    if any(key not in takes for key in wanted):
        raise InputError(f"recipe {recipe} sets its own number of walls and connections", code="not_of_this_recipe",
                         subjects=tuple(wanted), remedy="leave out --walls and --connections, or use recipe mixed")
    try:
        return make_part(seed, recipe, **wanted).write(out, reach=reach)
    except ModuleNotFoundError as error:
        if error.name != "cadquery":
            raise
        raise InputError("the part family needs cadquery, which is not installed", code="generator_not_installed",
                         subjects=("cadquery",), remedy="run it in the development environment (make setup); the "
                         "runtime environment cannot hold cadquery") from None
    except LayoutError as error:
        raise InputError(f"no part for recipe {recipe} and seed {seed}: {error}", code="impossible_layout",
                         remedy="use another seed, or fewer walls and connections") from None


def _exit(part: Path, setup: Path, run: Callable[[Setup, Progress, Path | None, PartReading], tuple[Any, int]],
          as_json: bool, data: Path | None, *, planned: bool = False) -> None:
    """Run a command on part and setup, print its result and exit with its exit code.

    data    : data folder whose library the setup may refer to; None: it refers to none
    planned : the command plans passes

    The part is read by another process while the command imports what it needs.
    """
    with error_reporting(as_json):
        from geometry.child_process import collect_rarely
        from geometry.step_import.text_checks import check_text
        from service.console import Progress, print_json
        from service.from_wire import read_setup
        from service.part_reading import PartReading

        collect_rarely()
        given = read_setup(setup, tool_commands.library_of(data))
        check_text(part)
        blank = blank_file(setup, given)
        progress = Progress()
        try:
            with PartReading(part, given, planned=planned) as reading:
                result, code = run(given, progress, blank, reading)
        finally:
            progress.close()
        print_json(result)
        raise typer.Exit(code)


def main() -> None:
    """Entry point of the ``zonemill`` program."""
    app()


if __name__ == "__main__":
    main()
