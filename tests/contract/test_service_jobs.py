"""The life of a job over HTTP."""

import errno
import hashlib
import runpy
import subprocess
import time
from pathlib import Path

import psutil
import pytest

from schemas.setup import content_hash
from service.from_wire import parse_setup
from service.jobs.job_child import JOB_MODULE
from tests.time_limits import in_time

STEP = runpy.run_path(str(Path(__file__).parent / "fakes" / "step_text.py"))["STEP"]


def test_a_job_is_accepted_computed_and_its_files_are_there(client, post, finish, setup_json):
    answer = post(client, "")
    assert answer.status_code == 202
    job = answer.json()
    assert answer.headers["Location"] == job["links"]["self"] == f"/v1/jobs/{job['id']}"
    assert job["state"] in ("queued", "running") and job["kind"] == "plan"
    assert job["content_sha256"] == content_hash(STEP, parse_setup(setup_json()))
    job = finish(client, job)
    assert (job["state"], job["progress"], job["error"]) == ("proved", 1.0, None)
    assert job["finished_at"] >= job["created_at"]
    assert client.get(job["links"]["report"]).json()["state"] == "proved"
    assert set(client.get(job["links"]["zones"]).json()) == {"part", "walls", "connections", "channels", "zones",
                                                            "remainder"}
    files = client.get(job["links"]["files"]).json()
    assert [f["name"] for f in files["items"]] == ["deviation.png", "job.stpnc", "program.linuxcnc.ngc", "report.json",
                                                   "sheet.html", "sheet.pdf", "zones.json"]
    assert files["withheld"] is None
    for item in files["items"]:
        got = client.get(item["href"])
        assert got.status_code == 200 and len(got.content) == item["size_bytes"]
        assert hashlib.sha256(got.content).hexdigest() == item["sha256"]


def test_head_is_get_without_the_body(client, post, finish):
    job = finish(client, post(client, "").json())
    links = job["links"]
    paths = ["/healthz", "/readyz", "/v1/jobs", links["self"], links["report"], links["files"],
             f"{links['files']}/program.linuxcnc.ngc", "/v1/materials"]
    for path in paths:
        head, get = client.head(path), client.get(path)
        assert head.status_code == get.status_code == 200 and head.content == b""
        for name in ("content-length", "content-type", "etag"):
            assert head.headers.get(name) == get.headers.get(name)
    assert client.head(f"{links['files']}/none").status_code == 404
    assert client.head("/v1/zones").status_code == client.head(links["events"]).status_code == 405


def test_what_the_client_has_is_not_sent_again(client, post, finish):
    links = finish(client, post(client, "").json())["links"]
    for path in (f"{links['files']}/program.linuxcnc.ngc", links["report"], links["zones"]):
        tag = client.get(path).headers["etag"]
        for given in (tag, f"W/{tag}", f'"other", {tag}', "*"):
            again = client.get(path, headers={"If-None-Match": given})
            assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
        assert client.get(path, headers={"If-None-Match": '"other"'}).status_code == 200


def test_programs_of_an_unproved_job_are_withheld_with_the_finding(client, post, finish):
    job = finish(client, post(client, "gouge").json())
    assert job["state"] == "unproved"
    files = client.get(job["links"]["files"]).json()
    assert [f["name"] for f in files["items"]] == ["deviation.png", "report.json", "sheet.html", "sheet.pdf",
                                                   "zones.json"]
    assert "gouge" in files["withheld"]
    # those that are there, and those that are not: which of them were written is nobody's business
    for name in ("program.linuxcnc.ngc", "program.A2.linuxcnc.ngc", "job.stpnc", "job.arm.stpnc", "job.A2.stpnc"):
        for headers in ({}, {"If-None-Match": "*"}, {"Range": "bytes=0-9"}):
            answer = client.get(f"{job['links']['files']}/{name}", headers=headers)
            assert answer.status_code == 409 and answer.json()["code"] == "program_withheld"
            assert answer.headers["content-type"].startswith("application/problem+json")
            assert answer.json()["measured"][0]["kind"] == "gouge" and "gouge" in answer.json()["detail"]
        assert client.head(f"{job['links']['files']}/{name}").status_code == 409
    assert client.get(job["links"]["report"]).json()["findings"][0]["kind"] == "gouge"


