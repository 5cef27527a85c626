"""POST /v1/tools:import and GET /v1/tools:export: tool libraries of other systems into /v1/tools, and out of it."""

from __future__ import annotations

from itertools import islice
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request, Response
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from geometry.errors import LibraryError
from schemas.libraries import LengthUnit, LibraryImport
from schemas.tools import Tool
from service.api.principals import Caller, Principal, require
from service.api.problems import responses
from service.errors import NotFoundError, RequestError, TooLargeError, UnauthorizedError
from service.jobs.api_keys import ADMIN, SUBMIT
from service.jobs.library import SHARED, LibraryStore
from service.libraries.containers import MAX_LIBRARY_BYTES
from service.libraries.entry import Source, Unit
from service.libraries.exchange import export_library, import_library
from service.libraries.import_report import import_report

MAX_SHOWN = 100
"""Tools that an error lists."""
router = APIRouter(prefix="/v1", tags=["libraries"])

ReadFormat = Literal["zonemill", "fusion", "hsmlib", "freecad", "linuxcnc", "iso13399", "din4000", "hypermill",
                     "solidcam", "camotics", "csv", "xlsx"]
WrittenFormat = Literal["zonemill", "fusion", "fusion-tools", "hsmlib", "freecad", "linuxcnc", "iso13399", "din4000",
                        "hypermill", "solidcam", "csv", "xlsx"]
Encoding = Literal["utf-8", "utf-16", "windows-1252", "iso-8859-1"]
FORM: dict[str, Any] = {"requestBody": {"required": True, "content": {"multipart/form-data": {
    "schema": {"type": "object", "title": "LibraryUpload", "required": ["library"], "additionalProperties": False,
               "properties": {"library": {"type": "string", "format": "binary",
                                          "description": "The file of the library, at most "
                                                         f"{MAX_LIBRARY_BYTES // 1_000_000} MB."}}},
    "encoding": {"library": {"contentType": "application/octet-stream"}}}}}}
FILE: dict[int | str, dict[str, Any]] = {200: {
    "description": "The file of the library.",
    "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}}}}


@router.post("/tools:import", operation_id="importTools", summary="Import a tool library",
             response_description="What became of each entry.", openapi_extra=FORM,
             responses=responses(LibraryError, RequestError, TooLargeError, UnauthorizedError))
async def import_tools(
        request: Request, caller: Caller,
        dry_run: Annotated[bool, Query(description="true: store nothing, only show what would be taken.")] = False,
        format: Annotated[ReadFormat | None, Query(description="Format of the library; default: by its "
                                                               "content.")] = None,
        unit: Annotated[LengthUnit | None, Query(description="Unit of lengths for which the library states "
                                                             "none.")] = None,
        encoding: Annotated[Encoding | None, Query(description="Encoding of a library that is text; default: UTF-8, "
                                                               "or as the file states.")] = None,
        shared: Annotated[bool, Query(description="true: write entries that all principals share (needs scope admin). "
                                                  "false: your own.")] = False) -> LibraryImport:
    """Read a tool library and store its tools in /v1/tools, each under a name that is made from the library's own id.

    Nothing is stored in a dry run. Entries that are left out have a reason, and defaults have a note.
    docs/libraries.md describes the formats. A tool that changed since the last import becomes the next version.

    Raises
    ------
    LibraryError
        The library cannot be read; the subject is the entry.
    RequestError
        not_multipart, bad_multipart, missing_part: the body is not a form with the file ``library``.
    """
    require(caller, ADMIN if shared else SUBMIT)
    name, data = await _uploaded(request)
    source = Source(name, None if unit is None else Unit(unit), encoding)
    store: LibraryStore = request.app.state.engine.library
    owner = SHARED if shared else caller.principal

    def work() -> LibraryImport:
        library = import_library(data, source, format)
        if dry_run:
            return import_report(library, dry_run=True)
        written = store.put_all(owner, "tools", {t.id: t.model_dump(mode="json") for t in library.tools})
        return import_report(library, dry_run=False, versions={n: e.version for n, e in written.items()})

    return await run_in_threadpool(work)


async def _uploaded(request: Request) -> tuple[str, bytes]:
    """Name and bytes of the part ``library`` of a multipart form."""
    remedy = "curl -F library=@FILE"
    if not request.headers.get("content-type", "").lower().startswith("multipart/form-data"):
        raise RequestError("the body must be multipart/form-data", code="not_multipart", remedy=remedy)
    try:
        form = await request.form(max_files=2, max_fields=2)
    except HTTPException as error:
        if error.status_code == 413:
            raise
        raise RequestError(f"the multipart body cannot be read: {error.detail}", code="bad_multipart",
                           remedy=remedy) from None
    names = [n for n, _ in form.multi_items()]
    file = form.get("library")
    if names != ["library"] or not isinstance(file, UploadFile):
        raise RequestError("the form needs exactly one part 'library', a file", code="missing_part",
                           subjects=("library",), measured=len(names), limit=1, remedy=remedy)
    return file.filename or "library", await file.read(MAX_LIBRARY_BYTES + 1)


@router.get("/tools:export", operation_id="exportTools", summary="Export a tool library",
            response_class=Response,
            responses=FILE | responses(LibraryError, RequestError, NotFoundError, UnauthorizedError))
def export_tools(
        request: Request, principal: Principal,
        format: Annotated[WrittenFormat, Query(description="Format of the file.")],
        name: Annotated[list[str] | None, Query(max_length=1000, description="Names of tools; default: all that you "
                                                                             "can use.")] = None,
        allow_loss: Annotated[bool, Query(description="true: leave out tools and fields for which the format has no "
                                                      "place. false: refuse, with the list of them.")] = False
) -> Response:
    """A file of the tools in /v1/tools, in the format of another system.

    The newest version of each tool is written. docs/libraries.md lists what each format has no place for.

    Raises
    ------
    LibraryError
        export_loses: the format has no place for fields or kinds of these tools, and allow_loss is false.
    """
    store: LibraryStore = request.app.state.engine.library
    found = store.all(principal, "tools") if name is None else [store.get(principal, "tools", n) for n in name]
    tools = [Tool.model_validate(e.value).model_copy(update={"id": e.name}) if _fits(e.name) else
             Tool.model_validate(e.value) for e in found]
    written = export_library(tools, format)
    if not allow_loss and (written.losses or written.left_out):
        raise LibraryError(f"{written.format.title} has no place for all that these tools state",
                           code="export_loses", subjects=tuple({**written.losses, **written.left_out})[:MAX_SHOWN],
                           measured=dict(islice({**written.losses, **written.left_out}.items(), MAX_SHOWN)),
                           remedy="add allow_loss=true, or use format csv, xlsx or zonemill, which lose nothing")
    ending = written.format.endings[0]
    return Response(written.data, media_type=written.format.media,
                    headers={"Content-Disposition": f'attachment; filename="tools{ending}"'})


def _fits(name: str) -> bool:
    """Whether a name of the library is an id of a tool; entries with one id under two names then stay apart."""
    return name[:1].isalpha() and len(name) <= 32 and "." not in name

