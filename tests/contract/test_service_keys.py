"""Keys: who gets in, what a scope opens, and that it ends at once."""

import json
import re
import time

import pytest

from service.api.routes import events
from tests.time_limits import in_time


def test_until_there_is_a_key_loopback_is_trusted_and_then_nobody(make_client, post):
    client = make_client()
    job = post(client, "sleep").json()
    made = client.post("/v1/keys", json={"principal": "ada", "scopes": ["read"], "days": None}).json()
    assert re.fullmatch(r"zm_[0-9a-f]{12}_[A-Za-z0-9_-]{43}", made["key"]) and made["about"]["expires_at"] is None
    assert client.get(job["links"]["self"]).status_code == 401
    assert client.get("/v1/jobs", headers={"Authorization": f"Bearer {made['key']}"}).json()["items"] == []
    client.app.state.engine.keys.revoke(made["about"]["id"])
    assert client.get("/v1/jobs").status_code == 401  # the last key gone does not open the door again


def test_a_service_that_is_told_to_asks_for_keys_before_there_is_one(make_client):
    client = make_client(auth="keys")
    assert client.get("/v1/jobs").status_code == 401
    assert client.get("/healthz").status_code == client.get("/readyz").status_code == 200


@pytest.mark.parametrize("given", ["", "Bearer", "Bearer ", "Basic eDp5", "Bearer zm_000000000000_" + "a" * 43,
                                   "Bearer zm_0_a", "bearer \x7f", "Bearer " + "z" * 5000, "Bearer é"])
def test_what_is_no_key_is_refused_in_the_same_words(make_client, bearer, given):
    client = make_client()
    bearer(client, "ada")
    for path in ("/v1/jobs", "/v1/tools", "/metrics", "/v1/keys"):
        answer = client.get(path, headers={"Authorization": given.encode("latin-1")})
        assert answer.status_code == 401 and answer.headers["www-authenticate"] == "Bearer"
        assert answer.json()["code"] == "unauthorized"


def test_a_right_id_with_a_wrong_secret_is_as_unknown_as_any(make_client, bearer):
    client = make_client()
    key = bearer(client, "ada")["Authorization"]
    wrong = key[:-1] + ("A" if key[-1] != "A" else "B")
    answer = client.get("/v1/jobs", headers={"Authorization": wrong})
    other = client.get("/v1/jobs", headers={"Authorization": "Bearer zm_000000000000_" + "a" * 43})
    assert answer.status_code == 401 and answer.json()["detail"] == other.json()["detail"]


def test_a_key_that_expired_or_was_revoked_is_told_so_only_to_who_has_its_secret(make_client, bearer, monkeypatch):
    client = make_client()
    short, long = bearer(client, "ada", days=0.5), bearer(client, "ada")
    assert client.get("/v1/jobs", headers=short).status_code == 200
    now = time.time()
    monkeypatch.setattr("service.jobs.api_keys.time.time", lambda: now + 86400)
    assert client.get("/v1/jobs", headers=short).json()["code"] == "key_expired"
    client.app.state.engine.keys.revoke(long["Authorization"].split("_")[1])
    assert client.get("/v1/jobs", headers=long).json()["code"] == "key_revoked"
    forged = {"Authorization": long["Authorization"][:-3] + "abc"}
    assert client.get("/v1/jobs", headers=forged).json()["code"] == "unauthorized"


WAYS = [  # method, path, scopes that open it
    ("GET", "/v1/jobs", {"read"}), ("GET", "/v1/jobs/jx", {"read"}), ("GET", "/v1/jobs/jx/events", {"read"}),
    ("GET", "/v1/jobs/jx/files", {"read"}), ("GET", "/v1/tools", {"read"}), ("POST", "/v1/jobs", {"submit"}),
    ("POST", "/v1/zones", {"submit"}), ("POST", "/v1/verifications", {"submit"}), ("DELETE", "/v1/jobs/jx", {"submit"}),
    ("DELETE", "/v1/machines/x", {"submit"}), ("GET", "/v1/keys", {"admin"}), ("POST", "/v1/keys", {"admin"}),
    ("DELETE", "/v1/keys/000000000000", {"admin"}), ("GET", "/metrics", {"admin", "metrics"})]