def test_no_name_leads_round_the_withholding(client, post, finish):
    job = finish(client, post(client, "gouge").json())
    for name in ("state", "..%2Fprogram.linuxcnc.ngc", "%2e%2e%2fstate", "PROGRAM.linuxcnc.ngc",
                 "program.linuxcnc.ngc%00.png", "program%2Elinuxcnc%2Engc", "./program.linuxcnc.ngc"):
        answer = client.get(f"{job['links']['files']}/{name}")
        assert answer.status_code in (404, 409) and b"G21" not in answer.content, name


def test_the_deviation_map_is_a_file_of_plans_and_verifications(client, post, finish):
    for job in (finish(client, post(client, "gouge").json()),
                finish(client, post(client, path="/v1/verifications", program=b"(GOUGE)\nM2\n").json())):
        assert "deviation.png" in [f["name"] for f in client.get(job["links"]["files"]).json()["items"]]
        answer = client.get(f"{job['links']['files']}/deviation.png")
        assert answer.status_code == 200 and answer.headers["content-type"] == "image/png"


def test_the_setup_sheet_is_a_file_of_every_plan(client, post, finish):
    for what in ("", "gouge"):
        links = finish(client, post(client, what).json())["links"]
        listed = {f["name"]: f["media_type"] for f in client.get(links["files"]).json()["items"]}
        for name, kind in (("sheet.html", "text/html; charset=utf-8"), ("sheet.pdf", "application/pdf")):
            answer = client.get(f"{links['files']}/{name}")
            assert answer.status_code == 200 and answer.headers["content-type"] == listed[name] == kind
            # labels are the user's words: the page is saved, not opened in the name of the service
            assert answer.headers["content-disposition"].startswith("attachment")
            assert answer.headers["x-content-type-options"] == "nosniff"


def test_zones_and_verifications_are_jobs_too(client, post, finish):
    zones = finish(client, post(client, path="/v1/zones").json())
    assert (zones["kind"], zones["state"]) == ("zones", "done")
    assert zones["links"]["report"] is None
    assert client.get(zones["links"]["zones"]).json()["part"]["faces"] == 6
    assert client.get(f"{zones['links']['self']}/report").json()["code"] == "no_such_document"
    good = finish(client, post(client, path="/v1/verifications", program=b"G21\nM2\n").json())
    bad = finish(client, post(client, path="/v1/verifications", program=b"(GOUGE)\nM2\n").json())
    high = finish(client, post(client, path="/v1/verifications", program=b"(HIGH)\nM2\n").json())
    assert (good["state"], high["state"], bad["state"]) == ("proved", "clean", "unproved")
    assert high["summary"]["findings"] == 1 and high["finished_at"] and high["error"] is None
    assert [j["id"] for j in client.get("/v1/jobs?state=clean").json()["items"]] == [high["id"]]
    assert 'zonemill_jobs{state="clean"} 1.0' in client.get("/metrics").text
    events = client.get(high["links"]["events"]).text
    assert events.count("event: end") == 1 and '"state":"clean"' in events.replace(" ", "")
    assert client.get(bad["links"]["report"]).json()["findings"] == [{"kind": "gouge"}]
    held = [post(client, path="/v1/verifications", program=b"(SPINDLE)\nM2\n", key="t", spindle_tool=n)
            for n in ("1", "1", "0")]
    assert [a.status_code for a in held] == [202, 202, 422] and held[0].json()["id"] == held[1].json()["id"]
    assert client.get(finish(client, held[0].json())["links"]["report"]).json()["findings"] == [{"spindle_tool": 1}]


