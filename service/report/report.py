"""report.json and zones.json of a job, as plain dictionaries with the keys of the wire models."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.sampling import SurfaceSamples
from service.estimate.job_estimate import estimate_of
from service.report import approach_cones, tool_offers
from service.report.computed_ahead import ComputedAhead
from service.stages.cautions import MAX_TIMES, JobCaution
from service.stages.job_part import JobPart
from service.stages.preparation import Prepared
from service.version import VERSION
from toolpath.planning.job_plan import Plan
from toolpath.planning.zone_finishing import ZonePlan
from toolpath.tool_deflection import DeflectionEstimate
from toolpath.workingsteps import TrajectoryKind, Workingstep
from verify.model import Proof
from zones.plan_view.regions import Labels
from zones.remainder.reasons import Reason
from zones.remainder.remainder import RemainderEntry, explain
from zones.zoning.zones import ZoneArea, is_open

REMAINDER_FLOOR_MM2 = 0.005
PROPOSAL = ""  # the name of the proposal beside the ids of zones
ZONES_KEYS = ("part", "walls", "connections", "channels", "accesses", "mcz", "cutting_planes", "machinable_area_mm2",
              "machinable_by_role_mm2", "zones", "remainder", "proposal")


def r(value: float, digits: int = 4) -> float | None:
    """A number rounded for the wire; None where it is not finite."""
    return round(float(value), digits) + 0.0 if math.isfinite(value) else None


def faces(numbers: tuple[int, ...]) -> list[str]:
    """Face ids of face numbers."""
    return [f"F{n}" for n in numbers]


def zones_document(report: dict[str, Any]) -> dict[str, Any]:
    """The part of a report that is zones.json."""
    return {k: report[k] for k in ZONES_KEYS}


def _shape(ready: Prepared) -> dict[str, Any]:
    d = ready.decomposition
    return {
        "part": part_of(ready),
        "walls": [{"id": w.id, "faces": faces(w.faces), "sides": faces(w.sides), "thickness_mm": r(w.thickness, 3),
                   "z_mm": [r(w.z_bottom), r(w.z_top)]} for w in d.walls],
        "connections": [{"id": c.id, "walls": list(c.walls), "faces": faces(c.faces),
                         "z_mm": [r(c.z_bottom), r(c.z_top)]} for c in d.connections],
        "channels": [{"id": c.id, "walls": list(c.walls), "gap_min_mm": r(c.gap_min),
                      "at_mm": _place(ready, c.at)} for c in d.channels],
        "accesses": accesses_of(ready),
        "mcz": [{"access": m.access, "tool": m.tool, "area_mm2": r(m.area, 3),
                 "cutter_area_mm2": r(m.cutter_area, 3)} for m in ready.zoning.mcz],
        "cutting_planes": [{"access": p.access, "z_mm": r(p.height), "region": p.region, "tool": p.tool,
                            "reason": p.reason} for p in ready.zoning.planes],
    }


def part_of(job: JobPart) -> dict[str, Any]:
    """Facts about the part, with the warnings of the job."""
    part = job.part
    return {"faces": len(part.faces), "volume_mm3": r(part.volume, 3),
            "bbox_mm": [[r(v) for v in row] for row in part.bounds.tolist()],
            "unit": part.unit, "mesh_chord_mm": part.chord, "mesh_deviation_mm": r(part.deviation, 6),
            "triangles": len(part.mesh.faces), "warnings": list(job.warnings)}


def accesses_of(ready: Prepared) -> list[dict[str, Any]]:
    """The tool axes of a job, and the angles of the rotary axes for each."""
    machine, given = ready.inputs.rotary, {a.id for a in ready.inputs.accesses}
    out = []
    for v in ready.views:
        turn = None if machine is None else [r(a) for a in np.degrees(
            machine.words(machine.follow(v.direction[None], np.zeros(2))[0])).tolist()]
        out.append({"id": v.id, "axis": [r(x, 9) for x in v.direction.tolist()], "found": v.id not in given,
                    "rotary_deg": turn})
    return out


def _zone(ready: Prepared, zone: ZoneArea) -> dict[str, Any]:
    view = ready.view(zone.access)
    profile = zone.category.profile
    return {"id": zone.id, "kind": zone.kind, "profile": str(profile.type) if profile and profile.type else None,
            "level": str(profile.level) if profile else None, "profiles": _profiles(zone),
            "open": is_open(zone, view.fields[zone.tool.id], ready.samples.area),
            "region": zone.region, "merged": list(zone.merged),
            "form": str(zone.form), "faces": faces(zone.faces), "access": zone.access, "tool": zone.tool.id,
            "axis": [r(v, 9) for v in view.direction.tolist()], "depth_mm": [r(zone.top), r(zone.bottom)],
            "approach": _cone(ready, zone), "cutting_plane_mm": r(zone.plane),
            "area_mm2": r(float(ready.samples.area[zone.samples].sum()), 3),
            "strategy": {"steep": "waterline", "level": "planar_floor" if zone.tool.flat_radius > 0.0 else "zigzag",
                         "shallow": "zigzag"}[str(zone.form)],
            "patches": [{"face": f"F{p.face}", "area_mm2": r(p.area, 3), "whole": p.whole, "loops": len(p.loops)}
                        for p in ready.patches.get(zone.id, ())],
            "rejected": list(zone.rejected)}


def _cone(ready: Prepared, zone: ZoneArea) -> dict[str, Any] | None:
    """Approach cone of a zone: axis in the setup frame and half angle, degrees."""
    cone = approach_cones.cone_of(ready, zone)
    if cone is None:
        return None
    return {"axis": [r(v, 6) for v in cone.axis.tolist()], "half_angle_deg": r(math.degrees(cone.half_angle), 2),
            "resolution_deg": r(math.degrees(cone.resolution), 2)}


def _profiles(zone: ZoneArea) -> list[dict[str, Any]]:
    """The wall sides that give a zone its profile, the most complex first."""
    return [{"wall": s.wall, "profile": str(s.profile.type) if s.profile.type else None, "level": str(s.profile.level),
             "margin": r(s.profile.margin, 3), "closed": s.profile.closed, "bends": len(s.profile.bends)}
            for s in zone.category.sides]


def _place(ready: Prepared, at: tuple[float, float, float]) -> list[float | None]:
    """A point of the frame of the first access in the setup frame."""
    return [r(v) for v in ready.views[0].back(np.array(at)).tolist()]


def _remainder(ready: Prepared, items: list[RemainderEntry]) -> list[dict[str, Any]]:
    return [{"faces": faces(x.faces), "area_mm2": r(x.area, 3), "reason": x.reason, "would_need": x.would_need,
             "tool_at_hand": x.tool_at_hand or None, "why_left": x.why_left or None, "at_mm": _place(ready, x.at),
             "patches": _places(ready, x)} for x in items if x.area >= REMAINDER_FLOOR_MM2]


def _places(ready: Prepared, item: RemainderEntry) -> list[dict[str, Any]]:
    """The area of an entry on each face, and its box in the setup frame."""
    s = item.samples
    if s is None:
        return []
    points = ready.views[0].back(s.points)
    out = []
    for face in np.unique(s.face):
        mine = s.face == face
        box = [[r(v) for v in row] for row in (points[mine].min(axis=0).tolist(), points[mine].max(axis=0).tolist())]
        out.append({"face": f"F{face}", "area_mm2": r(float(s.area[mine].sum()), 3), "box_mm": box})
    return out


def _areas(ready: Prepared) -> dict[str, Any]:
    """Machinable area by the samples, in total and by the role of the faces."""
    face, area = ready.samples.face, ready.samples.area
    roles = np.array([ready.decomposition.face_role.get(int(f), "free") for f in range(int(face.max(initial=0)) + 1)])
    by_role = {str(k): r(float(area[roles[face] == k].sum()), 3) for k in sorted(set(roles[np.unique(face)].tolist()))}
    return {"machinable_area_mm2": r(float(area.sum()), 3), "machinable_by_role_mm2": by_role}


def _proposal(ready: Prepared) -> dict[str, Any]:
    return tool_offers.as_dict(ready.inputs, tool_offers.offers(ready))


def known_before_planning(ready: Prepared) -> ComputedAhead[dict[str, Any]]:
    """The entries of the zones by their ids, and the proposal under ``PROPOSAL``: they depend on no plan."""
    calls = {PROPOSAL: partial(_proposal, ready), **{z.id: partial(_zone, ready, z) for z in ready.zones}}
    return ComputedAhead(calls)


def dry_report(ready: Prepared) -> dict[str, Any]:
    """zones.json without a plan: the zones that the tools of the setup reach, and the remainder."""
    rest = ~ready.zoning.taken
    first = ready.views[0]
    with ComputedAhead({PROPOSAL: partial(_proposal, ready)}) as ahead:
        ahead.begin()
        items = explain(first.samples.subset(rest), first.labels.subset(rest), ready.views, ready.decomposition,
                        ready.lift, clear=ready.inputs.clearances)
        zones = [_zone(ready, z) for z in ready.zones]
        return {**_shape(ready), **_areas(ready), "zones": zones, "remainder": _remainder(ready, items),
                "proposal": ahead.value(PROPOSAL)}


def job_report(ready: Prepared, known: ComputedAhead[dict[str, Any]], made: Plan, proof: Proof, dense: SurfaceSamples,
               labels: Labels, zone: NDArray[np.int32], given_up: NDArray[np.bool_],
               cautions: Sequence[JobCaution] = ()) -> tuple[dict[str, Any], NDArray[np.bool_], list[RemainderEntry]]:
    """report.json without its files, the samples that stay uncut, and the remainder.

    Each sample is proved, or a zone answers for it (then it is a finding), or it stands in the remainder.

    known    : of ``known_before_planning``, for the same zones
    dense    : SurfaceSamples of the proof, n of them, frame of the first view
    labels   : their regions
    zone     : (n,) int32, index: zone that answers for each sample, from 1; 0 for none
    given_up : (n,) bool: no pass touches the sample by the plan's own measure, although a tool could
    cautions : for the machinist

    Returns
    -------
    dict, (n,) bool, list
        The report; whether each sample stays uncut; the remainder by region and reason, with its smallest entries
    """
    proved = np.asarray(proof.proved, dtype=np.bool_)
    rest = ~proved & (zone == 0)
    items = explain(dense.subset(rest), labels.subset(rest), ready.views, ready.decomposition, ready.lift,
                    given_up[rest], clear=ready.inputs.clearances)
    area = dense.area
    total, done = float(area.sum()), float(area[proved].sum())
    # area that a tool of the setup can touch: proved, with a zone, or left by the passes although a tool reaches it
    reach = float(area[proved | (zone > 0)].sum()) + sum(i.area for i in items if i.reason == Reason.PASS)
    coverage = done / total if total > 0 else 0.0
    remainder = _remainder(ready, items)
    unmet = [*_unmet(ready, made, coverage, remainder),
             *(of_job("load", f"{c.message}; past {MAX_TIMES:g} times the limit", r(c.stays or 0.0) or 0.0, c.limit)
               for c in cautions if c.grave)]
    findings = [*(f.as_dict() for f in proof.findings), *unmet]
    plans = {p.zone.id: p for p in made.zones}
    steps = {s.id: s for s in made.steps}
    report = {
        **_shape(ready), **_areas(ready), "state": "unproved" if findings else "proved", "complete": not remainder,
        "labels": dict(ready.inputs.labels),
        "inputs": inputs_of(ready), "estimate": estimate_of(ready).as_dict(),
        "zones": [_planned(ready, z, known.value(z.id), plans.get(z.id), steps, proof) for z in ready.zones],
        "steps": [_step(s) for s in made.steps], "remainder": remainder,
        "proposal": known.value(PROPOSAL), "findings": findings,
        "finding_counts": counted(proof, unmet), "coverage": r(coverage, 6),
        "reach_coverage": r(done / reach, 6) if reach > 0 else 0.0,
        "machining_time_s": r(proof.spent.seconds, 1),
        "time": time_of(proof, max(cut.link_feed for cut in ready.inputs.cut_table.values())),
        "gouge_max_mm": r(proof.gouge_max, 5), "proof": {
            "samples": len(dense), "error_bound_mm": proof.error_bound, "stock_line_spacing_mm": proof.line_spacing,
            "cutting_length_mm": r(proof.cutting_length, 1), "notes": list(proof.notes), "support": support_of(proof),
            "assumed": [a.as_dict() for a in proof.assumed]},
        "warnings": [c.as_dict() for c in cautions],
        "tools": _tools(ready, proof, made.steps), "deviation": deviation(proof), "machined": None, "files": [],
        "version": VERSION,
    }
    return report, rest, items


def _unmet(ready: Prepared, made: Plan, coverage: float, remainder: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Findings about the job as a whole: nothing can be cut, or less than the setup demands."""
    if not made.steps:
        would: dict[str, Any] = next((x["would_need"] for x in remainder if x["would_need"].get("diameter_mm")), {})
        return [of_job("nothing_cut", "no tool of the setup can cut any of the requested area", would_need=would)]
    return too_little(coverage, ready.inputs.quality.coverage_min)


