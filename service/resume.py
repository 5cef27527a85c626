"""What a second attempt at a job takes over from the first: accesses that were planned, and proofs.

Reading, zones and the samples of the proof are made again, and so are programs, for they follow from the plans. What
is taken over is named by a digest of all it came from:

    plan    the job as prepared here, the access, the plans before it, what proofs found along it
    proof   the job as prepared here, the very texts that were proved, who answers for each sample

The job as prepared has its setup, our sources, the versions of the libraries that compute and the kind of processor in
it, and part, zones and samples bit by bit: a worker on which any of them is another finds no plan of the other's. So a
job that was taken up again ends with the bytes of one that nothing happened to.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from importlib.metadata import PackageNotFoundError, version
from typing import Any, TypeVar

import llvmlite.binding as llvm
import numpy as np
import structlog
from numpy.typing import NDArray

from geometry.sampling import SurfaceSamples
from schemas.setup import setup_sha256
from service.artifacts import code_version
from service.kept import Kept
from service.packing import Known, pack, unpack
from service.prepare import Prepared
from service.sides import Side
from toolpath.counterexamples import Counterexamples
from toolpath.family import Target
from toolpath.plan import Plan
from toolpath.stock import StockMap
from verify.model import NcProgram, Proof
from zones.view import View

log = structlog.get_logger(__name__)

COMPUTING = ("numpy", "scipy", "numba", "shapely", "trimesh", "cadquery-ocp")  # whose versions a plan hangs on
PLAN, PROOF = "plan", "proof"
T = TypeVar("T")


class Resumed:
    """A job on its way, with what is kept of it.

    kept    : Kept
    ready   : Prepared
    checks  : of each zone
    samples : SurfaceSamples of the proof
    """

    def __init__(self, kept: Kept, ready: Prepared, checks: Sequence[Target], samples: SurfaceSamples) -> None:
        self.kept, self.ready, self.checks, self.samples = kept, ready, checks, samples

    def side(self, view: View, before: Sequence[Side], found: Counterexamples, make: Callable[[], Side]) -> Side:
        """The plan of an access: the one that is kept, else what ``make`` plans, which is kept then.

        before : the sides planned before it; found : what proofs found along it
        """
        if not self.kept:
            return make()
        name = _digest(self._prepared, view.id, *(s.name for s in before), pack(found))
        side = self._taken(PLAN, name, partial(_side, view))
        if side is None:
            side = make()
            left = None if side.left is None else (side.left.lattice, side.left.top, side.left.cover)
            self._keep(PLAN, name, (side.made, side.clearance, left))
        return replace(side, name=name)

    def proof(self, programs: Sequence[NcProgram], zone: NDArray[np.int32], make: Callable[[], Proof]) -> Proof:
        """The proof of programs: the one that is kept, else what ``make`` finds, which is kept then.

        zone : (n,) int32, who answers for each sample
        """
        if not self.kept:
            return make()
        texts = [(p.name, p.dialect, p.work_offset, p.turn, p.text) for p in programs]
        name = _digest(self._prepared, pack((texts, zone)))
        proof = self._taken(PROOF, name, partial(_checked, Proof))
        if proof is None:
            proof = make()
            self._keep(PROOF, name, proof)
        return proof

    def _taken(self, kind: str, name: str, build: Callable[[Any], T]) -> T | None:
        """What ``build`` makes of the value that is kept; None where none is, or one that it makes nothing of."""
        data = self.kept.get(kind, name)
        if data is None:
            return None
        try:
            found = build(unpack(data, self._known))
        except (ValueError, KeyError, TypeError, IndexError) as error:
            log.warning("what was kept cannot be read", kind=kind, error=f"{type(error).__name__}: {error}")
            self.kept.drop(kind, name)
            return None
        self.kept.took(kind)
        return found

    def _keep(self, kind: str, name: str, value: object) -> None:
        try:
            done = self.kept.put(kind, name, pack(value, self._known))
        except TypeError as error:  # a class that ``service.packing`` does not know: no reason for a job to fail
            log.warning("cannot be kept for another attempt", kind=kind, error=str(error))
            return
        if not done:
            log.warning("could not be kept for another attempt", kind=kind)

    @cached_property
    def _known(self) -> Known:
        tools = {f.tool.id: f.tool for v in self.ready.views for f in v.fields.values()}
        return Known({"ZoneArea": {z.id: z for z in self.ready.zones}, "ToolBody": tools})

    @cached_property
    def _prepared(self) -> str:
        """Digest of the job as prepared here."""
        mesh, first = self.ready.part.mesh, self.ready.samples
        told: list[str | NDArray[Any]] = [code_version(), _computing(), setup_sha256(self.ready.setup)]
        told += [mesh.vertices, mesh.faces, first.points, first.normals]
        for v in self.ready.views:
            told += [v.id, v.rotation]
        for z, c in zip(self.ready.zones, self.checks, strict=True):
            told += [z.id, z.access, z.tool.id, z.tips, z.samples, c.points, c.normals, c.tips]
        return _digest(*told, self.samples.points, self.samples.normals)


def _side(view: View, value: Any) -> Side:
    made, clearance, left = value
    return Side(view, _checked(Plan, made), clearance, None if left is None else StockMap(*left))


def _checked(kind: type[T], value: Any) -> T:
    if not isinstance(value, kind):
        raise TypeError(f"a {type(value).__name__} is no {kind.__name__}")
    return value


def _digest(*told: str | bytearray | NDArray[Any]) -> str:
    """SHA-256 over texts, bytes and arrays, each with its length before it, hex."""
    digest = hashlib.sha256()
    for one in told:
        data: Any = one.encode() if isinstance(one, str) else one
        if isinstance(one, np.ndarray):
            data = np.ascontiguousarray(one).reshape(-1).view(np.uint8).data
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()


def _computing() -> str:
    """What computes: interpreter, processor as kernels are compiled for it, versions of libraries."""
    found = [sys.version, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()]
    for name in COMPUTING:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} none")
    return "\n".join(found)


__all__ = ["Resumed"]
