"""Jobs that crash, hoard, hang and break beside healthy ones: each is told by name, and nobody else notices."""

import time

from tests.contract.test_service_input import STEP

POISON = {"segfault": "job_crashed", "memory": "job_memory", "killed": "job_killed", "bug": "bug", "open": "open_shell",
          "sleep": "job_timeout"}


def test_healthy_jobs_are_proved_beside_poison_and_the_slots_come_back(make_client, post, finish, setup_json):
    client = make_client(workers=2, job_time_limit_s=6, job_memory_limit_mb=400)
    posted = []
    for k, do in enumerate(POISON):
        posted.append((do, post(client, do).json()))
        healthy = setup_json("", quality={"scallop_height_mm": 0.01 + k / 1000})  # each a content of its own
        posted.append((None, post(client, setup=healthy).json()))
    for do, job in posted:
        job = finish(client, job, patience=90)
        if do is None:
            assert (job["state"], job["attempt"]) == ("proved", 1), job
        else:
            assert job["state"] == "failed" and job["error"]["code"] == POISON[do], job
    # both slots are free again: two more run at the same time
    pair = [post(client, "nap").json(), post(client, "nap", part=STEP + b"\n").json()]
    deadline = time.monotonic() + 5
    while time.monotonic() < deadline:
        states = [client.get(j["links"]["self"]).json()["state"] for j in pair]
        if states == ["running", "running"] or "proved" in states:
            break
        time.sleep(0.02)
    assert states == ["running", "running"]
    assert not [p for p in client.app.state.engine.artifacts.tmp.iterdir() if p.name.startswith("job-")][2:]
