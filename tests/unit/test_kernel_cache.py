"""Compiled kernels never outlive a source they were compiled from, though numba looks at one file only."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
import time

import pytest

from geometry.kernels.cache import BESIDE, PACKAGES, bases, kernel_sources, remove_stale, sources_digest
from tests.source_tree import ROOT, imports, modules

INNER = "from numba import njit\n\n\n@njit(cache=True)\ndef inner(x):\n    return x + {addend}\n"
OUTER = ("from numba import njit\n\nfrom verify.kernels.inner import inner\n\n\n"
         "@njit(cache=True)\ndef outer(x):\n    return 2.0 * inner(x)\n")
RUN = ("import numba, os; from verify.kernels.outer import outer; print(outer(1.0)); "
       "print(sum(outer.stats.cache_hits.values())); print(numba.config.CACHE_DIR)")


def _copied(tmp_path):
    for path in kernel_sources():
        target = tmp_path / path.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    return tmp_path


def test_every_compiled_function_of_the_product_is_in_the_digest_and_behind_the_key():
    known = {".".join(p.relative_to(ROOT).with_suffix("").parts) for p in kernel_sources()}
    for name, tree in modules():
        if any(target.split(".")[:2] in (["numba", "njit"], ["numba", "jit"]) for target, _ in imports(tree)):
            assert name in known, f"{name} compiles functions; add it to geometry/kernels/cache.py"
    trees = dict(modules())
    for name in [*(f"{p}.kernels.__init__" for p in PACKAGES), *(b[:-3].replace("/", ".") for b in BESIDE)]:
        first = [n for n in trees[name].body if isinstance(n, ast.Import)]
        assert "geometry.kernels.cache" in {a.name for n in first for a in n.names}, name
    assert {p.parent.parent.name for p in kernel_sources() if p.parent.name == "kernels"} == {
        n.split(".")[0] for n, _ in modules() if "kernels" in n.split(".")}


def test_one_byte_of_any_kernel_changes_the_digest(tmp_path):
    root = _copied(tmp_path)
    seen = {sources_digest(ROOT)}
    assert sources_digest(root) in seen
    for path in kernel_sources(root):
        before = path.read_bytes()
        path.write_bytes(before + b"\n")
        seen.add(sources_digest(root))
        path.write_bytes(before)
    assert len(seen) == 1 + len(kernel_sources(root)) and sources_digest(root) in seen
    (root / "verify" / "kernels" / "rays.py").rename(root / "verify" / "kernels" / "beams.py")
    assert sources_digest(root) not in seen
    assert all(len(d) == 16 for d in seen)


def _outer_of(root, cache_dir, addend):
    """2 (1 + addend) as a new process computes it, the cache hits it had, and its cache folder."""
    (root / "verify" / "kernels" / "inner.py").write_text(INNER.format(addend=addend))
    env = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    env |= {"PYTHONPATH": str(root), "PYTHONDONTWRITEBYTECODE": "1"}
    env |= {"NUMBA_CACHE_DIR": str(cache_dir)} if cache_dir else {}
    run = subprocess.run([sys.executable, "-c", RUN], cwd=root, env=env, capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    value, hits, folder = run.stdout.splitlines()
    return float(value), int(hits), folder


@pytest.mark.parametrize("given", [True, False], ids=["NUMBA_CACHE_DIR", "in the tree"])
def test_a_kernel_follows_the_kernel_it_takes_from_another_file(tmp_path, given):
    root, cache_dir = tmp_path / "tree", tmp_path / "cache" if given else None
    for name in ("geometry/kernels/cache.py", "geometry/kernels/__init__.py", "verify/kernels/__init__.py"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, root / name)
    (root / "verify" / "kernels" / "outer.py").write_text(OUTER)
    base = cache_dir or root / "geometry" / "kernels" / "__pycache__" / "numba"

    value, hits, old = _outer_of(root, cache_dir, 1.0)
    assert (value, hits, old) == (4.0, 0, str(base / sources_digest(root)))
    value, hits, new = _outer_of(root, cache_dir, 5.0)
    assert (value, hits, new) == (12.0, 0, str(base / sources_digest(root)))
    if given:
        assert _outer_of(root, cache_dir, 1.0) == (4.0, 1, old)  # nothing was lost by it
        # numba alone answers with the machine code of before: what the key is for
        (root / "verify" / "kernels" / "__init__.py").write_text("")
        assert _outer_of(root, cache_dir, 1.0)[:2] == (4.0, 0)
        assert _outer_of(root, cache_dir, 5.0) == (4.0, 1, str(cache_dir))


def test_bases_are_the_places_of_numba_in_its_order(tmp_path):
    tree, home = bases("", tmp_path)
    assert tree.is_relative_to(tmp_path) and "__pycache__" in tree.parts and not home.is_relative_to(tmp_path)
    assert bases("elsewhere", tmp_path)[1:] == [tree, home]


def test_folders_of_other_states_go_after_a_day_ours_never(tmp_path):
    ours, old, young = (tmp_path / (c * 16) for c in "abc")
    foreign, looks_like = tmp_path / "kernels_0123", tmp_path / ("d" * 16)
    for folder in (ours, old, young, foreign):
        (folder / "inside").mkdir(parents=True)
        (folder / "inside" / "file.nbc").write_bytes(b"x")
    looks_like.write_text("a file")
    past = time.time() - 90000
    for path in (ours, old, foreign, looks_like):
        os.utime(path, (past, past))
    assert remove_stale(ours) == [old]
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(p.name for p in (ours, young, foreign, looks_like))
