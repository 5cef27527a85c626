"""The 60 deep parts of ``examples.family.deep``, planned and proved: state, findings and seconds of each.

    python benchmarks/jobs/deep_parts.py [SEED ...] [--out out/deep] [--table]

Each part runs in a process of its own. Its figures are a line of ``rows.jsonl`` in the folder, with a digest of the
sources; a part that has a line with the same digest is not planned again. ``--table`` only prints the newest lines.
``first`` counts the findings of the first proof of a job, ``findings`` those of its last.
"""

from __future__ import annotations

import argparse
import json
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
from examples.family.deep import COUNT, DeepPart, deep_part  # noqa: E402

OWN = ("plunge", "program", "residual")  # kinds of finding that a planner makes by itself
HEAD = ("part", "opening", "depth mm", "tool", "flutes mm", "blank", "state", "plans", "first proof", "coverage", "s")


def described(part: DeepPart) -> dict[str, Any]:
    """What a part is, as plain data."""
    tool, more = part.setup["tools"][0], " and a second" if len(part.setup["tools"]) > 1 else ""
    return {"opening": f"{part.outline}, {'through' if part.through else 'blind'}", "depth": part.depth,
            "tool": f"{tool['kind']} {tool['diameter_mm']:g}{more}",
            "flutes": tool["flute_length_mm"], "blank": part.setup["stock"]["kind"]}


def planned(seed: int) -> dict[str, Any]:
    """Draw, plan and prove one part: plain data."""
    from geometry.errors import CamError
    from schemas.setup import Setup
    from service import pipeline
    from service.stages import plan_prove_loop

    part, proofs, prove = deep_part(seed), [], plan_prove_loop.prove
    setup = Setup.model_validate(part.setup)

    def counted(*given: Any, **named: Any) -> Any:
        proofs.append(prove(*given, **named))
        return proofs[-1]

    plan_prove_loop.prove = counted
    facts = {"seed": seed, **described(part)}
    with tempfile.TemporaryDirectory() as folder:
        step, _ = part.write(folder)
        try:
            report = pipeline.plan(step, setup, Path(folder) / "job", lambda stage, share: None)
        except CamError as refusal:
            return facts | {"state": "error", "message": f"{refusal.code}: {refusal.message}"}
    return facts | {
        "state": report["state"], "findings": dict(report["finding_counts"]), "plans": len(proofs),
        "first": dict(proofs[0].counts), "coverage": report["coverage"],
        "texts": [f"{f.line}: {f.message}" for p in proofs for f in p.findings[:3]]}


def run(seed: int) -> dict[str, Any]:
    """One part in a process of its own."""
    begun = time.perf_counter()
    done = subprocess.run([sys.executable, __file__, "--one", str(seed)], capture_output=True, text=True)
    lines = done.stdout.splitlines()
    row = json.loads(lines[-1]) if done.returncode == 0 and lines else {
        "seed": seed, **described(deep_part(seed)), "state": "error", "message": done.stderr[-400:]}
    return row | {"wall": round(time.perf_counter() - begun, 1)}


def _counts(found: dict[str, int]) -> str:
    return ", ".join(f"{n} {kind}" for kind, n in sorted(found.items())) or "nothing"


def table(rows: list[dict[str, Any]]) -> None:
    """The newest line of each part, and how many are proved."""
    newest = {row["seed"]: row for row in rows}
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD))
    for seed, r in sorted(newest.items()):
        state = f"error: {r['message'][-80:]}" if r["state"] == "error" else \
            r["state"] + (f": {_counts(r['findings'])}" if r["findings"] else "")
        print(f"| deep-{seed} | {r['opening']} | {r['depth']:g} | {r['tool']} | {r['flutes']:g} | {r['blank']} | "
              f"{state} | {r.get('plans', '-')} | {_counts(r.get('first', {}))} | {100 * r.get('coverage', 0.0):.1f} % "
              f"| {r['wall']:.0f} |")
    made = [r for r in newest.values() if r["state"] != "error"]
    own = sum(any(kind in OWN for kind in r["findings"]) for r in made)
    print(f"\n{len(newest)} parts: {sum(r['state'] == 'proved' for r in made)} proved, "
          f"{sum(r['plans'] == 1 for r in made if r['state'] == 'proved')} of them at the first plan; {own} unproved "
          f"for {', '.join(OWN)}; {sum(r['wall'] for r in newest.values()):.0f} s")


def main() -> None:
    """Plan the parts that have no line yet and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", nargs="*", type=int, help=f"all {COUNT} where none is given")
    parser.add_argument("--out", type=Path, default=Path("out/deep"))
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one is not None:
        print(json.dumps(planned(args.one)))
        return
    args.out.mkdir(parents=True, exist_ok=True)
    kept, digest = args.out / "rows.jsonl", digest_of(SOURCES)
    rows = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    known = {row["seed"] for row in rows if row["sources"] == digest}
    for seed in [] if args.table else [s for s in args.seeds or range(COUNT) if s not in known]:
        rows.append({"sources": digest} | run(seed))
        with kept.open("a") as out:
            out.write(json.dumps(rows[-1]) + "\n")
        print(f"deep-{seed}: {rows[-1]['state']} {rows[-1]['wall']} s", flush=True)
    table(rows)


if __name__ == "__main__":
    main()
