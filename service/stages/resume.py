"""What a second attempt at a job takes over from the first: accesses that were planned, acts of a plan, and proofs.

Reading, zones and the samples of the proof are made again, and so are programs, for they follow from the plans. What
is taken over is named by a digest of all it came from:

    plan    the job as prepared here, the access, the plans before it, what proofs found along it
    acts    the same; what a plan has come to that is still under way, the newest of it alone
    proof   the job as prepared here, the very texts that were proved, who answers for each sample

The job as prepared has its setup, our sources, the versions of the libraries that compute and the kind of processor in
it, and part, zones and samples bit by bit: a worker on which any of them is another finds no plan of the other's. So a
job that was taken up again ends with the bytes of one that nothing happened to.
"""

from __future__ import annotations

import hashlib
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from importlib.metadata import PackageNotFoundError, version
from operator import itemgetter
from typing import Any, TypeVar

import llvmlite.binding as llvm
import numpy as np
import structlog
from numpy.typing import NDArray

from geometry.sampling import SurfaceSamples
from service.checkpoint_store import Kept
from service.serialization import Known, pack, unpack
from service.stages.access_plan import AccessPlan
from service.stages.preparation import Prepared
from service.version import code_version
from toolpath.counterexamples import Counterexamples
from toolpath.passes.pass_family import Target
from toolpath.plan_checkpoint import NOTHING, Keeper, PlanNow
from toolpath.planning.job_plan import Plan
from toolpath.stock.stock_map import StockMap
from verify.model import NcProgram, Proof
from zones.reach.access_view import View

log = structlog.get_logger(__name__)

KERNEL_WHEELS = ("cadquery-ocp", "cadquery-ocp-novtk")  # an environment holds one of them
COMPUTING = ("numpy", "scipy", "numba", "shapely", "trimesh", *KERNEL_WHEELS)  # whose versions a plan depends on
PLAN, ACTS, PROOF = "plan", "acts", "proof"
ACTS_EVERY_S = 15.0  # how often a plan under way is kept at most
ACTS_PAUSE = 60.0  # and not for so many times as long as that took the last time
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

    def access_plan(self, view: View, before: Sequence[AccessPlan], found: Counterexamples,
                    make: Callable[[Keeper], AccessPlan]) -> AccessPlan:
        """The plan of an access: the one that is kept, else what ``make`` plans, which is kept then.

        before : plans of the accesses before it; found : what proofs found along it
        make   : given who keeps the plan while it is under way
        """
        if not self.kept:
            return make(NOTHING)
        name = _digest(self._prepared, view.id, *(s.name for s in before), pack(found))
        planned = self.taken(PLAN, name, partial(_access_plan, view))
        if planned is None:
            planned = make(_UnderWay(self, name))
            stock = planned.left
            left = None if stock is None else (stock.lattice, stock.top, stock.cover)
            if self.keep(PLAN, name, (planned.plan, planned.clearance, left)):
                self.kept.drop(ACTS, name)
        return replace(planned, name=name)

    def proof(self, programs: Sequence[NcProgram], zone: NDArray[np.int32], make: Callable[[], Proof]) -> Proof:
        """The proof of programs: the one that is kept, else what ``make`` finds, which is kept then.

        zone : (n,) int32, who answers for each sample
        """
        if not self.kept:
            return make()
        texts = [(p.name, p.dialect, p.work_offset, p.turn, p.text) for p in programs]
        name = _digest(self._prepared, pack((texts, zone)))
        proof = self.taken(PROOF, name, partial(_checked, Proof))
        if proof is None:
            proof = make()
            self.keep(PROOF, name, proof)
        return proof

    def taken(self, kind: str, name: str, build: Callable[[Any], T],
              count: Callable[[T], int] = lambda _: 1) -> T | None:
        """What ``build`` makes of the value that is kept; None where none is, or one that it makes nothing of.

        count : as how many that is told
        """
        data = self.kept.get(kind, name)
        if data is None:
            return None
        try:
            found = build(unpack(data, self._known))
        except (ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
            log.warning("what was kept cannot be read", kind=kind, error=f"{type(error).__name__}: {error}")
            self.kept.drop(kind, name)
            return None
        self.kept.took(kind, count(found))
        return found

    def keep(self, kind: str, name: str, value: object) -> bool:
        """Keep a value for another attempt; False where that could not be done."""
        try:
            done = self.kept.put(kind, name, pack(value, self._known))
        except TypeError as error:  # a class that ``service.serialization`` does not know: no reason for a job to fail
            log.warning("cannot be kept for another attempt", kind=kind, error=str(error))
            return False
        if not done:
            log.warning("could not be kept for another attempt", kind=kind)
        return done

    @cached_property
    def _known(self) -> Known:
        tools = {f.tool.id: f.tool for v in self.ready.views for f in v.fields.values()}
        return Known({"ZoneArea": {z.id: z for z in self.ready.zones}, "ToolBody": tools})

    @cached_property
    def _prepared(self) -> str:
        """Digest of the job as prepared here."""
        mesh, first = self.ready.part.mesh, self.ready.samples
        told: list[str | NDArray[Any]] = [code_version(), _computing(), self.ready.inputs.sha256]
        told += [mesh.vertices, mesh.faces, first.points, first.normals]
        for v in self.ready.views:
            told += [v.id, v.rotation]
        for z, c in zip(self.ready.zones, self.checks, strict=True):
            told += [z.id, z.access, z.tool.id, z.tips, z.samples, c.points, c.normals, c.tips]
        return _digest(*told, self.samples.points, self.samples.normals)


class _UnderWay(Keeper):
    """Keeps a plan of an access while it is made, now and then, each time instead of the time before."""

    def __init__(self, resumed: Resumed, name: str) -> None:
        self.resumed, self.name = resumed, name
        self.next = time.monotonic() + ACTS_EVERY_S

    def taken(self, use: Callable[[PlanNow], T]) -> T | None:
        """See ``Keeper``; told is how many workingsteps were made."""
        found = self.resumed.taken(ACTS, self.name, lambda v: (use(_checked(PlanNow, v)), len(v.steps)), itemgetter(1))
        return None if found is None else found[0]

    def done(self, now: Callable[[], PlanNow]) -> None:
        """Keep it where the time for that has come."""
        begun = time.monotonic()
        if begun >= self.next:
            self.resumed.keep(ACTS, self.name, now())
            ended = time.monotonic()
            self.next = ended + max(ACTS_EVERY_S, ACTS_PAUSE * (ended - begun))


def _access_plan(view: View, value: Any) -> AccessPlan:
    plan, clearance, left = value
    return AccessPlan(view, _checked(Plan, plan), clearance, None if left is None else StockMap(*left))


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
