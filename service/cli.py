"""``zonemill``: plan, zones, verify, serve, view, keys, demo, family, warm, openapi.

Exit codes: 0 proved (verify: no finding; zones: done), 2 bad input, 3 not proved, 1 a bug. The result alone goes to
stdout; logs and progress go to stderr. Heavy imports stand inside the commands, so that ``--help`` is quick.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from service.commands import key_commands
from service.commands.arguments import blank_file, known_dialect, make_folder, mesh_wish, read_program, reported
from service.version import VERSION

if TYPE_CHECKING:
    from schemas.setup import Setup
    from service.console import Progress

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False,
                  help="From a STEP part of walls and internal connections to a proved milling job.")
app.add_typer(key_commands.app, name="keys")

Part = Annotated[Path, typer.Argument(metavar="PART.step", help="The part, a STEP file.", show_default=False)]
SetupPath = Annotated[Path, typer.Option("--setup", metavar="SETUP.json", help="The setup.", show_default=False)]
MeshBox = Annotated[str | None, typer.Option(metavar="x0,y0,z0,x1,y1,z1", help="Mesh this window only, mm in the "
                                             "coordinates of the program; small ones take steps down to 0.002.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print errors as JSON (problem document) on stdout.")]


def show_version(wanted: bool) -> None:
    """Print the version and leave, where ``--version`` stands on the command line."""
    if wanted:
        typer.echo(f"zonemill {VERSION}")
        raise typer.Exit


@app.callback()
def root(version: Annotated[bool, typer.Option("--version", callback=show_version, is_eager=True,
                                               help="Print the version and exit.")] = False) -> None:
    """Options that stand before a command."""


@app.command()
def plan(part: Part, setup: SetupPath,
         out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")],
         mesh_step: Annotated[float | None, typer.Option(help="Also write machined.stl, the part as the program leaves "
                                                              "it, with nodes so many mm apart.")] = None,
         mesh_box: MeshBox = None, as_json: AsJson = False) -> None:
    """Plan and prove a part: report, zones, programs and STEP-NC into DIR; the report also on stdout."""

    def run(given: Setup, progress: Progress, blank: Path | None) -> tuple[Any, int]:
        from service.errors import EXIT_PROVED, EXIT_UNPROVED
        from service.pipeline import plan as plan_job

        report = plan_job(part, given, out, progress, mesh_wish(mesh_step, mesh_box), blank_path=blank)
        return report, EXIT_PROVED if report["state"] == "proved" else EXIT_UNPROVED

    with reported(as_json):
        make_folder(out)
    _exit(part, setup, run, as_json)


@app.command()
def zones(part: Part, setup: SetupPath, as_json: AsJson = False) -> None:
    """Print zones.json: walls, connections, channels, zones, remainder."""

    def run(given: Setup, progress: Progress, blank: Path | None) -> tuple[Any, int]:
        from service.pipeline import zones_only

        return zones_only(part, given, progress, blank_path=blank), 0

    _exit(part, setup, run, as_json)


@app.command()
def verify(part: Part, setup: SetupPath,
           program: Annotated[Path, typer.Option("--program", metavar="FILE", help="The NC program, or STEP-NC: "
                                                                                      "AP238 or ISO 14649.")],
           access: Annotated[str | None, typer.Option(help="Access of the setup the program is for; default the "
                                                          "first.")] = None,
           dialect: Annotated[str | None, typer.Option(help="Control the program is for: linuxcnc, fanuc, haas, "
                                                            "siemens or heidenhain; default by its text, its name and "
                                                            "machine.dialects.")] = None,
           spindle_tool: Annotated[int, typer.Option(min=0, help="T number of the tool in the spindle, length offset "
                                                                 "on, before the first line; 0 for none.")] = 0,
           out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for report, deviation map and "
                                                                           "mesh; none is written without.")] = None,
           mesh_step: Annotated[float, typer.Option(help="mm between the nodes of machined.stl; 0 leaves it "
                                                         "out.")] = 0.2,
           mesh_box: MeshBox = None, as_json: AsJson = False) -> None:
    """Prove any program or STEP-NC, also foreign ones; the report goes to stdout, what was found in short to stderr."""

    def run(given: Setup, progress: Progress, blank: Path | None) -> tuple[Any, int]:
        from service.console import say, verification_summary
        from service.errors import EXIT_PROVED, EXIT_UNPROVED
        from service.pipeline import verify_program

        started, wish = time.monotonic(), mesh_wish(mesh_step or None, mesh_box) if out is not None else None
        result = verify_program(part, given, read_program(program), progress, access, out, wish, spindle_tool, blank,
                                known_dialect(dialect), program.suffix)
        progress.close()
        say(verification_summary(result, time.monotonic() - started))
        return result, EXIT_UNPROVED if result["findings"] else EXIT_PROVED

    if out is not None:
        with reported(as_json):
            make_folder(out, verification=True)
    _exit(part, setup, run, as_json)


@app.command()
def serve(host: Annotated[str | None, typer.Option(help="Address; default 127.0.0.1.")] = None,
          port: Annotated[int | None, typer.Option(help="Port; default 8000, 0 takes a free one.")] = None,
          data: Annotated[Path | None, typer.Option(help="Data folder; default ./data.")] = None,
          as_json: AsJson = False) -> None:
    """Serve the HTTP interface, engine included; every other setting comes from ZONEMILL_* variables."""
    from service.api.server import settings_with

    given = {"host": host, "port": port, "data_dir": data}
    with reported(as_json):
        from service.api.server import run_server

        run_server(settings_with(given))


@app.command()
def view(folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of plan --out, or of verify --out.",
                                                show_default=False)],
         port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 takes a free one.")] = 0,
         browser: Annotated[bool, typer.Option(help="Open it in the browser.")] = True,
         as_json: AsJson = False) -> None:
    """Show a folder of results in the browser: the page of a job, served to this machine until Ctrl-C."""
    with reported(as_json):
        from service.commands.view_command import show_folder

        show_folder(folder, port, open_browser=browser)


@app.command()
def demo(out: Annotated[Path, typer.Option("--out", help="Folder for the files.")] = Path("out"),
         keep: Annotated[bool, typer.Option("--keep", help="Keep serving until Ctrl-C.")] = False,
         as_json: AsJson = False) -> None:
    """Make a sample part, post it to an embedded service, and fetch its files."""
    with reported(as_json):
        from service.commands.demo import run_demo

        code = run_demo(out, keep=keep)
        raise typer.Exit(code)


@app.command()
def family(out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.",
                                             show_default=False)],
           recipe: Annotated[str, typer.Option(help="What is drawn; docs/family.md lists the recipes.")] = "mixed",
           seed: Annotated[int, typer.Option(min=0, help="Of the first part; the same seed gives the same part.")] = 0,
           count: Annotated[int, typer.Option(min=1, help="Parts, with seeds one after the other.")] = 1,
           walls: Annotated[int | None, typer.Option(help="Walls of each part; drawn when left out.")] = None,
           connections: Annotated[int | None, typer.Option(help="Connections; drawn when left out.")] = None,
           reach: Annotated[bool, typer.Option("--reach", help="Compute what the setup can reach as well.")] = False,
           as_json: AsJson = False) -> None:
    """Write random test parts with truth: NAME.step, NAME.truth.json, NAME.setup.json; prints the list of files."""
    with reported(as_json):
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
    with reported(as_json):
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

    wanted : walls and connections asked for, where the recipe lets one choose
    reach  : whether the truth says what the suggested setup can reach

    Raises
    ------
    InputError
        There is no such recipe (``unknown_recipe``), it lets one choose nothing of the kind (``not_of_this_recipe``),
        no draw kept the rules of the family (``impossible_layout``), or cadquery is not installed
        (``generator_not_installed``).
    """
    import inspect

    from examples.family.layout import LayoutError
    from examples.family.recipes import RECIPES, make_part
    from geometry.errors import InputError

    if recipe not in RECIPES:
        raise InputError(f"the family has no recipe {recipe!r}", code="unknown_recipe", measured=recipe,
                         limit=sorted(RECIPES), remedy="take one of the recipes listed")
    takes = inspect.signature(RECIPES[recipe]).parameters
    if any(key not in takes for key in wanted):
        raise InputError(f"recipe {recipe} sets its own number of walls and connections", code="not_of_this_recipe",
                         subjects=tuple(wanted), remedy="leave --walls and --connections out, or take recipe mixed")
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
                         remedy="take another seed, or fewer walls and connections") from None


def _exit(part: Path, setup: Path, run: Callable[[Setup, Progress, Path | None], tuple[Any, int]],
          as_json: bool) -> None:
    """Run a command on part and setup, print its result and leave with its exit code."""
    with reported(as_json):
        from geometry.step_import.text_checks import check_text
        from service.console import Progress, print_json
        from service.from_wire import read_setup

        given = read_setup(setup)
        check_text(part)
        blank = blank_file(setup, given)
        progress = Progress()
        try:
            result, code = run(given, progress, blank)
        finally:
            progress.close()
        print_json(result)
        raise typer.Exit(code)


def main() -> None:
    """Entry point of the ``zonemill`` program."""
    app()


if __name__ == "__main__":
    main()
