"""``ZONEMILL_SHARD=k/n``: only the k-th of n shares of the slow tests runs, by a checksum of each module's name.

A module stays whole, so that what its tests share is made once. Everyday tests are not touched.
"""

from __future__ import annotations

import os
import zlib

import pytest


def shard_of(module: str, count: int) -> int:
    """The share, 0 to ``count`` - 1, that a test module belongs to."""
    return zlib.crc32(module.encode()) % count


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the slow tests of other shares."""
    wanted = os.environ.get("ZONEMILL_SHARD")
    if not wanted:
        return
    k, count = (int(v) for v in wanted.split("/"))
    kept, left_out = [], []
    for item in items:
        other = item.get_closest_marker("slow") is not None and shard_of(item.nodeid.split("::")[0], count) != k
        (left_out if other else kept).append(item)
    config.hook.pytest_deselected(items=left_out)
    items[:] = kept
