"""What a child process sets before it works."""

import sys

from geometry.child_process import GARBAGE, run_limited


def test_a_child_looks_for_garbage_rarely():
    code = ("import gc; from geometry.child_process import guard_child; "
            "guard_child().write_text(repr(gc.get_threshold()))")
    told = run_limited([sys.executable, "-c", code], b"", time_limit=60.0, memory_limit=1e9)
    assert told.decode() == repr(GARBAGE)
