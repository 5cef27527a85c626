"""Writes THIRD_PARTY.md: the packages that the locks pin, with version and licence.

``python .ci/third_party.py LOCK...`` writes it, ``--check`` compares its names and versions with the locks. A lock is a
pip lock (``name==version`` lines) or a package-lock.json of npm. Licences of Python packages come from the metadata of
the running environment. A package that is not installed here, such as one for another system, keeps the licence that
THIRD_PARTY.md already gives for it.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "THIRD_PARTY.md"
UNKNOWN = "not known"
PIN = re.compile(r"^([A-Za-z0-9._-]+)(?:\[[^\]]*\])?==([^\s;]+)")
ROW = re.compile(r"^\| ([^|]+) \| ([^|]+) \| ([^|]+) \|$")
HEAD = """# Packages by others

zonemill is under the [Apache License 2.0](LICENSE). The repository holds no code of these packages; setting it up
installs them, each under the licence of its own authors. The built page contains `three`. The wheel of OCP contains
OpenCASCADE, which is under LGPL-2.1 with an exception.

`make third-party` writes this page from the locks and from the metadata of the installed packages. Packages that only
benchmarks or the build machine use (`requirements-bench.lock`, `requirements-web.lock`) are left out.
"""


@dataclass(frozen=True)
class Package:
    """A pinned package: name, version, licence."""

    name: str
    version: str
    licence: str


def licence_of(fields: metadata.PackageMetadata) -> str:
    """The licence that the metadata of a package states: its SPDX expression, else its classifiers, else its text."""
    expression = fields.get("License-Expression")
    if expression:
        return expression
    stated = [c.split(" :: ")[-1] for c in fields.get_all("Classifier", []) if c.startswith("License :: ")]
    named = [c for c in stated if c != "OSI Approved"]
    if named:
        return ", ".join(named)
    lines = (fields.get("License") or "").strip().splitlines()
    return lines[0].strip() if lines and len(lines[0]) <= 80 else UNKNOWN


def python_packages(lock: str, known: Mapping[str, str]) -> list[Package]:
    """Packages of a pip lock.

    lock  : text of the lock
    known : licence by name, for packages that are not installed here
    """
    found = []
    for name, version in (m.groups() for line in lock.splitlines() if (m := PIN.match(line))):
        try:
            licence = licence_of(metadata.metadata(name))
        except metadata.PackageNotFoundError:
            licence = UNKNOWN
        found.append(Package(name, version, known.get(name, UNKNOWN) if licence == UNKNOWN else licence))
    return found


def node_packages(lock: str) -> list[Package]:
    """Packages of a package-lock.json, each name and version once."""
    entries = json.loads(lock)["packages"]
    found = {(path.rpartition("node_modules/")[2], e["version"]): str(e.get("license", UNKNOWN))
             for path, e in entries.items() if path}
    return [Package(name, version, licence) for (name, version), licence in sorted(found.items())]


def listed(page: str) -> dict[str, list[Package]]:
    """Packages by section title, as a page lists them."""
    sections: dict[str, list[Package]] = {}
    for line in page.splitlines():
        if line.startswith("## "):
            sections[line[3:].strip("` ")] = []
        elif sections and (m := ROW.match(line)) and m[1] not in ("package", "---"):
            sections[list(sections)[-1]].append(Package(*(cell.strip() for cell in m.groups())))
    return sections


def pinned(locks: Iterable[str], page: str) -> dict[str, list[Package]]:
    """Packages by lock, those of an earlier lock left out.

    locks : paths from the project's root
    page  : the page as it is, for licences that cannot be found here
    """
    known = {p.name: p.licence for section in listed(page).values() for p in section}
    seen: set[Package] = set()
    sections = {}
    for lock in locks:
        text = (ROOT / lock).read_text(encoding="utf-8")
        packages = node_packages(text) if lock.endswith(".json") else python_packages(text, known)
        sections[lock] = [p for p in packages if p not in seen]
        seen.update(packages)
    return sections


def render(sections: Mapping[str, Iterable[Package]]) -> str:
    """Text of the page."""
    parts = [HEAD]
    for lock, packages in sections.items():
        rows = "".join(f"| {p.name} | {p.version} | {p.licence.replace('|', '/')} |\n" for p in packages)
        parts.append(f"## `{lock}`\n\n| package | version | licence |\n|---|---|---|\n{rows}")
    return "\n".join(parts)


def differences(sections: Mapping[str, Iterable[Package]], page: str) -> list[str]:
    """Where the page and the locks differ in section, name or version, one line each."""
    wanted = {(lock, p.name, p.version) for lock, packages in sections.items() for p in packages}
    there = {(lock, p.name, p.version) for lock, packages in listed(page).items() for p in packages}
    return [f"{lock}: {name} {version} is not in THIRD_PARTY.md" for lock, name, version in sorted(wanted - there)] + [
        f"{lock}: {name} {version} is in THIRD_PARTY.md only" for lock, name, version in sorted(there - wanted)]


def main(arguments: list[str]) -> int:
    """Write or check the page; 1 where the check finds a difference."""
    parser = argparse.ArgumentParser(description="Write THIRD_PARTY.md from the locks.")
    parser.add_argument("locks", nargs="+", metavar="LOCK", help="path from the project's root")
    parser.add_argument("--check", action="store_true", help="compare only")
    given = parser.parse_args(arguments)
    page = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    sections = pinned(given.locks, page)
    if not given.check:
        PAGE.write_text(render(sections), encoding="utf-8")
        return 0
    found = differences(sections, page)
    print("\n".join([*found, "Remedy: make third-party"] if found else ["THIRD_PARTY.md agrees with the locks"]))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
