"""Which slow tests a run of CI holds: a share of their modules, for as long as the time lasts.

``ZONEMILL_SHARD=k/n`` leaves only the k-th of n shares, by a checksum of each module's name. A module stays whole, so
that what its tests share is made once. ``ZONEMILL_FIRST`` turns the order of its modules on, so that what the time cut
off comes first another time. After ``ZONEMILL_SECONDS`` no slow test begins; those left are skipped and counted.
Everyday tests are not touched.
"""

from __future__ import annotations

import os
import time
import zlib

import pytest

BEGUN = time.monotonic()
LATE = "the time of this share was used up"


def shard_of(module: str, count: int) -> int:
    """The share, 0 to ``count`` - 1, that a test module belongs to."""
    return zlib.crc32(module.encode()) % count


def turned(modules: list[str], first: int) -> list[str]:
    """The modules in the order in which they run, begun ``first`` places on."""
    at = first % len(modules) if modules else 0
    return modules[at:] + modules[:at]


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the slow tests of other shares, and turn the order of those of this one."""
    wanted = os.environ.get("ZONEMILL_SHARD")
    if not wanted:
        return
    k, count = (int(v) for v in wanted.split("/"))
    kept, slow, left_out = [], dict[str, list[pytest.Item]](), []
    for item in items:
        module = item.nodeid.split("::")[0]
        if item.get_closest_marker("slow") is None:
            kept.append(item)
        elif shard_of(module, count) == k:
            slow.setdefault(module, []).append(item)
        else:
            left_out.append(item)
    config.hook.pytest_deselected(items=left_out)
    order = turned(list(slow), int(os.environ.get("ZONEMILL_FIRST", "0")))
    items[:] = [*(item for module in order for item in slow[module]), *kept]


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip a slow test that would begin too late."""
    seconds = os.environ.get("ZONEMILL_SECONDS")
    if seconds and item.get_closest_marker("slow") is not None and time.monotonic() - BEGUN > float(seconds):
        pytest.skip(LATE)
