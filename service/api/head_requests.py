"""HEAD on every path that has GET, but for event streams, which never end.

The request is answered as a GET whose body is dropped, so the OpenAPI document needs no operation of its own.
"""

from __future__ import annotations

from starlette.types import ASGIApp, Message, Receive, Scope, Send


def is_stream(path: str) -> bool:
    """Whether a path is a stream of events."""
    return path.endswith("/events")


class HeadMiddleware:
    """Turns HEAD into GET and sends the head of the answer alone."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http" or scope["method"] != "HEAD" or is_stream(scope["path"]):
            await self.app(scope, receive, send)
            return

        async def without_body(message: Message) -> None:
            await send({**message, "body": b""} if message["type"] == "http.response.body" else message)

        headers = [(k, v) for k, v in scope["headers"] if k != b"range"]  # parts are for GET alone (RFC 9110, 14.2)
        await self.app({**scope, "method": "GET", "headers": headers}, receive, without_body)
