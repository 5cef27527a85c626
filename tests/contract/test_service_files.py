"""Parts of files, filters of the list, and what the service says it can do."""

import base64
import json
import time
from datetime import UTC, datetime, timedelta

import httpx
import pytest

from service.api.server import background, settings_with

TEXT = b"%\nG21\nM2\n%\n"  # what the fake chain writes as a program


@pytest.fixture(scope="module")
def file(client, fake_path):
    """Path of a program, and its entity tag."""
    from tests.contract.test_service_input import STEP

    setup = json.dumps({"tools": [{"id": "T1", "kind": "ball", "diameter_mm": 3}]})
    job = client.post("/v1/jobs", files={"part": ("p", STEP), "setup": ("s", setup, "application/json")}).json()
    with client.stream("GET", job["links"]["events"]) as stream:
        "".join(stream.iter_text())
    path = f"{job['links']['files']}/program.linuxcnc.ngc"
    whole = client.get(path)
    assert whole.status_code == 200 and whole.content == TEXT and whole.headers["accept-ranges"] == "bytes"
    return path, whole.headers["etag"]


@pytest.mark.parametrize(("asked", "want", "told"), [
    ("bytes=0-3", TEXT[:4], "bytes 0-3/11"), ("bytes=2-", TEXT[2:], "bytes 2-10/11"),
    ("bytes=-3", TEXT[-3:], "bytes 8-10/11"), ("bytes=5-999", TEXT[5:], "bytes 5-10/11"),
    ("bytes=-999", TEXT, "bytes 0-10/11"), ("BYTES=0-0", TEXT[:1], "bytes 0-0/11"),
    ("bytes=0-1,50-", TEXT[:2], "bytes 0-1/11"), ("bytes=-0, 11-12, 3-4,99-", TEXT[3:5], "bytes 3-4/11")])
def test_a_part_of_a_file(client, file, asked, want, told):
    path, tag = file
    answer = client.get(path, headers={"Range": asked})
    assert (answer.status_code, answer.content, answer.headers["content-range"]) == (206, want, told)
    assert answer.headers["etag"] == tag and answer.headers["content-length"] == str(len(want))
    # an interrupted download goes on only if the file is still that one
    for condition, status in ((tag, 206), ('"other"', 200), (f"W/{tag}", 200)):
        again = client.get(path, headers={"Range": asked, "If-Range": condition})
        assert again.status_code == status and again.content == (want if status == 206 else TEXT)
    assert client.get(path, headers={"Range": asked, "If-None-Match": tag}).status_code == 304
    assert client.head(path, headers={"Range": asked}).headers["content-length"] == "11"


def test_several_parts_of_a_file(client, file):
    answer = client.get(file[0], headers={"Range": "bytes=0-1, 3-4"})
    assert answer.status_code == 206 and answer.headers["content-type"].startswith("multipart/byteranges")
    assert b"content-range: bytes 3-4/11" in answer.content.lower() and b"\r\n\r\n21\r\n" in answer.content


@pytest.mark.parametrize("asked", ["bytes=11-", "bytes=99-100", "bytes=-0", "bytes=11-12,50-,-0"])
def test_a_part_that_is_not_there(client, file, asked):
    answer = client.get(file[0], headers={"Range": asked})
    assert answer.status_code == 416 and answer.headers["content-range"] == "bytes */11"
    assert answer.headers["content-type"] == "application/problem+json" and answer.json()["limit"] == 11


@pytest.mark.parametrize("asked", ["bytes", "bytes=", "bytes=a-b", "lines=0-1", "bytes=5-2", "bytes=1--2", "bytes=²-3",
                                   "bytes=" + ",".join(["0-1"] * 40), "bytes=" + "9" * 4000 + "-", "bytes=--1"])
def test_a_range_that_cannot_be_read_is_not_there(client, file, asked):
    answer = client.get(file[0], headers={"Range": asked.encode("latin-1")})
    assert (answer.status_code, answer.content) == (200, TEXT)


def test_documents_come_in_parts_too(client, file):
    path = file[0].rsplit("/files", 1)[0] + "/report"
    whole = client.get(path)
    assert json.loads(whole.content)["state"] == "proved" and whole.headers["content-type"] == "application/json"
    part = client.get(path, headers={"Range": "bytes=0-9"})
    assert part.status_code == 206 and part.content == whole.content[:10]


