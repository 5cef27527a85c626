"""Logging: structlog to stderr, every line with the id of its request."""

from __future__ import annotations

import logging
import re
import sys
from collections.abc import MutableMapping
from contextlib import suppress
from typing import Any, TextIO, cast

import structlog
from asgi_correlation_id import correlation_id


def _request_id(_logger: Any, _name: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
    if request_id := correlation_id.get():
        event["request_id"] = request_id
    return event


_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029]")


def _harmless(_logger: Any, _name: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
    """Make text from outside harmless in the log.

    Control characters are escaped, so that text cannot make lines or colours. Tracebacks stand behind a bar.
    """
    for key, value in event.items():
        if isinstance(value, str):
            text = _CONTROL.sub(lambda m: ascii(m[0])[1:-1], value)
            event[key] = text.replace("\n", "\n    | ") if key in ("exception", "stack") else text.replace("\n", "\\n")
    return event


class _Stderr:
    """The current stderr; a closed or full stderr must not stop the program."""

    def write(self, text: str) -> int:
        with suppress(OSError, ValueError):
            sys.stderr.write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            sys.stderr.flush()


STDERR = cast(TextIO, _Stderr())


def configure_once(level: str, form: str) -> None:
    """Configure logging in a process that has not done so, such as a cluster worker.

    The default of structlog writes to stdout in colours, and shows the values of all variables with a traceback.
    """
    if not structlog.is_configured():
        configure(level, form)


def configure(level: str, form: str) -> None:
    """Send the log to stderr. level: 'debug' ... 'error'; form: 'console' or 'json'."""
    number = getattr(logging, level.upper())
    renderer = structlog.processors.JSONRenderer() if form == "json" else structlog.dev.ConsoleRenderer(
        colors=sys.stderr.isatty())
    common: list[Any] = [_request_id, structlog.processors.add_log_level,
                         structlog.processors.TimeStamper(fmt="iso", utc=True), structlog.processors.format_exc_info,
                         *([] if form == "json" else [_harmless])]
    others = logging.StreamHandler(STDERR)  # messages of libraries, in the same form
    others.setFormatter(structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=[structlog.stdlib.add_logger_name, *common],
        processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, renderer]))
    logging.basicConfig(handlers=[others], level=max(number, logging.WARNING))
    for noisy in ("distributed", "dask", "alembic", "asyncio", "uvicorn"):
        logging.getLogger(noisy).setLevel(logging.ERROR)
    structlog.configure(
        processors=[structlog.contextvars.merge_contextvars, *common, renderer],
        wrapper_class=structlog.make_filtering_bound_logger(number),
        logger_factory=structlog.PrintLoggerFactory(STDERR), cache_logger_on_first_use=False)
