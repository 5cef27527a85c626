"""Parts of the family in five dialects, planned for doglegs above a table, and for straight rapids.

    python benchmarks/jobs/dogleg_parts.py [SEED ...] [--out out/dogleg] [--five] [--table]

Seeds 0 to 35 are the first of the deep parts, 36 and 37 parts of ``mixed_linear`` and 38 and 39 of ``mixed_radial``, of
two walls and one connection. Each is planned twice: for a machine whose rapids are doglegs, with a table under the
part, a spindle nose and a change position, and for one whose rapids are straight, with none of these. Both plans are
proved in all five dialects. ``--five`` plans the demo on five axes instead.

Each plan runs in a process of its own. Its figures are a line of ``rows.jsonl`` in the folder, with a digest of the
sources, and a plan that has such a line is not made again. ``--table`` only prints the newest lines.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from benchmarks.five_axis.five_axis_sweep import SOURCES  # noqa: E402
from benchmarks.reach.family_score import digest_of  # noqa: E402

COUNT, DEEP, EACH = 40, 36, 2
FIVE = -1  # in place of a seed: the demo on five axes
DIALECTS = ["linuxcnc", "fanuc", "haas", "siemens", "heidenhain"]
DOGLEG = {"rapid_motion": "dogleg", "nose_diameter_mm": 100.0, "change_position": [200.0]}
UNDER = -20.0  # mm, a table under parts that tools go right through, or that turn
PIVOTS = [[0.0, 0.0, -50.0], [0.0, 0.0, -50.0]]
HEAD = ("part", "doglegs: state", "straight: state", "coverage", "doglegs s", "straight s", "ratio", "planning s")


def planned(seed: int, dogleg: bool) -> dict[str, Any]:
    """Draw, plan and prove one part in all dialects: plain data."""
    from examples.family.deep import deep_part
    from examples.family.recipes import make_part
    from geometry.errors import CamError
    from schemas.setup import Setup
    from service import pipeline

    with tempfile.TemporaryDirectory() as folder:
        if 0 <= seed < DEEP:
            step, setup = deep_part(seed).write(folder)
        elif seed == FIVE:
            step, _, setup = make_part(0, recipe="demo").write(folder)
        else:
            recipe = "mixed_linear" if seed < DEEP + EACH else "mixed_radial"
            step, _, setup = make_part((seed - DEEP) % EACH, recipe=recipe, walls=2, connections=1).write(folder)
        raw = json.loads(setup.read_text())
        raw["machine"] = {**raw.get("machine", {}), "dialects": DIALECTS, "rapid_motion": "linear"}
        if dogleg:
            raw["machine"] |= {**DOGLEG, "table_z_mm": UNDER if seed < DEEP else 0.0}
        if seed == FIVE:
            raw["machine"] |= {"kind": "5-axis", "kinematics": "table-table-AC", "pivots_mm": PIVOTS}
        begun = time.perf_counter()
        try:
            report = pipeline.plan(step, Setup.model_validate(raw), Path(folder) / "job", lambda stage, share: None)
        except CamError as refusal:
            return {"state": "error", "message": f"{refusal.code}: {refusal}", "time": math.nan, "coverage": math.nan}
    return {"state": report["state"], "findings": [f["message"] for f in report["findings"][:4]],
            "coverage": report["coverage"], "time": report["time"]["in_cut_s"] + report["time"]["in_air_s"],
            "wall": round(time.perf_counter() - begun, 1)}


def run(seed: int, dogleg: bool) -> dict[str, Any]:
    """One plan in a process of its own."""
    one = f"{seed}:{'dogleg' if dogleg else 'straight'}"
    done = subprocess.run([sys.executable, __file__, f"--one={one}"], capture_output=True, text=True)
    lines = done.stdout.splitlines()
    row = json.loads(lines[-1]) if done.returncode == 0 and lines else {
        "state": "error", "message": done.stderr[-400:], "time": math.nan, "coverage": math.nan}
    return {"seed": seed, "dogleg": dogleg} | row


def table(rows: list[dict[str, Any]]) -> None:
    """The newest lines of each part, and how many are proved and longer by over 5 %."""
    newest: dict[int, dict[bool, dict[str, Any]]] = {}
    for row in rows:
        newest.setdefault(row["seed"], {})[row["dogleg"]] = row
    both = {seed: by for seed, by in sorted(newest.items()) if len(by) == 2}
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD))
    for seed, by in both.items():
        bent, straight = by[True], by[False]
        print(f"| {seed} | {_state(bent)} | {_state(straight)} | {bent['coverage']:.4f} | {bent['time']:.0f} | "
              f"{straight['time']:.0f} | {bent['time'] / straight['time']:.4f} | {bent.get('wall', math.nan):.0f} |")
    ratios = [by[True]["time"] / by[False]["time"] for by in both.values()]
    print(f"\n{len(both)} parts: {sum(by[True]['state'] == 'proved' for by in both.values())} proved under doglegs, "
          f"{sum(by[False]['state'] == 'proved' for by in both.values())} with straight rapids; "
          f"{sum(not r <= 1.05 for r in ratios)} longer by over 5 %; longest {max(ratios, default=math.nan):.4f}")


def _state(row: dict[str, Any]) -> str:
    """State of a plan and what was found first."""
    found = row.get("findings") or [row["message"]] if row["state"] != "proved" else []
    return row["state"] + (f": {found[0][-80:]}" if found else "")


def main() -> None:
    """Make the plans that have no line yet and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", nargs="*", type=int, help=f"all {COUNT} where none is given")
    parser.add_argument("--out", type=Path, default=Path("out/dogleg"))
    parser.add_argument("--five", action="store_true")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one is not None:
        seed, way = args.one.split(":")
        print(json.dumps(planned(int(seed), way == "dogleg")))
        return
    args.out.mkdir(parents=True, exist_ok=True)
    kept, digest = args.out / "rows.jsonl", digest_of(SOURCES)
    rows = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    known = {(row["seed"], row["dogleg"]) for row in rows if row["sources"] == digest}
    wanted = [] if args.table else [FIVE] if args.five else args.seeds or range(COUNT)
    for seed, dogleg in [(s, d) for s in wanted for d in (True, False) if (s, d) not in known]:
        rows.append({"sources": digest} | run(seed, dogleg))
        with kept.open("a") as out:
            out.write(json.dumps(rows[-1]) + "\n")
        print(f"{seed} {'doglegs' if dogleg else 'straight'}: {_state(rows[-1])} {rows[-1]['time']:.1f} s", flush=True)
    table(rows)


if __name__ == "__main__":
    main()
