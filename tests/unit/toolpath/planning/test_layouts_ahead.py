"""Layouts computed by other threads: the same plan, nothing computed twice, failures where they are asked for."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import numba
import numpy as np
import pytest

from tests.hand_parts import ball, low_walls, plan_part
from toolpath.planning import layouts_ahead
from toolpath.planning.layouts_ahead import computed_ahead, side_by_side
from toolpath.planning.zone_layout import Once

ROOT = Path(__file__).resolve().parents[4]


class Counted:
    """A layout that counts in which thread its parts are computed."""

    def __init__(self, fails: bool = False) -> None:
        self.by: list[str] = []
        self.usual, self.borders = Once(lambda: self._made(fails)), Once(lambda: self._made(False))

    def _made(self, fails: bool) -> int:
        self.by.append(threading.current_thread().name)
        if fails:
            raise ValueError("no passes")
        assert numba.get_num_threads() == 1
        return len(self.by)

    def compute_usual(self) -> None:
        self.usual()

    def compute_along_borders(self) -> None:
        self.borders()


def test_parts_are_computed_once_by_another_thread(two_threads):
    layouts = [Counted() for _ in range(3)]
    with computed_ahead(layouts):
        for layout in layouts:
            layout.usual()
            layout.borders()
    assert all(len(layout.by) == 2 for layout in layouts)
    assert numba.get_num_threads() == 2


def test_with_one_thread_nothing_is_computed_before_it_is_asked_for():
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        layout = Counted()
        with computed_ahead([layout]):
            pass
        assert layout.by == [] and layout.borders() == 1
    finally:
        numba.set_num_threads(before)


def test_a_failure_is_met_by_whoever_asks(two_threads):
    layout = Counted(fails=True)
    with computed_ahead([layout]):
        layout.borders()
        with pytest.raises(ValueError, match="no passes"):
            layout.usual()


def test_an_error_of_the_plan_ends_the_other_threads(two_threads):
    with pytest.raises(KeyError), computed_ahead([Counted() for _ in range(50)]):
        raise KeyError
    assert not [t for t in threading.enumerate() if t.name.startswith("layout")]
    assert numba.get_num_threads() == 2


def test_calls_side_by_side_keep_their_order():
    assert side_by_side([lambda k=k: k * k for k in range(4)]) == [0, 1, 4, 9]


@pytest.mark.slow
def test_a_plan_has_the_same_bytes_with_one_thread_and_with_several(two_threads, monkeypatch):
    def ways() -> list[bytes]:
        c = plan_part(low_walls(), [ball(2.5), ball(1.5, "T2")])
        return [np.ascontiguousarray(t.points).tobytes() for s in c.plan.steps for t in s.trajectories]

    several = ways()
    monkeypatch.setattr(layouts_ahead.numba, "get_num_threads", lambda: 1)
    assert several and ways() == several


@pytest.mark.slow
def test_threads_of_a_plan_keep_out_of_the_threading_layer_of_numba():
    """The layer that numba has everywhere ends a process that two threads enter at once."""
    code = ("import numba; from tests.hand_parts import ball, low_walls, plan_part; numba.set_num_threads(2);"
            "plan_part(low_walls(), [ball(2.5), ball(1.5, 'T2')])")
    env = {**os.environ, "NUMBA_THREADING_LAYER": "workqueue", "NUMBA_NUM_THREADS": "2"}
    done = subprocess.run([sys.executable, "-c", code], env=env, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
