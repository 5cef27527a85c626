"""Server-sent events."""

import json
import threading
import time

from fastapi.testclient import TestClient
from sqlalchemy.exc import OperationalError


def _events(text):
    found = []
    for block in text.split("\n\n"):
        fields = dict(line.split(": ", 1) for line in block.splitlines() if ": " in line and not line.startswith(":"))
        if fields:
            found.append((fields["event"], int(fields["id"]), json.loads(fields["data"])))
    return found


def test_events_run_to_the_final_state(client, post):
    job = post(client, "").json()
    with client.stream("GET", job["links"]["events"]) as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        events = _events("".join(stream.iter_text()))
    assert [e[0] for e in events[:-1]] == ["progress"] * (len(events) - 1) and events[-1][0] == "end"
    assert events[-1][2] == {"id": job["id"], "state": "proved", "stage": "proved", "progress": 1.0}
    assert [e[1] for e in events] == sorted({e[1] for e in events})


def test_progress_is_seen_while_the_job_runs(client, post):
    job = post(client, "sleep").json()
    begun = []

    def cancel_while_asleep():
        """On a busy machine the job takes its time to fall asleep."""
        while client.get(job["links"]["self"]).json()["stage"] != "asleep":
            time.sleep(0.05)
        begun.append(time.monotonic())
        time.sleep(2.5)
        client.delete(job["links"]["self"])

    # the test client hands a stream over when it has ended, so the job is cancelled from a second thread
    thread = threading.Thread(target=cancel_while_asleep)
    thread.start()
    with client.stream("GET", job["links"]["events"]) as stream:
        seen = _events("".join(stream.iter_text()))
    slept = time.monotonic() - begun[0]
    thread.join()
    moving = [e for e in seen if e[2]["stage"] == "asleep"]
    assert len(moving) >= 2 and moving[-1][2]["progress"] > moving[0][2]["progress"]
    assert len(moving) <= slept * 6 + 1  # a few a second
    assert seen[-1][0] == "end" and seen[-1][2]["state"] == "cancelled"


def test_who_comes_late_gets_the_end_and_who_had_it_gets_204(client, post, finish):
    job = finish(client, post(client, "").json())
    with client.stream("GET", job["links"]["events"]) as stream:
        (event,) = _events("".join(stream.iter_text()))
    assert event[0] == "end"
    again = client.get(job["links"]["events"], headers={"Last-Event-ID": str(event[1])})
    assert again.status_code == 204
    for odd in ("1", "x", "²"):
        answer = client.get(job["links"]["events"], headers={"Last-Event-ID": odd.encode()})
        assert answer.status_code == 200 and "end" in answer.text


def test_a_principal_has_so_many_streams_at_a_time(make_client, post):
    client = make_client(max_streams_each=2)
    job = post(client, "sleep").json()
    streams = client.app.state.streams
    streams["local"] = 2
    answer = client.get(job["links"]["events"])
    assert answer.status_code == 429 and answer.json()["code"] == "too_many_streams"
    streams["local"] = 1
    threading.Timer(0.5, lambda: client.delete(job["links"]["self"])).start()
    with client.stream("GET", job["links"]["events"]) as stream:
        assert "event: end" in "".join(stream.iter_text())
    assert streams["local"] == 1  # what has ended counts no more


def test_a_stream_ends_in_order_when_the_database_goes_away(make_client, post, monkeypatch):
    client = make_client()
    job, jobs = post(client, "sleep").json(), client.app.state.engine.jobs
    get = jobs.get

    def away(job_id, principal=None):
        if principal is None:  # as the stream asks, once it is open
            raise OperationalError("SELECT", {}, Exception("gone"))
        return get(job_id, principal)

    monkeypatch.setattr(jobs, "get", away)
    strict = TestClient(client.app, base_url=str(client.base_url))  # raises what the server would log as its error
    answer = strict.get(job["links"]["events"])
    assert answer.status_code == 200 and len(_events(answer.text)) == 1
    assert client.app.state.streams["local"] == 0


def test_no_such_job(client):
    assert client.get("/v1/jobs/j0/events").json()["code"] == "no_such_job"
