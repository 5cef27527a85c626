"""Nobody else's data: every operation with no key, a dead key, another principal's; and names that lead elsewhere."""

import json
import socket
import time

import pytest

from service.api.server import background, settings_with
from service.logs import configure
from tests.contract.test_service_input import STEP

# The page is the same for every job; what it shows it asks for with a key.
OPEN = {"/healthz", "/readyz", "/v1/jobs/{job_id}/view"}
TOOL = {"id": "T1", "kind": "ball", "diameter_mm": 3}
MARK = "adas-own"


def operations(client):
    document = client.app.openapi()
    return [(method.upper(), path) for path, item in document["paths"].items() for method in item]


@pytest.fixture
def house(make_client, bearer, post, finish):
    """A service with ada's job, library entries and key in it, and keys of others."""
    client = make_client()
    keys = {"ada": bearer(client, "ada"), "bob": bearer(client, "bob", "submit", "read", "metrics"),
            "gone": bearer(client, "ada", "submit", "read", "admin"),
            "late": bearer(client, "ada", "submit", "read", "admin", days=1e-9)}
    client.app.state.engine.keys.revoke(keys["gone"]["Authorization"].split("_")[1])
    setup = {"tools": [TOOL], "labels": {"order": MARK}}
    job = finish(client, post(client, setup=setup, key=MARK, headers=keys["ada"]).json(), headers=keys["ada"])
    assert job["state"] == "proved"
    material = {"name": MARK, "cutting_speed_m_min": 70,
                "feed_per_tooth": [{"diameter_mm": 4, "feed_per_tooth_mm": 0.01}]}
    for shelf, entry in (("tools", {**TOOL, "diameter_mm": 2.5}), ("machines", {"max_rpm": 12345}),
                         ("materials", material)):
        assert client.put(f"/v1/{shelf}/{MARK}", json=entry, headers=keys["ada"]).status_code == 201
    time.sleep(0.01)
    return client, job, keys


def filled(path, job, keys):
    file = "program.linuxcnc.ngc" if "files" in path else MARK
    return (path.replace("{job_id}", job["id"]).replace("{name}", file)
            .replace("{key_id}", keys["ada"]["Authorization"].split("_")[1]))


def snapshot(client, job, keys):
    """All that is ada's, as she sees it."""
    paths = [job["links"]["self"], job["links"]["files"], job["links"]["report"], "/v1/jobs", "/v1/tools",
             "/v1/machines", "/v1/materials"]
    return [client.get(p, headers=keys["ada"]).json() for p in paths]


@pytest.mark.parametrize("who", [None, "gone", "late"])
def test_without_a_good_key_no_operation_does_anything(house, who):
    client, job, keys = house
    before, tried = snapshot(client, job, keys), 0
    for method, path in operations(client):
        if path in OPEN:
            continue
        tried += 1
        answer = client.request(method, filled(path, job, keys), headers=keys[who] if who else {})
        assert answer.status_code == 401, (method, path, answer.status_code)
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["code"] in ("unauthorized", "key_expired", "key_revoked")
        assert MARK not in answer.json()["detail"] and job["id"] not in answer.json()["detail"]
    assert tried >= 25 and snapshot(client, job, keys) == before