@pytest.mark.parametrize("scope", ["submit", "read", "admin", "metrics"])
def test_a_scope_opens_what_it_is_for_and_nothing_else(make_client, bearer, scope):
    client = make_client()
    headers = bearer(client, "ada", scope)
    for method, path, opens in WAYS:
        answer = client.request(method, path, headers=headers)
        if scope in opens:
            assert answer.status_code in (200, 404, 422), (method, path, answer.text)
        else:
            assert answer.status_code == 403 and answer.json()["code"] == "scope_missing", (method, path)
            assert answer.json()["limit"] and answer.json()["measured"] == [scope]


def test_keys_over_http_are_for_admins_and_never_show_a_secret(make_client, bearer):
    client = make_client()
    admin = bearer(client, "root", "admin")
    made = client.post("/v1/keys", headers=admin, json={"principal": "mes", "note": "night"})
    assert made.status_code == 201 and made.json()["about"]["scopes"] == ["submit", "read"]
    text, about = made.json()["key"], made.json()["about"]
    listed = client.get("/v1/keys", headers=admin)
    assert [k["principal"] for k in listed.json()["items"]] == ["root", "mes"]
    assert text.split("_", 2)[2] not in listed.text and "sha256" not in listed.text
    assert client.get("/v1/jobs", headers={"Authorization": f"Bearer {text}"}).status_code == 200
    assert client.get("/v1/keys", headers=admin).json()["items"][1]["last_used_at"]
    assert client.delete(f"/v1/keys/{about['id']}", headers=admin).status_code == 204
    assert client.delete(f"/v1/keys/{about['id']}", headers=admin).status_code == 204
    assert client.get("/v1/jobs", headers={"Authorization": f"Bearer {text}"}).status_code == 401
    assert client.delete("/v1/keys/000000000000", headers=admin).json()["code"] == "no_such_key"
    for bad in ({"principal": "a b"}, {"principal": "a", "scopes": []}, {"principal": "a", "scopes": ["root"]},
                {"principal": "a", "days": 0}, {"principal": "a", "note": "x\ny"}, {"principal": "a", "x": 1}):
        assert client.post("/v1/keys", headers=admin, json=bad).status_code == 422, bad


def test_an_open_stream_ends_when_its_key_is_revoked(make_client, bearer, post, monkeypatch):
    monkeypatch.setattr(events, "KEY_LOOK_S", 0.2)
    client = make_client()
    headers = bearer(client, "ada")
    job = post(client, "sleep", headers=headers).json()
    import threading
    key = headers["Authorization"].split("_")[1]
    threading.Timer(1.0, lambda: client.app.state.engine.keys.revoke(key)).start()
    started = time.monotonic()
    with client.stream("GET", job["links"]["events"], headers=headers) as stream:
        text = "".join(stream.iter_text())
    assert "event: progress" in text and "event: end" not in text and in_time(time.monotonic() - started, 5)


@pytest.mark.parametrize(("headers", "status"), [
    ({}, 200), ({"host": "localhost:8000"}, 200), ({"host": "[::1]:8000"}, 200), ({"host": "evil.example"}, 403),
    ({"host": "127.0.0.1.evil.example"}, 403), ({"host": "[:8000"}, 403), ({"origin": "http://localhost:8000"}, 200),
    ({"origin": "http://evil.example"}, 403), ({"origin": "null"}, 403)])
def test_without_keys_pages_of_other_sites_are_kept_out(client, headers, status):
    answer = client.get("/v1/jobs", headers=headers)
    assert answer.status_code == status
    if status == 403:
        assert answer.json()["code"] == "foreign_page" and answer.json()["remedy"]


def test_no_secret_comes_into_the_log_or_an_answer(make_client, bearer, post, capfd):
    from service.logs import configure

    configure("debug", "json")
    try:
        client = make_client()
        headers = bearer(client, "ada", "submit", "read", "admin")
        secret = headers["Authorization"].split("_", 2)[2]  # which may have underscores itself
        texts = [post(client, "bug", headers=headers).text, client.get("/v1/keys", headers=headers).text,
                 client.get("/v1/jobs", headers={"Authorization": headers["Authorization"] + "x"}).text]
        made = client.post("/v1/keys", headers=headers, json={"principal": "mes"}).json()["key"]
        client.app.state.engine.library.all = lambda: 1 / 0
        texts.append(client.get("/v1/tools", headers=headers).text)
        log = capfd.readouterr().err
        assert "key made" in log and "bug in a route" in log
        for text in (*texts, log):
            assert secret not in text and made.split("_", 2)[2] not in text
        assert all(json.loads(line) for line in log.splitlines() if line.startswith("{"))
    finally:
        configure("error", "console")
