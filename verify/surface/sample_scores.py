"""Proved samples, and their figures by zone and by face."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.mesh import F64
from geometry.sampling import SurfaceSamples
from verify.model import FaceProof, ProofSetup, ScoredSamples, ZoneProof

RAY_ERROR = 1e-6
BOOL = NDArray[np.bool_]


def proved_samples(residual: F64, setup: ProofSetup) -> BOOL:
    """Samples within the budget of the setup.

    residual : (n,) float64, mm, rest material on the normal of each sample

    Returns (n,) bool.
    """
    left = residual - setup.stock_allowance
    return np.asarray((left >= -setup.gouge_tolerance - RAY_ERROR) & (left <= setup.scallop_height + RAY_ERROR))


def zone_proofs(scored: ScoredSamples, residual: F64, proved: BOOL, setup: ProofSetup,
                zone_ids: Sequence[str]) -> dict[str, ZoneProof]:
    """The figures of every zone over the samples it claims.

    residual : (n,) float64, mm left on the samples; proved : (n,) bool
    """
    out = {}
    for k, name in enumerate(zone_ids, 1):
        own = np.flatnonzero(scored.zone == k)
        if len(own) == 0:
            out[name] = ZoneProof(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            continue
        area = scored.samples.area[own]
        left = _left(residual[own], area, setup.stock_allowance)
        total, good = float(area.sum()), float(area[proved[own]].sum())
        out[name] = ZoneProof(*left, _deepest(residual[own]), total, good, good / total)
    return out


def face_proofs(samples: SurfaceSamples, residual: F64, reached: BOOL, proved: BOOL,
                setup: ProofSetup) -> dict[int, FaceProof]:
    """The figures of every face that has samples, by face number.

    samples  : SurfaceSamples, n of them
    residual : (n,) float64, mm left on the normal, not above the reach of the proof
    reached  : (n,) bool, whether any feed move removed material from the normal of the sample
    proved   : (n,) bool

    Notes
    -----
    A sample is uncut where no feed move reaches it and more stands than the budget allows. A face on which the blank
    has its final shape is neither cut nor uncut.
    """
    uncut = ~reached & (residual - setup.stock_allowance > setup.scallop_height + RAY_ERROR)
    order = np.argsort(samples.face, kind="stable")
    numbers, first = np.unique(samples.face[order], return_index=True)
    out = {}
    ends = [*first[1:].tolist(), len(order)]
    for number, a, b in zip(numbers.tolist(), first.tolist(), ends[:len(first)], strict=True):
        own = order[a:b]
        area = samples.area[own]
        total, good = float(area.sum()), float(area[proved[own]].sum())
        out[number] = FaceProof(number, total, *_left(residual[own], area, setup.stock_allowance),
                                _deepest(residual[own]), float(area[uncut[own]].sum()), good,
                                good / total if total > 0 else 0.0)
    return out


def _left(residual: F64, area: F64, allowance: float) -> tuple[float, float, float]:
    """Median, 99th percentile by area and maximum of rest material over the allowance, mm; deeper cuts count 0."""
    left = np.maximum(residual - allowance, 0.0)
    p50, p99 = _percentiles(left, area, np.array([0.5, 0.99]))
    return float(p50), float(p99), float(left.max())


def _percentiles(values: F64, weight: F64, shares: F64) -> F64:
    """Values (n,) at shares (k,) of their weight (n,), (k,) float64; equal weights give the usual percentiles."""
    if np.ptp(weight) <= 0.0 or weight.sum() <= 0.0:
        return np.asarray(np.percentile(values, 100.0 * shares))
    order = np.argsort(values, kind="stable")
    middle = np.cumsum(weight[order]) - 0.5 * weight[order]
    return np.asarray(np.interp(shares, (middle - middle[0]) / (middle[-1] - middle[0]), values[order]))


def _deepest(residual: F64) -> float:
    """Deepest cut into the part, mm."""
    return max(float(-residual.min()), 0.0)
