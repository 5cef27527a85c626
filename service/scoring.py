"""Which samples of the proof a zone answers for.

The proof has samples of its own, four times as dense as the planner's. Each is handed to the zone of a planning
sample of the same face and form near it, if that zone's tool can touch it: judged by the exact reach of the
tool, not by what the planner did.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.sampling import SurfaceSamples
from service.prepare import Prepared, machinable_samples
from toolpath.plan import Plan
from zones.reach import touchable
from zones.zoning import forms_of

PROOF_DENSITY = 100.0  # samples a mm²
PROOF_SEED = 20_011
NEIGHBOURS = 4


def proof_samples(ready: Prepared) -> SurfaceSamples:
    """Samples of the machinable area for the proof, ``PROOF_DENSITY`` a mm²."""
    return machinable_samples(ready.part, ready.decomposition, ready.setup, PROOF_DENSITY, PROOF_SEED)


def claims(ready: Prepared, plan: Plan | None, dense: SurfaceSamples) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Zone of every proof sample, and which ones the plan gave up.

    Returns
    -------
    zone     : (n,) int32, 0 for none, else the place of the zone in ``ready.zones`` from 1
    given_up : (n,) bool, a tool could touch it but the plan's own measure says no pass does
    """
    owner = np.zeros(len(ready.samples), np.int32)
    for k, z in enumerate(ready.zones, start=1):
        owner[z.samples] = k
    lost = np.zeros(len(ready.samples), np.bool_)
    for p in plan.zones if plan is not None else ():
        gone = p.zone.samples if p.step is None else p.zone.samples[p.left]
        lost[gone] = True
    zone, nearest = _neighbours(ready, owner, dense)
    for k, z in enumerate(ready.zones, start=1):
        mine = np.flatnonzero(zone == k)
        if not len(mine):
            continue
        _, whole, _ = touchable(ready.fields[z.tool.id], dense.points[mine], dense.normals[mine], ready.lift)
        zone[mine[~(whole & (dense.points[mine, 2] >= z.plane))]] = 0
    given_up = (zone > 0) & lost[nearest]
    zone[given_up] = 0
    return zone, given_up


def _neighbours(ready: Prepared, owner: NDArray[np.int32],
                dense: SurfaceSamples) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Zone of the nearest owned of a few planning samples of the same face and form, and the nearest of all."""
    zone = np.zeros(len(dense), np.int32)
    nearest = np.zeros(len(dense), np.int64)
    codes = {"level": 0, "shallow": 1, "steep": 2}
    key = ready.samples.face.astype(np.int64) * 3 + np.array([codes[f] for f in forms_of(ready.samples.normals)])
    wanted = dense.face.astype(np.int64) * 3 + np.array([codes[f] for f in forms_of(dense.normals)])
    order, dense_order = np.argsort(key, kind="stable"), np.argsort(wanted, kind="stable")
    for value in np.unique(wanted):
        rows = dense_order[slice(*np.searchsorted(wanted[dense_order], [value, value + 1]))]
        pool = order[slice(*np.searchsorted(key[order], [value, value + 1]))]
        if not len(pool):
            continue
        k = min(NEIGHBOURS, len(pool))
        _, near = cKDTree(ready.samples.points[pool]).query(dense.points[rows], k=k, workers=2)
        near = pool[near.reshape(len(rows), k)]
        nearest[rows] = near[:, 0]
        owners = owner[near]
        first = np.argmax(owners > 0, axis=1)
        zone[rows] = owners[np.arange(len(rows)), first]
    return zone, nearest