def too_little(coverage: float, coverage_min: float) -> list[dict[str, Any]]:
    """A finding where the coverage is below the least one of the setup."""
    if coverage >= coverage_min:
        return []
    return [of_job("coverage", f"coverage {coverage:.4f} is below coverage_min {coverage_min:g}",
                    round(coverage, 6), coverage_min)]


def counted(proof: Proof, unmet: list[dict[str, Any]]) -> dict[str, int]:
    """Number of findings of each kind, including those beyond the list."""
    return dict(sorted((Counter(proof.counts) + Counter(f["kind"] for f in unmet)).items()))


def of_job(kind: str, message: str, depth: float = 0.0, limit: float = 0.0, **more: Any) -> dict[str, Any]:
    """A finding about the job as a whole: it has no place and no line."""
    return {"kind": kind, "message": message, "depth": depth, "limit": limit, "program": "", "line": 0, "zone": None,
            "face": None, "point": None, "count": 1, "area": 0.0, **more}


def _planned(ready: Prepared, zone: ZoneArea, entry: dict[str, Any], plan: ZonePlan | None,
             steps: dict[str, Workingstep], proof: Proof) -> dict[str, Any]:
    """The entry of a zone with what plan and proof add to it."""
    out = dict(entry)
    result = proof.zones.get(zone.id)
    mine = [s for s in steps.values() if s.zone == zone.id]
    out["scallop_mm"] = {"requested": ready.inputs.quality.scallop_height_mm, "p50": None, "p99": None, "max": None}
    out["passes"], out["cutting_length_mm"], out["machining_time_s"], out["steps"] = 0, 0.0, 0.0, []
    if plan is not None:
        out.update(strategy=plan.strategy, side_step_mm=r(plan.side_step), passes=plan.passes,
                   rejected=[*out["rejected"], *plan.rejected])
        if plan.step is not None and not mine:  # a step of other zones finishes it
            out.update(step=plan.step, steps=[plan.step])
    if mine:
        out.update(cutting_length_mm=r(sum(map(cutting_length, mine)), 1), step=mine[0].id,
                   machining_time_s=r(sum(s.seconds for s in mine), 1), steps=[s.id for s in mine])
    if result is not None:
        out["scallop_mm"] |= {"p50": r(result.scallop_p50, 5), "p99": r(result.scallop_p99, 5),
                              "max": r(result.scallop_max, 5)}
        out.update(gouge_mm=r(result.gouge, 5), coverage=r(result.coverage, 6),
                   proved_area_mm2=r(result.proved_area, 3))
    return out


