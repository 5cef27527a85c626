"""The principal of a request: the owner of the key, or 'local' on loopback before the first key exists.

Routes find data by the name of the principal, so a route that takes ``Principal`` sees no data of others.
"""

from __future__ import annotations

import math
import threading
import time
from collections import defaultdict, deque
from collections.abc import Awaitable, Callable
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from limits import parse

from service.errors import ForbiddenError, RateError, UnauthorizedError
from service.jobs.api_keys import ADMIN, METRICS, READ, SCOPES, SUBMIT, Identity
from service.settings import Settings, is_loopback

LOCAL = Identity("local", frozenset(SCOPES))
bearer = HTTPBearer(auto_error=False, description="A key from zonemill keys create. Required for requests from other "
                                                  "hosts, and for local requests once a key exists.")


def keys_wanted(request: Request) -> bool:
    """Whether this service requires a key."""
    settings: Settings = request.app.state.settings
    return settings.auth == "keys" or not is_loopback(settings.host) or request.app.state.engine.keys.any()


def identity(request: Request, given: Annotated[HTTPAuthorizationCredentials | None, Depends(bearer)]) -> Identity:
    """Identity of the sender of a request.

    Raises
    ------
    UnauthorizedError
        A key is required, and the request has none, or a wrong, revoked or expired one.
    ForbiddenError
        foreign_page: no key is required, and the request comes from a page of another site.
    """
    if not keys_wanted(request):
        _refuse_foreign_pages(request)
        return LOCAL
    if given is None:
        raise UnauthorizedError("an API key is required", remedy="send Authorization: Bearer KEY")
    found: Identity = request.app.state.engine.keys.identify(given.credentials)
    return found


def _refuse_foreign_pages(request: Request) -> None:
    """Refuse requests from pages of other sites while no key is required.

    Without keys everyone who reaches the port is trusted, and a browser on this machine can send requests for any page.
    Host shows a name that was made to point to this machine, Origin shows a page of another site.
    """
    for header in ("host", "origin"):
        text = request.headers.get(header)
        if text is None and header == "origin":
            continue
        try:
            name = urlsplit(str(text) if header == "origin" else f"//{text}").hostname or ""
        except ValueError:
            name = ""
        if not is_loopback(name):
            raise ForbiddenError(f"the {header.capitalize()} of the request is not this machine", code="foreign_page",
                                 subjects=(header,), measured=ascii(text)[:200], limit="127.0.0.1, ::1 or localhost",
                                 remedy="use the address 127.0.0.1, or create a key: zonemill keys create")


def require(caller: Identity, *scopes: str) -> None:
    """Refuse a caller without any of these scopes.

    Raises
    ------
    ForbiddenError
        Code 'scope_missing'.
    """
    if not caller.scopes & set(scopes):
        raise ForbiddenError(f"the key {caller.key_id} lacks the scope {' or '.join(scopes)}", code="scope_missing",
                             subjects=(str(caller.key_id),), measured=sorted(caller.scopes), limit=list(scopes),
                             remedy=f"use a key with the scope {scopes[0]}")


def _needs(*scopes: str) -> Callable[[Identity], Awaitable[str]]:
    """Dependency that requires one of these scopes and returns the name of the principal."""

    async def check(caller: Annotated[Identity, Depends(identity)]) -> str:  # does not block, so it needs no thread
        if scopes:
            require(caller, *scopes)
        return caller.principal

    return check


Caller = Annotated[Identity, Depends(identity)]
Principal = Annotated[str, Depends(_needs(READ))]
Submitter = Annotated[str, Depends(_needs(SUBMIT))]
Admin = Annotated[str, Depends(_needs(ADMIN))]
Watcher = Annotated[str, Depends(_needs(METRICS, ADMIN))]
Anybody = Annotated[str, Depends(_needs())]


class PostRate:
    """Counts the submissions of each principal, in this process, by a monotonic clock.

    With the time of day, setting the clock back by an hour would refuse everything for an hour.
    """

    def __init__(self, rate: str) -> None:
        self.rate = parse(rate)
        self._taken: defaultdict[str, deque[float]] = defaultdict(deque)
        self._lock = threading.Lock()

    def check(self, name: str) -> None:
        """Count one submission.

        Raises
        ------
        RateError
            There were too many; the error says when the next one is accepted.
        """
        now, window = time.monotonic(), self.rate.get_expiry()
        with self._lock:
            taken = self._taken[name]
            while taken and taken[0] <= now - window:
                taken.popleft()
            if len(taken) < self.rate.amount:
                taken.append(now)
                return
            wait = taken[0] + window - now
        raise RateError(f"more than {self.rate} submissions", limit=str(self.rate),
                        remedy="wait before the next submission", retry_after_s=max(1, math.ceil(wait)))


def submission_rate(request: Request, name: Submitter) -> None:
    """Dependency of every route that queues a job."""
    request.app.state.post_rate.check(name)