def test_another_principal_finds_nothing_and_changes_nothing(house):
    client, job, keys = house
    before, tried = snapshot(client, job, keys), 0
    for method, path in operations(client):
        if path in OPEN:
            continue
        tried += 1
        body = {"PUT": TOOL if "tools" in path else {"max_rpm": 1} if "machines" in path else {
            "name": "x", "cutting_speed_m_min": 1, "feed_per_tooth": [{"diameter_mm": 4, "feed_per_tooth_mm": 0.01}]},
                "POST": {"principal": "x"}}.get(method)
        if path in ("/v1/jobs", "/v1/zones", "/v1/verifications") and method == "POST":
            files = {"part": ("p", STEP), "setup": ("s", json.dumps({"tools": [f"lib:{MARK}"]}))}
            if "verif" in path:
                files["program"] = ("x", b"M2\n")
            answer = client.post(path, files=files, headers={**keys["bob"], "Idempotency-Key": MARK})
            assert answer.status_code == 422 and answer.json()["code"] == "bad_setup"  # he has no such tool
            continue
        if path.startswith("/v1/tools:"):  # a library of his own with that name, and nothing of others
            table = f"id,kind,diameter_mm\n{MARK},flat,6\n".encode()
            answer = (client.post(path, files={"library": ("x.csv", table)}, headers=keys["bob"]) if method == "POST"
                      else client.get(f"{path}?format=csv", headers=keys["bob"]))
            assert answer.status_code == 200 or answer.json()["code"] == "no_tools", (method, path, answer.text)
            if method == "POST":
                assert client.delete(f"/v1/tools/{MARK}", headers=keys["bob"]).status_code == 204
            continue
        answer = client.request(method, filled(path, job, keys), headers=keys["bob"], json=body)
        if "/v1/keys" in path:
            assert answer.status_code == 403, (method, path)
        elif "{job_id}" in path or ("{name}" in path and method in ("GET", "DELETE")):
            assert answer.status_code == 404, (method, path, answer.text)
        else:
            assert answer.status_code in (200, 201), (method, path, answer.text)
            if method == "GET":
                assert job["id"] not in answer.text and MARK not in answer.text and "12345" not in answer.text, path
        if method == "PUT":  # now there is one of his own under that name
            assert client.delete(filled(path, job, keys), headers=keys["bob"]).status_code == 204
    assert tried >= 25 and snapshot(client, job, keys) == before
    # the same Idempotency-Key is another one, and the same content another job
    files = {"part": ("p", STEP), "setup": ("s", json.dumps({"tools": [TOOL], "labels": {"order": MARK}}))}
    own = client.post("/v1/jobs", files=files, headers={**keys["bob"], "Idempotency-Key": MARK}).json()
    assert own["id"] != job["id"] and own["content_sha256"] == job["content_sha256"]
    for query in (f"label=order:{MARK}", "state=proved", "limit=200"):
        found = client.get(f"/v1/jobs?{query}", headers=keys["bob"]).json()["items"]
        assert {j["id"] for j in found} <= {own["id"]}


def test_a_cursor_of_another_principal_shows_nothing_of_his(house, post):
    client, job, keys = house
    for _ in range(3):
        post(client, "sleep", headers=keys["ada"])
    cursor = client.get("/v1/jobs?limit=1", headers=keys["ada"]).json()["next_cursor"]
    assert client.get("/v1/jobs", params={"cursor": cursor}, headers=keys["bob"]).json()["items"] == []


LEADING_AWAY = ["..", ".", "../state", "..%2fstate", "%2e%2e%2fstate", "..%5cstate", "state", "/etc/passwd", "~", "*",
                "%2fetc%2fpasswd", "....//state", "program.linuxcnc.ngc%00.png", "program.linuxcnc.ngc/", "CON",
                "PROGRAM.LINUXCNC.NGC", "program.linuxcnc.ngc.part", "%252e%252e%252fstate", "a" * 5000, "%ff%fe",
                "\u202e", "view.bin/../state"]


@pytest.fixture(scope="module")
def served(fake_path, tmp_path_factory):
    """A service on a socket, for what a client library would not send; with a finished job."""
    data = tmp_path_factory.mktemp("served")
    with background(settings_with({"data_dir": data, "port": 0, "poll_s": 0.05, "workers": 1}), "fake_chain") as url:
        import httpx

        with httpx.Client(base_url=url, trust_env=False) as client:
            files = {"part": ("p", STEP), "setup": ("s", json.dumps({"tools": [TOOL]}))}
            job = client.post("/v1/jobs", files=files).json()
            while job["state"] in ("queued", "running"):
                time.sleep(0.05)
                job = client.get(job["links"]["self"]).json()
            yield client, job, data


def raw(client, text):
    """Send bytes as they are; the first line of the answer and the rest."""
    host, port = client.base_url.host, client.base_url.port
    with socket.create_connection((host, port), 5) as connection:
        connection.sendall(text)
        connection.settimeout(5)
        got = b""
        try:
            while chunk := connection.recv(65536):
                got += chunk
        except TimeoutError:
            pass
    return got


