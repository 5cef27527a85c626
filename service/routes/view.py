"""The page: the list of jobs at ``/``, one job at ``/v1/jobs/{id}/view``, and the files it is made of.

The page itself is public, as it holds nothing of any job: it asks the interface for what it shows, with the key of
whoever looks at it.
"""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, Response

from service.errors import RequestError
from service.pages import asset, page
from service.problems import responses

router = APIRouter(tags=["page"])

PAGE: dict[int | str, dict[str, Any]] = {
    200: {"description": "The page, the same for every job; it asks the interface for what it shows."},
    503: {"description": "The page was not built (make web).",
          "content": {"text/html": {"schema": {"type": "string"}}}}}


@router.get("/v1/jobs/{job_id}/view", operation_id="viewJob", summary="A job to look at", response_class=HTMLResponse,
            responses=PAGE | responses(RequestError))
def view_job(job_id: str) -> Response:
    """The page of a job: part, zones, remainder, deviation, tool paths, findings."""
    return page()


@router.get("/", include_in_schema=False)
def list_page() -> Response:
    """The page with the list of jobs and the form for a new one."""
    return page()


@router.get("/assets/{name}", include_in_schema=False)
def page_asset(request: Request, name: str) -> Response:
    """A file the page loads."""
    return asset(request, name)
