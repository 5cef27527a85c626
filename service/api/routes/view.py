"""The web page: the list of jobs at ``/``, one job at ``/v1/jobs/{id}/view``, and the files of the page.

The page itself is public, since it contains no data of a job. It requests its data from the HTTP interface with the key
of its user. So it is not part of the OpenAPI document.
"""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.viewer.static_files import asset, page

router = APIRouter(tags=["page"], include_in_schema=False)


@router.get("/v1/jobs/{job_id}/view")
def view_job(job_id: str) -> Response:
    """The page of a job: part, zones, remainder, deviation, tool paths, findings."""
    return page()


@router.get("/")
def list_page() -> Response:
    """The page with the list of jobs and the form for a new job."""
    return page()


@router.get("/assets/{name}")
def page_asset(request: Request, name: str) -> Response:
    """A file that the page loads."""
    return asset(request, name)
