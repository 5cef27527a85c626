"""The page: the list of jobs at ``/``, one job at ``/v1/jobs/{id}/view``, and the files it is made of.

The page itself is public, as it holds nothing of any job: it asks the interface for what it shows, with the key of
whoever looks at it. So it stands beside the contract of the interface, not in it.
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
    """The page with the list of jobs and the form for a new one."""
    return page()


@router.get("/assets/{name}")
def page_asset(request: Request, name: str) -> Response:
    """A file the page loads."""
    return asset(request, name)
