"""Progress of proofs rises in small steps, and an exception from it ends them at once, also in long programs."""

import time

import numpy as np
import pytest

from tests.pocket_case import SETUP, TOOL, ZONES, block, program, scored, text
from tests.time_limits import in_time
from verify.material.machined_part import machined_stock
from verify.material.tiles import run_tiles
from verify.prove import prove
from verify.surface.guard_points import gouge_depths

PART = block()
SCORED = scored(PART)


class Stop(Exception):
    """Somebody lost interest."""


def long_program(passes: int = 10) -> str:
    """The right program with its last layer run over and over: about 66 000 moves of a tenth of a mm."""
    lines = program()
    end = lines.index("G0 Z20", 6)
    x = [f"X{v:.2f}" for v in np.linspace(-8, 8, 161)]
    rows = [row for k, y in enumerate(np.linspace(-4, 4, 41))
            for row in (f"Y{y:.2f}", *(x if k % 2 == 0 else x[::-1]))]
    again = ["G1 X-8 Y-4", *rows, "X-7 Y-4", "X-7 Y0"] * passes
    return text([*lines[:end], *again, *lines[end:]])


LONG = long_program()


def test_shares_rise_in_small_steps_to_one():
    told = []
    prove([("pocket", text(program()))], PART, (TOOL,), SETUP, SCORED, ZONES, progress=told.append)
    assert told == sorted(told) and told[-1] == 1.0
    assert len(set(told)) > 60 and np.diff([0.0, *told]).max() < 0.15


def test_reading_alone_is_told_in_small_steps():
    told = []

    def until_read(share):
        told.append(share)
        if share > 0.12:
            raise Stop

    with pytest.raises(Stop):
        prove([("long", LONG)], PART, (TOOL,), SETUP, SCORED, ZONES, progress=until_read)
    assert len([s for s in told if s < 0.12]) > 12 and np.diff(told).max() < 0.03


@pytest.mark.parametrize("share", [0.0, 0.05, 0.2, 0.35, 0.6, 0.8])
def test_a_cancelled_proof_ends_within_a_second(share):
    prove([("pocket", text(program()))], PART, (TOOL,), SETUP, SCORED, ZONES)  # kernels are compiled
    asked, silence = [], [time.monotonic()]

    def progress(done):
        silence.append(time.monotonic())
        if done >= share:
            asked.append(time.monotonic())
            raise Stop

    with pytest.raises(Stop):
        prove([("long", LONG)], PART, (TOOL,), SETUP, SCORED, ZONES, progress=progress)
    assert in_time(time.monotonic() - asked[0], 0.5)
    # a cancel can come at any time: it is seen when progress is told next
    assert in_time(float(np.diff(silence).max()), 1.0)


@pytest.mark.parametrize("share", [0.0, 0.15, 0.5])
def test_a_cancelled_mesh_ends_within_a_second(share):
    asked = []

    def progress(done):
        if done >= share:
            asked.append(time.monotonic())
            raise Stop

    with pytest.raises(Stop):
        machined_stock([("long", LONG)], PART, (TOOL,), SETUP, 0.15, progress=progress)
    assert in_time(time.monotonic() - asked[0], 0.5)


def test_tiles_tell_while_one_runs_and_drop_what_waits():
    started, told = [], []

    def job(k):
        return lambda: (started.append(k), time.sleep(0.6))

    def progress(share):
        told.append(share)
        if len(told) == 3:
            raise Stop

    before = time.monotonic()
    with pytest.raises(Stop):
        run_tiles([job(k) for k in range(50)], 2, progress)
    assert in_time(time.monotonic() - before, 0.55) and told == [0.0] * 3
    time.sleep(0.8)
    assert len(started) <= 4


def test_what_a_tile_raises_comes_through_and_results_keep_their_order():
    def broken():
        raise ValueError("a tile")

    with pytest.raises(ValueError, match="a tile"):
        run_tiles([lambda: 1, broken, *[lambda: 2] * 20], 2)
    assert run_tiles([lambda k=k: (time.sleep(0.01 * (5 - k)), k)[1] for k in range(5)], 3) == list(range(5))
    assert run_tiles([], 2) == []


def test_depths_of_gouges_are_told_in_batches_and_do_not_depend_on_them():
    from geometry.mesh_queries.bvh import TriangleTree

    tree = TriangleTree(PART.mesh)
    s = SCORED.samples
    deep = np.full(len(s), 0.2)
    told = []
    got = gouge_depths(tree, s.points, s.normals, deep, told.append)
    assert told == sorted(told) and told[-1] == 1.0 and len(told) > 5
    pick = np.arange(0, len(s), 997)
    np.testing.assert_array_equal(got[pick], gouge_depths(tree, s.points[pick], s.normals[pick], deep[pick]))
