"""Seeded parts with walls 0.8 to 6 mm apart on five axes: how many are proved, and how much of what can be reached.

    python benchmarks/five_axis/five_axis_sweep.py [--seeds 0:200] [--out out/five_axis_sweep] [--limit 900]
    [--score-only]

Parts are of the recipe random with two or three walls, up to three connections and every channel's least gap in that
range, with their suggested tools; the machine is a table A/C (A -30 to 110 degrees). Each is planned and proved in a
process of its own; what others have written reads its files, as ``stepnc_family.py`` says, the form of AP238 going
round with the seeds. What a part gave is kept as a line of ``rows.jsonl`` in the folder, so a broken run goes on where
it stopped; a line holds a digest of the sources it was made with, and one made with others is told apart. A part that
ends in an error or over the limit counts as not proved. ``benchmarks/five_axis/five_axis_rows`` has those made so
far: go on there with ``--out``, see them with ``--score-only``.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from benchmarks.five_axis.five_axis_gain import MACHINE, silent  # noqa: E402
from benchmarks.reach.family_score import digest_of  # noqa: E402
from benchmarks.writing.stepnc_family import SCHEMAS as FORMS  # noqa: E402
from benchmarks.writing.stepnc_family import heard  # noqa: E402

SOURCES = ["geometry", "zones", "toolpath", "output", "verify", "schemas", "service", "examples"]
GAPS = (0.8, 6.0)  # mm
AIM, REACHED = 0.95, 0.98


def planned(seed: int, folder: Path) -> dict[str, Any]:
    """Make, plan and prove one part: plain data."""
    from examples.family.recipes import make_part
    from geometry.errors import CamError
    from schemas.setup import Setup
    from service import pipeline

    made = make_part(seed, "random", walls=2 + seed % 2, connections=seed % 4, gap=GAPS)
    step, _, _ = made.write(folder)
    gaps = sorted(round(c["gap_min"], 3) for c in made.truth["channels"])
    facts: dict[str, Any] = {"seed": seed, "gaps": gaps, "connections": len(made.truth["connections"])}
    form = list(FORMS)[seed % len(FORMS)]
    machine = {**MACHINE, "ap238": form, "restart_points": True}
    try:
        report = pipeline.plan(step, Setup.model_validate({**made.setup, "machine": machine}), folder / "job", silent)
    except CamError as refusal:
        return facts | {"state": "error", "code": refusal.code, "message": refusal.message}
    zones = report["zones"]
    return facts | {
        "state": report["state"], "findings": dict(report["finding_counts"]), "reach": report["reach_coverage"],
        "coverage": report["coverage"], "gouge": report["gouge_max_mm"], "zones": len(zones),
        "accesses": len({z["access"] for z in zones}),
        "flank": round(sum(z["area_mm2"] for z in zones if z["strategy"] == "flank"), 1),
        "minutes": round(sum(s["machining_time_s"] for s in report["steps"]) / 60.0, 1),
        "files": dict(zip(("iso14649", form, "linuxcnc"), heard(folder / "job", form, True), strict=True))}


def run(seed: int, limit: float) -> dict[str, Any]:
    """One part in a process of its own."""
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        try:
            done = subprocess.run([sys.executable, __file__, "--one", str(seed), scratch], capture_output=True,
                                  text=True, timeout=limit)
            lines = done.stdout.splitlines()
            row = json.loads(lines[-1]) if done.returncode == 0 and lines else {
                "seed": seed, "state": "error", "code": f"exit {done.returncode}", "message": done.stderr[-400:]}
        except subprocess.TimeoutExpired:
            row = {"seed": seed, "state": "error", "code": "time", "message": f"over {limit:g} s"}
    return row | {"seconds": round(time.perf_counter() - begun, 1)}


def score(rows: list[dict[str, Any]], sources: str) -> None:
    """Print what a set of rows comes to."""
    good = [r for r in rows if r["state"] == "proved" and r["reach"] >= REACHED]
    proved = [r for r in rows if r["state"] == "proved"]
    print(f"{len(rows)} parts, {sum(r['sources'] == sources for r in rows)} of them with these sources")
    print(f"states: {dict(Counter(r['state'] for r in rows))}")
    print(f"proved with reach_coverage >= {REACHED}: {len(good)} of {len(rows)}, "
          f"{100.0 * len(good) / len(rows):.1f} % (asked {100 * AIM:.0f} %)")
    for low, high in ((0.8, 1.2), (1.2, 2.0), (2.0, 3.5), (3.5, 6.0)):
        some = [r for r in rows if r.get("gaps") and low <= r["gaps"][0] < high]
        fine = sum(r in good for r in some)
        print(f"  least gap {low} to {high} mm: {fine} of {len(some)}")
    if proved:
        print(f"gouge of proved ones at most {max(r['gouge'] for r in proved):.4f} mm; seconds a part, median "
              f"{sorted(r['seconds'] for r in rows)[len(rows) // 2]:.0f}, most {max(r['seconds'] for r in rows):.0f}")
    read = [r for r in proved if "files" in r]
    if read:
        print(f"files of {len(read)} of them read by others, without complaint "
              f"{sum(all(said.startswith('ok') for said in r['files'].values()) for r in read)}")
    for r in rows:
        if r not in good:
            print(f"  seed {r['seed']}: {r['state']} {r.get('findings') or r.get('code', '')} "
                  f"reach {r.get('reach', float('nan')):.4f} {r.get('message', '')[:160]}")


def main() -> None:
    """Go on with the sweep and print its score."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="0:200")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "five_axis_sweep")
    parser.add_argument("--limit", type=float, default=900.0)
    parser.add_argument("--score-only", action="store_true")
    parser.add_argument("--one", nargs=2, metavar=("SEED", "DIR"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        print(json.dumps(planned(int(args.one[0]), Path(args.one[1]))))
        return
    first, last = (int(x) for x in args.seeds.split(":"))
    args.out.mkdir(parents=True, exist_ok=True)
    kept = args.out / "rows.jsonl"
    rows = {r["seed"]: r for r in map(json.loads, kept.read_text().splitlines())} if kept.exists() else {}
    for seed in range(first, last) if not args.score_only else ():
        if seed not in rows:
            rows[seed] = {"sources": digest_of(SOURCES)} | run(seed, args.limit)
            with kept.open("a") as out:
                out.write(json.dumps(rows[seed]) + "\n")
            print(f"{seed}: {rows[seed]['state']} {rows[seed]['seconds']} s", flush=True)
    if rows:
        score([rows[k] for k in sorted(rows)], digest_of(SOURCES))


if __name__ == "__main__":
    main()
