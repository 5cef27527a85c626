"""Webhooks: signed, tried again, over a restart too, and only to where they may go."""

import base64
import hashlib
import hmac
import http.server
import json
import shutil
import subprocess
import threading
import time
from pathlib import Path

import pytest

from service.jobs import webhooks
from service.jobs.webhooks import pause_s, secret_of, signature

MASTER = "m" * 40


class Receiver:
    """Answers POSTs with the statuses it is given, the last one for ever, after a while; keeps what it got."""

    def __init__(self, *statuses, tls=None, after_s=0.0):
        self.got, self.statuses = [], list(statuses)
        outer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self):
                body = self.rfile.read(int(self.headers["content-length"]))
                status = outer.statuses.pop(0) if len(outer.statuses) > 1 else outer.statuses[0]
                outer.got.append((self.path, dict(self.headers.items()), body, status))
                time.sleep(after_s)
                self.send_response(status)
                if status == 302:
                    self.send_header("Location", f"http://127.0.0.1:{outer.port}/elsewhere")
                self.end_headers()

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        if tls:
            import ssl

            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(*tls)
            self.server.socket = context.wrap_socket(self.server.socket, server_side=True)
        self.port = self.server.server_address[1]
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def wait(self, count, patience=120.0):
        deadline = time.monotonic() + patience
        while len(self.got) < count and time.monotonic() < deadline:
            time.sleep(0.02)
        return self.got


@pytest.fixture
def receiver():
    opened = []

    def start(*statuses, **how):
        opened.append(Receiver(*statuses, **how))
        return opened[-1]

    yield start
    for each in opened:
        each.server.shutdown()
        each.server.server_close()


@pytest.fixture
def hooked(make_client):
    """A service that may call a receiver on this machine."""

    def start(receiver, **settings):
        values = {"webhook_origins": [f"http://127.0.0.1:{receiver.port}"], "webhook_networks": ["127.0.0.0/8"],
                  "webhook_secret": MASTER, "webhook_retry_s": 0.1, "webhook_timeout_s": 1.0, **settings}
        return make_client(**values)

    return start


def settled(client, job, state, headers=None, patience=120.0):
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        found = client.get(job["links"]["self"], headers=headers).json()
        if found["webhook"]["state"] == state:
            return found
        time.sleep(0.05)
    pytest.fail(f"the webhook is {found['webhook']}")


def test_the_signature_is_that_of_standard_webhooks():
    assert signature("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw", "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330,
                     b'{"test": 2432232314}') == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="


def test_pauses_grow_and_end_within_a_day():
    pauses = [pause_s(n, 5.0) for n in range(1, 10)]
    assert all(b > 2 * a for a, b in zip(pauses[:6], pauses[1:7], strict=True)) and 4 <= pauses[0] <= 6
    assert max(pauses) <= 6 * 3600 * 1.2 and 10 * 3600 < sum(pauses) < 24 * 3600
    assert pause_s(1000, 5.0) <= 6 * 3600 * 1.2


def test_secrets_differ_by_principal_and_are_long_enough():
    ada, bob = secret_of(MASTER, "ada"), secret_of(MASTER, "bob")
    assert ada != bob and ada.startswith("whsec_") and len(base64.b64decode(ada[6:])) == 32
    assert secret_of("n" * 40, "ada") != ada


def test_an_ended_job_is_told_once_signed_with_its_labels_and_figures(receiver, hooked, post, bearer, setup_json):
    there = receiver(204)
    client = hooked(there, webhook_secret_before="o" * 40)
    ada = bearer(client, "ada")
    url = f"http://127.0.0.1:{there.port}/hook?order=4711"
    setup = setup_json(labels={"order": "4711", "revision": "C"})
    posted = post(client, setup=setup, key="k", headers=ada, webhook_url=url).json()
    plain = post(client, setup=setup, headers=ada).json()
    assert posted["content_sha256"] == plain["content_sha256"] and plain["webhook"] is None
    job = settled(client, posted, "delivered", ada)
    assert job["webhook"] == {"url": url, "state": "delivered", "attempts": 1, "next_attempt_at": None, "problem": None}
    ((path, headers, body, _),) = there.wait(1)
    assert path == "/hook?order=4711" and headers["Content-Type"] == "application/json"
    told = json.loads(body)
    assert told["type"] == "job.ended" and told["timestamp"] == job["finished_at"]
    assert told["data"] == {k: v for k, v in job.items() if k not in ("webhook", "expired_at")}
    assert told["data"]["labels"] == setup["labels"] and told["data"]["state"] == "proved"
    assert told["data"]["summary"]["complete"] is True and told["data"]["summary"]["coverage"] == 1.0
    assert headers["webhook-id"] == f"msg_{job['id']}" and abs(time.time() - int(headers["webhook-timestamp"])) < 5
    text = f"{headers['webhook-id']}.{headers['webhook-timestamp']}.".encode() + body
    wanted = [base64.b64encode(hmac.new(base64.b64decode(secret_of(m, "ada")[6:]), text, hashlib.sha256).digest())
              .decode() for m in (MASTER, "o" * 40)]
    assert headers["webhook-signature"].split() == [f"v1,{w}" for w in wanted]
    assert post(client, setup=setup, key="k", headers=ada, webhook_url=url).json()["id"] == job["id"]
    time.sleep(1.2)
    assert len(there.got) == 1


