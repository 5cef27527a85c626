"""The plan of an access, and the frame of a proof."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.mesh import F64
from geometry.part import Part
from geometry.sampling import SurfaceSamples
from toolpath.planning.job_plan import Plan
from toolpath.stock.stock_map import StockMap
from verify.model import Proof
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


__all__ = ["ProofFrame", "AccessPlan", "in_setup_frame"]
