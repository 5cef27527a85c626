"""``ZONEMILL_NO_SKIP=cadquery,rs274``: a test that skips with one of these words in its reason fails instead.

CI sets it to what its environment must have: tests that skip for want of it would pass by not running.
"""

from __future__ import annotations

import os
from collections.abc import Generator
from typing import TypeVar

import pytest

R = TypeVar("R", pytest.TestReport, pytest.CollectReport)


def words() -> list[str]:
    """The words of ``ZONEMILL_NO_SKIP``."""
    return [w for w in os.environ.get("ZONEMILL_NO_SKIP", "").split(",") if w]


def _refuse(report: R) -> R:
    if report.outcome == "skipped" and isinstance(report.longrepr, tuple):
        path, line, reason = report.longrepr
        found = [w for w in words() if w in reason]
        if found:
            report.outcome = "failed"
            report.longrepr = f"{path}:{line}: skipped, and ZONEMILL_NO_SKIP forbids it for {found[0]}: {reason}"
    return report


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Tests that skip while they run."""
    return _refuse((yield))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Modules that skip while they are imported."""
    return _refuse((yield))
