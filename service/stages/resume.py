"""What a second attempt at a job takes over from the first: plans of accesses, acts of an unfinished plan, and proofs.

The second attempt reads the part, builds zones and samples, and writes programs again. A value that it takes over is
named by a digest of everything it depends on:

    plan    the prepared job, the access, the plans before it, the counterexamples along it
    acts    the same; the newest state of a plan that is not finished
    proof   the prepared job, the texts that were proved, the zone of each sample

The prepared job covers the setup, the sources of this program, the versions of the computing libraries, the kind of
processor, and part, zones and samples bit by bit. A worker where any of them differs takes over nothing. So a job that
was interrupted ends with the same bytes as one that was not.
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
from toolpath.passes.pass_family import FinishTarget
from toolpath.plan_checkpoint import NOTHING, CheckpointKeeper, PlanSnapshot
from toolpath.planning.job_plan import Plan
from toolpath.stock.stock_map import StockMap
from verify.model import NcProgram, Proof
from zones.reach.access_view import View

log = structlog.get_logger(__name__)

KERNEL_WHEELS = ("cadquery-ocp", "cadquery-ocp-novtk")  # an environment holds one of them
COMPUTING = ("numpy", "scipy", "numba", "shapely", "trimesh", *KERNEL_WHEELS)  # libraries that change a plan
PLAN, ACTS, PROOF = "plan", "acts", "proof"
ACTS_EVERY_S = 15.0  # least time between two states of an unfinished plan that are kept
ACTS_PAUSE = 60.0  # the same, in times of how long keeping the last state took
T = TypeVar("T")


class Resumed:
    """A job with the plans and proofs that are kept of it.

    kept    : Kept, the store
    ready   : Prepared
    checks  : for each zone the places its passes are measured at
    samples : SurfaceSamples of the proof, in its frame
    """

    def __init__(self, kept: Kept, ready: Prepared, checks: Sequence[FinishTarget], samples: SurfaceSamples) -> None:
        self.kept, self.ready, self.checks, self.samples = kept, ready, checks, samples

    def access_plan(self, view: View, before: Sequence[AccessPlan], found: Counterexamples,
                    make: Callable[[CheckpointKeeper], AccessPlan]) -> AccessPlan:
        """The plan of an access: the kept one, else the one that ``make`` returns, which is then kept.

        before : plans of the accesses before it
        found  : counterexamples along it
        make   : plans the access, given the keeper of the unfinished plan
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
        """The proof of programs: the kept one, else the one that ``make`` returns, which is then kept.

        zone : (n,) int32, index: zone that answers for each sample, from 1; 0 for none
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
        """What ``build`` makes of a kept value; None where none is kept or ``build`` cannot read it.

        count : how many values the result counts as in the log of the job
        """
        data = self.kept.get(kind, name)
        if data is None:
            return None
        try:
            found = build(unpack(data, self._known))
        except (ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
            log.warning("a kept value cannot be read", kind=kind, error=f"{type(error).__name__}: {error}")
            self.kept.drop(kind, name)
            return None
        self.kept.took(kind, count(found))
        return found

    def keep(self, kind: str, name: str, value: object) -> bool:
        """Keep a value for another attempt; returns whether it is stored."""
        try:
            done = self.kept.put(kind, name, pack(value, self._known))
        except TypeError as error:  # a class that ``service.serialization`` does not know: no reason for a job to fail
            log.warning("a value cannot be kept for another attempt", kind=kind, error=str(error))
            return False
        if not done:
            log.warning("a value could not be stored for another attempt", kind=kind)
        return done

    @cached_property
    def _known(self) -> Known:
        tools = {f.tool.id: f.tool for v in self.ready.views for f in v.fields.values()}
        return Known({"ZoneArea": {z.id: z for z in self.ready.zones}, "ToolBody": tools})

    @cached_property
    def _prepared(self) -> str:
        """Digest of the prepared job."""
        mesh, first = self.ready.part.mesh, self.ready.samples
        parts: list[str | NDArray[Any]] = [code_version(), _computing(), self.ready.inputs.sha256]
        parts += [mesh.vertices, mesh.faces, first.points, first.normals]
        for v in self.ready.views:
            parts += [v.id, v.rotation]
        for z, c in zip(self.ready.zones, self.checks, strict=True):
            parts += [z.id, z.access, z.tool.id, z.tips, z.samples, c.points, c.normals, c.tips]
        return _digest(*parts, self.samples.points, self.samples.normals)


class _UnderWay(CheckpointKeeper):
    """Keeps the newest state of a plan of an access from time to time while it is made."""

    def __init__(self, resumed: Resumed, name: str) -> None:
        self.resumed, self.name = resumed, name
        self.next = time.monotonic() + ACTS_EVERY_S

    def taken(self, use: Callable[[PlanSnapshot], T]) -> T | None:
        """See ``CheckpointKeeper``; the result counts as the number of its workingsteps."""
        found = self.resumed.taken(ACTS, self.name, lambda v: (use(_checked(PlanSnapshot, v)), len(v.steps)),
                                   itemgetter(1))
        return None if found is None else found[0]

    def done(self, now: Callable[[], PlanSnapshot]) -> None:
        """Keep the state of the plan if it is time to."""
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


def _digest(*parts: str | bytearray | NDArray[Any]) -> str:
    """SHA-256 over texts, bytes and arrays, each with its length before it, hex."""
    digest = hashlib.sha256()
    for one in parts:
        data: Any = one.encode() if isinstance(one, str) else one
        if isinstance(one, np.ndarray):
            data = np.ascontiguousarray(one).reshape(-1).view(np.uint8).data
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()


def _computing() -> str:
    """Interpreter, processor features that kernels are compiled for, and versions of the computing libraries."""
    found = [sys.version, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()]
    for name in COMPUTING:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} none")
    return "\n".join(found)


__all__ = ["Resumed"]
