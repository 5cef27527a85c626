"""What a child process sets before it works, and how it gets its request."""

import sys
import threading
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from geometry.child_process import GARBAGE, run_limited
from geometry.errors import ResourceError

ECHO = ("import sys; from geometry.child_process import guard_child; "
        "guard_child().write_bytes(sys.stdin.buffer.read()[::-1])")


def test_a_child_looks_for_garbage_rarely():
    code = ("import gc; from geometry.child_process import guard_child; "
            "guard_child().write_text(repr(gc.get_threshold()))")
    told = run_limited([sys.executable, "-c", code], b"", time_limit=60.0, memory_limit=1e9)
    assert told.decode() == repr(GARBAGE)


def echo(request, stop=None):
    return run_limited([sys.executable, "-c", ECHO], request, time_limit=60.0, memory_limit=1e9, stop=stop)


def test_a_child_waits_for_a_request_that_comes_later():
    request = Future()
    with ThreadPoolExecutor(1) as pool:
        told = pool.submit(echo, request)
        long = bytes(range(256)) * 1000  # more than a pipe holds
        request.set_result(long)
        assert told.result() == long[::-1] == echo(long)


def test_a_child_whose_request_does_not_come_is_stopped():
    stop = threading.Event()
    with ThreadPoolExecutor(1) as pool:
        told = pool.submit(echo, Future(), stop)
        stop.set()
        with pytest.raises(ResourceError):
            told.result()
