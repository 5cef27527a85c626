"""What a child process sets before it works, and how it gets its request."""

import subprocess
import sys
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from geometry.child_process import GARBAGE, Family, run_limited
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


def test_a_child_hands_over_a_first_result_and_goes_on():
    code = ("import sys; from geometry.child_process import guard_child, hand_over; r = guard_child(); "
            "hand_over(r, b'first'); sys.stdin.buffer.read(); r.write_bytes(b'last')")
    told = []
    last = run_limited([sys.executable, "-c", code], b"", time_limit=60.0, memory_limit=1e9, early=told.append)
    assert (told, last) == ([b"first"], b"last")


def hoarding(megabytes):
    """Code that takes memory and keeps it."""
    return f"import time; kept = bytearray(b'x') * ({megabytes} << 20); time.sleep(60)"


def test_memory_of_a_descendant_counts():
    code = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {hoarding(400)!r}])"
    with pytest.raises(ResourceError) as told:
        run_limited([sys.executable, "-c", code], b"", time_limit=60.0, memory_limit=3e8)
    assert told.value.code == "reader_memory" and told.value.measured > 3e8


def test_a_family_is_as_large_as_its_members_and_nothing_once_it_has_ended():
    child = subprocess.Popen([sys.executable, "-c", hoarding(50)])
    try:
        family, least = Family(child.pid), 50 << 20
        deadline = time.monotonic() + 30.0
        while family.resident() < least and time.monotonic() < deadline:
            time.sleep(0.05)
        assert least <= family.resident() < least + 1e8
    finally:
        child.kill()
        child.wait()
    assert family.resident() == 0
