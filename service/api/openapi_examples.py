"""Examples for the OpenAPI document: an answer of every operation and a problem of every class.

They are built from the wire models, so that they fit the schema; a test validates each of them.
"""

from __future__ import annotations

from http import HTTPStatus
from typing import Any

from schemas.jobs import (
    Health,
    Job,
    JobEvent,
    JobFile,
    JobFiles,
    JobLinks,
    JobPage,
    JobSummary,
    MachineEntry,
    MachineList,
    MaterialEntry,
    MaterialList,
    ToolEntry,
    ToolList,
)
from schemas.keys import Key, KeyList, MadeKey
from schemas.libraries import ImportedEntry, LibraryImport
from schemas.machine import Machine
from schemas.materials import MATERIALS
from schemas.tools import BUILT_KINDS, Tool
from service.errors import ERROR_TABLE, problem_document

JOB_ID = "j0660cde19ab0bbcba666faa426aeaf78"
PATH = f"/v1/jobs/{JOB_ID}"
SHA = "dc01fa7ef75416456e8cc2fba6c89ee20e2be4cc29f8436b92e0842cc27e1903"
WHEN = "2026-01-31T12:00:00.000Z"
NO_KEY = "zm_0a1b2c3d4e5f_" + "x" * 43  # only the form of a key


def _job(state: str, stage: str, progress: float, **more: Any) -> Job:
    links = JobLinks(self=PATH, events=f"{PATH}/events", zones=f"{PATH}/zones", report=f"{PATH}/report",
                     files=f"{PATH}/files")
    return Job.model_validate({
        "id": JOB_ID, "kind": "plan", "state": state, "stage": stage, "progress": progress, "attempt": 0,
        "content_sha256": SHA, "part_sha256": SHA, "setup_sha256": SHA, "labels": {"order": "4711"},
        "created_at": WHEN, "links": links, **more})


QUEUED = _job("queued", "queued", 0.0)
PROVED = _job("proved", "proved", 1.0, attempt=1, started_at=WHEN, finished_at="2026-01-31T12:03:20.000Z",
              summary=JobSummary(complete=True, coverage=0.9991, reach_coverage=1.0, machining_time_s=4740.0))
FACTS = {"part": {"faces": 42, "volume_mm3": 15230.5, "bbox_mm": [[-30.0, -20.0, 0.0], [30.0, 20.0, 18.0]]},
         "walls": [{"id": "W1"}, {"id": "W2"}], "connections": [{"id": "C1", "walls": ["W1", "W2"]}],
         "channels": [{"id": "H1", "walls": ["W1", "W2"], "gap_min_mm": 3.2}],
         "accesses": [{"id": "A1", "axis": [0.0, 0.0, 1.0], "found": False, "rotary_deg": None}], "zones": [],
         "remainder": []}
TOOL = Tool.model_validate({"id": "T1", "kind": "ball", "diameter_mm": 3, "flute_length_mm": 9})
ABOUT = {"name": "finisher", "version": 3, "created_at": WHEN}
KEY = Key(id="0a1b2c3d4e5f", principal="mes", scopes=["submit", "read"], note="night shift", created_at=WHEN,
          expires_at="2027-01-31T12:00:00.000Z")
MATERIAL = MATERIALS["Ti-6Al-4V"]

