"""/healthz, /readyz, /metrics: for operators."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from fastapi.responses import PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST

from schemas.jobs import Health
from service.api.principals import Watcher
from service.api.problems import responses
from service.errors import UnauthorizedError

router = APIRouter(tags=["operation"])


@router.get("/healthz", operation_id="healthz", summary="Check the process",
            response_description="The process answers.")
async def healthz() -> Health:  # without a thread: all threads may wait for the database
    """Answer ok while the process runs, even without database and disk."""
    return Health(status="ok")


@router.get("/readyz", operation_id="readyz", summary="Check the service",
            response_description="The service is ready.",
            responses={503: {"model": Health, "description": "Not ready."}})
def readyz(request: Request, response: Response) -> Health:
    """Check database, engine, data folder and free disk space. An answer 503 names the failed checks."""
    checks = request.app.state.engine.ready()
    if all(text == "ok" for text in checks.values()):
        return Health(status="ok", checks=checks)
    response.status_code = 503
    return Health(status="unready", checks=checks)


@router.get("/metrics", operation_id="metrics", summary="Counters of the service", response_description="The counters.",
            response_class=PlainTextResponse, responses=responses(UnauthorizedError))
def metrics(request: Request, _: Watcher) -> Response:
    """Counters in the Prometheus text format."""
    text = request.app.state.metrics.render(request.app.state.engine)
    return Response(text, media_type=CONTENT_TYPE_LATEST)
