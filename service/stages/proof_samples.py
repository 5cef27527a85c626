"""The samples of the proof, and the zone that answers for each of them.

The proof has samples of its own, denser than those that zones are built of. A sample goes to the zone of a
nearby planning sample of the same face and form, if the tool of that zone can touch it by its exact reach. The planner
measures its passes at the same places by its own formula (``toolpath.stock.residual_map``). The proof measures there
what the program leaves that it reads back (``verify.surface.removal``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh_queries.keyed_nearest import KeyedPoints
from geometry.part import Part
from geometry.sampling import SurfaceSamples, joined, sample_surface, with_surface_normals
from service.stages.preparation import Prepared, machinable_triangles
from service.stages.sample_spacing import coarse_sets, coarse_spacing, split_where_zones_meet
from toolpath.passes.pass_family import FinishTarget
from toolpath.planning.job_plan import Plan
from zones.machinable_area import FORMS, form_codes
from zones.plan_view.regions import Labels
from zones.reach.access_view import View, turned_samples
from zones.reach.tip_field import touchable
from zones.zoning.zones import ZoneArea

PROOF_DENSITY = 100.0  # samples a mm²
PROOF_SEED = 20_011
NEIGHBOURS = 4
MIXED = -1  # in place of a zone: several zones, or some and none


@dataclass(frozen=True, eq=False)
class Score:
    """The samples of the proof and the zones that answer for them.

    samples : SurfaceSamples of the machinable area, frame of the first view
    labels  : their regions there
    zone    : (n,) int32, index: place of the zone in ``ready.zones``, from 1; 0 for none
    tips    : (n, 3) float64, mm, frame of the zone's view: an admissible tip that touches each claimed sample
    """

    samples: SurfaceSamples
    labels: Labels
    zone: NDArray[np.int32]
    tips: NDArray[np.float64]

    def checks(self, ready: Prepared) -> list[FinishTarget]:
        """For each zone, the places its passes are measured at: its samples, and the borders of its faces."""
        out = []
        for k, z in enumerate(ready.zones, start=1):
            mine, view = self.zone == k, ready.view(z.access)
            border = ready.samples.area[z.samples] == 0
            edge = z.samples[border]
            here = turned_samples(self.samples.subset(mine), view.rotation @ ready.views[0].rotation.T)
            covers = None if here.covers is None else np.concatenate([here.covers, np.zeros(len(edge))])
            out.append(FinishTarget(np.vstack([here.points, view.samples.points[edge]]),
                                    np.vstack([here.normals, view.samples.normals[edge]]),
                                    np.vstack([self.tips[mine], z.tips[border]]), PROOF_DENSITY ** -0.5, covers))
        return out

    def without(self, plan: Plan, zones: Sequence[ZoneArea]) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
        """Zone of every sample without those that the plan gave up, and a mark of these.

        The plan gives up a sample where a tool could touch it but no pass does by the plan's own measure, or where the
        zone was not finished at all. The sample then stands in the remainder, reason 'pass'.

        zones : as in ``Prepared``

        Returns (n,) int32, index: zone from 1, 0 for none; and (n,) bool, whether the plan gave the sample up.
        """
        zone, lost = self.zone.copy(), np.zeros(len(self.zone), np.bool_)
        plans = {p.zone.id: p for p in plan.zones}
        for k, z in enumerate(zones, start=1):
            mine = np.flatnonzero(self.zone == k)
            p = plans.get(z.id)
            lost[mine if p is None or p.step is None else mine[p.left[p.left < len(mine)]]] = True
        zone[lost] = 0
        return zone, lost


def score(ready: Prepared) -> Score:
    """Sample the machinable area for the proof and hand every sample to the zone whose tool can touch it.

    Samples stand ``PROOF_DENSITY`` a mm², fewer where ``service.stages.sample_spacing`` allows it.
    """
    first = ready.views[0]
    seen_from = ready.seen_from @ first.rotation.T
    triangles = machinable_triangles(first.part, ready.decomposition.seat, ready.inputs, seen_from)
    dense = _laid(ready, triangles, seen_from)
    zone, tips = np.zeros(len(dense), np.int32), np.zeros((len(dense), 3))
    own = first.label(dense)
    for view in ready.views:
        here = turned_samples(dense, view.rotation @ first.rotation.T)
        labels = own if view is first else view.label(here)
        mine = [(k, z) for k, z in enumerate(ready.zones, start=1) if z.access == view.id]
        owner = np.zeros(len(ready.samples), np.int32)
        for k, z in mine:
            owner[z.samples] = k
        wanted = _neighbours(view, owner, here)
        names = labels.names
        for k, z in mine:
            rows = np.flatnonzero((wanted == k) & (zone == 0))
            if not len(rows):
                continue
            _, whole, tip = touchable(view.fields[z.tool.id], here.points[rows], here.normals[rows], ready.lift)
            good = whole & ~z.below_plane(names[rows], here.points[rows, 2])
            zone[rows[good]], tips[rows[good]] = k, tip[good]
    return Score(dense, own, zone, tips)


def proof_samples(part: Part, triangles: NDArray[np.int64], spacing: Mapping[int, float]) -> SurfaceSamples:
    """The samples of a proof on some triangles of a part.

    triangles : (n,) int64, index
    spacing   : mm between the samples inside the faces that need few, by face number
                (``service.stages.sample_spacing.coarse_spacing``)

    Returns SurfaceSamples in the frame of the part, with the normals of the exact surface.
    """
    return with_surface_normals(_spread(part, triangles, spacing), part.mesh)


def _spread(part: Part, triangles: NDArray[np.int64], spacing: Mapping[int, float]) -> SurfaceSamples:
    rest = triangles[~np.isin(part.mesh.face_ids[triangles], list(spacing))]
    sets = [sample_surface(part.mesh, PROOF_DENSITY, seed=PROOF_SEED, triangles=rest)] if len(rest) else []
    return joined([*sets, *coarse_sets(part.mesh, triangles, spacing, PROOF_DENSITY**-0.5)])


def _laid(ready: Prepared, triangles: NDArray[np.int64], directions: NDArray[np.float64]) -> SurfaceSamples:
    """The samples of the proof in the frame of the first view.

    triangles  : (k,) int64, index of the triangles of the machinable area
    directions : (d, 3) float64, dimensionless, unit vectors the area is seen from
    """
    part = ready.views[0].part
    laid = _spread(part, triangles, coarse_spacing(part, ready.inputs, directions))
    return with_surface_normals(split_where_zones_meet(laid, ready.samples, ready.zones, PROOF_DENSITY**-0.5),
                                part.mesh)


def _neighbours(view: View, owner: NDArray[np.int32], dense: SurfaceSamples) -> NDArray[np.int32]:
    """Zone of the nearest planning sample of the same face and form that has a zone.

    owner : (m,) int32, index: zone of the planning samples, from 1; 0 for none
    dense : in the frame of the view
    """
    key, wanted = (s.face.astype(np.int64) * len(FORMS) + form_codes(s.normals) for s in (view.samples, dense))
    size = 1 + int(max(key.max(initial=0), wanted.max(initial=0)))
    least, most = np.full(size, len(owner) + 1, np.int32), np.zeros(size, np.int32)
    np.minimum.at(least, key, owner)
    np.maximum.at(most, key, owner)
    # where all samples of a key have one zone, the nearest has it too
    table = np.where(least < most, MIXED, most)
    out, among = table[wanted], table[key] == MIXED
    mixed = out == MIXED
    if mixed.any():
        points, own = view.samples.points, owner[among]
        near = KeyedPoints(key[among], points[among], points).nearest(wanted[mixed], dense.points[mixed], NEIGHBOURS)
        owners = np.where(near >= 0, own[near], 0)
        out[mixed] = owners[np.arange(len(owners)), np.argmax(owners > 0, axis=1)]
    return out