def test_same_key_and_content_is_the_same_job_and_other_content_is_refused(client, post, setup_json):
    setup = setup_json("", quality={"scallop_height_mm": 0.02})
    first = post(client, key="k1", setup=setup)
    # the meaning counts, not the bytes: defaults written out and another order of keys
    same = post(client, key="k1", setup={**setup, "stock": {"margin_mm": 1}, "labels": {}})
    assert first.json()["id"] == same.json()["id"] and same.status_code == 202
    other = post(client, key="k1", setup=setup_json("", quality={"scallop_height_mm": 0.03}))
    assert other.status_code == 422 and other.json()["code"] == "idempotency_key_reused"
    kind = post(client, key="k1", setup=setup, path="/v1/zones")
    assert kind.status_code == 422 and kind.json()["code"] == "idempotency_key_reused"
    assert (kind.json()["measured"], kind.json()["limit"]) == ("zones", "plan") and "kind" in kind.json()["detail"]
    dry = [post(client, key="k2", setup=setup, path="/v1/zones") for _ in range(2)]
    assert dry[0].status_code == dry[1].status_code == 202 and dry[0].json()["id"] == dry[1].json()["id"]
    assert post(client, setup=setup).json()["id"] != first.json()["id"]


def test_same_content_is_computed_once(client, post, finish, setup_json):
    setup = setup_json("", quality={"scallop_height_mm": 0.04})
    finish(client, post(client, setup=setup).json())
    results = client.app.state.engine.artifacts.root / "artifacts"
    before = {p: p.stat().st_mtime_ns for p in results.rglob("*") if p.is_file()}
    started = time.monotonic()
    assert finish(client, post(client, setup=setup).json())["state"] == "proved"
    assert in_time(time.monotonic() - started, 0.6)
    assert {p: p.stat().st_mtime_ns for p in results.rglob("*") if p.is_file()} == before


def test_cancel_frees_the_worker_in_under_a_second(client, post, finish, setup_json):
    sleeping = post(client, "sleep").json()
    waiting = post(client, setup=setup_json("", quality={"scallop_height_mm": 0.05})).json()
    job = finish(client, sleeping, until=("queued",))
    deadline = time.monotonic() + 120
    while client.get(job["links"]["self"]).json()["stage"] != "asleep" and time.monotonic() < deadline:
        time.sleep(0.02)
    assert client.get(waiting["links"]["self"]).json()["state"] == "queued"
    started = time.monotonic()
    cancelled = client.delete(job["links"]["self"])
    assert cancelled.status_code == 200 and cancelled.json()["state"] == "cancelled"
    finish(client, waiting, until=("queued",))
    assert in_time(time.monotonic() - started, 1.0)
    assert finish(client, waiting)["state"] == "proved"
    assert client.get(job["links"]["report"]).json()["code"] == "no_result"
    assert not [p for p in psutil.Process().children(recursive=True) if JOB_MODULE in " ".join(p.cmdline())]
    assert client.delete(waiting["links"]["self"]).json()["state"] == "proved"  # an end stays


def test_a_queued_job_is_cancelled_at_once(client, post, finish):
    first = post(client, "sleep").json()
    second = post(client, "sleep").json()
    assert client.delete(second["links"]["self"]).json()["state"] == "cancelled"
    assert client.delete(first["links"]["self"]).json()["state"] == "cancelled"


@pytest.mark.parametrize(("do", "code", "status"), [
    ("segfault", "job_crashed", 503), ("memory", "job_memory", 503), ("killed", "job_killed", 503),
    ("bug", "bug", 500), ("open", "open_shell", 422)])
def test_a_failing_child_is_a_typed_error_and_harms_nobody(client, post, finish, do, code, status):
    job = finish(client, post(client, do).json())
    assert job["state"] == "failed" and job["attempt"] == 1
    assert (job["error"]["code"], job["error"]["status"]) == (code, status)
    assert job["error"]["type"].endswith(f":{code}")
    assert not list(client.app.state.engine.artifacts.tmp.iterdir())
    assert client.get("/readyz").status_code == 200


def test_a_hanging_child_ends_at_the_time_limit(make_client, post, finish):
    client = make_client(job_time_limit_s=1.5)
    job = finish(client, post(client, "sleep").json())
    assert job["error"]["code"] == "job_timeout" and job["error"]["limit"] == 1.5


