"""The plan of an access, the frame of a proof, and a written program with the names of its files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from geometry.mesh import F64
from geometry.part import Part
from geometry.sampling import SurfaceSamples
from output.workplan import Workplan
from schemas.machine import DIALECT_ENDINGS
from toolpath.planning.job_plan import Plan
from toolpath.stock.stock_map import StockMap
from verify.model import NcProgram, Proof
from zones.reach.access_view import View, turned_samples


@dataclass(frozen=True, eq=False)
class AccessPlan:
    """The plan of one access, in its frame.

    clearance : mm, height of the clearance plane
    left      : the stock after it, for the accesses that follow; None where every access begins with the whole blank
    name      : under which it is kept for another attempt (``service.stages.resume``); '' where it is not kept
    """

    view: View
    plan: Plan
    clearance: float
    left: StockMap | None
    name: str = ""


@dataclass(frozen=True, eq=False)
class ProofFrame:
    """The frame of a proof.

    id       : access whose frame it is; the first access where it is the setup frame
    rotation : (3, 3) float64, dimensionless, from the setup frame to this one
    part     : Part in this frame
    """

    id: str
    rotation: F64
    part: Part

    @classmethod
    def of(cls, view: View) -> ProofFrame:
        """The frame of an access."""
        return cls(view.id, view.rotation, view.part)

    def into(self, samples: SurfaceSamples, view: View) -> SurfaceSamples:
        """Samples that are given in the frame of a view, in this frame."""
        if np.array_equal(self.rotation, view.rotation):
            return samples
        return turned_samples(samples, self.rotation @ view.rotation.T)


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


def in_setup_frame(frame: ProofFrame, proof: Proof) -> Proof:
    """The proof with the places of its findings, and of walls without support, in the setup frame."""
    if np.array_equal(frame.rotation, np.eye(3)):
        return proof
    support = replace(proof.support, at=_turned(proof.support.at, frame.rotation))
    return replace(proof, support=support, findings=tuple(
        replace(f, point=_turned(f.point, frame.rotation), tip=_turned(f.tip, frame.rotation)) for f in proof.findings))


Place = tuple[float, float, float]


def _turned(place: Place | None, rotation: F64) -> Place | None:
    if place is None:
        return None
    x, y, z = (np.array(place) @ rotation).tolist()
    return x, y, z


__all__ = ["ProofFrame", "WrittenProgram", "AccessPlan", "in_setup_frame"]