@pytest.mark.parametrize("name", LEADING_AWAY)
def test_names_that_lead_elsewhere_find_nothing(served, name):
    client, job, data = served
    text = name.encode("utf-8")
    for path in (f"{job['links']['files']}/".encode() + text, b"/v1/jobs/" + text, b"/v1/tools/" + text,
                 b"/v1/jobs/" + text + b"/report"):
        got = raw(client, b"GET " + path + b" HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n")
        status = int(got.split(b" ")[1])
        head, _, body = got.partition(b"\r\n\r\n")
        own = path.endswith(b"/.") or b"/v1/tools/%" in path
        assert status in (400, 404, 405, 414, 422) or own, (path, got[:200])
        assert status < 500 and b"root:" not in body and str(data).encode() not in body, path


@pytest.mark.parametrize("name", ["../../../etc/cron.d/x", "/etc/passwd", "a\x00b.step", "x" * 10_000, "",
                                  "\u202egpj.step", 'a"; filename="b', "a\\..\\b", "%2e%2e%2f", "a\nb"])
def test_the_name_of_an_upload_is_not_looked_at(served, name):
    client, _, data = served
    before = {p for p in data.rglob("*") if p.is_file()}
    mark = "bd"
    quoted = name.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "%0A")
    head = f'--{mark}\r\nContent-Disposition: form-data; name="part"; filename="{quoted or "p"}"\r\n\r\n'
    body = (head.encode() + STEP + f'\r\n--{mark}\r\nContent-Disposition: form-data; name="setup"\r\n\r\n'.encode()
            + json.dumps({"tools": [TOOL]}).encode() + f"\r\n--{mark}--\r\n".encode())
    answer = client.post("/v1/jobs", content=body, headers={"content-type": f"multipart/form-data; boundary={mark}"})
    assert answer.status_code in (202, 422), answer.text
    new = {p for p in data.rglob("*") if p.is_file()} - before
    assert all(p.relative_to(data).parts[0] in ("blobs", "artifacts", "tmp", "zonemill.db-wal", "zonemill.db-shm")
               for p in new)


@pytest.mark.parametrize("text", [
    b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Request-ID: a\r\n Set-Cookie: x=1\r\nConnection: close\r\n\r\n",
    b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Request-ID: %0d%0aSet-Cookie:%20x\r\nConnection: close\r\n\r\n",
    b"GET /v1/jobs/x%0d%0aSet-Cookie:%20x=1 HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n",
    b"GET /v1/jobs?cursor=%0d%0aSet-Cookie:%20x=1 HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n",
    b"PATCH /v1/jobs/%0d%0aX-Bad:%20x HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n",
    b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Request-ID: " + b"a" * 8000 + b"\r\nConnection: close\r\n\r\n",
    b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
    b"GET http://evil.example/healthz HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n"])
def test_nothing_a_client_sends_becomes_a_header(served, text):
    got = raw(served[0], text)
    head = got.partition(b"\r\n\r\n")[0].lower()
    assert got == b"" or int(got.split(b" ")[1]) < 500
    assert b"\nset-cookie" not in head and b"\nx-bad" not in head and b"aaaa" not in head


@pytest.mark.parametrize("form", ["console", "json"])
def test_nothing_a_client_sends_becomes_a_line_of_the_log(make_client, capfd, form, monkeypatch):
    client = make_client()
    configure("debug", form)
    try:
        def bug(*_):
            raise ValueError("a\n2026-01-01 [info] forged one\x1b[31m")

        monkeypatch.setattr(client.app.state.engine.jobs, "get", bug)
        assert client.get("/v1/jobs/x%0A2026-01-01%20[info]%20forged%20two%1b[31m%7f%c2%85").status_code == 500
        log = capfd.readouterr().err
    finally:
        configure("error", "console")
    lines = log.splitlines()
    assert "forged one" in log and "forged two" in log
    assert not [line for line in lines if line.startswith("2026-01-01 [info] forged")], log
    assert "\x1b[31m" not in log and "\x7f" not in log and "\x85" not in log
