"""Converts database rows and result folders into the wire models of jobs and files."""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

from sqlalchemy.engine import RowMapping

from geometry.errors import error_from_dict
from schemas.estimate import JobEstimate
from schemas.jobs import FINAL_STATES, Job, JobEvent, JobFile, JobFiles, JobLinks, JobResumed, JobSummary, JobWebhook
from schemas.keys import Key
from schemas.problem import Problem
from service.errors import GoneError, NotFoundError, NotReadyError, RequestError, WithheldError, problem_document
from service.jobs.artifacts import Artifacts

MEDIA_TYPES = {".json": "application/json", ".png": "image/png", ".stpnc": "model/step", ".svg": "image/svg+xml",
               ".html": "text/html; charset=utf-8", ".pdf": "application/pdf", ".bin": "application/octet-stream"}
INTERNAL_FILES = frozenset({"state"})


def path_of(row: RowMapping) -> str:
    """Path of a job."""
    return f"/v1/jobs/{row['id']}"


def time_text(seconds: float | None) -> str | None:
    """A time of the database as text: UTC, ISO 8601."""
    if seconds is None:
        return None
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def job_resource(row: RowMapping) -> Job:
    """The job as wire model."""
    path, kind = path_of(row), row["kind"]
    links = JobLinks(self=path, events=f"{path}/events", files=f"{path}/files", view=f"{path}/view",
                     zones=f"{path}/zones" if kind != "verify" else None,
                     report=f"{path}/report" if kind != "zones" else None)
    error = None
    if row["error_json"]:
        error = Problem(**problem_document(error_from_dict(json.loads(row["error_json"])), path))
    return Job(id=row["id"], kind=kind, state=row["state"], stage=row["stage"], progress=row["progress"],
               attempt=row["attempt"], resumed=_resumed(row), estimate=_estimate(row),
               content_sha256=row["content_sha256"], part_sha256=row["part_sha256"],
               setup_sha256=row["setup_sha256"], stock_sha256=row["stock_sha256"],
               labels=json.loads(row["labels_json"]), created_at=time_text(row["created"]) or "",
               started_at=time_text(row["started"]), deadline_at=time_text(row["deadline"]),
               finished_at=time_text(row["finished"]), expired_at=time_text(row["expired"]), error=error,
               links=links, webhook=_webhook(row), library=json.loads(row["library_json"] or "[]"),
               summary=JobSummary(**json.loads(row["summary_json"])) if row["summary_json"] else None)


def key_resource(row: RowMapping) -> Key:
    """A key as wire model, without its secret and hash."""
    return Key(id=row["id"], principal=row["principal"], scopes=row["scopes"].split(","), note=row["note"],
               created_at=time_text(row["created"]) or "", expires_at=time_text(row["expires"]),
               revoked_at=time_text(row["revoked"]), last_used_at=time_text(row["last_used"]))


def _webhook(row: RowMapping) -> JobWebhook | None:
    if row["webhook_url"] is None:
        return None
    waits = row["webhook_state"] == "pending" and row["webhook_attempts"]
    return JobWebhook(url=row["webhook_url"], state=row["webhook_state"], attempts=row["webhook_attempts"],
                      next_attempt_at=time_text(row["webhook_due"]) if waits else None, problem=row["webhook_problem"])


def _resumed(row: RowMapping) -> JobResumed | None:
    if not row["resumed_json"]:
        return None
    taken = json.loads(row["resumed_json"])
    return JobResumed(plans=taken.get("plan", 0), steps=taken.get("acts", 0), proofs=taken.get("proof", 0))


def _estimate(row: RowMapping) -> JobEstimate | None:
    return JobEstimate(**json.loads(row["estimate_json"])) if row["estimate_json"] else None


def event_data(row: RowMapping) -> str:
    """Data of one event, JSON."""
    return JobEvent(id=row["id"], state=row["state"], stage=row["stage"], progress=row["progress"],
                    resumed=_resumed(row), estimate=_estimate(row)).model_dump_json(exclude_none=True)


def encode_cursor(job_id: str) -> str:
    """The cursor after a job."""
    return base64.urlsafe_b64encode(job_id.encode()).decode().rstrip("=")


