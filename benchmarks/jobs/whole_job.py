"""Whole jobs from a box, ours beside a plan nobody optimised: proof, time, air, retracts, tool changes, engagement.

    python benchmarks/jobs/whole_job.py [PART/AXES ...] [--plan ours|baseline] [--spacing MM] [--engaged DEG]
        [--out out/whole_job] [--table]

Parts: the demo, a gap of 0.8 mm, a closed pocket, a strut impeller; axes 3 (upright) and 5 (table A/C, A -30 to 110
degrees). Each is planned and proved in a process of its own, with the feeds of its setup; what it gave is a line of
``rows.jsonl`` in the folder, with a digest of the sources it was made with. ``baseline`` is the plan of
``baseline_plan.py``, which stays as it was committed; its lines in ``benchmarks/jobs/whole_job_rows`` were made then,
and again with the feeds of ours where these changed.
``--table`` prints the newest line of each. Times and moves are those the proof simulated; air is all time but that of
moves which take stock. A move takes stock where it takes a line of the proof's stock, and lines stand 0.15 mm apart, so
a skin that a finishing pass takes off a wall meets few of them and much of the pass counts as air; ``--spacing`` says
how far apart they are to be. ``--engaged`` bounds the engaged angle of all tools of 1.5 mm and more; such jobs have a
table of their own.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from benchmarks.five_axis.five_axis_gain import MACHINE  # noqa: E402
from benchmarks.five_axis.five_axis_sweep import SOURCES  # noqa: E402
from benchmarks.jobs.parts_table import Stages  # noqa: E402
from benchmarks.reach.family_score import digest_of  # noqa: E402

ROWS = ROOT / "benchmarks" / "jobs" / "whole_job_rows"
PARTS: dict[str, dict[str, Any]] = {
    "demo:0": {}, "narrow:1": {}, "mixed_linear:0": {"walls": 2, "connections": 1}, "impeller:4": {}}
AXES = {"3": None, "5": MACHINE}
BOUNDED = 1.5  # mm, diameter of the least tool that --engaged bounds: thinner ones have no room for arcs in their slots
STOCK = {"kind": "box", "margin_mm": 1.0, "uncertainty_mm": 0.5}
HEAD = ("part", "axes", "plan", "state", "left mm²", "min", "air min", "air", "retracts", "changes", "cut m",
        "engaged max / p99 deg", "gouge mm", "s by stage")


def planned(part: str, axes: str, plan: str, folder: Path, spacing: float | None = None,
            engaged: float | None = None) -> dict[str, Any]:
    """Make, plan and prove one part: plain data.

    spacing : mm between lines of the proof's stock, where not its own;  engaged : degrees, as ``--engaged`` has it
    """
    from benchmarks.jobs import baseline_plan
    from examples.demo import demo_setup
    from examples.family.recipes import make_part
    from geometry.errors import CamError
    from schemas.setup import Setup
    from service import pipeline
    from toolpath.planning.job_plan import Plan, plan_job

    if spacing is not None:
        usual = pipeline.proof_setup
        pipeline.proof_setup = lambda *a, **k: replace(usual(*a, **k), line_spacing=spacing)
    recipe, seed = part.split(":")
    made = make_part(int(seed), recipe, **PARTS[part])
    step, _, _ = made.write(folder)
    setup = {**(demo_setup() if recipe == "demo" else made.setup), "stock": STOCK}
    if AXES[axes] is not None:
        setup["machine"] = AXES[axes]
    for tool in setup["tools"] if engaged is not None else ():
        if tool["diameter_mm"] >= BOUNDED:
            tool["max_engagement_deg"] = engaged
    stages = Stages()

    def plain(*given: Any, keeper: Any, **named: Any) -> Plan:
        """The baseline as the chain calls it today; it is planned in one go."""
        del keeper
        return baseline_plan.plan_job(*given, **named)

    facts = {"part": part, "axes": axes, "plan": plan, "spacing": spacing, "engaged_limit": engaged}
    try:
        report = pipeline.plan(step, Setup.model_validate(setup), folder / "job", stages,
                            planner=plain if plan == "baseline" else plan_job)
    except CamError as refusal:
        return facts | {"state": "error", "code": refusal.code, "message": refusal.message}
    met = [t["engagement_deg"] | {"id": t["id"]} for t in report["tools"] if t["engagement_deg"]]
    return facts | {
        "state": report["state"], "findings": dict(report["finding_counts"]), "reach": report["reach_coverage"],
        "coverage": report["coverage"], "left": sum(x["area_mm2"] for x in report["remainder"]),
        "gouge": report["gouge_max_mm"], "faces": report["part"]["faces"], "zones": len(report["zones"]),
        "seconds": report["machining_time_s"], "time": report["time"],
        "cut_mm": report["proof"]["cutting_length_mm"],
        "engaged": [max((e[k] for e in met), default=0.0) for k in ("max", "p99")], "engaged_by_tool": met,
        "steps": len(report["steps"]), "stages": {k: round(v, 1) for k, v in stages.seconds.items()},
        "processor": {k: round(v, 1) for k, v in stages.busy.items()}}


def run(part: str, axes: str, plan: str, limit: float | None, spacing: float | None,
        engaged: float | None) -> dict[str, Any]:
    """One part in a process of its own."""
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        try:
            done = subprocess.run([sys.executable, __file__, "--one", part, axes, plan, scratch, str(spacing or ""),
                                   str(engaged or "")],
                                  capture_output=True, text=True, timeout=limit)
            lines = done.stdout.splitlines()
            row = json.loads(lines[-1]) if done.returncode == 0 and lines else {
                "part": part, "axes": axes, "plan": plan, "state": "error", "message": done.stderr[-400:]}
        except subprocess.TimeoutExpired:
            row = {"part": part, "axes": axes, "plan": plan, "state": "error", "message": f"over {limit:g} s"}
    return row | {"wall": round(time.perf_counter() - begun, 1)}


def cells(row: dict[str, Any]) -> list[str]:
    """One line of the table."""
    if row["state"] == "error":
        return [row["part"], row["axes"], row["plan"], f"error: {row.get('message', '')[:80]}",
                *["-"] * (len(HEAD) - 4)]
    kinds, t = ", ".join(f"{n} {k}" for k, n in sorted(row["findings"].items())), row["time"]
    return [row["part"], row["axes"], row["plan"], row["state"] + (f": {kinds}" if kinds else ""), f"{row['left']:.0f}",
            f"{row['seconds'] / 60:.1f}", f"{t['in_air_s'] / 60:.1f}", f"{100 * t['in_air_s'] / row['seconds']:.1f} %",
            str(t["retracts"]), str(t["tool_changes"]), f"{1e-3 * row['cut_mm']:.2f}",
            " / ".join(f"{x:.0f}" for x in row["engaged"]), f"{row['gouge']:.4f}",
            " ".join(f"{k} {v:.0f}" for k, v in row["stages"].items())]


def table(rows: list[dict[str, Any]]) -> None:
    """The newest line of each part, axes and plan; after ours what is saved against the baseline."""
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD))
    bounded = {(r["part"], r["axes"]): r for r in rows if r.get("engaged_limit") and r["state"] != "error"}
    rows = [r for r in rows if not r.get("engaged_limit")]
    newest = {(r["part"], r["axes"], r["plan"], r.get("spacing")): r for r in rows}
    spacings = sorted({key[3] for key in newest}, key=lambda s: s or 1.0, reverse=True)
    for part, axes, spacing in [(p, a, s) for p in PARTS for a in AXES for s in spacings]:
        pair = [newest.get((part, axes, plan, spacing)) for plan in ("baseline", "ours")]
        for row in pair:
            if row is not None:
                print("| " + " | ".join(cells(row)) + " |")
        if all(r is not None and r["state"] != "error" for r in pair):
            was, now = pair
            assert was is not None and now is not None
            apart = "" if spacing is None else f", lines {spacing:g} mm apart"
            print(f"\n{part} {axes} axes{apart}: total time {1 - now['seconds'] / was['seconds']:+.1%} saved, air "
                  f"{1 - now['time']['in_air_s'] / was['time']['in_air_s']:+.1%} saved\n")
    if bounded:
        head = ("part", "axes", "limit deg", "state", "min", "max / p99 deg by tool")
        print(f"\nWith a limit of the engaged angle:\n\n| {' | '.join(head)} |\n|" + "---|" * len(head))
    for (part, axes), row in bounded.items():
        by = ", ".join(f"{e['id']} {e['max']:.0f} / {e['p99']:.0f}" for e in row["engaged_by_tool"])
        kinds = ", ".join(f"{n} {k}" for k, n in sorted(row["findings"].items()))
        print(f"| {part} | {axes} | {row['engaged_limit']:g} | {row['state']}{': ' + kinds if kinds else ''} | "
              f"{row['seconds'] / 60:.1f} | {by} |")


def growth(rows: list[dict[str, Any]]) -> None:
    """How processor seconds of our plans grow with faces and with metres of cutting: exponents over jobs."""
    newest = {(r["part"], r["axes"]): r for r in rows if r["plan"] == "ours" and r["state"] != "error"
              and r.get("spacing") is None and not r.get("engaged_limit") and "processor" in r}
    if len(newest) < 3:
        return
    names = [*dict.fromkeys(k for r in newest.values() for k in r["processor"]), "all"]
    print(f"\nExponents of processor seconds over {len(newest)} jobs, and what they miss at most:\n\n"
          "| stage | seconds | with faces | with metres of cutting |\n|---|---|---|---|")
    for name in names:
        took = np.array([sum(r["processor"].values()) if name == "all" else r["processor"].get(name, 0.0)
                         for r in newest.values()])
        line = [f"{took.min():.1f} to {took.max():.1f}"]
        for size in ("faces", "cut_mm"):
            x, y = np.log([r[size] for r in newest.values()]), np.log(np.maximum(took, 0.1))
            fit = np.polynomial.Polynomial.fit(x, y, 1).convert().coef
            line.append(f"{fit[1]:.2f} (times {np.exp(np.abs(y - fit[0] - fit[1] * x).max()):.1f})")
        print(f"| {name} | {' | '.join(line)} |")


def main() -> None:
    """Run what is asked for and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("jobs", nargs="*", help="such as demo:0/3; all where none is given")
    parser.add_argument("--plan", choices=("ours", "baseline"), default="ours")
    parser.add_argument("--out", type=Path, default=ROWS)
    parser.add_argument("--limit", type=float)
    parser.add_argument("--spacing", type=float)
    parser.add_argument("--engaged", type=float)
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--one", nargs=6, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        spacing, engaged = (float(text) if text else None for text in args.one[4:])
        print(json.dumps(planned(*args.one[:3], Path(args.one[3]), spacing, engaged)))
        return
    args.out.mkdir(parents=True, exist_ok=True)
    kept = args.out / "rows.jsonl"
    jobs = args.jobs or [f"{p}/{a}" for p in PARTS for a in AXES]
    for part, axes in [job.split("/") for job in jobs] if not args.table else ():
        row = {"sources": digest_of(SOURCES)} | run(part, axes, args.plan, args.limit, args.spacing, args.engaged)
        with kept.open("a") as out:
            out.write(json.dumps(row) + "\n")
        print(f"{part}/{axes} {args.plan}: {row['state']} {row['wall']} s", flush=True)
    if kept.exists():
        known = [json.loads(line) for line in kept.read_text().splitlines()]
        table(known)
        growth(known)


if __name__ == "__main__":
    main()
