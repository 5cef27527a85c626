"""Webhooks: one signed POST when a job ends, repeated until the receiver accepts it.

The row of the job keeps the state of its webhook. The form is Standard Webhooks 1.0 [StandardWebhooks2023].
``webhook-id`` is made from the id of the job and is the same for every attempt, so that a receiver drops repeats.
``webhook-timestamp`` is that of the attempt, so that it drops old messages. The signature is HMAC-SHA256 over id,
timestamp and body. Every principal has a secret of its own, derived from the secret of the service. Nobody who checks
the webhooks of one can forge those of another, and no secret is stored.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import http.client
import ipaddress
import json
import random
import threading
import time

import structlog
from sqlalchemy.engine import RowMapping

from service.errors import RequestError
from service.jobs.job_store import JobStore
from service.jobs.resources import job_resource
from service.outbound_requests import BlockedError, check_allowed, parse_target, resolve, send
from service.settings import Settings
from service.version import VERSION

log = structlog.get_logger(__name__)

SLOTS = 4
LAST_WORDS_S = 5.0
LOOK_EVERY_S = 0.5
LONGEST_PAUSE_S = 6 * 3600.0
LARGEST_BODY = 256_000
GONE = 410


def secret_of(master: str, principal: str) -> str:
    """The secret of a principal as in [StandardWebhooks2023]: ``whsec_`` and base64."""
    key = hmac.new(master.encode(), f"zonemill webhook {principal}".encode(), hashlib.sha256).digest()
    return f"whsec_{base64.b64encode(key).decode()}"


def signature(secret: str, message_id: str, timestamp: int, body: bytes) -> str:
    """The signature of [StandardWebhooks2023]: ``v1,`` and base64."""
    key = base64.b64decode(secret.removeprefix("whsec_"))
    text = f"{message_id}.{timestamp}.".encode() + body
    return f"v1,{base64.b64encode(hmac.new(key, text, hashlib.sha256).digest()).decode()}"


def pause_s(attempt: int, first_s: float) -> float:
    """Pause after a failed attempt, s: four times the previous one, at most six hours, with a random fifth."""
    pause = min(first_s * 4.0 ** min(attempt - 1, 20), LONGEST_PAUSE_S)
    return pause * random.uniform(0.8, 1.2)


def payload(row: RowMapping) -> bytes:
    """The body: the job as wire model without the state of its webhook; it is the same for every attempt."""
    job = job_resource(row).model_dump(mode="json", exclude={"webhook", "expired_at"})
    message = {"type": "job.ended", "timestamp": job["finished_at"], "data": job}
    body = json.dumps(message, separators=(",", ":")).encode()
    if len(body) > LARGEST_BODY and job["error"]:
        job["error"].update(measured=None, subjects=[], detail=job["error"]["detail"][:1000])
        body = json.dumps(message, separators=(",", ":")).encode()
    return body


def registered(url: str, settings: Settings) -> str:
    """The URL of a webhook, as stored.

    Raises
    ------
    RequestError
        Codes 'webhooks_off', 'bad_webhook_url', 'webhook_not_allowed'.
    """
    if not settings.webhooks_on:
        raise RequestError("this service sends no webhooks", code="webhooks_off", subjects=("webhook_url",),
                           remedy="leave out webhook_url and follow the events of the job, or ask the operator")
    check_allowed(parse_target(url), settings.webhook_origins)
    return url


class WebhookSender:
    """Sends in the background; several services may do so at once."""

    def __init__(self, settings: Settings, jobs: JobStore) -> None:
        self.settings, self.jobs = settings, jobs
        self._networks = [ipaddress.ip_network(n) for n in settings.webhook_networks]
        self._stop = threading.Event()
        self._busy: list[threading.Thread] = []
        self._thread = threading.Thread(target=self._run, name="courier", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """Stop claiming and wait briefly for attempts under way; unfinished ones are sent again later."""
        self._stop.set()
        self._thread.join(timeout=5)
        until = time.monotonic() + LAST_WORDS_S
        for each in self._busy:
            each.join(timeout=max(0.0, until - time.monotonic()))

    def _run(self) -> None:
        while not self._stop.is_set():
            self._busy = [each for each in self._busy if each.is_alive()]
            try:
                # The lease is longer than all limits of an attempt together: name resolution and four connections.
                lease_s = 60 + 9 * self.settings.webhook_timeout_s
                while len(self._busy) < SLOTS and (row := self.jobs.claim_webhook(lease_s)):
                    # A daemon thread, since a hanging receiver must not keep the process from ending.
                    self._busy.append(threading.Thread(target=self._deliver, args=(row,), name="webhook", daemon=True))
                    self._busy[-1].start()
            except Exception:
                log.exception("webhook round failed")  # no database: the next round tries again
            self._stop.wait(timeout=LOOK_EVERY_S)

    def _deliver(self, row: RowMapping) -> None:
        attempt, settings = row["webhook_attempts"], self.settings
        try:
            problem, final = self._attempt(row)
            if problem is None:
                self.jobs.settle_webhook(row["id"], attempt, "delivered")
            elif final or attempt >= settings.webhook_attempts:
                self.jobs.settle_webhook(row["id"], attempt, "given_up", problem)
            else:
                due = time.time() + pause_s(attempt, settings.webhook_retry_s)
                self.jobs.settle_webhook(row["id"], attempt, "pending", problem, due)
            log.info("webhook", job=row["id"], attempt=attempt, problem=problem)
        except Exception:
            log.exception("webhook not settled", job=row["id"])  # it is due again when its lease has expired

    def _attempt(self, row: RowMapping) -> tuple[str | None, bool]:
        """The error of an attempt, None when it was accepted, and whether to give up."""
        try:
            target = parse_target(row["webhook_url"])
            check_allowed(target, self.settings.webhook_origins)
            addresses = resolve(target, self._networks)
            body = payload(row)
            status = send(target, addresses, body, self._headers(row, body), self.settings.webhook_timeout_s)
        except (RequestError, BlockedError) as error:
            return str(error), False
        except (OSError, http.client.HTTPException) as error:
            return f"no answer ({type(error).__name__})", False
        if 200 <= status < 300:
            return None, False
        return f"answered {status}", status == GONE

    def _headers(self, row: RowMapping, body: bytes) -> dict[str, str]:
        message_id, now = f"msg_{row['id']}", int(time.time())
        secrets = [s.get_secret_value() for s in (self.settings.webhook_secret, self.settings.webhook_secret_before)
                   if s is not None]
        signed = " ".join(signature(secret_of(s, row["principal"]), message_id, now, body) for s in secrets)
        return {"Content-Type": "application/json", "User-Agent": f"zonemill/{VERSION}", "Connection": "close",
                "webhook-id": message_id, "webhook-timestamp": str(now), "webhook-signature": signed}
