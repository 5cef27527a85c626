"""Who is asking: the principal of the key, or 'local' on loopback before the first key is made.

What belongs to a principal is found by its name alone, so a route that takes ``Principal`` sees nothing of others.
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
bearer = HTTPBearer(auto_error=False, description="A key from zonemill keys create. Needed beyond loopback, and as "
                                                  "soon as there is one.")


def keys_wanted(request: Request) -> bool:
    """Whether this service asks for a key."""
    settings: Settings = request.app.state.settings
    return settings.auth == "keys" or not is_loopback(settings.host) or request.app.state.engine.keys.any()


def identity(request: Request, given: Annotated[HTTPAuthorizationCredentials | None, Depends(bearer)]) -> Identity:
    """Who is asking.

    Raises
    ------
    UnauthorizedError
        A key is asked for and none was given, or one that is wrong, revoked or expired.
    ForbiddenError
        No key is asked for, and the request comes from a page of another site (code 'foreign_page').
    """
    if not keys_wanted(request):
        _refuse_foreign_pages(request)
        return LOCAL
    if given is None:
        raise UnauthorizedError("a key is needed", remedy="send Authorization: Bearer KEY")
    found: Identity = request.app.state.engine.keys.identify(given.credentials)
    return found


def _refuse_foreign_pages(request: Request) -> None:
    """Without keys, whoever reaches the port is trusted, and a browser on this machine lends its reach to every page.

    A name that was made to point to this machine shows in Host, a page of another site in Origin.
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
                                 remedy="call the service by 127.0.0.1, or make a key: zonemill keys create")


def require(who: Identity, *scopes: str) -> None:
    """Refuse who has none of these scopes.

    Raises
    ------
    ForbiddenError
        Code 'scope_missing'.
    """
    if not who.scopes & set(scopes):
        raise ForbiddenError(f"the key {who.key_id} has not the scope {' or '.join(scopes)}", code="scope_missing",
                             subjects=(str(who.key_id),), measured=sorted(who.scopes), limit=list(scopes),
                             remedy=f"ask for a key with the scope {scopes[0]}")


def _needs(*scopes: str) -> Callable[[Identity], Awaitable[str]]:
    """Dependency that wants one of these scopes and gives the name of the principal."""

    async def check(who: Annotated[Identity, Depends(identity)]) -> str:  # waits for nothing, so it needs no thread
        if scopes:
            require(who, *scopes)
        return who.principal

    return check


Who = Annotated[Identity, Depends(identity)]
Principal = Annotated[str, Depends(_needs(READ))]
Submitter = Annotated[str, Depends(_needs(SUBMIT))]
Admin = Annotated[str, Depends(_needs(ADMIN))]
Watcher = Annotated[str, Depends(_needs(METRICS, ADMIN))]
Anybody = Annotated[str, Depends(_needs())]


class PostRate:
    """Counts the submissions of each principal, in this process, by a clock that nobody sets.

    A window by the time of the day refuses everything for an hour when that is set back by an hour.
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
            There were too many; it says when the next will be taken.
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
        raise RateError(f"more than {self.rate} submissions", limit=str(self.rate), remedy="wait a little",
                        retry_after_s=max(1, math.ceil(wait)))


def submission_rate(request: Request, name: Submitter) -> None:
    """Dependency of every route that queues a job."""
    request.app.state.post_rate.check(name)
