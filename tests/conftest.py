"""Fixtures every test may use."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.no_skip import pytest_make_collect_report, pytest_runtest_makereport

__all__ = ["pytest_make_collect_report", "pytest_runtest_makereport"]  # hooks

SHARED_PARTS = Path(__file__).resolve().parents[2] / "shared" / "parts"


@pytest.fixture(scope="session")
def shared_parts() -> Path:
    """Folder of the STEP parts by others; the test is skipped where a checkout stands without them."""
    if not SHARED_PARTS.is_dir():
        pytest.skip("the collection of STEP parts by others (../shared/parts) does not lie beside this checkout")
    return SHARED_PARTS


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
def demo_job(demo_files: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> PlannedJob:
    """The demo part planned and proved once per run (half a minute or so)."""
    from service.from_wire import read_setup
    from service.pipeline import plan

    part, setup = demo_files
    out = tmp_path_factory.mktemp("demo-out")
    return PlannedJob(plan(part, read_setup(setup), out, lambda stage, fraction: None), part, setup, out)
