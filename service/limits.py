"""The limit on request bodies: refused by Content-Length before a byte is read, else counted while it streams.

The framework's own limit answers in plain text; this one lets the error handlers answer as problem+json.
"""

from __future__ import annotations

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.problems import problem_response, too_large


class BodyLimitMiddleware:
    """Refuses bodies of more than ``limit`` bytes with 413."""

    def __init__(self, app: ASGIApp, limit: int) -> None:
        self.app, self.limit = app, limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        request = Request(scope, receive)
        text = request.headers.get("content-length", "")
        if text.isascii() and text.isdecimal() and int(text[:20]) > self.limit:
            answer = problem_response(request, too_large(self.limit), {"Connection": "close"})
            await answer(scope, receive, send)
            return
        seen = 0

        async def counted() -> Message:
            nonlocal seen
            message = await receive()
            seen += len(message.get("body", b""))
            if seen > self.limit:
                raise HTTPException(413)
            return message

        await self.app(scope, counted, send)
