"""Multipart submissions: part, setup and program, checked before anything is queued."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from fastapi import Request
from python_multipart.multipart import parse_options_header
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from geometry.errors import InputError, ProgramError, SetupError
from geometry.step_import.text_checks import check_text
from schemas.setup import Setup, canonical_json, setup_sha256
from service.errors import RequestError
from service.from_wire import blank_error, check_plannable, check_spindle_tool, no_stock_file, parse_setup
from service.jobs.artifacts import Artifacts
from service.jobs.engine import Engine
from service.jobs.job_store import NewJob
from service.jobs.webhooks import registered

CHUNK = 1 << 20
MAX_SETUP_BYTES = 4_000_000
KEY_LIMIT = 255
TOOL_DIGITS = 6
SPINDLE_TOOL, STOCK, DEADLINE, WEBHOOK = "spindle_tool", "stock", "deadline_s", "webhook_url"
DEADLINE_S = (1, 604800)  # a week


@dataclass(frozen=True)
class SubmissionForm:
    """The parts of a multipart request, as sent."""

    part: UploadFile
    setup: bytes
    program: UploadFile | None
    spindle_tool: int = 0
    stock: UploadFile | None = None
    deadline_s: float | None = None
    webhook_url: str | None = None


async def read_form(request: Request, *, with_program: bool) -> SubmissionForm:
    """Read a multipart form and spool its files to disk, within the body limit of the application.

    Raises
    ------
    RequestError
        A part is missing, repeated or unknown, or a field has a wrong value.
    SetupError
        The setup is larger than 4 MB.
    """
    wanted = {"part", "setup"} | ({"program"} if with_program else set())
    if not request.headers.get("content-type", "").lower().startswith("multipart/form-data"):
        raise RequestError("the body must be multipart/form-data", code="not_multipart",
                           remedy="curl -F part=@PART.step -F 'setup=@SETUP.json;type=application/json'")
    _check_charset(request.headers["content-type"])
    try:
        form = await request.form(max_files=7, max_fields=7, max_part_size=MAX_SETUP_BYTES)
    except HTTPException as error:
        if error.status_code == 413:
            raise
        raise RequestError(f"the multipart body cannot be read: {error.detail}", code="bad_multipart",
                           remedy="let the client write the multipart body: curl -F part=@PART.step -F "
                                  "'setup=@SETUP.json;type=application/json'") from None
    names = [name for name, _ in form.multi_items()]
    optional = {STOCK, DEADLINE, WEBHOOK} | ({SPINDLE_TOOL} if with_program else set())
    for name in sorted(set(names) - wanted - optional):
        raise RequestError(f"the form has an unknown part '{name}'", subjects=(name,), code="unknown_part",
                           remedy=f"send {' and '.join(sorted(wanted))}, each once; optional: "
                                  + ", ".join(sorted(optional)))
    for name in sorted(wanted | (optional & set(names))):
        if (count := names.count(name)) != 1:
            raise RequestError(f"the form needs exactly one part '{name}', there are {count or 'none'}",
                               subjects=(name,), code="repeated_part" if count else "missing_part", measured=count,
                               limit=1, remedy=f"send {' and '.join(sorted(wanted))}, each once")
    part, program, stock = form["part"], form.get("program"), form.get(STOCK)
    for name in ("part", *(["program"] if with_program else []), *([STOCK] if STOCK in names else [])):
        if not isinstance(form[name], UploadFile):
            raise RequestError(f"'{name}' must be sent as a file, with a file name", code="not_a_file",
                               subjects=(name,), remedy=f"curl -F {name}=@FILE")
    assert isinstance(part, UploadFile)
    return SubmissionForm(part, await _bytes_of(form["setup"]), program if isinstance(program, UploadFile) else None,
                _tool_number(await _bytes_of(form[SPINDLE_TOOL])) if SPINDLE_TOOL in names else 0,
                stock if isinstance(stock, UploadFile) else None,
                _deadline(await _bytes_of(form[DEADLINE])) if DEADLINE in names else None,
                (await _bytes_of(form[WEBHOOK])).decode("latin-1") if WEBHOOK in names else None)


def _check_charset(content_type: str) -> None:
    """Refuse any charset but UTF-8.

    The framework would decode text with any codec of Python that the header names. Some of them take hours for a
    megabyte
    (punycode, idna), and one raises an error for any input (undefined).
    """
    charset = parse_options_header(content_type)[1].get(b"charset", b"utf-8")  # as the framework reads it
    if charset.lower() not in (b"utf-8", b"utf8", b"us-ascii"):
        raise RequestError("the text of a form must be UTF-8", code="bad_multipart", subjects=("content-type",),
                           measured=ascii(charset)[:80], limit="utf-8", remedy="leave out charset in Content-Type")


def _tool_number(data: bytes) -> int:
    if not data.isdigit() or len(data) > TOOL_DIGITS:
        raise RequestError(f"{SPINDLE_TOOL} must be a T number, digits only", code="bad_spindle_tool",
                           subjects=(SPINDLE_TOOL,), measured=ascii(data[:20]),
                           remedy="send the number of the tool in the spindle, or leave the field out")
    return int(data)


def _deadline(data: bytes) -> float:
    try:
        value = float(data) if len(data) <= 20 else math.nan
    except ValueError:
        value = math.nan
    if not DEADLINE_S[0] <= value <= DEADLINE_S[1]:
        raise RequestError(f"{DEADLINE} must be a number of seconds", code="bad_deadline", subjects=(DEADLINE,),
                           measured=ascii(data[:20]), limit=list(DEADLINE_S),
                           remedy="send seconds from now, up to a week, or leave the field out")
    return value


async def _bytes_of(field: Any) -> bytes:
    if not isinstance(field, UploadFile):
        return str(field).encode()
    data = await field.read(MAX_SETUP_BYTES + 1)
    if len(data) > MAX_SETUP_BYTES:
        raise SetupError("the setup is larger than 4 MB", code="setup_too_large", limit=MAX_SETUP_BYTES,
                         remedy="leave out data that the job does not need; 200 tools are less than 1 MB")
    return data


def new_job(engine: Engine, kind: str, principal: str, key: str | None, form: SubmissionForm) -> NewJob:
    """Check and store the upload, and describe the job. It runs in a thread, since it reads and writes files.

    Raises
    ------
    StepError, SetupError, ProgramError
        An uploaded file is wrong; nothing is queued.
    RequestError
        The Idempotency-Key is empty or too long, or the webhook URL is not allowed.
    """
    if key is not None and not 1 <= len(key) <= KEY_LIMIT:
        raise RequestError(f"an Idempotency-Key has 1 to {KEY_LIMIT} characters", code="bad_idempotency_key",
                           measured=len(key), limit=KEY_LIMIT, remedy="use a UUID, for example")
    webhook = registered(form.webhook_url, engine.settings) if form.webhook_url is not None else None
    library = engine.library.view(principal)
    setup = parse_setup(form.setup, library)
    if kind != "verify":
        check_plannable(setup)
    check_spindle_tool(setup, form.spindle_tool)
    if (setup.stock.kind == "step") != (form.stock is not None):
        raise no_stock_file() if form.stock is None else _stock_not_asked(setup.stock.kind)
    part_sha = store_part(engine.artifacts, form.part.file)
    stock_sha = _store_stock(engine.artifacts, form.stock.file) if form.stock else None
    program_sha = _store_program(engine.artifacts, form.program.file) if form.program else None
    setup_sha = setup_sha256(setup)
    content = content_of(part_sha, setup_sha, program_sha, form.spindle_tool, stock_sha)
    return NewJob(kind, principal, content, part_sha, setup_sha, canonical_json(setup).decode(), _labels(setup),
                  program_sha, form.spindle_tool, key, stock_sha, form.deadline_s, webhook, library.as_json())


def store_part(artifacts: Artifacts, file: BinaryIO) -> str:
    """Store a STEP file and return its hash. Its text is checked first, since other jobs may use the same bytes.

    Raises
    ------
    StepError
        The file is empty, truncated or not a STEP file, or has dangling references.
    """
    def check(path: Path) -> None:
        try:
            check_text(path)
        except InputError as error:
            named = tuple("part" if s == path.name else s for s in error.subjects)
            raise type(error)(error.message, code=error.code, subjects=named, measured=error.measured,
                              limit=error.limit, remedy=error.remedy) from None

    return artifacts.put_blob(_chunks(file), check)[0]


def _store_stock(artifacts: Artifacts, file: BinaryIO) -> str:
    try:
        return store_part(artifacts, file)
    except InputError as error:
        raise blank_error(error) from None


def _stock_not_asked(kind: str) -> SetupError:
    return SetupError(f"the form has a file of the blank, but the setup has stock.kind '{kind}'",
                      code="stock_not_asked", subjects=(STOCK, "stock.kind"), measured=kind, limit="step",
                      remedy="set stock.kind 'step' in the setup, or leave out the part 'stock' of the form")


def _store_program(artifacts: Artifacts, file: BinaryIO) -> str:
    sha, size = artifacts.put_blob(_chunks(file))
    if size == 0:
        raise ProgramError("the program is empty", code="empty_program", measured=0, limit=1,
                           remedy="send the NC program as part 'program'")
    return sha


def _chunks(file: BinaryIO) -> Iterator[bytes]:
    file.seek(0)
    while chunk := file.read(CHUNK):
        yield chunk


def content_of(part_sha256: str, setup_sha: str, program_sha256: str | None = None,
               spindle_tool: int = 0, stock_sha256: str | None = None) -> str:
    """The content hash of ``schemas.setup.content_hash``, from hashes; a program and its ``spindle_tool`` count too."""
    text = f"{part_sha256}:{setup_sha}" + (f":stock {stock_sha256}" if stock_sha256 else "")
    text += f":{program_sha256}" if program_sha256 else ""
    text += f":T{spindle_tool}" if spindle_tool else ""
    return hashlib.sha256(text.encode()).hexdigest()


def _labels(setup: Setup) -> dict[str, str]:
    return dict(setup.labels)