def test_the_receiver_of_the_documentation_believes_what_is_genuine_and_nothing_else(receiver, hooked, post, bearer):
    text = (Path(__file__).resolve().parents[2] / "docs" / "http.md").read_text()
    words: dict = {}
    exec(text.split("```python\n")[1].split("```")[0], words)
    there = receiver(200)
    client = hooked(there, webhook_secret_before="o" * 40)
    post(client, "", headers=bearer(client, "ada"), webhook_url=f"http://127.0.0.1:{there.port}")
    ((_, headers, body, _),) = there.wait(1)
    seen: set = set()
    for secret in (secret_of(MASTER, "bob"), secret_of("p" * 40, "ada")):
        assert not words["is_genuine"](headers, body, secret, seen)
    old = {**headers, "webhook-timestamp": str(int(headers["webhook-timestamp"]) - 400)}
    for changed, sent in ((headers, body + b" "), (old, body), ({**headers, "webhook-id": "msg_x"}, body)):
        assert not words["is_genuine"](changed, sent, secret_of(MASTER, "ada"), seen)
    assert words["is_genuine"](headers, body, secret_of(MASTER, "ada"), seen)
    assert not words["is_genuine"](headers, body, secret_of(MASTER, "ada"), seen)  # a second time is a replay


@pytest.mark.parametrize("do", ["gouge", "open", "cancelled", "high"])
def test_however_a_job_ends_it_is_told(receiver, hooked, post, do):
    there = receiver(200)
    client = hooked(there)
    verification = {"path": "/v1/verifications", "program": b"(HIGH)\nM2\n"} if do == "high" else {}
    job = post(client, "sleep" if do == "cancelled" else do, webhook_url=f"http://127.0.0.1:{there.port}",
               **verification).json()
    if do == "cancelled":
        client.delete(job["links"]["self"])
    ((_, _, body, _),) = there.wait(1)
    state = {"gouge": "unproved", "open": "failed", "cancelled": "cancelled", "high": "clean"}[do]
    data = json.loads(body)["data"]
    assert data["state"] == state and (data["error"] is None) == (do != "open")
    assert (data["summary"] or {}).get("findings") == (1 if do in ("gouge", "high") else None)


def test_it_is_tried_again_with_the_same_id_and_body_until_it_is_taken(receiver, hooked, post):
    there = receiver(500, 302, 404, 200)
    client = hooked(there)
    job = post(client, "", webhook_url=f"http://127.0.0.1:{there.port}/x").json()
    job = settled(client, job, "delivered")
    assert job["webhook"]["attempts"] == 4 and [g[3] for g in there.got] == [500, 302, 404, 200]
    assert {g[0] for g in there.got} == {"/x"}  # no redirect was followed
    assert len({g[1]["webhook-id"] for g in there.got}) == len({g[2] for g in there.got}) == 1


def test_it_is_given_up_after_so_many_attempts_and_at_once_when_gone(receiver, hooked, post):
    there = receiver(503)
    client = hooked(there, webhook_attempts=3, webhook_retry_s=0.05)
    job = settled(client, post(client, "", webhook_url=f"http://127.0.0.1:{there.port}").json(), "given_up")
    assert (job["webhook"]["attempts"], job["webhook"]["problem"]) == (3, "answered 503") and job["state"] == "proved"
    there.statuses = [410]
    job = settled(client, post(client, "", webhook_url=f"http://127.0.0.1:{there.port}").json(), "given_up")
    assert job["webhook"]["attempts"] == 1
    assert 'zonemill_webhooks{state="given_up"} 2.0' in client.get("/metrics").text


def test_a_restart_in_between_loses_nothing(receiver, hooked, post):
    there = receiver(500, 200)
    client = hooked(there, webhook_retry_s=2.0)
    job = post(client, "", webhook_url=f"http://127.0.0.1:{there.port}").json()
    there.wait(1)
    assert settled(client, job, "pending")["webhook"]["attempts"] == 1
    client.__exit__(None, None, None)
    client.__enter__ = client.__exit__ = lambda *_: None
    job = settled(hooked(there), job, "delivered")
    assert job["webhook"]["attempts"] == 2 and len(there.got) == 2


def test_an_orderly_stop_waits_for_what_is_on_its_way_so_that_it_is_not_sent_twice(receiver, hooked, post):
    there = receiver(200, after_s=1.0)
    client = hooked(there, webhook_timeout_s=5)
    job = post(client, "sleep", webhook_url=f"http://127.0.0.1:{there.port}").json()
    client.delete(job["links"]["self"])
    assert there.wait(1)
    client.app.state.engine._courier.close()
    assert client.get(job["links"]["self"]).json()["webhook"]["state"] == "delivered"