def cutting_length(step: Workingstep) -> float:
    """Length of the cutting passes of a step, mm."""
    return float(sum(np.linalg.norm(np.diff(t.points, axis=0), axis=1).sum() for t in step.trajectories
                     if t.motion is TrajectoryKind.CUT))


def _step(step: Workingstep) -> dict[str, Any]:
    return {"id": step.id, "name": step.name, "zone": step.zone, "tool": step.tool.id, "operation": step.operation,
            "strategy": step.strategy, "faces": faces(step.faces), "spindle_rpm": r(step.spindle_rpm, 1),
            "feed_mm_min": r(step.feed, 1), "side_step_mm": r(step.side_step),
            "cutting_length_mm": r(cutting_length(step), 1), "machining_time_s": r(step.seconds, 1),
            "points": int(sum(len(t.points) for t in step.trajectories)), "fresh_cutter": step.fresh,
            **_bend(step.bend)}


def _bend(bend: DeflectionEstimate | None) -> dict[str, Any]:
    """Deflection of a tool in a step, and the share of its feed that the plan keeps because of it."""
    if bend is None:
        return {"deflection_mm": None, "deflection_limit_mm": None, "feed_share": None}
    return {"deflection_mm": r(bend.deflection, 5), "deflection_limit_mm": r(bend.limit, 5),
            "feed_share": r(bend.share)}


