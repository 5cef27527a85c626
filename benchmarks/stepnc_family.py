"""STEP-NC of real jobs before the schema checker: small parts planned on 3 axes, 3+2 and 5, seed by seed.

    .venv/bin/python benchmarks/stepnc_family.py [--seeds 0 1 2] [--machines 3-axis 3+2 5-axis] [--minutes 30]

Each part is drawn by the family (recipe linear, two walls, one connection), planned, proved, and both its STEP-NC files
are held against their schemas by ../shared/stepnc/p21check.py with --rules --roots; jobs that are not proved have none,
and say so. The three forms of AP238 go round with the seeds. The chain itself has read them back and held them against
the program before they are there (docs/stepnc.md). Ends where the minutes are spent; a row is printed as it is known.
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

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from examples.family import make_part  # noqa: E402
from geometry.errors import CamError  # noqa: E402
from service import chain  # noqa: E402
from service.convert import parse_setup  # noqa: E402

CHECK = ROOT.parent / "shared" / "stepnc" / "p21check.py"
SCHEMAS = {"cc1": "ap238e3_aim_lf.exp", "cc2": "ap238e3_aim_lf.exp", "integrated_cnc": "ap238e1_aim_lf.exp"}
FIVE = {"kind": "5-axis", "kinematics": "table-table-AC", "rotary_deg": [[-100, 100], [-720, 720]]}
MACHINES: dict[str, dict[str, Any]] = {
    "3-axis": {}, "3+2": {**FIVE, "simultaneous": False}, "5-axis": {**FIVE, "simultaneous": True}}


def checked(path: Path, schema: str) -> str:
    """'ok' where the checker exits with 0 and has no warning, else what it says first."""
    done = subprocess.run([sys.executable, str(CHECK), "--schema", str(CHECK.parent / "schemas" / schema), "--rules",
                           "--roots", str(path)], capture_output=True, text=True)
    bad = [line for line in done.stdout.splitlines() if ": W " in line or ": E " in line]
    roots = [line for line in done.stdout.splitlines() if "unreferenced:" in line]
    if schema.startswith("iso") and not all(line.endswith("unreferenced: PROJECT x1 (e.g. #1)") for line in roots):
        bad.append(roots[0])
    return "ok" if done.returncode == 0 and not bad else f"exit {done.returncode}: {bad[0] if bad else '?'}"


def row(seed: int, machine: str, folder: Path) -> str:
    """One job as a row of the table."""
    started = time.monotonic()
    part, _, setup_path = make_part(seed, "linear", walls=2, connections=1).write(folder, reach=False)
    form = list(SCHEMAS)[seed % len(SCHEMAS)]
    setup = json.loads(Path(setup_path).read_text())
    setup["machine"] = {**setup.get("machine", {}), **MACHINES[machine], "ap238": form}
    try:
        report = chain.plan(Path(part), parse_setup(setup), folder / "out", lambda _stage, _share: None)
    except CamError as refusal:
        return f"| {seed} | {machine} | {form} | {refusal.code} | | | | {time.monotonic() - started:.0f} |"
    out = [str(report["state"]), str(len(report["steps"]))]
    for pattern, schema in (("job*.arm.stpnc", "iso14649_milling.exp"), ("job*.stpnc", SCHEMAS[form])):
        files = [f for f in sorted((folder / "out").glob(pattern)) if pattern.endswith("arm.stpnc")
                 or not f.name.endswith("arm.stpnc")]
        said = [checked(f, schema) for f in files]
        out.append(next((s for s in said if s != "ok"), f"ok {sum(f.stat().st_size for f in files) / 1e6:.1f} MB")
                   if files else "none")
    return f"| {seed} | {machine} | {form} | {' | '.join(out)} | {time.monotonic() - started:.0f} |"


def main() -> None:
    """Print the table."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    ask.add_argument("--machines", nargs="+", default=list(MACHINES), choices=list(MACHINES))
    ask.add_argument("--minutes", type=float, default=60.0)
    asked = ask.parse_args()
    begun = time.monotonic()
    print("| seed | machine | AP238 as | state | steps | ISO 14649 | AP238 | s |\n|---|---|---|---|---|---|---|---|")
    for seed in asked.seeds:
        for machine in asked.machines:
            if time.monotonic() - begun > 60.0 * asked.minutes:
                return
            with tempfile.TemporaryDirectory() as folder:
                print(row(seed, machine, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