def test_an_attempt_that_was_cut_off_by_a_crash_is_made_again(receiver, hooked, post, monkeypatch):
    there = receiver(200)
    monkeypatch.setattr(webhooks.WebhookSender, "_deliver", lambda *_: None)  # claimed, and never heard of again
    client = hooked(there)
    jobs = client.app.state.engine.jobs
    job = post(client, "", webhook_url=f"http://127.0.0.1:{there.port}").json()
    deadline = time.monotonic() + 120
    while client.get(job["links"]["self"]).json()["webhook"]["attempts"] == 0 and time.monotonic() < deadline:
        time.sleep(0.05)
    monkeypatch.undo()
    assert jobs.claim_webhook(1) is None and not there.got
    assert not jobs.settle_webhook(job["id"], 7, "delivered")  # an attempt that is not the newest
    jobs.settle_webhook(job["id"], 1, "pending", None, 0.0)  # the lease has run out
    assert settled(client, job, "delivered")["webhook"]["attempts"] == 2


@pytest.mark.parametrize(("url", "code"), [
    ("http://127.0.0.1:1/", "webhook_not_allowed"), ("https://127.0.0.1:{port}/", "webhook_not_allowed"),
    ("http://localhost:{port}/", "webhook_not_allowed"), ("http://u@127.0.0.1:{port}/", "bad_webhook_url"),
    ("", "bad_webhook_url"), ("javascript:alert(1)", "bad_webhook_url")])
def test_where_no_webhook_may_go_the_job_is_not_accepted(receiver, hooked, post, url, code):
    there = receiver(200)
    client = hooked(there)
    answer = post(client, "", webhook_url=url.format(port=there.port))
    assert answer.status_code == 422 and answer.json()["code"] == code and answer.json()["subjects"] == ["webhook_url"]
    assert client.get("/v1/jobs").json()["items"] == []


def test_without_settings_there_are_no_webhooks(client, post):
    assert post(client, "", webhook_url="https://mes.example.com/").json()["code"] == "webhooks_off"


def test_an_allowed_name_that_leads_inside_is_not_called(receiver, hooked, post):
    there = receiver(200)
    client = hooked(there, webhook_networks=[], webhook_attempts=1)
    job = settled(client, post(client, "", webhook_url=f"http://127.0.0.1:{there.port}").json(), "given_up")
    assert "not public" in job["webhook"]["problem"] and not there.got


def test_nobody_there_is_a_reason_to_try_again(receiver, hooked, post):
    there = receiver(200)
    there.server.server_close()
    client = hooked(there, webhook_attempts=2, webhook_retry_s=0.05)
    job = settled(client, post(client, "", webhook_url=f"http://127.0.0.1:{there.port}").json(), "given_up")
    assert job["webhook"]["problem"] == "no answer (ConnectionRefusedError)"


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificate")
def test_the_certificate_has_to_be_that_of_the_host(receiver, hooked, post, tmp_path, monkeypatch):
    key, cert = tmp_path / "key.pem", tmp_path / "cert.pem"
    subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", key, "-out", cert,
                    "-days", "2", "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost"], check=True,
                   capture_output=True)
    there = receiver(200, tls=(cert, key))
    url = f"https://localhost:{there.port}"
    client = hooked(there, webhook_origins=[url, url.replace("localhost", "127.0.0.1")], webhook_attempts=1,
                    webhook_networks=["127.0.0.0/8", "::1/128"])
    for wrong in (url, url.replace("localhost", "127.0.0.1")):
        job = settled(client, post(client, "", webhook_url=wrong).json(), "given_up")
        assert job["webhook"]["problem"] == "no answer (SSLCertVerificationError)"
        monkeypatch.setenv("SSL_CERT_FILE", str(cert))  # known now, and still not that of the address
    assert settled(client, post(client, "", webhook_url=url).json(), "delivered") and len(there.got) == 1


def test_the_secret_is_told_on_the_command_line_alone(monkeypatch):
    from typer.testing import CliRunner

    from service.cli import app

    monkeypatch.setenv("ZONEMILL_WEBHOOK_SECRET", MASTER)
    got = CliRunner().invoke(app, ["keys", "webhook-secret", "--principal", "ada"])
    assert got.exit_code == 0 and got.stdout.strip() == secret_of(MASTER, "ada")
    monkeypatch.setenv("ZONEMILL_WEBHOOK_SECRET", "short-and-secret")
    got = CliRunner().invoke(app, ["keys", "webhook-secret", "--principal", "ada"])
    assert got.exit_code == 2 and "webhook_secret" in got.stderr and "short-and-secret" not in got.stderr
    monkeypatch.delenv("ZONEMILL_WEBHOOK_SECRET")
    assert CliRunner().invoke(app, ["keys", "webhook-secret", "--principal", "ada"]).exit_code == 2
