"""The part of a job as it is read, before anything is decomposed: enough to prove a program of any origin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from geometry.errors import CamError
from geometry.part import Part
from geometry.step_import.reader import read_part
from schemas.setup import Access, Setup
from service.from_wire import blank_error, mesh_chord, no_stock_file, placement_of
from service.part_reading import PartReading, load
from service.stages.blank_checks import check_against_part
from service.stages.blank_model import Blank, blank_of
from service.stages.job_inputs import JobInputs

Progress = Callable[[str, float], None]


class JobPart(Protocol):
    """What proof and report take of a job: a part that was read, decomposed or not."""

    @property
    def inputs(self) -> JobInputs:
        """The converted setup."""
        ...

    @property
    def part(self) -> Part:
        """The part in the setup frame."""
        ...

    @property
    def blank(self) -> Blank:
        """The stock before the first cut."""
        ...

    @property
    def accesses(self) -> tuple[Access, ...]:
        """The accesses, those of the setup first."""
        ...

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences for the report."""
        ...


@dataclass(frozen=True, eq=False)
class ReadPart:
    """A part that was read and checked against its blank; ``JobPart`` without zones."""

    inputs: JobInputs
    part: Part
    blank: Blank
    accesses: tuple[Access, ...]
    warnings: tuple[str, ...]


def load_blank(path: Path, setup: Setup) -> Part:
    """The solid of a blank's STEP file in the setup frame, which is that of the part.

    Raises
    ------
    CamError
        As ``geometry.step_import.reader.read_part``, of the same class and code; the message names the blank.
    """
    try:
        return read_part(path, placement=placement_of(setup), chord=mesh_chord(setup.quality))
    except CamError as error:
        raise blank_error(error) from None


def read_job_part(path: Path, setup: Setup, progress: Progress, blank_path: Path | None = None,
                  reading: PartReading | None = None) -> ReadPart:
    """Read part and blank of a job, and check them against each other.

    blank_path : STEP file of a blank of kind 'step'
    reading    : the reading of this part, where it has begun already

    Raises
    ------
    CamError
        The part or the setup is wrong, or the reader exceeds its limits.
    SetupError
        The setup wants the blank of a STEP file, and none is given.
    """
    progress("read", 0.0)
    if setup.stock.kind == "step" and blank_path is None:
        raise no_stock_file()
    part = load(path, setup) if reading is None else reading.part()
    blank = blank_of(setup, part, None if blank_path is None else load_blank(blank_path, setup))
    check_against_part(setup, part, blank)
    inputs = JobInputs.of(setup, part.others)
    solid_warnings = () if blank.solid is None else (f"the blank: {w}" for w in blank.solid.warnings)
    return ReadPart(inputs, part, blank, inputs.accesses, (*part.warnings, *solid_warnings))


__all__ = ["JobPart", "Progress", "ReadPart", "load_blank", "read_job_part"]
