"""Limit on request bodies, by Content-Length before a byte is read, otherwise by counting during the transfer.

Forms with files may be large and go to disk. Every other body is JSON. The framework reads it into memory before it
checks the key, so JSON has a smaller limit. The framework's own limit answers in plain text; this one lets the error
handlers answer as problem+json.
"""

from __future__ import annotations

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.problems import BODY_LIMIT, problem_response, too_large

FORMS = ("/v1/jobs", "/v1/zones", "/v1/verifications", "/v1/tools:import")
LARGEST_JSON = 1_000_000  # bytes, ten times a tool with the finest profile


class BodyLimitMiddleware:
    """Refuses forms of more than ``limit`` bytes, and other bodies of more than ``LARGEST_JSON``, with 413."""

    def __init__(self, app: ASGIApp, limit: int) -> None:
        self.app, self.limit = app, limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        limit = self.limit if scope["path"] in FORMS else min(self.limit, LARGEST_JSON)
        scope[BODY_LIMIT] = limit
        request = Request(scope, receive)
        text = request.headers.get("content-length", "")
        if text.isascii() and text.isdecimal() and int(text[:20]) > limit:
            answer = problem_response(request, too_large(limit), {"Connection": "close"})
            await answer(scope, receive, send)
            return
        seen = 0

        async def counted() -> Message:
            nonlocal seen
            message = await receive()
            seen += len(message.get("body", b""))
            if seen > limit:
                raise HTTPException(413)
            return message

        await self.app(scope, counted, send)
