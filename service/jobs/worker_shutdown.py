"""What a worker of a cluster does when it is told to end: its jobs go back into the queue, and no attempt is lost."""

from __future__ import annotations

import asyncio
import time
from typing import Any

from distributed import Status, WorkerPlugin

from service.jobs import attempt

PATIENCE_S = 8.0  # within what is usually given to a process between SIGTERM and SIGKILL
LOOK_S = 0.05


class OrderlyEnd(WorkerPlugin):  # type: ignore[misc]
    """Registered by every service under one name: the second replaces the first, which ends no worker."""

    name = "zonemill-orderly-end"

    async def teardown(self, worker: Any) -> None:
        """Stop the attempts of a worker that closes, and wait until they have put their jobs back."""
        if worker.status is not Status.closing:
            return
        attempt.ending.set()
        until = time.monotonic() + PATIENCE_S
        while attempt.under_way and time.monotonic() < until:
            await asyncio.sleep(LOOK_S)
