"""The life of one STEP file: read, zones, tool paths, programs, proof, report.

``plan`` runs the whole chain and writes its files, ``zones_only`` stops before the first pass, ``verify_program``
proves a program that may come from anywhere. Nothing is written as a program before the proof has read it and
found nothing.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from output.linuxcnc import write_linuxcnc
from output.model import StockBox, Workplan
from output.stepnc_aim import write_stepnc_aim
from output.stepnc_arm import write_stepnc_arm
from schemas.setup import Setup, setup_sha256
from service import reporting
from service.convert import tool_bodies
from service.materials import DEFAULT_MAX_FEED_MM_MIN, cutting_data
from service.prepare import Prepared, prepare
from service.preview import draw_preview
from service.scoring import score
from service.version import VERSION
from toolpath.plan import CutData, Plan, PlanSettings, plan_job
from toolpath.stock import StockMap
from verify.model import ProofSetup, ScoredSamples
from verify.prove import prove

Progress = Callable[[str, float], None]

RAMP_ANGLE = np.radians(3.0)
LINK_FEED = 3000.0  # mm/min, feed moves in air
STEP_DOWN = {"ball": 0.3, "bull": 0.3, "flat": 0.5}  # of the diameter
STOCK_STEP = 0.08  # mm, the planner's stock lattice; wider where that would take more than STOCK_CELLS
STOCK_CELLS = 4e6
ABOVE = 1.0  # mm between the height rapids may go down to and the clearance plane
PROGRAM_NAME = "program.linuxcnc.ngc"


def plan(part_path: Path, setup: Setup, out: Path, progress: Progress) -> dict[str, Any]:
    """Plan and prove a job and write its files into ``out``.

    Returns
    -------
    dict
        The report; ``report["state"]`` is 'proved' or 'unproved'. Programs and STEP-NC are written only where it
        is 'proved'.

    Raises
    ------
    CamError
        Wrong input, limits exceeded, or a bug.
    """
    out.mkdir(parents=True, exist_ok=True)
    ready = prepare(part_path, setup, progress)
    stock = planning_stock(ready)
    settings = plan_settings(ready, stock)
    scored = score(ready)
    dense = scored.samples
    made = plan_job(ready.zones, scored.checks(ready), ready.fields, cut_table(setup), stock, settings,
                    lambda f: progress("plan", 0.28 + 0.37 * f))
    progress("write", 0.66)
    work = workplan(ready, made, settings)
    program = write_linuxcnc(work) if made.steps else ""
    zone, given_up = scored.without(made, ready.zones)
    proof = prove([(PROGRAM_NAME, program)] if made.steps else [], ready.part, tool_bodies(setup), proof_setup(ready),
                  ScoredSamples(dense, zone), [z.id for z in ready.zones],
                  lambda f: progress("prove", 0.68 + 0.27 * f))
    progress("report", 0.96)
    report, rest = reporting.job_report(ready, made, proof, dense, zone, given_up)
    files: dict[str, tuple[str, str, bytes]] = {}
    if report["state"] == "proved":
        files[PROGRAM_NAME] = ("program", "linuxcnc", program.encode())
        files["job.stpnc"] = ("stepnc", "", write_stepnc_aim(work).encode())
        files["job.arm.stpnc"] = ("stepnc-arm", "", write_stepnc_arm(work).encode())
    files["zones.json"] = ("zones", "", _json(reporting.zones_document(report)))
    _preview(ready, made, report, dense.points[rest], out / "preview.png")
    files["preview.png"] = ("preview", "", (out / "preview.png").read_bytes())
    access = setup.access[0].id
    report["files"] = [{"name": name, "kind": kind, "access": access if kind == "program" else None,
                        "dialect": dialect or None, "sha256": hashlib.sha256(data).hexdigest()}
                       for name, (kind, dialect, data) in sorted(files.items())]
    for name, (_, _, data) in files.items():
        _write(out / name, data)
    _write(out / "report.json", _json(report))
    progress("done", 1.0)
    return report


def zones_only(part_path: Path, setup: Setup, progress: Progress) -> dict[str, Any]:
    """The dry check: walls, connections, channels, zones with their tools, and what stays out of reach.

    Raises
    ------
    CamError
        As ``plan``.
    """
    ready = prepare(part_path, setup, progress)
    out = reporting.dry_report(ready)
    progress("done", 1.0)
    return out


def verify_program(part_path: Path, setup: Setup, program_text: str, progress: Progress) -> dict[str, Any]:
    """Prove any program against the part: gouges, contacts, rapids and limits, and what it leaves.

    No zone answers for a sample here, so uncut area is a figure (coverage), not a finding.

    Raises
    ------
    CamError
        As ``plan``; ``ProgramError`` where the program cannot be read.
    """
    ready = prepare(part_path, setup, progress)
    dense = score(ready).samples
    proof = prove([("program", program_text)], ready.part, tool_bodies(setup), proof_setup(ready),
                  ScoredSamples(dense, np.zeros(len(dense), np.int32)), [], lambda f: progress("prove", 0.3 + 0.65 * f))
    progress("done", 1.0)
    return reporting.verification_report(ready, proof, dense)


def cut_table(setup: Setup) -> dict[str, CutData]:
    """Speeds, feeds and layer depths by tool id."""
    out = {}
    for tool in setup.tools:
        c = cutting_data(setup.material, tool, setup.machine)
        link = min(LINK_FEED, setup.machine.max_feed_mm_min or DEFAULT_MAX_FEED_MM_MIN)
        out[tool.id] = CutData(c.spindle_rpm, c.feed, c.plunge_feed, link, STEP_DOWN[tool.kind] * tool.diameter_mm)
    return out


def stock_corners(ready: Prepared) -> np.ndarray:
    """(2, 3) corners of the nominal stock, mm, uncertainty left out."""
    stock, bounds = ready.setup.stock, ready.part.bounds
    if stock.kind == "box" and stock.box_mm is not None:
        return np.array(stock.box_mm, dtype=np.float64)
    grown = np.array([bounds[0] - stock.margin_mm, bounds[1] + stock.margin_mm])
    grown[0, 2] = bounds[0, 2]
    return grown


def planning_stock(ready: Prepared) -> StockMap:
    """The stock the planner starts from: the largest the setup allows."""
    stock = ready.setup.stock
    lo, hi = stock_corners(ready)
    step = max(STOCK_STEP, float(np.sqrt(np.prod(hi[:2] - lo[:2]) / STOCK_CELLS)))
    if stock.kind == "box":
        return StockMap.box(ready.tree, lo - stock.uncertainty_mm, hi + stock.uncertainty_mm, step)
    return StockMap.around(ready.tree, ready.part.bounds, stock.margin_mm + stock.uncertainty_mm, step)


def plan_settings(ready: Prepared, stock: StockMap) -> PlanSettings:
    """Tolerances and heights of the plan."""
    q, ops = ready.setup.quality, ready.setup.operations
    tops = [stock.highest, float(ready.part.bounds[1, 2]) + q.stock_allowance_mm]
    tops.extend(f.box_mm[1][2] for f in ready.setup.fixtures)
    floor = float(np.ceil(10.0 * (max(tops) + ready.setup.clearance_mm.rapid + 0.1)) / 10.0)
    return PlanSettings(q.scallop_height_mm, q.chordal_tolerance_mm, q.stock_allowance_mm, ready.lift, floor + ABOVE,
                        floor, float(RAMP_ANGLE), ops.roughing, ops.finishing, ops.cut_direction != "conventional",
                        ops.cut_direction == "either")


def workplan(ready: Prepared, made: Plan, settings: PlanSettings) -> Workplan:
    """The plan as the writers want it."""
    setup = ready.setup
    used = {s.tool.id for s in made.steps}
    lo, hi = stock_corners(ready)
    comments = tuple(f"warning: {w}" for w in ready.warnings)
    return Workplan(setup.labels.get("order", "zonemill job"), made.steps,
                    tuple(t for t in tool_bodies(setup) if t.id in used), settings.clearance,
                    setup.access[0].work_offset, StockBox(lo, hi), reporting.material_name(setup), ready.part.sha256,
                    setup_sha256(setup), VERSION, dict(setup.labels), comments)


def proof_setup(ready: Prepared) -> ProofSetup:
    """The setup in the plain words of the proof."""
    s = ready.setup
    c, q = s.clearance_mm, s.quality
    box = stock_corners(ready) if s.stock.kind == "box" else None
    if box is not None:
        box = np.array([box[0] - s.stock.uncertainty_mm, box[1] + s.stock.uncertainty_mm])
    return ProofSetup(
        stock_kind=s.stock.kind, margin=s.stock.margin_mm, uncertainty=s.stock.uncertainty_mm, stock_box=box,
        fixtures=tuple(np.array(f.box_mm, dtype=np.float64) for f in s.fixtures), clearance_neck=c.neck,
        clearance_shank=c.shank, clearance_holder=c.holder, clearance_rapid=c.rapid,
        scallop_height=q.scallop_height_mm, gouge_tolerance=q.gouge_tolerance_mm,
        stock_allowance=q.stock_allowance_mm, ramp_angle=float(RAMP_ANGLE),
        rapid_feed=s.machine.rapid_mm_min or reporting.RAPID_MM_MIN, work_offset=s.access[0].work_offset,
        travel=None if s.machine.travel_mm is None else np.array(s.machine.travel_mm, dtype=np.float64),
        gauge_length={body.number: t.gauge_length_mm or 0.0 for t, body in zip(s.tools, tool_bodies(s), strict=True)},
        dogleg=s.machine.rapid_motion == "dogleg", max_feed=s.machine.max_feed_mm_min,
        max_rpm={body.number: min(limits) for t, body in zip(s.tools, tool_bodies(s), strict=True)
                 if (limits := [x for x in (t.max_rpm, s.machine.max_rpm) if x is not None])})


def _preview(ready: Prepared, made: Plan, report: dict[str, Any], stays: np.ndarray, path: Path) -> None:
    owner: dict[int, str] = {}
    for z in ready.zones:
        for f in z.faces:
            owner.setdefault(f, z.id)
    facts = {"state": report["state"], "coverage": f"{100 * report['coverage']:.1f} %",
             "of what is in reach": f"{100 * report['reach_coverage']:.1f} %",
             "machining time": f"{report['machining_time_s'] / 60:.0f} min"}
    title = ready.setup.labels.get("order") or "zonemill"
    draw_preview(ready.part, ready.decomposition, owner, made.steps, stays[:: max(1, len(stays) // 20_000)], path,
                 title, facts)


def _json(data: dict[str, Any]) -> bytes:
    return (json.dumps(data, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n").encode()


def _write(path: Path, data: bytes) -> None:
    """Write a file so that it is there whole or not at all."""
    partial = path.with_name(path.name + ".part")
    with open(partial, "wb") as f:
        f.write(data)
        f.flush()
        os.fsync(f.fileno())
    os.replace(partial, path)
