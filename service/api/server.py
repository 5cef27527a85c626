"""Runs the application under uvicorn, in the foreground or in a thread for the demo."""

from __future__ import annotations

import os
import signal
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

import structlog
import uvicorn

from geometry.errors import CamError, SetupError
from service.api.app import create_app
from service.errors import UnavailableError
from service.logs import configure
from service.settings import Settings, settings_of

log = structlog.get_logger(__name__)


def settings_with(given: dict[str, Any]) -> Settings:
    """Settings from the environment, overridden by those given in code; None is not given.

    Raises
    ------
    SetupError
        A setting has an invalid value.
    """
    return settings_of(Settings, given)


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio sends small answers at once (TCP_NODELAY) only where the socket states the protocol TCP;
    # otherwise an answer on a kept-alive connection waits 40 ms for the delayed acknowledgement of the other side.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise SetupError(f"cannot listen on {host}:{port}: {error.strerror}", code="cannot_listen",
                         remedy="use another --port; 0 is any free port") from None
    return listener


class _Server(uvicorn.Server):
    """Ends open event streams as soon as the server has to stop."""

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """SIGINT or SIGTERM came."""
        self.config.app.state.stopping.set()  # type: ignore[union-attr]
        super().handle_exit(sig, frame)

    def startup_error(self) -> CamError:
        """The reason why it did not start."""
        known: CamError | None = self.config.app.state.startup_error  # type: ignore[union-attr]
        return known or UnavailableError("the service did not start; the log says why", code="did_not_start")


def _server(settings: Settings, chain: str = "service.pipeline") -> _Server:
    return _Server(uvicorn.Config(create_app(settings, chain), log_config=None, access_log=False,
                                  timeout_graceful_shutdown=5))


def run_server(settings: Settings, chain: str = "service.pipeline") -> None:
    """Serve until SIGINT or SIGTERM; running jobs return to the queue.

    chain : see ``create_app``

    Raises
    ------
    SetupError
        The port or the data folder is in use, or the service is exposed without keys.
    """
    configure(settings.log_level, settings.log_format)
    listener = _listen(settings.host, settings.port)
    host, port = listener.getsockname()[:2]
    log.info("serving", url=f"http://{host}:{port}", data=str(settings.data_dir), pid=os.getpid())
    server = _server(settings, chain)
    try:
        server.run(sockets=[listener])
    except KeyboardInterrupt:
        log.info("stopped")  # uvicorn raises the signal again after the shutdown
    except SystemExit:
        raise server.startup_error() from None  # uvicorn does this when the application did not start


def _run_quietly(server: _Server, listener: socket.socket) -> None:
    try:
        server.run(sockets=[listener])
    except SystemExit:
        pass  # ``startup_error`` gives the reason to the caller


@contextmanager
def background(settings: Settings, chain: str = "service.pipeline") -> Iterator[str]:
    """Serve in a thread; yields the base URL.

    Raises
    ------
    UnavailableError
        The service did not start.
    SetupError
        The port is in use.
    """
    listener = _listen(settings.host, settings.port)
    server = _server(settings, chain)
    thread = threading.Thread(target=_run_quietly, args=(server, listener), name="server", daemon=True)
    thread.start()
    try:
        while not server.started:
            if not thread.is_alive():
                raise server.startup_error()
            time.sleep(0.02)
        yield f"http://{settings.host}:{listener.getsockname()[1]}"
    finally:
        server.config.app.state.stopping.set()  # type: ignore[union-attr]
        server.should_exit = True
        thread.join(timeout=20)


def wait_for_interrupt() -> None:
    """Sleep until Ctrl-C."""
    stop = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: stop.set())
    stop.wait()
