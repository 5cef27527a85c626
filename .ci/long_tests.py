"""Writes tests/long_tests.txt from the durations of an everyday run.

    python -m pytest -q -m "not slow and not soak" -n 2 --junitxml build/tests.xml
    python .ci/long_tests.py build/tests.xml [--over 1.5]

Tests of which the run has no duration keep their place in the list. Where all tests of a module are long, the quickest
stays in the everyday run. So do the tests in ``KEPT``.
"""

from __future__ import annotations

import argparse
import xml.etree.ElementTree as ElementTree
from pathlib import Path

LIST = Path(__file__).resolve().parents[1] / "tests" / "long_tests.txt"
KEPT = ("tests/e2e/test_demo.py::test_it_is_proved_without_a_finding",)  # the whole chain on the demo part


def durations(report: Path) -> dict[str, float]:
    """Seconds of each test of a JUnit report, by node id."""
    out = {}
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        out[f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}"] = float(case.get("time", "0"))
    return out


def chosen(seconds: dict[str, float], over: float) -> set[str]:
    """Node ids of the tests that take long."""
    modules: dict[str, list[str]] = {}
    for name in seconds:
        modules.setdefault(name.split("::")[0], []).append(name)
    kept = {min(names, key=lambda n: (seconds[n], n)) for names in modules.values()}
    return {n for n, s in seconds.items() if s > over and n not in kept and n not in KEPT}


def main() -> None:
    """Write the list."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=Path)
    parser.add_argument("--over", type=float, default=1.5, help="s")
    args = parser.parse_args()
    seconds = durations(args.report)
    before = set(LIST.read_text(encoding="utf-8").splitlines()) if LIST.exists() else set()
    after = sorted((before - seconds.keys()) | chosen(seconds, args.over))
    LIST.write_text("\n".join(after) + "\n", encoding="utf-8")
    left = sum(s for n, s in seconds.items() if n not in after)
    print(f"{len(after)} tests take long; the others take {left:.0f} s")


if __name__ == "__main__":
    main()
