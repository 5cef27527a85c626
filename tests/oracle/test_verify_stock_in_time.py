"""The stock stretch by stretch: its end is the machined part, and nothing goes before the tool comes to it."""

import numpy as np
import pytest

from tests.pocket_case import SETUP, TOOL, block, program, text
from verify.checks.program_sequence import read_all
from verify.material.machined_part import LEVELS, machined_stock, stock_in_time
from verify.model import NcProgram
from verify.program.move_times import minutes_of

PART = block()
# looks along -X of the part: its X is Y of the part, its Y is Z, its Z is X
ASIDE = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
SLOT = ["%", "G21 G90 G17 G94 G40 G49 G54 G61", "T1 M6", "S8000 M3", "G0 G43 H1 Z40", "X-9 Y-5", "Z24",
        "G1 Z18 F300", "G1 X9", "G0 Z40", "M5", "M30", "%"]
GIVEN = [NcProgram("pocket", text(program(2.5))), NcProgram("slot", text(SLOT), turn=ASIDE)]


def made(stretches=6, nodes=20_000, given=GIVEN, threads=1):
    read = read_all(given, PART, (TOOL,), SETUP, 0, lambda _share: None)
    return stock_in_time(read, PART, (TOOL,), SETUP, stretches=stretches, nodes=nodes, threads=threads)


@pytest.fixture(scope="module")
def stock():
    return made()


def test_the_last_field_is_the_machined_part(stock):
    whole = machined_stock(GIVEN, PART, (TOOL,), SETUP, stock.step)
    last = stock.after(len(stock.ended))
    assert last.values.shape == whole.values.shape and np.allclose(last.origin, whole.origin)
    assert np.abs(last.values - whole.values).max() <= 0.51 * stock.step / LEVELS
    assert 0.8 * 20_000 < whole.values.size < 1.25 * 20_000


def test_the_first_is_the_blank_and_the_part_lies_in_all(stock):
    bounds = stock.after(0).surface().bounds
    assert np.allclose(bounds, PART.bounds + [[-0.5, -0.5, 0], [0.5, 0.5, 0.5]], atol=0.01)
    assert (stock.part <= stock.first).all()
    inside = stock.part > 0
    assert inside.any() and (stock.after(len(stock.ended)).values[inside] > -0.05 * stock.step).mean() > 0.98


def test_stretches_follow_the_clock_and_take_what_runs_in_them(stock):
    read = read_all(GIVEN, PART, (TOOL,), SETUP, 0, lambda _share: None)
    seconds = [60.0 * float(minutes_of(r.program, r.setup).sum()) for r in read]
    assert (np.diff(stock.ended) > 0).all() and stock.ended[-1] == pytest.approx(sum(seconds))
    x = stock.origin[0] + stock.step * np.arange(stock.first.shape[0])
    for k, until in enumerate(stock.ended, 1):
        side = stock.after(k).values[(x > 18.6) & (x < 19.5)]
        fresh = stock.after(0).values[(x > 18.6) & (x < 19.5)]
        assert np.array_equal(side, fresh) == (until <= seconds[0])
    volumes = [stock.after(k).volume for k in range(len(stock.ended) + 1)]
    assert (np.diff(volumes) < 0).all()


def test_changes_are_few_and_only_downwards(stock):
    assert len(stock.node) < 2 * stock.first.size
    values = stock.first.ravel().astype(int)
    for a, b in zip(stock.begins[:-1], stock.begins[1:], strict=True):
        assert (np.diff(stock.node[a:b]) > 0).all()
        assert (stock.value[a:b] < values[stock.node[a:b]]).all()
        values[stock.node[a:b]] = stock.value[a:b]


def test_any_number_of_threads_and_of_stretches_ends_alike(stock):
    one, many = made(1), made(25, threads=2)
    assert len(one.ended) == 1 and len(many.ended) > 15
    ends = [s.after(len(s.ended)).values for s in (one, many, stock)]
    assert np.array_equal(ends[0], ends[1]) and np.array_equal(ends[0], ends[2])


def test_without_moves_there_is_the_blank():
    none = made(given=[])
    assert len(none.ended) == 0 and len(none.node) == 0 and none.begins.tolist() == [0]
    assert none.after(0).volume == pytest.approx(41 * 31 * 10.5, rel=3e-3)
