"""Fixtures every test may use."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.long_tests import pytest_itemcollected
from tests.no_skip import pytest_make_collect_report, pytest_runtest_makereport
from tests.shards import pytest_collection_modifyitems, pytest_runtest_setup
from tests.skips import pytest_terminal_summary

__all__ = ["pytest_collection_modifyitems", "pytest_itemcollected", "pytest_make_collect_report",
           "pytest_runtest_makereport", "pytest_runtest_setup", "pytest_terminal_summary"]  # hooks

HERE = Path(__file__).resolve()
# The planner takes seconds to load, in each of hundreds of services. Tests that want it preloaded say so.
os.environ.setdefault("ZONEMILL_PRELOAD", "0")
WRITTEN_PARTS = os.environ.get("ZONEMILL_PARTS")  # set where the environment has no cadquery (make test-runtime)
DRAWS = 'importorskip("cadquery")'
SHARED_PARTS = Path(__file__).resolve().parents[2] / "shared" / "parts"


@pytest.fixture
def two_threads() -> Iterator[None]:
    """Two threads of numba during the test, which is skipped where numba may not have them."""
    import numba

    before = numba.get_num_threads()
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("numba has one thread here (NUMBA_NUM_THREADS, or one core)")
    numba.set_num_threads(2)
    yield
    numba.set_num_threads(before)


@pytest.fixture(scope="session")
def shared_parts() -> Path:
    """Folder of the STEP parts by others; the test is skipped where a checkout stands without them."""
    if not SHARED_PARTS.is_dir():
        pytest.skip("the collection of STEP parts by others (../shared/parts) does not lie beside this checkout")
    return SHARED_PARTS


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """With parts written beforehand: no module that draws. Without: none of ``tests/runtime``, which compares them."""
    if collection_path.suffix != ".py":
        return None
    if WRITTEN_PARTS:
        return True if DRAWS in collection_path.read_text(encoding="utf-8") and collection_path != HERE else None
    return True if collection_path.parent == HERE.parent / "runtime" else None


def pytest_report_header() -> str | None:
    """How many modules of tests are left out because they draw their parts."""
    if not WRITTEN_PARTS:
        return None
    modules = list(HERE.parent.rglob("test_*.py"))
    draw = sum(DRAWS in p.read_text(encoding="utf-8") for p in modules)
    return f"runtime environment: {draw} of {len(modules)} modules of tests draw parts with cadquery and are left out"


@pytest.fixture(scope="session")
def demo_truth() -> dict[str, Any]:
    """What the generator knows about the demo part: drawn anew, or as written beforehand."""
    if WRITTEN_PARTS:
        return dict(json.loads(Path(WRITTEN_PARTS, "demo-0.truth.json").read_text()))
    from examples.family.recipes import make_part

    return make_part(0, "demo").truth


@pytest.fixture(scope="session")
def demo_files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The demo part and its setup, written once per run: (step_path, setup_path)."""
    from examples.demo import write_demo

    return write_demo(tmp_path_factory.mktemp("demo"))


@dataclass(frozen=True)
class PlannedJob:
    """One run of the whole chain: the report as returned, and where part, setup and files lie."""

    report: dict[str, Any]
    part: Path
    setup: Path
    out: Path


@pytest.fixture(scope="session")
def demo_job(tmp_path_factory: pytest.TempPathFactory) -> PlannedJob:
    """The demo part planned and proved once per run, by the first of the test processes that wants it."""
    import fcntl

    from examples.demo import write_demo
    from service.from_wire import read_setup
    from service.pipeline import plan

    base = tmp_path_factory.getbasetemp()
    shared = (base.parent if os.environ.get("PYTEST_XDIST_WORKER") else base) / "demo-job"
    shared.mkdir(exist_ok=True)
    report, out = shared / "returned.json", shared / "out"
    with (shared / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        part, setup = write_demo(shared)
        if not report.exists():
            report.write_text(json.dumps(plan(part, read_setup(setup), out, lambda stage, fraction: None)))
    return PlannedJob(json.loads(report.read_text()), part, setup, out)
