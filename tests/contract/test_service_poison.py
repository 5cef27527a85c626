"""Jobs that crash, hoard, hang and break beside healthy ones: each is told by name, and nobody else notices.

``make soak K=poison`` has ten of each and prints how long healthy jobs take beside them and alone, and how long a slot
stays empty.
"""

import statistics
import time

import pytest

from tests.contract.test_service_input import STEP
from tests.time_limits import in_time

POISON = {"segfault": "job_crashed", "memory": "job_memory", "killed": "job_killed", "bug": "bug", "open": "open_shell",
          "kernel": "kernel_failed", "loop": "job_timeout", "sleep": "job_timeout"}
SLOTS = 2


@pytest.fixture
def service(make_client):
    return make_client(workers=SLOTS, job_time_limit_s=20, job_memory_limit_mb=400)


@pytest.fixture
def play(service, post, finish, setup_json):
    """Post jobs and see each end as it should: (what they do, '' a healthy one) -> their rows."""
    posted = 0

    def run(deeds):
        nonlocal posted
        jobs = []
        for do in deeds:
            posted += 1  # each a content of its own
            wanted = setup_json(do, quality={"scallop_height_mm": 0.01 + posted / 100_000})
            jobs.append((do, post(service, setup=wanted).json()))
        for do, job in jobs:
            job = finish(service, job, patience=30 + 10 * len(deeds))
            if do:
                assert job["state"] == "failed" and job["error"]["code"] == POISON[do], job
            else:
                assert (job["state"], job["attempt"]) == ("proved", 1), job
        return [service.app.state.engine.jobs.get(job["id"]) for _, job in jobs]

    return run


def took(rows, deeds):
    """s, of the healthy ones."""
    return [row["finished"] - row["started"] for row, do in zip(rows, deeds, strict=True) if not do]


def empty(rows):
    """s that slots stood empty while jobs waited: each start but the first ones takes the slot of an end before it."""
    ends, starts = sorted(r["finished"] for r in rows), sorted(r["started"] for r in rows)
    return [s - e for s, e in zip(starts[SLOTS:], ends, strict=False)]


@pytest.mark.slow
def test_healthy_jobs_are_proved_beside_poison_and_the_slots_come_back(service, play, post):
    deeds = [d for do in POISON for d in (do, "")]
    rows = play(deeds)
    assert in_time(max(took(rows, deeds)), 6) and in_time(max(empty(rows)), 2)
    # both slots are free again: two more run at the same time
    pair = [post(service, "nap").json(), post(service, "nap", part=STEP + b"\n").json()]
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline:
        states = [service.get(j["links"]["self"]).json()["state"] for j in pair]
        if states == ["running", "running"] or "proved" in states:
            break
        time.sleep(0.02)
    assert states == ["running", "running"]
    assert not [p for p in service.app.state.engine.artifacts.tmp.iterdir() if p.name.startswith("job-")][2:]


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_a_slot_is_back_within_two_seconds_of_any_poison(play):
    deeds = [d for do in 10 * list(POISON) for d in (do, "")]
    alone, beside = took(play([""] * 20), [""] * 20), play(deeds)
    gaps, healthy = empty(beside), took(beside, deeds)
    print(f"healthy: alone median {statistics.median(alone):.2f} s, longest {max(alone):.2f}; beside poison median "
          f"{statistics.median(healthy):.2f} s, longest {max(healthy):.2f}; a slot empty median "
          f"{statistics.median(gaps):.2f} s, longest {max(gaps):.2f} s of {len(gaps)}")
    assert max(gaps) < 2.0
