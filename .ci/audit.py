"""Known vulnerabilities of what we depend on: pip-audit for requirements.lock, npm audit for what has a package-lock.

``python .ci/audit.py FOLDER``; pip-audit gets an environment of its own in FOLDER. Exit 1 where one is vulnerable;
where nobody answers who knows of advisories nothing is audited, which is said and is no failure.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
NPM = ("web", "examples/clients/typescript")


def run(*words: str | Path, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """A command with what it said."""
    return subprocess.run([str(w) for w in words], cwd=cwd, capture_output=True, text=True, timeout=600)


def ask_pip_audit(program: Path, lock: Path) -> dict[str, list[dict[str, object]]] | None:
    """Its dependencies: audited (with 'vulns') or skipped; None where nobody answered."""
    said = run(program, "-r", lock, "--no-deps", "--disable-pip", "--progress-spinner", "off", "-f", "json")
    try:
        found = json.loads(said.stdout)["dependencies"]
    except (ValueError, KeyError):
        return None
    return {"audited": [d for d in found if "vulns" in d], "skipped": [d for d in found if "vulns" not in d]}


def audit_python(folder: Path) -> int:
    """Number of vulnerable packages in requirements.lock."""
    venv.create(folder, with_pip=True)
    if run(folder / "bin" / "pip", "install", "-q", "pip-audit==2.10.1").returncode != 0:
        print("audit: pip-audit cannot be had; Python packages are not audited")
        return 0
    first = folder / "first.txt"
    first.write_text("idna==3.7\n")
    asked = ask_pip_audit(folder / "bin" / "pip-audit", first)
    if asked is None or not asked["audited"]:
        print("audit: no advisories of Python packages can be reached from here; requirements.lock is not audited")
        return 0
    asked = ask_pip_audit(folder / "bin" / "pip-audit", ROOT / "requirements.lock") or {"audited": [], "skipped": []}
    bad = [d for d in asked["audited"] if d["vulns"]]
    print(f"audit: {len(asked['audited'])} Python packages, {len(asked['skipped'])} skipped, {len(bad)} vulnerable")
    for d in bad:
        print(f"  {d['name']} {d['version']}: {', '.join(str(v['id']) for v in d['vulns'])}")  # type: ignore[attr-defined]
    return len(bad)


def audit_node(name: str) -> int:
    """Number of serious advisories for one package-lock.json."""
    if shutil.which("npm") is None:
        print(f"audit: there is no npm; {name} is not audited")
        return 0
    try:
        counts = json.loads(run("npm", "audit", "--json", cwd=ROOT / name).stdout)["metadata"]["vulnerabilities"]
    except (ValueError, KeyError):
        print(f"audit: no advisories of npm packages can be reached from here; {name} is not audited")
        return 0
    print(f"audit: {name}: {counts}")
    return int(counts.get("high", 0)) + int(counts.get("critical", 0))


if __name__ == "__main__":
    sys.exit(1 if audit_python(Path(sys.argv[1])) + sum(audit_node(name) for name in NPM) else 0)
