"""A written program with the names of its files.

The process that writes STEP-NC imports this, so it imports little.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from geometry.mesh import F64
from output.workplan import Workplan
from schemas.machine import DIALECT_ENDINGS
from verify.model import NcProgram


@dataclass(frozen=True, eq=False)
class WrittenProgram:
    """A program in all its dialects, with the workplan it was written from.

    access  : its access; the first one where a program holds all accesses
    text    : in the dialect that the proof simulates
    end     : part of the names of its files, '' for the first program
    turn    : (3, 3) float64, dimensionless, from the frame of the proof to that of the program; None: the same
    dialect : that the proof simulates
    others  : texts in further dialects
    """

    access: str
    work: Workplan
    text: str
    end: str = ""
    turn: F64 | None = None
    dialect: str = "linuxcnc"
    others: Mapping[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """File name of the program that is simulated."""
        return self._named(self.dialect)

    def files(self) -> list[tuple[str, str, str]]:
        """Dialect, file name and text of each dialect, the simulated one first."""
        texts = {self.dialect: self.text, **self.others}
        return [(dialect, self._named(dialect), text) for dialect, text in texts.items()]

    def _named(self, dialect: str) -> str:
        return self.file_name("program", f"{dialect}.{DIALECT_ENDINGS[dialect]}")

    def file_name(self, stem: str, end: str) -> str:
        """'job.stpnc' for the first access, 'job.A2.stpnc' for a further one."""
        return f"{stem}{self.end}.{end}"

    def given(self) -> NcProgram:
        """The program as a proof takes it."""
        return NcProgram(self.name, self.text, self.turn, self.work.work_offset, self.dialect)

    def twins(self) -> list[NcProgram]:
        """The same program in the further dialects, which are compared with it."""
        return [NcProgram(self._named(d), t, self.turn, self.work.work_offset, d) for d, t in self.others.items()]


__all__ = ["WrittenProgram"]
