"""Post a job with the client generated from openapi.yaml: ``python use_client.py DATA``; prints state and files."""

import io
import sys
import time

from step_text import STEP
from zm import Client
from zm.api.jobs import get_job, list_files
from zm.api.submissions import create_job
from zm.models.create_job_submission import CreateJobSubmission
from zm.models.quality import Quality
from zm.models.setup import Setup
from zm.models.tool import Tool
from zm.models.tool_kind import ToolKind
from zm.types import File

from service.api.server import background, settings_with
from service.logs import configure

configure("warning", "console")
with background(settings_with({"data_dir": sys.argv[1], "port": 0, "poll_s": 0.05}), "fake_chain") as url:
    client = Client(base_url=url)
    setup = Setup(tools=[Tool(id="T1", kind=ToolKind.BALL, diameter_mm=3.0)], quality=Quality(scallop_height_mm=0.02))
    body = CreateJobSubmission(part=File(io.BytesIO(STEP), "p.step", "model/step"), setup=setup)
    job = create_job.sync(client=client, body=body, idempotency_key="once")
    again = create_job.sync(client=client, body=CreateJobSubmission(
        part=File(io.BytesIO(STEP), "other.step", "model/step"), setup=setup), idempotency_key="once")
    assert getattr(again, "id", again) == getattr(job, "id", job), again
    while job.state in ("queued", "running"):
        time.sleep(0.05)
        job = get_job.sync(job.id, client=client)
    files = list_files.sync(job.id, client=client)
    print(job.state, len([f for f in files.items if f.name.endswith(".ngc")]))