def decode_cursor(cursor: str) -> str:
    """The job of a cursor.

    Raises
    ------
    RequestError
        The text is not a cursor of this service.
    """
    try:
        text = base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)).decode("ascii")
    except (binascii.Error, ValueError):
        text = ""
    if not (text.startswith("j") and text[1:].isalnum() and len(text) <= 40):
        raise RequestError("the cursor is not from this service", code="bad_cursor", subjects=("cursor",),
                           remedy="use next_cursor of the previous page")
    return text


def result_folder(artifacts: Artifacts, row: RowMapping) -> Path:
    """Folder of the result of a job.

    Raises
    ------
    NotReadyError
        The job has not ended, or ended without a result.
    GoneError
        Its files have expired.
    NotFoundError
        The data folder has lost it.
    """
    if row["state"] not in FINAL_STATES:
        raise NotReadyError(f"job {row['id']} is {row['state']}", subjects=(row["id"],),
                            remedy=f"wait until it ends; GET {path_of(row)}/events follows it")
    if row["expired"] is not None:
        raise GoneError(f"the files of job {row['id']} were deleted at {time_text(row['expired'])}",
                        subjects=(row["id"],), remedy="post the same content again")
    if not row["artifact"]:
        cancelled = row["state"] == "cancelled"
        remedy = ("the job was cancelled: post it again, with another Idempotency-Key if it had one" if cancelled else
                  f"GET {path_of(row)} has the reason under error")
        raise NotReadyError(f"job {row['id']} ended as {row['state']} without a result", code="no_result",
                            subjects=(row["id"],), remedy=remedy)
    folder = artifacts.result(row["artifact"])
    if not folder.is_dir():
        raise NotFoundError(f"the files of job {row['id']} are missing in the data folder", code="result_gone",
                            subjects=(row["id"],), remedy="post the same content again")
    return folder


def is_program(name: str) -> bool:
    """Whether a file drives a machine: NC programs and STEP-NC."""
    return name.endswith(".stpnc") or name.startswith("program.")


def withheld(folder: Path, row: RowMapping) -> WithheldError:
    """The error for the programs of an unproved job, with the reason."""
    findings: list[Any] = []
    report = folder / "report.json"
    if report.exists():
        findings = json.loads(report.read_bytes()).get("findings") or []
    first = f"; first finding: {json.dumps(findings[0], sort_keys=True)[:300]}" if findings else ""
    return WithheldError(f"job {row['id']} is {row['state']}, so its NC and STEP-NC files are withheld{first}",
                         subjects=(row["id"],), measured=findings[:20], limit=[],
                         remedy=f"GET {path_of(row)}/report lists findings and remainder")


def list_files(folder: Path, row: RowMapping) -> JobFiles:
    """The files of a job that can be downloaded."""
    proved = row["state"] == "proved"
    items = [JobFile(name=p.name, size_bytes=p.stat().st_size, sha256=file_sha256(p), media_type=media_type(p.name),
                     href=f"{path_of(row)}/files/{p.name}")
             for p in sorted(folder.iterdir())
             if p.is_file() and p.name not in INTERNAL_FILES and (proved or not is_program(p.name))]
    reason = withheld(folder, row).message if row["kind"] == "plan" and not proved else None
    return JobFiles(items=items, withheld=reason)


def find_file(folder: Path, row: RowMapping, name: str) -> Path:
    """One file of a job.

    Raises
    ------
    WithheldError
        It is a program, and the job is not proved.
    NotFoundError
        There is no such file.
    """
    if is_program(name) and row["state"] != "proved":
        raise withheld(folder, row)
    known = {p.name: p for p in folder.iterdir() if p.is_file() and p.name not in INTERNAL_FILES}
    if name not in known:
        raise NotFoundError(f"job {row['id']} has no file '{name}'", code="no_such_file", subjects=(name,),
                            remedy=f"GET {path_of(row)}/files lists the files")
    return known[name]


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, hex; it is cached until the file changes."""
    found = path.stat()
    return _sha256(path, found.st_mtime_ns, found.st_size)


@lru_cache(maxsize=4096)
def _sha256(path: Path, _mtime_ns: int, _size: int) -> str:
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def media_type(name: str) -> str:
    """Media type by extension; programs are plain text."""
    return MEDIA_TYPES.get(Path(name).suffix, "text/plain; charset=utf-8")