def test_the_list_is_filtered_by_label_time_state_and_kind(make_client, post, setup_json):
    client = make_client()
    busy = post(client, "sleep").json()["id"]
    made = []
    for order, revision in (("1", "A"), ("1", "B"), ("2", "A")):
        made.append(post(client, setup=setup_json(labels={"order": order, "revision": revision, "do": "sleep"})).json())
    ids = [j["id"] for j in made]

    def found(**query):
        answer = client.get("/v1/jobs", params=query)
        assert answer.status_code == 200, answer.text
        return [j["id"] for j in answer.json()["items"]]

    assert found(label="order:1") == [ids[1], ids[0]] and found(label=["order:1", "revision:B"]) == [ids[1]]
    assert found(label="order:3") == found(label="order:") == found(label="nonesuch:1") == []
    assert found(label="do:sleep", limit=2) == [ids[2], ids[1]]
    page = client.get("/v1/jobs", params={"label": "do:sleep", "limit": 2}).json()
    rest = client.get("/v1/jobs", params={"label": "do:sleep", "limit": 2, "cursor": page["next_cursor"]}).json()
    assert [j["id"] for j in rest["items"]] == [ids[0], busy] and rest["next_cursor"] is None
    middle = made[1]["created_at"]
    assert found(created_from=middle, label="revision:A") == [ids[2]]
    assert set(found(created_to=middle)) == {ids[0], busy}
    now = datetime.now(UTC)
    assert found(created_from=(now + timedelta(days=1)).isoformat()) == []
    assert len(found(created_from=(now - timedelta(days=1)).replace(tzinfo=None).isoformat())) == 4
    client.delete(made[2]["links"]["self"])
    assert found(state="cancelled", label="order:2") == [ids[2]] and found(state="cancelled", label="order:1") == []


@pytest.mark.parametrize("query", [
    {"label": "order"}, {"label": "1:2"}, {"label": "a:\n"}, {"label": "a:\x00"}, {"label": "a:" + "x" * 201},
    {"label": ["a:b"] * 9}, {"created_from": "yesterday"}, {"created_to": "2026-13-01T00:00:00Z"}, {"state": "gone"}])
def test_filters_that_make_no_sense(client, query):
    answer = client.get("/v1/jobs", params=query)
    assert answer.status_code == 422 and answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("text", ["", "x", "=", base64.urlsafe_b64encode(b"j' OR 1=1").decode(), "a" * 101, "é",
                                  base64.urlsafe_b64encode(b"j\x00").decode()])
def test_a_cursor_of_ours_has_one_form(client, text):
    answer = client.get("/v1/jobs", params={"cursor": text})
    assert answer.status_code == 422 and answer.json()["code"] in ("bad_cursor", "malformed_request")


def test_a_small_answer_does_not_wait_for_an_acknowledgement(fake_path, tmp_path):
    """Without TCP_NODELAY every answer on a connection that is kept takes the 40 ms of a delayed acknowledgement."""
    with background(settings_with({"data_dir": tmp_path, "port": 0}), "fake_chain") as url:
        with httpx.Client(base_url=url, trust_env=False) as client:
            took = []
            for _ in range(40):
                started = time.perf_counter()
                client.get("/healthz").raise_for_status()
                took.append(time.perf_counter() - started)
    assert sorted(took)[10] < 0.03, sorted(took)


def test_what_the_service_can_do(make_client, bearer):
    client = make_client(retention_days=30, max_queued=7)
    ada = bearer(client, "ada", "submit")
    told = client.get("/v1/capabilities", headers=ada).json()
    assert [d["name"] for d in told["dialects"]] == ["linuxcnc", "fanuc", "haas", "siemens", "heidenhain"]
    assert told["dialects"][3]["extension"] == "mpf" and told["kinds"] == ["plan", "zones", "verify"]
    assert told["tools"] == ["ball", "flat", "bull", "tapered_ball", "tapered_bull", "tapered_flat", "lens", "barrel"]
    assert told["machines"] == ["3-axis", "5-axis"]
    assert "table-table-AC" in told["kinematics"] and "Ti-6Al-4V" in told["materials"] and "step" in told["stock"]
    assert told["principal"] == "ada" and told["scopes"] == ["submit"] and told["webhooks"] is False
    assert told["limits"]["retention_days"] == 30 and told["limits"]["queued"] == 7 and told["slots"] == 1
    assert len(told["code"]) == 64 and told["version"]
    assert client.get("/v1/capabilities").status_code == 401
