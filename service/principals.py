"""Who is asking: the owner of the bearer token, or 'local' when no tokens are set."""

from __future__ import annotations

import hmac
from typing import Annotated

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from limits import parse
from limits.storage import MemoryStorage
from limits.strategies import MovingWindowRateLimiter

from service.errors import RateError, UnauthorizedError
from service.settings import Settings

LOCAL = "local"
bearer = HTTPBearer(auto_error=False, description="Needed when the service has tokens set.")


def principal(request: Request, given: Annotated[HTTPAuthorizationCredentials | None, Depends(bearer)]) -> str:
    """Name of the token's owner.

    Raises
    ------
    UnauthorizedError
        Tokens are set and none of them was given.
    """
    settings: Settings = request.app.state.settings
    if not settings.tokens:
        return LOCAL
    if given is None:
        raise UnauthorizedError("a bearer token is needed", remedy="send Authorization: Bearer TOKEN")
    sent = given.credentials.encode()
    # Every token is compared, so that the time taken says nothing about which one came close.
    matches = [name for name, token in settings.tokens.items()
               if hmac.compare_digest(token.get_secret_value().encode(), sent)]
    if not matches:
        raise UnauthorizedError("the bearer token is not known", remedy="send a token of this service")
    return matches[0]


Principal = Annotated[str, Depends(principal)]


class PostRate:
    """Counts the submissions of each principal."""

    def __init__(self, rate: str) -> None:
        self.rate, self.limiter = parse(rate), MovingWindowRateLimiter(MemoryStorage())

    def check(self, name: str) -> None:
        """Count one submission.

        Raises
        ------
        RateError
            There were too many.
        """
        if not self.limiter.hit(self.rate, name):
            raise RateError(f"more than {self.rate} submissions", limit=str(self.rate), remedy="wait a little")


def submission_rate(request: Request, name: Principal) -> None:
    """Dependency of every route that queues a job."""
    request.app.state.post_rate.check(name)
