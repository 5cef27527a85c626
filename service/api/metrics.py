"""Counters for Prometheus. Each application has its own registry, so that tests do not share them."""

from __future__ import annotations

import time
from typing import Any

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from schemas.jobs import FINAL_STATES
from service.jobs.engine import Engine

METHODS = frozenset(("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"))
STATES = ("queued", "running", *FINAL_STATES)


class Metrics:
    """The counters of the service."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.submissions = Counter("zonemill_submissions_total", "Jobs queued by this process.", ["kind"],
                                   registry=self.registry)
        self.jobs = Gauge("zonemill_jobs", "Jobs in the database by state.", ["state"], registry=self.registry)
        self.webhooks = Gauge("zonemill_webhooks", "Webhooks in the database by state.", ["state"],
                              registry=self.registry)
        self.capacity = Gauge("zonemill_capacity", "Jobs that can run at once.", registry=self.registry)
        self.requests = Histogram("zonemill_request_seconds", "Time until the last byte of a response.",
                                  ["method", "route", "status"], registry=self.registry)

    def submitted(self, kind: str) -> None:
        """Count one job."""
        self.submissions.labels(kind).inc()

    def render(self, engine: Engine) -> bytes:
        """The counters in text format, with current figures from the database."""
        counts = engine.jobs.counts()
        for state in STATES:
            self.jobs.labels(state).set(counts.get(state, 0))
        for state, count in engine.jobs.webhook_counts().items():
            self.webhooks.labels(state).set(count)
        self.capacity.set(engine.capacity())
        return generate_latest(self.registry)


class MetricsMiddleware:
    """Times every request under the pattern of its route.

    Paths would give a label for every id, and method names can be invented by clients; both would grow without end.
    """

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self.app, self.metrics = app, metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        started, seen = time.perf_counter(), {"status": 500}

        async def watched(message: Message) -> None:
            if message["type"] == "http.response.start":
                seen["status"] = message["status"]
            await send(message)

        try:
            await self.app(scope, receive, watched)
        finally:
            route: Any = scope.get("route")
            pattern = getattr(route, "path", "none")
            method = scope["method"] if scope["method"] in METHODS else "other"
            self.metrics.requests.labels(method, pattern, str(seen["status"])).observe(
                time.perf_counter() - started)