ANSWERS: dict[str, Any] = {
    "createJob": QUEUED, "createZones": QUEUED, "createVerification": QUEUED, "getJob": PROVED,
    "cancelJob": _job("cancelled", "cancelled", 0.4, attempt=1, started_at=WHEN, finished_at=WHEN),
    "listJobs": JobPage(items=[PROVED], next_cursor="ajA2NjBjZGUxOWFi"), "getZones": FACTS,
    "getReport": {**FACTS, "state": "proved", "complete": True, "labels": {"order": "4711"},
                  "inputs": {"part_sha256": SHA, "setup_sha256": SHA}, "steps": [], "findings": [],
                  "coverage": 0.9991, "reach_coverage": 1.0, "machining_time_s": 4740.0, "tools": [],
                  "files": [{"name": "program.linuxcnc.ngc", "kind": "nc", "access": "A1", "dialect": "linuxcnc",
                             "sha256": SHA}], "version": "0.2.0"},
    "listFiles": JobFiles(items=[JobFile(name="program.linuxcnc.ngc", size_bytes=1793307, sha256=SHA,
                                         media_type="text/plain; charset=utf-8",
                                         href=f"{PATH}/files/program.linuxcnc.ngc")]),
    "listTools": ToolList(items=[ToolEntry(**ABOUT, entry=TOOL)]), "getTool": ToolEntry(**ABOUT, entry=TOOL),
    "importTools": LibraryImport(format="fusion", dry_run=True, taken=0, noted=1, left_out=1, entries=[
        ImportedEntry(place="entry 1", verdict="noted", notes=["flutes is not stated; 2 teeth are taken"],
                      library_id="T1", stated_kind="ball end mill", t_number=1, h_number=1, name="T1", tool=TOOL),
        ImportedEntry(place="entry 2", verdict="left_out", reason="kind 'lollipop mill' is not available",
                      library_id="T2", stated_kind="lollipop mill", t_number=2)]),
    "exportTools": "id,number,kind,diameter_mm\nT1,1,ball,3.0\n", "putTool": ToolEntry(**ABOUT, entry=TOOL),
    "listMachines": MachineList(items=[MachineEntry(**ABOUT, entry=Machine(max_rpm=18000))]),
    "getMachine": MachineEntry(**ABOUT, entry=Machine(max_rpm=18000)),
    "putMachine": MachineEntry(**ABOUT, entry=Machine(max_rpm=18000)),
    "listMaterials": MaterialList(items=[MaterialEntry(name="Ti-6Al-4V", entry=MATERIAL, built_in=True)]),
    "getMaterial": MaterialEntry(name="Ti-6Al-4V", entry=MATERIAL, built_in=True),
    "putMaterial": MaterialEntry(**ABOUT, entry=MATERIAL),
    "listKeys": KeyList(items=[KEY]), "createKey": MadeKey(key=NO_KEY, about=KEY),
    "capabilities": {
        "version": "0.2.0", "code": SHA, "kinds": ["plan", "zones", "verify"], "stepnc": ["AP238", "ISO 14649"],
        "dialects": [{"name": "linuxcnc", "extension": "ngc"}], "tools": list(BUILT_KINDS),
        "machines": ["3-axis", "5-axis"], "kinematics": ["table-table-AC"], "stock": ["part_offset", "box"],
        "materials": ["Ti-6Al-4V"], "webhooks": True, "slots": 4, "principal": "mes", "scopes": ["submit", "read"],
        "limits": {"body_bytes": 256000000, "job_time_s": 1800.0, "job_memory_bytes": 8000000000, "attempts": 3,
                   "submissions": "120/minute", "queued": 1000, "queued_each": 200, "deadline_s": [1.0, 604800.0],
                   "retention_days": None}},
    "healthz": Health(status="ok"),
    "readyz": Health(status="ok", checks={"database": "ok", "data_folder": "ok", "disk_space": "ok", "engine": "ok"}),
    "followJob": "event: progress\ndata: " + JobEvent(id=JOB_ID, state="running", stage="zones",
                                                      progress=0.12).model_dump_json(exclude_none=True) + "\nid: 4\n\n",
    "metrics": 'zonemill_jobs{state="queued"} 3.0\n', "getFile": "%\nG21\nG90\nM2\n%\n",
}
"""Successful answer of each operation, by its id, except those without a body (204)."""


def problem_samples() -> dict[str, dict[str, Any]]:
    """A problem document of every class, by its slug; two classes with one slug differ in their status."""
    found: dict[str, dict[str, Any]] = {}
    for kind, row in ERROR_TABLE.items():
        error = kind(f"{row.title}: one sentence with the details.", remedy="how to solve the problem")
        name = f"{row.slug}-{int(row.status)}" if row.slug in found else row.slug
        found.setdefault(name, problem_document(error, PATH, "3f2b8c1e5d6a4f7e9b0c1d2e3f4a5b6c"))
    return found


def add_samples(document: dict[str, Any]) -> None:
    """Put the examples into an OpenAPI document: problems once under components, with references from the answers.

    Problems that no answer uses are there too, since a failed job has one of them as its error.
    """
    problems = problem_samples()
    for item in document["paths"].values():
        for operation in item.values():
            for status, answer in operation["responses"].items():
                for media, content in answer.get("content", {}).items():
                    if media == "application/problem+json":
                        fitting = [s for s, p in problems.items() if p["status"] == int(status)]
                        titles = answer["description"].lower().split("; ")
                        named = [s for s in fitting if problems[s]["title"].lower() in titles]
                        content["examples"] = {s: {"$ref": f"#/components/examples/{s}"} for s in named}
                    elif int(status) < HTTPStatus.MULTIPLE_CHOICES and operation["operationId"] in ANSWERS:
                        content["example"] = _plain(ANSWERS[operation["operationId"]])
    document["components"]["examples"] = {
        s: {"summary": problems[s]["title"], "value": problems[s]} for s in sorted(problems)}


def _plain(value: Any) -> Any:
    return value.model_dump(mode="json") if hasattr(value, "model_dump") else value
