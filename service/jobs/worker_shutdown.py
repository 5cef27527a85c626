"""Orderly end of a cluster worker: its jobs return to the queue, and no attempt is lost."""

from __future__ import annotations

import asyncio
import time
from typing import Any

from distributed import Status, WorkerPlugin

from service.jobs import attempt

PATIENCE_S = 8.0  # less than the usual time between SIGTERM and SIGKILL
LOOK_S = 0.05


class WorkerShutdown(WorkerPlugin):  # type: ignore[misc]
    """Worker plugin. Every service registers it under one name; a second registration replaces the first."""

    name = "zonemill-orderly-end"

    async def teardown(self, worker: Any) -> None:
        """Stop the attempts of a closing worker, and wait until they have put their jobs back."""
        if worker.status is not Status.closing:
            return
        attempt.ending.set()
        until = time.monotonic() + PATIENCE_S
        while attempt.under_way and time.monotonic() < until:
            await asyncio.sleep(LOOK_S)
