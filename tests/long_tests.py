"""Everyday tests that take long: ``tests/long_tests.txt`` names them, and they are marked slow.

What is left runs in ten minutes on two idle cores. ``.ci/long_tests.py`` writes the list from durations of a run. In
each module at least one test stays in the everyday run. The others run in ``make test-slow`` and in the shares of CI.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

LIST = Path(__file__).with_suffix(".txt")


@cache
def long_tests() -> frozenset[str]:
    """Node ids of the tests that take long."""
    return frozenset(LIST.read_text(encoding="utf-8").splitlines())


def pytest_itemcollected(item: pytest.Item) -> None:
    """Mark a test slow that the list names."""
    if item.nodeid in long_tests():
        item.add_marker(pytest.mark.slow)
