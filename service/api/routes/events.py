"""GET /v1/jobs/{id}/events: server-sent events, a few a second, ending with the final state.

The id of an event is the change counter of the job. A client that connects first gets the current state of the job.
With
Last-Event-ID it gets that state only where it has changed since. After the final event it gets 204, which tells an
EventSource to stop.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections import Counter
from collections.abc import AsyncIterator
from typing import Annotated, Any

import structlog
from fastapi import APIRouter, Header, Request
from fastapi.responses import Response, StreamingResponse
from fastapi.sse import format_sse_event
from sqlalchemy.engine import RowMapping
from starlette.concurrency import run_in_threadpool

from schemas.jobs import FINAL_STATES
from service.api.principals import Caller, Principal
from service.api.problems import responses
from service.errors import NotFoundError, RateError, RequestError, UnauthorizedError
from service.jobs.database import AWAY
from service.jobs.resources import event_data

log = structlog.get_logger(__name__)
router = APIRouter(prefix="/v1/jobs", tags=["jobs"])

KEEP_ALIVE_S = 10.0
KEY_LOOK_S = 5.0
STREAM: dict[int | str, dict[str, Any]] = {
    200: {"description": "Events 'progress' and, once, 'end'; data is a JobEvent.",
          "content": {"text/event-stream": {"schema": {"type": "string"}}}},
    204: {"description": "No more events: Last-Event-ID is that of the final event."}}


@router.get("/{job_id}/events", operation_id="followJob", summary="Follow a job", response_class=StreamingResponse,
            responses=STREAM | responses(UnauthorizedError, NotFoundError, RequestError, RateError))
async def follow(request: Request, principal: Principal, caller: Caller, job_id: str,
                 last: Annotated[str | None, Header(alias="Last-Event-ID", max_length=20)] = None) -> Response:
    """Progress of a job until it ends.

    Raises
    ------
    RateError
        The principal has too many open streams.
    """
    row = await run_in_threadpool(request.app.state.engine.jobs.get, job_id, principal)
    # isdecimal also accepts digits of other scripts; ids are ASCII
    seen = int(last) if last is not None and last.isascii() and last.isdecimal() else -1
    if row["state"] in FINAL_STATES and row["event_seq"] == seen:
        return Response(status_code=204)
    streams: Counter[str] = request.app.state.streams
    most = request.app.state.settings.max_streams_each
    if streams[principal] >= most:
        raise RateError(f"{most} of your event streams are open", code="too_many_streams", limit=most,
                        remedy="close some streams, or poll the job instead", retry_after_s=10)
    stream = _counted(streams, principal, _stream(request, row, seen, caller.key_id))
    return StreamingResponse(stream, media_type="text/event-stream",
                             headers={"Cache-Control": "no-cache", "X-Accel-Buffering": "no"})


async def _counted(streams: Counter[str], principal: str, stream: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
    """A stream that counts as open from its first event to its end."""
    streams[principal] += 1
    try:
        async for event in stream:
            yield event
    finally:
        streams[principal] -= 1


async def _stream(request: Request, row: RowMapping, seen: int, key_id: str | None) -> AsyncIterator[bytes]:
    keys, looked = request.app.state.engine.keys, time.monotonic()
    jobs, interval = request.app.state.engine.jobs, max(0.2, request.app.state.settings.poll_s)
    stopping: threading.Event = request.app.state.stopping
    spoken = time.monotonic()
    while True:
        final = row["state"] in FINAL_STATES
        if final or row["event_seq"] != seen:
            seen, spoken = row["event_seq"], time.monotonic()
            yield format_sse_event(data_str=event_data(row), event="end" if final else "progress", id=str(seen))
        elif time.monotonic() - spoken > KEEP_ALIVE_S:
            spoken = time.monotonic()
            yield b": still here\n\n"
        if final or stopping.is_set():
            return
        await asyncio.sleep(interval)
        try:
            if key_id is not None and time.monotonic() - looked > KEY_LOOK_S:
                looked = time.monotonic()
                if not await run_in_threadpool(keys.is_live, key_id):
                    return  # revoked or expired: a new connection checks the key again
            row = await run_in_threadpool(jobs.get, row["id"])
        except AWAY as error:
            log.warning("a stream ends because the database does not answer", error=type(error).__name__)
            return  # a new connection gets 503 until the database answers
