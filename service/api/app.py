"""The HTTP application: routes, errors, and start and stop of the engine."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from asgi_correlation_id import CorrelationIdMiddleware
from fastapi import FastAPI
from starlette.concurrency import run_in_threadpool

from geometry.errors import CamError
from service.api import problems
from service.api.body_limit import BodyLimitMiddleware
from service.api.head_requests import HeadMiddleware
from service.api.metrics import Metrics, MetricsMiddleware
from service.api.openapi import document
from service.api.principals import PostRate
from service.api.routes import capabilities, events, health, jobs, keys, library, submissions, tool_libraries, view
from service.jobs.engine import Engine
from service.settings import Settings
from service.version import VERSION

DESCRIPTION = """Turns a STEP file and a list of tools into G-code and STEP-NC that a simulator has verified.

POST a part with its setup, follow the events, fetch report and files. Lengths are mm, angles degrees, times seconds,
unless the name of a field says otherwise. Errors are application/problem+json."""


def create_app(settings: Settings | None = None, chain: str = "service.pipeline") -> FastAPI:
    """The application.

    settings : None takes them from the environment
    chain    : module that a job process calls; see ``service.jobs.attempt.WorkConfig``
    """
    settings = settings or Settings()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        engine: Engine = app.state.engine
        try:
            await run_in_threadpool(engine.start)
        except CamError as error:
            app.state.startup_error = error
            raise
        try:
            yield
        finally:
            app.state.stopping.set()
            await run_in_threadpool(engine.close)

    # The documentation pages of the framework load scripts from another host, which could read the API key of a tab.
    app = FastAPI(title="zonemill", version=VERSION, description=DESCRIPTION, lifespan=lifespan, docs_url=None,
                  redoc_url=None, separate_input_output_schemas=False, redirect_slashes=False)
    app.state.settings, app.state.engine, app.state.metrics = settings, Engine(settings, chain), Metrics()
    app.state.stopping, app.state.startup_error = threading.Event(), None
    app.state.streams = Counter()
    app.state.post_rate = PostRate(settings.post_rate)
    problems.install(app)
    for module in (submissions, jobs, events, tool_libraries, library, keys, capabilities, health, view):
        app.include_router(module.router)
    app.add_middleware(BodyLimitMiddleware, limit=settings.max_body_bytes)
    app.add_middleware(MetricsMiddleware, metrics=app.state.metrics)
    app.add_middleware(HeadMiddleware)
    app.add_middleware(CorrelationIdMiddleware, header_name="X-Request-ID")

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = document(app)
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]
    return app