def _tools(ready: Prepared, proof: Proof, steps: Sequence[Workingstep]) -> list[dict[str, Any]]:
    out, lives = [], {t.id: t.life_min for t in ready.inputs.tools}
    for f in ready.views[0].fields.values():
        t = f.tool
        mine = [s for s in steps if s.tool.id == t.id]
        bent = [s.bend.deflection for s in mine if s.bend is not None]
        engaged = proof.engaged.get(t.number)
        relieved = t.neck_diameter < 2.0 * t.widest_radius
        slender = (t.neck_length if relieved else t.stickout) / max(t.neck_diameter, 1e-9)
        out.append({"id": t.id, "number": t.number, "minutes_in_cut": r(proof.minutes.get(t.number, 0.0), 3),
                    "metres_in_cut": r(0.001 * sum(map(cutting_length, mine)), 3),
                    "life_min": lives[t.id], "cutters": sum(s.fresh for s in mine) + bool(mine),
                    "slenderness": r(slender, 2), "deflection_mm": r(max(bent), 5) if bent else None,
                    "engagement_deg": None if engaged is None else
                    {"max": r(math.degrees(engaged.most), 2), "p99": r(math.degrees(engaged.p99), 2)},
                    "neck_clearance_mm": r(t.neck_clearance(ready.inputs.clearances.neck))})
    return out


