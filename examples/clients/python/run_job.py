"""Post a part with a setup built from typed classes, wait for the end, fetch the programs.

run_job.py PART.step OUT; ZONEMILL_BASE and ZONEMILL_KEY as for the curl scripts.
"""

import os
import sys
import time
from pathlib import Path

from zonemill_client import AuthenticatedClient, Client
from zonemill_client.api.jobs import get_file, get_job, list_files
from zonemill_client.api.submissions import create_job
from zonemill_client.models.create_job_submission import CreateJobSubmission
from zonemill_client.models.quality import Quality
from zonemill_client.models.setup import Setup
from zonemill_client.models.setup_labels import SetupLabels
from zonemill_client.models.stock import Stock
from zonemill_client.models.tool import Tool
from zonemill_client.models.tool_kind import ToolKind
from zonemill_client.types import File


def setup() -> Setup:
    """The setup, field by field."""
    labels = SetupLabels()
    labels["client"] = "python"
    tool = Tool(id="T1", kind=ToolKind.FLAT, diameter_mm=4.0, flute_length_mm=8.0, stickout_mm=20.0)
    return Setup(tools=[tool], quality=Quality(scallop_height_mm=0.05),
                 stock=Stock(margin_mm=0.5, uncertainty_mm=0.0), labels=labels)


def main(part: Path, out: Path) -> None:
    """Run the job."""
    base, key = os.environ.get("ZONEMILL_BASE", "http://127.0.0.1:8000"), os.environ.get("ZONEMILL_KEY")
    client = AuthenticatedClient(base_url=base, token=key) if key else Client(base_url=base)
    with part.open("rb") as step:
        body = CreateJobSubmission(part=File(step, part.name, "model/step"), setup=setup())
        job = create_job.sync(client=client, body=body, idempotency_key="client-python")
    while job.state in ("queued", "running"):
        time.sleep(0.5)
        job = get_job.sync(job.id, client=client)
    programs = [f.name for f in list_files.sync(job.id, client=client).items if f.name.startswith("program.")]
    for name in programs:
        got = get_file.sync_detailed(job.id, name, client=client)
        (out / name).write_bytes(got.content)
    print(f"{job.state}, coverage {job.summary.coverage:.4f}, {len(programs)} programs")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
