"""The view file of a job for the page: part, remainder, deviation, track of the tool and findings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.errors import CamError
from geometry.mesh_queries.keyed_nearest import KeyedPoints
from geometry.part import Part
from geometry.sampling import SurfaceSamples
from geometry.tool_body import ToolBody
from service.delivery.result_files import Files
from service.report.report import REMAINDER_FLOOR_MM2
from service.stages.access_plan import ProofFrame
from service.stages.job_part import JobPart
from service.stages.preparation import Prepared
from service.stages.proof_samples import Score
from service.version import VERSION
from service.viewer.view_file import Chunk, write_view
from service.viewer.view_mesh import GRID as MESH_GRID
from service.viewer.view_mesh import LEFT_UNIT, Judged, edge_chunk, facets_of, mesh_chunks, top_of
from service.viewer.view_paths import AXIS_UNIT, COARSE, ToolTrack, path_chunks, track_of
from service.viewer.view_paths import GRID as PATH_GRID
from service.viewer.view_stock import stock_chunk
from verify.checks.program_sequence import FramedProgram, read_all
from verify.model import NcProgram, Proof, ProofSetup
from verify.program.program import Program
from zones.model import Decomposition
from zones.reach.access_view import turned_samples
from zones.remainder.remainder import RemainderEntry

VIEW_NAME = "view.bin"
VIEW_VERSION = 2
ARC = 10  # chords of a quarter circle in the profile of a tool
EDGE_SPACING = 0.4  # mm
NO_HOLDER = 30.0  # mm of shank that are drawn where no holder is known
I64 = NDArray[np.int64]


def plan_view(ready: Prepared, frame: ProofFrame, scored: Score, zone: NDArray[np.int32], uncut: NDArray[np.bool_],
              remainder: Sequence[RemainderEntry], proof: Proof, programs: Sequence[NcProgram], read: Sequence[Program],
              setup: ProofSetup, report: Mapping[str, Any]) -> Files:
    """The view file of a planned job, as ``service.delivery.result_files`` takes it.

    scored, proof, setup : of the last plan, the proof in ``frame``
    programs, read : of the last plan, as texts and as the proof has read them
    zone     : (n,) int32, index: zone that answers for each sample, from 1; 0 for none
    uncut    : (n,) bool, samples that stay uncut
    remainder : the same by region and reason, as ``service.report.report.job_report`` returns it
    report   : of the job, places in the setup frame. Where the file cannot be made, its notes get a sentence

    The view of an unproved job shows no program.
    """
    return _or_none(report, f"{VIEW_NAME}, and preview.png, which is drawn from it,",
                    lambda: _plan_view(ready, frame, scored, zone, uncut, remainder, proof, programs, read, setup,
                                       report))


def _plan_view(ready: Prepared, frame: ProofFrame, scored: Score, zone: NDArray[np.int32], uncut: NDArray[np.bool_],
               remainder: Sequence[RemainderEntry], proof: Proof, programs: Sequence[NcProgram],
               read: Sequence[Program], setup: ProofSetup, report: Mapping[str, Any]) -> Files:
    zones, entries = report["zones"], report["remainder"]
    label = np.where(zone > 0, zone.astype(np.int64) - 1, len(zones) + len(entries))
    label[uncut] = len(zones) + _entries(scored.samples.subset(uncut), remainder, len(entries))
    names = [{"zone": z["id"]} for z in zones] + [{"remainder": k} for k in range(len(entries))] + [{"other": True}]
    framed = read_all(programs, frame.part, ready.inputs.bodies, setup, 0, lambda _share: None, read)
    track = track_of(framed, programs, frame.rotation, report["steps"])
    return _file(ready, ready.decomposition, frame.into(scored.samples, ready.views[0]), frame, label, names, proof,
                 setup, track, framed, report, open_=report["state"] == "proved")


def verification_view(job: JobPart, frame: ProofFrame, samples: SurfaceSamples, proof: Proof,
                      programs: Sequence[NcProgram], setup: ProofSetup, report: Mapping[str, Any], entry: I64,
                      program: Program) -> Files:
    """The view file of a verification. The program is the user's own, so the view shows all of its track.

    samples : of the proof, in ``frame``
    report  : of the verification, places in the setup frame
    entry   : (n,) int64, index: entry of the remainder of each sample, -1 for none
    program : the only one of ``programs``, as it was read
    """
    def made() -> Files:
        read = read_all(programs, frame.part, job.inputs.bodies, setup, 0, lambda _share: None, [program])
        track = track_of(read, programs, frame.rotation)
        count = len(report["remainder"])
        names: list[dict[str, Any]] = [*({"remainder": k} for k in range(count)), {"other": True}]
        label = np.where(entry >= 0, entry, count)
        return _file(job, Decomposition((), (), ()), samples, frame, label, names, proof, setup, track, read, report,
                     open_=True)

    return _or_none(report, VIEW_NAME, made)


def _or_none(report: Mapping[str, Any], names: str, made: Callable[[], Files]) -> Files:
    """The file, or none and a note in the report, so that no job fails because of its view."""
    try:
        return made()
    except CamError as error:
        report["proof"]["notes"].append(f"{names} could not be made: {error.message}")
        return {}


def _entries(s: SurfaceSamples, remainder: Sequence[RemainderEntry], count: int) -> I64:
    """Entry of the remainder for each uncut sample, (r,) int64, index; ``count`` for none.

    The entry is that of the nearest sample of the same face that has one.
    """
    kept = [i.samples for i in remainder if i.area >= REMAINDER_FLOOR_MM2]
    sampled = [(k, i) for k, i in enumerate(kept[:count]) if i is not None and len(i)]
    if not sampled:
        return np.full(len(s), count, np.int64)
    of = np.repeat([k for k, _ in sampled], [len(i) for _, i in sampled])
    near = KeyedPoints(np.concatenate([i.face for _, i in sampled]).astype(np.int64),
                       np.concatenate([i.points for _, i in sampled]))
    row = near.nearest(s.face.astype(np.int64), s.points)[:, 0]
    return np.where(row >= 0, of[row], count)


def _file(job: JobPart, d: Decomposition, samples: SurfaceSamples, frame: ProofFrame, label: I64,
          names: Sequence[Mapping[str, Any]], proof: Proof, setup: ProofSetup, track: ToolTrack,
          read: Sequence[FramedProgram], report: Mapping[str, Any], *, open_: bool) -> Files:
    part = job.part
    here = turned_samples(samples, frame.rotation.T)
    judged = Judged(here, label, proof.residual - setup.stock_allowance, np.asarray(proof.program >= 0),
                    setup.scallop_height, setup.gouge_tolerance)
    facets = facets_of(part, judged)
    lowest = [np.minimum(track.start, track.end).min(axis=0)] if len(track.end) else []
    low = np.floor(np.min([part.bounds[0], *lowest], axis=0))
    seconds = round(float(track.ended[-1]), 3 if open_ else 0) if len(track.ended) else 0
    mesh, finer = mesh_chunks(facets, low)
    path, longer, steps, grid = path_chunks(track, low, open_=open_)
    chunks: list[Chunk] = [*mesh, edge_chunk(part, low, EDGE_SPACING), *path]
    if len(track.end):
        chunks.append(stock_chunk(read, frame.part, job.inputs.bodies, setup, frame, open_=open_))
    chunks += [*finer, *longer]
    head = {
        "version": VIEW_VERSION, "made_by": VERSION, "kind": "plan" if "zones" in report else "verify",
        "state": report["state"], "withheld": not open_, "labels": report.get("labels", {}),
        "low_mm": low.tolist(), "mesh_grid_mm": MESH_GRID, "path_grid_mm": grid, "left_unit_mm": LEFT_UNIT,
        "axis_unit": AXIS_UNIT, "bounds_mm": part.bounds.tolist(),
        "budget_mm": {"scallop": setup.scallop_height, "gouge": setup.gouge_tolerance,
                      "allowance": setup.stock_allowance},
        "labelled": list(names), "zones": [_zone(z) for z in report.get("zones", ())],
        "walls": [_named(part, w.id, w.faces) for w in d.walls],
        "connections": [_named(part, c.id, c.faces) | {"walls": list(c.walls)} for c in d.connections],
        "remainder": [{k: e[k] for k in ("reason", "area_mm2", "faces", "would_need", "tool_at_hand", "why_left",
                                         "at_mm")} for e in report.get("remainder", ())],
        "tools": [tool_shape(t) for t in job.inputs.bodies], "steps": steps,
        "programs": list(track.names), "seconds": seconds,
        "findings": [_finding(f, track, open_) for f in report["findings"]], "found": report["finding_counts"],
        **_minded(report),
        "facts": {k: report.get(k) for k in ("coverage", "reach_coverage", "machining_time_s", "gouge_max_mm",
                                             "complete")},
        "counts": {"facets": len(facets.corners), "moves": len(track.end)},
    }
    return {VIEW_NAME: ("view", "", None, write_view(head, chunks))}


def _minded(report: Mapping[str, Any]) -> dict[str, Any]:
    """Cautions, what the proof takes for granted, and the other warnings and notes."""
    cautions = [{k: c[k] for k in ("kind", "message", "remedy", "subjects", "at_mm")}
                for c in report.get("warnings", ())]
    known = {f"{c['message']}; {c['remedy']}" for c in cautions}
    return {"cautions": cautions, "assumed": list(report["proof"].get("assumed", ())),
            "notes": [*(w for w in report["part"]["warnings"] if w not in known), *report["proof"]["notes"]]}


def _zone(z: Mapping[str, Any]) -> dict[str, Any]:
    return {"id": z["id"], "tool": z["tool"], "strategy": z["strategy"], "form": z["form"], "profile": z["profile"],
            "area_mm2": z["area_mm2"], "faces": z["faces"], "coverage": z.get("coverage"),
            "scallop_mm": z.get("scallop_mm"), "machining_time_s": z.get("machining_time_s")}


def _named(part: Part, name: str, faces: Sequence[int]) -> dict[str, Any]:
    return {"id": name, "faces": [int(f) for f in faces], "at_mm": top_of(part, faces)}


def _finding(f: Mapping[str, Any], track: ToolTrack, open_: bool) -> dict[str, Any]:
    """A finding of the report with its time and the position of the tool at that time."""
    keep = {k: f[k] for k in ("kind", "message", "program", "line", "zone", "face", "point", "depth", "limit", "count")}
    # the place of a gouge is on the part; the tool is below it
    stand = track.stand(f["program"], f["line"], f.get("tip") or f.get("point"),
                        0.0 if f.get("tip") or f["kind"] != "gouge" else f["depth"])
    if stand is None:
        return keep | {"time_s": None, "step": None, "tip_mm": None, "axis": None}
    # an unproved job shows whole seconds, in which a tool moves far: its place is on the coarse grid of such tracks
    grid, digits = (PATH_GRID, 3) if open_ else (COARSE, 0)
    return keep | {"time_s": round(stand.seconds, digits), "step": stand.step,
                   "tip_mm": [round(grid * round(v / grid), 3) + 0.0 for v in stand.tip.tolist()],
                   "axis": [round(v, 6) + 0.0 for v in stand.axis.tolist()]}


def tool_shape(tool: ToolBody) -> dict[str, Any]:
    """A tool assembly as profiles of its bodies: points (radius, height above the tip), mm, from the tip up."""
    cutter = [[round(r, 5), round(z, 5)] for r, z in tool.cutting_profile(ARC)]
    neck, shank = 0.5 * tool.neck_diameter, 0.5 * tool.shank_diameter
    bodies = [{"kind": "cutting part", "profile": cutter}]
    if tool.neck_length > tool.flute_length:
        bodies.append({"kind": "neck", "profile": [[neck, tool.flute_length], [neck, tool.neck_length]]})
    end = max(tool.neck_length, tool.flute_length)
    top = tool.stickout if tool.holder else tool.stickout + NO_HOLDER
    bodies.append({"kind": "shank", "profile": [[shank, end], [shank, top]]})
    z, holder = tool.stickout, []
    for h in tool.holder:
        holder += [[0.5 * h.diameter, z], [0.5 * h.diameter_top, z + h.length]]
        z += h.length
    if holder:
        bodies.append({"kind": "holder", "profile": holder})
    cone = {"taper_deg": round(tool.taper_deg, 6)} if tool.taper > 0.0 else {}
    if tool.form:
        cone = {"profile_radius_mm": tool.profile_radius, "taper_deg": round(tool.taper_deg, 6)}
    return {"id": tool.id, "number": tool.number, "kind": tool.kind, "diameter_mm": tool.diameter, **cone,
            "bodies": bodies}


__all__ = ["VIEW_NAME", "VIEW_VERSION", "plan_view", "tool_shape", "verification_view"]