def support_of(proof: Proof) -> dict[str, Any]:
    """Free height of thin walls where they are finished, over their thickness."""
    s = proof.support
    return {"walls": s.walls, "places": s.places, "most_ratio": r(s.most, 2), "limit_ratio": r(s.limit, 2),
            "places_over": s.over, "at_mm": None if s.at is None else [r(v) for v in s.at]}


def time_of(proof: Proof, link_feed: float | None = None) -> dict[str, Any]:
    """Shares of the machining time. link_feed : mm/min, of the links of a plan; None: a program of others."""
    t = proof.spent
    return {"in_cut_s": r(t.in_cut, 1), "in_air_s": r(t.seconds - t.in_cut, 1), "rapid_s": r(t.rapid, 1),
            "retracts": t.retracts, "tool_changes": t.tool_changes, "link_feed_mm_min": link_feed}


def deviation(proof: Proof) -> list[dict[str, Any]]:
    """The figures of a proof by face, in the order of the faces."""
    return [{"face": f"F{n}", "area_mm2": r(f.area, 3),
             "residual_mm": {"p50": r(f.left_p50, 5), "p99": r(f.left_p99, 5), "max": r(f.left_max, 5)},
             "gouge_mm": r(f.gouge, 5), "uncut_mm2": r(f.uncut, 3), "coverage": r(f.coverage, 6)}
            for n, f in sorted(proof.faces.items())]


def inputs_of(job: JobPart) -> dict[str, str]:
    """Hashes of part, setup and, where it is a file, blank."""
    out = {"part_sha256": job.part.sha256, "setup_sha256": job.inputs.sha256}
    return out if job.blank.solid is None else {**out, "stock_sha256": job.blank.solid.sha256}
