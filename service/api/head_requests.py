"""HEAD on every path that has GET, except event streams, which never end.

A HEAD request is answered like GET [RFC9110], without the body, so the OpenAPI document needs no operation for it.
"""

from __future__ import annotations

from starlette.types import ASGIApp, Message, Receive, Scope, Send


def is_stream(path: str) -> bool:
    """Whether a path is an event stream."""
    return path.endswith("/events")


class HeadMiddleware:
    """Turns HEAD into GET and sends only the head of the answer."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http" or scope["method"] != "HEAD" or is_stream(scope["path"]):
            await self.app(scope, receive, send)
            return

        async def without_body(message: Message) -> None:
            await send({**message, "body": b""} if message["type"] == "http.response.body" else message)

        # Range is defined for GET only (RFC 9110, 14.2)
        headers = [(k, v) for k, v in scope["headers"] if k != b"range"]
        await self.app({**scope, "method": "GET", "headers": headers}, receive, without_body)
