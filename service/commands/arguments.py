"""Arguments of the command line, and their errors. Heavy imports are inside the functions, as in ``service.cli``."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from schemas.setup import Setup
    from service.delivery.machined_mesh import MeshWish


def requested_mesh(step: float | None, box: str | None) -> MeshWish | None:
    """The requested mesh of the machined part; None where ``step`` is None.

    Raises
    ------
    InputError
        ``bad_mesh_step``, ``bad_mesh_box``; ``box_without_step``.
    """
    from geometry.errors import InputError
    from service.delivery.machined_mesh import MeshWish

    if step is not None:
        return MeshWish.of(step, box)
    if box is not None:
        raise InputError("--mesh-box is given without --mesh-step", code="box_without_step", measured=box,
                         remedy="add --mesh-step, or leave out --mesh-box")
    return None


def make_folder(out: Path, *, verification: bool = False) -> None:
    """Make the folder for the files, and remove the files of an earlier job or verification from it.

    Raises
    ------
    InputError
        The folder cannot be made or written; ``out_holds_a_job`` as ``artifacts.clear_verification``.
    """
    from geometry.errors import InputError
    from service.delivery.result_files import clear_results, clear_verification

    try:
        out.mkdir(parents=True, exist_ok=True)
        probe = out / ".writable"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(f"the folder {out} cannot be written to: {error.strerror}", code="out_not_writable",
                         remedy="give another --out") from None
    (clear_verification if verification else clear_results)(out)


def blank_file(setup_path: Path, setup: Setup) -> Path | None:
    """The STEP file of the blank, relative to the folder of the setup; None where the blank needs no file.

    Raises
    ------
    SetupError
        ``no_stock_file``: the setup does not name it.
    StepError
        The file cannot be read, or is not a STEP file.
    """
    from geometry.errors import InputError
    from geometry.step_import.text_checks import check_text
    from service.from_wire import blank_error, no_stock_file

    if setup.stock.kind != "step":
        return None
    if setup.stock.step_file is None:
        raise no_stock_file()
    path = setup_path.parent / setup.stock.step_file
    try:
        check_text(path)
    except InputError as error:
        raise blank_error(error) from None
    return path


def known_dialect(name: str | None) -> str | None:
    """The name of a control, checked.

    Raises
    ------
    InputError
        ``unknown_dialect``.
    """
    from geometry.errors import InputError
    from schemas.machine import DIALECT_ENDINGS

    if name is not None and name not in DIALECT_ENDINGS:
        raise InputError(f"unknown dialect '{name}'", code="unknown_dialect", measured=name,
                         limit=sorted(DIALECT_ENDINGS), remedy="use one of them, or leave it out")
    return name


def read_program(path: Path) -> str:
    """Text of a program.

    Raises
    ------
    ProgramError
        The file cannot be read, or is empty.
    """
    from geometry.errors import ProgramError
    from verify.gcode.program_text import cleaned, decoded

    try:
        text = cleaned(decoded(path.read_bytes()))
    except OSError as error:
        raise ProgramError(f"the program {path.name} cannot be read: {error.strerror}",
                           code="program_unreadable", remedy="give an NC program that this user may read") from None
    if not text.strip():
        raise ProgramError(f"the program {path.name} is empty", code="empty_program", measured=0, limit=1,
                           remedy="give the NC program to be proved")
    return text


@contextmanager
def error_reporting(as_json: bool) -> Iterator[None]:
    """Turn errors into a block or a problem document, and exit with the exit code of their class.

    Raises
    ------
    Exit
        With the exit code of an error, or after Ctrl-C.
    """
    import typer

    from geometry.errors import CamError, CancelledError, InternalError
    from service.console import report_error

    try:
        yield
    except CamError as error:
        raise typer.Exit(report_error(error, as_json=as_json)) from None
    except KeyboardInterrupt:
        raise typer.Exit(report_error(CancelledError("stopped by Ctrl-C"), as_json=as_json)) from None
    except (typer.Exit, typer.Abort):
        raise
    except Exception as error:
        import traceback

        traceback.print_exc()
        bug = InternalError(f"{type(error).__name__}: {error}", code="bug",
                            remedy="please report this bug with part and setup")
        raise typer.Exit(report_error(bug, as_json=as_json)) from None