def test_pages_do_not_shift_and_filter_by_state(make_client, post):
    client = make_client()
    ids = [post(client, "sleep").json()["id"] for _ in range(3)]
    first = client.get("/v1/jobs?limit=2").json()
    ids.append(post(client, "sleep").json()["id"])
    second = client.get("/v1/jobs", params={"limit": 2, "cursor": first["next_cursor"]}).json()
    assert [j["id"] for j in first["items"] + second["items"]] == ids[2::-1]
    assert second["next_cursor"] is None
    client.delete(f"/v1/jobs/{ids[0]}")
    assert [j["id"] for j in client.get("/v1/jobs?state=cancelled").json()["items"]] == [ids[0]]
    assert client.get("/v1/jobs?kind=zones").json()["items"] == []
    assert client.get("/v1/jobs?cursor=nonsense").json()["code"] == "bad_cursor"


def test_the_file_of_a_blank_counts_by_its_bytes_and_reaches_the_chain(client, post, finish, setup_json):
    setup, blank = setup_json(stock={"kind": "step", "step_file": "../../etc/blank.step"}), STEP + b"\n"
    job = post(client, setup=setup, stock=blank, key="casting").json()
    sha = hashlib.sha256(blank).hexdigest()
    assert job["stock_sha256"] == sha
    assert job["content_sha256"] == content_hash(STEP, parse_setup(setup), blank)
    job = finish(client, job)
    assert job["state"] == "proved"
    assert client.get(job["links"]["report"]).json()["inputs"]["stock_sha256"] == sha
    renamed = {**setup, "stock": {"kind": "step"}}
    assert post(client, setup=renamed, stock=blank, key="casting").json()["id"] == job["id"]
    other = post(client, setup=setup, stock=STEP, key="casting")
    assert other.status_code == 422 and other.json()["code"] == "idempotency_key_reused"
    plain = post(client, key="no casting").json()
    assert plain["stock_sha256"] is None


def test_a_blank_that_is_not_sent_or_not_asked_for_or_no_step_file(client, post, setup_json):
    setup = setup_json(stock={"kind": "step", "step_file": "blank.step"})
    for answer, code in ((post(client, setup=setup), "no_stock_file"), (post(client, stock=STEP), "stock_not_asked"),
                         (post(client, setup=setup, stock=b"no STEP"), "not_step"),
                         (post(client, setup=setup, stock=b""), "empty_file")):
        assert answer.status_code == 422 and answer.json()["code"] == code, answer.json()
        assert answer.json()["remedy"] and answer.json()["subjects"]


def test_a_child_that_cannot_be_started_for_want_of_handles_is_waited_for(client, post, finish, monkeypatch):
    """Twice there are no handles left, then there are: it is one attempt, and no bug."""
    popen, left = subprocess.Popen, [errno.EMFILE, errno.EAGAIN]

    def starts(*args, **kwargs):
        if JOB_MODULE in args[0] and left:
            raise OSError(left.pop(), "none left")
        return popen(*args, **kwargs)

    monkeypatch.setattr("service.jobs.job_child.subprocess.Popen", starts)
    monkeypatch.setattr("service.jobs.attempt.RETRY_S", 0.1)
    job = finish(client, post(client, "few handles").json())
    assert (job["state"], job["attempt"]) == ("proved", 1) and not left


def test_a_worker_that_can_start_no_child_at_all_says_so(client, post, finish, monkeypatch):
    def never(*_args, **_kwargs):
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr("service.jobs.job_child.subprocess.Popen", never)
    monkeypatch.setattr("service.jobs.attempt.RETRY_S", 0.05)
    monkeypatch.setattr("service.jobs.attempt.PATIENCE_S", 0.3)
    job = finish(client, post(client, "no handles").json())
    assert (job["state"], job["error"]["code"]) == ("failed", "worker_exhausted")
    assert "limits of open files" in job["error"]["remedy"]
