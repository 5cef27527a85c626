"""What a page shows of a job, made once when the job ends: part, remainder, deviation, way of the tool, findings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.errors import CamError
from geometry.mesh_queries.keyed_nearest import KeyedPoints
from geometry.sampling import SurfaceSamples
from geometry.tool_body import ToolBody
from service.delivery.result_files import Files
from service.report.report import REMAINDER_FLOOR_MM2
from service.stages.access_plan import ProofFrame
from service.stages.preparation import Prepared
from service.stages.proof_samples import Score
from service.version import VERSION
from service.viewer.view_file import Chunk, write_view
from service.viewer.view_mesh import GRID as MESH_GRID
from service.viewer.view_mesh import LEFT_UNIT, Judged, edge_chunk, facets_of, mesh_chunks, top_of
from service.viewer.view_paths import AXIS_UNIT, COARSE, ToolTrack, path_chunks, way_of
from service.viewer.view_paths import GRID as PATH_GRID
from service.viewer.view_stock import stock_chunk
from verify.checks.program_sequence import Reading, read_all
from verify.model import NcProgram, Proof, ProofSetup
from zones.reach.access_view import turned_samples
from zones.remainder.remainder import Remainder

VIEW_NAME = "view.bin"
VIEW_VERSION = 2
ARC = 10  # chords of a quarter circle in the profile of a tool
EDGE_SPACING = 0.4  # mm
NO_HOLDER = 30.0  # mm of shank that are drawn where no holder is known
I64 = NDArray[np.int64]


def plan_view(ready: Prepared, frame: ProofFrame, scored: Score, zone: NDArray[np.int32], rest: NDArray[np.bool_],
              stays: Sequence[Remainder], proof: Proof, programs: Sequence[NcProgram], setup: ProofSetup,
              report: Mapping[str, Any]) -> Files:
    """The view file of a planned job, as ``service.delivery.result_files`` takes it.

    scored, proof, setup : of the last plan, the proof in the frame of ``frame``; programs : its texts
    zone   : (n,) int32, row of the zone that answers for each sample, from 1; 0 for none
    rest   : (n,) bool, those that stay uncut; stays : why, as ``service.report.report.job_report`` has it
    report : whose places are in the setup frame; of a job that is not proved no program is given away.
             Where the file cannot be made its notes say so
    """
    return _or_none(report, f"{VIEW_NAME}, and preview.png, which is drawn from it,",
                    lambda: _plan_view(ready, frame, scored, zone, rest, stays, proof, programs, setup, report))


def _plan_view(ready: Prepared, frame: ProofFrame, scored: Score, zone: NDArray[np.int32], rest: NDArray[np.bool_],
               stays: Sequence[Remainder], proof: Proof, programs: Sequence[NcProgram], setup: ProofSetup,
               report: Mapping[str, Any]) -> Files:
    zones, entries = report["zones"], report["remainder"]
    label = np.where(zone > 0, zone.astype(np.int64) - 1, len(zones) + len(entries))
    label[rest] = len(zones) + _entries(scored.samples.subset(rest), stays, len(entries))
    names = [{"zone": z["id"]} for z in zones] + [{"remainder": k} for k in range(len(entries))] + [{"other": True}]
    read = read_all(programs, frame.part, ready.inputs.bodies, setup, 0, lambda _share: None)
    way = way_of(read, programs, frame.rotation, report["steps"])
    return _file(ready, frame.into(scored.samples, ready.views[0]), frame, label, names, proof, setup, way, read,
                 report, open_=report["state"] == "proved")


def verification_view(ready: Prepared, frame: ProofFrame, samples: SurfaceSamples, proof: Proof,
                      programs: Sequence[NcProgram], setup: ProofSetup, report: Mapping[str, Any],
                      spindle_tool: int = 0) -> Files:
    """The view file of a verification; its program is that of whoever posted it, so its way is shown as it is.

    samples : of the proof, in the frame of ``frame``; report : whose places are in the setup frame
    """
    def made() -> Files:
        read = read_all(programs, frame.part, ready.inputs.bodies, setup, spindle_tool, lambda _share: None)
        way = way_of(read, programs, frame.rotation)
        label = np.zeros(len(samples), np.int64)
        return _file(ready, samples, frame, label, [{"other": True}], proof, setup, way, read, report, open_=True)

    return _or_none(report, VIEW_NAME, made)


def _or_none(report: Mapping[str, Any], what: str, made: Callable[[], Files]) -> Files:
    """The file, or none and a note in the report: no job is lost for its picture."""
    try:
        return made()
    except CamError as error:
        report["proof"]["notes"].append(f"{what} could not be made: {error.message}")
        return {}


def _entries(s: SurfaceSamples, stays: Sequence[Remainder], count: int) -> I64:
    """(r,) which entry of the remainder, of ``count``, each sample that stays is of: that of the nearest one asked."""
    kept = [i.samples for i in stays if i.area >= REMAINDER_FLOOR_MM2]
    asked = [(k, i) for k, i in enumerate(kept[:count]) if i is not None and len(i)]
    if not asked:
        return np.full(len(s), count, np.int64)
    of = np.repeat([k for k, _ in asked], [len(i) for _, i in asked])
    near = KeyedPoints(np.concatenate([i.face for _, i in asked]).astype(np.int64),
                       np.concatenate([i.points for _, i in asked]))
    row = near.nearest(s.face.astype(np.int64), s.points)[:, 0]
    return np.where(row >= 0, of[row], count)


def _file(ready: Prepared, samples: SurfaceSamples, frame: ProofFrame, label: I64, names: Sequence[Mapping[str, Any]],
          proof: Proof, setup: ProofSetup, way: ToolTrack, read: Sequence[Reading], report: Mapping[str, Any], *,
          open_: bool) -> Files:
    part, d = ready.part, ready.decomposition
    here = turned_samples(samples, frame.rotation.T)
    judged = Judged(here, label, proof.residual - setup.stock_allowance, np.asarray(proof.program >= 0),
                    setup.scallop_height, setup.gouge_tolerance)
    facets = facets_of(part, judged)
    low = np.floor(np.min([part.bounds[0], *([np.minimum(way.start, way.end).min(axis=0)] if len(way.end) else [])],
                          axis=0))
    mesh, finer = mesh_chunks(facets, low)
    path, longer, steps, grid = path_chunks(way, low, open_=open_)
    chunks: list[Chunk] = [*mesh, edge_chunk(part, low, EDGE_SPACING), *path]
    if len(way.end):
        chunks.append(stock_chunk(read, frame.part, ready.inputs.bodies, setup, frame, open_=open_))
    chunks += [*finer, *longer]
    head = {
        "version": VIEW_VERSION, "made_by": VERSION, "kind": "plan" if "zones" in report else "verify",
        "state": report["state"], "withheld": not open_, "labels": report.get("labels", {}),
        "low_mm": low.tolist(), "mesh_grid_mm": MESH_GRID, "path_grid_mm": grid, "left_unit_mm": LEFT_UNIT,
        "axis_unit": AXIS_UNIT, "bounds_mm": part.bounds.tolist(),
        "budget_mm": {"scallop": setup.scallop_height, "gouge": setup.gouge_tolerance,
                      "allowance": setup.stock_allowance},
        "labelled": list(names), "zones": [_zone(z) for z in report.get("zones", ())],
        "walls": [_named(ready, w.id, w.faces) for w in d.walls],
        "connections": [_named(ready, c.id, c.faces) | {"walls": list(c.walls)} for c in d.connections],
        "remainder": [{k: e[k] for k in ("reason", "area_mm2", "faces", "would_need", "tool_at_hand", "why_left",
                                         "at_mm")} for e in report.get("remainder", ())],
        "tools": [tool_shape(t) for t in ready.inputs.bodies], "steps": steps,
        "programs": list(way.names), "seconds": round(float(way.ended[-1]), 3 if open_ else 0) if len(way.ended) else 0,
        "findings": [_finding(f, way, open_) for f in report["findings"]], "found": report["finding_counts"],
        **_minded(report),
        "facts": {k: report.get(k) for k in ("coverage", "reach_coverage", "machining_time_s", "gouge_max_mm",
                                             "complete")},
        "counts": {"facets": len(facets.corners), "moves": len(way.end)},
    }
    return {VIEW_NAME: ("view", "", None, write_view(head, chunks))}


def _minded(report: Mapping[str, Any]) -> dict[str, Any]:
    """What is to be minded although it is no finding: cautions, and the sentences that are none of them."""
    cautions = [{k: c[k] for k in ("kind", "message", "remedy", "subjects", "at_mm")}
                for c in report.get("warnings", ())]
    known = {f"{c['message']}; {c['remedy']}" for c in cautions}
    return {"cautions": cautions,
            "notes": [*(w for w in report["part"]["warnings"] if w not in known), *report["proof"]["notes"]]}


def _zone(z: Mapping[str, Any]) -> dict[str, Any]:
    return {"id": z["id"], "tool": z["tool"], "strategy": z["strategy"], "form": z["form"], "profile": z["profile"],
            "area_mm2": z["area_mm2"], "faces": z["faces"], "coverage": z.get("coverage"),
            "scallop_mm": z.get("scallop_mm"), "machining_time_s": z.get("machining_time_s")}


def _named(ready: Prepared, name: str, faces: Sequence[int]) -> dict[str, Any]:
    return {"id": name, "faces": [int(f) for f in faces], "at_mm": top_of(ready.part, faces)}


def _finding(f: Mapping[str, Any], way: ToolTrack, open_: bool) -> dict[str, Any]:
    """A finding of the report with the time at which it happens, and how the tool stands then."""
    keep = {k: f[k] for k in ("kind", "message", "program", "line", "zone", "face", "point", "depth", "limit", "count")}
    # the place of a gouge is on the part; the tool is below it
    stand = way.stand(f["program"], f["line"], f.get("tip") or f.get("point"),
                      0.0 if f.get("tip") or f["kind"] != "gouge" else f["depth"])
    if stand is None:
        return keep | {"time_s": None, "step": None, "tip_mm": None, "axis": None}
    # seconds of a job that is not proved are whole, and in one a tool goes far: its place is on the grid of such ways
    grid, digits = (PATH_GRID, 3) if open_ else (COARSE, 0)
    return keep | {"time_s": round(stand.seconds, digits), "step": stand.step,
                   "tip_mm": [round(grid * round(v / grid), 3) + 0.0 for v in stand.tip.tolist()],
                   "axis": [round(v, 6) + 0.0 for v in stand.axis.tolist()]}


def tool_shape(tool: ToolBody) -> dict[str, Any]:
    """A tool assembly as profiles of its bodies: points (radius, height above the tip), mm, from below."""
    r, c = tool.radius, tool.corner_radius
    turn = np.linspace(0.0, 0.5 * np.pi, ARC + 1) if c > 0.0 else np.zeros(0)
    corner = [[round(float(v), 5) for v in p] for p in np.column_stack([r - c + c * np.sin(turn),
                                                                       c - c * np.cos(turn)])]
    cutter = [[0.0, 0.0], *(corner or [[r, 0.0]]), [r, tool.flute_length]]
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
    return {"id": tool.id, "number": tool.number, "kind": tool.kind, "diameter_mm": tool.diameter, "bodies": bodies}


__all__ = ["VIEW_NAME", "VIEW_VERSION", "plan_view", "tool_shape", "verification_view"]
