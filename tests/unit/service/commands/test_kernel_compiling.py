"""The kernels that ``zonemill warm`` compiles on all cores: their list fits the sources, a stale one harms nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from numba import typeof, types

from geometry.kernels.bvh import TreeArrays
from service.commands.kernel_compiling import (
    LIST,
    Listed,
    _Order,
    compile_listed,
    kernel_of,
    read_list,
    text_of,
    to_compile,
    type_of,
)
from tests.source_tree import ROOT

REWRITE = "write the list again: make kernels"

USED = """
import json, sys, tempfile
from pathlib import Path
from examples.demo import write_small
from geometry.kernel_cache.cache import sources
from service.commands.kernel_compiling import compile_listed, text_of
from service.from_wire import read_setup
from service.pipeline import plan
compile_listed(lambda done, of, left: None)
with tempfile.TemporaryDirectory() as folder:
    step, setup = write_small(folder)
    assert plan(step, read_setup(setup), Path(folder, "out"), lambda stage, share: None)["state"] == "proved"
used = []
for name in sources().compiled():
    for own, kernel in vars(sys.modules.get(name, sys)).items():
        if getattr(getattr(kernel, "py_func", None), "__module__", None) == name:
            used += [[f"{name}.{own}", [text_of(t) for t in arguments]] for arguments in kernel.overloads]
print(json.dumps(used))
"""

TRIVIAL = """
from numba import njit
import geometry.kernel_cache.cache

@njit(cache=True)
def inner(x):
    return x + 1.0

@njit(cache=True)
def outer(x):
    return 2.0 * inner(x)
"""


@pytest.mark.timeout(1800)
@pytest.mark.slow
def test_the_list_holds_all_that_the_small_part_calls():
    run = subprocess.run([sys.executable, "-c", USED], cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)},
                         capture_output=True, text=True, timeout=1500)
    assert run.returncode == 0, run.stderr
    used = json.loads(run.stdout.splitlines()[-1])
    listed = [[e.kernel, list(e.arguments)] for e in read_list()]
    assert len(used) > 30
    assert [u for u in used if u not in listed] == [], REWRITE


def test_every_entry_fits_the_sources():
    for listed in read_list():
        kernel, arguments = kernel_of(listed)
        assert len(arguments) == kernel.py_func.__code__.co_argcount, f"{listed.kernel}: {REWRITE}"


def test_callees_stand_before_callers():
    for place, listed in enumerate(read_list()):
        assert all(0 <= c < place for c in listed.calls), listed.kernel


@pytest.mark.parametrize("kind", [
    types.float64, types.boolean, types.int64,
    typeof(np.zeros((2, 2))), typeof(np.zeros((2, 2))[::2, ::2]), typeof(np.zeros(3, np.bool_)),
    typeof((1.0, 2.0, 3.0)), typeof((1, 2.0)), types.Array(types.float64, 2, "C", readonly=True),
    typeof(TreeArrays(*(np.zeros(1),) * len(TreeArrays._fields))),
])
def test_a_type_comes_back_from_its_text(kind):
    assert type_of(json.loads(json.dumps(text_of(kind)))) == kind


def test_a_type_without_text_is_refused():
    with pytest.raises(ValueError, match="no text"):
        text_of(types.unicode_type)


@pytest.mark.parametrize("kernel, arguments", [
    ("verify.kernels.gone.kernel", ["float64"]),
    ("geometry.kernels.bvh.gone", ["float64"]),
    ("geometry.kernels.bvh.TreeArrays", ["float64"]),
    ("geometry.kernels.bvh.facet_rows", ["complex7"]),
    ("geometry.kernels.bvh.facet_rows", [{"geometry.kernels.bvh.TreeArrays": ["float64"]}]),
])
def test_an_entry_that_fits_no_more_is_passed_over(kernel, arguments):
    stale = [Listed(kernel, tuple(arguments), 1.0, ())]
    assert to_compile(stale) == []
    compile_listed(lambda done, of, left: None, stale)


def test_the_longest_way_to_the_end_comes_first():
    kernels = [Listed("a", (), 1.0, ()), Listed("b", (), 1.5, ()), Listed("c", (), 5.0, (0,)), Listed("d", (), 2.0, ())]
    order = _Order(kernels, {0, 1, 2, 3})
    assert [order.pop(), order.pop(), order.pop(), order.pop()] == [0, 3, 1, None]
    order.done(0)
    assert order.pop() == 2
    assert order.seconds_left(1.0, 2) > 0.0


def test_processes_compile_what_is_listed_into_the_cache(tmp_path):
    """In a tree of its own: an entry that cannot be compiled for its types stops none of the others."""
    code = """
from service.commands.kernel_compiling import Listed, compile_listed, to_compile
listed = [Listed("trivial.inner", ("float64",), 1.0, ()), Listed("trivial.inner", (["float64", "int64"],), 1.0, ()),
          Listed("trivial.outer", ("float64",), 1.0, (0,))]
told = []
compile_listed(lambda *t: told.append(t), listed, 2)
print(to_compile(listed), told[-1][:2])
import trivial
print(trivial.outer(1.0), sum(trivial.outer.stats.cache_hits.values()))
"""
    (tmp_path / "trivial.py").write_text(TRIVIAL)
    env = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}", "NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=env, capture_output=True, text=True,
                         timeout=300)
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[0] == "[1] (3, 3)"
    assert run.stdout.splitlines()[1] == "4.0 1"


def test_the_list_is_package_data():
    assert LIST.name in (p.name for p in (ROOT / "service" / "commands").glob("*.json"))
    assert '"**/*.json"' in (ROOT / "pyproject.toml").read_text()
